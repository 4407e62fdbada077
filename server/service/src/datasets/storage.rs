//! What lies in the data directory, and how it gets there so that a crash loses nothing.
//!
//! ```text
//! data/datasets/<id>.json      one manifest per dataset: its existence is the dataset's existence
//! data/blobs/<content>/...     the uploaded files, in a folder named by their hash; of DICOM, the
//!                              volumes read from them, and nothing else
//! data/incoming/...            uploads under way; emptied at start
//! data/thumbnails/...          pictures that can be drawn again
//! data/samples/...             scans that come with the service, written out for the readers
//! ```
//!
//! A dataset is stored in this order: its files are synced, their folder is renamed into `blobs`,
//! the manifest is written beside its place, synced and renamed, and the directory is synced. Only
//! then is it acknowledged. A crash before the last rename leaves a blob without a manifest, which
//! the next start removes.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use proto::rest::Dataset;
use serde::{Deserialize, Serialize};

/// Version of the manifest's form.
const MANIFEST_VERSION: u32 = 1;
/// Largest manifest that is read, bytes.
const MAX_MANIFEST_BYTES: u64 = 1 << 20;

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
    /// Makes the directories, removes what unfinished uploads left, and reads every manifest.
    /// A manifest that cannot be used is logged and left where it is.
    ///
    /// # Errors
    /// The directory cannot be made, read or cleaned.
    pub fn open(root: &Path) -> io::Result<(Self, Vec<Manifest>)> {
        let storage = Self { root: root.into() };
        match fs::remove_dir_all(storage.incoming()) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        for folder in ["datasets", "blobs", "incoming", "thumbnails", "samples"] {
            fs::create_dir_all(root.join(folder))?;
        }
        let manifests = storage.read_manifests()?;
        storage.remove_orphans(&manifests)?;
        Ok((storage, manifests))
    }

    /// Where uploads are received.
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
    /// crash. The files in `folder` must have been synced.
    ///
    /// # Errors
    /// The file system refuses; nothing is left behind but a blob the next start removes.
    pub fn store(&self, folder: &Path, manifest: &Manifest) -> io::Result<()> {
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
        write_atomically(&self.manifest(&manifest.dataset.id), &text)
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

    fn read_manifests(&self) -> io::Result<Vec<Manifest>> {
        let mut manifests = Vec::new();
        for entry in fs::read_dir(self.root.join("datasets"))? {
            let path = entry?.path();
            if path.extension().is_none_or(|extension| extension != "json") {
                // A manifest whose rename a crash prevented; it was never acknowledged.
                fs::remove_file(&path)?;
                continue;
            }
            match self.read_manifest(&path) {
                Ok(manifest) => manifests.push(manifest),
                Err(reason) => tracing::error!(manifest = %path.display(), reason, "a dataset is left out"),
            }
        }
        Ok(manifests)
    }

    fn read_manifest(&self, path: &Path) -> Result<Manifest, String> {
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
        Ok(manifest)
    }

    /// Removes blobs that no manifest names. Blobs of manifests that could not be read stay: their
    /// names are taken from the manifests' own file system entries, so as not to destroy data
    /// because of a damaged manifest.
    fn remove_orphans(&self, manifests: &[Manifest]) -> io::Result<()> {
        let known = fs::read_dir(self.root.join("datasets"))?.count();
        if known != manifests.len() {
            tracing::warn!("unused blobs are kept because a manifest cannot be read");
            return Ok(());
        }
        for entry in fs::read_dir(self.root.join("blobs"))? {
            let entry = entry?;
            let name = entry.file_name();
            if manifests.iter().all(|manifest| name != *manifest.content) {
                fs::remove_dir_all(entry.path())?;
            }
        }
        Ok(())
    }
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

fn sync_directory(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::scene_file::VoxelType;

    fn manifest(id: &str, content: &str) -> Manifest {
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

    fn receive(storage: &Storage) -> PathBuf {
        let folder = storage.incoming().join(random_hex(8).unwrap());
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("a.nrrd"), b"x").unwrap();
        folder
    }

    #[test]
    fn survives_a_restart_and_cleans_up_after_a_crash() {
        let root = tempfile::tempdir().unwrap();
        let (storage, none) = Storage::open(root.path()).unwrap();
        assert!(none.is_empty());
        let first = manifest("aa", "aacc");
        storage.store(&receive(&storage), &first).unwrap();
        // What a crash can leave: an upload, a half-written manifest, a blob without a manifest.
        receive(&storage);
        fs::write(root.path().join("datasets/bb.1234.part"), b"{").unwrap();
        fs::create_dir(root.path().join("blobs/bbcc")).unwrap();
        let (storage, found) = Storage::open(root.path()).unwrap();
        assert_eq!(found, std::slice::from_ref(&first));
        assert!(storage.main_file(&first).is_file());
        assert_eq!(fs::read_dir(storage.incoming()).unwrap().count(), 0);
        assert_eq!(fs::read_dir(root.path().join("blobs")).unwrap().count(), 1);
        storage.remove(&first).unwrap();
        assert!(Storage::open(root.path()).unwrap().1.is_empty());
    }

    #[test]
    fn a_damaged_manifest_destroys_nothing() {
        let root = tempfile::tempdir().unwrap();
        let (storage, _) = Storage::open(root.path()).unwrap();
        let hostile = Manifest { main_file: "../../x".into(), ..manifest("aa", "aacc") };
        storage.store(&receive(&storage), &hostile).unwrap();
        let (_, found) = Storage::open(root.path()).unwrap();
        assert!(found.is_empty());
        assert!(root.path().join("blobs/aacc/a.nrrd").is_file());
    }
}
