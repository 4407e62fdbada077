//! The same edits of matter with `precomputed_transfer`: a bake that follows, and one from the beginning.

use std::path::Path;

use anyhow::bail;
use render::View;
use serde_json::{Value, json};

use super::super::drawing::Canvas;
use super::super::report::{Table, columns, rounded};
use super::{EXPERIMENTS, Experiment, Size, about, finish, same_picture, scene_of, snapshot};

/// Photons of a bake for each of a photon map's lights.
const PHOTONS: u32 = 8;
/// Experiments from the first on that are edits of matter.
const OF_MATTER: usize = 6;
const COLUMNS: [&str; 9] = [
    "experiment",
    "photons",
    "photons_share",
    "beams_share",
    "millis_followed",
    "millis_anew",
    "speed_up",
    "peak_mib",
    "same_picture",
];

/// The table as Markdown; and the experiments whose pictures are not those from the beginning.
pub fn of_bakes(canvas: &mut Canvas, size: &Size, out: &Path) -> anyhow::Result<(String, Vec<&'static str>)> {
    let mut table = Table {
        name: "edits-bakes",
        about: about(
            canvas,
            size,
            &json!({"method": "precomputed_transfer", "transfer_grid": size.grid, "lights": "a uniform sky",
                "transfer_lights": 42, "transfer_directions": 192, "beams_share": "marched, of those of a new bake"}),
        ),
        columns: columns(&COLUMNS),
        rows: Vec::new(),
    };
    let mut wrong = Vec::new();
    for experiment in &EXPERIMENTS[..OF_MATTER] {
        let (cells, same) = measured(canvas, experiment, size)?;
        table.rows.push(cells);
        table.write(out)?;
        if !same {
            wrong.push(experiment.name);
        }
    }
    Ok((table.markdown(&COLUMNS), wrong))
}

fn measured(canvas: &mut Canvas, experiment: &Experiment, size: &Size) -> anyhow::Result<(Vec<Value>, bool)> {
    let photons = PHOTONS * size.photons;
    let (mut before, volume) = scene_of(experiment.scene, photons, size)?;
    before["illumination"] = json!({"method": "precomputed_transfer", "transfer_photons": photons,
        "transfer_grid": size.grid, "transfer_lights": 42, "transfer_directions": 192});
    before["lights"] = json!([{"type": "environment", "radiance": [1, 1, 1]}]);
    let mut after = before.clone();
    (experiment.edit)(&mut after);
    let before = snapshot(before, &volume, 1)?;
    let after = snapshot(after, &volume, 2)?;
    // Compiles what both need.
    finish(canvas, &mut View::new(), &after)?;
    let mut best = [f64::INFINITY; 2];
    let mut last = None;
    for _ in 0..size.runs {
        let (mut kept, mut empty) = (View::new(), View::new());
        finish(canvas, &mut kept, &before)?;
        let (followed, millis) = finish(canvas, &mut kept, &after)?;
        best[0] = best[0].min(millis);
        let (anew, millis) = finish(canvas, &mut empty, &after)?;
        best[1] = best[1].min(millis);
        last = Some((followed, anew, same_picture(canvas, &after, [&mut kept, &mut empty])?));
    }
    let Some((followed, anew, same)) = last else { bail!("nothing was measured") };
    let share = |name: &str| {
        let of =
            |counters: &std::collections::BTreeMap<String, u64>| counters.get(name).copied().unwrap_or(0);
        of(&followed.counters) as f64 / of(&anew.counters).max(1) as f64
    };
    let peak = followed.counters.get("transfer_peak_bytes").copied().unwrap_or(0);
    let cells = vec![
        json!(experiment.name),
        json!(photons),
        rounded(share("transfer_photons_traced")),
        rounded(share("transfer_rays_marched")),
        rounded(best[0]),
        rounded(best[1]),
        rounded(best[1] / best[0]),
        json!(peak >> 20),
        json!(same),
    ];
    Ok((cells, same))
}
