//! Furnaces, clipping, environments, orders, bounds: what holds in any matter.
#![allow(clippy::unwrap_used)]

mod common;

use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use common::*;
use glam::DVec3;
use reference::closed_forms::{self, HomogeneousBox};
use reference::{Ended, Pixel, Progress, Request, Transport};
use scene::levels::Reduction;
use scene::part::Part;
use scene::{PreparedVolume, Volume, Voxels};
use serde_json::{Value, json};

/// Values without any order, in voxels that are no cubes.
fn noise() -> Arc<PreparedVolume> {
    let voxel = |i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8;
    let mut volume = Volume::new([7, 6, 5], Voxels::U8((0..210).map(voxel).collect()));
    volume.spacing = [1.0, 1.3, 0.8];
    prepared(volume)
}

/// A ramp with a step and matter of one material.
fn uneven_matter(albedo: [f64; 3], emission: [f64; 3]) -> Value {
    let point = |s: f64, extinction: f64| json!({"s": s, "extinction": extinction, "albedo": albedo, "emission": emission, "material": "m"});
    json!({"points": [point(0.2, 0.0), point(0.5, 8.0), point(0.5, 2.0), point(1.0, 25.0)]})
}

fn wide_camera() -> Value {
    json!({"position": [0.9, 0.6, 1.4], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 45})
}

fn materials() -> Vec<(&'static str, Value)> {
    vec![
        ("isotropic", json!({"m": {}})),
        ("henyey_greenstein", henyey_greenstein(0.6)),
        ("schlick", json!({"m": {"phase": {"type": "schlick", "k": -0.5}}})),
        ("lambert", json!({"m": {"surface": 1.0, "brdf": {"type": "lambert", "diffuse": 1.0}}})),
        (
            "half a surface",
            json!({"m": {"surface": 0.5, "brdf": {"type": "lambert", "diffuse": 1.0},
                "phase": {"type": "henyey_greenstein", "g": -0.3}}}),
        ),
    ]
}

#[test]
fn white_matter_cannot_be_told_from_a_uniform_environment() {
    let expected = closed_forms::white_furnace(0.5);
    for (name, materials) in materials() {
        let scene = scene(
            &noise(),
            json!({"transfer_function": uneven_matter([1.0; 3], [0.0; 3]), "materials": materials,
                "lights": [{"type": "environment", "radiance": [0.5, 0.5, 0.5]}],
                "background": "environment", "camera": wide_camera()}),
        );
        let estimate = estimate(&scene, 512);
        let wrong = [("a hundredth lost", 0.99 * expected), ("a hundredth gained", 1.01 * expected)];
        assert_agrees(name, &estimate, expected, &wrong);
        assert_eq!(estimate.cut, 0.0);
    }
}

#[test]
fn an_image_of_one_colour_is_a_uniform_environment() {
    let scene = scene_with_images(
        &noise(),
        json!({"transfer_function": uneven_matter([1.0; 3], [0.0; 3]), "background": "environment",
            "lights": [{"type": "environment", "image": "sky", "scale": 0.25, "rotation_degrees": [10, 20, 30]}],
            "camera": wide_camera()}),
        &sky(3, 2, &[2.0; 18]),
    );
    assert_agrees("image", &estimate(&scene, 512), 0.5, &[("no scale", 2.0), ("a hundredth lost", 0.495)]);
}

#[test]
fn matter_as_hot_as_its_surroundings_is_invisible() {
    // It emits what it absorbs, at any albedo, and lights itself.
    let scene = scene(
        &noise(),
        json!({"transfer_function": uneven_matter([0.9, 0.5, 0.0], [0.5; 3]), "background": "environment",
            "lights": [{"type": "environment", "radiance": [0.5, 0.5, 0.5]}],
            "materials": henyey_greenstein(0.3), "camera": wide_camera()}),
    );
    assert_agrees("equilibrium", &estimate(&scene, 512), 0.5, &[("a hundredth lost", 0.495)]);
    // With emission that does not light its surroundings it would be darker.
    let dark = scene::Scene { lights: Vec::new(), ..scene };
    let glow = mean(&estimate(&dark, 512));
    let alone = scene::Scene { orders: proto::scene_file::Orders::AtMost(1), ..dark };
    let first = mean(&estimate(&alone, 512));
    assert!(glow > first && first > 0.0, "{glow} {first}");
}

#[test]
fn an_image_lights_from_where_it_shows() {
    // One column, two rows, turned so that the map's +y is the world's +z: radiance goes linearly
    // in the polar angle from 3 at a quarter of the half turn to 1 at three quarters.
    let from_angle = |angle: f64| 3.0 - 2.0 * (2.0 * angle / PI - 0.5).clamp(0.0, 1.0);
    let radiance = move |w: DVec3| from_angle(w.z.clamp(-1.0, 1.0).acos());
    let images = sky(1, 2, &[3.0, 3.0, 3.0, 1.0, 1.0, 1.0]);
    let (sigma_t, g) = (2.0, 0.4);
    let patch = |sigma_t: f64| {
        json!({"transfer_function": matter(sigma_t, 0.8), "materials": henyey_greenstein(g),
            "lights": [{"type": "environment", "image": "sky", "rotation_degrees": [90, 0, 0]}],
            "background": "environment", "camera": oblique_camera(), "scattering": {"orders": 1}})
    };
    let cube = HomogeneousBox { size: DVec3::ONE, sigma_t };
    let (origin, direction) = oblique_ray();
    let behind = cube.transmittance(origin, direction) * radiance(direction);
    let phase = closed_forms::henyey_greenstein(0.8, g);
    let scattered =
        cube.lit_by_environment((origin, direction), 1.0, |w_i, w_o| radiance(w_i) * phase(w_i, w_o));
    let upside_down =
        cube.lit_by_environment((origin, direction), 1.0, |w_i, w_o| radiance(-w_i) * phase(w_i, w_o));
    let matter = scene_with_images(&homogeneous(), patch(sigma_t), &images);
    let wrong = [("upside down", behind + upside_down), ("no background", scattered)];
    assert_agrees("image", &estimate(&matter, 2048), behind + scattered, &wrong);
    let vacuum = scene_with_images(&homogeneous(), patch(0.0), &images);
    assert!((mean(&estimate(&vacuum, 2)) - radiance(direction)).abs() < 1e-5);
}

#[test]
fn a_spot_fades_by_smoothstep_in_the_cosine() {
    let (position, axis) = (DVec3::new(0.1, 1.2, 0.2), DVec3::new(0.1, -1.0, 0.0).normalize());
    let scene = scene(
        &homogeneous(),
        json!({"transfer_function": matter(2.0, 0.8), "camera": oblique_camera(), "scattering": {"orders": 1},
            "lights": [{"type": "spot", "position": position.to_array(), "direction": axis.to_array(),
                "cone_degrees": [8, 30], "intensity": [9, 9, 9]}]}),
    );
    let cube = HomogeneousBox { size: DVec3::ONE, sigma_t: 2.0 };
    let [inner, outer] = [8.0f64, 30.0].map(|degrees| degrees.to_radians().cos());
    let phase = closed_forms::isotropic(0.8);
    let share = |w_i: DVec3| {
        let x = ((-w_i.dot(axis) - outer) / (inner - outer)).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    };
    let expected = cube.lit_by_point(oblique_ray(), (position, 9.0), |w_i, w_o| share(w_i) * phase(w_i, w_o));
    let point = cube.lit_by_point(oblique_ray(), (position, 9.0), &phase);
    assert_agrees("spot", &estimate(&scene, 2048), expected, &[("a point light", point)]);
}

#[test]
fn phase_and_surface_mix_by_their_weight() {
    let travel = DVec3::new(-0.48, -0.64, 0.6);
    let point = json!({"s": 0, "extinction": 2.0, "albedo": [0.8, 0.8, 0.8], "material": "m"});
    let material = json!({"m": {"surface": 0.3, "brdf": {"type": "lambert", "diffuse": 0.9},
        "phase": {"type": "henyey_greenstein", "g": 0.5}}});
    let scene = scene(
        &ramp(),
        json!({"transfer_function": {"points": [point]}, "materials": material, "camera": oblique_camera(),
            "lights": [{"type": "directional", "direction": travel.to_array(), "irradiance": [3, 3, 3]}],
            "scattering": {"orders": 1}}),
    );
    let cube = HomogeneousBox { size: DVec3::ONE, sigma_t: 2.0 };
    let lit = |surface: f64| {
        let (phase, lambert) =
            (closed_forms::henyey_greenstein(0.8, 0.5), closed_forms::lambert(0.72, DVec3::X));
        cube.lit_by_directional(oblique_ray(), (travel, 3.0), |w_i, w_o| {
            (1.0 - surface) * phase(w_i, w_o) + surface * lambert(w_i, w_o)
        })
    };
    let wrong = [("the other weight", lit(0.7)), ("no surface", lit(0.0))];
    assert_agrees("mix", &estimate(&scene, 4096), lit(0.3), &wrong);
}

#[test]
fn clipped_matter_is_unseen_and_blocks_light_if_it_should() {
    // Kept: x <= 0. The eye looks along -z at x = -0.2, light travels along -x.
    let sigma_t = 2.0f64;
    let patch = |shadows: bool, orders: Value| {
        json!({"transfer_function": matter(sigma_t, 0.8), "scattering": {"orders": orders},
            "lights": [{"type": "directional", "direction": [-1, 0, 0], "irradiance": [3, 3, 3]}],
            "camera": narrow(DVec3::new(-0.2, 0.1, 2.0), DVec3::new(-0.2, 0.1, 0.0)),
            "clip": {"planes": [{"normal": [-2, 0, 0], "offset": 0}], "shadows": shadows}})
    };
    let expected = |way: f64| 3.0 * 0.8 / (4.0 * PI) * (-sigma_t * way).exp() * (1.0 - (-sigma_t).exp());
    for (shadows, way, other) in [(true, 0.7, 0.2), (false, 0.2, 0.7)] {
        let scene = scene(&homogeneous(), patch(shadows, json!(1)));
        let wrong = [("the other setting", expected(other))];
        assert_agrees(&format!("shadows {shadows}"), &estimate(&scene, 2048), expected(way), &wrong);
    }
    // A box in volume coordinates does the same.
    let mut boxed = scene(&homogeneous(), patch(false, json!(1)));
    boxed.clip =
        scene(&homogeneous(), json!({"clip": {"box": [[0, 0, 0], [0.5, 1, 1]], "shadows": false}})).clip;
    assert_agrees("box", &estimate(&boxed, 2048), expected(0.2), &[]);
    // The eye looks through what is clipped.
    let seen = scene(
        &homogeneous(),
        json!({"transfer_function": matter(sigma_t, 0.0), "background": [1, 1, 1],
            "camera": narrow(DVec3::new(2.0, 0.1, 0.1), DVec3::new(0.0, 0.1, 0.1)),
            "clip": {"planes": [{"normal": [-1, 0, 0], "offset": 0}], "shadows": true}}),
    );
    let through = (-0.5 * sigma_t).exp();
    assert_agrees("view", &estimate(&seen, 2048), through, &[("clipped matter seen", through * through)]);
    // Blocking matter scatters nothing: all orders stay below those without it.
    let all = |shadows: bool| mean(&estimate(&scene(&homogeneous(), patch(shadows, json!("all"))), 2048));
    assert!(all(true) > expected(0.7) && all(true) < 0.6 * all(false), "{} {}", all(true), all(false));
}

#[test]
fn nearest_voxels_are_boxes_of_their_own() {
    let volume = prepared(Volume::new([1, 1, 4], Voxels::U8(vec![0, 255, 100, 255])));
    let scene = scene(
        &volume,
        json!({"volume": {"builtin": "homogeneous", "filter": "nearest"}, "value_range": [0, 255],
            "transfer_function": {"points": [{"s": 0.5, "extinction": 0}, {"s": 0.5, "extinction": 5, "albedo": [0, 0, 0]}]},
            "background": [1, 1, 1], "camera": narrow(DVec3::new(0.1, 0.0, 2.0), DVec3::new(0.1, 0.0, 0.0))}),
    );
    let expected = (-5.0f64 * 0.5).exp();
    // Linear, values are above the middle on more than two voxels.
    let crossing = (255.0 - 127.5) / (255.0 - 100.0);
    let linear = (-5.0f64 * 0.25 * (0.5 + crossing + crossing + 0.5)).exp();
    assert_agrees("nearest", &estimate(&scene, 8192), expected, &[("the linear filter", linear)]);
    assert!((mean(&estimate_local(&scene, 2)) - expected).abs() < 1e-12);
    let filter = proto::scene_file::Filter::Linear;
    let smooth = scene::Scene { filter, ..scene };
    assert_agrees("linear", &estimate(&smooth, 8192), linear, &[("the nearest filter", expected)]);
}

#[test]
fn threads_and_stops_change_no_bit() {
    let scene = scene(
        &noise(),
        json!({"transfer_function": uneven_matter([0.9, 0.8, 0.7], [0.0; 3]), "camera": wide_camera(),
            "materials": materials()[4].1, "background": [0.1, 0.1, 0.1],
            "lights": [{"type": "sphere", "center": [0, 1, 0], "radius": 0.3, "radiance": [5, 5, 5]}]}),
    );
    let with_threads = |threads: usize, samples: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| estimate(&scene, samples))
    };
    let (one, many) = (with_threads(1, 40), with_threads(5, 40));
    assert_eq!((one.mean, one.standard_error), (many.mean.clone(), many.standard_error));
    let other_seed = Request { seed: 1, ..Request::new(EDGE, EDGE, 40) };
    assert_ne!(reference::render(&scene, &other_seed, &Progress::default()).unwrap().mean, many.mean);
    // A picture that was ended by its error is the picture of that many samples.
    let request = Request { relative_error: Some(0.2), ..Request::new(EDGE, EDGE, 100_000) };
    let ended = reference::render(&scene, &request, &Progress::default()).unwrap();
    assert_eq!(ended.ended, Ended::RelativeError);
    assert!(ended.relative_error <= 0.2 && ended.samples < 100_000);
    assert_eq!(with_threads(2, ended.samples).mean, ended.mean);
}

#[test]
fn standard_errors_are_the_spread_of_pictures() {
    let scene = scene(
        &noise(),
        json!({"transfer_function": uneven_matter([0.9; 3], [0.0; 3]), "camera": wide_camera(),
            "lights": [{"type": "directional", "direction": [0, -1, 0], "irradiance": [3, 3, 3]}]}),
    );
    let picture = |seed: u64| {
        let request = Request { seed, ..Request::new(EDGE, EDGE, 256) };
        reference::render(&scene, &request, &Progress::default()).unwrap()
    };
    let (a, b) = (picture(1), picture(2));
    let test = |se: &[[f64; 3]]| reference::statistics::z_test_image(&a.mean, se, &b.mean, &b.standard_error);
    assert!(test(&a.standard_error).passes(LEVEL), "{:?}", test(&a.standard_error));
}

#[test]
fn dense_white_matter_ends_and_says_what_it_cut() {
    let scene = scene(
        &homogeneous(),
        json!({"transfer_function": matter(1e6, 1.0), "camera": wide_camera(), "background": "environment",
            "lights": [{"type": "environment", "radiance": [1, 1, 1]}]}),
    );
    let request = Request { longest_path: 1000, ..Request::new(EDGE, EDGE, 32) };
    let cut = reference::render(&scene, &request, &Progress::default()).unwrap();
    assert!(cut.cut > 0.005 && cut.cut < 0.05, "{}", cut.cut);
    let se = cut.standard_error.iter().map(|se| se[0] * se[0]).sum::<f64>().sqrt() / 64.0;
    let missing = 1.0 - mean(&cut);
    assert!(missing < cut.cut + 5.0 * se && missing > 0.2 * cut.cut, "{missing} {} {se}", cut.cut);
    let longer = reference::render(&scene, &Request::new(4, 4, 8), &Progress::default()).unwrap();
    assert!(longer.cut < cut.cut, "{}", longer.cut);
}

#[test]
fn a_gap_in_dense_matter_is_given_up_rather_than_searched_for_ever() {
    // A thin shell a billion times denser than what lies in the same block.
    let volume = prepared(Volume::new([2, 1, 1], Voxels::U8(vec![0, 255])));
    let points = json!({"points": [{"s": 0, "extinction": 1e-3}, {"s": 0.999, "extinction": 1e-3},
        {"s": 0.9995, "extinction": 1e9}, {"s": 0.9999, "extinction": 1e-3}]});
    let scene = scene(
        &volume,
        json!({"transfer_function": points, "background": [1, 1, 1],
            "camera": narrow(DVec3::new(-0.1, 0.0, 2.0), DVec3::new(-0.1, 0.0, 0.0))}),
    );
    let request = Request::new(1, 1, 2);
    let estimate = reference::render(&scene, &request, &Progress::default()).unwrap();
    assert!(estimate.lost > 0 && estimate.cut > 0.0);
}

#[test]
fn pictures_can_be_watched_cancelled_and_timed() {
    let scene = scene(
        &noise(),
        json!({"transfer_function": uneven_matter([0.99; 3], [0.0; 3]), "camera": wide_camera(),
            "lights": [{"type": "environment", "radiance": [1, 1, 1]}]}),
    );
    let request = Request { time: Some(Duration::from_millis(700)), ..Request::new(EDGE, EDGE, 10_000_000) };
    let reports = AtomicUsize::new(0);
    let report = |report: reference::Report| {
        assert!((0.0..=1.0).contains(&report.share));
        reports.fetch_add(1, Ordering::Relaxed);
    };
    let progress = Progress { report: Some(&report), cancel: None };
    let timed = reference::render(&scene, &request, &progress).unwrap();
    assert!(timed.ended == Ended::Time && timed.samples >= 2 && reports.into_inner() > 0);
    let cancel = AtomicBool::new(true);
    let progress = Progress { report: None, cancel: Some(&cancel) };
    let cancelled = reference::render(&scene, &Request::new(EDGE, EDGE, 1000), &progress).unwrap();
    assert_eq!((cancelled.ended, cancelled.samples), (Ended::Cancelled, 0));
}

#[test]
fn what_is_not_judged_is_refused() {
    let slice = scene(&homogeneous(), json!({"rendering": {"mode": "slice"}}));
    let refused = reference::render(&slice, &Request::new(2, 2, 2), &Progress::default()).unwrap_err();
    assert_eq!(refused.field, "rendering.mode");
    let image = scene_with_images(
        &homogeneous(),
        json!({"lights": [{"id": "dome", "type": "environment", "image": "sky"}]}),
        &sky(1, 1, &[1.0; 3]),
    );
    let local = Request { transport: Transport::Local, ..Request::new(2, 2, 2) };
    let refused = reference::render(&image, &local, &Progress::default()).unwrap_err();
    assert_eq!(refused.field, "lights[dome].image");
    assert!(reference::render(&image, &Request::new(0, 2, 2), &Progress::default()).is_err());
}

#[test]
fn local_is_unshadowed_single_scattering() {
    let (origin, direction) = oblique_ray();
    let cube = HomogeneousBox { size: DVec3::ONE, sigma_t: 2.0 };
    let stopped = 1.0 - cube.transmittance(origin, direction);
    let travel = DVec3::new(-0.48, -0.64, 0.6);
    let light = json!({"type": "directional", "direction": travel.to_array(), "irradiance": [3, 3, 3]});
    let ambient = json!({"type": "environment", "radiance": [0.4, 0.4, 0.4]});
    let scene = scene(
        &homogeneous(),
        json!({"transfer_function": matter(2.0, 0.8), "materials": henyey_greenstein(0.6),
            "lights": [light, ambient], "camera": oblique_camera()}),
    );
    let phase = closed_forms::henyey_greenstein(0.8, 0.6)(-travel, -direction);
    let expected = stopped * (3.0 * phase + 0.8 * 0.4);
    let estimate = estimate_local(&scene, 2);
    assert!((mean(&estimate) / expected - 1.0).abs() < 1e-9, "{} {expected}", mean(&estimate));
}

#[test]
fn a_region_of_a_volume_is_judged_in_its_place() {
    let whole = noise();
    let region = [[0.2, 0.3, 0.1], [0.7, 0.9, 0.8]];
    let part = Part::of_region(whole.volume.dims, 0, Some(region));
    let part = Arc::new(whole.part(&part, Some(region), Reduction::Mean));
    let patch = |clip: Value| {
        json!({"transfer_function": uneven_matter([0.9, 0.5, 0.2], [0.0; 3]), "clip": clip,
            "lights": [{"type": "point", "position": [0.4, 0.5, 0.6], "intensity": [1, 1, 1]}],
            "camera": wide_camera()})
    };
    let request = Request { transport: Transport::Local, pixel: Pixel::Center, ..Request::new(12, 10, 2) };
    let picture = |volume: &Arc<PreparedVolume>, clip: Value| {
        reference::render(&scene(volume, patch(clip)), &request, &Progress::default()).unwrap().mean
    };
    let clipped = picture(&whole, json!({"box": region}));
    let alone = picture(&part, json!({}));
    assert!(clipped.iter().flatten().sum::<f64>() > 1.0);
    for (a, b) in clipped.iter().flatten().zip(alone.iter().flatten()) {
        assert!((a - b).abs() < 1e-3 * (0.1 + a), "{a} {b}");
    }
}
