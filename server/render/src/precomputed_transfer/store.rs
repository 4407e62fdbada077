//! Bakes on disk, so that none is made twice: by another session, or after a restart.
//!
//! `<key>.bake` holds one, finished or as far as it got. The key is a hash of everything that the bake
//! follows from (`key`), so a file is never out of date, only unused. A file is written beside its place,
//! synced and renamed; it ends with a checksum and is read only if that is right. What was not used for
//! longest goes where there is too much.
//!
//! Files are read and written by threads of their own, in pieces: memory is bounded, and the thread that
//! owns the GPU never waits for a disk.

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use bytemuck::{Pod, Zeroable};

/// What bakes may take on disk if nothing else is said, bytes.
pub const DEFAULT_BAKE_BYTES: u64 = 8 << 30;
/// A bake under way is written at least this long after it was before, or began.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(10);
/// Bytes that pass between disk and device at once.
pub const PIECE_BYTES: u64 = 8 << 20;
/// Pieces that wait to be written, at most: whatever a software device holds.
const MOST_TO_WRITE: usize = 32;
/// Pieces that are read ahead.
const MOST_READ: usize = 2;
/// How often a thread that waits for more to write looks whether the store is closed.
const PATIENCE: Duration = Duration::from_millis(50);
/// Who has not worked on a bake for longer is not waited for.
const GIVEN_UP: Duration = Duration::from_secs(10);
const MAGIC: [u8; 8] = *b"TYNDBAKE";
/// Version of the file's form.
const FORM: u32 = 2;
const HASH_BYTES: u64 = 32;
const EXTENSION: &str = "bake";
const UNFINISHED: &str = "part";

/// Hash of everything a bake follows from.
pub type Key = [u8; 32];

/// How far a bake is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Done {
    /// Photons of whole batches.
    pub photons: u64,
    /// Directions marched.
    pub directions: u32,
}

/// What a file begins with.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Head {
    magic: [u8; 8],
    form: u32,
    directions: u32,
    photons: u64,
    payload: u64,
    key: Key,
}

const HEAD_BYTES: u64 = size_of::<Head>() as u64;

/// A folder of bakes.
pub struct BakeStore(Arc<Shared>);

struct Shared {
    folder: PathBuf,
    max_bytes: u64,
    checkpoint_interval: Duration,
    closing: AtomicBool,
    /// Files being written.
    writers: Mutex<usize>,
    written: Condvar,
    /// Bakes that somebody works on, or writes.
    in_the_making: Mutex<HashMap<Key, Making>>,
    /// Counts files, so that two being written have different names, and those who work on bakes.
    begun: AtomicUsize,
    /// Held while a file takes its place and others make room.
    placing: Mutex<()>,
}

/// What is known of a bake that somebody works on, or writes.
#[derive(Default)]
struct Making {
    /// Who, when last, and how far it was then.
    by: Option<(u64, Instant, f32)>,
    /// Files of it being written.
    writers: usize,
}

/// A bake on its way from disk.
pub struct Incoming(Receiver<Arrival>);

/// What comes from disk next.
pub enum Arrival {
    /// The file is sound, and this is how far it is.
    Begins(Done),
    /// The next bytes.
    Piece(Vec<u8>),
    /// That was all.
    Ends,
    /// There is nothing of use. What came before counts for nothing.
    Nothing,
}

/// Matrices on their way to a thread, as a rule to disk. Dropped before all bytes were given, nothing is
/// left of them.
pub struct Outgoing(SyncSender<Vec<u8>>);

impl BakeStore {
    /// Opens a folder, which is made if absent, and removes what a crash left half-written.
    ///
    /// # Errors
    /// The folder cannot be made or read.
    pub fn open(folder: &Path, max_bytes: u64) -> io::Result<Self> {
        Self::with_checkpoints(folder, max_bytes, CHECKPOINT_INTERVAL)
    }

    /// As [`BakeStore::open`]; bakes under way are written this often, if that takes little beside the
    /// baking.
    ///
    /// # Errors
    /// The folder cannot be made or read.
    pub fn with_checkpoints(folder: &Path, max_bytes: u64, interval: Duration) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        let has = |path: &Path, extension: &str| path.extension().is_some_and(|found| found == extension);
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if has(&path, UNFINISHED) {
                remove(&path);
            }
        }
        let shared = Shared {
            folder: folder.to_owned(),
            max_bytes,
            checkpoint_interval: interval,
            closing: AtomicBool::new(false),
            writers: Mutex::new(0),
            written: Condvar::new(),
            in_the_making: Mutex::default(),
            begun: AtomicUsize::new(0),
            placing: Mutex::new(()),
        };
        shared.make_room(None)?;
        Ok(Self(Arc::new(shared)))
    }

    /// Time from one writing of a bake under way to the next.
    pub(super) fn checkpoint_interval(&self) -> Duration {
        self.0.checkpoint_interval
    }

    /// Whether there is a file of the bake.
    pub(super) fn has(&self, key: &Key) -> bool {
        self.0.path(key).exists()
    }

    /// Begins to read a bake with this many bytes of matrices; `None`: there is none.
    pub(super) fn read(&self, key: Key, payload: u64) -> Option<Incoming> {
        let path = self.0.path(&key);
        if !self.has(&key) {
            return None;
        }
        let (sender, receiver) = mpsc::sync_channel(MOST_READ);
        let read = move || match send_file(&path, &key, payload, &sender) {
            Ok(()) => {}
            Err(Unread::NotWanted) => {}
            Err(Unread::Unsound(reason)) => {
                tracing::warn!(file = %path.display(), reason, "a baked light is no use and is made anew");
                remove(&path);
                let _ = sender.send(Arrival::Nothing);
            }
        };
        spawn("read a bake", read).then_some(Incoming(receiver))
    }

    /// Begins to write a bake with this many bytes of matrices; `None`: there is no room for it.
    pub(super) fn write(&self, key: Key, done: Done, payload: u64) -> Option<Outgoing> {
        if HEAD_BYTES + payload + HASH_BYTES > self.0.max_bytes {
            return None;
        }
        let (outgoing, receiver) = Outgoing::with_room(MOST_TO_WRITE);
        let head = Head {
            magic: MAGIC,
            form: FORM,
            directions: done.directions,
            photons: done.photons,
            payload,
            key,
        };
        let shared = self.0.clone();
        shared.begins_to_write(&key);
        let write = move || {
            if let Err(error) = shared.write(&head, &receiver) {
                tracing::warn!(%error, "a baked light cannot be stored");
            }
            shared.has_written(&key);
        };
        if spawn("write a bake", write) {
            return Some(outgoing);
        }
        self.0.has_written(&key);
        None
    }

    /// A number for somebody who works on bakes.
    pub(super) fn newcomer(&self) -> u64 {
        self.0.begun.fetch_add(1, Ordering::Relaxed) as u64
    }

    /// Says that somebody works on a bake, and how far it is, 0..1.
    pub(super) fn works_on(&self, key: &Key, who: u64, progress: f32) {
        let mut making = lock(&self.0.in_the_making);
        making.entry(*key).or_default().by = Some((who, Instant::now(), progress));
    }

    /// Says that somebody works on a bake no longer.
    pub(super) fn leaves(&self, key: &Key, who: u64) {
        self.0.change(key, |making| making.by = making.by.filter(|by| by.0 != who));
    }

    /// How far a bake is that somebody else works on or writes, 0..1; `None`: nobody does.
    pub(super) fn made_by_another(&self, key: &Key, who: u64) -> Option<f32> {
        let making = lock(&self.0.in_the_making);
        let making = making.get(key)?;
        let by = making.by.filter(|(by, at, _)| *by != who && at.elapsed() < GIVEN_UP);
        by.map(|by| by.2).or((making.writers > 0).then_some(1.0))
    }
}

impl Drop for BakeStore {
    /// Waits for what was given whole.
    fn drop(&mut self) {
        self.0.closing.store(true, Ordering::Release);
        let mut writers = lock(&self.0.writers);
        while *writers > 0 {
            writers = self.0.written.wait(writers).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Incoming {
    /// What comes next; `None`: not within this time.
    pub fn next(&self, wait: Duration) -> Option<Arrival> {
        match self.0.recv_timeout(wait) {
            Ok(arrival) => Some(arrival),
            Err(RecvTimeoutError::Timeout) => None,
            // Its thread is gone.
            Err(RecvTimeoutError::Disconnected) => Some(Arrival::Nothing),
        }
    }
}

impl Outgoing {
    /// A way to a thread of somebody else, with room for some pieces.
    pub fn with_room(pieces: usize) -> (Self, Receiver<Vec<u8>>) {
        let (sender, receiver) = mpsc::sync_channel(pieces);
        (Self(sender), receiver)
    }

    /// Gives the next bytes, or gets them back because too much is waiting. `Ok(false)`: nobody writes any
    /// more.
    ///
    /// # Errors
    /// The bytes.
    pub fn give(&self, piece: Vec<u8>) -> Result<bool, Vec<u8>> {
        match self.0.try_send(piece) {
            Ok(()) => Ok(true),
            Err(TrySendError::Full(piece)) => Err(piece),
            Err(TrySendError::Disconnected(_)) => Ok(false),
        }
    }
}

impl Shared {
    fn change(&self, key: &Key, change: impl FnOnce(&mut Making)) {
        let mut all = lock(&self.in_the_making);
        let making = all.entry(*key).or_default();
        change(making);
        if making.by.is_none() && making.writers == 0 {
            all.remove(key);
        }
    }

    fn begins_to_write(&self, key: &Key) {
        *lock(&self.writers) += 1;
        self.change(key, |making| making.writers += 1);
    }

    fn has_written(&self, key: &Key) {
        self.change(key, |making| making.writers -= 1);
        *lock(&self.writers) -= 1;
        self.written.notify_all();
    }

    fn path(&self, key: &Key) -> PathBuf {
        self.folder.join(format!("{}.{EXTENSION}", blake3::Hash::from_bytes(*key).to_hex()))
    }

    fn write(&self, head: &Head, pieces: &Receiver<Vec<u8>>) -> io::Result<()> {
        let path = self.path(&head.key);
        let count = self.begun.fetch_add(1, Ordering::Relaxed);
        let part = Part(path.with_extension(format!("{}-{count}.{UNFINISHED}", std::process::id())));
        let mut file = File::create_new(&part.0)?;
        let mut hasher = blake3::Hasher::new();
        let mut put = |bytes: &[u8]| {
            hasher.update(bytes);
            file.write_all(bytes)
        };
        put(bytemuck::bytes_of(head))?;
        let mut missing = head.payload;
        while missing > 0 {
            match pieces.recv_timeout(PATIENCE) {
                Ok(piece) => {
                    put(&piece)?;
                    missing = missing.saturating_sub(piece.len() as u64);
                }
                // Nothing is missing of what will be given, though it may not be all.
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
                Err(RecvTimeoutError::Timeout) if self.closing.load(Ordering::Acquire) => return Ok(()),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
        let hash = hasher.finalize();
        file.write_all(hash.as_bytes())?;
        file.sync_all()?;
        let _placing = lock(&self.placing);
        let done = |head: &Head| Done { photons: head.photons, directions: head.directions };
        let there = File::open(&path).ok().and_then(|mut there| read_head(&mut there).ok());
        if there.is_some_and(|there| there.key == head.key && done(&there) > done(head)) {
            // Another session is further.
            return Ok(());
        }
        fs::rename(&part.0, &path)?;
        File::open(&self.folder)?.sync_all()?;
        self.make_room(Some(&path))
    }

    /// Removes what was not used for longest until the rest fits; `keep` stays.
    fn make_room(&self, keep: Option<&Path>) -> io::Result<()> {
        let mut files = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            let path = entry.path();
            if path.extension().is_some_and(|extension| extension == EXTENSION) {
                let about = entry.metadata()?;
                files.push((about.modified()?, about.len(), path));
            }
        }
        files.sort();
        let mut bytes: u64 = files.iter().map(|file| file.1).sum();
        for (_, length, path) in &files {
            if bytes > self.max_bytes && keep != Some(path) {
                remove(path);
                bytes -= length;
            }
        }
        Ok(())
    }
}

/// A file beside its place; whatever has not taken it is removed.
struct Part(PathBuf);

impl Drop for Part {
    fn drop(&mut self) {
        remove(&self.0);
    }
}

/// Why a file was not read.
enum Unread {
    /// Who asked for it is gone.
    NotWanted,
    /// It is not what it should be.
    Unsound(String),
}

impl From<io::Error> for Unread {
    fn from(error: io::Error) -> Self {
        Self::Unsound(error.to_string())
    }
}

/// Reads a file twice: it is sound before anything of it is handed out.
fn send_file(path: &Path, key: &Key, payload: u64, sender: &SyncSender<Arrival>) -> Result<(), Unread> {
    let unsound = |reason: &str| Err(Unread::Unsound(reason.to_owned()));
    let mut file = File::open(path)?;
    let head = read_head(&mut file)?;
    if head.magic != MAGIC || head.form != FORM {
        return unsound("it is of another kind");
    }
    if head.key != *key || head.payload != payload {
        return unsound("it is another one's");
    }
    if file.metadata()?.len() != HEAD_BYTES + payload + HASH_BYTES {
        return unsound("it was cut off");
    }
    let give = |arrival| sender.send(arrival).map_err(|_| Unread::NotWanted);
    for hands_out in [false, true] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(bytemuck::bytes_of(&head));
        file.seek(SeekFrom::Start(HEAD_BYTES))?;
        let mut missing = payload;
        while missing > 0 {
            let mut piece = vec![0; missing.min(PIECE_BYTES) as usize];
            file.read_exact(&mut piece)?;
            hasher.update(&piece);
            missing -= piece.len() as u64;
            if hands_out {
                give(Arrival::Piece(piece))?;
            }
        }
        let mut hash = [0; HASH_BYTES as usize];
        file.read_exact(&mut hash)?;
        if hasher.finalize() != hash {
            return unsound("its checksum is wrong");
        }
        if !hands_out {
            // Used now.
            File::options().append(true).open(path)?.set_modified(SystemTime::now())?;
            give(Arrival::Begins(Done { photons: head.photons, directions: head.directions }))?;
        }
    }
    give(Arrival::Ends)
}

fn read_head(file: &mut File) -> io::Result<Head> {
    let mut head = Head::zeroed();
    file.read_exact(bytemuck::bytes_of_mut(&mut head))?;
    Ok(head)
}

fn remove(path: &Path) {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            tracing::warn!(file = %path.display(), %error, "a baked light cannot be removed");
        }
        _ => {}
    }
}

pub(super) fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> bool {
    match std::thread::Builder::new().name(name.into()).spawn(work) {
        Ok(_) => true,
        Err(error) => {
            tracing::warn!(%error, "no thread for baked light");
            false
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
