//! Matrices and tables of a bake on the GPU.

use glam::{DVec3, Vec4};

use super::basis::{Basis, Directions, Flights};
use super::beams::BeamSet;
use super::keeping::Matrices;
use super::layout::Layout;
use super::march::{MOST_LISTED, STALE_AT_ONCE};
use super::mass::{Mass, rows_of_texels};
use super::packets::PACKET;
use super::store::PIECE_BYTES;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::uniforms;

/// Photons at work together, at most.
pub const BATCH: u32 = 65_536;
pub const BATCH_SOFTWARE: u32 = 16_384;
/// Two words a counter, then one: see `counters` in shaders/precomputed_transfer/carry.wgsl.
pub const COUNTERS: usize = 4;
pub const COUNTER_BYTES: u64 = 8 * COUNTERS as u64 + 4;
/// Bytes of what a photon relied on.
pub const HISTORY_BYTES: u64 = 16;
/// Usage of what passes read and write.
pub const STORAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC).union(wgpu::BufferUsages::COPY_DST);

/// Photons followed together.
pub fn batch_of(gpu: &Gpu) -> u32 {
    if gpu.info().software { BATCH_SOFTWARE } else { BATCH }
}

/// What light comes from, in numbers.
pub struct Tables {
    directions: Directions,
    flights: Flights,
    beams: BeamSet,
    /// Of all of it.
    pub hash: [u8; 32],
}

impl Tables {
    /// For a box of this size, in this many texels.
    pub fn new(basis: &Basis, layout: &Layout, size: DVec3, dims: [u32; 3]) -> Self {
        let directions = basis.directions(layout.nside, layout.bands as usize);
        let flights = basis.flights();
        let beams = BeamSet::new(&directions.towards, size, dims);
        let mut hasher = blake3::Hasher::new();
        hasher.update(bytemuck::cast_slice(&directions.integrals));
        hasher.update(bytemuck::cast_slice(&directions.entries));
        hasher.update(bytemuck::cast_slice(&flights.texels));
        hasher.update(bytemuck::cast_slice(&[flights.count, flights.stride]));
        hasher.update(bytemuck::cast_slice(&beams.beams));
        hasher.update(bytemuck::bytes_of(&[beams.area, f64::from(beams.unit)]));
        let hash = *hasher.finalize().as_bytes();
        Self { directions, flights, beams, hash }
    }

    /// Entries of a direction in the list of integrals: the first, and the one behind the last.
    pub fn entries(&self, direction: u32) -> [u32; 2] {
        self.directions.entries[direction as usize]
    }
}

/// Buffers of a bake.
pub struct Held {
    pub settings: wgpu::Buffer,
    /// Texels that have rows, in their order.
    pub texels: Vec<u32>,
    pub texel_rows: wgpu::Buffer,
    pub masses: wgpu::Buffer,
    /// Matrices of direct light.
    pub direct: wgpu::Buffer,
    /// Of each direction what its beams lost around each row's texel.
    pub fallen: wgpu::Buffer,
    /// Matrices of scattered light: low words of whole numbers, and high words.
    pub low_words: wgpu::Buffer,
    pub high_words: wgpu::Buffer,
    /// Of each photon what it relied on.
    pub histories: wgpu::Buffer,
    pub lights: wgpu::Buffer,
    /// What only the work needs; `None`: it is done.
    pub work: Option<Workshop>,
}

pub struct Workshop {
    pub beams: wgpu::Buffer,
    /// Of each direction's square, in beams; cross-section of one; what is lost is counted in.
    pub edge: u32,
    pub area: f64,
    pub beam_unit: f32,
    pub integrals: wgpu::Buffer,
    pub flights: wgpu::Buffer,
    pub flight_count: u32,
    pub stride: u32,
    pub paths: wgpu::Buffer,
    pub counters: wgpu::Buffer,
    /// Beams to be marched again.
    pub stale_beams: wgpu::Buffer,
    /// Photons to be followed anew, and of each packet how many there are.
    pub list: wgpu::Buffer,
    pub counts: wgpu::Buffer,
}

/// Bytes of one number for each row, light and coefficient.
pub fn plane_bytes(rows: u64, layout: &Layout) -> u64 {
    4 * rows * u64::from(layout.lights) * u64::from(layout.bands * layout.bands)
}

/// Bytes of what beams lost.
pub fn fallen_bytes(rows: u64, layout: &Layout) -> u64 {
    4 * rows * u64::from(layout.directions())
}

/// Bytes of the largest buffer, and of all matrices.
pub fn matrix_bytes(rows: u64, layout: &Layout, coloured: bool) -> (u64, u64) {
    let (plane, fallen) = (plane_bytes(rows, layout), fallen_bytes(rows, layout));
    let channels = if coloured { 3 } else { 1 };
    ((channels * plane).max(fallen), (1 + 2 * channels) * plane + fallen)
}

/// A buffer with these bytes; what waits to be copied is bounded.
///
/// # Errors
/// Out of memory.
pub fn filled(gpu: &Gpu, label: &str, bytes: &[u8]) -> Result<wgpu::Buffer, RenderError> {
    let buffer = gpu.buffer(label, bytes.len() as u64, STORAGE)?;
    for (place, piece) in bytes.chunks(PIECE_BYTES as usize).enumerate() {
        gpu.queue.write_buffer(&buffer, place as u64 * PIECE_BYTES, piece);
        if piece.len() as u64 == PIECE_BYTES {
            gpu.queue.submit([]);
            gpu.wait()?;
        }
    }
    Ok(buffer)
}

/// Beams that may be listed: those of a direction, and of more if they are few.
fn most_listed(edge: u32) -> u64 {
    let beams = u64::from(edge * edge);
    (STALE_AT_ONCE * beams).min(MOST_LISTED.max(beams))
}

impl Workshop {
    pub fn new(gpu: &Gpu, layout: &Layout, tables: &Tables) -> Result<Self, RenderError> {
        let Tables { directions, flights, beams, .. } = tables;
        let batch = batch_of(gpu);
        let paths = u64::from(batch) * std::mem::size_of::<uniforms::Path>() as u64;
        Ok(Self {
            beams: filled(gpu, "beams", bytemuck::cast_slice(&beams.beams))?,
            edge: beams.edge,
            area: beams.area,
            beam_unit: beams.unit,
            integrals: filled(gpu, "integrals of functions", bytemuck::cast_slice(&directions.integrals))?,
            flights: filled(gpu, "directions of photons", bytemuck::cast_slice(&flights.texels))?,
            flight_count: flights.count,
            stride: flights.stride,
            paths: gpu.buffer("photons at work", paths, STORAGE)?,
            counters: gpu.buffer("counters", COUNTER_BYTES, STORAGE)?,
            stale_beams: gpu.buffer("stale beams", 4 * most_listed(beams.edge), STORAGE)?,
            list: gpu.buffer("stale photons", 4 * u64::from(batch), STORAGE)?,
            counts: gpu.buffer("counts", 4 * layout.photons.div_ceil(u64::from(PACKET)), STORAGE)?,
        })
    }

    fn buffers(&self) -> [&wgpu::Buffer; 8] {
        let Self { beams, integrals, flights, paths, counters, stale_beams, list, counts, .. } = self;
        [beams, integrals, flights, paths, counters, stale_beams, list, counts]
    }
}

impl Held {
    pub fn new(
        gpu: &Gpu,
        layout: &Layout,
        tables: &Tables,
        mass: &Mass,
        coloured: bool,
    ) -> Result<Self, RenderError> {
        let texels: Vec<u32> = mass.rows.iter().map(|row| row.0).collect();
        let rows = texels.len() as u64;
        let plane = plane_bytes(rows, layout);
        let words = if coloured { 3 * plane } else { plane };
        let texel_count = 4 * mass.dims.iter().map(|&n| u64::from(n)).product::<u64>();
        let held = Self {
            settings: gpu.buffer("transfer", std::mem::size_of::<uniforms::Transfer>() as u64, STORAGE)?,
            texel_rows: gpu.buffer("rows of texels", texel_count, STORAGE)?,
            masses: gpu.buffer("extinction around texels", 16 * rows, STORAGE)?,
            direct: gpu.buffer("matrices of direct light", plane, STORAGE)?,
            fallen: gpu.buffer("what beams lost", fallen_bytes(rows, layout), STORAGE)?,
            low_words: gpu.buffer("sums of photons", words, STORAGE)?,
            high_words: gpu.buffer("high words of sums", words, STORAGE)?,
            histories: gpu.buffer("histories of photons", HISTORY_BYTES * layout.photons, STORAGE)?,
            lights: gpu.buffer("light vector", 16 * u64::from(layout.lights), STORAGE)?,
            work: Some(Workshop::new(gpu, layout, tables)?),
            texels,
        };
        held.write_rows(gpu, mass);
        Ok(held)
    }

    /// Which rows texels have, and the extinction around those.
    pub fn write_rows(&self, gpu: &Gpu, mass: &Mass) {
        let of = |texel: &u32| {
            let row = mass.rows.binary_search_by_key(texel, |row| row.0);
            row.map_or(Vec4::ZERO, |row| mass.rows[row].1 / mass.largest)
        };
        let masses: Vec<[f32; 4]> = self.texels.iter().map(|texel| of(texel).to_array()).collect();
        gpu.queue.write_buffer(&self.masses, 0, bytemuck::cast_slice(&masses));
        let rows = rows_of_texels(mass.dims, &self.texels);
        gpu.queue.write_buffer(&self.texel_rows, 0, bytemuck::cast_slice(&rows));
    }

    pub fn bytes(&self) -> u64 {
        let Self { texel_rows, masses, direct, fallen, low_words, high_words, histories, .. } = self;
        let kept = [texel_rows, masses, direct, fallen, low_words, high_words, histories];
        let work = self.work.iter().flat_map(Workshop::buffers);
        kept.into_iter().chain(work).map(wgpu::Buffer::size).sum()
    }

    /// What there is to keep of a bake.
    pub fn matrices(&self) -> Matrices<'_> {
        let Self { direct, fallen, low_words, high_words, histories, .. } = self;
        Matrices(vec![direct, fallen, low_words, high_words, histories])
    }

    /// What of it light meets.
    pub fn of_light(&self) -> Matrices<'_> {
        Matrices(vec![&self.direct, &self.low_words, &self.high_words])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::Scene;
    use serde_json::json;

    fn layout(bands: u32) -> Layout {
        let file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
            "illumination": {"method": "precomputed_transfer", "transfer_lights": 42, "transfer_directions": 48}});
        let file = proto::SceneFile::from_value(file).unwrap();
        let scene = Scene::new(&file, crate::test_support::balls(4)).unwrap();
        Layout { bands, ..Layout::of(&scene) }
    }

    #[test]
    fn matrices_of_colour_take_six_planes_for_photons_and_one_for_the_rest() {
        let (largest, all) = matrix_bytes(1000, &layout(1), false);
        assert_eq!((largest, all), (192_000, 3 * 168_000 + 192_000));
        let (largest, all) = matrix_bytes(1000, &layout(3), true);
        assert_eq!((largest, all), (27 * 168_000, 63 * 168_000 + 192_000));
    }
}
