//! Method `convection_diffusion` against the independent reference, and the properties it promises.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;
use std::time::Duration;

use common::{draw, homogeneous, json_merge, prepared, renderer, snapshot, target};
use reference::statistics::difference;
use reference::{Progress, Request};
use render::{DrawRequest, Drawn, View};
use scene::{PreparedVolume, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

/// Pixels of a picture.
const SIZE: [u32; 2] = [16, 12];

/// Seen from the front and above; lit from the side.
fn base() -> Value {
    json!({"value_range": [0, 255],
        "illumination": {"method": "convection_diffusion", "light_grid": 2.0},
        "transfer_function": matter(12.0, 0.95),
        "camera": {"position": [0.8, 0.7, 1.2], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 45},
        "background": [0, 0, 0],
        "lights": [sun([-0.4, -1.0, -0.7], [2.0, 2.5, 3.0])]})
}

fn matter(sigma_t: f64, albedo: f64) -> Value {
    json!({"points": [{"s": 0.0, "extinction": 0, "albedo": [albedo, albedo, albedo]},
        {"s": 1.0, "extinction": sigma_t, "albedo": [albedo, albedo, albedo]}]})
}

fn sun(direction: [f64; 3], irradiance: [f64; 3]) -> Value {
    json!({"id": "sun", "type": "directional", "direction": direction, "irradiance": irradiance})
}

fn lamp(position: [f64; 3], intensity: [f64; 3]) -> Value {
    json!({"id": "lamp", "type": "point", "position": position, "intensity": intensity})
}

fn scene(volume: &Arc<PreparedVolume>, patch: Value, epoch: u32) -> Arc<Snapshot> {
    let mut file = base();
    json_merge(&mut file, patch);
    snapshot(volume, file, epoch)
}

/// Blobs of values between 0 and 255.
fn blobs(dims: [usize; 3]) -> Arc<PreparedVolume> {
    let [nx, ny, _] = dims;
    let value = |i: usize| {
        let [x, y, z] = [i % nx, i / nx % ny, i / (nx * ny)].map(|v| v as f64);
        127.5 + 42.0 * ((0.5 * x).sin() + (0.4 * y + 0.2 * x).sin() + (0.5 * z - 0.2 * y).sin())
    };
    prepared(Volume::new(dims, Voxels::U8((0..dims.iter().product()).map(|i| value(i) as u8).collect())))
}

fn pixels(snapshot: &Arc<Snapshot>) -> Vec<[f64; 3]> {
    let image = common::radiance(snapshot, target(SIZE[0], SIZE[1], 64));
    image.rgb.as_chunks::<3>().0.iter().map(|p| p.map(f64::from)).collect()
}

/// Relative L2 difference from the reference, and that of the pictures' means.
fn error(snapshot: &Arc<Snapshot>, samples: u32) -> (f64, f64) {
    let picture = pixels(snapshot);
    let request = Request { seed: 5, ..Request::new(SIZE[0], SIZE[1], samples) };
    let truth = reference::render(&snapshot.scene, &request, &Progress::default()).unwrap();
    let exact = vec![[0.0; 3]; picture.len()];
    let found = difference(&picture, &exact, &truth.mean, &truth.standard_error);
    let mean = |image: &[[f64; 3]]| image.iter().flatten().sum::<f64>();
    (found.relative_l2, mean(&picture) / mean(&truth.mean) - 1.0)
}

#[test]
fn single_scattering_agrees_with_the_reference() {
    let single = |patch: Value| {
        let mut all = json!({"scattering": {"orders": 1}, "transfer_function": matter(4.0, 0.8)});
        json_merge(&mut all, patch);
        scene(&homogeneous([16; 3]), all, 1)
    };
    let spot = json!({"id": "spot", "type": "spot", "position": [0.9, 0.8, 0.3], "direction": [-0.8, -0.8, -0.2],
        "cone_degrees": [15, 30], "intensity": [4, 4, 3]});
    let forward = json!({"m": {"phase": {"type": "henyey_greenstein", "g": 0.3}}});
    let mut material = matter(4.0, 0.8);
    material["points"][0]["material"] = json!("m");
    material["points"][1]["material"] = json!("m");
    for (name, patch, tolerance) in [
        ("from afar", json!({}), 0.04),
        ("from outside", json!({"lights": [lamp([0.9, 0.8, 0.3], [2.0, 2.0, 1.0])]}), 0.04),
        ("from inside", json!({"lights": [lamp([0.1, -0.1, 0.2], [0.2, 0.2, 0.1])]}), 0.04),
        ("a cone", json!({"lights": [spot]}), 0.04),
        (
            "two lights",
            json!({"lights": [sun([1.0, -1.0, 0.2], [1.0; 3]), lamp([-0.8, 0.6, 0.9], [1.0; 3])]}),
            0.04,
        ),
        (
            "forward",
            json!({"materials": forward, "transfer_function": material, "illumination":
            {"method": "convection_diffusion", "light_grid": 2.0}}),
            0.04,
        ),
        ("clipped, with shadows", json!({"clip": {"box": [[0, 0, 0], [1, 0.6, 1]], "shadows": true}}), 0.04),
        ("clipped, without", json!({"clip": {"box": [[0, 0, 0], [1, 0.6, 1]], "shadows": false}}), 0.04),
    ] {
        let (l2, mean) = error(&single(patch), 2048);
        eprintln!("{name}: relative L2 {l2:.4}, mean {mean:+.4}");
        assert!(l2 < tolerance && mean.abs() < 0.03, "{name}: {l2} {mean}");
    }
}

/// The goal: P1 within 10 % of the picture's mean at 10 and more mean free paths and an albedo
/// of 0.95 and more.
#[test]
fn thick_matter_is_within_a_tenth_of_the_reference() {
    for (sigma_t, albedo) in [(10.0, 0.95), (20.0, 0.99), (20.0, 0.95), (40.0, 0.99)] {
        let snapshot = scene(&homogeneous([16; 3]), json!({"transfer_function": matter(sigma_t, albedo)}), 1);
        let (l2, mean) = error(&snapshot, 128);
        eprintln!("extinction {sigma_t}, albedo {albedo}: relative L2 {l2:.4}, mean {mean:+.4}");
        assert!(mean.abs() < 0.1, "{sigma_t} {albedo}: {mean}");
    }
}

/// A sky brighter above than below, with a sun or without: the sun is a light of its own, the rest enters
/// by the faces of matter.
#[test]
fn pictures_of_light_enter_by_the_faces() {
    let volume = homogeneous([16; 3]);
    let of = |sun: f32, patch: Value| {
        let texel = |i: usize| match (i % 32, i / 32) {
            (20, 4) => [sun; 3],
            (_, y) => [3.0 - 0.15 * y as f32, 2.0, 0.5 + 0.1 * y as f32],
        };
        let rgb: Vec<f32> = (0..32 * 16).flat_map(texel).collect();
        let images =
            [("sky".to_owned(), Arc::new(scene::EnvironmentImage::new(32, 16, &rgb).unwrap()))].into();
        let mut file = base();
        file["transfer_function"] = matter(20.0, 0.95);
        file["lights"] =
            json!([{"id": "sky", "type": "environment", "image": "sky", "rotation_degrees": [20, 30, 0]}]);
        json_merge(&mut file, patch);
        let file = common::scene_file(file);
        render::check(&scene::Scene::with_images(&file, volume.clone(), &images).unwrap()).unwrap();
        let scene = scene::Scene::with_images(&file, volume.clone(), &images).unwrap();
        Arc::new(Snapshot { epoch: 1, scene })
    };
    for (name, sun, most) in [("without a sun", 2.0, 0.15), ("with a sun", 600.0, 0.12)] {
        let (l2, mean) = error(&of(sun, json!({})), 256);
        eprintln!("a picture of light, {name}: relative L2 {l2:.4}, mean {mean:+.4}");
        assert!(l2 < most && mean.abs() < 0.1, "{name}: {l2} {mean}");
    }
    // The comparison can fail: the same light turned round.
    let upright = pixels(&of(2.0, json!({})));
    let turned = json!({"lights": [{"id": "sky", "type": "environment", "image": "sky", "rotation_degrees": [0, 0, 180]}]});
    let exact = vec![[0.0; 3]; upright.len()];
    let found = difference(&pixels(&of(2.0, turned)), &exact, &upright, &exact);
    assert!(found.relative_l2 > 0.1, "{}", found.relative_l2);
}

/// One step of the random numbers below.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *state >> 33
}

/// Random edits of lights, matter and clipping; each picture equals one from scratch within what the
/// residual allows, and bit by bit without diffusion.
#[test]
fn edits_equal_from_scratch() {
    for (diffusion, tolerance) in [("none", 0.0), ("p1", 2e-3), ("heat", 2e-3)] {
        let volume = blobs([18, 14, 22]);
        let mut view = View::new();
        let mut state = 11;
        let mut patch = json!({"illumination":
            {"method": "convection_diffusion", "light_grid": 0.7, "max_residual": 1e-4, "diffusion": diffusion},
            "lights": [sun([-0.4, -1.0, -0.7], [2.0, 2.5, 3.0]), lamp([0.1, 0.0, 0.2], [0.1, 0.1, 0.2])]});
        for epoch in 1..14 {
            let random = |state: &mut u64| next(state) as f64 / (1u64 << 31) as f64;
            match next(&mut state) % 6 {
                0 => {
                    patch["lights"][0] =
                        sun([random(&mut state) - 0.5, -1.0, random(&mut state) - 0.5], [1.0; 3])
                }
                1 => patch["lights"][1]["intensity"] = json!([random(&mut state), 0.2, 0.1]),
                2 => {
                    patch["lights"][1]["position"] =
                        json!([random(&mut state) - 0.5, 0.8 * random(&mut state), 0.1])
                }
                3 => {
                    let s = 0.1 + 0.5 * random(&mut state);
                    let points = json!([{"s": s, "extinction": 0}, {"s": s + 0.1, "extinction": 30.0 * random(&mut state),
                        "albedo": [0.9, 0.8, 0.7]}, {"s": s + 0.2, "extinction": 0}]);
                    patch["transfer_function"] = json!({"points": points});
                }
                4 => {
                    patch["clip"] =
                        json!({"box": [[0, 0, 0], [1, 0.4 + 0.6 * random(&mut state), 1]], "shadows": false})
                }
                _ => patch["lights"][1]["enabled"] = json!(next(&mut state).is_multiple_of(2)),
            }
            let snapshot = scene(&volume, patch.clone(), epoch);
            let size = target(SIZE[0], SIZE[1], 1);
            let mut renderer = renderer();
            // Now and then the next edit comes before the light is there.
            if next(&mut state).is_multiple_of(3) {
                let hasty = DrawRequest { snapshot: &snapshot, target: size, budget: Some(Duration::ZERO) };
                renderer.draw(&mut view, &hasty).unwrap();
                continue;
            }
            draw(&mut renderer, &mut view, &snapshot, size);
            let edited = renderer.radiance(&view).unwrap().rgb;
            let mut fresh = View::new();
            draw(&mut renderer, &mut fresh, &snapshot, size);
            let scratch = renderer.radiance(&fresh).unwrap().rgb;
            let largest = scratch.iter().fold(0.0f32, |a, &b| a.max(b));
            for (a, b) in edited.iter().zip(&scratch) {
                assert!((a - b).abs() <= tolerance * largest, "{diffusion}, edit {epoch}: {a} for {b}");
            }
        }
    }
}

fn counted(drawn: &Drawn, counter: &str) -> u64 {
    drawn.counters.get(counter).copied().unwrap_or(0)
}

#[test]
fn an_edit_does_what_it_makes_stale_and_no_more() {
    let volume = blobs([16; 3]);
    let lights = |strength: f64, x: f64| json!({"lights": [sun([0.0, -1.0, 0.0], [strength; 3]), lamp([x, 0.9, 0.2], [1.0; 3])]});
    let mut renderer = renderer();
    let mut view = View::new();
    let size = target(SIZE[0], SIZE[1], 1);
    let mut drawn =
        |patch: Value, epoch: u32| draw(&mut renderer, &mut view, &scene(&volume, patch, epoch), size);
    let first = drawn(lights(1.0, 0.0), 1);
    let all = 32 * 32 * 32;
    assert_eq!(counted(&first, "light_cells_filled"), all);
    assert!(counted(&first, "light_cells_carried") >= 2 * all);
    let again = drawn(lights(1.0, 0.0), 1);
    assert!(again.counters.keys().all(|name| !name.starts_with("light_")), "{:?}", again.counters);
    let recolored = drawn(lights(2.0, 0.0), 2);
    assert_eq!(counted(&recolored, "light_cells_carried"), 0);
    assert_eq!(counted(&recolored, "light_cells_filled"), 0);
    assert!(counted(&recolored, "light_iterations") > 0);
    let moved = drawn(lights(2.0, 0.1), 3);
    assert_eq!(counted(&moved, "light_cells_filled"), 0);
    let carried = counted(&moved, "light_cells_carried");
    assert!(carried > 0 && carried <= counted(&first, "light_cells_carried") - all, "{carried}");
}

#[test]
fn skipping_and_slices_change_no_bit() {
    let volume = blobs([20, 16, 18]);
    let patch = |skip: bool| {
        json!({"sampling": {"skip_empty": skip}, "transfer_function":
            {"points": [{"s": 0.5, "extinction": 0}, {"s": 0.8, "extinction": 30, "albedo": [0.9, 0.8, 0.7]}]}})
    };
    let image = |skip: bool| pixels(&scene(&volume, patch(skip), 1));
    assert_eq!(image(true), image(false));
    let snapshot = scene(&volume, patch(true), 1);
    let mut renderer = renderer();
    let (mut sliced, mut whole) = (View::new(), View::new());
    let size = target(SIZE[0], SIZE[1], 2);
    let request = DrawRequest { snapshot: &snapshot, target: size, budget: Some(Duration::ZERO) };
    let mut calls = 0;
    while !renderer.draw(&mut sliced, &request).unwrap().complete {
        calls += 1;
        assert!(calls < 1000);
    }
    assert!(calls > 4, "{calls}");
    draw(&mut renderer, &mut whole, &snapshot, size);
    assert_eq!(renderer.radiance(&sliced).unwrap(), renderer.radiance(&whole).unwrap());
}

/// Without P1, light from all around is undimmed: thin white matter is as bright as it.
#[test]
fn light_from_all_around_reaches_every_place() {
    for diffusion in ["p1", "none", "heat"] {
        let patch = json!({"lights": [{"type": "environment", "radiance": [0.5, 0.5, 0.5]}], "background": "environment",
            "transfer_function": matter(3.0, 1.0), "illumination": {"method": "convection_diffusion", "diffusion": diffusion}});
        for value in pixels(&scene(&homogeneous([8; 3]), patch, 1)).iter().flatten() {
            assert!((value - 0.5).abs() < 2e-3, "{diffusion}: {value}");
        }
    }
}

/// As many lights as a scene may have, each with its part of the light, are as bright as one.
#[test]
fn all_lights_of_a_scene_are_taken() {
    let volume = homogeneous([8; 3]);
    let of = |count: u32, share: f64| {
        let part = |i| {
            let irradiance = json!([2.0 * share, 2.5 * share, 3.0 * share]);
            json!({"id": format!("{i}"), "type": "directional", "direction": [-0.4, -1, -0.7], "irradiance": irradiance})
        };
        let lights: Vec<Value> = (0..count).map(part).collect();
        pixels(&scene(
            &volume,
            json!({"lights": lights, "illumination": {"method": "convection_diffusion", "light_grid": 1}}),
            1,
        ))
    };
    let (one, many) = (of(1, 1.0), of(64, 1.0 / 64.0));
    let off = one.iter().flatten().zip(many.iter().flatten()).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 2e-3 && one.iter().flatten().any(|x| *x > 0.1));
}
