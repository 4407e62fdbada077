//! Where the keys of a Zarr hierarchy lie: in a folder or in a zip archive.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::ReadOptions;
use crate::archive::{Archive, Entry};
use crate::error::{FormatError, file_name, quoted};

/// A Zarr hierarchy.
pub(super) struct Store {
    /// File name for messages.
    pub(super) file: String,
    inner: Inner,
}

enum Inner {
    Folder { root: PathBuf, siblings_only: bool },
    Zip(Box<Zipped>),
}

struct Zipped {
    archive: Archive,
    /// Entry of each key.
    entries: BTreeMap<String, Entry>,
    /// The value read last, for shards that are read piece by piece.
    last: Option<(String, Vec<u8>)>,
}

/// Which part of a value to read.
#[derive(Debug, Clone, Copy)]
pub(super) enum Part {
    Whole,
    /// So many bytes from an offset on.
    At(u64, u64),
    /// So many last bytes.
    End(u64),
}

/// The folder of an archive in which a Zarr hierarchy lies, with a slash at its end unless it is the
/// archive's own; `None` if there is none.
pub(crate) fn root_in(archive: &Archive) -> Option<String> {
    let marks = ["zarr.json", ".zattrs", ".zgroup"];
    let names = archive.entries().iter().map(|entry| entry.name.as_str());
    let roots = names.filter_map(|name| marks.iter().find_map(|mark| name.strip_suffix(mark)));
    let roots = roots.filter(|root| root.is_empty() || root.ends_with('/'));
    roots.min_by_key(|root| root.len()).map(str::to_owned)
}

impl Store {
    pub(super) fn folder(path: &Path, options: &ReadOptions<'_>) -> Result<Self, FormatError> {
        let file = file_name(path);
        let root = path.canonicalize().map_err(FormatError::io(&file, "open"))?;
        Ok(Self { file, inner: Inner::Folder { root, siblings_only: options.siblings_only } })
    }

    /// A hierarchy that may lie in a folder of the archive.
    pub(super) fn zip(archive: Archive) -> Result<Self, FormatError> {
        let file = archive.file.clone();
        let Some(root) = root_in(&archive) else {
            let what = "an archive without OME-Zarr in it";
            return Err(FormatError::unsupported(&file, what, "unpack it and open the files"));
        };
        let of_root = |entry: &Entry| Some((entry.name.strip_prefix(&root)?.to_owned(), entry.clone()));
        let entries = archive.entries().iter().filter_map(of_root).collect();
        Ok(Self { file, inner: Inner::Zip(Box::new(Zipped { archive, entries, last: None })) })
    }

    /// The value of a key, `None` if it is not there.
    pub(super) fn get(&mut self, key: &str, part: Part, most: u64) -> Result<Option<Vec<u8>>, FormatError> {
        let file = &self.file;
        if !is_inside(key) {
            let expected = "a path inside of the hierarchy";
            return Err(FormatError::field(file, "path", key, expected));
        }
        match &mut self.inner {
            Inner::Folder { root, siblings_only } => {
                let path = root.join(key);
                if !path.is_file() {
                    return Ok(None);
                }
                if *siblings_only && !path.canonicalize().is_ok_and(|real| real.starts_with(root)) {
                    return Err(FormatError::field(file, "path", key, "files, not links to elsewhere"));
                }
                let read_failed = |error| FormatError::io(&format!("{file}/{key}"), "read")(error);
                let mut handle = File::open(&path).map_err(read_failed)?;
                let length = handle.metadata().map_err(read_failed)?.len();
                let (start, count) = range(file, key, part, length, most)?;
                handle.seek(SeekFrom::Start(start)).map_err(read_failed)?;
                let mut bytes = Vec::new();
                handle.take(count).read_to_end(&mut bytes).map_err(read_failed)?;
                Ok(Some(bytes))
            }
            Inner::Zip(zip) => {
                let Some(entry) = zip.entries.get(key) else { return Ok(None) };
                if zip.last.as_ref().is_none_or(|(last, _)| last != key) {
                    let most_unpacked = match part {
                        Part::Whole => most,
                        _ => most.saturating_mul(MAX_SHARD_PARTS),
                    };
                    if entry.bytes > most_unpacked {
                        return Err(FormatError::TooLarge {
                            file: format!("{file}/{key}"),
                            what: "bytes of a stored chunk",
                            got: entry.bytes.to_string(),
                            limit: most_unpacked,
                        });
                    }
                    zip.last = Some((key.to_owned(), zip.archive.read(entry)?));
                }
                let Some((_, bytes)) = &zip.last else { return Ok(None) };
                let (start, count) = range(file, key, part, bytes.len() as u64, most)?;
                Ok(Some(bytes[start as usize..(start + count) as usize].to_vec()))
            }
        }
    }

    /// Whether an array has any chunk.
    pub(super) fn has_chunks(&self, array: &str) -> bool {
        let is_metadata = |name: &str| name.starts_with('.') || name == "zarr.json";
        match &self.inner {
            Inner::Folder { root, .. } => std::fs::read_dir(root.join(array)).is_ok_and(|entries| {
                entries.flatten().any(|entry| !is_metadata(&entry.file_name().to_string_lossy()))
            }),
            Inner::Zip(zip) => {
                let prefix = format!("{array}/");
                zip.entries
                    .range(prefix.clone()..)
                    .take_while(|(name, _)| name.starts_with(&prefix))
                    .any(|(name, _)| !name.ends_with('/') && !is_metadata(&name[prefix.len()..]))
            }
        }
    }
}

/// How many inner chunks' worth of bytes a shard in an archive may unpack to.
const MAX_SHARD_PARTS: u64 = 1 << 10;

/// Start and length of a part within a value of `length` bytes.
fn range(file: &str, key: &str, part: Part, length: u64, most: u64) -> Result<(u64, u64), FormatError> {
    let (start, count) = match part {
        Part::Whole => (0, length),
        Part::At(start, count) => (start, count),
        Part::End(count) => (length.saturating_sub(count), count),
    };
    if start.checked_add(count).is_none_or(|end| end > length) {
        return Err(FormatError::corrupt(file, format!("{} is cut short: {length} bytes", quoted(key))));
    }
    if count > most {
        let what = "bytes of a stored chunk";
        return Err(FormatError::TooLarge {
            file: format!("{file}/{key}"),
            what,
            got: count.to_string(),
            limit: most,
        });
    }
    Ok((start, count))
}

/// Whether a relative path with forward slashes stays where it starts.
fn is_inside(path: &str) -> bool {
    !path.is_empty()
        && !path.contains(['\\', '\0', ':'])
        && path.split('/').all(|part| !part.is_empty() && part != "." && part != "..")
}
