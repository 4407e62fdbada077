//! Scenes made of numbers, and what is expected of them.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used)]

use std::sync::Arc;

use glam::DVec3;
use proto::SceneFile;
use reference::statistics::{ZTest, z_test_image};
use reference::{Estimate, Progress, Request, Transport};
use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Scene, Volume, Voxels};
use serde_json::{Value, json};

/// Seeds are fixed: a right tracer fails a test once in ten thousand changes of its numbers.
pub const LEVEL: f64 = 1e-4;
/// What a wrong tracer's test must stay below.
pub const CERTAIN: f64 = 1e-9;
/// Pixels along each edge of a test picture.
pub const EDGE: u32 = 8;

pub fn prepared(volume: Volume) -> Arc<PreparedVolume> {
    Arc::new(PreparedVolume::new(volume, &|_| {}))
}

/// A cube of one value.
pub fn homogeneous() -> Arc<PreparedVolume> {
    prepared(Volume::new([4; 3], Voxels::U8(vec![255; 64])))
}

/// A cube whose value grows along x: it has the same normal everywhere.
pub fn ramp() -> Arc<PreparedVolume> {
    prepared(Volume::new([8; 3], Voxels::U8((0..512).map(|i| 20 * (i % 8) as u8).collect())))
}

/// A scene from a JSON object; `volume` and `version` are filled in, and a material `m`.
pub fn scene(volume: &Arc<PreparedVolume>, patch: Value) -> Scene {
    scene_with_images(volume, patch, &EnvironmentImages::new())
}

pub fn scene_with_images(volume: &Arc<PreparedVolume>, patch: Value, images: &EnvironmentImages) -> Scene {
    let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "materials": {"m": {}}});
    for (key, value) in patch.as_object().unwrap() {
        file[key] = value.clone();
    }
    Scene::with_images(&SceneFile::from_value(file).unwrap(), volume.clone(), images).unwrap()
}

/// One image under the name `sky`.
pub fn sky(width: usize, height: usize, rgb: &[f32]) -> EnvironmentImages {
    [("sky".to_owned(), Arc::new(EnvironmentImage::new(width, height, rgb).unwrap()))].into()
}

/// The same matter everywhere.
pub fn matter(sigma_t: f64, albedo: f64) -> Value {
    json!({"points": [{"s": 0, "extinction": sigma_t, "albedo": [albedo, albedo, albedo], "material": "m"}]})
}

pub fn henyey_greenstein(g: f64) -> Value {
    json!({"m": {"phase": {"type": "henyey_greenstein", "g": g}}})
}

/// All pixels look along one ray, but for a millionth of a world unit.
pub fn narrow(position: DVec3, target: DVec3) -> Value {
    json!({"position": position.to_array(), "target": target.to_array(), "up": [0.1, 1, 0.2],
        "orthographic_height": 1e-6})
}

/// The ray of [`narrow`].
pub fn ray(position: DVec3, target: DVec3) -> (DVec3, DVec3) {
    (position, (target - position).normalize())
}

/// A view that meets a cube obliquely, through no edge.
pub const OBLIQUE: [DVec3; 2] = [DVec3::new(1.1, 0.7, 1.5), DVec3::new(0.05, -0.1, 0.02)];

pub fn oblique_camera() -> Value {
    narrow(OBLIQUE[0], OBLIQUE[1])
}

pub fn oblique_ray() -> (DVec3, DVec3) {
    ray(OBLIQUE[0], OBLIQUE[1])
}

pub fn estimate(scene: &Scene, samples: u32) -> Estimate {
    reference::render(scene, &Request::new(EDGE, EDGE, samples), &Progress::default()).unwrap()
}

pub fn estimate_local(scene: &Scene, samples: u32) -> Estimate {
    let request = Request { transport: Transport::Local, ..Request::new(EDGE, EDGE, samples) };
    reference::render(scene, &request, &Progress::default()).unwrap()
}

/// Against the same grey in every pixel.
pub fn against(estimate: &Estimate, expected: f64) -> ZTest {
    against_pixels(estimate, &vec![[expected; 3]; estimate.mean.len()])
}

pub fn against_pixels(estimate: &Estimate, expected: &[[f64; 3]]) -> ZTest {
    let exact = vec![[0.0; 3]; expected.len()];
    z_test_image(&estimate.mean, &estimate.standard_error, expected, &exact)
}

/// Passes against the right value, and would not against a wrong one: the test can tell.
pub fn assert_agrees(what: &str, estimate: &Estimate, expected: f64, wrong: &[(&str, f64)]) {
    let test = against(estimate, expected);
    assert!(test.passes(LEVEL), "{what}: expected {expected}, {:?} {test:?}", mean(estimate));
    for (fault, wrong) in wrong {
        let test = against(estimate, *wrong);
        assert!(!test.passes(CERTAIN), "{what}: {fault} would go unnoticed: {expected} {wrong} {test:?}");
    }
}

/// Mean of all pixels, first channel.
pub fn mean(estimate: &Estimate) -> f64 {
    estimate.mean.iter().map(|pixel| pixel[0]).sum::<f64>() / estimate.mean.len() as f64
}
