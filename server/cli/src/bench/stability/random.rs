//! Scenes by chance, from tame to absurd. A scene that fails is made smaller as long as it fails.

use std::cell::RefCell;
use std::time::Duration;

use proptest::collection::vec;
use proptest::prelude::{Just, Strategy, prop_oneof};
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};
use proto::SceneFile;
use proto::scene_file::Builtin;
use scene::EnvironmentImages;
use serde_json::{Value, json};

use super::judge::{draw, reference};
use crate::bench::drawing::Canvas;
use crate::bench::methods::Entry;
use crate::bench::scenes::{Loaded, prepared};

/// Pixels.
const IMAGE: [u32; 2] = [12, 8];
/// Time for each reference.
const REFERENCE_TIME: Duration = Duration::from_millis(150);
/// Most pictures drawn on the way from a failing scene to the smallest.
const SHRINKING: u32 = 200;

/// What came of many scenes.
pub struct Many {
    /// Scenes drawn.
    pub scenes: u32,
    /// The smallest scene found that fails, as JSON, and why.
    pub failed: Option<(String, String)>,
    /// Relative L2 against the method's reference, ascending; random scenes are not converged, so it
    /// is stated, not judged.
    pub errors: Vec<f64>,
    /// The scene with the largest of them, as JSON.
    pub worst: String,
}

/// A scene as chance makes it: plain values, each of which can shrink.
#[derive(Debug, Clone)]
struct Recipe {
    kind: Builtin,
    dims: [usize; 3],
    spacing: [f64; 3],
    density: f64,
    points: Vec<(f64, f64, [f64; 3], f64, bool)>,
    asymmetry: f64,
    surface: f64,
    lights: Vec<Value>,
    eye: [f64; 3],
    field_of_view: f64,
    clip: Option<[[f64; 3]; 2]>,
    nearest: bool,
}

impl Recipe {
    fn json(&self) -> Value {
        let mut points: Vec<_> = self.points.clone();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let point = |(s, extinction, albedo, emission, plain): &(f64, f64, [f64; 3], f64, bool)| {
            json!({"s": s, "extinction": extinction, "albedo": albedo, "emission": [emission, emission, emission],
                "material": if *plain { "default" } else { "m" }})
        };
        let mut json = json!({
            "version": 1,
            "volume": {"builtin": self.kind.name(), "dims": self.dims, "filter": if self.nearest { "nearest" } else { "linear" }},
            "spacing": self.spacing, "density": self.density,
            "transfer_function": {"points": points.iter().map(point).collect::<Vec<_>>()},
            "materials": {"m": {"phase": {"type": "henyey_greenstein", "g": self.asymmetry}, "surface": self.surface,
                "brdf": {"type": "blinn_phong", "diffuse": 0.7, "specular": 0.2, "exponent": 40}}},
            "lights": self.lights,
            "camera": {"position": self.eye, "target": [0.01, 0.02, -0.01], "up": [0.1, 1, 0.05], "fov_y_degrees": self.field_of_view},
            "background": [0.1, 0.1, 0.1]
        });
        if let Some(clip) = self.clip {
            json["clip"] = json!({"box": clip});
        }
        json
    }
}

/// A number between powers of ten, as likely small as large.
fn decades(low: f64, high: f64) -> impl Strategy<Value = f64> + Clone {
    (low..high).prop_map(|exponent| 10f64.powf(exponent))
}

fn place(reach: f64) -> impl Strategy<Value = [f64; 3]> + Clone {
    let one = -reach..reach;
    [one.clone(), one.clone(), one]
}

fn unit3() -> impl Strategy<Value = [f64; 3]> + Clone {
    [0.0..=1.0f64, 0.0..=1.0, 0.0..=1.0]
}

fn light() -> impl Strategy<Value = Value> {
    let grey = |power: f64| [power; 3];
    prop_oneof![
        (place(1.0), decades(-3.0, 3.0)).prop_map(move |(d, power)| {
            json!({"type": "directional", "direction": [d[0], d[1] - 1.001, d[2]], "irradiance": grey(power)})
        }),
        (place(2.0), decades(-3.0, 3.0))
            .prop_map(move |(p, power)| json!({"type": "point", "position": p, "intensity": grey(power)})),
        (place(2.0), 0.0..0.5, decades(-3.0, 3.0)).prop_map(move |(p, radius, power)| {
            json!({"type": "sphere", "center": p, "radius": radius, "radiance": grey(power)})
        }),
        (place(2.0), 0.0..2.0, decades(-3.0, 3.0)).prop_map(move |(p, edge, power)| {
            json!({"type": "rectangle", "center": p, "normal": [0, -1, 0], "up": [0, 0, 1], "size": [edge, edge], "radiance": grey(power)})
        }),
    ]
}

fn recipe() -> impl Strategy<Value = Recipe> {
    let kind = prop_oneof![
        Just(Builtin::Homogeneous),
        Just(Builtin::ThickBlob),
        Just(Builtin::SmokePlume),
        Just(Builtin::NestedShells),
        Just(Builtin::VesselTree)
    ];
    let extinction = prop_oneof![Just(0.0), decades(-6.0, 6.0)];
    let emission = prop_oneof![3 => Just(0.0), 1 => decades(-3.0, 6.0)];
    let point = (0.0..=1.0f64, extinction, unit3(), emission, proptest::bool::ANY);
    let asymmetry = prop_oneof![Just(0.0), -0.999..0.999f64];
    let surface = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0f64];
    let clip = proptest::option::weighted(0.3, (unit3(), unit3()));
    let shape =
        (kind, [1..20usize, 1..20, 1..20], [decades(-2.0, 2.0), decades(-2.0, 2.0), decades(-2.0, 2.0)]);
    let matter = (decades(-2.0, 2.0), vec(point, 1..6), asymmetry, surface);
    let view = (vec(light(), 0..4), place(2.0), 0.1..179.0f64, clip, proptest::bool::weighted(0.2));
    (shape, matter, view).prop_map(
        |(
            (kind, dims, spacing),
            (density, points, asymmetry, surface),
            (lights, eye, field_of_view, clip, nearest),
        )| {
            let clip = clip.map(|(a, b): ([f64; 3], [f64; 3])| {
                [[0, 1, 2].map(|i| a[i].min(b[i])), [0, 1, 2].map(|i| a[i].max(b[i]))]
            });
            Recipe {
                kind,
                dims,
                spacing,
                density,
                points,
                asymmetry,
                surface,
                lights,
                eye,
                field_of_view,
                clip,
                nearest,
            }
        },
    )
}

/// Draws `count` scenes, the same ones each time.
pub fn many(canvas: &mut Canvas, entry: &Entry, count: u32) -> Many {
    let canvas = RefCell::new(canvas);
    let errors = RefCell::new(Vec::new());
    let test = |recipe: &Recipe| -> Result<(), String> {
        let volume = prepared(scene::builtin::build(recipe.kind, recipe.dims, &|_| {}));
        let file = SceneFile::from_value(recipe.json()).map_err(|refused| format!("refused: {refused}"))?;
        let loaded = Loaded { file, volume, images: EnvironmentImages::new() };
        let drawn = draw(*canvas.borrow_mut(), entry, &loaded, IMAGE);
        let (drawing, outcome) = match drawn {
            Ok(drawn) => drawn,
            Err(outcome) => return outcome.fault.map_or(Ok(()), Err),
        };
        if let Some(fault) = outcome.fault {
            eprintln!("tyndall: stability: by chance: {fault}: {}", recipe.json());
            return Err(fault);
        }
        let (truth, _) = reference(entry, &loaded, IMAGE, REFERENCE_TIME)?;
        let exact = vec![[0.0; 3]; drawing.radiance.len()];
        if truth.mean.iter().flatten().any(|x| *x > 0.0) {
            let found = reference::statistics::difference(
                &drawing.radiance,
                &exact,
                &truth.mean,
                &truth.standard_error,
            );
            errors.borrow_mut().push((found.relative_l2, recipe.clone()));
        }
        Ok(())
    };
    let failed =
        smallest_failing(&recipe(), count, test).map(|(recipe, why)| (recipe.json().to_string(), why));
    let mut errors = errors.into_inner();
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let worst = errors.last().map(|(_, recipe)| recipe.json().to_string()).unwrap_or_default();
    Many { scenes: count, failed, errors: errors.into_iter().map(|(error, _)| error).collect(), worst }
}

/// The smallest value found for which `test` fails, and why.
fn smallest_failing<T: std::fmt::Debug + Clone>(
    strategy: &impl Strategy<Value = T>,
    count: u32,
    test: impl Fn(&T) -> Result<(), String>,
) -> Option<(T, String)> {
    let config =
        Config { cases: count, failure_persistence: None, max_shrink_iters: SHRINKING, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    match runner.run(strategy, |value| test(&value).map_err(TestCaseError::fail)) {
        Ok(()) => None,
        Err(TestError::Fail(reason, value)) => Some((value, reason.message().to_owned())),
        // No strategy here rejects values.
        Err(TestError::Abort(_)) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failing_scene_is_made_smaller() {
        let test = |recipe: &Recipe| {
            if recipe.lights.len() >= 2 && recipe.dims[0] >= 5 { Err("too much".into()) } else { Ok(()) }
        };
        let (smallest, why) = smallest_failing(&recipe(), 200, test).unwrap();
        assert_eq!((smallest.lights.len(), smallest.dims, smallest.points.len()), (2, [5, 1, 1], 1));
        assert!(smallest.clip.is_none() && !smallest.nearest);
        assert_eq!(why, "too much");
    }

    #[test]
    fn every_scene_fits_the_format() {
        let fits = |recipe: &Recipe| {
            SceneFile::from_value(recipe.json()).map(|_| ()).map_err(|refused| refused.to_string())
        };
        assert!(smallest_failing(&recipe(), 500, fits).is_none());
    }
}
