//! The heuristic on phantoms whose right answer is known.

use std::sync::Arc;

use scene::{Orientation, Scene, Volume, Voxels};

use super::*;

const EDGE: usize = 48;

/// Concentric balls in a cube: `value(r)` with r from 0 at the centre to 1 at the faces; the
/// noise is a fixed sequence in -1..1.
fn phantom(value: impl Fn(f64, f64) -> f64) -> PreparedVolume {
    let mut state = 1u32;
    let mut voxels = Vec::new();
    for index in 0..EDGE * EDGE * EDGE {
        let at = [index % EDGE, index / EDGE % EDGE, index / (EDGE * EDGE)];
        let offset = at.map(|i| (i as f64 + 0.5) / EDGE as f64 * 2.0 - 1.0);
        let radius = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(state >> 8) / f64::from(1 << 23) - 1.0;
        voxels.push(value(radius, noise) as i16);
    }
    PreparedVolume::new(Volume::new([EDGE; 3], Voxels::I16(voxels)), &|_| {})
}

fn source() -> VolumeSource {
    VolumeSource { dataset: Some("x".into()), ..VolumeSource::default() }
}

/// Extinction the default scene gives a data value.
fn extinction(scene: &SceneFile, value: f64) -> f64 {
    let [low, high] = scene.value_range.unwrap();
    let (function, _) = scene::TransferFunction::from_file(scene);
    function.at(((value - low) / (high - low)).clamp(0.0, 1.0)).sigma_t
}

fn checked(prepared: PreparedVolume) -> SceneFile {
    let scene = default_scene(&prepared, source());
    Scene::new(&scene, Arc::new(prepared)).unwrap();
    scene
}

/// Air, a body of soft tissue and a core of bone, in Hounsfield units.
fn ct(radius: f64, noise: f64) -> f64 {
    let base = match radius {
        r if r < 0.3 => 900.0,
        r if r < 0.8 => 40.0,
        _ => -1000.0,
    };
    base + 25.0 * noise
}

#[test]
fn air_is_transparent_tissue_translucent_bone_solid() {
    let scene = checked(phantom(ct));
    assert_eq!(extinction(&scene, -1000.0), 0.0);
    assert_eq!(extinction(&scene, -975.0), 0.0, "noise of the air is not seen");
    let tissue = extinction(&scene, 40.0);
    assert!((1.0..=BODY_EXTINCTION[1]).contains(&tissue), "{tissue}");
    assert!(extinction(&scene, 900.0) >= 0.5 * DENSE_EXTINCTION);
}

#[test]
fn padding_and_metal_change_nothing() {
    let plain = checked(phantom(ct));
    let disturbed = checked(phantom(|radius, noise| match radius {
        r if r > 1.2 => -3024.0,
        r if r < 0.03 => 30_000.0,
        r => ct(r, noise),
    }));
    for value in [-1000.0, -975.0, 40.0] {
        let (a, b) = (extinction(&plain, value), extinction(&disturbed, value));
        assert!((a - b).abs() <= 0.5 * a, "{value}: {a} {b}");
    }
    assert!(disturbed.value_range.unwrap()[1] < 2000.0, "metal does not eat the window");
}

#[test]
fn background_noise_of_a_magnetic_resonance_scan_is_transparent() {
    let scene = checked(phantom(|radius, noise| match radius {
        r if r < 0.9 => 400.0 + 300.0 * (5.0 * r).sin() + 20.0 * noise,
        _ => 15.0 + 15.0 * noise,
    }));
    assert_eq!(extinction(&scene, 15.0), 0.0);
    assert_eq!(extinction(&scene, 30.0), 0.0);
    assert!(extinction(&scene, 680.0) > 50.0);
}

#[test]
fn matter_that_fills_the_box_does_not_hide_everything() {
    // Soft tissue up to the faces, vessels brighter, no air at all.
    let scene = checked(phantom(|radius, noise| match radius {
        r if r < 0.35 => 350.0 + 10.0 * noise,
        _ => 40.0 + 15.0 * noise,
    }));
    assert_eq!(extinction(&scene, 25.0), 0.0);
    assert!(extinction(&scene, 350.0) > 20.0);
}

#[test]
fn matter_below_its_surroundings_is_seen_too() {
    // A simulation: constant surroundings of the highest value, structure below it.
    let scene = checked(phantom(|radius, _| match radius {
        r if r < 0.8 => 200.0 * r,
        _ => 255.0,
    }));
    assert_eq!(extinction(&scene, 255.0), 0.0);
    assert!(extinction(&scene, 10.0) >= 0.5 * DENSE_EXTINCTION);
    let between = extinction(&scene, 85.0);
    assert!(between > 0.0 && between < DENSE_EXTINCTION, "{between}");
}

#[test]
fn labels_get_a_color_each_and_no_blending() {
    let scene = checked(phantom(|radius, _| match radius {
        r if r < 0.3 => 2.0,
        r if r < 0.7 => 1.0,
        _ => 0.0,
    }));
    assert_eq!(scene.volume.filter, Filter::Nearest);
    assert_eq!(extinction(&scene, 0.0), 0.0);
    assert_eq!(extinction(&scene, 1.0), DENSE_EXTINCTION);
    assert_eq!(extinction(&scene, 2.0), DENSE_EXTINCTION);
    let (function, _) = scene::TransferFunction::from_file(&scene);
    let albedo = |label: f64| {
        let [low, high] = scene.value_range.unwrap();
        function.at((label - low) / (high - low)).albedo
    };
    assert!((albedo(1.0) - albedo(2.0)).length() > 0.3);
}

#[test]
fn sixty_labels_are_told_apart_and_the_first_is_transparent() {
    let cell = |i: usize| [i % 40 / 10, i / 40 % 40 / 10, i / 1600 / 10];
    let label = |[x, y, z]: [usize; 3]| ((x + 4 * y + 16 * z) * 29 % 61) as u8;
    let voxels = Voxels::U8((0..64_000).map(|i| label(cell(i))).collect());
    let scene = checked(PreparedVolume::new(Volume::new([40; 3], voxels), &|_| {}));
    assert_eq!(scene.volume.filter, Filter::Nearest);
    assert_eq!(extinction(&scene, 0.0), 0.0);
    assert_eq!(scene.transfer_function.points.len(), 2 * 61);
    for value in 1..61 {
        assert_eq!(extinction(&scene, f64::from(value)), DENSE_EXTINCTION);
    }
    let srgb = |x: f64| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    let colors: Vec<[f64; 3]> = (0..MAX_LABELS).map(|number| label_color(number).map(srgb)).collect();
    for (number, a) in colors.iter().enumerate() {
        assert!(a.iter().all(|x| (0.0..=1.0).contains(x)), "{number}: {a:?}");
        for b in &colors[..number] {
            let apart = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            assert!(apart > 0.06, "{number}: {a:?} {b:?}");
        }
    }
}

#[test]
fn a_label_has_its_colour_whatever_others_there_are() {
    let color_of = |labels: &[u8], label: u8| {
        let voxels = Voxels::U8((0..1000).map(|i| labels[i * labels.len() / 1000]).collect());
        let scene = checked(PreparedVolume::new(Volume::new([10; 3], voxels), &|_| {}));
        let [low, high] = scene.value_range.unwrap();
        let (function, _) = scene::TransferFunction::from_file(&scene);
        function.at((f64::from(label) - low) / (high - low)).albedo
    };
    assert_eq!(color_of(&[0, 1, 5], 5), color_of(&[0, 2, 3, 5, 9], 5));
}

#[test]
fn degenerate_volumes_open_too() {
    checked(phantom(|_, _| 7.0));
    checked(phantom(|radius, _| if radius < 0.1 { 1.0 } else { 0.0 }));
    let one = Volume::new([1, 1, 1], Voxels::F32(vec![0.5]));
    checked(PreparedVolume::new(one, &|_| {}));
    let ramp = Volume::new([256, 1, 1], Voxels::F32((0..256).map(|i| i as f32).collect()));
    checked(PreparedVolume::new(ramp, &|_| {}));
}

#[test]
fn the_matter_fills_the_picture_in_every_orientation() {
    let mut prepared = phantom(|radius, noise| ct(radius * 2.0, noise));
    for anatomical in [false, true] {
        prepared.volume.orientation = anatomical.then_some(Orientation {
            lps_from_grid: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            origin: [0.0; 3],
        });
        let scene = default_scene(&prepared, source());
        let camera = scene.camera.unwrap();
        let offset: Vec<f64> = (0..3).map(|i| camera.position[i] - camera.target[i]).collect();
        let distance = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
        // The ball of matter spans 0.4 of the box, the macrocells around it at most 0.67.
        assert!((0.9..2.0).contains(&distance), "{distance}");
        let expected_up = if anatomical { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] };
        assert_eq!(camera.up, expected_up);
        assert!(!anatomical || offset[1] < 0.0, "from the front");
    }
}
