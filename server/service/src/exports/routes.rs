//! `/api/v1/sessions/{id}/exports` and `/api/v1/exports`.

use std::sync::Arc;

use axum::Json as JsonAnswer;
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use proto::FieldError;
use proto::rest::{CameraKey, Export as ExportDocument, ExportFormat, ExportRequest, ExportState, Problem};
use proto::scene_file::limits::MAX_IMAGE_EDGE;
use tokio_util::io::ReaderStream;

use crate::App;
use crate::http::Json;
use crate::problem::{Answer, Fault};
use crate::sessions::edits::check_camera;
use crate::sessions::routes::{check_edges, find};
use crate::sessions::stills::check_pixels;

/// Pictures of an export.
const FRAMES: std::ops::RangeInclusive<u32> = 2..=1440;
/// Pictures a second.
const RATES: std::ops::RangeInclusive<u32> = 1..=60;
/// Most turns, either way.
const MAX_TURNS: f64 = 10.0;
/// Views of a film.
const KEYS: std::ops::RangeInclusive<usize> = 2..=64;
/// Latest time of a view, seconds.
const MAX_SECONDS: f64 = 3600.0;
/// Least time between two views, seconds: less than a picture at the highest rate.
const MIN_SECONDS_BETWEEN: f64 = 0.01;
/// Samples, or paths, per pixel.
const SAMPLES: std::ops::RangeInclusive<u32> = 1..=4096;

/// Begins to draw the session's scene, as it is now, from a camera that goes around its target
/// (`turns`) or through views (`keys`); the pictures are drawn behind all other work. The answer tells where to ask how far it has come.
#[utoipa::path(
    post, path = "/sessions/{id}/exports", tag = "exports", params(("id" = String, Path)), request_body = ExportRequest,
    responses(
        (status = CREATED, body = ExportDocument),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "A field is not valid"),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
        (status = SERVICE_UNAVAILABLE, body = Problem, content_type = "application/problem+json", description = "Too many exports"),
    )
)]
pub async fn create(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Json(request): Json<ExportRequest>,
) -> Answer<Response> {
    check(&request)?;
    let session = find(&app, &id).await?;
    let shared = app.clone();
    let runtime = tokio::runtime::Handle::current();
    let begun = crate::blocking("beginning an export", move || {
        let _entered = runtime.enter();
        let snapshot = session.snapshot();
        let camera = request.camera.clone().unwrap_or_else(|| session.camera());
        shared.exports().begin(&shared, request, camera, snapshot)
    });
    let export = begun.await??.describe();
    let location = format!("/api/v1/exports/{}", export.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], JsonAnswer(export)).into_response())
}

/// How far an export has come.
#[utoipa::path(
    get, path = "/exports/{id}", tag = "exports", params(("id" = String, Path)),
    responses((status = OK, body = ExportDocument), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json", description = "There is none, or no more: exports do not survive a restart"))
)]
pub async fn get(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<JsonAnswer<ExportDocument>> {
    crate::blocking("reading an export", move || Ok(JsonAnswer(app.exports().find(&id)?.describe()))).await?
}

/// Stops an export, or forgets one that is done.
#[utoipa::path(
    delete, path = "/exports/{id}", tag = "exports", params(("id" = String, Path)),
    responses((status = NO_CONTENT), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn delete(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<StatusCode> {
    crate::blocking("deleting an export", move || app.exports().delete(&id)).await??;
    Ok(StatusCode::NO_CONTENT)
}

/// The file of an export that is done.
#[utoipa::path(
    get, path = "/exports/{id}/file", tag = "exports", params(("id" = String, Path)),
    responses(
        (status = OK, description = "The file", content((Vec<u8> = "image/apng"), (Vec<u8> = "application/zip"))),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
        (status = CONFLICT, body = Problem, content_type = "application/problem+json", description = "It is not done"),
    )
)]
pub async fn file(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<Response> {
    let export = crate::blocking("reading an export", move || app.exports().find(&id)).await??;
    let document = export.describe();
    if document.state != ExportState::Done {
        return Err(Fault::conflict(
            "The export is not done; GET /api/v1/exports/{id} tells how far it has come.",
        ));
    }
    let opened = tokio::fs::File::open(&export.path).await;
    let file = opened.map_err(|error| Fault::disk("reading an export", &error))?;
    let media_type = match document.format {
        ExportFormat::Apng => "image/apng",
        ExportFormat::Zip => "application/zip",
    };
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
        (header::CONTENT_LENGTH, HeaderValue::from(document.bytes)),
        // Without a name: the page has a better one.
        (header::CONTENT_DISPOSITION, HeaderValue::from_static("attachment")),
    ];
    Ok((headers, Body::from_stream(ReaderStream::new(file))).into_response())
}

fn check(request: &ExportRequest) -> Answer<()> {
    check_edges(request.width, request.height, MAX_IMAGE_EDGE)?;
    check_pixels(request.width, request.height)?;
    let counts = [
        ("frames", Some(request.frames), FRAMES),
        ("frames_per_second", Some(request.frames_per_second), RATES),
        ("samples", request.samples, SAMPLES),
    ];
    for (field, count, range) in counts {
        if let Some(count) = count.filter(|count| !range.contains(count)) {
            let (least, most) = range.into_inner();
            let message = format!("must be from {least} to {most}, got {count}");
            return Err(FieldError::new(field, message).into());
        }
    }
    match (request.turns, request.keys.as_slice()) {
        (Some(turns), []) => check_turns(turns)?,
        (None, []) => return Err(FieldError::new("turns", "is missing (or give `keys`)").into()),
        (Some(_), _) => return Err(FieldError::new("keys", "are an alternative to `turns`; give one").into()),
        (None, keys) => check_keys(keys)?,
    }
    match &request.camera {
        Some(_) if request.turns.is_none() => {
            Err(FieldError::new("camera", "is where a turntable begins; `keys` have their own").into())
        }
        Some(camera) => Ok(check_camera(camera)?),
        None => Ok(()),
    }
}

fn check_turns(turns: f64) -> Result<(), FieldError> {
    if turns.abs() <= MAX_TURNS && turns != 0.0 {
        return Ok(());
    }
    Err(FieldError::new("turns", format!("must be from -{MAX_TURNS} to {MAX_TURNS} and not 0, got {turns}")))
}

fn check_keys(keys: &[CameraKey]) -> Result<(), FieldError> {
    if !KEYS.contains(&keys.len()) {
        let (least, most) = KEYS.into_inner();
        return Err(FieldError::new("keys", format!("must be {least} to {most} views, got {}", keys.len())));
    }
    let mut before = -MIN_SECONDS_BETWEEN;
    for (index, CameraKey { seconds, camera }) in keys.iter().enumerate() {
        let field = format!("keys[{index}]");
        check_camera(camera)
            .map_err(|error| FieldError::new(format!("{field}.{}", error.field), error.message))?;
        if !(0.0..=MAX_SECONDS).contains(seconds) {
            let message = format!("must be from 0 to {MAX_SECONDS}, got {seconds}");
            return Err(FieldError::new(format!("{field}.seconds"), message));
        }
        if seconds - before < MIN_SECONDS_BETWEEN {
            let message =
                format!("must be at least {MIN_SECONDS_BETWEEN} after the view before, at {before}");
            return Err(FieldError::new(format!("{field}.seconds"), message));
        }
        if camera.fov_y_degrees.is_some() != keys[0].camera.fov_y_degrees.is_some() {
            let message = "must have the projection of the first view: with perspective, or without";
            return Err(FieldError::new(format!("{field}.camera"), message));
        }
        before = *seconds;
    }
    Ok(())
}
