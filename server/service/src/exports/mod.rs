//! Exports: a session's scene seen from a camera that goes around it or through saved views, drawn
//! picture by picture behind all other work and written to a file.
//!
//! An export is of the scene as it was when it was asked for. One is drawn at a time, the others wait.
//! Its file is kept in `data/exports` for a while after it is done. The folder is emptied at every
//! start: an export does not survive the process, and the answer to whoever asks for it says so.

mod flight;
mod orbit;
mod reel;
pub mod routes;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use proto::rest::{self, ExportFormat, ExportRequest, ExportState};
use proto::scene_file::Camera;
use scene::Snapshot;
use scene::plan::Target;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

use crate::App;
use crate::config::Config;
use crate::datasets::storage::random_hex;
use crate::problem::{Answer, Fault};
use crate::render_thread::{RenderThread, Still};
use reel::Reel;

/// Random bytes of an identifier: whoever knows it may use the export.
const ID_BYTES: usize = 16;

/// Every export.
pub struct Exports {
    folder: PathBuf,
    jobs: Mutex<Vec<Arc<Export>>>,
    /// One is drawn at a time.
    turn: Semaphore,
    most: usize,
    most_bytes: u64,
    keep: Duration,
    /// Longest time one may be drawn.
    patience: Duration,
}

/// One export.
pub struct Export {
    id: String,
    request: ExportRequest,
    /// Where a turntable begins.
    camera: Camera,
    path: PathBuf,
    /// Cancelled when it is deleted.
    stop: CancellationToken,
    progress: Mutex<Progress>,
}

struct Progress {
    state: ExportState,
    frames: u32,
    /// Bytes of its file.
    bytes: u64,
    /// When its first picture was begun.
    began: Option<Instant>,
    /// When it was done or failed.
    ended: Option<Instant>,
    problem: Option<rest::Problem>,
}

impl Export {
    /// What REST tells about it.
    pub fn describe(&self) -> rest::Export {
        let progress = self.progress.lock();
        let left = self.request.frames - progress.frames;
        // From the pictures so far; unknown before the first.
        let seconds_left = progress.began.filter(|_| progress.frames > 0 && progress.ended.is_none());
        let seconds_left = seconds_left
            .map(|began| began.elapsed().as_secs_f64() / f64::from(progress.frames) * f64::from(left));
        rest::Export {
            id: self.id.clone(),
            state: progress.state,
            width: self.request.width,
            height: self.request.height,
            format: self.request.format,
            frames: self.request.frames,
            frames_done: progress.frames,
            seconds_left,
            bytes: progress.bytes,
            problem: progress.problem.clone(),
        }
    }

    fn end(&self, state: ExportState, problem: Option<rest::Problem>) {
        let mut progress = self.progress.lock();
        progress.state = state;
        progress.ended = Some(Instant::now());
        if problem.is_some() {
            progress.bytes = 0;
        }
        progress.problem = problem;
    }
}

/// Why an export ends without a file.
enum End {
    /// It was deleted, or the service stops.
    Stopped,
    Failed(Fault),
}

impl From<Fault> for End {
    fn from(fault: Fault) -> Self {
        End::Failed(fault)
    }
}

impl Exports {
    /// An empty folder.
    ///
    /// # Errors
    /// It cannot be made or emptied.
    pub fn open(config: &Config) -> io::Result<Self> {
        let folder = config.data.join("exports");
        fs::create_dir_all(&folder)?;
        for entry in fs::read_dir(&folder)? {
            fs::remove_file(entry?.path())?;
        }
        Ok(Self {
            folder,
            jobs: Mutex::default(),
            turn: Semaphore::new(1),
            most: config.limits.max_exports,
            most_bytes: config.limits.max_export_bytes,
            keep: Duration::from_secs(config.export_keep_seconds),
            patience: Duration::from_secs(config.limits.export_seconds),
        })
    }

    /// Begins an export of a snapshot; a turntable begins at the camera. It goes on whether or not anybody asks for it.
    ///
    /// # Errors
    /// There are too many (503).
    pub fn begin(
        &self,
        app: &Arc<App>,
        request: ExportRequest,
        camera: Camera,
        snapshot: Arc<Snapshot>,
    ) -> Answer<Arc<Export>> {
        self.expire();
        let id = random_hex(ID_BYTES).map_err(|error| Fault::internal("beginning an export", &error))?;
        let path = self.folder.join(format!("{id}.{}", ending(request.format)));
        let progress = Progress {
            state: ExportState::Waiting,
            frames: 0,
            bytes: 0,
            began: None,
            ended: None,
            problem: None,
        };
        let export = Arc::new(Export {
            id,
            request,
            camera,
            path,
            stop: CancellationToken::new(),
            progress: Mutex::new(progress),
        });
        {
            let mut jobs = self.jobs.lock();
            if jobs.len() >= self.most {
                let most = self.most;
                return Err(Fault::busy(format!(
                    "There are {most} exports, the most this service keeps (`limits.max_exports`); delete one, or wait until one expires."
                )));
            }
            jobs.push(export.clone());
        }
        tokio::spawn(run(app.clone(), export.clone(), snapshot));
        Ok(export)
    }

    /// An export by its identifier.
    ///
    /// # Errors
    /// There is none (any more).
    pub fn find(&self, id: &str) -> Answer<Arc<Export>> {
        self.expire();
        let found = self.jobs.lock().iter().find(|export| export.id == id).cloned();
        found.ok_or_else(|| no_such_export(id))
    }

    /// Stops an export, if it is under way, and forgets it. Blocks.
    ///
    /// # Errors
    /// There is none.
    pub fn delete(&self, id: &str) -> Answer<()> {
        let export = self.find(id)?;
        self.jobs.lock().retain(|other| other.id != id);
        remove(&export);
        Ok(())
    }

    /// Forgets those that ended long ago. Blocks.
    pub fn expire(&self) {
        let old = |export: &Arc<Export>| {
            export.progress.lock().ended.is_some_and(|ended| ended.elapsed() >= self.keep)
        };
        let expired: Vec<_> = self.jobs.lock().extract_if(.., |export| old(export)).collect();
        expired.iter().for_each(|export| remove(export));
    }

    /// Bytes of all files, also those that are being written.
    fn bytes(&self) -> u64 {
        self.jobs.lock().iter().map(|export| export.progress.lock().bytes).sum()
    }
}

fn remove(export: &Export) {
    export.stop.cancel();
    discard(&export.path);
}

fn discard(path: &Path) {
    if let Err(error) = fs::remove_file(path)
        && error.kind() != io::ErrorKind::NotFound
    {
        tracing::error!(%error, "the file of an export cannot be removed");
    }
}

/// Draws an export to its end.
async fn run(app: Arc<App>, export: Arc<Export>, snapshot: Arc<Snapshot>) {
    let done = match draw(&app, &export, &snapshot).await {
        Ok(()) => {
            export.end(ExportState::Done, None);
            true
        }
        Err(End::Failed(fault)) => {
            export.end(ExportState::Failed, Some(fault.problem));
            false
        }
        Err(End::Stopped) => false,
    };
    // It may have been deleted while its file was being written.
    if !done || export.stop.is_cancelled() {
        let path = export.path.clone();
        drop(crate::blocking("removing an export", move || discard(&path)).await);
    }
}

/// Lets go of what the pictures of an export share when it ends.
struct Drawing<'a>(&'a RenderThread);

impl Drop for Drawing<'_> {
    fn drop(&mut self) {
        self.0.end_export();
    }
}

async fn draw(app: &Arc<App>, export: &Arc<Export>, snapshot: &Arc<Snapshot>) -> Result<(), End> {
    let exports = app.exports();
    let stopped = async {
        tokio::select! {
            () = export.stop.cancelled() => {}
            () = app.closing().cancelled() => {}
        }
    };
    tokio::pin!(stopped);
    let _turn = tokio::select! {
        () = &mut stopped => return Err(End::Stopped),
        turn = exports.turn.acquire() => turn.map_err(|_| End::Stopped)?,
    };
    let _drawing = Drawing(app.renderer());
    let began = Instant::now();
    {
        let mut progress = export.progress.lock();
        (progress.state, progress.began) = (ExportState::Drawing, Some(began));
    }
    let request = &export.request;
    let samples_per_pixel = request.samples.unwrap_or_else(|| snapshot.scene.samples_at_rest());
    let target = Target { width: request.width, height: request.height, samples_per_pixel };
    let (path, wanted) = (export.path.clone(), request.clone());
    let created = crate::blocking("beginning an export", move || Reel::create(&path, &wanted)).await?;
    let mut reel = created.map_err(|error| Fault::disk("beginning an export", &error))?;
    for camera in way(request, &export.camera) {
        let left = exports.patience.saturating_sub(began.elapsed());
        let mut scene = snapshot.scene.clone();
        scene.camera = scene::Camera::from_file(&camera);
        let turned = Arc::new(Snapshot { epoch: snapshot.epoch, scene });
        let drawn = tokio::select! {
            () = &mut stopped => return Err(End::Stopped),
            drawn = app.renderer().export_picture(turned, target, left) => drawn?,
        };
        let Still::Picture(picture) = drawn else {
            return Err(Fault::internal("drawing an export", &"radiance was drawn").into());
        };
        let added = crate::blocking("writing an export", move || {
            let added = reel.add(&picture);
            added.map(|()| reel)
        });
        reel = added.await?.map_err(|error| Fault::disk("writing an export", &error))?;
        {
            let mut progress = export.progress.lock();
            progress.frames += 1;
            progress.bytes = reel.bytes();
        }
        if exports.bytes() > exports.most_bytes {
            return Err(Fault::storage_full(format!(
                "All exports together may have {} bytes (`limits.max_export_bytes`); delete one, or ask for fewer or smaller pictures.",
                exports.most_bytes
            ))
            .into());
        }
    }
    let finished = crate::blocking("ending an export", move || reel.finish()).await?;
    export.progress.lock().bytes = finished.map_err(|error| Fault::disk("ending an export", &error))?;
    Ok(())
}

/// The cameras of the pictures, one after the other.
fn way(request: &ExportRequest, camera: &Camera) -> Box<dyn Iterator<Item = Camera> + Send> {
    match request.turns {
        Some(turns) => Box::new(orbit::way(camera, request.frames, turns)),
        None => Box::new(flight::Flight::new(&request.keys).way(request.frames)),
    }
}

/// Ending of a file's name.
fn ending(format: ExportFormat) -> &'static str {
    match format {
        ExportFormat::Apng => "png",
        ExportFormat::Zip => "zip",
    }
}

fn no_such_export(id: &str) -> Fault {
    let shown: String = id.chars().take(64).collect();
    Fault::not_found(format!(
        "There is no export `{shown}`. It may have been deleted, or be older than `export_keep_seconds`; and exports do not survive a restart of the service: begin it again."
    ))
}
