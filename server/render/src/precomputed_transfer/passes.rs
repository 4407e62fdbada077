//! Pipelines of method `precomputed_transfer`.

use std::sync::Arc;

use proto::scene_file::Filter;
use scene::Scene;
use wgpu::TextureViewDimension::{D2, D3};

use crate::gpu::Gpu;
use crate::ray_cast::Features;
use crate::shaders;
use crate::variants::Variants;
use crate::volume_texture::VolumeTexture;

/// Invocations of a workgroup, as in the shaders.
pub const GROUP: u32 = 64;

/// A compiled specialisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variant {
    nearest: bool,
    quads: bool,
    bands: u32,
    coloured: bool,
    features: Features,
}

impl Variant {
    pub fn of(scene: &Scene, texture: &VolumeTexture, bands: u32, coloured: bool) -> Self {
        let points = &scene.transfer_function.points;
        // Whatever the lights are: a bake is for all of them.
        let surfaces = points.iter().any(|point| scene.materials[point.material].surface > 0.0);
        Self {
            nearest: scene.filter == Filter::Nearest,
            quads: texture.quads.is_some(),
            bands,
            coloured,
            features: Features { surfaces, ..Features::of(scene) },
        }
    }
}

/// Compiled when first needed; one for all sessions.
pub struct Pipelines {
    gpu: Arc<Gpu>,
    pub march: Module,
    pub spread: Module,
    pub enter: Module,
    pub carry: Module,
    pub take_in: Module,
    pub relight: Module,
    pub light_directions: Module,
    pub light_rows: Module,
    /// Reads nothing, but the modules declare it.
    pub sampler: wgpu::Sampler,
}

/// An entry point with its layout.
pub struct Module {
    entry_point: &'static str,
    shader: wgpu::ShaderModule,
    pub bindings: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
    pipelines: Variants<Option<Variant>>,
}

impl Module {
    fn new(gpu: &Gpu, entry_point: &'static str, source: &'static str, entries: &[Entry]) -> Self {
        let device = &gpu.device;
        let entries: Vec<_> = entries.iter().map(|&(binding, kind)| kind.layout(binding)).collect();
        let bindings = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(entry_point),
            entries: &entries,
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(entry_point),
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(entry_point),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        Self { entry_point, shader, bindings, layout, pipelines: Variants::default() }
    }

    pub fn bind(&self, gpu: &Gpu, entries: &[wgpu::BindGroupEntry<'_>]) -> wgpu::BindGroup {
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.entry_point),
            layout: &self.bindings,
            entries,
        })
    }

    fn compiled(
        &self,
        gpu: &Gpu,
        variant: Option<Variant>,
        constants: &[(&str, f64)],
    ) -> wgpu::ComputePipeline {
        let compile = || gpu.compute_pipeline(self.entry_point, Some(&self.layout), &self.shader, constants);
        self.pipelines.get(variant, compile)
    }
}

/// What is bound at a number.
#[derive(Clone, Copy)]
enum Kind {
    Uniform,
    Read,
    Write,
    Table,
    Volume,
    Cells,
    Sampler,
    Field,
}

type Entry = (u32, Kind);

impl Kind {
    fn layout(self, binding: u32) -> wgpu::BindGroupLayoutEntry {
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let storage = |read_only| buffer(wgpu::BufferBindingType::Storage { read_only });
        let texture = |view_dimension, sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension,
            multisampled: false,
        };
        let floats = wgpu::TextureSampleType::Float { filterable: false };
        let ty = match self {
            Kind::Uniform => buffer(wgpu::BufferBindingType::Uniform),
            Kind::Read => storage(true),
            Kind::Write => storage(false),
            Kind::Table => texture(D2, floats),
            Kind::Volume => texture(D3, floats),
            Kind::Cells => texture(D3, wgpu::TextureSampleType::Uint),
            Kind::Sampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering),
            Kind::Field => wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format: wgpu::TextureFormat::Rgba16Float,
                view_dimension: D3,
            },
        };
        wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
    }
}

impl Pipelines {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        use Kind::{Cells, Field, Read, Sampler, Table, Uniform, Volume, Write};
        let matter =
            [(0, Uniform), (1, Table), (2, Table), (7, Volume), (8, Sampler), (9, Cells), (21, Read)];
        let with = |more: &[Entry]| matter.iter().chain(more).copied().collect::<Vec<_>>();
        let march = with(&[(12, Volume), (22, Read), (24, Write), (28, Read)]);
        let spread = [(21, Read), (23, Read), (24, Write), (26, Write)];
        let enter = [(0, Uniform), (10, Write), (21, Read), (27, Read)];
        let carry = with(&[(3, Uniform), (6, Write), (10, Write), (27, Read), (28, Read), (29, Write)]);
        let take_in = [(21, Read), (24, Write), (29, Write)];
        let relight = [(21, Read), (24, Write), (25, Read), (26, Read), (28, Read), (30, Read), (31, Field)];
        let directions = [(21, Read), (24, Read), (29, Write), (30, Read)];
        let rows = [(21, Read), (25, Read), (26, Read), (27, Read), (28, Read), (29, Write), (31, Field)];
        Self {
            march: Module::new(&gpu, "march_transfer", shaders::MARCH_TRANSFER, &march),
            spread: Module::new(&gpu, "spread_beams", shaders::SPREAD_BEAMS, &spread),
            enter: Module::new(&gpu, "enter_photons", shaders::CARRY_PHOTONS, &enter),
            carry: Module::new(&gpu, "carry_photons", shaders::CARRY_PHOTONS, &carry),
            take_in: Module::new(&gpu, "take_in", shaders::RELIGHT, &take_in),
            relight: Module::new(&gpu, "relight", shaders::RELIGHT, &relight),
            light_directions: Module::new(&gpu, "light_directions", shaders::LIGHT_CLUSTERS, &directions),
            light_rows: Module::new(&gpu, "light_rows", shaders::LIGHT_CLUSTERS, &rows),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor::default()),
            gpu,
        }
    }

    pub fn march(&self, variant: Variant) -> wgpu::ComputePipeline {
        let filter = if variant.nearest { 2.0 } else { 1.0 };
        let constants = [("FILTER", filter), ("QUADS", f64::from(u8::from(variant.quads)))];
        // All that differs otherwise is not in this module.
        let variant = Variant { bands: 0, coloured: false, features: Features::default(), ..variant };
        self.march.compiled(&self.gpu, Some(variant), &constants)
    }

    pub fn spread(&self) -> wgpu::ComputePipeline {
        self.spread.compiled(&self.gpu, None, &[])
    }

    pub fn enter(&self) -> wgpu::ComputePipeline {
        self.enter.compiled(&self.gpu, None, &[])
    }

    pub fn carry(&self, variant: Variant) -> wgpu::ComputePipeline {
        let mut constants = variant.features.constants().to_vec();
        constants.push(("FILTER", if variant.nearest { 2.0 } else { 1.0 }));
        constants.push(("BANDS", f64::from(variant.bands)));
        constants.push(("COLOURED", f64::from(u8::from(variant.coloured))));
        self.carry.compiled(&self.gpu, Some(Variant { quads: false, ..variant }), &constants)
    }

    pub fn take_in(&self) -> wgpu::ComputePipeline {
        self.take_in.compiled(&self.gpu, None, &[])
    }

    pub fn relight(&self) -> wgpu::ComputePipeline {
        self.relight.compiled(&self.gpu, None, &[])
    }

    pub fn light_directions(&self) -> wgpu::ComputePipeline {
        self.light_directions.compiled(&self.gpu, None, &[])
    }

    pub fn light_rows(&self) -> wgpu::ComputePipeline {
        self.light_rows.compiled(&self.gpu, None, &[])
    }
}
