//! `/api/v1/sessions/{id}/snapshot` and `/preview`: pictures of a session drawn beside its viewers.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::{Path, Query, State};
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use proto::FieldError;
use proto::rest::{PreviewRequest, Problem};
use proto::scene_file::limits::MAX_IMAGE_EDGE;
use scene::plan::Target;
use serde::Deserialize;

use super::routes::{check_edges, find};
use crate::App;
use crate::http::Json;
use crate::problem::{Answer, Fault};
use crate::render_thread::Still;

/// Most pixels of a still: what a film of 16 bytes a pixel may have on every device.
const MAX_STILL_PIXELS: u64 = 8 << 20;
/// Longest edge of a preview, pixels.
const MAX_PREVIEW_EDGE: u32 = 512;
/// Most samples per pixel of a preview.
const PREVIEW_SAMPLES: u32 = 4;

/// Header of a still: the epoch of the scene it shows.
const EPOCH_HEADER: &str = "tyndall-epoch";

/// Formats of a still.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StillFormat {
    /// 8-bit sRGB, tone-mapped.
    #[default]
    Png,
    /// OpenEXR, linear float32 RGB.
    Exr,
    /// NumPy array of shape (height, width, 3), linear float32.
    Npy,
}

/// What still is wanted.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct StillQuery {
    /// Default png.
    #[serde(default)]
    #[param(inline)]
    format: StillFormat,
    /// Pixels, default the scene's `image.width`.
    width: Option<u32>,
    /// Pixels, default the scene's `image.height`.
    height: Option<u32>,
    /// Epoch the scene must be at; 409 if it was edited since.
    epoch: Option<u32>,
}

/// Draws the scene from the session's camera, to the scene's `sampling.samples_per_pixel`. The header
/// `tyndall-epoch` says which epoch of the scene it shows.
#[utoipa::path(
    get, path = "/sessions/{id}/snapshot", tag = "sessions", params(("id" = String, Path), StillQuery),
    responses(
        (status = OK, description = "The picture", content(
            (Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"), (Vec<u8> = "application/x-npy")
        )),
        (status = CONFLICT, body = Problem, content_type = "application/problem+json", description = "The scene is at another epoch than the one asked for"),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json"),
        (status = SERVICE_UNAVAILABLE, body = Problem, content_type = "application/problem+json", description = "Too many stills are waiting"),
        (status = GATEWAY_TIMEOUT, body = Problem, content_type = "application/problem+json", description = "Drawing took too long"),
    )
)]
pub async fn snapshot(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Query(query): Query<StillQuery>,
) -> Answer<Response> {
    let session = find(&app, &id).await?;
    let (file, snapshot) =
        crate::blocking("reading a session", move || (session.scene_file(), session.snapshot())).await?;
    let epoch = snapshot.epoch;
    if let Some(wanted) = query.epoch.filter(|&wanted| wanted != epoch) {
        return Err(Fault::conflict(format!(
            "The scene is at epoch {epoch}, not {wanted}: it was edited meanwhile; ask for the newest."
        )));
    }
    let target = Target {
        width: query.width.unwrap_or(file.image.width),
        height: query.height.unwrap_or(file.image.height),
        samples_per_pixel: snapshot.scene.samples_at_rest(),
    };
    check_edges(target.width, target.height, MAX_IMAGE_EDGE)?;
    check_pixels(target.width, target.height)?;
    let radiance = query.format != StillFormat::Png;
    let still = app.renderer().still(snapshot, target, radiance, patience(&app)).await?;
    let mut response = answered(still, query.format).await?;
    response.headers_mut().insert(EPOCH_HEADER, HeaderValue::from(epoch));
    Ok(response)
}

/// Refuses a picture of more pixels than are drawn.
pub(crate) fn check_pixels(width: u32, height: u32) -> Result<(), FieldError> {
    let pixels = u64::from(width) * u64::from(height);
    if pixels > MAX_STILL_PIXELS {
        let message = format!("and `height` ask for {pixels} pixels, at most {MAX_STILL_PIXELS} are drawn");
        return Err(FieldError::new("width", message));
    }
    Ok(())
}

/// Draws the scene as a patch would make it, small and quickly, from the session's camera or from
/// that of the patch. The session stays as it is.
///
/// One such picture is drawn at a time, beside the viewers and behind what moves.
#[utoipa::path(
    post, path = "/sessions/{id}/preview", tag = "sessions", params(("id" = String, Path)), request_body = PreviewRequest,
    responses(
        (status = OK, body = Vec<u8>, content_type = "image/png", description = "The picture"),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "A field is not valid, or the patch names another volume"),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
        (status = SERVICE_UNAVAILABLE, body = Problem, content_type = "application/problem+json", description = "Too many stills are waiting"),
        (status = GATEWAY_TIMEOUT, body = Problem, content_type = "application/problem+json", description = "Drawing took too long"),
    )
)]
pub async fn preview(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Json(request): Json<PreviewRequest>,
) -> Answer<Response> {
    let PreviewRequest { patch, width, height } = request;
    check_edges(width, height, MAX_PREVIEW_EDGE)?;
    let session = find(&app, &id).await?;
    let shared = app.clone();
    let snapshot =
        crate::blocking("preparing a preview", move || session.patched_snapshot(&shared, &patch)).await??;
    let samples_per_pixel = snapshot.scene.samples_at_rest().min(PREVIEW_SAMPLES);
    let target = Target { width, height, samples_per_pixel };
    let _turn = app.previews.acquire().await;
    let still = app.renderer().still(snapshot, target, false, patience(&app)).await?;
    answered(still, StillFormat::Png).await
}

fn patience(app: &App) -> Duration {
    Duration::from_secs(app.config().limits.still_seconds)
}

async fn answered(still: Still, format: StillFormat) -> Answer<Response> {
    let (media_type, bytes) = crate::blocking("encoding a still", move || encoded(&still, format)).await??;
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
    ];
    Ok((headers, bytes).into_response())
}

fn encoded(still: &Still, format: StillFormat) -> Answer<(&'static str, Vec<u8>)> {
    let failed = |error| Fault::internal("encoding a still", &error);
    match (still, format) {
        (Still::Picture(picture), _) => Ok(("image/png", render::still::png(picture).map_err(failed)?)),
        (Still::Radiance(radiance), StillFormat::Npy) => {
            Ok(("application/x-npy", render::still::npy(radiance)))
        }
        (Still::Radiance(radiance), _) => Ok(("image/x-exr", render::still::exr(radiance).map_err(failed)?)),
    }
}
