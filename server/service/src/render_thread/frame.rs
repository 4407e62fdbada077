//! A picture under way, and what travels with it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use proto::frame::{FLAG_FINAL, FLAG_MOVING, FRAME_HEADER_BYTES, FRAME_MAGIC, FrameHeader};
use proto::plan::FrameReport;
use render::{Drawn, Picture};
use scene::Snapshot;
use scene::plan::{Pass, Target};

use super::Encoding;

/// Counters that each slice tells of everything that is kept: the part that was not redone, and the
/// part that was. Over several slices the redone parts add up, and the rest is what was reused.
const OF_ALL: [[&str; 2]; 3] = [
    ["photons_reused", "photons_recomputed"],
    ["bricks_reused", "bricks_recomputed"],
    ["tiles_reused", "tiles_recomputed"],
];

/// Counters that tell how much there is, not how much was done: the newest slice knows.
const AMOUNTS: [&str; 5] =
    ["records", "transfer_rows", "transfer_made", "transfer_peak_bytes", "transfer_compression_error_ppm"];

/// A picture under way.
pub(super) struct Drawing {
    pub kind: Kind,
    pub snapshot: Arc<Snapshot>,
    pub viewport: (u32, u32),
    pub target: Target,
    pub seq: u32,
    pub arrived: Instant,
    pub began: Instant,
    pub spent: Duration,
    /// The part of `spent` that grows with the pixels; loading and compiling are not counted.
    pub casting: Duration,
    /// Share of the light that is the snapshot's, 0..1.
    pub illumination: f32,
    /// Epoch of the scene whose light that is.
    pub illumination_epoch: u32,
    /// What was done since the last frame.
    pub report: Option<FrameReport>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Small enough to come in time; the JPEG quality.
    Moving(u8),
    /// At rest, on slow devices: reduced, because the full size will take long.
    Preview,
    /// At rest, at full size.
    Still,
}

/// The header of a frame, as far as it is known before encoding; with samples per pixel of its film,
/// and their relative standard error where that is known.
pub(super) fn header(
    frame: u32,
    drawing: &Drawing,
    picture: &Picture,
    encoding: Encoding,
    (samples_per_pixel, error): (u32, Option<f64>),
) -> FrameHeader {
    let epoch = drawing.snapshot.epoch;
    let flags = match encoding {
        Encoding::Moving(_) => FLAG_MOVING,
        Encoding::Refining => 0,
        Encoding::Lossless => FLAG_FINAL,
    };
    FrameHeader {
        magic: FRAME_MAGIC,
        header_bytes: FRAME_HEADER_BYTES as u16,
        format: 0,
        flags,
        frame,
        seq: drawing.seq,
        snapshot_epoch: epoch,
        illumination_epoch: drawing.illumination_epoch,
        illumination_completeness: drawing.illumination,
        samples_per_pixel,
        error_estimate: error.map_or(f32::NAN, |error| error as f32),
        width: edge(picture.width),
        height: edge(picture.height),
        viewport_width: edge(drawing.viewport.0),
        viewport_height: edge(drawing.viewport.1),
        quality: 0,
        queue_micros: micros(drawing.began.saturating_duration_since(drawing.arrived)),
        render_micros: micros(drawing.spent),
        encode_micros: 0,
        payload_bytes: 0,
    }
}

/// Time a slice spent casting rays or following paths.
pub(super) fn casting_time(drawn: &Drawn) -> Duration {
    let passes = [Pass::RayCast, Pass::PathTrace].map(Pass::name);
    let casting = drawn.stages.iter().filter(|stage| passes.contains(&stage.stage.as_str()));
    Duration::from_secs_f64(casting.map(|stage| stage.millis / 1e3).sum())
}

/// Adds a slice to the report of the frame it belongs to.
pub(super) fn accumulate(report: &mut Option<FrameReport>, slice: FrameReport) {
    let Some(report) = report else {
        *report = Some(slice);
        return;
    };
    for stage in slice.stages {
        stage.add_to(&mut report.stages);
    }
    let reused = OF_ALL.map(|[reused, recomputed]| {
        let total = |counters: &BTreeMap<String, u64>| {
            counters.get(reused).map(|count| count + counters.get(recomputed).copied().unwrap_or_default())
        };
        (reused, recomputed, total(&slice.counters).max(total(&report.counters)))
    });
    for (name, count) in slice.counters {
        let known = if AMOUNTS.contains(&name.as_str()) {
            0
        } else {
            report.counters.get(&name).copied().unwrap_or(0)
        };
        report.counters.insert(name, known + count);
    }
    for (reused, recomputed, total) in reused {
        if let Some(total) = total {
            let redone = report.counters.get(recomputed).copied().unwrap_or_default();
            report.counters.insert(reused.to_owned(), total.saturating_sub(redone));
        }
    }
    report.gpu_bytes = slice.gpu_bytes;
}

fn edge(pixels: u32) -> u16 {
    u16::try_from(pixels).unwrap_or(u16::MAX)
}

fn micros(time: Duration) -> u32 {
    u32::try_from(time.as_micros()).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slice(counters: &[(&str, u64)]) -> FrameReport {
        let counters = counters.iter().map(|(name, count)| ((*name).to_owned(), *count)).collect();
        FrameReport { counters, ..FrameReport::default() }
    }

    #[test]
    fn what_slices_redo_adds_up_and_the_rest_was_reused() {
        let mut report = None;
        for redone in [100, 250, 0] {
            let (photons, bricks) = (("photons_recomputed", redone), ("bricks_recomputed", 40));
            let rest = [("photons_reused", 1000 - redone), ("bricks_reused", 10)];
            let amount = ("transfer_rows", 5);
            accumulate(
                &mut report,
                slice(&[photons, bricks, rest[0], rest[1], amount, ("samples_taken", 7)]),
            );
        }
        let counters = report.unwrap().counters;
        assert_eq!((counters["photons_recomputed"], counters["photons_reused"]), (350, 650));
        // Filled again and again: more than there are.
        assert_eq!((counters["bricks_recomputed"], counters["bricks_reused"]), (120, 0));
        assert_eq!((counters["samples_taken"], counters["transfer_rows"]), (21, 5));
    }

    #[test]
    fn rays_are_counted_where_they_are_cast() {
        let mut report = None;
        accumulate(&mut report, slice(&[("segments_cast", 5), ("segments_reused", 10)]));
        accumulate(&mut report, slice(&[("segments_cast", 0), ("segments_reused", 15)]));
        let counters = report.unwrap().counters;
        assert_eq!((counters["segments_cast"], counters["segments_reused"]), (5, 25));
        assert!(!counters.contains_key("photons_reused"));
    }
}
