//! Pipelines of method `precomputed_transfer`.

use std::borrow::Cow;
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

/// Where more photons, or beams that meet the box, than this share are stale, all are followed anew: each
/// stale one is followed twice, to be taken out and to come again.
const MOST_STALE: f64 = 0.4;

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

/// WGSL.
type Source = Cow<'static, str>;

/// Of the modules that edits of matter depend on.
pub struct Sources {
    pub march: Source,
    pub enter: Source,
    pub carry: Source,
    pub find_stale: Source,
    pub move_rows: Source,
}

impl Default for Sources {
    fn default() -> Self {
        Self {
            march: shaders::MARCH_TRANSFER.into(),
            enter: shaders::ENTER_PHOTONS.into(),
            carry: shaders::CARRY_PHOTONS.into(),
            find_stale: shaders::FIND_STALE.into(),
            move_rows: shaders::MOVE_ROWS.into(),
        }
    }
}

/// Compiled when first needed; one for all sessions.
pub struct Pipelines {
    gpu: Arc<Gpu>,
    pub march: Module,
    pub list_beams: Module,
    pub spread: Module,
    pub enter: Module,
    pub carry: Module,
    pub count_stale: Module,
    pub list_stale: Module,
    pub move_rows: Module,
    pub relight: Module,
    pub light_directions: Module,
    pub light_rows: Module,
    /// Reads nothing, but the modules declare it.
    pub sampler: wgpu::Sampler,
    /// Where more photons than this share are stale, 0 to 1, a bake is made anew; and beams are.
    pub most_stale: f64,
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
    fn new(gpu: &Gpu, entry_point: &'static str, source: Source, entries: &[Entry]) -> Self {
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
            source: wgpu::ShaderSource::Wgsl(source),
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
        Self::of_sources(gpu, Sources::default())
    }

    /// With other sources of some of the modules.
    pub fn of_sources(gpu: Arc<Gpu>, sources: Sources) -> Self {
        use Kind::{Cells, Field, Read, Sampler, Table, Uniform, Volume, Write};
        let matter =
            [(0, Uniform), (1, Table), (2, Table), (7, Volume), (8, Sampler), (9, Cells), (21, Read)];
        let with = |more: &[Entry]| matter.iter().chain(more).copied().collect::<Vec<_>>();
        let march =
            with(&[(11, Cells), (12, Volume), (13, Cells), (22, Read), (24, Write), (28, Read), (33, Read)]);
        let list_beams = [(0, Uniform), (6, Write), (11, Cells), (21, Read), (22, Read), (34, Write)];
        let spread = [(21, Read), (23, Read), (24, Read), (26, Write)];
        let enter = [(0, Uniform), (10, Write), (21, Read), (27, Read), (32, Write), (33, Read)];
        let mut carry = with(&[(3, Uniform), (27, Read), (28, Read)]);
        carry.extend([6, 10, 24, 29, 32].map(|binding| (binding, Write)));
        let count_stale = [(21, Read), (32, Read), (34, Write)];
        let list_stale = [(21, Read), (32, Read), (33, Write), (34, Write)];
        let move_rows = [(21, Read), (29, Read), (35, Write), (36, Read)];
        let mut relight = [21, 24, 25, 26, 28, 29, 30].map(|binding| (binding, Read)).to_vec();
        relight.push((31, Field));
        let directions = [(21, Read), (24, Read), (29, Write), (30, Read)];
        let rows = [(21, Read), (25, Read), (26, Read), (27, Read), (28, Read), (29, Write), (31, Field)];
        Self {
            march: Module::new(&gpu, "march_transfer", sources.march.clone(), &march),
            list_beams: Module::new(&gpu, "list_beams", sources.march, &list_beams),
            spread: Module::new(&gpu, "spread_beams", shaders::SPREAD_BEAMS.into(), &spread),
            enter: Module::new(&gpu, "enter_photons", sources.enter, &enter),
            carry: Module::new(&gpu, "carry_photons", sources.carry, &carry),
            count_stale: Module::new(&gpu, "count_stale", sources.find_stale.clone(), &count_stale),
            list_stale: Module::new(&gpu, "list_stale", sources.find_stale, &list_stale),
            move_rows: Module::new(&gpu, "move_rows", sources.move_rows, &move_rows),
            relight: Module::new(&gpu, "relight", shaders::RELIGHT.into(), &relight),
            light_directions: Module::new(
                &gpu,
                "light_directions",
                shaders::LIGHT_CLUSTERS.into(),
                &directions,
            ),
            light_rows: Module::new(&gpu, "light_rows", shaders::LIGHT_CLUSTERS.into(), &rows),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor::default()),
            most_stale: MOST_STALE,
            gpu,
        }
    }

    pub fn march(&self, variant: Variant) -> wgpu::ComputePipeline {
        self.of_beams(&self.march, variant)
    }

    pub fn list_beams(&self, variant: Variant) -> wgpu::ComputePipeline {
        self.of_beams(&self.list_beams, variant)
    }

    fn of_beams(&self, module: &Module, variant: Variant) -> wgpu::ComputePipeline {
        let filter = if variant.nearest { 2.0 } else { 1.0 };
        let constants = [("FILTER", filter), ("QUADS", f64::from(u8::from(variant.quads)))];
        // All that differs otherwise is not in this module.
        let variant = Variant { bands: 0, coloured: false, features: Features::default(), ..variant };
        module.compiled(&self.gpu, Some(variant), &constants)
    }

    /// A module that is the same for all scenes.
    pub fn of(&self, module: &Module) -> wgpu::ComputePipeline {
        module.compiled(&self.gpu, None, &[])
    }

    pub fn carry(&self, variant: Variant) -> wgpu::ComputePipeline {
        let mut constants = variant.features.constants().to_vec();
        constants.push(("FILTER", if variant.nearest { 2.0 } else { 1.0 }));
        constants.push(("BANDS", f64::from(variant.bands)));
        constants.push(("COLOURED", f64::from(u8::from(variant.coloured))));
        self.carry.compiled(&self.gpu, Some(Variant { quads: false, ..variant }), &constants)
    }
}
