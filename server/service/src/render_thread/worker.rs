//! The render thread's loop: whose turn it is, one slice of work at a time.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use render::{AdapterPolicy, BakeStore, DrawRequest, Gpu, Light, RenderError, Renderer, View};

use super::turns::{Account, Patience, Turns};
use super::watched::{Need, Watched};
use super::{Inbox, Shared, Still, StillJob, ViewerId};

/// Length of a slice of work.
const SLICE: Duration = Duration::from_millis(6);
/// The same on a software device.
const SLICE_SOFTWARE: Duration = Duration::from_millis(25);
/// Refinement and stills get a slice after this time, however much others move, if their slices are
/// short ([`Patience`]).
const BACKGROUND_PATIENCE: Duration = Duration::from_millis(250);
/// The same of an export, however much there is to do.
const EXPORT_PATIENCE: Duration = Duration::from_secs(1);
/// Pause before a lost device is opened again.
const REOPEN_PAUSE: Duration = Duration::from_secs(2);

/// Everything the thread owns.
pub(super) struct Worker {
    renderer: Renderer,
    shared: Arc<Shared>,
    software: bool,
    /// For all that is on the GPU.
    max_gpu_bytes: u64,
    /// Where precomputed light is kept.
    bakes: Option<Arc<BakeStore>>,
    viewers: HashMap<ViewerId, Watched>,
    still: Option<ActiveStill>,
    /// The picture of the export under way.
    export: Option<ActiveStill>,
    /// What the pictures of one export share, between two of them.
    export_view: View,
    turns: Turns,
    background: Patience,
    exports: Patience,
}

/// The still being drawn.
struct ActiveStill {
    job: StillJob,
    view: View,
    account: Account,
}

/// Whose turn it is.
enum Turn {
    Viewer(ViewerId, Need, u32),
    Still,
    Export,
}

impl Worker {
    pub(super) fn new(
        renderer: Renderer,
        shared: Arc<Shared>,
        max_gpu_bytes: u64,
        bakes: Option<Arc<BakeStore>>,
    ) -> Self {
        let software = renderer.gpu().info().software;
        Self {
            renderer,
            shared,
            software,
            max_gpu_bytes,
            bakes,
            viewers: HashMap::new(),
            still: None,
            export: None,
            export_view: View::new(),
            turns: Turns::default(),
            background: Patience::new(BACKGROUND_PATIENCE, Instant::now()),
            exports: Patience::new(EXPORT_PATIENCE, Instant::now()),
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
                Ok(turn) => {
                    self.work(&turn);
                    let done = Instant::now();
                    let class = match turn {
                        Turn::Viewer(_, Need::Still, _) | Turn::Still => Some(&mut self.background),
                        Turn::Export => Some(&mut self.exports),
                        Turn::Viewer(..) => None,
                    };
                    if let Some(patience) = class {
                        patience.had_turn(done, done.saturating_duration_since(now));
                    }
                }
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
            let watched = self
                .viewers
                .entry(*id)
                .or_insert_with(|| Watched::new(input.clone(), self.software, self.turns.join()));
            watched.take(input);
        }
        let now = Instant::now();
        let wanted = |job: &StillJob| !job.reply.is_closed() && now < job.deadline;
        if self.still.as_ref().is_some_and(|still| !wanted(&still.job)) {
            self.still = None;
        }
        if self.export.as_ref().is_some_and(|export| !wanted(&export.job)) {
            self.export = None;
        }
        if !inbox.exporting {
            self.export_view = View::new();
        }
        if self.export.is_none()
            && let Some(job) = inbox.export.take().filter(wanted)
        {
            let view = std::mem::take(&mut self.export_view);
            self.export = Some(ActiveStill { job, view, account: self.turns.join() });
        }
        inbox.stills.retain(wanted);
        if self.still.is_none()
            && let Some(job) = inbox.stills.pop_front()
        {
            self.still = Some(ActiveStill { job, view: View::new(), account: self.turns.join() });
        }
    }

    /// Moving viewers before background work, exports behind both, within each class who had fewest
    /// turns; or the time until which nobody needs anything.
    fn pick(&mut self, now: Instant) -> Result<Turn, Option<Instant>> {
        let mut wake_at: Option<Instant> = None;
        let mut moving: Option<(Account, ViewerId)> = None;
        let mut background: Option<(Account, Option<ViewerId>)> =
            self.still.as_ref().map(|still| (still.account, None));
        let mut sharers = 0;
        for (&id, watched) in &self.viewers {
            match watched.need(now) {
                Need::Nothing => {}
                Need::Until(at) => wake_at = Some(wake_at.map_or(at, |earliest| earliest.min(at))),
                Need::Moving => {
                    sharers += 1;
                    let candidate = (watched.account, id);
                    moving = Some(moving.map_or(candidate, |best| best.min(candidate)));
                }
                Need::Still => {
                    let candidate = (watched.account, Some(id));
                    background = Some(background.map_or(candidate, |best| best.min(candidate)));
                }
            }
        }
        if background.is_none() {
            self.background.nobody_waits(now);
        }
        if self.export.is_none() {
            self.exports.nobody_waits(now);
        }
        let idle = moving.is_none() && background.is_none();
        if self.export.is_some() && (idle || self.exports.is_over(now)) {
            return Ok(Turn::Export);
        }
        match (moving, background) {
            (_, Some((_, who))) if moving.is_none() || self.background.is_over(now) => {
                Ok(who.map_or(Turn::Still, |id| Turn::Viewer(id, Need::Still, 1)))
            }
            (Some((_, id)), _) => Ok(Turn::Viewer(id, Need::Moving, sharers)),
            (None, _) => Err(wake_at),
        }
    }

    fn work(&mut self, turn: &Turn) {
        let slice = if self.software { SLICE_SOFTWARE } else { SLICE };
        match turn {
            &Turn::Viewer(id, need, sharers) => {
                let Some(watched) = self.viewers.get_mut(&id) else { return };
                let allotted = watched.allotment(need, slice, sharers);
                let (began, frame) = (Instant::now(), watched.frame());
                let result = watched.advance(&mut self.renderer, need, allotted);
                let is_picture = watched.frame() != frame;
                self.turns.charge(&mut watched.account, allotted, began.elapsed(), is_picture);
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
                if let Some(active) = self.still.take() {
                    self.still = self.advance_still(active, slice).continue_value();
                }
                self.keep_within_memory(None);
            }
            Turn::Export => {
                if let Some(active) = self.export.take() {
                    match self.advance_still(active, slice) {
                        ControlFlow::Break(view) => self.export_view = view,
                        ControlFlow::Continue(active) => self.export = Some(active),
                    }
                }
                self.keep_within_memory(None);
            }
        }
    }

    /// Drops what views keep, those first that cannot be seen and were not worked on for longest, as
    /// long as more of the GPU's memory is in use than may be. The view at work keeps its own.
    fn keep_within_memory(&mut self, at_work: Option<ViewerId>) {
        let stills = self.still.iter().chain(&self.export).map(|still| still.view.total_bytes()).sum::<u64>();
        let others = stills + self.export_view.total_bytes();
        let of_views = |worker: &Self| {
            let of_pictures = worker.viewers.values().map(Watched::gpu_bytes).sum::<u64>();
            of_pictures + worker.light_bytes() + others
        };
        self.renderer.volumes().charge_others(of_views(self));
        while self.renderer.volumes().excess_bytes() > 0 && self.drop_one(at_work) {
            self.renderer.volumes().charge_others(of_views(self));
        }
    }

    /// Light computed ahead, that of each session once.
    fn light_bytes(&self) -> u64 {
        let mut counted: Vec<&Light> = Vec::new();
        for light in self.viewers.values().map(Watched::light) {
            if !counted.iter().any(|other| other.is_same(light)) {
                counted.push(light);
            }
        }
        counted.iter().map(|light| light.bytes()).sum()
    }

    /// Drops what one view keeps that is not at work, its light too unless the one at work shares it;
    /// false if none keeps anything.
    fn drop_one(&mut self, at_work: Option<ViewerId>) -> bool {
        let kept = at_work.and_then(|id| self.viewers.get(&id)).map(|view| view.light().clone());
        let may_go = |light: &Light| kept.as_ref().is_none_or(|kept| !kept.is_same(light));
        let others = self.viewers.iter_mut().filter(|(id, view)| {
            let light = view.light();
            Some(**id) != at_work && (view.gpu_bytes() > 0 || may_go(light) && light.bytes() > 0)
        });
        let Some((_, least)) = others.min_by_key(|(_, view)| view.keep_order()) else { return false };
        if may_go(least.light()) {
            least.light().clear();
        }
        least.drop_pictures();
        true
    }

    /// Works on a still for a slice: it goes on, or ended and leaves what its drawing held.
    fn advance_still(&mut self, mut active: ActiveStill, slice: Duration) -> ControlFlow<View, ActiveStill> {
        let began = Instant::now();
        match self.draw_still(&mut active, slice) {
            Ok(None) => {
                self.turns.charge(&mut active.account, slice, began.elapsed(), false);
                ControlFlow::Continue(active)
            }
            Ok(Some(still)) => {
                drop(active.job.reply.send(Ok(still)));
                ControlFlow::Break(active.view)
            }
            Err(error) => {
                let lost = matches!(error, RenderError::DeviceLost(_));
                let reason = error.to_string();
                drop(active.job.reply.send(Err(error)));
                if lost {
                    self.reopen(&reason);
                }
                ControlFlow::Break(View::new())
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
        (self.still, self.export, self.export_view) = (None, None, View::new());
        for watched in self.viewers.values_mut() {
            watched.fail(&lost);
        }
        let policy = if self.software { AdapterPolicy::Any } else { AdapterPolicy::HardwareOnly };
        match Gpu::open(policy).and_then(Renderer::new) {
            Ok(mut renderer) => {
                renderer.keep_bakes(self.bakes.clone());
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
