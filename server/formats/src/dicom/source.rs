//! The files of a series: one file, a folder, or a zip archive.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::header::{DETECTION_BYTES, is_dicom};
use crate::ReadOptions;
use crate::archive::{Archive, Entry};
use crate::error::{FormatError, file_name};
use crate::stream::Stream;

/// Most files of a folder that are looked at.
const MAX_FILES: usize = 20_000;
/// Deepest folder below the given one that is looked into.
const MAX_FOLDER_DEPTH: usize = 16;

/// Where the files are.
pub(super) struct Source {
    /// Name of the file, folder or archive, for messages.
    pub(super) name: String,
    /// Files that were passed over because they are not DICOM.
    pub(super) passed_over: usize,
    files: Files,
}

enum Files {
    OnDisk(Vec<PathBuf>),
    InArchive(Mutex<Archive>, Vec<Entry>),
}

impl Source {
    /// Lists the DICOM files of a folder (and folders in it) or archive; a single file is taken
    /// as it is.
    pub(super) fn open(path: &Path, options: &ReadOptions<'_>) -> Result<Self, FormatError> {
        let name = file_name(path);
        if path.is_dir() {
            let mut found = Vec::new();
            list(path, 0, options.siblings_only, &mut found)?;
            let all = found.len();
            found.retain(|path| starts_like_dicom(path));
            found.sort();
            return Ok(Self { name, passed_over: all - found.len(), files: Files::OnDisk(found) });
        }
        if !starts_like_zip(path) {
            return Ok(Self { name, passed_over: 0, files: Files::OnDisk(vec![path.to_owned()]) });
        }
        let mut archive = Archive::open(path, &options.limits)?;
        let all = archive.entries().to_vec();
        let mut found = Vec::new();
        for entry in &all {
            if is_dicom(&archive.read_start(entry, DETECTION_BYTES as u64)?) {
                found.push(entry.clone());
            }
        }
        found.sort_by(|a, b| a.name.cmp(&b.name));
        let passed_over = all.len() - found.len();
        Ok(Self { name, passed_over, files: Files::InArchive(Mutex::new(archive), found) })
    }

    /// Number of files.
    pub(super) fn len(&self) -> usize {
        match &self.files {
            Files::OnDisk(paths) => paths.len(),
            Files::InArchive(_, entries) => entries.len(),
        }
    }

    /// Name of a file, for messages.
    pub(super) fn file(&self, index: usize) -> String {
        match &self.files {
            Files::OnDisk(paths) => paths.get(index).map(|path| file_name(path)),
            Files::InArchive(_, entries) => {
                let last = |entry: &Entry| entry.name.rsplit('/').next().unwrap_or_default().to_owned();
                entries.get(index).map(last)
            }
        }
        .unwrap_or_default()
    }

    /// All bytes of a file; one that is larger than its voxels could ever be is refused.
    pub(super) fn load(&self, index: usize, options: &ReadOptions<'_>) -> Result<Vec<u8>, FormatError> {
        let limit = options.limits.max_voxel_bytes.saturating_add(options.limits.max_header_bytes);
        let check = |bytes: u64| match bytes <= limit {
            true => Ok(()),
            false => Err(FormatError::TooLarge {
                file: self.file(index),
                what: "bytes of a DICOM file",
                got: bytes.to_string(),
                limit,
            }),
        };
        match &self.files {
            Files::OnDisk(paths) => {
                let Some(path) = paths.get(index) else { return Ok(Vec::new()) };
                let mut stream = Stream::open(path)?;
                check(stream.at_most())?;
                let mut bytes = vec![0; usize::try_from(stream.at_most()).unwrap_or(0)];
                stream.read_exact(&mut bytes)?;
                Ok(bytes)
            }
            Files::InArchive(archive, entries) => {
                let Some(entry) = entries.get(index) else { return Ok(Vec::new()) };
                check(entry.bytes)?;
                archive.lock().unwrap_or_else(PoisonError::into_inner).read(entry)
            }
        }
    }
}

/// Collects the files below a folder. Links are followed to files only, and not at all where
/// strangers may have put them there.
fn list(
    folder: &Path,
    depth: usize,
    siblings_only: bool,
    found: &mut Vec<PathBuf>,
) -> Result<(), FormatError> {
    let name = file_name(folder);
    for entry in fs::read_dir(folder).map_err(FormatError::io(&name, "list"))? {
        let entry = entry.map_err(FormatError::io(&name, "list"))?;
        let kind = entry.file_type().map_err(FormatError::io(&name, "list"))?;
        let path = entry.path();
        if kind.is_dir() {
            if depth < MAX_FOLDER_DEPTH {
                list(&path, depth + 1, siblings_only, found)?;
            }
        } else if kind.is_file() || (kind.is_symlink() && !siblings_only && path.is_file()) {
            found.push(path);
        }
        if found.len() > MAX_FILES {
            return Err(FormatError::TooLarge {
                file: name,
                what: "files of a folder",
                got: format!("{} or more", found.len()),
                limit: MAX_FILES as u64,
            });
        }
    }
    Ok(())
}

fn start(path: &Path) -> Vec<u8> {
    Stream::open(path).map(|mut stream| stream.peek_up_to(DETECTION_BYTES)).unwrap_or_default()
}

/// Whether a file starts as DICOM files do; one that cannot be read does not.
pub(super) fn starts_like_dicom(path: &Path) -> bool {
    is_dicom(&start(path))
}

fn starts_like_zip(path: &Path) -> bool {
    start(path).starts_with(crate::archive::ZIP_MAGIC)
}
