//! Suite `skip`: what empty-space skipping saves, and that it changes nothing.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use proto::scene_file::Builtin;
use render::{AdapterPolicy, DrawRequest, Gpu, Radiance, Renderer, View};
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot};
use serde_json::json;

use super::report::{Table, bar_chart};

/// Voxels along each axis.
const EDGE: usize = 128;
/// Pixels along each axis, one sample each.
const IMAGE_EDGE: u32 = 512;

pub fn run(scenes: &[Builtin], out: &Path) -> anyhow::Result<()> {
    let gpu = Gpu::open(AdapterPolicy::Any)?;
    let about = json!({"device": gpu.info(), "volume": [EDGE, EDGE, EDGE], "image": [IMAGE_EDGE, IMAGE_EDGE], "samples_per_pixel": 1});
    let mut renderer = Renderer::new(gpu)?;
    let mut table = Table {
        name: "skip",
        about,
        columns: vec![
            "scene",
            "samples_on_lattice",
            "samples_taken",
            "samples_skipped",
            "fewer_samples_factor",
            "millis_plain",
            "millis_skipping",
            "speed_up",
            "bit_equal",
        ],
        rows: Vec::new(),
    };
    let mut bars = Vec::new();
    for &kind in scenes {
        let volume = scene::builtin::build(kind, [EDGE; 3], &|_| {});
        let scene =
            Scene::new(&scene::builtin::scene(kind)?, Arc::new(PreparedVolume::new(volume, &|_| {})))?;
        // Warm up: compile, upload.
        measure(&mut renderer, &scene, true)?;
        let plain = measure(&mut renderer, &scene, false)?;
        let skipping = measure(&mut renderer, &scene, true)?;
        let factor = plain.taken as f64 / skipping.taken.max(1) as f64;
        bars.push((kind.name().to_owned(), factor));
        table.rows.push(vec![
            json!(kind.name()),
            json!(skipping.on_lattice),
            json!(skipping.taken),
            json!(skipping.skipped),
            json!((factor * 100.0).round() / 100.0),
            json!(plain.millis.round()),
            json!(skipping.millis.round()),
            json!((plain.millis / skipping.millis * 100.0).round() / 100.0),
            json!(plain.radiance == skipping.radiance),
        ]);
    }
    table.write(out)?;
    bar_chart(&out.join("skip.svg"), "samples of the plain march / samples taken", &bars)
}

struct Measured {
    on_lattice: u64,
    taken: u64,
    skipped: u64,
    millis: f64,
    radiance: Radiance,
}

fn measure(renderer: &mut Renderer, scene: &Scene, skip_empty: bool) -> anyhow::Result<Measured> {
    let mut scene = scene.clone();
    scene.sampling.skip_empty = skip_empty;
    let snapshot = Arc::new(Snapshot { epoch: 1, scene });
    let target = Target { width: IMAGE_EDGE, height: IMAGE_EDGE, samples_per_pixel: 1 };
    let mut view = View::new();
    let began = Instant::now();
    let drawn = renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None })?;
    let millis = began.elapsed().as_secs_f64() * 1e3;
    let count = |name: &str| drawn.counters.get(name).copied().unwrap_or(0);
    Ok(Measured {
        on_lattice: count("samples_on_lattice"),
        taken: count("samples_taken"),
        skipped: count("samples_skipped"),
        millis,
        radiance: renderer.radiance(&view)?,
    })
}
