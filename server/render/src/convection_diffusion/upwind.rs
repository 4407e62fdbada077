//! The upwind scheme, solved front by front: directly, or by steps in time as published
//! (shaders/convection_diffusion/upwind.wgsl).

use std::sync::Arc;

use glam::DVec3;
use scene::light::LightGeometry;

use super::sweep::{Cells, Source, source_of};
use super::transport::{Matter, storage};
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::shaders;
use crate::uniforms::Front;

/// Distance of uniforms in a buffer, bytes: no device asks for more.
const UNIFORM_STRIDE: u64 = 256;
/// Fronts done in one submission.
const FRONTS_PER_SLICE: u32 = 32;
/// Edge of a workgroup.
const GROUP: u32 = 8;

/// Pipelines of the scheme.
pub struct Upwind {
    gpu: Arc<Gpu>,
    layout: wgpu::BindGroupLayout,
    direct: wgpu::ComputePipeline,
    explicit: wgpu::ComputePipeline,
    pack: wgpu::ComputePipeline,
}

/// A light on its way, front by front.
pub struct Fronts {
    group: wgpu::BindGroup,
    /// Steps in time of each front; 0: solved directly.
    steps: u32,
    done: u32,
    count: u32,
    cells: [u32; 3],
}

impl Upwind {
    /// Compiles the passes.
    pub fn new(gpu: Arc<Gpu>) -> Self {
        let device = &gpu.device;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("upwind"),
            source: wgpu::ShaderSource::Wgsl(shaders::UPWIND.into()),
        });
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty,
            count: None,
        };
        let storage = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: false },
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("upwind"),
            entries: &[
                entry(
                    24,
                    wgpu::BindingType::Texture {
                        sample_type: wgpu::TextureSampleType::Float { filterable: false },
                        view_dimension: wgpu::TextureViewDimension::D3,
                        multisampled: false,
                    },
                ),
                entry(29, storage),
                entry(
                    43,
                    wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Uniform,
                        has_dynamic_offset: true,
                        min_binding_size: None,
                    },
                ),
                entry(44, storage),
            ],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("upwind"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pass = |name: &str, constants: &[(&str, f64)]| {
            gpu.compute_pipeline(name, Some(&pipeline_layout), &module, constants)
        };
        Self {
            direct: pass("upwind_front", &[("EXPLICIT", 0.0)]),
            explicit: pass("upwind_front", &[("EXPLICIT", 1.0)]),
            pack: pass("pack_fronts", &[]),
            layout,
            gpu: gpu.clone(),
        }
    }

    /// Begins to carry a light; `None` for an environment. `steps`: in time, of each front; 0 solves
    /// fronts directly.
    ///
    /// # Errors
    /// Out of memory.
    pub fn begin(
        &self,
        geometry: &LightGeometry,
        cells: &Cells,
        slot: u32,
        steps: u32,
        matter: &Matter,
        transmittances: &wgpu::Buffer,
    ) -> Result<Option<Fronts>, RenderError> {
        let Some(source) = source_of(geometry, cells) else { return Ok(None) };
        let last = DVec3::from_array(cells.dims.map(|n| f64::from(n) - 1.0));
        let (light, start) = match source {
            Source::Afar(direction) => {
                (direction, DVec3::select(direction.cmplt(DVec3::ZERO), last, DVec3::ZERO))
            }
            Source::At(place) => (place, place.floor().clamp(DVec3::ZERO, last)),
        };
        // To the corner of the grid farthest away.
        let count = start.max(last - start).element_sum() as u32 + 1;
        let told = Front {
            cells: cells.dims,
            cell_size: cells.size.as_vec3().to_array(),
            from_place: u32::from(matches!(source, Source::At(_))),
            light: light.as_vec3().to_array(),
            slot,
            start: start.as_uvec3().to_array(),
            ..Front::default()
        };
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniforms = self.gpu.buffer("fronts", UNIFORM_STRIDE * u64::from(count), usage)?;
        let mut bytes = vec![0; UNIFORM_STRIDE as usize * count as usize];
        for (front, place) in bytes.chunks_exact_mut(UNIFORM_STRIDE as usize).enumerate() {
            let told = Front { front: front as u32, ..told };
            place[..std::mem::size_of::<Front>()].copy_from_slice(bytemuck::bytes_of(&told));
        }
        self.gpu.queue.write_buffer(&uniforms, 0, &bytes);
        // New buffers are zero: explicit steps begin in the dark.
        let densities = storage(&self.gpu, "energy densities", 16 * cells.count())?;
        let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("upwind"),
            layout: &self.layout,
            entries: &[
                texture_entry(24, &matter.coefficients),
                buffer_entry(29, transmittances),
                wgpu::BindGroupEntry {
                    binding: 43,
                    resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                        buffer: &uniforms,
                        offset: 0,
                        size: std::num::NonZeroU64::new(std::mem::size_of::<Front>() as u64),
                    }),
                },
                buffer_entry(44, &densities),
            ],
        });
        Ok(Some(Fronts { group, steps, done: 0, count, cells: cells.dims }))
    }

    /// Goes on by some fronts; whether all are done, and how many cells got light.
    pub fn advance(&self, fronts: &mut Fronts) -> (bool, u64) {
        let [x, y, z] = fronts.cells;
        let end = fronts.count.min(fronts.done + FRONTS_PER_SLICE);
        let pipeline = if fronts.steps > 0 { &self.explicit } else { &self.direct };
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            for front in fronts.done..end {
                pass.set_bind_group(0, &fronts.group, &[front * UNIFORM_STRIDE as u32]);
                for _ in 0..fronts.steps.max(1) {
                    pass.dispatch_workgroups(y.div_ceil(GROUP), z.div_ceil(GROUP), 1);
                }
            }
            if end == fronts.count {
                pass.set_pipeline(&self.pack);
                pass.set_bind_group(0, &fronts.group, &[0]);
                pass.dispatch_workgroups(x.div_ceil(GROUP), y.div_ceil(GROUP), z);
            }
        }
        self.gpu.queue.submit([encoder.finish()]);
        fronts.done = end;
        let done = end == fronts.count;
        (done, if done { u64::from(x) * u64::from(y) * u64::from(z) } else { 0 })
    }
}
