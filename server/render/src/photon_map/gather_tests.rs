//! Photons that rays gather themselves.

use std::sync::Arc;
use std::time::Duration;

use scene::plan::Target;
use scene::{PreparedVolume, Snapshot};
use serde_json::{Value, json};

use super::tests::{TARGET, draw, edits, equal, snapshot};
use crate::test_support::{balls, renderer};
use crate::{DrawRequest, Drawn, Renderer, View};

fn by(gather: &str) -> Value {
    json!({"illumination": {"gather": gather}})
}

/// The picture, and what drawing it took.
pub(super) fn picture(
    renderer: &mut Renderer,
    volume: &Arc<PreparedVolume>,
    patches: &[Value],
) -> (Vec<f32>, Drawn) {
    let snapshot = snapshot(volume, patches, 1);
    let mut view = View::new();
    let target = Target { samples_per_pixel: snapshot.scene.samples_at_rest(), ..TARGET };
    let drawn = renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None }).unwrap();
    assert!(drawn.complete);
    (renderer.radiance(&view).unwrap().rgb, drawn)
}

/// Relative L2 error.
pub(super) fn off(found: &[f32], expected: impl Fn(usize) -> f64) -> f64 {
    let (mut squared_error, mut squared) = (0.0, 0.0);
    for (i, &value) in found.iter().enumerate() {
        squared_error += (f64::from(value) - expected(i)).powi(2);
        squared += expected(i).powi(2);
    }
    (squared_error / squared).sqrt()
}

/// Matter that absorbs nothing, between even light and an even background.
fn furnace(g: f64) -> Value {
    let white = |s: f64, extinction: f64| json!({"s": s, "extinction": extinction, "albedo": [1, 1, 1], "material": "m"});
    json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": g}}},
        "transfer_function": {"points": [white(0.1, 0.0), white(0.4, 8.0)]}, "background": [1, 1, 1],
        "lights": [{"id": "sky", "type": "environment", "radiance": [1, 1, 1]}],
        "illumination": {"photon_events": 64, "photon_grid": 8}})
}

/// In a white furnace every pixel is 1, whatever the kernel, if matter in it is counted rightly: what is
/// left is the photons' noise.
#[test]
fn a_white_furnace_is_white_but_for_noise() {
    let mut renderer = renderer();
    let volume = balls(24);
    for g in [0.0, 0.7] {
        let mut errors = Vec::new();
        for photons in [4096, 65_536] {
            let count = json!({"illumination": {"photons": photons}});
            let (rgb, drawn) = picture(&mut renderer, &volume, &[furnace(g), count, by("ray")]);
            let mean = rgb.iter().map(|&x| f64::from(x)).sum::<f64>() / rgb.len() as f64;
            eprintln!("g {g}, {photons} photons: off by {:.4}, mean {mean:.4}", off(&rgb, |_| 1.0));
            assert!((mean - 1.0).abs() < 0.03, "{mean}");
            assert!(drawn.counters["photons_gathered"] > drawn.counters["samples_with_matter"]);
            errors.push(off(&rgb, |_| 1.0));
        }
        assert!(errors[1] < 0.06 && errors[1] < 0.5 * errors[0], "{errors:?}");
    }
}

/// Kernels with more photons than one dispatch sums up: none is left out.
#[test]
fn kernels_may_hold_more_photons_than_a_dispatch_takes() {
    let volume = balls(24);
    let many = json!({"illumination": {"photons": 65536, "photon_grid": 4}});
    let (rgb, drawn) = picture(&mut renderer(), &volume, &[furnace(0.0), many, by("ray")]);
    let (sorted, gathered) = (drawn.counters["interactions_sorted"], drawn.counters["photons_gathered"]);
    let per_part = gathered / drawn.counters["samples_with_matter"];
    eprintln!("{sorted} sorted, {per_part} a part");
    assert!(per_part > 8000, "{per_part}");
    assert!(off(&rgb, |_| 1.0) < 0.02, "{}", off(&rgb, |_| 1.0));
}

/// Light that is scattered forward, which no few bands can hold.
#[test]
fn narrow_phase_functions_are_nearer_to_paths_than_by_bands() {
    let mut renderer = renderer();
    let volume = balls(24);
    let forward = json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": 0.9}}},
        "transfer_function": {"points": [
            {"s": 0.1, "extinction": 0, "albedo": [0.95, 0.95, 0.95], "material": "m"},
            {"s": 0.4, "extinction": 12, "albedo": [0.95, 0.95, 0.95], "material": "m"}]},
        "lights": [{"id": "sun", "type": "directional", "direction": [0.2, 0.1, 1], "irradiance": [3, 3, 3]}],
        "background": [0, 0, 0], "illumination": {"photons": 131_072, "photon_grid": 16, "photon_events": 32}});
    let paths = json!({"illumination": {"method": "path_traced", "paths_per_pixel": 512}});
    let (expected, _) = picture(&mut renderer, &volume, &[forward.clone(), paths]);
    let errors = ["field", "ray"].map(|gather| {
        let (rgb, _) = picture(&mut renderer, &volume, &[forward.clone(), by(gather)]);
        off(&rgb, |i| f64::from(expected[i]))
    });
    eprintln!("field {:.4}, ray {:.4}", errors[0], errors[1]);
    assert!(errors[1] < 0.5 * errors[0], "{errors:?}");
}

/// Surfaces and opaque matter are as bright as followed from the eye.
#[test]
fn surfaces_are_as_bright_as_followed_from_the_eye() {
    let mut renderer = renderer();
    let volume = balls(24);
    let shiny = json!({"materials": {"m": {"surface": 0.8,
            "brdf": {"type": "blinn_phong", "diffuse": 0.6, "specular": 0.3, "exponent": 30}}},
        "transfer_function": {"points": [
            {"s": 0.1, "extinction": 0, "albedo": [0.8, 0.8, 0.8], "material": "m"},
            {"s": 0.4, "extinction": 30, "albedo": [0.8, 0.8, 0.8], "material": "m"}]},
        "lights": [{"id": "sky", "type": "environment", "radiance": [1, 1, 1]}],
        "background": [0, 0, 0], "illumination": {"photons": 65_536, "photon_grid": 16}});
    let paths = json!({"illumination": {"method": "path_traced", "paths_per_pixel": 128}});
    let mean = |rgb: &[f32]| rgb.iter().map(|&x| f64::from(x)).sum::<f64>() / rgb.len() as f64;
    let (expected, _) = picture(&mut renderer, &volume, &[shiny.clone(), paths]);
    let of = |renderer: &mut Renderer, gather: &str| {
        let (found, _) = picture(renderer, &volume, &[shiny.clone(), by(gather)]);
        (mean(&found) / mean(&expected), off(&found, |i| f64::from(expected[i])))
    };
    let (field, ray) = (of(&mut renderer, "field"), of(&mut renderer, "ray"));
    eprintln!("field {field:?}, ray {ray:?}");
    assert!((ray.0 - 1.0).abs() < 0.12 && ray.1 < 1.2 * field.1, "field {field:?}, ray {ray:?}");
}

/// Every ray comes to its end, however many parts it has: those behind the first ones that are written down
/// are gathered, too.
#[test]
fn no_ray_is_cut() {
    let mut renderer = renderer();
    let volume = balls(24);
    let sky = json!({"lights": [{"id": "sky", "type": "environment", "radiance": [1, 1, 1]}],
        "transfer_function": {"points": [{"s": 0, "extinction": 1, "albedo": [1, 1, 1]},
            {"s": 1, "extinction": 2, "albedo": [1, 1, 1]}]}, "background": [1, 1, 1],
        "illumination": {"photons": 16384, "photon_grid": 8, "photon_events": 64}});
    for step in [1.0, 0.125] {
        let fine = json!({"sampling": {"step_voxels": step, "termination_transmittance": 0}});
        let of = |renderer: &mut Renderer, gather: &str| {
            let (rgb, drawn) = picture(renderer, &volume, &[sky.clone(), fine.clone(), by(gather)]);
            (rgb, ["samples_with_matter", "samples_taken"].map(|name| drawn.counters[name]))
        };
        let (_, expected) = of(&mut renderer, "field");
        let (rgb, found) = of(&mut renderer, "ray");
        assert_eq!(found, expected, "step {step}");
        let per_pixel = found[0] / (u64::from(TARGET.width) * u64::from(TARGET.height));
        eprintln!("{per_pixel} parts a ray, off by {:.4}", off(&rgb, |_| 1.0));
        assert!(step == 1.0 || per_pixel > 128, "{per_pixel} parts a ray");
        assert!(off(&rgb, |_| 1.0) < 0.03, "{}", off(&rgb, |_| 1.0));
    }
}

/// After edits, interrupted ones among them, pixels equal those drawn from scratch.
#[test]
fn edits_leave_what_would_be_gathered_from_scratch() {
    let mut renderer = renderer();
    let volume = balls(24);
    let mut view = View::new();
    let mut patches = vec![by("ray")];
    draw(&mut renderer, &mut view, &snapshot(&volume, &patches, 1));
    let mut before = renderer.radiance(&view).unwrap().rgb;
    let mut changed = 0;
    for (i, (name, edit)) in edits().into_iter().enumerate() {
        patches.push(edit);
        let newest = snapshot(&volume, &patches, i as u32 + 2);
        // Every third is overtaken by the next.
        let budget = Some(Duration::from_micros(1));
        for _ in 0..i % 3 {
            renderer.draw(&mut view, &DrawRequest { snapshot: &newest, target: TARGET, budget }).unwrap();
        }
        if i % 3 == 2 {
            continue;
        }
        draw(&mut renderer, &mut view, &newest);
        equal(&mut renderer, &view, &newest).map_err(|what| format!("{name}: {what}")).unwrap();
        let now = renderer.radiance(&view).unwrap().rgb;
        changed += usize::from(now != before);
        before = now;
    }
    assert!(changed > 10, "{changed} pictures are other than those before");
}

/// Rays alone are cast anew where light is gathered otherwise, and where lights get other colours.
#[test]
fn another_gather_follows_no_photon() {
    let mut renderer = renderer();
    let volume = balls(24);
    let mut view = View::new();
    let bright = json!({"lights": [{"id": "sun", "type": "directional", "direction": [-1, -1, -0.5],
        "irradiance": [5, 4, 3]}]});
    let mut pictures = Vec::new();
    let mut redraw = |patches: &[Value], epoch: u32| {
        let snapshot: Arc<Snapshot> = snapshot(&volume, patches, epoch);
        let drawn = draw(&mut renderer, &mut view, &snapshot);
        equal(&mut renderer, &view, &snapshot).unwrap();
        pictures.push(renderer.radiance(&view).unwrap().rgb);
        let sorts = drawn.stages.iter().any(|stage| stage.stage == "sort_photons");
        (drawn.counters["photons_recomputed"], sorts)
    };
    assert_eq!(redraw(&[by("field")], 1), (4096, false));
    assert_eq!(redraw(&[by("ray")], 2), (0, true));
    assert_eq!(redraw(&[by("ray"), bright], 3), (0, false));
    assert_eq!(redraw(&[by("field")], 4), (0, false));
    assert_eq!(pictures[0], pictures[3]);
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);
}
