//! Pictures in approximate light that paths refine at rest: their error falls and is told, and they do
//! not depend on how they came about.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;
use std::time::Duration;

use common::{draw, prepared, renderer, target};
use proto::SceneFile;
use render::{DrawRequest, Renderer, View};
use scene::plan::{Pass, Target};
use scene::{PreparedVolume, Scene, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

const SAMPLES: u32 = 4;
const WIDTH: u32 = 40;
const HEIGHT: u32 = 28;

/// A dense ball in thin haze. (Its light is rough in what follows, so that there is something to refine.)
fn ball() -> Arc<PreparedVolume> {
    let voxel = |i: usize| {
        let [x, y, z] = [i % 16, i / 16 % 16, i / 256].map(|v| v as f64 - 7.5);
        if (x * x + y * y + z * z).sqrt() < 4.0 { 200 } else { 60 }
    };
    prepared(Volume::new([16; 3], Voxels::U8((0..4096).map(voxel).collect())))
}

fn snapshot(volume: &Arc<PreparedVolume>, patches: &[Value], epoch: u32) -> Arc<Snapshot> {
    let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "value_range": [0, 255],
        "transfer_function": {"points": [{"s": 0.0, "extinction": 0}, {"s": 0.2, "extinction": 1.5},
            {"s": 0.5, "extinction": 1.5}, {"s": 0.6, "extinction": 60, "albedo": [0.9, 0.6, 0.4]}]},
        "camera": {"position": [0.4, 0.3, 2.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 27},
        "lights": [{"id": "sun", "type": "directional", "direction": [0.3, -0.8, -0.6], "irradiance": [3, 3, 3]},
            {"id": "sky", "type": "environment", "radiance": [0.3, 0.4, 0.5]}],
        "sampling": {"samples_per_pixel": SAMPLES},
        "illumination": {"method": "photon_map", "photons": 2048, "photon_grid": 5, "refine": true}});
    patches.iter().for_each(|patch| json_patch::merge(&mut file, patch));
    let scene = Scene::new(&SceneFile::from_value(file).unwrap(), volume.clone()).unwrap();
    Arc::new(Snapshot { epoch, scene })
}

fn at_rest(snapshot: &Snapshot) -> Target {
    target(WIDTH, HEIGHT, snapshot.scene.samples_at_rest())
}

fn bits(renderer: &mut Renderer, view: &View) -> Vec<u32> {
    renderer.radiance(view).unwrap().rgb.iter().map(|x| x.to_bits()).collect()
}

/// A new view's picture, and what it is said to be off by.
fn picture(renderer: &mut Renderer, snapshot: &Arc<Snapshot>) -> (Vec<f32>, Option<f64>) {
    let mut view = View::new();
    let drawn = draw(renderer, &mut view, snapshot, at_rest(snapshot));
    (renderer.radiance(&view).unwrap().rgb, drawn.estimate.map(|estimate| estimate.relative_error))
}

fn relative_l2(picture: &[f32], reference: &[f32]) -> f64 {
    let square = |x: f32| f64::from(x) * f64::from(x);
    let apart: f64 = picture.iter().zip(reference).map(|(a, b)| square(a - b)).sum();
    (apart / reference.iter().copied().map(square).sum::<f64>()).sqrt()
}

#[test]
fn the_error_falls_below_that_of_light_and_of_paths_and_is_told() {
    let volume = ball();
    let mut renderer = renderer();
    let mut error = |settings: Value| {
        let snapshot = snapshot(&volume, &[json!({"illumination": settings})], 1);
        picture(&mut renderer, &snapshot)
    };
    let (reference, told) = error(json!({"method": "path_traced", "paths_per_pixel": 2048}));
    let noise = told.unwrap();
    assert!(noise < 0.025, "{noise}");
    let (approximate, told) = error(json!({"refine": false}));
    assert_eq!(told, None);
    let of_light = relative_l2(&approximate, &reference);
    let mut before = of_light;
    for paths in [8, 16, 64, 256] {
        let (alone, _) = error(json!({"method": "path_traced", "paths_per_pixel": paths}));
        let (refined, told) = error(json!({"paths_per_pixel": paths}));
        let [alone, refined] = [&alone, &refined].map(|picture| relative_l2(picture, &reference));
        let told = told.unwrap();
        eprintln!(
            "{paths} paths: light {of_light:.4}, paths {alone:.4}, refined {refined:.4}, told {told:.4}"
        );
        assert!(refined < 1.03 * before && refined < alone, "{paths}: {refined} {before} {alone}");
        assert!((0.75..1.3).contains(&(told.hypot(noise) / refined)), "{paths}: {told} {refined}");
        before = refined;
    }
    // Without the noise of what both are compared with.
    let [refined, of_light] = [before, of_light].map(|error| (error * error - noise * noise).sqrt());
    assert!(refined < 0.4 * of_light, "{refined} {of_light}");
}

#[test]
fn pictures_do_not_depend_on_edits_or_slices() {
    let volume = ball();
    let mut renderer = renderer();
    let paths = |count: u32| json!({"illumination": {"paths_per_pixel": count}});
    let mut view = View::new();
    let edits = [
        json!({}),
        json!({"transfer_function": {"points": [{"s": 0.0, "extinction": 0}, {"s": 0.2, "extinction": 1.5},
            {"s": 0.5, "extinction": 1.5}, {"s": 0.6, "extinction": 20, "albedo": [0.4, 0.6, 0.9]}]}}),
        json!({"camera": {"position": [1.9, 0.3, 1.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 27}}),
        json!({"lights": [{"id": "sky", "type": "environment", "radiance": [0.6, 0.4, 0.2]}]}),
        json!({"clip": {"box": [[0, 0, 0], [1, 1, 0.5]]}}),
        json!({"scattering": {"orders": 2}}),
        json!({"illumination": {"method": "convection_diffusion"}}),
    ];
    for (epoch, edit) in edits.iter().enumerate() {
        let snapshot = snapshot(&volume, &[paths(8), edit.clone()], epoch as u32);
        // Each slice goes on where the one before ended.
        let budget = Some(Duration::from_millis(2));
        let request = DrawRequest { snapshot: &snapshot, target: at_rest(&snapshot), budget };
        let done = (0..5000).any(|_| renderer.draw(&mut view, &request).unwrap().complete);
        assert!(done, "{edit}");
        let mut fresh = View::new();
        let drawn = draw(&mut renderer, &mut fresh, &snapshot, at_rest(&snapshot));
        assert_eq!(drawn.samples_per_pixel, SAMPLES + 8);
        assert!(bits(&mut renderer, &view) == bits(&mut renderer, &fresh), "{edit}");
        assert_eq!(renderer.picture(&mut view).unwrap(), renderer.picture(&mut fresh).unwrap());
    }
}

#[test]
fn what_is_refined_is_dropped_on_edit_and_only_as_much_as_it_takes() {
    let volume = ball();
    let mut renderer = renderer();
    let paths = json!({"illumination": {"paths_per_pixel": 8}});
    let refined = snapshot(&volume, std::slice::from_ref(&paths), 1);
    let plain = snapshot(&volume, &[json!({"illumination": {"refine": false}})], 1);
    let mut view = View::new();
    let drawn = draw(&mut renderer, &mut view, &refined, at_rest(&refined));
    assert!(drawn.plan.runs(Pass::PathTrace) && drawn.gpu_bytes["refinement"] > 0);
    let again = draw(&mut renderer, &mut view, &refined, at_rest(&refined));
    assert!(!again.plan.runs(Pass::PathTrace) && again.stages.is_empty(), "{:?}", again.stages);
    // Exposure shows what is there.
    let brighter = snapshot(&volume, &[paths.clone(), json!({"film": {"exposure_stops": 1}})], 2);
    let shown = draw(&mut renderer, &mut view, &brighter, at_rest(&brighter));
    assert!(!shown.plan.runs(Pass::RayCast) && !shown.plan.runs(Pass::PathTrace));
    // More paths go on from those that were followed.
    let more = snapshot(&volume, &[json!({"illumination": {"paths_per_pixel": 12}})], 3);
    let shown = draw(&mut renderer, &mut view, &more, at_rest(&more));
    assert!(!shown.plan.runs(Pass::RayCast) && !shown.plan.runs(Pass::Illuminate));
    assert_eq!(shown.counters["paths"], 4 * u64::from(WIDTH * HEIGHT));
    // What paths alone see changes what they find, and what is shown of it.
    let before = renderer.picture(&mut view).unwrap();
    let short = json!({"illumination": {"paths_per_pixel": 12, "longest_path": 1}});
    let short = snapshot(&volume, &[short], 4);
    let shown = draw(&mut renderer, &mut view, &short, at_rest(&short));
    assert!(!shown.plan.runs(Pass::RayCast) && shown.samples_per_pixel == SAMPLES + 12);
    let after = renderer.picture(&mut view).unwrap();
    let mut fresh = View::new();
    draw(&mut renderer, &mut fresh, &short, at_rest(&short));
    assert!(after != before, "paths are cut");
    assert!(after == renderer.picture(&mut fresh).unwrap());
    draw(&mut renderer, &mut view, &more, at_rest(&more));
    // As good as asked for.
    let rough = json!({"illumination": {"paths_per_pixel": 4096, "max_error": 0.2}});
    let rough = snapshot(&volume, &[rough], 4);
    let shown = draw(&mut renderer, &mut view, &rough, at_rest(&rough));
    assert!(!shown.plan.runs(Pass::PathTrace) && shown.samples_per_pixel == SAMPLES + 12);
    // While it moves there are view rays alone.
    let camera = json!({"camera": {"position": [1.9, 0.3, 1.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 27}});
    let moved = snapshot(&volume, &[paths, camera.clone()], 5);
    let moving = Target { samples_per_pixel: 1, ..at_rest(&moved) };
    let shown = draw(&mut renderer, &mut view, &moved, moving);
    assert!(shown.estimate.is_none() && !shown.plan.runs(Pass::PathTrace));
    let unrefined = snapshot(&volume, &[json!({"illumination": {"refine": false}}), camera], 5);
    let mut fresh = View::new();
    draw(&mut renderer, &mut fresh, &unrefined, moving);
    assert!(bits(&mut renderer, &view) == bits(&mut renderer, &fresh));
    // Switched off, nothing of it is kept.
    let shown = draw(&mut renderer, &mut view, &plain, at_rest(&plain));
    assert_eq!(shown.gpu_bytes["refinement"], 0);
    assert_eq!(shown.samples_per_pixel, SAMPLES);
}
