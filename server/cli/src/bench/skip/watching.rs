//! What nobody looks at is not drawn: an unchanged scene and a hidden viewer, through the service.

use std::time::Duration;

use anyhow::{Context, ensure};
use proto::frame::FLAG_FINAL;
use proto::scene_file::{Builtin, VolumeSource};
use proto::{ClientMessage, SceneFile};
use serde_json::json;

use super::{Row, Same};
use crate::bench::served::{Frame, Served, Viewer};

/// Time for each part, and for pictures to come to rest.
const WATCHED: Duration = Duration::from_millis(1500);
const AT_REST: Duration = Duration::from_millis(2500);
/// Edits made while watched or hidden, and the time between two.
const EDITS: u32 = 20;
const BETWEEN_EDITS: Duration = Duration::from_millis(50);
const SIZE: (u32, u32) = (160, 120);

/// Measures in a service of its own.
///
/// # Errors
/// The service fails, or a picture never becomes final.
pub fn measure() -> anyhow::Result<Vec<Row>> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(async {
        let served = Served::open().await?;
        let rows = watch(&served).await;
        served.close().await?;
        rows
    })
}

async fn watch(served: &Served) -> anyhow::Result<Vec<Row>> {
    let volume =
        VolumeSource { builtin: Some(Builtin::SmokePlume), dims: Some([48; 3]), ..VolumeSource::default() };
    let scene = SceneFile { volume, ..scene::builtin::scene(Builtin::SmokePlume)? };
    let session = served.session(&scene).await?;
    let mut watching = served.viewer(&session, SIZE).await?;
    let mut hiding = served.viewer(&session, SIZE).await?;
    rest(&mut watching).await?;
    rest(&mut hiding).await?;

    // Edits, seen by one viewer and not by the other.
    hiding.send(&ClientMessage::Visible { visible: false }).await?;
    let mut seen = Vec::new();
    for edit in 1..=EDITS {
        let patch = json!({"density": 1.0 + 0.02 * f64::from(edit)});
        watching.send(&ClientMessage::Patch { seq: 1 + edit, patch }).await?;
        seen.extend(watching.frames_within(BETWEEN_EDITS).await?);
    }
    let last_seen = rest(&mut watching).await?;
    let unseen = hiding.frames_within(Duration::from_millis(100)).await?;

    // Nothing changes.
    let unchanged = watching.frames_within(WATCHED).await?;

    // Shown again, the hidden viewer has the picture that the other one sees.
    hiding.send(&ClientMessage::Visible { visible: true }).await?;
    let shown_again = rest(&mut hiding).await?;
    let difference = picture_difference(&last_seen, &shown_again)?;
    watching.close().await?;
    hiding.close().await?;
    let millis = |frames: &[Frame]| {
        frames.iter().fold(0.0, |sum, frame| sum + f64::from(frame.header.render_micros) / 1e3)
    };
    let row = |kind, how, with: &[Frame], without: &[Frame]| Row {
        kind,
        how,
        unit: "frames",
        work: [with.len() as u64, without.len() as u64],
        millis: [millis(with), millis(without)],
        difference,
        same: Same::Bits,
        mean_ratio: 1.0,
        mean_uncertainty: 0.0,
    };
    Ok(vec![
        row("unchanged scene, service", "20 edits within a second, and 1.5 s without any", &seen, &unchanged),
        row("hidden viewer", "20 edits of a session with a visible and a hidden viewer", &seen, &unseen),
    ])
}

/// Waits for the final picture and for silence after it.
async fn rest(viewer: &mut Viewer) -> anyhow::Result<Frame> {
    let frames = viewer.frames_within(AT_REST).await?;
    let last = frames.into_iter().last().context("no picture came")?;
    ensure!(last.header.flags & FLAG_FINAL != 0, "the picture at rest is not final");
    Ok(last)
}

/// Largest difference of a channel of two encoded pictures, 0..1.
fn picture_difference(a: &Frame, b: &Frame) -> anyhow::Result<f64> {
    let decode = |frame: &Frame| image::load_from_memory(&frame.payload).map(|picture| picture.to_rgb8());
    let (a, b) = (decode(a)?, decode(b)?);
    ensure!(a.dimensions() == b.dimensions(), "pictures of different sizes");
    let farthest = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    Ok(f64::from(farthest) / 255.0)
}
