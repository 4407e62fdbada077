//! The kernel that is widened where photons are few.

use serde_json::{Value, json};

use super::PhotonTrial;
use super::gather_tests::{off, picture};
use crate::Renderer;
use crate::test_support::{balls, renderer};

/// Thin matter under light from all around, which photons alone bring, and opaque matter.
fn scene(extinction: f64, photons: u32) -> Value {
    let white =
        |s: f64, extinction: f64| json!({"s": s, "extinction": extinction, "albedo": [0.8, 0.8, 0.8]});
    json!({"transfer_function": {"points": [white(0.1, 0.0), white(0.4, extinction)]}, "background": [0, 0, 0],
        "lights": [{"id": "sky", "type": "environment", "radiance": [1, 1, 1]}],
        "illumination": {"photons": photons, "photon_grid": 24}})
}

/// How far off pictures are whose kernel is widened, and is not.
fn errors(renderer: &mut Renderer, scene: &Value) -> [f64; 2] {
    let volume = balls(24);
    let paths = json!({"illumination": {"method": "path_traced", "paths_per_pixel": 256}});
    let (expected, _) = picture(renderer, &volume, &[scene.clone(), paths]);
    [true, false].map(|widens| {
        renderer.try_photons(PhotonTrial { widens, ..PhotonTrial::default() });
        let (rgb, _) = picture(renderer, &volume, std::slice::from_ref(scene));
        renderer.try_photons(PhotonTrial::default());
        off(&rgb, |i| f64::from(expected[i]))
    })
}

#[test]
fn few_photons_are_nearer_with_a_wider_kernel_and_many_are_no_farther() {
    let mut renderer = renderer();
    for (extinction, photons, most) in [(8.0, 2048, 0.8), (8.0, 262_144, 1.05), (300.0, 16_384, 1.0)] {
        let [widened, found] = errors(&mut renderer, &scene(extinction, photons));
        eprintln!("extinction {extinction}, {photons} photons: {widened:.4}, as found {found:.4}");
        assert!(widened < most * found, "extinction {extinction}, {photons} photons: {widened} and {found}");
    }
}
