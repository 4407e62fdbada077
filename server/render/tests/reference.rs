//! Pictures of method `local` against the independent reference, restricted to what `local` means.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;

use common::{prepared, radiance, target};
use proto::SceneFile;
use proto::scene_file::{Builtin, Interpolation};
use reference::statistics::{Difference, difference};
use reference::{Pixel, Progress, Request, Transport};
use scene::{Scene, Snapshot};

/// Pixels of a picture. Both sides draw the ray through each pixel's centre: no noise.
const SIZE: [u32; 2] = [40, 30];

/// The ray caster's step.
const STEP_VOXELS: f64 = 0.125;

/// The scene of a built-in volume, sampled finely.
fn file(kind: Builtin) -> SceneFile {
    let mut file = scene::builtin::scene(kind).unwrap();
    file.sampling.step_voxels = STEP_VOXELS;
    file.sampling.termination_transmittance = 0.0;
    file.sampling.interpolation = Interpolation::Exact;
    file
}

fn scene(kind: Builtin, file: &SceneFile) -> Scene {
    let volume = prepared(scene::builtin::build(kind, [40; 3], &|_| {}));
    Scene::new(file, volume).unwrap()
}

/// How far the picture of `drawn` is from the reference's of `judged`.
fn compare(drawn: Scene, judged: &Scene) -> Difference {
    let [width, height] = SIZE;
    let snapshot = Arc::new(Snapshot { epoch: 1, scene: drawn });
    let image = radiance(&snapshot, target(width, height, 1));
    let picture: Vec<[f64; 3]> = image.rgb.as_chunks::<3>().0.iter().map(|p| p.map(f64::from)).collect();
    let request =
        Request { transport: Transport::Local, pixel: Pixel::Center, ..Request::new(width, height, 2) };
    let truth = reference::render(judged, &request, &Progress::default()).unwrap();
    let exact = vec![[0.0; 3]; picture.len()];
    difference(&picture, &exact, &truth.mean, &truth.standard_error)
}

/// Built-in scenes, and about twice the relative L2 difference seen on a software device. It comes
/// from the ray caster's steps: with half of them, shells are half as far off, smooth matter a
/// quarter. Labels have sharp edges: a few pixels whose rays graze one make nearly all of their
/// difference, and which ones do depends on the picture's size.
const TOLERANCES: [(Builtin, f64); 6] = [
    (Builtin::Homogeneous, 1e-5),
    (Builtin::ThickBlob, 1e-4),
    (Builtin::SmokePlume, 1.2e-3),
    (Builtin::NestedShells, 0.009),
    (Builtin::Buckyball, 0.017),
    (Builtin::CornellBox, 0.05),
];

#[test]
fn local_agrees_with_the_reference() {
    for (kind, tolerance) in TOLERANCES {
        let file = file(kind);
        let found = compare(scene(kind, &file), &scene(kind, &file));
        eprintln!("{}: relative L2 {:.2e}, bias {:.2e}", kind.name(), found.relative_l2, found.bias);
        assert!(found.relative_l2 < tolerance, "{}: {found:?}", kind.name());
    }
}

#[test]
fn a_different_scene_is_noticed() {
    let kind = Builtin::Buckyball;
    let right = file(kind);
    let mut denser = right.clone();
    denser.density *= 1.1;
    let found = compare(scene(kind, &denser), &scene(kind, &right));
    assert!(found.relative_l2 > 0.02, "{found:?}");
}
