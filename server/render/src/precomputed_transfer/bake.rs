//! A bake: each texel's answer to every basis light, for matter as it is.

use std::time::{Duration, Instant};

use proto::scene_file::Orders;
use scene::{Changes, Scene};

use super::basis::{Basis, LightVector, mean_shown, photon_factor};
use super::buffers::{COUNTER_BYTES, COUNTERS, Held, batch_of, matrix_bytes};
use super::compress::{Compressed, Compressing, Shape};
use super::keeping::{Keeping, Step};
use super::key::key;
use super::layout::{Layout, Share, Work, is_coloured};
use super::mass::Mass;
use super::passes::{GROUP, Variant};
use super::store::Done;
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
/// Directions marched between looks at the clock.
const DIRECTIONS_AT_ONCE: u32 = 2;
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
/// Most workgroups along an axis of a dispatch.
const MAX_GROUPS: u32 = 65_535;
/// Whole numbers that hold sums of photons stay below this.
const MOST_COUNT: f64 = 1_073_741_824.0;
/// What photons of a batch may add up to in one basis light, in even shares of one throughput each per
/// interaction: functions are not quite alike, directions show more or less of the box, and surfaces may
/// make a photon heavier.
const HEAVIEST: f64 = 8.0;

/// The bake of a session, finished or under way.
pub struct Bake {
    layout: Layout,
    /// What it is, or is becoming, the bake of: as it was when it began.
    scene: Scene,
    basis: Basis,
    mass: Mass,
    /// Matrices and tables; `None`: there is no matter, or they are compressed.
    held: Option<Held>,
    /// Clusters to compress the finished matrices into; 0: none.
    clusters: u32,
    compressing: Option<Compressing>,
    compressed: Option<Compressed>,
    pub field: LightField,
    coloured: bool,
    directions: u32,
    directions_done: u32,
    photons_done: u64,
    /// Photons of the batch under way; 0: there is none.
    under_way: u32,
    rays: u32,
    /// `None`: it is kept nowhere else.
    keeping: Option<Keeping>,
    share: Share,
    /// Largest memory so far, bytes.
    pub peak_bytes: u64,
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
        let keeping = held.as_ref().zip(inputs.bakes).map(|(held, store)| {
            let key = key(gpu, scene, &layout, &mass, &held.tables);
            Keeping::new(store, key, &held.matrices())
        });
        let directions = (12 * layout.nside * layout.nside) as u32;
        let mut bake = Self {
            scene: scene.clone(),
            basis,
            mass,
            directions,
            directions_done: if held.is_some() { 0 } else { directions },
            photons_done: if held.is_some() { 0 } else { layout.photons },
            held,
            clusters: scene.illumination.transfer_clusters,
            compressing: None,
            compressed: None,
            field,
            coloured,
            under_way: 0,
            rays: RAYS[0],
            keeping,
            share: Share::default(),
            layout,
            peak_bytes: 0,
        };
        bake.peak_bytes = bake.bytes();
        Ok(bake)
    }

    /// Whether it is, or is becoming, the bake of a scene: lights, camera and film do not matter.
    pub fn serves(&self, scene: &Scene) -> bool {
        // Compressed matrices are those of one number of clusters.
        let recompressed = self.clusters != scene.illumination.transfer_clusters;
        if self.layout != Layout::of(scene) || recompressed && self.compressed.is_some() {
            return false;
        }
        let changes = Changes::between(&self.scene, scene);
        let bins = changes.bins & scene.volume.macrocells.occurring(scene.filter);
        !changes.volume && bins == 0 && !changes.clip && !changes.clip_shadows
    }

    /// Whether every direction is marched and every photon flown.
    fn is_complete(&self) -> bool {
        self.directions_done == self.directions && self.photons_done == self.layout.photons
    }

    /// Whether there is nothing left to do, storing and compressing it included.
    pub fn is_settled(&self) -> bool {
        let is_compressed = self.clusters == 0 || self.held.is_none();
        self.is_complete() && is_compressed && self.keeping.as_ref().is_none_or(Keeping::is_idle)
    }

    /// Whether there is nothing to do but to wait for a thread.
    pub fn waits(&self) -> bool {
        self.compressing.as_ref().is_some_and(Compressing::waits)
    }

    /// Into how many clusters the matrices of a bake that serves the scene go.
    pub fn compress_as(&mut self, scene: &Scene) {
        let clusters = scene.illumination.transfer_clusters;
        if clusters != self.clusters {
            self.clusters = clusters;
            self.compressing = None;
        }
    }

    /// What compression left out of the matrices, relative L2; `None`: they are not compressed.
    pub fn compression_error(&self) -> Option<f64> {
        self.compressed.as_ref().map(|compressed| compressed.error)
    }

    /// Whether it has something of all light: what follows takes noise away and nothing else.
    pub fn has_all_light(&self) -> bool {
        let has_photons = self.photons_done > 0 || self.layout.photons == 0;
        self.directions_done == self.directions && has_photons
    }

    /// Share of the work that is done, in time, 0..1.
    pub fn progress(&mut self) -> f32 {
        let done = [u64::from(self.directions_done), self.photons_done];
        self.share.of(done, [u64::from(self.directions), self.layout.photons]) as f32
    }

    pub fn rows(&self) -> u64 {
        self.mass.rows.len() as u64
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let matrices = self.held.as_ref().map_or(0, Held::bytes);
        self.field.bytes() + matrices + self.compressed.as_ref().map_or(0, Compressed::bytes)
    }

    /// The light of a scene, made of basis lights.
    pub fn light_of(&mut self, scene: &Scene) -> LightVector {
        self.basis.light_of(scene)
    }

    /// One slice of work.
    pub fn work(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        if self.is_with_the_disk(inputs, work)? {
            return Ok(());
        }
        if self.is_complete() {
            return self.compress(inputs, work);
        }
        // A batch of photons first: from then on it is known how long the rest takes.
        let began = Instant::now();
        let all_marched = self.directions_done == self.directions;
        let carries = self.photons_done < self.layout.photons && (self.photons_done == 0 || all_marched);
        if carries {
            self.carry(inputs, work)?;
        } else if !all_marched {
            self.march(inputs, work)?;
        }
        self.share.took(usize::from(carries), began.elapsed());
        let complete = self.is_complete();
        let done = Done { photons: self.photons_done, directions: self.directions_done };
        if let Some(held) = &mut self.held {
            let matrices = held.matrices();
            match &mut self.keeping {
                Some(keeping) if complete || self.under_way == 0 && keeping.is_due() => {
                    keeping.write(done, &matrices);
                }
                _ => {}
            }
            if complete {
                held.work = None;
            }
        }
        Ok(())
    }

    /// A slice of reading or writing, if there is something to read or write.
    fn is_with_the_disk(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<bool, RenderError> {
        let (Some(keeping), Some(held)) = (&mut self.keeping, &mut self.held) else { return Ok(false) };
        let step = keeping.step(inputs.gpu, &held.matrices())?;
        match step {
            Step::Free | Step::Missed => return Ok(false),
            Step::Busy => {}
            Step::Stored => work.stored += 1,
            Step::Loaded(done) => {
                work.loaded += 1;
                let Done { photons, directions } = done;
                tracing::info!(photons, directions, "a bake goes on from where it was stored");
                self.photons_done = done.photons.min(self.layout.photons);
                self.directions_done = done.directions.min(self.directions);
                if self.is_complete() {
                    self.held.iter_mut().for_each(|held| held.work = None);
                }
            }
        }
        Ok(true)
    }

    /// A slice of compressing. Compressed matrices take the place of the others.
    fn compress(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        let settings = self.settings(&inputs.snapshot.scene);
        let Some(held) = &self.held else { return Ok(()) };
        let compressing = match &mut self.compressing {
            Some(compressing) => compressing,
            none => none.insert(Compressing::new(Shape::of(&settings), self.clusters)?),
        };
        let Some(clusters) = compressing.step(inputs.gpu, &held.matrices())? else { return Ok(()) };
        let compressed = Compressed::new(inputs.gpu, held, &clusters, self.layout.bands)?;
        tracing::info!(error = compressed.error, clusters = self.clusters, "baked light is compressed");
        (self.held, self.compressing, self.compressed) = (None, None, Some(compressed));
        work.compressed += 1;
        Ok(())
    }

    fn settings(&self, scene: &Scene) -> uniforms::Transfer {
        let size = scene.grid.size_world;
        let largest = f64::from(self.mass.largest);
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
            buffer_entry(22, &workshop.beams),
            buffer_entry(24, &workshop.fallen),
            buffer_entry(28, &held.texel_rows),
        ]);
        let march = pipelines.march.bind(gpu, &entries);
        let spread = pipelines.spread.bind(
            gpu,
            &[
                buffer_entry(21, &held.settings),
                buffer_entry(23, &workshop.integrals),
                buffer_entry(24, &workshop.fallen),
                buffer_entry(26, &held.direct),
            ],
        );
        let beams = workshop.edge * workshop.edge;
        let groups = beams.div_ceil(GROUP);
        let columns = groups.min(MAX_GROUPS);
        let settings = uniforms::Transfer {
            unit: workshop.beam_unit,
            beam_area: (workshop.area / f64::from(self.mass.largest)) as f32,
            ..settings
        };
        let last = (self.directions_done + DIRECTIONS_AT_ONCE).min(self.directions);
        for direction in self.directions_done..last {
            let [first_entry, last_entry] = held.entries[direction as usize];
            let settings = uniforms::Transfer { direction, first_entry, last_entry, ..settings };
            gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
            gpu.dispatch(&pipelines.march(variant), &march, [columns, groups.div_ceil(columns)]);
            gpu.dispatch(&pipelines.spread(), &spread, [settings.rows.div_ceil(GROUP), 1]);
            work.rays += u64::from(beams);
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
        let batch = batch_of(gpu);
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
    pub fn relight(&mut self, inputs: &Inputs<'_>, light: &LightVector) -> Result<(), RenderError> {
        let (gpu, scene, pipelines) = (inputs.gpu, &inputs.snapshot.scene, inputs.transfer_pipelines);
        self.field.set_scale(light.scale);
        let settings = uniforms::Transfer { scale: light.scale, ..self.settings(scene) };
        if let Some(compressed) = &self.compressed {
            return compressed.relight(gpu, pipelines, &settings, light, &self.field.view);
        }
        let Some(held) = &self.held else { return Ok(()) };
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

#[cfg(test)]
mod tests {
    use super::super::buffers::{BATCH, BATCH_SOFTWARE};
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
}
