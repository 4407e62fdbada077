//! One viewer as the render thread sees it: what it asked for, what it was shown, what is next.

use std::sync::Arc;
use std::time::{Duration, Instant};

use proto::plan::FrameReport;
use render::{DrawRequest, Drawn, Light, Picture, RenderError, Renderer, View};
use scene::Snapshot;
use scene::plan::{Caches, FilmPlan, FilmState, Plan, SegmentsPlan, Target};
use tokio::sync::mpsc::error::TrySendError;

use super::frame::{self, Drawing, Kind};
use super::pace::{Moving, Pace};
use super::turns::{Account, allotment};
use super::{Encoding, FinishedFrame, MAX_FRAMES_IN_FLIGHT, Output, ViewerInput};

/// Without a visible change for this long, a viewer is at rest.
const REST_DELAY: Duration = Duration::from_millis(100);
/// Shortest time between the starts of two moving pictures.
const FRAME_INTERVAL: Duration = Duration::from_millis(33);
/// Time a moving picture may take.
const MOVING_TIME: Duration = Duration::from_millis(26);
/// The same on a software device.
const MOVING_TIME_SOFTWARE: Duration = Duration::from_millis(120);
/// A moving picture that takes this many times its time is given up for a smaller one.
const PATIENCE: f64 = 1.5;
/// Shortest time between two refining pictures.
const REFINE_INTERVAL: Duration = Duration::from_millis(400);
/// If one pass at full size is expected to take longer than this, a reduced picture comes first.
const LONG_PASS: Duration = Duration::from_millis(1200);
/// Time that reduced picture may take.
const PREVIEW_TIME: Duration = Duration::from_millis(500);
/// It must have this many times the pixels already shown to be worth it.
const PREVIEW_GAIN: u64 = 2;
/// If the final picture will be there within this time, the first full one is not sent.
const SOON: Duration = Duration::from_millis(80);

/// Finding the stale view-ray segments and putting all together takes about this share of the time
/// of casting the rays.
const SEGMENTS_OVERHEAD: f32 = 0.15;

/// A viewer on the render thread.
pub(super) struct Watched {
    view: View,
    pace: Pace,
    moving_time: Duration,
    input: ViewerInput,
    /// When the newest visible change arrived.
    changed: Instant,
    /// What the view's film holds.
    film: Option<Film>,
    /// What the newest frame shows.
    shown: Option<Shown>,
    drawing: Option<Drawing>,
    /// The snapshot that could not be drawn at the present viewport; not tried again.
    failed: Option<Arc<Snapshot>>,
    /// Number of the newest frame.
    frame: u32,
    /// Number of the newest frame that went to an earlier connection.
    lost: u32,
    /// When the newest moving picture was begun.
    moving_began: Option<Instant>,
    /// When it was last worked on.
    worked: Instant,
    /// Turns it had, for fairness.
    pub(super) account: Account,
}

struct Film {
    snapshot: Arc<Snapshot>,
    /// The viewport it was drawn for: it has its proportions.
    viewport: (u32, u32),
    held: Target,
    /// Its relative standard error, where that is known.
    error: Option<f64>,
}

struct Shown {
    snapshot: Arc<Snapshot>,
    viewport: (u32, u32),
    /// Pixels of the picture, before it is stretched to the viewport.
    pixels: u64,
    /// Full resolution, this many samples; 0 for a reduced picture.
    samples_at_full_size: u32,
    /// Share of the light that was there, 0..1.
    illumination: f32,
    is_final: bool,
    sent: Instant,
}

/// What a viewer needs of the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Need {
    /// Nothing until its input changes.
    Nothing,
    /// Nothing until then.
    Until(Instant),
    /// A picture while it moves.
    Moving,
    /// Refinement at rest.
    Still,
}

impl Watched {
    pub(super) fn new(input: ViewerInput, software: bool, account: Account) -> Self {
        Self {
            view: View::in_light(&input.light),
            pace: Pace::new(software),
            moving_time: if software { MOVING_TIME_SOFTWARE } else { MOVING_TIME },
            changed: input.arrived,
            input,
            film: None,
            shown: None,
            drawing: None,
            failed: None,
            frame: 0,
            lost: 0,
            moving_began: None,
            worked: Instant::now(),
            account,
        }
    }

    /// Takes over the newest input. A change that cannot be seen is answered with a report.
    pub(super) fn take(&mut self, input: &ViewerInput) {
        let old = std::mem::replace(&mut self.input, input.clone());
        if old.resumed != input.resumed {
            self.shown = None;
            self.lost = self.frame;
        }
        let same_viewport = old.viewport == input.viewport;
        if same_viewport && Arc::ptr_eq(&old.snapshot, &input.snapshot) {
            return;
        }
        if same_viewport && let Some(plan) = self.invisible_change(&input.snapshot) {
            self.adopt(&old.snapshot);
            let report =
                FrameReport { changes: plan.changes.clone(), plan: plan.report(), ..FrameReport::default() };
            self.send(Output::Unchanged { frame: self.frame, report: Box::new(report) });
            return;
        }
        self.changed = Instant::now();
        self.failed = None;
        // A picture at rest of what is no longer wanted ends here; a moving one is finished, so
        // that a steady stream of inputs shows progress.
        if self.drawing.as_ref().is_some_and(|drawing| !matches!(drawing.kind, Kind::Moving(_))) {
            self.drawing = None;
        }
    }

    /// The plan for a snapshot that looks like the one on the film, `None` if it looks different.
    fn invisible_change(&self, snapshot: &Arc<Snapshot>) -> Option<Plan> {
        let film = self.film.as_ref().filter(|film| Some(film.viewport) == self.input.viewport)?;
        let plan = self.plan_on_film(film, snapshot);
        plan.is_empty().then_some(plan)
    }

    fn plan_on_film(&self, film: &Film, snapshot: &Arc<Snapshot>) -> Plan {
        let old = Some(&film.snapshot.scene);
        let state = Some(FilmState { scene: &film.snapshot.scene, held: film.held, error: film.error });
        let caches = Caches {
            volume: old,
            transfer_function: old,
            distance_map: old,
            majorants: old,
            lights: old,
            environment: old,
            film: state,
            picture: state,
            ..Caches::default()
        };
        Plan::new(&caches, &snapshot.scene, film.held)
    }

    /// What was drawn of `old` is as good for the newest snapshot.
    fn adopt(&mut self, old: &Arc<Snapshot>) {
        let new = &self.input.snapshot;
        let shown = self.shown.as_mut().map(|shown| &mut shown.snapshot);
        let drawing = self.drawing.as_mut().map(|drawing| &mut drawing.snapshot);
        for held in shown.into_iter().chain(drawing) {
            if Arc::ptr_eq(held, old) {
                *held = new.clone();
            }
        }
    }

    /// What is to be done now.
    pub(super) fn need(&self, now: Instant) -> Need {
        let in_flight = self.frame - self.input.acknowledged.max(self.lost).min(self.frame);
        let Some(viewport) = self.input.viewport.filter(|_| self.input.visible) else {
            return Need::Nothing;
        };
        if in_flight >= MAX_FRAMES_IN_FLIGHT || self.has_failed() {
            return Need::Nothing;
        }
        if self.drawing.as_ref().is_some_and(|drawing| matches!(drawing.kind, Kind::Moving(_))) {
            return Need::Moving;
        }
        let shown = self
            .shown
            .as_ref()
            .filter(|shown| shown.viewport == viewport && Arc::ptr_eq(&shown.snapshot, &self.input.snapshot));
        match shown {
            None => match self.moving_began.map(|began| began + FRAME_INTERVAL) {
                Some(earliest) if now < earliest => Need::Until(earliest),
                _ => Need::Moving,
            },
            Some(shown) if shown.is_final => Need::Nothing,
            Some(_) if now < self.changed + REST_DELAY => Need::Until(self.changed + REST_DELAY),
            Some(_) => Need::Still,
        }
    }

    fn has_failed(&self) -> bool {
        self.failed.as_ref().is_some_and(|snapshot| Arc::ptr_eq(snapshot, &self.input.snapshot))
    }

    /// Time its next turn gets where `sharers` viewers are moving at once. A moving picture gets all
    /// its time at once: it is wanted whole, and each slice costs a wait.
    pub(super) fn allotment(&self, need: Need, slice: Duration, sharers: u32) -> Duration {
        if need == Need::Moving { allotment(self.moving_time, slice, sharers) } else { slice }
    }

    /// Works on the present picture for one turn.
    pub(super) fn advance(
        &mut self,
        renderer: &mut Renderer,
        need: Need,
        time: Duration,
    ) -> Result<(), RenderError> {
        let began = Instant::now();
        if self.drawing.is_none() {
            self.drawing = self.begin(renderer, need, time);
        }
        let Some(drawing) = &mut self.drawing else { return Ok(()) };
        let (snapshot, target) = (drawing.snapshot.clone(), drawing.target);
        let request = DrawRequest { snapshot: &snapshot, target, budget: Some(time) };
        let drawn = renderer.draw(&mut self.view, &request)?;
        frame::accumulate(&mut drawing.report, drawn.report());
        drawing.casting += frame::casting_time(&drawn);
        self.film = Some(Film {
            snapshot,
            viewport: drawing.viewport,
            held: Target { samples_per_pixel: drawn.samples_per_pixel, ..target },
            error: drawn.estimate.map(|estimate| estimate.relative_error),
        });
        drawing.spent += began.elapsed();
        drawing.illumination = drawn.illumination;
        drawing.illumination_epoch = drawn.illumination_epoch;
        // While light is on its way pictures are shown in what there is of it.
        let is_whole = drawn.complete || drawn.illumination < 1.0 && drawn.samples_per_pixel > 0;
        let result = match drawing.kind {
            Kind::Moving(quality) if is_whole => {
                self.finish_reduced(renderer, Encoding::Moving(quality), began)
            }
            Kind::Preview if is_whole => self.finish_reduced(renderer, Encoding::Refining, began),
            Kind::Preview => Ok(()),
            Kind::Moving(_) => {
                self.give_up_if_too_slow(time, drawn.pass_share);
                Ok(())
            }
            Kind::Still => self.show_still(renderer, &drawn),
        };
        self.worked = Instant::now();
        result
    }

    /// Number of the newest frame.
    pub(super) fn frame(&self) -> u32 {
        self.frame
    }

    /// GPU memory it keeps for itself.
    pub(super) fn gpu_bytes(&self) -> u64 {
        self.view.total_bytes()
    }

    /// Light computed ahead, which other viewers may share.
    pub(super) fn light(&self) -> &Light {
        self.view.light()
    }

    /// What is dropped first is smallest: what nobody sees, then what was not worked on for longest.
    pub(super) fn keep_order(&self) -> (bool, Instant) {
        (self.input.visible, self.worked)
    }

    /// Drops what it keeps on the GPU; what is shown stays shown, and is drawn anew when it changes.
    pub(super) fn drop_pictures(&mut self) {
        self.view = View::in_light(&self.input.light);
        self.film = None;
        self.drawing = None;
    }

    fn begin(&mut self, renderer: &Renderer, need: Need, time: Duration) -> Option<Drawing> {
        let viewport = self.input.viewport?;
        let (kind, target) = match need {
            Need::Moving => {
                self.moving_began = Some(Instant::now());
                let Moving { width, height, quality } = self.pace.next(viewport, time, self.input.link);
                // If the film already holds what is asked for, a tone-mapping edit say, it is used.
                let reusable = self.film.as_ref().filter(|film| {
                    film.held.samples_per_pixel > 0
                        && film.viewport == viewport
                        && matches!(
                            self.plan_on_film(film, &self.input.snapshot).film,
                            FilmPlan::Keep | FilmPlan::Refine | FilmPlan::Mix
                        )
                });
                let fresh = Target { width, height, samples_per_pixel: 1 };
                let held = reusable.map(|film| film.held);
                let target = held.or_else(|| self.target_from_kept(renderer, viewport, time));
                (Kind::Moving(quality), target.unwrap_or(fresh))
            }
            Need::Still => match self.preview_size(viewport) {
                Some((width, height)) => (Kind::Preview, Target { width, height, samples_per_pixel: 1 }),
                None => {
                    let samples_per_pixel = self.input.snapshot.scene.samples_at_rest();
                    (Kind::Still, Target { width: viewport.0, height: viewport.1, samples_per_pixel })
                }
            },
            Need::Nothing | Need::Until(_) => return None,
        };
        Some(Drawing {
            kind,
            snapshot: self.input.snapshot.clone(),
            viewport,
            target,
            seq: self.input.seq,
            arrived: self.input.arrived,
            began: Instant::now(),
            spent: Duration::ZERO,
            casting: Duration::ZERO,
            illumination: 1.0,
            illumination_epoch: self.input.snapshot.epoch,
            report: None,
        })
    }

    /// A moving picture at full size, if view-ray segments or tiles kept at rest make it quick
    /// enough.
    fn target_from_kept(&self, renderer: &Renderer, viewport: (u32, u32), time: Duration) -> Option<Target> {
        let target = Target { width: viewport.0, height: viewport.1, samples_per_pixel: 1 };
        let plan = renderer.plan(&self.view, &self.input.snapshot, target);
        let stale_share = match (plan.segments, plan.film) {
            (SegmentsPlan::Reuse { stale_share }, _) => stale_share,
            (_, FilmPlan::RestartTiles { stale_share, .. }) => stale_share,
            _ => return None,
        };
        let whole = self.pace.expected(u64::from(viewport.0) * u64::from(viewport.1));
        (whole.mul_f32(stale_share + SEGMENTS_OVERHEAD) <= time).then_some(target)
    }

    /// Size of a reduced picture to show before a long pass at full size, if that pass is long
    /// and the reduced picture adds enough to what is shown.
    fn preview_size(&self, viewport: (u32, u32)) -> Option<(u32, u32)> {
        let full = u64::from(viewport.0) * u64::from(viewport.1);
        let (width, height) = self.pace.preview_size(viewport, PREVIEW_TIME);
        let pixels = u64::from(width) * u64::from(height);
        let shown = self.shown.as_ref().map_or(0, |shown| shown.pixels);
        let film_has_it = self
            .film
            .as_ref()
            .is_some_and(|film| film.viewport == viewport && (film.held.width, film.held.height) == viewport);
        let worth_it = !film_has_it && self.pace.expected(full) > LONG_PASS && pixels >= PREVIEW_GAIN * shown;
        worth_it.then_some((width, height))
    }

    /// Shows a picture of one pass at a size chosen for its time.
    fn finish_reduced(
        &mut self,
        renderer: &mut Renderer,
        encoding: Encoding,
        slice_began: Instant,
    ) -> Result<(), RenderError> {
        let before = slice_began.elapsed();
        let picture = renderer.picture(&mut self.view)?;
        let Some(mut drawing) = self.drawing.take() else { return Ok(()) };
        let reading = slice_began.elapsed().saturating_sub(before);
        drawing.spent += reading;
        // How quick a picture from kept segments was says nothing about the next of whole rays.
        let reused = drawing.report.as_ref().and_then(|report| report.counters.get("segments_reused"));
        if drawing.casting > Duration::ZERO && reused.is_none_or(|&count| count == 0) {
            let pixels = u64::from(drawing.target.width) * u64::from(drawing.target.height);
            self.pace.measured(pixels, drawing.casting + reading);
        }
        self.show(drawing, picture, encoding);
        Ok(())
    }

    /// A picture that takes too long is begun again smaller, if there is a smaller size and what is
    /// missing of this one, of which `done` is there, would take as long.
    fn give_up_if_too_slow(&mut self, time: Duration, done: f64) {
        let Some(drawing) = &self.drawing else { return };
        let missing = drawing.casting.as_secs_f64() * (1.0 - done) / done.max(f64::EPSILON);
        if drawing.casting > time.mul_f64(PATIENCE) && missing > time.as_secs_f64() {
            let pixels = u64::from(drawing.target.width) * u64::from(drawing.target.height);
            if self.pace.too_slow(pixels, drawing.casting) {
                self.drawing = None;
            }
        }
    }

    /// Sends the film at rest when it is complete, or when there is something new worth seeing.
    fn show_still(&mut self, renderer: &mut Renderer, drawn: &Drawn) -> Result<(), RenderError> {
        let Some(drawing) = &self.drawing else { return Ok(()) };
        if drawn.complete {
            let picture = renderer.picture(&mut self.view)?;
            let stale_shares = renderer.stale_shares(&self.view)?;
            if let Some(mut drawing) = self.drawing.take() {
                drawing.report.get_or_insert_default().stale_shares = stale_shares;
                self.show(drawing, picture, Encoding::Lossless);
            }
            return Ok(());
        }
        let samples = drawn.samples_per_pixel;
        let shown_samples = self.shown.as_ref().map_or(0, |shown| shown.samples_at_full_size);
        let missing = drawing.target.samples_per_pixel.saturating_sub(samples);
        let left = drawing.spent.mul_f64(f64::from(missing) / f64::from(samples.max(1)));
        let waited = self.shown.as_ref().is_none_or(|shown| shown.sent.elapsed() >= REFINE_INTERVAL);
        let is_finer = samples > shown_samples && (shown_samples == 0 || waited) && left > SOON;
        // Light that comes bit by bit is shown as it comes, and how much of it there is.
        let lit = self.shown.as_ref().map_or(0.0, |shown| shown.illumination);
        let is_brighter = samples > 0 && waited && drawn.illumination > lit && drawn.illumination < 1.0;
        if is_finer || is_brighter {
            let picture = renderer.picture(&mut self.view)?;
            let Some(drawing) = &mut self.drawing else { return Ok(()) };
            let shown =
                Drawing { report: drawing.report.take(), snapshot: drawing.snapshot.clone(), ..*drawing };
            self.show(shown, picture, Encoding::Refining);
        }
        Ok(())
    }

    /// Hands a picture to the viewer's encoder.
    fn show(&mut self, drawing: Drawing, picture: Picture, encoding: Encoding) {
        self.frame += 1;
        let samples = self.film.as_ref().map_or(0, |film| film.held.samples_per_pixel);
        let error = self.film.as_ref().and_then(|film| film.error);
        let is_final = encoding == Encoding::Lossless;
        let pixels = u64::from(picture.width) * u64::from(picture.height);
        let full_size = (picture.width, picture.height) == drawing.viewport;
        let header = frame::header(self.frame, &drawing, &picture, encoding, (samples, error));
        self.shown = Some(Shown {
            snapshot: drawing.snapshot,
            viewport: drawing.viewport,
            pixels,
            samples_at_full_size: if full_size && !matches!(encoding, Encoding::Moving(_)) {
                samples
            } else {
                0
            },
            illumination: drawing.illumination,
            is_final,
            sent: Instant::now(),
        });
        let report = drawing.report.unwrap_or_default();
        self.send(Output::Frame(Box::new(FinishedFrame { picture, encoding, header, report })));
    }

    /// The present picture cannot be drawn: says so once, and waits for another.
    pub(super) fn fail(&mut self, error: &RenderError) {
        self.drawing = None;
        self.failed = Some(self.input.snapshot.clone());
        self.send(Output::Failed(error.to_string()));
    }

    /// The device was replaced: everything it held is gone.
    pub(super) fn forget(&mut self) {
        self.drop_pictures();
        self.light().clear();
        self.shown = None;
        self.failed = None;
    }

    fn send(&self, output: Output) {
        let is_frame = matches!(output, Output::Frame(_));
        match self.input.outputs.try_send(output) {
            // The connection is going away; its slot follows.
            Ok(()) | Err(TrySendError::Closed(_)) => {}
            Err(TrySendError::Full(_)) if !is_frame => {}
            Err(TrySendError::Full(_)) => tracing::error!("a viewer's frames exceed those in flight"),
        }
    }
}

#[cfg(test)]
#[path = "watched_tests.rs"]
mod tests;
