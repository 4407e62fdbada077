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
/// Which of a front's steps in time it is; as in the shader.
const FIRST: u32 = 1;
const LAST: u32 = 2;
/// Steps of a front that are told apart: the first, those between, the last.
const STEPS: [u32; 3] = [FIRST, 0, LAST];

/// Pipelines of the scheme.
pub struct Upwind {
    gpu: Arc<Gpu>,
    layout: wgpu::BindGroupLayout,
    direct: wgpu::ComputePipeline,
    explicit: wgpu::ComputePipeline,
}

/// A light on its way, front by front.
pub struct Fronts {
    group: wgpu::BindGroup,
    /// Steps in time of each front; 0: solved directly.
    steps: u32,
    done: u32,
    /// Of each front, where its cells are along y and z.
    spans: Vec<[Span; 2]>,
    cells: u64,
}

/// Cells along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Span {
    begin: u32,
    end: u32,
}

impl Span {
    /// Those no farther than `most` from `start` of `count`, and, where all lie to one side of it, no nearer
    /// than `least`.
    fn around(start: u32, count: u32, least: u32, most: u32) -> Self {
        let (mut begin, mut end) = (start.saturating_sub(most), (start + most + 1).min(count));
        if start == 0 {
            begin = least.min(end);
        } else if start + 1 == count {
            end = count.saturating_sub(least).max(begin);
        }
        Self { begin, end }
    }

    fn groups(self) -> u32 {
        (self.end - self.begin).div_ceil(GROUP)
    }
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
        let reach = start.max(last - start).as_uvec3();
        let count = reach.element_sum() + 1;
        let from = start.as_uvec3();
        let spans: Vec<[Span; 2]> = (0..count)
            .map(|front| {
                // At least this far along y, and along z, for all that x and the other bring.
                let span = |axis: usize, other: usize| {
                    let least = front.saturating_sub(reach.x + reach[other]);
                    Span::around(from[axis], cells.dims[axis], least, front)
                };
                [span(1, 2), span(2, 1)]
            })
            .collect();
        let told = Front {
            cells: cells.dims,
            cell_size: cells.size.as_vec3().to_array(),
            from_place: u32::from(matches!(source, Source::At(_))),
            light: light.as_vec3().to_array(),
            slot,
            start: from.to_array(),
            ..Front::default()
        };
        let told = spans.iter().enumerate().flat_map(|(front, [y, z])| {
            let of_front = Front { front: front as u32, origin: [y.begin, z.begin], ..told };
            let step = move |step| Front { step: if steps > 1 { step } else { FIRST | LAST }, ..of_front };
            STEPS.map(step)
        });
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let told: Vec<Front> = told.collect();
        let mut bytes = vec![0; UNIFORM_STRIDE as usize * told.len()];
        let uniforms = self.gpu.buffer("fronts", bytes.len() as u64, usage)?;
        for (place, told) in bytes.chunks_exact_mut(UNIFORM_STRIDE as usize).zip(&told) {
            place[..std::mem::size_of::<Front>()].copy_from_slice(bytemuck::bytes_of(told));
        }
        self.gpu.queue.write_buffer(&uniforms, 0, &bytes);
        // Two fronts of two sides, two floats each.
        let across = u64::from(cells.dims[1]) * u64::from(cells.dims[2]);
        let densities = storage(&self.gpu, "energy densities", 2 * 2 * 8 * across)?;
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
        Ok(Some(Fronts { group, steps, done: 0, spans, cells: cells.count() }))
    }

    /// Goes on by some fronts; whether all are done, and how many cells got light.
    pub fn advance(&self, fronts: &mut Fronts) -> (bool, u64) {
        let count = fronts.spans.len() as u32;
        let end = count.min(fronts.done + FRONTS_PER_SLICE);
        let pipeline = if fronts.steps > 0 { &self.explicit } else { &self.direct };
        let last = fronts.steps.max(1) - 1;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            for front in fronts.done..end {
                let [y, z] = fronts.spans[front as usize];
                for step in 0..=last {
                    let which = if step == 0 { 0 } else { 1 + u32::from(step == last) };
                    let told = STEPS.len() as u32 * front + which;
                    pass.set_bind_group(0, &fronts.group, &[told * UNIFORM_STRIDE as u32]);
                    pass.dispatch_workgroups(y.groups(), z.groups(), 1);
                }
            }
        }
        self.gpu.queue.submit([encoder.finish()]);
        fronts.done = end;
        let done = end == count;
        (done, if done { fronts.cells } else { 0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No cell of a front lies outside of its span.
    #[test]
    fn spans_hold_their_fronts() {
        for (dims, start) in [([5u32, 7, 4], [0u32, 6, 0]), ([5, 7, 4], [2, 3, 1]), ([1, 9, 3], [0, 0, 2])] {
            let reach: [u32; 3] = std::array::from_fn(|axis| start[axis].max(dims[axis] - 1 - start[axis]));
            for index in 0..dims.iter().product::<u32>() {
                let cell = [index % dims[0], index / dims[0] % dims[1], index / dims[0] / dims[1]];
                let away: [u32; 3] = std::array::from_fn(|axis| cell[axis].abs_diff(start[axis]));
                let front: u32 = away.iter().sum();
                for (axis, other) in [(1, 2), (2, 1)] {
                    let least = front.saturating_sub(reach[0] + reach[other]);
                    let span = Span::around(start[axis], dims[axis], least, front);
                    assert!((span.begin..span.end).contains(&cell[axis]), "{cell:?} {span:?}");
                }
            }
        }
    }
}
