//! Suite `steps`: the error of the ray caster against the step length, and what it costs with and
//! without skipping; for the showcase scenes and for sharp transfer functions.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use proto::SceneFile;
use proto::scene_file::{Builtin, Interpolation};
use render::{AdapterPolicy, DrawRequest, Gpu, Renderer, View};
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot};
use serde_json::json;

use super::report::{Line, Table, columns, line_chart};

/// Voxels along each axis.
const EDGE: usize = 64;
/// Pixels along each axis.
const IMAGE_EDGE: u32 = 160;
/// Step of the image that counts as true, voxels.
const FINEST_STEP: f64 = 1.0 / 16.0;
/// Steps compared with it.
const STEPS: [f64; 5] = [0.125, 0.25, 0.5, 1.0, 2.0];
/// Samples per pixel: one, and the default at rest.
const SAMPLES: [u32; 2] = [1, 8];

pub fn run(scenes: &[Builtin], out: &Path) -> anyhow::Result<()> {
    let gpu = Gpu::open(AdapterPolicy::Any)?;
    let about = json!({
        "device": gpu.info(), "volume": [EDGE, EDGE, EDGE], "image": [IMAGE_EDGE, IMAGE_EDGE],
        "true_step_voxels": FINEST_STEP,
        "error": "mean absolute (or root mean square) difference from the image at the true step, same samples per pixel, over the same mean of that image"
    });
    let mut renderer = Renderer::new(gpu)?;
    let mut table = Table {
        name: "steps",
        about,
        columns: columns(&[
            "scene",
            "samples_per_pixel",
            "step_voxels",
            "mean_error_percent",
            "rms_error_percent",
            "sampler_against_exact_percent",
            "samples_taken",
            "millis_skipping",
            "millis_plain",
        ]),
        rows: Vec::new(),
    };
    let mut lines = Vec::new();
    for (name, file, kind) in cases(scenes)? {
        let volume = scene::builtin::build(kind, [EDGE; 3], &|_| {});
        let scene = Scene::new(&file, Arc::new(PreparedVolume::new(volume, &|_| {})))?;
        for samples in SAMPLES {
            let fine = image(&mut renderer, &with_step(&scene, FINEST_STEP), samples)?;
            let mut line = Line { label: format!("{name}, {samples} spp"), points: Vec::new() };
            for step in STEPS {
                let scene = with_step(&scene, step);
                let skipping = image(&mut renderer, &scene, samples)?;
                let mut plain = scene.clone();
                plain.sampling.skip_empty = false;
                let plain = image(&mut renderer, &plain, samples)?;
                let mut exact = scene.clone();
                exact.sampling.interpolation = Interpolation::Exact;
                let exact = image(&mut renderer, &exact, samples)?;
                let [mean, rms] = errors(&skipping.rgb, &fine.rgb);
                let [sampler, _] = errors(&skipping.rgb, &exact.rgb);
                line.points.push((step, mean));
                table.rows.push(vec![
                    json!(name),
                    json!(samples),
                    json!(step),
                    json!(rounded(mean)),
                    json!(rounded(rms)),
                    json!(rounded(sampler)),
                    json!(skipping.samples_taken),
                    json!(skipping.millis.round()),
                    json!(plain.millis.round()),
                ]);
            }
            lines.push(line);
        }
    }
    table.write(out)?;
    let path = out.join("steps.svg");
    line_chart(&path, "mean error against the step", "step, voxels", "mean error, per cent", &lines)
}

/// The showcase scenes, and two with a step, a thin peak and a two-coloured layer in the transfer
/// function, on fields that cross them steeply and gently.
fn cases(scenes: &[Builtin]) -> anyhow::Result<Vec<(String, SceneFile, Builtin)>> {
    let mut cases = Vec::new();
    for &kind in scenes {
        cases.push((kind.name().to_owned(), scene::builtin::scene(kind)?, kind));
    }
    for kind in [Builtin::MarschnerLobb, Builtin::SmokePlume] {
        let mut file = serde_json::to_value(scene::builtin::scene(kind)?)?;
        let blue = [0.2, 0.3, 0.9];
        let green = [0.2, 0.9, 0.3];
        file["transfer_function"] = json!({"points": [
            {"s": 0.0, "extinction": 0}, {"s": 0.49, "extinction": 0}, {"s": 0.5, "extinction": 300}, {"s": 0.51, "extinction": 0},
            {"s": 0.7, "extinction": 0}, {"s": 0.7, "extinction": 50, "albedo": blue},
            {"s": 0.72, "extinction": 50, "albedo": green}, {"s": 0.72, "extinction": 0}
        ]});
        cases.push((format!("{}_sharp", kind.name()), SceneFile::from_value(file)?, kind));
    }
    Ok(cases)
}

fn with_step(scene: &Scene, step_voxels: f64) -> Scene {
    let mut scene = scene.clone();
    scene.sampling.step_voxels = step_voxels;
    scene
}

struct Image {
    rgb: Vec<f32>,
    samples_taken: u64,
    millis: f64,
}

fn image(renderer: &mut Renderer, scene: &Scene, samples_per_pixel: u32) -> anyhow::Result<Image> {
    let snapshot = Arc::new(Snapshot { epoch: 1, scene: scene.clone() });
    let target = Target { width: IMAGE_EDGE, height: IMAGE_EDGE, samples_per_pixel };
    let mut view = View::new();
    let began = Instant::now();
    let drawn = renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None })?;
    let millis = began.elapsed().as_secs_f64() * 1e3;
    let samples_taken = drawn.counters.get("samples_taken").copied().unwrap_or(0);
    Ok(Image { rgb: renderer.radiance(&view)?.rgb, samples_taken, millis })
}

/// Mean absolute and root mean square difference over the same mean of `truth`, per cent.
fn errors(image: &[f32], truth: &[f32]) -> [f64; 2] {
    let sum = |f: &dyn Fn(f64, f64) -> f64| {
        image.iter().zip(truth).map(|(&a, &b)| f(f64::from(a), f64::from(b))).sum::<f64>()
    };
    let mean = sum(&|a, b| (a - b).abs()) / sum(&|_, b| b.abs()).max(f64::MIN_POSITIVE);
    let square = sum(&|a, b| (a - b).powi(2)) / sum(&|_, b| b * b).max(f64::MIN_POSITIVE);
    [100.0 * mean, 100.0 * square.sqrt()]
}

fn rounded(percent: f64) -> f64 {
    (percent * 1e4).round() / 1e4
}
