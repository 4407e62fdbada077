//! Photons as rays gather them (shaders/photon_map/gather.wgsl): interactions sorted by cell, and how much
//! extinction there is in the kernel around each place.

use std::collections::BTreeMap;

use scene::Scene;

use super::field::FieldOfPhotons;
use super::lights::{Interaction, LightPhotons, flux, sphere_radius};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::illumination::Inputs;
use crate::light_field::LightField;
use crate::uniforms;

/// `PLACES` of shaders/photon_map/seen.wgsl.
const PLACES: u32 = 3;
/// The tent's values at places, up to where it ends.
const TENT: [f32; 5] = [1.0 / 3.0, 2.0 / 3.0, 1.0, 2.0 / 3.0, 1.0 / 3.0];
/// Interactions in a row of their texture, two texels each.
const ROW: usize = 4096;
/// Interactions that are sorted, at most: memory of the host, 72 bytes each, and as much as a texture holds.
const MOST_INTERACTIONS: usize = 1 << 25;
/// Cells that interactions are sorted by: where there are more places, a cell is of several along each axis.
const MOST_CELLS: u64 = 16 << 20;

/// What rays gather of a photon map that is complete.
pub(crate) struct Gather {
    /// Row by row, two texels each: place in the lattice and way; throughput in a word, and the light.
    pub interactions: wgpu::TextureView,
    pub cell_starts: wgpu::TextureView,
    /// Flux of a photon of each light.
    pub flux_of_lights: wgpu::TextureView,
    /// Extinction in the kernel about each place.
    pub extinction_around: wgpu::TextureView,
    /// `Gather` of the shader, before the first dispatch.
    pub uniform: uniforms::Gather,
    /// Interactions.
    pub count: u64,
    bytes: u64,
}

impl Gather {
    /// Sorts the interactions of complete photons.
    ///
    /// # Errors
    /// Out of memory; too many of them for the device.
    pub(super) fn new(
        inputs: &Inputs<'_>,
        lights: &BTreeMap<String, LightPhotons>,
        field: &FieldOfPhotons,
    ) -> Result<Self, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let grid = Grid::of(&field.light, scene);
        let sorted = grid.sort(inputs, lights)?;
        let rows = sorted.interactions.len().div_ceil(ROW).max(1);
        let mut interactions = sorted.interactions;
        interactions.resize(rows * ROW, Interaction::default());
        let size = wgpu::Extent3d { width: 2 * ROW as u32, height: rows as u32, depth_or_array_layers: 1 };
        let texture = |label: &str, size, dimension, format, bytes: &[u8]| {
            gpu.filled_texture(label, size, dimension, format, bytes)
        };
        use wgpu::TextureDimension::{D2, D3};
        let [width, height, depth] = grid.cells;
        let starts_size = wgpu::Extent3d { width: width + 1, height, depth_or_array_layers: depth };
        let around = grid.extinction_around(&field.places(gpu)?);
        let [width, height, depth] = grid.lattice;
        let around_size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
        let bytes = std::mem::size_of_val(interactions.as_slice()) + 4 * (sorted.starts.len() + around.len());
        Ok(Self {
            interactions: texture(
                "interactions",
                size,
                D2,
                wgpu::TextureFormat::Rgba32Uint,
                bytemuck::cast_slice(&interactions),
            )?,
            cell_starts: texture(
                "cells of interactions",
                starts_size,
                D3,
                wgpu::TextureFormat::R32Uint,
                bytemuck::cast_slice(&sorted.starts),
            )?,
            flux_of_lights: flux_of_lights(gpu, scene, lights)?,
            extinction_around: texture(
                "extinction in kernels",
                around_size,
                D3,
                wgpu::TextureFormat::R32Float,
                bytemuck::cast_slice(&around),
            )?,
            uniform: uniforms::Gather {
                dims: field.light.dims.map(|n| n as f32),
                places_per_cell: grid.places_per_cell as f32,
                cells: grid.cells,
                first: 0,
            },
            count: sorted.count,
            bytes: bytes as u64,
        })
    }

    /// Takes over colours and strengths of the scene's lights.
    pub(super) fn recolour(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        lights: &BTreeMap<String, LightPhotons>,
    ) -> Result<(), RenderError> {
        self.flux_of_lights = flux_of_lights(gpu, scene, lights)?;
        Ok(())
    }

    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

/// Flux of a photon of each light, in the order of their identifiers.
fn flux_of_lights(
    gpu: &Gpu,
    scene: &Scene,
    lights: &BTreeMap<String, LightPhotons>,
) -> Result<wgpu::TextureView, RenderError> {
    let radius = sphere_radius(scene);
    let flux_of = |(id, photons): (&String, &LightPhotons)| {
        let light = scene.lights.iter().find(|light| light.id == *id);
        let all = light.map_or(glam::DVec3::ZERO, |light| flux(light, radius));
        (all / photons.traced().max(1) as f64).as_vec3().extend(0.0).to_array()
    };
    let mut texels: Vec<[f32; 4]> = lights.iter().map(flux_of).collect();
    texels.resize(texels.len().max(1), [0.0; 4]);
    let size = wgpu::Extent3d { width: texels.len() as u32, height: 1, depth_or_array_layers: 1 };
    let (dimension, format) = (wgpu::TextureDimension::D2, wgpu::TextureFormat::Rgba32Float);
    gpu.filled_texture("flux of lights", size, dimension, format, bytemuck::cast_slice(&texels))
}

/// The lattice of places, and the cells that interactions are sorted by.
struct Grid {
    lattice: [u32; 3],
    places_per_cell: u32,
    cells: [u32; 3],
    /// From the world to places of the lattice.
    scale: [f32; 3],
    offset: [f32; 3],
    /// Volume of a place, world units.
    place_volume: f32,
}

struct Sorted {
    interactions: Vec<Interaction>,
    /// Of each row of cells along x one more than there are cells.
    starts: Vec<u32>,
    count: u64,
}

impl Grid {
    fn of(field: &LightField, scene: &Scene) -> Self {
        let lattice = field.dims.map(|n| PLACES * (n + 1));
        let cells_of = |places: u32| lattice.map(|n| n.div_ceil(places));
        let fits =
            |places: &u32| cells_of(*places).iter().map(|&n| u64::from(n)).product::<u64>() <= MOST_CELLS;
        let places_per_cell = (1..).find(fits).unwrap_or(1);
        let size = scene.grid.size_world;
        let per_world = [0, 1, 2].map(|axis| f64::from(PLACES * field.dims[axis]) / size[axis]);
        Self {
            lattice,
            places_per_cell,
            cells: cells_of(places_per_cell),
            scale: per_world.map(|scale| scale as f32),
            offset: field.dims.map(|n| 0.5 * (PLACES * n) as f32 + 1.0),
            place_volume: (1.0 / per_world.iter().product::<f64>()) as f32,
        }
    }

    /// By cell; within a cell by light, photon and event, so that sums do not depend on what was before.
    fn sort(
        &self,
        inputs: &Inputs<'_>,
        lights: &BTreeMap<String, LightPhotons>,
    ) -> Result<Sorted, RenderError> {
        let [width, height, depth] = self.cells.map(|n| n as usize);
        let most = MOST_INTERACTIONS.min(inputs.gpu.max_texture_edge_2d() as usize * ROW);
        let mut found: Vec<(u32, Interaction)> = Vec::new();
        let mut count = 0;
        // Behind each cell how many are in it.
        let mut starts = vec![0_u32; (width + 1) * height * depth];
        for (slot, photons) in lights.values().enumerate() {
            photons.each_interaction(inputs.gpu, inputs.photon_pipelines, |mut interaction| {
                count += 1;
                if count > most {
                    return;
                }
                let place =
                    [0, 1, 2].map(|k| f32::from_bits(interaction[k]) * self.scale[k] + self.offset[k]);
                let cell = [0, 1, 2].map(|k| {
                    let cell = (place[k] / self.places_per_cell as f32).max(0.0) as usize;
                    cell.min(self.cells[k] as usize - 1)
                });
                let index = (cell[2] * height + cell[1]) * (width + 1) + cell[0];
                starts[index + 1] += 1;
                interaction[..3].copy_from_slice(&place.map(f32::to_bits));
                interaction[7] = slot as u32;
                found.push((index as u32, interaction));
            })?;
        }
        if count > most {
            return Err(RenderError::TooLarge {
                what: format!("{count} interactions of photons, gathered on rays"),
                limit: format!("{most} of them; fewer photons or events have fewer"),
            });
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        let mut next = starts.clone();
        let mut interactions = vec![Interaction::default(); found.len()];
        for (cell, record) in &found {
            let place = &mut next[*cell as usize];
            interactions[*place as usize] = *record;
            *place += 1;
        }
        Ok(Sorted { count: found.len() as u64, interactions, starts })
    }

    /// Extinction times the tents about each place, integrated over the volume.
    fn extinction_around(&self, places: &[f32]) -> Vec<f32> {
        let [width, height, depth] = self.lattice.map(|n| n as usize);
        let mut values: Vec<f32> = places.iter().map(|value| value * self.place_volume).collect();
        let reach = TENT.len() / 2;
        for (count, stride) in [(width, 1), (height, width), (depth, width * height)] {
            let along = values;
            values = (0..along.len())
                .map(|index| {
                    let at = index / stride % count;
                    let from = at.saturating_sub(reach);
                    let to = (at + reach).min(count - 1);
                    let value = |other: usize| {
                        TENT[other + reach - at] * along[index - (at * stride) + other * stride]
                    };
                    (from..=to).map(value).sum()
                })
                .collect();
        }
        values
    }
}
