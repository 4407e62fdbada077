//! `tyndall doctor`.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use proto::SceneFile;
use proto::scene_file::{Builtin, VolumeSource};
use render::{AdapterPolicy, DrawRequest, Gpu, Renderer, View};
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot};

/// A frame slower than this is not fluent: 15 frames a second.
const FLUENT_MILLIS: f64 = 66.0;

#[derive(clap::Args)]
pub struct Arguments {}

pub fn run(_: &Arguments) -> anyhow::Result<()> {
    let gpu = match Gpu::open(AdapterPolicy::Any) {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("GPU: none. {error}");
            return Err(error.into());
        }
    };
    let info = gpu.info().clone();
    println!("GPU: {} ({})", info.name, info.driver);
    println!("kind: {}", if info.software { "software: runs on the processor" } else { "hardware" });
    for (name, value) in gpu.properties() {
        println!("{name}: {value}");
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    println!("processor: {cores} cores");

    // Draw a small standard scene: validates the shaders on this driver and gives its speed.
    let volume = scene::builtin::build(Builtin::Buckyball, [128; 3], &|_| {});
    let source = VolumeSource { builtin: Some(Builtin::Buckyball), ..VolumeSource::default() };
    let file = SceneFile { volume: source, ..scene::builtin::scene(Builtin::Buckyball)? };
    let scene = Scene::new(&file, Arc::new(PreparedVolume::new(volume, &|_| {})))?;
    let mut renderer = Renderer::new(gpu)?;
    let target = Target { width: 512, height: 512, samples_per_pixel: 1 };
    let mut millis = 0.0;
    // The first frame compiles and uploads.
    for epoch in 1..=2 {
        let snapshot = Arc::new(Snapshot { epoch, scene: scene.clone() });
        let mut view = View::new();
        let began = Instant::now();
        renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None })?;
        renderer.picture(&mut view)?;
        millis = began.elapsed().as_secs_f64() * 1e3;
    }
    println!("128^3 voxels at 512 x 512, shaded: {millis:.1} ms a frame");
    if info.software {
        println!(
            "advice: install the GPU's Vulkan driver if there is a GPU (NVIDIA: nvidia-driver with libvulkan1); while moving, pictures have a lower resolution until then"
        );
        if Path::new("/proc/driver/nvidia").exists() {
            println!(
                "advice: an NVIDIA kernel driver is loaded, but its Vulkan driver was not found: look for nvidia_icd.json under /usr/share/vulkan/icd.d"
            );
        }
    } else if millis > FLUENT_MILLIS {
        println!("advice: this is slow for a hardware GPU; check that nothing else uses it");
    } else {
        println!("all is well");
    }
    Ok(())
}
