//! Sessions on disk, so that they outlive the process and a time without viewers.
//!
//! `data/sessions/<id>.json` holds one session's scene. A session that changed is written within
//! [`SAVE_INTERVAL`], whole or not at all; after a crash it is as it was then. What nobody used for
//! long is removed, and so is the least recently used where there are too many.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use parking_lot::{Condvar, Mutex};
use proto::scene_file::SceneFile;
use serde::{Deserialize, Serialize};

use super::Session;
use crate::datasets::storage::write_atomically;

/// Version of the form.
const STORED_VERSION: u32 = 1;
/// Largest stored session that is read, bytes.
const MAX_STORED_BYTES: u64 = 4 << 20;
/// A change is on disk after this time; a drag is not written edit by edit.
const SAVE_INTERVAL: Duration = Duration::from_millis(250);

/// A session as it lies on disk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stored {
    version: u32,
    /// Milliseconds since 1970.
    pub created_unix_millis: u64,
    /// When it was last used, milliseconds since 1970.
    pub used_unix_millis: u64,
    /// Epoch of the scene.
    pub epoch: u32,
    /// The scene, camera filled in.
    pub scene: SceneFile,
}

impl Stored {
    /// A session of the present version.
    pub fn new(created_unix_millis: u64, used_unix_millis: u64, epoch: u32, scene: SceneFile) -> Self {
        Self { version: STORED_VERSION, created_unix_millis, used_unix_millis, epoch, scene }
    }
}

/// Every session on disk, and the thread that writes them.
pub struct Store {
    shared: Arc<Shared>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

struct Shared {
    folder: PathBuf,
    /// Identifiers on disk or about to be, and when each was last written.
    known: Mutex<HashMap<String, SystemTime>>,
    changed: Mutex<Changed>,
    wake: Condvar,
    /// Held while a file is written or removed.
    writing: Mutex<()>,
}

#[derive(Default)]
struct Changed {
    sessions: HashMap<String, Arc<Session>>,
    closing: bool,
}

impl Store {
    /// Opens the folder.
    ///
    /// # Errors
    /// The folder cannot be made or read, or the system has no thread left.
    pub fn open(folder: PathBuf) -> io::Result<Self> {
        fs::create_dir_all(&folder)?;
        let known = Mutex::new(on_disk(&folder)?);
        let shared = Arc::new(Shared {
            folder,
            known,
            changed: Mutex::default(),
            wake: Condvar::new(),
            writing: Mutex::new(()),
        });
        let writer = shared.clone();
        let thread = std::thread::Builder::new().name("sessions".into()).spawn(move || writer.run())?;
        Ok(Self { shared, thread: Mutex::new(Some(thread)) })
    }

    /// Has a session written soon.
    pub fn changed(&self, session: &Arc<Session>) {
        self.shared.changed.lock().sessions.insert(session.id.clone(), session.clone());
        self.shared.wake.notify_one();
    }

    /// Whether what is on disk is as new as the session.
    pub fn is_saved(&self, id: &str) -> bool {
        // Whoever writes has taken it off the list already.
        let _writing = self.shared.writing.lock();
        !self.shared.changed.lock().sessions.contains_key(id)
    }

    /// Identifiers on disk.
    pub fn ids(&self) -> Vec<String> {
        self.shared.known.lock().keys().cloned().collect()
    }

    /// A session from disk; `None` if it is not there or cannot be read, which is logged.
    pub fn read(&self, id: &str) -> Option<Stored> {
        if !self.shared.known.lock().contains_key(id) {
            return None;
        }
        match read(&self.shared.path(id)) {
            Ok(stored) => Some(stored),
            Err(error) => {
                tracing::error!(%error, "a stored session cannot be read");
                None
            }
        }
    }

    /// Removes a session from disk; it must have been marked as deleted.
    pub fn remove(&self, id: &str) {
        let _writing = self.shared.writing.lock();
        self.shared.changed.lock().sessions.remove(id);
        if self.shared.known.lock().remove(id).is_some() {
            remove(&self.shared.path(id));
        }
    }

    /// Removes what has not been used for `keep` and is none of `open`, and the least recently used
    /// beyond `most`.
    pub fn forget_old(&self, most: usize, keep: Duration, open: &HashSet<String>) {
        let known = self.shared.known.lock().clone();
        let mut closed: Vec<_> = known.into_iter().filter(|(id, _)| !open.contains(id)).collect();
        closed.sort_by_key(|(_, used)| std::cmp::Reverse(*used));
        let now = SystemTime::now();
        for (index, (id, used)) in closed.iter().enumerate() {
            let age = now.duration_since(*used).unwrap_or_default();
            if index >= most || age > keep {
                self.remove(id);
            }
        }
    }

    /// Writes what is waiting and ends the thread. Blocks.
    pub fn close(&self) {
        self.shared.changed.lock().closing = true;
        self.shared.wake.notify_one();
        let thread = self.thread.lock().take();
        if thread.is_some_and(|thread| thread.join().is_err()) {
            tracing::error!("the thread that stores sessions had panicked");
        }
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        self.close();
    }
}

impl Shared {
    fn path(&self, id: &str) -> PathBuf {
        self.folder.join(format!("{id}.json"))
    }

    fn run(&self) {
        loop {
            let mut changed = self.changed.lock();
            while changed.sessions.is_empty() && !changed.closing {
                self.wake.wait(&mut changed);
            }
            if !changed.closing {
                let soon = Instant::now() + SAVE_INTERVAL;
                while !changed.closing && !self.wake.wait_until(&mut changed, soon).timed_out() {}
            }
            let closing = changed.closing;
            let ids: Vec<String> = changed.sessions.keys().cloned().collect();
            drop(changed);
            for id in ids {
                let _writing = self.writing.lock();
                let session = self.changed.lock().sessions.remove(&id);
                if let Some(session) = session {
                    self.save(&session);
                }
            }
            if closing {
                return;
            }
        }
    }

    fn save(&self, session: &Session) {
        if session.is_deleted() {
            return;
        }
        let written = serde_json::to_vec(&session.stored())
            .map_err(io::Error::from)
            .and_then(|text| write_atomically(&self.path(&session.id), &text));
        match written {
            Ok(()) => drop(self.known.lock().insert(session.id.clone(), SystemTime::now())),
            // The session lives on in memory; its next change is tried again.
            Err(error) => tracing::error!(%error, "a session cannot be stored"),
        }
    }
}

/// Sessions of a folder and when each was written; what a crash left half-written is removed.
fn on_disk(folder: &Path) -> io::Result<HashMap<String, SystemTime>> {
    let mut found = HashMap::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let path = entry.path();
        let is_json = path.extension().is_some_and(|extension| extension == "json");
        match path.file_stem().and_then(|stem| stem.to_str()) {
            Some(id) if is_json => drop(found.insert(id.to_owned(), entry.metadata()?.modified()?)),
            _ => remove(&path),
        }
    }
    Ok(found)
}

fn read(path: &Path) -> Result<Stored, String> {
    let length = fs::metadata(path).map_err(|error| error.to_string())?.len();
    if length > MAX_STORED_BYTES {
        return Err(format!("{length} bytes are too many"));
    }
    let text = fs::read(path).map_err(|error| error.to_string())?;
    let stored: Stored = serde_json::from_slice(&text).map_err(|error| error.to_string())?;
    if stored.version != STORED_VERSION {
        return Err(format!("version {} is not known", stored.version));
    }
    Ok(stored)
}

fn remove(path: &Path) {
    if let Err(error) = fs::remove_file(path) {
        tracing::warn!(%error, "a file of a session cannot be removed");
    }
}
