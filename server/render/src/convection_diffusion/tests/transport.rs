//! Transmittances against closed forms.

use super::*;

/// The bound of the error of direct light, as a share of what arrives.
const GOAL: f64 = 0.01;

/// The way light takes in the box, half edges `half`, from `from` (or from afar along `direction`) to
/// `x`.
fn way(x: DVec3, from: Option<DVec3>, direction: DVec3, half: DVec3) -> f64 {
    let back = from.map_or(-direction, |place| place - x);
    let distance = if from.is_some() { back.length() } else { f64::INFINITY };
    let back = back.normalize();
    let exit =
        |i: usize| if back[i] == 0.0 { f64::INFINITY } else { (half[i] * back[i].signum() - x[i]) / back[i] };
    (0..3).map(exit).fold(distance, f64::min)
}

/// Largest error over all cells of a homogeneous box of optical depth `depth` along its longest edge.
fn largest_error(dims: [usize; 3], cell_dims: [u32; 3], depth: f64, light: Value) -> f64 {
    errors(dims, cell_dims, depth, light, |snapshot, cells| device().transmittances(snapshot, cells)).0
}

/// The largest and the mean error of a solver.
fn errors(
    dims: [usize; 3],
    cell_dims: [u32; 3],
    depth: f64,
    light: Value,
    solve: impl Fn(&Arc<Snapshot>, &Cells) -> Vec<[f32; 2]>,
) -> (f64, f64) {
    let voxels = vec![255; dims.iter().product()];
    let patch = json!({"transfer_function": ramp(depth, 0.0), "lights": [light]});
    let snapshot = snapshot(dims, voxels, patch);
    let cells = cells(&snapshot, cell_dims);
    let found = solve(&snapshot, &cells);
    let half = 0.5 * snapshot.scene.grid.size_world;
    let geometry = &snapshot.scene.lights[0].geometry;
    let (from, direction) = match geometry {
        scene::light::LightGeometry::Directional { direction } => (None, *direction),
        scene::light::LightGeometry::Point { position } => (Some(*position), DVec3::X),
        _ => unreachable!(),
    };
    let error = |(index, x): (usize, DVec3)| {
        let expected = (-depth * way(x, from, direction, half)).exp();
        (f64::from(found[index][0]) - expected).abs()
    };
    let all: Vec<f64> = centres(&cells).map(error).collect();
    (all.iter().copied().fold(0.0, f64::max), all.iter().sum::<f64>() / all.len() as f64)
}

fn directional(direction: [f64; 3]) -> Value {
    json!({"type": "directional", "direction": direction, "irradiance": [1.0, 1.0, 1.0]})
}

fn point(position: [f64; 3]) -> Value {
    json!({"type": "point", "position": position, "intensity": [1.0, 1.0, 1.0]})
}

#[test]
fn homogeneous_matter_from_any_direction_is_within_the_goal() {
    let directions = [
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 1.0, 0.0],
        [-1.0, 1.0, 1.0],
        [0.3, -0.8, 0.51],
        [-0.9, 0.02, 0.11],
        [1e-4, 1.0, -1e-4],
    ];
    for direction in directions {
        let error = largest_error([8; 3], [32; 3], 4.0, directional(direction));
        println!("{direction:?}: {error:.5}");
        assert!(error <= GOAL, "{direction:?}: {error}");
    }
}

#[test]
fn lights_with_a_place_are_within_the_goal_outside_and_inside() {
    let places = [
        [0.0, 0.0, 2.0],
        [-1.3, 0.7, 0.2],
        [0.7, 0.7, 0.7],
        [0.52, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.13, -0.21, 0.333],
        [0.25, 0.25, -0.25],
        [0.015625, 0.015625, 0.015625],
        [0.5, 0.5, 0.5],
        [3000.0, 1000.0, -500.0],
    ];
    for place in places {
        let error = largest_error([8; 3], [32; 3], 4.0, point(place));
        println!("{place:?}: {error:.5}");
        assert!(error <= GOAL, "{place:?}: {error}");
    }
}

#[test]
fn any_aspect_ratio_and_matter_in_layers() {
    // Layers along x, linear between voxel centres, in a cube of voxels eight times as thick across.
    const LAYERS: [u8; 16] = [0, 0, 40, 255, 255, 0, 0, 90, 90, 10, 0, 255, 0, 60, 130, 130];
    const SIGMA: f64 = 4.0;
    let voxels: Vec<u8> = (0..16 * 4).map(|i| LAYERS[i % 16]).collect();
    let volume = Volume { spacing: [1.0, 8.0, 8.0], ..Volume::new([16, 2, 2], Voxels::U8(voxels)) };
    // Optical depth along x from -1/2 to x.
    let depth = |x: f64| {
        let steps = 4000;
        let value = |x: f64| {
            let at = ((x + 0.5) * 16.0 - 0.5).clamp(0.0, 15.0);
            let (i, f) = ((at as usize).min(14), at - (at as usize).min(14) as f64);
            f64::from(LAYERS[i]) * (1.0 - f) + f64::from(LAYERS[i + 1]) * f
        };
        let step = (x + 0.5) / f64::from(steps);
        (0..steps).map(|i| value(-0.5 + (f64::from(i) + 0.5) * step)).sum::<f64>() * step * SIGMA / 255.0
    };
    for (direction, from) in
        [([0.8, 0.3, -0.2], None), ([1.0, 0.0, 0.0], None), ([1.0, 0.0, 0.0], Some([0.1, 0.2, -0.3]))]
    {
        let light = from.map_or(directional(direction), point);
        let patch = json!({"transfer_function": ramp(SIGMA, 0.0), "lights": [light]});
        let snapshot = snapshot_of(volume.clone(), patch);
        assert!((snapshot.scene.grid.size_world - 1.0).length() < 1e-12);
        let errors = [[32, 24, 16], [64, 48, 32]].map(|dims| {
            let cells = cells(&snapshot, dims);
            let found = device().transmittances(&snapshot, &cells);
            let from = from.map(DVec3::from_array);
            let travel = DVec3::from_array(direction).normalize();
            let error = |(index, x): (usize, DVec3)| {
                let way = way(x, from, travel, DVec3::splat(0.5));
                let back = from.map_or(-travel, |place| (place - x).normalize());
                let start = x + way * back;
                let slope = (x - start).x.abs() / way;
                // By the sides light enters through whole layers within a cell: not resolved.
                if from.is_none() && start.x > -0.499 {
                    return 0.0;
                }
                let expected = if slope < 1e-6 {
                    return 0.0;
                } else {
                    (-(depth(x.x) - depth(start.x)).abs() / slope).exp()
                };
                (f64::from(found[index][0]) - expected).abs()
            };
            centres(&cells).map(error).fold(0.0, f64::max)
        });
        println!("{direction:?} {from:?}: {errors:?}");
        // Second order in the cell; from within, some ways follow a layer that a cell does not resolve.
        let goal = if from.is_some() { 5.0 * GOAL } else { GOAL };
        assert!(errors[1] <= goal && errors[1] < 0.5 * errors[0], "{direction:?} {from:?}: {errors:?}");
    }
}

#[test]
fn a_mean_over_a_thick_cell_holds_what_the_cell_takes() {
    // Each cell has optical depth 5: at its centre there is little light left, over it more.
    let patch = json!({"transfer_function": ramp(40.0, 0.0), "lights": [directional([0.0, 0.0, -1.0])]});
    let snapshot = snapshot([4; 3], vec![255; 64], patch);
    let cells = cells(&snapshot, [8; 3]);
    let found = device().transmittances(&snapshot, &cells);
    for (index, x) in centres(&cells) {
        let above = 40.0 * (0.5 - x.z - 1.0 / 16.0);
        let mean = (-above).exp() * (1.0 - (-5.0f64).exp()) / 5.0;
        assert!(
            (f64::from(found[index][1]) - mean).abs() < 1e-3 * mean + 1.0 / 65535.0,
            "{x}: {:?} {mean}",
            found[index]
        );
    }
}

#[test]
fn upwind_is_exact_along_an_axis_and_of_first_order_askew() {
    let direct = |light: Value, n| {
        errors([8; 3], [n; 3], 4.0, light, |snapshot, cells| device().upwind(snapshot, cells, 0))
    };
    let (axis, _) = direct(directional([0.0, -1.0, 0.0]), 32);
    assert!(axis < 1e-4, "{axis}");
    for light in [directional([0.5, -0.6, 0.8]), point([0.9, 0.4, -0.7]), point([0.1, -0.07, 0.2])] {
        let ((_, coarse), (_, fine)) = (direct(light.clone(), 16), direct(light.clone(), 32));
        println!("{light}: mean error {coarse:.4}, {fine:.4}");
        assert!(fine < 0.04 && fine < 0.8 * coarse, "{light}: {coarse} {fine}");
    }
}

/// Explicit steps approach the direct solution; the published four or five are far from it.
#[test]
fn explicit_steps_converge_to_the_direct_solution() {
    let patch = json!({"transfer_function": ramp(4.0, 0.0), "lights": [directional([0.0, -1.0, 0.0])]});
    let snapshot = snapshot([8; 3], vec![255; 512], patch);
    let cells = cells(&snapshot, [32; 3]);
    let direct = device().upwind(&snapshot, &cells, 0);
    let distance = |steps: u32| {
        let found = device().upwind(&snapshot, &cells, steps);
        let each = found.iter().zip(&direct).map(|(a, b)| (a[0] - b[0]).abs());
        each.fold(0.0, f32::max)
    };
    let distances = [2, 5, 24].map(distance);
    println!("{distances:?}");
    assert!(distances[0] > distances[1] && distances[1] > 0.05 && distances[2] < 1e-3, "{distances:?}");
}
