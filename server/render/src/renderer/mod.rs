//! Draws snapshots into views, slice by slice, as the plan says.

mod casting;
mod gathering;
mod layers;
mod refining;
mod tracing;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use proto::FieldError;
use proto::plan::{FrameReport, StageTime, StaleShares};
use proto::scene_file::{Method, RecordForm, ToneMapping};
use scene::distance::distance_map;
use scene::light::LightGeometry;
use scene::plan::{FilmPlan, Pass, Plan, SegmentsPlan, Target};
use scene::{Integrator, Rendering, Scene, Snapshot};

use crate::convection_diffusion;
use crate::direct_light;
use crate::error::RenderError;
use crate::film::ToneMapper;
use crate::gpu::Gpu;
use crate::illumination::Inputs;
use crate::image_based;
use crate::path_tracer::{PathTracer, PathVariant};
use crate::photon_map::PhotonPipelines;
use crate::precomputed_transfer;
use crate::ray_cast::{RayCaster, Variant, WORKGROUP_EDGE};
use crate::stale_shares;
use crate::tables;
use crate::uniforms::FrameUniform;
use crate::view::{
    FILM_PIXEL_BYTES, FilmCache, LightTables, PICTURE_PIXEL_BYTES, TransferFunctionTables, View, ViewBuffers,
};
use crate::volume_texture::{DEFAULT_GPU_BYTES, VolumeCache};
use crate::warm_up::warm_up_scene;
pub(crate) use casting::name_counters;
pub(crate) use refining::Refinement;
pub use tracing::PathEstimate;
pub(crate) use tracing::PathFilm;

/// Methods that can be drawn.
pub const METHODS_BUILT: &[Method] = &Method::ALL;

/// Light computed ahead may take this share of a call's budget; the rest is for the picture.
const LIGHT_SHARE_OF_BUDGET: f64 = 0.5;
/// Or as long as the rays of the call before took, if they are slower than the budget has it, up to this many
/// budgets: else light would wait for pictures that are drawn again once it is there.
const MOST_BUDGETS_FOR_LIGHT: u32 = 20;

/// Draws views. One per GPU, on the thread that owns submission.
pub struct Renderer {
    gpu: Arc<Gpu>,
    volumes: Arc<VolumeCache>,
    ray_caster: Arc<RayCaster>,
    path_tracer: Arc<PathTracer>,
    pub(crate) photon_pipelines: Arc<PhotonPipelines>,
    pub(crate) record_passes: Arc<image_based::Passes>,
    pub(crate) direct_light: Arc<direct_light::Passes>,
    gathering: gathering::Pipelines,
    tone_mapper: ToneMapper,
    refining: refining::Pipelines,
    convection_diffusion: convection_diffusion::Pipelines,
    pub(crate) transfer_pipelines: precomputed_transfer::Pipelines,
    bakes: Option<Arc<precomputed_transfer::BakeStore>>,
}

/// What is wanted of one call of [`Renderer::draw`].
#[derive(Debug, Clone, Copy)]
pub struct DrawRequest<'a> {
    /// What to show.
    pub snapshot: &'a Arc<Snapshot>,
    /// Size and samples per pixel.
    pub target: Target,
    /// Return after about this long even if unfinished; at least one slice is drawn.
    pub budget: Option<Duration>,
}

/// What a call of [`Renderer::draw`] did.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// The plan it followed.
    pub plan: Plan,
    /// Whether the film now holds the target.
    pub complete: bool,
    /// Complete passes over the image the film holds.
    pub samples_per_pixel: u32,
    /// Share of the next pass that the film holds besides, 0..1; 0 where paths are followed.
    pub pass_share: f64,
    /// How well the film is known, where the method tells.
    pub estimate: Option<PathEstimate>,
    /// Share of the light that is the snapshot's, 0..1.
    pub illumination: f32,
    /// Epoch of the scene whose light is shown: an older one's while there is little of the snapshot's.
    pub illumination_epoch: u32,
    /// Whether anything ran or has to (a tone-mapping edit leaves the film alone).
    pub drew: bool,
    /// Times of the stages that ran.
    pub stages: Vec<StageTime>,
    /// Exact work counters of this call.
    pub counters: BTreeMap<String, u64>,
    /// GPU memory by owner, bytes.
    pub gpu_bytes: BTreeMap<String, u64>,
}

impl Drawn {
    /// As it travels.
    pub fn report(&self) -> FrameReport {
        FrameReport {
            changes: self.plan.changes.clone(),
            plan: self.plan.report(),
            stages: self.stages.clone(),
            counters: self.counters.clone(),
            gpu_bytes: self.gpu_bytes.clone(),
            stale_shares: None,
        }
    }
}

/// Makes ready for scenes ahead of their first picture, on other threads than the one that draws: a
/// new shader variant there would hold up everybody.
#[derive(Clone)]
pub struct Preparer {
    volumes: Arc<VolumeCache>,
    ray_caster: Arc<RayCaster>,
    path_tracer: Arc<PathTracer>,
}

impl Preparer {
    /// Volume textures.
    pub fn volumes(&self) -> &Arc<VolumeCache> {
        &self.volumes
    }

    /// Compiles what a scene needs whose volume is on the GPU: the pipeline of its pictures, and that
    /// of pictures in view-ray segments, which edits will ask for, or of paths that refine it. Blocks while
    /// it compiles.
    pub fn compile(&self, scene: &Scene) {
        if scene.integrator() == Integrator::PathTracer {
            self.path_tracer.pipeline(PathVariant::of(scene));
            return;
        }
        if scene.is_refined() {
            self.path_tracer.pipeline(PathVariant::of(&scene.path_traced()));
        }
        let Some(texture) = self.volumes.loaded(&scene.volume) else { return };
        let variant = Variant::of(scene, &texture, None);
        self.ray_caster.pipeline(variant);
        if variant.mode == 0 && scene.sampling.segments > 1 {
            self.ray_caster.pipeline(Variant { keep_segments: true, ..variant });
        }
    }
}

/// 8-bit sRGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Rows top to bottom, four bytes a pixel, alpha 255.
    pub rgba: Vec<u8>,
}

impl Picture {
    /// Three bytes a pixel.
    pub fn rgb(&self) -> Vec<u8> {
        self.rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
    }
}

/// Linear radiance.
#[derive(Debug, Clone, PartialEq)]
pub struct Radiance {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Rows top to bottom, three values a pixel.
    pub rgb: Vec<f32>,
}

/// Refuses what is not built yet, in words, before a session accepts a scene.
///
/// # Errors
/// The field that asks for it.
pub fn check(scene: &Scene) -> Result<(), FieldError> {
    let image = |light: &&scene::Light| matches!(light.geometry, LightGeometry::Environment { .. });
    if scene.integrator() == Integrator::PathTracer {
        return layers::check_count(scene);
    }
    if METHODS_BUILT.contains(&scene.method) {
        // Projections and slices show data, not light.
        let takes_images = scene.method != Method::Local;
        if !scene.rendering.is_lit() || takes_images && scene.has_light_field() {
            return check_method(scene);
        }
        let Some(light) = scene.lights.iter().find(image) else { return check_method(scene) };
        let who = match scene.rendering {
            Rendering::Isosurface { .. } => "an isosurface".to_owned(),
            _ => format!("`{}`", scene.method.name()),
        };
        let message = format!("{who} cannot use environment images; give a uniform `radiance` instead");
        return Err(FieldError::new(format!("lights[{}].image", light.index), message));
    }
    let built: Vec<&str> = METHODS_BUILT.iter().map(|method| method.name()).collect();
    let message = format!("`{}` is not built yet; available: {}", scene.method.name(), built.join(", "));
    Err(FieldError::new("illumination.method", message))
}

/// What a method that computes light ahead does not take.
fn check_method(scene: &Scene) -> Result<(), FieldError> {
    match scene.method {
        Method::PrecomputedTransfer if scene.has_light_field() => precomputed_transfer::check(scene),
        _ => Ok(()),
    }
}

impl Renderer {
    /// A renderer with its own pipelines.
    ///
    /// # Errors
    /// Out of memory, or the driver refuses a shader.
    pub fn new(gpu: Arc<Gpu>) -> Result<Self, RenderError> {
        let volumes = Arc::new(VolumeCache::new(gpu.clone(), DEFAULT_GPU_BYTES));
        let ray_caster = Arc::new(RayCaster::new(gpu.clone()));
        let path_tracer = Arc::new(PathTracer::new(gpu.clone()));
        let record_passes = Arc::new(image_based::Passes::new(gpu.clone()));
        let direct_light = Arc::new(direct_light::Passes::new(gpu.clone()));
        let photon_pipelines = Arc::new(PhotonPipelines::new(gpu.clone()));
        let transfer_pipelines = precomputed_transfer::Pipelines::new(gpu.clone());
        let gathering = gathering::Pipelines::new(&gpu)?;
        let tone_mapper = ToneMapper::new(gpu.clone())?;
        let refining = refining::Pipelines::new(&gpu);
        gpu.take_error()?;
        let convection_diffusion = convection_diffusion::Pipelines::default();
        Ok(Self {
            gpu,
            volumes,
            ray_caster,
            path_tracer,
            photon_pipelines,
            convection_diffusion,
            transfer_pipelines,
            bakes: None,
            record_passes,
            direct_light,
            gathering,
            tone_mapper,
            refining,
        })
    }

    /// Where bakes of `precomputed_transfer` are kept from now on, and taken from; `None`: nowhere.
    pub fn keep_bakes(&mut self, bakes: Option<Arc<precomputed_transfer::BakeStore>>) {
        self.bakes = bakes;
    }

    /// Draws a few pixels with each common variant, so that no viewer waits for a compiler (the
    /// software device compiles at the first dispatch).
    ///
    /// # Errors
    /// As [`Renderer::draw`].
    pub fn warm_up(&mut self) -> Result<(), RenderError> {
        let voxels = scene::Voxels::U8(vec![0, 255]);
        let volume = Arc::new(scene::PreparedVolume::new(scene::Volume::new([2, 1, 1], voxels), &|_| {}));
        for (surface, emission) in [(1.0, 0.0), (0.0, 0.0), (1.0, 1.0)] {
            let scene = Scene::new(&warm_up_scene(surface, emission), volume.clone())
                .map_err(RenderError::Refused)?;
            let snapshot = Arc::new(Snapshot { epoch: 0, scene });
            let target = Target { width: WORKGROUP_EDGE, height: WORKGROUP_EDGE, samples_per_pixel: 1 };
            let mut view = View::new();
            self.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None })?;
            self.picture(&mut view)?;
        }
        Ok(())
    }

    /// What can be done ahead of time on other threads.
    pub fn preparer(&self) -> Preparer {
        Preparer {
            volumes: self.volumes.clone(),
            ray_caster: self.ray_caster.clone(),
            path_tracer: self.path_tracer.clone(),
        }
    }

    /// Volume textures; [`VolumeCache::load`] may be called ahead of time from another thread.
    pub fn volumes(&self) -> &Arc<VolumeCache> {
        &self.volumes
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Draws towards `request.target` for about `request.budget`; call again to go on. What
    /// changed since the view was last drawn is derived from the snapshots; a newer snapshot
    /// simply supersedes an unfinished one.
    ///
    /// # Errors
    /// What is not built, too large or out of memory; GPU errors. The view may be drawn again.
    pub fn draw(&mut self, view: &mut View, request: &DrawRequest<'_>) -> Result<Drawn, RenderError> {
        self.draw_refined(view, request)
    }

    /// The same without paths that refine.
    fn draw_film(&mut self, view: &mut View, request: &DrawRequest<'_>) -> Result<Drawn, RenderError> {
        let began = Instant::now();
        let snapshot = &centred(request.snapshot);
        let request = &DrawRequest { snapshot, ..*request };
        let scene = &snapshot.scene;
        check(scene).map_err(RenderError::Refused)?;
        let plan = self.plan_centred(view, scene, request.target);
        let mut stages = Stages::default();
        let mut counters = BTreeMap::new();
        self.bring_tables_up_to_date(view, snapshot, &plan, &mut stages)?;
        // Of what was read back since the last drawing, its picture say.
        self.gpu.take_device_millis();
        let light = view.light.clone();
        let mut light = light.lock();
        if plan.runs(Pass::Illuminate) {
            let time = request.budget.map(|budget| {
                let as_rays = view.rays_took.min(budget.saturating_mul(MOST_BUDGETS_FOR_LIGHT));
                budget.mul_f64(LIGHT_SHARE_OF_BUDGET).max(as_rays)
            });
            let deadline = time.map(|time| began + time);
            stages.time("illuminate", || {
                let inputs = self.inputs(view, snapshot)?;
                light.advance(&inputs, deadline, &mut counters)
            })?;
            stages.on_device("illuminate", self.gpu.take_device_millis());
            if light.is_to_be_sorted(scene) {
                stages.time("sort_photons", || {
                    let inputs = self.inputs(view, snapshot)?;
                    light.sort(&inputs, &mut counters)
                })?;
            }
        }
        let light_is_complete = !scene.has_light_field() || light.is_complete();
        self.bring_film_to(view, snapshot, request.target, &plan, light.version())?;
        if plan.runs(Pass::RayCast) {
            // What will be drawn again is drawn roughly.
            let samples_per_pixel = if light_is_complete { request.target.samples_per_pixel } else { 1 };
            let target = Target { samples_per_pixel, ..request.target };
            let request = &DrawRequest { target, ..*request };
            let field = light.field().filter(|_| scene.has_light_field());
            let light = casting::SeenLight { field, gather: light.gather().filter(|_| field.is_some()) };
            let rays_began = Instant::now();
            stages.time("ray_cast", || {
                self.cast_rays(view, &light, scene, request, began)?;
                // Waits for the last slice, too: if that failed, so did the film.
                let finished = self.read_counters(view, light.gather.is_some(), &mut counters);
                if finished.is_err() {
                    view.film = None;
                }
                finished
            })?;
            view.rays_took = rays_began.elapsed();
            stages.on_device("ray_cast", self.gpu.take_device_millis());
        }
        if plan.runs(Pass::PathTrace) {
            stages.time("path_trace", || self.trace_paths(view, scene, request, began))?;
            stages.time("read_counters", || self.read_path_counters(view, &mut counters))?;
            stages.on_device("path_trace", self.gpu.take_device_millis());
            count_tiles(view, &plan, &mut counters);
            layers::count_mixed(view, &mut counters);
        } else if plan.film == FilmPlan::Mix {
            stages.time("mix_lights", || self.mix_alone(view, scene, &mut counters))?;
        }
        let samples = view.film.as_ref().map_or(0, |film| film.samples);
        let estimate = view.paths.as_ref().and_then(|paths| paths.estimate);
        let estimate = estimate.filter(|_| scene.integrator() == Integrator::PathTracer);
        let good_enough = estimate.is_some_and(|e| scene::plan::good_enough(scene, e.relative_error));
        let light_bytes = light.bytes();
        let film_is_lit = view.film.as_ref().is_none_or(|film| film.light_version == light.version());
        let is_lit = !scene.has_light_field() || light.is_complete() && film_is_lit;
        Ok(Drawn {
            complete: is_lit && (samples >= request.target.samples_per_pixel || good_enough),
            illumination: if scene.has_light_field() { light.completeness() } else { 1.0 },
            illumination_epoch: if light_is_complete { snapshot.epoch } else { light.lit_epoch() },
            samples_per_pixel: samples,
            pass_share: view.film.as_ref().map_or(0.0, |film| f64::from(film.rows) / f64::from(film.height)),
            estimate,
            drew: !plan.is_empty(),
            plan,
            stages: stages.0,
            counters,
            gpu_bytes: self.gpu_bytes(view, light_bytes),
        })
    }

    /// What an edit of each bin would make stale of what the view's complete picture was made from,
    /// where the method remembers which bins that relied on.
    ///
    /// # Errors
    /// GPU errors.
    pub fn stale_shares(&self, view: &View) -> Result<Option<StaleShares>, RenderError> {
        let Some(film) = &view.film else { return Ok(None) };
        let scene = &film.snapshot.scene;
        if scene.integrator() == Integrator::PathTracer {
            let tiles = view.paths.as_ref().map_or(&[] as &[u64], |paths| paths.tile_bins());
            return Ok(stale_shares::of_masks("tiles", tiles));
        }
        if scene.has_light_field() { view.light.lock().stale_shares(&self.gpu) } else { Ok(None) }
    }

    /// What drawing would do now, paths that refine left aside.
    pub fn plan(&self, view: &View, snapshot: &Arc<Snapshot>, target: Target) -> Plan {
        let [samples_per_pixel, _] = snapshot.scene.samples_and_paths(target.samples_per_pixel);
        let target = Target { samples_per_pixel, ..target };
        self.plan_centred(view, &centred(snapshot).scene, target)
    }

    fn plan_centred(&self, view: &View, scene: &Scene, target: Target) -> Plan {
        let light = view.light.lock();
        Plan::new(&view.caches(&light, scene, target, self.gpu.max_binding_bytes()), scene, target)
    }

    /// What a method that computes light ahead reads.
    fn inputs<'a>(&'a self, view: &'a View, snapshot: &'a Arc<Snapshot>) -> Result<Inputs<'a>, RenderError> {
        let (Some((_, texture)), Some((_, tables)), Some((_, lights))) =
            (&view.volume, &view.transfer_function, &view.lights)
        else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        Ok(Inputs {
            gpu: &self.gpu,
            snapshot,
            texture,
            tables,
            lights,
            majorants: view.majorants.as_ref().map(|(_, map)| map),
            distance_map: view.distance_map.as_ref().map(|(_, map)| map),
            record_passes: &self.record_passes,
            direct_light: &self.direct_light,
            environment: view.environment.as_ref().map(|(_, tables)| tables),
            photon_pipelines: &self.photon_pipelines,
            convection_diffusion: &self.convection_diffusion,
            transfer_pipelines: &self.transfer_pipelines,
            bakes: self.bakes.as_ref(),
        })
    }

    /// Tone-mapped picture of the view's film as it stands. Before the first complete pass, rows
    /// not drawn yet are black or show the film before.
    ///
    /// # Errors
    /// GPU errors; a view that was never drawn.
    pub fn picture(&mut self, view: &mut View) -> Result<Picture, RenderError> {
        let (Some(film), Some(buffers)) = (&view.film, &view.buffers) else {
            return Err(RenderError::Gpu("the view was never drawn".into()));
        };
        let pixels = u64::from(film.width) * u64::from(film.height);
        let (shown, paths) =
            view.refined().map_or((&buffers.film, 0), |refined| (&refined.blended, refined.paths));
        let samples_per_pixel = film.samples + paths;
        let held = Target { width: film.width, height: film.height, samples_per_pixel };
        let current = view.picture.as_ref().is_some_and(|(snapshot, shown)| {
            *shown == held && film.rows == 0 && snapshot.scene.film == film.snapshot.scene.film
        });
        if !current {
            let scene = &film.snapshot.scene;
            let mut settings = scene.film.clone();
            if !scene.rendering.is_lit() {
                // Greys of values are not light: shown as they are.
                settings.tone_mapping = ToneMapping::Linear;
            }
            self.tone_mapper.run(shown, &buffers.picture, pixels as u32, &settings);
        }
        let rgba = self.gpu.read_buffer(&buffers.picture, pixels * PICTURE_PIXEL_BYTES)?;
        // A film in the middle of a pass will have changed by the next call.
        view.picture = (film.rows == 0).then(|| (film.snapshot.clone(), held));
        Ok(Picture { width: held.width, height: held.height, rgba })
    }

    /// Linear radiance of the view's film: the mean of its samples.
    ///
    /// # Errors
    /// GPU errors; a view that was never drawn.
    pub fn radiance(&mut self, view: &View) -> Result<Radiance, RenderError> {
        let (Some(film), Some(buffers)) = (&view.film, &view.buffers) else {
            return Err(RenderError::Gpu("the view was never drawn".into()));
        };
        let pixels = u64::from(film.width) * u64::from(film.height);
        let shown = view.refined().map_or(&buffers.film, |refined| &refined.blended);
        let bytes = self.gpu.read_buffer(shown, pixels * FILM_PIXEL_BYTES)?;
        let sums: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        let rgb = sums.iter().flat_map(|&[r, g, b, count]| [r, g, b].map(|x| x / count.max(1.0)));
        Ok(Radiance { width: film.width, height: film.height, rgb: rgb.collect() })
    }

    fn bring_tables_up_to_date(
        &mut self,
        view: &mut View,
        snapshot: &Arc<Snapshot>,
        plan: &Plan,
        stages: &mut Stages,
    ) -> Result<(), RenderError> {
        let scene = &snapshot.scene;
        if plan.runs(Pass::UploadVolume) {
            // The old texture goes first: two volumes need not fit at once.
            view.volume = None;
            let texture = stages.time("upload_volume", || self.volumes.load(&scene.volume))?;
            view.volume = Some((snapshot.clone(), texture));
        }
        if plan.runs(Pass::UploadTransferFunction) {
            let tables = stages.time("upload_transfer_function", || self.transfer_function_tables(scene))?;
            view.transfer_function = Some((snapshot.clone(), tables));
        }
        if plan.runs(Pass::DistanceMap) || view.distance_map.is_none() && plan.runs(Pass::RayCast) {
            let map = stages.time("distance_map", || self.distance_map(scene))?;
            view.distance_map = Some((snapshot.clone(), map));
        }
        if plan.runs(Pass::Majorants) {
            let map = stages.time("majorants", || self.majorant_map(view, scene))?;
            view.majorants = Some((snapshot.clone(), map));
        }
        if plan.runs(Pass::UploadLights) {
            let lights = stages.time("upload_lights", || {
                Ok::<_, RenderError>(LightTables {
                    lights: self.uniform("lights", &tables::lights(scene), tables::MAX_LIGHTS)?,
                    sources: self.uniform("sources", &tables::sources(scene), tables::MAX_LIGHTS)?,
                })
            })?;
            view.lights = Some((snapshot.clone(), lights));
        }
        if plan.runs(Pass::UploadEnvironment)
            || view.environment.is_none() && (plan.runs(Pass::PathTrace) || plan.runs(Pass::Illuminate))
        {
            let tables = stages.time("upload_environment", || self.environment_tables(scene))?;
            view.environment = Some((snapshot.clone(), tables));
        }
        Ok(())
    }

    fn transfer_function_tables(&self, scene: &Scene) -> Result<TransferFunctionTables, RenderError> {
        let points = tables::transfer_function_points(scene);
        let width = scene.transfer_function.points.len() as u32;
        let cells = tables::transfer_function_cells(&scene.transfer_function);
        let cell_rows = [tables::TRANSFER_FUNCTION_CELLS, tables::CELL_ROWS].map(|edge| edge as u32);
        Ok(TransferFunctionTables {
            points: self.table("transfer function points", &points, [width, tables::POINT_ROWS as u32])?,
            cells: self.table("transfer function cells", &cells, cell_rows)?,
            materials: self.uniform("materials", &tables::materials(scene), tables::MAX_MATERIALS)?,
        })
    }

    /// A 2D texture of four floats a texel, row by row.
    fn table(
        &self,
        label: &str,
        texels: &[[f32; 4]],
        [width, height]: [u32; 2],
    ) -> Result<wgpu::TextureView, RenderError> {
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        let dimension = wgpu::TextureDimension::D2;
        self.gpu.filled_texture(
            label,
            size,
            dimension,
            wgpu::TextureFormat::Rgba32Float,
            bytemuck::cast_slice(texels),
        )
    }

    /// A uniform array with room for `capacity` values, as the shader declares it.
    fn uniform<T: bytemuck::Pod>(
        &self,
        label: &str,
        values: &[T],
        capacity: usize,
    ) -> Result<wgpu::Buffer, RenderError> {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let buffer = self.gpu.buffer(label, (capacity * std::mem::size_of::<T>()) as u64, usage)?;
        self.gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(values));
        Ok(buffer)
    }

    fn distance_map(&self, scene: &Scene) -> Result<wgpu::TextureView, RenderError> {
        let cells = &scene.volume.macrocells;
        let distances = distance_map(cells.dims, cells.masks(scene.filter), scene.bins_in_view());
        self.cell_map("distance map", scene, &distances)
    }

    /// A byte per macrocell.
    fn cell_map(&self, label: &str, scene: &Scene, bytes: &[u8]) -> Result<wgpu::TextureView, RenderError> {
        let cells = &scene.volume.macrocells;
        let [width, height, depth] = cells.dims.map(|n| n as u32);
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
        let dimension = wgpu::TextureDimension::D3;
        self.gpu.filled_texture(label, size, dimension, wgpu::TextureFormat::R8Uint, bytes)
    }

    /// Makes the film the newest snapshot's: kept, refined or begun again.
    fn bring_film_to(
        &self,
        view: &mut View,
        snapshot: &Arc<Snapshot>,
        target: Target,
        plan: &Plan,
        light_version: u64,
    ) -> Result<(), RenderError> {
        if plan.film != FilmPlan::Restart {
            if let FilmPlan::RestartTiles { bins, .. } = plan.film {
                self.restart_tiles(view, bins)?;
            }
            if plan.film != FilmPlan::Keep {
                view.picture = None;
            }
            if let Some(film) = &mut view.film {
                // Nothing that changed since can be seen on it, so it is this snapshot's film, too.
                film.snapshot = snapshot.clone();
            }
            return Ok(());
        }
        let Target { width, height, .. } = target;
        let pixels = u64::from(width) * u64::from(height);
        if view.buffers.as_ref().is_none_or(|buffers| buffers.capacity < pixels) {
            view.buffers = None;
            view.buffers = Some(self.view_buffers(pixels)?);
        }
        let same_size = view.film.as_ref().is_some_and(|film| (film.width, film.height) == (width, height));
        if let (false, Some(buffers)) = (same_size, &view.buffers) {
            let mut encoder =
                self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.clear_buffer(&buffers.film, 0, Some(pixels * FILM_PIXEL_BYTES));
            self.gpu.queue.submit([encoder.finish()]);
        }
        let in_segments = plan.segments != SegmentsPlan::Unused;
        view.film = Some(FilmCache {
            snapshot: snapshot.clone(),
            width,
            height,
            samples: 0,
            rows: 0,
            in_segments,
            light_version,
        });
        view.picture = None;
        match snapshot.scene.integrator() {
            Integrator::RayCaster => Ok(()),
            Integrator::PathTracer => self.begin_paths(view, &snapshot.scene, target),
        }
    }

    fn view_buffers(&self, pixels: u64) -> Result<ViewBuffers, RenderError> {
        let film_bytes = pixels * FILM_PIXEL_BYTES;
        let limit = self.gpu.max_binding_bytes();
        if film_bytes > limit {
            return Err(RenderError::TooLarge {
                what: format!("a picture of {pixels} pixels"),
                limit: format!("{} pixels", limit / FILM_PIXEL_BYTES),
            });
        }
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        Ok(ViewBuffers {
            frame: self.gpu.buffer("frame", std::mem::size_of::<FrameUniform>() as u64, uniform)?,
            counters: self.gpu.buffer("counters", tracing::COUNTER_BUFFER_BYTES, storage)?,
            film: self.gpu.buffer("the film", film_bytes, storage)?,
            picture: self.gpu.buffer("the picture", pixels * PICTURE_PIXEL_BYTES, storage)?,
            capacity: pixels,
        })
    }

    fn gpu_bytes(&self, view: &View, light_bytes: u64) -> BTreeMap<String, u64> {
        [
            ("volumes", self.volumes.bytes()),
            ("film", view.bytes()),
            ("segments", view.segment_bytes()),
            ("paths", view.path_bytes()),
            ("light", light_bytes),
            ("refinement", view.refinement.as_ref().map_or(0, |refinement| refinement.bytes())),
        ]
        .map(|(owner, bytes)| (owner.to_owned(), bytes))
        .into()
    }
}

/// Of an edit of matter, what became of the tiles of a path-traced film.
fn count_tiles(view: &View, plan: &Plan, counters: &mut BTreeMap<String, u64>) {
    let kept = view.paths.as_ref().and_then(|paths| paths.tiles_kept);
    if let (FilmPlan::RestartTiles { .. }, Some(tiles)) = (plan.film, kept) {
        counters.insert("tiles_reused".into(), tiles.kept);
        counters.insert("tiles_recomputed".into(), tiles.total - tiles.kept);
    }
}

/// The snapshot with the box of its voxels centred at the origin, where shaders expect it. From
/// here on there is no other: each cache's snapshot is a centred one. Methods that keep light in few bands
/// have small suns of environment images as lights of their own; those that work for each light have none
/// that are nothing beside the others.
fn centred(snapshot: &Arc<Snapshot>) -> Arc<Snapshot> {
    let scene = &snapshot.scene;
    let has_suns_apart = match scene.method {
        Method::PhotonMap | Method::ConvectionDiffusion => true,
        Method::ImageBased => scene.illumination.record_form == RecordForm::Product,
        _ => false,
    };
    let bright = if has_suns_apart { scene.without_negligible_lights() } else { None };
    let lit = bright.as_ref().unwrap_or(scene);
    let apart = if has_suns_apart { lit.with_suns_apart() } else { None };
    match apart.or(bright) {
        None if scene.grid.center_world == glam::DVec3::ZERO => snapshot.clone(),
        None => Arc::new(Snapshot { epoch: snapshot.epoch, scene: scene.centred() }),
        Some(lit) => Arc::new(Snapshot { epoch: snapshot.epoch, scene: lit.centred() }),
    }
}

/// Times of stages in the order they ran.
#[derive(Default)]
struct Stages(Vec<StageTime>);

impl Stages {
    fn time<T>(&mut self, stage: &str, run: impl FnOnce() -> T) -> T {
        let began = Instant::now();
        let value = run();
        let millis = began.elapsed().as_secs_f64() * 1e3;
        self.0.push(StageTime { stage: stage.to_owned(), millis, device_millis: None });
        value
    }

    /// What a stage took by the device's own clock.
    fn on_device(&mut self, stage: &str, millis: Option<f64>) {
        if let Some(known) = self.0.iter_mut().find(|known| known.stage == stage) {
            known.device_millis = millis;
        }
    }
}
