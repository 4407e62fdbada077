//! Errors as problem documents (RFC 9457).

use axum::body::{Body, to_bytes};
use axum::extract::Request;
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use proto::FieldError;
use proto::rest::Problem;

/// Media type of a problem document.
pub const PROBLEM_MEDIA_TYPE: &str = "application/problem+json";
/// Seconds after which a busy service may be asked again.
const RETRY_AFTER_SECONDS: u32 = 10;
/// Longest plain-text error body that is taken over into a problem document.
const MAX_FOREIGN_DETAIL_BYTES: usize = 4096;

/// A failed request: its problem document and what else the answer needs.
#[derive(Debug, Clone)]
pub struct Fault {
    /// The document.
    pub problem: Problem,
    retry: bool,
}

/// Result of a request handler.
pub type Answer<T> = Result<T, Fault>;

impl Fault {
    /// A fault of a kind; the kind's title is looked up.
    fn new(kind: Kind, detail: impl Into<String>) -> Self {
        let (status, name, title) = kind.parts();
        Self {
            problem: Problem {
                kind: format!("/problems/{name}"),
                title: title.into(),
                status: status.as_u16(),
                detail: detail.into(),
                field: None,
            },
            retry: status == StatusCode::SERVICE_UNAVAILABLE,
        }
    }

    /// There is no such thing.
    pub fn not_found(detail: impl Into<String>) -> Self {
        Self::new(Kind::NotFound, detail)
    }

    /// The request as a whole cannot be understood.
    pub fn bad_request(detail: impl Into<String>) -> Self {
        Self::new(Kind::BadRequest, detail)
    }

    /// One field is wrong.
    pub fn invalid(field: impl Into<String>, detail: impl Into<String>) -> Self {
        let mut fault = Self::new(Kind::InvalidField, detail);
        fault.problem.field = Some(field.into()).filter(|field| !field.is_empty());
        fault
    }

    /// An uploaded file that no reader accepts; `detail` holds the reader's words.
    pub fn unreadable_file(detail: impl Into<String>) -> Self {
        Self::new(Kind::UnreadableFile, detail)
    }

    /// The caller may not do this.
    pub fn forbidden(detail: impl Into<String>) -> Self {
        Self::new(Kind::Forbidden, detail)
    }

    /// The body is larger than a limit.
    pub fn too_large(detail: impl Into<String>) -> Self {
        Self::new(Kind::TooLarge, detail)
    }

    /// The client stopped sending.
    pub fn timed_out(detail: impl Into<String>) -> Self {
        Self::new(Kind::RequestTimeout, detail)
    }

    /// A limit on how much is taken on at once is reached.
    pub fn busy(detail: impl Into<String>) -> Self {
        Self::new(Kind::Busy, detail)
    }

    /// No room for another dataset.
    pub fn storage_full(detail: impl Into<String>) -> Self {
        Self::new(Kind::StorageFull, detail)
    }

    /// The file system refuses: 507 where it is full, otherwise [`Fault::internal`].
    pub fn disk(doing: &str, error: &std::io::Error) -> Self {
        use std::io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        if !matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge) {
            return Self::internal(doing, error);
        }
        tracing::error!(%error, "no room while {doing}");
        Self::storage_full(format!(
            "The disk of the service is full: no room while {doing}. Delete datasets, or make room on the server, and try again."
        ))
    }

    /// The thing was there and is not any more.
    pub fn gone(detail: impl Into<String>) -> Self {
        Self::new(Kind::Gone, detail)
    }

    /// The request and the state of the thing do not fit together.
    pub fn conflict(detail: impl Into<String>) -> Self {
        Self::new(Kind::Conflict, detail)
    }

    /// Another request holds the thing.
    pub fn locked(detail: impl Into<String>) -> Self {
        Self::new(Kind::Locked, detail)
    }

    /// The body is of a type that is not taken here.
    pub fn unsupported_media(detail: impl Into<String>) -> Self {
        Self::new(Kind::UnsupportedMedia, detail)
    }

    /// The client speaks another version of a protocol.
    pub fn wrong_version(detail: impl Into<String>) -> Self {
        Self::new(Kind::WrongVersion, detail)
    }

    /// What arrived is not what was sent.
    pub fn checksum_mismatch(detail: impl Into<String>) -> Self {
        Self::new(Kind::ChecksumMismatch, detail)
    }

    /// Drawing took too long.
    pub fn too_slow(detail: impl Into<String>) -> Self {
        Self::new(Kind::TooSlow, detail)
    }

    /// Something failed that the caller cannot help; the cause is logged, not told.
    pub fn internal(doing: &str, cause: &dyn std::fmt::Display) -> Self {
        tracing::error!(%cause, "failed while {doing}");
        Self::new(Kind::Internal, format!("Something failed while {doing}; the server's log says more."))
    }

    /// The status of the answer.
    pub fn status(&self) -> StatusCode {
        StatusCode::from_u16(self.problem.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
    }

    /// The fault as a field error, for viewers.
    pub fn as_field_error(&self) -> FieldError {
        FieldError::new(self.problem.field.clone().unwrap_or_default(), self.problem.detail.clone())
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.as_field_error().fmt(formatter)
    }
}

/// Kinds of problem; the names are part of the interface.
#[derive(Debug, Clone, Copy)]
enum Kind {
    NotFound,
    BadRequest,
    InvalidField,
    UnreadableFile,
    Forbidden,
    TooLarge,
    RequestTimeout,
    Busy,
    StorageFull,
    TooSlow,
    Gone,
    Conflict,
    Locked,
    UnsupportedMedia,
    WrongVersion,
    ChecksumMismatch,
    Internal,
}

impl Kind {
    fn parts(self) -> (StatusCode, &'static str, &'static str) {
        match self {
            Kind::NotFound => (StatusCode::NOT_FOUND, "not-found", "Not found"),
            Kind::BadRequest => (StatusCode::BAD_REQUEST, "bad-request", "Request not understood"),
            Kind::InvalidField => (StatusCode::UNPROCESSABLE_ENTITY, "invalid-field", "A field is not valid"),
            Kind::UnreadableFile => {
                (StatusCode::UNPROCESSABLE_ENTITY, "unreadable-file", "The file cannot be read as a volume")
            }
            Kind::Forbidden => (StatusCode::FORBIDDEN, "forbidden", "Not allowed"),
            Kind::TooLarge => (StatusCode::PAYLOAD_TOO_LARGE, "too-large", "Too large"),
            Kind::RequestTimeout => {
                (StatusCode::REQUEST_TIMEOUT, "request-timeout", "The request stopped arriving")
            }
            Kind::Busy => (StatusCode::SERVICE_UNAVAILABLE, "busy", "Busy"),
            Kind::StorageFull => (StatusCode::INSUFFICIENT_STORAGE, "storage-full", "No storage left"),
            Kind::TooSlow => (StatusCode::GATEWAY_TIMEOUT, "too-slow", "Drawing took too long"),
            Kind::Gone => (StatusCode::GONE, "gone", "No longer there"),
            Kind::Conflict => (StatusCode::CONFLICT, "conflict", "Does not fit what is there"),
            Kind::Locked => (StatusCode::LOCKED, "locked", "In use"),
            Kind::UnsupportedMedia => {
                (StatusCode::UNSUPPORTED_MEDIA_TYPE, "unsupported-media-type", "Not taken in this form")
            }
            Kind::WrongVersion => {
                (StatusCode::PRECONDITION_FAILED, "wrong-version", "Another version of the protocol")
            }
            Kind::ChecksumMismatch => (checksum_mismatch(), "checksum-mismatch", "Damaged on the way"),
            Kind::Internal => (StatusCode::INTERNAL_SERVER_ERROR, "internal", "Internal error"),
        }
    }
}

/// Status 460, which tus defines.
fn checksum_mismatch() -> StatusCode {
    StatusCode::from_u16(460).unwrap_or(StatusCode::BAD_REQUEST)
}

impl From<FieldError> for Fault {
    fn from(error: FieldError) -> Self {
        Fault::invalid(error.field, error.message)
    }
}

impl From<Problem> for Fault {
    fn from(problem: Problem) -> Self {
        Self { problem, retry: false }
    }
}

impl IntoResponse for Fault {
    fn into_response(self) -> Response {
        let body = serde_json::to_vec(&self.problem).unwrap_or_default();
        let mut response = (self.status(), body).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(PROBLEM_MEDIA_TYPE));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if self.retry {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(RETRY_AFTER_SECONDS));
        }
        response
    }
}

/// Middleware: errors that the framework itself answers in plain text become problem documents.
pub async fn as_problems(request: Request, next: Next) -> Response {
    let response = next.run(request).await;
    let status = response.status();
    let media_type = response.headers().get(header::CONTENT_TYPE);
    if !(status.is_client_error() || status.is_server_error())
        || media_type.is_some_and(|value| value == PROBLEM_MEDIA_TYPE)
    {
        return response;
    }
    let (mut parts, body) = response.into_parts();
    let text = to_bytes(body, MAX_FOREIGN_DETAIL_BYTES).await.unwrap_or_default();
    let detail = match String::from_utf8_lossy(&text).into_owned() {
        empty if empty.is_empty() => match status {
            StatusCode::METHOD_NOT_ALLOWED => {
                "This address does not know this method; the `Allow` header lists those it knows.".into()
            }
            StatusCode::NOT_FOUND => {
                "There is nothing at this address; GET /api/v1/openapi.json lists what there is.".into()
            }
            _ => "The request was refused.".into(),
        },
        text => text,
    };
    let problem = Problem {
        kind: "about:blank".into(),
        title: status.canonical_reason().unwrap_or("Error").into(),
        status: status.as_u16(),
        detail,
        field: None,
    };
    parts.headers.remove(header::CONTENT_LENGTH);
    parts.headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(PROBLEM_MEDIA_TYPE));
    Response::from_parts(parts, Body::from(serde_json::to_vec(&problem).unwrap_or_default()))
}
