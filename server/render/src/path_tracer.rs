//! Pipelines of method `path_traced`: `path_trace` and its variants, `restart_tiles`,
//! `mix_lights`, `error`.

use std::sync::Arc;

use proto::scene_file::Filter;
use scene::Scene;

use crate::gpu::Gpu;
use crate::ray_cast::Features;
use crate::shaders;
use crate::variants::Variants;

/// Edge of a tile and of a `path_trace` workgroup, pixels.
pub const TILE_EDGE: u32 = 8;
/// Pixels one workgroup of `error` sums up.
pub const ERROR_BLOCK: u32 = 256;

/// A compiled specialisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PathVariant {
    /// Voxels are not interpolated. Otherwise they are in f32: the estimator claims accuracy.
    nearest: bool,
    environment_image: bool,
    /// Each light is kept apart.
    light_layers: bool,
    features: Features,
}

impl PathVariant {
    /// The cheapest variant that draws the scene.
    pub fn of(scene: &Scene) -> Self {
        let points = &scene.transfer_function.points;
        // Matter that glows lights surfaces, too, where there is no light.
        let surfaces = points.iter().any(|point| scene.materials[point.material].surface > 0.0);
        Self {
            nearest: scene.filter == Filter::Nearest,
            environment_image: scene.environment_image().is_some(),
            light_layers: scene.has_light_layers(),
            features: Features { surfaces, ..Features::of(scene) },
        }
    }
}

/// The pipelines, compiled when first needed.
pub struct PathTracer {
    gpu: Arc<Gpu>,
    module: wgpu::ShaderModule,
    pub bind_group_layout: wgpu::BindGroupLayout,
    pipeline_layout: wgpu::PipelineLayout,
    pipelines: Variants<PathVariant>,
    /// Reads nothing, but the module declares it.
    pub sampler: wgpu::Sampler,
    pub restart: wgpu::ComputePipeline,
    pub mix: wgpu::ComputePipeline,
    pub error: wgpu::ComputePipeline,
}

impl PathTracer {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        let device = &gpu.device;
        let module = |label, source: &'static str| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            })
        };
        let plain = |label, source| gpu.compute_pipeline(label, None, &module(label, source), &[]);
        let bind_group_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("path_trace"),
            entries: &layout_entries(),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("path_trace"),
            bind_group_layouts: &[Some(&bind_group_layout)],
            immediate_size: 0,
        });
        Self {
            module: module("path_trace", shaders::PATH_TRACE),
            restart: plain("restart_tiles", shaders::RESTART_TILES),
            mix: plain("mix_lights", shaders::MIX_LIGHTS),
            error: plain("error", shaders::ERROR),
            sampler: device.create_sampler(&wgpu::SamplerDescriptor::default()),
            bind_group_layout,
            pipeline_layout,
            pipelines: Variants::default(),
            gpu,
        }
    }

    /// A variant's pipeline, compiled if need be; any thread may ask.
    pub fn pipeline(&self, variant: PathVariant) -> wgpu::ComputePipeline {
        let Self { gpu, module, pipeline_layout, .. } = self;
        let compile = || {
            let mut constants = variant.features.constants().to_vec();
            constants.push(("FILTER", if variant.nearest { 2.0 } else { 1.0 }));
            constants.push(("ENVIRONMENT_IMAGE", f64::from(u8::from(variant.environment_image))));
            constants.push(("LIGHT_LAYERS", f64::from(u8::from(variant.light_layers))));
            gpu.compute_pipeline("path_trace", Some(pipeline_layout), module, &constants)
        };
        self.pipelines.get(variant, compile)
    }
}

fn layout_entries() -> [wgpu::BindGroupLayoutEntry; 18] {
    use wgpu::TextureViewDimension::{D2, D3};
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    };
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let uniform = || buffer(wgpu::BufferBindingType::Uniform);
    let write = || buffer(wgpu::BufferBindingType::Storage { read_only: false });
    let texture = |view_dimension, sample_type| wgpu::BindingType::Texture {
        sample_type,
        view_dimension,
        multisampled: false,
    };
    let floats = wgpu::TextureSampleType::Float { filterable: false };
    [
        entry(0, uniform()),
        entry(1, texture(D2, floats)),
        entry(2, texture(D2, floats)),
        entry(3, uniform()),
        entry(4, uniform()),
        entry(5, write()),
        entry(6, write()),
        entry(7, texture(D3, floats)),
        entry(8, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering)),
        entry(9, texture(D3, wgpu::TextureSampleType::Uint)),
        entry(10, write()),
        entry(20, texture(D2, floats)),
        entry(12, texture(D2, floats)),
        entry(13, uniform()),
        entry(14, write()),
        entry(15, write()),
        entry(16, write()),
        entry(17, write()),
    ]
}
