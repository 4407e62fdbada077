//! Edits to the picture with photons' light in the field, and gathered on rays as *Historygrams* does.

use std::path::Path;

use render::View;
use scene::plan::Target;
use serde_json::json;

use super::super::drawing::Canvas;
use super::super::report::{Table, columns, rounded};
use super::{EXPERIMENTS, Size, about, scene_of, snapshot, timed};

/// Stages that make light and show it.
const STAGES: [&str; 3] = ["illuminate", "sort_photons", "ray_cast"];

/// The table as Markdown.
pub fn of_gathers(canvas: &mut Canvas, size: &Size, out: &Path) -> anyhow::Result<String> {
    let names = [
        "experiment",
        "millis_field",
        "millis_ray",
        "ray_over_field",
        "millis_ray_anew",
        "ray_speed_up",
        "photons_gathered",
    ];
    // A pixel a voxel: gathering on rays is slow.
    let edge = size.voxels as u32;
    let more = json!({"image": [edge, edge], "photons": size.photons,
        "ray": "photons are followed as usual, and gathered on all view rays", "anew": "an empty view"});
    let mut table = Table {
        name: "edits-gathers",
        about: about(canvas, size, &more),
        columns: columns(&names),
        rows: Vec::new(),
    };
    let target = Target { width: edge, height: edge, samples_per_pixel: 1 };
    for experiment in EXPERIMENTS {
        // Of the edit with the field, with rays; of rays from scratch.
        let mut best = [f64::INFINITY; 3];
        let mut gathered = 0;
        for (way, gather) in ["field", "ray"].into_iter().enumerate() {
            let (mut before, volume) = scene_of(experiment.scene, size.photons, size)?;
            before["illumination"]["gather"] = json!(gather);
            let mut after = before.clone();
            (experiment.edit)(&mut after);
            let (before, after) = (snapshot(before, &volume, 1)?, snapshot(after, &volume, 2)?);
            // The first round compiles.
            for run in 0..=size.runs {
                let (mut view, mut empty) = (View::new(), View::new());
                timed(canvas, &mut view, &before, target, &STAGES)?;
                let (drawn, edited) = timed(canvas, &mut view, &after, target, &STAGES)?;
                let (_, anew) = timed(canvas, &mut empty, &after, target, &STAGES)?;
                if run > 0 {
                    best[way] = best[way].min(edited);
                }
                if run > 0 && gather == "ray" {
                    best[2] = best[2].min(anew);
                    gathered = drawn.counters.get("photons_gathered").copied().unwrap_or(0);
                }
            }
        }
        let [field, ray, anew] = best;
        table.rows.push(vec![
            json!(experiment.name),
            rounded(field),
            rounded(ray),
            rounded(ray / field),
            rounded(anew),
            rounded(anew / ray),
            json!(gathered),
        ]);
    }
    table.write(out)?;
    Ok(table.markdown(&names))
}
