//! Which rays of records an edit makes stale.
//!
//! A ray's transmittance depends on the extinction along it alone. So an edit of matter concerns the
//! rays that meet a macrocell with a bin in which extinction changed (where matter glows: or albedo or
//! emission), and those are found by walking over a distance map of such cells. A light that moved
//! concerns its own rays.

use glam::DVec3;
use scene::distance::distance_map;
use scene::light::Light;
use scene::spherical::healpix;
use scene::{Records, Scene};

use super::arriving::has_own_ray;
use crate::direct_light::{changed_bins, kept_region};

/// What is to be done with the rays of a column; as in shaders/image_based/records.wgsl.
const KEEP: f32 = 0.0;
const TEST: f32 = 1.0;
const CAST: f32 = 2.0;

/// What becomes of the rays of records that stem from one scene.
pub struct Stale {
    /// Of each column the direction, if it is the same for all records, and what is to be done.
    columns: Vec<[f32; 4]>,
    /// Bins in which what a ray sees changed.
    bins: u64,
}

impl Stale {
    /// Nothing was cast before.
    pub fn everything(nside: u32, scene: &Scene) -> Self {
        staleness(None, scene, nside)
    }

    /// Whether any ray may have to be cast.
    pub fn any(&self) -> bool {
        self.columns.iter().any(|column| column[3] != KEEP)
    }

    pub fn columns(&self) -> &[[f32; 4]] {
        &self.columns
    }

    /// Distances to cells that make a ray stale, where some rays are to be tested.
    pub fn distances(&self, scene: &Scene) -> Option<Vec<u8>> {
        let cells = &scene.volume.macrocells;
        let tests = self.columns.iter().any(|column| column[3] == TEST);
        tests.then(|| distance_map(cells.dims, cells.masks(scene.filter), self.bins))
    }
}

/// What becomes, for `new`, of rays cast for `old`, both of one volume.
pub fn staleness(old: Option<&Scene>, new: &Scene, nside: u32) -> Stale {
    let bins = old.map_or(u64::MAX, |old| changed_bins(old, new, old.glows() || new.glows()));
    let all = match old {
        None => CAST,
        Some(old) if kept_region(old) != kept_region(new) => CAST,
        Some(_) if bins & new.volume.macrocells.occurring(new.filter) != 0 => TEST,
        Some(_) => KEEP,
    };
    let before: Vec<&Light> = old.map_or_else(Vec::new, own_lights);
    let own = own_lights(new);
    let centres = healpix::centres(nside as usize).into_iter().map(|towards| column(towards, all));
    let own = own.iter().enumerate().map(|(i, light)| {
        let same = before.get(i).is_some_and(|before| before.geometry == light.geometry);
        let direction = match light.geometry {
            scene::light::LightGeometry::Directional { direction } => -direction,
            _ => DVec3::Z,
        };
        column(direction, if same { all } else { CAST })
    });
    Stale { columns: centres.chain(own).collect(), bins }
}

fn column(direction: DVec3, todo: f32) -> [f32; 4] {
    direction.as_vec3().extend(todo).to_array()
}

fn own_lights(scene: &Scene) -> Vec<&Light> {
    let form = Records::of(scene).form;
    scene.lights.iter().filter(|light| has_own_ray(light, form)).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proto::SceneFile;
    use scene::{PreparedVolume, Volume, Voxels};
    use serde_json::{Value, json};

    use super::*;

    fn scene(patch: Value) -> Scene {
        let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
            "lights": [{"id": "a", "type": "point", "position": [0, 2, 0], "intensity": [1, 1, 1]},
                {"id": "b", "type": "point", "position": [2, 0, 0], "intensity": [1, 1, 1]}],
            "transfer_function": {"points": [{"s": 0, "extinction": 1}, {"s": 0.5, "extinction": 2}]},
            "illumination": {"method": "image_based", "record_form": "static"}});
        for (key, value) in patch.as_object().unwrap() {
            file[key] = value.clone();
        }
        let voxels = (0..512).map(|i| (i / 2) as u8).collect();
        let volume = Arc::new(PreparedVolume::new(Volume::new([8; 3], Voxels::U8(voxels)), &|_| {}));
        Scene::new(&SceneFile::from_value(file).unwrap(), volume).unwrap()
    }

    /// What is to be done with the rays of directions, of light a, and of light b.
    fn done(old: Value, new: Value) -> [f32; 3] {
        let stale = staleness(Some(&scene(old)), &scene(new), 1);
        assert_eq!(stale.columns.len(), 14);
        [0, 12, 13].map(|column| stale.columns[column][3])
    }

    fn points(point: Value) -> Value {
        json!({"transfer_function": {"points": [{"s": 0, "extinction": 1}, point]}})
    }

    #[test]
    fn rays_are_stale_where_extinction_changed() {
        assert_eq!(done(json!({}), json!({})), [KEEP; 3]);
        assert_eq!(done(json!({}), points(json!({"s": 0.5, "extinction": 3}))), [TEST; 3]);
        let colour = points(json!({"s": 0.5, "extinction": 2, "albedo": [1, 0, 0]}));
        assert_eq!(done(json!({}), colour.clone()), [KEEP; 3], "colours are not on the way");
        let glowing = points(json!({"s": 0.5, "extinction": 2, "emission": [1, 0, 0]}));
        assert_eq!(done(colour, glowing), [TEST; 3], "but light is");
        assert_eq!(done(json!({}), json!({"density": 2})), [TEST; 3]);
        assert_eq!(done(json!({}), json!({"value_range": [0, 100]})), [TEST; 3]);
    }

    #[test]
    fn clipped_matter_matters_where_it_lets_light_pass() {
        let clip = |x: f64, shadows| json!({"clip": {"box": [[0, 0, 0], [x, 1, 1]], "shadows": shadows}});
        assert_eq!(done(clip(1.0, true), clip(0.5, true)), [KEEP; 3]);
        assert_eq!(done(clip(1.0, false), clip(0.5, false)), [CAST; 3]);
        assert_eq!(done(clip(0.5, true), clip(0.5, false)), [CAST; 3]);
    }

    #[test]
    fn a_light_that_moved_has_new_rays_and_no_other() {
        let moved = json!({"lights": [{"id": "a", "type": "point", "position": [0, 2, 0.1], "intensity": [1, 1, 1]},
            {"id": "b", "type": "point", "position": [2, 0, 0], "intensity": [5, 1, 1]}]});
        assert_eq!(done(json!({}), moved), [KEEP, CAST, KEEP]);
        let fewer =
            json!({"lights": [{"id": "b", "type": "point", "position": [2, 0, 0], "intensity": [1, 1, 1]}]});
        let stale = staleness(Some(&scene(json!({}))), &scene(fewer), 1);
        assert_eq!((stale.columns[0][3], stale.columns[12][3]), (KEEP, CAST));
    }
}
