//! The plan: which passes a frame needs, how much work each has, and why the others are skipped.
//!
//! A plain value, computed without a GPU from what each cache was computed from and the newest
//! scene. "Skip what a scene doesn't need" lives here and nowhere else.

use proto::plan::PassReport;
use proto::scene_file::{Method, RecordForm};

use crate::changes::Changes;
use crate::records::Records;
use crate::rendering::Rendering;
use crate::scene::{Integrator, Scene};

/// The passes of a frame, in the order they run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Pass {
    /// Voxels to the GPU.
    UploadVolume,
    /// Transfer function and materials to the GPU.
    UploadTransferFunction,
    /// Empty-space distance map from bin masks.
    DistanceMap,
    /// Bounds of the extinction from bin masks.
    Majorants,
    /// Lights to the GPU.
    UploadLights,
    /// Environment image to the GPU, with what is needed to sample it.
    UploadEnvironment,
    /// Light into its field.
    Illuminate,
    /// View-ray segments: what is kept of rays between edits of matter.
    ViewSegments,
    /// View rays into the film.
    RayCast,
    /// Paths into the film, or into the layers it is mixed from.
    PathTrace,
    /// Light layers into the film.
    MixLights,
    /// Film to picture.
    ToneMap,
}

impl Pass {
    /// Name in reports; equal to the shader file where there is one.
    pub fn name(self) -> &'static str {
        match self {
            Pass::UploadVolume => "upload_volume",
            Pass::UploadTransferFunction => "upload_transfer_function",
            Pass::DistanceMap => "distance_map",
            Pass::Majorants => "majorants",
            Pass::UploadLights => "upload_lights",
            Pass::UploadEnvironment => "upload_environment",
            Pass::Illuminate => "illuminate",
            Pass::ViewSegments => "view_segments",
            Pass::RayCast => "ray_cast",
            Pass::PathTrace => "path_trace",
            Pass::MixLights => "mix_lights",
            Pass::ToneMap => "tone_map",
        }
    }
}

/// Whether a pass runs, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlannedPass {
    /// Which.
    pub pass: Pass,
    /// Whether it runs.
    pub runs: bool,
    /// Why it runs, or why not.
    pub reason: String,
    /// Amount of work if it runs, else 0.
    pub work: u64,
    /// Unit of `work`.
    pub unit: &'static str,
}

/// The passes of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What changed since the film was drawn, in words.
    pub changes: Vec<String>,
    /// Every pass once, in order.
    pub passes: Vec<PlannedPass>,
    /// What becomes of the film.
    pub film: FilmPlan,
    /// What becomes of the view-ray segments of a film that starts again.
    pub segments: SegmentsPlan,
}

/// What becomes of view-ray segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SegmentsPlan {
    /// Rays are cast whole.
    Unused,
    /// Rays are cast in segments, which are kept.
    Record,
    /// Kept segments serve again, but for those that meet changed cells.
    Reuse {
        /// Share of the cells with matter, now or then, in which matter changed, 0..1.
        stale_share: f32,
    },
}

/// What becomes of the film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FilmPlan {
    /// It stays as it is.
    Keep,
    /// It is summed up anew from its light layers, which stay as they are.
    Mix,
    /// Samples are added to those it holds.
    Refine,
    /// It starts again.
    Restart,
    /// Tiles start again whose paths met matter of these bins; the others stay.
    RestartTiles {
        /// Bins in which matter changed.
        bins: u64,
        /// Share of the tiles whose paths were known to meet it when the last pass ended, 0..1.
        stale_share: f32,
    },
}

/// Size of the picture and how well it is to be sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Samples per pixel the film shall have.
    pub samples_per_pixel: u32,
}

/// A film as it stands.
#[derive(Debug, Clone, Copy)]
pub struct FilmState<'a> {
    /// The scene it shows.
    pub scene: &'a Scene,
    /// Its size and the samples per pixel it holds (of complete passes over the image).
    pub held: Target,
    /// Its relative standard error, where that is known.
    pub error: Option<f64>,
}

/// View-ray segments kept for a film size.
#[derive(Debug, Clone, Default)]
pub struct SegmentsState<'a> {
    /// Each segment was computed for one of these scenes; empty: there are no segments.
    pub bases: Vec<&'a Scene>,
    /// Whether edits are to come, so that the first picture already is cast in segments.
    pub wanted: bool,
    /// Whether the film as it stands is cast in segments.
    pub film_is_cast_in_them: bool,
    /// Whether a ray's segments for the film's size fit the device and the view's budget.
    pub fit: bool,
}

/// A light field.
#[derive(Debug, Clone, Copy, Default)]
pub struct LightState<'a> {
    /// The scene it is, or is becoming, the light of; `None`: there is no light yet.
    pub scene: Option<&'a Scene>,
    /// Whether it is all of it.
    pub complete: bool,
    /// Whether the film was begun in the light as it stands.
    pub film_is_lit_by_it: bool,
}

/// What each cache was computed from; `None`: it holds nothing.
#[derive(Debug, Clone, Default)]
pub struct Caches<'a> {
    /// Volume texture.
    pub volume: Option<&'a Scene>,
    /// Transfer-function tables.
    pub transfer_function: Option<&'a Scene>,
    /// Distance map.
    pub distance_map: Option<&'a Scene>,
    /// Bounds of the extinction.
    pub majorants: Option<&'a Scene>,
    /// Light table.
    pub lights: Option<&'a Scene>,
    /// Environment image.
    pub environment: Option<&'a Scene>,
    /// Light field.
    pub light: LightState<'a>,
    /// Film.
    pub film: Option<FilmState<'a>>,
    /// Tone-mapped picture: the scene and the film state it was made from.
    pub picture: Option<FilmState<'a>>,
    /// View-ray segments for the target's size.
    pub segments: SegmentsState<'a>,
    /// Bins that the paths of each tile of a path-traced film relied on.
    pub tiles: &'a [u64],
}

/// Why a cache is stale, or why it is not: `Err` carries the reason to keep it.
type Verdict = Result<String, String>;

impl Plan {
    /// The plan that brings `caches` to `scene` and `target`.
    pub fn new(caches: &Caches<'_>, scene: &Scene, target: Target) -> Self {
        let pixels = u64::from(target.width) * u64::from(target.height);
        let cells: usize = scene.volume.macrocells.dims.iter().product();
        let light_verdict = illuminate(&caches.light, scene);
        let film_verdict = draw_film(caches, scene, target, light_verdict.is_ok());
        let (film, samples_missing) = match &film_verdict {
            Ok((_, film, samples)) => (*film, u64::from(*samples)),
            Err(_) => (FilmPlan::Keep, 0),
        };
        let film_runs = film != FilmPlan::Keep;
        let paths_or_rays_run = film_runs && film != FilmPlan::Mix;
        let integrator = scene.integrator();
        let rays_only = |verdict: Verdict| match integrator {
            Integrator::RayCaster => verdict,
            Integrator::PathTracer => Err("paths are followed instead of rays".to_owned()),
        };
        let paths_only = |verdict: Verdict| match integrator {
            Integrator::RayCaster if scene.is_refined() => {
                Err("paths refine a picture that is complete".to_owned())
            }
            Integrator::RayCaster => Err("no paths are followed".to_owned()),
            Integrator::PathTracer => verdict,
        };
        let mut passes = Vec::new();
        let mut plan = |pass, verdict: Verdict, work: u64, unit| {
            let (runs, reason) = match verdict {
                Ok(reason) => (true, reason),
                Err(reason) => (false, reason),
            };
            passes.push(PlannedPass { pass, runs, reason, work: if runs { work } else { 0 }, unit });
        };
        let tables_needed = |verdict: Verdict| {
            let wanted = paths_or_rays_run || light_verdict.is_ok();
            if wanted { verdict } else { Err("no ray will be cast".to_owned()) }
        };
        let tracks = integrator == Integrator::PathTracer
            || matches!(scene.method, Method::PhotonMap | Method::PrecomputedTransfer);
        let tracked = |verdict: Verdict| {
            if tracks { verdict } else { Err("no paths are followed".to_owned()) }
        };
        plan(
            Pass::UploadVolume,
            tables_needed(upload_volume(caches.volume, scene)),
            scene.volume.volume.voxels.len() as u64,
            "voxels",
        );
        plan(
            Pass::UploadTransferFunction,
            tables_needed(upload_transfer_function(caches.transfer_function, scene)),
            scene.transfer_function.points.len() as u64,
            "points",
        );
        plan(
            Pass::DistanceMap,
            rays_only(tables_needed(distance_map(caches.distance_map, scene))),
            cells as u64,
            "cells",
        );
        plan(
            Pass::Majorants,
            tracked(tables_needed(majorants(caches.majorants, scene))),
            cells as u64,
            "cells",
        );
        plan(
            Pass::UploadLights,
            tables_needed(upload_lights(caches.lights, scene)),
            scene.lights.len() as u64,
            "lights",
        );
        let image = scene.environment_image();
        plan(
            Pass::UploadEnvironment,
            tables_needed(upload_environment(caches.environment, scene)),
            image.map_or(0, |(image, _)| image.texels().len() as u64),
            "texels",
        );
        plan(Pass::Illuminate, light_verdict.clone(), scene.lights.len() as u64, "lights");
        let segments = match film {
            _ if integrator == Integrator::PathTracer => Err("paths are followed instead of rays".into()),
            FilmPlan::Restart if scene.has_light_field() => {
                Err("light that changes reaches all segments".into())
            }
            FilmPlan::Restart => segments(caches, scene),
            _ => Err("no film starts again".into()),
        };
        let (segments, verdict) = match segments {
            Ok((segments, reason)) => (segments, Ok(reason)),
            Err(reason) => (SegmentsPlan::Unused, Err(reason)),
        };
        let all_segments = pixels * u64::from(scene.sampling.segments);
        plan(Pass::ViewSegments, verdict, all_segments, "segments a sample");
        let film_verdict = film_verdict.map(|(reason, ..)| reason);
        plan(Pass::RayCast, rays_only(film_verdict.clone()), pixels * samples_missing, "pixel samples");
        let (traced, mixed) = mixing(scene, film, film_verdict);
        plan(Pass::PathTrace, paths_only(traced), pixels * samples_missing, "paths");
        plan(Pass::MixLights, paths_only(mixed), pixels, "pixels");
        plan(Pass::ToneMap, tone_map(caches.picture, scene, target, film_runs), pixels, "pixels");
        let changes =
            caches.film.map_or_else(Vec::new, |film| Changes::between(film.scene, scene).in_words());
        Self { changes, passes, film, segments }
    }

    /// Takes over what the plan of the paths that refine the picture says of them.
    pub fn refined_by(&mut self, paths: &Plan) {
        let followed = paths.passes.iter().find(|planned| planned.pass == Pass::PathTrace);
        let own = self.passes.iter_mut().find(|planned| planned.pass == Pass::PathTrace);
        if let (Some(own), Some(followed)) = (own, followed) {
            own.clone_from(followed);
        }
    }

    /// Whether a pass runs.
    pub fn runs(&self, pass: Pass) -> bool {
        self.passes.iter().any(|planned| planned.pass == pass && planned.runs)
    }

    /// Whether nothing runs.
    pub fn is_empty(&self) -> bool {
        self.passes.iter().all(|planned| !planned.runs)
    }

    /// The plan as it travels.
    pub fn report(&self) -> Vec<PassReport> {
        let report = |planned: &PlannedPass| PassReport {
            pass: planned.pass.name().to_owned(),
            runs: planned.runs,
            reason: planned.reason.clone(),
            work: planned.work,
            unit: planned.unit.to_owned(),
        };
        self.passes.iter().map(report).collect()
    }
}

fn upload_volume(cached: Option<&Scene>, scene: &Scene) -> Verdict {
    match cached {
        None => Ok("not on the GPU yet".into()),
        Some(old) if old.volume.content != scene.volume.content => Ok("another volume".into()),
        Some(_) => Err("same voxels".into()),
    }
}

fn upload_transfer_function(cached: Option<&Scene>, scene: &Scene) -> Verdict {
    match cached {
        None => Ok("not on the GPU yet".into()),
        Some(old) if old.transfer_function == scene.transfer_function && old.materials == scene.materials => {
            Err("same transfer function and materials".into())
        }
        Some(_) => Ok("transfer function or materials edited".into()),
    }
}

fn distance_map(cached: Option<&Scene>, scene: &Scene) -> Verdict {
    if !scene.sampling.skip_empty {
        return Err("skipping is switched off".into());
    }
    match cached {
        None => Ok("not computed yet".into()),
        Some(old) if old.volume.content != scene.volume.content || old.filter != scene.filter => {
            Ok("other macrocell masks".into())
        }
        Some(old) if old.bins_in_view() != scene.bins_in_view() => {
            let changed = (old.bins_in_view() ^ scene.bins_in_view()).count_ones();
            Ok(format!("{changed} bins came into view or went out of it"))
        }
        Some(_) => Err("the same bins are in view".into()),
    }
}

fn upload_lights(cached: Option<&Scene>, scene: &Scene) -> Verdict {
    match cached {
        None => Ok("not on the GPU yet".into()),
        // For layers lights are taken to be white and of strength 1.
        Some(old) if old.shares_light_layers(scene) => Err("same lights but for their power".into()),
        Some(old) if old.lights == scene.lights && old.has_light_layers() == scene.has_light_layers() => {
            Err("same lights".into())
        }
        Some(_) => Ok("lights edited".into()),
    }
}

/// What paths do, and what becomes of their light layers.
fn mixing(scene: &Scene, film: FilmPlan, verdict: Verdict) -> (Verdict, Verdict) {
    if !scene.has_light_layers() {
        return (verdict, Err("light is not kept in layers".into()));
    }
    match (film, verdict) {
        (FilmPlan::Mix, Ok(reason)) => (Err("the light layers stay as they are".into()), Ok(reason)),
        (_, Ok(reason)) => (Ok(reason), Ok("the layers change".into())),
        (_, Err(reason)) => (Err(reason.clone()), Err(reason)),
    }
}

fn majorants(cached: Option<&Scene>, scene: &Scene) -> Verdict {
    match cached {
        None => Ok("not computed yet".into()),
        Some(old) => {
            let changes = Changes::between(old, scene);
            if changes.volume || old.sampling.skip_empty != scene.sampling.skip_empty {
                return Ok("other macrocells".into());
            }
            match changes.bins.count_ones() {
                0 => Err("the same matter in all bins".into()),
                changed => Ok(format!("matter changed in {changed} bins")),
            }
        }
    }
}

fn illuminate(state: &LightState<'_>, scene: &Scene) -> Verdict {
    if !scene.has_light_field() {
        return Err("light is not kept in a field".into());
    }
    let Some(old) = state.scene else {
        return Ok("no light yet".into());
    };
    let reasons = changes_of_light(old, scene).in_words();
    match reasons.is_empty() {
        false => Ok(reasons.join(", ")),
        true if !state.complete => Ok("light is catching up".into()),
        true => Err("the light is up to date".into()),
    }
}

/// Those of the changes from `old` to `new` that a light field depends on.
pub fn changes_of_light(old: &Scene, new: &Scene) -> Changes {
    let changes = Changes::between(old, new);
    // Clipped matter that blocks light all the same makes no difference to light that is not scattered
    // twice.
    let scatters_on = |scene: &Scene| match scene.method {
        Method::PhotonMap | Method::PrecomputedTransfer | Method::ConvectionDiffusion => true,
        Method::ImageBased => Records::of(scene).exchanges > 0,
        Method::Local | Method::PathTraced => false,
    };
    let clips = |scene: &Scene| !scene.clip.shadows || scatters_on(scene);
    Changes {
        bins: changes.bins & new.volume.macrocells.occurring(new.filter),
        clip: changes.clip && (clips(old) || clips(new)),
        clip_shadows: changes.clip_shadows,
        volume: changes.volume,
        // Only the form of records that the paper has for media that change.
        camera: changes.camera
            && new.method == Method::ImageBased
            && new.illumination.record_form == RecordForm::Dynamic,
        lights: changes.lights,
        orders: changes.orders,
        method: changes.method,
        light_settings: changes.light_settings,
        ..Changes::default()
    }
}

fn upload_environment(cached: Option<&Scene>, scene: &Scene) -> Verdict {
    let image = |scene: &Scene| scene.environment_image().map(|(image, _)| image.content());
    match (cached.map(image), image(scene)) {
        (None, None) | (Some(None), None) => Err("no environment image".into()),
        (Some(Some(old)), Some(new)) if old == new => Err("same environment image".into()),
        (Some(Some(_)), None) => Err("no environment image any more".into()),
        (_, Some(_)) => Ok("another environment image".into()),
    }
}

/// Reason, what becomes of the film and samples per pixel to add; or why nothing is to be drawn.
fn draw_film(
    caches: &Caches<'_>,
    scene: &Scene,
    target: Target,
    light_moves: bool,
) -> Result<(String, FilmPlan, u32), String> {
    let from_scratch = |reason: String| Ok((reason, FilmPlan::Restart, target.samples_per_pixel));
    let Some(film) = caches.film else {
        return from_scratch("the film is empty".into());
    };
    let changes = Changes::between(film.scene, scene);
    let Seen { changes: seen, mixed } = changes_seen(&changes, film.scene, scene);
    let mut reasons = seen.in_words();
    if (film.held.width, film.held.height) != (target.width, target.height) {
        reasons.push(format!("image size is now {} x {}", target.width, target.height));
    }
    if scene.has_light_field() && (light_moves || !caches.light.film_is_lit_by_it) {
        // While light is on its way the first picture comes to its end, lest there be none.
        let under_way = film.held.samples_per_pixel == 0 && light_moves && reasons.is_empty();
        if !under_way {
            reasons.push("the light changes".to_owned());
        }
    }
    if !reasons.is_empty() {
        let same_size = (film.held.width, film.held.height) == (target.width, target.height);
        let bins = bins_alone_changed(film.scene, scene);
        if let (Integrator::PathTracer, true, Some(bins)) = (scene.integrator(), same_size, bins)
            && (mixed_alike(film.scene, scene) || film.scene.background == scene.background)
            // Whether it is worth following a path's last ray.
            && film.scene.glows() == scene.glows()
        {
            let reason = format!("tiles whose paths met it: {}", reasons.join(", "));
            let stale = caches.tiles.iter().filter(|met| *met & bins != 0).count();
            let stale_share = stale as f32 / caches.tiles.len().max(1) as f32;
            return Ok((reason, FilmPlan::RestartTiles { bins, stale_share }, target.samples_per_pixel));
        }
        return from_scratch(reasons.join(", "));
    }
    // How well another mix is known is not known yet.
    let error = film.error.filter(|&error| mixed.is_empty() && good_enough(scene, error));
    if let Some(error) = error {
        return Err(format!("the error is {:.2} %, as good as asked for", 100.0 * error));
    }
    if film.held.samples_per_pixel < target.samples_per_pixel {
        let missing = target.samples_per_pixel - film.held.samples_per_pixel;
        let refining = format!(
            "refining from {} to {} samples per pixel",
            film.held.samples_per_pixel, target.samples_per_pixel
        );
        let reasons = std::iter::once(refining).chain(mixed).collect::<Vec<_>>();
        return Ok((reasons.join(", "), FilmPlan::Refine, missing));
    }
    if !mixed.is_empty() {
        return Ok((format!("mixed anew: {}", mixed.join(", ")), FilmPlan::Mix, 0));
    }
    Err(if changes.is_empty() {
        "nothing changed".into()
    } else {
        format!("{} cannot be seen on the film", changes.in_words().join(", "))
    })
}

/// Whether a picture with this relative standard error need not get better.
pub fn good_enough(scene: &Scene, error: f64) -> bool {
    (scene.integrator() == Integrator::PathTracer || scene.is_refined()) && error <= scene.paths.max_error
}

/// Whether a film that starts again is cast in view-ray segments, and which of them serve again.
fn segments(caches: &Caches<'_>, scene: &Scene) -> Result<(SegmentsPlan, String), String> {
    let state = &caches.segments;
    if scene.sampling.segments == 0 {
        return Err("switched off".into());
    }
    if scene.rendering != Rendering::Volume {
        return Err("only rays through matter in light are cut into segments".into());
    }
    if !state.fit {
        return Err("the picture is too large for them".into());
    }
    if let Some(bins) = bins_changed_since(&state.bases, scene) {
        let in_view = state.bases.iter().fold(scene.bins_in_view(), |all, base| all | base.bins_in_view());
        let stale_share = stale_share(scene, in_view, bins);
        let reason = format!("matter changed in {:.0} % of the cells that hold any", 100.0 * stale_share);
        return Ok((SegmentsPlan::Reuse { stale_share }, reason));
    }
    if state.wanted {
        return Ok((SegmentsPlan::Record, "edits are to come".into()));
    }
    let Some(film) = caches.film else {
        return Err("no edit yet".into());
    };
    match bins_alone_changed(film.scene, scene) {
        Some(bins) if bins != 0 || state.film_is_cast_in_them => {
            Ok((SegmentsPlan::Record, "matter is being edited".into()))
        }
        _ => Err("no edit of matter alone".into()),
    }
}

/// Share of the cells that hold a bin in view in which matter changed in one of `bins`, 0..1.
pub fn stale_share(scene: &Scene, in_view: u64, bins: u64) -> f32 {
    let masks = scene.volume.macrocells.masks(scene.filter);
    let seen = masks.iter().filter(|mask| *mask & in_view != 0);
    let stale = seen.clone().filter(|mask| *mask & bins != 0).count();
    stale as f32 / seen.count().max(1) as f32
}

/// Bins in which matter changed since any of the scenes that segments were cast for, if nothing
/// else did that they depend on; `None` without such scenes.
pub fn bins_changed_since(bases: &[&Scene], scene: &Scene) -> Option<u64> {
    let bins = bases.iter().map(|base| bins_alone_changed(base, scene));
    bins.reduce(|a, b| Some(a? | b?)).flatten()
}

/// Bins in which matter changed, if nothing else did that segments depend on. What lies behind the
/// volume is added when they are put together.
fn bins_alone_changed(old: &Scene, new: &Scene) -> Option<u64> {
    let mut seen = changes_seen(&Changes::between(old, new), old, new).changes;
    let bins = std::mem::take(&mut seen.bins);
    seen.background = false;
    seen.is_empty().then_some(bins)
}

/// Changes that show on the film.
struct Seen {
    /// By which what was drawn is not what is wanted.
    changes: Changes,
    /// Those, in words, for which light layers are summed up anew and stay as they are.
    mixed: Vec<String>,
}

/// Whether the pictures of both scenes are mixed from the same layers, if matter and view are the
/// same.
fn mixed_alike(old: &Scene, new: &Scene) -> bool {
    old.shares_light_layers(new) && old.background.differs_in_power_alone(&new.background)
}

/// Those of the changes from `old` to `new` that show on the film.
fn changes_seen(changes: &Changes, old: &Scene, new: &Scene) -> Seen {
    let mut seen = changes_on_film(changes, old, new);
    let mut mixed = Changes::default();
    if mixed_alike(old, new) {
        mixed.lights = std::mem::take(&mut seen.lights);
        mixed.background = std::mem::take(&mut seen.background);
    }
    Seen { changes: seen, mixed: mixed.in_words() }
}

fn changes_on_film(changes: &Changes, old: &Scene, new: &Scene) -> Changes {
    let paths = new.integrator() == Integrator::PathTracer;
    let mut seen = Changes {
        // What cannot show in a picture without shadows and multiple scattering, or not in the film.
        clip_shadows: paths && changes.clip_shadows,
        orders: paths && changes.orders,
        longest_path: paths && changes.longest_path,
        light_layers: paths && changes.light_layers,
        // Paths are followed for a film beside this one.
        refinement: false,
        // They show in the light, which has a verdict of its own.
        light_settings: false,
        // Steps are the ray caster's.
        ray_sampling: !paths && changes.ray_sampling,
        film: false,
        // The transfer function's share is in `bins`.
        window: false,
        isosurface: false,
        ..changes.clone()
    };
    let occurring = new.volume.macrocells.occurring(new.filter);
    if new.has_light_field() {
        seen.lights.clear();
    }
    if changes.volume || changes.rendering {
        return seen;
    }
    match new.rendering {
        Rendering::Volume => {
            seen.bins &= occurring;
            // Light on nothing, or on matter that scatters nothing, cannot be seen.
            if !anything_scatters(new) && !anything_scatters(old) {
                seen.lights.clear();
            }
        }
        Rendering::Isosurface { .. } => {
            seen.bins = 0;
            seen.isosurface = changes.isosurface;
        }
        Rendering::Maximum | Rendering::Minimum | Rendering::Average | Rendering::Slice { .. } => {
            seen.bins = 0;
            seen.window = changes.window;
            seen.lights.clear();
            seen.method = false;
        }
    }
    seen
}

/// Whether any matter that occurs in the volume scatters light.
fn anything_scatters(scene: &Scene) -> bool {
    let occurring = scene.volume.macrocells.occurring(scene.filter);
    let surfaces = scene.materials.iter().any(|material| material.surface > 0.0);
    let albedo = scene.transfer_function.points.iter().any(|p| p.albedo.max_element() > 0.0);
    (surfaces || albedo) && scene.bins_with_matter() & occurring != 0
}

fn tone_map(picture: Option<FilmState<'_>>, scene: &Scene, target: Target, film_runs: bool) -> Verdict {
    if film_runs {
        return Ok("the film changes".into());
    }
    match picture {
        None => Ok("no picture yet".into()),
        Some(old) if old.scene.film != scene.film => Ok("exposure or tone mapping edited".into()),
        Some(old) if old.held != target && old.held.samples_per_pixel < target.samples_per_pixel => {
            Ok("the film holds more samples".into())
        }
        Some(_) => Err("same film, same operator".into()),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proto::scene_file::{Builtin, SceneFile, VolumeSource};
    use serde_json::{Value, json};

    use super::*;
    use crate::prepared::PreparedVolume;
    use crate::volume::{Volume, Voxels};

    const TARGET: Target = Target { width: 64, height: 48, samples_per_pixel: 4 };

    fn volume() -> Arc<PreparedVolume> {
        let voxels = (0..16 * 16 * 16).map(|i| (i % 199) as u8).collect();
        Arc::new(PreparedVolume::new(Volume::new([16; 3], Voxels::U8(voxels)), &|_| {}))
    }

    fn scene(volume: &Arc<PreparedVolume>, patch: serde_json::Value) -> Scene {
        let source = VolumeSource { builtin: Some(Builtin::Pillars), ..VolumeSource::default() };
        let mut file = serde_json::to_value(SceneFile::new(source)).unwrap();
        file["lights"] =
            json!([{"id": "sun", "type": "directional", "direction": [0, -1, 0], "irradiance": [1, 1, 1]}]);
        for (key, value) in patch.as_object().unwrap() {
            file[key] = value.clone();
        }
        Scene::new(&SceneFile::from_value(file).unwrap(), volume.clone()).unwrap()
    }

    /// Names of the passes that run when `old` is complete and `new` is asked for.
    fn running(old: &Scene, new: &Scene) -> Vec<&'static str> {
        let state = FilmState { scene: old, held: TARGET, error: None };
        let caches = Caches {
            volume: Some(old),
            transfer_function: Some(old),
            distance_map: Some(old),
            majorants: Some(old),
            lights: Some(old),
            environment: Some(old),
            film: Some(state),
            picture: Some(state),
            ..Caches::default()
        };
        let plan = Plan::new(&caches, new, TARGET);
        plan.passes.iter().filter(|p| p.runs).map(|p| p.pass.name()).collect()
    }

    #[test]
    fn the_first_frame_runs_everything() {
        let volume = volume();
        let plan = Plan::new(&Caches::default(), &scene(&volume, json!({})), TARGET);
        let paths = [Pass::Majorants, Pass::UploadEnvironment, Pass::PathTrace, Pass::MixLights];
        let idle = [&[Pass::ViewSegments, Pass::Illuminate], &paths[..]].concat();
        assert!(plan.passes.iter().all(|p| p.runs != idle.contains(&p.pass)), "{plan:?}");
        let cast = plan.passes.iter().find(|p| p.pass == Pass::RayCast).unwrap();
        assert_eq!(cast.work, 64 * 48 * 4);
    }

    #[test]
    fn light_in_a_field_has_a_verdict_of_its_own() {
        let volume = volume();
        let lit = |patch: serde_json::Value| {
            let mut all = json!({"illumination": {"method": "photon_map"}});
            all.as_object_mut().unwrap().extend(patch.as_object().unwrap().clone());
            scene(&volume, all)
        };
        let old = lit(json!({}));
        let state = |held| FilmState { scene: &old, held, error: None };
        let plan = |new: &Scene, complete, film_is_lit_by_it, samples_per_pixel| {
            let held = Target { samples_per_pixel, ..TARGET };
            let light = LightState { scene: Some(&old), complete, film_is_lit_by_it };
            let caches = Caches { film: Some(state(held)), light, ..Caches::default() };
            let plan = Plan::new(&caches, new, TARGET);
            (plan.runs(Pass::Illuminate), plan.film)
        };
        assert_eq!(plan(&old, true, true, 4), (false, FilmPlan::Keep));
        // The light has moved on since the film was begun.
        assert_eq!(plan(&old, true, false, 4), (false, FilmPlan::Restart));
        assert_eq!(plan(&old, true, false, 0), (false, FilmPlan::Restart));
        // It still does: a first pass comes to its end, a whole one is followed by another.
        assert_eq!(plan(&old, false, false, 0), (true, FilmPlan::Refine));
        assert_eq!(plan(&old, false, false, 1), (true, FilmPlan::Restart));
        let camera =
            json!({"position": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 30});
        let moved = lit(json!({"camera": camera}));
        assert_eq!(plan(&moved, true, true, 4), (false, FilmPlan::Restart));
        let brighter = lit(json!({"lights": [{"type": "directional", "direction": [0, 0, -1],
            "irradiance": [3, 3, 3]}]}));
        assert_eq!(plan(&brighter, true, true, 4), (true, FilmPlan::Restart));
        assert!(!Plan::new(&Caches::default(), &scene(&volume, json!({})), TARGET).runs(Pass::Illuminate));
    }

    /// Clipped matter that casts shadows scatters no light on.
    #[test]
    fn light_that_scatters_on_follows_clipping_under_shadows() {
        let volume = volume();
        let lit = |method: Value, half: f64| {
            scene(
                &volume,
                json!({"illumination": method, "clip": {"box": [[0, 0, 0], [half, 1, 1]], "shadows": true}}),
            )
        };
        for (method, follows) in [
            (json!({"method": "convection_diffusion"}), true),
            (json!({"method": "photon_map"}), true),
            (json!({"method": "image_based"}), false),
            (json!({"method": "image_based", "record_exchange": 2}), true),
        ] {
            let changes = changes_of_light(&lit(method.clone(), 1.0), &lit(method.clone(), 0.5));
            assert_eq!(!changes.is_empty(), follows, "{method}");
        }
    }

    #[test]
    fn light_follows_the_camera_in_one_form_of_records_alone() {
        let volume = volume();
        let scene_with = |form: &str, x: f64| {
            scene(
                &volume,
                json!({"illumination": {"method": "image_based", "record_form": form},
                    "camera": {"position": [x, 0.0, 5.0], "target": [0.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0],
                        "fov_y_degrees": 30.0}}),
            )
        };
        for (form, follows) in
            [("product", false), ("isotropic", false), ("static", false), ("dynamic", true)]
        {
            let changes = changes_of_light(&scene_with(form, 0.0), &scene_with(form, 1.0));
            assert_eq!(changes.is_empty(), !follows, "{form}");
        }
        let settings = changes_of_light(&scene_with("product", 0.0), &scene_with("static", 0.0));
        assert_eq!(settings.in_words(), ["settings of the light"]);
    }

    #[test]
    fn paths_depend_on_more_than_rays_do_and_on_less() {
        let volume = volume();
        let traced = |mut patch: serde_json::Value| {
            if patch.get("illumination").is_none() {
                patch["illumination"] = json!({"method": "path_traced"});
            }
            scene(&volume, patch)
        };
        let old = traced(json!({}));
        let first = Plan::new(&Caches::default(), &old, TARGET);
        assert!(first.runs(Pass::Majorants) && first.runs(Pass::PathTrace), "{first:?}");
        assert!(!first.runs(Pass::DistanceMap) && !first.runs(Pass::RayCast), "{first:?}");
        let check = |patch, expected: &[&str]| assert_eq!(running(&old, &traced(patch)), expected);
        check(json!({}), &[]);
        check(json!({"scattering": {"orders": 1}}), &["path_trace", "tone_map"]);
        check(json!({"clip": {"shadows": false}}), &["path_trace", "tone_map"]);
        check(json!({"sampling": {"step_voxels": 0.5, "termination_transmittance": 0}}), &[]);
        let paths =
            |longest: u32| json!({"illumination": {"method": "path_traced", "longest_path": longest}});
        check(paths(7), &["path_trace", "tone_map"]);
        let points = |top: f64| json!([{"s": 0, "extinction": 0}, {"s": 0.15, "extinction": 0}, {"s": 1, "extinction": top}]);
        let denser = json!({"transfer_function": {"points": points(90.0)}});
        check(denser.clone(), &["upload_transfer_function", "majorants", "path_trace", "tone_map"]);
        // Matter alone changed: tiles restart, and how many is known from what their paths met.
        let new = traced(denser);
        let state = FilmState { scene: &old, held: TARGET, error: Some(0.01) };
        let caches = Caches { film: Some(state), tiles: &[1, u64::MAX, 0, 1], ..Caches::default() };
        let FilmPlan::RestartTiles { bins, stale_share } = Plan::new(&caches, &new, TARGET).film else {
            panic!("tiles restart")
        };
        assert!(bins != 0 && bins & 1 == 0 && stale_share == 0.25, "{bins:b} {stale_share}");
        // An error that is good enough ends it; a better one asked for goes on.
        let more = Target { samples_per_pixel: 400, ..TARGET };
        for (wanted, runs) in [(0.02, false), (0.005, true)] {
            let scene = traced(json!({"illumination": {"method": "path_traced", "max_error": wanted}}));
            assert_eq!(Plan::new(&caches, &scene, more).runs(Pass::PathTrace), runs, "{wanted}");
        }
    }

    #[test]
    fn colours_of_lights_in_layers_follow_no_path() {
        let volume = volume();
        let sun = |key: &str, value: serde_json::Value| {
            let mut sun = json!({"id": "sun", "type": "directional", "direction": [0, -1, 0],
                "irradiance": [1, 1, 1]});
            sun[key] = value;
            sun
        };
        let lamp = |height: f64, enabled: bool| {
            json!({"id": "lamp", "type": "point", "position": [0, height, 0], "intensity": [1, 1, 1],
                "enabled": enabled})
        };
        let layered = |patch: serde_json::Value| {
            let mut all = json!({"illumination": {"method": "path_traced", "light_layers": true},
                "lights": [sun("id", json!("sun")), lamp(1.0, false)]});
            all.as_object_mut().unwrap().extend(patch.as_object().unwrap().clone());
            scene(&volume, all)
        };
        let old = layered(json!({}));
        assert_eq!(old.lights.len(), 2, "a light that is off keeps its layer");
        let first = Plan::new(&Caches::default(), &old, TARGET);
        assert!(first.runs(Pass::PathTrace) && first.runs(Pass::MixLights), "{first:?}");
        let check = |patch, expected: &[&str]| assert_eq!(running(&old, &layered(patch)), expected);
        let mixed = ["mix_lights", "tone_map"];
        let retraced = ["upload_lights", "path_trace", "mix_lights", "tone_map"];
        check(json!({}), &[]);
        check(json!({"lights": [sun("irradiance", json!([9, 0, 1])), lamp(1.0, false)]}), &mixed);
        check(json!({"lights": [sun("enabled", json!(false)), lamp(1.0, true)]}), &mixed);
        check(json!({"background": [1, 0, 0]}), &mixed);
        // What has no layer yet, or another one: off or not, and in another order.
        check(json!({"lights": [sun("direction", json!([1, 0, 0])), lamp(1.0, false)]}), &retraced);
        check(json!({"lights": [sun("id", json!("sun")), lamp(2.0, false)]}), &retraced);
        check(json!({"lights": [lamp(1.0, false), sun("id", json!("sun"))]}), &retraced);
        check(json!({"lights": [sun("id", json!("sun"))]}), &retraced);
        let plain = scene(&volume, json!({"illumination": {"method": "path_traced"}}));
        assert_eq!(running(&old, &plain), ["upload_lights", "path_trace", "tone_map"]);
        // With matter edited beside it, tiles start again; a picture that lacks paths goes on.
        let points =
            json!([{"s": 0, "extinction": 0}, {"s": 0.15, "extinction": 0}, {"s": 1, "extinction": 90}]);
        let both = json!({"lights": [sun("irradiance", json!([9, 0, 1])), lamp(1.0, true)],
            "transfer_function": {"points": points}});
        let plan_on = |error: Option<f64>, new: &Scene, target: Target| {
            let film = Some(FilmState { scene: &old, held: TARGET, error });
            Plan::new(&Caches { film, ..Caches::default() }, new, target)
        };
        let tiles = plan_on(None, &layered(both), TARGET).film;
        assert!(matches!(tiles, FilmPlan::RestartTiles { .. }), "{tiles:?}");
        // How good another mix is, is not known before it is made.
        let mut recoloured = json!({"lights": [sun("irradiance", json!([9, 0, 1])), lamp(1.0, false)]});
        recoloured["illumination"] =
            json!({"method": "path_traced", "light_layers": true, "max_error": 0.02});
        let recoloured = layered(recoloured);
        let more = Target { samples_per_pixel: 400, ..TARGET };
        assert_eq!(plan_on(Some(0.01), &recoloured, more).film, FilmPlan::Refine);
        let plan = plan_on(Some(0.01), &recoloured, TARGET);
        let reason = |pass| plan.passes.iter().find(|p| p.pass == pass).unwrap().reason.clone();
        assert_eq!(plan.film, FilmPlan::Mix);
        assert_eq!(reason(Pass::MixLights), "mixed anew: light `sun` recoloured");
        assert_eq!(reason(Pass::PathTrace), "the light layers stay as they are");
        assert_eq!(plan.changes, ["light `sun` recoloured"]);
    }

    #[test]
    fn nothing_changed_nothing_runs() {
        let volume = volume();
        let old = scene(&volume, json!({}));
        assert_eq!(running(&old, &scene(&volume, json!({}))), [""; 0]);
    }

    #[test]
    fn each_edit_runs_what_it_needs() {
        let volume = volume();
        let old = scene(&volume, json!({}));
        let check = |patch, expected: &[&str]| assert_eq!(running(&old, &scene(&volume, patch)), expected);
        let tf = |points| json!({"transfer_function": {"points": points}});
        let ramp = |top: f64| json!([{"s": 0, "extinction": 0}, {"s": 0.15, "extinction": 0}, {"s": 1, "extinction": top}]);
        check(
            json!({"camera": {"position": [1, 1, 1], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 30}}),
            &["ray_cast", "tone_map"],
        );
        check(json!({"film": {"exposure_stops": 1}}), &["tone_map"]);
        check(tf(ramp(90.0)), &["upload_transfer_function", "ray_cast", "tone_map"]);
        check(
            tf(json!([{"s": 0, "extinction": 0}, {"s": 0.5, "extinction": 0}, {"s": 1, "extinction": 60}])),
            &["upload_transfer_function", "distance_map", "ray_cast", "tone_map"],
        );
        check(json!({"lights": []}), &["upload_lights", "ray_cast", "tone_map"]);
        check(json!({"scattering": {"orders": 1}}), &[]);
        check(json!({"clip": {"shadows": false}}), &[]);
        check(json!({"sampling": {"skip_empty": false}}), &[]);
        check(json!({"clip": {"box": [[0, 0, 0], [1, 1, 0.5]]}}), &["ray_cast", "tone_map"]);
    }

    #[test]
    fn values_depend_on_neither_matter_nor_light() {
        let volume = volume();
        let with = |patch: serde_json::Value| {
            let mut all = json!({"rendering": {"mode": "maximum"}});
            all.as_object_mut().unwrap().extend(patch.as_object().unwrap().clone());
            scene(&volume, all)
        };
        let old = with(json!({}));
        let opaque =
            json!({"transfer_function": {"points": [{"s": 0, "extinction": 50, "albedo": [1, 0, 0]}]}});
        assert_eq!(running(&old, &with(opaque)), [""; 0]);
        assert_eq!(running(&old, &with(json!({"lights": []}))), [""; 0]);
        assert_eq!(
            running(&old, &with(json!({"value_range": [20, 90]}))),
            ["upload_transfer_function", "ray_cast", "tone_map"][1..]
        );
        let mean = with(json!({"rendering": {"mode": "average"}}));
        assert_eq!(running(&old, &mean), ["ray_cast", "tone_map"]);
    }

    #[test]
    fn an_isosurface_depends_on_the_matter_at_its_value_alone() {
        let volume = volume();
        let with = |isovalue: f64, low: f64, high: [f64; 3]| {
            scene(
                &volume,
                json!({
                    "rendering": {"mode": "isosurface", "isovalue": isovalue}, "value_range": [0, 200],
                    "transfer_function": {"points": [
                        {"s": 0.0, "extinction": low}, {"s": 0.4, "extinction": low},
                        {"s": 0.5, "extinction": 9, "albedo": high}, {"s": 1.0, "extinction": 9, "albedo": high}
                    ]}
                }),
            )
        };
        let old = with(120.0, 0.0, [1.0, 0.5, 0.2]);
        assert_eq!(running(&old, &with(120.0, 3.0, [1.0, 0.5, 0.2])), [""; 0], "matter elsewhere");
        assert_eq!(
            running(&old, &with(120.0, 0.0, [0.1, 0.5, 0.2])),
            ["upload_transfer_function", "ray_cast", "tone_map"],
            "its colour"
        );
        assert_eq!(
            running(&old, &with(30.0, 0.0, [1.0, 0.5, 0.2])),
            ["distance_map", "ray_cast", "tone_map"]
        );
    }

    #[test]
    fn light_on_black_matter_is_not_seen() {
        let volume = volume();
        let black = json!([{"s": 0, "extinction": 9, "albedo": [0, 0, 0], "emission": [1, 1, 1]}]);
        let old = scene(&volume, json!({"transfer_function": {"points": black}}));
        let new = scene(&volume, json!({"transfer_function": {"points": black}, "lights": []}));
        assert_eq!(running(&old, &new), [""; 0]);
    }

    #[test]
    fn segments_serve_again_only_where_nothing_but_matter_changed() {
        let volume = volume();
        let tf = |top: f64| json!([{"s": 0, "extinction": 0}, {"s": 0.7, "extinction": 0}, {"s": 1, "extinction": top}]);
        let old = scene(&volume, json!({"transfer_function": {"points": tf(60.0)}}));
        let film = FilmState { scene: &old, held: TARGET, error: None };
        let plan = |new: &Scene, segments: SegmentsState<'_>| {
            let caches = Caches { film: Some(film), segments, ..Caches::default() };
            Plan::new(&caches, new, TARGET).segments
        };
        let kept = || SegmentsState { bases: vec![&old], fit: true, ..SegmentsState::default() };
        let none = || SegmentsState { bases: vec![], ..kept() };
        let edited = scene(&volume, json!({"transfer_function": {"points": tf(90.0)}}));
        assert_eq!(plan(&edited, none()), SegmentsPlan::Record, "the first edit");
        let larger = Target { width: 2 * TARGET.width, ..TARGET };
        let at_rest = |film_is_cast_in_them| {
            let segments = SegmentsState { film_is_cast_in_them, ..none() };
            Plan::new(&Caches { film: Some(film), segments, ..Caches::default() }, &old, larger).segments
        };
        assert_eq!((at_rest(false), at_rest(true)), (SegmentsPlan::Unused, SegmentsPlan::Record));
        let bins = bins_changed_since(&[&old], &edited).unwrap();
        assert_eq!(bins, Changes::between(&old, &edited).bins);
        assert!(bins.count_ones() < 25, "{bins:x}");
        assert_eq!(plan(&edited, kept()), SegmentsPlan::Reuse { stale_share: 1.0 }, "all matter changed");
        assert_eq!(plan(&edited, SegmentsState { fit: false, ..kept() }), SegmentsPlan::Unused);
        let patches = [
            json!({"lights": []}),
            json!({"clip": {"box": [[0, 0, 0], [1, 1, 0.5]]}}),
            json!({"camera": {"position": [1, 1, 1], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 30}}),
            json!({"sampling": {"step_voxels": 0.5}}),
        ];
        for mut patch in patches {
            patch["transfer_function"] = json!({"points": tf(90.0)});
            assert_eq!(plan(&scene(&volume, patch.clone()), kept()), SegmentsPlan::Unused, "{patch}");
        }
        let behind = json!({"background": [1, 0, 0], "transfer_function": {"points": tf(60.0)}});
        let reuse_all = SegmentsPlan::Reuse { stale_share: 0.0 };
        assert_eq!(plan(&scene(&volume, behind), kept()), reuse_all);
        let off = json!({"sampling": {"segments": 0}, "transfer_function": {"points": tf(90.0)}});
        assert_eq!(plan(&scene(&volume, off), kept()), SegmentsPlan::Unused);
    }

    #[test]
    fn more_samples_refine_without_uploads() {
        let volume = volume();
        let old = scene(&volume, json!({}));
        let state = FilmState { scene: &old, held: Target { samples_per_pixel: 1, ..TARGET }, error: None };
        let caches = Caches {
            film: Some(state),
            volume: Some(&old),
            transfer_function: Some(&old),
            distance_map: Some(&old),
            lights: Some(&old),
            picture: Some(state),
            ..Caches::default()
        };
        let plan = Plan::new(&caches, &old, TARGET);
        let cast = plan.passes.iter().find(|p| p.pass == Pass::RayCast).unwrap();
        assert_eq!((cast.runs, cast.work), (true, 64 * 48 * 3));
        assert!(!plan.runs(Pass::UploadLights) && plan.runs(Pass::ToneMap));
    }
}
