//! A bake: each texel's answer to every basis light, for matter as it is.

use std::time::{Duration, Instant};

use proto::scene_file::{Filter, Orders};
use scene::{Changes, Scene};

use super::basis::{Basis, Flights, LightVector, mean_shown, photon_factor};
use super::mass::{MOST_DEPTH, Mass};
use super::passes::{GROUP, Variant};
use crate::error::RenderError;
use crate::gpu::{buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::light_field::{self, LightField};
use crate::uniforms;

/// What matrices of a session may take on a device with memory of its own, bytes.
const MAX_BYTES: u64 = 2 << 30;
/// The same on a software device.
const MAX_BYTES_SOFTWARE: u64 = 256 << 20;
/// By how much a grid that does not fit is made coarser at a time.
const COARSER: f64 = 0.85;
/// Photons followed together. Part of the result: sums are rounded batch by batch.
const BATCH: u32 = 65_536;
const BATCH_SOFTWARE: u32 = 16_384;
/// Directions marched between looks at the clock.
const DIRECTIONS_AT_ONCE: u32 = 4;
/// Rays of an invocation: fewest and most.
const RAYS: [u32; 2] = [2, 64];
/// Numbers that an invocation may add up with its rays. All loops of eight lanes together end after
/// 65,535 turns on Mesa 22's software device; a share has up to 6 functions in 8 texels.
const MOST_TURNS: u32 = 24_000;
const TURNS_OF_A_SHARE: u32 = 48;
/// Cells and tentative collisions of an invocation.
const STEPS: u32 = 16_384;
const STEPS_SOFTWARE: u32 = 4096;
/// Time a dispatch aims at.
const DISPATCH_AIM: Duration = Duration::from_millis(50);
/// Two words a counter, then one: see `counters` in shaders/precomputed_transfer/carry.wgsl.
const COUNTERS: usize = 4;
const COUNTER_BYTES: u64 = 8 * COUNTERS as u64 + 4;
/// Most workgroups along an axis of a dispatch.
const MAX_GROUPS: u32 = 65_535;
/// Whole numbers that hold sums of photons stay below this.
const MOST_COUNT: f64 = 1_073_741_824.0;
/// How much heavier than all others together a basis light's share of photons is, at most; and a photon
/// than it began. Both with room.
const HEAVIEST: f64 = 8.0;

/// What a bake is made for, beside matter: another layout is another bake.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    lights: u32,
    longest: u32,
    nside: usize,
    photons: u64,
    events: u32,
    bands: u32,
    orders: Orders,
    nearest: bool,
}

impl Layout {
    pub fn of(scene: &Scene) -> Self {
        let settings = &scene.illumination;
        let events = match scene.orders {
            Orders::All => settings.transfer_events,
            Orders::AtMost(count) => count.min(settings.transfer_events),
        };
        Self {
            lights: settings.transfer_lights,
            longest: settings.transfer_grid,
            nside: f64::from(settings.transfer_directions / 12).sqrt().round() as usize,
            // What has been scattered at most once was marched.
            photons: if events > 1 { u64::from(settings.transfer_photons) } else { 0 },
            events,
            bands: light_field::bands_of(scene, settings.transfer_bands),
            orders: scene.orders,
            nearest: scene.filter == Filter::Nearest,
        }
    }
}

/// Exact work of a call.
#[derive(Debug, Clone, Copy, Default)]
pub struct Work {
    pub rays: u64,
    pub photons: u64,
    pub interactions: u64,
    pub tentative_collisions: u64,
    pub cells: u64,
    pub cut_1024ths: u64,
}

/// The bake of a session, finished or under way.
pub struct Bake {
    layout: Layout,
    /// What it is, or is becoming, the bake of.
    scene: Scene,
    basis: Basis,
    mass: Mass,
    /// Matrices and tables; `None`: there is no matter.
    held: Option<Held>,
    pub field: LightField,
    coloured: bool,
    directions: u32,
    directions_done: u32,
    photons_done: u64,
    /// Photons of the batch under way; 0: there is none.
    under_way: u32,
    rays: u32,
    /// Largest memory so far, bytes.
    pub peak_bytes: u64,
}

/// Buffers of a bake.
struct Held {
    settings: wgpu::Buffer,
    frame: wgpu::Buffer,
    row_texels: wgpu::Buffer,
    texel_rows: wgpu::Buffer,
    masses: wgpu::Buffer,
    direct: wgpu::Buffer,
    scattered: wgpu::Buffer,
    lights: wgpu::Buffer,
    /// What only the work needs; `None`: it is done.
    work: Option<Workshop>,
    entries: Vec<[u32; 2]>,
}

struct Workshop {
    directions: wgpu::Buffer,
    integrals: wgpu::Buffer,
    flights: wgpu::Buffer,
    flight_count: u32,
    stride: u32,
    sums: wgpu::Buffer,
    paths: wgpu::Buffer,
    counters: wgpu::Buffer,
}

impl Workshop {
    fn buffers(&self) -> [&wgpu::Buffer; 6] {
        [&self.directions, &self.integrals, &self.flights, &self.sums, &self.paths, &self.counters]
    }
}

/// Whether albedo differs between red, green and blue.
fn is_coloured(scene: &Scene) -> bool {
    let grey = |albedo: glam::DVec3| albedo.x == albedo.y && albedo.y == albedo.z;
    !scene.transfer_function.points.iter().all(|point| grey(point.albedo))
}

/// Bytes of the largest buffer, and of all matrices.
fn matrix_bytes(rows: u64, lights: u32, bands: u32, coloured: bool) -> (u64, u64) {
    let plane = 4 * rows * u64::from(lights) * u64::from(bands * bands);
    let channels = if coloured { 3 } else { 1 };
    (channels * plane, (1 + 2 * channels) * plane)
}

impl Bake {
    /// # Errors
    /// Out of memory.
    pub fn new(inputs: &Inputs<'_>) -> Result<Self, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let layout = Layout::of(scene);
        let coloured = is_coloured(scene);
        let limit = if gpu.info().software { MAX_BYTES_SOFTWARE } else { MAX_BYTES };
        let mut longest = layout.longest;
        let mass = loop {
            let mass = Mass::of(inputs, light_field::dims(scene, longest))?;
            let rows = mass.rows.len() as u64;
            let (largest, all) = matrix_bytes(rows, layout.lights, layout.bands, coloured);
            if largest <= gpu.max_binding_bytes() && all <= limit || longest <= 1 {
                break mass;
            }
            longest = (f64::from(longest) * COARSER) as u32;
        };
        let mut field = LightField::new(gpu, mass.dims, layout.bands)?;
        field.nearest = layout.nearest;
        let basis = Basis::new(layout.lights);
        let held = match mass.rows.is_empty() {
            true => None,
            false => Some(Held::new(inputs, &layout, &basis, &mass, coloured)?),
        };
        let directions = (12 * layout.nside * layout.nside) as u32;
        let mut bake = Self {
            scene: scene.clone(),
            basis,
            mass,
            directions,
            directions_done: if held.is_some() { 0 } else { directions },
            photons_done: if held.is_some() { 0 } else { layout.photons },
            held,
            field,
            coloured,
            under_way: 0,
            rays: RAYS[0],
            layout,
            peak_bytes: 0,
        };
        bake.peak_bytes = bake.bytes();
        Ok(bake)
    }

    /// Whether it is, or is becoming, the bake of a scene: lights, camera and film do not matter.
    pub fn serves(&self, scene: &Scene) -> bool {
        if self.layout != Layout::of(scene) {
            return false;
        }
        let changes = Changes::between(&self.scene, scene);
        let bins = changes.bins & scene.volume.macrocells.occurring(scene.filter);
        !changes.volume && bins == 0 && !changes.clip && !changes.clip_shadows
    }

    /// Takes the scene for its own, which it serves.
    pub fn take_scene(&mut self, scene: &Scene) {
        self.scene = scene.clone();
    }

    pub fn is_complete(&self) -> bool {
        self.directions_done == self.directions && self.photons_done == self.layout.photons
    }

    /// Share of the work that is done, 0..1.
    pub fn progress(&self) -> f32 {
        let share = |done: f64, all: f64| if all > 0.0 { done / all } else { 1.0 };
        let marched = share(f64::from(self.directions_done), f64::from(self.directions));
        let flown = share(self.photons_done as f64, self.layout.photons as f64);
        (0.5 * (marched + flown)) as f32
    }

    pub fn rows(&self) -> u64 {
        self.mass.rows.len() as u64
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        self.field.bytes() + self.held.as_ref().map_or(0, Held::bytes)
    }

    /// The light of a scene, made of basis lights.
    pub fn light_of(&mut self, scene: &Scene) -> LightVector {
        self.basis.light_of(scene)
    }

    /// One slice of work.
    pub fn work(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        if self.directions_done < self.directions {
            self.march(inputs, work)?;
        } else if self.photons_done < self.layout.photons {
            self.carry(inputs, work)?;
        }
        if let (true, Some(held)) = (self.is_complete(), &mut self.held) {
            held.work = None;
        }
        Ok(())
    }

    fn settings(&self, scene: &Scene) -> uniforms::Transfer {
        let size = scene.grid.size_world;
        let largest = f64::from(self.mass.largest);
        let texel = (0..3).map(|axis| size[axis] / f64::from(self.mass.dims[axis])).sum::<f64>();
        let factor = photon_factor(size, self.photons_done, largest);
        uniforms::Transfer {
            dims: self.mass.dims,
            bases: self.layout.lights,
            rows: self.mass.rows.len() as u32,
            bands: self.layout.bands,
            channels: if self.coloured { 3 } else { 1 },
            clip_shadows: u32::from(scene.clip.shadows),
            events: self.layout.events,
            unit: 1.0,
            mean_shown: mean_shown(size) as f32,
            photon_factor: if self.photons_done > 0 { factor as f32 } else { 0.0 },
            scale: 1.0,
            most: (MOST_DEPTH * 3.0 / texel) as f32,
            ..uniforms::Transfer::default()
        }
    }

    fn variant(&self, inputs: &Inputs<'_>) -> Variant {
        let (bands, coloured) = (self.layout.bands, self.coloured);
        Variant::of(&inputs.snapshot.scene, inputs.texture, bands, coloured)
    }

    /// Some directions of light that has not been scattered.
    fn march(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        let (gpu, scene, pipelines) = (inputs.gpu, &inputs.snapshot.scene, inputs.transfer_pipelines);
        let (variant, settings) = (self.variant(inputs), self.settings(scene));
        let Some(held) = &self.held else { return Ok(()) };
        let (Some(workshop), Some(distance_map)) = (&held.work, inputs.distance_map) else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        held.write_frame(inputs);
        let quads = inputs.texture.quads.as_ref().unwrap_or(&inputs.texture.view);
        let mut entries = held.matter(inputs, &pipelines.sampler, distance_map).to_vec();
        entries.extend([
            texture_entry(12, quads),
            buffer_entry(22, &workshop.directions),
            buffer_entry(23, &workshop.integrals),
            buffer_entry(24, &held.row_texels),
            buffer_entry(25, &held.masses),
            buffer_entry(26, &held.direct),
        ]);
        let bind_group = pipelines.march.bind(gpu, &entries);
        let pipeline = pipelines.march(variant);
        let last = (self.directions_done + DIRECTIONS_AT_ONCE).min(self.directions);
        for direction in self.directions_done..last {
            let [first_entry, last_entry] = held.entries[direction as usize];
            let settings = uniforms::Transfer { direction, first_entry, last_entry, ..settings };
            gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
            gpu.dispatch(&pipeline, &bind_group, [settings.rows.div_ceil(GROUP), 1]);
            work.rays += u64::from(settings.rows);
        }
        gpu.wait()?;
        self.directions_done = last;
        Ok(())
    }

    /// One dispatch of photons.
    fn carry(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        let (gpu, scene, pipelines) = (inputs.gpu, &inputs.snapshot.scene, inputs.transfer_pipelines);
        let (variant, settings) = (self.variant(inputs), self.settings(scene));
        let software = gpu.info().software;
        let Some(held) = &self.held else { return Ok(()) };
        let (Some(workshop), Some(majorants)) = (&held.work, inputs.majorants) else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        let batch = if software { BATCH_SOFTWARE } else { BATCH };
        let begins = self.under_way == 0;
        if begins {
            self.under_way = u64::from(batch).min(self.layout.photons - self.photons_done) as u32;
        }
        let most_rays = MOST_TURNS / (TURNS_OF_A_SHARE * self.layout.bands * self.layout.bands);
        let settings = uniforms::Transfer {
            first: self.photons_done as u32,
            count: self.under_way,
            photon_rays: self.rays.min(most_rays).max(1),
            steps: if software { STEPS_SOFTWARE } else { STEPS },
            flights: workshop.flight_count,
            stride: workshop.stride,
            unit: unit_of(batch, self.layout.events, self.layout.lights),
            ..settings
        };
        gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
        gpu.queue.write_buffer(&workshop.counters, 0, &[0; COUNTER_BYTES as usize]);
        held.write_frame(inputs);
        let groups = self.under_way.div_ceil(GROUP);
        if begins {
            let bind_group = pipelines.enter.bind(
                gpu,
                &[
                    buffer_entry(0, &held.frame),
                    buffer_entry(10, &workshop.paths),
                    buffer_entry(21, &held.settings),
                    buffer_entry(27, &workshop.flights),
                ],
            );
            gpu.dispatch(&pipelines.enter(), &bind_group, [groups, 1]);
        }
        let mut entries = held.matter(inputs, &pipelines.sampler, majorants).to_vec();
        entries.extend([
            buffer_entry(3, &inputs.tables.materials),
            buffer_entry(6, &workshop.counters),
            buffer_entry(10, &workshop.paths),
            buffer_entry(27, &workshop.flights),
            buffer_entry(28, &held.texel_rows),
            buffer_entry(29, &workshop.sums),
        ]);
        let bind_group = pipelines.carry.bind(gpu, &entries);
        let began = Instant::now();
        gpu.dispatch(&pipelines.carry(variant), &bind_group, [groups, 1]);
        let bytes = gpu.read_buffer(&workshop.counters, COUNTER_BYTES)?;
        let took = began.elapsed();
        if took < DISPATCH_AIM / 2 {
            self.rays = (2 * self.rays).min(RAYS[1]);
        } else if took > 2 * DISPATCH_AIM {
            self.rays = (self.rays / 2).max(RAYS[0]);
        }
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
        let count = |i: usize| u64::from(words[2 * i]) | u64::from(words[2 * i + 1]) << 32;
        work.tentative_collisions += count(0);
        work.cells += count(1);
        work.interactions += count(2);
        // What the scene asks to leave out is not lost.
        let asked = matches!(self.layout.orders, Orders::AtMost(n) if n <= self.layout.events);
        work.cut_1024ths += if asked { 0 } else { count(3) };
        if words[2 * COUNTERS] == 0 {
            let bind_group = pipelines.take_in.bind(
                gpu,
                &[
                    buffer_entry(21, &held.settings),
                    buffer_entry(24, &held.scattered),
                    buffer_entry(29, &workshop.sums),
                ],
            );
            let groups = (workshop.sums.size() / 4).div_ceil(u64::from(GROUP)) as u32;
            let columns = groups.min(MAX_GROUPS);
            gpu.dispatch(&pipelines.take_in(), &bind_group, [columns, groups.div_ceil(columns)]);
            gpu.wait()?;
            work.photons += u64::from(self.under_way);
            self.photons_done += u64::from(self.under_way);
            self.under_way = 0;
        }
        Ok(())
    }

    /// Light times matrices into the field.
    pub fn relight(&self, inputs: &Inputs<'_>, light: &LightVector) -> Result<(), RenderError> {
        let (gpu, scene, pipelines) = (inputs.gpu, &inputs.snapshot.scene, inputs.transfer_pipelines);
        self.field.set_scale(light.scale);
        let Some(held) = &self.held else { return Ok(()) };
        let settings = uniforms::Transfer { scale: light.scale, ..self.settings(scene) };
        gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
        gpu.queue.write_buffer(&held.lights, 0, bytemuck::cast_slice(&light.texels));
        let bind_group = pipelines.relight.bind(
            gpu,
            &[
                buffer_entry(21, &held.settings),
                buffer_entry(24, &held.scattered),
                buffer_entry(25, &held.masses),
                buffer_entry(26, &held.direct),
                buffer_entry(28, &held.texel_rows),
                buffer_entry(30, &held.lights),
                texture_entry(31, &self.field.view),
            ],
        );
        let texels: u32 = self.mass.dims.iter().product();
        let coefficients = self.layout.bands * self.layout.bands;
        gpu.dispatch(&pipelines.relight(), &bind_group, [texels.div_ceil(GROUP), coefficients]);
        gpu.wait()
    }
}

/// What a share is counted in: a power of two, so that a batch that falls into one texel cannot make a
/// sum overflow.
fn unit_of(batch: u32, events: u32, lights: u32) -> f32 {
    let largest = HEAVIEST * f64::from(batch) * f64::from(events) / f64::from(lights);
    (largest / MOST_COUNT).log2().ceil().exp2() as f32
}

impl Held {
    fn new(
        inputs: &Inputs<'_>,
        layout: &Layout,
        basis: &Basis,
        mass: &Mass,
        coloured: bool,
    ) -> Result<Self, RenderError> {
        let gpu = inputs.gpu;
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let filled = |label: &str, bytes: &[u8]| {
            let buffer = gpu.buffer(label, bytes.len() as u64, storage)?;
            gpu.queue.write_buffer(&buffer, 0, bytes);
            Ok::<_, RenderError>(buffer)
        };
        let rows = mass.rows.len() as u64;
        let (scattered, _) = matrix_bytes(rows, layout.lights, layout.bands, coloured);
        let (direct, _) = matrix_bytes(rows, layout.lights, layout.bands, false);
        let batch = if gpu.info().software { BATCH_SOFTWARE } else { BATCH };
        let paths = u64::from(batch) * std::mem::size_of::<uniforms::Path>() as u64;
        let directions = basis.directions(layout.nside, layout.bands as usize);
        let Flights { texels, count, stride } = basis.flights();
        let normalised: Vec<f32> = mass.rows.iter().map(|row| row.1 / mass.largest).collect();
        let row_texels: Vec<u32> = mass.rows.iter().map(|row| row.0).collect();
        Ok(Self {
            settings: gpu.buffer("transfer", std::mem::size_of::<uniforms::Transfer>() as u64, storage)?,
            frame: gpu.buffer("frame", std::mem::size_of::<uniforms::FrameUniform>() as u64, uniform)?,
            row_texels: filled("texels of rows", bytemuck::cast_slice(&row_texels))?,
            texel_rows: filled("rows of texels", bytemuck::cast_slice(&mass.rows_of_texels()))?,
            masses: filled("extinction around texels", bytemuck::cast_slice(&normalised))?,
            direct: gpu.buffer("matrices of direct light", direct, storage)?,
            scattered: gpu.buffer("matrices of scattered light", scattered, storage)?,
            lights: gpu.buffer("light vector", 16 * u64::from(layout.lights), storage)?,
            work: Some(Workshop {
                directions: filled("directions", bytemuck::cast_slice(&directions.towards))?,
                integrals: filled("integrals of functions", bytemuck::cast_slice(&directions.integrals))?,
                flights: filled("directions of photons", bytemuck::cast_slice(&texels))?,
                flight_count: count,
                stride,
                sums: gpu.buffer("sums of photons", scattered, storage)?,
                paths: gpu.buffer("photons at work", paths, storage)?,
                counters: gpu.buffer("counters", COUNTER_BYTES, storage)?,
            }),
            entries: directions.entries,
        })
    }

    fn bytes(&self) -> u64 {
        let kept = [&self.row_texels, &self.texel_rows, &self.masses, &self.direct, &self.scattered];
        let work = self.work.iter().flat_map(Workshop::buffers);
        kept.into_iter().chain(work).map(wgpu::Buffer::size).sum()
    }

    fn write_frame(&self, inputs: &Inputs<'_>) {
        let frame = crate::frame::scene_uniform(&inputs.snapshot.scene, inputs.texture);
        inputs.gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
    }

    /// What passes through matter read; `cells`: distances to matter, or bounds of the extinction.
    fn matter<'a>(
        &'a self,
        inputs: &Inputs<'a>,
        sampler: &'a wgpu::Sampler,
        cells: &'a wgpu::TextureView,
    ) -> [wgpu::BindGroupEntry<'a>; 7] {
        [
            buffer_entry(0, &self.frame),
            texture_entry(1, &inputs.tables.points),
            texture_entry(2, &inputs.tables.cells),
            texture_entry(7, &inputs.texture.view),
            wgpu::BindGroupEntry { binding: 8, resource: wgpu::BindingResource::Sampler(sampler) },
            texture_entry(9, cells),
            buffer_entry(21, &self.settings),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_have_room_and_digits() {
        for (batch, events, lights) in [(BATCH, 256, 42), (BATCH_SOFTWARE, 2, 642), (BATCH, 32, 162)] {
            let unit = f64::from(unit_of(batch, events, lights));
            let all = HEAVIEST * f64::from(batch) * f64::from(events) / f64::from(lights);
            assert!(all / unit <= MOST_COUNT && unit.log2().fract() == 0.0);
            // A usual share has two digits.
            assert!(0.01 / unit > 80.0 || events > 100, "{unit}");
        }
    }

    #[test]
    fn matrices_of_colour_take_three_planes_for_photons_and_one_for_the_rest() {
        let (largest, all) = matrix_bytes(1000, 42, 1, false);
        assert_eq!((largest, all), (168_000, 504_000));
        let (largest, all) = matrix_bytes(1000, 42, 3, true);
        assert_eq!((largest, all), (27 * 168_000, 63 * 168_000));
    }
}
