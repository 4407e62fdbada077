//! Suite `compression`: what clustered principal components leave out of a bake of `precomputed_transfer`,
//! and what they cost and save (the experiment of PVRT, table 2).

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, bail};
use proto::SceneFile;
use render::{BakeStore, DrawRequest, Drawn, View};
use scene::Snapshot;
use scene::plan::Target;
use serde_json::{Value, json};

use super::drawing::Canvas;
use super::edits::finish;
use super::report::{Line, Table, columns, line_chart, rounded};
use super::scenes::{Loaded, STANDARD, Size};

/// Scenes, each with the grid of its bake: opaque matter with surfaces, and smoke that scatters forward.
const SCENES: [(&str, u32); 2] = [("pillars", 24), ("smoke_sky", 32)];
/// Numbers of clusters; 0: the matrices as they are.
const CLUSTERS: [u32; 5] = [0, 32, 64, 128, 256];
/// Photons of a bake.
const PHOTONS: u32 = 131_072;
/// Pixels along each axis.
const PIXELS: u32 = 48;
/// Times that light is edited; the quickest counts.
const RUNS: u32 = 5;
/// Clock ticks of the system in a second.
const TICKS: f64 = 100.0;

const COLUMNS: [&str; 9] = [
    "scene",
    "rows",
    "clusters",
    "matrices_l2_percent",
    "picture_l2_percent",
    "picture_bias_percent",
    "compression_seconds",
    "device_mib",
    "light_edit_millis",
];

/// Measures every scene with every number of clusters. Each bake is made once.
///
/// # Errors
/// No device, or it refuses; nothing can be written.
pub fn run(out: &Path) -> anyhow::Result<()> {
    let bakes = out.join("compression-bakes");
    let mut canvas = Canvas::open()?;
    canvas.renderer().keep_bakes(Some(Arc::new(BakeStore::open(&bakes, 1 << 32)?)));
    let mut table = Table {
        name: "compression",
        about: json!({"device": canvas.device(), "volume": vec![Size::Small.volume_edge(); 3],
            "image": [PIXELS, PIXELS], "photons": PHOTONS,
            "errors": "relative L2, to the matrices as they are and to the picture with them",
            "compression": "processor time of all threads, reading back included",
            "light edit": "as in `edits`: software devices processor time of light and a picture of 2 x 2 \
                           pixels, others wall clock of the pass that computes light; the quickest run counts",
            "device_mib": "what the finished light keeps on the device, the field included"}),
        columns: columns(&COLUMNS),
        rows: Vec::new(),
    };
    let mut lines = Vec::new();
    for (name, grid) in SCENES {
        let standard = STANDARD.iter().find(|standard| standard.name == name);
        let loaded = standard.with_context(|| format!("no scene `{name}`"))?.load(Size::Small)?;
        let mut reference: Option<Vec<f32>> = None;
        let mut line = Line { label: name.to_owned(), points: Vec::new() };
        for clusters in CLUSTERS {
            let measured = Measured::of(&mut canvas, &loaded, grid, clusters)?;
            let expected = reference.get_or_insert_with(|| measured.picture.clone());
            line.points.push((f64::from(clusters), 100.0 * measured.left_out));
            table.rows.push(measured.cells(name, clusters, expected));
            table.write(out)?;
        }
        lines.push(line);
    }
    canvas.renderer().keep_bakes(None);
    std::fs::remove_dir_all(&bakes)?;
    std::fs::write(out.join("compression.md"), table.markdown(&COLUMNS))?;
    let title = "What compression leaves out of a bake";
    line_chart(&out.join("compression.svg"), title, "clusters", "matrices, relative L2, per cent", &lines)
}

/// A bake with one number of clusters.
struct Measured {
    rows: u64,
    left_out: f64,
    seconds: f64,
    device_bytes: u64,
    edit_millis: f64,
    picture: Vec<f32>,
}

impl Measured {
    fn of(canvas: &mut Canvas, loaded: &Loaded, grid: u32, clusters: u32) -> anyhow::Result<Self> {
        let mut view = View::new();
        let baked = draw(canvas, &mut view, &snapshot(loaded, grid, 0, 0.0, 1)?)?;
        let whole = snapshot(loaded, grid, clusters, 0.0, 2)?;
        let before = process_seconds()?;
        let drawn = match clusters {
            0 => draw(canvas, &mut view, &whole)?,
            _ => finish(canvas, &mut view, &whole)?.0,
        };
        let seconds = if clusters > 0 { process_seconds()? - before } else { 0.0 };
        let finished = draw(canvas, &mut view, &whole)?;
        let picture = canvas.renderer().radiance(&view)?.rgb;
        let mut edit_millis = f64::INFINITY;
        for run in 0..RUNS {
            let sunny = snapshot(loaded, grid, clusters, 1.0 + f64::from(run), 3 + run)?;
            let (edited, millis) = finish(canvas, &mut view, &sunny)?;
            if edited.counters.get("transfer_rays_marched") != Some(&0) {
                bail!("an edit of light touched the bake");
            }
            edit_millis = edit_millis.min(millis);
        }
        let counter = |drawn: &Drawn, name: &str| drawn.counters.get(name).copied();
        Ok(Self {
            rows: counter(&baked, "transfer_rows").unwrap_or(0),
            left_out: counter(&drawn, "transfer_compression_error_ppm").unwrap_or(0) as f64 * 1e-6,
            seconds,
            device_bytes: finished.gpu_bytes.get("light").copied().unwrap_or(0),
            edit_millis,
            picture,
        })
    }

    fn cells(&self, scene: &str, clusters: u32, expected: &[f32]) -> Vec<Value> {
        let pairs = || self.picture.iter().zip(expected).map(|(a, b)| (f64::from(*a), f64::from(*b)));
        let squared: f64 = pairs().map(|(a, b)| (a - b) * (a - b)).sum();
        let all: f64 = pairs().map(|(_, b)| b * b).sum();
        let sums = pairs().fold((0.0, 0.0), |sums, pair| (sums.0 + pair.0, sums.1 + pair.1));
        vec![
            json!(scene),
            json!(self.rows),
            json!(clusters),
            rounded(100.0 * self.left_out),
            rounded(100.0 * (squared / all).sqrt()),
            rounded(100.0 * (sums.0 / sums.1 - 1.0)),
            rounded(self.seconds),
            rounded(self.device_bytes as f64 / f64::from(1 << 20)),
            rounded(self.edit_millis),
        ]
    }
}

/// The scene with a sun of this irradiance beside its lights; 0: without.
fn snapshot(
    loaded: &Loaded,
    grid: u32,
    clusters: u32,
    sun: f64,
    epoch: u32,
) -> anyhow::Result<Arc<Snapshot>> {
    let mut file = serde_json::to_value(&loaded.file)?;
    file["illumination"] = json!({"method": "precomputed_transfer", "transfer_grid": grid,
        "transfer_photons": PHOTONS, "transfer_clusters": clusters});
    if sun > 0.0 {
        let light = json!({"id": "sun", "type": "directional", "direction": [-0.3, -1, -0.5], "irradiance": vec![sun; 3]});
        file["lights"].as_array_mut().context("a scene without lights")?.push(light);
    }
    let scene = loaded.scene(&SceneFile::from_value(file)?)?;
    Ok(Arc::new(Snapshot { epoch, scene }))
}

fn draw(canvas: &mut Canvas, view: &mut View, snapshot: &Arc<Snapshot>) -> anyhow::Result<Drawn> {
    let target = Target { width: PIXELS, height: PIXELS, samples_per_pixel: 4 };
    Ok(canvas.renderer().draw(view, &DrawRequest { snapshot, target, budget: None })?)
}

/// Processor time of the process, threads that ended included.
fn process_seconds() -> anyhow::Result<f64> {
    let text = std::fs::read_to_string("/proc/self/stat")?;
    // Behind the name, which may hold anything: user and system ticks are the 14th and 15th field.
    let (_, fields) = text.rsplit_once(") ").context("/proc/self/stat has another form")?;
    let ticks = fields.split(' ').skip(11).take(2).map(str::parse::<f64>);
    Ok(ticks.sum::<Result<f64, _>>()? / TICKS)
}
