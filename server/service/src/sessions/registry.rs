//! Every session, and when each ends.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use proto::scene_file::SceneFile;

use super::{Asked, Loaded, Session};
use crate::App;
use crate::datasets::storage::random_hex;
use crate::problem::{Answer, Fault};

/// Random bytes of a session's identifier: whoever knows it may use the session.
const ID_BYTES: usize = 16;

/// Every session.
pub struct Sessions {
    by_id: Mutex<HashMap<String, Arc<Session>>>,
    most: usize,
    idle_bound: Duration,
}

impl Sessions {
    /// None yet.
    pub fn new(most: usize, idle_bound: Duration) -> Self {
        Self { by_id: Mutex::default(), most, idle_bound }
    }

    /// Opens a session; its volume is loaded first.
    ///
    /// # Errors
    /// Too many sessions (503), the field at fault, or the volume cannot be loaded.
    pub async fn create(&self, app: &Arc<App>, file: SceneFile) -> Answer<Arc<Session>> {
        file.validate()?;
        self.expire();
        self.check_room()?;
        let (shared, source) = (app.clone(), file.volume.clone());
        let asked = crate::blocking("opening a session", move || Asked::of(&shared, &source)).await??;
        let loaded = Loaded::load(app, asked, |_| {}).await?;
        let checked = crate::blocking("opening a session", move || loaded.check(file)).await??;
        let id = random_hex(ID_BYTES).map_err(|error| Fault::internal("opening a session", &error))?;
        let session = Arc::new(Session::new(id.clone(), checked));
        let mut sessions = self.by_id.lock();
        if sessions.len() >= self.most {
            drop(sessions);
            return self.check_room().map(|()| session);
        }
        sessions.insert(id, session.clone());
        Ok(session)
    }

    fn check_room(&self) -> Answer<()> {
        if self.by_id.lock().len() < self.most {
            return Ok(());
        }
        let most = self.most;
        Err(Fault::busy(format!(
            "There are {most} sessions, the most this service keeps (`limits.max_sessions`); delete one or wait."
        )))
    }

    /// One session.
    pub fn get(&self, id: &str) -> Option<Arc<Session>> {
        self.by_id.lock().get(id).cloned()
    }

    /// Every session, oldest first.
    pub fn list(&self) -> Vec<Arc<Session>> {
        let mut sessions: Vec<_> = self.by_id.lock().values().cloned().collect();
        sessions.sort_by_key(|session| session.created_unix_millis);
        sessions
    }

    /// Number of sessions and of their viewers.
    pub fn counts(&self) -> (u32, u32) {
        let sessions = self.list();
        let viewers = sessions.iter().map(|session| session.viewer_count()).sum();
        (sessions.len() as u32, viewers)
    }

    /// Deletes a session; its viewers are told.
    ///
    /// # Errors
    /// There is no such session.
    pub fn delete(&self, id: &str) -> Answer<()> {
        let session = self.by_id.lock().remove(id).ok_or_else(|| no_such_session(id))?;
        session.ended.cancel();
        Ok(())
    }

    /// Closes sessions that nobody has used for long.
    pub fn expire(&self) {
        let now = Instant::now();
        let idle = |session: &Session| session.idle(now).is_some_and(|idle| idle >= self.idle_bound);
        self.by_id.lock().retain(|_, session| {
            let expired = idle(session);
            if expired {
                session.ended.cancel();
            }
            !expired
        });
    }
}

/// The answer to an unknown session.
pub fn no_such_session(id: &str) -> Fault {
    let shown: String = id.chars().take(64).collect();
    Fault::not_found(format!(
        "There is no session `{shown}`; it may have been closed after a time without viewers. POST /api/v1/sessions opens one."
    ))
}
