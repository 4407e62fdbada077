//! What method `path_traced` promises beside being right: pictures do not depend on how they came
//! about, edits redo only the tiles they touch, nothing hangs, and the work is counted.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;
use std::time::{Duration, Instant};

use common::{draw, homogeneous, json_merge, prepared, renderer, target};
use proto::SceneFile;
use proto::scene_file::{Builtin, Method};
use render::{DrawRequest, Drawn, Renderer, View};
use scene::plan::{FilmPlan, Target};
use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Scene, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

/// Two balls far apart, of values around 100 and around 200, in air.
fn balls() -> Arc<PreparedVolume> {
    let voxel = |i: usize| {
        let [x, y, z] = [i % 40, i / 40 % 40, i / 1600].map(|v| v as f64 - 19.5);
        let distance = |cx: f64| ((x - cx).powi(2) + (y - cx).powi(2) + z * z).sqrt();
        let ball = |cx: f64, value: f64| (value * (1.0 - (distance(cx) / 8.0).powi(2))).max(0.0);
        ball(-11.0, 100.0).max(ball(11.0, 220.0)) as u8
    };
    prepared(Volume::new([40; 3], Voxels::U8((0..64_000).map(voxel).collect())))
}

fn sky(sun: f32) -> EnvironmentImages {
    let rgb: Vec<f32> = (0..8 * 4).flat_map(|i| [0.3, 0.4, if i == 5 { sun } else { 0.5 }]).collect();
    [("sky".to_owned(), Arc::new(EnvironmentImage::new(8, 4, &rgb).unwrap()))].into()
}

fn file(patch: Value) -> Value {
    let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "value_range": [0, 255],
        "illumination": {"method": "path_traced"}, "materials": {"m": {"surface": 0.5, "brdf": {"type": "lambert", "diffuse": 0.8}}},
        "transfer_function": {"points": [{"s": 0.1, "extinction": 0}, {"s": 0.3, "extinction": 20, "material": "m"},
            {"s": 0.45, "extinction": 5}, {"s": 0.8, "extinction": 60}]},
        "camera": {"position": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 25},
        "lights": [{"id": "sun", "type": "directional", "direction": [0, -0.2, -1], "irradiance": [3, 3, 3]}]});
    json_merge(&mut file, patch);
    file
}

fn snapshot(volume: &Arc<PreparedVolume>, patch: Value, epoch: u32) -> Arc<Snapshot> {
    let file = SceneFile::from_value(file(patch)).unwrap();
    Arc::new(Snapshot { epoch, scene: Scene::with_images(&file, volume.clone(), &sky(9.0)).unwrap() })
}

const TARGET: Target = Target { width: 48, height: 40, samples_per_pixel: 6 };

/// Bits of the picture of a fresh view.
fn from_scratch(renderer: &mut Renderer, snapshot: &Arc<Snapshot>) -> Vec<u32> {
    let mut view = View::new();
    draw(renderer, &mut view, snapshot, TARGET);
    bits(renderer, &view)
}

fn bits(renderer: &mut Renderer, view: &View) -> Vec<u32> {
    renderer.radiance(view).unwrap().rgb.iter().map(|x| x.to_bits()).collect()
}

/// Draws in slices too short for anything, `at_most` of them.
fn in_slices(
    renderer: &mut Renderer,
    view: &mut View,
    snapshot: &Arc<Snapshot>,
    at_most: usize,
) -> Option<Drawn> {
    let budget = Some(Duration::from_micros(1));
    for _ in 0..at_most {
        let drawn = renderer.draw(view, &DrawRequest { snapshot, target: TARGET, budget }).unwrap();
        if drawn.complete {
            return Some(drawn);
        }
    }
    None
}

#[test]
fn interruptions_change_no_bit() {
    let mut renderer = renderer();
    let scene = snapshot(&balls(), json!({}), 1);
    let whole = from_scratch(&mut renderer, &scene);
    let mut view = View::new();
    assert!(in_slices(&mut renderer, &mut view, &scene, 3).is_none(), "three slices are not enough");
    in_slices(&mut renderer, &mut view, &scene, 100_000).expect("it ends");
    assert_eq!(bits(&mut renderer, &view), whole);
}

/// Long ways through noisy matter: what a device that ends loops early would lose.
#[test]
fn long_paths_in_one_go_are_those_in_slices() {
    let mut renderer = renderer();
    let volume = prepared(scene::builtin::build(Builtin::VesselTree, [32; 3], &|_| {}));
    let mut file = scene::builtin::scene(Builtin::VesselTree).unwrap();
    file.illumination.method = Method::PathTraced;
    let snapshot = Arc::new(Snapshot { epoch: 1, scene: Scene::new(&file, volume).unwrap() });
    let target = Target { width: 64, height: 64, samples_per_pixel: 32 };
    let mut of = |budget: Option<Duration>| {
        let mut view = View::new();
        let request = DrawRequest { snapshot: &snapshot, target, budget };
        while !renderer.draw(&mut view, &request).unwrap().complete {}
        bits(&mut renderer, &view)
    };
    assert!(of(None) == of(Some(Duration::from_millis(5))));
}

#[test]
fn leaps_change_no_bit_and_save_look_ups() {
    let mut renderer = renderer();
    let volume = balls();
    let mut of = |skip: bool| {
        let scene = snapshot(&volume, json!({"sampling": {"skip_empty": skip}}), 1);
        let mut view = View::new();
        let drawn = draw(&mut renderer, &mut view, &scene, TARGET);
        (bits(&mut renderer, &view), drawn.counters)
    };
    let ((picture, leaping), (same, stepping)) = (of(true), of(false));
    assert!(picture == same, "leaps over empty cells change the picture");
    assert_eq!(leaping["tentative_collisions"], stepping["tentative_collisions"]);
    // A cell is looked up again after each tentative collision in it.
    assert!(6 * leaping["cells_visited"] < 5 * stepping["cells_visited"], "{leaping:?} {stepping:?}");
}

#[test]
fn local_bounds_save_look_ups_at_equal_variance() {
    let mut renderer = renderer();
    let scene = snapshot(&balls(), json!({}), 1);
    let mut of = |mut view: View| {
        let target = Target { samples_per_pixel: 64, ..TARGET };
        let drawn = draw(&mut renderer, &mut view, &scene, target);
        (drawn.counters["tentative_collisions"] as f64, drawn.estimate.unwrap().relative_error)
    };
    let (local, global) = (of(View::new()), of(View::with_global_majorant()));
    eprintln!("look-ups {local:?} with bounds for macrocells, {global:?} with one bound");
    // Ratio-tracked shadows are a little less noisy with a larger bound.
    let at_equal_variance = (global.0 * global.1.powi(2)) / (local.0 * local.1.powi(2));
    assert!(at_equal_variance > 2.0, "{at_equal_variance}");
}

#[test]
fn air_beside_dense_matter_is_not_looked_at_as_if_it_were_dense() {
    let mut renderer = renderer();
    let mut look_ups = |extinction: f64| {
        let points = json!([{"s": 0, "extinction": 0}, {"s": 0.3, "extinction": 0},
            {"s": 0.5, "extinction": extinction, "albedo": [0.9, 0.9, 0.9]}]);
        let patch = json!({"transfer_function": {"points": points}, "scattering": {"orders": 1}});
        let scene = snapshot(&balls(), patch, 1);
        draw(&mut renderer, &mut View::new(), &scene, TARGET).counters["tentative_collisions"] as f64
    };
    let (thin, dense) = (look_ups(1e3), look_ups(1e5));
    eprintln!("{thin} look-ups at 1e3, {dense} at 1e5");
    // A hundred times as many by the bounds of macrocells alone.
    assert!(dense < 4.0 * thin, "{thin} {dense}");
}

/// Edits of the transfer function, one after the other, some of them superseded before the picture
/// is complete.
#[test]
fn edits_of_matter_redo_the_tiles_they_touch_and_no_other() {
    let mut renderer = renderer();
    let volume = balls();
    let points = |sparse: f64, dense: f64, air: f64, red: f64| {
        json!({"transfer_function": {"points": [{"s": 0, "extinction": air}, {"s": 0.02, "extinction": 0},
            {"s": 0.1, "extinction": 0}, {"s": 0.3, "extinction": sparse, "material": "m"},
            {"s": 0.45, "extinction": 5, "albedo": [red, 0.8, 0.8]}, {"s": 0.5, "extinction": dense},
            {"s": 0.8, "extinction": 60, "albedo": [red, 0.8, 0.8]}]}})
    };
    // Sparse ball, dense ball, air; and whether the picture is finished.
    let edits = [
        (points(20.0, 30.0, 0.0, 0.8), true),
        (points(20.0, 30.0, 0.0, 0.2), true),
        (points(20.0, 80.0, 0.0, 0.2), false),
        (points(20.0, 40.0, 0.0, 0.4), true),
        (points(50.0, 40.0, 0.0, 0.4), false),
        (points(50.0, 40.0, 0.0, 0.9), false),
        (points(0.0, 40.0, 0.0, 0.9), true),
        (points(0.0, 40.0, 0.3, 0.9), true),
        (points(0.0, 40.0, 0.0, 0.9), true),
    ];
    let mut view = View::new();
    let mut kept = Vec::new();
    for (index, (patch, finish)) in edits.into_iter().enumerate() {
        let scene = snapshot(&volume, patch, 1 + index as u32);
        let plan = renderer.plan(&view, &scene, TARGET).film;
        assert_eq!(matches!(plan, FilmPlan::RestartTiles { .. }), index > 0, "{plan:?}");
        let budget = (!finish).then_some(Duration::from_micros(1));
        let drawn =
            renderer.draw(&mut view, &DrawRequest { snapshot: &scene, target: TARGET, budget }).unwrap();
        kept.push(drawn.counters.get("tiles_reused").copied().unwrap_or(0));
        if finish {
            assert!(drawn.complete);
            let fresh = from_scratch(&mut renderer, &scene);
            assert!(bits(&mut renderer, &view) == fresh, "edit {index} differs from a fresh picture");
        }
    }
    eprintln!("tiles kept of 30: {kept:?}");
    assert!(kept[1] >= 10, "the colour of the dense ball leaves tiles alone: {kept:?}");
    assert_eq!(kept[7], 0, "air is everywhere: {kept:?}");
    assert_eq!(kept.last(), Some(&0), "paths met the air that goes: {kept:?}");
}

#[test]
fn other_edits_are_those_of_a_fresh_picture() {
    let mut renderer = renderer();
    let volume = balls();
    let image = |scale: f64| {
        json!({"lights": [{"id": "sky", "type": "environment", "image": "sky", "scale": scale}],
            "background": "environment"})
    };
    let mut view = View::new();
    let patches = [
        json!({}),
        json!({"scattering": {"orders": 1}}),
        // A path's last ray finds what begins to glow.
        json!({"scattering": {"orders": 1}, "transfer_function": {"points": [{"s": 0.1, "extinction": 0},
            {"s": 0.3, "extinction": 20, "material": "m"}, {"s": 0.45, "extinction": 5},
            {"s": 0.8, "extinction": 60, "emission": [9, 9, 9]}]}}),
        json!({"clip": {"box": [[0, 0, 0], [1, 1, 0.5]], "shadows": true}}),
        json!({"clip": {"box": [[0, 0, 0], [1, 1, 0.5]], "shadows": false}}),
        image(1.0),
        image(2.0),
        json!({"background": [1, 0, 0]}),
        json!({"illumination": {"method": "local"}}),
        json!({}),
        json!({"illumination": {"method": "path_traced", "longest_path": 2}}),
    ];
    for (index, patch) in patches.into_iter().enumerate() {
        let scene = snapshot(&volume, patch.clone(), 1 + index as u32);
        let drawn = draw(&mut renderer, &mut view, &scene, TARGET);
        assert!(drawn.drew, "{patch}");
        assert!(bits(&mut renderer, &view) == from_scratch(&mut renderer, &scene), "{patch}");
    }
    // What paths do not depend on leaves the film alone.
    let scene = snapshot(
        &volume,
        json!({"illumination": {"method": "path_traced", "longest_path": 2},
        "sampling": {"step_voxels": 2.0}}),
        99,
    );
    assert_eq!(renderer.plan(&view, &scene, TARGET).film, FilmPlan::Keep);
}

#[test]
fn white_matter_of_huge_extinction_ends_and_what_is_cut_is_counted() {
    let mut renderer = renderer();
    let of = |longest: u32| {
        let points = json!({"points": [{"s": 0, "extinction": 1e6, "albedo": [1, 1, 1]}]});
        snapshot(
            &homogeneous([4; 3]),
            json!({"transfer_function": points, "value_range": null,
            "illumination": {"method": "path_traced", "longest_path": longest}}),
            1,
        )
    };
    let target = target(8, 8, 16);
    let (mut short, mut long) = (View::new(), View::new());
    let cut = draw(&mut renderer, &mut short, &of(10), target).estimate.unwrap().cut;
    assert!(cut > 0.05, "{cut}");
    let began = Instant::now();
    let mut slices = 0;
    let snapshot = of(3000);
    let drawn = loop {
        let slice = Instant::now();
        let budget = Some(Duration::from_millis(20));
        let drawn = renderer.draw(&mut long, &DrawRequest { snapshot: &snapshot, target, budget }).unwrap();
        slices += 1;
        assert!(slice.elapsed() < Duration::from_secs(5), "a slice took {:?}", slice.elapsed());
        if drawn.complete {
            break drawn;
        }
        assert!(began.elapsed() < Duration::from_secs(120), "it does not end");
    };
    assert!(slices > 1);
    let less = drawn.estimate.unwrap().cut;
    eprintln!("cut {cut} after 10 events, {less} after 3000, {slices} slices");
    assert!(less < 0.3 * cut, "{less} {cut}");
}

#[test]
fn pictures_end_at_the_error_asked_for() {
    let mut renderer = renderer();
    let volume = balls();
    let of = |error: f64| {
        snapshot(&volume, json!({"illumination": {"method": "path_traced", "max_error": error}}), 1)
    };
    let target = Target { samples_per_pixel: 4096, ..TARGET };
    let mut view = View::new();
    let rough = draw(&mut renderer, &mut view, &of(0.1), target);
    assert!(rough.estimate.unwrap().relative_error <= 0.1 && rough.samples_per_pixel < 4096);
    let better = draw(&mut renderer, &mut view, &of(0.05), target);
    assert!(better.samples_per_pixel > rough.samples_per_pixel, "it goes on where it was");
    assert!(better.estimate.unwrap().relative_error <= 0.05);
    // The estimate is the difference from a better picture.
    let good = draw(&mut renderer, &mut View::new(), &of(0.0), Target { samples_per_pixel: 1, ..target });
    assert!(good.estimate.is_none(), "one path a pixel tells nothing");
    let picture = renderer.radiance(&view).unwrap().rgb;
    let mut reference = View::new();
    draw(&mut renderer, &mut reference, &of(0.0), target);
    let truth = renderer.radiance(&reference).unwrap().rgb;
    // Its first paths are the picture's own, so it differs a little less.
    let squares = |values: &mut dyn Iterator<Item = f32>| values.map(|x| f64::from(x).powi(2)).sum::<f64>();
    let off = squares(&mut picture.iter().zip(&truth).map(|(a, b)| a - b));
    let difference = (off / squares(&mut truth.iter().copied())).sqrt();
    let estimate = better.estimate.unwrap().relative_error;
    eprintln!("estimate {estimate}, difference {difference}, {} paths", better.samples_per_pixel);
    assert!((0.7..1.3).contains(&(difference / estimate)));
}
