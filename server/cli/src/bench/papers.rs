//! Suite `papers`: the tables of the papers of `convection_diffusion` and `image_based`, taken anew, and
//! those of exchange between records.
//!
//! Every row is a method with its settings on a scene: the first picture, then edits of each kind one after
//! the other, each timed once as the light it computes and as the whole; and the error against paths.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use proto::SceneFile;
use proto::scene_file::Builtin;
use render::{DrawRequest, View};
use scene::plan::Target;
use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Scene, Snapshot};
use serde_json::{Value, json};

use super::drawing::Canvas;
use super::report::{Table, columns, rounded};
use super::scenes::prepared;

/// Pixels.
const IMAGE: [u32; 2] = [64, 48];
/// Voxels along each axis of the volume whose picture compiles.
const WARM_UP_EDGE: usize = 8;
/// Samples per pixel.
const SAMPLES: u32 = 8;
/// Paths of each pixel of the picture that counts as true.
const PATHS: u32 = 2048;
/// Light cells, or rays of records, beyond which a row is left out on a software device.
const MOST_IN_SOFTWARE: u64 = 20_000_000;
/// Diffused light is slower.
const MOST_DIFFUSED_IN_SOFTWARE: u64 = 64 * 64 * 64;
/// Name of the picture of light in scene files.
const SKY: &str = "sky";

/// What an error is taken against.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Truth {
    /// Light that is scattered once.
    Single,
    /// All light.
    Full,
}

/// What is lit, and by what.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lit {
    /// Smoke under a smooth picture of light.
    SmokeUnderPicture,
    /// Smoke under so many lights with a direction.
    SmokeUnderLights(usize),
    /// Dense wax under two lamps and uniform light.
    Wax,
}

/// One row.
struct Row {
    table: &'static str,
    label: String,
    lit: Lit,
    /// Voxels along each axis.
    edge: usize,
    illumination: Value,
    /// A merge patch of the scene.
    patch: Value,
    truth: Option<Truth>,
    /// Cells, or rays, that it works on.
    amount: u64,
    most_in_software: u64,
}

impl Row {
    fn new(table: &'static str, label: String, lit: Lit, edge: usize, illumination: Value) -> Self {
        let (patch, most_in_software) = (json!({}), MOST_IN_SOFTWARE);
        Self { table, label, lit, edge, illumination, patch, truth: None, amount: 0, most_in_software }
    }

    fn against(self, truth: Truth) -> Self {
        Self { truth: Some(truth), ..self }
    }

    fn file(&self) -> anyhow::Result<Value> {
        let kind = match self.lit {
            Lit::Wax => Builtin::ThickBlob,
            _ => Builtin::SmokePlume,
        };
        let mut file = serde_json::to_value(scene::builtin::scene(kind)?)?;
        match self.lit {
            Lit::Wax => {}
            Lit::SmokeUnderPicture => {
                file["lights"] = json!([{"id": SKY, "type": "environment", "image": SKY}]);
            }
            Lit::SmokeUnderLights(count) => file["lights"] = (0..count).map(light).collect(),
        }
        file["volume"]["dims"] = json!([self.edge, self.edge, self.edge]);
        file["illumination"] = self.illumination.clone();
        file["sampling"] = json!({"samples_per_pixel": SAMPLES});
        json_patch::merge(&mut file, &self.patch);
        Ok(file)
    }
}

/// One of several, from afar or from a place.
fn light(number: usize) -> Value {
    let id = format!("light {number}");
    let (sin, cos) = (1.2 * number as f64).sin_cos();
    match number % 2 {
        0 => {
            json!({"id": id, "type": "directional", "direction": [0.6 * cos, -0.6, -0.5 + 0.3 * sin], "irradiance": [3, 2.7, 2.2]})
        }
        _ => {
            json!({"id": id, "type": "point", "position": [cos, 0.6, 0.8 * sin], "intensity": [0.8, 1, 1.4]})
        }
    }
}

/// A gradient with a broad lobe.
fn picture() -> anyhow::Result<EnvironmentImage> {
    const WIDTH: usize = 64;
    const HEIGHT: usize = 32;
    let texel = |index: usize| {
        let (x, y) = ((index % WIDTH) as f64 / WIDTH as f64, (index / WIDTH) as f64 / HEIGHT as f64);
        let lobe = (-18.0 * ((x - 0.7).powi(2) + (y - 0.25).powi(2))).exp();
        [0.25 + 0.2 * (1.0 - y) + 2.2 * lobe, 0.3 + 0.25 * (1.0 - y) + 1.9 * lobe, 0.5 - 0.2 * y + 1.4 * lobe]
    };
    let rgb: Vec<f32> = (0..WIDTH * HEIGHT).flat_map(texel).map(|x| x as f32).collect();
    Ok(EnvironmentImage::new(WIDTH, HEIGHT, &rgb)?)
}

/// Every row of every table; fewer in the short form.
fn rows(quick: bool) -> Vec<Row> {
    let mut rows = Vec::new();
    // Zhang and Ma, table 2: resolutions of the light volume, light carried and light spread.
    let grids: &[u32] = if quick { &[16, 32] } else { &[16, 32, 64, 128, 256] };
    for diffusion in ["none", "p1"] {
        for &cells in grids {
            let edge = if cells > 128 { 128 } else { 64 };
            let grid = f64::from(cells) / edge as f64;
            let settings =
                json!({"method": "convection_diffusion", "light_grid": grid, "diffusion": diffusion});
            let row = Row::new(
                "light grid",
                format!("{cells}^3, {diffusion}"),
                Lit::SmokeUnderLights(1),
                edge,
                settings,
            );
            let most_in_software =
                if diffusion == "p1" { MOST_DIFFUSED_IN_SOFTWARE } else { MOST_IN_SOFTWARE };
            rows.push(Row { amount: u64::from(cells).pow(3), most_in_software, ..row });
        }
    }
    // Their table 1: lights.
    for diffusion in ["none", "p1"] {
        for count in 1..=if quick { 2 } else { 5 } {
            let settings = json!({"method": "convection_diffusion", "diffusion": diffusion});
            rows.push(Row::new(
                "lights",
                format!("{count}, {diffusion}"),
                Lit::SmokeUnderLights(count),
                64,
                settings,
            ));
        }
    }
    // How light is carried: the published explicit scheme, the same solved directly, and ours.
    let carried = [json!({}), json!({"transport": "upwind"})].into_iter();
    let steps = [5, 10, 20].map(|steps| json!({"transport": "explicit", "explicit_steps": steps}));
    for transport in carried.chain(steps) {
        for cells in if quick { vec![32] } else { vec![32, 64] } {
            let mut settings = json!({"method": "convection_diffusion", "light_grid": f64::from(cells) / 64.0, "diffusion": "none"});
            json_patch::merge(&mut settings, &transport);
            let label = format!("{cells}^3, {transport}");
            let row = Row::new("transport", label, Lit::SmokeUnderLights(1), 64, settings);
            rows.push(row.against(Truth::Single));
        }
    }
    // Their figure 7: a smoke with diffusion coefficients 0, 1 and 10, in squares of a cell.
    for coefficient in [0.0, 1.0, 10.0f64] {
        let mut settings =
            json!({"method": "convection_diffusion", "light_grid": 0.667, "diffusion": "heat"});
        if coefficient > 0.0 {
            settings["heat_spread"] = json!(coefficient.sqrt() / 32.0);
        } else {
            settings["diffusion"] = json!("none");
        }
        let label = format!("{coefficient} cells^2");
        rows.push(Row::new("heat flow", label, Lit::SmokeUnderLights(2), 48, settings).against(Truth::Full));
    }
    // Errors by grid.
    for cells in [12, 24, 48, 72].into_iter().take(if quick { 2 } else { 4 }) {
        for lit in [Lit::SmokeUnderLights(2), Lit::Wax] {
            let name = if lit == Lit::Wax { "wax" } else { "smoke" };
            let settings = json!({"method": "convection_diffusion", "light_grid": f64::from(cells) / 48.0});
            let row = Row::new("error by grid", format!("{name}, {cells}^3"), lit, 48, settings);
            rows.push(row.against(Truth::Full));
        }
    }
    // Delalandre and others, table 1: records, each ours and as published.
    let published = json!({"record_form": "isotropic", "record_lookup": "containing"});
    for records in [10, 50, 100].into_iter().take(if quick { 1 } else { 3 }) {
        for (name, form) in [("ours", json!({})), ("as published", published.clone())] {
            let mut settings = json!({"method": "image_based", "records": records});
            json_patch::merge(&mut settings, &form);
            let row =
                Row::new("records", format!("{records}^3, {name}"), Lit::SmokeUnderPicture, 64, settings);
            rows.push(row.against(Truth::Single));
        }
    }
    // Bands of the light as published; and of ours, where matter tells directions apart.
    let forward = json!({"materials": {"smoke": {"phase": {"type": "henyey_greenstein", "g": 0.6}}}});
    for bands in if quick { 1..=2 } else { 1..=6 } {
        let settings = json!({"method": "image_based", "record_bands": bands, "record_form": "isotropic"});
        let row = Row::new("bands", format!("{bands}, as published"), Lit::SmokeUnderPicture, 48, settings);
        rows.push(row.against(Truth::Single));
        let settings = json!({"method": "image_based", "record_bands": bands, "record_directions": 192});
        let row = Row::new("bands", format!("{bands}, ours, g = 0.6"), Lit::SmokeUnderPicture, 48, settings);
        rows.push(Row { patch: forward.clone(), ..row }.against(Truth::Single));
    }
    // The announced exchange between records, beside other methods.
    for (name, lit) in [
        ("smoke", Lit::SmokeUnderPicture),
        ("smoke, two lights", Lit::SmokeUnderLights(2)),
        ("wax", Lit::Wax),
    ] {
        for (label, settings) in exchanges(quick) {
            let row = Row::new("exchange", format!("{name}: {label}"), lit, 48, settings);
            rows.push(row.against(Truth::Full));
        }
    }
    rows
}

/// Settings that are compared for all orders of scattering.
fn exchanges(quick: bool) -> Vec<(String, Value)> {
    let records = |rounds: u32| {
        let settings = json!({"method": "image_based", "record_exchange": rounds});
        (format!("32^3 records, {rounds} rounds"), settings)
    };
    let mut all: Vec<(String, Value)> = [0, 4].map(records).into();
    if !quick {
        all.extend([1, 2, 8, 16, 32, 64].map(records));
    }
    let coarse =
        json!({"method": "image_based", "records": 20, "record_directions": 12, "record_exchange": 16});
    all.push(("20^3 records, 12 directions, 16 rounds".into(), coarse));
    all.push(("convection_diffusion, 1/2".into(), json!({"method": "convection_diffusion"})));
    let fine = json!({"method": "convection_diffusion", "light_grid": 1.0});
    all.push(("convection_diffusion, 1".into(), fine));
    all.push(("photon_map, 65 k".into(), json!({"method": "photon_map"})));
    let more = json!({"method": "photon_map", "photons": 262_144, "photon_grid": 32});
    all.push(("photon_map, 262 k, 32 texels".into(), more));
    all
}

/// Takes all tables, or some rows of some.
///
/// # Errors
/// No device, out of memory, a disk that cannot be written.
pub fn run(tables: &[String], quick: bool, out: &Path) -> anyhow::Result<()> {
    let mut canvas = Canvas::open()?;
    let software = canvas.device().software;
    let mut names = vec!["table", "setting", "error_percent", "noise_percent", "left_out"];
    names.extend(["first_light_millis", "first_millis", "brighter_light_millis", "brighter_millis"]);
    names.extend(["turned_light_millis", "turned_millis", "camera_light_millis", "camera_millis"]);
    names.extend(["matter_light_millis", "matter_millis"]);
    let about = json!({"device": canvas.device(), "image": IMAGE, "samples_per_pixel": SAMPLES, "paths": PATHS,
        "clock": "wall clock, each once, after a picture that compiled; edits one after the other",
        "error": "relative L2 to paths, their noise taken out"});
    let mut table = Table { name: "papers", about, columns: columns(&names), rows: Vec::new() };
    let mut truths: Vec<(Value, Vec<f32>, f64)> = Vec::new();
    let wanted = |row: &Row| tables.is_empty() || tables.iter().any(|name| name == row.table);
    for row in rows(quick).iter().filter(|row| wanted(row)) {
        eprintln!("tyndall: papers: {}, {}", row.table, row.label);
        let mut cells = vec![json!(row.table), json!(row.label)];
        if software && row.amount > row.most_in_software {
            cells.extend([Value::Null, Value::Null, json!("minutes on a software device")]);
            cells.resize(names.len(), Value::Null);
        } else {
            let measured = measure(&mut canvas, row, &mut truths)?;
            let [error, noise] =
                measured.error.map_or([Value::Null, Value::Null], |of| of.map(|x| rounded(100.0 * x)));
            cells.extend([error, noise, Value::Null]);
            cells.extend(measured.millis.iter().flatten().map(|millis| rounded(*millis)));
        }
        table.rows.push(cells);
    }
    table.write(out)?;
    std::fs::write(out.join("papers.md"), table.markdown(&names))?;
    Ok(())
}

/// Of a row.
struct Measured {
    /// Of the first picture and of each edit: light, and the whole.
    millis: Vec<[f64; 2]>,
    /// Relative L2 to paths, and their noise.
    error: Option<[f64; 2]>,
}

fn measure(
    canvas: &mut Canvas,
    row: &Row,
    truths: &mut Vec<(Value, Vec<f32>, f64)>,
) -> anyhow::Result<Measured> {
    let file = row.file()?;
    let kind = SceneFile::from_value(file.clone())?.volume.builtin.unwrap_or(Builtin::SmokePlume);
    let volume = prepared(scene::builtin::build(kind, [row.edge; 3], &|_| {}));
    let images: EnvironmentImages = [(SKY.to_owned(), Arc::new(picture()?))].into();
    let scene = |file: &Value| scene_of(file, &volume, &images);
    // Compiles.
    let few = prepared(scene::builtin::build(kind, [WARM_UP_EDGE; 3], &|_| {}));
    draw(canvas, &mut View::new(), &scene_of(&file, &few, &images)?)?;
    let mut view = View::new();
    let mut millis = vec![draw(canvas, &mut view, &scene(&file)?)?];
    let first = canvas.renderer().radiance(&view)?.rgb;
    // One after the other.
    let mut edited = file.clone();
    for edit in [brighter, turned, camera, matter] {
        edit(&mut edited);
        millis.push(draw(canvas, &mut view, &scene(&edited)?)?);
    }
    let error = match row.truth {
        None => None,
        Some(truth) => Some(error(canvas, &file, truth, &scene, &first, truths)?),
    };
    Ok(Measured { millis, error })
}

fn scene_of(file: &Value, volume: &Arc<PreparedVolume>, images: &EnvironmentImages) -> anyhow::Result<Scene> {
    Ok(Scene::with_images(&SceneFile::from_value(file.clone())?, volume.clone(), images)?)
}

/// Milliseconds of light, and of the whole.
fn draw(canvas: &mut Canvas, view: &mut View, scene: &Scene) -> anyhow::Result<[f64; 2]> {
    let snapshot = Arc::new(Snapshot { epoch: 1, scene: scene.clone() });
    let [width, height] = IMAGE;
    let target = Target { width, height, samples_per_pixel: scene.samples_at_rest() };
    let began = Instant::now();
    let drawn = canvas
        .renderer()
        .draw(view, &DrawRequest { snapshot: &snapshot, target, budget: None::<Duration> })?;
    let whole = began.elapsed().as_secs_f64() * 1e3;
    let light =
        drawn.stages.iter().filter(|stage| stage.stage == "illuminate").map(|stage| stage.millis).sum();
    Ok([light, whole])
}

/// All light twice as strong.
fn brighter(file: &mut Value) {
    for light in file["lights"].as_array_mut().into_iter().flatten() {
        match light["type"].as_str() {
            Some("environment") if light["image"].is_string() => light["scale"] = json!(2),
            Some("environment") => light["radiance"] = json!([0.3, 0.3, 0.3]),
            Some("directional") => light["irradiance"] = json!([6, 5, 4]),
            _ => light["intensity"] = json!([2, 2, 2]),
        }
    }
}

/// The first light moved, or the picture of light turned.
fn turned(file: &mut Value) {
    let light = &mut file["lights"][0];
    match light["type"].as_str() {
        Some("environment") => light["rotation_degrees"] = json!([0, 40, 0]),
        Some("directional") => light["direction"] = json!([0.3, -0.7, -0.6]),
        _ => light["position"] = json!([-0.3, 0.45, 0.3]),
    }
}

fn camera(file: &mut Value) {
    file["camera"]["position"] = json!([0.7, 0.2, 1.9]);
}

/// The densest matter half as dense again.
fn matter(file: &mut Value) {
    if let Some(densest) =
        file["transfer_function"]["points"].as_array_mut().and_then(|points| points.last_mut())
    {
        densest["extinction"] = json!(1.5 * densest["extinction"].as_f64().unwrap_or(1.0));
    }
}

/// Relative L2 of a picture to paths, and their noise.
fn error(
    canvas: &mut Canvas,
    file: &Value,
    truth: Truth,
    scene: &impl Fn(&Value) -> anyhow::Result<Scene>,
    picture: &[f32],
    truths: &mut Vec<(Value, Vec<f32>, f64)>,
) -> anyhow::Result<[f64; 2]> {
    let mut traced = file.clone();
    traced["illumination"] = json!({"method": "path_traced", "paths_per_pixel": PATHS});
    if truth == Truth::Single {
        traced["scattering"] = json!({"orders": 1});
    }
    if !truths.iter().any(|(of, ..)| *of == traced) {
        let drawing = canvas.draw(&scene(&traced)?, IMAGE, None, Duration::MAX)?;
        let square = |pixels: &[[f64; 3]]| pixels.iter().flatten().map(|x| x * x).sum::<f64>();
        let noise = (square(&drawing.standard_error) / square(&drawing.radiance)).sqrt();
        let rgb = drawing.radiance.iter().flatten().map(|x| *x as f32).collect();
        truths.push((traced.clone(), rgb, noise));
    }
    let Some((_, exact, noise)) = truths.iter().find(|(of, ..)| *of == traced) else {
        anyhow::bail!("the picture of paths is missing");
    };
    let square = |x: f32| f64::from(x).powi(2);
    let off: f64 = picture.iter().zip(exact).map(|(a, b)| square(a - b)).sum();
    let all: f64 = exact.iter().map(|b| square(*b)).sum();
    Ok([(off / all - noise * noise).max(0.0).sqrt(), *noise])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_and_edit_fits_the_format() {
        let volume = prepared(scene::builtin::build(Builtin::SmokePlume, [4; 3], &|_| {}));
        let images: EnvironmentImages = [(SKY.to_owned(), Arc::new(picture().unwrap()))].into();
        for row in rows(false) {
            for edit in [brighter, turned, camera, matter] {
                let mut file = row.file().unwrap();
                let before = file.clone();
                edit(&mut file);
                assert!(file != before, "{}: {}", row.table, row.label);
                let scene = scene_of(&file, &volume, &images).unwrap();
                render::check(&scene).unwrap();
            }
        }
    }
}
