//! REST types of `/api/v1`.

use serde::{Deserialize, Serialize};
use ts_rs::TS;
use utoipa::ToSchema;

use crate::control::Role;
use crate::scene_file::{Camera, SceneFile, VoxelType};

/// Problem document, RFC 9457 (`application/problem+json`).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct Problem {
    /// Kind of problem: `about:blank` or a path under `/problems/`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Short summary of the kind.
    pub title: String,
    /// HTTP status.
    pub status: u16,
    /// What happened here, in words, with what to do.
    pub detail: String,
    /// The field at fault, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
}

/// What renders.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, TS, ToSchema)]
pub struct DeviceInfo {
    /// Adapter name as the driver gives it.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// A software device renders at reduced resolution.
    pub software: bool,
}

/// `GET /api/v1/status`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, TS, ToSchema)]
pub struct Status {
    /// Version of the service.
    pub version: String,
    /// What renders.
    pub device: DeviceInfo,
    /// Open sessions.
    pub sessions: u32,
    /// Connected viewers.
    pub viewers: u32,
    /// Largest upload, bytes.
    #[ts(type = "number")]
    pub max_upload_bytes: u64,
    /// Methods that can be chosen; names as in scene files.
    pub methods: Vec<String>,
}

/// A volume one can explore.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct Dataset {
    /// Identifier: content hash of an upload, or the sample's name.
    pub id: String,
    /// For people.
    pub name: String,
    /// Samples come with the service and cannot be deleted.
    pub sample: bool,
    /// `builtin`, or the format of the file, for example `nrrd`, `tiff`, `ome-zarr`.
    pub format: String,
    /// Voxels along x, y, z (after reordering to world axes).
    pub dims: [u32; 3],
    /// Edge lengths of a voxel along x, y, z.
    pub spacing: [f64; 3],
    /// Unit of `spacing`, for example `mm`, where the file says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacing_unit: Option<String>,
    /// Type of a stored voxel.
    pub voxel_type: VoxelType,
    /// Smallest and largest data value.
    pub value_range: [f64; 2],
    /// Whether the axes are anatomical (x left, y posterior, z superior).
    pub anatomical: bool,
    /// Size of the upload, or of the computed voxels, bytes.
    #[ts(type = "number")]
    pub bytes: u64,
    /// Milliseconds since 1970; 0 for samples.
    #[ts(type = "number")]
    pub created_unix_millis: u64,
    /// What the reader wants to be known, for example that only the first volume was taken.
    pub notices: Vec<String>,
    /// Names of the volumes a scene can choose from by `volume.index`; empty where there is one.
    #[serde(default)]
    pub choices: Vec<String>,
    /// Where the data comes from and under which licence, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attribution: Option<String>,
}

/// Light from all directions that a scene can be lit by; `image` of an environment light names it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct Environment {
    /// Identifier: content hash of an upload, or the sample's name.
    pub id: String,
    /// For people.
    pub name: String,
    /// Samples come with the service and cannot be deleted.
    pub sample: bool,
    /// Texels around the horizon, after shrinking.
    pub width: u32,
    /// Texels from pole to pole.
    pub height: u32,
    /// Size of the upload, bytes; 0 for samples.
    #[ts(type = "number")]
    pub bytes: u64,
    /// Linear RGB, mean over all directions at scale 1; absent for those that an earlier version of the
    /// service stored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_radiance: Option<[f64; 3]>,
    /// What the reader wants to be known.
    pub notices: Vec<String>,
}

/// How far a resumable upload has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum UploadState {
    /// Bytes are missing.
    Receiving,
    /// Every byte is there, and the service reads them.
    Reading,
    /// There is a dataset.
    Stored,
    /// No dataset will come of it; `problem` says why. The bytes are gone.
    Refused,
    /// Reading failed for a reason that may pass; `problem` says why. The bytes are kept: a `PATCH`
    /// without a body makes the service read them again, and so does its next start.
    Failed,
}

/// `GET /api/v1/uploads/{id}`: a resumable upload.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct Upload {
    /// How far it has come.
    pub state: UploadState,
    /// Bytes of the whole upload.
    #[ts(type = "number")]
    pub length: u64,
    /// Bytes that are safe at the service.
    #[ts(type = "number")]
    pub offset: u64,
    /// What came of it; absent, too, if it was deleted meanwhile.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dataset: Option<Dataset>,
    /// Why there is no dataset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<Problem>,
}

/// What is shown of a volume, where that is not the whole of it at full resolution.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct ShownVolume {
    /// 0 is full resolution; each further level has half as many voxels along each axis.
    pub level: u32,
    /// Voxels held along x, y, z; of a region, with two more on each side where there are any, which
    /// its borders need.
    pub dims: [u32; 3],
    /// Voxels of the whole volume at full resolution.
    pub whole_dims: [u32; 3],
    /// The box that is shown, in 0..1 coordinates of the whole volume; absent: all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<[[f64; 3]; 2]>,
    /// What is shown and why, in words.
    pub notice: String,
}

/// `GET /api/v1/datasets/{id}/histogram`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
pub struct Histogram {
    /// Data value at the lower edge of the first and the upper edge of the last bucket.
    pub value_range: [f64; 2],
    /// Voxels per bucket; buckets have equal width.
    #[ts(type = "number[]")]
    pub counts: Vec<u64>,
    /// The 65 edges of the scalar bins that caches are keyed by, data values.
    pub bin_edges: Vec<f64>,
    /// For each of the 64 bins the share of the volume that an edit of its values touches, 0..1:
    /// of all blocks of 4 x 4 x 4 voxels, those in which a value of the bin occurs.
    pub bin_shares: Vec<f64>,
}

/// `GET /api/v1/sessions/{id}/histogram`: the data values of what the session's clip region keeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
pub struct RegionHistogram {
    /// Epoch of the scene whose clip region was looked at.
    pub epoch: u32,
    /// Data value at the lower edge of the first and the upper edge of the last bucket; those of
    /// the whole volume.
    pub value_range: [f64; 2],
    /// Voxels with their centre inside clip box and clip planes per bucket; buckets have equal
    /// width.
    #[ts(type = "number[]")]
    pub counts: Vec<u64>,
}

/// `POST /api/v1/sessions/{id}/preview`: what the session would look like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PreviewRequest {
    /// A JSON merge patch (RFC 7396) on the session's scene, which stays as it is; it may not name
    /// another volume.
    #[ts(type = "Record<string, unknown>")]
    #[schema(value_type = Object)]
    pub patch: serde_json::Value,
    /// Width of the picture, pixels, 1 to 512.
    pub width: u32,
    /// Height of the picture, pixels, 1 to 512.
    pub height: u32,
}

/// How pictures of an export are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExportFormat {
    /// One animated PNG, which browsers play again and again.
    #[default]
    Apng,
    /// A zip archive of one PNG a picture: `frame-0001.png` and on.
    Zip,
}

/// A view that the camera of a film comes through.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct CameraKey {
    /// When, seconds, 0 to 3600; at least 0.01 after the view before.
    pub seconds: f64,
    /// The view.
    pub camera: Camera,
}

/// `POST /api/v1/sessions/{id}/exports`: the session's scene from a camera that goes around its
/// target (`turns`), or through views (`keys`). Exactly one of the two.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct ExportRequest {
    /// Width of the pictures, pixels.
    pub width: u32,
    /// Height of the pictures, pixels.
    pub height: u32,
    /// Number of pictures, 2 to 1440.
    pub frames: u32,
    /// Turntable: turns about the camera's upright axis, -10 to 10; positive ones are right-handed
    /// about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turns: Option<f64>,
    /// Film: 2 to 64 views of one projection, in the order of their times. The first picture shows
    /// the first view, the last one the last, and the others stand evenly in time between. From view
    /// to view the camera takes the shorter rotation, and its velocity is continuous; it starts and
    /// ends at rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[ts(optional, as = "Option<Vec<CameraKey>>")]
    pub keys: Vec<CameraKey>,
    /// Pictures a second, 1 to 60, where the format tells.
    pub frames_per_second: u32,
    /// Samples, or paths, per pixel, 1 to 4096; absent: as many as the scene has at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<u32>,
    /// Default apng.
    #[serde(default)]
    pub format: ExportFormat,
    /// Where a turntable begins; absent: the session's camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
}

/// How far an export has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExportState {
    /// Others are drawn first.
    Waiting,
    /// Pictures are drawn.
    Drawing,
    /// The file can be fetched.
    Done,
    /// There will be no file; `problem` says why.
    Failed,
}

/// `GET /api/v1/exports/{id}`. Exports do not survive a restart of the service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct Export {
    /// Identifier.
    pub id: String,
    /// How far it has come.
    pub state: ExportState,
    /// Width of the pictures, pixels.
    pub width: u32,
    /// Height of the pictures, pixels.
    pub height: u32,
    /// How they are kept.
    pub format: ExportFormat,
    /// Number of pictures.
    pub frames: u32,
    /// Pictures that are drawn and written.
    pub frames_done: u32,
    /// Time until it is done, seconds, as far as the pictures so far tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds_left: Option<f64>,
    /// Bytes of the file so far.
    #[ts(type = "number")]
    pub bytes: u64,
    /// Why there is no file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<Problem>,
}

/// `POST /api/v1/sessions`: from a scene, or from a dataset with its default scene.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct CreateSession {
    /// The scene to open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<SceneFile>,
    /// The dataset to open with a scene that suits it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dataset: Option<String>,
}

/// `POST /api/v1/sessions/{id}/probe`: which pixel, of which view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeRequest {
    /// The view.
    pub camera: Camera,
    /// Pixels from the left edge.
    pub x: f64,
    /// Pixels from the upper edge.
    pub y: f64,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
}

/// What lies under a pixel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
pub struct Probe {
    /// The place; absent where the pixel shows nothing that has one.
    pub hit: Option<ProbeHit>,
}

/// A place in the volume: in matter, where half of the light from the ray's matter comes from nearer
/// by; of an isosurface, slice, maximum or minimum its place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
pub struct ProbeHit {
    /// World.
    pub position: [f64; 3],
    /// Indices of the voxel that holds it, along the world axes.
    pub voxel: [u32; 3],
    /// Data value there.
    pub value: f64,
}

/// A session: a scene with its caches. In `GET /api/v1/sessions` each is told as to those who watch:
/// the identifier for editing is known to those who opened it, or were given it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct Session {
    /// Identifier.
    pub id: String,
    /// Epoch of the newest scene.
    pub epoch: u32,
    /// Connected viewers.
    pub viewers: u32,
    /// Milliseconds since 1970.
    #[ts(type = "number")]
    pub created_unix_millis: u64,
    /// When it was last used, milliseconds since 1970.
    #[ts(type = "number")]
    pub used_unix_millis: u64,
    /// What the identifier it was asked for with allows.
    pub role: Role,
    /// Identifier under which it can be watched, but not edited; absent for those who watch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub watch: Option<String>,
    /// The newest scene, camera filled in.
    pub scene: SceneFile,
    /// What is shown of the volume; absent: the whole of it at full resolution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shown: Option<ShownVolume>,
}
