//! Macrocells: for each block of 4^3 voxels, the exact set of bins its samples can touch.
//!
//! Cell (i, j, k) covers voxel coordinates `4i .. 4i + 4`; trilinear samples in it read voxels
//! `4i - 1 ..= 4i + 4`. The field is continuous and the cell connected, so its values fill the
//! whole interval between the smallest and the largest of those voxels' values (mean value
//! theorem), and the bin set of an interval is contiguous. For nearest filtering the samples take
//! exactly the values of voxels `4i .. 4i + 4`.

use proto::scene_file::Filter;
use rayon::prelude::*;

use crate::bins::{BIN_COUNT, Bins};
use crate::volume::{Volume, Voxels};

/// Edge of a macrocell, voxels.
pub const MACROCELL_EDGE: usize = 4;

/// Masks counted by one task: about a millisecond.
const MASKS_PER_TASK: usize = 1 << 16;

/// Bin masks of a volume's macrocells, x fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Macrocells {
    /// Cells along x, y, z.
    pub dims: [usize; 3],
    /// Bins a trilinear sample in the cell can touch.
    linear: Vec<u64>,
    /// Bins of the voxels in the cell.
    nearest: Vec<u64>,
}

impl Macrocells {
    /// Scans the volume; `progress` is called with 0..1.
    pub fn of(volume: &Volume, bins: &Bins, progress: &(dyn Fn(f32) + Sync)) -> Self {
        let dims = volume.dims.map(|n| n.div_ceil(MACROCELL_EDGE));
        let layers_done = std::sync::atomic::AtomicUsize::new(0);
        let layers: Vec<Vec<(u64, u64)>> = (0..dims[2])
            .into_par_iter()
            .map(|cell_z| {
                let layer = layer_masks(volume, bins, dims, cell_z);
                let done = layers_done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                progress(done as f32 / dims[2] as f32);
                layer
            })
            .collect();
        let (linear, nearest) = layers.into_iter().flatten().unzip();
        Self { dims, linear, nearest }
    }

    /// One mask per cell for the filter the samples use.
    pub fn masks(&self, filter: Filter) -> &[u64] {
        match filter {
            Filter::Linear => &self.linear,
            Filter::Nearest => &self.nearest,
        }
    }

    /// Every bin that occurs anywhere.
    pub fn occurring(&self, filter: Filter) -> u64 {
        self.masks(filter).iter().fold(0, |all, mask| all | mask)
    }

    /// For each bin the share of the cells whose mask holds it, 0..1: the share of the volume that
    /// an edit of the bin's values touches.
    pub fn shares(&self, filter: Filter) -> [f64; BIN_COUNT] {
        let masks = self.masks(filter);
        let counts = masks.par_chunks(MASKS_PER_TASK).map(cells_per_bin).reduce(
            || [0; BIN_COUNT],
            |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                a
            },
        );
        counts.map(|count| count as f64 / masks.len().max(1) as f64)
    }
}

fn cells_per_bin(masks: &[u64]) -> [u64; BIN_COUNT] {
    let mut counts = [0; BIN_COUNT];
    for &mask in masks {
        let mut left = mask;
        while left != 0 {
            counts[left.trailing_zeros() as usize] += 1;
            left &= left - 1;
        }
    }
    counts
}

fn layer_masks(volume: &Volume, bins: &Bins, cells: [usize; 3], cell_z: usize) -> Vec<(u64, u64)> {
    match &volume.voxels {
        Voxels::U8(v) => layer_masks_of(volume, v, f64::from, bins, cells, cell_z),
        Voxels::U16(v) => layer_masks_of(volume, v, f64::from, bins, cells, cell_z),
        Voxels::I16(v) => layer_masks_of(volume, v, f64::from, bins, cells, cell_z),
        Voxels::F32(v) => layer_masks_of(volume, v, f64::from, bins, cells, cell_z),
    }
}

fn layer_masks_of<T: Copy + PartialOrd>(
    volume: &Volume,
    voxels: &[T],
    to_f64: impl Fn(T) -> f64,
    bins: &Bins,
    cells: [usize; 3],
    cell_z: usize,
) -> Vec<(u64, u64)> {
    let data_value = |stored: T| volume.slope * to_f64(stored) + volume.intercept;
    let inner = |cell: usize, n: usize| cell * MACROCELL_EDGE..((cell + 1) * MACROCELL_EDGE).min(n);
    let footprint =
        |range: &std::ops::Range<usize>, n: usize| range.start.saturating_sub(1)..(range.end + 1).min(n);
    let [nx, ny, nz] = volume.dims;
    let mut masks = Vec::with_capacity(cells[0] * cells[1]);
    for cell_y in 0..cells[1] {
        for cell_x in 0..cells[0] {
            let (xs, ys, zs) = (inner(cell_x, nx), inner(cell_y, ny), inner(cell_z, nz));
            let (fx, fy, fz) = (footprint(&xs, nx), footprint(&ys, ny), footprint(&zs, nz));
            let first = voxels[volume.index(fx.start, fy.start, fz.start)];
            let (mut low, mut high) = (first, first);
            let mut nearest = 0u64;
            let mut last_seen: Option<T> = None;
            for z in fz {
                for y in fy.clone() {
                    let row = volume.index(0, y, z);
                    let inside = zs.contains(&z) && ys.contains(&y);
                    for x in fx.clone() {
                        let value = voxels[row + x];
                        if value < low {
                            low = value;
                        }
                        if value > high {
                            high = value;
                        }
                        if inside && xs.contains(&x) && last_seen != Some(value) {
                            nearest |= 1 << bins.bin(data_value(value));
                            last_seen = Some(value);
                        }
                    }
                }
            }
            let (a, b) = (data_value(low), data_value(high));
            masks.push((bins.mask_of_interval(a.min(b), a.max(b)), nearest));
        }
    }
    masks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Trilinear value at continuous voxel coordinates, edge values extended.
    fn sample(volume: &Volume, p: [f64; 3]) -> f64 {
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut at = [0; 3];
            for axis in 0..3 {
                let x = p[axis] - 0.5;
                let base = x.floor();
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { x - base } else { 1.0 - (x - base) };
                at[axis] = (base as i64 + upper as i64).clamp(0, volume.dims[axis] as i64 - 1) as usize;
            }
            sum += weight * volume.value(at[0], at[1], at[2]);
        }
        sum
    }

    #[test]
    fn shares_are_those_of_the_cells_a_value_occurs_in() {
        // Cells along x: zeros, zeros, a ramp from 10 to 40, forties.
        let row = [0, 0, 0, 0, 0, 0, 0, 0, 10, 20, 30, 40, 40, 40, 40, 40];
        let voxels = (0..16 * 4 * 4).map(|index| row[index % 16]).collect();
        let volume = Volume::new([16, 4, 4], Voxels::U8(voxels));
        let bins = Bins::of(&volume, [0.0, 40.0]);
        let cells = Macrocells::of(&volume, &bins, &|_| {});
        let share = |filter, value| cells.shares(filter)[bins.bin(value)];
        let of = |filter| [0.0, 10.0, 20.0, 40.0].map(|value| share(filter, value));
        assert_eq!(of(Filter::Nearest), [0.5, 0.25, 0.25, 0.5]);
        // Between the voxels of two cells the field takes the values of both.
        assert_eq!(of(Filter::Linear), [0.75, 0.5, 0.25, 0.5]);
        let touched = cells.shares(Filter::Linear).iter().filter(|share| **share > 0.0).count();
        assert_eq!(touched as u32, cells.occurring(Filter::Linear).count_ones());
    }

    #[test]
    fn every_sample_lies_in_a_bin_of_its_cell() {
        let dims = [19, 9, 25];
        let mut state = 1u32;
        let voxels: Vec<u8> = (0..dims.iter().product())
            .map(|_| {
                state = state.wrapping_mul(1664525).wrapping_add(1013904223);
                (state >> 24) as u8 / 3
            })
            .collect();
        let volume = Volume::new(dims, Voxels::U8(voxels));
        let bins = Bins::of(&volume, [0.0, 85.0]);
        let cells = Macrocells::of(&volume, &bins, &|_| {});
        assert_eq!(cells.dims, [5, 3, 7]);
        for i in 0..20_000 {
            let u =
                |k: u32| f64::from((i * 2 + 1) as u32 ^ 0x9e37).mul_add(0.618 * f64::from(k), 0.3).fract();
            let p = [u(1) * 19.0, u(3) * 9.0, u(7) * 25.0];
            let cell = p.map(|x| x as usize / MACROCELL_EDGE);
            let index = (cell[2] * cells.dims[1] + cell[1]) * cells.dims[0] + cell[0];
            let bin = bins.bin(sample(&volume, p));
            assert!(cells.masks(Filter::Linear)[index] >> bin & 1 == 1, "sample {p:?}");
            let v = p.map(|x| x as usize);
            let bin = bins.bin(volume.value(v[0], v[1], v[2]));
            assert!(cells.masks(Filter::Nearest)[index] >> bin & 1 == 1, "voxel {v:?}");
        }
    }
}
