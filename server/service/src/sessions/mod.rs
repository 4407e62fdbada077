//! Sessions: scenes that are explored, each with its viewers.
//!
//! The scene file is the truth; the checked scene and the snapshots follow from it. An edit is
//! applied whole or not at all. Everything here computes for a moment under the session's lock and
//! is called where blocking is allowed, never on the async threads.

pub(crate) mod edits;
mod registry;
pub mod routes;
pub mod stills;
mod store;
mod viewers;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use proto::control::{Role, ServerMessage};
use proto::scene_file::{Camera, SceneFile};
use proto::{FieldError, rest};
use render::Light;
use scene::{Scene, Snapshot};
use serde_json::Value;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

pub use edits::{Asked, Edit, Loaded};
pub use registry::{Access, Sessions, WATCH_ONLY};
pub use viewers::{Member, Outlet};

use crate::App;
use crate::problem::{Answer, Fault};
use edits::{Checked, Current, Refusal};
use store::Stored;
use viewers::Viewer;

/// Random hexadecimal digits of a session's identifier: whoever knows it may use the session.
const ID_DIGITS: usize = 32;
/// Digits by which sessions are told apart in the log.
const DIGITS_IN_LOG: usize = 8;

/// A scene and its viewers.
pub struct Session {
    /// Identifier, hard to guess.
    pub id: String,
    created_unix_millis: u64,
    state: Mutex<State>,
    /// The epoch, for whoever waits for changes.
    epoch: watch::Sender<u32>,
    /// Cancelled when the session is deleted, or put away for lack of viewers.
    pub ended: CancellationToken,
    deleted: AtomicBool,
}

struct State {
    /// The truth, camera filled in.
    file: SceneFile,
    /// The scene's volume.
    loaded: Arc<Loaded>,
    scene: Scene,
    /// Light computed ahead, for all viewers.
    light: Light,
    epoch: u32,
    viewers: BTreeMap<u32, Viewer>,
    next_viewer: u32,
    /// When the last viewer left, or the session was last used without one.
    idle_since: Instant,
    /// The same, milliseconds since 1970.
    used_unix_millis: u64,
}

/// What became of a viewer's patches.
#[derive(Default)]
pub struct Patched {
    /// Those that were refused.
    pub rejected: Vec<(u32, FieldError)>,
    /// The volume that the last so many patches wait for.
    pub waiting: Option<(Asked, usize)>,
    /// The new epoch, if any was accepted; to be dropped after the refusals were sent, so that
    /// their author hears of those first.
    pub announcement: Option<Announcement>,
}

/// Tells whoever waits of a new epoch when it is dropped: also when its author is gone by then.
pub struct Announcement {
    session: Arc<Session>,
    epoch: u32,
}

impl Drop for Announcement {
    fn drop(&mut self) {
        self.session.epoch.send_if_modified(|known| {
            let newer = self.epoch > *known;
            *known = self.epoch.max(*known);
            newer
        });
    }
}

impl State {
    fn current(&self) -> Current<'_> {
        Current { file: &self.file, loaded: &self.loaded }
    }

    fn connected(&self) -> impl Iterator<Item = &Viewer> {
        self.viewers.values().filter(|viewer| viewer.is_connected())
    }

    fn used(&mut self) {
        self.idle_since = Instant::now();
        self.used_unix_millis = crate::unix_millis();
    }
}

impl Session {
    /// What it is called in the log. It gives nobody access.
    pub fn name_in_log(&self) -> String {
        let mut name = watch_id(&self.id);
        name.truncate(DIGITS_IN_LOG);
        name
    }

    /// The identifier that allows what a role may do.
    fn id_for(&self, role: Role) -> String {
        match role {
            Role::Editor => self.id.clone(),
            Role::Watcher => watch_id(&self.id),
        }
    }

    /// What REST tells about it to whoever may do that much.
    pub fn describe(&self, role: Role) -> rest::Session {
        let state = self.state.lock();
        rest::Session {
            id: self.id_for(role),
            epoch: state.epoch,
            viewers: state.connected().count() as u32,
            created_unix_millis: self.created_unix_millis,
            used_unix_millis: state.used_unix_millis,
            role,
            watch: (role == Role::Editor).then(|| watch_id(&self.id)),
            scene: state.file.clone(),
            shown: state.loaded.shown(),
        }
    }

    /// The newest snapshot, with the session's camera.
    pub fn snapshot(&self) -> Arc<Snapshot> {
        let mut state = self.state.lock();
        state.used();
        Arc::new(Snapshot { epoch: state.epoch, scene: state.scene.clone() })
    }

    /// What the newest snapshot would be with a patch, which may not need another volume. The
    /// session stays as it is.
    ///
    /// # Errors
    /// The field at fault, below `patch`.
    pub fn patched_snapshot(&self, app: &App, patch: &Value) -> Answer<Arc<Snapshot>> {
        let (file, loaded, epoch) = {
            let state = self.state.lock();
            (state.file.clone(), state.loaded.clone(), state.epoch)
        };
        let current = Current { file: &file, loaded: &loaded };
        let checked = edits::merged(&file, patch)
            .map_err(Refusal::Field)
            .and_then(|value| edits::check(app, current, None, value));
        match checked {
            Ok(checked) => Ok(Arc::new(Snapshot { epoch, scene: checked.scene })),
            Err(Refusal::Field(error)) => {
                let mut fault = Fault::from(error);
                if let Some(field) = &mut fault.problem.field {
                    field.insert_str(0, "patch.");
                }
                Err(fault)
            }
            Err(Refusal::Needs(_)) => {
                Err(Fault::invalid("patch.volume", "must be the session's: a preview loads no other"))
            }
        }
    }

    /// The newest scene file.
    pub fn scene_file(&self) -> SceneFile {
        self.state.lock().file.clone()
    }

    /// The camera of the newest scene file.
    pub fn camera(&self) -> Camera {
        let state = self.state.lock();
        filled_camera(&state.file, &state.scene)
    }

    /// Told of every new epoch.
    pub fn epochs(&self) -> watch::Receiver<u32> {
        self.epoch.subscribe()
    }

    /// Edits the scene on behalf of a request; a volume it names is loaded first.
    ///
    /// # Errors
    /// The field at fault, or the volume cannot be loaded. The scene is unchanged then.
    pub async fn edit(self: &Arc<Self>, app: &Arc<App>, edit: Edit) -> Answer<()> {
        let mut loaded = None;
        loop {
            let (session, shared, edit) = (self.clone(), app.clone(), edit.clone());
            let apply = move || session.try_edit(&shared, &edit, loaded.as_ref());
            match crate::blocking("editing a scene", apply).await? {
                Ok(()) => return Ok(()),
                Err(Refusal::Field(error)) => return Err(error.into()),
                // A patch may need another volume than before if the scene changed in between.
                Err(Refusal::Needs(asked)) => loaded = Some(Loaded::load(app, asked, |_| {}).await?),
            }
        }
    }

    fn try_edit(
        self: &Arc<Self>,
        app: &App,
        edit: &Edit,
        loaded: Option<&Arc<Loaded>>,
    ) -> Result<(), Refusal> {
        let mut state = self.state.lock();
        let value = match edit {
            Edit::Replace(value) => value.clone(),
            Edit::Patch(patch) => edits::merged(&state.file, patch)?,
        };
        let checked = edits::check(app, state.current(), loaded, value)?;
        drop(self.commit(app, &mut state, checked, None));
        Ok(())
    }

    /// Applies a viewer's patches in order. Each is checked on its own, so that what is refused
    /// does not depend on what arrived together; what is accepted is one edit of the scene.
    /// `loaded` is the volume that earlier patches waited for.
    pub fn patch(
        self: &Arc<Self>,
        app: &App,
        number: u32,
        patches: &[(u32, Value)],
        loaded: Option<&Arc<Loaded>>,
        arrived: Instant,
    ) -> Patched {
        let mut outcome = Patched::default();
        let mut state = self.state.lock();
        let Some(viewer) = state.viewers.get(&number) else { return outcome };
        let mut camera = (viewer.camera.clone(), viewer.camera_seq);
        let mut accepted: Option<Checked> = None;
        let mut done_seq = viewer.done_seq;
        for (index, (seq, patch)) in patches.iter().enumerate() {
            let current = accepted.as_ref().map_or_else(|| state.current(), Checked::current);
            match edits::patched(app, current, loaded, &camera, *seq, patch) {
                Ok((checked, moves_camera)) => {
                    if let (true, Some(moved)) = (moves_camera, &checked.file.camera) {
                        camera = (moved.clone(), *seq);
                    }
                    accepted = Some(checked);
                }
                Err(Refusal::Field(error)) => outcome.rejected.push((*seq, error)),
                Err(Refusal::Needs(asked)) => {
                    outcome.waiting = Some((asked, patches.len() - index));
                    break;
                }
            }
            done_seq = done_seq.max(*seq);
        }
        let waiting = outcome.waiting.as_ref().map_or(0, |(_, count)| *count);
        let waiting_from = patches.get(patches.len() - waiting).map(|(seq, _)| *seq);
        if let Some(viewer) = state.viewers.get_mut(&number) {
            (viewer.camera, viewer.camera_seq) = camera;
            viewer.done_seq = done_seq;
            viewer.waiting_from = waiting_from;
        }
        if let Some(checked) = accepted {
            outcome.announcement = Some(self.commit(app, &mut state, checked, Some((number, arrived))));
        }
        outcome
    }

    /// Makes a checked scene the newest and shows it to every viewer; `author` is the viewer whose
    /// input it comes from, and when that arrived.
    fn commit(
        self: &Arc<Self>,
        app: &App,
        state: &mut State,
        checked: Checked,
        author: Option<(u32, Instant)>,
    ) -> Announcement {
        let Checked { file, loaded, scene } = checked;
        app.renderer().prepare(&scene);
        state.file = file;
        state.loaded = loaded;
        state.scene = scene;
        state.epoch = state.epoch.saturating_add(1);
        state.used();
        app.sessions().store().changed(self);
        for (number, viewer) in &state.viewers {
            let snapshot = viewer_snapshot(state, viewer);
            let arrived = author.filter(|(author, _)| author == number).map(|(_, arrived)| arrived);
            app.renderer().update(viewer.render, |input| {
                input.snapshot = snapshot;
                input.seq = input.seq.max(viewer.done_seq);
                input.arrived = arrived.unwrap_or_else(Instant::now);
            });
        }
        Announcement { session: self.clone(), epoch: state.epoch }
    }

    /// Moves a viewer's camera, and if it is an editor's the session's with it; the others see nothing
    /// of it.
    ///
    /// # Errors
    /// The field at fault.
    pub fn move_camera(
        self: &Arc<Self>,
        app: &App,
        number: u32,
        seq: u32,
        camera: Camera,
        arrived: Instant,
    ) -> Result<(), FieldError> {
        edits::check_camera(&camera)?;
        let mut state = self.state.lock();
        let Some(viewer) = state.viewers.get_mut(&number) else { return Ok(()) };
        let role = viewer.role;
        viewer.camera = camera.clone();
        viewer.camera_seq = seq;
        viewer.done_seq = viewer.done_seq.max(seq);
        let render = viewer.render;
        let mut scene = state.scene.clone();
        scene.camera = scene::Camera::from_file(&camera);
        if role == Role::Editor {
            state.file.camera = Some(camera);
            state.scene.camera = scene.camera;
            app.sessions().store().changed(self);
        }
        let snapshot = Arc::new(Snapshot { epoch: state.epoch, scene });
        app.renderer().update(render, |input| {
            input.snapshot = snapshot;
            input.seq = input.seq.max(seq);
            input.arrived = arrived;
        });
        Ok(())
    }

    /// The newest scene as a viewer sees it.
    pub fn scene_message(&self, number: u32) -> ServerMessage {
        let state = self.state.lock();
        let viewer = state.viewers.get(&number);
        let mut scene = state.file.clone();
        let mut seq = 0;
        if let Some(viewer) = viewer {
            scene.camera = Some(viewer.camera.clone());
            // Inputs from a waiting edit on are not part of the scene yet.
            seq = viewer.waiting_from.map_or(viewer.done_seq, |seq| seq.saturating_sub(1));
        }
        let shown = state.loaded.shown().map(Box::new);
        ServerMessage::Scene { epoch: state.epoch, seq, scene: Box::new(scene), shown }
    }

    /// A session with a scene: a new one, or one that was stored as `stored`.
    fn new(id: String, checked: Checked, stored: Option<&Stored>) -> Self {
        let Checked { file, loaded, scene } = checked;
        let now = crate::unix_millis();
        // What a viewer was told before is older than what it will be told.
        let epoch = stored.map_or(1, |stored| stored.epoch.saturating_add(1));
        let state = State {
            file,
            loaded,
            scene,
            epoch,
            light: Light::default(),
            viewers: BTreeMap::new(),
            next_viewer: 1,
            idle_since: Instant::now(),
            used_unix_millis: stored.map_or(now, |stored| stored.used_unix_millis),
        };
        Self {
            id,
            created_unix_millis: stored.map_or(now, |stored| stored.created_unix_millis),
            state: Mutex::new(state),
            epoch: watch::Sender::new(epoch),
            ended: CancellationToken::new(),
            deleted: AtomicBool::new(false),
        }
    }

    /// What is kept on disk.
    fn stored(&self) -> Stored {
        let state = self.state.lock();
        Stored::new(self.created_unix_millis, state.used_unix_millis, state.epoch, state.file.clone())
    }

    /// Whether nothing of it may be kept.
    fn is_deleted(&self) -> bool {
        self.deleted.load(Ordering::Acquire)
    }

    /// Connected viewers.
    fn viewer_count(&self) -> u32 {
        self.state.lock().connected().count() as u32
    }

    /// How long nobody has used it; `None` while it has viewers.
    fn idle(&self, now: Instant) -> Option<Duration> {
        let state = self.state.lock();
        let unused = state.connected().next().is_none();
        unused.then(|| now.saturating_duration_since(state.idle_since))
    }
}

/// The identifier under which a session can be watched. It does not tell the session's own.
fn watch_id(id: &str) -> String {
    let mut hasher = blake3::Hasher::new_derive_key("Tyndall, identifier for watching a session");
    hasher.update(id.as_bytes());
    hasher.finalize().to_hex().chars().take(ID_DIGITS).collect()
}

fn viewer_snapshot(state: &State, viewer: &Viewer) -> Arc<Snapshot> {
    let mut scene = state.scene.clone();
    scene.camera = scene::Camera::from_file(&viewer.camera);
    Arc::new(Snapshot { epoch: state.epoch, scene })
}

fn filled_camera(file: &SceneFile, scene: &Scene) -> Camera {
    let anatomical = scene.volume.volume.orientation.is_some();
    file.camera.clone().unwrap_or_else(|| scene::Camera::default_file(anatomical))
}
