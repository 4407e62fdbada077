//! The ray caster against closed forms.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::{homogeneous, prepared, radiance, snapshot, target};
use glam::DVec3;
use scene::{Camera, Volume, Voxels};
use serde_json::json;

/// Chord of a ray through the box of the given size, from f64.
fn chord(origin: DVec3, direction: DVec3, size: DVec3) -> f64 {
    let a = (-0.5 * size - origin) / direction;
    let b = (0.5 * size - origin) / direction;
    (a.max(b).min_element() - a.min(b).max_element().max(0.0)).max(0.0)
}

fn opaque_point(sigma_t: f64, albedo: f64, emission: f64) -> serde_json::Value {
    json!({"points": [{"s": 0, "extinction": sigma_t, "albedo": [albedo, albedo, albedo], "emission": [emission, emission, emission]}]})
}

/// Largest difference between the image and a formula of the chord.
fn worst_against(patch: serde_json::Value, dims: [usize; 3], formula: impl Fn(f64) -> f64) -> f64 {
    let volume = homogeneous(dims);
    let snapshot = snapshot(&volume, patch, 1);
    let (width, height) = (48, 40);
    let image = radiance(&snapshot, target(width, height, 1));
    let camera: Camera = snapshot.scene.camera;
    let mut worst: f64 = 0.0;
    for y in 0..height {
        for x in 0..width {
            let (origin, direction) = camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5, width, height);
            let expected = formula(chord(origin, direction, snapshot.scene.grid.size_world));
            let got = f64::from(image.rgb[3 * (y * width + x) as usize]);
            worst = worst.max((got - expected).abs());
        }
    }
    worst
}

const OBLIQUE: [f64; 3] = [1.3, 0.9, 1.7];

fn camera(position: [f64; 3]) -> serde_json::Value {
    json!({"position": position, "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 35})
}

#[test]
fn transmittance_of_a_cube_seen_obliquely() {
    // A chord of f32 is good to a millionth of a world unit, the sum of some hundred f32 steps to 1e-5.
    for sigma_t in [0.1, 2.0, 40.0] {
        let patch = json!({
            "transfer_function": opaque_point(sigma_t, 0.0, 0.0), "background": [1, 1, 1], "camera": camera(OBLIQUE),
            "sampling": {"termination_transmittance": 0}
        });
        let worst = worst_against(patch, [16, 16, 16], |chord| (-sigma_t * chord).exp());
        assert!(worst < 1e-5 + 1e-6 * sigma_t, "sigma_t {sigma_t}: {worst}");
    }
}

#[test]
fn transmittance_of_an_anisotropic_slab_in_orthographic_view() {
    let patch = json!({
        "transfer_function": opaque_point(3.0, 0.0, 0.0), "background": [1, 1, 1],
        "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.4},
        "spacing": [1, 1, 0.25]
    });
    // 0.4 * 48/40 = 0.48 world units wide: inside the face everywhere; depth 0.25.
    let worst = worst_against(patch, [16, 16, 16], |_| (-3.0f64 * 0.25).exp());
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn emission_only() {
    let patch = json!({"transfer_function": opaque_point(2.5, 0.0, 0.7), "camera": camera(OBLIQUE), "sampling": {"termination_transmittance": 0}});
    let worst = worst_against(patch, [8, 8, 8], |chord| 0.7 * (1.0 - (-2.5 * chord).exp()));
    assert!(worst < 2e-5, "{worst}");
}

#[test]
fn emission_vanishes_at_albedo_one() {
    let patch = json!({"transfer_function": opaque_point(2.5, 1.0, 0.7), "camera": camera(OBLIQUE)});
    assert_eq!(worst_against(patch, [8, 8, 8], |_| 0.0), 0.0);
}

#[test]
fn unshadowed_isotropic_scattering() {
    let patch = json!({
        "transfer_function": opaque_point(2.0, 0.8, 0.0), "camera": camera(OBLIQUE), "sampling": {"termination_transmittance": 0},
        "lights": [{"type": "directional", "direction": [1, -2, 0.5], "irradiance": [3, 3, 3]}]
    });
    let per_extinction = 0.8 * 3.0 / (4.0 * std::f64::consts::PI);
    let worst = worst_against(patch, [8, 8, 8], |chord| per_extinction * (1.0 - (-2.0 * chord).exp()));
    assert!(worst < 2e-5, "{worst}");
}

#[test]
fn forward_scattering_is_towards_the_eye_when_looking_into_the_light() {
    let scene = |direction: [f64; 3]| {
        json!({
            "transfer_function": {"points": [{"s": 0, "extinction": 2.0, "material": "default"}]},
            "materials": {"default": {"phase": {"type": "henyey_greenstein", "g": 0.6}}},
            "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.01},
            "lights": [{"type": "directional", "direction": direction, "irradiance": [1, 1, 1]}],
            "sampling": {"termination_transmittance": 0}
        })
    };
    // Light that travels along +z comes towards the eye: cos_theta = 1.
    let hg = |cosine: f64| (1.0 - 0.36) / (4.0 * std::f64::consts::PI * (1.36 - 1.2 * cosine).powf(1.5));
    let (towards, away) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
    let alpha = 1.0 - (-2.0f64).exp();
    assert!(worst_against(scene(towards), [8; 3], |_| hg(1.0) * alpha) < 1e-5 * hg(1.0) + 2e-6);
    assert!(worst_against(scene(away), [8; 3], |_| hg(-1.0) * alpha) < 2e-6);
}

#[test]
fn white_furnace_of_the_uniform_ambient() {
    // Every point scatters exactly what it receives: the volume cannot be told from the environment.
    let patch = json!({
        "transfer_function": opaque_point(30.0, 1.0, 0.0), "camera": camera(OBLIQUE), "background": "environment",
        "lights": [{"type": "environment", "radiance": [0.5, 0.5, 0.5]}], "sampling": {"termination_transmittance": 0}
    });
    assert!(worst_against(patch, [8; 3], |_| 0.5) < 1e-5);
}

#[test]
fn inverse_square_and_spot_cone() {
    let at = |light: serde_json::Value| {
        let patch = json!({
            "transfer_function": opaque_point(1e-3, 1.0, 0.0), "lights": [light],
            "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.001}
        });
        // A thin flat volume: every sample is at about the origin.
        let volume = homogeneous([64, 64, 1]);
        f64::from(radiance(&snapshot(&volume, patch, 1), target(1, 1, 1)).rgb[0])
    };
    let point = |d: f64| at(json!({"type": "point", "position": [0, 0, d], "intensity": [1, 1, 1]}));
    assert!((point(1.0) / point(3.0) - 9.0).abs() < 0.01);
    let spot = |degrees: f64| {
        let angle = degrees.to_radians();
        at(
            json!({"type": "spot", "position": [angle.sin(), 0, angle.cos()], "direction": [0, 0, -1], "cone_degrees": [20, 30], "intensity": [1, 1, 1]}),
        )
    };
    assert!((spot(10.0) / point(1.0) - 1.0).abs() < 1e-3);
    assert!(spot(25.0) > 0.0 && spot(25.0) < spot(15.0));
    assert_eq!(spot(31.0), 0.0);
}

#[test]
fn clip_planes_and_box_cut_exactly() {
    // Keep z >= 0.1 of the unit cube, then the lower 70 % in x: the chord along z is 0.4.
    let patch = json!({
        "transfer_function": opaque_point(3.0, 0.0, 0.0), "background": [1, 1, 1],
        "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.8},
        "clip": {"box": [[0, 0, 0], [0.7, 1, 1]], "planes": [{"normal": [0, 0, 2], "offset": 0.1}]}
    });
    let volume = homogeneous([16; 3]);
    let image = radiance(&snapshot(&volume, patch, 1), target(40, 40, 1));
    for x in 0..40 {
        let world_x = (f64::from(x) + 0.5) / 40.0 * 0.8 - 0.4;
        let expected = if world_x < 0.2 { (-3.0f64 * 0.4).exp() } else { 1.0 };
        let got = f64::from(image.rgb[3 * (20 * 40 + x as usize)]);
        assert!((got - expected).abs() < 1e-5, "column {x}: {got} against {expected}");
    }
}

/// One bright voxel in an empty volume appears where the camera's formula says.
#[test]
fn an_asymmetric_volume_lands_on_the_right_pixels() {
    let dims = [9, 7, 5];
    for voxel in [[1usize, 5, 2], [7, 1, 4], [4, 3, 0]] {
        let mut voxels = vec![0u8; 315];
        voxels[(voxel[2] * 7 + voxel[1]) * 9 + voxel[0]] = 255;
        let mut volume = Volume::new(dims, Voxels::U8(voxels));
        volume.spacing = [1.0, 2.0, 1.5];
        let volume = prepared(volume);
        let patch = json!({
            "volume": {"builtin": "homogeneous", "filter": "nearest"},
            "transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 0.5, "extinction": 0}, {"s": 0.5, "extinction": 5000, "albedo": [0, 0, 0], "emission": [1, 1, 1]}]},
            "camera": {"position": [0.7, 0.4, 2.0], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40}
        });
        let snapshot = snapshot(&volume, patch, 1);
        let (width, height) = (120, 100);
        let image = radiance(&snapshot, target(width, height, 1));
        let mut center = [0.0; 2];
        let mut mass = 0.0;
        for y in 0..height {
            for x in 0..width {
                let weight = f64::from(image.rgb[3 * (y * width + x) as usize]);
                center[0] += weight * (f64::from(x) + 0.5);
                center[1] += weight * (f64::from(y) + 0.5);
                mass += weight;
            }
        }
        let scene = &snapshot.scene;
        let unit = DVec3::from_array(std::array::from_fn(|a| (voxel[a] as f64 + 0.5) / dims[a] as f64));
        let world = scene.grid.world_from_unit(unit);
        let (_, direction) = scene.camera.ray(center[0] / mass, center[1] / mass, width, height);
        let towards = (world - scene.camera.eye).normalize();
        let off_degrees = direction.angle_between(towards).to_degrees();
        assert!(
            mass > 10.0 && off_degrees < 0.5,
            "voxel {voxel:?}: {off_degrees} degrees off, {mass} pixels"
        );
    }
}

#[test]
fn local_refuses_environment_images_by_name() {
    let file =
        common::scene_file(json!({"lights": [{"id": "dome", "type": "environment", "image": "sky.hdr"}]}));
    let image = scene::EnvironmentImage::new(1, 1, &[1.0; 3]).unwrap();
    let images = [("sky.hdr".to_owned(), std::sync::Arc::new(image))].into();
    let scene = scene::Scene::with_images(&file, homogeneous([2; 3]), &images).unwrap();
    let refused = render::check(&scene).unwrap_err();
    assert_eq!(refused.field, "lights[0].image");
    assert!(refused.message.contains("`local`"), "{refused}");
}
