//! Diffused light against closed forms.

use std::collections::BTreeMap;

use super::*;
use crate::convection_diffusion::ConvectionDiffusion;
use crate::illumination::Inputs;

/// Fluence of diffused light, red, of every cell, and the iterations it took.
fn diffused(snapshot: &Arc<Snapshot>) -> (Vec<f32>, Cells, u64) {
    let mut device = device();
    let device = &mut *device;
    with_inputs(device, snapshot, |inputs, gpu| {
        let mut light = ConvectionDiffusion::new(inputs).unwrap();
        let mut counters = BTreeMap::new();
        assert!(light.advance(inputs, None, &mut counters).unwrap().complete);
        let bytes = gpu.read_buffer(light.solution().unwrap(), 16 * light.cells().count()).unwrap();
        let values: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        (
            values.iter().map(|v| v[0] * light.scale() as f32).collect(),
            light.cells(),
            counters["light_iterations"],
        )
    })
}

/// Runs with what the method reads of a scene.
fn with_inputs<T>(
    device: &mut Device,
    snapshot: &Arc<Snapshot>,
    run: impl FnOnce(&Inputs<'_>, &Gpu) -> T,
) -> T {
    let mut view = View::new();
    let target = Target { width: 8, height: 8, samples_per_pixel: 1 };
    device
        .renderer
        .draw(&mut view, &DrawRequest { snapshot: &local(snapshot), target, budget: None })
        .unwrap();
    let inputs = Inputs {
        gpu: &device.gpu,
        snapshot,
        texture: &view.volume.as_ref().unwrap().1,
        tables: &view.transfer_function.as_ref().unwrap().1,
        lights: &view.lights.as_ref().unwrap().1,
        majorants: None,
        environment: None,
        distance_map: None,
        record_passes: &device.renderer.record_passes.clone(),
        direct_light: &device.renderer.direct_light.clone(),
        transfer_pipelines: &device.renderer.transfer_pipelines,
        bakes: None,
        photon_pipelines: &device.renderer.photon_pipelines.clone(),
        convection_diffusion: &device.pipelines,
    };
    run(&inputs, &device.gpu)
}

/// The same scene by a method that needs no light field.
fn local(snapshot: &Snapshot) -> Arc<Snapshot> {
    let scene = Scene { method: proto::scene_file::Method::Local, ..snapshot.scene.clone() };
    Arc::new(Snapshot { epoch: 1, scene })
}

#[test]
fn white_matter_under_uniform_light_is_as_bright_as_the_light() {
    let patch = json!({"transfer_function": ramp(20.0, 1.0),
        "lights": [{"type": "environment", "radiance": [0.25, 0.5, 1.0]}],
        "illumination": {"method": "convection_diffusion", "max_residual": 1e-5, "light_grid": 1}});
    // Matter of many densities, and some vacuum.
    let voxels: Vec<u8> =
        (0..12 * 9 * 17).map(|i| if i % 7 == 0 { 0 } else { (i * 37 % 251) as u8 }).collect();
    let snapshot = snapshot([12, 9, 17], voxels, patch);
    let (fluence, _, iterations) = diffused(&snapshot);
    let expected = std::f32::consts::PI;
    println!("{iterations} iterations");
    for value in fluence.iter().filter(|&&value| value != 0.0) {
        assert!((value / expected - 1.0).abs() < 2e-3, "{value} for {expected}");
    }
    assert!(fluence.iter().filter(|&&value| value != 0.0).count() > 1500 && iterations < 30);
}

/// A slab under normal light: phi = A exp(k z) + B exp(-k z) + C exp(-sigma z).
#[test]
fn a_slab_follows_the_closed_form() {
    const DEPTH: f64 = 16.0;
    for albedo in [0.99, 0.8] {
        let volume =
            Volume { spacing: [1000.0, 1000.0, 1.0], ..Volume::new([2, 2, 96], Voxels::U8(vec![255; 384])) };
        let height = 0.048;
        let sigma = DEPTH / height;
        let patch = json!({"transfer_function": ramp(sigma, albedo),
            "lights": [{"type": "directional", "direction": [0, 0, -1], "irradiance": [2.0, 1.0, 0.0]}],
            "illumination": {"method": "convection_diffusion", "max_residual": 1e-5, "light_grid": 1}});
        let snapshot = snapshot_of(volume, patch);
        assert!((snapshot.scene.grid.size_world.z - height).abs() < 1e-12);
        let (fluence, cells, iterations) = diffused(&snapshot);
        let (sigma_a, sigma_s, d) = ((1.0 - albedo) * sigma, albedo * sigma, 1.0 / (3.0 * sigma));
        let k = (sigma_a / d).sqrt();
        let c = sigma_s * 2.0 / (sigma_a - d * sigma * sigma);
        // phi - 2 D phi' = 0 at 0; phi + 2 D phi' = 0 at the height.
        let e = |x: f64| (x * height).exp();
        let rows = [
            [1.0 - 2.0 * d * k, 1.0 + 2.0 * d * k, -c * (1.0 + 2.0 * d * sigma)],
            [
                (1.0 + 2.0 * d * k) * e(k),
                (1.0 - 2.0 * d * k) * e(-k),
                -c * (1.0 - 2.0 * d * sigma) * e(-sigma),
            ],
        ];
        let determinant = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0];
        let a = (rows[0][2] * rows[1][1] - rows[0][1] * rows[1][2]) / determinant;
        let b = (rows[0][0] * rows[1][2] - rows[0][2] * rows[1][0]) / determinant;
        let phi = |z: f64| a * (k * z).exp() + b * (-k * z).exp() + c * (-sigma * z).exp();
        let largest = (0..96).map(|i| phi((f64::from(i) + 0.5) / 96.0 * height)).fold(0.0, f64::max);
        let mut worst = 0.0f64;
        for (index, x) in centres(&cells) {
            let expected = phi(0.5 * height - x.z);
            worst = worst.max((f64::from(fluence[index]) - expected).abs() / largest);
        }
        println!("albedo {albedo}: {worst:.5} of the largest, {iterations} iterations");
        assert!(worst < 0.01, "albedo {albedo}: {worst}");
    }
}

/// Nothing of the light is lost, none is negative, and walls keep it back.
#[test]
fn heat_keeps_its_energy_and_stays_positive() {
    let found = |spread: f64| {
        // A wall across the middle, opaque and black; light on one side of it.
        let voxels: Vec<u8> = (0..20 * 12 * 12).map(|i| if i % 20 == 10 { 255 } else { 10 }).collect();
        let patch = json!({"transfer_function": {"points": [{"s": 0.0, "extinction": 2, "albedo": [1, 1, 1]},
                {"s": 0.5, "extinction": 2, "albedo": [1, 1, 1]}, {"s": 1.0, "extinction": 1e5, "albedo": [0, 0, 0]}]},
            "lights": [{"type": "directional", "direction": [1, 0, 0], "irradiance": [1, 1, 1]}],
            "illumination": {"method": "convection_diffusion", "diffusion": "heat", "light_grid": 1,
                "heat_spread": spread, "max_residual": 1e-5}});
        diffused(&snapshot([20, 12, 12], voxels, patch)).0
    };
    let (still, spread) = (found(0.0), found(0.1));
    let sum = |light: &[f32]| light.iter().map(|&x| f64::from(x)).sum::<f64>();
    assert!((sum(&spread) / sum(&still) - 1.0).abs() < 1e-3, "{} for {}", sum(&spread), sum(&still));
    assert!(spread.iter().all(|&x| x > -1e-4));
    let beyond = |light: &[f32]| {
        light.iter().enumerate().filter(|(i, _)| i % 20 > 11).map(|(_, x)| f64::from(*x)).sum::<f64>()
    };
    assert!(beyond(&spread) < 1e-3 * sum(&spread), "{}", beyond(&spread));
    assert!(spread.iter().zip(&still).any(|(a, b)| (a - b).abs() > 0.02), "light was spread");
}
