//! The shader's phase functions and BRDFs give what their f64 counterparts give, seen through a
//! picture: a flat wall of one material under one directional light.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::{prepared, radiance, snapshot, target};
use glam::DVec3;
use proto::scene_file::{Brdf, Phase};
use scene::scattering::{brdf, phase_function};
use scene::{Volume, Voxels};
use serde_json::{Value, json};

/// A ramp in z: its gradient points along z everywhere, and matter is everywhere the same.
fn ramp() -> std::sync::Arc<scene::PreparedVolume> {
    let voxels = (0..16 * 16 * 16).map(|i| (i / 256) as f32).collect();
    prepared(Volume::new([16; 3], Voxels::F32(voxels)))
}

/// Radiance of the middle pixel of opaque matter, seen along -z, and the scene it was drawn of.
fn seen(material: &Value, direction: DVec3) -> (f64, std::sync::Arc<scene::Snapshot>) {
    let patch = json!({
        "transfer_function": {"points": [{"s": 0, "extinction": 500, "albedo": [0.8, 0.8, 0.8], "material": "m"}]},
        "materials": {"m": material},
        "lights": [{"type": "directional", "direction": direction.to_array(), "irradiance": [1, 1, 1]}],
        "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.01}
    });
    let snapshot = snapshot(&ramp(), patch, 1);
    (f64::from(radiance(&snapshot, target(1, 1, 1)).rgb[0]), snapshot)
}

fn directions() -> [DVec3; 4] {
    [DVec3::NEG_Z, DVec3::new(0.5, 0.2, -1.0), DVec3::new(-1.0, 0.7, -0.8), DVec3::new(0.3, -0.4, 1.0)]
        .map(DVec3::normalize)
}

#[test]
fn phase_functions_agree() {
    let phases = [
        json!({"type": "isotropic"}),
        json!({"type": "henyey_greenstein", "g": 0.7}),
        json!({"type": "henyey_greenstein", "g": -0.3}),
        json!({"type": "schlick", "k": 0.6}),
    ];
    for phase in phases {
        for direction in directions() {
            let (got, _) = seen(&json!({"phase": phase}), direction);
            // The view ray travels along -z, so light leaves along +z.
            let parsed: Phase = serde_json::from_value(phase.clone()).unwrap();
            let expected = 0.8 * phase_function(&parsed, direction.z);
            assert!((got - expected).abs() < 1e-4 * expected + 1e-6, "{phase} {direction}: {got} {expected}");
        }
    }
}

#[test]
fn brdfs_agree() {
    let brdfs = [
        json!({"type": "lambert", "diffuse": 0.7}),
        json!({"type": "blinn_phong", "diffuse": 0.5, "specular": 0.3, "exponent": 20}),
        json!({"type": "ashikhmin_shirley", "diffuse": 0.6, "specular": 0.1, "exponents": [10, 60]}),
        json!({"type": "abc", "diffuse": 0.4, "a": 0.5, "b": 30, "c": 1.3}),
    ];
    for (index, surface) in brdfs.iter().enumerate() {
        for direction in directions() {
            let (got, _) = seen(&json!({"surface": 1.0, "brdf": surface}), direction);
            let parsed: Brdf = serde_json::from_value(surface.clone()).unwrap();
            let f_r = brdf(&parsed, DVec3::Z, -direction, DVec3::Z);
            let expected = (0.8 * f_r.x + f_r.y) * (-direction.z).max(0.0);
            assert!((got - expected).abs() < 1e-3 * expected + 1e-6, "{index} {direction}: {got} {expected}");
        }
    }
}
