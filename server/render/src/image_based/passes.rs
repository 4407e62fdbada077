//! Pipelines `march_records` and `project_records`, and the buffers they work on.

use std::sync::Arc;

use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::image_based::exchange;
use crate::image_based::slots::CHUNK_SLOTS;
use crate::light_field::LightField;
use crate::shaders;
use crate::uniforms;
use crate::variants::Variants;

/// Invocations of a workgroup, as in the shaders.
pub const GROUP: u32 = 64;
/// Words of the counter buffer: five counters of two words.
pub const COUNTER_BYTES: u64 = 40;
/// Their names, in the shaders' order.
pub const COUNTERS: [&str; 5] =
    ["record_rays_cast", "record_rays_kept", "record_cells_taken", "record_cells_skipped", "records_renewed"];

/// A compiled specialisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PassVariant {
    pub nearest: bool,
    pub quads: bool,
    pub glow: bool,
    pub dynamic: bool,
    pub exchanged: bool,
}

impl PassVariant {
    /// Numbers that a ray's result takes.
    pub fn words(self) -> u32 {
        if self.glow { 4 } else { 1 }
    }
}

/// Pipelines of the method, compiled when first needed; one for all sessions.
pub struct Passes {
    gpu: Arc<Gpu>,
    march: Pass,
    project: Pass,
    /// Of the exchange between records.
    pub exchange: exchange::Pipelines,
}

struct Pass {
    label: &'static str,
    module: wgpu::ShaderModule,
    bindings: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
    pipelines: Variants<PassVariant>,
}

/// Rays of [`CHUNK_SLOTS`] records.
pub struct Chunk {
    rays: wgpu::Buffer,
    renewed: wgpu::Buffer,
}

/// Small buffers of a session.
pub struct Buffers {
    pub frame: wgpu::Buffer,
    pub records: wgpu::Buffer,
    pub entries: wgpu::Buffer,
    pub columns: wgpu::Buffer,
    pub lights: wgpu::Buffer,
    pub counters: wgpu::Buffer,
}

/// What a dispatch reads beside its chunk.
pub struct Bound<'a> {
    pub buffers: &'a Buffers,
    pub texture: &'a crate::volume_texture::VolumeTexture,
    pub tables: &'a crate::view::TransferFunctionTables,
    pub distance_map: &'a wgpu::TextureView,
    pub changed_map: &'a wgpu::TextureView,
    pub products: &'a wgpu::TextureView,
    pub field: &'a LightField,
    /// What rays of the chunk received from other records.
    pub received: Option<&'a wgpu::Buffer>,
}

impl Passes {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        let march = Pass::new(&gpu, "march_records", shaders::MARCH_RECORDS, &march_entries());
        let project = Pass::new(&gpu, "project_records", shaders::PROJECT_RECORDS, &project_entries());
        Self { gpu, march, project, exchange: exchange::Pipelines::default() }
    }

    /// Casts the rays of `records` entries, a row of workgroups for each column.
    pub fn march(&self, variant: PassVariant, chunk: &Chunk, bound: &Bound<'_>, records: u32, columns: u32) {
        let quads = bound.texture.quads.as_ref().unwrap_or(&bound.texture.view);
        let buffers = bound.buffers;
        let group = self.march.bind_group(
            &self.gpu,
            &[
                buffer_entry(0, &buffers.frame),
                texture_entry(1, &bound.tables.points),
                texture_entry(2, &bound.tables.cells),
                buffer_entry(4, &buffers.lights),
                texture_entry(7, &bound.texture.view),
                texture_entry(9, bound.distance_map),
                texture_entry(11, bound.changed_map),
                texture_entry(12, quads),
                buffer_entry(13, &buffers.records),
                buffer_entry(14, &buffers.entries),
                buffer_entry(15, &buffers.columns),
                buffer_entry(16, &chunk.rays),
                buffer_entry(17, &chunk.renewed),
                buffer_entry(18, &buffers.counters),
            ],
        );
        let variant = PassVariant { dynamic: false, ..variant };
        let pipeline = self.march.pipeline(&self.gpu, variant);
        self.gpu.dispatch(&pipeline, &group, [records.div_ceil(GROUP), columns]);
    }

    /// Writes coefficients of `records` entries.
    pub fn project(&self, variant: PassVariant, chunk: &Chunk, bound: &Bound<'_>, records: u32) {
        let buffers = bound.buffers;
        let group = self.project.bind_group(
            &self.gpu,
            &[
                buffer_entry(0, &buffers.frame),
                buffer_entry(3, &bound.tables.materials),
                buffer_entry(4, &buffers.lights),
                buffer_entry(13, &buffers.records),
                buffer_entry(14, &buffers.entries),
                buffer_entry(15, &buffers.columns),
                buffer_entry(16, &chunk.rays),
                buffer_entry(17, &chunk.renewed),
                buffer_entry(18, &buffers.counters),
                texture_entry(19, bound.products),
                texture_entry(20, &bound.field.view),
                // Where nothing is received it is not read.
                buffer_entry(21, bound.received.unwrap_or(&buffers.entries)),
            ],
        );
        let exchanged = bound.received.is_some();
        let variant = PassVariant { nearest: false, quads: false, exchanged, ..variant };
        let pipeline = self.project.pipeline(&self.gpu, variant);
        let coefficients = bound.field.bands * bound.field.bands;
        self.gpu.dispatch(&pipeline, &group, [records.div_ceil(GROUP), coefficients]);
    }
}

impl Chunk {
    /// Bytes of the rays of a chunk.
    pub fn bytes(columns: u32, words: u32) -> u64 {
        4 * u64::from(CHUNK_SLOTS) * u64::from(columns) * u64::from(words)
    }

    pub fn new(gpu: &Gpu, columns: u32, words: u32) -> Result<Self, RenderError> {
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let rays = gpu.buffer("rays of records", Self::bytes(columns, words), storage)?;
        let renewed = gpu.buffer("renewed records", 4 * u64::from(CHUNK_SLOTS), storage)?;
        Ok(Self { rays, renewed })
    }

    pub fn rays(&self) -> &wgpu::Buffer {
        &self.rays
    }
}

impl Buffers {
    pub fn new(gpu: &Gpu, columns: u32) -> Result<Self, RenderError> {
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let size = |n: usize| n as u64;
        let lights = crate::tables::MAX_LIGHTS * std::mem::size_of::<uniforms::Light>();
        Ok(Self {
            frame: gpu.buffer("frame", size(std::mem::size_of::<uniforms::FrameUniform>()), uniform)?,
            records: gpu.buffer("records", size(std::mem::size_of::<uniforms::Records>()), storage)?,
            entries: gpu.buffer("entries", 8 * u64::from(CHUNK_SLOTS), storage)?,
            columns: gpu.buffer("columns", 16 * u64::from(columns), storage)?,
            lights: gpu.buffer("lights of records", size(lights), uniform)?,
            counters: gpu.buffer("counters of records", COUNTER_BYTES, storage)?,
        })
    }
}

impl Pass {
    fn new(
        gpu: &Gpu,
        label: &'static str,
        source: &'static str,
        entries: &[wgpu::BindGroupLayoutEntry],
    ) -> Self {
        let device = &gpu.device;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let bindings =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        Self { label, module, bindings, layout, pipelines: Variants::default() }
    }

    fn bind_group(&self, gpu: &Gpu, entries: &[wgpu::BindGroupEntry<'_>]) -> wgpu::BindGroup {
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.label),
            layout: &self.bindings,
            entries,
        })
    }

    fn pipeline(&self, gpu: &Gpu, variant: PassVariant) -> wgpu::ComputePipeline {
        let flag = |on: bool| f64::from(u8::from(on));
        let constants: &[(&str, f64)] = match self.label {
            "march_records" => &[
                ("FILTER", if variant.nearest { 2.0 } else { 1.0 }),
                ("QUADS", flag(variant.quads)),
                ("GLOW", flag(variant.glow)),
            ],
            _ => &[
                ("GLOW", flag(variant.glow)),
                ("DYNAMIC", flag(variant.dynamic)),
                ("EXCHANGED", flag(variant.exchanged)),
            ],
        };
        let compile = || gpu.compute_pipeline(self.label, Some(&self.layout), &self.module, constants);
        self.pipelines.get(variant, compile)
    }
}

fn entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

fn texture(dimension: wgpu::TextureViewDimension, sample_type: wgpu::TextureSampleType) -> wgpu::BindingType {
    wgpu::BindingType::Texture { sample_type, view_dimension: dimension, multisampled: false }
}

const UNIFORM: wgpu::BufferBindingType = wgpu::BufferBindingType::Uniform;
const READ: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: true };
const WRITE: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: false };
const FLOATS: wgpu::TextureSampleType = wgpu::TextureSampleType::Float { filterable: false };

/// Bindings 13 to 18, which both passes have.
fn shared_entries() -> [wgpu::BindGroupLayoutEntry; 6] {
    [
        entry(13, buffer(READ)),
        entry(14, buffer(READ)),
        entry(15, buffer(READ)),
        entry(16, buffer(WRITE)),
        entry(17, buffer(WRITE)),
        entry(18, buffer(WRITE)),
    ]
}

fn march_entries() -> Vec<wgpu::BindGroupLayoutEntry> {
    use wgpu::TextureViewDimension::{D2, D3};
    let own = [
        entry(0, buffer(UNIFORM)),
        entry(1, texture(D2, FLOATS)),
        entry(2, texture(D2, FLOATS)),
        entry(4, buffer(UNIFORM)),
        entry(7, texture(D3, FLOATS)),
        entry(9, texture(D3, wgpu::TextureSampleType::Uint)),
        entry(11, texture(D3, wgpu::TextureSampleType::Uint)),
        entry(12, texture(D3, FLOATS)),
    ];
    own.into_iter().chain(shared_entries()).collect()
}

fn project_entries() -> Vec<wgpu::BindGroupLayoutEntry> {
    let field = wgpu::BindingType::StorageTexture {
        access: wgpu::StorageTextureAccess::WriteOnly,
        format: wgpu::TextureFormat::Rgba16Float,
        view_dimension: wgpu::TextureViewDimension::D3,
    };
    let own = [
        entry(0, buffer(UNIFORM)),
        entry(3, buffer(UNIFORM)),
        entry(4, buffer(UNIFORM)),
        entry(19, texture(wgpu::TextureViewDimension::D2, FLOATS)),
        entry(20, field),
        entry(21, buffer(READ)),
    ];
    own.into_iter().chain(shared_entries()).collect()
}
