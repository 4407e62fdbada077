//! Exchange of scattered light between records: each round adds an order of scattering
//! (shaders/image_based/README.md, equations d and e).

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use glam::DVec3;
use scene::plan::changes_of_light;
use scene::{Records, Snapshot};

use super::passes::GROUP;
use super::slots::CHUNK_SLOTS;
use super::{Kept, Run, slice};
use crate::convection_diffusion::sweep::Cells;
use crate::convection_diffusion::transport::{
    Matter, Transport, bind, groups_of, light_grid, pipeline, storage, texture_3d, uniform, whole,
};
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::light_field::LightField;
use crate::shaders;

/// Points at which matter is looked at in one dispatch, about.
const POINTS_PER_SLICE: u64 = 1 << 20;
/// Most bands of what matter scatters on.
const MAX_SOURCE_BANDS: u32 = 2;
/// Bytes of what a ray receives.
const RECEIVED_BYTES: u64 = 4;

/// Pipelines of the exchange, compiled when first needed; one for all sessions.
#[derive(Default)]
pub struct Pipelines(Mutex<Option<Arc<Compiled>>>);

struct Compiled {
    transport: Transport,
    /// For one band of source and for two.
    scatter: [wgpu::ComputePipeline; 2],
    receive: [wgpu::ComputePipeline; 2],
    linear: wgpu::Sampler,
}

impl Pipelines {
    fn get(&self, gpu: &Arc<Gpu>) -> Arc<Compiled> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.get_or_insert_with(|| Arc::new(Compiled::new(gpu))).clone()
    }
}

impl Compiled {
    fn new(gpu: &Arc<Gpu>) -> Self {
        let of_bands =
            |label, source| [1.0, 2.0].map(|bands| pipeline(gpu, label, source, &[("SOURCE_BANDS", bands)]));
        Self {
            transport: Transport::new(gpu.clone()),
            scatter: of_bands("scatter_records", shaders::SCATTER_RECORDS),
            receive: of_bands("receive_records", shaders::RECEIVE_RECORDS),
            linear: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            }),
        }
    }
}

/// What is to be done next, and for which record or layer of cells first.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    /// Look at matter in cells, from a layer on.
    Fill { layer: u32 },
    /// Write the light of the orders so far to the field of the exchange.
    Project { round: u32, next: usize },
    /// Have matter scatter it, and records receive that.
    Receive { round: u32, next: usize },
    /// All rounds are done.
    Done,
}

/// Exchange between the records of a session.
pub struct Exchange {
    compiled: Arc<Compiled>,
    cells: Cells,
    matter: Matter,
    /// Light of the orders so far.
    field: LightField,
    source: wgpu::TextureView,
    source_bands: u32,
    /// Of each chunk, what its rays receive; those of `shown` are part of the field that is seen.
    received: Vec<[wgpu::Buffer; 2]>,
    shown: usize,
    /// The light it is, or is becoming, the exchange of.
    snapshot: Option<Arc<Snapshot>>,
    stage: Stage,
    rounds: u32,
    millis_per_product: f64,
    millis_per_ray: f64,
}

impl Exchange {
    pub fn new(inputs: &Inputs<'_>, pipelines: &Pipelines, field: &LightField) -> Result<Self, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let dims = field.dims;
        let cells = Cells { dims, size: scene.grid.size_world / DVec3::from_array(dims.map(f64::from)) };
        let source_bands = field.bands.min(MAX_SOURCE_BANDS);
        let edges = [dims[0] * source_bands, dims[1], dims[2] * source_bands];
        let source = texture_3d(gpu, "source of records", edges, wgpu::TextureFormat::Rgba16Float)?;
        Ok(Self {
            compiled: pipelines.get(gpu),
            cells,
            matter: Matter::new(gpu, &cells)?,
            field: LightField::new(gpu, dims, field.bands)?,
            source: whole(&source),
            source_bands,
            received: Vec::new(),
            shown: 0,
            snapshot: None,
            stage: Stage::Fill { layer: 0 },
            rounds: 0,
            millis_per_product: 0.0,
            millis_per_ray: 0.0,
        })
    }

    /// Bytes of what rays of a chunk receive: of the light that is shown, and of the one under way.
    pub fn chunk_bytes(columns: u32) -> u64 {
        2 * RECEIVED_BYTES * u64::from(CHUNK_SLOTS) * u64::from(columns)
    }

    /// Whether it is that of a field of such a size.
    pub fn fits(&self, field: &LightField) -> bool {
        (self.field.dims, self.field.bands) == (field.dims, field.bands)
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let source = 8 * self.cells.count() * u64::from(self.source_bands * self.source_bands);
        let received = self.received.iter().flatten().map(wgpu::Buffer::size).sum::<u64>();
        self.field.bytes() + Matter::bytes(&self.cells) + source + received
    }

    /// Of a chunk, what its rays receive of the light that is shown.
    pub fn shown(&self, chunk: usize) -> Option<&wgpu::Buffer> {
        self.received.get(chunk).map(|both| &both[self.shown])
    }

    /// Makes room for the rays of a number of chunks; nothing is received yet.
    pub fn make_room(&mut self, gpu: &Gpu, chunks: usize, columns: u32) -> Result<(), RenderError> {
        let bytes = Self::chunk_bytes(columns) / 2;
        while self.received.len() < chunks {
            let new = || storage(gpu, "light received by records", bytes);
            self.received.push([new()?, new()?]);
        }
        Ok(())
    }

    /// Takes a snapshot: begins anew unless its light is the same.
    pub fn take(&mut self, snapshot: &Arc<Snapshot>) {
        let same = self.snapshot.as_ref().is_some_and(|of| {
            Arc::ptr_eq(of, snapshot) || changes_of_light(&of.scene, &snapshot.scene).is_empty()
        });
        if !same {
            self.stage = Stage::Fill { layer: 0 };
            self.rounds = Records::of(&snapshot.scene).exchanges;
        }
        self.snapshot = Some(snapshot.clone());
    }

    pub fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Share of the rounds that are done, 0..1.
    pub fn completeness(&self) -> f32 {
        match self.stage {
            Stage::Fill { .. } => 0.0,
            Stage::Project { round, .. } => round as f32 / self.rounds.max(1) as f32,
            Stage::Receive { round, .. } => (round as f32 - 0.5) / self.rounds.max(1) as f32,
            Stage::Done => 1.0,
        }
    }

    /// Goes on with the exchange of the records of `kept`, whose own rays and coefficients are all up to
    /// date, until the deadline, at least one slice; whether it came to its end.
    pub fn advance(
        &mut self,
        run: &Run<'_>,
        kept: &mut Kept,
        deadline: Option<Instant>,
    ) -> Result<bool, RenderError> {
        let all = kept.slots.all();
        while !self.is_done() {
            self.work(run, kept, &all, deadline)?;
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                break;
            }
        }
        Ok(self.is_done())
    }

    /// One slice.
    fn work(
        &mut self,
        run: &Run<'_>,
        kept: &Kept,
        all: &[(usize, Vec<[u32; 2]>)],
        deadline: Option<Instant>,
    ) -> Result<(), RenderError> {
        let count = all.iter().map(|(_, entries)| entries.len()).sum();
        self.stage = match self.stage {
            Stage::Fill { layer } => match self.fill(run.inputs, layer)? {
                Some(layer) => Stage::Fill { layer },
                None => Stage::Project { round: 0, next: 0 },
            },
            Stage::Project { round, next } if next < count => {
                let per_record = f64::from(kept.directions() * kept.field.bands * kept.field.bands);
                let (chunk, entries) = part(all, next, per_record, self.millis_per_product, deadline);
                let began = Instant::now();
                let received = (round > 0).then(|| &self.received[chunk][1 - self.shown]);
                run.project_to(kept, chunk, entries, &self.field, received)?;
                self.millis_per_product = millis_each(began, entries.len(), per_record);
                Stage::Project { round, next: next + entries.len() }
            }
            Stage::Project { round, .. } => {
                self.scatter(run.inputs, kept)?;
                Stage::Receive { round: round + 1, next: 0 }
            }
            Stage::Receive { round, next } if next < count => {
                let per_record = f64::from(kept.directions());
                let (chunk, entries) = part(all, next, per_record, self.millis_per_ray, deadline);
                let began = Instant::now();
                self.receive(run, kept, chunk, entries)?;
                self.millis_per_ray = millis_each(began, entries.len(), per_record);
                Stage::Receive { round, next: next + entries.len() }
            }
            Stage::Receive { round, .. } if round < self.rounds => Stage::Project { round, next: 0 },
            Stage::Receive { .. } | Stage::Done => {
                self.shown = 1 - self.shown;
                Stage::Done
            }
        };
        Ok(())
    }

    /// Looks at matter in some layers of cells; the next one, if there is any.
    fn fill(&self, inputs: &Inputs<'_>, layer: u32) -> Result<Option<u32>, RenderError> {
        let Inputs { snapshot, texture, tables, .. } = inputs;
        let [width, height, depth] = self.cells.dims;
        let points = self.compiled.transport.points(&self.cells, &snapshot.scene);
        let per_layer = points.iter().map(|&n| u64::from(n)).product::<u64>() * u64::from(width * height);
        let layers = ((POINTS_PER_SLICE / per_layer.max(1)).max(1) as u32).min(depth - layer);
        let run = [layer * width * height, layers * width * height];
        self.compiled.transport.fill(&self.matter, &self.cells, run, snapshot, texture, tables)?;
        inputs.gpu.wait()?;
        Ok((layer + layers < depth).then_some(layer + layers))
    }

    /// What matter scatters on of the light so far.
    fn scatter(&self, inputs: &Inputs<'_>, kept: &Kept) -> Result<(), RenderError> {
        let gpu = inputs.gpu;
        let count = self.cells.count() as u32;
        let grid = uniform(gpu, "cells of records", &light_grid(&self.cells, 0, count))?;
        let scatter = &self.compiled.scatter[self.source_bands as usize - 1];
        let group = bind(
            gpu,
            scatter,
            &[
                buffer_entry(0, &kept.buffers.frame),
                buffer_entry(4, &inputs.lights.lights),
                texture_entry(13, &self.field.view),
                wgpu::BindGroupEntry {
                    binding: 14,
                    resource: wgpu::BindingResource::Sampler(&self.compiled.linear),
                },
                buffer_entry(15, &kept.field.uniform),
                // Without lights of their own it is not read.
                texture_entry(16, kept.field.direct().unwrap_or(&self.field.view)),
                buffer_entry(20, &grid),
                texture_entry(21, &self.source),
                buffer_entry(22, &self.matter.cosines),
                texture_entry(24, &self.matter.coefficients),
            ],
        );
        gpu.dispatch(scatter, &group, groups_of(count));
        gpu.wait()
    }

    /// What some records receive of that.
    fn receive(
        &self,
        run: &Run<'_>,
        kept: &Kept,
        chunk: usize,
        entries: &[[u32; 2]],
    ) -> Result<(), RenderError> {
        let gpu = run.inputs.gpu;
        run.write(kept, entries, &kept.towards(&run.inputs.snapshot.scene));
        let receive = &self.compiled.receive[self.source_bands as usize - 1];
        let buffers = &kept.buffers;
        let group = bind(
            gpu,
            receive,
            &[
                buffer_entry(0, &buffers.frame),
                buffer_entry(13, &buffers.records),
                buffer_entry(14, &buffers.entries),
                buffer_entry(15, &buffers.columns),
                buffer_entry(16, kept.chunks[chunk].rays()),
                texture_entry(21, &self.source),
                wgpu::BindGroupEntry {
                    binding: 22,
                    resource: wgpu::BindingResource::Sampler(&self.compiled.linear),
                },
                buffer_entry(23, &self.received[chunk][1 - self.shown]),
            ],
        );
        gpu.dispatch(receive, &group, [(entries.len() as u32).div_ceil(GROUP), kept.directions()]);
        gpu.wait()
    }
}

/// The next records of one chunk, from the `next`th of all on: a slice of them.
fn part(
    all: &[(usize, Vec<[u32; 2]>)],
    next: usize,
    per_record: f64,
    millis: f64,
    deadline: Option<Instant>,
) -> (usize, &[[u32; 2]]) {
    let mut before = 0;
    for (chunk, entries) in all {
        if next < before + entries.len() {
            let rest = &entries[next - before..];
            return (*chunk, &rest[..slice(rest.len(), per_record, millis, deadline)]);
        }
        before += entries.len();
    }
    (0, &[])
}

fn millis_each(began: Instant, records: usize, per_record: f64) -> f64 {
    began.elapsed().as_secs_f64() * 1e3 / (records as f64 * per_record).max(1.0)
}
