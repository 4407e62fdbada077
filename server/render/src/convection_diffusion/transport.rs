//! Light from each source to each cell: matter in the light grid's cells, and transmittances through
//! it along characteristics.

use std::sync::Arc;

use proto::scene_file::Filter;
use scene::{Scene, Snapshot};

use super::sweep::Cells;
use crate::error::RenderError;
use crate::frame::frame_uniform;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::shaders;
use crate::uniforms::{LightGrid, Sweep};
use crate::view::{FilmCache, TransferFunctionTables};
use crate::volume_texture::VolumeTexture;

/// Invocations of a workgroup that goes over cells.
pub const CELL_GROUP: u32 = 64;
/// Workgroups in a row of a dispatch over cells; core WebGPU allows 65,535.
pub const GROUP_ROW: u32 = 1 << 15;
/// Edge of a workgroup over characteristics.
const LINE_GROUP: u32 = 8;
/// Planes of characteristics held at once at most, bytes.
const MAX_LINE_BYTES: u64 = 32 << 20;
/// Planes marched in one dispatch at most.
const MAX_PLANES: u32 = 32;
/// Bytes of a characteristic's state at one plane.
const LINE_BYTES: u64 = 8;
/// Points along an axis of a cell at which matter is looked at, at least and at most.
const POINTS: [u32; 2] = [2, 16];

/// Workgroups along x and y for `count` cells, as `index_in_dispatch` (grid.wgsl) unfolds them.
pub fn groups_of(count: u32) -> [u32; 2] {
    let groups = count.div_ceil(CELL_GROUP);
    [groups.min(GROUP_ROW), groups.div_ceil(GROUP_ROW)]
}

/// What dispatches over cells are told.
pub fn light_grid(cells: &Cells, first: u32, count: u32) -> LightGrid {
    LightGrid {
        cells: cells.dims,
        first,
        cell_size: cells.size.as_vec3().to_array(),
        count,
        row: GROUP_ROW.min(count.div_ceil(CELL_GROUP)),
        ..LightGrid::default()
    }
}

/// A compute pipeline whose layout is what its module binds.
pub fn pipeline(
    gpu: &Gpu,
    label: &str,
    source: &'static str,
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    gpu.compute_pipeline(label, None, &module, constants)
}

/// Binds `entries` as a pipeline's only group.
pub fn bind(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    entries: &[wgpu::BindGroupEntry<'_>],
) -> wgpu::BindGroup {
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries,
    })
}

/// A uniform buffer with a value.
pub fn uniform<T: bytemuck::Pod>(gpu: &Gpu, label: &str, value: &T) -> Result<wgpu::Buffer, RenderError> {
    let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
    let buffer = gpu.buffer(label, std::mem::size_of::<T>() as u64, usage)?;
    gpu.queue.write_buffer(&buffer, 0, bytemuck::bytes_of(value));
    Ok(buffer)
}

/// A storage buffer.
pub fn storage(gpu: &Gpu, label: &str, bytes: u64) -> Result<wgpu::Buffer, RenderError> {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    gpu.buffer(label, bytes, usage)
}

/// A 3D texture that passes write and others read.
pub fn texture_3d(
    gpu: &Gpu,
    label: &str,
    [width, height, depth]: [u32; 3],
    format: wgpu::TextureFormat,
) -> Result<wgpu::Texture, RenderError> {
    let texels = u64::from(width) * u64::from(height) * u64::from(depth);
    let bytes = texels * u64::from(format.block_copy_size(None).unwrap_or(1));
    let create = || {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: depth },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format,
            usage: wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    };
    gpu.allocating(label, bytes, create)
}

/// The view of a whole texture.
pub fn whole(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Matter in the cells of a light grid.
pub struct Matter {
    /// Absorption RGB and extinction of each cell, per world unit.
    pub coefficients: wgpu::TextureView,
    /// Mean cosine of scattering of each cell.
    pub cosines: wgpu::Buffer,
}

impl Matter {
    /// Room for the cells of a grid.
    pub fn new(gpu: &Gpu, cells: &Cells) -> Result<Self, RenderError> {
        let format = wgpu::TextureFormat::Rgba16Float;
        let texture = texture_3d(gpu, "matter in the light grid", cells.dims, format)?;
        let cosines = storage(gpu, "mean cosines in the light grid", 4 * cells.count())?;
        Ok(Self { coefficients: whole(&texture), cosines })
    }

    /// Bytes on the GPU.
    pub fn bytes(cells: &Cells) -> u64 {
        12 * cells.count()
    }
}

/// Pipelines of the passes here.
pub struct Transport {
    gpu: Arc<Gpu>,
    coefficients: [wgpu::ComputePipeline; 2],
    march: wgpu::ComputePipeline,
    gather: wgpu::ComputePipeline,
    linear: wgpu::Sampler,
    nearest: wgpu::Sampler,
}

impl Transport {
    /// Compiles them.
    pub fn new(gpu: Arc<Gpu>) -> Self {
        let coefficients =
            |filter| pipeline(&gpu, "light_coefficients", shaders::LIGHT_COEFFICIENTS, &[("FILTER", filter)]);
        Self {
            coefficients: [coefficients(1.0), coefficients(2.0)],
            march: pipeline(&gpu, "march_lines", shaders::MARCH_LINES, &[]),
            gather: pipeline(&gpu, "gather_lines", shaders::GATHER_LINES, &[]),
            linear: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            }),
            nearest: gpu.device.create_sampler(&wgpu::SamplerDescriptor::default()),
            gpu,
        }
    }

    /// Points along each axis of a cell at which matter is looked at: one for each voxel.
    pub fn points(&self, cells: &Cells, scene: &Scene) -> [u32; 3] {
        std::array::from_fn(|axis| {
            let voxels = scene.grid.dims[axis] as f64 / f64::from(cells.dims[axis]);
            (voxels.ceil() as u32).clamp(POINTS[0], POINTS[1])
        })
    }

    /// Computes matter in `count` cells from `first` on.
    ///
    /// # Errors
    /// Out of memory.
    pub fn fill(
        &self,
        matter: &Matter,
        cells: &Cells,
        [first, count]: [u32; 2],
        snapshot: &Arc<Snapshot>,
        volume: &VolumeTexture,
        tables: &TransferFunctionTables,
    ) -> Result<(), RenderError> {
        let scene = &snapshot.scene;
        let film = FilmCache {
            snapshot: snapshot.clone(),
            width: 1,
            height: 1,
            samples: 0,
            rows: 0,
            in_segments: false,
            light_version: 0,
        };
        let frame = uniform(&self.gpu, "frame", &frame_uniform(scene, volume, &film))?;
        let grid = LightGrid {
            points: self.points(cells, scene),
            clip_shadows: u32::from(scene.clip.shadows),
            ..light_grid(cells, first, count)
        };
        let grid = uniform(&self.gpu, "light grid", &grid)?;
        let nearest = scene.filter == Filter::Nearest;
        let pipeline = &self.coefficients[usize::from(nearest)];
        let group = bind(
            &self.gpu,
            pipeline,
            &[
                buffer_entry(0, &frame),
                texture_entry(1, &tables.points),
                texture_entry(2, &tables.cells),
                buffer_entry(3, &tables.materials),
                texture_entry(7, &volume.view),
                wgpu::BindGroupEntry { binding: 8, resource: wgpu::BindingResource::Sampler(&self.nearest) },
                buffer_entry(20, &grid),
                texture_entry(21, &matter.coefficients),
                buffer_entry(22, &matter.cosines),
            ],
        );
        self.gpu.dispatch(pipeline, &group, groups_of(count));
        Ok(())
    }

    /// Begins a sweep: room for its characteristics. Cells before plane `gather_from` keep the light
    /// they have.
    ///
    /// # Errors
    /// Out of memory.
    pub fn begin(&self, sweep: Sweep, gather_from: u32) -> Result<Lines, RenderError> {
        let [width, height] = sweep.lines;
        let lines = u64::from(width) * u64::from(height);
        let held = (MAX_LINE_BYTES / (LINE_BYTES * lines)).clamp(1, u64::from(MAX_PLANES)) as u32;
        let held = held.min(sweep.plane_count);
        let format = wgpu::TextureFormat::Rg32Float;
        let texture = texture_3d(&self.gpu, "characteristics", [width, height, held], format)?;
        let depths = storage(&self.gpu, "depths of characteristics", 4 * lines)?;
        Ok(Lines { sweep, gather_from, held, done: 0, view: whole(&texture), depths })
    }

    /// Goes on with a sweep by as many planes as are held at once; whether it is done, and how many
    /// cells were looked at.
    ///
    /// # Errors
    /// Out of memory.
    pub fn advance(
        &self,
        lines: &mut Lines,
        matter: &Matter,
        transmittances: &wgpu::Buffer,
    ) -> Result<(bool, u64), RenderError> {
        let planes = lines.held.min(lines.sweep.plane_count - lines.done);
        let sweep =
            Sweep { first_plane: lines.sweep.start_plane + lines.done, plane_count: planes, ..lines.sweep };
        let told = uniform(&self.gpu, "sweep", &sweep)?;
        let march = bind(
            &self.gpu,
            &self.march,
            &[
                buffer_entry(23, &told),
                texture_entry(24, &matter.coefficients),
                wgpu::BindGroupEntry { binding: 25, resource: wgpu::BindingResource::Sampler(&self.linear) },
                buffer_entry(26, &lines.depths),
                texture_entry(27, &lines.view),
            ],
        );
        let gather = bind(
            &self.gpu,
            &self.gather,
            &[
                buffer_entry(23, &told),
                texture_entry(24, &matter.coefficients),
                wgpu::BindGroupEntry { binding: 25, resource: wgpu::BindingResource::Sampler(&self.linear) },
                texture_entry(28, &lines.view),
                buffer_entry(29, transmittances),
            ],
        );
        let gathers = sweep.first_plane + planes > lines.gather_from;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            let groups = |n: u32| n.div_ceil(LINE_GROUP);
            pass.set_pipeline(&self.march);
            pass.set_bind_group(0, &march, &[]);
            pass.dispatch_workgroups(groups(sweep.lines[0]), groups(sweep.lines[1]), 1);
            if gathers {
                pass.set_pipeline(&self.gather);
                pass.set_bind_group(0, &gather, &[]);
                pass.dispatch_workgroups(groups(sweep.cells[1]), groups(sweep.cells[2]), planes);
            }
        }
        self.gpu.queue.submit([encoder.finish()]);
        lines.done += planes;
        let cells = u64::from(planes) * u64::from(sweep.cells[1]) * u64::from(sweep.cells[2]);
        Ok((lines.done >= lines.sweep.plane_count, if gathers { cells } else { 0 }))
    }
}

/// A sweep under way.
pub struct Lines {
    sweep: Sweep,
    /// First plane whose cells are to get light.
    gather_from: u32,
    /// Planes held at once.
    held: u32,
    /// Planes that are done.
    done: u32,
    view: wgpu::TextureView,
    depths: wgpu::Buffer,
}
