//! How well a ray is integrated: what is exact, and how fast the rest converges with the step.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;

use common::{json_merge, prepared, radiance, snapshot, target};
use scene::{PreparedVolume, Volume, Voxels};
use serde_json::{Value, json};

/// Voxels along the ramp.
const DEPTH: usize = 64;
/// World length over which the ramp's s grows by one: values grow by 4 of 255 a voxel.
const WORLD_PER_S: f64 = 255.0 / 4.0 / DEPTH as f64;

/// Values that grow linearly towards the eye; seen along the ramp.
fn ramp() -> Arc<PreparedVolume> {
    let voxels = (0..4 * 4 * DEPTH).map(|i| (i / 16 * 4) as u8).collect();
    prepared(Volume::new([4, 4, DEPTH], Voxels::U8(voxels)))
}

fn along_the_ramp(points: Value, step_voxels: f64, interpolation: &str) -> Value {
    json!({
        "value_range": [0, 255],
        "transfer_function": {"points": points},
        "background": [1, 1, 1],
        "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.03},
        "sampling": {"step_voxels": step_voxels, "termination_transmittance": 0, "interpolation": interpolation}
    })
}

fn centre(patch: Value) -> [f64; 3] {
    let image = radiance(&snapshot(&ramp(), patch, 1), target(8, 8, 1));
    std::array::from_fn(|channel| f64::from(image.rgb[3 * (4 * 8 + 4) + channel]))
}

fn black(s: f64, extinction: f64) -> Value {
    json!({"s": s, "extinction": extinction, "albedo": [0, 0, 0]})
}

#[test]
fn steps_and_peaks_of_the_transfer_function_are_exact_on_a_linear_field() {
    // A step up and down between 0.3 and 0.4, and a peak 0.01 wide: 0.16 voxels.
    let (height, peak) = (4.0, 200.0);
    let points = json!([
        black(0.0, 0.0),
        black(0.3, 0.0),
        black(0.3, height),
        black(0.4, height),
        black(0.4, 0.0),
        black(0.6, 0.0),
        black(0.605, peak),
        black(0.61, 0.0)
    ]);
    let optical_depth = WORLD_PER_S * (0.1 * height + 0.5 * 0.01 * peak);
    for step_voxels in [0.25, 1.0, 1.7, 3.0, 8.0] {
        let [got, ..] = centre(along_the_ramp(points.clone(), step_voxels, "exact"));
        let expected = (-optical_depth).exp();
        assert!((got - expected).abs() < 2e-5, "step {step_voxels}: {got}, not {expected}");
        // The sampler's weights are coarser, but the same light must come through.
        let [sampled, ..] = centre(along_the_ramp(points.clone(), step_voxels, "sampler"));
        assert!((sampled - expected).abs() < 2e-2, "step {step_voxels}: {sampled}, not {expected}");
    }
}

#[test]
fn layers_within_one_step_hide_each_other_in_the_right_order() {
    // Both 0.02 of s thick and of optical depth 1; the bright ends of s lie towards the eye.
    let sigma_t = 1.0 / (0.02 * WORLD_PER_S);
    let layer = |from: f64, emission: [f64; 3]| {
        let point = |s: f64, sigma_t: f64| json!({"s": s, "extinction": sigma_t, "albedo": [0, 0, 0], "emission": emission});
        [point(from, 0.0), point(from, sigma_t), point(from + 0.02, sigma_t), point(from + 0.02, 0.0)]
    };
    let blue_behind = layer(0.50, [0.0, 0.0, 1.0]);
    let red_in_front = layer(0.53, [1.0, 0.0, 0.0]);
    let points: Vec<Value> = blue_behind.into_iter().chain(red_in_front).collect();
    for step_voxels in [0.5, 2.0, 8.0] {
        let mut patch = along_the_ramp(json!(points), step_voxels, "exact");
        json_merge(&mut patch, json!({"background": [0, 0, 0]}));
        let [red, green, blue] = centre(patch);
        let hidden = (-1.0f64).exp();
        assert!((red - (1.0 - hidden)).abs() < 2e-4, "step {step_voxels}: red {red}");
        assert!(green == 0.0, "step {step_voxels}: green {green}");
        assert!((blue - (1.0 - hidden) * hidden).abs() < 2e-4, "step {step_voxels}: blue {blue}");
    }
}

#[test]
fn the_error_is_of_second_order_in_the_step_and_small_at_any() {
    let volume = prepared(scene::builtin::build(proto::scene_file::Builtin::Buckyball, [64; 3], &|_| {}));
    let image = |step_voxels: f64| {
        let patch = json!({
            "transfer_function": {"points": [
                {"s": 0.1, "extinction": 0}, {"s": 0.6, "extinction": 12, "albedo": [0.9, 0.5, 0.2]}, {"s": 1, "extinction": 40}
            ]},
            "lights": [{"type": "environment", "radiance": [1, 1, 1]}],
            "sampling": {"step_voxels": step_voxels, "termination_transmittance": 0}
        });
        radiance(&snapshot(&volume, patch, 1), target(64, 64, 1)).rgb
    };
    let fine = image(0.0625);
    let error = |rgb: &[f32]| {
        let squared = rgb.iter().zip(&fine).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        (squared / fine.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>()).sqrt()
    };
    let errors = [0.25, 0.5, 1.0, 2.0].map(|step| error(&image(step)));
    eprintln!("relative error at steps of 0.25, 0.5, 1 and 2 voxels: {errors:?}");
    // Halving divides the error by four; a first-order method would divide it by two. Steps longer
    // than a cell of the field are cut by the cells.
    assert!(errors[1] > 3.0 * errors[0], "{errors:?}");
    assert!(errors.iter().all(|error| *error < 1e-3), "{errors:?}");
}

#[test]
fn voxels_read_one_by_one_or_four_at_a_time_show_the_same() {
    let volume = || scene::builtin::build(proto::scene_file::Builtin::Buckyball, [24, 19, 21], &|_| {});
    let by_four = prepared(volume());
    // The same voxels under another name, so that they are loaded again.
    let mut one_by_one = PreparedVolume::new(volume(), &|_| {});
    one_by_one.content = [1; 32];
    let one_by_one = Arc::new(one_by_one);
    {
        let renderer = common::renderer();
        let volumes = renderer.volumes();
        let before = volumes.bytes();
        volumes.load(&by_four).unwrap();
        let by_four_bytes = volumes.bytes() - before;
        volumes.set_max_quad_bytes(0);
        volumes.load(&one_by_one).unwrap();
        volumes.set_max_quad_bytes(u64::MAX);
        assert!(volumes.bytes() - before - by_four_bytes < by_four_bytes / 4);
    }
    // From every octant: along mirrored axes the four are read in another order.
    for octant in 0..8 {
        let side = |bit: u32, distance: f64| if octant >> bit & 1 == 1 { distance } else { -distance };
        let patch = json!({
            "transfer_function": {"points": [{"s": 0, "extinction": 0.1}, {"s": 1, "extinction": 40, "albedo": [0.9, 0.5, 0.2]}]},
            "lights": [{"type": "environment", "radiance": [1, 1, 1]}],
            "camera": {"position": [side(0, 1.3), side(1, 0.8), side(2, 0.9)], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40}
        });
        let image = |volume| radiance(&snapshot(volume, patch.clone(), 1), target(48, 40, 1)).rgb;
        let (a, b) = (image(&by_four), image(&one_by_one));
        let worst = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-6, "octant {octant}: {worst}");
        assert!(a.iter().any(|x| *x > 0.1));
    }
}

#[test]
fn thin_matter_is_the_same_at_every_step() {
    let volume = prepared(scene::builtin::build(proto::scene_file::Builtin::SmokePlume, [48; 3], &|_| {}));
    // A peak 0.02 wide and a layer of two colours.
    let points = json!([
        black(0.0, 0.0), black(0.49, 0.0), black(0.5, 300.0), black(0.51, 0.0), black(0.7, 0.0),
        {"s": 0.7, "extinction": 50, "albedo": [0.2, 0.3, 0.9]}, {"s": 0.72, "extinction": 50, "albedo": [0.2, 0.9, 0.3]},
        black(0.72, 0.0)
    ]);
    let image = |step_voxels: f64| {
        let patch = json!({
            "transfer_function": {"points": points}, "background": [1, 1, 1],
            "lights": [{"type": "environment", "radiance": [1, 1, 1]}], "sampling": {"step_voxels": step_voxels}
        });
        radiance(&snapshot(&volume, patch, 1), target(64, 64, 1)).rgb
    };
    let fine = image(0.0625);
    let error = |rgb: &[f32]| {
        let sum = |values: &mut dyn Iterator<Item = f32>| values.map(f64::from).sum::<f64>();
        // Of what matter takes from the background.
        sum(&mut rgb.iter().zip(&fine).map(|(a, b)| (a - b).abs())) / sum(&mut fine.iter().map(|x| 1.0 - x))
    };
    let errors = [0.25, 0.5, 1.0, 2.0].map(|step| error(&image(step)));
    eprintln!("mean error at steps of 0.25, 0.5, 1 and 2 voxels: {errors:?}");
    assert!(errors.iter().all(|error| error.abs() < 0.01), "{errors:?}");
}

#[test]
fn the_sampler_reads_voxels_of_eight_bits_as_finely_as_others() {
    // Eight voxels from 100 to 101: between them the field takes values that eight bits cannot hold.
    let voxels = (0..8 * 8 * 8).map(|i| 100 + (i % 8 / 4) as u8).collect();
    let volume = prepared(Volume::new([8, 8, 8], Voxels::U8(voxels)));
    let image = |interpolation: &str| {
        let patch = json!({
            "value_range": [100, 101], "rendering": {"mode": "slice", "slice": {"normal": [0, 0, 1], "offset": 0}},
            "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 0.25},
            "sampling": {"interpolation": interpolation}
        });
        radiance(&snapshot(&volume, patch, 1), target(32, 32, 1)).rgb
    };
    let (sampled, exact) = (image("sampler"), image("exact"));
    let worst = sampled.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // Weights of eight bits are the coarsest that devices have.
    assert!(worst < 0.03, "{worst}");
    assert!(exact.iter().any(|x| *x > 0.2 && *x < 0.8));
}
