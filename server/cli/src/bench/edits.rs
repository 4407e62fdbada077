//! Suite `edits`: what of a photon map an edit makes stale, and what following only that saves: the
//! experiments of *Historygrams* (table 1) on stand-ins from formulas. What keeping histories costs, and from
//! which share of stale photons on a map is sooner made anew: [`costs`]. Edits of baked light:
//! [`bakes`]. Into how many segments view rays are best cut: [`segments`]. Light in the field against photons
//! gathered on rays: [`gathers`].

mod bakes;
mod costs;
mod gathers;
mod segments;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use anyhow::bail;
use proto::SceneFile;
use proto::scene_file::Builtin;
use render::{DrawRequest, Drawn, View};
use scene::plan::Target;
use scene::{EnvironmentImages, PreparedVolume, Scene, Snapshot};
use serde_json::{Value, json};

use super::drawing::Canvas;
use super::report::{Line, Table, columns, line_chart, rounded};
use super::scenes::prepared;

/// How much is measured.
struct Size {
    /// Voxels along each axis.
    voxels: usize,
    /// Photons of each light, and those of the sweep.
    photons: u32,
    sweep: &'static [u32],
    /// Texels of scattered light along an edge.
    grid: u32,
    /// Times that each edit is made; the quickest counts.
    runs: usize,
}

const USUAL: Size = Size { voxels: 64, photons: 8192, sweep: &[2048, 32_768], grid: 16, runs: 2 };
const QUICK: Size = Size { voxels: 20, photons: 2048, sweep: &[], grid: 12, runs: 1 };

/// Pixels along each axis: few, for light is measured.
const PIXELS: u32 = 24;
/// Nodes of direct light along an edge: with as many as usual they would take most of the time.
const DIRECT_GRID: u32 = 16;

/// An edit of a scene.
struct Experiment {
    name: &'static str,
    /// What stands for which of the paper's.
    about: &'static str,
    scene: Builtin,
    /// Makes the edit.
    edit: fn(&mut Value),
}

const EXPERIMENTS: [Experiment; 8] = [
    Experiment {
        name: "sphere recoloured",
        about: "Cornell box, nearest filter: the ball's colour",
        scene: Builtin::CornellBox,
        edit: |scene| points(scene, 10..12, &json!({"albedo": [0.9, 0.6, 0.1]})),
    },
    Experiment {
        name: "sphere of another material",
        about: "Cornell box: the ball from chalk to paint",
        scene: Builtin::CornellBox,
        edit: |scene| points(scene, 10..12, &json!({"material": "paint"})),
    },
    Experiment {
        name: "vessels recoloured",
        about: "thin vessels in empty space: the colour of their inside",
        scene: Builtin::VesselTree,
        edit: |scene| points(scene, 3..4, &json!({"albedo": [0.2, 0.3, 0.9]})),
    },
    Experiment {
        name: "small structure removed",
        about: "nested shells: the innermost core becomes clear",
        scene: Builtin::NestedShells,
        edit: |scene| points(scene, 8..10, &json!({"extinction": 0})),
    },
    Experiment {
        name: "inner shell recoloured",
        about: "nested shells: the colour of the third shell",
        scene: Builtin::NestedShells,
        edit: |scene| points(scene, 6..8, &json!({"albedo": [0.3, 0.9, 0.9]})),
    },
    Experiment {
        name: "outer skin denser",
        about: "nested shells: what all light has to cross",
        scene: Builtin::NestedShells,
        edit: |scene| points(scene, 2..4, &json!({"extinction": 50})),
    },
    Experiment {
        name: "light moved",
        about: "nested shells: the key light turns",
        scene: Builtin::NestedShells,
        edit: |scene| scene["lights"][0]["direction"] = json!([0.2, -0.7, -0.7]),
    },
    Experiment {
        name: "light recoloured",
        about: "nested shells: the key light's colour",
        scene: Builtin::NestedShells,
        edit: |scene| scene["lights"][0]["irradiance"] = json!([1.0, 2.0, 3.0]),
    },
];

/// Merges a patch into control points of the transfer function.
fn points(scene: &mut Value, which: std::ops::Range<usize>, patch: &Value) {
    for index in which {
        json_patch::merge(&mut scene["transfer_function"]["points"][index], patch);
    }
}

const COLUMNS: [&str; 19] = [
    "experiment",
    "about",
    "photons",
    "lights",
    "photons_redone",
    "photons_share",
    "interactions_share",
    "look_ups_share",
    "bricks_share",
    "nodes_share",
    "lights_begun_again",
    "work_saved",
    "time_saved",
    "time_over_work",
    "millis_reuse",
    "millis_anew",
    "speed_up",
    "history_bytes",
    "same_picture",
];

/// Measures every edit. Tables are written after each.
///
/// # Errors
/// A picture that is not bit for bit the one from scratch, after all tables were written.
pub fn run(quick: bool, out: &Path) -> anyhow::Result<()> {
    let size = if quick { QUICK } else { USUAL };
    let mut canvas = Canvas::open()?;
    let (of_bakes, mut wrong) = bakes::of_bakes(&mut canvas, &size, out)?;
    let mut table = Table {
        name: "edits",
        about: about(
            &canvas,
            &size,
            &json!({
            "work": "places of matter and cells looked up by photons, and cells looked up for direct light",
            "without reuse": "an empty view"}),
        ),
        columns: columns(&COLUMNS),
        rows: Vec::new(),
    };
    let mut dots = Vec::new();
    let usual = EXPERIMENTS.iter().map(|experiment| (experiment, size.photons));
    let sweep = size.sweep.iter().map(|&photons| (&EXPERIMENTS[2], photons));
    for (experiment, photons) in usual.chain(sweep) {
        let measured = Measured::of(&mut canvas, experiment, photons, &size)?;
        if !measured.same {
            wrong.push(experiment.name);
        }
        table.rows.push(measured.cells(experiment, photons));
        table.write(out)?;
        dots.push((measured.share(&["photons_recomputed"]), measured.speed_up()));
    }
    dots.sort_by(|a, b| a.0.total_cmp(&b.0));
    let lines = [Line { label: "edits".into(), points: dots }];
    line_chart(
        &out.join("edits.svg"),
        "Edits of a photon map",
        "share of photons followed anew",
        "speed-up",
        &lines,
    )?;
    let masks = costs::of_masks(&mut canvas, &size, out)?;
    let beginning_again = costs::of_beginning_again(&mut canvas, &size, out)?;
    let of_table = table.markdown(&[
        "experiment",
        "photons",
        "photons_share",
        "look_ups_share",
        "time_saved",
        "time_over_work",
        "speed_up",
        "same_picture",
    ]);
    let (of_segments, wrong_segments) = segments::of_segments(&mut canvas, &size, out)?;
    wrong.extend(wrong_segments);
    let of_gathers = gathers::of_gathers(&mut canvas, &size, out)?;
    let tables = [of_table, masks, beginning_again, of_bakes, of_segments, of_gathers];
    std::fs::write(out.join("edits.md"), tables.join("\n"))?;
    if wrong.is_empty() {
        return Ok(());
    }
    bail!("not the picture from scratch: {}", wrong.join(", "))
}

/// What was measured where.
fn about(canvas: &Canvas, size: &Size, more: &Value) -> Value {
    let mut about = json!({"device": canvas.device(), "volume": vec![size.voxels; 3], "image": [PIXELS, PIXELS],
        "method": "photon_map", "photon_grid": size.grid, "direct_grid": DIRECT_GRID,
        "clock": "software devices: processor time of all threads, of light and a picture of 2 x 2 pixels; others: \
                  wall clock of the pass that computes light; the quickest run counts",
        "runs": size.runs});
    json_patch::merge(&mut about, more);
    about
}

/// A scene as a file, and its voxels.
fn scene_of(builtin: Builtin, photons: u32, size: &Size) -> anyhow::Result<(Value, Arc<PreparedVolume>)> {
    let volume = prepared(scene::builtin::build(builtin, [size.voxels; 3], &|_| {}));
    let mut file = serde_json::to_value(scene::builtin::scene(builtin)?)?;
    file["volume"]["dims"] = json!(vec![size.voxels; 3]);
    file["illumination"] = json!({"method": "photon_map", "photons": photons, "photon_grid": size.grid,
        "direct_grid": DIRECT_GRID});
    Ok((file, volume))
}

/// An edit with what is kept, and from scratch.
struct Measured {
    lights: usize,
    photons: u32,
    reuse: BTreeMap<String, u64>,
    anew: BTreeMap<String, u64>,
    millis_reuse: f64,
    millis_anew: f64,
    events: u32,
    same: bool,
}

/// Counters of what light looks up on its way.
const LOOK_UPS: [&str; 3] = ["tentative_collisions", "cells_looked_up", "direct_cells_taken"];

impl Measured {
    fn of(canvas: &mut Canvas, experiment: &Experiment, photons: u32, size: &Size) -> anyhow::Result<Self> {
        let (before, volume) = scene_of(experiment.scene, photons, size)?;
        let mut after = before.clone();
        (experiment.edit)(&mut after);
        let before = snapshot(before, &volume, 1)?;
        let after = snapshot(after, &volume, 2)?;
        // Compiles what both need, and is kept from run to run.
        let mut kept = View::new();
        finish(canvas, &mut kept, &after)?;
        let (mut millis_reuse, mut millis_anew) = (f64::INFINITY, f64::INFINITY);
        let mut last = None;
        for _ in 0..size.runs {
            finish(canvas, &mut kept, &before)?;
            let (reuse, millis) = finish(canvas, &mut kept, &after)?;
            millis_reuse = millis_reuse.min(millis);
            let mut empty = View::new();
            let (anew, millis) = finish(canvas, &mut empty, &after)?;
            millis_anew = millis_anew.min(millis);
            last = Some((reuse, anew, same_picture(canvas, &after, [&mut kept, &mut empty])?));
        }
        let Some((reuse, anew, same)) = last else { bail!("nothing was measured") };
        Ok(Self {
            lights: after.scene.lights.len(),
            photons,
            millis_reuse,
            millis_anew,
            events: after.scene.illumination.photon_events,
            reuse: reuse.counters,
            anew: anew.counters,
            same,
        })
    }

    /// Of counters what the edit took of what a new map takes.
    fn share(&self, counters: &[&str]) -> f64 {
        let of = |counted: &BTreeMap<String, u64>| -> f64 {
            counters.iter().map(|&name| counted.get(name).copied().unwrap_or(0) as f64).sum()
        };
        if of(&self.anew) > 0.0 { of(&self.reuse) / of(&self.anew) } else { 0.0 }
    }

    fn speed_up(&self) -> f64 {
        self.millis_anew / self.millis_reuse
    }

    fn cells(&self, experiment: &Experiment, photons: u32) -> Vec<Value> {
        let count = |name: &str| json!(self.reuse.get(name).copied().unwrap_or(0));
        let look_ups = self.share(&LOOK_UPS);
        let work_saved = 1.0 - look_ups;
        let time_saved = 1.0 - self.millis_reuse / self.millis_anew;
        // Of an interaction's 64 bytes 16 are its history, and as many of a photon's end.
        let histories = u64::from(self.photons) * self.lights as u64 * 16 * (u64::from(self.events) + 1);
        vec![
            json!(experiment.name),
            json!(experiment.about),
            json!(photons),
            json!(self.lights),
            count("photons_recomputed"),
            rounded(self.share(&["photons_recomputed"])),
            rounded(self.share(&["photon_interactions"])),
            rounded(look_ups),
            rounded(self.share(&["bricks_recomputed"])),
            rounded(self.share(&["direct_nodes_cast"])),
            count("lights_begun_again"),
            rounded(work_saved),
            rounded(time_saved),
            if work_saved > 0.01 { rounded(time_saved / work_saved) } else { Value::Null },
            rounded(self.millis_reuse),
            rounded(self.millis_anew),
            rounded(self.speed_up()),
            json!(histories),
            json!(self.same),
        ]
    }
}

/// Whether two views show the same of a scene, bit for bit.
fn same_picture(
    canvas: &mut Canvas,
    snapshot: &Arc<Snapshot>,
    views: [&mut View; 2],
) -> anyhow::Result<bool> {
    let target = Target { width: PIXELS, height: PIXELS, samples_per_pixel: 1 };
    let mut pictures = Vec::new();
    for view in views {
        canvas.renderer().draw(view, &DrawRequest { snapshot, target, budget: None })?;
        let bits = canvas.renderer().radiance(view)?.rgb.iter().map(|x| x.to_bits()).collect::<Vec<u32>>();
        pictures.push(bits);
    }
    Ok(pictures[0] == pictures[1])
}

fn snapshot(file: Value, volume: &Arc<PreparedVolume>, epoch: u32) -> anyhow::Result<Arc<Snapshot>> {
    let file = SceneFile::from_value(file)?;
    let scene = Scene::with_images(&file, volume.clone(), &EnvironmentImages::new())?;
    Ok(Arc::new(Snapshot { epoch, scene }))
}

/// Brings light to a snapshot, for a picture of next to no pixels, and says how many milliseconds it took.
pub(super) fn finish(
    canvas: &mut Canvas,
    view: &mut View,
    snapshot: &Arc<Snapshot>,
) -> anyhow::Result<(Drawn, f64)> {
    let target = Target { width: 2, height: 2, samples_per_pixel: 1 };
    timed(canvas, view, snapshot, target, &["illuminate"])
}

/// Draws a picture, and says how many milliseconds it took, or on a GPU some of its stages.
fn timed(
    canvas: &mut Canvas,
    view: &mut View,
    snapshot: &Arc<Snapshot>,
    target: Target,
    stages: &[&str],
) -> anyhow::Result<(Drawn, f64)> {
    let cpu = canvas.device().software.then(cpu_millis).flatten();
    let drawn = canvas.renderer().draw(view, &DrawRequest { snapshot, target, budget: None })?;
    let millis = match (cpu, cpu_millis()) {
        (Some(before), Some(after)) => after - before,
        _ => {
            let counted = drawn.stages.iter().filter(|time| stages.contains(&time.stage.as_str()));
            counted.map(|time| time.millis).sum()
        }
    };
    // The least that is told, where nothing ran.
    Ok((drawn, millis.max(1e-3)))
}

/// Processor time of all threads of this process, milliseconds, where the system tells: a software device
/// works in them, and other processes do not count.
fn cpu_millis() -> Option<f64> {
    let of_thread = |entry: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(entry.ok()?.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    };
    let threads = std::fs::read_dir("/proc/self/task").ok()?;
    let nanos: f64 = threads.filter_map(of_thread).sum();
    (nanos > 0.0).then_some(nanos / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edit_is_one_and_fits_the_format() {
        for experiment in &EXPERIMENTS {
            let before = serde_json::to_value(scene::builtin::scene(experiment.scene).unwrap()).unwrap();
            let mut after = before.clone();
            (experiment.edit)(&mut after);
            assert_ne!(before, after, "{}", experiment.name);
            SceneFile::from_value(after).unwrap();
        }
    }
}
