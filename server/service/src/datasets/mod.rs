//! Datasets: the catalog of what can be explored.
//!
//! Samples come with the service; everything else was uploaded and lies in [`storage`]. The
//! catalog in memory is rebuilt from the manifests at every start.

pub mod default_scene;
pub mod receive;
pub mod routes;
pub mod samples;
mod series;
pub mod storage;
pub mod volumes;

use std::collections::BTreeMap;
use std::path::Path;

use parking_lot::Mutex;
use proto::rest::Dataset;
use scene::PreparedVolume;

use crate::config::Limits;
use crate::problem::{Answer, Fault};
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
}

struct State {
    manifests: BTreeMap<String, Manifest>,
    /// Bytes of all stored datasets and of all uploads under way.
    used_bytes: u64,
}

/// Bytes set aside for an upload; given back when dropped.
pub struct Reservation<'a> {
    catalog: &'a Catalog,
    bytes: u64,
}

impl Catalog {
    /// Reads the data directory; see [`Storage::open`].
    ///
    /// # Errors
    /// The directory cannot be used.
    pub fn open(root: &Path, limits: &Limits) -> std::io::Result<Self> {
        let (storage, manifests) = Storage::open(root)?;
        let used_bytes = manifests.iter().map(|m| m.dataset.bytes).sum();
        let by_id = |manifest: Manifest| (manifest.dataset.id.clone(), manifest);
        Ok(Self {
            storage,
            state: Mutex::new(State { manifests: manifests.into_iter().map(by_id).collect(), used_bytes }),
            writing: Mutex::new(()),
            limits: limits.clone(),
        })
    }

    /// The data directory.
    pub fn storage(&self) -> &Storage {
        &self.storage
    }

    /// Every dataset, newest first.
    pub fn list(&self) -> Vec<Dataset> {
        let state = self.state.lock();
        let mut datasets: Vec<_> = state.manifests.values().map(|m| m.dataset.clone()).collect();
        datasets.sort_by_key(|dataset| std::cmp::Reverse(dataset.created_unix_millis));
        datasets
    }

    /// One dataset's manifest.
    pub fn get(&self, id: &str) -> Option<Manifest> {
        self.state.lock().manifests.get(id).cloned()
    }

    /// The dataset with this content, if it is stored.
    pub fn with_content(&self, content: &str) -> Option<Manifest> {
        let state = self.state.lock();
        state.manifests.values().find(|m| m.content == content).cloned()
    }

    /// Refuses early what cannot be stored: too many datasets.
    ///
    /// # Errors
    /// 507 when the limit is reached.
    pub fn check_count(&self) -> Answer<()> {
        let most = self.limits.max_datasets;
        if self.state.lock().manifests.len() >= most {
            return Err(Fault::storage_full(format!(
                "There are {most} datasets, the most this service stores (`limits.max_datasets`); delete one first."
            )));
        }
        Ok(())
    }

    /// Nothing set aside yet.
    pub fn reserve(&self) -> Reservation<'_> {
        Reservation { catalog: self, bytes: 0 }
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
        self.storage
            .store(folder, &manifest)
            .map_err(|error| Fault::internal("storing a dataset", &error))?;
        let mut state = self.state.lock();
        state.used_bytes += dataset.bytes;
        state.manifests.insert(dataset.id.clone(), manifest);
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
        let mut state = self.state.lock();
        state.manifests.remove(id);
        state.used_bytes = state.used_bytes.saturating_sub(manifest.dataset.bytes);
        Ok(())
    }
}

impl Reservation<'_> {
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
}

impl Drop for Reservation<'_> {
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
