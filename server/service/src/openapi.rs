//! The OpenAPI document, generated from the handlers and the types.

use std::sync::Arc;

use axum::Router;
use axum::http::{HeaderValue, header};
use axum::response::IntoResponse;
use axum::routing::get;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::{Config, SwaggerUi};

use crate::App;
use crate::{datasets, environments, exports, sessions, viewer};

#[derive(OpenApi)]
#[openapi(
    info(
        title = "Tyndall",
        description = "Remote volume rendering: datasets, sessions, stills. Errors are problem documents (RFC 9457). Viewers connect to `/sessions/{id}/view` by WebSocket: JSON control messages (`ClientMessage`, `ServerMessage`) and binary frames.",
    ),
    servers((url = "/api/v1")),
    components(schemas(
        proto::rest::Problem,
        proto::control::ClientMessage,
        proto::control::ServerMessage,
    )),
    tags(
        (name = "service", description = "The service itself"),
        (name = "datasets", description = "Volumes that can be explored"),
        (name = "environments", description = "Light from all directions"),
        (name = "uploads", description = "Uploads that go on after a break (tus 1.0.0)"),
        (name = "sessions", description = "Scenes being explored"),
        (name = "exports", description = "Turntables and films: pictures of a camera that goes around, or through views, as one file"),
    )
)]
struct Document;

/// Every route of the API, with its description.
pub fn api() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::with_openapi(Document::openapi())
        .routes(routes!(sessions::routes::status))
        .routes(routes!(datasets::routes::list, datasets::routes::post))
        .routes(routes!(datasets::routes::get, datasets::routes::put, datasets::routes::delete))
        .routes(routes!(datasets::routes::histogram))
        .routes(routes!(datasets::routes::thumbnail))
        .routes(routes!(datasets::routes::scene))
        .routes(routes!(environments::routes::list))
        .routes(routes!(environments::routes::put, environments::routes::delete))
        .routes(routes!(environments::routes::preview))
        .routes(routes!(datasets::uploads::routes::create))
        .routes(routes!(
            datasets::uploads::routes::head,
            datasets::uploads::routes::get,
            datasets::uploads::routes::patch,
            datasets::uploads::routes::post,
            datasets::uploads::routes::delete
        ))
        .routes(routes!(sessions::routes::list, sessions::routes::create))
        .routes(routes!(sessions::routes::get, sessions::routes::delete))
        .routes(routes!(
            sessions::routes::get_scene,
            sessions::routes::put_scene,
            sessions::routes::patch_scene
        ))
        .routes(routes!(sessions::routes::probe))
        .routes(routes!(sessions::routes::histogram))
        .routes(routes!(sessions::stills::snapshot))
        .routes(routes!(sessions::stills::preview))
        .routes(routes!(exports::routes::create))
        .routes(routes!(exports::routes::get, exports::routes::delete))
        .routes(routes!(exports::routes::file))
        .routes(routes!(viewer::view))
}

/// The document for people: every route with its types, to be tried out.
pub fn browsable() -> SwaggerUi {
    SwaggerUi::new("/api/docs").config(Config::from("/api/v1/openapi.json"))
}

/// Serves the document.
pub fn document_route(document: utoipa::openapi::OpenApi) -> Router<Arc<App>> {
    let text = document.to_json().unwrap_or_default();
    let text: Arc<str> = text.into();
    Router::new().route(
        "/openapi.json",
        get(move || async move {
            let media_type = HeaderValue::from_static("application/json");
            ([(header::CONTENT_TYPE, media_type)], text.to_string()).into_response()
        }),
    )
}
