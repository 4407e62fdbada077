//! Datasets: the catalog of what can be explored.
//!
//! Samples come with the service; everything else was uploaded and lies in [`storage`], where an
//! [`index`] of the manifests answers what there is.

pub mod default_scene;
pub mod index;
pub mod receive;
pub mod routes;
pub mod samples;
mod series;
pub mod storage;
pub mod uploads;
pub mod volumes;

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parking_lot::Mutex;
use proto::rest::Dataset;
use scene::PreparedVolume;

use crate::config::Limits;
use crate::problem::{Answer, Fault};
use index::{Index, IndexError};
use storage::{Manifest, Storage};

/// Digits of a dataset's identifier, taken from its content hash.
const ID_DIGITS: usize = 16;

/// Every stored dataset.
pub struct Catalog {
    storage: Storage,
    state: Mutex<State>,
    /// Held while a dataset is stored or deleted, so that two uploads of one content meet.
    writing: Mutex<()>,
    limits: Limits,
    /// Keeps other services out of the data directory.
    _lock: File,
}

struct State {
    index: Index,
    /// Bytes of all stored datasets and of all uploads under way.
    used_bytes: u64,
}

/// Bytes set aside for an upload; given back when dropped.
pub struct Reservation {
    catalog: Arc<Catalog>,
    bytes: u64,
}

impl Catalog {
    /// Takes hold of the data directory and brings its index up to date; see [`Storage::lock`],
    /// [`Index::open`].
    ///
    /// # Errors
    /// The directory cannot be used.
    pub fn open(root: &Path, limits: &Limits) -> std::io::Result<Self> {
        let lock = Storage::lock(root)?;
        let storage = Storage::open(root)?;
        let index = Index::open(&storage).or_else(|error| {
            tracing::error!(%error, "the index of datasets is kept in memory");
            Index::in_memory(&storage)
        });
        let opened = index.and_then(|index| {
            storage.remove_orphans(&index.list()?)?;
            let (_, used_bytes) = index.totals()?;
            Ok(State { index, used_bytes })
        });
        let state = opened.map_err(|error| match error {
            IndexError::Io(error) => error,
            other => std::io::Error::other(other),
        })?;
        Ok(Self {
            storage,
            state: Mutex::new(state),
            writing: Mutex::new(()),
            limits: limits.clone(),
            _lock: lock,
        })
    }

    /// The data directory.
    pub fn storage(&self) -> &Storage {
        &self.storage
    }

    /// Asks the index. One that fails while the service runs is replaced by one in memory, made
    /// from the manifests.
    fn ask<T: Default>(&self, question: impl Fn(&Index) -> rusqlite::Result<T>) -> T {
        let mut state = self.state.lock();
        match question(&state.index) {
            Ok(answer) => return answer,
            Err(error) => tracing::error!(%error, "the index of datasets fails; it is made anew in memory"),
        }
        let answer = Index::in_memory(&self.storage).and_then(|index| {
            state.index = index;
            Ok(question(&state.index)?)
        });
        answer.unwrap_or_else(|error| {
            tracing::error!(%error, "the index of datasets cannot be made");
            T::default()
        })
    }

    /// Every dataset, newest first. Blocks.
    pub fn list(&self) -> Vec<Dataset> {
        self.ask(Index::list).into_iter().map(|manifest| manifest.dataset).collect()
    }

    /// One dataset's manifest.
    pub fn get(&self, id: &str) -> Option<Manifest> {
        self.ask(|index| index.get(id))
    }

    /// The dataset with this content, if it is stored.
    pub fn with_content(&self, content: &str) -> Option<Manifest> {
        self.ask(|index| index.with_content(content))
    }

    /// Refuses early what cannot be stored: too many datasets.
    ///
    /// # Errors
    /// 507 when the limit is reached.
    pub fn check_count(&self) -> Answer<()> {
        let most = self.limits.max_datasets;
        if self.ask(Index::totals).0 >= most {
            return Err(Fault::storage_full(format!(
                "There are {most} datasets, the most this service stores (`limits.max_datasets`); delete one first."
            )));
        }
        Ok(())
    }

    /// Nothing set aside yet.
    pub fn reserve(self: &Arc<Self>) -> Reservation {
        Reservation { catalog: self.clone(), bytes: 0 }
    }

    /// Sets aside what lies on the disk already, whatever the limit says.
    pub fn reserve_held(self: &Arc<Self>, bytes: u64) -> Reservation {
        self.state.lock().used_bytes += bytes;
        Reservation { catalog: self.clone(), bytes }
    }

    /// Stores a received folder under an identifier made from its content. Content that is stored
    /// already is recognised: the dataset it belongs to is returned, with `false`, and the folder is
    /// left to its owner.
    ///
    /// Blocks; call it where blocking is allowed.
    ///
    /// # Errors
    /// The limit on datasets (507), or the file system refuses (500).
    pub fn store(&self, folder: &Path, mut manifest: Manifest) -> Answer<(Dataset, bool)> {
        let _writing = self.writing.lock();
        if let Some(existing) = self.with_content(&manifest.content) {
            return Ok((existing.dataset, false));
        }
        self.check_count()?;
        let short: String = manifest.content.chars().take(ID_DIGITS).collect();
        manifest.dataset.id = if self.get(&short).is_some() { manifest.content.clone() } else { short };
        let dataset = manifest.dataset.clone();
        let stamp = self
            .storage
            .store(folder, &manifest)
            .map_err(|error| Fault::disk("storing a dataset", &error))?;
        self.ask(|index| index.put(&manifest, &stamp));
        self.state.lock().used_bytes += dataset.bytes;
        Ok((dataset, true))
    }

    /// Deletes a dataset. Sessions that show it keep their volume. Blocks.
    ///
    /// # Errors
    /// There is no such dataset, or the file system refuses.
    pub fn delete(&self, id: &str) -> Answer<()> {
        let _writing = self.writing.lock();
        let Some(manifest) = self.get(id) else {
            return Err(no_such_dataset(id));
        };
        self.storage.remove(&manifest).map_err(|error| Fault::internal("deleting a dataset", &error))?;
        self.ask(|index| index.remove(id));
        let mut state = self.state.lock();
        state.used_bytes = state.used_bytes.saturating_sub(manifest.dataset.bytes);
        Ok(())
    }
}

impl Reservation {
    /// Sets more bytes aside.
    ///
    /// # Errors
    /// 507 when the store is full.
    pub fn grow(&mut self, bytes: u64) -> Answer<()> {
        let mut state = self.catalog.state.lock();
        let most = self.catalog.limits.max_storage_bytes;
        if state.used_bytes.saturating_add(bytes) > most {
            return Err(Fault::storage_full(format!(
                "The upload does not fit: all datasets together may take {most} bytes (`limits.max_storage_bytes`); delete some first."
            )));
        }
        state.used_bytes += bytes;
        self.bytes += bytes;
        Ok(())
    }

    /// Sets aside what is missing to `bytes` in all.
    ///
    /// # Errors
    /// 507 when the store is full.
    pub fn cover(&mut self, bytes: u64) -> Answer<()> {
        match bytes.saturating_sub(self.bytes) {
            0 => Ok(()),
            missing => self.grow(missing),
        }
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.catalog.state.lock().used_bytes -= self.bytes;
    }
}

/// The answer to an unknown identifier.
pub fn no_such_dataset(id: &str) -> Fault {
    let shown: String = id.chars().take(64).collect();
    Fault::not_found(format!("There is no dataset `{shown}`; GET /api/v1/datasets lists them."))
}

/// What a volume, or the whole that it is a part of, tells about itself; identifier, name and sizes on disk are the caller's.
pub fn describe(prepared: &PreparedVolume, id: &str, name: &str, format: &str) -> Dataset {
    let volume = &prepared.volume;
    let whole_dims = prepared.placement.whole_dims;
    let voxel_bytes = volume.voxels.bytes() / volume.voxels.len().max(1);
    Dataset {
        id: id.into(),
        name: name.into(),
        sample: false,
        format: format.into(),
        dims: whole_dims.map(|edge| u32::try_from(edge).unwrap_or(u32::MAX)),
        spacing: prepared.placement.whole_spacing,
        spacing_unit: volume.spacing_unit.clone(),
        voxel_type: volume.voxels.voxel_type(),
        value_range: prepared.range,
        anatomical: volume.orientation.is_some(),
        bytes: scene::part::bytes_of(whole_dims, voxel_bytes as u64),
        created_unix_millis: 0,
        notices: Vec::new(),
        choices: Vec::new(),
        attribution: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_that_fails_while_the_service_runs_loses_nothing() {
        let root = tempfile::tempdir().unwrap();
        let catalog = Catalog::open(root.path(), &Limits::default()).unwrap();
        let store = |content: &str| {
            let manifest = storage::tests::manifest("", content);
            catalog.store(&storage::tests::receive(catalog.storage()), manifest).unwrap().0.id
        };
        let first = store("aacc");
        catalog.state.lock().index.damage();
        assert_eq!(catalog.list().len(), 1);
        catalog.state.lock().index.damage();
        let second = store("bbcc");
        assert!(catalog.get(&first).is_some() && catalog.with_content("bbcc").is_some());
        catalog.state.lock().index.damage();
        catalog.delete(&first).unwrap();
        assert_eq!(catalog.list()[0].id, second);
        // The file was left behind; the next start brings it up to date.
        drop(catalog);
        let catalog = Catalog::open(root.path(), &Limits::default()).unwrap();
        let ids: Vec<_> = catalog.list().into_iter().map(|dataset| dataset.id).collect();
        assert_eq!(ids, [second]);
    }
}
