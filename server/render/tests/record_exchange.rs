//! Method `image_based` whose records exchange scattered light: against the independent reference, and
//! where the answer is known.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;
use std::time::Duration;

use common::{draw, homogeneous, json_merge, prepared, renderer, snapshot, target};
use reference::statistics::difference;
use reference::{Progress, Request};
use render::{DrawRequest, View};
use scene::plan::Pass;
use scene::{PreparedVolume, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

/// Pixels of a picture.
const SIZE: [u32; 2] = [16, 12];

fn scene(
    volume: &Arc<PreparedVolume>,
    rounds: u32,
    [sigma_t, albedo]: [f64; 2],
    patch: Value,
) -> Arc<Snapshot> {
    let mut file = json!({"value_range": [0, 255],
        "illumination": {"method": "image_based", "records": 16, "record_exchange": rounds},
        "transfer_function": {"points": [{"s": 0.0, "extinction": 0, "albedo": [albedo, albedo, albedo], "material": "m"},
            {"s": 1.0, "extinction": sigma_t, "albedo": [albedo, albedo, albedo], "material": "m"}]},
        "materials": {"m": {"phase": {"type": "isotropic"}}},
        "camera": {"position": [0.8, 0.7, 1.2], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 45},
        "background": [0, 0, 0],
        "lights": [{"id": "sky", "type": "environment", "radiance": [1, 1, 1]}]});
    json_merge(&mut file, patch);
    snapshot(volume, file, 1)
}

fn sun() -> Value {
    json!({"lights": [{"id": "sun", "type": "directional", "direction": [-0.4, -1.0, -0.7], "irradiance": [2, 2.5, 3]}]})
}

fn pixels(snapshot: &Arc<Snapshot>) -> Vec<[f64; 3]> {
    let image = common::radiance(snapshot, target(SIZE[0], SIZE[1], 16));
    image.rgb.as_chunks::<3>().0.iter().map(|p| p.map(f64::from)).collect()
}

/// Relative L2 differences of pictures from the reference, and those of their means.
fn errors(snapshots: &[Arc<Snapshot>], samples: u32) -> Vec<[f64; 2]> {
    let request = Request { seed: 5, ..Request::new(SIZE[0], SIZE[1], samples) };
    let truth = reference::render(&snapshots[0].scene, &request, &Progress::default()).unwrap();
    let mean = |image: &[[f64; 3]]| image.iter().flatten().sum::<f64>();
    let error = |snapshot| {
        let picture = pixels(snapshot);
        let exact = vec![[0.0; 3]; picture.len()];
        let found = difference(&picture, &exact, &truth.mean, &truth.standard_error);
        [found.relative_l2, mean(&picture) / mean(&truth.mean) - 1.0]
    };
    snapshots.iter().map(error).collect()
}

/// Blobs of values between 0 and 255.
fn blobs() -> Arc<PreparedVolume> {
    let dims = [18usize, 14, 22];
    let value = |i: usize| {
        let [x, y, z] = [i % 18, i / 18 % 14, i / 252].map(|v| v as f64);
        127.5 + 42.0 * ((0.5 * x).sin() + (0.4 * y + 0.2 * x).sin() + (0.5 * z - 0.2 * y).sin())
    };
    prepared(Volume::new(dims, Voxels::U8((0..dims.iter().product()).map(|i| value(i) as u8).collect())))
}

/// White matter in white light is as bright as the light, once enough orders are there, whatever its
/// shape, density and phase function.
#[test]
fn white_furnace() {
    let forward = json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": 0.5}}}});
    for (name, volume, patch) in [
        ("cube", homogeneous([16; 3]), json!({})),
        ("blobs", blobs(), json!({})),
        ("forward", blobs(), forward),
    ] {
        let off = |rounds| {
            let mut all = json!({"background": [1, 1, 1]});
            json_merge(&mut all, patch.clone());
            let picture = pixels(&scene(&volume, rounds, [6.0, 1.0], all));
            picture.iter().flatten().map(|x| (x - 1.0).abs()).fold(0.0, f64::max)
        };
        let [none, many] = [off(0), off(32)];
        eprintln!("{name}: off by {many:.4}, without exchange {none:.4}");
        assert!(many < 0.01, "{name}: {many}");
        assert!(none > 0.1, "{name}: {none}");
    }
}

#[test]
fn exchange_leads_to_the_reference() {
    let forward = json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": 0.5}}}});
    let mut forward_sun = sun();
    json_merge(&mut forward_sun, forward);
    for (name, volume, matter, patch, most) in [
        ("cube, sky", homogeneous([16; 3]), [6.0, 0.9], json!({}), 0.04),
        // Diffused light that leaves by a face is held constant over the last half of a cell.
        ("cube, sun", homogeneous([16; 3]), [6.0, 0.9], sun(), 0.08),
        ("blobs, sun, forward", blobs(), [20.0, 0.9], forward_sun, 0.12),
    ] {
        let of = |rounds| scene(&volume, rounds, matter, patch.clone());
        let found = errors(&[0, 2, 32].map(of), 128);
        eprintln!("{name}: relative L2 and mean {found:.3?}");
        assert!(found[2][0] < most && found[2][0] < 0.5 * found[0][0], "{name}: {found:?}");
        assert!(found.is_sorted_by(|a, b| a[1] <= b[1]), "{name}: {found:?}");
    }
}

/// A round adds one order of scattering: as many as the scene asks for are exchanged.
#[test]
fn rounds_are_orders() {
    let volume = homogeneous([16; 3]);
    let of = |rounds, patch| scene(&volume, rounds, [6.0, 0.9], patch);
    let two = || json!({"scattering": {"orders": 2}});
    assert!(pixels(&of(9, two())) == pixels(&of(1, json!({}))));
    // The reference is that of the first; the others have one order more and one fewer.
    let found = errors(&[of(9, two()), of(2, json!({})), of(0, json!({}))], 512);
    eprintln!("two orders, three, one: {found:.4?}");
    assert!(found[0][0] < 0.08 && found[1][0] > 0.12 && found[2][0] > 0.2, "{found:?}");
}

/// Slices end with the light computed at once; a camera that moves meanwhile does not hold it up; a round
/// more or fewer casts no ray.
#[test]
fn exchange_goes_on_in_slices() {
    let volume = blobs();
    let newest = scene(&volume, 3, [20.0, 0.9], sun());
    let mut renderer = renderer();
    let mut view = View::new();
    let mut calls = 0;
    loop {
        let mut turned = sun();
        turned["camera"] = json!({"position": [0.8, 0.7 + 0.01 * f64::from(calls), 1.2], "target": [0, 0, 0],
            "up": [0, 1, 0], "fov_y_degrees": 45});
        let moving = scene(&volume, 3, [20.0, 0.9], turned);
        let request = DrawRequest {
            snapshot: &moving,
            target: target(SIZE[0], SIZE[1], 1),
            budget: Some(Duration::from_micros(100)),
        };
        let drawn = renderer.draw(&mut view, &request).unwrap();
        calls += 1;
        assert!(calls < 3000);
        if drawn.illumination == 1.0 {
            break;
        }
    }
    let mut fresh = View::new();
    draw(&mut renderer, &mut view, &newest, target(SIZE[0], SIZE[1], 1));
    draw(&mut renderer, &mut fresh, &newest, target(SIZE[0], SIZE[1], 1));
    assert!(calls > 3 && renderer.radiance(&view).unwrap() == renderer.radiance(&fresh).unwrap());
    let more = scene(&volume, 4, [20.0, 0.9], sun());
    let drawn = draw(&mut renderer, &mut view, &more, target(SIZE[0], SIZE[1], 1));
    assert!(drawn.plan.runs(Pass::Illuminate));
    assert_eq!(drawn.counters["record_rays_cast"], 0);
}
