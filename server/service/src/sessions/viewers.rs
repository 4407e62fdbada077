//! Viewers of a session: who is connected, and who may come back.
//!
//! A viewer whose connection ends stays for a time with all that was drawn for it. Whoever says its
//! token in time goes on with it: the picture is there at once, and nothing is drawn again.

use std::sync::Arc;
use std::time::Instant;

use proto::control::{Role, ServerMessage};
use proto::scene_file::Camera;
use scene::Snapshot;
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

use super::{Session, State, filled_camera};
use crate::App;
use crate::datasets::storage::random_hex;
use crate::problem::{Answer, Fault};
use crate::render_thread::{Output, ViewerId};

/// Random bytes of what a viewer says to come back.
const TOKEN_BYTES: usize = 16;

/// A viewer, as the session knows it.
pub(super) struct Viewer {
    pub render: ViewerId,
    pub role: Role,
    pub camera: Camera,
    /// Input that set the camera.
    pub camera_seq: u32,
    /// Newest input that was dealt with.
    pub done_seq: u32,
    /// First edit that waits for its volume.
    pub waiting_from: Option<u32>,
    token: String,
    /// Counts its connections.
    connections: u32,
    presence: Presence,
}

enum Presence {
    /// Cancelled when another connection takes over.
    Connected(CancellationToken),
    AwaySince(Instant),
}

impl Viewer {
    pub fn is_connected(&self) -> bool {
        matches!(self.presence, Presence::Connected(_))
    }
}

/// Whoever wants to see a session.
pub struct Outlet {
    /// What the address it came by allows.
    pub role: Role,
    /// The viewer it says it was.
    pub resume: Option<String>,
    /// Where frames go; holds [`crate::render_thread::MAX_WAITING_OUTPUTS`].
    pub outputs: mpsc::Sender<Output>,
}

impl Session {
    /// Connects a viewer: one that was away, or taken over from a connection that nobody has noticed
    /// to be dead, if its token is known; else a new one, which starts with the session's camera.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn join(self: &Arc<Self>, app: &Arc<App>, outlet: Outlet) -> Answer<Member> {
        let Outlet { role, resume, outputs } = outlet;
        let mut state = self.state.lock();
        let known = |viewer: &Viewer| viewer.role == role && Some(&viewer.token) == resume.as_ref();
        let known = state.viewers.iter().find(|(_, viewer)| known(viewer)).map(|(number, _)| *number);
        let number = match known {
            Some(number) => number,
            None => state.add_viewer(app, role, outputs.clone())?,
        };
        let taken_over = CancellationToken::new();
        let Some(viewer) = state.viewers.get_mut(&number) else {
            return Err(Fault::internal("joining a session", &"a viewer vanished"));
        };
        let presence = std::mem::replace(&mut viewer.presence, Presence::Connected(taken_over.clone()));
        if let Presence::Connected(old) = presence {
            old.cancel();
        }
        viewer.connections += 1;
        viewer.waiting_from = None;
        if known.is_some() {
            app.renderer().resume_viewer(viewer.render, outputs);
        }
        let (render, connection) = (viewer.render, viewer.connections);
        Ok(Member { session: self.clone(), app: app.clone(), number, render, role, connection, taken_over })
    }

    /// The first message to a viewer.
    pub fn welcome(&self, app: &App, member: &Member) -> ServerMessage {
        let state = self.state.lock();
        let mut scene = state.file.clone();
        let mut resume = String::new();
        if let Some(viewer) = state.viewers.get(&member.number) {
            scene.camera = Some(viewer.camera.clone());
            resume.clone_from(&viewer.token);
        }
        ServerMessage::Welcome {
            protocol: proto::control::PROTOCOL_VERSION,
            session: self.id_for(member.role),
            viewer: member.number,
            role: member.role,
            resume,
            epoch: state.epoch,
            scene: Box::new(scene),
            dataset: state.loaded.describe(app).map(Box::new),
            shown: state.loaded.shown().map(Box::new),
            device: app.renderer().device().clone(),
        }
    }

    /// Forgets a viewer that has been away since then; one that came back stays.
    pub fn forget_away(&self, app: &App, number: u32, since: Instant) {
        let mut state = self.state.lock();
        let is_away = |viewer: &Viewer| matches!(viewer.presence, Presence::AwaySince(at) if at == since);
        if state.viewers.get(&number).is_some_and(is_away) {
            state.forget_viewer(app, number);
        }
    }

    /// Ends the session: viewers are told, and those that are away are forgotten.
    pub fn end(&self, app: &App) {
        self.ended.cancel();
        let mut state = self.state.lock();
        let away: Vec<u32> = state
            .viewers
            .iter()
            .filter(|(_, viewer)| !viewer.is_connected())
            .map(|(number, _)| *number)
            .collect();
        for number in away {
            state.forget_viewer(app, number);
        }
    }

    /// A connection has ended; since when its viewer is away, if it may come back.
    fn leave(&self, member: &Member) -> Option<Instant> {
        let mut state = self.state.lock();
        let now = Instant::now();
        let ended = self.ended.is_cancelled();
        let viewer = state.viewers.get_mut(&member.number)?;
        if viewer.connections != member.connection {
            return None;
        }
        viewer.presence = Presence::AwaySince(now);
        if ended {
            state.forget_viewer(&member.app, member.number);
            return None;
        }
        member.app.renderer().update(member.render, |input| input.visible = false);
        state.used();
        Some(now)
    }
}

impl State {
    fn add_viewer(&mut self, app: &App, role: Role, outputs: mpsc::Sender<Output>) -> Answer<u32> {
        let token = random_hex(TOKEN_BYTES).map_err(|error| Fault::internal("joining a session", &error))?;
        let number = self.next_viewer;
        self.next_viewer += 1;
        let snapshot = Arc::new(Snapshot { epoch: self.epoch, scene: self.scene.clone() });
        let viewer = Viewer {
            render: app.renderer().add_viewer(snapshot, self.light.clone(), outputs),
            role,
            camera: filled_camera(&self.file, &self.scene),
            camera_seq: 0,
            done_seq: 0,
            waiting_from: None,
            token,
            connections: 0,
            presence: Presence::AwaySince(Instant::now()),
        };
        self.viewers.insert(number, viewer);
        Ok(number)
    }

    fn forget_viewer(&mut self, app: &App, number: u32) {
        if let Some(viewer) = self.viewers.remove(&number) {
            app.renderer().remove_viewer(viewer.render);
        }
    }
}

/// A connection's place in a session; its viewer is away when this is dropped.
pub struct Member {
    /// The session.
    pub session: Arc<Session>,
    app: Arc<App>,
    /// Number of the viewer within the session.
    pub number: u32,
    /// Identifier on the render thread.
    pub render: ViewerId,
    /// What it may do.
    pub role: Role,
    connection: u32,
    /// Cancelled when another connection goes on with this viewer.
    pub taken_over: CancellationToken,
}

impl Drop for Member {
    fn drop(&mut self) {
        if let Some(since) = self.session.leave(self) {
            self.app.sessions().left(&self.app, &self.session, self.number, since);
        }
    }
}
