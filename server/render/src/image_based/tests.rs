//! What rays of records hold, read back.

use std::sync::Arc;

use glam::DVec3;
use scene::plan::Target;
use scene::spherical::healpix;
use scene::{PreparedVolume, Scene, Snapshot, Volume, Voxels, records};
use serde_json::{Value, json};

use super::slots::CHUNK_SLOTS;
use crate::test_support::renderer;
use crate::{DrawRequest, View};

fn scene(volume: &Arc<PreparedVolume>, patch: Value) -> Scene {
    let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
        "lights": [{"type": "environment", "radiance": [1, 1, 1]}],
        "illumination": {"method": "image_based", "records": 5, "record_directions": 48}});
    for (key, value) in patch.as_object().unwrap() {
        file[key] = value.clone();
    }
    Scene::new(&proto::SceneFile::from_value(file).unwrap(), volume.clone()).unwrap()
}

/// Rays of the first chunk of a scene's records, all of whose records are kept: of a word, at
/// [column][slot], slots in the order of the grid.
fn rays(scene: &Scene, columns: usize, words: usize) -> Vec<Vec<f32>> {
    let mut renderer = renderer();
    let snapshot = Arc::new(Snapshot { epoch: 1, scene: scene.clone() });
    let mut view = View::new();
    let target = Target { width: 8, height: 8, samples_per_pixel: 1 };
    let drawn = renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None }).unwrap();
    assert!(drawn.complete);
    let light = view.light.lock();
    let kept = light.image_based().unwrap().kept.as_ref().unwrap();
    assert_eq!(kept.slots.chunks(), 1);
    let numbers = words * kept.shape.columns as usize * CHUNK_SLOTS as usize;
    let bytes = renderer.gpu().read_buffer(kept.chunks[0].rays(), 4 * numbers as u64).unwrap();
    let all: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
    let of = |row: usize| all[row * CHUNK_SLOTS as usize..][..kept.slots.len()].to_vec();
    (0..words)
        .flat_map(|word| (0..columns).map(move |c| word * kept.shape.columns as usize + c))
        .map(of)
        .collect()
}

/// Way from a point in a box to its surface.
fn way_out(x: DVec3, direction: DVec3, size: DVec3) -> f64 {
    let ways = (0.5 * size * direction.signum() - x) / direction;
    [ways.x, ways.y, ways.z].into_iter().filter(|way| way.is_finite()).fold(f64::INFINITY, f64::min)
}

#[test]
fn transmittance_in_a_cube_is_exact() {
    let dims = [13, 9, 7];
    let voxels = Voxels::U8(vec![200; dims.iter().product()]);
    let volume = Arc::new(PreparedVolume::new(Volume::new(dims, voxels), &|_| {}));
    let lamp = DVec3::new(0.1, 0.05, -0.02);
    let lights = json!([{"type": "environment", "radiance": [1, 1, 1]},
        {"type": "point", "position": lamp.to_array(), "intensity": [1, 1, 1]}]);
    for sigma_t in [0.3, 5.0, 60.0] {
        let scene = scene(
            &volume,
            json!({"lights": lights,
            "illumination": {"method": "image_based", "records": 5, "record_directions": 48, "record_form": "static"},
            "transfer_function": {"points": [{"s": 0, "extinction": sigma_t}]}}),
        );
        let found = rays(&scene, 49, 1);
        let grid = scene.grid;
        let dims = [5, 3, 3];
        let directions = healpix::centres(2);
        for slot in 0..45u32 {
            let x = records::position(&grid, dims, [slot % 5, slot / 5 % 3, slot / 15]);
            for (column, &direction) in directions.iter().enumerate() {
                let expected = (-sigma_t * way_out(x, direction, grid.size_world)).exp();
                let got = f64::from(found[column][slot as usize]);
                assert!(
                    (got - expected).abs() < 2e-6 * (1.0 + sigma_t) * expected + 1.1e-6,
                    "{column} {slot}: {got} {expected}"
                );
            }
            let expected = (-sigma_t * (lamp - x).length()).exp();
            let got = f64::from(found[48][slot as usize]);
            assert!(
                (got - expected).abs() < 1e-5 * (1.0 + sigma_t) * expected + 1.1e-6,
                "{slot}: {got} {expected}"
            );
        }
    }
}

#[test]
fn light_from_glowing_matter_is_collected_on_the_way() {
    let volume = Arc::new(PreparedVolume::new(Volume::new([6; 3], Voxels::U8(vec![9; 216])), &|_| {}));
    let point = json!({"s": 0, "extinction": 4, "albedo": [0.5, 0.5, 0.5], "emission": [3, 2, 1]});
    let scene = scene(&volume, json!({"transfer_function": {"points": [point]}}));
    let found = rays(&scene, 48, 4);
    for (column, direction) in healpix::centres(2).into_iter().enumerate() {
        for slot in [0, 31, 62, 124] {
            let x = records::position(
                &scene.grid,
                [5; 3],
                [slot as u32 % 5, slot as u32 / 5 % 5, slot as u32 / 25],
            );
            let through = (-4.0 * way_out(x, direction, scene.grid.size_world)).exp();
            for (channel, emission) in [3.0, 2.0, 1.0].into_iter().enumerate() {
                let expected = (1.0 - through) * 0.5 * emission;
                let got = f64::from(found[48 * (channel + 1) + column][slot]);
                assert!((got - expected).abs() < 1e-4, "{column} {slot} {channel}: {got} {expected}");
            }
        }
    }
}

/// Transmittance along a straight line through voxels, in f64 by many small steps.
fn marched(scene: &Scene, x: DVec3, direction: DVec3) -> f64 {
    const STEPS: usize = 8000;
    let end = way_out(x, direction, scene.grid.size_world);
    let volume = &scene.volume.volume;
    let value = |x: DVec3| {
        let p = scene.grid.unit_from_world(x) * DVec3::from_array(volume.dims.map(|n| n as f64)) - 0.5;
        let mut sum = 0.0;
        for corner in 0..8 {
            let (mut weight, mut at) = (1.0, [0; 3]);
            for axis in 0..3 {
                let upper = corner >> axis & 1;
                let low = p[axis].floor();
                weight *= if upper == 1 { p[axis] - low } else { 1.0 - (p[axis] - low) };
                at[axis] = (low as i64 + upper as i64).clamp(0, volume.dims[axis] as i64 - 1) as usize;
            }
            sum += weight * volume.value(at[0], at[1], at[2]);
        }
        sum
    };
    let step = end / STEPS as f64;
    let at = |i: usize| scene.classification().sigma_t_at(value(x + (i as f64 + 0.5) * step * direction));
    (-(0..STEPS).map(at).sum::<f64>() * step).exp()
}

#[test]
fn transmittance_through_a_field_agrees_with_small_steps() {
    let dims = [20, 17, 23];
    let voxels: Vec<u16> = (0..dims.iter().product::<usize>())
        .map(|i| {
            let p = DVec3::new((i % 20) as f64 - 9.0, (i / 20 % 17) as f64 - 8.0, (i / 340) as f64 - 12.0);
            ((p.x * 0.5).sin() * (p.y * 0.4).cos() * 9000.0 + 30_000.0 - 2000.0 * p.length()).max(0.0) as u16
        })
        .collect();
    let volume = Arc::new(PreparedVolume::new(Volume::new(dims, Voxels::U16(voxels)), &|_| {}));
    let points = json!({"points": [{"s": 0, "extinction": 6}, {"s": 0.3, "extinction": 6}, {"s": 0.35, "extinction": 0},
        {"s": 0.6, "extinction": 0}, {"s": 0.6, "extinction": 12}, {"s": 1, "extinction": 3}]});
    let scene = scene(&volume, json!({"transfer_function": points}));
    let found = rays(&scene, 48, 1);
    let dims = super::Records::of(&scene).dims(&scene.grid);
    let needed = records::needed(&scene, dims, proto::scene_file::RecordLookup::Trilinear);
    let kept: Vec<u32> = (0..needed.len() as u32).filter(|&record| needed[record as usize]).collect();
    let (mut worst, mut squares, mut count, mut dimmest) = (0.0f64, 0.0f64, 0.0f64, 1.0f64);
    for (slot, record) in kept.iter().enumerate().step_by(7) {
        let at = [record % dims[0], record / dims[0] % dims[1], record / dims[0] / dims[1]];
        let x = records::position(&scene.grid, dims, at);
        for (column, direction) in healpix::centres(2).into_iter().enumerate().step_by(5) {
            let expected = marched(&scene, x, direction);
            let off = (f64::from(found[column][slot]) - expected).abs();
            worst = worst.max(off);
            squares += off * off;
            count += 1.0;
            dimmest = dimmest.min(expected);
        }
    }
    let rms = (squares / count).sqrt();
    eprintln!("transmittance: root mean square error {rms:.1e}, largest {worst:.1e}");
    // Rays that graze a step of the transfer function are off by most.
    assert!(rms < 2e-3 && worst < 0.015 && dimmest < 0.3, "{rms} {worst} {dimmest}");
}
