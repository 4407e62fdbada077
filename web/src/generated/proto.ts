// Generated from the Rust crate `proto`; do not edit. `make web-types` rewrites it.

export type SceneFile = { 
/**
 * Format version, [`SCENE_VERSION`].
 */
version: number, 
/**
 * Where the voxels come from.
 */
volume: VolumeSource, 
/**
 * Data values mapped to `s` = 0 and 1; the data's own minimum and maximum if absent.
 */
value_range?: [number, number], 
/**
 * Overrides the file's voxel spacing, in the order of the world axes x, y, z; any unit.
 */
spacing?: [number, number, number], 
/**
 * Multiplies extinction everywhere; >= 0.
 */
density: number, 
/**
 * Maps `s` to extinction, albedo, emission and material.
 */
transfer_function: TransferFunction, 
/**
 * Scattering behaviour by name; points of the transfer function refer to it.
 */
materials: { [key in string]: Material }, 
/**
 * Light sources; at most [`limits::MAX_LIGHTS`].
 */
lights: Array<Light>, 
/**
 * The view; chosen from the volume's orientation if absent.
 */
camera?: Camera, 
/**
 * Parts of the volume to leave out.
 */
clip: Clip, 
/**
 * What is seen where the volume is transparent.
 */
background: Background, 
/**
 * How many scattering events a light path may have.
 */
scattering: Scattering, 
/**
 * The illumination method and its parameters.
 */
illumination: Illumination, 
/**
 * Sampling of view rays and pixels.
 */
sampling: Sampling, 
/**
 * What is drawn: matter in light, or a measure of the values along each ray.
 */
rendering: Rendering, 
/**
 * From linear radiance to the picture on screen; does not touch float output.
 */
film: Film, 
/**
 * Size of the image where nothing else gives one.
 */
image: ImageSize, };

export type VolumeSource = { 
/**
 * Path relative to the scene file.
 */
file?: string, 
/**
 * A volume computed from a formula.
 */
builtin?: Builtin, 
/**
 * Identifier of an uploaded dataset.
 */
dataset?: string, 
/**
 * Interpolation between voxels; `nearest` is for label volumes.
 */
filter: Filter, 
/**
 * Size x, y, z in voxels: of a built-in (default 64 each) or a raw file (required).
 */
dims?: [number, number, number], 
/**
 * Raw file: type of a voxel.
 */
type?: VoxelType, 
/**
 * Raw file: byte order, default little.
 */
endian?: Endian, 
/**
 * Raw file: bytes to skip before the first voxel, default 0.
 */
header_bytes?: number, 
/**
 * Which volume or component of a file that holds several, default 0.
 */
index?: number, 
/**
 * Finest level shown: 0, the default, is full resolution, each further one has half as many
 * voxels along each axis. A coarser one is shown where this one does not fit the device.
 */
level?: number, 
/**
 * Shows only this box, lower and upper corner in 0..1 coordinates of the whole volume, in the
 * finest level in which it fits. It keeps its place in the world.
 */
region?: [[number, number, number], [number, number, number]], };

export type Filter = "linear" | "nearest";

export type Builtin = "cornell_box" | "pillars" | "buckyball" | "smoke_plume" | "vessel_tree" | "thick_blob" | "nested_shells" | "marschner_lobb" | "homogeneous";

export type VoxelType = "uint8" | "int8" | "uint16" | "int16" | "uint32" | "int32" | "uint64" | "int64" | "float32" | "float64";

export type Endian = "little" | "big";

export type TransferFunction = { 
/**
 * At least one point, `s` ascending.
 */
points: Array<TransferFunctionPoint>, };

export type TransferFunctionPoint = { 
/**
 * Position, 0..1.
 */
s: number, 
/**
 * Extinction per world unit, >= 0.
 */
extinction?: number, 
/**
 * Alternative to extinction: opacity of 0.01 world units, 0..1, clamped to 0.9999.
 */
opacity?: number, 
/**
 * Share of the extinction that scatters, linear RGB, 0..1.
 */
albedo: [number, number, number], 
/**
 * Emitted radiance (weighted by absorption), linear RGB, >= 0.
 */
emission: [number, number, number], 
/**
 * Name of a material, valid up to the next point; none means isotropic scattering.
 */
material?: string, };

export type Material = { 
/**
 * Phase function, integrates to 1 over the sphere.
 */
phase: Phase, 
/**
 * Weight of the BRDF against the phase function, 0..1.
 */
surface: number, 
/**
 * Required where `surface` > 0.
 */
brdf?: Brdf, };

export type Phase = { "type": "isotropic" } | { "type": "henyey_greenstein" } & HenyeyGreenstein | { "type": "schlick" } & Schlick;

export type HenyeyGreenstein = { 
/**
 * Mean cosine, -0.999..0.999.
 */
g: number, };

export type Schlick = { 
/**
 * Asymmetry, -0.999..0.999.
 */
k: number, };

export type Brdf = { "type": "lambert" } & Lambert | { "type": "blinn_phong" } & BlinnPhong | { "type": "ashikhmin_shirley" } & AshikhminShirley | { "type": "abc" } & Abc;

export type Lambert = { 
/**
 * Diffuse reflectance, 0..1.
 */
diffuse: number, };

export type BlinnPhong = { 
/**
 * Diffuse reflectance, 0..1.
 */
diffuse: number, 
/**
 * Specular reflectance, 0..1.
 */
specular: number, 
/**
 * Exponent of `n . h`, 0..10000.
 */
exponent: number, };

export type AshikhminShirley = { 
/**
 * Diffuse reflectance, 0..1.
 */
diffuse: number, 
/**
 * Specular reflectance at normal incidence, 0..1.
 */
specular: number, 
/**
 * Exponents along the two tangents, 0..10000.
 */
exponents: [number, number], };

export type Abc = { 
/**
 * Diffuse reflectance, 0..1.
 */
diffuse: number, 
/**
 * Peak of the lobe, per steradian, >= 0.
 */
a: number, 
/**
 * Width, >= 0.
 */
b: number, 
/**
 * Fall-off, >= 0.
 */
c: number, };

export type Light = { "type": "directional" } & DirectionalLight | { "type": "point" } & PointLight | { "type": "spot" } & SpotLight | { "type": "rectangle" } & RectangleLight | { "type": "disk" } & DiskLight | { "type": "sphere" } & SphereLight | { "type": "environment" } & EnvironmentLight;

export type DirectionalLight = { 
/**
 * Stable name that keeps caches across edits; default the index.
 */
id?: string, 
/**
 * Off lights stay in the scene and shine nothing.
 */
enabled: boolean, 
/**
 * The direction the light travels; need not be normalised.
 */
direction: [number, number, number], 
/**
 * Irradiance on a perpendicular plane, linear RGB.
 */
irradiance: [number, number, number], };

export type PointLight = { 
/**
 * Stable name that keeps caches across edits; default the index.
 */
id?: string, 
/**
 * Off lights stay in the scene and shine nothing.
 */
enabled: boolean, 
/**
 * World position.
 */
position: [number, number, number], 
/**
 * Radiant intensity: irradiance at distance d is `intensity / d^2`.
 */
intensity: [number, number, number], };

export type SpotLight = { 
/**
 * Stable name that keeps caches across edits; default the index.
 */
id?: string, 
/**
 * Off lights stay in the scene and shine nothing.
 */
enabled: boolean, 
/**
 * World position.
 */
position: [number, number, number], 
/**
 * Axis of the cone, the direction the light travels.
 */
direction: [number, number, number], 
/**
 * Half-angles: full inside the first, smoothstep in the cosine to 0 at the second.
 */
cone_degrees: [number, number], 
/**
 * Radiant intensity along the axis.
 */
intensity: [number, number, number], };

export type RectangleLight = { 
/**
 * Stable name that keeps caches across edits; default the index.
 */
id?: string, 
/**
 * Off lights stay in the scene and shine nothing.
 */
enabled: boolean, 
/**
 * World position of the centre.
 */
center: [number, number, number], 
/**
 * The side that shines.
 */
normal: [number, number, number], 
/**
 * Second edge; made perpendicular to the normal.
 */
up: [number, number, number], 
/**
 * Edge lengths: `size[0]` along `up x normal`, `size[1]` along `up`.
 */
size: [number, number], 
/**
 * Emitted radiance.
 */
radiance: [number, number, number], };

export type DiskLight = { 
/**
 * Stable name that keeps caches across edits; default the index.
 */
id?: string, 
/**
 * Off lights stay in the scene and shine nothing.
 */
enabled: boolean, 
/**
 * World position of the centre.
 */
center: [number, number, number], 
/**
 * The side that shines.
 */
normal: [number, number, number], 
/**
 * Radius, world units.
 */
radius: number, 
/**
 * Emitted radiance.
 */
radiance: [number, number, number], };

export type SphereLight = { 
/**
 * Stable name that keeps caches across edits; default the index.
 */
id?: string, 
/**
 * Off lights stay in the scene and shine nothing.
 */
enabled: boolean, 
/**
 * World position of the centre.
 */
center: [number, number, number], 
/**
 * Radius, world units.
 */
radius: number, 
/**
 * Emitted radiance.
 */
radiance: [number, number, number], };

export type EnvironmentLight = { 
/**
 * Stable name that keeps caches across edits; default the index.
 */
id?: string, 
/**
 * Off lights stay in the scene and shine nothing.
 */
enabled: boolean, 
/**
 * Uniform radiance.
 */
radiance?: [number, number, number], 
/**
 * Latitude-longitude image, row 0 = +y: a file beside a scene on disk, or the identifier of an
 * environment of the service.
 */
image?: string, 
/**
 * Multiplies the image, default 1.
 */
scale?: number, 
/**
 * Rotation about x, then y, then z, right-handed.
 */
rotation_degrees?: [number, number, number], };

export type Camera = { 
/**
 * Eye, world.
 */
position: [number, number, number], 
/**
 * Point looked at, world.
 */
target: [number, number, number], 
/**
 * Up direction; made perpendicular to the view direction.
 */
up: [number, number, number], 
/**
 * Perspective: full vertical angle of view, 0.1..179.
 */
fov_y_degrees?: number, 
/**
 * Orthographic: height of the whole image in world units.
 */
orthographic_height?: number, };

export type Clip = { 
/**
 * Keeps what lies inside; lower and upper corner in 0..1 volume coordinates.
 */
box?: [[number, number, number], [number, number, number]], 
/**
 * Each keeps `dot(normal, x) >= offset` (world).
 */
planes: Array<ClipPlane>, 
/**
 * Whether clipped matter still blocks light.
 */
shadows: boolean, };

export type ClipPlane = { 
/**
 * World; normalised on use.
 */
normal: [number, number, number], 
/**
 * World units along the normalised normal.
 */
offset: number, };

export type Background = [number, number, number] | "environment";

export type Scattering = { 
/**
 * `"all"`, 1 (single scattering), or n.
 */
orders: Orders, };

export type Orders = number | "all";

export type Illumination = { 
/**
 * Which method supplies the in-scattered radiance.
 */
method: Method, 
/**
 * `path_traced`, and others where they `refine`: paths of each pixel at rest, 1..1048576.
 */
paths_per_pixel: number, 
/**
 * The same: ends earlier, once the picture's relative standard error is no more than this, 0..1.
 */
max_error: number, 
/**
 * `path_traced`: scattering events after which a path is cut, 1..10^9. What is lost by it is
 * counted.
 */
longest_path: number, 
/**
 * `path_traced`: what each light brings is kept apart, so that colours, strengths and switches
 * of lights change the picture without a new path. At most 8 lights.
 */
light_layers: boolean, 
/**
 * Methods that approximate all light, `photon_map`, `convection_diffusion` and
 * `precomputed_transfer`: at rest paths are followed, too, and the picture goes over to what they
 * find as far as that is known better.
 */
refine: boolean, 
/**
 * `photon_map`: photons of each light, 1..16777216.
 */
photons: number, 
/**
 * `photon_map`: most interactions of a photon, 1..256. What is lost by it is counted.
 */
photon_events: number, 
/**
 * `photon_map`: texels of the light field along the volume's longest edge, 4..256.
 */
photon_grid: number, 
/**
 * `photon_map`: bands of spherical harmonics that hold the light where matter is not isotropic,
 * 1..6; 0: as many as the phase functions ask for.
 */
photon_bands: number, 
/**
 * `photon_map`: where view rays find the light that photons bring.
 */
gather: LightGather, 
/**
 * `photon_map`, `image_based`: cells along the volume's longest edge of the grid that holds what
 * lights bring by themselves, 4..256; none smaller than half a voxel.
 */
direct_grid: number, 
/**
 * `convection_diffusion`: cells of the light grid along each axis for a voxel, 0.01..2.
 */
light_grid: number, 
/**
 * `convection_diffusion`: bands of diffused light, 1..6: 1 is its mean, 2 adds where it flows to,
 * which isotropic matter does not see. More is taken as 2: P1 has no more.
 */
light_bands: number, 
/**
 * `convection_diffusion`: how light is carried from its source.
 */
transport: LightTransport, 
/**
 * `convection_diffusion`, explicit transport: steps in time of each front of cells, 1..100.
 */
explicit_steps: number, 
/**
 * `convection_diffusion`: what becomes of light that is scattered.
 */
diffusion: Diffusion, 
/**
 * `convection_diffusion`, heat flow: how far light spreads in vacuum, world units, 0..1.
 */
heat_spread: number, 
/**
 * `convection_diffusion`: norm of the residual, as a share of that of the source, at which diffusion
 * is solved, 10^-5..0.5.
 */
max_residual: number, 
/**
 * `image_based`: records along the longest edge of the volume's box, 2..100.
 */
records: number, 
/**
 * `image_based`: directions a record looks in: 12, 48, 192 or 768.
 */
record_directions: number, 
/**
 * `image_based`: bands of spherical harmonics, 1..6.
 */
record_bands: number, 
/**
 * `image_based`: what a record holds.
 */
record_form: RecordForm, 
/**
 * `image_based`: how a sample in matter reads the records.
 */
record_lookup: RecordLookup, 
/**
 * `image_based`: damps the higher bands of the light, against ringing.
 */
record_window: boolean, 
/**
 * `image_based`, form `product`: how often records exchange scattered light with one another, 0..64.
 * Each time adds an order of scattering; 0: light that is scattered once, alone.
 */
record_exchange: number, 
/**
 * `precomputed_transfer`: lights that any light from infinity is made of: 42, 162 or 642.
 */
transfer_lights: number, 
/**
 * `precomputed_transfer`: texels of the baked light along the volume's longest edge, 4..128; fewer
 * where memory does not suffice.
 */
transfer_grid: number, 
/**
 * `precomputed_transfer`: directions that light is marched from which is not scattered before:
 * 48, 192, 768 or 3072.
 */
transfer_directions: number, 
/**
 * `precomputed_transfer`: photons of the bake, 1..16777216.
 */
transfer_photons: number, 
/**
 * `precomputed_transfer`: most interactions of a photon, 1..256. What is lost by it is counted.
 */
transfer_events: number, 
/**
 * `precomputed_transfer`: bands of spherical harmonics that hold the light where matter is not
 * isotropic, 1..6.
 */
transfer_bands: number, 
/**
 * `precomputed_transfer`: clusters that the finished bake is compressed into, each a few matrices that
 * every texel of it is a sum of; 0 (it stays as it is) or 32..256.
 */
transfer_clusters: number, };

export type LightGather = "field" | "ray";

export type LightTransport = "characteristics" | "upwind" | "explicit";

export type Diffusion = "p1" | "heat" | "none";

export type Method = "local" | "convection_diffusion" | "image_based" | "precomputed_transfer" | "photon_map" | "path_traced";

export type RecordForm = "product" | "isotropic" | "static" | "dynamic";

export type RecordLookup = "trilinear" | "containing";

export type Sampling = { 
/**
 * Distance between samples on a view ray of a projection or isosurface, and the longest part of
 * one through matter within which the field is taken as linear, in units of the smallest voxel
 * edge, 1/16..8.
 */
step_voxels: number, 
/**
 * Jittered passes accumulated at rest, 1..4096.
 */
samples_per_pixel: number, 
/**
 * Skips macrocells without matter; never changes the image.
 */
skip_empty: boolean, 
/**
 * A ray ends when less than this share of what lies behind it would be seen, 0..0.5.
 */
termination_transmittance: number, 
/**
 * Who interpolates between voxels, for the linear filter.
 */
interpolation: Interpolation, 
/**
 * Segments a view ray is kept in between edits of matter, so that an edit casts anew only
 * those it touches, 0..32; 0 keeps none.
 */
segments: number, };

export type Interpolation = "sampler" | "exact";

export type Rendering = { 
/**
 * What a pixel shows.
 */
mode: RenderingMode, 
/**
 * Data value of the isosurface; the middle of the value range if absent.
 */
isovalue?: number, 
/**
 * Data values shown black and white by projections and slices; the value range if absent.
 */
window?: [number, number], 
/**
 * The plane that `slice` shows.
 */
slice: SlicePlane, };

export type RenderingMode = "volume" | "maximum" | "minimum" | "average" | "isosurface" | "slice";

export type SlicePlane = { 
/**
 * Normalised on use.
 */
normal: [number, number, number], 
/**
 * World units from the centre of the volume.
 */
offset: number, };

export type Film = { 
/**
 * Radiance is multiplied by 2 to this power, -20..20.
 */
exposure_stops: number, 
/**
 * The operator applied before the sRGB curve.
 */
tone_mapping: ToneMapping, };

export type ToneMapping = "neutral" | "linear" | "reinhard";

export type ImageSize = { 
/**
 * Pixels, 1..8192.
 */
width: number, 
/**
 * Pixels, 1..8192.
 */
height: number, };

export type PassReport = { 
/**
 * Name of the pass, equal to the shader file where there is one.
 */
pass: string, 
/**
 * Whether it runs.
 */
runs: boolean, 
/**
 * Why it runs, or why it does not.
 */
reason: string, 
/**
 * Amount of work, in `unit`.
 */
work: number, 
/**
 * Unit of `work`: `voxels`, `cells`, `pixels`, `points`, `lights`.
 */
unit: string, };

export type StageTime = { 
/**
 * Name of the stage.
 */
stage: string, 
/**
 * Wall time, handing work over and waiting included, milliseconds.
 */
millis: number, 
/**
 * Time of the device at work, by its own clock, milliseconds; absent where it has none, and for
 * stages that are not its work.
 */
device_millis?: number, };

export type StaleShares = { 
/**
 * What is counted: `photons` or `tiles`.
 */
what: string, 
/**
 * How many were counted: all of them, or of many the first ones of each light.
 */
counted: number, 
/**
 * Of each of the 64 bins, in the order of their values, the share that relied on it, 0..1.
 */
of_bins: Array<number>, };

export type FrameReport = { 
/**
 * What changed since the picture before, in words; empty if nothing.
 */
changes: Array<string>, 
/**
 * Every pass, run or skipped.
 */
plan: Array<PassReport>, 
/**
 * Stage times in order.
 */
stages: Array<StageTime>, 
/**
 * Exact work counters, for example `samples_taken`, `samples_skipped`.
 */
counters: Record<string, number>, 
/**
 * GPU memory in use, bytes, by owner.
 */
gpu_bytes: Record<string, number>, 
/**
 * What edits would make stale; with final pictures of methods that keep it.
 */
stale_shares?: StaleShares, };

export type Problem = { 
/**
 * Kind of problem: `about:blank` or a path under `/problems/`.
 */
type: string, 
/**
 * Short summary of the kind.
 */
title: string, 
/**
 * HTTP status.
 */
status: number, 
/**
 * What happened here, in words, with what to do.
 */
detail: string, 
/**
 * The field at fault, where there is one.
 */
field?: string, };

export type DeviceInfo = { 
/**
 * Adapter name as the driver gives it.
 */
name: string, 
/**
 * Driver and version.
 */
driver: string, 
/**
 * A software device renders at reduced resolution.
 */
software: boolean, };

export type Status = { 
/**
 * Version of the service.
 */
version: string, 
/**
 * What renders.
 */
device: DeviceInfo, 
/**
 * Open sessions.
 */
sessions: number, 
/**
 * Connected viewers.
 */
viewers: number, 
/**
 * Largest upload, bytes.
 */
max_upload_bytes: number, 
/**
 * Methods that can be chosen; names as in scene files.
 */
methods: Array<string>, };

export type Dataset = { 
/**
 * Identifier: content hash of an upload, or the sample's name.
 */
id: string, 
/**
 * For people.
 */
name: string, 
/**
 * Samples come with the service and cannot be deleted.
 */
sample: boolean, 
/**
 * `builtin`, or the format of the file, for example `nrrd`, `tiff`, `ome-zarr`.
 */
format: string, 
/**
 * Voxels along x, y, z (after reordering to world axes).
 */
dims: [number, number, number], 
/**
 * Edge lengths of a voxel along x, y, z.
 */
spacing: [number, number, number], 
/**
 * Unit of `spacing`, for example `mm`, where the file says so.
 */
spacing_unit?: string, 
/**
 * Type of a stored voxel.
 */
voxel_type: VoxelType, 
/**
 * Smallest and largest data value.
 */
value_range: [number, number], 
/**
 * Whether the axes are anatomical (x left, y posterior, z superior).
 */
anatomical: boolean, 
/**
 * Size of the upload, or of the computed voxels, bytes.
 */
bytes: number, 
/**
 * Milliseconds since 1970; 0 for samples.
 */
created_unix_millis: number, 
/**
 * What the reader wants to be known, for example that only the first volume was taken.
 */
notices: Array<string>, 
/**
 * Names of the volumes a scene can choose from by `volume.index`; empty where there is one.
 */
choices: Array<string>, 
/**
 * Where the data comes from and under which licence, where that is known.
 */
attribution?: string, };

export type Environment = { 
/**
 * Identifier: content hash of an upload, or the sample's name.
 */
id: string, 
/**
 * For people.
 */
name: string, 
/**
 * Samples come with the service and cannot be deleted.
 */
sample: boolean, 
/**
 * Texels around the horizon, after shrinking.
 */
width: number, 
/**
 * Texels from pole to pole.
 */
height: number, 
/**
 * Size of the upload, bytes; 0 for samples.
 */
bytes: number, 
/**
 * Linear RGB, mean over all directions at scale 1; absent for those that an earlier version of the
 * service stored.
 */
mean_radiance?: [number, number, number], 
/**
 * What the reader wants to be known.
 */
notices: Array<string>, };

export type UploadState = "receiving" | "reading" | "stored" | "refused" | "failed";

export type Upload = { 
/**
 * How far it has come.
 */
state: UploadState, 
/**
 * Bytes of the whole upload.
 */
length: number, 
/**
 * Bytes that are safe at the service.
 */
offset: number, 
/**
 * What came of it; absent, too, if it was deleted meanwhile.
 */
dataset?: Dataset, 
/**
 * Why there is no dataset.
 */
problem?: Problem, };

export type ShownVolume = { 
/**
 * 0 is full resolution; each further level has half as many voxels along each axis.
 */
level: number, 
/**
 * Voxels held along x, y, z; of a region, with two more on each side where there are any, which
 * its borders need.
 */
dims: [number, number, number], 
/**
 * Voxels of the whole volume at full resolution.
 */
whole_dims: [number, number, number], 
/**
 * The box that is shown, in 0..1 coordinates of the whole volume; absent: all of it.
 */
region?: [[number, number, number], [number, number, number]], 
/**
 * What is shown and why, in words.
 */
notice: string, };

export type Histogram = { 
/**
 * Data value at the lower edge of the first and the upper edge of the last bucket.
 */
value_range: [number, number], 
/**
 * Voxels per bucket; buckets have equal width.
 */
counts: number[], 
/**
 * The 65 edges of the scalar bins that caches are keyed by, data values.
 */
bin_edges: Array<number>, 
/**
 * For each of the 64 bins the share of the volume that an edit of its values touches, 0..1:
 * of all blocks of 4 x 4 x 4 voxels, those in which a value of the bin occurs.
 */
bin_shares: Array<number>, };

export type RegionHistogram = { 
/**
 * Epoch of the scene whose clip region was looked at.
 */
epoch: number, 
/**
 * Data value at the lower edge of the first and the upper edge of the last bucket; those of
 * the whole volume.
 */
value_range: [number, number], 
/**
 * Voxels with their centre inside clip box and clip planes per bucket; buckets have equal
 * width.
 */
counts: number[], };

export type PreviewRequest = { 
/**
 * A JSON merge patch (RFC 7396) on the session's scene, which stays as it is; it may not name
 * another volume.
 */
patch: Record<string, unknown>, 
/**
 * Width of the picture, pixels, 1 to 512.
 */
width: number, 
/**
 * Height of the picture, pixels, 1 to 512.
 */
height: number, };

export type ExportFormat = "apng" | "zip";

export type CameraKey = { 
/**
 * When, seconds, 0 to 3600; at least 0.01 after the view before.
 */
seconds: number, 
/**
 * The view.
 */
camera: Camera, };

export type ExportRequest = { 
/**
 * Width of the pictures, pixels.
 */
width: number, 
/**
 * Height of the pictures, pixels.
 */
height: number, 
/**
 * Number of pictures, 2 to 1440.
 */
frames: number, 
/**
 * Turntable: turns about the camera's upright axis, -10 to 10; positive ones are right-handed
 * about it.
 */
turns?: number, 
/**
 * Film: 2 to 64 views of one projection, in the order of their times. The first picture shows
 * the first view, the last one the last, and the others stand evenly in time between. From view
 * to view the camera takes the shorter rotation, and its velocity is continuous; it starts and
 * ends at rest.
 */
keys?: Array<CameraKey>, 
/**
 * Pictures a second, 1 to 60, where the format tells.
 */
frames_per_second: number, 
/**
 * Samples, or paths, per pixel, 1 to 4096; absent: as many as the scene has at rest.
 */
samples?: number, 
/**
 * Default apng.
 */
format: ExportFormat, 
/**
 * Where a turntable begins; absent: the session's camera.
 */
camera?: Camera, };

export type ExportState = "waiting" | "drawing" | "done" | "failed";

export type Export = { 
/**
 * Identifier.
 */
id: string, 
/**
 * How far it has come.
 */
state: ExportState, 
/**
 * Width of the pictures, pixels.
 */
width: number, 
/**
 * Height of the pictures, pixels.
 */
height: number, 
/**
 * How they are kept.
 */
format: ExportFormat, 
/**
 * Number of pictures.
 */
frames: number, 
/**
 * Pictures that are drawn and written.
 */
frames_done: number, 
/**
 * Time until it is done, seconds, as far as the pictures so far tell.
 */
seconds_left?: number, 
/**
 * Bytes of the file so far.
 */
bytes: number, 
/**
 * Why there is no file.
 */
problem?: Problem, };

export type CreateSession = { 
/**
 * The scene to open.
 */
scene?: SceneFile, 
/**
 * The dataset to open with a scene that suits it.
 */
dataset?: string, };

export type ProbeRequest = { 
/**
 * The view.
 */
camera: Camera, 
/**
 * Pixels from the left edge.
 */
x: number, 
/**
 * Pixels from the upper edge.
 */
y: number, 
/**
 * Width of the picture, pixels.
 */
width: number, 
/**
 * Height of the picture, pixels.
 */
height: number, };

export type Probe = { 
/**
 * The place; absent where the pixel shows nothing that has one.
 */
hit: ProbeHit | null, };

export type ProbeHit = { 
/**
 * World.
 */
position: [number, number, number], 
/**
 * Indices of the voxel that holds it, along the world axes.
 */
voxel: [number, number, number], 
/**
 * Data value there.
 */
value: number, };

export type Session = { 
/**
 * Identifier.
 */
id: string, 
/**
 * Epoch of the newest scene.
 */
epoch: number, 
/**
 * Connected viewers.
 */
viewers: number, 
/**
 * Milliseconds since 1970.
 */
created_unix_millis: number, 
/**
 * When it was last used, milliseconds since 1970.
 */
used_unix_millis: number, 
/**
 * What the identifier it was asked for with allows.
 */
role: Role, 
/**
 * Identifier under which it can be watched, but not edited; absent for those who watch.
 */
watch?: string, 
/**
 * The newest scene, camera filled in.
 */
scene: SceneFile, 
/**
 * What is shown of the volume; absent: the whole of it at full resolution.
 */
shown?: ShownVolume, };

export type Role = "editor" | "watcher";

export type ClientMessage = { "type": "hello", 
/**
 * [`PROTOCOL_VERSION`].
 */
protocol: number, 
/**
 * `resume` of the connection that was lost: goes on with that viewer, whose picture is kept
 * for a time.
 */
resume?: string, } | { "type": "patch", 
/**
 * Number of this input.
 */
seq: number, 
/**
 * The patch. `camera` in it moves this viewer's camera and the session's.
 */
patch: Record<string, unknown>, } | { "type": "camera", 
/**
 * Number of this input.
 */
seq: number, 
/**
 * The new view.
 */
camera: Camera, } | { "type": "viewport", 
/**
 * Number of this input.
 */
seq: number, 
/**
 * CSS pixels.
 */
width: number, 
/**
 * CSS pixels.
 */
height: number, 
/**
 * Device pixels per CSS pixel, 0.25..4.
 */
pixel_ratio: number, } | { "type": "ack", 
/**
 * Number of the frame, from its header.
 */
frame: number, 
/**
 * Time to decode, milliseconds.
 */
decode_millis: number, } | { "type": "visible", 
/**
 * New state.
 */
visible: boolean, };

export type ServerMessage = { "type": "welcome", 
/**
 * [`PROTOCOL_VERSION`].
 */
protocol: number, 
/**
 * Session identifier.
 */
session: string, 
/**
 * This viewer's number within the session.
 */
viewer: number, 
/**
 * What this viewer may do.
 */
role: Role, 
/**
 * To be said in the next `hello` should this connection be lost. It takes this viewer over:
 * nobody else may know it.
 */
resume: string, 
/**
 * Epoch of the scene that follows.
 */
epoch: number, 
/**
 * The session's scene, camera filled in.
 */
scene: SceneFile, 
/**
 * What the scene's volume is.
 */
dataset: Dataset | null, 
/**
 * What is shown of the volume; absent: the whole of it at full resolution.
 */
shown?: ShownVolume, 
/**
 * What renders.
 */
device: DeviceInfo, } | { "type": "scene", 
/**
 * New epoch.
 */
epoch: number, 
/**
 * Newest input of *this* viewer that is part of it.
 */
seq: number, 
/**
 * The whole scene.
 */
scene: SceneFile, 
/**
 * What is shown of its volume; absent: the whole of it at full resolution.
 */
shown?: ShownVolume, } | { "type": "rejected", 
/**
 * The refused input.
 */
seq: number, 
/**
 * Field path, empty if the message as a whole is at fault.
 */
field: string, 
/**
 * In words.
 */
message: string, } | { "type": "report", 
/**
 * Number of the frame, or the newest frame where nothing had to be sent.
 */
frame: number, 
/**
 * Plan, counters, stage times.
 */
report: FrameReport, } | { "type": "progress", 
/**
 * What is being done, for people.
 */
activity: string, 
/**
 * 0..1, negative where unknown.
 */
fraction: number, } | { "type": "failed", 
/**
 * In words, with what to do.
 */
message: string, } | { "type": "closing", 
/**
 * Why.
 */
reason: string, };

export const PROTOCOL_VERSION = 1;
export const SCENE_VERSION = 1;
export const MAX_TRANSFER_FUNCTION_POINTS = 256;
export const MAX_LIGHTS = 64;
export const MAX_CLIP_PLANES = 8;
export const MAX_OPACITY = 0.9999;
export const OPACITY_LENGTH = 0.01;

export const FRAME_MAGIC = 826693972;
export const FRAME_HEADER_BYTES = 64;
export const FLAG_MOVING = 1;
export const FLAG_FINAL = 2;
export const FORMAT_JPEG = 1;
export const FORMAT_WEBP_LOSSLESS = 2;

export interface FrameHeader {
  magic: number;
  header_bytes: number;
  format: number;
  flags: number;
  frame: number;
  seq: number;
  snapshot_epoch: number;
  illumination_epoch: number;
  illumination_completeness: number;
  samples_per_pixel: number;
  error_estimate: number;
  width: number;
  height: number;
  viewport_width: number;
  viewport_height: number;
  quality: number;
  queue_micros: number;
  render_micros: number;
  encode_micros: number;
  payload_bytes: number;
}

/** Reads a frame's header; null if the bytes are not a frame. */
export function decodeFrameHeader(buffer: ArrayBuffer): FrameHeader | null {
  if (buffer.byteLength < FRAME_HEADER_BYTES) return null;
  const view = new DataView(buffer);
  const header: FrameHeader = {
    magic: view.getUint32(0, true),
    header_bytes: view.getUint16(4, true),
    format: view.getUint8(6),
    flags: view.getUint8(7),
    frame: view.getUint32(8, true),
    seq: view.getUint32(12, true),
    snapshot_epoch: view.getUint32(16, true),
    illumination_epoch: view.getUint32(20, true),
    illumination_completeness: view.getFloat32(24, true),
    samples_per_pixel: view.getUint32(28, true),
    error_estimate: view.getFloat32(32, true),
    width: view.getUint16(36, true),
    height: view.getUint16(38, true),
    viewport_width: view.getUint16(40, true),
    viewport_height: view.getUint16(42, true),
    quality: view.getUint32(44, true),
    queue_micros: view.getUint32(48, true),
    render_micros: view.getUint32(52, true),
    encode_micros: view.getUint32(56, true),
    payload_bytes: view.getUint32(60, true),
  };
  return header.magic === FRAME_MAGIC && header.header_bytes === FRAME_HEADER_BYTES ? header : null;
}
