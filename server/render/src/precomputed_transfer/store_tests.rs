//! Bakes that were made before, by others, or in part.

use std::fs;
use std::path::Path;
use std::sync::{Arc, MutexGuard};
use std::time::Duration;

use scene::{PreparedVolume, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

use super::buffers::batch_of;
use super::key::key;
use super::layout::Layout;
use super::mass::Mass;
use super::store::BakeStore;
use super::tests::{TARGET, image_of, snapshot};
use crate::test_support::{Folder, balls, renderer};
use crate::{DrawRequest, Drawn, Renderer, View};

/// A renderer that keeps its bakes in a folder; no other test draws meanwhile.
struct Keeper {
    renderer: Renderer,
    _alone: MutexGuard<'static, Renderer>,
}

impl Keeper {
    fn new(folder: &Path) -> Self {
        let alone = renderer();
        let mut renderer = Renderer::new(alone.gpu().clone()).unwrap();
        let store = BakeStore::with_checkpoints(folder, 1 << 30, Duration::ZERO).unwrap();
        renderer.keep_bakes(Some(Arc::new(store)));
        Self { renderer, _alone: alone }
    }

    fn draw(&mut self, view: &mut View, snapshot: &Arc<Snapshot>, budget: Option<Duration>) -> Drawn {
        self.renderer.draw(view, &DrawRequest { snapshot, target: TARGET, budget }).unwrap()
    }

    fn whole(&mut self, snapshot: &Arc<Snapshot>) -> (Drawn, Vec<f32>) {
        let mut view = View::new();
        let drawn = self.draw(&mut view, snapshot, None);
        assert!(drawn.complete);
        let rgb = self.renderer.radiance(&view).unwrap().rgb;
        (drawn, rgb)
    }
}

/// A scene whose bake takes several batches of photons.
fn scene() -> Arc<Snapshot> {
    let photons = 4 * batch_of(renderer().gpu());
    snapshot(&balls(20), &[json!({"illumination": {"transfer_photons": photons}})], 0, 1)
}

fn the_file(folder: &Path) -> std::path::PathBuf {
    let mut files = fs::read_dir(folder).unwrap();
    let file = files.next().expect("a file").unwrap().path();
    assert!(files.next().is_none() && file.extension().unwrap() == "bake");
    file
}

#[test]
fn bakes_go_on_where_they_were_and_are_made_once() {
    let folder = Folder::new();
    let scene = scene();
    let expected = image_of(&scene);
    let mut first = Keeper::new(folder.path());
    let mut view = View::new();
    let [mut stored, mut photons, mut rays] = [0; 3];
    while stored < 2 || photons == 0 || rays < 10_000 {
        let drawn = first.draw(&mut view, &scene, Some(Duration::from_millis(1)));
        assert!(!drawn.complete, "it is given up in the middle");
        stored += drawn.counters["bakes_stored"];
        photons += drawn.counters["transfer_photons_traced"];
        rays += drawn.counters["transfer_rays_marched"];
    }
    drop((view, first));
    let half = fs::read(the_file(folder.path())).unwrap();

    let mut second = Keeper::new(folder.path());
    let (drawn, rgb) = second.whole(&scene);
    let all_photons = u64::from(scene.scene.illumination.transfer_photons);
    assert_eq!((drawn.counters["bakes_loaded"], rgb == expected), (1, true));
    assert!((1..all_photons).contains(&drawn.counters["transfer_photons_traced"]), "{:?}", drawn.counters);
    assert!(drawn.counters["bakes_stored"] > 0);
    // Another session of the same process.
    let (drawn, rgb) = second.whole(&scene);
    let work = |drawn: &Drawn| {
        ["bakes_loaded", "bakes_stored", "transfer_photons_traced", "transfer_rays_marched"]
            .map(|name| drawn.counters[name])
    };
    assert_eq!((work(&drawn), rgb == expected), ([1, 0, 0, 0], true));
    drop(second);
    assert_ne!(fs::read(the_file(folder.path())).unwrap(), half, "what is finished replaces what was not");

    // Slices read as well.
    let mut third = Keeper::new(folder.path());
    let mut view = View::new();
    let mut loaded = 0;
    loop {
        let drawn = third.draw(&mut view, &scene, Some(Duration::from_millis(1)));
        loaded += drawn.counters.get("bakes_loaded").copied().unwrap_or(0);
        assert!(drawn.counters.get("transfer_photons_traced").is_none_or(|&count| count == 0));
        if drawn.complete {
            break;
        }
    }
    assert_eq!((loaded, third.renderer.radiance(&view).unwrap().rgb == expected), (1, true));
    // Other matter: another bake.
    let other =
        json!({"transfer_function": {"points": [{"s": 0.3, "extinction": 0}, {"s": 1, "extinction": 9}]}});
    let (drawn, _) = third.whole(&snapshot(&balls(20), &[other], 0, 2));
    assert_eq!(drawn.counters["bakes_loaded"], 0);
    assert!(drawn.counters["transfer_photons_traced"] > 0);
}

/// Slices of sessions in turn, until all have their bake; photons traced and bakes read by each.
fn in_turn(keeper: &mut Keeper, views: &mut [View], scene: &Arc<Snapshot>) -> Vec<[u64; 2]> {
    let mut work = vec![[0; 2]; views.len()];
    let mut complete = vec![false; views.len()];
    while complete.contains(&false) {
        for ((view, work), complete) in views.iter_mut().zip(&mut work).zip(&mut complete) {
            let drawn = keeper.draw(view, scene, Some(Duration::from_millis(1)));
            let of_bake = |name: &str| drawn.counters.get(name).copied().unwrap_or(0);
            work[0] += of_bake("transfer_photons_traced");
            work[1] += of_bake("bakes_loaded");
            *complete = drawn.complete;
        }
    }
    work
}

#[test]
fn sessions_that_begin_together_make_one_bake() {
    let folder = Folder::new();
    let scene = scene();
    let expected = image_of(&scene);
    let all_photons = u64::from(scene.scene.illumination.transfer_photons);
    let mut keeper = Keeper::new(folder.path());
    let mut views = [View::new(), View::new(), View::new()];
    let work = in_turn(&mut keeper, &mut views, &scene);
    assert_eq!(work, [[all_photons, 0], [0, 1], [0, 1]]);
    for view in &views {
        assert!(keeper.renderer.radiance(view).unwrap().rgb == expected);
    }
}

#[test]
fn a_bake_that_is_left_in_the_middle_is_taken_over() {
    let folder = Folder::new();
    let scene = scene();
    let expected = image_of(&scene);
    let all_photons = u64::from(scene.scene.illumination.transfer_photons);
    let mut keeper = Keeper::new(folder.path());
    let (mut first, mut second) = (View::new(), View::new());
    let mut photons = 0;
    while photons == 0 {
        photons += keeper.draw(&mut first, &scene, Some(Duration::from_millis(1))).counters["transfer_photons_traced"];
        let waiting = keeper.draw(&mut second, &scene, Some(Duration::from_millis(1)));
        assert_eq!(waiting.counters["transfer_photons_traced"], 0);
    }
    drop(first);
    let work = in_turn(&mut keeper, std::slice::from_mut(&mut second), &scene);
    assert!((1..=all_photons).contains(&work[0][0]), "{work:?}");
    assert!(keeper.renderer.radiance(&second).unwrap().rgb == expected);
}

#[test]
fn what_is_corrupt_is_made_anew() {
    let folder = Folder::new();
    let scene = snapshot(&balls(20), &[], 0, 1);
    let mut keeper = Keeper::new(folder.path());
    let (_, expected) = keeper.whole(&scene);
    drop(keeper);
    let path = the_file(folder.path());
    let sound = fs::read(&path).unwrap();
    let mut flipped = sound.clone();
    *flipped.last_mut().unwrap() ^= 0x40;
    let mut brighter = sound.clone();
    let middle = sound.len() / 2;
    brighter[middle..middle + 4].copy_from_slice(&1e9_f32.to_le_bytes());
    for harmed in [flipped, brighter, sound[..middle].to_vec(), Vec::new()] {
        fs::write(&path, harmed).unwrap();
        let mut keeper = Keeper::new(folder.path());
        let (drawn, rgb) = keeper.whole(&scene);
        assert_eq!((drawn.counters["bakes_loaded"], rgb == expected), (0, true));
        drop(keeper);
        assert!(fs::read(&path).unwrap() == sound, "made anew");
    }
}

#[test]
fn keys_tell_apart_what_bakes_follow_from_and_nothing_else() {
    let gpu = renderer().gpu().clone();
    let material = |g: f64| {
        json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": g}}},
        "transfer_function": {"points": [{"s": 0, "extinction": 1, "material": "m"}]}})
    };
    let matter = |s: f64, extinction: f64, albedo: f64, emission: f64| {
        json!({"transfer_function": {"points": [{"s": 0, "extinction": 1},
            {"s": s, "extinction": extinction, "albedo": [0.5, albedo, 0.5], "emission": [emission, 0, 0]}]}})
    };
    let volume = balls(16);
    let of = |patch: Value, volume: &Arc<PreparedVolume>, tables: u8| {
        let scene = &snapshot(volume, &[patch], 0, 1).scene;
        let mass = Mass { dims: [4; 3], rows: vec![(1, glam::Vec4::splat(0.5))], largest: 0.5 };
        key(&gpu, scene, &Layout::of(scene), &mass, &[tables; 32])
    };
    let mut bright = vec![0; 16 * 16 * 16];
    bright[77] = 200;
    let other = Arc::new(PreparedVolume::new(Volume::new([16; 3], Voxels::U8(bright)), &|_| {}));
    let mut keys = vec![
        of(json!({}), &volume, 0),
        of(json!({}), &volume, 1),
        of(json!({"value_range": [0, 255]}), &other, 0),
        of(json!({"value_range": [0, 200]}), &other, 0),
        of(json!({"spacing": [1, 1, 2]}), &volume, 0),
        of(json!({"volume": {"filter": "nearest"}}), &volume, 0),
        of(json!({"density": 2}), &volume, 0),
        of(json!({"scattering": {"orders": 3}}), &volume, 0),
        of(json!({"clip": {"box": [[0, 0, 0], [1, 0.5, 1]]}}), &volume, 0),
        of(json!({"clip": {"box": [[0, 0, 0], [1, 0.5, 1]], "shadows": false}}), &volume, 0),
        of(json!({"clip": {"planes": [{"normal": [0, 1, 0], "offset": 0}]}}), &volume, 0),
        of(material(0.5), &volume, 0),
        of(material(0.6), &volume, 0),
        of(matter(0.5, 3.0, 0.5, 0.0), &volume, 0),
        of(matter(0.6, 3.0, 0.5, 0.0), &volume, 0),
        of(matter(0.5, 4.0, 0.5, 0.0), &volume, 0),
        of(matter(0.5, 3.0, 0.6, 0.0), &volume, 0),
    ];
    for (name, value) in [
        ("transfer_lights", 162),
        ("transfer_grid", 17),
        ("transfer_directions", 192),
        ("transfer_photons", 16385),
        ("transfer_events", 31),
    ] {
        keys.push(of(json!({"illumination": {name: value}}), &volume, 0));
    }
    let mut apart = keys.clone();
    apart.sort();
    apart.dedup();
    assert_eq!(apart.len(), keys.len());
    for same in [
        json!({"lights": []}),
        json!({"camera": {"position": [3, 0, 0]}}),
        json!({"background": [1, 1, 1]}),
        json!({"film": {"exposure_stops": 1}}),
        json!({"sampling": {"skip_empty": false}}),
    ] {
        assert_eq!(of(same.clone(), &volume, 0), keys[0], "{same}");
    }
    assert_eq!(of(matter(0.5, 3.0, 0.5, 0.7), &volume, 0), of(matter(0.5, 3.0, 0.5, 0.0), &volume, 0));
}
