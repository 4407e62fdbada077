//! Suite `edits`: what of a photon map an edit makes stale, and what following only that saves: the
//! experiments of *Historygrams* (table 1) on stand-ins from formulas.

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

/// Voxels and pixels along each axis.
const VOXELS: usize = 32;
const PIXELS: u32 = 24;
/// Photons of each light, and those of the sweep.
const PHOTONS: u32 = 32_768;
const SWEEP: [u32; 3] = [8192, 32_768, 131_072];
/// Texels of scattered light along an edge.
const GRID: u32 = 16;
/// Times that each edit is made; the quickest counts.
const RUNS: usize = 2;

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

const COLUMNS: [&str; 20] = [
    "experiment",
    "about",
    "photons",
    "lights",
    "photons_redone",
    "photons_share",
    "interactions_share",
    "bricks_share",
    "nodes_share",
    "segments_share",
    "lights_begun_again",
    "work_saved",
    "time_saved",
    "time_over_work",
    "millis_reuse",
    "millis_anew",
    "speed_up",
    "light_bytes",
    "history_bytes",
    "same_picture",
];

/// Measures every edit.
///
/// # Errors
/// A picture that is not bit for bit the one from scratch, after all tables were written.
pub fn run(out: &Path) -> anyhow::Result<()> {
    let mut canvas = Canvas::open()?;
    let mut table = Table {
        name: "edits",
        about: json!({"device": canvas.device(), "volume": [VOXELS, VOXELS, VOXELS], "image": [PIXELS, PIXELS],
            "method": "photon_map", "photon_grid": GRID,
            "clock": "wall clock of the pass that computes light; without reuse: an empty view",
            "work": "interactions of photons"}),
        columns: columns(&COLUMNS),
        rows: Vec::new(),
    };
    let mut lines = Vec::new();
    let mut wrong = Vec::new();
    let mut measure = |experiment: &Experiment, photons: u32| -> anyhow::Result<(f64, f64)> {
        let measured = Measured::of(&mut canvas, experiment, photons)?;
        if !measured.same {
            wrong.push(experiment.name);
        }
        table.rows.push(measured.cells(experiment, photons));
        Ok((measured.share("photons_recomputed"), measured.speed_up()))
    };
    let mut dots = Vec::new();
    for experiment in &EXPERIMENTS {
        dots.push(measure(experiment, PHOTONS)?);
    }
    dots.sort_by(|a, b| a.0.total_cmp(&b.0));
    lines.push(Line { label: "edits".into(), points: dots });
    for photons in SWEEP.into_iter().filter(|&photons| photons != PHOTONS) {
        measure(&EXPERIMENTS[2], photons)?;
    }
    table.write(out)?;
    let of_table = table.markdown(&[
        "experiment",
        "photons",
        "photons_share",
        "interactions_share",
        "nodes_share",
        "time_saved",
        "time_over_work",
        "speed_up",
    ]);
    std::fs::write(out.join("edits.md"), of_table)?;
    let path = out.join("edits.svg");
    line_chart(&path, "Edits of a photon map", "share of photons followed anew", "speed-up", &lines)?;
    if wrong.is_empty() {
        return Ok(());
    }
    bail!("not the picture from scratch: {}", wrong.join(", "))
}

/// An edit with what is kept, and from scratch.
struct Measured {
    lights: usize,
    photons: u32,
    reuse: BTreeMap<String, u64>,
    anew: BTreeMap<String, u64>,
    millis_reuse: f64,
    millis_anew: f64,
    segments_share: f64,
    light_bytes: u64,
    events: u32,
    same: bool,
}

impl Measured {
    fn of(canvas: &mut Canvas, experiment: &Experiment, photons: u32) -> anyhow::Result<Self> {
        let volume = prepared(scene::builtin::build(experiment.scene, [VOXELS; 3], &|_| {}));
        let mut before = serde_json::to_value(scene::builtin::scene(experiment.scene)?)?;
        before["volume"]["dims"] = json!([VOXELS, VOXELS, VOXELS]);
        before["illumination"] = json!({"method": "photon_map", "photons": photons, "photon_grid": GRID});
        let mut after = before.clone();
        (experiment.edit)(&mut after);
        let before = snapshot(before, &volume, 1)?;
        let after = snapshot(after, &volume, 2)?;
        // Compiles what both need.
        finish(canvas, &mut View::new(), &after)?;
        let (mut millis_reuse, mut millis_anew) = (f64::INFINITY, f64::INFINITY);
        let mut last = None;
        for _ in 0..RUNS {
            let mut kept = View::new();
            finish(canvas, &mut kept, &before)?;
            let reuse = finish(canvas, &mut kept, &after)?;
            let mut empty = View::new();
            let anew = finish(canvas, &mut empty, &after)?;
            millis_reuse = millis_reuse.min(illuminate_millis(&reuse));
            millis_anew = millis_anew.min(illuminate_millis(&anew));
            let [a, b] = [canvas.renderer().radiance(&kept)?.rgb, canvas.renderer().radiance(&empty)?.rgb];
            let same = a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()));
            last = Some((reuse, anew, same));
        }
        let Some((reuse, anew, same)) = last else { bail!("nothing was measured") };
        let count = |drawn: &Drawn, name: &str| drawn.counters.get(name).copied().unwrap_or(0) as f64;
        let cast = count(&reuse, "segments_cast");
        let segments = cast + count(&reuse, "segments_reused");
        Ok(Self {
            lights: after.scene.lights.len(),
            photons,
            millis_reuse,
            millis_anew,
            segments_share: if segments > 0.0 { cast / segments } else { 1.0 },
            light_bytes: anew.gpu_bytes.get("light").copied().unwrap_or(0),
            events: after.scene.illumination.photon_events,
            reuse: reuse.counters,
            anew: anew.counters,
            same,
        })
    }

    /// Of a counter what the edit took of what a new map takes.
    fn share(&self, counter: &str) -> f64 {
        let of = |counters: &BTreeMap<String, u64>| counters.get(counter).copied().unwrap_or(0) as f64;
        if of(&self.anew) > 0.0 { of(&self.reuse) / of(&self.anew) } else { 0.0 }
    }

    fn speed_up(&self) -> f64 {
        self.millis_anew / self.millis_reuse
    }

    fn cells(&self, experiment: &Experiment, photons: u32) -> Vec<Value> {
        let count = |name: &str| json!(self.reuse.get(name).copied().unwrap_or(0));
        let interactions = self.share("photon_interactions");
        let work_saved = 1.0 - interactions;
        let time_saved = 1.0 - self.millis_reuse / self.millis_anew;
        // Histories take half of an interaction's 64 bytes, and of a photon's end 16 of 32.
        let histories = u64::from(self.photons) * self.lights as u64 * (32 * u64::from(self.events) + 16);
        vec![
            json!(experiment.name),
            json!(experiment.about),
            json!(photons),
            json!(self.lights),
            count("photons_recomputed"),
            rounded(self.share("photons_recomputed")),
            rounded(interactions),
            rounded(self.share("bricks_recomputed")),
            rounded(self.share("direct_nodes_cast")),
            rounded(self.segments_share),
            count("lights_begun_again"),
            rounded(work_saved),
            rounded(time_saved),
            if work_saved > 0.01 { rounded(time_saved / work_saved) } else { Value::Null },
            rounded(self.millis_reuse),
            rounded(self.millis_anew),
            rounded(self.speed_up()),
            json!(self.light_bytes),
            json!(histories),
            json!(self.same),
        ]
    }
}

fn snapshot(file: Value, volume: &Arc<PreparedVolume>, epoch: u32) -> anyhow::Result<Arc<Snapshot>> {
    let file = SceneFile::from_value(file)?;
    let scene = Scene::with_images(&file, volume.clone(), &EnvironmentImages::new())?;
    Ok(Arc::new(Snapshot { epoch, scene }))
}

fn finish(canvas: &mut Canvas, view: &mut View, snapshot: &Arc<Snapshot>) -> anyhow::Result<Drawn> {
    let target = Target { width: PIXELS, height: PIXELS, samples_per_pixel: 1 };
    Ok(canvas.renderer().draw(view, &DrawRequest { snapshot, target, budget: None })?)
}

/// Of the pass that computes light; the least that can be told where it did not run.
fn illuminate_millis(drawn: &Drawn) -> f64 {
    const LEAST: f64 = 1e-3;
    let stage = drawn.stages.iter().find(|time| time.stage == "illuminate");
    stage.map_or(LEAST, |time| time.millis.max(LEAST))
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
