//! Zip archives from strangers: bounded in entries, in names and in what comes out of them.
//!
//! Nothing is ever written to disk: entries are read into memory one at a time. A name that
//! points out of the archive says that the archive is meant to harm, so all of it is refused.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use zip::ZipArchive;
use zip::result::ZipError;

use crate::Limits;
use crate::error::{FormatError, file_name, quoted};

/// First bytes of an archive with at least one entry.
pub(crate) const ZIP_MAGIC: &[u8] = b"PK\x03\x04";
/// Most entries of an archive, folders included: a scan has hundreds of slices, a chunked array
/// thousands of chunks.
const MAX_ENTRIES: usize = 100_000;
/// Largest record of an entry that is reckoned with; names and comments may be long.
const MAX_RECORD_BYTES: u64 = 1 << 10;
/// The end record: 22 bytes and a comment of at most 65,535.
const MAX_END_BYTES: u64 = 22 + 65_535;
const END_MAGIC: &[u8] = b"PK\x05\x06";
/// Where the end record has the size of the archive's directory; the largest value stands for a
/// size in the 64-bit end record.
const END_DIRECTORY_BYTES_AT: usize = 12;
/// Bytes of the 64-bit end record and of the locator behind it, which stand before the end record.
const END64_BYTES: usize = 56 + 20;
const END64_MAGIC: &[u8] = b"PK\x06\x06";
/// Where the 64-bit end record has the size of the archive's directory.
const END64_DIRECTORY_BYTES_AT: usize = 40;

/// A file in an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Path inside the archive: relative, separated by `/`, without `..`.
    pub(crate) name: String,
    /// Decoded bytes, as the archive's directory states them; more never come.
    pub(crate) bytes: u64,
    index: usize,
}

/// An open archive.
pub(crate) struct Archive {
    /// File name for messages.
    pub(crate) file: String,
    zip: ZipArchive<BufReader<File>>,
    entries: Vec<Entry>,
}

impl Archive {
    /// Opens an archive and checks every entry's name and size; no entry is decoded.
    ///
    /// # Errors
    /// Not a zip file, more than [`MAX_ENTRIES`] entries, names that leave the archive, links,
    /// encrypted entries, more decoded bytes in total than [`Limits::max_decoded_bytes`].
    pub(crate) fn open(path: &Path, limits: &Limits) -> Result<Self, FormatError> {
        let file = file_name(path);
        let mut handle = File::open(path).map_err(FormatError::io(&file, "open"))?;
        if !handle.metadata().is_ok_and(|metadata| metadata.is_file()) {
            return Err(FormatError::corrupt(&file, "not a regular file"));
        }
        check_directory_size(&file, &mut handle)?;
        let mut zip = ZipArchive::new(BufReader::new(handle)).map_err(|error| damaged(&file, error))?;
        if zip.len() > MAX_ENTRIES {
            return Err(too_many(&file, zip.len().to_string()));
        }
        let mut entries = Vec::new();
        let mut total = 0_u64;
        for index in 0..zip.len() {
            let entry = zip.by_index_raw(index).map_err(|error| damaged(&file, error))?;
            let name = entry.name().map_err(|error| damaged(&file, error))?.into_owned();
            if entry.is_symlink() || !is_inside(&name) {
                let what = format!(
                    "{} is a link or points out of the archive, which no scan needs: the archive is not read",
                    quoted(&name)
                );
                return Err(FormatError::corrupt(&file, what));
            }
            if entry.is_dir() {
                continue;
            }
            if entry.encrypted() {
                let what = format!("the encryption of {}", quoted(&name));
                return Err(FormatError::unsupported(&file, what, "pack the files without a password"));
            }
            total = total.saturating_add(entry.size());
            entries.push(Entry { name, bytes: entry.size(), index });
        }
        if total > limits.max_decoded_bytes {
            return Err(FormatError::TooLarge {
                file,
                what: "decoded bytes of all files of the archive",
                got: total.to_string(),
                limit: limits.max_decoded_bytes,
            });
        }
        Ok(Self { file, zip, entries })
    }

    /// The files, in the archive's order; folders are left out.
    pub(crate) fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The first bytes of a file, at most `count`.
    ///
    /// # Errors
    /// The entry is damaged or compressed in a way other than deflate.
    pub(crate) fn read_start(&mut self, entry: &Entry, count: u64) -> Result<Vec<u8>, FormatError> {
        self.read_up_to(entry, count.min(entry.bytes))
    }

    /// A whole file. Memory grows with what comes out, not with what the directory promises.
    ///
    /// # Errors
    /// The entry is damaged (its checksum, too), compressed in a way other than deflate, or
    /// holds more or fewer bytes than stated.
    pub(crate) fn read(&mut self, entry: &Entry) -> Result<Vec<u8>, FormatError> {
        // One byte more than stated shows an entry that lies, and lets the checksum be compared.
        let bytes = self.read_up_to(entry, entry.bytes.saturating_add(1))?;
        if bytes.len() as u64 != entry.bytes {
            let what = format!("{} does not hold the {} bytes stated", quoted(&entry.name), entry.bytes);
            return Err(FormatError::corrupt(&self.file, what));
        }
        Ok(bytes)
    }

    fn read_up_to(&mut self, entry: &Entry, count: u64) -> Result<Vec<u8>, FormatError> {
        let file = &self.file;
        let reader = self.zip.by_index(entry.index).map_err(|error| damaged(file, error))?;
        let mut bytes = Vec::new();
        reader.take(count).read_to_end(&mut bytes).map_err(|error| {
            FormatError::corrupt(file, format!("{} is damaged ({error})", quoted(&entry.name)))
        })?;
        Ok(bytes)
    }
}

/// Whether a name stays inside the archive on every system.
fn is_inside(name: &str) -> bool {
    let is_plain = |part: &str| part != ".." && !part.contains([':', '\0']);
    !name.starts_with(['/', '\\']) && name.split(['/', '\\']).all(is_plain)
}

/// Refuses a directory of more entries than [`MAX_ENTRIES`] before it is taken into memory. Every
/// place that could be an end record counts, as readers differ in which one they believe.
fn check_directory_size(file: &str, handle: &mut File) -> Result<(), FormatError> {
    let io = |error| FormatError::io(file, "read")(error);
    let length = handle.seek(SeekFrom::End(0)).map_err(io)?;
    let start = length.saturating_sub(MAX_END_BYTES + END64_BYTES as u64);
    handle.seek(SeekFrom::Start(start)).map_err(io)?;
    let mut tail = Vec::new();
    handle.take(MAX_END_BYTES + END64_BYTES as u64).read_to_end(&mut tail).map_err(io)?;
    handle.seek(SeekFrom::Start(0)).map_err(io)?;
    let number = |at: usize, bytes: usize| {
        let field = tail.get(at..at + bytes)?;
        Some(field.iter().rev().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte)))
    };
    for at in 0..tail.len() {
        let size = match &tail[at..] {
            rest if rest.starts_with(END_MAGIC) => {
                number(at + END_DIRECTORY_BYTES_AT, 4).filter(|size| *size != u64::from(u32::MAX))
            }
            rest if rest.starts_with(END64_MAGIC) => number(at + END64_DIRECTORY_BYTES_AT, 8),
            _ => None,
        };
        if size.is_some_and(|size| size.min(length) > MAX_ENTRIES as u64 * MAX_RECORD_BYTES) {
            return Err(too_many(file, format!("a directory of {} bytes", size.unwrap_or_default())));
        }
    }
    Ok(())
}

fn too_many(file: &str, got: String) -> FormatError {
    FormatError::TooLarge {
        file: file.to_owned(),
        what: "entries of the archive",
        got,
        limit: MAX_ENTRIES as u64,
    }
}

fn damaged(file: &str, error: ZipError) -> FormatError {
    match error {
        ZipError::UnsupportedArchive(what) => {
            FormatError::unsupported(file, what, "pack the files with deflate, without a password")
        }
        error => FormatError::corrupt(file, format!("the zip archive is damaged ({error})")),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use zip::write::{SimpleFileOptions, ZipWriter};

    fn zipped(path: &Path, files: &[(&str, &[u8])]) {
        let mut writer = ZipWriter::new(File::create(path).unwrap());
        for (name, bytes) in files {
            writer.start_file(*name, SimpleFileOptions::default()).unwrap();
            writer.write_all(bytes).unwrap();
        }
        writer.finish().unwrap();
    }

    #[test]
    fn files_come_out_as_they_went_in() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.zip");
        zipped(&path, &[("a/b.bin", &[7; 5000]), ("c", b"")]);
        let mut archive = Archive::open(&path, &Limits::default()).unwrap();
        let entries = archive.entries().to_vec();
        assert_eq!(
            entries.iter().map(|e| (e.name.as_str(), e.bytes)).collect::<Vec<_>>(),
            [("a/b.bin", 5000), ("c", 0)]
        );
        assert_eq!(archive.read(&entries[0]).unwrap(), [7; 5000]);
        assert_eq!(archive.read_start(&entries[0], 3).unwrap(), [7; 3]);
        assert!(archive.read(&entries[1]).unwrap().is_empty());
        let limits = Limits { max_decoded_bytes: 4999, ..Limits::default() };
        assert!(matches!(Archive::open(&path, &limits), Err(FormatError::TooLarge { .. })));
    }

    #[test]
    fn names_that_leave_the_archive_are_refused() {
        for name in ["../a", "a/../../b", "a\\..\\b", "/a", "\\a", "C:a", "a\0b"] {
            assert!(!is_inside(name), "{name:?}");
        }
        for name in ["a", "a/b.dcm", "a/.zarray", "0.0.0", "..a/b.."] {
            assert!(is_inside(name), "{name:?}");
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.zip");
        zipped(&path, &[("ok", b"1"), ("../a", b"1")]);
        let error = Archive::open(&path, &Limits::default()).err().unwrap().to_string();
        assert!(error.contains("points out of the archive"), "{error}");
    }

    #[test]
    fn damage_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.zip");
        let voxels: Vec<u8> = (0..4000_u32).map(|i| ((i * i) >> 5) as u8).collect();
        zipped(&path, &[("a", &voxels)]);
        let bytes = std::fs::read(&path).unwrap();
        let mut flipped = bytes.clone();
        flipped[200] ^= 0x10;
        std::fs::write(&path, &flipped).unwrap();
        let mut archive = Archive::open(&path, &Limits::default()).unwrap();
        let entry = archive.entries()[0].clone();
        assert!(archive.read(&entry).is_err());
        std::fs::write(&path, &bytes[..bytes.len() - 30]).unwrap();
        assert!(Archive::open(&path, &Limits::default()).is_err());
        // An end record that promises a directory beyond the limit, in a sparse file of that size.
        let mut end = bytes.clone();
        let at = end.len() - 22 + END_DIRECTORY_BYTES_AT;
        end[at..at + 4].copy_from_slice(&0x7000_0000_u32.to_le_bytes());
        std::fs::write(&path, &end).unwrap();
        let file = File::options().write(true).open(&path).unwrap();
        file.set_len(0).unwrap();
        file.set_len(0x7100_0000).unwrap();
        drop(file);
        let mut file = File::options().append(true).open(&path).unwrap();
        file.write_all(&end[end.len() - 22..]).unwrap();
        let error = Archive::open(&path, &Limits::default()).err().unwrap().to_string();
        assert!(error.contains("entries of the archive"), "{error}");
    }
}
