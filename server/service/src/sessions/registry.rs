//! Every session: those in memory, those on disk, and when each goes.

use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use proto::control::Role;
use proto::rest;
use proto::scene_file::SceneFile;

use super::store::{Store, Stored};
use super::{Asked, ID_DIGITS, Loaded, Session, watch_id};
use crate::App;
use crate::config::Config;
use crate::datasets::storage::random_hex;
use crate::problem::{Answer, Fault};

/// Most viewers that are kept for coming back, of all sessions: each holds its picture on the GPU.
const MAX_AWAY: usize = 16;

/// Every session.
pub struct Sessions {
    by_id: Mutex<HashMap<String, Arc<Session>>>,
    store: Store,
    /// One session is brought back from disk at a time.
    reviving: tokio::sync::Mutex<()>,
    /// Viewers that may come back, longest away first.
    away: Mutex<VecDeque<Away>>,
    limits: Limits,
}

struct Limits {
    open: usize,
    stored: usize,
    /// A session without viewers leaves memory after this time.
    idle: Duration,
    /// A session leaves the disk after this time.
    keep: Duration,
    /// A viewer may come back within this time.
    away: Duration,
}

struct Away {
    session: Weak<Session>,
    viewer: u32,
    since: Instant,
}

/// A session, and what the identifier it was found by allows.
#[derive(Clone)]
pub struct Access {
    /// The session.
    pub session: Arc<Session>,
    /// What may be done with it.
    pub role: Role,
}

impl Access {
    /// What REST tells about it.
    pub fn describe(&self) -> rest::Session {
        self.session.describe(self.role)
    }

    /// The session, to be edited.
    ///
    /// # Errors
    /// It may only be watched.
    pub fn to_edit(self) -> Answer<Arc<Session>> {
        match self.role {
            Role::Editor => Ok(self.session),
            Role::Watcher => Err(Fault::forbidden(WATCH_ONLY)),
        }
    }
}

/// What a watcher is told who wants to edit.
pub const WATCH_ONLY: &str =
    "This session may be watched but not edited by this address; copy its scene into a session of your own.";

impl Sessions {
    /// Those that lie on disk.
    ///
    /// # Errors
    /// The data directory cannot be used.
    pub fn open(config: &Config) -> std::io::Result<Self> {
        let limits = Limits {
            open: config.limits.max_sessions,
            stored: config.limits.max_stored_sessions,
            idle: Duration::from_secs(config.session_idle_seconds),
            keep: Duration::from_secs(config.session_keep_days.saturating_mul(24 * 60 * 60)),
            away: Duration::from_secs(config.viewer_keep_seconds),
        };
        let store = Store::open(config.data.join("sessions"))?;
        store.forget_old(limits.stored, limits.keep, &HashSet::new());
        Ok(Self {
            by_id: Mutex::default(),
            store,
            reviving: tokio::sync::Mutex::new(()),
            away: Mutex::default(),
            limits,
        })
    }

    /// Opens a session; its volume is loaded first.
    ///
    /// # Errors
    /// Too many sessions (503), the field at fault, or the volume cannot be loaded.
    pub async fn create(&self, app: &Arc<App>, file: SceneFile) -> Answer<Arc<Session>> {
        let id = random_hex(ID_DIGITS / 2).map_err(|error| Fault::internal("opening a session", &error))?;
        self.build(app, id, file, None).await
    }

    async fn build(
        &self,
        app: &Arc<App>,
        id: String,
        file: SceneFile,
        stored: Option<Stored>,
    ) -> Answer<Arc<Session>> {
        file.validate()?;
        self.make_room(app)?;
        let (shared, source) = (app.clone(), file.volume.clone());
        let asked = crate::blocking("opening a session", move || Asked::of(&shared, &source)).await??;
        let loaded = Loaded::load(app, asked, |_| {}).await?;
        let shared = app.clone();
        let checked = crate::blocking("opening a session", move || {
            let checked = loaded.check(&shared, file)?;
            shared.renderer().prepare(&checked.scene);
            Ok::<_, Fault>(checked)
        });
        let checked = checked.await??;
        // Others may have been opened meanwhile.
        self.make_room(app)?;
        let session = Arc::new(Session::new(id.clone(), checked, stored.as_ref()));
        self.by_id.lock().insert(id, session.clone());
        self.store.changed(&session);
        Ok(session)
    }

    /// Puts away what is idle, and if that is not enough the session that nobody has looked at for
    /// longest: it comes back from disk when it is asked for.
    fn make_room(&self, app: &App) -> Answer<()> {
        self.expire(app);
        while self.by_id.lock().len() >= self.limits.open {
            let now = Instant::now();
            let mut unused: Vec<_> = self
                .in_memory()
                .into_iter()
                .filter_map(|session| Some((session.idle(now)?, session)))
                .collect();
            unused.sort_by_key(|(idle, _)| *idle);
            let put_away = unused.pop().is_some_and(|(_, session)| self.put_away(app, &session));
            if !put_away {
                let most = self.limits.open;
                return Err(Fault::busy(format!(
                    "There are {most} sessions in use, the most this service takes (`limits.max_sessions`); delete one or wait."
                )));
            }
        }
        Ok(())
    }

    /// A session in memory or on disk, by its identifier or by that for watching it.
    ///
    /// # Errors
    /// There is none, or what it shows is gone (404); too many sessions (503).
    pub async fn find(&self, app: &Arc<App>, id: &str) -> Answer<Access> {
        if let Some(access) = self.get(id) {
            return Ok(access);
        }
        let Some((own_id, role)) = match_id(self.store.ids().iter().map(String::as_str), id) else {
            return Err(no_such_session(id));
        };
        let _turn = self.reviving.lock().await;
        // Another request may have brought it back meanwhile.
        if let Some(access) = self.get(id) {
            return Ok(access);
        }
        let Some(stored) = self.store.read(&own_id) else { return Err(no_such_session(id)) };
        let built = self.build(app, own_id, stored.scene.clone(), Some(stored)).await;
        let session = built.map_err(|fault| {
            if fault.status().is_server_error() {
                return fault;
            }
            Fault::not_found(format!("What the session shows is no longer there: {}", fault.problem.detail))
        })?;
        Ok(Access { session, role })
    }

    /// A session in memory.
    fn get(&self, id: &str) -> Option<Access> {
        let by_id = self.by_id.lock();
        let (own_id, role) = match_id(by_id.keys().map(String::as_str), id)?;
        by_id.get(&own_id).map(|session| Access { session: session.clone(), role })
    }

    fn in_memory(&self) -> Vec<Arc<Session>> {
        self.by_id.lock().values().cloned().collect()
    }

    /// What REST tells everybody about every session, in memory and on disk, oldest first: as to those
    /// who watch, without the identifiers for editing. Reads files.
    pub fn list(&self) -> Vec<rest::Session> {
        let open = self.in_memory();
        let mut sessions: Vec<_> = open.iter().map(|session| session.describe(Role::Watcher)).collect();
        let known: HashSet<&String> = open.iter().map(|session| &session.id).collect();
        for id in self.store.ids().into_iter().filter(|id| !known.contains(id)) {
            if let Some(stored) = self.store.read(&id) {
                sessions.push(rest::Session {
                    id: watch_id(&id),
                    epoch: stored.epoch,
                    viewers: 0,
                    created_unix_millis: stored.created_unix_millis,
                    used_unix_millis: stored.used_unix_millis,
                    role: Role::Watcher,
                    watch: None,
                    scene: stored.scene,
                    shown: None,
                });
            }
        }
        sessions.sort_by_key(|session| session.created_unix_millis);
        sessions
    }

    /// Number of sessions in memory and of their viewers.
    pub fn counts(&self) -> (u32, u32) {
        let sessions = self.in_memory();
        let viewers = sessions.iter().map(|session| session.viewer_count()).sum();
        (sessions.len() as u32, viewers)
    }

    /// Deletes a session, also from disk; its viewers are told. Blocks.
    ///
    /// # Errors
    /// There is no such session, or the identifier is that for watching it.
    pub fn delete(&self, app: &App, id: &str) -> Answer<()> {
        let open = self.by_id.lock().remove(id);
        if let Some(session) = &open {
            session.deleted.store(true, std::sync::atomic::Ordering::Release);
            session.end(app);
        }
        let stored = self.store.ids().iter().any(|stored| stored == id);
        self.store.remove(id);
        if open.is_some() || stored {
            return Ok(());
        }
        match self.get(id) {
            Some(access) => access.to_edit().map(drop),
            None => Err(no_such_session(id)),
        }
    }

    /// Sessions on disk.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// A viewer's connection has ended; it may come back for a time.
    pub fn left(&self, app: &App, session: &Arc<Session>, viewer: u32, since: Instant) {
        self.away.lock().push_back(Away { session: Arc::downgrade(session), viewer, since });
        self.forget_away(app);
    }

    fn forget_away(&self, app: &App) {
        loop {
            let oldest = {
                let mut away = self.away.lock();
                let too_many = away.len() > MAX_AWAY;
                let due = |away: &Away| too_many || away.since.elapsed() >= self.limits.away;
                if !away.front().is_some_and(due) {
                    return;
                }
                away.pop_front()
            };
            if let Some(Away { session, viewer, since }) = oldest
                && let Some(session) = session.upgrade()
            {
                session.forget_away(app, viewer, since);
            }
        }
    }

    /// Puts away sessions that nobody has used for long, and forgets old ones.
    pub fn expire(&self, app: &App) {
        self.forget_away(app);
        let now = Instant::now();
        for session in self.in_memory() {
            if session.idle(now).is_some_and(|idle| idle >= self.limits.idle) {
                self.put_away(app, &session);
            }
        }
        let open: HashSet<String> = self.by_id.lock().keys().cloned().collect();
        self.store.forget_old(self.limits.stored, self.limits.keep, &open);
    }

    /// Takes an unused session out of memory, if the disk has it as it is.
    fn put_away(&self, app: &App, session: &Arc<Session>) -> bool {
        if !self.store.is_saved(&session.id) || session.idle(Instant::now()).is_none() {
            return false;
        }
        self.by_id.lock().remove(&session.id);
        session.end(app);
        true
    }
}

/// Which of some identifiers is meant, and what that allows.
fn match_id<'a>(mut known: impl Iterator<Item = &'a str>, id: &str) -> Option<(String, Role)> {
    known.find_map(|known| {
        if known == id {
            return Some((known.to_owned(), Role::Editor));
        }
        (watch_id(known) == id).then(|| (known.to_owned(), Role::Watcher))
    })
}

/// The answer to an unknown session.
pub fn no_such_session(id: &str) -> Fault {
    let shown: String = id.chars().take(64).collect();
    Fault::not_found(format!(
        "There is no session `{shown}`; it may have been deleted, or not been used for long. POST /api/v1/sessions opens one."
    ))
}
