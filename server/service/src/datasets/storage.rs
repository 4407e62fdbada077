//! What lies in the data directory, and how it gets there so that a crash loses nothing.
//!
//! ```text
//! data/datasets/<id>.json      one manifest per dataset: its existence is the dataset's existence
//! data/index.sqlite            what the manifests say, to look things up; made anew when missing
//! data/blobs/<content>/...     the uploaded files, in a folder named by their hash; of DICOM, the
//!                              volumes read from them, and nothing else
//! data/uploads/<id>.json       one record per resumable upload: what of it is safe
//! data/uploads/<id>.data       its bytes
//! data/incoming/...            what is being received in one request, or read; emptied at start
//! data/thumbnails/...          pictures that can be drawn again
//! data/samples/...             scans that come with the service, written out for the readers
//! data/lock                    held by the service that uses the directory
//! ```
//!
//! A dataset is stored in this order: its files are synced, their folder is renamed into `blobs`,
//! the manifest is written beside its place, synced and renamed, and the directory is synced. Only
//! then is it acknowledged. A crash before the last rename leaves a blob without a manifest, which
//! the next start removes.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, UNIX_EPOCH};

use proto::rest::Dataset;
use serde::{Deserialize, Serialize};

/// Version of the manifest's form.
const MANIFEST_VERSION: u32 = 1;
/// Largest manifest that is read, bytes.
const MAX_MANIFEST_BYTES: u64 = 1 << 20;

/// Longest wait for another service that is still about to leave the data directory.
const LOCK_PATIENCE: Duration = Duration::from_secs(15);
const LOCK_POLL: Duration = Duration::from_millis(50);

/// Length and time of change of a manifest's file: equal stamps, equal manifests.
pub type Stamp = String;

/// Everything there is to know about a stored dataset besides its bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`MANIFEST_VERSION`].
    version: u32,
    /// Name of the blob folder: BLAKE3 of the uploaded files, 64 hexadecimal digits.
    pub content: String,
    /// The file a reader opens; the others are its companions.
    pub main_file: String,
    /// The files are slices of one volume: a reader opens their folder, and `main_file` is the
    /// first of them by name.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub slices: bool,
    /// What clients are told.
    pub dataset: Dataset,
    /// Volumes that were read from the upload and are kept in its place, in the order of
    /// `volume.index`; empty where the uploaded files themselves are kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub volumes: Vec<StoredVolume>,
}

/// A volume that is kept in place of the files it was read from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredVolume {
    /// Its file in the blob folder.
    pub file: String,
    /// Bytes of its voxels in memory.
    pub memory_bytes: u64,
}

impl Manifest {
    /// A manifest of the present version.
    pub fn new(content: String, main_file: String, dataset: Dataset) -> Self {
        Self { version: MANIFEST_VERSION, content, main_file, slices: false, dataset, volumes: Vec::new() }
    }
}

/// The data directory.
#[derive(Debug, Clone)]
pub struct Storage {
    root: PathBuf,
}

impl Storage {
    /// Makes the directories and removes what unfinished requests left.
    ///
    /// # Errors
    /// The directory cannot be made, read or cleaned.
    pub fn open(root: &Path) -> io::Result<Self> {
        let storage = Self { root: root.into() };
        match fs::remove_dir_all(storage.incoming()) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        for folder in ["datasets", "blobs", "incoming", "uploads", "thumbnails", "samples"] {
            fs::create_dir_all(root.join(folder))?;
        }
        Ok(storage)
    }

    /// The right to use a data directory, until the file is closed. Two services would remove each
    /// other's uploads. Waits for one that is about to end.
    ///
    /// # Errors
    /// Another service stays, or the file system refuses.
    pub fn lock(root: &Path) -> io::Result<File> {
        fs::create_dir_all(root)?;
        let file = File::create(root.join("lock"))?;
        let began = Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => return Ok(file),
                Err(fs::TryLockError::WouldBlock) if began.elapsed() < LOCK_PATIENCE => {
                    std::thread::sleep(LOCK_POLL);
                }
                Err(fs::TryLockError::WouldBlock) => {
                    return Err(io::Error::new(
                        io::ErrorKind::ResourceBusy,
                        "another service uses it; stop that one, or choose another directory with --data or DATA=",
                    ));
                }
                Err(fs::TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {
                    tracing::warn!("the file system has no locks: nothing keeps a second service out");
                    return Ok(file);
                }
                Err(fs::TryLockError::Error(error)) => return Err(error),
            }
        }
    }

    /// The index's file.
    pub fn index(&self) -> PathBuf {
        self.root.join("index.sqlite")
    }

    /// Where resumable uploads lie.
    pub fn uploads(&self) -> PathBuf {
        self.root.join("uploads")
    }

    /// Where what one request brings is received, and what is being read lies.
    pub fn incoming(&self) -> PathBuf {
        self.root.join("incoming")
    }

    /// Where scans that come with the service are written out.
    pub fn samples(&self) -> PathBuf {
        self.root.join("samples")
    }

    /// The file a reader opens for a dataset.
    pub fn main_file(&self, manifest: &Manifest) -> PathBuf {
        self.blob(&manifest.content).join(&manifest.main_file)
    }

    /// The file of one of several volumes of a dataset, or its folder of slices, and the index to
    /// read it with; `None` if there is no such volume.
    pub fn volume_file(&self, manifest: &Manifest, index: Option<u32>) -> Option<(PathBuf, Option<u32>)> {
        if manifest.slices {
            return Some((self.blob(&manifest.content), index));
        }
        if manifest.volumes.is_empty() {
            return Some((self.main_file(manifest), index));
        }
        let volume = manifest.volumes.get(index.unwrap_or(0) as usize)?;
        Some((self.blob(&manifest.content).join(&volume.file), None))
    }

    /// A thumbnail's place; `key` names what it was drawn from.
    pub fn thumbnail(&self, id: &str, key: &str) -> PathBuf {
        self.root.join("thumbnails").join(format!("{id}-{key}.png"))
    }

    /// Makes a received folder and its manifest permanent; when this returns, both survive a
    /// crash. The files in `folder` must have been synced. Returns the manifest's stamp.
    ///
    /// # Errors
    /// The file system refuses; nothing is left behind but a blob the next start removes.
    pub fn store(&self, folder: &Path, manifest: &Manifest) -> io::Result<Stamp> {
        let blob = self.blob(&manifest.content);
        sync_directory(folder)?;
        // A blob of this content without a manifest is left over from a deletion that a crash
        // interrupted.
        match fs::remove_dir_all(&blob) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        fs::rename(folder, &blob)?;
        sync_directory(&self.root.join("blobs"))?;
        let text = serde_json::to_vec_pretty(manifest)?;
        let path = self.manifest(&manifest.dataset.id);
        write_atomically(&path, &text)?;
        stamp(&path)
    }

    /// Removes a dataset, manifest first.
    ///
    /// # Errors
    /// The file system refuses.
    pub fn remove(&self, manifest: &Manifest) -> io::Result<()> {
        fs::remove_file(self.manifest(&manifest.dataset.id))?;
        sync_directory(&self.root.join("datasets"))?;
        fs::remove_dir_all(self.blob(&manifest.content))?;
        let prefix = format!("{}-", manifest.dataset.id);
        for entry in fs::read_dir(self.root.join("thumbnails"))? {
            let entry = entry?;
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                fs::remove_file(entry.path())?;
            }
        }
        Ok(())
    }

    fn blob(&self, content: &str) -> PathBuf {
        self.root.join("blobs").join(content)
    }

    fn manifest(&self, id: &str) -> PathBuf {
        self.root.join("datasets").join(format!("{id}.json"))
    }

    /// Identifier and stamp of every manifest. Removes what a crash left of manifests that were
    /// being written; none of those was acknowledged.
    ///
    /// # Errors
    /// The directory cannot be read or cleaned.
    pub fn stamps(&self) -> io::Result<Vec<(String, Stamp)>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(self.root.join("datasets"))? {
            let path = entry?.path();
            match path.file_stem().filter(|_| path.extension().is_some_and(|ending| ending == "json")) {
                Some(id) => found.push((id.to_string_lossy().into_owned(), stamp(&path)?)),
                None => fs::remove_file(&path)?,
            }
        }
        Ok(found)
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// Why it cannot be used, in words.
    pub fn read_manifest(&self, id: &str) -> Result<Manifest, String> {
        let path = &self.manifest(id);
        let length = fs::metadata(path).map_err(|error| error.to_string())?.len();
        if length > MAX_MANIFEST_BYTES {
            return Err(format!("{length} bytes are too many for a manifest"));
        }
        let text = fs::read(path).map_err(|error| error.to_string())?;
        let manifest: Manifest = serde_json::from_slice(&text).map_err(|error| error.to_string())?;
        if manifest.version != MANIFEST_VERSION {
            return Err(format!("version {} is not known", manifest.version));
        }
        let plain = |name: &str| Path::new(name).file_name().is_some_and(|n| n == name);
        let volumes_are_plain = manifest.volumes.iter().all(|volume| plain(&volume.file));
        if !plain(&manifest.content) || !plain(&manifest.main_file) || !volumes_are_plain {
            return Err("it names a file outside its folder".into());
        }
        if !self.main_file(&manifest).is_file() {
            return Err("its data are missing".into());
        }
        if manifest.dataset.id != id {
            return Err(format!("it is the manifest of `{}`", manifest.dataset.id));
        }
        Ok(manifest)
    }

    /// Removes blobs that no manifest names. None is removed while there is a manifest that could
    /// not be read, so that a damaged one destroys nothing.
    ///
    /// # Errors
    /// The directory cannot be read or cleaned.
    pub fn remove_orphans(&self, manifests: &[Manifest]) -> io::Result<()> {
        let known = fs::read_dir(self.root.join("datasets"))?.count();
        if known != manifests.len() {
            tracing::warn!("unused blobs are kept because a manifest cannot be read");
            return Ok(());
        }
        let contents: HashSet<&str> = manifests.iter().map(|manifest| manifest.content.as_str()).collect();
        for entry in fs::read_dir(self.root.join("blobs"))? {
            let entry = entry?;
            if !entry.file_name().to_str().is_some_and(|name| contents.contains(name)) {
                fs::remove_dir_all(entry.path())?;
            }
        }
        Ok(())
    }
}

fn stamp(path: &Path) -> io::Result<Stamp> {
    let about = fs::metadata(path)?;
    let changed = about.modified()?.duration_since(UNIX_EPOCH).unwrap_or_default();
    Ok(format!("{}:{}", about.len(), changed.as_nanos()))
}

/// Writes a file so that it is either whole or absent after a crash.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let temporary = path.with_extension(format!("{}.part", random_hex(4)?));
    let written = (|| {
        let mut file = File::create_new(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&temporary, path)?;
        path.parent().map_or(Ok(()), sync_directory)
    })();
    if written.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// `bytes` random bytes as hexadecimal digits.
pub fn random_hex(bytes: usize) -> io::Result<String> {
    let mut random = vec![0; bytes];
    getrandom::fill(&mut random).map_err(|error| io::Error::other(error.to_string()))?;
    Ok(random.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Makes what was renamed into or removed from a directory survive a crash.
pub fn sync_directory(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proto::scene_file::VoxelType;

    pub(in crate::datasets) fn manifest(id: &str, content: &str) -> Manifest {
        let dataset = Dataset {
            id: id.into(),
            name: "scan".into(),
            sample: false,
            format: "nrrd".into(),
            dims: [1, 1, 1],
            spacing: [1.0; 3],
            spacing_unit: None,
            voxel_type: VoxelType::Uint8,
            value_range: [0.0, 1.0],
            anatomical: false,
            bytes: 1,
            created_unix_millis: 1,
            notices: Vec::new(),
            choices: Vec::new(),
            attribution: None,
        };
        Manifest::new(content.into(), "a.nrrd".into(), dataset)
    }

    pub(in crate::datasets) fn receive(storage: &Storage) -> PathBuf {
        let folder = storage.incoming().join(random_hex(8).unwrap());
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("a.nrrd"), b"x").unwrap();
        folder
    }

    fn start(root: &Path) -> (Storage, Vec<Manifest>) {
        let storage = Storage::open(root).unwrap();
        let stamps = storage.stamps().unwrap();
        let found: Vec<_> = stamps.iter().filter_map(|(id, _)| storage.read_manifest(id).ok()).collect();
        storage.remove_orphans(&found).unwrap();
        (storage, found)
    }

    #[test]
    fn survives_a_restart_and_cleans_up_after_a_crash() {
        let root = tempfile::tempdir().unwrap();
        let (storage, none) = start(root.path());
        assert!(none.is_empty());
        let first = manifest("aa", "aacc");
        storage.store(&receive(&storage), &first).unwrap();
        // What a crash can leave: an upload, a half-written manifest, a blob without a manifest.
        receive(&storage);
        fs::write(root.path().join("datasets/bb.1234.part"), b"{").unwrap();
        fs::create_dir(root.path().join("blobs/bbcc")).unwrap();
        let (storage, found) = start(root.path());
        assert_eq!(found, std::slice::from_ref(&first));
        assert!(storage.main_file(&first).is_file());
        assert_eq!(fs::read_dir(storage.incoming()).unwrap().count(), 0);
        assert_eq!(fs::read_dir(root.path().join("blobs")).unwrap().count(), 1);
        storage.remove(&first).unwrap();
        assert!(start(root.path()).1.is_empty());
    }

    #[test]
    fn a_damaged_manifest_destroys_nothing() {
        let root = tempfile::tempdir().unwrap();
        let (storage, _) = start(root.path());
        let hostile = Manifest { main_file: "../../x".into(), ..manifest("aa", "aacc") };
        storage.store(&receive(&storage), &hostile).unwrap();
        storage.store(&receive(&storage), &manifest("bb", "bbcc")).unwrap();
        fs::rename(root.path().join("datasets/bb.json"), root.path().join("datasets/dd.json")).unwrap();
        let (_, found) = start(root.path());
        assert!(found.is_empty());
        assert!(root.path().join("blobs/aacc/a.nrrd").is_file());
    }

    #[test]
    fn a_directory_has_one_user() {
        let root = tempfile::tempdir().unwrap();
        let first = Storage::lock(root.path()).unwrap();
        let second = File::create(root.path().join("lock")).unwrap();
        assert!(second.try_lock().is_err(), "the first one holds it");
        drop(first);
        Storage::lock(root.path()).unwrap();
    }
}
