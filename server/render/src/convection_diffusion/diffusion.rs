//! Diffusion on the light grid: conjugate gradients, preconditioned by one multigrid cycle
//! (shaders/convection_diffusion/level.wgsl and the passes beside it).

use std::sync::Arc;

use glam::DVec3;

use super::sweep::Cells;
use super::transport::{GROUP_ROW, groups_of, storage, uniform};
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry};
use crate::shaders;
use crate::uniforms::Level;

/// Bytes of a cell in one buffer: four floats.
const CELL_BYTES: u64 = 16;
/// Sums before the partial ones; as in conjugate.wgsl.
const SUMS: u64 = 8;
/// Cells that one invocation adds up; as in conjugate.wgsl.
const SHARE: u32 = 64;
/// Places of sums in conjugate.wgsl.
const P_AP: usize = 1;
const RR: usize = 2;
const RZ: usize = 3;
const BB: usize = 4;
/// An axis is coarsened where its cells are no more than this many times as long as the shortest:
/// coupling along longer ones is too weak for the smoother's errors to spread along them.
const ALIKE: f64 = 1.6;

/// Pipelines of the solver.
pub struct Diffusion {
    gpu: Arc<Gpu>,
    layout: wgpu::BindGroupLayout,
    first_red: wgpu::ComputePipeline,
    black: wgpu::ComputePipeline,
    red: wgpu::ComputePipeline,
    restrict: wgpu::ComputePipeline,
    prolong: wgpu::ComputePipeline,
    coarsen: wgpu::ComputePipeline,
    begin: wgpu::ComputePipeline,
    apply: wgpu::ComputePipeline,
    step: wgpu::ComputePipeline,
    correlate: wgpu::ComputePipeline,
    measure: wgpu::ComputePipeline,
    turn: wgpu::ComputePipeline,
    sums: [wgpu::ComputePipeline; 5],
}

/// The grids of one field: what is known of them stays between solutions, so that the next one begins
/// at the last.
pub struct Grids {
    levels: Vec<Level>,
    groups: Vec<wgpu::BindGroup>,
    /// D, per level.
    pub flows: wgpu::Buffer,
    /// E, per level.
    pub losses: wgpu::Buffer,
    /// b, then what is left of it.
    pub residuals: wgpu::Buffer,
    /// x of the finest level.
    pub solution: wgpu::Buffer,
    sums: wgpu::Buffer,
    bytes: u64,
}

/// Squared norms, by channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Norms {
    /// Of what is left.
    residual: [f32; 3],
    /// Of the right-hand side.
    source: [f32; 3],
}

impl Norms {
    /// Norm of the residual as a share of the right-hand side's, the largest of the channels.
    pub fn relative(&self) -> f32 {
        let largest = self.source.iter().fold(0.0f32, |a, &b| a.max(b));
        let share = |(&rest, &source): (&f32, &f32)| {
            let source = source.max(1e-10 * largest);
            if source > 0.0 { (rest / source).sqrt() } else { 0.0 }
        };
        self.residual.iter().zip(&self.source).map(share).fold(0.0, f32::max)
    }

    /// Whether a channel that has no source has something left: the beginning was not good.
    pub fn is_haunted(&self) -> bool {
        self.residual.iter().zip(&self.source).any(|(&rest, &source)| source == 0.0 && rest > 0.0)
    }
}

/// The finest level and coarser ones, down to a single cell.
pub fn levels(cells: &Cells) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::new();
    let (mut dims, mut size, mut offset) = (cells.dims, cells.size, 0);
    loop {
        let count: u32 = dims.iter().product();
        let mut level = Level {
            cells: dims,
            offset,
            weights: (DVec3::ONE / (size * size)).as_vec3().to_array(),
            count,
            coarse_cells: dims,
            factors: [1; 3],
            ..Level::default()
        };
        let shortest = (0..3).filter(|&i| dims[i] > 1).map(|i| size[i]).fold(f64::INFINITY, f64::min);
        for i in 0..3 {
            if dims[i] > 1 && size[i] <= ALIKE * shortest {
                level.factors[i] = 2;
                level.coarse_cells[i] = dims[i].div_ceil(2);
                size[i] *= 2.0;
            }
        }
        offset += count;
        dims = level.coarse_cells;
        level.coarse_offset = offset;
        level.coarse_count = dims.iter().product();
        levels.push(level);
        if count == 1 {
            return levels;
        }
    }
}

/// Bytes of the grids of a field.
pub fn bytes_of(cells: &Cells) -> u64 {
    let all: u64 = levels(cells).iter().map(|level| u64::from(level.count)).sum();
    CELL_BYTES * (4 * all + 3 * cells.count() + SUMS + cells.count().div_ceil(u64::from(SHARE)))
}

/// Bytes of the largest buffer of the grids of a field.
pub fn largest_buffer(cells: &Cells) -> u64 {
    CELL_BYTES * levels(cells).iter().map(|level| u64::from(level.count)).sum::<u64>()
}

impl Diffusion {
    /// Compiles the passes.
    pub fn new(gpu: Arc<Gpu>) -> Self {
        let device = &gpu.device;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("diffuse"),
            source: wgpu::ShaderSource::Wgsl(shaders::DIFFUSE.into()),
        });
        let entry = |binding: u32| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match binding {
                    30 => wgpu::BufferBindingType::Uniform,
                    _ => wgpu::BufferBindingType::Storage { read_only: false },
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("diffuse"),
            entries: &(30..=38).map(entry).collect::<Vec<_>>(),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("diffuse"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pass = |name: &str, constants: &[(&str, f64)]| {
            gpu.compute_pipeline(name, Some(&pipeline_layout), &module, constants)
        };
        Self {
            first_red: pass("smooth_level", &[("COLOUR", 0.0), ("FROM_NOTHING", 1.0)]),
            black: pass("smooth_level", &[("COLOUR", 1.0)]),
            red: pass("smooth_level", &[("COLOUR", 0.0)]),
            restrict: pass("restrict_residual", &[]),
            prolong: pass("prolong_correction", &[]),
            coarsen: pass("coarsen_level", &[]),
            begin: pass("begin_solve", &[]),
            apply: pass("apply_operator", &[]),
            step: pass("step_on", &[]),
            correlate: pass("correlate", &[("WITH_ITSELF", 0.0)]),
            measure: pass("correlate", &[("WITH_ITSELF", 1.0)]),
            turn: pass("turn", &[]),
            sums: std::array::from_fn(|sum| pass("sum_up", &[("SUM", sum as f64)])),
            layout,
            gpu: gpu.clone(),
        }
    }

    /// Room for the grids of a field; nothing is known of it yet.
    ///
    /// # Errors
    /// Out of memory.
    pub fn grids(&self, cells: &Cells) -> Result<Grids, RenderError> {
        let gpu = &self.gpu;
        let levels = levels(cells);
        let all = largest_buffer(cells);
        let finest = CELL_BYTES * cells.count();
        let flows = storage(gpu, "diffusion coefficients", all)?;
        let losses = storage(gpu, "losses", all)?;
        let corrections = storage(gpu, "corrections", all)?;
        let residuals = storage(gpu, "residuals", all)?;
        let solution = storage(gpu, "diffused light", finest)?;
        let directions = storage(gpu, "search directions", finest)?;
        let images = storage(gpu, "images of directions", finest)?;
        let sums = storage(gpu, "sums", CELL_BYTES * (SUMS + cells.count().div_ceil(u64::from(SHARE))))?;
        let bind = |level: &Level| {
            let told = uniform(gpu, "level", level)?;
            let buffers =
                [&told, &flows, &losses, &corrections, &residuals, &solution, &directions, &images, &sums];
            let entries: Vec<_> = (30..).zip(buffers).map(|(i, buffer)| buffer_entry(i, buffer)).collect();
            Ok::<_, RenderError>(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("diffuse"),
                layout: &self.layout,
                entries: &entries,
            }))
        };
        let groups = levels.iter().map(bind).collect::<Result<Vec<_>, _>>()?;
        Ok(Grids { groups, levels, flows, losses, residuals, solution, sums, bytes: bytes_of(cells) })
    }

    fn encode(&self, record: impl FnOnce(&mut wgpu::ComputePass<'_>)) {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// D and E of the coarser levels, once those of the finest are written.
    pub fn coarsen(&self, grids: &Grids) {
        self.encode(|pass| {
            for i in 0..grids.levels.len() - 1 {
                run(pass, &self.coarsen, grids, i, grids.levels[i].coarse_count);
            }
        });
    }

    /// Begins to solve for the right-hand side in `residuals`, at the solution as it stands.
    ///
    /// # Errors
    /// The device's.
    pub fn begin(&self, grids: &Grids) -> Result<Norms, RenderError> {
        let shares = grids.levels[0].count.div_ceil(SHARE);
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        // No direction was taken before.
        encoder.clear_buffer(&grids.sums, 0, Some(SUMS * CELL_BYTES));
        self.gpu.queue.submit([encoder.finish()]);
        self.encode(|pass| {
            run(pass, &self.begin, grids, 0, shares);
            run(pass, &self.sums[BB], grids, 0, 1);
            run(pass, &self.measure, grids, 0, shares);
            run(pass, &self.sums[RR], grids, 0, 1);
        });
        self.norms(grids)
    }

    /// One iteration.
    ///
    /// # Errors
    /// The device's.
    pub fn iterate(&self, grids: &Grids) -> Result<Norms, RenderError> {
        let count = grids.levels[0].count;
        let shares = count.div_ceil(SHARE);
        self.encode(|pass| {
            self.cycle(pass, grids);
            run(pass, &self.correlate, grids, 0, shares);
            run(pass, &self.sums[RZ], grids, 0, 1);
            run(pass, &self.turn, grids, 0, count);
            run(pass, &self.apply, grids, 0, shares);
            run(pass, &self.sums[P_AP], grids, 0, 1);
            run(pass, &self.step, grids, 0, shares);
            run(pass, &self.sums[RR], grids, 0, 1);
        });
        self.norms(grids)
    }

    /// One V-cycle from the residuals to corrections. Symmetric, as the conjugate gradients want it:
    /// red before black on the way down, black before red on the way up.
    fn cycle(&self, pass: &mut wgpu::ComputePass<'_>, grids: &Grids) {
        let last = grids.levels.len() - 1;
        let half = |i: usize| {
            let [x, y, z] = grids.levels[i].cells;
            x.div_ceil(2) * y * z
        };
        for i in 0..last {
            run(pass, &self.first_red, grids, i, half(i));
            run(pass, &self.black, grids, i, half(i));
            run(pass, &self.restrict, grids, i, grids.levels[i].coarse_count);
        }
        run(pass, &self.first_red, grids, last, half(last));
        for i in (0..last).rev() {
            run(pass, &self.prolong, grids, i, grids.levels[i].count);
            run(pass, &self.black, grids, i, half(i));
            run(pass, &self.red, grids, i, half(i));
        }
    }

    fn norms(&self, grids: &Grids) -> Result<Norms, RenderError> {
        let bytes = self.gpu.read_buffer(&grids.sums, SUMS * CELL_BYTES)?;
        let sums: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        let channels = |i: usize| [sums[i][0], sums[i][1], sums[i][2]];
        Ok(Norms { residual: channels(RR), source: channels(BB) })
    }
}

impl Grids {
    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

fn run(
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &wgpu::ComputePipeline,
    grids: &Grids,
    level: usize,
    count: u32,
) {
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &grids.groups[level], &[]);
    let [mut columns, rows] = groups_of(count);
    if rows > 1 {
        columns = GROUP_ROW;
    }
    pass.dispatch_workgroups(columns, rows, 1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_end_in_one_cell_and_keep_cells_alike() {
        for (dims, size) in [([128, 128, 128], 1.0), ([7, 33, 1], 0.3), ([1, 1, 1], 1.0), ([64, 64, 5], 6.0)]
        {
            let cells = Cells { dims, size: DVec3::new(1.0, 1.0, size) };
            let levels = levels(&cells);
            assert_eq!(levels.last().unwrap().cells, [1; 3]);
            assert_eq!(levels[0].cells, dims);
            for pair in levels.windows(2) {
                assert_eq!(pair[0].coarse_cells, pair[1].cells);
                assert_eq!(pair[0].offset + pair[0].count, pair[1].offset);
                assert!(pair[1].count < pair[0].count);
            }
        }
    }
}
