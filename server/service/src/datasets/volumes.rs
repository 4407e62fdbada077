//! Volumes in memory, shared by every session that shows them.
//!
//! Loading runs on blocking threads, once per volume however many wait for it. Volumes that no
//! session uses stay until the memory is needed; the least recently used goes first. Parts of
//! volumes ([`Volumes::part`]) stay as long as a session shows them.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Weak};

use formats::{FormatError, Imported, ReadOptions};
use parking_lot::Mutex;
use proto::FieldError;
use proto::rest::Dataset;
use proto::scene_file::{Builtin, VolumeSource, VoxelType};
use scene::PreparedVolume;
use scene::levels::Reduction;
use scene::part::{Part, Wish};
use tokio::sync::{Semaphore, watch};

use super::samples::{self, Origin, Samples};
use super::storage::Manifest;
use super::{Catalog, no_such_dataset};
use crate::config::Limits;
use crate::problem::{Answer, Fault};

/// Most volumes that wait to be loaded.
const MAX_WAITING_LOADS: usize = 32;
/// Decoded bytes of a file, parts that are not chosen included, per byte of the largest volume.
const DECODED_PER_VOXEL_BYTE: u64 = 4;
/// Bytes of a voxel in memory at most.
const MAX_VOXEL_BYTES: u64 = 4;
/// Share of the progress that decoding takes; preparing takes the rest.
const DECODING_SHARE: f32 = 0.6;

/// What a volume is loaded from: equal keys, equal voxels.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Key {
    /// Computed at a size.
    Builtin(Builtin, [u32; 3]),
    /// A dataset, and which of its volumes.
    Dataset(String, Option<u32>),
}

impl Key {
    /// The first volume of a dataset.
    pub fn dataset(id: &str) -> Self {
        Key::Dataset(id.to_owned(), None)
    }
}

/// Every loaded volume.
pub struct Volumes {
    catalog: Arc<Catalog>,
    samples: Arc<Samples>,
    limits: Limits,
    loads: Arc<Semaphore>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    ready: HashMap<Key, Ready>,
    /// Levels and regions in use.
    parts: Vec<Weak<PreparedVolume>>,
    loading: HashMap<Key, watch::Receiver<Stage>>,
    /// Counts uses; orders `Ready::used`.
    clock: u64,
}

struct Ready {
    volume: Arc<PreparedVolume>,
    used: u64,
}

#[derive(Clone)]
enum Stage {
    Running(f32),
    Done(Answer<Arc<PreparedVolume>>),
}

impl Volumes {
    /// Nothing is loaded yet.
    pub fn new(catalog: Arc<Catalog>, samples: Arc<Samples>, limits: &Limits) -> Self {
        Self {
            catalog,
            samples,
            limits: limits.clone(),
            loads: Arc::new(Semaphore::new(limits.max_loads)),
            state: Mutex::default(),
        }
    }

    /// What a scene's volume is loaded from. Blocks while samples are first described.
    ///
    /// # Errors
    /// The field at fault: scenes from the network may name datasets and built-ins only.
    pub fn key(&self, source: &VolumeSource) -> Result<Key, FieldError> {
        if source.file.is_some() {
            return Err(FieldError::new(
                "volume.file",
                "is for scenes on disk; here name a `dataset` or a `builtin`",
            ));
        }
        if let Some(kind) = source.builtin {
            let dims = samples::builtin_dims(source);
            let voxels = voxel_count(dims);
            let most = self.limits.max_builtin_voxels.min(self.limits.max_voxel_bytes / MAX_VOXEL_BYTES);
            if voxels > most {
                return Err(FieldError::new(
                    "volume.dims",
                    format!("ask for {voxels} voxels, at most {most} are computed here"),
                ));
            }
            return Ok(Key::Builtin(kind, dims));
        }
        let id = source.dataset.as_deref().unwrap_or_default();
        if let Some(sample) = self.samples.get(id) {
            return Ok(sample.key());
        }
        if self.catalog.get(id).is_none() {
            return Err(FieldError::new("volume.dataset", no_such_dataset(id).problem.detail));
        }
        // The first volume is the one that is shown without an index.
        Ok(Key::Dataset(id.to_owned(), source.index.filter(|index| *index > 0)))
    }

    /// A volume, loaded if need be; `progress` is told 0..1.
    ///
    /// # Errors
    /// It cannot be read, or there is no memory for it now.
    pub async fn load(
        self: &Arc<Self>,
        key: &Key,
        mut progress: impl FnMut(f32),
    ) -> Answer<Arc<PreparedVolume>> {
        let mut stages = self.watch(key)?;
        loop {
            let stage = stages.borrow_and_update().clone();
            match stage {
                Stage::Running(share) => progress(share),
                Stage::Done(result) => return result,
            }
            stages.changed().await.map_err(|error| Fault::internal("loading a volume", &error))?;
        }
    }

    /// Keeps a volume that was just read, if there is room.
    pub fn offer(&self, key: Key, volume: PreparedVolume) {
        let mut state = self.state.lock();
        let bytes = volume.volume.voxels.bytes() as u64;
        if state.make_room(bytes, self.limits.max_volume_memory_bytes).is_ok() {
            state.insert(key, Arc::new(volume));
        }
    }

    /// Bytes of all voxels in memory.
    pub fn bytes(&self) -> u64 {
        self.state.lock().bytes()
    }

    /// A level or region of a loaded volume, shared with whoever shows the same. Blocks.
    ///
    /// # Errors
    /// There is no memory for it now.
    pub fn part(&self, whole: &PreparedVolume, part: &Part, wish: &Wish) -> Answer<Arc<PreparedVolume>> {
        let reduction = Reduction::of(wish.filter);
        let content = whole.part_content(part, reduction);
        let shown = wish.region.unwrap_or(scene::part::WHOLE);
        {
            let mut state = self.state.lock();
            let same = |known: &PreparedVolume| known.content == content && known.placement.shown == shown;
            if let Some(known) = state.parts.iter().filter_map(Weak::upgrade).find(|known| same(known)) {
                return Ok(known);
            }
            let voxel_bytes = whole.volume.voxels.bytes() / whole.volume.voxels.len().max(1);
            let bytes = scene::part::bytes_of(part.dims(), voxel_bytes as u64);
            state.make_room(bytes, self.limits.max_volume_memory_bytes)?;
        }
        let made = Arc::new(whole.part(part, wish.region, reduction));
        let mut state = self.state.lock();
        state.parts.retain(|known| known.strong_count() > 0);
        state.parts.push(Arc::downgrade(&made));
        Ok(made)
    }

    /// Joins the loading of a volume, or starts it.
    fn watch(self: &Arc<Self>, key: &Key) -> Answer<watch::Receiver<Stage>> {
        let mut state = self.state.lock();
        if let Some(volume) = state.touch(key) {
            return Ok(watch::channel(Stage::Done(Ok(volume))).1);
        }
        if let Some(stages) = state.loading.get(key) {
            return Ok(stages.clone());
        }
        if state.loading.len() >= MAX_WAITING_LOADS {
            return Err(Fault::busy(format!(
                "{MAX_WAITING_LOADS} volumes are being loaded; try again shortly."
            )));
        }
        let (sender, receiver) = watch::channel(Stage::Running(0.0));
        state.loading.insert(key.clone(), receiver.clone());
        drop(state);
        tokio::spawn(self.clone().run(key.clone(), sender));
        Ok(receiver)
    }

    async fn run(self: Arc<Self>, key: Key, stages: watch::Sender<Stage>) {
        let permit = self.loads.clone().acquire_owned().await;
        let stages = Arc::new(stages);
        let job = {
            let (volumes, key, stages) = (self.clone(), key.clone(), stages.clone());
            move || {
                volumes.read(&key, &|share| {
                    stages.send_replace(Stage::Running(share));
                })
            }
        };
        let result = match tokio::task::spawn_blocking(job).await {
            Ok(result) => result,
            Err(error) => Err(Fault::internal("loading a volume", &error)),
        };
        drop(permit);
        let mut state = self.state.lock();
        state.loading.remove(&key);
        let result = result.map(|volume| state.insert(key, volume));
        drop(state);
        stages.send_replace(Stage::Done(result));
    }

    /// Reads or computes a volume. Blocks.
    fn read(&self, key: &Key, progress: &(dyn Fn(f32) + Sync)) -> Answer<Arc<PreparedVolume>> {
        let decoding = |share: f32| progress(DECODING_SHARE * share);
        let expected_bytes = self.expected_bytes(key)?;
        let memory = self.limits.max_volume_memory_bytes;
        self.state.lock().make_room(expected_bytes, memory)?;
        let from_file = |path: &Path, index| {
            read(path, index, &self.limits, &decoding)
                .map(|read| read.volume)
                .map_err(|error| Fault::unreadable_file(error.to_string()))
        };
        let volume = match key {
            Key::Builtin(kind, dims) => samples::build(*kind, *dims, &decoding),
            Key::Dataset(id, index) => match self.samples.get(id).map(|sample| &sample.origin) {
                Some(Origin::File(path)) => from_file(path, *index)?,
                Some(Origin::Builtin(kind, dims)) => samples::build(*kind, *dims, &decoding),
                None => {
                    let manifest = self.catalog.get(id).ok_or_else(|| no_such_dataset(id))?;
                    let (path, index) = self
                        .catalog
                        .storage()
                        .volume_file(&manifest, *index)
                        .ok_or_else(|| no_such_volume(&manifest))?;
                    from_file(&path, index)?
                }
            },
        };
        let preparing = |share: f32| progress(DECODING_SHARE + (1.0 - DECODING_SHARE) * share);
        Ok(Arc::new(PreparedVolume::new(volume, &preparing)))
    }

    /// Bytes a volume takes in memory at most, known before it is read.
    fn expected_bytes(&self, key: &Key) -> Answer<u64> {
        let of_dataset = |dataset: &Dataset| voxel_count(dataset.dims) * memory_bytes(dataset.voxel_type);
        Ok(match key {
            Key::Builtin(_, dims) => voxel_count(*dims) * MAX_VOXEL_BYTES,
            Key::Dataset(id, index) => match self.samples.get(id) {
                Some(sample) => of_dataset(&sample.dataset),
                None => {
                    let manifest = self.catalog.get(id).ok_or_else(|| no_such_dataset(id))?;
                    match manifest.volumes.get(index.unwrap_or(0) as usize) {
                        Some(volume) => volume.memory_bytes,
                        None => of_dataset(&manifest.dataset),
                    }
                }
            },
        })
    }
}

fn no_such_volume(manifest: &Manifest) -> Fault {
    let count = manifest.volumes.len();
    Fault::unreadable_file(format!("The dataset has {count} volumes; `volume.index` counts below that."))
}

impl State {
    fn touch(&mut self, key: &Key) -> Option<Arc<PreparedVolume>> {
        self.clock += 1;
        let ready = self.ready.get_mut(key)?;
        ready.used = self.clock;
        Some(ready.volume.clone())
    }

    fn insert(&mut self, key: Key, volume: Arc<PreparedVolume>) -> Arc<PreparedVolume> {
        self.clock += 1;
        let used = self.clock;
        let fresh = || Ready { volume, used };
        self.ready.entry(key).or_insert_with(fresh).volume.clone()
    }

    /// Drops unused volumes until `bytes` more fit.
    /// Bytes of all voxels held.
    fn bytes(&self) -> u64 {
        let size = |volume: &PreparedVolume| volume.volume.voxels.bytes() as u64;
        let parts: u64 = self.parts.iter().filter_map(Weak::upgrade).map(|part| size(&part)).sum();
        self.ready.values().map(|ready| size(&ready.volume)).sum::<u64>().saturating_add(parts)
    }

    fn make_room(&mut self, bytes: u64, memory: u64) -> Answer<()> {
        loop {
            let held = self.bytes();
            if held.saturating_add(bytes) <= memory {
                return Ok(());
            }
            let unused = self.ready.iter().filter(|(_, r)| Arc::strong_count(&r.volume) == 1);
            let Some(oldest) = unused.min_by_key(|(_, r)| r.used).map(|(key, _)| key.clone()) else {
                return Err(Fault::busy(format!(
                    "The volume needs {bytes} bytes, and the volumes in use leave {} of {memory} (`limits.max_volume_memory_bytes`); close a session first.",
                    memory.saturating_sub(held)
                )));
            };
            self.ready.remove(&oldest);
        }
    }
}

/// Reads a volume file with the service's limits. Blocks.
///
/// # Errors
/// The reader's.
pub fn read(
    path: &Path,
    index: Option<u32>,
    limits: &Limits,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Imported, FormatError> {
    formats::read_volume(
        path,
        &ReadOptions {
            raw: None,
            index,
            limits: formats::Limits {
                max_voxel_bytes: limits.max_voxel_bytes,
                max_decoded_bytes: limits.max_voxel_bytes.saturating_mul(DECODED_PER_VOXEL_BYTE),
                ..formats::Limits::default()
            },
            siblings_only: true,
            progress,
        },
    )
}

fn voxel_count(dims: [u32; 3]) -> u64 {
    // Far below 2^62: no volume of such dims is ever described.
    dims.iter().fold(1, |count: u64, &edge| count.saturating_mul(edge.into())).min(1 << 60)
}

/// Bytes of a file's voxel in memory; wider types than these are converted.
fn memory_bytes(voxel_type: VoxelType) -> u64 {
    match voxel_type {
        VoxelType::Uint8 => 1,
        VoxelType::Int8 | VoxelType::Uint16 | VoxelType::Int16 => 2,
        _ => MAX_VOXEL_BYTES,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::{Volume, Voxels};

    fn volume(edge: usize) -> Arc<PreparedVolume> {
        let voxels = Voxels::U8(vec![0; edge * edge * edge]);
        Arc::new(PreparedVolume::new(Volume::new([edge; 3], voxels), &|_| {}))
    }

    #[test]
    fn the_least_recently_used_goes_first_and_volumes_in_use_stay() {
        let mut state = State::default();
        let key = |name: &str| Key::dataset(name);
        for name in ["a", "b", "c"] {
            state.insert(key(name), volume(10));
        }
        let used = state.touch(&key("a")).unwrap();
        state.make_room(1000, 3000).unwrap();
        assert!(state.touch(&key("b")).is_none(), "the oldest went");
        assert!(state.touch(&key("a")).is_some() && state.touch(&key("c")).is_some());
        let full = state.make_room(2500, 3000).unwrap_err();
        assert_eq!(full.problem.status, 503);
        assert!(state.touch(&key("a")).is_some(), "a volume in use is never dropped");
        drop(used);
        state.make_room(2500, 3000).unwrap();
    }
}
