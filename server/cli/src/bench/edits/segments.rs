//! Into how many segments view rays are best cut (V_n of *Historygrams*): what edits cast anew, what that saves,
//! and what keeping them costs the first picture.

use std::path::Path;

use render::View;
use scene::plan::Target;
use serde_json::{Value, json};

use super::super::drawing::Canvas;
use super::super::report::{Line, Table, columns, line_chart, rounded};
use super::{EXPERIMENTS, Size, about, scene_of, snapshot, timed};

const SEGMENTS: [u32; 6] = [1, 2, 4, 8, 16, 32];
/// Pixels along each edge, for each voxel along an edge.
const PIXELS_A_VOXEL: u32 = 3;
const NAMES: [&str; 4] =
    ["sphere recoloured", "vessels recoloured", "small structure removed", "outer skin denser"];

/// Edits in `local`, whose rays depend on matter alone: the table as Markdown, and the edits whose picture is not
/// that from scratch.
pub fn of_segments(
    canvas: &mut Canvas,
    size: &Size,
    out: &Path,
) -> anyhow::Result<(String, Vec<&'static str>)> {
    let names = [
        "experiment",
        "segments",
        "segments_share",
        "samples_share",
        "millis_kept",
        "millis_anew",
        "speed_up",
        "overhead",
        "segment_bytes",
        "same_picture",
    ];
    let edge = PIXELS_A_VOXEL * size.voxels as u32;
    let more = json!({"method": "local", "image": [edge, edge], "millis_anew": "whole rays, nothing kept",
        "overhead": "of the first picture, over that of whole rays"});
    let mut table = Table {
        name: "edits-segments",
        about: about(canvas, size, &more),
        columns: columns(&names),
        rows: Vec::new(),
    };
    let (mut wrong, mut lines) = (Vec::new(), Vec::new());
    for experiment in EXPERIMENTS.iter().filter(|experiment| NAMES.contains(&experiment.name)) {
        let mut points = Vec::new();
        for segments in SEGMENTS {
            let (mut before, volume) = scene_of(experiment.scene, 1, size)?;
            before["illumination"] = json!({"method": "local"});
            json_patch::merge(&mut before, &json!({"sampling": {"segments": segments}}));
            let mut after = before.clone();
            (experiment.edit)(&mut after);
            let (before, after) = (snapshot(before, &volume, 1)?, snapshot(after, &volume, 2)?);
            let target = Target { width: edge, height: edge, samples_per_pixel: 1 };
            let mut best = [f64::INFINITY; 4];
            let mut last = None;
            // The first round compiles.
            for run in 0..=size.runs {
                let (mut kept, mut whole) = (View::for_edits(), View::new());
                let mut draw = |view: &mut View, snapshot, best: &mut f64| {
                    let (drawn, millis) = timed(canvas, view, snapshot, target, &["ray_cast"])?;
                    if run > 0 {
                        *best = best.min(millis);
                    }
                    anyhow::Ok(drawn)
                };
                let [first_kept, first_whole, edited, anew] = &mut best;
                draw(&mut kept, &before, first_kept)?;
                draw(&mut whole, &before, first_whole)?;
                let drawn = draw(&mut kept, &after, edited)?;
                let mut whole = View::new();
                let of_whole = draw(&mut whole, &after, anew)?;
                last = Some((kept, drawn, of_whole));
            }
            let Some((mut kept, drawn, of_whole)) = last else { continue };
            let mut scratch = View::for_edits();
            timed(canvas, &mut scratch, &after, target, &["ray_cast"])?;
            let bits = |canvas: &mut Canvas, view: &mut View| {
                canvas
                    .renderer()
                    .radiance(view)
                    .map(|image| image.rgb.iter().map(|x| x.to_bits()).collect::<Vec<_>>())
            };
            let same = bits(canvas, &mut kept)? == bits(canvas, &mut scratch)?;
            if !same {
                wrong.push(experiment.name);
            }
            let count = |of: &render::Drawn, name: &str| of.counters.get(name).copied().unwrap_or(0) as f64;
            let (cast, reused) = (count(&drawn, "segments_cast"), count(&drawn, "segments_reused"));
            let share = cast / (cast + reused).max(1.0);
            let samples = count(&drawn, "samples_taken") / count(&of_whole, "samples_taken").max(1.0);
            let [first_kept, first_whole, edited, anew] = best;
            points.push((f64::from(segments), anew / edited));
            table.rows.push(vec![
                json!(experiment.name),
                json!(segments),
                rounded(share),
                rounded(samples),
                rounded(edited),
                rounded(anew),
                rounded(anew / edited),
                rounded(first_kept / first_whole - 1.0),
                json!(kept.segment_bytes()),
                Value::Bool(same),
            ]);
        }
        table.write(out)?;
        lines.push(Line { label: experiment.name.into(), points });
    }
    let path = out.join("edits-segments.svg");
    line_chart(
        &path,
        "Edits of matter by segments of view rays",
        "segments",
        "speed-up of view rays",
        &lines,
    )?;
    Ok((table.markdown(&names), wrong))
}
