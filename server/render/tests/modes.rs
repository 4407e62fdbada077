//! Projections, isosurface and slice against closed forms.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;

use common::{draw, json_merge, prepared, radiance, renderer, snapshot, target};
use render::View;
use scene::{PreparedVolume, Volume, Voxels};
use serde_json::{Value, json};

/// Radiance that is shown as the share `code` of the grey scale.
fn grey(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Values 0, 4, ..., 252 along z.
fn ramp() -> Arc<PreparedVolume> {
    let voxels = (0..4 * 4 * 64).map(|i| (i / 16 * 4) as u8).collect();
    prepared(Volume::new([4, 4, 64], Voxels::U8(voxels)))
}

fn along_the_ramp(rendering: Value) -> Value {
    json!({
        "value_range": [0, 255], "rendering": rendering,
        "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.03},
        "sampling": {"interpolation": "exact"}
    })
}

fn centre(patch: Value) -> f64 {
    f64::from(radiance(&snapshot(&ramp(), patch, 1), target(8, 8, 1)).rgb[3 * (4 * 8 + 4)])
}

#[test]
fn projections_of_a_ramp() {
    for (mode, code) in [("maximum", 252.0 / 255.0), ("minimum", 0.0), ("average", 126.0 / 255.0)] {
        let got = centre(along_the_ramp(json!({"mode": mode})));
        assert!((got - grey(code)).abs() < 2e-4, "{mode}: {got}, not {}", grey(code));
    }
    // What is clipped away is not measured: the front half is, z from 0 to 0.5.
    let mut clipped = along_the_ramp(json!({"mode": "minimum"}));
    json_merge(&mut clipped, json!({"clip": {"box": [[0, 0, 0.5], [1, 1, 1]]}}));
    let got = centre(clipped);
    assert!((got - grey(126.0 / 255.0)).abs() < 2e-4, "{got}");
}

#[test]
fn the_window_is_apart_from_the_value_range() {
    let rendering = json!({"mode": "average", "window": [100.0, 200.0]});
    let got = centre(along_the_ramp(rendering));
    assert!((got - grey(0.26)).abs() < 2e-4, "{got}");
}

#[test]
fn a_slice_shows_the_value_on_its_plane() {
    for offset in [-0.3, 0.0, 0.21] {
        // Voxel centres lie at (k + 0.5) / 64 - 0.5 and hold 4 k.
        let code = 4.0 * ((offset + 0.5) * 64.0 - 0.5) / 255.0;
        let got = centre(along_the_ramp(
            json!({"mode": "slice", "slice": {"normal": [0, 0, 2], "offset": offset}}),
        ));
        assert!((got - grey(code)).abs() < 1e-4, "offset {offset}: {got}, not {}", grey(code));
    }
    let beyond =
        centre(along_the_ramp(json!({"mode": "slice", "slice": {"normal": [0, 0, 1], "offset": 0.7}})));
    assert_eq!(beyond, 0.0);
}

/// Distance from the centre, in voxels; f32.
fn ball() -> Arc<PreparedVolume> {
    let n = 32usize;
    let at = |i: usize| i as f64 + 0.5 - 0.5 * n as f64;
    let voxels = (0..n * n * n).map(|i| {
        let [x, y, z] = [at(i % n), at(i / n % n), at(i / n / n)];
        (x * x + y * y + z * z).sqrt() as f32
    });
    prepared(Volume::new([n; 3], Voxels::F32(voxels.collect())))
}

fn lit_ball(step_voxels: f64) -> Value {
    json!({
        "rendering": {"mode": "isosurface", "isovalue": 12.3}, "background": [0, 0, 1],
        "transfer_function": {"points": [{"s": 0, "extinction": 0, "albedo": [0.8, 0.4, 0.0]}]},
        "lights": [{"type": "directional", "direction": [0, 0, -1], "irradiance": [3.0, 3.0, 3.0]}],
        "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 1.0},
        "sampling": {"step_voxels": step_voxels}
    })
}

#[test]
fn an_isosurface_of_a_ball_is_lamberts_sphere() {
    let edge = 96u32;
    let radius = 12.3 / 32.0;
    for step_voxels in [0.5, 1.0, 2.0] {
        let image = radiance(&snapshot(&ball(), lit_ball(step_voxels), 1), target(edge, edge, 1));
        let mut worst: f64 = 0.0;
        for i in 0..edge * edge {
            let at = |i: u32| (f64::from(i) + 0.5) / f64::from(edge) - 0.5;
            let rho = (at(i % edge).powi(2) + at(i / edge).powi(2)).sqrt() / radius;
            let pixel: [f64; 3] = std::array::from_fn(|c| f64::from(image.rgb[3 * i as usize + c]));
            if rho > 1.05 {
                assert_eq!(pixel, [0.0, 0.0, 1.0], "beyond the ball");
            } else if rho < 0.9 {
                let expected = 3.0 / std::f64::consts::PI * (1.0 - rho * rho).sqrt();
                worst = worst.max((pixel[0] / 0.8 - expected).abs()).max((pixel[1] / 0.4 - expected).abs());
            }
        }
        // The normal of an interpolated field of this radius is good to some hundredths.
        assert!(worst < 0.03, "step {step_voxels}: {worst}");
    }
}

#[test]
fn a_skipped_isosurface_is_the_same() {
    let mut renderer = renderer();
    let mut drawn = |skip: bool| {
        let mut patch = lit_ball(1.0);
        patch["sampling"]["skip_empty"] = json!(skip);
        let mut view = View::new();
        let drawn = draw(&mut renderer, &mut view, &snapshot(&ball(), patch, 1), target(64, 64, 1));
        (renderer.radiance(&view).unwrap(), drawn.counters["samples_taken"])
    };
    let ((skipped, few), (plain, many)) = (drawn(true), drawn(false));
    assert!(skipped == plain);
    assert!(few * 4 < many * 3, "{few} of {many} samples");
}
