//! Matrices and tables of a bake on the GPU.

use super::basis::{Basis, Flights};
use super::beams::BeamSet;
use super::keeping::Matrices;
use super::layout::Layout;
use super::mass::Mass;
use super::store::PIECE_BYTES;
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::uniforms;

/// Photons of a batch.
pub const BATCH: u32 = 65_536;
pub const BATCH_SOFTWARE: u32 = 16_384;
/// Two words a counter, then one: see `counters` in shaders/precomputed_transfer/carry.wgsl.
pub const COUNTERS: usize = 4;
pub const COUNTER_BYTES: u64 = 8 * COUNTERS as u64 + 4;

/// Photons followed together. Part of the result: sums are rounded batch by batch.
pub fn batch_of(gpu: &Gpu) -> u32 {
    if gpu.info().software { BATCH_SOFTWARE } else { BATCH }
}

pub fn storage() -> wgpu::BufferUsages {
    wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST
}

/// A buffer with these bytes; what waits to be copied is bounded.
///
/// # Errors
/// Out of memory.
pub fn filled(gpu: &Gpu, label: &str, bytes: &[u8]) -> Result<wgpu::Buffer, RenderError> {
    let buffer = gpu.buffer(label, bytes.len() as u64, storage())?;
    for (place, piece) in bytes.chunks(PIECE_BYTES as usize).enumerate() {
        gpu.queue.write_buffer(&buffer, place as u64 * PIECE_BYTES, piece);
        if piece.len() as u64 == PIECE_BYTES {
            gpu.queue.submit([]);
            gpu.wait()?;
        }
    }
    Ok(buffer)
}

/// Buffers of a bake.
pub struct Held {
    pub settings: wgpu::Buffer,
    pub frame: wgpu::Buffer,
    pub texel_rows: wgpu::Buffer,
    pub masses: wgpu::Buffer,
    pub direct: wgpu::Buffer,
    pub scattered: wgpu::Buffer,
    pub lights: wgpu::Buffer,
    /// What only the work needs; `None`: it is done.
    pub work: Option<Workshop>,
    pub entries: Vec<[u32; 2]>,
    /// Hash of the tables: of all directions, of light and of photons, and of their functions.
    pub tables: [u8; 32],
}

pub struct Workshop {
    pub beams: wgpu::Buffer,
    pub fallen: wgpu::Buffer,
    /// Of each direction's square, in beams; cross-section of one; what is lost is counted in.
    pub edge: u32,
    pub area: f64,
    pub beam_unit: f32,
    pub integrals: wgpu::Buffer,
    pub flights: wgpu::Buffer,
    pub flight_count: u32,
    pub stride: u32,
    pub sums: wgpu::Buffer,
    pub paths: wgpu::Buffer,
    pub counters: wgpu::Buffer,
}

impl Workshop {
    fn buffers(&self) -> [&wgpu::Buffer; 7] {
        let Self { beams, fallen, integrals, flights, sums, paths, counters, .. } = self;
        [beams, fallen, integrals, flights, sums, paths, counters]
    }
}

/// Bytes of the largest buffer, and of all matrices.
pub fn matrix_bytes(rows: u64, lights: u32, bands: u32, coloured: bool) -> (u64, u64) {
    let plane = 4 * rows * u64::from(lights) * u64::from(bands * bands);
    let channels = if coloured { 3 } else { 1 };
    (channels * plane, (1 + 2 * channels) * plane)
}

impl Held {
    pub fn new(
        inputs: &Inputs<'_>,
        layout: &Layout,
        basis: &Basis,
        mass: &Mass,
        coloured: bool,
    ) -> Result<Self, RenderError> {
        let gpu = inputs.gpu;
        let storage = storage();
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let filled = |label: &str, bytes: &[u8]| filled(gpu, label, bytes);
        let rows = mass.rows.len() as u64;
        let (scattered, _) = matrix_bytes(rows, layout.lights, layout.bands, coloured);
        let (direct, _) = matrix_bytes(rows, layout.lights, layout.bands, false);
        let batch = batch_of(gpu);
        let paths = u64::from(batch) * std::mem::size_of::<uniforms::Path>() as u64;
        let directions = basis.directions(layout.nside, layout.bands as usize);
        let Flights { texels, count, stride } = basis.flights();
        let normalised: Vec<f32> = mass.rows.iter().map(|row| row.1 / mass.largest).collect();
        let set = BeamSet::new(&directions.towards, inputs.snapshot.scene.grid.size_world, mass.dims);
        let mut tables = blake3::Hasher::new();
        tables.update(&batch.to_le_bytes());
        tables.update(bytemuck::cast_slice(&directions.integrals));
        tables.update(bytemuck::cast_slice(&directions.entries));
        tables.update(bytemuck::cast_slice(&texels));
        tables.update(bytemuck::cast_slice(&[count, stride]));
        tables.update(bytemuck::cast_slice(&set.beams));
        tables.update(bytemuck::bytes_of(&[set.area, f64::from(set.unit)]));
        Ok(Self {
            tables: *tables.finalize().as_bytes(),
            settings: gpu.buffer("transfer", std::mem::size_of::<uniforms::Transfer>() as u64, storage)?,
            frame: gpu.buffer("frame", std::mem::size_of::<uniforms::FrameUniform>() as u64, uniform)?,
            texel_rows: filled("rows of texels", bytemuck::cast_slice(&mass.rows_of_texels()))?,
            masses: filled("extinction around texels", bytemuck::cast_slice(&normalised))?,
            direct: gpu.buffer("matrices of direct light", direct, storage)?,
            scattered: gpu.buffer("matrices of scattered light", scattered, storage)?,
            lights: gpu.buffer("light vector", 16 * u64::from(layout.lights), storage)?,
            work: Some(Workshop {
                beams: filled("beams", bytemuck::cast_slice(&set.beams))?,
                fallen: gpu.buffer("what beams lost", 4 * rows, storage)?,
                edge: set.edge,
                area: set.area,
                beam_unit: set.unit,
                integrals: filled("integrals of functions", bytemuck::cast_slice(&directions.integrals))?,
                flights: filled("directions of photons", bytemuck::cast_slice(&texels))?,
                flight_count: count,
                stride,
                sums: gpu.buffer("sums of photons", scattered, storage)?,
                paths: gpu.buffer("photons at work", paths, storage)?,
                counters: gpu.buffer("counters", COUNTER_BYTES, storage)?,
            }),
            entries: directions.entries,
        })
    }

    pub fn bytes(&self) -> u64 {
        let kept = [&self.texel_rows, &self.masses, &self.direct, &self.scattered];
        let work = self.work.iter().flat_map(Workshop::buffers);
        kept.into_iter().chain(work).map(wgpu::Buffer::size).sum()
    }

    /// What there is to keep of a bake.
    pub fn matrices(&self) -> Matrices<'_> {
        Matrices([&self.direct, &self.scattered])
    }

    pub fn write_frame(&self, inputs: &Inputs<'_>) {
        let frame = crate::frame::scene_uniform(&inputs.snapshot.scene, inputs.texture);
        inputs.gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
    }

    /// What passes through matter read; `cells`: distances to matter, or bounds of the extinction.
    pub fn matter<'a>(
        &'a self,
        inputs: &Inputs<'a>,
        sampler: &'a wgpu::Sampler,
        cells: &'a wgpu::TextureView,
    ) -> [wgpu::BindGroupEntry<'a>; 7] {
        [
            buffer_entry(0, &self.frame),
            texture_entry(1, &inputs.tables.points),
            texture_entry(2, &inputs.tables.cells),
            texture_entry(7, &inputs.texture.view),
            wgpu::BindGroupEntry { binding: 8, resource: wgpu::BindingResource::Sampler(sampler) },
            texture_entry(9, cells),
            buffer_entry(21, &self.settings),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_of_colour_take_three_planes_for_photons_and_one_for_the_rest() {
        let (largest, all) = matrix_bytes(1000, 42, 1, false);
        assert_eq!((largest, all), (168_000, 504_000));
        let (largest, all) = matrix_bytes(1000, 42, 3, true);
        assert_eq!((largest, all), (27 * 168_000, 63 * 168_000));
    }
}
