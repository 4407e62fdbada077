//! Times by the device's own clock.

use std::sync::Arc;
use std::time::Instant;

use proto::SceneFile;
use proto::scene_file::Builtin;
use render::{AdapterPolicy, DrawRequest, Gpu, Renderer, View};
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot};

#[test]
fn passes_are_timed_by_the_device_within_the_wall_time() {
    let gpu = Gpu::open(AdapterPolicy::Any).expect("tests need a device");
    let own_clock =
        gpu.properties().iter().any(|(name, how)| *name == "times of passes" && how == "by its own clock");
    let volume = scene::builtin::build(Builtin::Buckyball, [32; 3], &|_| {});
    let file: SceneFile = scene::builtin::scene(Builtin::Buckyball).unwrap();
    let scene = Scene::new(&file, Arc::new(PreparedVolume::new(volume, &|_| {}))).unwrap();
    let mut renderer = Renderer::new(gpu).unwrap();
    let mut millis = Vec::new();
    for edge in [64, 64, 256] {
        let snapshot = Arc::new(Snapshot { epoch: 1, scene: scene.clone() });
        let target = Target { width: edge, height: edge, samples_per_pixel: 2 };
        let began = Instant::now();
        let request = DrawRequest { snapshot: &snapshot, target, budget: None };
        let drawn = renderer.draw(&mut View::new(), &request).unwrap();
        let wall = began.elapsed().as_secs_f64() * 1e3;
        let cast = drawn.stages.iter().find(|stage| stage.stage == "ray_cast").unwrap();
        for other in drawn.stages.iter().filter(|stage| stage.stage != "ray_cast") {
            assert_eq!(other.device_millis, None, "{other:?}");
        }
        if !own_clock {
            eprintln!("this device has no clock: wall times alone");
            assert_eq!(cast.device_millis, None);
            continue;
        }
        let device = cast.device_millis.expect("a device time");
        assert!(device > 0.0 && device <= wall, "{device} of {wall} ms");
        millis.push(device);
    }
    eprintln!("64, 64 and 256 pixels along an edge: {millis:?} ms");
}
