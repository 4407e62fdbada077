//! The thread that owns the GPU's submission, and how the rest of the service talks to it.
//!
//! Each viewer has a slot that holds its newest input: snapshot, viewport, visibility,
//! acknowledgements. Writers overwrite it, the thread reads it between two slices of work; nothing
//! queues up, so the newest state always wins. Finished pictures leave through the viewer's
//! bounded channel and are encoded elsewhere.

mod frame;
mod pace;
mod turns;
mod watched;
mod worker;

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};
use proto::frame::FrameHeader;
use proto::plan::FrameReport;
use proto::rest::DeviceInfo;
use render::{BakeStore, Gpu, Light, Picture, Preparer, Radiance, RenderError, Renderer, VolumeCache};
use scene::plan::Target;
use scene::{Scene, Snapshot};
use tokio::sync::{mpsc, oneshot};

pub use pace::Link;

use crate::problem::{Answer, Fault};

/// Frames a viewer may have that it has not acknowledged.
pub const MAX_FRAMES_IN_FLIGHT: u32 = 2;
/// Pictures and reports waiting for a viewer's encoder: the frames in flight, each with a report.
pub const MAX_WAITING_OUTPUTS: usize = 8;

/// Identifies a viewer on the render thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ViewerId(u64);

/// The newest state of a viewer; a writer overwrites what the thread has not read yet.
#[derive(Clone)]
pub struct ViewerInput {
    /// What to show, with this viewer's camera.
    pub snapshot: Arc<Snapshot>,
    /// The light of its session: viewers of one session share what does not depend on the camera.
    pub light: Light,
    /// Device pixels; nothing is drawn before the viewer has said.
    pub viewport: Option<(u32, u32)>,
    /// A hidden viewer gets no frames.
    pub visible: bool,
    /// Newest input.
    pub seq: u32,
    /// When it arrived.
    pub arrived: Instant,
    /// Newest frame the viewer has acknowledged.
    pub acknowledged: u32,
    /// What its link carries.
    pub link: Link,
    /// Counts its connections after the first.
    pub resumed: u32,
    outputs: mpsc::Sender<Output>,
}

/// What the thread hands to a viewer's connection.
pub enum Output {
    /// A picture to encode and send; encoding fills in the header's rest.
    Frame(Box<FinishedFrame>),
    /// An edit that cannot be seen: nothing had to be drawn.
    Unchanged {
        /// Newest frame.
        frame: u32,
        /// The plan that says why.
        report: Box<FrameReport>,
    },
    /// Drawing failed.
    Failed(String),
}

/// A picture on its way to a viewer.
pub struct FinishedFrame {
    /// The pixels.
    pub picture: Picture,
    /// How to encode them.
    pub encoding: Encoding,
    /// Everything that is known before encoding.
    pub header: FrameHeader,
    /// What it cost.
    pub report: FrameReport,
}

/// How a picture travels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// JPEG 4:2:0 of this quality.
    Moving(u8),
    /// JPEG 4:4:4 of high quality.
    Refining,
    /// Lossless WebP.
    Lossless,
}

/// A still, drawn beside the viewers.
pub struct StillJob {
    snapshot: Arc<Snapshot>,
    target: Target,
    radiance: bool,
    deadline: Instant,
    reply: oneshot::Sender<Result<Still, RenderError>>,
}

/// A drawn still.
pub enum Still {
    /// Tone-mapped.
    Picture(Picture),
    /// Linear.
    Radiance(Radiance),
}

struct Shared {
    inbox: Mutex<Inbox>,
    wake: Condvar,
    preparer: Mutex<Preparer>,
}

struct Inbox {
    viewers: HashMap<ViewerId, ViewerInput>,
    /// At most `limits.max_waiting_stills`.
    stills: VecDeque<StillJob>,
    /// The next picture of the export under way.
    export: Option<StillJob>,
    /// Whether an export is under way: what its pictures share is kept until then.
    exporting: bool,
    next_viewer: u64,
    /// Counts changes, so that the thread never sleeps through one.
    version: u64,
    closing: bool,
}

/// The way to the render thread; the thread ends with [`RenderThread::stop`].
pub struct RenderThread {
    shared: Arc<Shared>,
    device: DeviceInfo,
    max_waiting_stills: usize,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl RenderThread {
    /// Starts the thread.
    ///
    /// # Errors
    /// The device refuses, or the system has no thread left.
    pub fn start(
        gpu: Arc<Gpu>,
        max_waiting_stills: usize,
        max_gpu_bytes: u64,
        bakes: Option<Arc<BakeStore>>,
    ) -> Result<Self, RenderError> {
        let device = gpu.info().clone();
        let mut renderer = Renderer::new(gpu)?;
        renderer.warm_up()?;
        renderer.keep_bakes(bakes.clone());
        renderer.volumes().set_budget_bytes(max_gpu_bytes);
        let inbox = Inbox {
            viewers: HashMap::new(),
            stills: VecDeque::new(),
            export: None,
            exporting: false,
            next_viewer: 1,
            version: 0,
            closing: false,
        };
        let shared = Arc::new(Shared {
            inbox: Mutex::new(inbox),
            wake: Condvar::new(),
            preparer: Mutex::new(renderer.preparer()),
        });
        let worker = worker::Worker::new(renderer, shared.clone(), max_gpu_bytes, bakes);
        let thread = std::thread::Builder::new()
            .name("render".into())
            .spawn(move || worker.run())
            .map_err(|error| RenderError::Gpu(format!("no thread for the GPU: {error}")))?;
        Ok(Self { shared, device, max_waiting_stills, thread: Mutex::new(Some(thread)) })
    }

    /// What renders.
    pub fn device(&self) -> &DeviceInfo {
        &self.device
    }

    /// Volume textures; uploading ahead of time keeps it off the render thread.
    pub fn volumes(&self) -> Arc<VolumeCache> {
        self.shared.preparer.lock().volumes().clone()
    }

    /// Compiles what a scene's pictures need, on this thread instead of the one that draws. Blocks.
    pub fn prepare(&self, scene: &Scene) {
        let preparer = self.shared.preparer.lock().clone();
        preparer.compile(scene);
    }

    /// Adds a viewer; its frames come through `outputs`, which should hold
    /// [`MAX_WAITING_OUTPUTS`].
    pub fn add_viewer(
        &self,
        snapshot: Arc<Snapshot>,
        light: Light,
        outputs: mpsc::Sender<Output>,
    ) -> ViewerId {
        let mut inbox = self.shared.inbox.lock();
        let id = ViewerId(inbox.next_viewer);
        inbox.next_viewer += 1;
        let input = ViewerInput {
            snapshot,
            light,
            viewport: None,
            visible: true,
            seq: 0,
            arrived: Instant::now(),
            acknowledged: 0,
            link: Link::default(),
            resumed: 0,
            outputs,
        };
        inbox.viewers.insert(id, input);
        self.notify(inbox);
        id
    }

    /// Goes on with a viewer over another connection: it is shown what it saw, and what it has not
    /// acknowledged counts as lost.
    pub fn resume_viewer(&self, id: ViewerId, outputs: mpsc::Sender<Output>) {
        self.update(id, |input| {
            input.outputs = outputs;
            input.link = Link::default();
            input.visible = true;
            input.resumed += 1;
        });
    }

    /// Changes a viewer's newest input.
    pub fn update(&self, id: ViewerId, change: impl FnOnce(&mut ViewerInput)) {
        let mut inbox = self.shared.inbox.lock();
        if let Some(input) = inbox.viewers.get_mut(&id) {
            change(input);
        }
        self.notify(inbox);
    }

    /// Forgets a viewer.
    pub fn remove_viewer(&self, id: ViewerId) {
        let mut inbox = self.shared.inbox.lock();
        inbox.viewers.remove(&id);
        self.notify(inbox);
    }

    /// Draws a still beside the viewers, complete to `target`.
    ///
    /// # Errors
    /// Too many are waiting (503), it takes longer than `patience` (504), the GPU refuses.
    pub async fn still(
        &self,
        snapshot: Arc<Snapshot>,
        target: Target,
        radiance: bool,
        patience: Duration,
    ) -> Answer<Still> {
        let (reply, answer) = oneshot::channel();
        let deadline = Instant::now() + patience;
        {
            let mut inbox = self.shared.inbox.lock();
            // Whoever hung up makes room.
            inbox.stills.retain(|job| !job.reply.is_closed());
            if inbox.stills.len() >= self.max_waiting_stills {
                let most = self.max_waiting_stills;
                return Err(Fault::busy(format!(
                    "{most} pictures are waiting to be drawn; try again shortly."
                )));
            }
            inbox.stills.push_back(StillJob { snapshot, target, radiance, deadline, reply });
            self.notify(inbox);
        }
        answered(answer, patience, "`sampling.samples_per_pixel`").await
    }

    /// Draws the next picture of the export under way, behind everything else. There is one at a time:
    /// another picture takes the place of one that nobody waits for any more.
    ///
    /// # Errors
    /// It takes longer than `patience` (504), the GPU refuses.
    pub async fn export_picture(
        &self,
        snapshot: Arc<Snapshot>,
        target: Target,
        patience: Duration,
    ) -> Answer<Still> {
        let (reply, answer) = oneshot::channel();
        let deadline = Instant::now() + patience;
        {
            let mut inbox = self.shared.inbox.lock();
            inbox.export = Some(StillJob { snapshot, target, radiance: false, deadline, reply });
            inbox.exporting = true;
            self.notify(inbox);
        }
        answered(answer, patience, "`frames` or `samples`").await
    }

    /// Lets go of what the pictures of an export shared.
    pub fn end_export(&self) {
        let mut inbox = self.shared.inbox.lock();
        inbox.export = None;
        inbox.exporting = false;
        self.notify(inbox);
    }

    /// Whether the thread is at work or waits for work.
    pub fn is_alive(&self) -> bool {
        self.thread.lock().as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Ends the thread after its present slice and waits for it. Blocks.
    pub fn stop(&self) {
        let mut inbox = self.shared.inbox.lock();
        inbox.closing = true;
        self.notify(inbox);
        let thread = self.thread.lock().take();
        if thread.is_some_and(|thread| thread.join().is_err()) {
            tracing::error!("the render thread had panicked");
        }
    }

    fn notify(&self, mut inbox: parking_lot::MutexGuard<'_, Inbox>) {
        inbox.version += 1;
        drop(inbox);
        self.shared.wake.notify_one();
    }
}

impl Drop for RenderThread {
    fn drop(&mut self) {
        self.stop();
    }
}

/// What became of a picture that is waited for; `less` is what may be asked for to be quicker.
async fn answered(
    answer: oneshot::Receiver<Result<Still, RenderError>>,
    patience: Duration,
    less: &str,
) -> Answer<Still> {
    match tokio::time::timeout(patience, answer).await {
        Ok(Ok(Ok(still))) => Ok(still),
        Ok(Ok(Err(error))) => Err(render_fault(error)),
        // The thread drops the reply when the deadline passes or the service stops.
        Ok(Err(_)) | Err(_) => Err(Fault::too_slow(format!(
            "The picture was not finished within {} seconds; ask for a smaller one or fewer {less}.",
            patience.as_secs()
        ))),
    }
}

/// A failure of the renderer as an answer to a request.
pub fn render_fault(error: RenderError) -> Fault {
    match error {
        RenderError::Refused(field) => field.into(),
        RenderError::TooLarge { .. } => Fault::invalid("", error.to_string()),
        RenderError::OutOfMemory { .. } => Fault::busy(error.to_string()),
        _ => Fault::internal("drawing", &error),
    }
}
