//! `/api/v1/datasets`.

use std::sync::Arc;

use axum::Json as JsonAnswer;
use axum::body::Body;
use axum::extract::{Multipart, Path, Query, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use proto::rest::{Dataset, Histogram, Problem};
use proto::scene_file::{Endian, SceneFile, VolumeSource, VoxelType};
use scene::part::Wish;
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot};
use serde::Deserialize;

use super::receive::{Incoming, plain_name};
use super::volumes::Key;
use super::{no_such_dataset, storage};
use crate::App;
use crate::problem::{Answer, Fault};
use crate::render_thread::Still;

/// Size of a thumbnail, pixels.
const THUMBNAIL_SIZE: (u32, u32) = (192, 144);
/// Most samples per pixel of a thumbnail.
const THUMBNAIL_SAMPLES: u32 = 4;
/// Changes whenever thumbnails drawn before should be drawn again.
const THUMBNAIL_VERSION: &str = concat!("2-", env!("CARGO_PKG_VERSION"));
/// What follows from a dataset's content alone may be kept, but is asked for again: a newer
/// version of the service may see it differently.
const REVALIDATE: &str = "private, no-cache";

/// Layout of a raw file, for uploads without a header.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct RawQuery {
    /// Voxels along x, y, z, separated by commas; makes the upload a raw file.
    dims: Option<String>,
    /// Type of a voxel.
    #[serde(rename = "type")]
    voxel_type: Option<VoxelType>,
    /// Byte order, default little.
    endian: Option<Endian>,
    /// Bytes before the first voxel, default 0.
    header_bytes: Option<u64>,
    /// Edges of a voxel along x, y, z, separated by commas, default 1.
    spacing: Option<String>,
}

/// Lists samples, then uploads, newest first.
#[utoipa::path(get, path = "/datasets", tag = "datasets", responses((status = OK, body = Vec<Dataset>)))]
pub async fn list(State(app): State<Arc<App>>) -> Answer<JsonAnswer<Vec<Dataset>>> {
    crate::blocking("listing datasets", move || {
        let samples = app.samples().all().iter().map(|sample| sample.dataset.clone());
        JsonAnswer(samples.chain(app.catalog().list()).collect())
    })
    .await
}

/// Uploads a dataset of one or more files.
///
/// Each file is a part named `file`: a volume, or a header with its data, or a raw file with
/// `NAME.json` that gives `dims`, `type` and, if needed, `endian`, `header_bytes`, `spacing`, or
/// the slices of a DICOM series, or TIFF or PNG slices of one page each, ordered by the numbers in
/// their names.
#[utoipa::path(
    post, path = "/datasets", tag = "datasets",
    request_body(content = inline(UploadForm), content_type = "multipart/form-data"),
    responses(
        (status = CREATED, body = Dataset, description = "Stored"),
        (status = OK, body = Dataset, description = "The same content was stored before"),
        (status = PAYLOAD_TOO_LARGE, body = Problem, content_type = "application/problem+json"),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "No reader accepts it; `detail` holds the reader's words"),
        (status = INSUFFICIENT_STORAGE, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(State(app): State<Arc<App>>, form: Multipart) -> Answer<Response> {
    let _permit = permit(&app)?;
    let mut incoming = Incoming::new(&app).await?;
    incoming.form(form).await?;
    stored(incoming).await
}

/// What a form upload holds.
#[derive(utoipa::ToSchema)]
#[allow(dead_code)]
struct UploadForm {
    /// The files.
    #[schema(value_type = Vec<String>, format = Binary)]
    file: Vec<Vec<u8>>,
}

/// Uploads a dataset of one file under a name (`curl -T engine.nrrd .../datasets/`).
///
/// A raw file needs `dims` and `type`. The answer names the dataset by its content.
#[utoipa::path(
    put, path = "/datasets/{id}", tag = "datasets",
    params(("id" = String, Path, description = "The file's name"), RawQuery),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses(
        (status = CREATED, body = Dataset, description = "Stored; `Location` is its address"),
        (status = OK, body = Dataset, description = "The same content was stored before"),
        (status = PAYLOAD_TOO_LARGE, body = Problem, content_type = "application/problem+json"),
        (status = UNPROCESSABLE_ENTITY, body = Problem, content_type = "application/problem+json", description = "No reader accepts it; `detail` holds the reader's words"),
        (status = INSUFFICIENT_STORAGE, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn put(
    State(app): State<Arc<App>>,
    Path(name): Path<String>,
    Query(raw): Query<RawQuery>,
    headers: HeaderMap,
    body: Body,
) -> Answer<Response> {
    let _permit = permit(&app)?;
    let length = headers.get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse().ok());
    let most = app.config().limits.max_upload_bytes;
    if length.is_some_and(|length: u64| length > most) {
        return Err(Fault::too_large(format!(
            "An upload may have {most} bytes (`limits.max_upload_bytes`)."
        )));
    }
    let sidecar = sidecar(&raw)?;
    let mut incoming = Incoming::new(&app).await?;
    incoming.file(&name, body.into_data_stream()).await?;
    if let Some(sidecar) = sidecar {
        let piece = Ok::<_, std::convert::Infallible>(axum::body::Bytes::from(sidecar));
        let name = format!("{}.json", plain_name(&name));
        incoming.file(&name, futures_util::stream::iter([piece])).await?;
    }
    stored(incoming).await
}

fn permit(app: &App) -> Answer<tokio::sync::SemaphorePermit<'_>> {
    let most = app.config().limits.max_uploads;
    app.receiving
        .try_acquire()
        .map_err(|_| Fault::busy(format!("{most} uploads are under way (`limits.max_uploads`).")))
}

async fn stored(incoming: Incoming<'_>) -> Answer<Response> {
    let (dataset, new) = incoming.finish().await?;
    let status = if new { StatusCode::CREATED } else { StatusCode::OK };
    let location = format!("/api/v1/datasets/{}", dataset.id);
    Ok((status, [(header::LOCATION, location)], JsonAnswer(dataset)).into_response())
}

/// The layout in a query as the JSON file that readers look for beside a raw file.
fn sidecar(raw: &RawQuery) -> Answer<Option<String>> {
    fn triple<T: std::str::FromStr>(field: &str, text: &str) -> Answer<[T; 3]> {
        let numbers: Option<Vec<T>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        numbers
            .and_then(|numbers| numbers.try_into().ok())
            .ok_or_else(|| Fault::invalid(field, "must be three numbers separated by commas"))
    }
    let Some(dims) = &raw.dims else {
        if raw.voxel_type.is_some()
            || raw.endian.is_some()
            || raw.header_bytes.is_some()
            || raw.spacing.is_some()
        {
            return Err(Fault::invalid("dims", "is missing: a raw file needs `dims` and `type`"));
        }
        return Ok(None);
    };
    let Some(voxel_type) = raw.voxel_type else {
        return Err(Fault::invalid("type", "is missing: a raw file needs `dims` and `type`"));
    };
    let mut layout = serde_json::json!({
        "dims": triple::<u32>("dims", dims)?,
        "type": voxel_type,
        "endian": raw.endian.unwrap_or_default(),
        "header_bytes": raw.header_bytes.unwrap_or_default(),
    });
    if let Some(spacing) = &raw.spacing {
        layout["spacing"] = serde_json::json!(triple::<f64>("spacing", spacing)?);
    }
    Ok(Some(layout.to_string()))
}

/// What a dataset is.
#[utoipa::path(
    get, path = "/datasets/{id}", tag = "datasets", params(("id" = String, Path)),
    responses((status = OK, body = Dataset), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn get(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<JsonAnswer<Dataset>> {
    find(&app, &id).await.map(|found| JsonAnswer(found.dataset))
}

/// Deletes an uploaded dataset. Sessions that show it keep their volume until they end.
#[utoipa::path(
    delete, path = "/datasets/{id}", tag = "datasets", params(("id" = String, Path)),
    responses(
        (status = NO_CONTENT),
        (status = FORBIDDEN, body = Problem, content_type = "application/problem+json", description = "It is a sample"),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn delete(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<StatusCode> {
    if find(&app, &id).await?.dataset.sample {
        return Err(Fault::forbidden("Samples come with the service and cannot be deleted."));
    }
    crate::blocking("deleting a dataset", move || app.catalog().delete(&id)).await??;
    Ok(StatusCode::NO_CONTENT)
}

/// How often each data value occurs.
#[utoipa::path(
    get, path = "/datasets/{id}/histogram", tag = "datasets", params(("id" = String, Path)),
    responses((status = OK, body = Histogram), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn histogram(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<JsonAnswer<Histogram>> {
    let found = find(&app, &id).await?;
    let volume = app.volumes().load(&found.key, |_| {}).await?;
    Ok(JsonAnswer(Histogram {
        value_range: volume.range,
        counts: volume.histogram.clone(),
        bin_edges: volume.bins.edges.to_vec(),
        bin_shares: volume.bin_shares.to_vec(),
    }))
}

/// The scene a dataset opens with.
#[utoipa::path(
    get, path = "/datasets/{id}/scene", tag = "datasets", params(("id" = String, Path)),
    responses((status = OK, body = SceneFile), (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"))
)]
pub async fn scene(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<JsonAnswer<SceneFile>> {
    opening_scene(&app, &id).await.map(JsonAnswer)
}

/// A small picture of the dataset in the scene it opens with.
#[utoipa::path(
    get, path = "/datasets/{id}/thumbnail", tag = "datasets", params(("id" = String, Path)),
    responses(
        (status = OK, body = Vec<u8>, content_type = "image/png"),
        (status = NOT_MODIFIED),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn thumbnail(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Answer<Response> {
    let found = find(&app, &id).await?;
    let scene_text = match &found.scene {
        Some(scene) => serde_json::to_string(scene).unwrap_or_default(),
        None => String::new(),
    };
    let drawn_from = format!("{THUMBNAIL_VERSION} {id} {:?} {scene_text}", found.key);
    let key: String = blake3::hash(drawn_from.as_bytes()).to_hex().chars().take(32).collect();
    let etag = HeaderValue::from_str(&format!("\"{key}\""))
        .map_err(|e| Fault::internal("naming a thumbnail", &e))?;
    let caching =
        [(header::ETAG, etag.clone()), (header::CACHE_CONTROL, HeaderValue::from_static(REVALIDATE))];
    if headers.get(header::IF_NONE_MATCH).is_some_and(|known| *known == etag) {
        return Ok((StatusCode::NOT_MODIFIED, caching).into_response());
    }
    let path = app.catalog().storage().thumbnail(&id, &key);
    let png = match tokio::fs::read(&path).await {
        Ok(png) => png,
        Err(_) => {
            let _turn = app.thumbnails.acquire().await;
            match tokio::fs::read(&path).await {
                Ok(png) => png,
                Err(_) => draw_thumbnail(&app, &id, path).await?,
            }
        }
    };
    let media_type = [(header::CONTENT_TYPE, HeaderValue::from_static("image/png"))];
    Ok((caching, media_type, png).into_response())
}

async fn draw_thumbnail(app: &Arc<App>, id: &str, path: std::path::PathBuf) -> Answer<Vec<u8>> {
    let (file, volume) = scene_and_volume(app, id).await?;
    let shared = app.clone();
    let snapshot = crate::blocking("preparing a thumbnail", move || {
        let fitted = shared.fit(&volume, &Wish::of(&file.volume))?;
        let scene = Scene::new(&file, fitted.volume)?;
        render::check(&scene)?;
        Ok::<_, Fault>(Arc::new(Snapshot { epoch: 1, scene }))
    })
    .await??;
    let (width, height) = THUMBNAIL_SIZE;
    let samples_per_pixel = snapshot.scene.samples_at_rest().min(THUMBNAIL_SAMPLES);
    let target = Target { width, height, samples_per_pixel };
    let patience = std::time::Duration::from_secs(app.config().limits.still_seconds);
    let still = app.renderer().still(snapshot, target, false, patience).await?;
    crate::blocking("encoding a thumbnail", move || {
        let Still::Picture(picture) = still else {
            return Err(Fault::internal("drawing a thumbnail", &"the wrong kind of picture"));
        };
        let png = render::still::png(&picture).map_err(|e| Fault::internal("encoding a thumbnail", &e))?;
        if let Err(error) = storage::write_atomically(&path, &png) {
            tracing::warn!(%error, "a thumbnail cannot be kept");
        }
        Ok(png)
    })
    .await?
}

/// A dataset, where its volume comes from, and its scene if it is a sample.
struct Found {
    dataset: Dataset,
    key: Key,
    scene: Option<SceneFile>,
}

async fn find(app: &Arc<App>, id: &str) -> Answer<Found> {
    let (shared, wanted) = (app.clone(), id.to_owned());
    crate::blocking("looking for a dataset", move || {
        if let Some(sample) = shared.samples().get(&wanted) {
            let key = sample.key();
            return Ok(Found { dataset: sample.dataset.clone(), key, scene: Some(sample.scene.clone()) });
        }
        let manifest = shared.catalog().get(&wanted).ok_or_else(|| no_such_dataset(&wanted))?;
        Ok(Found { dataset: manifest.dataset, key: Key::dataset(&wanted), scene: None })
    })
    .await?
}

/// The scene a dataset opens with: a sample's own, or one chosen from the voxels.
///
/// # Errors
/// There is no such dataset, or its volume cannot be loaded.
pub async fn opening_scene(app: &Arc<App>, id: &str) -> Answer<SceneFile> {
    match find(app, id).await?.scene {
        Some(scene) => Ok(scene),
        None => Ok(scene_and_volume(app, id).await?.0),
    }
}

async fn scene_and_volume(app: &Arc<App>, id: &str) -> Answer<(SceneFile, Arc<PreparedVolume>)> {
    let found = find(app, id).await?;
    let volume = app.volumes().load(&found.key, |_| {}).await?;
    if let Some(scene) = found.scene {
        return Ok((scene, volume));
    }
    let source = VolumeSource { dataset: Some(id.to_owned()), ..VolumeSource::default() };
    crate::blocking("choosing a scene", move || {
        (super::default_scene::default_scene(&volume, source), volume)
    })
    .await
}
