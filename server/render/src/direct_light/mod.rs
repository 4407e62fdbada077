//! How much of each light reaches places in the volume, looked up by marching the extinction: for light
//! fields that keep what lights bring by themselves apart (shaders/direct_light/README.md).

mod parts;
mod passes;
mod stale;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use proto::scene_file::Filter;
use scene::distance::distance_map;
use scene::light::{Light, LightGeometry};
use scene::{Scene, Snapshot};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::illumination::Inputs;
use crate::light_field::{self, Direct};
use crate::tables;
use crate::uniforms::{DirectRun, FrameUniform};
pub(crate) use parts::in_parts;
pub(crate) use passes::Passes;
use passes::{Bound, COUNTER_BYTES, COUNTERS};
use stale::{Todo, todo};
pub(crate) use stale::{changed_bins, kept_region};

/// Lights of a slab.
pub(crate) const LIGHTS_A_SLAB: usize = 4;
/// Nodes that are looked up, and known to be up to date, together.
const RUN_NODES: u32 = 65_536;
const RUN_NODES_SOFTWARE: u32 = 4096;
/// Places on a light with an extent.
const RAYS_OF_EXTENT: u32 = 8;
/// Cells along the edge of a voxel, at most.
const CELLS_A_VOXEL: f64 = 2.0;
/// How far matter is looked at beside a place, cells between nodes.
const NEAR_CELLS: f64 = 2.0;
/// Parts of that way: one of these, so that there are few variants of the ray caster.
const NEAR_PARTS: [u32; 7] = [4, 6, 8, 12, 16, 24, MOST_NEAR_PARTS];
const MOST_NEAR_PARTS: u32 = 32;

/// What nodes are laid out for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Layout {
    volume: [u8; 32],
    size_world: [f64; 3],
    nearest: bool,
    /// Cells between nodes.
    cells: [u32; 3],
    /// Slabs of [`LIGHTS_A_SLAB`] lights.
    slabs: u32,
}

impl Layout {
    fn of(scene: &Scene) -> Self {
        Self {
            volume: scene.volume.content,
            size_world: scene.grid.size_world.to_array(),
            nearest: scene.filter == Filter::Nearest,
            cells: cells_of(scene),
            slabs: (tables::by_slot(scene).len().max(1)).div_ceil(LIGHTS_A_SLAB) as u32,
        }
    }

    fn nodes(&self) -> u32 {
        self.cells.iter().map(|n| n + 1).product()
    }
}

/// Cells between nodes: about cubic, and none smaller than half a voxel.
fn cells_of(scene: &Scene) -> [u32; 3] {
    let size = scene.grid.size_world;
    let edge = size.max_element() / f64::from(scene.illumination.direct_grid);
    [0, 1, 2].map(|axis| {
        let finest = CELLS_A_VOXEL * scene.grid.dims[axis] as f64;
        (size[axis] / edge).round().min(finest).max(1.0) as u32
    })
}

/// Nodes of one session.
pub(crate) struct DirectLight {
    passes: Arc<Passes>,
    kept: Option<Kept>,
}

struct Kept {
    layout: Layout,
    /// Of each light, of each run of nodes: the scene it was looked up for.
    runs: Vec<Vec<Option<Arc<Snapshot>>>>,
    shares: wgpu::Buffer,
    view: wgpu::TextureView,
    frame: wgpu::Buffer,
    run: wgpu::Buffer,
    counters: wgpu::Buffer,
}

/// How far the nodes have got: in runs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Arrived {
    pub done: u64,
    pub all: u64,
    /// Whether a node is not what it was before.
    pub changed: bool,
}

impl DirectLight {
    pub fn new(passes: Arc<Passes>) -> Self {
        Self { passes, kept: None }
    }

    /// Bytes on the GPU: sums in f32, and the texture of half floats.
    pub fn bytes(&self) -> u64 {
        let per_node = |slabs: u32| 24 * u64::from(slabs);
        self.kept.as_ref().map_or(0, |kept| u64::from(kept.layout.nodes()) * per_node(kept.layout.slabs))
    }

    /// Shares of the first four lights at each node, x fastest; nothing of places for lights that are none.
    #[cfg(test)]
    pub fn contents(&self, gpu: &Gpu) -> Result<Vec<[f32; 4]>, RenderError> {
        let Some(kept) = &self.kept else { return Ok(Vec::new()) };
        let bytes = gpu.read_buffer(&kept.shares, 16 * u64::from(kept.layout.nodes()))?;
        let mut shares: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        let lights = kept.runs.len().min(LIGHTS_A_SLAB);
        shares.iter_mut().for_each(|of_lights| of_lights[lights..].fill(0.0));
        Ok(shares)
    }

    /// Brings nodes to the snapshot until the deadline, at least one run.
    ///
    /// # Errors
    /// Out of memory; too many nodes for the device.
    pub fn advance(
        &mut self,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<Arrived, RenderError> {
        let scene = &inputs.snapshot.scene;
        let layout = Layout::of(scene);
        if self.kept.as_ref().is_none_or(|kept| kept.layout != layout) {
            self.kept = None;
            self.kept = Some(Kept::new(inputs.gpu, layout)?);
        }
        let Some(kept) = &mut self.kept else {
            return Err(RenderError::Gpu("nodes of direct light are missing".into()));
        };
        kept.advance(&self.passes, inputs, deadline, counters)
    }

    /// As view rays of the scene look it up.
    pub fn look_up(&self, scene: &Scene) -> Option<Direct> {
        let kept = self.kept.as_ref()?;
        let (grid, cells) = (&scene.grid, kept.layout.cells);
        let cell = (0..3).map(|axis| grid.size_world[axis] / f64::from(cells[axis]));
        let voxel = (0..3).map(|axis| grid.size_world[axis] / grid.dims[axis] as f64);
        let near = NEAR_CELLS * cell.fold(0.0, f64::max);
        let voxels = near / voxel.fold(f64::INFINITY, f64::min);
        let parts = match scene.filter {
            // A way of n voxels crosses at most sqrt(3) n borders, and three more.
            Filter::Nearest => (1.74 * voxels).ceil() + 3.0,
            Filter::Linear => 2.0 * voxels,
        };
        let enough = |n: &u32| f64::from(*n) >= parts;
        Some(Direct {
            view: kept.view.clone(),
            cells,
            nodes: cells.map(|n| n + 1),
            near: near as f32,
            near_parts: NEAR_PARTS.into_iter().find(enough).unwrap_or(MOST_NEAR_PARTS),
            clipped_matter_blocks: scene.clip.shadows,
        })
    }
}

impl Kept {
    fn new(gpu: &Gpu, layout: Layout) -> Result<Self, RenderError> {
        let bytes = 16 * u64::from(layout.nodes()) * u64::from(layout.slabs);
        let size = wgpu::Extent3d {
            width: layout.cells[0] + 1,
            height: layout.cells[1] + 1,
            depth_or_array_layers: (layout.cells[2] + 1) * layout.slabs,
        };
        if bytes > gpu.max_binding_bytes() || size.depth_or_array_layers > gpu.max_texture_edge_3d() {
            return Err(RenderError::TooLarge {
                what: format!("direct light of {} lights on {:?} cells", layout.slabs * 4, layout.cells),
                limit: format!(
                    "{} bytes a buffer, {} texels along an axis",
                    gpu.max_binding_bytes(),
                    gpu.max_texture_edge_3d()
                ),
            });
        }
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let texture = light_field::texture(gpu, size)?;
        Ok(Self {
            layout,
            runs: Vec::new(),
            shares: gpu.buffer("direct light", bytes, storage)?,
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            frame: gpu.buffer("frame", std::mem::size_of::<FrameUniform>() as u64, uniform)?,
            run: gpu.buffer("run of nodes", std::mem::size_of::<DirectRun>() as u64, storage)?,
            counters: gpu.buffer("counters of nodes", COUNTER_BYTES, storage)?,
        })
    }

    fn advance(
        &mut self,
        passes: &Passes,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<Arrived, RenderError> {
        let (gpu, snapshot, scene) = (inputs.gpu, inputs.snapshot, &inputs.snapshot.scene);
        let run_nodes = if gpu.info().software { RUN_NODES_SOFTWARE } else { RUN_NODES };
        let nodes = self.layout.nodes();
        let lights = tables::by_slot(scene);
        self.runs.resize(lights.len(), vec![None; nodes.div_ceil(run_nodes) as usize]);
        let missing = || RenderError::Gpu("the distance map of the view is missing".into());
        let distance_map = inputs.distance_map.ok_or_else(missing)?;
        let mut arrived = Arrived {
            done: 0,
            all: (lights.len() * self.runs.first().map_or(0, Vec::len)) as u64,
            changed: false,
        };
        gpu.queue.write_buffer(&self.counters, 0, &[0; COUNTER_BYTES as usize]);
        let mut frame = crate::frame::scene_uniform(scene, inputs.texture);
        if scene.clip.shadows {
            // What is clipped stands in the way of light all the same.
            let half = 0.5 * scene.grid.size_world;
            (frame.clip_low, frame.clip_high) = (tables::vector(-half), tables::vector(half));
            frame.plane_count = 0;
        }
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        // Of the last bins that were tested.
        let mut changed_map: Option<(u64, wgpu::TextureView)> = None;
        let mut is_late = false;
        for (slot, light) in lights.into_iter().enumerate() {
            for index in 0..self.runs[slot].len() {
                let base = &mut self.runs[slot][index];
                let what = match base {
                    None => Todo::Cast,
                    Some(base) if Arc::ptr_eq(base, snapshot) => Todo::Keep,
                    Some(base) => todo(&base.scene, scene, tables::by_slot(&base.scene).get(slot), &light),
                };
                if what == Todo::Keep {
                    *base = Some(snapshot.clone());
                    arrived.done += 1;
                    continue;
                }
                if is_late {
                    continue;
                }
                if let Todo::Test(bins) = what
                    && changed_map.as_ref().is_none_or(|(of, _)| *of != bins)
                {
                    changed_map = Some((bins, map_of(gpu, scene, bins)?));
                }
                let first = index as u32 * run_nodes;
                let count = run_nodes.min(nodes - first);
                let run = DirectRun {
                    nodes: self.layout.cells.map(|n| n + 1),
                    slot: slot as u32,
                    first,
                    count,
                    tests: u32::from(what != Todo::Cast),
                    ..run_of(&light)
                };
                gpu.queue.write_buffer(&self.run, 0, bytemuck::bytes_of(&run));
                let bound = Bound {
                    frame: &self.frame,
                    run: &self.run,
                    shares: &self.shares,
                    counters: &self.counters,
                    field: &self.view,
                    distance_map,
                    changed_map: changed_map.as_ref().map_or(distance_map, |(_, map)| map),
                };
                passes.march(inputs, scene, &bound, count);
                gpu.wait()?;
                *base = Some(snapshot.clone());
                arrived.done += 1;
                arrived.changed = true;
                is_late = deadline.is_some_and(|deadline| Instant::now() >= deadline);
            }
        }
        if arrived.changed {
            let bytes = gpu.read_buffer(&self.counters, COUNTER_BYTES)?;
            crate::renderer::name_counters(&COUNTERS, &bytes, counters);
        }
        Ok(arrived)
    }
}

/// Distances to macrocells with one of the bins.
pub(crate) fn map_of(gpu: &Gpu, scene: &Scene, bins: u64) -> Result<wgpu::TextureView, RenderError> {
    let cells = &scene.volume.macrocells;
    let bytes = distance_map(cells.dims, cells.masks(scene.filter), bins);
    let [width, height, depth] = cells.dims.map(|n| n as u32);
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
    let (dimension, format) = (wgpu::TextureDimension::D3, wgpu::TextureFormat::R8Uint);
    gpu.filled_texture("map of changes for nodes", size, dimension, format, &bytes)
}

/// What the shader knows of a light.
fn run_of(light: &Light) -> DirectRun {
    let source = tables::source(light, light.power);
    let mut run = DirectRun {
        rays: 1,
        position: source.position,
        kind: source.kind,
        direction: source.direction,
        extent: source.extent,
        half_u: source.half_u,
        half_v: source.half_v,
        ..DirectRun::default()
    };
    match &light.geometry {
        LightGeometry::Disk { normal, radius, .. } => {
            let u = normal.any_orthonormal_vector();
            run.half_u = tables::vector(u * *radius);
            run.half_v = tables::vector(normal.cross(u) * *radius);
            run.rays = RAYS_OF_EXTENT;
        }
        LightGeometry::Rectangle { .. } | LightGeometry::Sphere { .. } => run.rays = RAYS_OF_EXTENT,
        _ => {}
    }
    run
}
