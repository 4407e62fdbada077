//! `/api/v1/environments`.

use std::sync::Arc;

use axum::Json as JsonAnswer;
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use proto::rest::{Environment, Problem};
use render::Picture;
use scene::environment::EnvironmentImage;

use crate::App;
use crate::datasets::receive::plain_name;
use crate::http::whole_body;
use crate::problem::{Answer, Fault};

/// Pixels of a preview.
const PREVIEW: (u32, u32) = (256, 128);
/// What the mean of a preview is brought to before it is compressed.
const PREVIEW_MEAN: f64 = 0.35;
/// A preview follows from the content its identifier names; the samples' may change with the service.
const REVALIDATE: &str = "private, no-cache";

/// Lists samples, then uploads by name.
#[utoipa::path(get, path = "/environments", tag = "environments", responses((status = OK, body = Vec<Environment>)))]
pub async fn list(State(app): State<Arc<App>>) -> Answer<JsonAnswer<Vec<Environment>>> {
    crate::blocking("listing environments", move || JsonAnswer(app.environments().list())).await
}

/// Uploads an environment: Radiance HDR or OpenEXR, latitude-longitude, row 0 = +y. Its identifier is
/// what an environment light's `image` names.
#[utoipa::path(
    put, path = "/environments/{name}", tag = "environments", params(("name" = String, Path)),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses(
        (status = CREATED, body = Environment, description = "Stored"),
        (status = OK, body = Environment, description = "The same content was stored before"),
        (status = PAYLOAD_TOO_LARGE, body = Problem, content_type = "application/problem+json"),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "No reader accepts it"),
        (status = INSUFFICIENT_STORAGE, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn put(State(app): State<Arc<App>>, Path(name): Path<String>, body: Body) -> Answer<Response> {
    let Ok(_permit) = app.receiving.try_acquire() else {
        return Err(Fault::busy("Other uploads are being received (`limits.max_uploads`)."));
    };
    let most = app.config().limits.max_environment_bytes;
    let bytes = whole_body(body, most, "An environment", "limits.max_environment_bytes").await?;
    let shared = app.clone();
    let stored = crate::blocking("storing an environment", move || {
        shared.environments().store(&plain_name(&name), &bytes)
    });
    let (environment, known) = stored.await??;
    let status = if known { StatusCode::OK } else { StatusCode::CREATED };
    Ok((status, JsonAnswer(environment)).into_response())
}

/// Deletes an uploaded environment. Sessions lit by it keep it for as long as they are in memory.
#[utoipa::path(
    delete, path = "/environments/{name}", tag = "environments", params(("name" = String, Path, description = "Its identifier")),
    responses((status = NO_CONTENT), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn delete(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<StatusCode> {
    crate::blocking("deleting an environment", move || app.environments().delete(&id)).await??;
    Ok(StatusCode::NO_CONTENT)
}

/// A small picture of an environment.
#[utoipa::path(
    get, path = "/environments/{name}/preview", tag = "environments", params(("name" = String, Path, description = "Its identifier")),
    responses((status = OK, body = Vec<u8>, content_type = "image/png"), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn preview(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<Response> {
    let png = crate::blocking("drawing an environment", move || {
        let image = app.environments().image(&id)?;
        render::still::png(&small(&image)).map_err(|error| Fault::internal("drawing an environment", &error))
    });
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static("image/png")),
        (header::CACHE_CONTROL, HeaderValue::from_static(REVALIDATE)),
    ];
    Ok((headers, png.await??).into_response())
}

/// The environment at the size of a preview, its mean brought to a fixed grey and its lights
/// compressed.
fn small(image: &EnvironmentImage) -> Picture {
    let (width, height) = PREVIEW;
    let texels = image.texels();
    // A block of texels per pixel, or the nearest texel of a small image.
    let span = |pixel: u32, pixels: u32, edge: usize| {
        let at = |p: u32| (p as usize * edge / pixels as usize).min(edge - 1);
        at(pixel)..at(pixel + 1).max(at(pixel) + 1).min(edge)
    };
    let mut pixels = Vec::with_capacity((width * height) as usize);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0; 3];
            let mut count = 0.0;
            for row in span(y, height, image.height()) {
                for column in span(x, width, image.width()) {
                    let texel = texels[row * image.width() + column];
                    (0..3).for_each(|channel| sum[channel] += f64::from(texel[channel]));
                    count += 1.0;
                }
            }
            pixels.push(sum.map(|channel: f64| channel / count));
        }
    }
    let level = |pixel: &[f64; 3]| (pixel.iter().sum::<f64>() / 3.0).min(4.0);
    let mean = pixels.iter().map(level).sum::<f64>() / pixels.len() as f64;
    let gain = if mean > 0.0 { PREVIEW_MEAN / mean } else { 1.0 };
    let srgb = |x: f64| {
        let compressed = x * gain / (1.0 + x * gain);
        let encoded = if compressed <= 0.003_130_8 {
            12.92 * compressed
        } else {
            1.055 * compressed.powf(1.0 / 2.4) - 0.055
        };
        (encoded * 255.0).round() as u8
    };
    let rgba =
        pixels.iter().flat_map(|pixel| [srgb(pixel[0]), srgb(pixel[1]), srgb(pixel[2]), 255]).collect();
    Picture { width, height, rgba }
}
