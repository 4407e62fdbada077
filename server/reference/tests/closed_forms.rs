//! The tracer against pictures that can be written down, and against wrong ones.
#![allow(clippy::unwrap_used)]

mod common;

use std::f64::consts::PI;

use common::*;
use glam::DVec3;
use reference::closed_forms::{self, HalfSpace, HomogeneousBox};
use scene::{Volume, Voxels};
use serde_json::json;

const SIGMA: f64 = 2.0;
const CUBE: HomogeneousBox = HomogeneousBox { size: DVec3::ONE, sigma_t: SIGMA };
/// The way a light travels.
const TRAVEL: DVec3 = DVec3::new(-0.48, -0.64, 0.6);

#[test]
fn transmittance_of_a_cube_averaged_over_pixels() {
    let scene = scene(
        &homogeneous(),
        json!({"transfer_function": matter(SIGMA, 0.0), "background": [1, 1, 1],
        "camera": {"position": [1.3, 0.9, 1.7], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 35}}),
    );
    let estimate = estimate(&scene, 4096);
    // Silhouettes cross pixels: means over a fine grid of the camera's formula.
    let fine = 64;
    let eye = DVec3::new(1.3, 0.9, 1.7);
    let forward = -eye.normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let height = 17.5f64.to_radians().tan();
    let expected = |sigma_t: f64| -> Vec<[f64; 3]> {
        let pixel = |k: u32| {
            let mut sum = 0.0;
            for at in 0..fine * fine {
                let place = |pixel: u32, at: u32| {
                    (f64::from(pixel) + (f64::from(at) + 0.5) / f64::from(fine)) / f64::from(EDGE)
                };
                let (x, y) = (place(k % EDGE, at % fine), place(k / EDGE, at / fine));
                let offset = (2.0 * x - 1.0) * right + (1.0 - 2.0 * y) * up;
                let direction = (forward + height * offset).normalize();
                sum += HomogeneousBox { sigma_t, ..CUBE }.transmittance(eye, direction);
            }
            [sum / f64::from(fine * fine); 3]
        };
        (0..EDGE * EDGE).map(pixel).collect()
    };
    let test = against_pixels(&estimate, &expected(SIGMA));
    assert!(test.passes(LEVEL), "{test:?}");
    // Opacity of a length of 1 used as extinction.
    let wrong = against_pixels(&estimate, &expected(1.0 - (-SIGMA).exp()));
    assert!(!wrong.passes(CERTAIN), "{wrong:?}");
}

#[test]
fn transmittance_of_values_between_voxels_through_steps_and_peaks() {
    // Along z the field is linear between voxel centres and constant beyond the outer ones.
    let values = [10u8, 200, 90, 250, 0, 30, 130, 60];
    let volume = prepared(Volume::new([1, 1, 8], Voxels::U8(values.to_vec())));
    // As s, extinction: a ramp, a step, a thin peak.
    let points = [(0.1, 0.0), (0.3, 4.0), (0.3, 1.0), (0.6, 1.0), (0.62, 60.0), (0.64, 1.0), (1.0, 9.0)];
    let file: Vec<_> =
        points.iter().map(|(s, e)| json!({"s": s, "extinction": e, "albedo": [0, 0, 0]})).collect();
    let view = [DVec3::new(0.01, 0.02, 2.0), DVec3::new(0.01, 0.02, 0.0)];
    let scene = scene(
        &volume,
        json!({"transfer_function": {"points": file}, "value_range": [0, 255], "background": [1, 1, 1],
            "camera": narrow(view[0], view[1])}),
    );
    let sigma_t = |s: f64| {
        let next = points.iter().position(|p| p.0 > s);
        match next {
            Some(0) => points[0].1,
            None => points[6].1,
            Some(next) => {
                let ((s0, e0), (s1, e1)) = (points[next - 1], points[next]);
                e0 + (s - s0) / (s1 - s0) * (e1 - e0)
            }
        }
    };
    let count = 1_000_000;
    let depth = |k: i32| {
        let p = (f64::from(k) + 0.5) / f64::from(count) * 8.0 - 0.5;
        let (low, share) = (p.clamp(0.0, 7.0).floor(), p.clamp(0.0, 7.0) % 1.0);
        let value = |i: f64| f64::from(values[(i as usize).min(7)]);
        sigma_t((value(low) + share * (value(low + 1.0) - value(low))) / 255.0) / f64::from(count)
    };
    let optical_depth: f64 = (0..count).map(depth).sum();
    let expected = (-optical_depth).exp();
    let traced = estimate(&scene, 4096);
    assert_agrees("peaks", &traced, expected, &[("a lost peak", expected * 1.3)]);
    let local = estimate_local(&scene, 2);
    assert!((mean(&local) / expected - 1.0).abs() < 1e-5, "{} {expected}", mean(&local));
}

#[test]
fn emission_of_a_slab() {
    let glow =
        json!({"points": [{"s": 0, "extinction": SIGMA, "albedo": [0, 0, 0], "emission": [0.7, 0.7, 0.7]}]});
    let (origin, direction) = oblique_ray();
    let scene = scene(&homogeneous(), json!({"transfer_function": glow, "camera": oblique_camera()}));
    let [near, far] = CUBE.chord(origin, direction).unwrap();
    let expected = closed_forms::emission(SIGMA, 0.7, far - near);
    let without = 0.7 * (far - near) * SIGMA;
    assert_agrees("emission", &estimate(&scene, 2048), expected, &[("no self-absorption", without)]);
    assert!((mean(&estimate_local(&scene, 2)) / expected - 1.0).abs() < 1e-9);
}

#[test]
fn single_scattering_of_a_directional_light() {
    let light = |g: f64| {
        json!({"transfer_function": matter(SIGMA, 0.8), "materials": henyey_greenstein(g),
            "lights": [{"type": "directional", "direction": TRAVEL.to_array(), "irradiance": [3, 3, 3]}],
            "camera": oblique_camera(), "scattering": {"orders": 1}})
    };
    let expected = |g: f64| {
        let scatter = closed_forms::henyey_greenstein(0.8, g);
        CUBE.lit_by_directional(oblique_ray(), (TRAVEL, 3.0), scatter)
    };
    for g in [0.0, 0.6, -0.4] {
        let mut wrong = vec![("a doubled phase function", 2.0 * expected(g))];
        if g != 0.0 {
            wrong.push(("a wrong sign of g", expected(-g)));
        }
        let thin = HomogeneousBox { sigma_t: 1.0 - (-SIGMA).exp(), ..CUBE };
        let scatter = closed_forms::henyey_greenstein(0.8, g);
        wrong.push((
            "opacity used as extinction",
            thin.lit_by_directional(oblique_ray(), (TRAVEL, 3.0), scatter),
        ));
        let estimate = estimate(&scene(&homogeneous(), light(g)), 2048);
        assert_agrees(&format!("g {g}"), &estimate, expected(g), &wrong);
    }
}

#[test]
fn single_scattering_of_a_lambert_surface() {
    let material = json!({"m": {"surface": 1.0, "brdf": {"type": "lambert", "diffuse": 0.9}}});
    let points = json!({"points": [
        {"s": 0, "extinction": SIGMA, "albedo": [0.8, 0.8, 0.8], "material": "m"},
        {"s": 1, "extinction": SIGMA, "albedo": [0.8, 0.8, 0.8], "material": "m"}]});
    let scene = scene(
        &ramp(),
        json!({"transfer_function": points, "materials": material, "camera": oblique_camera(),
            "lights": [{"type": "directional", "direction": TRAVEL.to_array(), "irradiance": [3, 3, 3]}],
            "scattering": {"orders": 1}}),
    );
    let scatter = closed_forms::lambert(0.72, DVec3::X);
    let expected = CUBE.lit_by_directional(oblique_ray(), (TRAVEL, 3.0), scatter);
    let wrong = [("a dropped cosine", expected / 0.48), ("a phase function", expected / 0.48 / 4.0)];
    assert_agrees("lambert", &estimate(&scene, 2048), expected, &wrong);
    assert!(expected > 0.0);
}

#[test]
fn single_scattering_of_a_point_light() {
    let position = DVec3::new(0.4, 1.1, -0.3);
    let scene = scene(
        &homogeneous(),
        json!({"transfer_function": matter(SIGMA, 0.8), "materials": henyey_greenstein(0.5),
            "lights": [{"type": "point", "position": position.to_array(), "intensity": [2, 2, 2]}],
            "camera": oblique_camera(), "scattering": {"orders": 1}}),
    );
    let expected =
        CUBE.lit_by_point(oblique_ray(), (position, 2.0), closed_forms::henyey_greenstein(0.8, 0.5));
    let wrong = [("a doubled phase function", 2.0 * expected)];
    assert_agrees("point", &estimate(&scene, 2048), expected, &wrong);
}

#[test]
fn a_point_light_falls_off_with_the_square() {
    // A thin sheet around the origin.
    let sheet = prepared(Volume::new([64, 64, 1], Voxels::U8(vec![255; 4096])));
    for distance in [1.0, 3.0] {
        let scene = scene(
            &sheet,
            json!({"transfer_function": matter(1e-3, 1.0),
                "lights": [{"type": "point", "position": [0, 0, distance], "intensity": [5, 5, 5]}],
                "camera": narrow(DVec3::new(1e-4, 0.0, 2.0), DVec3::new(1e-4, 0.0, 0.0)),
                "scattering": {"orders": 1}}),
        );
        let irradiance = closed_forms::point_irradiance(5.0, distance);
        let expected = irradiance * 1e-3 / 64.0 / (4.0 * PI);
        let local = mean(&estimate_local(&scene, 2));
        assert!((local / expected - 1.0).abs() < 1e-3, "{distance}: {local} {expected}");
    }
}

#[test]
fn single_scattering_of_a_uniform_environment() {
    for g in [0.0, 0.7] {
        let scene = scene(
            &homogeneous(),
            json!({"transfer_function": matter(SIGMA, 0.8), "materials": henyey_greenstein(g),
                "lights": [{"type": "environment", "radiance": [2, 2, 2]}],
                "camera": oblique_camera(), "scattering": {"orders": 1}}),
        );
        let expected = CUBE.lit_by_environment(oblique_ray(), 2.0, closed_forms::henyey_greenstein(0.8, g));
        let wrong = [("a doubled phase function", 2.0 * expected), ("light counted twice", 1.5 * expected)];
        assert_agrees(&format!("environment, g {g}"), &estimate(&scene, 2048), expected, &wrong);
    }
}

/// Rectangle, disk and sphere around a place, as JSON and as the light they scatter: the sum of
/// that of small pieces, which are point lights that shine with the cosine.
fn area_lights(center: DVec3, size: f64) -> [(serde_json::Value, f64); 3] {
    let normal = DVec3::new(-0.2, -0.9, 0.1).normalize();
    let up = (DVec3::Z - normal * normal.z).normalize();
    let across = up.cross(normal);
    let piece = |place: DVec3, normal: DVec3, area: f64| {
        let phase = closed_forms::henyey_greenstein(0.8, 0.5);
        let scatter = |w_i: DVec3, w_o: DVec3| phase(w_i, w_o) * (-w_i.dot(normal)).max(0.0);
        CUBE.lit_by_point(oblique_ray(), (place, 4.0 * area), scatter)
    };
    let fine = 24;
    let middle = |k: i32| (f64::from(k) + 0.5) / f64::from(fine);
    // Mean over pieces from a grid in two parameters.
    let mean = |piece: &dyn Fn(f64, f64) -> f64| {
        (0..fine * fine).map(|k| piece(middle(k / fine), middle(k % fine))).sum::<f64>()
            / f64::from(fine * fine)
    };
    let rectangle = mean(&|u, v| {
        let place = center + size * ((u - 0.5) * 1.2 * across + (v - 0.5) * 0.4 * up);
        piece(place, normal, 0.48 * size * size)
    });
    let disk = mean(&|u, v| {
        let (sin, cos) = (2.0 * PI * v).sin_cos();
        let place = center + size * 0.5 * u.sqrt() * (cos * across + sin * up);
        piece(place, normal, PI * 0.25 * size * size)
    });
    let sphere = mean(&|u, v| {
        let (z, (sin, cos)) = (1.0 - 2.0 * u, (2.0 * PI * v).sin_cos());
        let outwards = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
        piece(center + size * 0.3 * outwards, outwards, 4.0 * PI * 0.09 * size * size)
    });
    let light = |kind: &str, more: serde_json::Value| {
        let mut light = json!({"type": kind, "center": center.to_array(), "radiance": [4, 4, 4]});
        for (key, value) in more.as_object().unwrap() {
            light[key] = value.clone();
        }
        light
    };
    let (normal, up) = (normal.to_array(), up.to_array());
    let edges = [1.2 * size, 0.4 * size];
    [
        (light("rectangle", json!({"normal": normal, "up": up, "size": edges})), rectangle),
        (light("disk", json!({"normal": normal, "radius": 0.5 * size})), disk),
        (light("sphere", json!({"radius": 0.3 * size})), sphere),
    ]
}

#[test]
fn area_lights_are_many_point_lights_outside_of_matter_and_inside() {
    let places = [(DVec3::new(0.3, 0.9, 0.2), 1.0), (DVec3::new(-0.2, 0.25, -0.3), 0.2)];
    for (light, expected) in places.into_iter().flat_map(|(center, size)| area_lights(center, size)) {
        let scene = scene(
            &homogeneous(),
            json!({"transfer_function": matter(SIGMA, 0.8), "materials": henyey_greenstein(0.5),
                "lights": [light], "camera": oblique_camera(), "scattering": {"orders": 1}}),
        );
        let wrong = [("light counted twice", 1.5 * expected)];
        assert_agrees(&light.to_string(), &estimate(&scene, 4096), expected, &wrong);
    }
}

#[test]
fn all_orders_in_a_half_space() {
    // 600 mean free paths deep and as wide: its sides are out of reach.
    let cos_in = 0.6;
    let travel = DVec3::new(0.8, 0.0, -cos_in);
    let cos_out = 0.8;
    let view = ray(DVec3::new(0.0, 0.6, 0.5 + 0.8), DVec3::new(0.0, 0.0, 0.5));
    for albedo in [0.5, 0.9, 0.99] {
        let half_space = HalfSpace::new(albedo);
        let directional =
            json!({"type": "directional", "direction": travel.to_array(), "irradiance": [3, 3, 3]});
        let environment = json!({"type": "environment", "radiance": [1, 1, 1]});
        let cases = [
            (directional, 3.0 * half_space.reflected(cos_in, cos_out)),
            (environment, half_space.reflected_environment(cos_out)),
        ];
        for (light, expected) in cases {
            let scene = scene(
                &homogeneous(),
                json!({"transfer_function": matter(600.0, albedo), "lights": [light],
                    "camera": narrow(view.0, view.0 + view.1)}),
            );
            let estimate = estimate(&scene, 1024);
            let wrong = [("a tenth too much", 1.1 * expected)];
            assert_agrees(&format!("albedo {albedo}"), &estimate, expected, &wrong);
            assert_eq!((estimate.cut, estimate.lost), (0.0, 0));
        }
    }
}

#[test]
fn the_second_order_alone() {
    // Radiance of a half-space is a power series in the albedo; its n-th term is the n-th order.
    let (cos_in, cos_out) = (0.6, 0.8);
    let first = cos_in / (4.0 * PI * (cos_in + cos_out));
    // (I / albedo - first) / albedo is second + third albedo + ...: extrapolated to albedo 0.
    let quotient =
        |albedo: f64| (HalfSpace::new(albedo).reflected(cos_in, cos_out) / albedo - first) / albedo;
    let (a, b, c) = (quotient(0.04), quotient(0.02), quotient(0.01));
    let (ab, bc) = (2.0 * b - a, 2.0 * c - b);
    let second = (4.0 * bc - ab) / 3.0;
    let view = ray(DVec3::new(0.0, 0.6, 0.5 + 0.8), DVec3::new(0.0, 0.0, 0.5));
    let scene = scene(
        &homogeneous(),
        json!({"transfer_function": matter(600.0, 0.9), "scattering": {"orders": 2},
            "lights": [{"type": "directional", "direction": [0.8, 0.0, -cos_in], "irradiance": [1, 1, 1]}],
            "camera": narrow(view.0, view.0 + view.1)}),
    );
    let expected = 0.9 * first + 0.81 * second;
    let all = HalfSpace::new(0.9).reflected(cos_in, cos_out);
    let wrong = [("one order too few", 0.9 * first), ("all orders", all)];
    assert_agrees("two orders", &estimate(&scene, 2048), expected, &wrong);
}
