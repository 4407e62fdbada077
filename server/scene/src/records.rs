//! Method `image_based`: where its records stand, which of them are needed, and the directions they
//! look in.
//!
//! Records stand at the centres of the cells of a coarse grid over the volume's box. Which of them a
//! sample in matter can read follows from the macrocells' bin masks alone: no record is left out for
//! which there is matter, and no voxel is read.

use glam::DVec3;
use proto::scene_file::{Illumination, Orders, RecordForm, RecordLookup};

use crate::grid::Grid;
use crate::macrocells::MACROCELL_EDGE;
use crate::scene::Scene;

/// A record is needed if a sample this share of a record cell beside its reach has matter: single
/// precision moves samples by far less.
const REACH_SLACK: f64 = 1e-3;

/// Settings of the method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Records {
    /// Records along the longest edge of the box, 2..=100.
    pub along_longest_edge: u32,
    /// The HEALPix resolution: `12 nside^2` directions.
    pub nside: u32,
    /// Bands of spherical harmonics, 1..=6.
    pub bands: u32,
    /// What a record holds.
    pub form: RecordForm,
    /// How a sample reads them.
    pub lookup: RecordLookup,
    /// Whether higher bands of the light are damped.
    pub window: bool,
    /// Rounds of exchange between records, 0..=64: none in the paper's forms.
    pub exchanges: u32,
}

impl Records {
    /// Those of a scene: no more rounds of exchange than its orders of scattering leave.
    pub fn of(scene: &Scene) -> Self {
        let settings = Self::from_file(&scene.illumination);
        match scene.orders {
            Orders::AtMost(orders) => {
                Self { exchanges: settings.exchanges.min(orders.saturating_sub(1)), ..settings }
            }
            Orders::All => settings,
        }
    }

    /// From the checked file form.
    pub fn from_file(illumination: &Illumination) -> Self {
        let nside = f64::from(illumination.record_directions / 12).sqrt().round() as u32;
        Self {
            along_longest_edge: illumination.records,
            nside,
            bands: illumination.record_bands,
            form: illumination.record_form,
            lookup: illumination.record_lookup,
            window: illumination.record_window,
            exchanges: match illumination.record_form {
                RecordForm::Product => illumination.record_exchange,
                _ => 0,
            },
        }
    }

    /// Cells of the record grid along x, y, z: as nearly cubes as whole numbers allow.
    pub fn dims(&self, grid: &Grid) -> [u32; 3] {
        let size = grid.size_world / grid.size_world.max_element();
        let along = |edge: f64| ((f64::from(self.along_longest_edge) * edge).round() as u32).max(1);
        [along(size.x), along(size.y), along(size.z)]
    }

    /// Bands of the field that matter of the scene can tell apart: isotropic scattering reads the mean
    /// radiance alone.
    pub fn bands_read(&self, scene: &Scene) -> u32 {
        use proto::scene_file::Phase;
        let matter = scene.transfer_function.points.iter();
        let mut materials = matter.map(|point| &scene.materials[point.material]);
        let directed = materials.any(|m| m.surface > 0.0 || m.phase != Phase::Isotropic);
        match self.form {
            RecordForm::Product | RecordForm::Static if directed => self.bands,
            _ => 1,
        }
    }

    /// Whether any light comes by way of records: in the form `product` they hold that from all around,
    /// of glowing matter and, where they exchange it, scattered light alone.
    pub fn are_read(&self, scene: &Scene) -> bool {
        self.form != RecordForm::Product
            || scene.glows()
            || self.exchanges > 0
            || scene.lights.iter().any(|light| light.is_environment())
    }
}

/// Centre of a record's cell, world.
pub fn position(grid: &Grid, dims: [u32; 3], record: [u32; 3]) -> DVec3 {
    let share = |axis: usize| (f64::from(record[axis]) + 0.5) / f64::from(dims[axis]);
    grid.world_from_unit(DVec3::new(share(0), share(1), share(2)))
}

/// For each record, x fastest, whether a sample in matter may read it.
pub fn needed(scene: &Scene, dims: [u32; 3], lookup: RecordLookup) -> Vec<bool> {
    let cells = &scene.volume.macrocells;
    let masks = cells.masks(scene.filter);
    let with_matter = scene.bins_with_matter();
    let [nx, ny, _] = dims.map(|n| n as usize);
    let reach: [Vec<[usize; 2]>; 3] =
        std::array::from_fn(|axis| records_read(cells.dims[axis], scene.grid.dims[axis], dims[axis], lookup));
    let mut needed = vec![false; dims.iter().map(|&n| n as usize).product()];
    for (index, mask) in masks.iter().enumerate() {
        if mask & with_matter == 0 {
            continue;
        }
        let cell = [
            index % cells.dims[0],
            index / cells.dims[0] % cells.dims[1],
            index / cells.dims[0] / cells.dims[1],
        ];
        let [[x0, x1], [y0, y1], [z0, z1]] = [0, 1, 2].map(|axis| reach[axis][cell[axis]]);
        for z in z0..=z1 {
            for y in y0..=y1 {
                needed[(z * ny + y) * nx + x0..=(z * ny + y) * nx + x1].fill(true);
            }
        }
    }
    needed
}

/// Along one axis, the first and the last record that samples in each macrocell read.
fn records_read(cells: usize, voxels: usize, records: u32, lookup: RecordLookup) -> Vec<[usize; 2]> {
    let last = records as usize - 1;
    let at = |voxel: usize, slack: f64| voxel.min(voxels) as f64 / voxels as f64 * f64::from(records) + slack;
    let clamped = |x: f64| (x.floor().max(0.0) as usize).min(last);
    let of_cell = |cell: usize| {
        let low = at(cell * MACROCELL_EDGE, -REACH_SLACK);
        let high = at((cell + 1) * MACROCELL_EDGE, REACH_SLACK);
        match lookup {
            RecordLookup::Containing => [clamped(low), clamped(high)],
            // Between the centres of two cells both are read.
            RecordLookup::Trilinear => [clamped(low - 0.5), clamped(high + 0.5)],
        }
    };
    (0..cells).map(of_cell).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proto::SceneFile;
    use serde_json::json;

    use super::*;
    use crate::{PreparedVolume, Volume, Voxels};

    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    fn volume(dims: [usize; 3], numbers: &mut Numbers) -> Arc<PreparedVolume> {
        // Mostly air, with blobs.
        let voxels: Vec<u8> = (0..dims.iter().product())
            .map(|_| if numbers.next() < 0.97 { 0 } else { (numbers.next() * 255.0) as u8 })
            .collect();
        Arc::new(PreparedVolume::new(Volume::new(dims, Voxels::U8(voxels)), &|_| {}))
    }

    fn scene(volume: &Arc<PreparedVolume>, points: serde_json::Value, filter: &str, records: u32) -> Scene {
        let file = json!({"version": 1, "volume": {"builtin": "homogeneous", "filter": filter},
            "transfer_function": {"points": points}, "illumination": {"method": "image_based", "records": records}});
        Scene::new(&SceneFile::from_value(file).unwrap(), volume.clone()).unwrap()
    }

    /// A transfer function whose matter lies in one or two windows of `s`.
    fn random_points(numbers: &mut Numbers) -> serde_json::Value {
        let mut at: Vec<f64> = (0..4).map(|_| numbers.next()).collect();
        at.sort_by(f64::total_cmp);
        let sigma = |on: bool| if on { 20.0 } else { 0.0 };
        let steps = numbers.next() < 0.5;
        let mut points = vec![json!({"s": 0, "extinction": 0})];
        for (k, s) in at.into_iter().enumerate() {
            if steps {
                points.push(json!({"s": s, "extinction": sigma(k % 2 == 1)}));
            }
            points.push(json!({"s": s, "extinction": sigma(k % 2 == 0)}));
        }
        json!(points)
    }

    /// Trilinear or nearest data value at coordinates 0..1, straight from the voxels.
    fn value_at(volume: &Volume, nearest: bool, unit: [f64; 3]) -> f64 {
        let p: [f64; 3] = std::array::from_fn(|axis| unit[axis] * volume.dims[axis] as f64);
        if nearest {
            let at: [usize; 3] = std::array::from_fn(|axis| (p[axis] as usize).min(volume.dims[axis] - 1));
            return volume.value(at[0], at[1], at[2]);
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let (mut weight, mut at) = (1.0, [0; 3]);
            for axis in 0..3 {
                let x = p[axis] - 0.5;
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { x - x.floor() } else { 1.0 - (x - x.floor()) };
                at[axis] = (x.floor() as i64 + upper as i64).clamp(0, volume.dims[axis] as i64 - 1) as usize;
            }
            sum += weight * volume.value(at[0], at[1], at[2]);
        }
        sum
    }

    /// Records that samples in matter read but that are not in `needed`; and samples with matter.
    fn missing(scene: &Scene, lookup: RecordLookup, needed: &[bool], numbers: &mut Numbers) -> [usize; 2] {
        let dims = scene_dims(scene);
        let nearest = scene.filter == proto::scene_file::Filter::Nearest;
        let (mut missing, mut with_matter) = (0, 0);
        for _ in 0..20_000 {
            let unit = [numbers.next(), numbers.next(), numbers.next()];
            let value = value_at(&scene.volume.volume, nearest, unit);
            if scene.classification().sigma_t_at(value) <= 0.0 {
                continue;
            }
            with_matter += 1;
            let shift = if lookup == RecordLookup::Trilinear { 0.5 } else { 0.0 };
            for corner in 0..if lookup == RecordLookup::Trilinear { 8 } else { 1 } {
                let mut index = 0;
                for axis in (0..3).rev() {
                    let at = (unit[axis] * f64::from(dims[axis]) - shift).floor() as i64
                        + i64::from(corner >> axis & 1);
                    index = index * dims[axis] as usize + at.clamp(0, i64::from(dims[axis]) - 1) as usize;
                }
                missing += usize::from(!needed[index]);
            }
        }
        [missing, with_matter]
    }

    fn scene_dims(scene: &Scene) -> [u32; 3] {
        Records::of(scene).dims(&scene.grid)
    }

    #[test]
    fn no_record_is_left_out_that_matter_reads() {
        let mut numbers = Numbers(7);
        let (mut left_out, mut seen) = (0, 0);
        for round in 0..24 {
            let dims = [[37, 21, 30], [64, 1, 9], [40, 40, 40]][round % 3];
            let volume = volume(dims, &mut numbers);
            let filter = if round % 4 == 3 { "nearest" } else { "linear" };
            let scene = scene(&volume, random_points(&mut numbers), filter, [10, 17, 50][round / 3 % 3]);
            for lookup in [RecordLookup::Trilinear, RecordLookup::Containing] {
                let needed = needed(&scene, scene_dims(&scene), lookup);
                let [missing, with_matter] = missing(&scene, lookup, &needed, &mut numbers);
                assert_eq!(missing, 0, "round {round}, {lookup:?}");
                left_out += needed.iter().filter(|needed| !**needed).count();
                seen += with_matter;
            }
        }
        assert!(
            left_out > 1000 && seen > 1000,
            "{left_out} records were left out, {seen} samples had matter"
        );
    }

    #[test]
    fn a_missing_record_is_noticed() {
        let mut numbers = Numbers(3);
        let volume = volume([40, 40, 40], &mut numbers);
        let scene =
            scene(&volume, json!([{"s": 0, "extinction": 0}, {"s": 0.2, "extinction": 9}]), "linear", 20);
        let mut few = needed(&scene, scene_dims(&scene), RecordLookup::Trilinear);
        let used = few.iter().position(|needed| *needed).unwrap();
        few[used..used + 400].fill(false);
        assert!(missing(&scene, RecordLookup::Trilinear, &few, &mut numbers)[0] > 0);
    }

    #[test]
    fn the_grid_follows_the_box() {
        let mut numbers = Numbers(1);
        for (dims, records, expected) in [
            ([64, 64, 64], 50, [50, 50, 50]),
            ([64, 1, 9], 100, [100, 2, 14]),
            ([100, 50, 1], 10, [10, 5, 1]),
        ] {
            let scene =
                scene(&volume(dims, &mut numbers), json!([{"s": 0, "extinction": 1}]), "linear", records);
            assert_eq!(scene_dims(&scene), expected);
            assert!(needed(&scene, expected, RecordLookup::Trilinear).iter().all(|needed| *needed));
        }
    }

    #[test]
    fn bands_are_kept_that_matter_tells_apart() {
        let volume = volume([8; 3], &mut Numbers(1));
        let scene = |material: serde_json::Value, form: &str| {
            let file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "materials": {"m": material},
                "transfer_function": {"points": [{"s": 0, "extinction": 1, "material": "m"}]},
                "illumination": {"method": "image_based", "record_bands": 4, "record_form": form}});
            Scene::new(&SceneFile::from_value(file).unwrap(), volume.clone()).unwrap()
        };
        let hg = || json!({"phase": {"type": "henyey_greenstein", "g": 0.5}});
        let bands = |scene: Scene| Records::of(&scene).bands_read(&scene);
        assert_eq!(bands(scene(json!({}), "product")), 1);
        assert_eq!(bands(scene(hg(), "product")), 4);
        assert_eq!(bands(scene(hg(), "isotropic")), 1);
        let surface = json!({"surface": 0.5, "brdf": {"type": "lambert", "diffuse": 1.0}});
        assert_eq!(bands(scene(surface, "static")), 4);
    }
}
