//! Pictures of homogeneous matter in given fields, against what the definition says.

use std::sync::Arc;

use glam::DVec3;
use proto::scene_file::Method;
use scene::plan::Target;
use scene::spherical::sh;
use scene::{PreparedVolume, Scene, Snapshot, Volume, Voxels};
use serde_json::json;

use super::LightField;
use crate::test_support::renderer;
use crate::{DrawRequest, View};

const ALBEDO: [f64; 3] = [0.9, 0.5, 0.2];
/// Optical depth 3 along an axis.
const THROUGH: f64 = 0.049_787_068_367_863_944;

/// The middle pixel of a homogeneous cube in a field, seen by parallel rays from +z.
fn middle(
    material: serde_json::Value,
    dims: [u32; 3],
    bands: u32,
    write: impl Fn(&mut LightField),
) -> [f64; 3] {
    let mut renderer = renderer();
    let volume = Arc::new(PreparedVolume::new(Volume::new([4; 3], Voxels::U8(vec![255; 64])), &|_| {}));
    let file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
        "camera": {"position": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0],
            "orthographic_height": 0.5},
        "background": [0, 0, 0],
        "materials": {"m": material},
        "transfer_function": {"points": [{"s": 0, "extinction": 3, "albedo": ALBEDO, "material": "m"}]},
        "illumination": {"method": "photon_map"},
        "sampling": {"termination_transmittance": 0}});
    let file = proto::SceneFile::from_value(file).unwrap();
    let snapshot = Arc::new(Snapshot { epoch: 1, scene: Scene::new(&file, volume).unwrap() });
    let mut view = View::new();
    let mut field = LightField::new(renderer.gpu(), dims, bands).unwrap();
    write(&mut field);
    view.light.lock().give(Method::PhotonMap, field);
    let target = Target { width: 9, height: 9, samples_per_pixel: 1 };
    renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None }).unwrap();
    let radiance = renderer.radiance(&view).unwrap();
    std::array::from_fn(|channel| f64::from(radiance.rgb[3 * 40 + channel]))
}

fn constant(field: &mut LightField, values: &[f64]) {
    let texels = field.dims.iter().product::<u32>() as usize;
    let coefficients: Vec<_> = values.iter().map(|&v| vec![[v as f32; 3]; texels]).collect();
    field.write(&coefficients, &vec![1.0; texels]);
}

fn agrees(found: [f64; 3], in_scattered: f64, tolerance: f64) {
    for (value, albedo) in found.into_iter().zip(ALBEDO) {
        let expected = (1.0 - THROUGH) * albedo * in_scattered;
        assert!((value - expected).abs() <= tolerance, "{found:?}: {value} for {expected}");
    }
}

#[test]
fn uniform_radiance_is_scattered_by_the_albedo() {
    let mean = 2.0 * (4.0 * std::f64::consts::PI).sqrt();
    agrees(middle(json!({}), [3, 4, 5], 1, |field| constant(field, &[mean])), 2.0, 2e-3);
    let scaled = |field: &mut LightField| {
        field.set_scale(1e6);
        constant(field, &[1e-6 * mean]);
    };
    agrees(middle(json!({}), [3, 4, 5], 1, scaled), 2.0, 4e-3);
}

/// Every basis function alone, with a phase function that has all bands: its factor times the
/// function at the direction from which straight light would come.
#[test]
fn bands_are_scattered_by_their_factors() {
    let g: f64 = 0.8;
    let material = json!({"phase": {"type": "henyey_greenstein", "g": g}});
    let mean = 4.0;
    let towards = sh::basis(sh::MAX_BANDS, DVec3::NEG_Z);
    for k in 0..36 {
        let bands = 6;
        let mut values = [0.0; 36];
        values[0] = mean;
        values[k] += 1.0;
        let l = (k as f64).sqrt() as i32;
        let expected = mean * towards[0] + g.powi(l) * towards[k];
        agrees(middle(material.clone(), [2, 2, 2], bands, |field| constant(field, &values)), expected, 4e-3);
    }
}

#[test]
fn what_is_not_known_does_not_darken() {
    let mean = (4.0 * std::f64::consts::PI).sqrt() as f32;
    let half = |field: &mut LightField| {
        let known = |i: usize| if i % 3 == 1 { 1.0 } else { 0.0 };
        let weights: Vec<f32> = (0..27).map(known).collect();
        field.write(&[weights.iter().map(|w| [w * mean; 3]).collect()], &weights);
    };
    agrees(middle(json!({}), [3, 3, 3], 1, half), 1.0, 2e-3);
    let none = |field: &mut LightField| field.write(&[vec![[0.0; 3]; 27]], &[0.0; 27]);
    agrees(middle(json!({}), [3, 3, 3], 1, none), 0.0, 0.0);
}

/// Trilinear between texel centres, held beyond the outermost ones.
#[test]
fn texels_are_interpolated_across_the_box() {
    let ramp = |field: &mut LightField| {
        let mean = (4.0 * std::f64::consts::PI).sqrt();
        let texel = |i: usize| [((i % 8) as f64 * mean) as f32; 3];
        field.write(&[(0..8).map(texel).collect()], &[1.0; 8]);
    };
    // Texels 3 and 4 of 8 meet in the middle of the box.
    agrees(middle(json!({}), [8, 1, 1], 1, ramp), 3.5, 5e-3);
}

#[test]
fn images_of_fields_do_not_bleed_between_tiles() {
    let steep = |field: &mut LightField| {
        let texels = field.dims.iter().product::<u32>() as usize;
        let mut coefficients = vec![vec![[1e4_f32; 3]; texels]; 4];
        coefficients[0] = vec![[0.0; 3]; texels];
        field.write(&coefficients, &vec![1.0; texels]);
    };
    // Isotropic matter sees the first coefficient alone.
    agrees(middle(json!({}), [1, 1, 1], 2, steep), 0.0, 0.0);
    agrees(middle(json!({}), [3, 2, 2], 2, steep), 0.0, 0.0);
}
