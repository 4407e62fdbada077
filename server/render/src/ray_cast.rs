//! Pipeline `ray_cast` and its variants.

use std::sync::Arc;

use proto::scene_file::{Brdf, Filter, Interpolation, Phase};
use scene::light::LightGeometry;
use scene::{Background, Rendering, Scene};

use crate::gpu::Gpu;
use crate::light_field::LightField;
use crate::shaders;
use crate::uniforms;
use crate::variants::Variants;
use crate::volume_texture::VolumeTexture;

/// Edge of a `ray_cast` workgroup, pixels.
pub const WORKGROUP_EDGE: u32 = 8;

/// A compiled specialisation. Variants may round differently from one another, so everything
/// that is compared for equality uses one variant.
/// Parts that a ray may look at towards lights; `MOST_NEAR_TURNS` in the shader. All loops of eight rays end
/// after 65,535 turns together on a software device, and half of these are for the way of the rays.
const MOST_NEAR_TURNS_SOFTWARE: u32 = 4096;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variant {
    /// 0 hardware trilinear, 1 f32 trilinear, 2 nearest; `FILTER` in the shader.
    pub filter: u32,
    /// What a pixel shows; `MODE` in the shader.
    pub mode: u32,
    /// Segments a ray's sum is made of; `SEGMENTS` in the shader.
    pub segments: u32,
    /// Whether voxels can be read four at a time; `QUADS` in the shader.
    pub quads: bool,
    /// Whether they are kept; `KEEP_SEGMENTS` in the shader.
    pub keep_segments: bool,
    /// Bands of the light field; 0: there is none. `FIELD_BANDS` in the shader.
    pub field_bands: u32,
    /// Parts in which matter beside a place is looked at, if what lights bring by themselves stands
    /// beside the field, else 0; `DIRECT` and `NEAR_PARTS` in the shader.
    pub near_parts: Option<u32>,
    /// Whether its texels hold means of what is seen of skins; `SKINS` in the shader.
    pub skins: bool,
    /// Whether these hold where skins are seen from; `FACED` in the shader.
    pub faced: bool,
    /// Whether light is gathered at parts of rays; `GATHER` in the shader.
    pub gather: bool,
    /// Whether an image lies behind the volume; `ENVIRONMENT_IMAGE` in the shader.
    pub image_behind: bool,
    /// What the scene uses.
    pub features: Features,
}

/// What a pipeline may do without; constants of shaders/shared/features.wgsl.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Features {
    pub blinn_phong: bool,
    pub ashikhmin_shirley: bool,
    pub abc: bool,
    pub henyey_greenstein: bool,
    pub schlick: bool,
    pub lights_with_a_place: bool,
    pub surfaces: bool,
    pub emission: bool,
}

impl Variant {
    /// The cheapest variant that draws the scene, rays whole, in a light field if there is one.
    pub fn of(scene: &Scene, texture: &VolumeTexture, field: Option<&LightField>) -> Self {
        let hardware = scene.sampling.interpolation == Interpolation::Sampler;
        Self {
            filter: match scene.filter {
                Filter::Nearest => 2,
                Filter::Linear if texture.filterable && hardware => 0,
                Filter::Linear => 1,
            },
            mode: match scene.rendering {
                Rendering::Volume => 0,
                Rendering::Maximum => 1,
                Rendering::Minimum => 2,
                Rendering::Average => 3,
                Rendering::Isosurface { .. } => 4,
                Rendering::Slice { .. } => 5,
            },
            segments: scene.sampling.segments.max(1),
            quads: texture.quads.is_some(),
            keep_segments: false,
            field_bands: field.map_or(0, |field| field.bands),
            near_parts: field.and_then(LightField::near_parts),
            skins: field.is_some_and(LightField::has_skins),
            faced: field.is_some_and(|field| field.faced),
            gather: false,
            image_behind: matches!(scene.background, Background::Image { .. }),
            features: if scene.rendering.is_lit() { Features::of(scene) } else { Features::default() },
        }
    }
}

impl Features {
    /// What the scene's lights and the matter of its transfer function need.
    pub(crate) fn of(scene: &Scene) -> Self {
        let points = &scene.transfer_function.points;
        let material = |point: &scene::transfer_function::Point| &scene.materials[point.material];
        // An isosurface makes surfaces of all matter.
        let all_surfaces = scene.rendering != Rendering::Volume;
        let surface = |point: &_| all_surfaces || material(point).surface > 0.0;
        let any_surface = |kind: fn(&Brdf) -> bool| {
            points.iter().any(|point| surface(point) && material(point).brdf.as_ref().is_some_and(kind))
        };
        let any_phase = |kind: fn(&Phase) -> bool| points.iter().any(|point| kind(&material(point).phase));
        let placed = |light: &scene::Light| {
            !matches!(
                light.geometry,
                LightGeometry::Directional { .. }
                    | LightGeometry::UniformEnvironment
                    | LightGeometry::Environment { .. }
            )
        };
        Self {
            blinn_phong: any_surface(|brdf| matches!(brdf, Brdf::BlinnPhong(_))),
            ashikhmin_shirley: any_surface(|brdf| matches!(brdf, Brdf::AshikhminShirley(_))),
            abc: any_surface(|brdf| matches!(brdf, Brdf::Abc(_))),
            henyey_greenstein: any_phase(|phase| matches!(phase, Phase::HenyeyGreenstein(_))),
            schlick: any_phase(|phase| matches!(phase, Phase::Schlick(_))),
            lights_with_a_place: scene.lights.iter().any(placed),
            surfaces: !scene.lights.is_empty() && points.iter().any(surface),
            emission: points.iter().any(|point| point.emission.max_element() > 0.0),
        }
    }

    /// As pipeline constants.
    pub(crate) fn constants(&self) -> [(&'static str, f64); 8] {
        let flag = |on: bool| if on { 1.0 } else { 0.0 };
        [
            ("BLINN_PHONG", flag(self.blinn_phong)),
            ("ASHIKHMIN_SHIRLEY", flag(self.ashikhmin_shirley)),
            ("ABC", flag(self.abc)),
            ("HENYEY_GREENSTEIN", flag(self.henyey_greenstein)),
            ("SCHLICK", flag(self.schlick)),
            ("LIGHTS_WITH_A_PLACE", flag(self.lights_with_a_place)),
            ("SURFACES", flag(self.surfaces)),
            ("EMISSION", flag(self.emission)),
        ]
    }
}

/// The ray caster's pipelines, compiled when first needed.
pub struct RayCaster {
    gpu: Arc<Gpu>,
    module: wgpu::ShaderModule,
    /// For the hardware filter, and for variants that read texels one by one (which any format
    /// allows, filterable or not).
    filtering: Bindings,
    texel_wise: Bindings,
    pipelines: Variants<Variant>,
}

/// What a kind of variant binds.
pub struct Bindings {
    pub bind_group_layout: wgpu::BindGroupLayout,
    pub sampler: wgpu::Sampler,
    /// In place of view-ray segments where rays are cast whole.
    pub no_segments: wgpu::Buffer,
    /// In place of parts of rays where light is not gathered at them.
    pub no_parts: wgpu::Buffer,
    /// In place of a light field where there is none.
    pub no_light: wgpu::TextureView,
    /// Between texels of a light field, and of the texel that holds a place.
    pub light_samplers: [wgpu::Sampler; 2],
    pipeline_layout: wgpu::PipelineLayout,
}

impl RayCaster {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        let device = &gpu.device;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("ray_cast"),
            source: wgpu::ShaderSource::Wgsl(shaders::RAY_CAST.into()),
        });
        let (filtering, texel_wise) = (Bindings::new(device, true), Bindings::new(device, false));
        Self { gpu, module, filtering, texel_wise, pipelines: Variants::default() }
    }

    /// What a variant binds.
    pub fn bindings(&self, variant: Variant) -> &Bindings {
        if variant.filter == 0 { &self.filtering } else { &self.texel_wise }
    }

    /// A variant's pipeline, compiled if need be; any thread may ask.
    pub fn pipeline(&self, variant: Variant) -> wgpu::ComputePipeline {
        let Self { gpu, module, .. } = self;
        let layout = &self.bindings(variant).pipeline_layout;
        let compile = || {
            let mut constants = variant.features.constants().to_vec();
            constants.push(("FILTER", f64::from(variant.filter)));
            constants.push(("MODE", f64::from(variant.mode)));
            constants.push(("SEGMENTS", f64::from(variant.segments)));
            constants.push(("QUADS", f64::from(u8::from(variant.quads))));
            constants.push(("FIELD_BANDS", f64::from(variant.field_bands)));
            constants.push(("DIRECT", f64::from(u8::from(variant.near_parts.is_some()))));
            constants.push(("SKINS", f64::from(u8::from(variant.skins))));
            constants.push(("FACED", f64::from(u8::from(variant.faced))));
            constants.push(("GATHER", f64::from(u8::from(variant.gather))));
            constants.push(("NEAR_PARTS", f64::from(variant.near_parts.unwrap_or(0))));
            if gpu.info().software {
                constants.push(("MOST_NEAR_TURNS", f64::from(MOST_NEAR_TURNS_SOFTWARE)));
            }
            constants.push(("ENVIRONMENT_IMAGE", f64::from(u8::from(variant.image_behind))));
            constants.push(("KEEP_SEGMENTS", f64::from(u8::from(variant.keep_segments))));
            gpu.compute_pipeline("ray_cast", Some(layout), module, &constants)
        };
        self.pipelines.get(variant, compile)
    }
}

impl Bindings {
    fn new(device: &wgpu::Device, filtering: bool) -> Self {
        let bind_group_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("ray_cast"),
            entries: &layout_entries(filtering),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("ray_cast"),
            bind_group_layouts: &[Some(&bind_group_layout)],
            immediate_size: 0,
        });
        let filter = if filtering { wgpu::FilterMode::Linear } else { wgpu::FilterMode::Nearest };
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("volume"),
            mag_filter: filter,
            min_filter: filter,
            ..wgpu::SamplerDescriptor::default()
        });
        let nothing = |label, size| {
            let usage = wgpu::BufferUsages::STORAGE;
            let descriptor =
                wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            device.create_buffer(&descriptor)
        };
        let no_segments = nothing("no view-ray segments", 16);
        let no_parts = nothing("no parts of rays", std::mem::size_of::<uniforms::SeenPart>() as u64);
        let no_light = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("no light field"),
            size: wgpu::Extent3d::default(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format: wgpu::TextureFormat::Rgba16Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let light_samplers = [wgpu::FilterMode::Linear, wgpu::FilterMode::Nearest].map(|filter| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("light field"),
                mag_filter: filter,
                min_filter: filter,
                ..wgpu::SamplerDescriptor::default()
            })
        });
        Self {
            bind_group_layout,
            sampler,
            no_segments,
            no_parts,
            no_light: no_light.create_view(&wgpu::TextureViewDescriptor::default()),
            light_samplers,
            pipeline_layout,
        }
    }
}

fn layout_entries(filtering: bool) -> [wgpu::BindGroupLayoutEntry; 19] {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    };
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let write = || buffer(wgpu::BufferBindingType::Storage { read_only: false });
    let sampler =
        if filtering { wgpu::SamplerBindingType::Filtering } else { wgpu::SamplerBindingType::NonFiltering };
    let texture = |sample_type| wgpu::BindingType::Texture {
        sample_type,
        view_dimension: wgpu::TextureViewDimension::D3,
        multisampled: false,
    };
    let table = || wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: false },
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    [
        entry(0, buffer(wgpu::BufferBindingType::Uniform)),
        entry(1, table()),
        entry(2, table()),
        entry(3, buffer(wgpu::BufferBindingType::Uniform)),
        entry(4, buffer(wgpu::BufferBindingType::Uniform)),
        entry(5, write()),
        entry(6, write()),
        entry(7, texture(wgpu::TextureSampleType::Float { filterable: filtering })),
        entry(8, wgpu::BindingType::Sampler(sampler)),
        entry(9, texture(wgpu::TextureSampleType::Uint)),
        entry(10, write()),
        entry(11, texture(wgpu::TextureSampleType::Uint)),
        entry(12, texture(wgpu::TextureSampleType::Float { filterable: false })),
        entry(13, texture(wgpu::TextureSampleType::Float { filterable: true })),
        entry(14, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
        entry(15, buffer(wgpu::BufferBindingType::Uniform)),
        entry(16, texture(wgpu::TextureSampleType::Float { filterable: true })),
        entry(17, write()),
        entry(20, table()),
    ]
}
