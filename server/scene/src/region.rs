//! The data values of what the clip region keeps.

use std::ops::Range;

use rayon::prelude::*;

use crate::prepared::{HISTOGRAM_BUCKETS, add_counts, bucket_of};
use crate::scene::Scene;

/// Voxels inside the clip region, box and planes, per bucket of the display histogram: buckets of
/// equal width over the range of the whole volume. A voxel is inside if its centre is.
///
/// Reads each of those voxels once, on all cores.
pub fn histogram_in_clip(scene: &Scene) -> Vec<u64> {
    let prepared = &scene.volume;
    if is_whole(scene) {
        return prepared.histogram.clone();
    }
    let volume = &prepared.volume;
    let [_, ny, nz] = volume.dims;
    let bucket = bucket_of(volume, prepared.range);
    (0..nz)
        .into_par_iter()
        .map(|z| {
            let mut counts = vec![0; HISTOGRAM_BUCKETS];
            for y in 0..ny {
                let row = volume.index(0, y, z);
                for x in kept_of_row(scene, y, z) {
                    counts[bucket(volume.voxels.stored(row + x))] += 1;
                }
            }
            counts
        })
        .reduce(|| vec![0; HISTOGRAM_BUCKETS], add_counts)
}

fn is_whole(scene: &Scene) -> bool {
    let [low, high] = scene.clip.bounds;
    scene.clip.planes.is_empty() && low.max_element() <= 0.0 && high.min_element() >= 1.0
}

/// The voxels of a row along x whose centres are kept. The region is convex: they are neighbours.
fn kept_of_row(scene: &Scene, y: usize, z: usize) -> Range<usize> {
    let dims = scene.grid.dims.map(|n| n as f64);
    let [low, high] = scene.clip.bounds;
    // Volume coordinates of the row; its first voxel's centre lies at x = 0.5 voxels.
    let unit = |x: f64| glam::DVec3::new(x / dims[0], (y as f64 + 0.5) / dims[1], (z as f64 + 0.5) / dims[2]);
    let row = unit(0.0);
    let outside = |axis: usize| !(low[axis]..=high[axis]).contains(&row[axis]);
    if outside(1) || outside(2) {
        return 0..0;
    }
    let box_interval = [low.x * dims[0], high.x * dims[0]];
    let start = scene.grid.world_from_unit(row);
    let along = scene.grid.world_from_unit(unit(1.0)) - start;
    let Some([near, far]) = scene.clip.cut_by_planes(start, along, box_interval) else { return 0..0 };
    // Centres at or after `near` and at or before `far`; negative numbers become 0.
    let first = (near - 0.5).ceil() as usize;
    let end = ((far - 0.5).floor() + 1.0).min(dims[0]) as usize;
    first..end.max(first)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use proto::SceneFile;
    use serde_json::json;

    use super::*;
    use crate::prepared::PreparedVolume;
    use crate::volume::{Volume, Voxels};

    const DIMS: [usize; 3] = [12, 10, 7];

    fn scene() -> Scene {
        let voxels = (0..DIMS.iter().product()).map(|index: usize| (index * 37 % 251) as u8).collect();
        let mut volume = Volume::new(DIMS, Voxels::U8(voxels));
        volume.spacing = [1.0, 0.7, 2.0];
        let file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
            "transfer_function": {"points": [{"s": 0, "extinction": 1}]}});
        let file = SceneFile::from_value(file).unwrap();
        Scene::new(&file, Arc::new(PreparedVolume::new(volume, &|_| {}))).unwrap()
    }

    /// Every voxel asked by itself.
    fn voxel_by_voxel(scene: &Scene) -> Vec<u64> {
        let volume = &scene.volume.volume;
        let bucket = bucket_of(volume, scene.volume.range);
        let mut counts = vec![0; HISTOGRAM_BUCKETS];
        for index in 0..volume.voxels.len() {
            let at = [index % DIMS[0], index / DIMS[0] % DIMS[1], index / (DIMS[0] * DIMS[1])];
            let unit =
                DVec3::from_array(std::array::from_fn(|axis| (at[axis] as f64 + 0.5) / DIMS[axis] as f64));
            let world = scene.grid.world_from_unit(unit);
            let [low, high] = scene.clip.bounds;
            let in_box = unit.cmpge(low).all() && unit.cmple(high).all();
            if in_box && scene.clip.planes.iter().all(|(normal, offset)| normal.dot(world) >= *offset) {
                counts[bucket(volume.voxels.stored(index))] += 1;
            }
        }
        counts
    }

    #[test]
    fn rows_are_cut_where_single_voxels_are() {
        let planes = [
            (DVec3::new(1.0, 2.0, -0.5), 0.031),
            (DVec3::new(-1.0, 0.3, 0.2), -0.17),
            (DVec3::new(0.2, -1.0, 1.0), -0.09),
            (DVec3::Y, 0.013),
            (DVec3::X, 3.0),
        ];
        // Corners of the box, and which planes.
        for (low, high, cut) in [
            (0.0, 1.0, 0..0),
            (0.21, 0.77, 0..0),
            (0.0, 1.0, 0..1),
            (0.1, 0.9, 1..3),
            (0.0, 1.0, 3..4),
            (0.0, 1.0, 4..5),
        ] {
            let mut scene = scene();
            scene.clip.bounds = [DVec3::splat(low), DVec3::splat(high)];
            scene.clip.planes = planes[cut].iter().map(|(n, offset)| (n.normalize(), *offset)).collect();
            assert_eq!(histogram_in_clip(&scene), voxel_by_voxel(&scene), "{:?}", scene.clip);
        }
    }

    #[test]
    fn parts_of_a_cut_make_up_the_whole() {
        let mut scene = scene();
        let whole = histogram_in_clip(&scene);
        assert_eq!(whole.iter().sum::<u64>(), 12 * 10 * 7);
        let normal = DVec3::new(0.3, -0.8, 0.5).normalize();
        scene.clip.planes = vec![(normal, 0.0123)];
        let kept = histogram_in_clip(&scene);
        scene.clip.planes = vec![(-normal, -0.0123)];
        assert_eq!(add_counts(kept.clone(), histogram_in_clip(&scene)), whole);
        assert!(kept.iter().sum::<u64>() > 100 && kept != whole);
    }
}
