//! Pipeline `march_direct`.

use std::borrow::Cow;
use std::sync::Arc;

use proto::scene_file::Filter;
use scene::Scene;

use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::shaders;
use crate::variants::Variants;

/// Invocations of a workgroup, as in the shader.
const GROUP: u32 = 64;
/// Words of the counter buffer, in bytes: four counters of two words.
pub(super) const COUNTER_BYTES: u64 = 32;
/// Their names, in the shader's order.
pub(super) const COUNTERS: [&str; 4] =
    ["direct_nodes_cast", "direct_nodes_kept", "direct_cells_taken", "direct_cells_skipped"];

/// A compiled specialisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Variant {
    nearest: bool,
    quads: bool,
}

/// The pipeline, compiled when first needed; one for all sessions.
pub(crate) struct Passes {
    gpu: Arc<Gpu>,
    module: wgpu::ShaderModule,
    bindings: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
    pipelines: Variants<Variant>,
}

/// What a dispatch reads and writes beside the scene's tables.
pub(super) struct Bound<'a> {
    pub frame: &'a wgpu::Buffer,
    pub run: &'a wgpu::Buffer,
    pub shares: &'a wgpu::Buffer,
    pub counters: &'a wgpu::Buffer,
    pub field: &'a wgpu::TextureView,
    pub distance_map: &'a wgpu::TextureView,
    pub changed_map: &'a wgpu::TextureView,
}

impl Passes {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        Self::of_source(gpu, shaders::MARCH_DIRECT.into())
    }

    /// With another source of the module.
    pub fn of_source(gpu: Arc<Gpu>, source: Cow<'static, str>) -> Self {
        let device = &gpu.device;
        let label = Some("march_direct");
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(source),
        });
        let bindings =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries() });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        Self { module, bindings, layout, pipelines: Variants::default(), gpu }
    }

    /// Looks up `nodes` nodes.
    pub(super) fn march(&self, inputs: &Inputs<'_>, scene: &Scene, bound: &Bound<'_>, nodes: u32) {
        let texture = inputs.texture;
        let quads = texture.quads.as_ref();
        let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("march_direct"),
            layout: &self.bindings,
            entries: &[
                buffer_entry(0, bound.frame),
                texture_entry(1, &inputs.tables.points),
                texture_entry(2, &inputs.tables.cells),
                texture_entry(7, &texture.view),
                texture_entry(9, bound.distance_map),
                texture_entry(11, bound.changed_map),
                texture_entry(12, quads.unwrap_or(&texture.view)),
                buffer_entry(13, bound.run),
                buffer_entry(14, bound.shares),
                buffer_entry(18, bound.counters),
                texture_entry(19, bound.field),
            ],
        });
        let variant = Variant { nearest: scene.filter == Filter::Nearest, quads: quads.is_some() };
        let constants = [
            ("FILTER", if variant.nearest { 2.0 } else { 1.0 }),
            ("QUADS", f64::from(u8::from(variant.quads))),
        ];
        let compile =
            || self.gpu.compute_pipeline("march_direct", Some(&self.layout), &self.module, &constants);
        let pipeline = self.pipelines.get(variant, compile);
        self.gpu.dispatch(&pipeline, &group, [nodes.div_ceil(GROUP), 1]);
    }
}

fn entries() -> [wgpu::BindGroupLayoutEntry; 11] {
    use wgpu::TextureViewDimension::{D2, D3};
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    };
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let texture = |view_dimension, sample_type| wgpu::BindingType::Texture {
        sample_type,
        view_dimension,
        multisampled: false,
    };
    let floats = wgpu::TextureSampleType::Float { filterable: false };
    let write = || buffer(wgpu::BufferBindingType::Storage { read_only: false });
    let field = wgpu::BindingType::StorageTexture {
        access: wgpu::StorageTextureAccess::WriteOnly,
        format: wgpu::TextureFormat::Rgba16Float,
        view_dimension: D3,
    };
    [
        entry(0, buffer(wgpu::BufferBindingType::Uniform)),
        entry(1, texture(D2, floats)),
        entry(2, texture(D2, floats)),
        entry(7, texture(D3, floats)),
        entry(9, texture(D3, wgpu::TextureSampleType::Uint)),
        entry(11, texture(D3, wgpu::TextureSampleType::Uint)),
        entry(12, texture(D3, floats)),
        entry(13, buffer(wgpu::BufferBindingType::Storage { read_only: true })),
        entry(14, write()),
        entry(18, write()),
        entry(19, field),
    ]
}
