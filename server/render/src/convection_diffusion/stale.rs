//! Which cells of a light grid an edit of matter touches, and what lies behind them.

use scene::Scene;
use scene::macrocells::MACROCELL_EDGE;

use super::sweep::Cells;
use crate::uniforms::Sweep;

/// A box of cells, `high` excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// First cell along x, y, z.
    pub low: [u32; 3],
    /// One past the last.
    pub high: [u32; 3],
}

impl Region {
    /// All cells.
    pub fn all(cells: &Cells) -> Self {
        Self { low: [0; 3], high: cells.dims }
    }

    /// The smallest region that holds both.
    pub fn and(&self, other: &Self) -> Self {
        let each = |f: fn(u32, u32) -> u32, a: [u32; 3], b: [u32; 3]| std::array::from_fn(|i| f(a[i], b[i]));
        Self { low: each(u32::min, self.low, other.low), high: each(u32::max, self.high, other.high) }
    }
}

/// The region of the light grid in which matter of some bins occurs; `None`: nowhere.
pub fn changed_region(scene: &Scene, bins: u64, cells: &Cells) -> Option<Region> {
    let blocks = &scene.volume.macrocells;
    let masks = blocks.masks(scene.filter);
    let [nx, ny, _] = blocks.dims;
    let mut found: Option<Region> = None;
    for (index, _) in masks.iter().enumerate().filter(|(_, mask)| *mask & bins != 0) {
        let block = [index % nx, index / nx % ny, index / (nx * ny)];
        // Voxels of the block and the cells they reach into: samples between voxel centres read one
        // more voxel on either side.
        let cell = |axis: usize, block: usize, end: usize| {
            let voxels = scene.grid.dims[axis] as f64;
            let voxel = (block * MACROCELL_EDGE + end) as f64;
            (voxel.min(voxels) * f64::from(cells.dims[axis]) / voxels, cells.dims[axis])
        };
        let low = std::array::from_fn(|axis| {
            let (at, _) = cell(axis, block[axis], 0);
            (at.floor() as u32).saturating_sub(1)
        });
        let high = std::array::from_fn(|axis| {
            let (at, most) = cell(axis, block[axis], MACROCELL_EDGE);
            (at.ceil() as u32 + 1).min(most)
        });
        let region = Region { low, high };
        found = Some(found.map_or(region, |other| other.and(&region)));
    }
    found
}

/// The first plane of a sweep whose cells take light from a region: none before it does. `None`: no
/// plane of the sweep does.
pub fn first_plane_within(sweep: &Sweep, region: &Region) -> Option<u32> {
    let axis = sweep.axis as usize;
    let (low, high) = match sweep.forward {
        1 => (region.low[axis], region.high[axis]),
        _ => (sweep.cells[0] - region.high[axis], sweep.cells[0] - region.low[axis]),
    };
    // A sweep that begins beyond the region never meets it.
    (high > sweep.start_plane).then_some(low.max(sweep.start_plane))
}
