//! Skipping and reuse never change a bit of the picture, and nothing changed costs nothing.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::{draw, prepared, renderer, snapshot, target};
use proptest::prelude::*;
use render::{DrawRequest, View};
use scene::{PreparedVolume, Volume, Voxels};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;

/// Blobs in emptiness: macrocells of every kind.
fn blobs() -> Arc<PreparedVolume> {
    let dims = [40usize, 33, 28];
    let mut voxels = Vec::with_capacity(dims.iter().product());
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let bump = |cx: f64, cy: f64, cz: f64, r: f64| {
                    let d =
                        ((x as f64 - cx).powi(2) + (y as f64 - cy).powi(2) + (z as f64 - cz).powi(2)).sqrt();
                    (1.0 - d / r).max(0.0)
                };
                let value = bump(9.0, 9.0, 9.0, 8.0) + 0.6 * bump(30.0, 22.0, 20.0, 7.0);
                voxels.push((value * 60000.0).min(65535.0) as u16);
            }
        }
    }
    prepared(Volume::new(dims, Voxels::U16(voxels)))
}

fn base() -> Value {
    json!({
        "transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 0.1, "extinction": 0}, {"s": 0.3, "extinction": 60, "albedo": [0.9, 0.5, 0.2], "material": "skin"}, {"s": 1, "extinction": 200, "material": "skin"}]},
        "materials": {"skin": {"surface": 0.8, "brdf": {"type": "blinn_phong", "diffuse": 0.8, "specular": 0.2, "exponent": 30}}},
        "lights": [{"id": "key", "type": "directional", "direction": [-1, -1, -1], "irradiance": [3, 3, 3]}, {"type": "environment", "radiance": [0.2, 0.2, 0.3]}],
        "camera": {"position": [1.0, 0.7, 1.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40}
    })
}

/// An edit of one part of the scene.
fn any_edit() -> impl Strategy<Value = Value> {
    let low = 0.02..0.6f64;
    prop_oneof![
        (low, 1.0..300.0f64).prop_map(|(s, top)| json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": s, "extinction": 0}, {"s": s + 0.1, "extinction": top, "material": "skin"}, {"s": 1, "extinction": top}]}})),
        (0.0..1.0f64).prop_map(|g| json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 0.1, "extinction": 0}, {"s": 0.5, "extinction": 90, "albedo": [g, g, 0.3]}, {"s": 0.5, "extinction": 0}]}})),
        (-1.0..1.0f64, -1.0..1.0f64).prop_map(|(x, y)| json!({"camera": {"position": [x, y, 1.7], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40}})),
        (0.0..5.0f64).prop_map(|e| json!({"lights": [{"id": "key", "type": "directional", "direction": [-1, -1, -1], "irradiance": [e, e, e]}]})),
        (0.1..1.0f64).prop_map(|x| json!({"clip": {"box": [[0, 0, 0], [x, 1, 1]]}})),
        prop_oneof![Just(0.5), Just(1.0), Just(2.0)].prop_map(|step| json!({"sampling": {"step_voxels": step}})),
        (0.0..1.0f64).prop_map(|x| json!({"background": [x, 0.2, 0.1]})),
        (0.2..3.0f64).prop_map(|d| json!({"density": d})),
        prop_oneof![Just("linear"), Just("nearest")].prop_map(|f| json!({"volume": {"builtin": "homogeneous", "filter": f}})),
        (0.3..1.0f64).prop_map(|top| json!({"value_range": [0, top * 60000.0]})),
    ]
}

fn merged(edits: &[Value]) -> Value {
    let mut scene = base();
    for edit in edits {
        common::json_merge(&mut scene, edit.clone());
    }
    scene
}

fn with_skip(mut scene: Value, skip: bool) -> Value {
    scene["sampling"]["skip_empty"] = json!(skip);
    scene
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn skipped_equals_unskipped(edits in prop::collection::vec(any_edit(), 0..4)) {
        let volume = blobs();
        let mut renderer = renderer();
        let image = |renderer: &mut render::Renderer, skip| {
            let mut view = View::new();
            let drawn = draw(renderer, &mut view, &snapshot(&volume, with_skip(merged(&edits), skip), 1), target(48, 40, 2));
            (renderer.radiance(&view).unwrap(), drawn.counters)
        };
        let (skipped, a) = image(&mut renderer, true);
        let (plain, b) = image(&mut renderer, false);
        prop_assert!(skipped == plain, "images differ");
        prop_assert!(skipped.rgb.iter().all(|x| x.is_finite() && *x >= 0.0));
        prop_assert_eq!(a["samples_on_lattice"], b["samples_on_lattice"]);
        prop_assert_eq!(a["samples_with_matter"], b["samples_with_matter"]);
        prop_assert_eq!(b["samples_skipped"], 0);
    }

    #[test]
    fn incremental_equals_from_scratch(edits in prop::collection::vec(any_edit(), 1..6)) {
        let volume = blobs();
        let mut renderer = renderer();
        let mut running = View::for_edits();
        for count in 0..=edits.len() {
            let newest = snapshot(&volume, merged(&edits[..count]), count as u32 + 1);
            draw(&mut renderer, &mut running, &newest, target(40, 32, 2));
            let mut fresh = View::for_edits();
            draw(&mut renderer, &mut fresh, &newest, target(40, 32, 2));
            prop_assert!(renderer.radiance(&running).unwrap() == renderer.radiance(&fresh).unwrap(), "after edit {}", count);
        }
    }
}

#[test]
fn an_interrupted_update_leaves_a_film_that_ends_up_right() {
    let volume = blobs();
    let mut renderer = renderer();
    let mut view = View::new();
    let wanted = target(96, 80, 2);
    for epoch in 1..=5 {
        let x = f64::from(epoch) * 0.1;
        let camera =
            json!({"position": [x, 0.4, 1.7], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40});
        let newest = snapshot(&volume, merged(&[json!({"camera": camera})]), epoch);
        // One slice only, but for the last.
        let request =
            DrawRequest { snapshot: &newest, target: wanted, budget: Some(Duration::from_micros(1)) };
        renderer.draw(&mut view, &request).unwrap();
        if epoch == 5 {
            draw(&mut renderer, &mut view, &newest, wanted);
            let mut fresh = View::new();
            draw(&mut renderer, &mut fresh, &newest, wanted);
            assert!(renderer.radiance(&view).unwrap() == renderer.radiance(&fresh).unwrap());
        }
    }
}

#[test]
fn nothing_changed_costs_nothing_and_exposure_casts_no_ray() {
    let volume = blobs();
    let mut renderer = renderer();
    let mut view = View::new();
    let first = draw(&mut renderer, &mut view, &snapshot(&volume, base(), 1), target(32, 32, 2));
    assert!(first.drew && first.counters["samples_taken"] > 0);
    let before = renderer.picture(&mut view).unwrap();
    let again = draw(&mut renderer, &mut view, &snapshot(&volume, base(), 2), target(32, 32, 2));
    assert!(!again.drew && again.counters.is_empty() && again.stages.is_empty(), "{again:?}");
    let brighter = snapshot(&volume, merged(&[json!({"film": {"exposure_stops": 1.0}})]), 3);
    let exposed = draw(&mut renderer, &mut view, &brighter, target(32, 32, 2));
    assert!(exposed.drew && exposed.counters.is_empty());
    assert_ne!(renderer.picture(&mut view).unwrap().rgba, before.rgba);
}

#[test]
fn a_mostly_empty_volume_is_mostly_skipped() {
    let volume = blobs();
    let mut renderer = renderer();
    let drawn = draw(&mut renderer, &mut View::new(), &snapshot(&volume, base(), 1), target(64, 64, 1));
    let c = &drawn.counters;
    assert!(c["samples_taken"] * 2 < c["samples_on_lattice"], "{c:?}");
    assert!(c["samples_taken"] + c["samples_skipped"] <= c["samples_on_lattice"]);
}

#[test]
fn accumulation_converges_to_the_fine_step_image() {
    let volume = blobs();
    let mut renderer = renderer();
    let mut image = |patch: Value, samples| {
        let mut view = View::new();
        draw(&mut renderer, &mut view, &snapshot(&volume, merged(&[patch]), 1), target(48, 40, samples));
        renderer.radiance(&view).unwrap().rgb
    };
    let fine = image(json!({"sampling": {"step_voxels": 0.0625}}), 64);
    let error = |rgb: &[f32]| {
        let squared = |v: &mut dyn Iterator<Item = f32>| v.map(|x| f64::from(x) * f64::from(x)).sum::<f64>();
        let difference = squared(&mut rgb.iter().zip(&fine).map(|(a, b)| a - b));
        (difference / squared(&mut fine.iter().copied())).sqrt()
    };
    let one = error(&image(json!({"sampling": {"step_voxels": 1.0}}), 1));
    let many = error(&image(json!({"sampling": {"step_voxels": 1.0}}), 64));
    assert!(many < 0.4 * one && many < 0.02, "one sample {one}, 64 samples {many}");
}
