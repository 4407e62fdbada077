//! One device per test binary, and scenes made of numbers.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used)]

use std::sync::{Arc, Mutex, MutexGuard, OnceLock};

use proto::SceneFile;
use render::{AdapterPolicy, DrawRequest, Drawn, Gpu, Radiance, Renderer, View};
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot, Volume, Voxels};

/// The shared renderer; a machine without any Vulkan device fails here.
pub fn renderer() -> MutexGuard<'static, Renderer> {
    static RENDERER: OnceLock<Mutex<Renderer>> = OnceLock::new();
    let renderer = RENDERER.get_or_init(|| {
        let gpu = Gpu::open(AdapterPolicy::Any).expect("a Vulkan device, hardware or software");
        Mutex::new(Renderer::new(gpu).expect("shaders compile"))
    });
    renderer.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

pub fn prepared(volume: Volume) -> Arc<PreparedVolume> {
    Arc::new(PreparedVolume::new(volume, &|_| {}))
}

/// Every voxel the same.
pub fn homogeneous(dims: [usize; 3]) -> Arc<PreparedVolume> {
    prepared(Volume::new(dims, Voxels::U8(vec![255; dims.iter().product()])))
}

/// A scene from a JSON object; `volume` and `version` are filled in.
pub fn scene_file(patch: serde_json::Value) -> SceneFile {
    let mut file = serde_json::json!({"version": 1, "volume": {"builtin": "homogeneous"}});
    json_merge(&mut file, patch);
    SceneFile::from_value(file).expect("a valid scene")
}

pub fn json_merge(base: &mut serde_json::Value, patch: serde_json::Value) {
    for (key, value) in patch.as_object().expect("an object") {
        base[key] = value.clone();
    }
}

pub fn snapshot(volume: &Arc<PreparedVolume>, patch: serde_json::Value, epoch: u32) -> Arc<Snapshot> {
    let scene = Scene::new(&scene_file(patch), volume.clone()).expect("a consistent scene");
    Arc::new(Snapshot { epoch, scene })
}

pub fn target(width: u32, height: u32, samples_per_pixel: u32) -> Target {
    Target { width, height, samples_per_pixel }
}

pub fn draw(renderer: &mut Renderer, view: &mut View, snapshot: &Arc<Snapshot>, target: Target) -> Drawn {
    let drawn = renderer.draw(view, &DrawRequest { snapshot, target, budget: None }).expect("draws");
    assert!(drawn.complete);
    drawn
}

/// Draws into a fresh view.
pub fn radiance(snapshot: &Arc<Snapshot>, target: Target) -> Radiance {
    let mut renderer = renderer();
    let mut view = View::new();
    draw(&mut renderer, &mut view, snapshot, target);
    renderer.radiance(&view).expect("reads back")
}
