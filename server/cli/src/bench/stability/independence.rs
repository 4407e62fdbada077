//! Brightness does not depend on how finely a scene is sampled: steps on view rays, levels of detail,
//! the number of voxels of one and the same field, and the grid that light is kept on.

use std::sync::Arc;
use std::time::Duration;

use proto::SceneFile;
use proto::scene_file::Builtin;
use scene::levels::Reduction;
use scene::part::Part;
use serde_json::json;

use super::case::usual_scene;
use crate::bench::drawing::Canvas;
use crate::bench::methods::Entry;
use crate::bench::scenes::{Loaded, prepared};

/// Pixels along each axis.
const IMAGE: [u32; 2] = [32, 32];
const PATIENCE: Duration = Duration::from_secs(120);
/// Voxels along each axis of the finest field.
const EDGE: usize = 64;

/// Brightness of a photon map varies by 1 to 2 % with the usual 16 thousand photons, as much as may be; with
/// these by a third of that.
const MANY_PHOTONS: &str = r#"{"illumination": {"photons": 131072}}"#;
/// A patch without anything.
const UNCHANGED: &str = "{}";

/// A pair of pictures that must be equally bright.
pub struct Pair {
    /// What differs.
    pub name: String,
    /// Mean of the coarser picture over that of the finer one.
    pub ratio: f64,
    /// How far from 1 it may be.
    pub tolerance: f64,
}

impl Pair {
    pub fn is_right(&self) -> bool {
        (self.ratio - 1.0).abs() <= self.tolerance
    }
}

/// Measures a method.
///
/// # Errors
/// A picture that cannot be drawn.
pub fn measure(canvas: &mut Canvas, entry: &Entry) -> anyhow::Result<Vec<Pair>> {
    // Random estimates are right on average: their noise is allowed for.
    let noise = if entry.noisy { 0.03 } else { 0.0 };
    let mut pairs = Vec::new();
    for kind in [Builtin::ThickBlob, Builtin::SmokePlume] {
        let field = |edge: usize| {
            let mut json = usual_scene();
            json["volume"] = json!({"builtin": kind.name()});
            let volume = prepared(scene::builtin::build(kind, [edge; 3], &|_| {}));
            let file = SceneFile::from_value(json)?;
            Ok::<_, anyhow::Error>(Loaded { file, volume, images: Default::default() })
        };
        let loaded = field(EDGE)?;
        let mut mean = |loaded: &Loaded, step: Option<f64>, patch: &str| -> anyhow::Result<f64> {
            let mut file = patched(&patched(&entry.usually(&loaded.file)?, MANY_PHOTONS)?, patch)?;
            if let Some(step) = step {
                file.sampling.step_voxels = step;
            }
            let drawing = canvas.draw(&loaded.scene(&file)?, IMAGE, None, PATIENCE)?;
            Ok(drawing.radiance.iter().flatten().sum())
        };
        let finest = mean(&loaded, Some(0.25), UNCHANGED)?;
        for (step, tolerance) in [(2.0, 0.05), (1.0, 0.02), (0.5, 0.01)] {
            let name = format!("{}: step {step} against 1/4 voxel", kind.name());
            let ratio = mean(&loaded, Some(step), UNCHANGED)? / finest;
            pairs.push(Pair { name, ratio, tolerance: tolerance + noise });
        }
        let full = mean(&loaded, None, UNCHANGED)?;
        for (level, tolerance) in [(1, 0.02), (2, 0.06)] {
            let whole = &loaded.volume;
            let part = Part::of_region(whole.volume.dims, level, None);
            let coarser = Loaded {
                file: loaded.file.clone(),
                volume: Arc::new(whole.part(&part, None, Reduction::of(loaded.file.volume.filter))),
                images: Default::default(),
            };
            let name = format!("{}: level {level} against level 0", kind.name());
            let ratio = mean(&coarser, None, UNCHANGED)? / full;
            pairs.push(Pair { name, ratio, tolerance: tolerance + noise });
        }
        if let Some((patch, tolerance)) = entry.halved {
            let name = format!("{}: grid half as fine", kind.name());
            pairs.push(Pair { name, ratio: mean(&loaded, None, patch)? / full, tolerance });
        }
        let ratio = mean(&field(EDGE / 2)?, None, UNCHANGED)? / full;
        let name = format!("{}: {}^3 against {EDGE}^3 voxels", kind.name(), EDGE / 2);
        pairs.push(Pair { name, ratio, tolerance: 0.03 + noise });
    }
    Ok(pairs)
}

fn patched(file: &SceneFile, patch: &str) -> anyhow::Result<SceneFile> {
    let mut json = serde_json::to_value(file)?;
    json_patch::merge(&mut json, &serde_json::from_str(patch)?);
    Ok(SceneFile::from_value(json)?)
}
