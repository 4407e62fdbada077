//! Method `path_traced` against the independent reference, and the properties it promises.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;

use common::{draw, json_merge, prepared, renderer, target};
use proto::SceneFile;
use proto::scene_file::Builtin;
use reference::statistics::{ZTest, z_test_image};
use reference::{Progress, Request};
use render::View;
use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Scene, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

/// Pixels of a picture.
const SIZE: [u32; 2] = [10, 8];
/// Paths of each pixel, on both sides.
const PATHS: u32 = 512;
/// A right tracer fails one of the tests once in ten thousand changes of its random numbers.
const LEVEL: f64 = 1e-4;
/// What a wrong tracer's test must stay below.
const CERTAIN: f64 = 1e-9;

type Pixels = Vec<[f64; 3]>;

/// Blobs of values between 0 and 255, rough enough for surfaces.
fn blobs(dims: [usize; 3]) -> Arc<PreparedVolume> {
    let [nx, ny, _] = dims;
    let value = |i: usize| {
        let [x, y, z] = [i % nx, i / nx % ny, i / (nx * ny)].map(|v| v as f64);
        127.5 + 42.0 * ((0.9 * x).sin() + (0.7 * y + 0.3 * x).sin() + (0.8 * z - 0.2 * y).sin())
    };
    let voxels = (0..dims.iter().product()).map(|i| value(i) as u8).collect();
    prepared(Volume::new(dims, Voxels::U8(voxels)))
}

fn sky() -> EnvironmentImages {
    let (width, height) = (16, 8);
    let texel = |i: usize| {
        let (x, y) = (i % width, i / width);
        let sun = if (x, y) == (3, 2) { 40.0 } else { 0.0 };
        [0.2 + sun, 0.3 + 0.05 * x as f32 + sun, 0.8 - 0.08 * y as f32 + 0.7 * sun]
    };
    let rgb: Vec<f32> = (0..width * height).flat_map(texel).collect();
    [("sky".to_owned(), Arc::new(EnvironmentImage::new(width, height, &rgb).unwrap()))].into()
}

/// Matter from the middle of the values on, in two materials and colours.
fn base() -> Value {
    json!({"version": 1, "volume": {"builtin": "homogeneous"}, "illumination": {"method": "path_traced"},
        "materials": {"m": {}, "n": {}},
        "transfer_function": {"points": [
            {"s": 0.4, "extinction": 0, "albedo": [0.9, 0.5, 0.3], "material": "m"},
            {"s": 0.6, "extinction": 12, "albedo": [0.9, 0.7, 0.5], "material": "n"},
            {"s": 0.9, "extinction": 30, "albedo": [0.4, 0.8, 1.0], "material": "n"}]},
        "camera": {"position": [0.9, 0.6, 1.3], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 50},
        "background": [0.1, 0.2, 0.3],
        "lights": [{"id": "sun", "type": "directional", "direction": [-0.4, -1, -0.3], "irradiance": [3, 2.5, 2]}]})
}

fn scene(volume: &Arc<PreparedVolume>, patch: Value) -> Scene {
    let mut file = base();
    json_merge(&mut file, patch);
    Scene::with_images(&SceneFile::from_value(file).unwrap(), volume.clone(), &sky()).unwrap()
}

/// Mean and standard error of the GPU's picture, from two paths a pixel on.
fn traced(scene: &Scene, paths: u32) -> (Pixels, Pixels) {
    let mut renderer = renderer();
    let mut view = View::new();
    let snapshot = Arc::new(Snapshot { epoch: 1, scene: scene.clone() });
    let drawn = draw(&mut renderer, &mut view, &snapshot, target(SIZE[0], SIZE[1], paths));
    assert_eq!(drawn.counters["paths_not_finite"], 0);
    let pixels = |rgb: Vec<f32>| rgb.as_chunks::<3>().0.iter().map(|p| p.map(f64::from)).collect();
    (pixels(renderer.radiance(&view).unwrap().rgb), pixels(renderer.standard_error(&view).unwrap().rgb))
}

fn judge(drawn: &Scene, judged: &Scene) -> ZTest {
    let (mean, error) = traced(drawn, PATHS);
    let request = Request { seed: 7, ..Request::new(SIZE[0], SIZE[1], PATHS) };
    let truth = reference::render(judged, &request, &Progress::default()).unwrap();
    z_test_image(&mean, &error, &truth.mean, &truth.standard_error)
}

/// Scenes that between them have every kind of light, phase function, surface, filter and clipping.
fn scenes() -> Vec<(&'static str, Scene)> {
    let round = blobs([14, 12, 16]);
    let of = |patch| scene(&round, patch);
    let builtin = |kind: Builtin| {
        let volume = prepared(scene::builtin::build(kind, [24; 3], &|_| {}));
        let mut file = scene::builtin::scene(kind).unwrap();
        file.illumination.method = proto::scene_file::Method::PathTraced;
        Scene::new(&file, volume).unwrap()
    };
    let lights = |lights| json!({"lights": lights});
    let surface = |brdf: Value, weight: f64| json!({"m": {"surface": weight, "brdf": brdf}, "n": {"surface": 1, "brdf": brdf}});
    vec![
        ("directional", of(json!({}))),
        (
            "glow alone on surfaces",
            of(json!({"lights": [],
                "materials": {"m": {"surface": 1, "brdf": {"type": "lambert", "diffuse": 0.9}}},
                "transfer_function": {"points": [{"s": 0.45, "extinction": 0, "material": "m"},
                    {"s": 0.7, "extinction": 20, "albedo": [0.9, 0.6, 0.3], "emission": [2, 1, 0.2], "material": "m"}]}})),
        ),
        ("single scattering", of(json!({"scattering": {"orders": 1}}))),
        (
            "two orders, point",
            of(json!({"scattering": {"orders": 2}, "lights": [
            {"type": "point", "position": [0.3, 1.1, 0.8], "intensity": [3, 3, 2]}]})),
        ),
        (
            "spot, forward",
            of(
                json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": 0.8}}, "n": {"phase": {"type": "schlick", "k": 0.6}}},
            "lights": [{"type": "spot", "position": [0.5, 1.2, 0.4], "direction": [-0.4, -1, -0.3], "cone_degrees": [10, 40], "intensity": [6, 5, 4]}]}),
            ),
        ),
        (
            "backward, narrow lobes",
            of(
                json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": -0.5}}, "n": {"phase": {"type": "henyey_greenstein", "g": 0.99}}}}),
            ),
        ),
        (
            "rectangle and disk",
            of(lights(json!([
            {"type": "rectangle", "center": [0, 0.9, 0], "normal": [0.1, -1, 0], "up": [0, 0, 1], "size": [0.6, 0.4], "radiance": [4, 4, 3]},
            {"type": "disk", "center": [0.9, 0.1, 0.2], "normal": [-1, 0, 0], "radius": 0.3, "radiance": [1, 3, 5]}]))),
        ),
        (
            "sphere inside",
            of(lights(
                json!([{"type": "sphere", "center": [0.05, 0.1, -0.05], "radius": 0.15, "radiance": [4, 2, 1]}]),
            )),
        ),
        (
            "uniform environment, glow",
            of(json!({"background": "environment",
            "lights": [{"type": "environment", "radiance": [0.5, 0.7, 1.0]}],
            "transfer_function": {"points": [{"s": 0.45, "extinction": 0}, {"s": 0.7, "extinction": 9, "albedo": [0.9, 0.6, 0.3], "emission": [2, 1, 0.2]}]}})),
        ),
        (
            "environment image",
            of(json!({"background": "environment",
            "lights": [{"type": "environment", "image": "sky", "rotation_degrees": [20, 70, 10], "scale": 0.6}]})),
        ),
        (
            "image, surfaces of two exponents",
            of(
                json!({"materials": surface(json!({"type": "ashikhmin_shirley", "diffuse": 0.6, "specular": 0.3, "exponents": [8, 40]}), 0.5),
            "lights": [{"type": "environment", "image": "sky"}]}),
            ),
        ),
        (
            "shiny",
            of(
                json!({"materials": surface(json!({"type": "blinn_phong", "diffuse": 0.7, "specular": 0.3, "exponent": 25}), 0.8)}),
            ),
        ),
        (
            "abc, disk",
            of(
                json!({"materials": surface(json!({"type": "abc", "diffuse": 0.4, "a": 0.6, "b": 30, "c": 1.4}), 0.7), "lights": [
            {"type": "disk", "center": [0.2, 1, 0.6], "normal": [-0.2, -1, -0.5], "radius": 0.4, "radiance": [5, 5, 5]}]}),
            ),
        ),
        (
            "clipped, in its shadow",
            of(
                json!({"clip": {"box": [[0, 0, 0], [1, 0.6, 1]], "planes": [{"normal": [1, 0.3, 0], "offset": -0.1}], "shadows": true}}),
            ),
        ),
        (
            "clipped, gone",
            of(
                json!({"clip": {"box": [[0, 0, 0], [1, 0.6, 1]], "planes": [{"normal": [1, 0.3, 0], "offset": -0.1}], "shadows": false}}),
            ),
        ),
        ("thin voxels", of(json!({"spacing": [1, 0.2, 3], "density": 4}))),
        ("nearest", of(json!({"volume": {"builtin": "homogeneous", "filter": "nearest"}}))),
        ("cornell box", builtin(Builtin::CornellBox)),
        ("thick blob", builtin(Builtin::ThickBlob)),
        ("buckyball", builtin(Builtin::Buckyball)),
    ]
}

#[test]
fn agrees_with_the_reference() {
    let scenes = scenes();
    // Bonferroni over the scenes.
    let level = LEVEL / scenes.len() as f64;
    let mut failed = Vec::new();
    for (name, scene) in &scenes {
        let began = std::time::Instant::now();
        let test = judge(scene, scene);
        eprintln!(
            "{name}: worst z {:.2}, mean z^2 {:.3}, bias z {:.2}, {:.1} s",
            test.worst_z,
            test.mean_square,
            test.mean_z,
            began.elapsed().as_secs_f64()
        );
        if !test.passes(level) {
            failed.push((*name, test));
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn other_scenes_are_noticed() {
    let volume = blobs([14, 12, 16]);
    let of = |patch| scene(&volume, patch);
    let phase = |g: f64| {
        json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": g}},
            "n": {"phase": {"type": "henyey_greenstein", "g": g}}}})
    };
    let albedo = |a: f64| {
        json!({"transfer_function": {"points": [{"s": 0.4, "extinction": 0, "albedo": [a, a, a]},
            {"s": 0.6, "extinction": 20, "albedo": [a, a, a]}]}})
    };
    let pairs = [
        ("sign of g", of(phase(0.6)), of(phase(-0.6))),
        ("albedo", of(albedo(0.95)), of(albedo(0.9))),
        ("density", of(json!({})), of(json!({"density": 1.5}))),
        ("orders", of(json!({"scattering": {"orders": 2}})), of(json!({"scattering": {"orders": 3}}))),
        (
            "shadows of clipped matter",
            of(json!({"clip": {"box": [[0, 0, 0], [1, 0.6, 1]], "shadows": true}})),
            of(json!({"clip": {"box": [[0, 0, 0], [1, 0.6, 1]], "shadows": false}})),
        ),
    ];
    for (name, drawn, judged) in pairs {
        let test = judge(&drawn, &judged);
        eprintln!("{name}: {test:?}");
        assert!(!test.passes(CERTAIN), "{name}: {test:?}");
    }
}
