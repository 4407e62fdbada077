//! The scenes that show the built-in volumes and the carried scans.

use std::collections::BTreeSet;

use proto::SceneFile;
use proto::scene_file::{Builtin, Filter, Light};
use scene::builtin::scene as showcase;

#[test]
fn every_scene_is_valid_and_shows_its_own_volume() {
    for kind in Builtin::ALL {
        let scene = showcase(kind).unwrap_or_else(|error| panic!("{}: {error}", kind.name()));
        assert_eq!(scene.volume.builtin, Some(kind));
        assert!(scene.volume.dims.is_some());
        let labels = kind == Builtin::CornellBox;
        assert_eq!(scene.volume.filter == Filter::Nearest, labels);
        check_showcase(kind.name(), &scene);
    }
}

#[test]
fn the_scenes_of_the_carried_scans_are_valid() {
    let scans = [
        ("stent", include_str!("../../service/samples/stent.json")),
        ("avm", include_str!("../../service/samples/avm.json")),
    ];
    for (name, text) in scans {
        let scene = SceneFile::from_json(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(scene.volume.dataset.as_deref(), Some(name));
        check_showcase(name, &scene);
    }
}

/// What every showcase has: a fixed range of values, a key light beside a dim environment, a
/// camera that looks into the box from outside, and something to see.
fn check_showcase(name: &str, scene: &SceneFile) {
    assert!(scene.value_range.is_some(), "{name}");
    let environments = scene.lights.iter().filter(|l| matches!(l, Light::Environment(_))).count();
    assert!(environments == 1 && scene.lights.len() >= 2, "{name}");
    let ids: BTreeSet<_> = scene.lights.iter().filter_map(Light::id).collect();
    assert_eq!(ids.len(), scene.lights.len(), "{name}: lights have names of their own");
    let Some(camera) = &scene.camera else { panic!("{name}: no camera") };
    assert!(camera.target.iter().all(|c| c.abs() < 0.5), "{name}");
    assert!(camera.position.iter().any(|c| c.abs() > 0.5), "{name}");
    assert!(scene.transfer_function.points.iter().any(|p| p.sigma_t() > 0.0), "{name}");
    let again = serde_json::to_value(scene).map(SceneFile::from_value);
    assert_eq!(again.ok(), Some(Ok(scene.clone())), "{name}: written and read again");
}
