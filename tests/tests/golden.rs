//! The showcase scenes look as they did. Volumes of 64^3, pictures of 96 x 72.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use proto::scene_file::Builtin;
use system_tests::{assert_golden, difference, draw, keep};

const SIZE: (u32, u32) = (96, 72);

#[test]
fn showcase_scenes_match_their_golden_images() {
    for kind in Builtin::ALL {
        let file = scene::builtin::scene(kind).unwrap();
        let volume = scene::builtin::build(kind, [64; 3], &|_| {});
        let (picture, radiance, _) = draw(&file, volume, SIZE, 2);
        assert!(radiance.rgb.iter().all(|x| x.is_finite() && *x >= 0.0), "{}", kind.name());
        keep(&picture, kind.name());
        assert_golden(&picture, kind.name());
    }
}

/// The comparison notices what an eye would.
#[test]
fn a_changed_picture_is_not_tolerated() {
    let kind = Builtin::Buckyball;
    let file = scene::builtin::scene(kind).unwrap();
    let volume = scene::builtin::build(kind, [64; 3], &|_| {});
    let (picture, ..) = draw(&file, volume.clone(), SIZE, 2);
    let changes: [&dyn Fn(&mut proto::SceneFile); 4] = [
        &|scene| scene.film.exposure_stops = 0.2,
        &|scene| scene.density *= 0.8,
        &|scene| drop(scene.lights.remove(0)),
        &|scene| scene.camera.as_mut().unwrap().position[0] += 0.03,
    ];
    for (index, change) in changes.iter().enumerate() {
        let mut changed = file.clone();
        change(&mut changed);
        let (other, ..) = draw(&changed, volume.clone(), SIZE, 2);
        let difference = difference(&picture.rgb(), &other.rgb());
        assert!(!difference.tolerable(), "change {index} went unnoticed: {difference:?}");
    }
}
