//! Upper bounds of the extinction on a grid of blocks, and the way of a ray through it.

use rayon::prelude::*;

use crate::matter::Field;
use crate::region::Ray;

/// Most blocks along an axis: 2 MB of bounds, and few enough borders that crossing them costs
/// less than reading the field.
const MAX_BLOCKS: usize = 64;
/// Bounds are taken over this much more of `s`, to cover rounding of an interpolated value.
const ROUNDING: f64 = 1e-12;

/// A bound for each block.
pub struct Majorants {
    /// Voxels along a block's edge.
    edge: usize,
    blocks: [usize; 3],
    bounds: Vec<f64>,
}

/// A part of a ray within one block.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    /// Where the part begins.
    pub near: f64,
    /// Where it ends.
    pub far: f64,
    /// Upper bound of the extinction on it.
    pub majorant: f64,
}

impl Majorants {
    /// Scans the field on all cores.
    pub fn new(field: &Field<'_>) -> Self {
        let dims = field.dims();
        let longest = dims[0].max(dims[1]).max(dims[2]);
        let edge = longest.div_ceil(MAX_BLOCKS);
        let blocks = dims.map(|n| n.div_ceil(edge));
        let bound = |block: usize| {
            let at = [block % blocks[0], block / blocks[0] % blocks[1], block / (blocks[0] * blocks[1])];
            // Interpolation inside a block reads the voxels within half a voxel of it.
            let ranges: [_; 3] = std::array::from_fn(|axis| {
                let first = (at[axis] * edge).saturating_sub(1);
                first..=((at[axis] + 1) * edge).min(dims[axis] - 1)
            });
            let [xs, ys, zs] = ranges;
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        let s = field.s_of_voxel((z * dims[1] + y) * dims[0] + x);
                        low = low.min(s);
                        high = high.max(s);
                    }
                }
            }
            let [low, high] = [low - ROUNDING, high + ROUNDING].map(|s| s.clamp(0.0, 1.0));
            field.largest_sigma_t(low, high)
        };
        let bounds = (0..blocks[0] * blocks[1] * blocks[2]).into_par_iter().map(bound).collect();
        Self { edge, blocks, bounds }
    }

    /// The parts of a ray in the order it passes them.
    pub fn walk(&self, field: &Field<'_>, ray: &Ray, [near, far]: [f64; 2]) -> Walk<'_> {
        let scale = 1.0 / self.edge as f64;
        // Block coordinates are linear in t.
        let start = field.voxel_from_world(ray.at(near)) * scale;
        let slope = ray.direction / field.voxel_size() * scale;
        let mut walk = Walk {
            majorants: self,
            at: [0; 3],
            step: [0; 3],
            next: [f64::INFINITY; 3],
            delta: [f64::INFINITY; 3],
            near,
            far,
        };
        for axis in 0..3 {
            let block = start[axis].floor().clamp(0.0, (self.blocks[axis] - 1) as f64);
            walk.at[axis] = block as i64;
            if slope[axis] != 0.0 {
                walk.step[axis] = if slope[axis] > 0.0 { 1 } else { -1 };
                let border = if slope[axis] > 0.0 { block + 1.0 } else { block };
                walk.next[axis] = near + (border - start[axis]) / slope[axis];
                walk.delta[axis] = 1.0 / slope[axis].abs();
            }
        }
        walk
    }

    /// The bound of the block around a world position.
    #[cfg(test)]
    pub fn at(&self, field: &Field<'_>, x: glam::DVec3) -> f64 {
        let p = field.voxel_from_world(x) / self.edge as f64;
        let block: [usize; 3] = std::array::from_fn(|axis| (p[axis] as usize).min(self.blocks[axis] - 1));
        self.bounds[(block[2] * self.blocks[1] + block[1]) * self.blocks[0] + block[0]]
    }
}

/// Iterates over the spans of a ray.
pub struct Walk<'a> {
    majorants: &'a Majorants,
    at: [i64; 3],
    step: [i64; 3],
    /// Distance at which each axis' next border is crossed.
    next: [f64; 3],
    delta: [f64; 3],
    near: f64,
    far: f64,
}

impl Iterator for Walk<'_> {
    type Item = Span;

    fn next(&mut self) -> Option<Span> {
        if self.near >= self.far {
            return None;
        }
        let blocks = self.majorants.blocks.map(|n| n as i64);
        let [x, y, z] = self.at;
        let majorant = self.majorants.bounds[((z * blocks[1] + y) * blocks[0] + x) as usize];
        let axis = (0..3).min_by(|a, b| self.next[*a].total_cmp(&self.next[*b])).unwrap_or(0);
        let near = self.near;
        let stepped = self.at[axis] + self.step[axis];
        if (0..blocks[axis]).contains(&stepped) && self.next[axis] < self.far {
            self.near = self.next[axis].max(near);
            self.at[axis] = stepped;
            self.next[axis] += self.delta[axis];
        } else {
            // The last block reaches to the end, whatever rounding says.
            self.near = self.far;
        }
        Some(Span { near, far: self.near, majorant })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use proto::SceneFile;
    use proto::scene_file::Filter;
    use scene::{PreparedVolume, Scene, Volume, Voxels};
    use serde_json::json;

    use super::*;
    use crate::random::Random;

    /// Noise under a transfer function with a peak, a step and a gap between voxel values.
    fn scene(dims: [usize; 3], filter: Filter) -> Scene {
        let mut random = Random::new(1, 2, 3);
        let voxels = (0..dims.iter().product()).map(|_| (256.0 * random.unit()) as u8).collect();
        let mut volume = Volume::new(dims, Voxels::U8(voxels));
        volume.spacing = [1.0, 0.7, 1.9];
        let file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "value_range": [20, 240],
            "transfer_function": {"points": [
                {"s": 0.1, "extinction": 0}, {"s": 0.401, "extinction": 0}, {"s": 0.402, "extinction": 90},
                {"s": 0.403, "extinction": 0}, {"s": 0.7, "extinction": 0}, {"s": 0.7, "extinction": 30},
                {"s": 0.9, "extinction": 5}]}});
        let file = SceneFile::from_value(file).unwrap();
        let scene = Scene::new(&file, Arc::new(PreparedVolume::new(volume, &|_| {}))).unwrap();
        Scene { filter, ..scene }
    }

    #[test]
    fn bounds_hold_everywhere_between_voxels_too() {
        for (dims, filter) in
            [([9, 8, 7], Filter::Linear), ([9, 8, 7], Filter::Nearest), ([130, 3, 70], Filter::Linear)]
        {
            let scene = scene(dims, filter);
            let field = Field::new(&scene);
            let majorants = Majorants::new(&field);
            let mut random = Random::new(4, 5, 6);
            let mut largest_share: f64 = 0.0;
            for _ in 0..200_000 {
                let unit = DVec3::new(random.unit(), random.unit(), random.unit());
                let x = (unit - 0.5) * scene.grid.size_world;
                let (sigma_t, bound) = (field.sigma_t(field.s(x)), majorants.at(&field, x));
                assert!(sigma_t <= bound, "{x}: {sigma_t} {bound}");
                largest_share = largest_share.max(sigma_t / bound.max(1e-9));
            }
            assert!(largest_share > 0.3, "bounds are not idle: {largest_share}");
        }
    }

    #[test]
    fn spans_cover_a_ray_in_order_each_in_its_block() {
        let scene = scene([130, 3, 70], Filter::Linear);
        let field = Field::new(&scene);
        let majorants = Majorants::new(&field);
        let region = crate::region::Region::whole(&scene);
        let mut random = Random::new(7, 8, 9);
        let mut rays = 0;
        while rays < 2000 {
            let origin = 2.0 * (DVec3::new(random.unit(), random.unit(), random.unit()) - 0.5);
            let mut direction = crate::frame::on_sphere(random.pair());
            if rays % 3 == 0 {
                direction = DVec3::AXES[rays / 3 % 3];
            }
            let ray = Ray { origin, direction };
            let Some([near, far]) = region.interval(&ray) else {
                rays += usize::from(rays % 3 == 0);
                continue;
            };
            rays += 1;
            let mut end = near;
            for span in majorants.walk(&field, &ray, [near, far]) {
                assert_eq!(span.near, end);
                end = span.far;
                let inside = majorants.at(&field, ray.at(0.5 * (span.near + span.far)));
                assert!(span.majorant == inside || span.far - span.near < 1e-9, "{ray:?} {span:?} {inside}");
            }
            assert_eq!(end, far);
        }
    }
}
