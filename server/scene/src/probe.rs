//! What lies under a pixel: the place a viewer points at, and the value there. On the CPU, in f64.

use glam::DVec3;
use proto::scene_file::Filter;

use crate::rendering::Rendering;
use crate::scene::Scene;
use crate::volume::Volume;

/// Steps for each voxel on the way.
const STEPS_PER_VOXEL: f64 = 2.0;
/// Most steps on a ray; longer ways are walked in longer steps.
const MAX_STEPS: f64 = 8192.0;
/// A ray whose opacity stays below this points at nothing.
const FAINTEST_OPACITY: f64 = 0.02;
/// Halvings of the step in which an isosurface lies.
const REFINEMENTS: usize = 16;

/// A place in the volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// World.
    pub position: DVec3,
    /// Indices of the voxel of the whole volume at full resolution that holds it.
    pub voxel: [usize; 3],
    /// Data value there, interpolated as in the picture.
    pub value: f64,
}

/// What a ray from `origin` along the unit vector `direction` points at, by what the scene shows:
/// in matter the place where half of the light that the ray gathers from matter comes from nearer
/// by; of an isosurface, a slice, a maximum or minimum its place. Averages have none.
pub fn probe(scene: &Scene, origin: DVec3, direction: DVec3) -> Option<Probe> {
    let [near, far] = kept_interval(scene, origin, direction)?;
    let way = Way { scene, origin, direction };
    let step = (scene.grid.smallest_voxel_edge_world() / STEPS_PER_VOXEL).max((far - near) / MAX_STEPS);
    let count = ((far - near) / step).ceil().max(1.0) as usize;
    let length = (far - near) / count as f64;
    let points = (0..=count).map(|k| near + k as f64 * length);
    let t = match scene.rendering {
        Rendering::Volume => opacity_median(&way, points, length),
        Rendering::Maximum => points.max_by(|a, b| way.value(*a).total_cmp(&way.value(*b))),
        Rendering::Minimum => points.min_by(|a, b| way.value(*a).total_cmp(&way.value(*b))),
        Rendering::Average => None,
        Rendering::Isosurface { value } => crossing(&way, points, value),
        Rendering::Slice { normal, offset } => {
            let t = (offset - normal.dot(origin)) / normal.dot(direction);
            (near..=far).contains(&t).then_some(t)
        }
    }?;
    let position = way.at(t);
    let placement = &scene.volume.placement;
    let [low, high] = placement.held.map(DVec3::from_array);
    let unit = low + scene.grid.unit_from_world(position) * (high - low);
    let dims = placement.whole_dims;
    let voxel =
        std::array::from_fn(|axis| ((unit[axis] * dims[axis] as f64).max(0.0) as usize).min(dims[axis] - 1));
    Some(Probe { position, voxel, value: way.value(t) })
}

struct Way<'a> {
    scene: &'a Scene,
    origin: DVec3,
    direction: DVec3,
}

impl Way<'_> {
    fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }

    fn value(&self, t: f64) -> f64 {
        let unit = self.scene.grid.unit_from_world(self.at(t));
        value_at(&self.scene.volume.volume, self.scene.filter, unit)
    }
}

fn opacity_median(way: &Way<'_>, points: impl Iterator<Item = f64>, length: f64) -> Option<f64> {
    let classification = way.scene.classification();
    // Opacity gathered up to each point.
    let mut gathered = Vec::new();
    let mut optical_depth = 0.0;
    for t in points {
        optical_depth += classification.sigma_t_at(way.value(t)) * length;
        gathered.push((t, 1.0 - (-optical_depth).exp()));
    }
    let total = gathered.last()?.1;
    if total < FAINTEST_OPACITY {
        return None;
    }
    gathered.into_iter().find(|&(_, opacity)| opacity >= 0.5 * total).map(|(t, _)| t)
}

fn crossing(way: &Way<'_>, points: impl Iterator<Item = f64>, value: f64) -> Option<f64> {
    let mut before: Option<(f64, bool)> = None;
    for t in points {
        let above = way.value(t) >= value;
        if let Some((mut near, was_above)) = before
            && was_above != above
        {
            let mut far = t;
            for _ in 0..REFINEMENTS {
                let middle = 0.5 * (near + far);
                if (way.value(middle) >= value) == was_above { near = middle } else { far = middle }
            }
            return Some(0.5 * (near + far));
        }
        before = Some((t, above));
    }
    None
}

/// The part of the ray ahead of the eye that is inside the box and not clipped away.
fn kept_interval(scene: &Scene, origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
    let [low, high] = scene.clip.bounds.map(|corner| scene.grid.world_from_unit(corner));
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let ends = [low[axis], high[axis]].map(|edge| (edge - origin[axis]) / direction[axis]);
        // Parallel to the slab: 0 / 0 on its border; outside of it both ends have the same sign.
        if direction[axis] == 0.0 {
            if !(low[axis]..=high[axis]).contains(&origin[axis]) {
                return None;
            }
            continue;
        }
        near = near.max(ends[0].min(ends[1]));
        far = far.min(ends[0].max(ends[1]));
    }
    let [near, far] = scene.clip.cut_by_planes(origin, direction, [near, far])?;
    (near < far && far.is_finite()).then_some([near, far])
}

/// Data value at volume coordinates 0..1; edge values extend to the faces.
fn value_at(volume: &Volume, filter: Filter, unit: DVec3) -> f64 {
    let p: [f64; 3] = std::array::from_fn(|axis| unit[axis] * volume.dims[axis] as f64);
    let clamp = |x: f64, axis: usize| x.clamp(0.0, volume.dims[axis] as f64 - 1.0) as usize;
    if filter == Filter::Nearest {
        return volume.value(clamp(p[0].floor(), 0), clamp(p[1].floor(), 1), clamp(p[2].floor(), 2));
    }
    let base = p.map(|x| (x - 0.5).floor());
    let mut sum = 0.0;
    for corner in 0..8 {
        let mut weight = 1.0;
        let at: [usize; 3] = std::array::from_fn(|axis| {
            let upper = f64::from(corner >> axis & 1);
            let share = p[axis] - 0.5 - base[axis];
            weight *= if upper == 1.0 { share } else { 1.0 - share };
            clamp(base[axis] + upper, axis)
        });
        sum += weight * volume.value(at[0], at[1], at[2]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proto::SceneFile;
    use serde_json::json;

    use super::*;
    use crate::prepared::PreparedVolume;
    use crate::volume::Voxels;

    /// Values grow by 4 a voxel along z.
    fn scene(rendering: serde_json::Value, points: serde_json::Value) -> Scene {
        let voxels = (0..4 * 4 * 64).map(|i| (i / 16 * 4) as u8).collect();
        let volume = Volume::new([4, 4, 64], Voxels::U8(voxels));
        let file = json!({
            "version": 1, "volume": {"builtin": "homogeneous"}, "value_range": [0, 255],
            "rendering": rendering, "transfer_function": {"points": points}
        });
        let file = SceneFile::from_value(file).unwrap();
        Scene::new(&file, Arc::new(PreparedVolume::new(volume, &|_| {}))).unwrap()
    }

    /// Height of the place that a ray from above points at.
    fn height(scene: &Scene) -> Option<f64> {
        let found = probe(scene, DVec3::new(0.01, 0.0, 2.0), -DVec3::Z)?;
        assert!((found.value - 4.0 * ((found.position.z + 0.5) * 64.0 - 0.5)).abs() < 1e-6, "{found:?}");
        assert_eq!(found.voxel[2], ((found.position.z + 0.5) * 64.0) as usize);
        Some(found.position.z)
    }

    #[test]
    fn points_at_what_is_shown() {
        let opaque_below = |s: f64| json!([{"s": 0, "extinction": 5000}, {"s": s, "extinction": 5000}, {"s": s, "extinction": 0}]);
        // The surface lies where the value is 102.
        let surface = (102.0 / 4.0 + 0.5) / 64.0 - 0.5;
        let volume = scene(json!({"mode": "volume"}), opaque_below(0.4));
        assert!((height(&volume).unwrap() - surface).abs() < 0.6 / 64.0);
        let iso = scene(json!({"mode": "isosurface", "isovalue": 102}), opaque_below(0.4));
        assert!((height(&iso).unwrap() - surface).abs() < 1e-5);
        let slice =
            scene(json!({"mode": "slice", "slice": {"normal": [0, 0, 1], "offset": 0.2}}), opaque_below(0.4));
        assert!((height(&slice).unwrap() - 0.2).abs() < 1e-12);
        let maximum = probe(
            &scene(json!({"mode": "maximum"}), opaque_below(0.4)),
            DVec3::new(0.01, 0.0, 2.0),
            -DVec3::Z,
        );
        assert_eq!(maximum.unwrap().value, 252.0);
    }

    #[test]
    fn nothing_is_pointed_at_where_nothing_is() {
        let empty = json!([{"s": 0, "extinction": 0}]);
        let volume = scene(json!({"mode": "volume"}), empty.clone());
        assert_eq!(height(&volume), None);
        assert!(probe(&volume, DVec3::new(3.0, 0.0, 2.0), -DVec3::Z).is_none(), "beside the box");
        assert!(probe(&volume, DVec3::new(0.0, 0.0, 2.0), DVec3::Z).is_none(), "away from it");
        assert_eq!(height(&scene(json!({"mode": "average"}), empty)), None);
    }

    #[test]
    fn what_is_clipped_is_not_pointed_at() {
        let solid = json!([{"s": 0, "extinction": 5000}]);
        let mut scene = scene(json!({"mode": "volume"}), solid);
        scene.clip.planes.push((-DVec3::Z, -0.1));
        assert!((height(&scene).unwrap() - 0.1).abs() < 1.0 / 64.0, "{:?}", height(&scene));
    }
}
