//! Suite `accuracy`: run time against error, of every method of the ladder on every standard scene.

mod errors;
mod gate;
mod page;
mod plot;

use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use proto::FieldError;
use serde_json::{Value, json};

use super::drawing::{Canvas, Drawing};
use super::methods::{Entry, FULL, Judge, LADDER, Setting};
use super::references::{Quality, References, Truth};
use super::report::{Table, columns, rounded};
use super::scenes::{Loaded, STANDARD, Size, Standard};
use errors::Errors;

/// Longest a picture may take.
const PATIENCE: Duration = Duration::from_secs(900);

/// What to measure.
pub struct Plan<'a> {
    /// Names of scenes; empty: all.
    pub scenes: &'a [String],
    /// How large.
    pub size: Size,
    /// Where reports go.
    pub out: &'a Path,
    /// Where references are kept.
    pub references: &'a Path,
}

/// Everything about one scene.
struct Measured {
    standard: &'static Standard,
    loaded: Loaded,
    full: Truth,
    methods: Vec<MethodOnScene>,
}

impl Measured {
    /// Whether any method draws it.
    fn has_points(&self) -> bool {
        self.methods.iter().any(|method| method.points.is_ok())
    }
}

/// A method on a scene.
struct MethodOnScene {
    entry: &'static Entry,
    /// The reference of what it claims; `None`: it claims everything.
    same: Option<Truth>,
    /// One a setting; or why it cannot draw the scene.
    points: Result<Vec<Point>, FieldError>,
}

/// A picture at a setting.
struct Point {
    setting: &'static Setting,
    drawing: Drawing,
    same: Errors,
    full: Errors,
    /// Whether nothing measured on this scene is both quicker and nearer to full transport.
    pareto: bool,
}

pub fn run(plan: &Plan<'_>) -> anyhow::Result<()> {
    let scenes = chosen(plan.scenes, plan.size == Size::Quick)?;
    let references = References::open(plan.references)?;
    let mut canvas = Canvas::open()?;
    let mut measured = Vec::new();
    for standard in scenes {
        eprintln!("tyndall: accuracy: {}", standard.name);
        measured.push(measure(&mut canvas, &references, standard, plan.size).context(standard.name)?);
    }
    let about = about(&canvas, plan.size);
    table(&measured, &about).write(plan.out)?;
    for scene in &measured {
        if scene.has_points() {
            plot::write(scene, plan.out)?;
        }
    }
    page::write(&measured, &about, plan.out)?;
    if plan.size == Size::Quick { gate::check(&measured, plan.out) } else { Ok(()) }
}

/// The standard scenes of these names; of no names: all, or those of the short form.
///
/// # Errors
/// A name that no scene has.
pub fn chosen(names: &[String], quick: bool) -> Result<Vec<&'static Standard>, crate::Refused> {
    let known = || STANDARD.iter().map(|standard| standard.name).collect::<Vec<_>>().join(", ");
    if names.is_empty() {
        return Ok(STANDARD.iter().filter(|standard| !quick || standard.quick).collect());
    }
    let find = |name: &String| {
        let found = STANDARD.iter().find(|standard| standard.name == name);
        found.ok_or_else(|| crate::Refused(format!("--scenes: unknown scene `{name}`; known: {}", known())))
    };
    names.iter().map(find).collect()
}

fn about(canvas: &Canvas, size: Size) -> Value {
    let (volume, image) = (size.volume_edge(), size.image_edge());
    json!({
        "device": canvas.device(),
        "size": size.name(),
        "volume": [volume, volume, volume],
        "image": [image, image],
        "clock": "wall clock, from an empty view to the finished film, volume on the device; the quickest of up to seven",
        "errors": "relative L2 of linear radiance, the reference's own noise taken out, with its standard error; bias of the mean; 95th percentile and FLIP with what a picture without error would get (floor)",
        "flip_pixels_per_degree": rounded(super::flip::PIXELS_PER_DEGREE),
    })
}

fn measure(
    canvas: &mut Canvas,
    references: &References,
    standard: &'static Standard,
    size: Size,
) -> anyhow::Result<Measured> {
    let loaded = standard.load(size)?;
    let image = [size.image_edge(); 2];
    let reference = |judge: &Judge| -> anyhow::Result<Truth> {
        let truth = references.get(&loaded, judge, image, &Quality::of(size, judge.transport))?;
        let (made, source) = (&truth.made, if truth.cached { "kept from before" } else { "computed" });
        let error = 100.0 * made.relative_error;
        eprintln!(
            "  reference, transport {}: {} samples, {error:.2} % noise, {source}",
            judge.name, made.samples
        );
        Ok(truth)
    };
    let full = reference(&FULL)?;
    let mut methods = Vec::new();
    for entry in LADDER {
        let claims_all = entry.judge.transport == FULL.transport && entry.judge.orders.is_none();
        let refused = render::check(&loaded.scene(&entry.usually(&loaded.file)?)?).err();
        if let Some(refused) = refused {
            methods.push(MethodOnScene { entry, same: None, points: Err(refused) });
            continue;
        }
        let same = if claims_all { None } else { Some(reference(&entry.judge)?) };
        let mut points = Vec::new();
        for setting in entry.settings.iter().filter(|setting| size != Size::Quick || setting.quick) {
            let scene = loaded.scene(&entry.applied(&loaded.file, setting)?)?;
            // Time is no part of the short form.
            let drawing = match size {
                Size::Quick => canvas.draw(&scene, image, None, PATIENCE),
                Size::Small | Size::Large => canvas.time(&scene, image, PATIENCE),
            };
            let drawing = drawing.context(setting.label)?;
            let against = |truth| Errors::of(&drawing.radiance, truth, &loaded.file.film, image[0] as usize);
            let against_full = against(&full);
            let against_same = same.as_ref().map_or(against_full, against);
            points.push(Point { setting, same: against_same, full: against_full, drawing, pareto: false });
        }
        methods.push(MethodOnScene { entry, same, points: Ok(points) });
    }
    mark_pareto(&mut methods);
    Ok(Measured { standard, loaded, full, methods })
}

/// Marks the points that no other one beats in both time and error.
fn mark_pareto(methods: &mut [MethodOnScene]) {
    let all: Vec<[f64; 2]> = methods
        .iter()
        .flat_map(|method| method.points.iter().flatten())
        .map(|point| [point.drawing.millis, point.full.linear.relative_l2])
        .collect();
    for point in methods.iter_mut().flat_map(|method| method.points.iter_mut().flatten()) {
        point.pareto = on_front([point.drawing.millis, point.full.linear.relative_l2], &all);
    }
}

fn on_front([millis, error]: [f64; 2], all: &[[f64; 2]]) -> bool {
    !all.iter().any(|&[m, e]| m <= millis && e <= error && (m < millis || e < error))
}

/// Names of the error columns, each once for the same and once for full transport.
const ERROR_COLUMNS: [&str; 8] = [
    "relative_l2",
    "uncertainty",
    "bias",
    "bias_uncertainty",
    "percentile_95",
    "percentile_95_floor",
    "flip",
    "flip_floor",
];

fn error_cells(errors: &Errors) -> [Value; 8] {
    let linear = &errors.linear;
    [
        linear.relative_l2,
        linear.uncertainty,
        linear.bias,
        linear.bias_uncertainty,
        linear.percentile_95,
        errors.percentile_95_floor,
        errors.flip,
        errors.flip_floor,
    ]
    .map(rounded)
}

fn table(measured: &[Measured], about: &Value) -> Table {
    let points =
        || measured.iter().flat_map(|m| &m.methods).flat_map(|method| method.points.iter().flatten());
    let counters: std::collections::BTreeSet<&String> =
        points().flat_map(|point| point.drawing.counters.keys()).collect();
    let mut names = columns(&["scene", "method", "setting", "left_out", "wall_millis", "pareto"]);
    for judge in ["same", "full"] {
        names.push(format!("{judge}_transport"));
        names.extend(ERROR_COLUMNS.map(|name| format!("{judge}_{name}")));
        names.push(format!("{judge}_reference_error"));
        names.push(format!("{judge}_reference_samples"));
    }
    names.extend(counters.iter().map(|&name| name.clone()));
    let width = names.len();
    let mut rows = Vec::new();
    for scene in measured {
        for method in &scene.methods {
            let head = |setting: &str| {
                vec![json!(scene.standard.name), json!(method.entry.method.name()), json!(setting)]
            };
            let points = match &method.points {
                Ok(points) => points,
                Err(refused) => {
                    let mut row = head("");
                    row.push(json!(refused.to_string()));
                    row.resize(width, Value::Null);
                    rows.push(row);
                    continue;
                }
            };
            for point in points {
                let mut row = head(point.setting.label);
                row.extend([Value::Null, rounded(point.drawing.millis), json!(point.pareto)]);
                let same = method.same.as_ref().unwrap_or(&scene.full);
                let judges =
                    [(method.entry.judge.name, &point.same, same), (FULL.name, &point.full, &scene.full)];
                for (name, errors, truth) in judges {
                    row.push(json!(name));
                    row.extend(error_cells(errors));
                    row.push(rounded(truth.made.relative_error));
                    row.push(json!(truth.made.samples));
                }
                row.extend(counters.iter().map(|name| json!(point.drawing.counters.get(*name))));
                rows.push(row);
            }
        }
    }
    Table { name: "accuracy", about: about.clone(), columns: names, rows }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_what_nothing_beats() {
        let all = [[1.0, 0.5], [2.0, 0.1], [3.0, 0.1], [2.0, 0.6], [4.0, 0.01]];
        let front: Vec<bool> = all.iter().map(|&point| on_front(point, &all)).collect();
        assert_eq!(front, [true, true, false, false, true]);
    }
}
