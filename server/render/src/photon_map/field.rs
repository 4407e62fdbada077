//! The light field of a photon map: the extinction around its texels, and light sums over it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use scene::{Changes, Scene, Snapshot};

use super::lights::{LightPhotons, flux, sphere_radius};
use super::pipelines::MassKept;
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::light_field::{self, LightField};
use crate::uniforms::{self, Fill, Mass};

/// Edge of a brick, texels.
const BRICK_EDGE: u32 = 4;
/// Edge of a macrocell, voxels.
const MACROCELL_EDGE: f64 = 4.0;
/// Of a coefficient red, green and blue, 64 bits each.
const SUM_BYTES: u64 = 24;
/// `REACH` over `PLACES` of shaders/photon_map/seen.wgsl, and `SEEN_FROM`.
const REACH: f64 = 4.0 / 3.0;
const SEEN_FROM: f64 = 0.5;
/// Of opaque matter about so much counts in a texel: optical depth.
const MOST_DEPTH: f64 = 2.0;
/// How far from a place shaders/photon_map/mass.wgsl looks at matter, at most: texels.
const REACH_TEXELS: f64 = 1.5;
/// Cells along an axis of what a workgroup of that shader adds up.
const BLOCK_EDGE: u32 = 2;
/// Eight sums of what counts of the extinction a cell, and eight of all of it, f32.
const MOMENT_BYTES: u64 = 64;
/// Two f32 a texel.
const DOUBT_BYTES: u64 = 8;
/// Places of the lattice in a cell between texel centres.
const PLACES_OF_CELL: u64 = 27;
/// Most workgroups along an axis of a dispatch.
const MAX_GROUPS: u32 = 65_535;

/// Largest extinction, per world unit.
fn densest(scene: &Scene) -> f64 {
    scene.transfer_function.points.iter().map(|point| point.sigma_t).fold(0.0, f64::max)
}

/// How far off matter around so many texels is looked at from, world units; 0: none is so dense that this
/// makes a difference.
pub(crate) fn reach_of(scene: &Scene, dims: [u32; 3]) -> f64 {
    let edges = (0..3).map(|axis| scene.grid.size_world[axis] / f64::from(dims[axis]));
    let reach = REACH * edges.sum::<f64>() / 3.0;
    if densest(scene) * reach > SEEN_FROM { reach } else { 0.0 }
}

/// Blocks of cells, by their index, that hold any of these cells between texel centres.
pub(crate) fn blocks_with(dims: [u32; 3], cells: &[u32]) -> Vec<u32> {
    let across = dims.map(|n| (n + 1).div_ceil(BLOCK_EDGE));
    let block_of = |&cell: &u32| {
        let (width, height) = (dims[0] + 1, dims[1] + 1);
        let block = [cell % width, cell / width % height, cell / (width * height)].map(|n| n / BLOCK_EDGE);
        (block[2] * across[1] + block[1]) * across[0] + block[0]
    };
    let blocks: BTreeSet<u32> = cells.iter().map(block_of).collect();
    blocks.into_iter().collect()
}

pub(super) struct FieldOfPhotons {
    pub light: LightField,
    /// Of each brick: whether a light sum changed since the field was filled.
    pub touched: wgpu::Buffer,
    moments: wgpu::Buffer,
    /// Whether behind the moments what counts of the extinction is kept place by place.
    keeps_places: bool,
    totals: wgpu::Buffer,
    /// What photons brought, before the kernel is widened.
    found: wgpu::Texture,
    found_view: wgpu::TextureView,
    /// How sure of it texels are: variance, and extinction around them.
    doubt: wgpu::Buffer,
    /// Of the last call of [`Self::fill`].
    weight_of_mass_filled: f32,
    fill_uniform: wgpu::Buffer,
    mass_uniform: wgpu::Buffer,
    frame: wgpu::Buffer,
    /// The scene that the moments are of.
    mass_of: Option<Arc<Snapshot>>,
    /// Of the last call of [`Self::fill`].
    pub bricks_filled: u64,
}

impl FieldOfPhotons {
    pub fn new(gpu: &Arc<Gpu>, dims: [u32; 3], bands: u32) -> Result<Self, RenderError> {
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let light = LightField::new(gpu, dims, bands)?;
        let texels: u64 = dims.iter().map(|&n| u64::from(n)).product();
        let cells: u64 = dims.iter().map(|&n| u64::from(n) + 1).product();
        let coefficients = u64::from(bands * bands);
        if texels * coefficients * SUM_BYTES > gpu.max_binding_bytes() {
            return Err(RenderError::TooLarge {
                what: format!("a light field of {dims:?} texels with {bands} bands"),
                limit: format!("{} bytes a buffer", gpu.max_binding_bytes()),
            });
        }
        let bricks: u64 = dims.iter().map(|&n| u64::from(n.div_ceil(BRICK_EDGE))).product();
        let found = light_field::texture(gpu, light.texture.size())?;
        Ok(Self {
            found_view: found.create_view(&wgpu::TextureViewDescriptor::default()),
            found,
            doubt: gpu.buffer("doubt of texels", DOUBT_BYTES * texels, storage)?,
            light,
            touched: gpu.buffer("touched bricks", 4 * bricks, storage)?,
            moments: gpu.buffer("extinction around texels", MOMENT_BYTES * cells, storage)?,
            keeps_places: false,
            weight_of_mass_filled: 0.0,
            totals: gpu.buffer("light of all lights", 16 * texels * coefficients, storage)?,
            fill_uniform: gpu.buffer("fill", std::mem::size_of::<Fill>() as u64, uniform)?,
            mass_uniform: gpu.buffer("mass", std::mem::size_of::<Mass>() as u64, uniform)?,
            frame: gpu.buffer("frame", std::mem::size_of::<uniforms::FrameUniform>() as u64, uniform)?,
            mass_of: None,
            bricks_filled: 0,
        })
    }

    /// Bytes of the light sums of one light.
    pub fn sum_bytes(&self) -> u64 {
        let texels: u64 = self.light.dims.iter().map(|&n| u64::from(n)).product();
        texels * u64::from(self.light.bands * self.light.bands) * SUM_BYTES
    }

    /// All bricks will be filled anew.
    pub fn touch_all(&self, gpu: &Gpu) {
        let touched = vec![1_u32; self.bricks() as usize];
        gpu.queue.write_buffer(&self.touched, 0, bytemuck::cast_slice(&touched));
    }

    pub fn bricks(&self) -> u64 {
        self.touched.size() / 4
    }

    pub fn bytes(&self) -> u64 {
        let buffers = [&self.touched, &self.moments, &self.totals, &self.doubt];
        2 * self.light.bytes() + buffers.iter().map(|buffer| buffer.size()).sum::<u64>()
    }

    /// Cells between texel centres.
    fn cells(&self) -> u32 {
        self.light.dims.iter().map(|&n| n + 1).product()
    }

    /// Makes room for what counts of the extinction place by place, which is then added up anew, or gives it
    /// back.
    fn keep_places(&mut self, gpu: &Gpu, keeps: bool) -> Result<(), RenderError> {
        if keeps == self.keeps_places {
            return Ok(());
        }
        let cells = u64::from(self.cells());
        let bytes = MOMENT_BYTES * cells + if keeps { 4 * PLACES_OF_CELL * cells } else { 0 };
        if bytes > gpu.max_binding_bytes() {
            return Err(RenderError::TooLarge {
                what: format!("photons gathered on rays with {:?} texels", self.light.dims),
                limit: format!("{} bytes a buffer; a coarser light grid needs less", gpu.max_binding_bytes()),
            });
        }
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        self.moments = gpu.buffer("extinction around texels", bytes, storage)?;
        self.keeps_places = keeps;
        self.mass_of = None;
        Ok(())
    }

    /// What counts of the extinction at each place of the lattice, x fastest: three times as many along each
    /// axis as cells.
    pub fn places(&self, gpu: &Gpu) -> Result<Vec<f32>, RenderError> {
        let cells = u64::from(self.cells());
        let bytes = gpu.read_part(&self.moments, MOMENT_BYTES * cells, 4 * PLACES_OF_CELL * cells)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    /// Adds up extinction around the texels where it changed; whether it did.
    pub fn bring_mass_to(&mut self, inputs: &Inputs<'_>) -> Result<bool, RenderError> {
        let scene = &inputs.snapshot.scene;
        self.keep_places(inputs.gpu, super::is_gathered(scene))?;
        let cells = match &self.mass_of {
            None => (0..self.cells()).collect(),
            Some(then) => {
                let changes = Changes::between(&then.scene, scene);
                if changes.volume || changes.clip {
                    (0..self.cells()).collect()
                } else {
                    self.cells_with(scene, changes.bins)
                }
            }
        };
        self.mass_of = Some(inputs.snapshot.clone());
        self.light.set_reach(reach_of(scene, self.light.dims) as f32);
        if cells.is_empty() {
            return Ok(false);
        }
        let (gpu, pipelines) = (inputs.gpu, inputs.photon_pipelines);
        let Some(majorants) = inputs.majorants else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        self.touch_around(gpu, &cells)?;
        let blocks = blocks_with(self.light.dims, &cells);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let list = gpu.buffer("blocks to be added up", 4 * blocks.len() as u64, usage)?;
        gpu.queue.write_buffer(&list, 0, bytemuck::cast_slice(&blocks));
        let uniform = Mass { dims: self.light.dims, count: blocks.len() as u32 };
        gpu.queue.write_buffer(&self.mass_uniform, 0, bytemuck::bytes_of(&uniform));
        let frame = crate::frame::scene_uniform(scene, inputs.texture);
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("add_up_mass"),
            layout: pipelines.mass_layout(),
            entries: &[
                buffer_entry(0, &self.frame),
                texture_entry(1, &inputs.tables.points),
                texture_entry(2, &inputs.tables.cells),
                texture_entry(7, &inputs.texture.view),
                wgpu::BindGroupEntry {
                    binding: 8,
                    resource: wgpu::BindingResource::Sampler(&pipelines.sampler),
                },
                texture_entry(9, majorants),
                buffer_entry(13, &self.mass_uniform),
                buffer_entry(14, &self.moments),
                buffer_entry(15, &list),
            ],
        });
        let kept = if self.keeps_places { MassKept::Places } else { MassKept::Sums };
        let groups = blocks.len() as u32;
        let columns = groups.min(MAX_GROUPS);
        gpu.dispatch(&pipelines.mass(scene.filter, kept), &bind_group, [columns, groups.div_ceil(columns)]);
        gpu.wait()?;
        Ok(true)
    }

    /// Cells between texel centres that reach into a macrocell with one of the bins, or within a texel of
    /// one: that far matter is looked at for what hides it.
    fn cells_with(&self, scene: &Scene, bins: u64) -> Vec<u32> {
        let macrocells = &scene.volume.macrocells;
        let masks = macrocells.masks(scene.filter);
        let dims = self.light.dims;
        let across = dims.map(|n| n as usize + 1);
        let mut stale = vec![false; across.iter().product()];
        for (index, _) in masks.iter().enumerate().filter(|(_, mask)| *mask & bins != 0) {
            let [width, height, _] = macrocells.dims;
            let cell = [index % width, index / width % height, index / (width * height)];
            // In texels, from the lower edge of the box; cell i spans i - 1/2 .. i + 1/2.
            let range = |axis: usize| {
                let texels = f64::from(dims[axis]) / scene.grid.dims[axis] as f64;
                let low = cell[axis] as f64 * MACROCELL_EDGE * texels - REACH_TEXELS;
                let high = low + MACROCELL_EDGE * texels + 2.0 * REACH_TEXELS;
                let first = (low + 0.5 - 1e-6).floor().max(0.0) as usize;
                let last = ((high + 0.5 + 1e-6).floor().max(0.0) as usize).min(across[axis] - 1);
                first..=last
            };
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        stale[(z * across[1] + y) * across[0] + x] = true;
                    }
                }
            }
        }
        (0..stale.len()).filter(|&cell| stale[cell]).map(|cell| cell as u32).collect()
    }

    /// Bricks whose texels have a share in these cells will be filled anew.
    fn touch_around(&self, gpu: &Gpu, cells: &[u32]) -> Result<(), RenderError> {
        let dims = self.light.dims;
        let bricks = dims.map(|n| n.div_ceil(BRICK_EDGE));
        let bytes = gpu.read_buffer(&self.touched, self.touched.size())?;
        let mut touched: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
        for &cell in cells {
            let (width, height) = (dims[0] + 1, dims[1] + 1);
            let cell = [cell % width, cell / width % height, cell / (width * height)];
            for corner in 0..8_u32 {
                // Texels cell - 1 and cell along each axis.
                let texel = [0, 1, 2]
                    .map(|axis| (cell[axis] + (corner >> axis & 1)).saturating_sub(1).min(dims[axis] - 1));
                let brick = texel.map(|n| n / BRICK_EDGE);
                touched[((brick[2] * bricks[1] + brick[1]) * bricks[0] + brick[0]) as usize] = 1;
            }
        }
        gpu.queue.write_buffer(&self.touched, 0, bytemuck::cast_slice(&touched));
        Ok(())
    }

    /// A power of two, which changes no digit, that brings the largest extinction around a texel to
    /// about 1.
    fn weight_of_mass(&self, scene: &Scene) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|axis| scene.grid.size_world[axis] / f64::from(self.light.dims[axis]));
        // As about as much is seen.
        let counted = densest(scene).min(MOST_DEPTH * 3.0 / (x + y + z));
        let largest = counted * x * y * z;
        if largest > 1e-30 { (-largest.log2().round()).exp2() as f32 } else { 1.0 }
    }

    /// Fills the field from the light sums: touched bricks, or all.
    pub fn fill(
        &mut self,
        inputs: &Inputs<'_>,
        photons: &BTreeMap<String, LightPhotons>,
        mut everything: bool,
    ) -> Result<(), RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let radius = sphere_radius(scene);
        let lit: Vec<_> =
            scene.lights.iter().filter_map(|light| Some((light, photons.get(&light.id)?))).collect();
        // Irradiance, about, of the brightest channel.
        let cross_section = std::f64::consts::PI * radius * radius;
        let brightest: f64 =
            lit.iter().map(|(light, _)| flux(light, radius).max_element() / cross_section).sum();
        let scale = if brightest > 0.0 { brightest.min(1e30) } else { 1.0 };
        self.light.set_scale(scale as f32);
        let weight_of_mass = self.weight_of_mass(scene);
        everything |= weight_of_mass != self.weight_of_mass_filled;
        self.weight_of_mass_filled = weight_of_mass;
        let bytes = gpu.read_buffer(&self.touched, self.touched.size())?;
        let touched: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
        self.bricks_filled = match everything {
            true => touched.len() as u64,
            false => touched.iter().filter(|&&flag| flag != 0).count() as u64,
        };
        let pipeline = inputs.photon_pipelines.fill(self.light.bands);
        let groups = self.light.dims.map(|n| n.div_ceil(BRICK_EDGE));
        for (index, (light, photons)) in lit.iter().enumerate() {
            let photon_count = photons.traced().max(1) as f64;
            let of_one = flux(light, radius) / (scale * photon_count);
            let uniform = Fill {
                dims: self.light.dims,
                everything: u32::from(everything),
                flux: of_one.as_vec3().to_array(),
                turn: u32::from(index == 0) + 2 * u32::from(index + 1 == lit.len()),
                weight_of_mass,
                ..Fill::default()
            };
            gpu.queue.write_buffer(&self.fill_uniform, 0, bytemuck::bytes_of(&uniform));
            let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("fill_field"),
                layout: inputs.photon_pipelines.fill_layout(),
                entries: &[
                    buffer_entry(0, &self.fill_uniform),
                    buffer_entry(1, &photons.sums),
                    buffer_entry(2, &self.moments),
                    buffer_entry(3, &self.touched),
                    texture_entry(5, &self.found_view),
                    buffer_entry(9, &self.totals),
                    buffer_entry(10, &self.doubt),
                ],
            });
            gpu.dispatch_3d(&pipeline, &bind_group, groups);
        }
        gpu.queue.write_buffer(&self.touched, 0, bytemuck::cast_slice(&vec![0_u32; touched.len()]));
        match inputs.photon_pipelines.trial().widens {
            true => self.widen(inputs),
            false => self.take(gpu),
        }
        gpu.wait()
    }

    /// Widens the kernel where photons are few.
    fn widen(&self, inputs: &Inputs<'_>) {
        let (gpu, pipelines) = (inputs.gpu, inputs.photon_pipelines);
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("widen_field"),
            layout: pipelines.widen_layout(),
            entries: &[
                buffer_entry(0, &self.fill_uniform),
                texture_entry(1, &self.found_view),
                texture_entry(5, &self.light.view),
                buffer_entry(10, &self.doubt),
            ],
        });
        let groups = self.light.dims.map(|n| n.div_ceil(BRICK_EDGE));
        gpu.dispatch_3d(&pipelines.widen(self.light.bands), &bind_group, groups);
    }

    /// Takes what was found as it is.
    fn take(&self, gpu: &Gpu) {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let (from, to) = (self.found.as_image_copy(), self.light.texture.as_image_copy());
        encoder.copy_texture_to_texture(from, to, self.found.size());
        gpu.queue.submit([encoder.finish()]);
    }
}
