//! `tyndall render`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use proto::SceneFile;
use proto::scene_file::limits::{MAX_IMAGE_EDGE, MAX_PATHS_PER_PIXEL};
use render::fit::DEFAULT_MAX_TEXTURE_BYTES;
use render::{
    AdapterPolicy, BakeStore, DEFAULT_BAKE_BYTES, DrawRequest, Drawn, Gpu, PathEstimate, Renderer, View,
    still,
};
use scene::plan::Target;
use scene::{Integrator, Scene, Snapshot};
use serde_json::{Value, json};

use crate::Refused;
use crate::scene_on_disk::SceneOnDisk;

/// Samples per pixel where a time budget is the only bound.
const MAX_SAMPLES_PER_PIXEL: u32 = 4096;

#[derive(clap::Args)]
pub struct Arguments {
    /// Scene file (JSON).
    scene: PathBuf,
    /// Image to write: .png is tone-mapped; .exr and .npy are linear float32 RGB.
    #[arg(short, long, value_name = "OUT.{png,exr,npy}")]
    out: PathBuf,
    /// Image size; default: the scene's.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// Illumination method; default: the scene's.
    #[arg(long, value_name = "M")]
    method: Option<String>,
    /// Keep adding samples for this long.
    #[arg(long, value_name = "S")]
    budget_seconds: Option<f64>,
    /// Stop at this relative standard error, 0..1: root mean square of the pixels' standard errors
    /// over that of their means. For methods that know theirs.
    #[arg(long, value_name = "E")]
    max_error: Option<f64>,
    /// JSON merge patch applied to the running scene, incrementally; may be repeated. The picture
    /// is drawn after each; the last is written.
    #[arg(long, value_name = "PATCH.json")]
    edit: Vec<PathBuf>,
    /// Sets one value before drawing, for example density=2; may be repeated.
    #[arg(long, value_name = "PATH=JSON")]
    set: Vec<String>,
    /// Writes times, exact work counters, what each edit reused, and the histogram of what the clip
    /// region keeps.
    #[arg(long, value_name = "STATS.json")]
    stats: Option<PathBuf>,
    /// Largest volume on the GPU, bytes; a larger one is drawn at a coarser level, with a notice.
    #[arg(long, value_name = "N", default_value_t = DEFAULT_MAX_TEXTURE_BYTES)]
    max_texture_bytes: u64,
    /// Directory that keeps what `precomputed_transfer` bakes, made if absent: the next run with the same
    /// matter takes it from there, and one that was broken off goes on.
    #[arg(long, value_name = "DIR")]
    bakes: Option<PathBuf>,
    /// Prints the plan of each picture: every pass, whether it runs, and why not.
    #[arg(long)]
    explain: bool,
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let edge = |part: &str| part.parse().ok().filter(|edge| (1..=MAX_IMAGE_EDGE).contains(edge));
    let size = text.split_once('x').and_then(|(w, h)| Some((edge(w)?, edge(h)?)));
    size.ok_or_else(|| {
        format!("expected WxH in pixels, each from 1 to {MAX_IMAGE_EDGE}, for example 640x400")
    })
}

/// How a picture leaves.
#[derive(Clone, Copy)]
enum Output {
    Png,
    Exr,
    Npy,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    // Find every fault that needs no drawing before drawing.
    let output = output_kind(&arguments.out)?;
    if arguments.budget_seconds.is_some_and(|s| !s.is_finite() || s <= 0.0) {
        return Err(Refused("--budget-seconds: must be above 0".into()).into());
    }
    let mut disk = SceneOnDisk::read(&arguments.scene)?;
    for assignment in &arguments.set {
        let (path, value) = assignment
            .split_once('=')
            .ok_or_else(|| Refused(format!("--set {assignment}: expected PATH=JSON")))?;
        let value = serde_json::from_str(value)
            .map_err(|error| Refused(format!("--set {assignment}: the value is not JSON: {error}")))?;
        disk.set(path, value)?;
    }
    if let Some(method) = &arguments.method {
        disk.set("illumination.method", json!(method))?;
    }
    if let Some(error) = arguments.max_error {
        if !(error > 0.0 && error <= 1.0) {
            return Err(Refused("--max-error: must be above 0 and at most 1".into()).into());
        }
        disk.set("illumination.max_error", json!(error))?;
    }
    let edits = arguments.edit.iter().map(|path| read_patch(path)).collect::<anyhow::Result<Vec<Value>>>()?;
    let (file, scene) = disk.scene()?;
    let knows_error = scene.integrator() == Integrator::PathTracer || scene.is_refined();
    if arguments.max_error.is_some() && !knows_error {
        let method = scene.method.name();
        let message = format!(
            "--max-error: `{method}` keeps no estimate of its error; use --budget-seconds, or a method that \
             approximates all light with --set illumination.refine=true"
        );
        return Err(Refused(message).into());
    }

    let gpu = Gpu::open(AdapterPolicy::Any)?;
    // Without edits nothing is kept for them.
    let view = if edits.is_empty() { View::new() } else { View::for_edits() };
    let mut session = Session { renderer: Renderer::new(gpu)?, view, epoch: 0, arguments };
    if let Some(folder) = &arguments.bakes {
        let store = BakeStore::open(folder, DEFAULT_BAKE_BYTES)
            .with_context(|| format!("cannot use {}", folder.display()))?;
        session.renderer.keep_bakes(Some(Arc::new(store)));
    }
    let volumes = session.renderer.volumes().clone();
    // Nobody shares the device.
    volumes.set_budget_bytes(u64::MAX);
    let most = arguments.max_texture_bytes;
    let scene = disk.fit(&file, scene, &volumes, most)?;
    let initial = session.draw(&file, scene, "scene")?;
    let mut reports = Vec::new();
    for (index, patch) in edits.iter().enumerate() {
        disk.merge(patch);
        let name = arguments.edit[index].display().to_string();
        let (file, scene) = disk.scene().with_context(|| format!("--edit {name}"))?;
        let scene = disk.fit(&file, scene, &volumes, most)?;
        reports.push(session.draw(&file, scene, &name)?);
    }
    session.write(output, &arguments.out)?;
    if let Some(path) = &arguments.stats {
        let info = session.renderer.gpu().info();
        let stats = json!({"device": info, "initial": initial, "edits": reports});
        std::fs::write(path, serde_json::to_string_pretty(&stats)?)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// The running scene: one view, edited as a session would be.
struct Session<'a> {
    renderer: Renderer,
    view: View,
    epoch: u32,
    arguments: &'a Arguments,
}

impl Session<'_> {
    /// Draws the scene and reports what that took.
    fn draw(&mut self, file: &SceneFile, scene: Scene, name: &str) -> anyhow::Result<Value> {
        self.epoch += 1;
        let (width, height) = self.arguments.size.unwrap_or((file.image.width, file.image.height));
        // A time or an error are the only bounds where they are given.
        let until_bound = match scene.integrator() {
            Integrator::RayCaster if scene.is_refined() => {
                scene.sampling.samples_per_pixel + MAX_PATHS_PER_PIXEL
            }
            Integrator::RayCaster => MAX_SAMPLES_PER_PIXEL,
            Integrator::PathTracer => MAX_PATHS_PER_PIXEL,
        };
        let bounded = self.arguments.budget_seconds.is_some() || self.arguments.max_error.is_some();
        let samples_per_pixel = if bounded { until_bound } else { scene.samples_at_rest() };
        let snapshot = Arc::new(Snapshot { epoch: self.epoch, scene });
        let budget = self.arguments.budget_seconds.map(Duration::from_secs_f64);
        let target = Target { width, height, samples_per_pixel };
        let began = Instant::now();
        let mut drawn =
            self.renderer.draw(&mut self.view, &DrawRequest { snapshot: &snapshot, target, budget })?;
        // The first pass is always finished, whatever the budget.
        while drawn.samples_per_pixel == 0 {
            let more = Target { samples_per_pixel: 1, ..target };
            let request = DrawRequest { snapshot: &snapshot, target: more, budget: None };
            let rest = self.renderer.draw(&mut self.view, &request)?;
            for (name, count) in rest.counters {
                *drawn.counters.entry(name).or_default() += count;
            }
            drawn.samples_per_pixel = rest.samples_per_pixel;
            drawn.estimate = rest.estimate;
        }
        let millis = began.elapsed().as_secs_f64() * 1e3;
        // A session tone-maps and reads back after each edit, too.
        let began = Instant::now();
        self.renderer.picture(&mut self.view)?;
        let picture_millis = began.elapsed().as_secs_f64() * 1e3;
        if self.arguments.explain {
            explain(name, &drawn);
        }
        let histogram = self.arguments.stats.is_some().then(|| {
            let counts = scene::region::histogram_in_clip(&snapshot.scene);
            json!({"value_range": snapshot.scene.volume.range, "counts": counts})
        });
        let mut report = json!({
            "name": name, "millis": millis, "picture_millis": picture_millis, "samples_per_pixel": drawn.samples_per_pixel, "changes": drawn.plan.changes,
            "plan": drawn.plan.report(), "stages": drawn.stages, "counters": drawn.counters,
            "histogram_in_view": histogram,
        });
        let count = |name: &str| drawn.counters.get(name).copied().unwrap_or(0);
        // What is kept between edits, by kind.
        let kinds = [("segments", "segments_cast"), ("tiles", "tiles_recomputed")]
            .into_iter()
            .chain([("photons", "photons_recomputed"), ("bricks", "bricks_recomputed")]);
        for (kind, recomputed) in kinds {
            let (reused, recomputed) = (count(&format!("{kind}_reused")), count(recomputed));
            if reused + recomputed > 0 {
                let total = reused + recomputed;
                report[kind] = json!({"total": total, "reused": reused, "recomputed": recomputed});
            }
        }
        if let Some(&total) = drawn.counters.get("records") {
            let recomputed = count("records_renewed");
            report["records"] =
                json!({"total": total, "reused": total.saturating_sub(recomputed), "recomputed": recomputed});
        }
        if let Some(PathEstimate { relative_error, cut }) = drawn.estimate {
            report["relative_error"] = json!(relative_error);
            report["throughput_cut"] = json!(cut);
        }
        Ok(report)
    }

    fn write(&mut self, output: Output, path: &Path) -> anyhow::Result<()> {
        let bytes = match output {
            Output::Png => still::png(&self.renderer.picture(&mut self.view)?)?,
            Output::Exr => still::exr(&self.renderer.radiance(&self.view)?)?,
            Output::Npy => still::npy(&self.renderer.radiance(&self.view)?),
        };
        std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
    }
}

fn output_kind(path: &Path) -> Result<Output, Refused> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("png") => Ok(Output::Png),
        Some("exr") => Ok(Output::Exr),
        Some("npy") => Ok(Output::Npy),
        _ => Err(Refused(format!("{}: the name must end in .png, .exr or .npy", path.display()))),
    }
}

fn read_patch(path: &Path) -> anyhow::Result<Value> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let patch = serde_json::from_str(&text);
    Ok(patch.map_err(|error| Refused(format!("{}: not valid JSON: {error}", path.display())))?)
}

fn explain(name: &str, drawn: &Drawn) {
    let changes =
        if drawn.plan.changes.is_empty() { "nothing".into() } else { drawn.plan.changes.join(", ") };
    println!("{name}: changed: {changes}");
    for pass in drawn.plan.report() {
        let verdict = if pass.runs { "run " } else { "skip" };
        let work = if pass.runs { format!(" ({} {})", pass.work, pass.unit) } else { String::new() };
        println!("  {verdict} {:<26}{}{work}", pass.pass, pass.reason);
    }
}
