//! The index of stored datasets: an SQLite table derived from the manifests.
//!
//! The manifests are the truth. A dataset's manifest is written first and its row second, so a
//! crash can only leave the index behind; every start compares it with the manifests by their
//! lengths and times of change and reads those that differ. An index that is missing, damaged or
//! of another version is made anew.

use std::collections::HashMap;
use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, OptionalExtension, Row, params};

use super::storage::{Manifest, Stamp, Storage};

/// Version of the table; another one is made anew.
const SCHEMA_VERSION: i64 = 1;
const SCHEMA: &str = "
    CREATE TABLE datasets (
        id       TEXT PRIMARY KEY,
        content  TEXT NOT NULL,
        created  INTEGER NOT NULL, -- milliseconds since 1970
        bytes    INTEGER NOT NULL,
        stamp    TEXT NOT NULL,    -- length and time of change of the manifest's file
        manifest TEXT NOT NULL     -- JSON
    ) WITHOUT ROWID;
    CREATE INDEX datasets_by_content ON datasets (content);
    CREATE INDEX datasets_by_creation ON datasets (created);";
/// The data directory has one user at a time; this is for whoever looks in with other tools.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// An open index.
pub struct Index {
    connection: Connection,
}

/// Why there is no index.
#[derive(Debug, thiserror::Error)]
pub enum IndexError {
    /// SQLite.
    #[error(transparent)]
    Sqlite(#[from] rusqlite::Error),
    /// The manifests cannot be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The file holds something else.
    #[error("{0}")]
    Unusable(String),
}

impl Index {
    /// Opens the index of a data directory and brings it up to date with the manifests; where the
    /// file cannot be used it is made anew.
    ///
    /// # Errors
    /// The manifests cannot be read, or SQLite refuses even a new file.
    pub fn open(storage: &Storage) -> Result<Self, IndexError> {
        let path = storage.index();
        let known = path.exists();
        match Self::open_file(&path) {
            Ok(mut index) => match index.reconcile(storage) {
                Ok(()) => return Ok(index),
                Err(IndexError::Io(error)) => return Err(error.into()),
                Err(error) => tracing::warn!(%error, "the index of datasets is made anew"),
            },
            Err(error) if known => tracing::warn!(%error, "the index of datasets is made anew"),
            Err(error) => return Err(error),
        }
        for ending in ["", "-wal", "-shm", "-journal"] {
            let mut file = path.clone().into_os_string();
            file.push(ending);
            match std::fs::remove_file(file) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error.into()),
                _ => {}
            }
        }
        let mut index = Self::open_file(&path)?;
        index.reconcile(storage)?;
        Ok(index)
    }

    /// An index in memory, for when the file fails while the service runs.
    ///
    /// # Errors
    /// The manifests cannot be read.
    pub fn in_memory(storage: &Storage) -> Result<Self, IndexError> {
        let connection = Connection::open_in_memory()?;
        connection.execute_batch(SCHEMA)?;
        let mut index = Self { connection };
        index.reconcile(storage)?;
        Ok(index)
    }

    fn open_file(path: &Path) -> Result<Self, IndexError> {
        let connection = Connection::open(path)?;
        connection.busy_timeout(BUSY_TIMEOUT)?;
        // Consistent after a crash; what a power cut takes from it, the manifests give back.
        connection.pragma_update(None, "locking_mode", "EXCLUSIVE")?;
        connection.pragma_update_and_check(None, "journal_mode", "WAL", |_| Ok(()))?;
        connection.pragma_update(None, "synchronous", "NORMAL")?;
        let verdict: String = connection.query_row("PRAGMA quick_check(1)", [], |row| row.get(0))?;
        if verdict != "ok" {
            return Err(IndexError::Unusable(verdict));
        }
        let version: i64 = connection.query_row("PRAGMA user_version", [], |row| row.get(0))?;
        let tables: i64 = connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))?;
        match (version, tables) {
            (SCHEMA_VERSION, _) => {}
            (0, 0) => {
                let version = format!("PRAGMA user_version = {SCHEMA_VERSION};");
                connection.execute_batch(&format!("BEGIN; {SCHEMA} {version} COMMIT;"))?;
            }
            _ => return Err(IndexError::Unusable(format!("it has version {version}"))),
        }
        Ok(Self { connection })
    }

    /// Reads the manifests that the index does not know as they are now, and forgets those that are
    /// gone or cannot be used.
    fn reconcile(&mut self, storage: &Storage) -> Result<(), IndexError> {
        let mut known: HashMap<String, (Stamp, Manifest)> = HashMap::new();
        {
            let mut rows = self.connection.prepare("SELECT id, stamp, manifest FROM datasets")?;
            let mut rows = rows.query([])?;
            while let Some(row) = rows.next()? {
                // A row that cannot be read is replaced.
                if let Ok(manifest) = serde_json::from_str(&row.get::<_, String>(2)?) {
                    known.insert(row.get(0)?, (row.get(1)?, manifest));
                }
            }
        }
        let found = storage.stamps()?;
        let transaction = self.connection.transaction()?;
        let (mut kept, mut read) = (Vec::new(), 0_usize);
        for (id, stamp) in found {
            let up_to_date = known
                .get(&id)
                .is_some_and(|(known, manifest)| *known == stamp && storage.main_file(manifest).is_file());
            if !up_to_date {
                read += 1;
                match storage.read_manifest(&id) {
                    Ok(manifest) => put(&transaction, &manifest, &stamp)?,
                    Err(reason) => {
                        tracing::error!(id, reason, "a dataset is left out: its manifest cannot be used");
                        continue;
                    }
                }
            }
            kept.push(id);
        }
        let gone: Vec<&String> = known.keys().filter(|&id| !kept.contains(id)).collect();
        for id in &gone {
            transaction.execute("DELETE FROM datasets WHERE id = ?1", [id])?;
        }
        if read > 0 || !gone.is_empty() {
            tracing::info!(read, gone = gone.len(), "the index of datasets was behind the manifests");
        }
        Ok(transaction.commit()?)
    }

    /// Every manifest, newest first.
    ///
    /// # Errors
    /// SQLite's; of every method here.
    pub fn list(&self) -> rusqlite::Result<Vec<Manifest>> {
        let mut rows = self.connection.prepare("SELECT manifest FROM datasets ORDER BY created DESC, id")?;
        rows.query_map([], manifest_of)?.collect()
    }

    /// One manifest.
    pub fn get(&self, id: &str) -> rusqlite::Result<Option<Manifest>> {
        let mut rows = self.connection.prepare("SELECT manifest FROM datasets WHERE id = ?1")?;
        rows.query_row([id], manifest_of).optional()
    }

    /// A manifest with this content.
    pub fn with_content(&self, content: &str) -> rusqlite::Result<Option<Manifest>> {
        let mut rows = self.connection.prepare("SELECT manifest FROM datasets WHERE content = ?1 LIMIT 1")?;
        rows.query_row([content], manifest_of).optional()
    }

    /// Datasets, and the bytes of all of them.
    pub fn totals(&self) -> rusqlite::Result<(usize, u64)> {
        let sums = "SELECT count(*), coalesce(sum(bytes), 0) FROM datasets";
        let (count, bytes): (i64, i64) =
            self.connection.query_row(sums, [], |row| Ok((row.get(0)?, row.get(1)?)))?;
        Ok((usize::try_from(count).unwrap_or(0), u64::try_from(bytes).unwrap_or(0)))
    }

    /// Adds or replaces a row.
    pub fn put(&self, manifest: &Manifest, stamp: &Stamp) -> rusqlite::Result<()> {
        put(&self.connection, manifest, stamp)
    }

    /// Makes every question fail.
    #[cfg(test)]
    pub fn damage(&self) {
        self.connection.execute_batch("DROP TABLE datasets").unwrap();
    }

    /// Removes a row, if it is there.
    pub fn remove(&self, id: &str) -> rusqlite::Result<()> {
        self.connection.execute("DELETE FROM datasets WHERE id = ?1", [id]).map(drop)
    }
}

fn put(connection: &Connection, manifest: &Manifest, stamp: &Stamp) -> rusqlite::Result<()> {
    let whole = |number: u64| i64::try_from(number).unwrap_or(i64::MAX);
    let text = serde_json::to_string(manifest)
        .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))?;
    let dataset = &manifest.dataset;
    connection
        .prepare("INSERT OR REPLACE INTO datasets VALUES (?1, ?2, ?3, ?4, ?5, ?6)")?
        .execute(params![
            dataset.id,
            manifest.content,
            whole(dataset.created_unix_millis),
            whole(dataset.bytes),
            stamp,
            text
        ])
        .map(drop)
}

fn manifest_of(row: &Row<'_>) -> rusqlite::Result<Manifest> {
    let text: String = row.get(0)?;
    serde_json::from_str(&text).map_err(|error| {
        rusqlite::Error::FromSqlConversionFailure(0, rusqlite::types::Type::Text, Box::new(error))
    })
}

#[cfg(test)]
mod tests {
    use super::super::storage::tests::{manifest, receive};
    use super::*;
    use std::fs;

    fn stored(root: &Path, id: &str) -> Storage {
        let storage = Storage::open(root).unwrap();
        storage.store(&receive(&storage), &manifest(id, &format!("{id}cc"))).unwrap();
        storage
    }

    fn ids(index: &Index) -> Vec<String> {
        index.list().unwrap().into_iter().map(|manifest| manifest.dataset.id).collect()
    }

    #[test]
    fn a_missing_damaged_or_older_index_is_made_anew() {
        let root = tempfile::tempdir().unwrap();
        let storage = stored(root.path(), "aa");
        let index = Index::open(&storage).unwrap();
        assert_eq!((ids(&index), index.totals().unwrap()), (vec!["aa".to_owned()], (1, 1)));
        drop(index);
        let damages: [&dyn Fn(&Path); 5] = [
            &|path| fs::remove_file(path).unwrap(),
            &|path| fs::write(path, b"this is no database, though it is longer than a header").unwrap(),
            &|path| fs::write(path, vec![0; 5]).unwrap(),
            &|path| {
                let older = Connection::open(path).unwrap();
                older.execute_batch("DROP TABLE datasets; PRAGMA user_version = 7").unwrap();
                older.execute_batch("CREATE TABLE other (x)").unwrap();
            },
            &|path| {
                let mut bytes = fs::read(path).unwrap();
                let end = bytes.len();
                bytes[4000..end].fill(0x5a);
                fs::write(path, bytes).unwrap();
            },
        ];
        for (number, damage) in damages.iter().enumerate() {
            damage(&storage.index());
            let index = Index::open(&storage).unwrap();
            assert_eq!(ids(&index), ["aa"], "damage {number}");
            assert_eq!(index.get("aa").unwrap().unwrap(), manifest("aa", "aacc"));
            assert_eq!(index.with_content("aacc").unwrap().unwrap().dataset.id, "aa");
        }
    }

    #[test]
    fn a_start_finds_what_changed_behind_its_back() {
        let root = tempfile::tempdir().unwrap();
        let storage = stored(root.path(), "aa");
        stored(root.path(), "bb");
        assert_eq!(ids(&Index::open(&storage).unwrap()), ["aa", "bb"]);
        // A crash between manifest and row, a dataset removed by hand, and one edited by hand.
        stored(root.path(), "cc");
        fs::remove_file(root.path().join("datasets/aa.json")).unwrap();
        let path = root.path().join("datasets/bb.json");
        let renamed = fs::read_to_string(&path).unwrap().replace("\"scan\"", "\"another\"");
        fs::write(&path, renamed).unwrap();
        let index = Index::open(&storage).unwrap();
        assert_eq!(ids(&index), ["bb", "cc"]);
        assert_eq!(index.get("bb").unwrap().unwrap().dataset.name, "another");
        drop(index);
        // Blobs that went away.
        fs::remove_dir_all(root.path().join("blobs/cccc")).unwrap();
        assert_eq!(ids(&Index::open(&storage).unwrap()), ["bb"]);
        assert_eq!(ids(&Index::in_memory(&storage).unwrap()), ["bb"]);
    }

    #[test]
    fn rows_come_and_go() {
        let root = tempfile::tempdir().unwrap();
        let storage = stored(root.path(), "aa");
        let index = Index::open(&storage).unwrap();
        index.put(&manifest("bb", "bbcc"), &"1:1".to_owned()).unwrap();
        assert_eq!(index.totals().unwrap(), (2, 2));
        index.remove("aa").unwrap();
        index.remove("aa").unwrap();
        assert_eq!(ids(&index), ["bb"]);
        assert!(index.get("aa").unwrap().is_none() && index.with_content("aacc").unwrap().is_none());
    }
}
