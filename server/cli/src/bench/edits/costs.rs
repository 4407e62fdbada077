//! What following edits costs where nothing is edited, and where it stops paying.

use std::ops::Range;
use std::path::Path;

use proto::scene_file::Builtin;
use render::{PhotonTrial, View};
use serde_json::{Value, json};

use super::super::drawing::Canvas;
use super::super::report::{Line, Table, columns, line_chart, rounded};
use super::{Size, about, finish, points, same_picture, scene_of, snapshot};

/// Scenes whose histories are compared.
const SCENES: [Builtin; 3] = [Builtin::CornellBox, Builtin::VesselTree, Builtin::NestedShells];
/// Runs are compared in pairs, more often than edits: a difference of some per cent is looked for.
const PAIRS: usize = 3;

/// A new map with histories, and without. The table as Markdown.
pub fn of_masks(canvas: &mut Canvas, size: &Size, out: &Path) -> anyhow::Result<String> {
    let names = ["scene", "photons", "millis_with", "millis_without", "overhead", "same_picture"];
    let mut table = Table {
        name: "edits-masks",
        about: about(
            canvas,
            size,
            &json!({"runs": PAIRS * size.runs,
            "without": "a variant of the shader that gathers and stores no history"}),
        ),
        columns: columns(&names),
        rows: Vec::new(),
    };
    for builtin in SCENES {
        let (file, volume) = scene_of(builtin, size.photons, size)?;
        let scene = snapshot(file, &volume, 1)?;
        let mut best = [f64::INFINITY; 2];
        let mut views = [View::new(), View::new()];
        // The first round compiles.
        for run in 0..=PAIRS * size.runs {
            for (masks, (best, view)) in [true, false].into_iter().zip(best.iter_mut().zip(&mut views)) {
                canvas.renderer().try_photons(PhotonTrial { masks, ..PhotonTrial::default() });
                *view = View::new();
                let drawn = finish(canvas, view, &scene);
                canvas.renderer().try_photons(PhotonTrial::default());
                let (_, millis) = drawn?;
                if run > 0 {
                    *best = best.min(millis);
                }
            }
        }
        let [with, without] = best;
        let [one, other] = &mut views;
        let same = same_picture(canvas, &scene, [one, other])?;
        table.rows.push(vec![
            json!(builtin.name()),
            json!(size.photons),
            rounded(with),
            rounded(without),
            rounded(with / without - 1.0),
            json!(same),
        ]);
        table.write(out)?;
    }
    Ok(table.markdown(&names))
}

/// Edits that leave few to nearly all photons stale: which control points are recoloured of which scene.
const EVER_MORE: [(Builtin, Range<usize>); 11] = [
    (Builtin::CornellBox, 10..12),
    (Builtin::CornellBox, 8..10),
    (Builtin::CornellBox, 2..4),
    (Builtin::CornellBox, 2..6),
    (Builtin::CornellBox, 6..8),
    (Builtin::NestedShells, 8..10),
    (Builtin::NestedShells, 6..8),
    (Builtin::NestedShells, 4..6),
    (Builtin::NestedShells, 2..4),
    (Builtin::VesselTree, 3..4),
    (Builtin::VesselTree, 2..3),
];

/// Edits of ever more photons, followed and begun again. The table as Markdown.
pub fn of_beginning_again(canvas: &mut Canvas, size: &Size, out: &Path) -> anyhow::Result<String> {
    let names = [
        "scene",
        "points",
        "photons_share",
        "millis_followed",
        "millis_begun_again",
        "followed_over_begun_again",
    ];
    let mut table = Table {
        name: "edits-begin-again",
        about: about(canvas, size, &json!({"photons": size.photons})),
        columns: columns(&names),
        rows: Vec::new(),
    };
    let mut dots = Vec::new();
    for (builtin, which) in EVER_MORE {
        let (before, volume) = scene_of(builtin, size.photons, size)?;
        let mut after = before.clone();
        points(&mut after, which.clone(), &json!({"albedo": [0.55, 0.45, 0.35]}));
        let before = snapshot(before, &volume, 1)?;
        let after = snapshot(after, &volume, 2)?;
        let mut kept = View::new();
        let mut best = [f64::INFINITY; 2];
        let mut share = 0.0;
        for _ in 0..size.runs {
            for (begin_again_share, best) in [1.0, 0.0].into_iter().zip(&mut best) {
                finish(canvas, &mut kept, &before)?;
                let trial = PhotonTrial { begin_again_share, ..PhotonTrial::default() };
                canvas.renderer().try_photons(trial);
                let drawn = finish(canvas, &mut kept, &after);
                canvas.renderer().try_photons(PhotonTrial::default());
                let (drawn, millis) = drawn?;
                *best = best.min(millis);
                if begin_again_share > 0.0 {
                    let count = |name: &str| drawn.counters.get(name).copied().unwrap_or(0) as f64;
                    share = count("photons_recomputed")
                        / (count("photons_recomputed") + count("photons_reused")).max(1.0);
                }
            }
        }
        let [followed, begun_again] = best;
        dots.push((share, followed / begun_again));
        table.rows.push(vec![
            json!(builtin.name()),
            Value::String(format!("{which:?}")),
            rounded(share),
            rounded(followed),
            rounded(begun_again),
            rounded(followed / begun_again),
        ]);
        table.write(out)?;
    }
    dots.sort_by(|a, b| a.0.total_cmp(&b.0));
    let line = Line { label: "time followed over begun again".into(), points: dots };
    let path = out.join("edits-begin-again.svg");
    line_chart(&path, "Following an edit, or beginning again", "share of stale photons", "time", &[line])?;
    Ok(table.markdown(&names))
}
