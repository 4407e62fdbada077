//! The photons of one light: stored in chunks, each with the scenes it was traced for.

use std::f64::consts::PI;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;
use scene::light::{Light, LightGeometry};
use scene::{Scene, Snapshot};

use super::field::FieldOfPhotons;
use super::pipelines::{PhotonPipelines, PhotonVariant};
use super::stale::Query;
use super::{Layout, Turn, Work};
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::tables;
use crate::uniforms::{self, Photons};

/// Photons at work together.
const CHUNK_PHOTONS: u32 = 65_536;
const CHUNK_PHOTONS_SOFTWARE: u32 = 16_384;
/// Bytes of an interaction: place, way, history.
const INTERACTION_BYTES: [u64; 3] = [16, 16, 32];
/// Bytes of a photon's end.
const END_BYTES: u64 = 32;
/// Scenes a chunk may be a mixture of, before all of it is stale.
const MAX_BASES: usize = 8;
/// Rays of an invocation: fewest and most.
const RAYS: [u32; 2] = [4, 64];
/// Cells and tentative collisions of an invocation. All loops of eight lanes together end after
/// 65,535 turns on Mesa 22's software device.
const STEPS: u32 = 16_384;
const STEPS_SOFTWARE: u32 = 4096;
/// Time a dispatch aims at.
const DISPATCH_AIM: Duration = Duration::from_millis(50);
/// Names of the words of the counter buffer: two words each, then one.
const COUNTERS: usize = 4;
const COUNTER_BYTES: u64 = 8 * COUNTERS as u64 + 4;
/// Word of the counter buffer at which the first of two lists of photons begins.
const LISTS: u32 = 16;
const WORKGROUP: u32 = 64;

/// What all lights work with, one chunk at a time.
pub(super) struct InFlight {
    paths: wgpu::Buffer,
    uniform: wgpu::Buffer,
    frame: wgpu::Buffer,
    counters: wgpu::Buffer,
    chunk: u32,
    rays: u32,
    /// Whose photons are on it: the light's key and the first photon.
    owner: Option<(u32, u32)>,
    /// Of these photons those that are not finished, and which of the two lists says which.
    listed: u32,
    list: u32,
}

impl InFlight {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let chunk = if gpu.info().software { CHUNK_PHOTONS_SOFTWARE } else { CHUNK_PHOTONS };
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            paths: gpu.buffer("photons at work", Self::path_bytes(chunk), storage)?,
            uniform: gpu.buffer("photons", std::mem::size_of::<Photons>() as u64, uniform)?,
            frame: gpu.buffer("frame", std::mem::size_of::<uniforms::FrameUniform>() as u64, uniform)?,
            counters: gpu.buffer("counters", Self::counter_bytes(chunk), storage)?,
            chunk,
            rays: RAYS[0],
            owner: None,
            listed: 0,
            list: 0,
        })
    }

    fn path_bytes(chunk: u32) -> u64 {
        u64::from(chunk) * std::mem::size_of::<uniforms::Path>() as u64
    }

    /// With the two lists behind the counters.
    fn counter_bytes(chunk: u32) -> u64 {
        4 * (u64::from(LISTS) + 2 * u64::from(chunk))
    }

    pub fn bytes(&self) -> u64 {
        Self::path_bytes(self.chunk) + Self::counter_bytes(self.chunk)
    }

    /// Where in the counter buffer a list begins.
    fn word_of(&self, list: u32) -> u32 {
        LISTS + list * self.chunk
    }
}

/// What may be left to do after a dispatch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Left {
    Nothing,
    /// The photons that are on the in_flight.
    SamePhotons,
    Others,
    /// So many are stale that all have to be followed anew.
    Everything,
}

/// An interaction as rays gather it: place (world) and way as floats, throughput in a word, and one that is free.
pub(super) type Interaction = [u32; 8];

/// Photons that are traced together.
struct Chunk {
    first: u32,
    count: u32,
    places: wgpu::Buffer,
    ways: wgpu::Buffer,
    histories: wgpu::Buffer,
    ends: wgpu::Buffer,
    /// Each photon was traced for one of these; empty: none was traced.
    bases: Vec<Arc<Snapshot>>,
    /// Whether photons are under way for the last of the bases.
    is_at_work: bool,
}

/// The photons of a light.
pub(super) struct LightPhotons {
    /// Of its random numbers.
    key: u32,
    /// Whether what it brings by itself is kept apart.
    pub direct: bool,
    chunks: Vec<Chunk>,
    /// What they bring to the field.
    pub sums: wgpu::Buffer,
    bytes: u64,
}

impl LightPhotons {
    /// Bytes of a light's photons and sums.
    pub fn bytes_of(layout: Layout, field: &FieldOfPhotons) -> u64 {
        let interaction = INTERACTION_BYTES.iter().sum::<u64>();
        let photon = u64::from(layout.slots) * interaction + END_BYTES;
        field.sum_bytes() + u64::from(layout.photons) * photon
    }

    pub fn new(
        gpu: &Gpu,
        light: &Light,
        layout: Layout,
        field: &FieldOfPhotons,
    ) -> Result<Self, RenderError> {
        let chunk = if gpu.info().software { CHUNK_PHOTONS_SOFTWARE } else { CHUNK_PHOTONS };
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let bytes = Self::bytes_of(layout, field);
        let mut chunks = Vec::new();
        let mut first = 0;
        while first < layout.photons {
            let count = chunk.min(layout.photons - first);
            let of_slots = |per: u64| u64::from(count) * u64::from(layout.slots) * per;
            let buffer = |size: u64| {
                if size > gpu.max_binding_bytes() {
                    return Err(RenderError::TooLarge {
                        what: format!("photons with {} interactions each", layout.slots),
                        limit: format!("{} bytes a buffer", gpu.max_binding_bytes()),
                    });
                }
                gpu.buffer("photons", size, storage)
            };
            let [places, ways, histories] = INTERACTION_BYTES.map(of_slots);
            let ends = u64::from(count) * END_BYTES;
            chunks.push(Chunk {
                first,
                count,
                places: buffer(places)?,
                ways: buffer(ways)?,
                histories: buffer(histories)?,
                ends: buffer(ends)?,
                bases: Vec::new(),
                is_at_work: false,
            });
            first += count;
        }
        let sums = gpu.buffer("light sums", field.sum_bytes(), storage)?;
        Ok(Self { key: key_of(&light.id), direct: tables::is_in_light_table(light), chunks, sums, bytes })
    }

    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Photons that have been traced, whatever for.
    pub fn traced(&self) -> u64 {
        let traced = self.chunks.iter().filter(|chunk| !chunk.bases.is_empty());
        traced.map(|chunk| u64::from(chunk.count)).sum()
    }

    /// Photons that are the snapshot's.
    pub fn current(&self, snapshot: &Arc<Snapshot>) -> u64 {
        let is_current = |chunk: &&Chunk| {
            !chunk.is_at_work && chunk.bases.len() == 1 && Arc::ptr_eq(&chunk.bases[0], snapshot)
        };
        self.chunks.iter().filter(is_current).map(|chunk| u64::from(chunk.count)).sum()
    }

    /// One dispatch for the first chunk that is not the snapshot's.
    pub fn trace_some(
        &mut self,
        turn: &Turn<'_>,
        in_flight: &mut InFlight,
        work: &mut Work,
    ) -> Result<Left, RenderError> {
        let snapshot = turn.inputs.snapshot;
        let (scene, light) = (&snapshot.scene, turn.light);
        // A snapshot that differs in nothing that photons depend on stands for both.
        let is_same = |base: &Arc<Snapshot>| Query::between(&base.scene, scene, light).is_empty();
        let is_current = |chunk: &Chunk| chunk.bases.last().is_some_and(is_same);
        // The first to be looked at tells how many photons are stale, for chunks are alike.
        let may_begin_again = !self.chunks.iter().any(is_current);
        let of_another_scene = |chunk: &Chunk| chunk.bases.is_empty() || chunk.query(scene, light).everything;
        if may_begin_again && self.traced() > 0 && self.chunks.iter().all(of_another_scene) {
            self.begin_again(turn, in_flight, work)?;
        }
        for chunk in &mut self.chunks {
            if !chunk.is_at_work && chunk.bases.len() == 1 && Arc::ptr_eq(&chunk.bases[0], snapshot) {
                continue;
            }
            let query = chunk.query(scene, light);
            if query.is_empty() && !chunk.is_at_work {
                chunk.bases = vec![snapshot.clone()];
                continue;
            }
            let is_empty = chunk.bases.is_empty();
            let newest_is_same = chunk.bases.last().is_some_and(is_same);
            chunk.bases.retain(|base| !is_same(base));
            chunk.bases.push(snapshot.clone());
            let is_on_bench = in_flight.owner == Some((self.key, chunk.first));
            if chunk.is_at_work && is_on_bench && newest_is_same {
                return chunk.go_on(turn, in_flight, work, self.key, &self.sums, None);
            }
            in_flight.owner = Some((self.key, chunk.first));
            let may_begin_again = may_begin_again && !is_empty;
            let begin = Begin { query, nothing_there: is_empty, may_begin_again };
            let left = chunk.go_on(turn, in_flight, work, self.key, &self.sums, Some(begin))?;
            if left == Left::Everything {
                self.begin_again(turn, in_flight, work)?;
                return Ok(Left::Others);
            }
            return Ok(left);
        }
        Ok(Left::Nothing)
    }

    /// Forgets all photons.
    fn begin_again(
        &mut self,
        turn: &Turn<'_>,
        in_flight: &mut InFlight,
        work: &mut Work,
    ) -> Result<(), RenderError> {
        let gpu = turn.inputs.gpu;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(&self.sums, 0, None);
        gpu.queue.submit([encoder.finish()]);
        turn.field.touch_all(gpu);
        for chunk in &mut self.chunks {
            chunk.bases.clear();
            chunk.is_at_work = false;
        }
        in_flight.owner = None;
        work.begun_again += 1;
        gpu.wait()
    }

    /// Bins that the ways of the light's first photons relied on, of no more than so many.
    pub fn first_bins(&self, gpu: &Gpu, most: u32) -> Result<Vec<u64>, RenderError> {
        let mut bins = Vec::new();
        for chunk in &self.chunks {
            let count = chunk.count.min(most.saturating_sub(chunk.first));
            if count == 0 {
                break;
            }
            let ends = gpu.read_buffer(&chunk.ends, u64::from(count) * END_BYTES)?;
            let of_end = |end: &[u8]| bytemuck::pod_read_unaligned::<u64>(&end[..8]);
            bins.extend(ends.chunks_exact(END_BYTES as usize).map(of_end));
        }
        Ok(bins)
    }

    /// Those interactions that count in the field, by photon and event.
    pub fn each_interaction(
        &self,
        gpu: &Gpu,
        pipelines: &PhotonPipelines,
        mut take: impl FnMut(Interaction),
    ) -> Result<(), RenderError> {
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let size_of = std::mem::size_of::<Interaction>() as u64;
        let most = self.chunks.iter().map(|chunk| u64::from(chunk.count) * chunk.slots()).max().unwrap_or(0);
        let packed = gpu.buffer("interactions", most * size_of, storage)?;
        for chunk in &self.chunks {
            let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            let uniform = gpu.buffer("photons", std::mem::size_of::<Photons>() as u64, usage)?;
            let contents = Photons { count: chunk.count, slots: chunk.slots() as u32, ..Photons::default() };
            gpu.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&contents));
            let runs = gpu.buffer("interactions of photons", 4 + 8 * u64::from(chunk.count), storage)?;
            let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("pack_interactions"),
                layout: pipelines.pack_layout(),
                entries: &[
                    buffer_entry(13, &uniform),
                    buffer_entry(14, &chunk.places),
                    buffer_entry(15, &chunk.ways),
                    buffer_entry(16, &chunk.histories),
                    buffer_entry(17, &chunk.ends),
                    buffer_entry(18, &runs),
                    buffer_entry(19, &packed),
                ],
            });
            gpu.dispatch(&pipelines.pack(), &bind_group, [chunk.count.div_ceil(WORKGROUP), 1]);
            let runs: Vec<u32> = bytemuck::pod_collect_to_vec(&gpu.read_buffer(&runs, runs.size())?);
            let [all, runs @ ..] = runs.as_slice() else { continue };
            let bytes = gpu.read_buffer(&packed, (u64::from(*all) * size_of).max(4))?;
            for run in runs.chunks_exact(2) {
                let range = run[0] as usize..(run[0] + run[1]) as usize;
                range.for_each(|at| {
                    let from = at * size_of as usize;
                    take(bytemuck::pod_read_unaligned(&bytes[from..from + size_of as usize]));
                });
            }
        }
        Ok(())
    }

    #[cfg(test)]
    pub fn contents(&self, gpu: &Gpu) -> Result<Vec<Vec<u8>>, RenderError> {
        let mut contents = vec![gpu.read_buffer(&self.sums, self.sums.size())?];
        for chunk in &self.chunks {
            let ends = gpu.read_buffer(&chunk.ends, chunk.ends.size())?;
            let slots = chunk.slots();
            let counts: Vec<usize> = ends
                .chunks_exact(END_BYTES as usize)
                .map(|end| u32::from_le_bytes([end[16], end[17], end[18], end[19]]) as usize)
                .collect();
            contents.push(ends);
            for (buffer, size) in [(&chunk.places, 16), (&chunk.ways, 16), (&chunk.histories, 32)] {
                // Behind a photon's last interaction there may be anything.
                let mut bytes = gpu.read_buffer(buffer, buffer.size())?;
                for (photon, count) in counts.iter().enumerate() {
                    let first = photon * slots as usize * size;
                    bytes[first + count * size..first + slots as usize * size].fill(0);
                }
                contents.push(bytes);
            }
        }
        Ok(contents)
    }
}

/// How work on a chunk begins.
struct Begin {
    query: Query,
    /// Whether its buffers hold nothing yet.
    nothing_there: bool,
    /// Whether, if too many photons are stale, all may be forgotten instead.
    may_begin_again: bool,
}

impl Chunk {
    /// Most interactions of a photon.
    fn slots(&self) -> u64 {
        self.places.size() / INTERACTION_BYTES[0] / u64::from(self.count)
    }

    /// What changed since any of the scenes its photons were traced for.
    fn query(&self, scene: &Scene, light: &Light) -> Query {
        if self.bases.is_empty() || self.bases.len() > MAX_BASES {
            return Query { everything: true, ..Query::default() };
        }
        let queries = self.bases.iter().map(|base| Query::between(&base.scene, scene, light));
        queries.fold(Query::default(), Query::or)
    }

    /// One dispatch.
    fn go_on(
        &mut self,
        turn: &Turn<'_>,
        in_flight: &mut InFlight,
        work: &mut Work,
        key: u32,
        sums: &wgpu::Buffer,
        begin: Option<Begin>,
    ) -> Result<Left, RenderError> {
        let Turn { inputs, light, index, field, layout } = turn;
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let query = begin.as_ref().map_or(Query::default(), |begin| begin.query);
        let everything = begin.as_ref().map_or(0, |begin| match begin {
            Begin { nothing_there: true, .. } => 2,
            Begin { query, .. } => u32::from(query.everything),
        });
        let mut uniform = Photons {
            first: self.first,
            count: self.count,
            key,
            light: *index as u32,
            slots: layout.slots,
            rays: in_flight.rays,
            steps: if gpu.info().software { STEPS_SOFTWARE } else { STEPS },
            direct: u32::from(tables::is_in_light_table(light)),
            bins: halves(query.bins),
            blocks: halves(query.blocks),
            dims: layout.dims,
            everything,
            radius: sphere_radius(scene) as f32,
            reference: reference(light, sphere_radius(scene)) as f32,
            seed: 0,
            clip_shadows: u32::from(scene.clip.shadows),
            listed: in_flight.listed,
            list: in_flight.word_of(in_flight.list),
            next_list: in_flight.word_of(1 - in_flight.list),
            pad0: 0,
        };
        gpu.queue.write_buffer(&in_flight.uniform, 0, bytemuck::bytes_of(&uniform));
        let frame = crate::frame::scene_uniform(scene, inputs.texture);
        gpu.queue.write_buffer(&in_flight.frame, 0, bytemuck::bytes_of(&frame));
        gpu.queue.write_buffer(&in_flight.counters, 0, &[0; COUNTER_BYTES as usize]);
        let pipelines = inputs.photon_pipelines;
        let (Some(majorants), Some(environment)) = (inputs.majorants, inputs.environment) else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("trace_photons"),
            layout: pipelines.trace_layout(),
            entries: &[
                buffer_entry(0, &in_flight.frame),
                texture_entry(1, &inputs.tables.points),
                texture_entry(2, &inputs.tables.cells),
                buffer_entry(3, &inputs.tables.materials),
                buffer_entry(6, &in_flight.counters),
                texture_entry(7, &inputs.texture.view),
                wgpu::BindGroupEntry {
                    binding: 8,
                    resource: wgpu::BindingResource::Sampler(&pipelines.sampler),
                },
                texture_entry(9, majorants),
                buffer_entry(10, &in_flight.paths),
                buffer_entry(13, &in_flight.uniform),
                buffer_entry(14, &self.places),
                buffer_entry(15, &self.ways),
                buffer_entry(16, &self.histories),
                buffer_entry(17, &self.ends),
                buffer_entry(18, sums),
                buffer_entry(19, &field.touched),
            ],
        });
        if begin.is_some() {
            let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("take_up"),
                layout: pipelines.take_up_layout(),
                entries: &[
                    buffer_entry(0, &in_flight.frame),
                    buffer_entry(4, &inputs.lights.sources),
                    buffer_entry(6, &in_flight.counters),
                    buffer_entry(10, &in_flight.paths),
                    buffer_entry(13, &in_flight.uniform),
                    buffer_entry(14, &self.places),
                    buffer_entry(15, &self.ways),
                    buffer_entry(16, &self.histories),
                    buffer_entry(17, &self.ends),
                    texture_entry(12, &environment.draws),
                    texture_entry(20, &environment.radiance),
                ],
            });
            gpu.dispatch(&pipelines.take_up(light), &bind_group, [self.count.div_ceil(WORKGROUP), 1]);
            let stale = gpu.read_buffer(&in_flight.counters, 4)?;
            let stale: u32 = bytemuck::pod_read_unaligned(&stale);
            let may_begin_again = begin.as_ref().is_some_and(|begin| begin.may_begin_again);
            if may_begin_again
                && f64::from(stale) > pipelines.trial().begin_again_share * f64::from(self.count)
            {
                return Ok(Left::Everything);
            }
            work.recomputed += u64::from(stale);
            in_flight.listed = stale;
            if stale == 0 {
                return Ok(self.finish(inputs.snapshot, in_flight));
            }
            uniform.listed = stale;
            gpu.queue.write_buffer(&in_flight.uniform, 0, bytemuck::bytes_of(&uniform));
            gpu.queue.write_buffer(&in_flight.counters, 0, &[0; COUNTER_BYTES as usize]);
        }
        self.is_at_work = true;
        let began = Instant::now();
        let pipeline = pipelines.trace(PhotonVariant::of(scene, layout.bands));
        gpu.dispatch(&pipeline, &bind_group, [in_flight.listed.div_ceil(WORKGROUP), 1]);
        let bytes = gpu.read_buffer(&in_flight.counters, COUNTER_BYTES)?;
        let took = began.elapsed();
        if took < DISPATCH_AIM / 2 {
            in_flight.rays = (2 * in_flight.rays).min(RAYS[1]);
        } else if took > 2 * DISPATCH_AIM {
            in_flight.rays = (in_flight.rays / 2).max(RAYS[0]);
        }
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
        let count = |i: usize| u64::from(words[2 * i]) | u64::from(words[2 * i + 1]) << 32;
        work.dispatches += 1;
        work.tentative_collisions += count(0);
        work.cells += count(1);
        work.interactions += count(2);
        work.cut_1024ths += count(3);
        in_flight.listed = words[2 * COUNTERS];
        in_flight.list = 1 - in_flight.list;
        if in_flight.listed == 0 {
            return Ok(self.finish(inputs.snapshot, in_flight));
        }
        Ok(Left::SamePhotons)
    }

    /// All of its photons are the snapshot's.
    fn finish(&mut self, snapshot: &Arc<Snapshot>, in_flight: &mut InFlight) -> Left {
        self.is_at_work = false;
        self.bases = vec![snapshot.clone()];
        in_flight.owner = None;
        Left::Others
    }
}

fn halves(mask: u64) -> [u32; 2] {
    [mask as u32, (mask >> 32) as u32]
}

/// FNV-1a: the same numbers for a light whatever its place in the scene.
fn key_of(id: &str) -> u32 {
    id.bytes().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// Radius of the sphere around the volume's box, which is centred at the origin; a little more, so that
/// what starts on it starts outside.
pub(super) fn sphere_radius(scene: &Scene) -> f64 {
    0.5 * scene.grid.size_world.length() * 1.001
}

/// `photons.reference` of the shader: what a light of unit power sends, about, on average over its
/// photons, but for the sphere's cross-section and the light's area.
fn reference(light: &Light, radius: f64) -> f64 {
    // Solid angle over 2 pi in which the sphere is seen.
    let cap = |center: DVec3| {
        let sine_squared = radius * radius / center.length_squared();
        if sine_squared < 1.0 { sine_squared / (1.0 + (1.0 - sine_squared).sqrt()) } else { 2.0 }
    };
    match &light.geometry {
        LightGeometry::Directional { .. } | LightGeometry::UniformEnvironment => 1.0,
        LightGeometry::Environment { image, .. } => crate::environment_map::mean_total(image).max(1e-30),
        LightGeometry::Point { position } => 2.0 * PI * cap(*position),
        LightGeometry::Spot { position, cos_outer, .. } => {
            2.0 * PI * cap(*position).min((1.0 - cos_outer).max(1e-12))
        }
        LightGeometry::Rectangle { center, .. }
        | LightGeometry::Disk { center, .. }
        | LightGeometry::Sphere { center, .. } => PI * cap(*center).min(1.0),
    }
}

/// Flux that all photons of a light carry together if each throughput begins at 1: watts, linear RGB.
pub(super) fn flux(light: &Light, radius: f64) -> DVec3 {
    let cross_section = PI * radius * radius;
    let size = match &light.geometry {
        LightGeometry::Directional { .. } => cross_section,
        LightGeometry::UniformEnvironment => 4.0 * PI * cross_section,
        LightGeometry::Environment { .. } => cross_section,
        LightGeometry::Point { .. } | LightGeometry::Spot { .. } => 1.0,
        LightGeometry::Rectangle { size, .. } => size[0] * size[1],
        LightGeometry::Disk { radius, .. } => PI * radius * radius,
        LightGeometry::Sphere { radius, .. } => 4.0 * PI * radius * radius,
    };
    light.power * (size * reference(light, radius))
}
