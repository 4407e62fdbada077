//! The scene file: one format for the file on disk, the share link, the wire and the benchmarks.
//!
//! Decode with [`SceneFile::from_json`]; a value that came out of it is complete (defaults
//! filled in) and within range.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use ts_rs::TS;
use utoipa::ToSchema;

use crate::field::{self, FieldError, tagged_by_type};

/// Version of the scene format this crate reads and writes.
pub const SCENE_VERSION: u32 = 1;

/// Linear RGB, or any other triple of numbers.
pub type Triple = [f64; 3];

/// A complete scene: what to draw, how it is lit, from where, and with which method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct SceneFile {
    /// Format version, [`SCENE_VERSION`].
    pub version: u32,
    /// Where the voxels come from.
    pub volume: VolumeSource,
    /// Data values mapped to `s` = 0 and 1; the data's own minimum and maximum if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value_range: Option<[f64; 2]>,
    /// Overrides the file's voxel spacing, in the order of the world axes x, y, z; any unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacing: Option<[f64; 3]>,
    /// Multiplies extinction everywhere; >= 0.
    #[serde(default = "one")]
    pub density: f64,
    /// Maps `s` to extinction, albedo, emission and material.
    #[serde(default)]
    pub transfer_function: TransferFunction,
    /// Scattering behaviour by name; points of the transfer function refer to it.
    #[serde(default)]
    pub materials: BTreeMap<String, Material>,
    /// Light sources; at most [`limits::MAX_LIGHTS`].
    #[serde(default)]
    pub lights: Vec<Light>,
    /// The view; chosen from the volume's orientation if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// Parts of the volume to leave out.
    #[serde(default)]
    pub clip: Clip,
    /// What is seen where the volume is transparent.
    #[serde(default)]
    #[schema(value_type = serde_json::Value)]
    pub background: Background,
    /// How many scattering events a light path may have.
    #[serde(default)]
    pub scattering: Scattering,
    /// The illumination method and its parameters.
    #[serde(default)]
    pub illumination: Illumination,
    /// Sampling of view rays and pixels.
    #[serde(default)]
    pub sampling: Sampling,
    /// What is drawn: matter in light, or a measure of the values along each ray.
    #[serde(default)]
    pub rendering: Rendering,
    /// From linear radiance to the picture on screen; does not touch float output.
    #[serde(default)]
    pub film: Film,
    /// Size of the image where nothing else gives one.
    #[serde(default)]
    pub image: ImageSize,
}

/// Named bounds of a scene.
pub mod limits {
    /// Most transfer-function points.
    pub const MAX_TRANSFER_FUNCTION_POINTS: usize = 256;
    /// Most lights.
    pub const MAX_LIGHTS: usize = 64;
    /// Most materials.
    pub const MAX_MATERIALS: usize = 64;
    /// Most clip planes.
    pub const MAX_CLIP_PLANES: usize = 8;
    /// Largest image edge, pixels.
    pub const MAX_IMAGE_EDGE: u32 = 8192;
    /// Largest edge of a built-in or raw volume, voxels.
    pub const MAX_VOLUME_EDGE: u32 = 2048;
    /// Most paths of a pixel.
    pub const MAX_PATHS_PER_PIXEL: u32 = 1 << 20;
    /// Photons of a light.
    pub const MAX_PHOTONS: u32 = 1 << 24;
    /// Most scattering events of a path.
    pub const MAX_PATH_LENGTH: u32 = 1_000_000_000;
    /// Records of method `image_based` along the longest edge.
    pub const MAX_RECORDS: u32 = 100;
    /// Directions that its records may look in.
    pub const RECORD_DIRECTIONS: [u32; 4] = [12, 48, 192, 768];
    /// Lights that any light from infinity may be made of, in method `precomputed_transfer`.
    pub const TRANSFER_LIGHTS: [u32; 3] = [42, 162, 642];
    /// Directions that its light may be marched from.
    pub const TRANSFER_DIRECTIONS: [u32; 4] = [48, 192, 768, 3072];
    /// Bands of spherical harmonics.
    pub const MAX_BANDS: u32 = 6;
    /// Most segments a view ray is kept in.
    pub const MAX_SEGMENTS: u32 = 32;
    /// Coarsest level of a volume that can be asked for.
    pub const MAX_LEVEL: u32 = 16;
    /// Shortest edge of a region, share of the volume's edge.
    pub const MIN_REGION_EDGE: f64 = 1e-6;
    /// Opacity is clamped to this before it becomes an extinction.
    pub const MAX_OPACITY: f64 = 0.9999;
    /// Reference length, world units, of an opacity: `extinction = -ln(1 - opacity) / 0.01`.
    pub const OPACITY_LENGTH: f64 = 0.01;
    /// Largest magnitude of any number in a scene; keeps f32 products finite.
    pub const MAX_MAGNITUDE: f64 = 1e9;
}

/// Where the voxels come from: exactly one of `file`, `builtin`, `dataset`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct VolumeSource {
    /// Path relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// A volume computed from a formula.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub builtin: Option<Builtin>,
    /// Identifier of an uploaded dataset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dataset: Option<String>,
    /// Interpolation between voxels; `nearest` is for label volumes.
    #[serde(default)]
    pub filter: Filter,
    /// Size x, y, z in voxels: of a built-in (default 64 each) or a raw file (required).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dims: Option<[u32; 3]>,
    /// Raw file: type of a voxel.
    #[serde(default, rename = "type", skip_serializing_if = "Option::is_none")]
    pub voxel_type: Option<VoxelType>,
    /// Raw file: byte order, default little.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub endian: Option<Endian>,
    /// Raw file: bytes to skip before the first voxel, default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[ts(type = "number")]
    pub header_bytes: Option<u64>,
    /// Which volume or component of a file that holds several, default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub index: Option<u32>,
    /// Finest level shown: 0, the default, is full resolution, each further one has half as many
    /// voxels along each axis. A coarser one is shown where this one does not fit the device.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level: Option<u32>,
    /// Shows only this box, lower and upper corner in 0..1 coordinates of the whole volume, in the
    /// finest level in which it fits. It keeps its place in the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<[[f64; 3]; 2]>,
}

/// Interpolation of data values between voxel centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Filter {
    /// Trilinear.
    #[default]
    Linear,
    /// The value of the voxel the point lies in.
    Nearest,
}

/// Volumes computed from formulas, at any size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Builtin {
    /// Closed box with labelled walls and two blocks (Historygrams paper).
    CornellBox,
    /// A field of pillars.
    Pillars,
    /// Electron-density-like carbon cage of 60 atoms.
    Buckyball,
    /// A turbulent smoke plume.
    SmokePlume,
    /// A branching tree of vessels, over 99 % empty.
    VesselTree,
    /// A thick scattering blob.
    ThickBlob,
    /// Concentric shells.
    NestedShells,
    /// The Marschner-Lobb test signal.
    MarschnerLobb,
    /// One value everywhere: the closed forms' volume.
    Homogeneous,
}

impl Builtin {
    /// Every built-in volume.
    pub const ALL: [Builtin; 9] = [
        Builtin::CornellBox,
        Builtin::Pillars,
        Builtin::Buckyball,
        Builtin::SmokePlume,
        Builtin::VesselTree,
        Builtin::ThickBlob,
        Builtin::NestedShells,
        Builtin::MarschnerLobb,
        Builtin::Homogeneous,
    ];

    /// The name used in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Builtin::CornellBox => "cornell_box",
            Builtin::Pillars => "pillars",
            Builtin::Buckyball => "buckyball",
            Builtin::SmokePlume => "smoke_plume",
            Builtin::VesselTree => "vessel_tree",
            Builtin::ThickBlob => "thick_blob",
            Builtin::NestedShells => "nested_shells",
            Builtin::MarschnerLobb => "marschner_lobb",
            Builtin::Homogeneous => "homogeneous",
        }
    }
}

/// Type of one voxel of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum VoxelType {
    Uint8,
    Int8,
    Uint16,
    Int16,
    Uint32,
    Int32,
    Uint64,
    Int64,
    Float32,
    Float64,
}

/// Byte order of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Endian {
    #[default]
    Little,
    Big,
}

/// Piecewise linear in `s`, constant beyond the ends. Two points at the same `s` make a step:
/// the later one holds at and above `s`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TransferFunction {
    /// At least one point, `s` ascending.
    pub points: Vec<TransferFunctionPoint>,
}

impl Default for TransferFunction {
    /// A neutral ramp: the lowest values transparent, the highest dense.
    fn default() -> Self {
        let point = |s: f64, extinction: f64| TransferFunctionPoint {
            s,
            extinction: Some(extinction),
            ..TransferFunctionPoint::default()
        };
        Self { points: vec![point(0.0, 0.0), point(0.15, 0.0), point(1.0, 60.0)] }
    }
}

/// Matter at one value of `s`. Exactly one of `extinction` and `opacity`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct TransferFunctionPoint {
    /// Position, 0..1.
    pub s: f64,
    /// Extinction per world unit, >= 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extinction: Option<f64>,
    /// Alternative to extinction: opacity of 0.01 world units, 0..1, clamped to 0.9999.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub opacity: Option<f64>,
    /// Share of the extinction that scatters, linear RGB, 0..1.
    #[serde(default = "white")]
    pub albedo: [f64; 3],
    /// Emitted radiance (weighted by absorption), linear RGB, >= 0.
    #[serde(default)]
    pub emission: [f64; 3],
    /// Name of a material, valid up to the next point; none means isotropic scattering.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
}

impl Default for TransferFunctionPoint {
    fn default() -> Self {
        Self { s: 0.0, extinction: None, opacity: None, albedo: [1.0; 3], emission: [0.0; 3], material: None }
    }
}

impl TransferFunctionPoint {
    /// Extinction per world unit, opacity converted.
    pub fn sigma_t(&self) -> f64 {
        match (self.extinction, self.opacity) {
            (Some(extinction), _) => extinction,
            (None, Some(opacity)) => -(1.0 - opacity.min(limits::MAX_OPACITY)).ln() / limits::OPACITY_LENGTH,
            (None, None) => 0.0,
        }
    }
}

/// How matter scatters: `(1 - surface) * phase + surface * brdf * |n . w_i|`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct Material {
    /// Phase function, integrates to 1 over the sphere.
    #[serde(default)]
    pub phase: Phase,
    /// Weight of the BRDF against the phase function, 0..1.
    #[serde(default)]
    pub surface: f64,
    /// Required where `surface` > 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brdf: Option<Brdf>,
}

/// Phase function; positive asymmetry scatters forward.
#[derive(Debug, Clone, PartialEq, Default, Serialize, TS, ToSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Phase {
    /// `1 / (4 pi)`.
    #[default]
    Isotropic,
    /// Henyey-Greenstein.
    HenyeyGreenstein(HenyeyGreenstein),
    /// Schlick's approximation, `(1 - k^2) / (4 pi (1 - k cos_theta)^2)`.
    Schlick(Schlick),
}

/// No parameters; refuses unknown fields.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NoParameters {}

impl<'de> Deserialize<'de> for Phase {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        enum Tagged {
            Isotropic(NoParameters),
            HenyeyGreenstein(HenyeyGreenstein),
            Schlick(Schlick),
        }
        tagged_by_type!(Tagged {
            "isotropic" => Isotropic,
            "henyey_greenstein" => HenyeyGreenstein,
            "schlick" => Schlick,
        });
        Ok(match Tagged::deserialize(deserializer)? {
            Tagged::Isotropic(NoParameters {}) => Phase::Isotropic,
            Tagged::HenyeyGreenstein(p) => Phase::HenyeyGreenstein(p),
            Tagged::Schlick(p) => Phase::Schlick(p),
        })
    }
}

/// Parameters of [`Phase::HenyeyGreenstein`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct HenyeyGreenstein {
    /// Mean cosine, -0.999..0.999.
    pub g: f64,
}

/// Parameters of [`Phase::Schlick`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Schlick {
    /// Asymmetry, -0.999..0.999.
    pub k: f64,
}

/// Surface reflection. The albedo multiplies the diffuse part; the specular part is achromatic.
#[derive(Debug, Clone, PartialEq, Serialize, TS, ToSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Brdf {
    /// `diffuse / pi`.
    Lambert(Lambert),
    /// Lambert plus a normalised half-vector lobe.
    BlinnPhong(BlinnPhong),
    /// Ashikhmin and Shirley 2000.
    AshikhminShirley(AshikhminShirley),
    /// Lambert plus `a / (1 + b (1 - n . h))^c`.
    Abc(Abc),
}

tagged_by_type!(Brdf {
    "lambert" => Lambert,
    "blinn_phong" => BlinnPhong,
    "ashikhmin_shirley" => AshikhminShirley,
    "abc" => Abc,
});

/// Parameters of [`Brdf::Lambert`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Lambert {
    /// Diffuse reflectance, 0..1.
    pub diffuse: f64,
}

/// Parameters of [`Brdf::BlinnPhong`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BlinnPhong {
    /// Diffuse reflectance, 0..1.
    pub diffuse: f64,
    /// Specular reflectance, 0..1.
    pub specular: f64,
    /// Exponent of `n . h`, 0..10000.
    pub exponent: f64,
}

/// Parameters of [`Brdf::AshikhminShirley`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AshikhminShirley {
    /// Diffuse reflectance, 0..1.
    pub diffuse: f64,
    /// Specular reflectance at normal incidence, 0..1.
    pub specular: f64,
    /// Exponents along the two tangents, 0..10000.
    pub exponents: [f64; 2],
}

/// Parameters of [`Brdf::Abc`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Abc {
    /// Diffuse reflectance, 0..1.
    pub diffuse: f64,
    /// Peak of the lobe, per steradian, >= 0.
    pub a: f64,
    /// Width, >= 0.
    pub b: f64,
    /// Fall-off, >= 0.
    pub c: f64,
}

/// A light source. Lights neither block light nor are seen.
#[derive(Debug, Clone, PartialEq, Serialize, TS, ToSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Light {
    /// From infinitely far, one direction.
    Directional(DirectionalLight),
    /// From a point in every direction.
    Point(PointLight),
    /// From a point into a cone.
    Spot(SpotLight),
    /// One-sided rectangle.
    Rectangle(RectangleLight),
    /// One-sided disk.
    Disk(DiskLight),
    /// Sphere.
    Sphere(SphereLight),
    /// From every direction: uniform, or a latitude-longitude map.
    Environment(EnvironmentLight),
}

tagged_by_type!(Light {
    "directional" => Directional,
    "point" => Point,
    "spot" => Spot,
    "rectangle" => Rectangle,
    "disk" => Disk,
    "sphere" => Sphere,
    "environment" => Environment,
});

/// Parameters of [`Light::Directional`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct DirectionalLight {
    /// Stable name that keeps caches across edits; default the index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Off lights stay in the scene and shine nothing.
    #[serde(default = "yes")]
    pub enabled: bool,
    /// The direction the light travels; need not be normalised.
    pub direction: [f64; 3],
    /// Irradiance on a perpendicular plane, linear RGB.
    pub irradiance: [f64; 3],
}

/// Parameters of [`Light::Point`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct PointLight {
    /// Stable name that keeps caches across edits; default the index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Off lights stay in the scene and shine nothing.
    #[serde(default = "yes")]
    pub enabled: bool,
    /// World position.
    pub position: [f64; 3],
    /// Radiant intensity: irradiance at distance d is `intensity / d^2`.
    pub intensity: [f64; 3],
}

/// Parameters of [`Light::Spot`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct SpotLight {
    /// Stable name that keeps caches across edits; default the index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Off lights stay in the scene and shine nothing.
    #[serde(default = "yes")]
    pub enabled: bool,
    /// World position.
    pub position: [f64; 3],
    /// Axis of the cone, the direction the light travels.
    pub direction: [f64; 3],
    /// Half-angles: full inside the first, smoothstep in the cosine to 0 at the second.
    pub cone_degrees: [f64; 2],
    /// Radiant intensity along the axis.
    pub intensity: [f64; 3],
}

/// Parameters of [`Light::Rectangle`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct RectangleLight {
    /// Stable name that keeps caches across edits; default the index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Off lights stay in the scene and shine nothing.
    #[serde(default = "yes")]
    pub enabled: bool,
    /// World position of the centre.
    pub center: [f64; 3],
    /// The side that shines.
    pub normal: [f64; 3],
    /// Second edge; made perpendicular to the normal.
    pub up: [f64; 3],
    /// Edge lengths: `size[0]` along `up x normal`, `size[1]` along `up`.
    pub size: [f64; 2],
    /// Emitted radiance.
    pub radiance: [f64; 3],
}

/// Parameters of [`Light::Disk`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct DiskLight {
    /// Stable name that keeps caches across edits; default the index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Off lights stay in the scene and shine nothing.
    #[serde(default = "yes")]
    pub enabled: bool,
    /// World position of the centre.
    pub center: [f64; 3],
    /// The side that shines.
    pub normal: [f64; 3],
    /// Radius, world units.
    pub radius: f64,
    /// Emitted radiance.
    pub radiance: [f64; 3],
}

/// Parameters of [`Light::Sphere`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct SphereLight {
    /// Stable name that keeps caches across edits; default the index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Off lights stay in the scene and shine nothing.
    #[serde(default = "yes")]
    pub enabled: bool,
    /// World position of the centre.
    pub center: [f64; 3],
    /// Radius, world units.
    pub radius: f64,
    /// Emitted radiance.
    pub radiance: [f64; 3],
}

/// Parameters of [`Light::Environment`]: either `radiance` or `image`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct EnvironmentLight {
    /// Stable name that keeps caches across edits; default the index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Off lights stay in the scene and shine nothing.
    #[serde(default = "yes")]
    pub enabled: bool,
    /// Uniform radiance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radiance: Option<[f64; 3]>,
    /// Latitude-longitude image, row 0 = +y: a file beside a scene on disk, or the identifier of an
    /// environment of the service.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Multiplies the image, default 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Rotation about x, then y, then z, right-handed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation_degrees: Option<[f64; 3]>,
}

impl Light {
    /// The stable name given in the file, if any.
    pub fn id(&self) -> Option<&str> {
        match self {
            Light::Directional(l) => l.id.as_deref(),
            Light::Point(l) => l.id.as_deref(),
            Light::Spot(l) => l.id.as_deref(),
            Light::Rectangle(l) => l.id.as_deref(),
            Light::Disk(l) => l.id.as_deref(),
            Light::Sphere(l) => l.id.as_deref(),
            Light::Environment(l) => l.id.as_deref(),
        }
    }

    /// Whether the light shines.
    pub fn enabled(&self) -> bool {
        match self {
            Light::Directional(l) => l.enabled,
            Light::Point(l) => l.enabled,
            Light::Spot(l) => l.enabled,
            Light::Rectangle(l) => l.enabled,
            Light::Disk(l) => l.enabled,
            Light::Sphere(l) => l.enabled,
            Light::Environment(l) => l.enabled,
        }
    }
}

/// The view. Exactly one of `fov_y_degrees` and `orthographic_height`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct Camera {
    /// Eye, world.
    pub position: [f64; 3],
    /// Point looked at, world.
    pub target: [f64; 3],
    /// Up direction; made perpendicular to the view direction.
    pub up: [f64; 3],
    /// Perspective: full vertical angle of view, 0.1..179.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov_y_degrees: Option<f64>,
    /// Orthographic: height of the whole image in world units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orthographic_height: Option<f64>,
}

/// Parts of the volume to leave out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
#[ts(optional_fields)]
pub struct Clip {
    /// Keeps what lies inside; lower and upper corner in 0..1 volume coordinates.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Each keeps `dot(normal, x) >= offset` (world).
    #[serde(default)]
    pub planes: Vec<ClipPlane>,
    /// Whether clipped matter still blocks light.
    #[serde(default = "yes")]
    pub shadows: bool,
}

impl Default for Clip {
    fn default() -> Self {
        Self { bounds: None, planes: Vec::new(), shadows: true }
    }
}

/// Keeps `dot(normal, x) >= offset`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ClipPlane {
    /// World; normalised on use.
    pub normal: [f64; 3],
    /// World units along the normalised normal.
    pub offset: f64,
}

/// What is seen where the volume is transparent.
#[derive(Debug, Clone, Copy, PartialEq, TS)]
#[ts(type = "[number, number, number] | \"environment\"")]
pub enum Background {
    /// Linear radiance.
    Color([f64; 3]),
    /// The environment light.
    Environment,
}

impl Default for Background {
    fn default() -> Self {
        Background::Color([0.0; 3])
    }
}

impl Serialize for Background {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Background::Color(color) => color.serialize(serializer),
            Background::Environment => serializer.serialize_str("environment"),
        }
    }
}

impl<'de> Deserialize<'de> for Background {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        use serde::de::Error as _;
        let value = serde_json::Value::deserialize(deserializer)?;
        if value == "environment" {
            return Ok(Background::Environment);
        }
        field::from_value(value)
            .map(Background::Color)
            .map_err(|_| D::Error::custom("must be three numbers (linear radiance) or \"environment\""))
    }
}

/// How many scattering events a light path may have.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Scattering {
    /// `"all"`, 1 (single scattering), or n.
    #[schema(value_type = serde_json::Value)]
    pub orders: Orders,
}

/// `"all"` or a count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, TS)]
#[ts(type = "number | \"all\"")]
pub enum Orders {
    /// Every order.
    #[default]
    All,
    /// At most this many, >= 1.
    AtMost(u32),
}

impl Serialize for Orders {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Orders::All => serializer.serialize_str("all"),
            Orders::AtMost(count) => serializer.serialize_u32(*count),
        }
    }
}

impl<'de> Deserialize<'de> for Orders {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        use serde::de::Error as _;
        let value = serde_json::Value::deserialize(deserializer)?;
        match value.as_u64() {
            _ if value == "all" => Ok(Orders::All),
            Some(count @ 1..=1_000_000) => Ok(Orders::AtMost(count as u32)),
            _ => Err(D::Error::custom("must be \"all\" or a whole number from 1 to 1000000")),
        }
    }
}

/// The illumination method; its parameters stand beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Illumination {
    /// Which method supplies the in-scattered radiance.
    pub method: Method,
    /// `path_traced`, and others where they `refine`: paths of each pixel at rest, 1..1048576.
    pub paths_per_pixel: u32,
    /// The same: ends earlier, once the picture's relative standard error is no more than this, 0..1.
    pub max_error: f64,
    /// `path_traced`: scattering events after which a path is cut, 1..10^9. What is lost by it is
    /// counted.
    pub longest_path: u32,
    /// `path_traced`: what each light brings is kept apart, so that colours, strengths and switches
    /// of lights change the picture without a new path. At most 8 lights.
    pub light_layers: bool,
    /// Methods that approximate all light, `photon_map`, `convection_diffusion` and
    /// `precomputed_transfer`: at rest paths are followed, too, and the picture goes over to what they
    /// find as far as that is known better.
    pub refine: bool,
    /// `photon_map`: photons of each light, 1..16777216.
    pub photons: u32,
    /// `photon_map`: most interactions of a photon, 1..256. What is lost by it is counted.
    pub photon_events: u32,
    /// `photon_map`: texels of the light field along the volume's longest edge, 4..256.
    pub photon_grid: u32,
    /// `photon_map`: bands of spherical harmonics that hold the light where matter is not isotropic,
    /// 1..6; 0: as many as the phase functions ask for.
    pub photon_bands: u32,
    /// `photon_map`: where view rays find the light that photons bring.
    pub gather: LightGather,
    /// `photon_map`, `image_based`: cells along the volume's longest edge of the grid that holds what
    /// lights bring by themselves, 4..256; none smaller than half a voxel.
    pub direct_grid: u32,
    /// `convection_diffusion`: cells of the light grid along each axis for a voxel, 0.01..2.
    pub light_grid: f64,
    /// `convection_diffusion`: bands of diffused light, 1..6: 1 is its mean, 2 adds where it flows to,
    /// which isotropic matter does not see. More is taken as 2: P1 has no more.
    pub light_bands: u32,
    /// `convection_diffusion`: how light is carried from its source.
    pub transport: LightTransport,
    /// `convection_diffusion`, explicit transport: steps in time of each front of cells, 1..100.
    pub explicit_steps: u32,
    /// `convection_diffusion`: what becomes of light that is scattered.
    pub diffusion: Diffusion,
    /// `convection_diffusion`, heat flow: how far light spreads in vacuum, world units, 0..1.
    pub heat_spread: f64,
    /// `convection_diffusion`: norm of the residual, as a share of that of the source, at which diffusion
    /// is solved, 10^-5..0.5.
    pub max_residual: f64,
    /// `image_based`: records along the longest edge of the volume's box, 2..100.
    pub records: u32,
    /// `image_based`: directions a record looks in: 12, 48, 192 or 768.
    pub record_directions: u32,
    /// `image_based`: bands of spherical harmonics, 1..6.
    pub record_bands: u32,
    /// `image_based`: what a record holds.
    pub record_form: RecordForm,
    /// `image_based`: how a sample in matter reads the records.
    pub record_lookup: RecordLookup,
    /// `image_based`: damps the higher bands of the light, against ringing.
    pub record_window: bool,
    /// `image_based`, form `product`: how often records exchange scattered light with one another, 0..64.
    /// Each time adds an order of scattering; 0: light that is scattered once, alone.
    pub record_exchange: u32,
    /// `precomputed_transfer`: lights that any light from infinity is made of: 42, 162 or 642.
    pub transfer_lights: u32,
    /// `precomputed_transfer`: texels of the baked light along the volume's longest edge, 4..128; fewer
    /// where memory does not suffice.
    pub transfer_grid: u32,
    /// `precomputed_transfer`: directions that light is marched from which is not scattered before:
    /// 48, 192, 768 or 3072.
    pub transfer_directions: u32,
    /// `precomputed_transfer`: photons of the bake, 1..16777216.
    pub transfer_photons: u32,
    /// `precomputed_transfer`: most interactions of a photon, 1..256. What is lost by it is counted.
    pub transfer_events: u32,
    /// `precomputed_transfer`: bands of spherical harmonics that hold the light where matter is not
    /// isotropic, 1..6.
    pub transfer_bands: u32,
    /// `precomputed_transfer`: clusters that the finished bake is compressed into, each a few matrices that
    /// every texel of it is a sum of; 0 (it stays as it is) or 32..256.
    pub transfer_clusters: u32,
}

/// Where view rays find the light that photons bring, in method `photon_map`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightGather {
    /// In the light field, whose bands blur where it comes from.
    #[default]
    Field,
    /// Once all photons are there, in the photons themselves: of those about a texel of the field away each
    /// by its own direction. Exact for narrow phase functions and lobes; slower, the more photons there are.
    Ray,
}

/// How light is carried from its source over the grid, in method `convection_diffusion`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightTransport {
    /// Along lines that follow its directions: second order in the cell.
    #[default]
    Characteristics,
    /// From cell to cell in order of dependence: first order, blurs shadows.
    Upwind,
    /// From cell to cell by steps in time, as published; for comparison.
    Explicit,
}

/// What becomes of light that is scattered, in method `convection_diffusion`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Diffusion {
    /// It follows the P1 approximation of light transport: right in thick matter that absorbs little.
    #[default]
    P1,
    /// It spreads like heat for a while: soft light without a physical unit.
    Heat,
    /// It is lost: single scattering.
    None,
}

/// What a record of method `image_based` holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordForm {
    /// The product of transmittance and light, in bands; phase functions act band by band.
    #[default]
    Product,
    /// The dot product of transmittance and light, each in bands; scattering is taken as isotropic.
    Isotropic,
    /// As `product`, with transmittance and light looked at in the centres of directions only.
    Static,
    /// As `isotropic`, with the phase function towards the camera; follows the camera.
    Dynamic,
}

/// How records of method `image_based` are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordLookup {
    /// Interpolated between eight records.
    #[default]
    Trilinear,
    /// The record whose cell holds the sample.
    Containing,
}

impl Default for Illumination {
    fn default() -> Self {
        Self {
            method: Method::default(),
            paths_per_pixel: 256,
            max_error: 0.0,
            longest_path: 100_000,
            light_layers: false,
            refine: false,
            photons: 65_536,
            photon_events: 32,
            photon_grid: 32,
            photon_bands: 0,
            gather: LightGather::default(),
            direct_grid: 64,
            light_grid: 0.5,
            light_bands: 2,
            transport: LightTransport::default(),
            explicit_steps: 5,
            diffusion: Diffusion::default(),
            heat_spread: 0.05,
            max_residual: 1e-3,
            records: 32,
            record_directions: 48,
            record_bands: 3,
            record_form: RecordForm::default(),
            record_lookup: RecordLookup::default(),
            record_window: false,
            record_exchange: 0,
            transfer_lights: 162,
            transfer_grid: 32,
            transfer_directions: 192,
            transfer_photons: 262_144,
            transfer_events: 32,
            transfer_bands: 3,
            transfer_clusters: 0,
        }
    }
}

/// The closed set of illumination methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Classic shading without shadows.
    #[default]
    Local,
    /// Convection-diffusion on a grid.
    ConvectionDiffusion,
    /// Image-based lighting with spherical harmonics.
    ImageBased,
    /// Precomputed volume radiance transfer.
    PrecomputedTransfer,
    /// Historygram photon mapping.
    PhotonMap,
    /// Unbiased path tracing.
    PathTraced,
}

impl Method {
    /// Every method, fastest first.
    pub const ALL: [Method; 6] = [
        Method::Local,
        Method::ConvectionDiffusion,
        Method::ImageBased,
        Method::PrecomputedTransfer,
        Method::PhotonMap,
        Method::PathTraced,
    ];

    /// The name used in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Method::Local => "local",
            Method::ConvectionDiffusion => "convection_diffusion",
            Method::ImageBased => "image_based",
            Method::PrecomputedTransfer => "precomputed_transfer",
            Method::PhotonMap => "photon_map",
            Method::PathTraced => "path_traced",
        }
    }
}

/// Sampling of view rays and pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sampling {
    /// Distance between samples on a view ray of a projection or isosurface, and the longest part of
    /// one through matter within which the field is taken as linear, in units of the smallest voxel
    /// edge, 1/16..8.
    pub step_voxels: f64,
    /// Jittered passes accumulated at rest, 1..4096.
    pub samples_per_pixel: u32,
    /// Skips macrocells without matter; never changes the image.
    pub skip_empty: bool,
    /// A ray ends when less than this share of what lies behind it would be seen, 0..0.5.
    pub termination_transmittance: f64,
    /// Who interpolates between voxels, for the linear filter.
    pub interpolation: Interpolation,
    /// Segments a view ray is kept in between edits of matter, so that an edit casts anew only
    /// those it touches, 0..32; 0 keeps none.
    pub segments: u32,
}

/// What is drawn.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[ts(optional_fields)]
pub struct Rendering {
    /// What a pixel shows.
    pub mode: RenderingMode,
    /// Data value of the isosurface; the middle of the value range if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub isovalue: Option<f64>,
    /// Data values shown black and white by projections and slices; the value range if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window: Option<[f64; 2]>,
    /// The plane that `slice` shows.
    pub slice: SlicePlane,
}

/// What a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RenderingMode {
    /// Matter of the transfer function, in light.
    #[default]
    Volume,
    /// The largest value on the ray, as a grey of the window.
    Maximum,
    /// The smallest value on the ray, as a grey of the window.
    Minimum,
    /// The mean value along the ray, as a grey of the window.
    Average,
    /// The first place on the ray that has the isovalue, as an opaque surface in light.
    Isosurface,
    /// The value where the ray meets a plane, as a grey of the window.
    Slice,
}

/// The points with `dot(normal, x) = offset`, world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SlicePlane {
    /// Normalised on use.
    pub normal: [f64; 3],
    /// World units from the centre of the volume.
    pub offset: f64,
}

impl Default for SlicePlane {
    fn default() -> Self {
        Self { normal: [0.0, 0.0, 1.0], offset: 0.0 }
    }
}

/// How the linear filter's weights are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// By the device's texture sampler, with the precision it has (8 bits of weight are common).
    #[default]
    Sampler,
    /// By the shader, in f32, from eight voxels.
    Exact,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            step_voxels: 1.0,
            samples_per_pixel: 8,
            skip_empty: true,
            termination_transmittance: 1e-3,
            segments: 4,
            interpolation: Interpolation::default(),
        }
    }
}

/// From linear radiance to the picture on screen.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Film {
    /// Radiance is multiplied by 2 to this power, -20..20.
    pub exposure_stops: f64,
    /// The operator applied before the sRGB curve.
    pub tone_mapping: ToneMapping,
}

/// Tone-mapping operators.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToneMapping {
    /// Khronos PBR Neutral: colours below 0.8 stay as they are, highlights roll off.
    #[default]
    Neutral,
    /// Clipped at 1.
    Linear,
    /// `x / (1 + x)` on the luminance.
    Reinhard,
}

/// Image size in pixels.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, TS, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSize {
    /// Pixels, 1..8192.
    pub width: u32,
    /// Pixels, 1..8192.
    pub height: u32,
}

impl Default for ImageSize {
    fn default() -> Self {
        Self { width: 256, height: 256 }
    }
}

impl SceneFile {
    /// A scene with defaults for everything but the volume.
    pub fn new(volume: VolumeSource) -> Self {
        Self {
            version: SCENE_VERSION,
            volume,
            value_range: None,
            spacing: None,
            density: 1.0,
            transfer_function: TransferFunction::default(),
            materials: BTreeMap::new(),
            lights: Vec::new(),
            camera: None,
            clip: Clip::default(),
            background: Background::default(),
            scattering: Scattering::default(),
            illumination: Illumination::default(),
            sampling: Sampling::default(),
            rendering: Rendering::default(),
            film: Film::default(),
            image: ImageSize::default(),
        }
    }

    /// Decodes and checks a scene.
    pub fn from_json(text: &str) -> Result<Self, FieldError> {
        let scene: Self = field::from_json(text)?;
        scene.validate()?;
        Ok(scene)
    }

    /// Decodes and checks a scene.
    pub fn from_value(value: serde_json::Value) -> Result<Self, FieldError> {
        let scene: Self = field::from_value(value)?;
        scene.validate()?;
        Ok(scene)
    }

    /// Checks every range and reference; the first fault is returned.
    pub fn validate(&self) -> Result<(), FieldError> {
        crate::validate::scene(self)
    }
}

fn one() -> f64 {
    1.0
}

fn white() -> [f64; 3] {
    [1.0; 3]
}

fn yes() -> bool {
    true
}
