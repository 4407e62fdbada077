//! Resumable uploads: tus 1.0.0 with creation, creation-with-upload, checksum, expiration and
//! termination (<https://tus.io/protocols/resumable-upload>), below `/api/v1/uploads`.
//!
//! **What is acknowledged is safe.** Bytes count from when they were synced and the record ([`record`])
//! that says so was, too: at the end of each request, however it ends, and between every
//! [`SYNC_BYTES`] or [`SYNC_INTERVAL`], so that a crash costs a client little. A start cuts the data
//! to what the record says, so a client is never told more than was synced, and bytes whose checksum
//! nobody has looked at are not kept.
//!
//! **One writer.** A connection may be dead long before anybody notices. So whoever asks for an
//! upload that is not complete ([`Upload::turn`]) takes it over: the request that holds it stops,
//! keeps what it received, and is answered 423.
//!
//! **A complete upload** is read as `PUT /datasets/{id}` or, where its `filetype` is a form's,
//! `POST /datasets` would read it ([`import`]), whether or not its client is still there, and again
//! after a restart. `GET` says what came of it.

mod import;
mod protocol;
mod receive;
mod record;
pub mod routes;

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use parking_lot::Mutex;
use proto::rest::{self, Problem, UploadState};
use tokio::sync::OwnedMutexGuard;
use tokio_util::sync::CancellationToken;

use super::storage::random_hex;
use super::{Catalog, Reservation};
use crate::App;
use crate::config::Config;
use crate::problem::{Answer, Fault};
pub use protocol::{REQUEST_HEADERS, RESPONSE_HEADERS, speak};
use record::{Outcome, Place, Record};

/// Bytes after which an upload under way is synced.
const SYNC_BYTES: u64 = 16 << 20;
/// Time after which it is, on a slow link.
const SYNC_INTERVAL: Duration = Duration::from_secs(2);
/// Random bytes of an identifier: whoever knows it may use the upload.
const ID_BYTES: usize = 16;
/// Longest wait for a request to let go of its upload.
const TAKEOVER_PATIENCE: Duration = Duration::from_secs(5);
/// How often expired uploads are looked for.
const SWEEP_INTERVAL: Duration = Duration::from_secs(30);
/// Most uploads that ended and are still told about; the oldest go first.
const MAX_ENDED: usize = 1024;

/// Every resumable upload.
pub struct Uploads {
    folder: PathBuf,
    catalog: Arc<Catalog>,
    /// Life of an upload that receives nothing.
    idle: Duration,
    max_unfinished: usize,
    max_unfinished_bytes: u64,
    entries: Mutex<HashMap<String, Arc<Upload>>>,
}

/// One resumable upload.
pub struct Upload {
    id: String,
    place: Place,
    /// Held by who writes its files.
    turn: Arc<tokio::sync::Mutex<()>>,
    state: Mutex<State>,
}

struct State {
    /// As it is on disk.
    record: Record,
    /// Room for the whole of it; taken along by who reads it.
    room: Option<Reservation>,
    /// Asks the holder of the turn to let go.
    release: CancellationToken,
    reading: bool,
    /// Why reading failed, where it may succeed another time.
    failure: Option<Problem>,
}

/// The right to write an upload's files.
struct Turn {
    _held: OwnedMutexGuard<()>,
    /// Cancelled when another request wants it.
    stop: CancellationToken,
}

impl Uploads {
    /// Finds the uploads that an earlier run left. Blocks.
    ///
    /// # Errors
    /// The directory cannot be read or cleaned.
    pub fn open(catalog: &Arc<Catalog>, config: &Config) -> std::io::Result<Self> {
        let folder = catalog.storage().uploads();
        let mut entries = HashMap::new();
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&folder)? {
            names.push(entry?.file_name().to_string_lossy().into_owned());
        }
        for name in &names {
            let Some(id) = name.strip_suffix(".json") else { continue };
            let place = Place::new(&folder, id);
            match place.open() {
                Ok(record) => {
                    let room = record.outcome.is_none().then(|| catalog.reserve_held(record.length));
                    entries.insert(id.to_owned(), Arc::new(Upload::new(id.to_owned(), place, record, room)));
                }
                Err(reason) => tracing::error!(id, reason, "an upload is left out"),
            }
        }
        // Data without a record, and records that were being written.
        for name in &names {
            let has_record =
                name.strip_suffix(".data").is_some_and(|id| names.contains(&format!("{id}.json")));
            if !name.ends_with(".json") && !has_record {
                std::fs::remove_file(folder.join(name))?;
            }
        }
        Ok(Self {
            folder,
            catalog: catalog.clone(),
            idle: Duration::from_secs(config.upload_idle_seconds),
            max_unfinished: config.limits.max_unfinished_uploads,
            max_unfinished_bytes: config.limits.max_unfinished_bytes,
            entries: Mutex::new(entries),
        })
    }

    /// Makes an upload; when this returns it survives a crash.
    async fn create(&self, length: u64, metadata: String) -> Answer<Arc<Upload>> {
        self.catalog.check_count()?;
        let failed = |error| Fault::disk("preparing an upload", &error);
        let mut room = self.catalog.reserve();
        room.grow(length)?;
        let id = random_hex(ID_BYTES).map_err(failed)?;
        let place = Place::new(&self.folder, &id);
        let record = Record::new(length, metadata);
        let upload = Arc::new(Upload::new(id, place.clone(), record.clone(), Some(room)));
        let forgotten = self.admit(&upload)?;
        let creating = move || {
            if let Some(forgotten) = forgotten {
                forgotten.place.remove()?;
            }
            place.create(&record)
        };
        let created = match crate::blocking("preparing an upload", creating).await {
            Ok(created) => created.map_err(failed),
            Err(fault) => Err(fault),
        };
        if let Err(fault) = created {
            self.entries.lock().remove(&upload.id);
            return Err(fault);
        }
        Ok(upload)
    }

    /// Lists a new upload if the limits allow it; returns one that gives way.
    fn admit(&self, upload: &Arc<Upload>) -> Answer<Option<Arc<Upload>>> {
        let mut entries = self.entries.lock();
        let records: Vec<Record> = entries.values().map(|upload| upload.record()).collect();
        let unfinished: Vec<&Record> = records.iter().filter(|record| record.outcome.is_none()).collect();
        let most = self.max_unfinished;
        if unfinished.len() >= most {
            return Err(Fault::busy(format!(
                "{most} uploads are not finished (`limits.max_unfinished_uploads`)."
            )));
        }
        let bytes: u64 = unfinished.iter().map(|record| record.length).sum();
        let most = self.max_unfinished_bytes;
        if bytes.saturating_add(upload.record().length) > most {
            return Err(Fault::storage_full(format!(
                "Uploads that are not finished may take {most} bytes together (`limits.max_unfinished_bytes`); finish or cancel some first."
            )));
        }
        let mut oldest = None;
        if records.len() - unfinished.len() >= MAX_ENDED {
            let ended = entries.values().filter(|upload| upload.record().outcome.is_some());
            oldest = ended.min_by_key(|upload| upload.record().touched_unix_millis).cloned();
        }
        if let Some(oldest) = &oldest {
            entries.remove(&oldest.id);
        }
        entries.insert(upload.id.clone(), upload.clone());
        Ok(oldest)
    }

    /// An upload that has not expired.
    async fn find(&self, id: &str) -> Answer<Arc<Upload>> {
        let unknown =
            || Fault::not_found("There is no such upload; it may have been cancelled. Begin it again.");
        let upload = self.entries.lock().get(id).cloned().ok_or_else(unknown)?;
        self.expire(&upload).await?;
        match upload.record().outcome {
            Some(Outcome::Expired) => Err(Fault::gone(format!(
                "Nothing came for {} hours, and the upload was removed (`upload_idle_seconds`). Begin it again.",
                self.idle.as_secs().div_ceil(3600)
            ))),
            _ => Ok(upload),
        }
    }

    /// Removes the bytes of an upload that received nothing for too long, and later what is known of
    /// it.
    async fn expire(&self, upload: &Arc<Upload>) -> Answer<()> {
        let record = upload.record();
        let age = crate::unix_millis().saturating_sub(record.touched_unix_millis);
        if u128::from(age) < self.idle.as_millis() {
            return Ok(());
        }
        // Who holds the turn receives or reads it.
        let Ok(_held) = upload.turn.clone().try_lock_owned() else { return Ok(()) };
        if record.outcome.is_none() {
            return upload.end(Outcome::Expired).await;
        }
        self.forget(upload).await
    }

    /// Removes everything of an upload.
    async fn forget(&self, upload: &Arc<Upload>) -> Answer<()> {
        self.entries.lock().remove(&upload.id);
        upload.state.lock().room = None;
        let place = upload.place.clone();
        crate::blocking("removing an upload", move || place.remove())
            .await?
            .map_err(|error| Fault::internal("removing an upload", &error))
    }

    fn all(&self) -> Vec<Arc<Upload>> {
        self.entries.lock().values().cloned().collect()
    }
}

/// Reads the uploads that were complete when an earlier run ended; then looks for expired ones as long
/// as it is polled.
pub async fn tend(app: Arc<App>) {
    for upload in app.resumable().all() {
        let record = upload.record();
        if record.complete()
            && record.outcome.is_none()
            && let Ok(turn) = upload.turn().await
        {
            import::start(app.clone(), upload, turn);
        }
    }
    let mut ticks = tokio::time::interval(SWEEP_INTERVAL);
    loop {
        ticks.tick().await;
        for upload in app.resumable().all() {
            // What cannot be removed was logged, and is tried again.
            let _ = app.resumable().expire(&upload).await;
        }
    }
}

impl Upload {
    fn new(id: String, place: Place, record: Record, room: Option<Reservation>) -> Self {
        let release = CancellationToken::new();
        let state = State { record, room, release, reading: false, failure: None };
        Self { id, place, turn: Arc::default(), state: Mutex::new(state) }
    }

    fn record(&self) -> Record {
        self.state.lock().record.clone()
    }

    /// Takes the upload over from whoever holds it.
    ///
    /// # Errors
    /// It is not let go in time (423).
    async fn turn(&self) -> Answer<Turn> {
        self.state.lock().release.cancel();
        let held = tokio::time::timeout(TAKEOVER_PATIENCE, self.turn.clone().lock_owned()).await;
        let held = held.map_err(|_| {
            Fault::locked("Another request is still at work on this upload; try again shortly.")
        })?;
        let stop = CancellationToken::new();
        self.state.lock().release = stop.clone();
        Ok(Turn { _held: held, stop })
    }

    /// Changes the record, on disk first. For who holds the turn.
    async fn persist(&self, change: impl FnOnce(&mut Record)) -> Answer<()> {
        let mut record = self.record();
        change(&mut record);
        let (place, written) = (self.place.clone(), record.clone());
        crate::blocking("recording an upload", move || place.write(&written))
            .await?
            .map_err(|error| Fault::disk("recording an upload", &error))?;
        self.state.lock().record = record;
        Ok(())
    }

    /// Records how the upload ended, and removes its bytes. For who holds the turn. Clients are told
    /// when all of that is done.
    async fn end(&self, outcome: Outcome) -> Answer<()> {
        let mut record = self.record();
        record.outcome = Some(outcome);
        record.metadata.clear();
        record.touched_unix_millis = crate::unix_millis();
        let (place, written) = (self.place.clone(), record.clone());
        let ending = move || {
            place.write(&written)?;
            if let Err(error) = place.remove_data() {
                tracing::error!(%error, "the bytes of an ended upload stay until the next start");
            }
            Ok(())
        };
        crate::blocking("recording an upload", ending)
            .await?
            .map_err(|error| Fault::disk("recording an upload", &error))?;
        let mut state = self.state.lock();
        state.record = record;
        state.room = None;
        Ok(())
    }

    /// What a client is told.
    fn describe(&self, catalog: &Catalog) -> rest::Upload {
        let state = self.state.lock();
        let record = state.record.clone();
        let failure = state.failure.clone();
        drop(state);
        let (mut dataset, mut problem) = (None, None);
        let stage = match record.outcome {
            Some(Outcome::Stored(ref id)) => {
                dataset = catalog.get(id).map(|manifest| manifest.dataset);
                UploadState::Stored
            }
            Some(Outcome::Refused(ref why)) => {
                problem = Some(why.clone());
                UploadState::Refused
            }
            _ if !record.complete() => UploadState::Receiving,
            _ if failure.is_some() => {
                problem = failure;
                UploadState::Failed
            }
            _ => UploadState::Reading,
        };
        rest::Upload { state: stage, length: record.length, offset: record.offset, dataset, problem }
    }
}
