//! `/api/v1/sessions` and `/api/v1/status`.

use std::sync::Arc;

use axum::Json as JsonAnswer;
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use proto::FieldError;
use proto::control::Role;
use proto::rest::{
    CreateSession, Probe, ProbeHit, ProbeRequest, Problem, RegionHistogram, Session as SessionDocument,
    Status,
};
use proto::scene_file::{SceneFile, limits::MAX_IMAGE_EDGE};
use serde_json::Value;

use super::{Access, Edit, Session, edits};
use crate::App;
use crate::http::Json;
use crate::problem::{Answer, Fault};

/// What the service is and how busy.
#[utoipa::path(get, path = "/status", tag = "service", responses((status = OK, body = Status)))]
pub async fn status(State(app): State<Arc<App>>) -> Answer<JsonAnswer<Status>> {
    let shared = app.clone();
    let (sessions, viewers) =
        crate::blocking("counting sessions", move || shared.sessions().counts()).await?;
    Ok(JsonAnswer(Status {
        version: env!("CARGO_PKG_VERSION").into(),
        device: app.renderer().device().clone(),
        sessions,
        viewers,
        max_upload_bytes: app.config().limits.max_upload_bytes,
        methods: render::METHODS_BUILT.iter().map(|method| method.name().to_owned()).collect(),
    }))
}

/// Lists sessions, in memory and on disk, oldest first, each by the identifier for watching it: who may
/// edit one knows its own.
#[utoipa::path(get, path = "/sessions", tag = "sessions", responses((status = OK, body = Vec<SessionDocument>)))]
pub async fn list(State(app): State<Arc<App>>) -> Answer<JsonAnswer<Vec<SessionDocument>>> {
    crate::blocking("listing sessions", move || JsonAnswer(app.sessions().list())).await
}

/// Opens a session with a scene, or with a dataset in the scene that suits it.
#[utoipa::path(
    post, path = "/sessions", tag = "sessions", request_body = CreateSession,
    responses(
        (status = CREATED, body = SessionDocument),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "A field is not valid; `field` names it"),
        (status = SERVICE_UNAVAILABLE, body = Problem, content_type = "application/problem+json", description = "Too many sessions, or no memory for the volume"),
    )
)]
pub async fn create(State(app): State<Arc<App>>, Json(wish): Json<CreateSession>) -> Answer<Response> {
    let own_scene = wish.scene.is_some();
    let scene = match (wish.scene, wish.dataset) {
        (Some(scene), None) => scene,
        (None, Some(id)) => {
            crate::datasets::routes::opening_scene(&app, &id).await.map_err(|mut fault| {
                if fault.problem.status == 404 {
                    fault = Fault::invalid("dataset", fault.problem.detail);
                }
                fault
            })?
        }
        (Some(_), Some(_)) => {
            return Err(Fault::invalid("dataset", "is an alternative to `scene`; give one"));
        }
        (None, None) => return Err(Fault::invalid("scene", "is missing (or give `dataset`)")),
    };
    let session = app.sessions().create(&app, scene).await.map_err(|mut fault| {
        // The field's path in the request.
        if own_scene && let Some(field) = &mut fault.problem.field {
            field.insert_str(0, "scene.");
        }
        fault
    })?;
    let location = format!("/api/v1/sessions/{}", session.id);
    let document = described(Access { session, role: Role::Editor }).await?;
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], document).into_response())
}

/// A session with its scene.
#[utoipa::path(
    get, path = "/sessions/{id}", tag = "sessions", params(("id" = String, Path)),
    responses((status = OK, body = SessionDocument), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn get(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<JsonAnswer<SessionDocument>> {
    described(app.sessions().find(&app, &id).await?).await
}

/// Deletes a session, also from disk; its viewers are told.
#[utoipa::path(
    delete, path = "/sessions/{id}", tag = "sessions", params(("id" = String, Path)),
    responses((status = NO_CONTENT), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn delete(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<StatusCode> {
    crate::blocking("deleting a session", move || app.sessions().delete(&app, &id)).await??;
    Ok(StatusCode::NO_CONTENT)
}

/// The session's scene file, camera filled in.
#[utoipa::path(
    get, path = "/sessions/{id}/scene", tag = "sessions", params(("id" = String, Path)),
    responses((status = OK, body = SceneFile), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn get_scene(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<JsonAnswer<SceneFile>> {
    let session = find(&app, &id).await?;
    crate::blocking("reading a scene", move || JsonAnswer(session.scene_file())).await
}

/// Replaces the session's scene. Connected viewers keep their cameras.
#[utoipa::path(
    put, path = "/sessions/{id}/scene", tag = "sessions", params(("id" = String, Path)), request_body = SceneFile,
    responses(
        (status = OK, body = SessionDocument),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "A field is not valid; the scene is unchanged"),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn put_scene(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Json(scene): Json<Value>,
) -> Answer<JsonAnswer<SessionDocument>> {
    edit(&app, &id, Edit::Replace(scene)).await
}

/// Changes part of the session's scene by a JSON merge patch (RFC 7396); arrays are replaced
/// whole. Connected viewers keep their cameras.
#[utoipa::path(
    patch, path = "/sessions/{id}/scene", tag = "sessions", params(("id" = String, Path)),
    request_body(content = Object, content_type = "application/merge-patch+json"),
    responses(
        (status = OK, body = SessionDocument),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "A field is not valid; the scene is unchanged"),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn patch_scene(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Json(patch): Json<Value>,
) -> Answer<JsonAnswer<SessionDocument>> {
    edit(&app, &id, Edit::Patch(patch)).await
}

/// The place under a pixel, and the data value there.
#[utoipa::path(
    post, path = "/sessions/{id}/probe", tag = "sessions", params(("id" = String, Path)), request_body = ProbeRequest,
    responses(
        (status = OK, body = Probe),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "The camera or the pixel is not valid"),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn probe(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Json(request): Json<ProbeRequest>,
) -> Answer<JsonAnswer<Probe>> {
    edits::check_camera(&request.camera)?;
    check_edges(request.width, request.height, MAX_IMAGE_EDGE)?;
    for (axis, pixels, edge) in [("x", request.x, request.width), ("y", request.y, request.height)] {
        if !(0.0..=f64::from(edge)).contains(&pixels) {
            return Err(FieldError::new(axis, "must lie within the picture").into());
        }
    }
    let session = find(&app, &id).await?;
    let hit = move || {
        let snapshot = session.snapshot();
        let camera = scene::Camera::from_file(&request.camera);
        let (origin, direction) = camera.ray(request.x, request.y, request.width, request.height);
        let hit = scene::probe::probe(&snapshot.scene, origin, direction)?;
        Some(ProbeHit {
            position: hit.position.to_array(),
            voxel: hit.voxel.map(|index| index as u32),
            value: hit.value,
        })
    };
    crate::blocking("probing a volume", move || JsonAnswer(Probe { hit: hit() })).await
}

/// How often each data value occurs in what the session's clip region keeps.
#[utoipa::path(
    get, path = "/sessions/{id}/histogram", tag = "sessions", params(("id" = String, Path)),
    responses((status = OK, body = RegionHistogram), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn histogram(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
) -> Answer<JsonAnswer<RegionHistogram>> {
    let session = find(&app, &id).await?;
    let _turn = app.region_scans.acquire().await;
    let count = move || {
        let snapshot = session.snapshot();
        JsonAnswer(RegionHistogram {
            epoch: snapshot.epoch,
            value_range: snapshot.scene.volume.range,
            counts: scene::region::histogram_in_clip(&snapshot.scene),
        })
    };
    crate::blocking("counting values", count).await
}

async fn edit(app: &Arc<App>, id: &str, edit: Edit) -> Answer<JsonAnswer<SessionDocument>> {
    let access = app.sessions().find(app, id).await?;
    access.clone().to_edit()?.edit(app, edit).await?;
    described(access).await
}

/// A session as REST tells it; an edit under way may hold it for a moment.
async fn described(access: Access) -> Answer<JsonAnswer<SessionDocument>> {
    crate::blocking("reading a session", move || JsonAnswer(access.describe())).await
}

/// A session to look at.
pub(crate) async fn find(app: &Arc<App>, id: &str) -> Answer<Arc<Session>> {
    Ok(app.sessions().find(app, id).await?.session)
}

/// Refuses the size of a picture that has no pixels or an edge beyond `most`.
pub(crate) fn check_edges(width: u32, height: u32, most: u32) -> Result<(), FieldError> {
    for (field, edge) in [("width", width), ("height", height)] {
        if !(1..=most).contains(&edge) {
            return Err(FieldError::new(field, format!("must be from 1 to {most} pixels, got {edge}")));
        }
    }
    Ok(())
}
