//! What is remembered of a resumable upload, on disk and across restarts.

use std::io;
use std::path::{Path, PathBuf};

use proto::rest::Problem;
use serde::{Deserialize, Serialize};

use crate::datasets::storage::{sync_directory, write_atomically};

/// Version of the record's form.
const RECORD_VERSION: u32 = 1;
/// Largest record that is read, bytes.
const MAX_RECORD_BYTES: u64 = 1 << 16;

/// What a client is told of a refusal after a restart.
const REFUSED_BEFORE: &str =
    "The upload was refused before the service was started anew. Send it again to be told why.";

/// A record; its existence is the upload's existence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// [`RECORD_VERSION`].
    version: u32,
    /// Bytes of the whole upload.
    pub length: u64,
    /// Bytes that were synced before this was written: what a client is told.
    pub offset: u64,
    /// `Upload-Metadata` as it came. Emptied when the upload ends: file names may name patients.
    pub metadata: String,
    /// When bytes last came, or how it ended, milliseconds since 1970.
    pub touched_unix_millis: u64,
    /// How often reading it was begun.
    pub attempts: u32,
    /// How it ended; absent while it goes on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outcome: Option<Outcome>,
}

/// How an upload ended. Its bytes are gone then, or the dataset's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// As the dataset of this identifier.
    Stored(String),
    /// No reader accepts it.
    Refused(Problem),
    /// Nothing came for too long.
    Expired,
}

/// The two files of an upload.
#[derive(Debug, Clone)]
pub struct Place {
    record: PathBuf,
    /// Its bytes.
    pub data: PathBuf,
}

impl Record {
    /// Of an upload of which nothing has come.
    pub fn new(length: u64, metadata: String) -> Self {
        let touched_unix_millis = crate::unix_millis();
        Self {
            version: RECORD_VERSION,
            length,
            offset: 0,
            metadata,
            touched_unix_millis,
            attempts: 0,
            outcome: None,
        }
    }

    /// Whether every byte is there.
    pub fn complete(&self) -> bool {
        self.offset == self.length
    }
}

impl Place {
    /// Of an identifier, which must be a plain name.
    pub fn new(folder: &Path, id: &str) -> Self {
        Self { record: folder.join(format!("{id}.json")), data: folder.join(format!("{id}.data")) }
    }

    /// Makes an upload without bytes; when this returns it survives a crash.
    ///
    /// # Errors
    /// The file system refuses; nothing is left behind.
    pub fn create(&self, record: &Record) -> io::Result<()> {
        std::fs::File::create_new(&self.data)?;
        self.write(record).inspect_err(|_| {
            let _ = std::fs::remove_file(&self.data);
        })
    }

    /// Replaces the record. Why an upload was refused is not written: the words may quote file names.
    ///
    /// # Errors
    /// The file system refuses; the former record stays.
    pub fn write(&self, record: &Record) -> io::Result<()> {
        let mut record = record.clone();
        if let Some(Outcome::Refused(problem)) = &mut record.outcome {
            problem.detail = REFUSED_BEFORE.into();
        }
        write_atomically(&self.record, &serde_json::to_vec(&record)?)
    }

    /// Removes the bytes, if they are there.
    ///
    /// # Errors
    /// The file system refuses.
    pub fn remove_data(&self) -> io::Result<()> {
        remove(&self.data)
    }

    /// Removes the upload, record first: bytes without a record are removed at the next start.
    ///
    /// # Errors
    /// The file system refuses.
    pub fn remove(&self) -> io::Result<()> {
        remove(&self.record)?;
        self.record.parent().map_or(Ok(()), sync_directory)?;
        self.remove_data()
    }

    /// Reads the record and cuts the data to what it says is safe: what follows was neither checked
    /// nor acknowledged.
    ///
    /// # Errors
    /// Why the upload cannot be used, in words.
    pub fn open(&self) -> Result<Record, String> {
        let in_words = |error: io::Error| error.to_string();
        let length = std::fs::metadata(&self.record).map_err(in_words)?.len();
        if length > MAX_RECORD_BYTES {
            return Err(format!("{length} bytes are too many for a record"));
        }
        let text = std::fs::read(&self.record).map_err(in_words)?;
        let record: Record = serde_json::from_slice(&text).map_err(|error| error.to_string())?;
        if record.version != RECORD_VERSION {
            return Err(format!("version {} is not known", record.version));
        }
        if record.outcome.is_some() {
            self.remove_data().map_err(in_words)?;
            return Ok(record);
        }
        let data = std::fs::OpenOptions::new().write(true).open(&self.data).map_err(in_words)?;
        let held = data.metadata().map_err(in_words)?.len();
        if held < record.offset || record.offset > record.length {
            return Err(format!("it holds {held} bytes of {} that it should", record.offset));
        }
        if held > record.offset {
            data.set_len(record.offset).map_err(in_words)?;
        }
        Ok(record)
    }
}

fn remove(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_record_says_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::new(folder.path(), "aa");
        let mut record = Record::new(10, "filename YQ==".into());
        place.create(&record).unwrap();
        assert!(place.create(&record).is_err(), "an upload is made once");
        std::fs::write(&place.data, b"1234567").unwrap();
        record.offset = 4;
        place.write(&record).unwrap();
        assert_eq!(place.open().unwrap(), record);
        assert_eq!(std::fs::read(&place.data).unwrap(), b"1234", "the rest was not acknowledged");
        // Lost bytes are told, not made up.
        std::fs::write(&place.data, b"123").unwrap();
        assert!(place.open().unwrap_err().contains("3 bytes of 4"));
        record.outcome = Some(Outcome::Stored("x".into()));
        place.write(&record).unwrap();
        assert_eq!(place.open().unwrap(), record);
        assert!(!place.data.exists(), "an ended upload has no bytes");
        place.remove().unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
