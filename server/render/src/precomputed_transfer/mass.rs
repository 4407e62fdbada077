//! How much extinction there is around the texels of a field, by the pass of `photon_map`: what photons
//! are compared with, and which texels there are matrices for.

use glam::{DVec4, Vec4};

use super::buffers::matrix_bytes;
use super::layout::Layout;
use super::reach::Reach;
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::photon_map::{MassKept, blocks_with};
use crate::{light_field, uniforms};

/// No row: as in shaders/precomputed_transfer/.
pub const NO_ROW: u32 = u32::MAX;
/// Eight sums of extinction a cell, f32, and where each is seen from, four bytes.
const MOMENTS: usize = 8;
const MOMENT_WORDS: usize = 2 * MOMENTS;
/// Most workgroups along an axis of a dispatch.
const MAX_GROUPS: u32 = 65_535;

/// What matrices of a session may take on a device with memory of its own, bytes.
const MAX_BYTES: u64 = 2 << 30;
/// The same on a software device.
const MAX_BYTES_SOFTWARE: u64 = 384 << 20;
/// By how much a grid that does not fit is made coarser at a time.
const COARSER: f64 = 0.85;

/// What matrices of a session may take, bytes.
pub fn limit(gpu: &Gpu) -> u64 {
    if gpu.info().software { MAX_BYTES_SOFTWARE } else { MAX_BYTES }
}

/// Extinction around texels.
#[derive(PartialEq)]
pub struct Mass {
    /// Texels.
    pub dims: [u32; 3],
    /// Texels around which there may be matter, in their order, and how much there is (w): extinction
    /// integrated over the texel's share of places, as far as it is seen, as these tell; and as much times
    /// where it is seen from (x, y, z).
    pub rows: Vec<(u32, Vec4)>,
    /// The largest one; 1 where there is none.
    pub largest: f32,
}

impl Mass {
    /// In the finest grid, up to the one asked for, whose matrices there is room for. `reach` is kept for the
    /// next time.
    ///
    /// # Errors
    /// GPU errors.
    pub fn that_fits(
        inputs: &Inputs<'_>,
        layout: &Layout,
        coloured: bool,
        reach: &mut Option<Reach>,
    ) -> Result<Self, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let mut longest = layout.longest;
        loop {
            let dims = light_field::dims(scene, longest);
            let kept = reach.take().filter(|reach| reach.serves(scene, dims));
            let texels = reach.insert(kept.unwrap_or_else(|| Reach::of(scene, dims))).texels(scene);
            let (largest, all) = matrix_bytes(texels.len() as u64, layout, coloured);
            if largest <= gpu.max_binding_bytes() && all <= limit(gpu) || longest <= 1 {
                return Self::of(inputs, dims, &texels);
            }
            longest = (f64::from(longest) * COARSER) as u32;
        }
    }

    fn of(inputs: &Inputs<'_>, dims: [u32; 3], texels: &[u32]) -> Result<Self, RenderError> {
        let (gpu, scene, pipelines) = (inputs.gpu, &inputs.snapshot.scene, inputs.photon_pipelines);
        let Some(majorants) = inputs.majorants else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let cells: Vec<u32> = (0..dims.iter().map(|&n| n + 1).product()).collect();
        let blocks = blocks_with(dims, &cells);
        let moments_bytes = (4 * MOMENT_WORDS * cells.len()) as u64;
        let moments = gpu.buffer("extinction around texels", moments_bytes, storage)?;
        let list = gpu.buffer("blocks to be added up", 4 * blocks.len() as u64, storage)?;
        gpu.queue.write_buffer(&list, 0, bytemuck::cast_slice(&blocks));
        let settings = uniforms::Mass { dims, count: blocks.len() as u32 };
        let mass = gpu.buffer("mass", std::mem::size_of::<uniforms::Mass>() as u64, uniform)?;
        gpu.queue.write_buffer(&mass, 0, bytemuck::bytes_of(&settings));
        let frame = gpu.buffer("frame", std::mem::size_of::<uniforms::FrameUniform>() as u64, uniform)?;
        let contents = crate::frame::scene_uniform(scene, inputs.texture);
        gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&contents));
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("add_up_mass"),
            layout: pipelines.mass_layout(),
            entries: &[
                buffer_entry(0, &frame),
                texture_entry(1, &inputs.tables.points),
                texture_entry(2, &inputs.tables.cells),
                texture_entry(7, &inputs.texture.view),
                wgpu::BindGroupEntry {
                    binding: 8,
                    resource: wgpu::BindingResource::Sampler(&pipelines.sampler),
                },
                texture_entry(9, majorants),
                buffer_entry(13, &mass),
                buffer_entry(14, &moments),
                buffer_entry(15, &list),
            ],
        });
        let groups = blocks.len() as u32;
        let columns = groups.min(MAX_GROUPS);
        gpu.dispatch(
            &pipelines.mass(scene.filter, MassKept::Faced),
            &bind_group,
            [columns, groups.div_ceil(columns)],
        );
        let bytes = gpu.read_buffer(&moments, moments_bytes)?;
        Ok(Self::of_moments(dims, texels, &bytemuck::pod_collect_to_vec(&bytes)))
    }

    /// Adds up for each texel what the cells around it have for it. At the border both corners of a
    /// cell may be the same texel.
    fn of_moments(dims: [u32; 3], texels: &[u32], moments: &[u32]) -> Self {
        let [width, height, depth] = dims.map(|n| n as usize);
        let mut sums = vec![DVec4::ZERO; width * height * depth];
        let across = [width + 1, height + 1];
        for (cell, words) in moments.chunks_exact(MOMENT_WORDS).enumerate() {
            let cell = [cell % across[0], cell / across[0] % across[1], cell / (across[0] * across[1])];
            for corner in 0..MOMENTS {
                let texel = |axis: usize| {
                    let upper = cell[axis] + (corner >> axis & 1);
                    upper.saturating_sub(1).min(dims[axis] as usize - 1)
                };
                sums[(texel(2) * height + texel(1)) * width + texel(0)] +=
                    weighted(words[corner], words[MOMENTS + corner]);
            }
        }
        let rows: Vec<(u32, Vec4)> =
            texels.iter().map(|&texel| (texel, sums[texel as usize].as_vec4())).collect();
        let largest = rows.iter().map(|row| row.1.w).fold(0.0, f32::max);
        Self { dims, rows, largest: if largest > 0.0 { largest } else { 1.0 } }
    }
}

/// A sum from its bits, and as much times where it is seen from, of `pack4x8snorm`.
fn weighted(sum: u32, seen_from: u32) -> DVec4 {
    let [x, y, z, _] = seen_from.to_le_bytes().map(|byte| (f64::from(byte as i8) / 127.0).max(-1.0));
    f64::from(f32::from_bits(sum)) * DVec4::new(x, y, z, 1.0)
}

/// The row of each texel, or `NO_ROW`; `texels`: those that have one.
pub fn rows_of_texels(dims: [u32; 3], texels: &[u32]) -> Vec<u32> {
    let mut rows = vec![NO_ROW; dims.iter().product::<u32>() as usize];
    for (row, &texel) in texels.iter().enumerate() {
        rows[texel as usize] = row as u32;
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders;

    #[test]
    fn constants_are_those_of_the_shaders() {
        for shader in [shaders::CARRY_PHOTONS, shaders::RELIGHT, shaders::MARCH_TRANSFER, shaders::MOVE_ROWS]
        {
            assert!(shader.contains(&format!("const NO_ROW = {NO_ROW:#x}u;")));
        }
    }

    #[test]
    fn texels_with_matter_have_rows() {
        // Three texels in a row; matter between the second and the third.
        let mut moments = vec![0; 4 * 2 * 2 * MOMENT_WORDS];
        let cell = 2; // x between texels 1 and 2, y and z below the first texel
        moments[MOMENT_WORDS * cell] = 1.0_f32.to_bits();
        moments[MOMENT_WORDS * cell + 1] = 3.0_f32.to_bits();
        // One from -y, the other from +x.
        moments[MOMENT_WORDS * cell + MOMENTS] = 0x0000_8100;
        moments[MOMENT_WORDS * cell + MOMENTS + 1] = 0x0000_007f;
        let mass = Mass::of_moments([3, 1, 1], &[1, 2], &moments);
        assert_eq!(mass.rows, [(1, Vec4::new(0.0, -1.0, 0.0, 1.0)), (2, Vec4::new(3.0, 0.0, 0.0, 3.0))]);
        assert_eq!(rows_of_texels([3, 1, 1], &[1, 2]), [NO_ROW, 0, 1]);
        let empty = Mass::of_moments([3, 1, 1], &[], &[0; 16 * MOMENT_WORDS]);
        assert!(empty.rows.is_empty() && empty.largest == 1.0);
    }
}
