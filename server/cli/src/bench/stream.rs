//! Suite `stream`: frames per second, input-to-frame latency and bytes per frame of a viewer on a
//! real socket, while its camera orbits.

use std::collections::VecDeque;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use proto::scene_file::{Builtin, Camera, VolumeSource};
use proto::{ClientMessage, SceneFile};
use serde_json::json;

use super::report::{Table, bar_chart, columns};
use super::served::{Event, Frame, Served, Viewer};

/// How long each case is measured, after a warm-up of a quarter of it.
const MEASURED: Duration = Duration::from_secs(8);
/// Time between two camera inputs: a mouse at 60 Hz.
const INPUT_INTERVAL: Duration = Duration::from_micros(16_667);
/// Turn of the camera between two inputs, radians.
const TURN: f64 = 0.02;

struct Case {
    name: &'static str,
    scene: SceneFile,
    size: (u32, u32),
}

/// What a viewer got.
#[derive(Default)]
pub(super) struct Measured {
    pub frames: usize,
    pub seconds: f64,
    /// Milliseconds from sending an input to having a frame that shows it, or a newer one.
    pub latencies: Vec<f64>,
    pub bytes: u64,
    /// Mean share of the viewport's pixels that was drawn.
    pub resolution: f64,
    /// Mean milliseconds: waiting for its turn, drawing, encoding.
    pub stages: [f64; 3],
}

pub fn run(out: &Path) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(measure_all(out))
}

fn cases() -> anyhow::Result<Vec<Case>> {
    let volume = |builtin, edge: u32| VolumeSource {
        builtin: Some(builtin),
        dims: Some([edge; 3]),
        ..VolumeSource::default()
    };
    // Nothing to see: what the service itself costs.
    let mut trivial = SceneFile::new(volume(Builtin::Homogeneous, 8));
    trivial.transfer_function.points.truncate(1);
    let buckyball = scene::builtin::scene(Builtin::Buckyball)?;
    Ok(vec![
        Case { name: "trivial_1280x720", scene: trivial, size: (1280, 720) },
        Case {
            name: "buckyball_128_512x512",
            scene: SceneFile { volume: volume(Builtin::Buckyball, 128), ..buckyball },
            size: (512, 512),
        },
    ])
}

async fn measure_all(out: &Path) -> anyhow::Result<()> {
    let served = Served::open().await?;
    let mut table = Table {
        name: "stream",
        about: json!({"device": served.device, "seconds": MEASURED.as_secs_f64(), "inputs_per_second": 60}),
        columns: columns(&[
            "case",
            "frames_per_second",
            "latency_p50_ms",
            "latency_p95_ms",
            "bytes_per_frame",
            "pixels_drawn_share",
            "queue_ms",
            "draw_ms",
            "encode_ms",
        ]),
        rows: Vec::new(),
    };
    let mut bars = Vec::new();
    for case in cases()? {
        let measured = measure(&served, &case).await.with_context(|| case.name)?;
        let round = |x: f64| json!((x * 10.0).round() / 10.0);
        let frames_per_second = measured.frames as f64 / measured.seconds;
        bars.push((case.name.to_owned(), frames_per_second));
        table.rows.push(vec![
            json!(case.name),
            round(frames_per_second),
            round(percentile(&measured.latencies, 0.5)),
            round(percentile(&measured.latencies, 0.95)),
            json!(measured.bytes / measured.frames.max(1) as u64),
            json!((measured.resolution * 1000.0).round() / 1000.0),
            round(measured.stages[0]),
            round(measured.stages[1]),
            round(measured.stages[2]),
        ]);
    }
    served.close().await?;
    table.write(out)?;
    bar_chart(&out.join("stream.svg"), "frames per second while the camera orbits", &bars)
}

/// A session over HTTP as any client makes it, then a viewer that orbits.
async fn measure(served: &Served, case: &Case) -> anyhow::Result<Measured> {
    let session = served.session(&case.scene).await?;
    let viewer = served.viewer(&session, case.size).await?;
    orbiting(viewer, &case.scene, case.size, MEASURED).await
}

/// What a viewer gets that turns its camera sixty times a second for a time, after a warm-up of a
/// quarter of it.
///
/// # Errors
/// The connection breaks.
pub(super) async fn orbiting(
    mut viewer: Viewer,
    scene: &SceneFile,
    (width, height): (u32, u32),
    time: Duration,
) -> anyhow::Result<Measured> {
    let mut ticks = tokio::time::interval(INPUT_INTERVAL);
    let (mut seq, mut angle) = (1u32, 0.0f64);
    let mut sent: VecDeque<(u32, Instant)> = VecDeque::new();
    let warm_up = time / 4;
    let began = Instant::now();
    let mut measured = Measured { seconds: time.as_secs_f64(), ..Measured::default() };
    while began.elapsed() < warm_up + time {
        tokio::select! {
            _ = ticks.tick() => {
                seq += 1;
                angle += TURN;
                sent.push_back((seq, Instant::now()));
                viewer.send(&ClientMessage::Camera { seq, camera: orbit(scene, angle) }).await?;
            }
            event = viewer.event() => {
                let Event::Frame(Frame { header, bytes, .. }) = event? else { continue };
                viewer.acknowledge(&header).await?;
                let counted = began.elapsed() >= warm_up;
                while sent.front().is_some_and(|(number, _)| *number <= header.seq) {
                    let Some((_, at)) = sent.pop_front() else { break };
                    if counted {
                        measured.latencies.push(at.elapsed().as_secs_f64() * 1e3);
                    }
                }
                if counted {
                    measured.frames += 1;
                    let micros = [header.queue_micros, header.render_micros, header.encode_micros];
                    measured.stages.iter_mut().zip(micros).for_each(|(sum, t)| *sum += f64::from(t) / 1e3);
                    measured.bytes += bytes as u64;
                    let drawn = f64::from(header.width) * f64::from(header.height);
                    measured.resolution += drawn / (f64::from(width) * f64::from(height));
                }
            }
        }
    }
    measured.resolution /= measured.frames.max(1) as f64;
    measured.stages.iter_mut().for_each(|sum| *sum /= measured.frames.max(1) as f64);
    viewer.close().await?;
    Ok(measured)
}

/// The value below which a share of some values lies; NaN if there are none.
pub(super) fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get((sorted.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN)
}

/// The scene's camera turned about its target around the world's y axis.
fn orbit(scene: &SceneFile, angle: f64) -> Camera {
    let mut camera = scene.camera.clone().unwrap_or_else(|| scene::Camera::default_file(false));
    let [x, y, z] = std::array::from_fn(|axis| camera.position[axis] - camera.target[axis]);
    let (sine, cosine) = angle.sin_cos();
    let turned = [x * cosine + z * sine, y, z * cosine - x * sine];
    camera.position = std::array::from_fn(|axis| camera.target[axis] + turned[axis]);
    camera
}
