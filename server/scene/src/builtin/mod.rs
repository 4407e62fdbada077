//! Built-in volumes: fields given by formulas, so that a scene needs no data file.
//!
//! Every field is a function of the world position (box with longest edge 1, centred at the
//! origin, cubic voxels), sampled at voxel centres: any size shows the same thing, and a box that
//! is flatter in one direction shows a slab of it. Only [`cornell_box`] follows the faces of the
//! box; [`pillars`] puts its floor and heights by them. All arithmetic is IEEE operations and
//! `libm`, so the voxels are the same on every machine and for any number of threads.
//!
//! | name | voxels | data values |
//! |---|---|---|
//! | `cornell_box` | u8 | labels, see [`cornell_box`] |
//! | `pillars` | u16 | 0 air, 0.4 floor, 1 pillars |
//! | `buckyball` | u16 | density 0..1, about 1 at the atoms |
//! | `smoke_plume` | u16 | density 0..1 |
//! | `vessel_tree` | u16 | 0 outside, 0.5 on the wall, 1 inside |
//! | `thick_blob` | u16 | 0 outside, 1 deep inside |
//! | `nested_shells` | u16 | 0.25, 0.5, 0.75, 1 from the outermost shell to the core, 0 between |
//! | `marschner_lobb` | f32 | the signal, 0..1 |
//! | `homogeneous` | u8 | 255 everywhere |
//!
//! u16 voxels carry slope 1/65535, so the data values are 0..1 as in the table. Where a scene
//! gives no `value_range`, the range of the data present is used, which depends on the size and
//! is empty for `homogeneous`; the scenes here therefore give it ([0, 1]; [0, 5] for the labels;
//! [0, 255] for `homogeneous`).

pub mod buckyball;
pub mod cornell_box;
mod grid;
pub mod marschner_lobb;
mod noise;
pub mod pillars;
pub mod round;
mod smoke_plume;
mod vector;
mod vessel_tree;

use proto::FieldError;
use proto::scene_file::{Builtin, SceneFile};

use crate::volume::{Volume, Voxels};
use grid::{Grid, fraction, fractional_volume, sample};

/// Size where neither a scene nor the caller gives one, voxels along x, y, z.
pub const DEFAULT_DIMS: [usize; 3] = [64; 3];

/// Stored value of every voxel of `homogeneous`.
pub const HOMOGENEOUS_VALUE: u8 = u8::MAX;

/// Computes a volume of `dims` voxels (each edge at least 1) on all threads of the current
/// rayon pool.
///
/// `progress` is called with the finished share, 0..1, after each z slice, from any thread and
/// not necessarily in order. Needs 1 to 4 bytes per voxel (see the table above); the caller
/// bounds `dims`.
pub fn build(kind: Builtin, dims: [usize; 3], progress: &(dyn Fn(f32) + Sync)) -> Volume {
    let grid = Grid::new(dims);
    let labels = |label: &(dyn Fn(grid::Point) -> u8 + Sync)| {
        Volume::new(dims, Voxels::U8(sample(&grid, progress, label)))
    };
    let fractions = |value: &(dyn Fn(grid::Point) -> f64 + Sync)| {
        fractional_volume(&grid, sample(&grid, progress, |p| fraction(value(p))))
    };
    match kind {
        Builtin::CornellBox => labels(&|p| cornell_box::label(&grid, p)),
        Builtin::Pillars => {
            let layout = pillars::layout(&grid);
            fractions(&|p| pillars::value(&grid, &layout, p))
        }
        Builtin::Buckyball => {
            let molecule = buckyball::Molecule::new();
            fractions(&|p| molecule.density(p))
        }
        Builtin::SmokePlume => fractions(&smoke_plume::density),
        Builtin::VesselTree => fractional_volume(&grid, vessel_tree::voxels(&grid, progress)),
        Builtin::ThickBlob => fractions(&round::thick_blob),
        Builtin::NestedShells => fractions(&round::nested_shells),
        Builtin::MarschnerLobb => {
            let signal = |p| marschner_lobb::value(p) as f32;
            Volume::new(dims, Voxels::F32(sample(&grid, progress, signal)))
        }
        Builtin::Homogeneous => labels(&|_| HOMOGENEOUS_VALUE),
    }
}

/// The scene that shows a volume at its best, as JSON text.
pub fn scene_json(kind: Builtin) -> &'static str {
    match kind {
        Builtin::CornellBox => include_str!("../../scenes/cornell_box.json"),
        Builtin::Pillars => include_str!("../../scenes/pillars.json"),
        Builtin::Buckyball => include_str!("../../scenes/buckyball.json"),
        Builtin::SmokePlume => include_str!("../../scenes/smoke_plume.json"),
        Builtin::VesselTree => include_str!("../../scenes/vessel_tree.json"),
        Builtin::ThickBlob => include_str!("../../scenes/thick_blob.json"),
        Builtin::NestedShells => include_str!("../../scenes/nested_shells.json"),
        Builtin::MarschnerLobb => include_str!("../../scenes/marschner_lobb.json"),
        Builtin::Homogeneous => include_str!("../../scenes/homogeneous.json"),
    }
}

/// The scene that shows a volume at its best. A test proves that none is an error.
pub fn scene(kind: Builtin) -> Result<SceneFile, FieldError> {
    SceneFile::from_json(scene_json(kind))
}
