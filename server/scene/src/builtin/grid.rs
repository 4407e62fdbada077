//! From a formula to voxels: where voxel centres lie in the world, and the parallel loop.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::volume::{Volume, Voxels};

/// A point or vector in world units.
pub(crate) type Point = [f64; 3];

/// Called with the finished share, 0..1, from any thread.
pub(crate) type Progress<'a> = &'a (dyn Fn(f32) + Sync);

/// Data value 1 of the fractional fields as stored.
pub(crate) const FULL_SCALE: f64 = u16::MAX as f64;

/// Places the voxels of a grid in the world: cubic voxels, the longest edge of the box is 1
/// world unit, its centre the origin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Half the edges of the box, world units; the largest is 0.5.
    pub half: Point,
    /// Edge of a voxel, world units.
    pub voxel: f64,
}

impl Grid {
    pub fn new(dims: [usize; 3]) -> Self {
        let longest = dims[0].max(dims[1]).max(dims[2]).max(1) as f64;
        Self { dims, half: dims.map(|n| 0.5 * n as f64 / longest), voxel: 1.0 / longest }
    }

    /// World coordinate of the centre of voxel `index` along `axis`.
    pub fn center(&self, axis: usize, index: usize) -> f64 {
        // Volume coordinate first: grids whose centres coincide then agree to the last bits.
        let volume = (index as f64 + 0.5) / self.dims[axis] as f64;
        (volume - 0.5) * 2.0 * self.half[axis]
    }

    /// The voxels along `axis` whose centres may lie within `reach` of `center` (world).
    pub fn range(&self, axis: usize, center: f64, reach: f64) -> std::ops::Range<usize> {
        let index_at = |world: f64| (world + self.half[axis]) / self.voxel - 0.5;
        // A float to integer cast saturates: what lies outside the grid becomes an empty range.
        let first = index_at(center - reach).floor().max(0.0) as usize;
        let last = (index_at(center + reach).ceil() + 1.0).max(0.0) as usize;
        first.min(self.dims[axis])..last.min(self.dims[axis])
    }
}

/// Fills the grid slice by slice in parallel. `fill_slice` gets z and the slice, x fastest; it
/// must depend on nothing else, so the result does not depend on the number of threads.
pub(crate) fn fill_slices<T: Copy + Default + Send>(
    grid: &Grid,
    progress: Progress<'_>,
    fill_slice: impl Fn(usize, &mut [T]) + Sync,
) -> Vec<T> {
    let slice_len = grid.dims[0] * grid.dims[1];
    let mut voxels = vec![T::default(); slice_len * grid.dims[2]];
    let done = AtomicUsize::new(0);
    voxels.par_chunks_mut(slice_len.max(1)).enumerate().for_each(|(z, slice)| {
        fill_slice(z, slice);
        let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(finished as f32 / grid.dims[2] as f32);
    });
    voxels
}

/// Evaluates `value` at the world position of every voxel centre.
pub(crate) fn sample<T: Copy + Default + Send>(
    grid: &Grid,
    progress: Progress<'_>,
    value: impl Fn(Point) -> T + Sync,
) -> Vec<T> {
    fill_slices(grid, progress, |z, slice| {
        let z = grid.center(2, z);
        for (y, row) in slice.chunks_mut(grid.dims[0].max(1)).enumerate() {
            let y = grid.center(1, y);
            for (x, voxel) in row.iter_mut().enumerate() {
                *voxel = value([grid.center(0, x), y, z]);
            }
        }
    })
}

/// 16-bit voxels of a field with values in 0..1; what lies outside is clamped.
pub(crate) fn fraction(value: f64) -> u16 {
    (value.clamp(0.0, 1.0) * FULL_SCALE).round() as u16
}

/// A volume whose stored 0..65535 stands for data values 0..1.
pub(crate) fn fractional_volume(grid: &Grid, voxels: Vec<u16>) -> Volume {
    Volume { slope: 1.0 / FULL_SCALE, ..Volume::new(grid.dims, Voxels::U16(voxels)) }
}
