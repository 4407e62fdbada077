//! Which texels of a field light in matter can fall to. The field of a volume lies between two values in
//! each cell between texel centres, whatever the transfer function; where none of them is matter no photon
//! has ever interacted, and what a texel got from there is nothing.

use glam::DVec3;
use proto::scene_file::Filter;
use rayon::prelude::*;
use scene::{Scene, Volume};

use crate::photon_map::stale::kept;

/// By how much cells are taken to be larger, in voxels and in texels: rounding of places in f32.
const SLACK: f64 = 1e-2;
/// By how much values may be off, as a share of the data's range.
const VALUE_SLACK: f64 = 1e-4;

/// Smallest and largest value.
type Span = [f32; 2];
const NOTHING: Span = [f32::INFINITY, f32::NEG_INFINITY];

/// Bins that the field takes around each cell between texel centres, one more than texels along each axis.
pub struct Reach {
    pub dims: [u32; 3],
    volume: [u8; 32],
    nearest: bool,
    cells: Vec<u64>,
}

impl Reach {
    /// Reads every voxel once.
    pub fn of(scene: &Scene, dims: [u32; 3]) -> Self {
        let prepared = &scene.volume;
        let volume = &prepared.volume;
        let nearest = scene.filter == Filter::Nearest;
        let voxels = |axis: usize| voxels_of_cells(volume.dims[axis], dims[axis], nearest);
        let [xs, ys, zs] = [0, 1, 2].map(voxels);
        let layers: Vec<Vec<Span>> =
            (0..volume.dims[2]).into_par_iter().map(|z| layer(volume, z, &xs, &ys)).collect();
        let [low, high] = prepared.range;
        let slack = VALUE_SLACK * (high - low);
        let bins = |[a, b]: Span| prepared.bins.mask_of_interval(f64::from(a) - slack, f64::from(b) + slack);
        let cells_of = |[first, last]: &[usize; 2]| {
            let mut spans = vec![NOTHING; xs.len() * ys.len()];
            for layer in &layers[*first..=*last] {
                spans.iter_mut().zip(layer).for_each(|(span, more)| *span = joined(*span, *more));
            }
            spans.into_iter().map(bins).collect::<Vec<u64>>()
        };
        let cells = zs.par_iter().map(cells_of).collect::<Vec<_>>().concat();
        Self { dims, volume: prepared.content, nearest, cells }
    }

    /// Whether it holds for the scene's volume in a field of so many texels.
    pub fn serves(&self, scene: &Scene, dims: [u32; 3]) -> bool {
        let is_same =
            self.volume == scene.volume.content && self.nearest == (scene.filter == Filter::Nearest);
        is_same && self.dims == dims
    }

    /// Texels around which there may be matter that is not clipped away, in their order.
    pub fn texels(&self, scene: &Scene) -> Vec<u32> {
        let matter = scene.bins_with_matter();
        let [width, height, depth] = self.dims.map(|n| n as usize);
        let across = [width + 1, height + 1];
        let mut found = vec![false; width * height * depth];
        for (index, bins) in self.cells.iter().enumerate() {
            let cell = [index % across[0], index / across[0] % across[1], index / (across[0] * across[1])];
            if bins & matter == 0 || kept(scene, &self.corners(cell)) == Some(false) {
                continue;
            }
            // At the border both corners of a cell may be the same texel.
            let texels =
                |axis: usize| cell[axis].saturating_sub(1)..=cell[axis].min(self.dims[axis] as usize - 1);
            for z in texels(2) {
                for y in texels(1) {
                    texels(0).for_each(|x| found[(z * height + y) * width + x] = true);
                }
            }
        }
        (0..found.len() as u32).filter(|&texel| found[texel as usize]).collect()
    }

    /// Of a cell, in the unit box.
    fn corners(&self, cell: [usize; 3]) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            DVec3::from_array([0, 1, 2].map(|axis| {
                let side = if corner >> axis & 1 == 1 { 0.5 + SLACK } else { -0.5 - SLACK };
                ((cell[axis] as f64 + side) / f64::from(self.dims[axis])).clamp(0.0, 1.0)
            }))
        })
    }
}

/// First and last voxel along an axis that the field in each cell between texel centres depends on.
fn voxels_of_cells(voxels: usize, texels: u32, nearest: bool) -> Vec<[usize; 2]> {
    let (n, last) = (voxels as f64, voxels as f64 - 1.0);
    let at = |cell: u32, side: f64| (f64::from(cell) + side) / f64::from(texels) * n;
    let footprint = |cell| {
        let (low, high) = (at(cell, -0.5 - SLACK) - SLACK, at(cell, 0.5 + SLACK) + SLACK);
        let (first, end) = if nearest { (low, high) } else { (low - 0.5, high + 0.5) };
        [first.floor().clamp(0.0, last) as usize, end.floor().clamp(0.0, last) as usize]
    };
    (0..=texels).map(footprint).collect()
}

fn joined(a: Span, b: Span) -> Span {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Of one layer of voxels: their span in each cell's footprint, x fastest.
fn layer(volume: &Volume, z: usize, xs: &[[usize; 2]], ys: &[[usize; 2]]) -> Vec<Span> {
    let across = |y: usize| {
        let values: Vec<f32> = (0..volume.dims[0]).map(|x| volume.value(x, y, z) as f32).collect();
        let span = |[first, last]: &[usize; 2]| {
            values[*first..=*last].iter().fold(NOTHING, |span, &value| joined(span, [value; 2]))
        };
        xs.iter().map(span).collect::<Vec<Span>>()
    };
    let rows: Vec<Vec<Span>> = (0..volume.dims[1]).map(across).collect();
    let mut spans = Vec::with_capacity(xs.len() * ys.len());
    for [first, last] in ys {
        let joined = |x: usize| rows[*first..=*last].iter().fold(NOTHING, |span, row| joined(span, row[x]));
        spans.extend((0..xs.len()).map(joined));
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::balls;
    use serde_json::json;
    use std::sync::Arc;

    fn scene(volume: &Arc<scene::PreparedVolume>, patch: serde_json::Value) -> Scene {
        let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
            "transfer_function": {"points": [{"s": 0.5, "extinction": 0}, {"s": 0.6, "extinction": 9}]}});
        json_patch::merge(&mut file, &patch);
        Scene::new(&proto::SceneFile::from_value(file).unwrap(), volume.clone()).unwrap()
    }

    /// Every place with matter has rows for the texels around it.
    #[test]
    fn no_texel_is_left_out_that_matter_is_near() {
        let volume = balls(20);
        let halves = json!({"clip": {"box": [[0, 0, 0], [1, 0.5, 1]]}});
        for (patch, dims) in [
            (json!({}), [16, 7, 33]),
            (json!({"volume": {"filter": "nearest"}}), [5, 20, 12]),
            (halves, [16; 3]),
        ] {
            let scene = scene(&volume, patch);
            let texels = Reach::of(&scene, dims).texels(&scene);
            assert!(!texels.is_empty() && texels.len() < dims.iter().product::<u32>() as usize / 2);
            for i in 0..20_000 {
                let u = |k: u32| (f64::from(i) * [0.754_877, 0.569_84, 0.362_9][k as usize]).fract();
                let at = DVec3::new(u(0), u(1), u(2));
                let voxel = |axis: usize| at[axis] * 20.0;
                let value = if scene.filter == Filter::Nearest {
                    let v = [0, 1, 2].map(|axis| voxel(axis) as usize);
                    volume.volume.value(v[0], v[1], v[2])
                } else {
                    trilinear(&volume.volume, [0, 1, 2].map(voxel))
                };
                let [low, high] = scene.value_range;
                let s = ((value - low) / (high - low)).clamp(0.0, 1.0);
                let is_kept = at.cmpge(scene.clip.bounds[0]).all() && at.cmple(scene.clip.bounds[1]).all();
                if scene.transfer_function.at(s).sigma_t <= 0.0 || !is_kept {
                    continue;
                }
                for corner in 0..8 {
                    let texel = [0, 1, 2].map(|axis| {
                        let low =
                            (at[axis] * f64::from(dims[axis]) - 0.5).floor() + f64::from(corner >> axis & 1);
                        low.clamp(0.0, f64::from(dims[axis] - 1)) as u32
                    });
                    let index = (texel[2] * dims[1] + texel[1]) * dims[0] + texel[0];
                    assert!(texels.binary_search(&index).is_ok(), "{at} {texel:?}");
                }
            }
        }
    }

    fn trilinear(volume: &Volume, at: [f64; 3]) -> f64 {
        (0..8).fold(0.0, |sum, corner| {
            let mut weight = 1.0;
            let voxel = [0, 1, 2].map(|axis| {
                let low = (at[axis] - 0.5).floor();
                let part = at[axis] - 0.5 - low;
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { part } else { 1.0 - part };
                (low + f64::from(upper)).clamp(0.0, volume.dims[axis] as f64 - 1.0) as usize
            });
            sum + weight * volume.value(voxel[0], voxel[1], voxel[2])
        })
    }
}
