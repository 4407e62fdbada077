//! Each kind of "not needed" on the device: work and time with and without it, and that the picture is
//! the same.

use std::sync::Arc;
use std::time::Duration;

use proto::SceneFile;
use proto::scene_file::Builtin;
use render::{DrawRequest, Drawn, View};
use scene::plan::Target;
use scene::{EnvironmentImages, Scene, Snapshot};
use serde_json::{Value, json};

use super::{Row, Same};
use crate::bench::drawing::{Canvas, Drawing};
use crate::bench::methods::Entry;
use crate::bench::scenes::{Loaded, prepared};

/// Longest a picture may take.
const PATIENCE: Duration = Duration::from_secs(300);
/// Variants of a shader may round differently.
const VARIANTS: f64 = 1e-5;
/// What finer parts of a ray change at a step of one voxel.
const FINER_PARTS: f64 = 5e-3;

/// Two scenes that must look the same; the second one lacks what nothing needs.
struct Kind {
    name: &'static str,
    how: &'static str,
    scene: Builtin,
    /// Patches of that scene: where it is done nevertheless, and where it is not.
    done: Value,
    left_out: Value,
    same: Same,
}

/// Edits after which nothing has to be drawn.
struct Edit {
    name: &'static str,
    how: &'static str,
    base: Value,
    edit: Value,
    /// Whether only methods without light from light to matter and on to matter cannot see it.
    local: bool,
}

fn kinds() -> Vec<Kind> {
    let lights = |irradiance: f64| -> Value {
        let mut lights = vec![
            json!({"id": "key", "type": "directional", "direction": [0.6, -0.6, -0.5], "irradiance": [4.5, 4.0, 3.2]}),
        ];
        lights.extend((0..8).map(|i| {
            json!({"type": "directional", "direction": [-1.0, -f64::from(i), -1.0], "irradiance": [irradiance, irradiance, irradiance]})
        }));
        json!({"lights": lights})
    };
    // A last point that no value reaches: the scene has the feature, the picture has not.
    let unreached = |point: Value| {
        json!({"value_range": [0, 1.0], "transfer_function": {"points": [
            {"s": 0, "extinction": 0, "material": "smoke"}, {"s": 0.03, "extinction": 0, "material": "smoke"},
            {"s": 0.9, "extinction": 40, "material": "smoke"}, {"s": 0.999_999, "extinction": 40, "material": "smoke"}, point]}})
    };
    let plain = || unreached(json!({"s": 1, "extinction": 40, "material": "smoke"}));
    let mut shiny = unreached(json!({"s": 1, "extinction": 40, "material": "shiny"}));
    shiny["materials"] = json!({"shiny": {"surface": 1, "brdf": {"type": "lambert", "diffuse": 0.5}}});
    let phase = |phase: Value| json!({"materials": {"smoke": {"phase": phase}}});
    vec![
        Kind {
            name: "empty space",
            how: "sampling.skip_empty off and on",
            scene: Builtin::VesselTree,
            done: json!({"sampling": {"skip_empty": false}}),
            left_out: json!({}),
            same: Same::Bits,
        },
        Kind {
            name: "behind opaque matter",
            how: "sampling.termination_transmittance 0 and its default",
            scene: Builtin::Pillars,
            done: json!({"sampling": {"termination_transmittance": 0}}),
            left_out: json!({}),
            same: Same::Within(2e-3),
        },
        Kind {
            name: "isotropic phase",
            how: "Henyey-Greenstein with g = 0 and isotropic",
            scene: Builtin::SmokePlume,
            done: phase(json!({"type": "henyey_greenstein", "g": 0})),
            left_out: phase(json!({"type": "isotropic"})),
            same: Same::Within(VARIANTS),
        },
        Kind {
            name: "no surface (BRDF)",
            how: "a surface at a value that no voxel has, and none",
            scene: Builtin::SmokePlume,
            done: shiny,
            left_out: plain(),
            // Where there may be normals, rays are cut into parts that bend less.
            same: Same::Within(FINER_PARTS),
        },
        Kind {
            name: "no emission",
            how: "emission at a value that no voxel has, and none",
            scene: Builtin::SmokePlume,
            done: unreached(
                json!({"s": 1, "extinction": 40, "emission": [1, 1, 1], "albedo": [0.5, 0.5, 0.5], "material": "smoke"}),
            ),
            left_out: plain(),
            same: Same::Within(VARIANTS),
        },
        Kind {
            name: "unused light",
            how: "eight lights of power 1e-30, and of power 0",
            scene: Builtin::SmokePlume,
            done: lights(1e-30),
            left_out: lights(0.0),
            same: Same::Within(VARIANTS),
        },
    ]
}

fn edits() -> Vec<Edit> {
    let black = json!({"transfer_function": {"points": [
        {"s": 0, "extinction": 0, "albedo": [0, 0, 0]}, {"s": 1, "extinction": 30, "albedo": [0, 0, 0], "emission": [1, 0.6, 0.2]}]}});
    vec![
        Edit { name: "unchanged scene", how: "drawn again", base: json!({}), edit: json!({}), local: false },
        Edit {
            name: "albedo 0",
            how: "lights removed from black matter that glows",
            base: black,
            edit: json!({"lights": []}),
            local: false,
        },
        Edit {
            name: "unused light",
            how: "a light without power added",
            base: json!({"lights": []}),
            edit: json!({"lights": [{"type": "directional", "direction": [-1, -1, -1], "irradiance": [0, 0, 0]}]}),
            local: false,
        },
        Edit {
            name: "shadows that the method has not",
            how: "clip.shadows and scattering.orders edited",
            base: json!({}),
            edit: json!({"clip": {"shadows": false}, "scattering": {"orders": 1}}),
            local: true,
        },
    ]
}

/// Measures a method on volumes and pictures of these edges; the short form takes no trouble over times.
///
/// # Errors
/// A picture that cannot be drawn.
pub fn measure(
    canvas: &mut Canvas,
    entry: &Entry,
    voxels: usize,
    pixels: u32,
    quick: bool,
) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for kind in kinds() {
        let loaded = load(entry, kind.scene, voxels)?;
        let mut draw = |scene: &Scene| {
            if quick {
                canvas.draw(scene, [pixels; 2], None, PATIENCE)
            } else {
                canvas.time(scene, [pixels; 2], PATIENCE)
            }
        };
        let done = draw(&patched(entry, &loaded, &[&kind.done])?)?;
        let left_out = draw(&patched(entry, &loaded, &[&kind.left_out])?)?;
        let count = |counters: &std::collections::BTreeMap<String, u64>| counters.get(entry.work).copied();
        rows.push(Row {
            kind: kind.name,
            how: kind.how,
            unit: entry.work,
            work: [count(&done.counters), count(&left_out.counters)].map(Option::unwrap_or_default),
            millis: [done.millis, left_out.millis],
            difference: largest_difference(&done.radiance, &left_out.radiance),
            // Random estimates with other features draw other numbers.
            same: if entry.noisy && kind.same != Same::Bits { Same::OnAverage } else { kind.same },
            mean_ratio: mean_ratio(&done.radiance, &left_out.radiance),
            mean_uncertainty: mean_error(&done).hypot(mean_error(&left_out)),
        });
    }
    let local = entry.judge.transport == reference::Transport::Local;
    for edit in edits().into_iter().filter(|edit| local || !edit.local) {
        rows.push(after_edit(canvas, entry, &edit, voxels, pixels)?);
    }
    Ok(rows)
}

/// What an edit that cannot be seen costs a view that is up to date, against an empty one.
fn after_edit(
    canvas: &mut Canvas,
    entry: &Entry,
    edit: &Edit,
    voxels: usize,
    pixels: u32,
) -> anyhow::Result<Row> {
    let loaded = load(entry, Builtin::SmokePlume, voxels)?;
    let before = Arc::new(Snapshot { epoch: 1, scene: patched(entry, &loaded, &[&edit.base])? });
    let after = Arc::new(Snapshot { epoch: 2, scene: patched(entry, &loaded, &[&edit.base, &edit.edit])? });
    let samples_per_pixel = after.scene.samples_at_rest();
    let target = Target { width: pixels, height: pixels, samples_per_pixel };
    let mut view = View::new();
    let mut draw = |view: &mut View, snapshot: &Arc<Snapshot>| -> anyhow::Result<(Drawn, f64)> {
        let began = std::time::Instant::now();
        let drawn = canvas.renderer().draw(view, &DrawRequest { snapshot, target, budget: None })?;
        Ok((drawn, began.elapsed().as_secs_f64() * 1e3))
    };
    draw(&mut view, &before)?;
    let (kept, kept_millis) = draw(&mut view, &after)?;
    let mut fresh = View::new();
    let (scratch, scratch_millis) = draw(&mut fresh, &after)?;
    let work = |drawn: &Drawn| drawn.counters.get(entry.work).copied().unwrap_or(0);
    let mut pixels_of = |view: &View| -> anyhow::Result<Vec<[f64; 3]>> {
        let rgb = canvas.renderer().radiance(view)?.rgb;
        Ok(rgb.as_chunks::<3>().0.iter().map(|pixel| pixel.map(f64::from)).collect())
    };
    let (a, b) = (pixels_of(&fresh)?, pixels_of(&view)?);
    Ok(Row {
        kind: edit.name,
        how: edit.how,
        unit: entry.work,
        work: [work(&scratch), work(&kept)],
        millis: [scratch_millis, kept_millis],
        difference: largest_difference(&a, &b),
        same: Same::Bits,
        mean_ratio: mean_ratio(&a, &b),
        mean_uncertainty: 0.0,
    })
}

/// A built-in scene, with those of its lights that the method takes.
fn load(entry: &Entry, kind: Builtin, voxels: usize) -> anyhow::Result<Loaded> {
    let volume = prepared(scene::builtin::build(kind, [voxels; 3], &|_| {}));
    let mut loaded = Loaded { file: scene::builtin::scene(kind)?, volume, images: EnvironmentImages::new() };
    for light in std::mem::take(&mut loaded.file.lights) {
        loaded.file.lights.push(light);
        if render::check(&patched(entry, &loaded, &[])?).is_err() {
            loaded.file.lights.pop();
        }
    }
    Ok(loaded)
}

fn patched(entry: &Entry, loaded: &Loaded, patches: &[&Value]) -> anyhow::Result<Scene> {
    let mut json = serde_json::to_value(entry.usually(&loaded.file)?)?;
    patches.iter().for_each(|patch| json_patch::merge(&mut json, patch));
    Ok(loaded.scene(&SceneFile::from_value(json)?)?)
}

/// Largest difference of a channel over the largest value of the first picture.
fn largest_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let largest = a.iter().flatten().fold(f64::MIN_POSITIVE, |largest, x| largest.max(*x));
    let differences = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max) / largest
}

/// Standard error of a picture's mean over it. The channels of a pixel share their random numbers.
fn mean_error(drawing: &Drawing) -> f64 {
    let variance: f64 = drawing.standard_error.iter().map(|e| e.iter().sum::<f64>().powi(2)).sum();
    let light: f64 = drawing.radiance.iter().flatten().sum();
    if light > 0.0 { variance.sqrt() / light } else { 0.0 }
}

fn mean_ratio(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    b.iter().flatten().sum::<f64>() / a.iter().flatten().sum::<f64>()
}
