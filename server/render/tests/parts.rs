//! Parts of volumes: a region drawn from its own voxels looks like that region of the whole, in its
//! place, and a coarser level like the volume seen from afar.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;

use common::{draw, prepared, renderer, target};
use proto::scene_file::Filter;
use render::fit::fit;
use render::{Radiance, RenderError, View};
use scene::levels::Reduction;
use scene::part::{Part, UnitBox, Wish};
use scene::plan::Pass;
use scene::{PreparedVolume, Scene, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

const REGION: UnitBox = [[0.22, 0.31, 0.08], [0.71, 0.83, 0.62]];
/// Sizes whose halves are odd, and unequal edges of a voxel.
const DIMS: [usize; 3] = [41, 33, 27];

/// Waves in all directions: matter, and gradients, everywhere.
fn waves() -> Arc<PreparedVolume> {
    let mut voxels = Vec::new();
    for i in 0..DIMS.iter().product() {
        let [x, y, z] = [i % DIMS[0], i / DIMS[0] % DIMS[1], i / (DIMS[0] * DIMS[1])].map(|i| i as f64);
        let wave = (0.31 * x + 0.2 * y).sin() + (0.27 * y - 0.33 * z).cos() + (0.4 * z + 0.1 * x).sin();
        voxels.push((30_000.0 + 9_000.0 * wave) as u16);
    }
    prepared(Volume { spacing: [1.0, 1.2, 1.5], ..Volume::new(DIMS, Voxels::U16(voxels)) })
}

fn part(
    whole: &Arc<PreparedVolume>,
    level: u32,
    region: Option<UnitBox>,
    filter: Filter,
) -> Arc<PreparedVolume> {
    let part = Part::of_region(whole.volume.dims, level, region);
    Arc::new(whole.part(&part, region, Reduction::of(filter)))
}

/// Surfaces, a light nearby, a clip plane, and a camera from the side.
fn lit(change: Value) -> Value {
    let mut scene = json!({
        "transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 0.4, "extinction": 0}, {"s": 0.6, "extinction": 12, "albedo": [0.9, 0.5, 0.2], "material": "skin"}, {"s": 1, "extinction": 40, "material": "skin"}]},
        "materials": {"skin": {"surface": 0.8, "brdf": {"type": "blinn_phong", "diffuse": 0.8, "specular": 0.2, "exponent": 20}}},
        "lights": [
            {"type": "point", "position": [0.3, 0.5, 0.6], "intensity": [0.6, 0.6, 0.6]},
            {"type": "spot", "position": [-0.8, 0.6, 0.5], "direction": [0.8, -0.6, -0.5], "cone_degrees": [20, 30], "intensity": [1, 0.5, 0.2]},
            {"type": "sphere", "center": [0.1, -0.7, 0.3], "radius": 0.1, "radiance": [5, 8, 9]},
            {"type": "environment", "radiance": [0.2, 0.2, 0.3]}],
        "camera": {"position": [0.8, 0.7, 1.3], "target": [-0.05, 0.05, -0.1], "up": [0, 1, 0], "fov_y_degrees": 35},
        "clip": {"planes": [{"normal": [0.6, 0.0, 0.8], "offset": -0.25}]},
        "sampling": {"step_voxels": 0.125, "termination_transmittance": 0},
        "background": [0.1, 0.3, 0.2]
    });
    common::json_merge(&mut scene, change);
    scene
}

fn snapshot(volume: &Arc<PreparedVolume>, scene: Value, filter: Filter, epoch: u32) -> Arc<Snapshot> {
    let mut file = common::scene_file(scene);
    file.volume.filter = filter;
    Arc::new(Snapshot { epoch, scene: Scene::new(&file, volume.clone()).unwrap() })
}

/// The whole volume at a level, cut to the region by the clip box.
fn clipped(whole: &Arc<PreparedVolume>, mut scene: Value, filter: Filter) -> Arc<Snapshot> {
    scene["clip"]["box"] = json!(REGION);
    snapshot(whole, scene, filter, 1)
}

fn image(snapshot: &Arc<Snapshot>) -> Radiance {
    common::radiance(snapshot, target(72, 60, 1))
}

/// Mean difference of two pictures over their mean, and the largest difference over it.
fn difference(a: &Radiance, b: &Radiance) -> (f64, f64) {
    let mean = a.rgb.iter().map(|&x| f64::from(x)).sum::<f64>() / a.rgb.len() as f64;
    let apart = a.rgb.iter().zip(&b.rgb).map(|(&a, &b)| f64::from(a - b).abs());
    let largest = apart.clone().fold(0.0, f64::max);
    (apart.sum::<f64>() / a.rgb.len() as f64 / mean, largest / mean)
}

/// Mean and largest difference of pictures that show the same. Steps are laid from the box of the
/// voxels held, so they differ by the error of the steps.
const SAME: (f64, f64) = (5e-4, 0.15);
/// The same where that error is none to speak of.
const EQUAL: (f64, f64) = (5e-5, 2e-3);

fn assert_same(a: &Radiance, b: &Radiance, tolerance: (f64, f64), what: &str) {
    let (mean, largest) = difference(a, b);
    assert!(mean < tolerance.0 && largest < tolerance.1, "{what}: mean {mean}, largest {largest}");
}

#[test]
fn a_region_looks_like_that_region_of_the_whole() {
    let full = waves();
    let ortho = json!({"camera": {"position": [0.8, 0.7, 1.3], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.9}});
    let slice = json!({"rendering": {"mode": "slice", "slice": {"normal": [0.3, 0.2, 1], "offset": -0.06}}});
    let iso = json!({"rendering": {"mode": "isosurface", "isovalue": 33_000}});
    let smooth = json!({"sampling": {"step_voxels": 0.125, "interpolation": "exact"}});
    for (name, change, tolerance) in [
        ("volume", json!({}), SAME),
        ("own interpolation", smooth, SAME),
        ("orthographic", ortho, SAME),
        ("maximum", json!({"rendering": {"mode": "maximum"}}), SAME),
        ("average", json!({"rendering": {"mode": "average"}}), EQUAL),
        ("slice", slice, EQUAL),
        ("isosurface", iso, EQUAL),
    ] {
        for level in [0, 1] {
            let whole = if level == 0 { full.clone() } else { part(&full, level, None, Filter::Linear) };
            let held = part(&full, level, Some(REGION), Filter::Linear);
            assert!(held.volume.voxels.len() < whole.volume.voxels.len() / 2);
            let a = image(&clipped(&whole, lit(change.clone()), Filter::Linear));
            let b = image(&snapshot(&held, lit(change.clone()), Filter::Linear, 1));
            assert_same(&a, &b, tolerance, &format!("{name}, level {level}"));
        }
    }
}

#[test]
fn a_region_of_labels_looks_like_that_region_of_the_whole() {
    let full = waves();
    // A step is one voxel's matter: rays that graze voxels differ more.
    let (mean, _) = difference(
        &image(&clipped(&full, lit(json!({})), Filter::Nearest)),
        &image(&snapshot(&part(&full, 0, Some(REGION), Filter::Nearest), lit(json!({})), Filter::Nearest, 1)),
    );
    assert!(mean < 0.01, "{mean}");
}

#[test]
fn a_region_in_the_wrong_place_is_noticed() {
    let whole = waves();
    let expected = image(&clipped(&whole, lit(json!({})), Filter::Linear));
    let mut held = whole.part(&Part::of_region(DIMS, 0, Some(REGION)), Some(REGION), Reduction::Mean);
    for corner in &mut held.placement.held {
        corner[0] += 0.5 / DIMS[0] as f64;
    }
    let shifted = image(&snapshot(&Arc::new(held), lit(json!({})), Filter::Linear, 1));
    let (mean, largest) = difference(&expected, &shifted);
    assert!(mean > 10.0 * SAME.0 && largest > 2.0 * SAME.1, "half a voxel: mean {mean}, largest {largest}");
    // Without neighbours beyond the border, gradients there are wrong.
    let tight = {
        let [low, high] = REGION.map(|corner| [0, 1, 2].map(|axis| corner[axis] * DIMS[axis] as f64));
        let part =
            Part { level: 0, low: low.map(|x| x.floor() as usize), high: high.map(|x| x.ceil() as usize) };
        image(&snapshot(
            &Arc::new(whole.part(&part, Some(REGION), Reduction::Mean)),
            lit(json!({})),
            Filter::Linear,
            1,
        ))
    };
    let (_, largest) = difference(&expected, &tight);
    assert!(largest > 2.0 * SAME.1, "no apron: largest {largest}");
}

#[test]
fn a_clip_box_and_a_region_keep_what_both_keep() {
    let whole = waves();
    let held = part(&whole, 0, Some(REGION), Filter::Linear);
    let inner = json!([[0.3, 0.2, 0.2], [0.5, 0.6, 0.9]]);
    let both = json!([[0.3, 0.31, 0.2], [0.5, 0.6, 0.62]]);
    let again = {
        let file = common::scene_file(lit(json!({"clip": {"box": both}})));
        let scene = Scene::new(&file, whole.clone()).unwrap().with_part(&file, held.clone());
        image(&Arc::new(Snapshot { epoch: 1, scene }))
    };
    let with_box = |bounds: Value| lit(json!({"clip": {"box": bounds}}));
    let a = image(&snapshot(&whole, with_box(both.clone()), Filter::Linear, 1));
    assert!(
        again == image(&snapshot(&held, with_box(both), Filter::Linear, 1)),
        "a scene with its part exchanged"
    );
    let b = image(&snapshot(&held, with_box(inner), Filter::Linear, 1));
    assert_same(&a, &b, SAME, "clip box across the region's border");
    let beside = image(&snapshot(&held, with_box(json!([[0.8, 0, 0], [1, 1, 1]])), Filter::Linear, 1));
    let empty = [0.1f32, 0.3, 0.2];
    assert!(beside.rgb.chunks(3).all(|pixel| pixel == empty), "a clip box beside the region keeps nothing");
}

#[test]
fn a_level_looks_like_the_volume_in_the_same_place() {
    let whole = waves();
    let expected = image(&snapshot(&whole, lit(json!({})), Filter::Linear, 1));
    let (mean, _) = difference(
        &expected,
        &image(&snapshot(&part(&whole, 1, None, Filter::Linear), lit(json!({})), Filter::Linear, 1)),
    );
    assert!(mean < 0.1, "half the resolution: {mean}");
    let mirrored = image(&snapshot(
        &whole,
        lit(
            json!({"camera": {"position": [-0.8, 0.7, 1.3], "target": [-0.05, 0.05, -0.1], "up": [0, 1, 0], "fov_y_degrees": 35}}),
        ),
        Filter::Linear,
        1,
    ));
    assert!(difference(&expected, &mirrored).0 > 0.2, "the comparison can fail");
}

#[test]
fn skipping_changes_no_bit_of_a_level_or_region() {
    let full = waves();
    for (level, region) in [(1, None), (0, Some(REGION)), (1, Some(REGION))] {
        let held = part(&full, level, region, Filter::Linear);
        let with = |skip: bool| {
            let sampling = json!({"sampling": {"step_voxels": 0.5, "skip_empty": skip}});
            image(&snapshot(&held, lit(sampling), Filter::Linear, 1))
        };
        assert!(with(true) == with(false), "level {level}, {region:?}");
    }
}

#[test]
fn going_into_a_region_and_back_leaves_nothing_behind() {
    let full = waves();
    let steps = [
        full.clone(),
        part(&full, 0, Some(REGION), Filter::Linear),
        part(&full, 1, None, Filter::Linear),
        full,
    ];
    let mut renderer = renderer();
    let mut running = View::new();
    for (epoch, volume) in steps.iter().enumerate() {
        let newest = snapshot(volume, lit(json!({})), Filter::Linear, epoch as u32 + 1);
        draw(&mut renderer, &mut running, &newest, target(40, 32, 1));
        let mut fresh = View::new();
        draw(&mut renderer, &mut fresh, &newest, target(40, 32, 1));
        assert!(renderer.radiance(&running).unwrap() == renderer.radiance(&fresh).unwrap(), "step {epoch}");
        let again = draw(&mut renderer, &mut running, &newest, target(40, 32, 1));
        assert!(!again.plan.runs(Pass::RayCast), "nothing changed at step {epoch}");
    }
}

#[test]
fn what_does_not_fit_is_drawn_coarser() {
    let whole = waves();
    let bytes = whole.volume.voxels.bytes() as u64;
    let cache = renderer().volumes().clone();
    let wish = Wish { level: 0, region: None, filter: Filter::Linear };
    let fitted = |wish: &Wish, most| {
        let part_of =
            |part: &Part| Ok::<_, RenderError>(Arc::new(whole.part(part, wish.region, Reduction::Mean)));
        fit(&cache, &whole, wish, most, part_of).unwrap()
    };
    assert_eq!(fitted(&wish, 2 * bytes).shown, None);
    let half = fitted(&wish, bytes / 4);
    assert_eq!(half.shown.unwrap().level, 1);
    assert_eq!(half.volume.volume.dims, [21, 17, 14]);
    image(&snapshot(&half.volume, lit(json!({})), Filter::Linear, 1));
    let region = fitted(&Wish { region: Some(REGION), ..wish }, bytes / 2).shown.unwrap();
    assert_eq!((region.level, region.region), (0, Some(REGION)));
}
