//! Suite `load`: many viewers of one service at once, each turning its own camera; how evenly they
//! are served, and what a viewer whose picture takes minutes costs the others.

use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use proto::SceneFile;
use proto::scene_file::{Builtin, Method, VolumeSource};
use serde_json::{Value, json};

use super::report::{Table, bar_chart, columns};
use super::served::Served;
use super::stream::{Measured, orbiting, percentile};

/// Viewers at once.
const VIEWERS: [usize; 4] = [1, 4, 8, 16];
/// How long each case is measured, after a warm-up of a quarter of it.
const MEASURED: Duration = Duration::from_secs(16);
/// Pixels of each viewer's picture.
const SIZE: (u32, u32) = (512, 512);
/// Voxels along an edge of the volume.
const EDGE: u32 = 64;
/// Paths per pixel of the long job: more than it can follow meanwhile.
const LONG_PATHS: u32 = 65_536;
/// Viewers beside the long job.
const BESIDE: usize = 2;

pub fn run(out: &Path) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(measure_all(out))
}

async fn measure_all(out: &Path) -> anyhow::Result<()> {
    let load_before = load_average();
    let served = Served::open().await?;
    let volume =
        VolumeSource { builtin: Some(Builtin::Buckyball), dims: Some([EDGE; 3]), ..VolumeSource::default() };
    let scene = SceneFile { volume, ..scene::builtin::scene(Builtin::Buckyball)? };
    let about = json!({
        "device": served.device,
        "seconds": MEASURED.as_secs_f64(),
        "inputs_per_second_and_viewer": 60,
        "volume": format!("buckyball, {EDGE} voxels along an edge"),
        "size": [SIZE.0, SIZE.1],
    });
    let mut table = Table {
        name: "load",
        about,
        columns: columns(&[
            "case",
            "viewers",
            "frames_per_second_all",
            "frames_per_second_worst",
            "frames_per_second_best",
            "worst_over_best",
            "latency_p50_ms",
            "latency_p95_ms",
            "pixels_drawn_share",
            "volume_bytes_on_gpu",
        ]),
        rows: Vec::new(),
    };
    let mut bars = Vec::new();
    for viewers in VIEWERS {
        let measured = together(&served, &scene, viewers).await.context("viewers alone")?;
        table.rows.push(row("alone", &measured, served.volume_bytes()));
        bars.push((format!("{viewers} viewers"), all_frames_per_second(&measured)));
    }
    // The long job: a picture at rest that is not finished meanwhile.
    let mut long = scene.clone();
    long.illumination.method = Method::PathTraced;
    long.illumination.paths_per_pixel = LONG_PATHS;
    for beside in [false, true] {
        let mut job = None;
        if beside {
            let session = served.session(&long).await?;
            let mut viewer = served.viewer(&session, SIZE).await?;
            job = Some(tokio::spawn(async move { viewer.frames_within(2 * MEASURED).await }));
        }
        let measured = together(&served, &scene, BESIDE).await.context("viewers beside a long job")?;
        let case = if beside { "beside a long job" } else { "without the long job" };
        table.rows.push(row(case, &measured, served.volume_bytes()));
        if let Some(job) = job {
            job.abort();
        }
    }
    served.close().await?;
    // How busy the machine was, with other work too: it decides what the figures are worth.
    table.about["load_average"] = json!([load_before, load_average()]);
    table.write(out)?;
    bar_chart(&out.join("load.svg"), "frames per second of all viewers together", &bars)
}

/// The system's load average over a minute; `None` where it does not tell.
fn load_average() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    text.split_whitespace().next()?.parse().ok()
}

/// So many viewers at once, each with a session of its own on the same volume.
async fn together(served: &Served, scene: &SceneFile, viewers: usize) -> anyhow::Result<Vec<Measured>> {
    let mut orbits = Vec::new();
    for _ in 0..viewers {
        let session = served.session(scene).await?;
        orbits.push(orbiting(served.viewer(&session, SIZE).await?, scene, SIZE, MEASURED));
    }
    futures_util::future::try_join_all(orbits).await
}

fn frames_per_second(measured: &Measured) -> f64 {
    measured.frames as f64 / measured.seconds
}

fn all_frames_per_second(measured: &[Measured]) -> f64 {
    measured.iter().map(frames_per_second).sum()
}

fn row(case: &str, measured: &[Measured], volume_bytes: u64) -> Vec<Value> {
    let round = |x: f64| json!((x * 100.0).round() / 100.0);
    let rates = measured.iter().map(frames_per_second);
    let worst = rates.clone().fold(f64::INFINITY, f64::min);
    let best = rates.fold(0.0, f64::max);
    let latencies: Vec<f64> = measured.iter().flat_map(|one| one.latencies.iter().copied()).collect();
    let resolution = measured.iter().map(|one| one.resolution).sum::<f64>() / measured.len() as f64;
    vec![
        json!(case),
        json!(measured.len()),
        round(all_frames_per_second(measured)),
        round(worst),
        round(best),
        round(worst / best),
        round(percentile(&latencies, 0.5)),
        round(percentile(&latencies, 0.95)),
        round(resolution),
        json!(volume_bytes),
    ]
}
