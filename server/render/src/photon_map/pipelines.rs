//! Pipelines of method `photon_map`.

use std::borrow::Cow;
use std::sync::{Arc, Mutex, PoisonError};

use proto::scene_file::Filter;
use scene::light::LightGeometry;
use scene::{Light, Scene};

use crate::gpu::Gpu;
use crate::ray_cast::Features;
use crate::shaders;
use crate::variants::Variants;

/// A compiled specialisation of `trace_photons`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PhotonVariant {
    /// Voxels are not interpolated; otherwise they are in f32.
    nearest: bool,
    bands: u32,
    features: Features,
}

impl PhotonVariant {
    pub fn of(scene: &Scene, bands: u32) -> Self {
        let points = &scene.transfer_function.points;
        let surfaces = points.iter().any(|point| scene.materials[point.material].surface > 0.0);
        Self {
            nearest: scene.filter == Filter::Nearest,
            bands,
            features: Features { surfaces, ..Features::of(scene) },
        }
    }

    fn constants(self) -> Vec<(&'static str, f64)> {
        let mut constants = self.features.constants().to_vec();
        constants.push(("FILTER", if self.nearest { 2.0 } else { 1.0 }));
        constants.push(("BANDS", f64::from(self.bands)));
        constants
    }
}

/// Where more of a light's photons than this share are stale, its sums are emptied and all are followed
/// anew. Measured: following takes as long at 0.41, and 1.1 times as long at 0.48 (docs/benchmarks/README.md).
const BEGIN_AGAIN_SHARE: f64 = 0.4;

/// How maps are made: other than usual only to compare what that costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotonTrial {
    /// Whether histories are kept. Without them edits are not followed: for empty views only.
    pub masks: bool,
    /// Of a light's photons the share, 0 to 1, above which it begins again; 1: it never does.
    pub begin_again_share: f64,
    /// Whether the kernel is widened where photons are few.
    pub widens: bool,
}

impl Default for PhotonTrial {
    fn default() -> Self {
        Self { masks: true, begin_again_share: BEGIN_AGAIN_SHARE, widens: true }
    }
}

/// What is kept of the extinction beside its sums around texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MassKept {
    Sums,
    /// Where it is seen from.
    Faced,
    /// What counts of it at each place.
    Places,
}

/// Compiled when first needed.
pub struct PhotonPipelines {
    gpu: Arc<Gpu>,
    trace: Module,
    take_up: Module,
    mass: Module,
    fill: Module,
    widen: Module,
    pack: Module,
    trial: Mutex<PhotonTrial>,
    traces: Variants<(PhotonVariant, bool)>,
    takes_up: Variants<bool>,
    masses: Variants<(bool, MassKept)>,
    fills: Variants<u32>,
    widens: Variants<u32>,
    packs: Variants<()>,
    /// Reads nothing, but the modules declare it.
    pub sampler: wgpu::Sampler,
}

/// WGSL.
pub type Source = Cow<'static, str>;

/// A module with the layout of its one entry point.
struct Module {
    shader: wgpu::ShaderModule,
    entry_point: &'static str,
    bind_group_layout: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
}

impl Module {
    fn new(gpu: &Gpu, entry_point: &'static str, source: Source, entries: &[Entry]) -> Self {
        let device = &gpu.device;
        let entries: Vec<_> = entries.iter().map(|entry| entry.layout()).collect();
        let bind_group_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(entry_point),
            entries: &entries,
        });
        Self {
            shader: device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(entry_point),
                source: wgpu::ShaderSource::Wgsl(source),
            }),
            entry_point,
            layout: device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(entry_point),
                bind_group_layouts: &[Some(&bind_group_layout)],
                immediate_size: 0,
            }),
            bind_group_layout,
        }
    }

    fn compile(&self, gpu: &Gpu, constants: &[(&'static str, f64)]) -> wgpu::ComputePipeline {
        gpu.compute_pipeline(self.entry_point, Some(&self.layout), &self.shader, constants)
    }
}

/// A binding by number.
enum Entry {
    Uniform(u32),
    Read(u32),
    Write(u32),
    /// Of floats that are not filtered: two or three dimensions.
    Table(u32),
    Volume(u32),
    /// Of whole numbers, three dimensions.
    Cells(u32),
    Sampler(u32),
    /// Written: half floats, three dimensions.
    Field(u32),
}

impl Entry {
    fn layout(&self) -> wgpu::BindGroupLayoutEntry {
        use wgpu::TextureViewDimension::{D2, D3};
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let storage = |read_only| buffer(wgpu::BufferBindingType::Storage { read_only });
        let texture = |view_dimension, sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension,
            multisampled: false,
        };
        let floats = wgpu::TextureSampleType::Float { filterable: false };
        let (binding, ty) = match *self {
            Entry::Uniform(binding) => (binding, buffer(wgpu::BufferBindingType::Uniform)),
            Entry::Read(binding) => (binding, storage(true)),
            Entry::Write(binding) => (binding, storage(false)),
            Entry::Table(binding) => (binding, texture(D2, floats)),
            Entry::Volume(binding) => (binding, texture(D3, floats)),
            Entry::Cells(binding) => (binding, texture(D3, wgpu::TextureSampleType::Uint)),
            Entry::Sampler(binding) => {
                (binding, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering))
            }
            Entry::Field(binding) => (
                binding,
                wgpu::BindingType::StorageTexture {
                    access: wgpu::StorageTextureAccess::WriteOnly,
                    format: wgpu::TextureFormat::Rgba16Float,
                    view_dimension: D3,
                },
            ),
        };
        wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
    }
}

impl PhotonPipelines {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        Self::of_sources(gpu, shaders::TRACE_PHOTONS.into(), shaders::TAKE_UP.into())
    }

    /// With other sources of two of the modules.
    pub fn of_sources(gpu: Arc<Gpu>, trace_source: Source, take_up_source: Source) -> Self {
        use Entry::{Cells, Field, Read, Sampler, Table, Uniform, Volume, Write};
        let matter = [Uniform(0), Table(1), Table(2), Volume(7), Sampler(8), Cells(9)];
        let mut trace = vec![Uniform(3), Uniform(13)];
        trace.extend([6, 10, 14, 15, 16, 17, 18, 19].map(Write));
        trace.extend(matter);
        let mut take_up = vec![Uniform(0), Uniform(4), Uniform(13), Table(12), Table(20)];
        take_up.extend([6, 10, 14, 15, 16, 17].map(Write));
        let mut mass = vec![Uniform(13), Write(14), Read(15)];
        mass.extend([Uniform(0), Table(1), Table(2), Volume(7), Sampler(8), Cells(9)]);
        let fill = [Uniform(0), Read(1), Read(2), Read(3), Field(5), Write(9), Write(10)];
        let widen = [Uniform(0), Volume(1), Field(5), Read(10)];
        let pack = [Uniform(13), Write(14), Write(15), Write(16), Write(17), Write(18), Write(19)];
        Self {
            trace: Module::new(&gpu, "trace_photons", trace_source, &trace),
            take_up: Module::new(&gpu, "take_up", take_up_source, &take_up),
            mass: Module::new(&gpu, "add_up_mass", shaders::ADD_UP_MASS.into(), &mass),
            fill: Module::new(&gpu, "fill_field", shaders::FILL_FIELD.into(), &fill),
            widen: Module::new(&gpu, "widen_field", shaders::WIDEN_FIELD.into(), &widen),
            pack: Module::new(&gpu, "pack_interactions", shaders::PACK_INTERACTIONS.into(), &pack),
            trial: Mutex::default(),
            traces: Variants::default(),
            takes_up: Variants::default(),
            masses: Variants::default(),
            fills: Variants::default(),
            widens: Variants::default(),
            packs: Variants::default(),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor::default()),
            gpu,
        }
    }

    /// How maps are made.
    pub fn trial(&self) -> PhotonTrial {
        *self.trial.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// From now on maps are made this way.
    pub fn set_trial(&self, trial: PhotonTrial) {
        *self.trial.lock().unwrap_or_else(PoisonError::into_inner) = trial;
    }

    /// `trace_photons`; any thread may ask.
    pub fn trace(&self, variant: PhotonVariant) -> wgpu::ComputePipeline {
        let masks = self.trial().masks;
        let mut constants = variant.constants();
        constants.push(("MASKS", f64::from(u8::from(masks))));
        self.traces.get((variant, masks), || self.trace.compile(&self.gpu, &constants))
    }

    /// `take_up`, for a light of this kind.
    pub fn take_up(&self, light: &Light) -> wgpu::ComputePipeline {
        let has_image = matches!(light.geometry, LightGeometry::Environment { .. });
        let constants = [("ENVIRONMENT_IMAGE", f64::from(u8::from(has_image)))];
        self.takes_up.get(has_image, || self.take_up.compile(&self.gpu, &constants))
    }

    /// `add_up_mass`.
    pub fn mass(&self, filter: Filter, kept: MassKept) -> wgpu::ComputePipeline {
        let nearest = filter == Filter::Nearest;
        let constants = [
            ("FILTER", if nearest { 2.0 } else { 1.0 }),
            ("FACED", f64::from(u8::from(kept == MassKept::Faced))),
            ("PLACES_KEPT", f64::from(u8::from(kept == MassKept::Places))),
        ];
        self.masses.get((nearest, kept), || self.mass.compile(&self.gpu, &constants))
    }

    pub fn fill(&self, bands: u32) -> wgpu::ComputePipeline {
        self.fills.get(bands, || self.fill.compile(&self.gpu, &[("BANDS", f64::from(bands))]))
    }

    pub fn pack(&self) -> wgpu::ComputePipeline {
        self.packs.get((), || self.pack.compile(&self.gpu, &[]))
    }

    pub fn pack_layout(&self) -> &wgpu::BindGroupLayout {
        &self.pack.bind_group_layout
    }

    pub fn trace_layout(&self) -> &wgpu::BindGroupLayout {
        &self.trace.bind_group_layout
    }

    pub fn take_up_layout(&self) -> &wgpu::BindGroupLayout {
        &self.take_up.bind_group_layout
    }

    pub fn mass_layout(&self) -> &wgpu::BindGroupLayout {
        &self.mass.bind_group_layout
    }

    /// `widen_field`.
    pub fn widen(&self, bands: u32) -> wgpu::ComputePipeline {
        self.widens.get(bands, || self.widen.compile(&self.gpu, &[("BANDS", f64::from(bands))]))
    }

    pub fn widen_layout(&self) -> &wgpu::BindGroupLayout {
        &self.widen.bind_group_layout
    }

    pub fn fill_layout(&self) -> &wgpu::BindGroupLayout {
        &self.fill.bind_group_layout
    }
}
