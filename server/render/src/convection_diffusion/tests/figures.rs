//! Times and errors for the method's README; run by hand:
//!
//! ```text
//! cargo test --release -p render --lib figures -- --ignored --nocapture --test-threads=1
//! ```

use std::time::Instant;

use super::diffusion::begin;
use super::*;

/// Edges of light grids, cells; the largest only on a hardware device.
const EDGES: [u32; 5] = [16, 32, 64, 128, 256];

fn edges(device: &Device) -> Vec<u32> {
    let most = if device.gpu.info().software { 64 } else { 256 };
    EDGES.into_iter().filter(|&edge| edge <= most).collect()
}

/// The best of a few runs, milliseconds.
fn best(gpu: &Gpu, mut run: impl FnMut()) -> f64 {
    let time = |_| {
        gpu.wait().unwrap();
        let began = Instant::now();
        run();
        gpu.wait().unwrap();
        began.elapsed().as_secs_f64() * 1e3
    };
    (0..3).map(time).fold(f64::INFINITY, f64::min)
}

fn homogeneous(direction: [f64; 3]) -> Arc<Snapshot> {
    let light = json!({"type": "directional", "direction": direction, "irradiance": [1, 1, 1]});
    snapshot([8; 3], vec![255; 512], json!({"transfer_function": ramp(4.0, 0.0), "lights": [light]}))
}

/// The largest and the mean error at optical depth 4.
fn errors(found: &[[f32; 2]], cells: &Cells, direction: [f64; 3]) -> (f64, f64) {
    let travel = DVec3::from_array(direction).normalize();
    let all: Vec<f64> = centres(cells)
        .map(|(index, x)| {
            let way = (0..3)
                .filter(|&i| travel[i] != 0.0)
                .map(|i| (0.5 + x[i] * travel[i].signum()) / travel[i].abs())
                .fold(f64::INFINITY, f64::min);
            (f64::from(found[index][0]) - (-4.0 * way).exp()).abs()
        })
        .collect();
    (all.iter().copied().fold(0.0, f64::max), all.iter().sum::<f64>() / all.len() as f64)
}

#[test]
#[ignore = "prints figures"]
fn transport_figures() {
    let mut device = device();
    let gpu = device.gpu.clone();
    println!("device: {}", gpu.info().name);
    println!("direction, cells, solver, milliseconds, largest error, mean error");
    for direction in [[0.0, -1.0, 0.0], [0.5, -0.6, 0.8]] {
        let snapshot = homogeneous(direction);
        for edge in edges(&device) {
            let cells = cells(&snapshot, [edge; 3]);
            let matter = device.matter(&snapshot, &cells);
            let out = storage(&gpu, "transmittances", 4 * cells.count()).unwrap();
            let geometry = snapshot.scene.lights[0].geometry.clone();
            let say = |device: &Device, solver: &str, millis: f64| {
                let (largest, mean) = errors(&device.shares(&out, &cells), &cells, direction);
                println!("{direction:?}, {edge}, {solver}, {millis:.2}, {largest:.5}, {mean:.5}");
            };
            let millis = best(&gpu, || {
                for sweep in sweeps(&geometry, &cells, 0) {
                    let mut lines = device.transport.begin(sweep, 0).unwrap();
                    while !device.transport.advance(&mut lines, &matter, &out).unwrap().0 {}
                }
            });
            say(&device, "characteristics", millis);
            let upwind = Upwind::new(gpu.clone());
            for (solver, steps) in
                [("upwind", 0), ("explicit 5", 5), ("explicit 10", 10), ("explicit 20", 20)]
            {
                let millis = best(&gpu, || {
                    let mut fronts =
                        upwind.begin(&geometry, &cells, 0, steps, &matter, &out).unwrap().unwrap();
                    while !upwind.advance(&mut fronts).0 {}
                });
                say(&device, solver, millis);
            }
        }
    }
}

/// All of the light from scratch, by number of lights, and each part of it.
#[test]
#[ignore = "prints figures"]
fn light_figures() {
    let mut guard = device();
    let device = &mut *guard;
    println!("device: {}", device.gpu.info().name);
    println!("cells, lights, diffusion, milliseconds, iterations; another colour; one light moved");
    for edge in edges(device) {
        for (lights, diffusion) in
            [(1, "none"), (1, "heat"), (1, "p1"), (2, "p1"), (3, "p1"), (4, "p1"), (5, "p1")]
        {
            let scene = |strength: f64, turn: f64| {
                let light = |i: usize| {
                    let angle = i as f64 + turn;
                    json!({"id": format!("{i}"), "type": "directional", "irradiance": [strength, 1, 1],
                        "direction": [angle.sin(), -0.7, angle.cos()]})
                };
                let voxel = |i: usize| {
                    let n = edge as usize;
                    let [x, y, z] =
                        [i % n, i / n % n, i / (n * n)].map(|v| (v as f64 + 0.5) / f64::from(edge) - 0.5);
                    let wave = (12.0 * x).sin() + (11.0 * y).sin() + (13.0 * z).cos();
                    (127.0 + 42.0 * wave) as u8
                };
                let points = json!({"points": [{"s": 0.4, "extinction": 0, "albedo": [0.95, 0.9, 0.8]},
                    {"s": 0.9, "extinction": 60, "albedo": [0.95, 0.9, 0.8]}]});
                let lights: Vec<Value> = (0..lights).map(light).collect();
                snapshot(
                    [edge as usize; 3],
                    (0..edge.pow(3) as usize).map(voxel).collect(),
                    json!({
                    "transfer_function": points, "lights": lights, "illumination": {
                    "method": "convection_diffusion", "light_grid": 1, "light_bands": 1, "diffusion": diffusion}}),
                )
            };
            let times = begin(device, &[scene(1.0, 0.0), scene(2.0, 0.0)], &{
                let mut moved = (*scene(2.0, 0.0)).clone();
                moved.scene.lights[0].geometry = LightGeometry::Directional { direction: DVec3::NEG_Y };
                Arc::new(Snapshot { epoch: 3, ..moved })
            });
            println!("{edge}, {lights}, {diffusion}, {times}");
        }
    }
}
