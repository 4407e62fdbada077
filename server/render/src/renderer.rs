//! Draws snapshots into views, slice by slice, as the plan says.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;
use proto::FieldError;
use proto::plan::{FrameReport, StageTime};
use proto::scene_file::{Method, ToneMapping};
use scene::distance::distance_map;
use scene::light::LightGeometry;
use scene::plan::{FilmPlan, Pass, Plan, SegmentsPlan, Target};
use scene::{Background, Rendering, Scene, Snapshot};

use crate::error::RenderError;
use crate::film::ToneMapper;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::ray_cast::{RayCaster, Variant, WORKGROUP_EDGE};
use crate::segments::Segments;
use crate::tables;
use crate::uniforms::{FrameUniform, MAX_PLANES};
use crate::view::{
    FILM_PIXEL_BYTES, FilmCache, PICTURE_PIXEL_BYTES, TransferFunctionTables, View, ViewBuffers,
};
use crate::volume_texture::{VolumeCache, VolumeTexture};

/// Methods that can be drawn.
pub const METHODS_BUILT: &[Method] = &[Method::Local];

/// Length a slice aims at where no budget is given: far below any driver's watchdog.
const UNHURRIED_SLICE: Duration = Duration::from_millis(200);
/// A slice aims at this share of the budget, so that the last one seldom overshoots it by much.
const SLICE_SHARE_OF_BUDGET: f64 = 0.5;
/// The first slice of a view, whose speed is unknown, covers this share of the image's rows.
const FIRST_SLICE_SHARE: u32 = 16;
/// A slice has at least about this many pixels: below it, handing a dispatch to the device and
/// waiting for it costs more than casting the rays (3 ms on an idle software device, ten times
/// that on a busy one).
const MIN_SLICE_PIXELS: u32 = 16_384;
/// Names of the words of the counter buffer, in the shader's order.
const COUNTERS: [&str; 6] = [
    "samples_taken",
    "samples_skipped",
    "samples_on_lattice",
    "samples_with_matter",
    "segments_reused",
    "segments_cast",
];
/// GPU memory for volumes no view holds any more.
const VOLUME_CACHE_BYTES: u64 = 2 << 30;

/// Draws views. One per GPU, on the thread that owns submission.
pub struct Renderer {
    gpu: Arc<Gpu>,
    volumes: Arc<VolumeCache>,
    ray_caster: RayCaster,
    tone_mapper: ToneMapper,
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
    if METHODS_BUILT.contains(&scene.method) {
        let Some(light) = scene.lights.iter().find(image) else { return Ok(()) };
        let message = format!(
            "`{}` cannot use environment images; give a uniform `radiance` instead",
            scene.method.name()
        );
        return Err(FieldError::new(format!("lights[{}].image", light.id), message));
    }
    let built: Vec<&str> = METHODS_BUILT.iter().map(|method| method.name()).collect();
    let message = format!("`{}` is not built yet; available: {}", scene.method.name(), built.join(", "));
    Err(FieldError::new("illumination.method", message))
}

impl Renderer {
    /// A renderer with its own pipelines.
    ///
    /// # Errors
    /// Out of memory, or the driver refuses a shader.
    pub fn new(gpu: Arc<Gpu>) -> Result<Self, RenderError> {
        let volumes = Arc::new(VolumeCache::new(gpu.clone(), VOLUME_CACHE_BYTES));
        let ray_caster = RayCaster::new(gpu.clone());
        let tone_mapper = ToneMapper::new(gpu.clone())?;
        gpu.take_error()?;
        Ok(Self { gpu, volumes, ray_caster, tone_mapper })
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
                .map_err(RenderError::NotBuilt)?;
            let snapshot = Arc::new(Snapshot { epoch: 0, scene });
            let target = Target { width: WORKGROUP_EDGE, height: WORKGROUP_EDGE, samples_per_pixel: 1 };
            let mut view = View::new();
            self.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None })?;
            self.picture(&mut view)?;
        }
        Ok(())
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
        let began = Instant::now();
        let snapshot = &centred(request.snapshot);
        let request = &DrawRequest { snapshot, ..*request };
        let scene = &snapshot.scene;
        check(scene).map_err(RenderError::NotBuilt)?;
        let plan = self.plan_centred(view, scene, request.target);
        let mut stages = Stages::default();
        self.bring_tables_up_to_date(view, snapshot, &plan, &mut stages)?;
        self.bring_film_to(view, snapshot, request.target, &plan)?;
        let mut counters = BTreeMap::new();
        if plan.runs(Pass::RayCast) {
            stages.time("ray_cast", || self.cast_rays(view, scene, request, began))?;
            stages.time("read_counters", || self.read_counters(view, &mut counters))?;
        }
        let samples = view.film.as_ref().map_or(0, |film| film.samples);
        Ok(Drawn {
            complete: samples >= request.target.samples_per_pixel,
            samples_per_pixel: samples,
            drew: !plan.is_empty(),
            plan,
            stages: stages.0,
            counters,
            gpu_bytes: self.gpu_bytes(view),
        })
    }

    /// What drawing would do now.
    pub fn plan(&self, view: &View, snapshot: &Arc<Snapshot>, target: Target) -> Plan {
        self.plan_centred(view, &centred(snapshot).scene, target)
    }

    fn plan_centred(&self, view: &View, scene: &Scene, target: Target) -> Plan {
        Plan::new(&view.caches(scene, target, self.gpu.max_binding_bytes()), scene, target)
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
        let held = Target { width: film.width, height: film.height, samples_per_pixel: film.samples };
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
            self.tone_mapper.run(&buffers.film, &buffers.picture, pixels as u32, &settings);
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
        let bytes = self.gpu.read_buffer(&buffers.film, pixels * FILM_PIXEL_BYTES)?;
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
        if plan.runs(Pass::UploadLights) {
            let lights = stages.time("upload_lights", || {
                self.uniform("lights", &tables::lights(scene), tables::MAX_LIGHTS)
            })?;
            view.lights = Some((snapshot.clone(), lights));
        }
        Ok(())
    }

    fn transfer_function_tables(&self, scene: &Scene) -> Result<TransferFunctionTables, RenderError> {
        let points = tables::transfer_function_points(scene);
        let width = scene.transfer_function.points.len() as u32;
        let cells = tables::transfer_function_cells(scene);
        Ok(TransferFunctionTables {
            points: self.table("transfer function points", &points, [width, tables::POINT_ROWS as u32])?,
            cells: self.table("transfer function cells", &cells, [cells.len() as u32, 1])?,
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
        self.texture(label, size, dimension, wgpu::TextureFormat::Rgba32Float, bytemuck::cast_slice(texels))
    }

    /// A texture with contents.
    fn texture(
        &self,
        label: &str,
        size: wgpu::Extent3d,
        dimension: wgpu::TextureDimension,
        format: wgpu::TextureFormat,
        bytes: &[u8],
    ) -> Result<wgpu::TextureView, RenderError> {
        let descriptor = wgpu::TextureDescriptor {
            label: Some(label),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        };
        let create = || self.gpu.device.create_texture(&descriptor);
        let texture = self.gpu.allocating(label, bytes.len() as u64, create)?;
        let rows = size.height * size.depth_or_array_layers;
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(bytes.len() as u32 / rows),
            rows_per_image: Some(size.height),
        };
        self.gpu.queue.write_texture(texture.as_image_copy(), bytes, layout, size);
        Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
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
        self.texture(label, size, dimension, wgpu::TextureFormat::R8Uint, bytes)
    }

    /// Makes the film the newest snapshot's: kept, refined or begun again.
    fn bring_film_to(
        &self,
        view: &mut View,
        snapshot: &Arc<Snapshot>,
        target: Target,
        plan: &Plan,
    ) -> Result<(), RenderError> {
        if plan.film != FilmPlan::Restart {
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
        view.film =
            Some(FilmCache { snapshot: snapshot.clone(), width, height, samples: 0, rows: 0, in_segments });
        view.picture = None;
        Ok(())
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
            counters: self.gpu.buffer("counters", COUNTER_BYTES, storage)?,
            film: self.gpu.buffer("the film", film_bytes, storage)?,
            picture: self.gpu.buffer("the picture", pixels * PICTURE_PIXEL_BYTES, storage)?,
            capacity: pixels,
        })
    }

    /// Casts rays, rows by rows and pass by pass, until the target or the budget is reached.
    fn cast_rays(
        &mut self,
        view: &mut View,
        scene: &Scene,
        request: &DrawRequest<'_>,
        began: Instant,
    ) -> Result<(), RenderError> {
        let View { volume, transfer_function, distance_map, lights, film, buffers, segments, .. } = view;
        let (
            Some((_, texture)),
            Some((_, tables)),
            Some((_, distance_map)),
            Some((_, lights)),
            Some(film),
            Some(buffers),
        ) = (volume, transfer_function, distance_map, lights, film, buffers)
        else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        self.gpu.queue.write_buffer(&buffers.counters, 0, &[0; COUNTER_BYTES as usize]);
        let mut uniform = frame_uniform(scene, texture, film);
        let tables = BoundTables { texture, tables, distance_map, lights };
        let mut pass: Option<SamplePass> = None;
        while film.samples < request.target.samples_per_pixel {
            let current = match pass.take().filter(|pass| pass.sample == film.samples) {
                Some(pass) => pass,
                None => self.sample_pass(scene, &tables, buffers, film, segments)?,
            };
            let rows = slice_rows(film, view.millis_per_megasample, request.budget);
            uniform.segments_kept = u32::from(current.segments_kept);
            uniform.first_row = film.rows;
            uniform.row_count = rows;
            uniform.sample_index = film.samples;
            (uniform.subpixel, uniform.lattice_shift) = sample_position(film.samples);
            let gpu = &self.gpu;
            gpu.queue.write_buffer(&buffers.frame, 0, bytemuck::bytes_of(&uniform));
            let slice_began = Instant::now();
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut dispatch = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                dispatch.set_pipeline(&current.pipeline);
                dispatch.set_bind_group(0, &current.bind_group, &[]);
                dispatch.dispatch_workgroups(
                    film.width.div_ceil(WORKGROUP_EDGE),
                    rows.div_ceil(WORKGROUP_EDGE),
                    1,
                );
            }
            gpu.queue.submit([encoder.finish()]);
            gpu.wait()?;
            let megasamples = f64::from(film.width) * f64::from(rows) / 1e6;
            view.millis_per_megasample = slice_began.elapsed().as_secs_f64() * 1e3 / megasamples;
            film.rows += rows;
            if film.rows >= film.height {
                if current.in_segments {
                    segments.finish(film.samples, &film.snapshot);
                }
                film.rows = 0;
                film.samples += 1;
            }
            pass = Some(current);
            if request.budget.is_some_and(|budget| began.elapsed() >= budget) {
                break;
            }
        }
        Ok(())
    }

    /// Pipeline and bindings for one sample per pixel of the film.
    fn sample_pass(
        &mut self,
        scene: &Scene,
        tables: &BoundTables<'_>,
        buffers: &ViewBuffers,
        film: &FilmCache,
        segments: &mut Segments,
    ) -> Result<SamplePass, RenderError> {
        let size = (film.width, film.height);
        let layer = film.in_segments.then(|| segments.begin(&self.gpu, size, film.samples, &film.snapshot));
        let layer = layer.flatten();
        let mut variant = Variant::of(scene, tables.texture);
        let mut changed_map = None;
        if let Some(layer) = &layer {
            variant.keep_segments = true;
            if let Some(distances) = &layer.changed_distances {
                changed_map = Some(self.cell_map("map of changes", scene, distances)?);
            }
        }
        let pipeline = self.ray_caster.pipeline(variant);
        let bindings = self.ray_caster.bindings(variant);
        let segments = layer.as_ref().map_or(&bindings.no_segments, |layer| &layer.buffer);
        let bind_group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("ray_cast"),
            layout: &bindings.bind_group_layout,
            entries: &[
                buffer_entry(0, &buffers.frame),
                texture_entry(1, &tables.tables.points),
                texture_entry(2, &tables.tables.cells),
                buffer_entry(3, &tables.tables.materials),
                buffer_entry(4, tables.lights),
                buffer_entry(5, &buffers.film),
                buffer_entry(6, &buffers.counters),
                texture_entry(7, &tables.texture.view),
                wgpu::BindGroupEntry {
                    binding: 8,
                    resource: wgpu::BindingResource::Sampler(&bindings.sampler),
                },
                texture_entry(9, tables.distance_map),
                buffer_entry(10, segments),
                texture_entry(11, changed_map.as_ref().unwrap_or(tables.distance_map)),
            ],
        });
        Ok(SamplePass {
            sample: film.samples,
            in_segments: layer.is_some(),
            segments_kept: changed_map.is_some(),
            pipeline,
            bind_group,
        })
    }

    fn read_counters(&self, view: &View, counters: &mut BTreeMap<String, u64>) -> Result<(), RenderError> {
        let Some(buffers) = &view.buffers else { return Ok(()) };
        let bytes = self.gpu.read_buffer(&buffers.counters, COUNTER_BYTES)?;
        // Low word, then high word.
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
        for (name, pair) in COUNTERS.iter().zip(words.chunks_exact(2)) {
            counters.insert((*name).to_owned(), u64::from(pair[0]) | u64::from(pair[1]) << 32);
        }
        Ok(())
    }

    fn gpu_bytes(&self, view: &View) -> BTreeMap<String, u64> {
        [("volumes", self.volumes.bytes()), ("film", view.bytes()), ("segments", view.segment_bytes())]
            .map(|(owner, bytes)| (owner.to_owned(), bytes))
            .into()
    }
}

/// The snapshot with the box of its voxels centred at the origin, where shaders expect it. From
/// here on there is no other: each cache's snapshot is a centred one.
fn centred(snapshot: &Arc<Snapshot>) -> Arc<Snapshot> {
    if snapshot.scene.grid.center_world == glam::DVec3::ZERO {
        return snapshot.clone();
    }
    Arc::new(Snapshot { epoch: snapshot.epoch, scene: snapshot.scene.centred() })
}

/// A lit scene whose matter has a surface or none, and emits or not.
fn warm_up_scene(surface: f64, emission: f64) -> proto::SceneFile {
    use proto::scene_file as file;
    let source =
        file::VolumeSource { builtin: Some(file::Builtin::Homogeneous), ..file::VolumeSource::default() };
    let mut scene = proto::SceneFile::new(source);
    // What default scenes and samples use.
    let brdf = Some(file::Brdf::BlinnPhong(file::BlinnPhong { diffuse: 0.9, specular: 0.1, exponent: 30.0 }));
    scene.materials.insert("m".into(), file::Material { surface, brdf, ..file::Material::default() });
    for point in &mut scene.transfer_function.points {
        point.material = Some("m".into());
        point.emission = [emission; 3];
    }
    let (direction, irradiance) = ([0.0, 0.0, -1.0], [1.0; 3]);
    let light = file::DirectionalLight { id: None, enabled: true, direction, irradiance };
    scene.lights.push(file::Light::Directional(light));
    scene
}

/// What every pass of the ray caster over a view reads.
struct BoundTables<'a> {
    texture: &'a VolumeTexture,
    tables: &'a TransferFunctionTables,
    distance_map: &'a wgpu::TextureView,
    lights: &'a wgpu::Buffer,
}

/// One sample per pixel: what its slices are dispatched with.
struct SamplePass {
    /// Index of the sample.
    sample: u32,
    /// Whether rays are cast in segments, which are kept.
    in_segments: bool,
    /// Whether segments kept before may serve again.
    segments_kept: bool,
    pipeline: wgpu::ComputePipeline,
    bind_group: wgpu::BindGroup,
}

/// Two words a counter.
const COUNTER_BYTES: u64 = 8 * COUNTERS.len() as u64;

/// Times of stages in the order they ran.
#[derive(Default)]
struct Stages(Vec<StageTime>);

impl Stages {
    fn time<T>(&mut self, stage: &str, run: impl FnOnce() -> T) -> T {
        let began = Instant::now();
        let value = run();
        self.0.push(StageTime { stage: stage.to_owned(), millis: began.elapsed().as_secs_f64() * 1e3 });
        value
    }
}

/// Rows of the next slice: whole workgroups, as many as fit the time a slice may take.
fn slice_rows(film: &FilmCache, millis_per_megasample: f64, budget: Option<Duration>) -> u32 {
    let left = film.height - film.rows;
    let aim = budget.map_or(UNHURRIED_SLICE, |budget| budget.mul_f64(SLICE_SHARE_OF_BUDGET));
    let rows = if millis_per_megasample > 0.0 {
        let row_millis = millis_per_megasample * f64::from(film.width) / 1e6;
        (aim.as_secs_f64() * 1e3 / row_millis).min(f64::from(film.height)) as u32
    } else {
        film.height / FIRST_SLICE_SHARE
    };
    let whole_groups = |rows: u32| rows.div_ceil(WORKGROUP_EDGE) * WORKGROUP_EDGE;
    let fewest = whole_groups(MIN_SLICE_PIXELS.div_ceil(film.width));
    whole_groups(rows).max(fewest).min(left)
}

/// Position in the pixel square and shift of the lattice along the ray, in steps, of sample
/// `index`. The first stands in the middle of everything; the others follow the additive
/// recurrence of Roberts (R3), so that n samples are close to evenly spread for every n. They are
/// the same for every pixel: the picture shows no noise, and accumulation refines the lattice.
fn sample_position(index: u32) -> ([f32; 2], f32) {
    // Reciprocal powers of the root of x^4 = x + 1.
    const ROOT: f64 = 1.220_744_084_605_759_5;
    let part = |power: i32, start: f64| (start + f64::from(index) * ROOT.powi(-power)).fract() as f32;
    ([part(1, 0.5), part(2, 0.5)], part(3, 0.0))
}

/// `surface` of the frame uniform.
fn surface(scene: &Scene) -> [f32; 4] {
    match scene.rendering {
        Rendering::Slice { normal, offset } => normal.extend(offset).as_vec4().to_array(),
        Rendering::Isosurface { value } => {
            let [low, high] = scene.value_range;
            let s = if high > low { (value - low) / (high - low) } else { f64::MAX };
            [0.0, 0.0, 0.0, s.clamp(-1e30, 1e30) as f32]
        }
        _ => [0.0; 4],
    }
}

fn frame_uniform(scene: &Scene, texture: &VolumeTexture, film: &FilmCache) -> FrameUniform {
    use scene::camera::Projection;
    let camera = &scene.camera;
    let (projection, half_height) = match camera.projection {
        Projection::Perspective { tan_half_fov_y } => (0, tan_half_fov_y),
        Projection::Orthographic { half_height } => (1, half_height),
    };
    let (s_scale, s_offset) = texture.s_from_texel(scene);
    let mut planes = [[0.0; 4]; MAX_PLANES];
    for (slot, (normal, offset)) in planes.iter_mut().zip(&scene.clip.planes) {
        *slot = normal.extend(*offset).as_vec4().to_array();
    }
    let background = match scene.background {
        Background::Color(color) => color,
        // Only with an environment image as a light, which `check` refuses.
        Background::Image { .. } => DVec3::ZERO,
    };
    FrameUniform {
        eye: tables::vector(camera.eye),
        half_height: half_height as f32,
        forward: tables::vector(camera.forward),
        projection,
        right: tables::vector(camera.right),
        step_world: scene.step_world() as f32,
        up: tables::vector(camera.up),
        termination: scene.sampling.termination_transmittance as f32,
        size_world: tables::vector(scene.grid.size_world),
        s_scale: s_scale as f32,
        voxels: scene.grid.dims.map(|n| n as f32),
        s_offset: s_offset as f32,
        clip_low: tables::vector(scene.grid.world_from_unit(scene.clip.bounds[0])),
        plane_count: scene.clip.planes.len() as u32,
        clip_high: tables::vector(scene.grid.world_from_unit(scene.clip.bounds[1])),
        light_count: tables::lights(scene).len() as u32,
        background: tables::vector(background),
        skip_empty: u32::from(scene.sampling.skip_empty),
        ambient: tables::vector(tables::ambient(scene)),
        point_count: scene.transfer_function.points.len() as u32,
        image: [film.width, film.height],
        first_row: 0,
        row_count: 0,
        subpixel: [0.5; 2],
        lattice_shift: 0.0,
        sample_index: 0,
        segments_kept: 0,
        pad0: 0,
        pad1: 0,
        pad2: 0,
        surface: surface(scene),
        planes,
    }
}
