//! What every request passes through: request id and log line, admission, CORS, JSON bodies.

use std::sync::Arc;
use std::time::Instant;

use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{FromRequest, MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde::de::DeserializeOwned;
use tower_http::cors::{AllowOrigin, CorsLayer};
use tracing::Instrument;

use crate::App;
use crate::config::Config;
use crate::datasets::storage::random_hex;
use crate::datasets::uploads;
use crate::problem::{Answer, Fault};

/// Carries the request's id in the answer; the log's lines carry it too.
const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
/// Random bytes of a request id.
const REQUEST_ID_BYTES: usize = 8;

/// Middleware: gives each request an id and logs how it ended. Addresses are logged as route
/// templates: a file name in one may name a patient.
pub async fn traced(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let id = random_hex(REQUEST_ID_BYTES).unwrap_or_default();
    let route = request.extensions().get::<MatchedPath>().map_or("page", MatchedPath::as_str).to_owned();
    let method = request.method().clone();
    let began = Instant::now();
    let span = tracing::info_span!("request", id, %method, route = route.as_str());
    let mut response = next.run(request).instrument(span.clone()).await;
    let _entered = span.entered();
    let took = began.elapsed();
    app.metrics().request(method.as_str(), &route, response.status(), took);
    let millis = took.as_secs_f64() * 1e3;
    tracing::debug!(status = response.status().as_u16(), millis, "answered");
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(REQUEST_ID, value);
    }
    let headers = response.headers_mut();
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    response
}

/// Middleware: no more requests at once than `limits.max_requests`.
pub async fn admit(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    match app.requests.try_acquire() {
        Ok(_permit) => next.run(request).await,
        Err(_) => {
            let most = app.config().limits.max_requests;
            Fault::busy(format!("{most} requests are being answered (`limits.max_requests`)."))
                .into_response()
        }
    }
}

/// What pages of listed origins may read and send.
pub fn cors(config: &Config) -> CorsLayer {
    let origins = config.allowed_origins.iter().filter_map(|origin| origin.parse().ok());
    let exposed: Vec<_> = [REQUEST_ID, header::LOCATION, header::RETRY_AFTER]
        .into_iter()
        .chain(uploads::RESPONSE_HEADERS)
        .collect();
    CorsLayer::new()
        .allow_origin(AllowOrigin::list(origins))
        .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::PATCH, Method::DELETE])
        .allow_headers([header::CONTENT_TYPE].into_iter().chain(uploads::REQUEST_HEADERS).collect::<Vec<_>>())
        .expose_headers(exposed)
}

/// The answer to addresses that nothing answers to.
pub async fn nothing_here() -> Fault {
    Fault::not_found("There is nothing at this address; GET /api/v1/openapi.json lists what there is.")
}

/// A body of at most so many bytes.
///
/// # Errors
/// It is longer, which is told with the limit's name, or broke off.
pub async fn whole_body(body: Body, most: usize, what: &str, limit: &str) -> Answer<Bytes> {
    to_bytes(body, most).await.map_err(|error| {
        let too_long = std::error::Error::source(&error)
            .is_some_and(|source| source.to_string().contains("length limit"));
        if too_long {
            Fault::too_large(format!("{what} may have {most} bytes (`{limit}`)."))
        } else {
            Fault::bad_request(format!("The body broke off: {error}."))
        }
    })
}

/// A JSON body within `limits.max_json_bytes`; errors name the field.
pub struct Json<T>(pub T);

impl<T: DeserializeOwned + Send + 'static> FromRequest<Arc<App>> for Json<T> {
    type Rejection = Fault;

    async fn from_request(request: Request, app: &Arc<App>) -> Result<Self, Fault> {
        let most = app.config().limits.max_json_bytes;
        let body = whole_body(request.into_body(), most, "A JSON body", "limits.max_json_bytes").await?;
        // A body of megabytes takes milliseconds to decode.
        crate::blocking("decoding a body", move || {
            let text =
                std::str::from_utf8(&body).map_err(|_| Fault::bad_request("The body is not UTF-8."))?;
            proto::field::from_json(text).map(Json).map_err(|error| {
                if error.field.is_empty() { Fault::bad_request(error.message) } else { error.into() }
            })
        })
        .await?
    }
}
