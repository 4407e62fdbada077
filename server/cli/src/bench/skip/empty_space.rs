//! What empty-space skipping saves, that it changes nothing, and what an edit of the transfer function
//! costs (a distance map) against scanning the voxels again (macrocells).

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use proto::scene_file::Builtin;
use render::{AdapterPolicy, DrawRequest, Gpu, Radiance, Renderer, View};
use scene::distance::distance_map;
use scene::macrocells::Macrocells;
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot};
use serde_json::json;

use crate::bench::report::{Table, bar_chart, columns};

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
        columns: columns(&[
            "scene",
            "samples_on_lattice",
            "samples_taken",
            "samples_skipped",
            "fewer_samples_factor",
            "millis_plain",
            "millis_skipping",
            "speed_up",
            "bit_equal",
            "macrocells_millis",
            "distance_map_millis",
        ]),
        rows: Vec::new(),
    };
    let mut bars = Vec::new();
    for &kind in scenes {
        let volume = scene::builtin::build(kind, [EDGE; 3], &|_| {});
        let prepared = PreparedVolume::new(volume, &|_| {});
        let (_, macrocells_millis) = timed(|| Macrocells::of(&prepared.volume, &prepared.bins, &|_| {}));
        let scene = Scene::new(&scene::builtin::scene(kind)?, Arc::new(prepared))?;
        let cells = &scene.volume.macrocells;
        let matter = scene.bins_with_matter();
        let (_, distance_map_millis) = timed(|| distance_map(cells.dims, cells.masks(scene.filter), matter));
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
            json!((macrocells_millis * 100.0).round() / 100.0),
            json!((distance_map_millis * 100.0).round() / 100.0),
        ]);
    }
    table.write(out)?;
    bar_chart(&out.join("skip.svg"), "samples of the plain march / samples taken", &bars)
}

/// Of a few runs, the quickest.
fn timed<T>(run: impl Fn() -> T) -> (T, f64) {
    const RUNS: usize = 5;
    let mut best = f64::INFINITY;
    let mut once = || {
        let began = Instant::now();
        let value = run();
        best = best.min(began.elapsed().as_secs_f64() * 1e3);
        value
    };
    (1..RUNS).for_each(|_| drop(once()));
    let value = once();
    (value, best)
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
