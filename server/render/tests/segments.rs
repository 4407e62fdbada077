//! View-ray segments: an edit of matter casts anew only what it touches, and the picture is the one
//! that would be drawn from scratch.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;
use std::time::Duration;

use common::{draw, prepared, renderer, snapshot, target};
use proptest::prelude::*;
use render::{DrawRequest, Renderer, View};
use scene::{PreparedVolume, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

/// Two balls of different values before one another, and a ramp around them that no matter covers.
fn balls() -> Arc<PreparedVolume> {
    let dims = [36usize, 30, 41];
    let mut voxels = Vec::with_capacity(dims.iter().product());
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let distance = |cz: f64| {
                    let d = [x as f64 - 18.0, y as f64 - 15.0, z as f64 - cz];
                    d.iter().map(|x| x * x).sum::<f64>().sqrt()
                };
                let ball = |cz: f64, r: f64, v: f64| v * (0.5 * (r - distance(cz)) + 0.5).clamp(0.0, 1.0);
                let value = ball(9.0, 7.0, 0.5).max(ball(28.0, 11.0, 1.0));
                voxels.push((value * 240.0) as u8 + (x / 12) as u8);
            }
        }
    }
    prepared(Volume::new(dims, Voxels::U8(voxels)))
}

/// A window of the transfer function for each ball: extinction and colour.
fn matter(low: (f64, [f64; 3]), high: (f64, [f64; 3])) -> Value {
    let point = |s: f64, extinction: f64, albedo: [f64; 3]| json!({"s": s, "extinction": extinction, "albedo": albedo, "material": "skin"});
    json!({"transfer_function": {"points": [
        point(0.0, 0.0, low.1), point(0.3, 0.0, low.1), point(0.4, low.0, low.1), point(0.55, low.0, low.1),
        point(0.6, 0.0, low.1), point(0.6, 0.0, high.1), point(0.8, high.0, high.1), point(1.0, high.0, high.1)
    ]}})
}

const RED: [f64; 3] = [0.9, 0.2, 0.1];
const BLUE: [f64; 3] = [0.1, 0.3, 0.9];

fn scene(volume: &Arc<PreparedVolume>, edits: &[Value], epoch: u32) -> Arc<Snapshot> {
    let mut all = json!({
        "materials": {"skin": {"surface": 0.7, "brdf": {"type": "blinn_phong", "diffuse": 0.8, "specular": 0.2, "exponent": 30}}},
        "lights": [{"id": "key", "type": "directional", "direction": [-1, -1, -1], "irradiance": [3, 3, 3]}, {"type": "environment", "radiance": [0.2, 0.2, 0.3]}],
        "camera": {"position": [0.6, 0.3, 1.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40},
        "background": [0.05, 0.1, 0.2], "sampling": {"segments": 16}
    });
    common::json_merge(&mut all, matter((40.0, RED), (80.0, BLUE)));
    for edit in edits {
        common::json_merge(&mut all, edit.clone());
    }
    snapshot(volume, all, epoch)
}

fn radiance(renderer: &mut Renderer, view: &View) -> Vec<f32> {
    renderer.radiance(view).unwrap().rgb
}

/// Drawn in a fresh view, in kept segments.
fn from_scratch(renderer: &mut Renderer, snapshot: &Arc<Snapshot>, samples: u32) -> Vec<f32> {
    let mut view = View::for_edits();
    draw(renderer, &mut view, snapshot, target(48, 40, samples));
    radiance(renderer, &view)
}

#[test]
fn recolouring_one_structure_casts_only_its_segments() {
    let volume = balls();
    let mut renderer = renderer();
    let mut view = View::for_edits();
    let wanted = target(48, 40, 2);
    let first = draw(&mut renderer, &mut view, &scene(&volume, &[], 1), wanted);
    let all = first.counters["segments_cast"];
    assert!(all > 0 && first.counters["segments_reused"] == 0, "{:?}", first.counters);
    let green = scene(&volume, &[matter((40.0, RED), (80.0, [0.1, 0.8, 0.1]))], 2);
    let edited = draw(&mut renderer, &mut view, &green, wanted);
    let (cast, reused) = (edited.counters["segments_cast"], edited.counters["segments_reused"]);
    assert!(cast > 0 && cast * 2 < all, "{cast} of {all} segments cast");
    assert!(reused > cast, "{:?}", edited.counters);
    assert!(edited.counters["samples_taken"] < first.counters["samples_taken"]);
    assert_eq!(radiance(&mut renderer, &view), from_scratch(&mut renderer, &green, 2));
    // What lies behind the volume is no part of them.
    let behind = matter((40.0, RED), (80.0, [0.1, 0.8, 0.1]));
    let behind = scene(&volume, &[behind, json!({"background": [0.4, 0.4, 0.4]})], 3);
    let edited = draw(&mut renderer, &mut view, &behind, wanted);
    assert_eq!(edited.counters["segments_cast"], 0, "{:?}", edited.counters);
    assert_eq!(radiance(&mut renderer, &view), from_scratch(&mut renderer, &behind, 2));
}

#[test]
fn what_lay_behind_opaque_matter_is_cast_when_it_opens() {
    let volume = balls();
    let mut renderer = renderer();
    let mut view = View::for_edits();
    // Nearest voxels: the cells of the one ball's inside hold no value of the other's.
    let looking_along_z = json!({"volume": {"builtin": "homogeneous", "filter": "nearest"}, "camera": {"position": [0, 0, -2], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 30}});
    let at = |low: f64, high: [f64; 3], epoch| {
        scene(&volume, &[looking_along_z.clone(), matter((low, RED), (6.0, high))], epoch)
    };
    let wanted = target(48, 40, 1);
    draw(&mut renderer, &mut view, &at(1.0, BLUE, 1), wanted);
    draw(&mut renderer, &mut view, &at(5000.0, BLUE, 2), wanted);
    let opaque = radiance(&mut renderer, &view);
    // Never cast, cast and still right, cast and recoloured while it was hidden.
    for (epoch, low, high) in
        [(3, 0.0, BLUE), (4, 5000.0, BLUE), (5, 5000.0, RED), (6, 1.0, RED), (7, 20.0, BLUE)]
    {
        let now = at(low, high, epoch);
        draw(&mut renderer, &mut view, &now, wanted);
        let seen = radiance(&mut renderer, &view);
        assert_eq!(seen, from_scratch(&mut renderer, &now, 1), "extinction {low}");
        assert!(seen != opaque || low == 5000.0);
    }
}

#[test]
fn a_viewer_who_only_looks_keeps_no_segments() {
    let volume = balls();
    let mut renderer = renderer();
    let mut view = View::new();
    let turned = |x: f64| json!({"camera": {"position": [x, 0.3, 1.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40}});
    for (epoch, x) in [(1, 0.5), (2, 0.6), (3, 0.7)] {
        draw(&mut renderer, &mut view, &scene(&volume, &[turned(x)], epoch), target(48, 40, 1));
        assert_eq!(view.segment_bytes(), 0);
    }
    // The first edit of matter records them, the second uses them.
    let edit = |high: f64, epoch| scene(&volume, &[turned(0.7), matter((40.0, RED), (high, BLUE))], epoch);
    let first = draw(&mut renderer, &mut view, &edit(10.0, 4), target(48, 40, 1));
    assert_eq!(view.segment_bytes(), 48 * 40 * (16 + 1) * 16);
    assert_eq!(first.counters["segments_reused"], 0);
    let second = draw(&mut renderer, &mut view, &edit(30.0, 5), target(48, 40, 1));
    assert!(second.counters["segments_reused"] > second.counters["segments_cast"], "{:?}", second.counters);
    // Switched off they are dropped from the picture, not from its meaning.
    let off = scene(
        &volume,
        &[turned(0.7), matter((40.0, RED), (31.0, BLUE)), json!({"sampling": {"segments": 0}})],
        6,
    );
    let plain = draw(&mut renderer, &mut view, &off, target(48, 40, 1));
    assert_eq!(plain.counters["segments_cast"], 0);
}

#[test]
fn whole_rays_and_kept_segments_show_the_same() {
    let volume = balls();
    let mut renderer = renderer();
    for segments in [1, 3, 8, 32] {
        let scene = scene(&volume, &[json!({"sampling": {"segments": segments}})], 1);
        let kept = from_scratch(&mut renderer, &scene, 1);
        let mut view = View::new();
        draw(&mut renderer, &mut view, &scene, target(48, 40, 1));
        assert_eq!(view.segment_bytes(), 0);
        // The pipelines are two: they may round differently.
        let whole = radiance(&mut renderer, &view);
        let worst =
            whole.iter().zip(&kept).map(|(a, b)| (a - b).abs() / a.abs().max(0.01)).fold(0.0, f32::max);
        assert!(worst < 1e-6, "{segments} segments: {worst}");
    }
}

/// An edit that segments survive, or one that they do not.
fn any_edit() -> impl Strategy<Value = Value> {
    let color = || (0.0..1.0f64, 0.0..1.0f64, 0.0..1.0f64).prop_map(|(r, g, b)| [r, g, b]);
    let dense = || prop_oneof![Just(0.0), 0.5..60.0f64, Just(4000.0)];
    prop_oneof![
        8 => (dense(), color(), dense(), color()).prop_map(|(a, b, c, d)| matter((a, b), (c, d))),
        2 => (dense(), color()).prop_map(|(a, b)| matter((a, b), (80.0, BLUE))),
        1 => (0.0..1.0f64).prop_map(|x| json!({"background": [x, 0.2, 0.1]})),
        1 => (0.0..5.0f64).prop_map(|e| json!({"lights": [{"id": "key", "type": "directional", "direction": [-1, -1, -1], "irradiance": [e, e, e]}]})),
        1 => (0.3..1.0f64).prop_map(|x| json!({"clip": {"box": [[0, 0, 0], [x, 1, 1]]}})),
        1 => (0.2..3.0f64).prop_map(|d| json!({"density": d})),
        1 => prop_oneof![Just("linear"), Just("nearest")].prop_map(|f| json!({"volume": {"builtin": "homogeneous", "filter": f}})),
        1 => prop_oneof![Just(0.5), Just(1.0)].prop_map(|step| json!({"sampling": {"step_voxels": step}})),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// After any edits, some of them drawn only in part, the picture is bit for bit the one drawn
    /// from scratch.
    #[test]
    fn edited_equals_from_scratch(edits in prop::collection::vec((any_edit(), any::<bool>()), 1..7)) {
        let volume = balls();
        let mut renderer = renderer();
        let mut view = View::for_edits();
        let wanted = target(48, 40, 2);
        let mut patches = Vec::new();
        for (i, (edit, in_part)) in edits.iter().enumerate() {
            patches.push(edit.clone());
            let newest = scene(&volume, &patches, i as u32 + 1);
            if *in_part {
                // One slice; the next edit supersedes the rest.
                let request = DrawRequest { snapshot: &newest, target: wanted, budget: Some(Duration::from_micros(1)) };
                renderer.draw(&mut view, &request).unwrap();
            } else {
                draw(&mut renderer, &mut view, &newest, wanted);
            }
        }
        let newest = scene(&volume, &patches, 99);
        draw(&mut renderer, &mut view, &newest, wanted);
        prop_assert_eq!(radiance(&mut renderer, &view), from_scratch(&mut renderer, &newest, 2));
    }
}
