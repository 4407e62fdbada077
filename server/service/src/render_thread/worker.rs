//! The render thread's loop: whose turn it is, one slice of work at a time.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use render::{AdapterPolicy, DrawRequest, Gpu, RenderError, Renderer, View};

use super::watched::{Need, Watched};
use super::{Inbox, Shared, Still, StillJob, ViewerId};

/// Length of a slice of work.
const SLICE: Duration = Duration::from_millis(6);
/// The same on a software device.
const SLICE_SOFTWARE: Duration = Duration::from_millis(25);
/// Refinement and stills get a slice at least this often, however much others move.
const BACKGROUND_PATIENCE: Duration = Duration::from_millis(250);
/// Pause before a lost device is opened again.
const REOPEN_PAUSE: Duration = Duration::from_secs(2);

/// Everything the thread owns.
pub(super) struct Worker {
    renderer: Renderer,
    shared: Arc<Shared>,
    software: bool,
    /// For all that is on the GPU.
    max_gpu_bytes: u64,
    viewers: HashMap<ViewerId, Watched>,
    still: Option<ActiveStill>,
    /// GPU time used by whoever worked last: who joins starts here, without arrears or credit.
    clock: Duration,
    last_background: Instant,
}

/// The still being drawn.
struct ActiveStill {
    job: StillJob,
    view: View,
    used: Duration,
}

/// Whose turn it is.
enum Turn {
    Viewer(ViewerId, Need, u32),
    Still,
}

impl Worker {
    pub(super) fn new(renderer: Renderer, shared: Arc<Shared>, max_gpu_bytes: u64) -> Self {
        let software = renderer.gpu().info().software;
        Self {
            renderer,
            shared,
            software,
            max_gpu_bytes,
            viewers: HashMap::new(),
            still: None,
            clock: Duration::ZERO,
            last_background: Instant::now(),
        }
    }

    pub(super) fn run(mut self) {
        let shared = self.shared.clone();
        loop {
            let seen = {
                let mut inbox = shared.inbox.lock();
                if inbox.closing {
                    return;
                }
                self.take_inputs(&mut inbox);
                inbox.version
            };
            let now = Instant::now();
            match self.pick(now) {
                Ok(turn) => self.work(turn),
                Err(wake_at) => {
                    let mut inbox = shared.inbox.lock();
                    if inbox.version == seen && !inbox.closing {
                        match wake_at {
                            Some(at) => {
                                shared.wake.wait_until(&mut inbox, at);
                            }
                            None => shared.wake.wait(&mut inbox),
                        }
                    }
                }
            }
        }
    }

    /// Copies what is new: the inbox is locked only for this.
    fn take_inputs(&mut self, inbox: &mut Inbox) {
        self.viewers.retain(|id, _| inbox.viewers.contains_key(id));
        for (id, input) in &inbox.viewers {
            let clock = self.clock;
            let watched = self.viewers.entry(*id).or_insert_with(|| {
                let mut watched = Watched::new(input.clone(), self.software);
                watched.used = clock;
                watched
            });
            watched.take(input);
        }
        let now = Instant::now();
        let wanted = |job: &StillJob| !job.reply.is_closed() && now < job.deadline;
        if self.still.as_ref().is_some_and(|still| !wanted(&still.job)) {
            self.still = None;
        }
        inbox.stills.retain(wanted);
        if self.still.is_none()
            && let Some(job) = inbox.stills.pop_front()
        {
            self.still = Some(ActiveStill { job, view: View::new(), used: self.clock });
        }
    }

    /// Moving viewers before background work, within each class who has used least; or the time
    /// until which nobody needs anything.
    fn pick(&mut self, now: Instant) -> Result<Turn, Option<Instant>> {
        let mut wake_at: Option<Instant> = None;
        let mut moving: Option<(Duration, ViewerId)> = None;
        let mut background: Option<(Duration, Option<ViewerId>)> =
            self.still.as_ref().map(|still| (still.used, None));
        let mut sharers = 0;
        for (&id, watched) in &self.viewers {
            match watched.need(now) {
                Need::Nothing => {}
                Need::Until(at) => wake_at = Some(wake_at.map_or(at, |earliest| earliest.min(at))),
                Need::Moving => {
                    sharers += 1;
                    let candidate = (watched.used, id);
                    moving = Some(moving.map_or(candidate, |best| best.min(candidate)));
                }
                Need::Still => {
                    let candidate = (watched.used, Some(id));
                    background = Some(background.map_or(candidate, |best| best.min(candidate)));
                }
            }
        }
        if background.is_none() {
            self.last_background = now;
        }
        let starved = now.saturating_duration_since(self.last_background) > BACKGROUND_PATIENCE;
        match (moving, background) {
            (_, Some((_, who))) if starved || moving.is_none() => {
                self.last_background = now;
                Ok(who.map_or(Turn::Still, |id| Turn::Viewer(id, Need::Still, 1)))
            }
            (Some((_, id)), _) => Ok(Turn::Viewer(id, Need::Moving, sharers)),
            (None, _) => Err(wake_at),
        }
    }

    fn work(&mut self, turn: Turn) {
        let slice = if self.software { SLICE_SOFTWARE } else { SLICE };
        match turn {
            Turn::Viewer(id, need, sharers) => {
                let Some(watched) = self.viewers.get_mut(&id) else { return };
                // Time spent idle is no credit.
                watched.used = watched.used.max(self.clock.saturating_sub(BACKGROUND_PATIENCE));
                let result = watched.advance(&mut self.renderer, need, slice, sharers);
                self.clock = watched.used;
                match result {
                    Ok(()) => self.keep_within_memory(Some(id)),
                    Err(RenderError::DeviceLost(reason)) => self.reopen(&reason),
                    // Tried again with more room.
                    Err(RenderError::OutOfMemory { .. }) if self.drop_one(Some(id)) => {
                        self.keep_within_memory(Some(id));
                    }
                    Err(error) => {
                        tracing::error!(%error, "drawing failed");
                        if let Some(watched) = self.viewers.get_mut(&id) {
                            watched.fail(&error);
                        }
                    }
                }
            }
            Turn::Still => {
                self.advance_still(slice);
                self.keep_within_memory(None);
            }
        }
    }

    /// Drops what views keep, those first that cannot be seen and were not worked on for longest, as
    /// long as more of the GPU's memory is in use than may be. The view at work keeps its own.
    fn keep_within_memory(&mut self, at_work: Option<ViewerId>) {
        let still = self.still.as_ref().map_or(0, |still| still.view.total_bytes());
        let of_views = |worker: &Self| worker.viewers.values().map(Watched::gpu_bytes).sum::<u64>() + still;
        self.renderer.volumes().charge_others(of_views(self));
        while self.renderer.volumes().excess_bytes() > 0 && self.drop_one(at_work) {
            self.renderer.volumes().charge_others(of_views(self));
        }
    }

    /// Drops what one view keeps that is not at work; false if none keeps anything.
    fn drop_one(&mut self, at_work: Option<ViewerId>) -> bool {
        let others =
            self.viewers.iter_mut().filter(|(id, view)| Some(**id) != at_work && view.gpu_bytes() > 0);
        let least = others.min_by_key(|(_, view)| view.keep_order());
        least.map(|(_, view)| view.drop_pictures()).is_some()
    }

    fn advance_still(&mut self, slice: Duration) {
        let Some(mut active) = self.still.take() else { return };
        let began = Instant::now();
        match self.draw_still(&mut active, slice) {
            Ok(None) => {
                active.used += began.elapsed();
                self.clock = active.used;
                self.still = Some(active);
            }
            Ok(Some(still)) => drop(active.job.reply.send(Ok(still))),
            Err(error) => {
                let lost = matches!(error, RenderError::DeviceLost(_));
                let reason = error.to_string();
                drop(active.job.reply.send(Err(error)));
                if lost {
                    self.reopen(&reason);
                }
            }
        }
    }

    fn draw_still(
        &mut self,
        active: &mut ActiveStill,
        slice: Duration,
    ) -> Result<Option<Still>, RenderError> {
        let ActiveStill { job, view, .. } = active;
        let request = DrawRequest { snapshot: &job.snapshot, target: job.target, budget: Some(slice) };
        if !self.renderer.draw(view, &request)?.complete {
            return Ok(None);
        }
        Ok(Some(if job.radiance {
            Still::Radiance(self.renderer.radiance(view)?)
        } else {
            Still::Picture(self.renderer.picture(view)?)
        }))
    }

    /// Opens the device again after it was lost; viewers are told, and drawn anew.
    fn reopen(&mut self, reason: &str) {
        tracing::error!(reason, "the GPU was lost; opening it again");
        let lost = RenderError::DeviceLost(reason.to_owned());
        self.still = None;
        for watched in self.viewers.values_mut() {
            watched.fail(&lost);
        }
        let policy = if self.software { AdapterPolicy::Any } else { AdapterPolicy::HardwareOnly };
        match Gpu::open(policy).and_then(Renderer::new) {
            Ok(renderer) => {
                renderer.volumes().set_budget_bytes(self.max_gpu_bytes);
                *self.shared.preparer.lock() = renderer.preparer();
                self.renderer = renderer;
                self.viewers.values_mut().for_each(Watched::forget);
            }
            Err(error) => {
                tracing::error!(%error, "the GPU cannot be opened again");
                std::thread::sleep(REOPEN_PAUSE);
            }
        }
    }
}
