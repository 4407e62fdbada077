//! Samples: volumes that come with the service, each with the scene that shows it at its best.
//!
//! Most are computed from formulas; the scans in `samples/` are embedded in the binary and
//! written to the data directory when first needed, because readers read files.

use std::path::PathBuf;
use std::sync::OnceLock;

use proto::FieldError;
use proto::rest::Dataset;
use proto::scene_file::{Builtin, SceneFile, VolumeSource};
use scene::builtin;
use scene::{PreparedVolume, Volume};

use super::storage::{Storage, write_atomically};
use super::volumes::{self, Key};
use crate::config::Limits;

/// Edge of the small volume a built-in's properties are read off, voxels.
const PROBE_EDGE: usize = 2;

/// The scans in `samples/`: for each, `NAME.json` is the scene, `NAME.*` the volume file, and the
/// section `## NAME` of `README.md` says where it comes from and under which licence.
#[derive(rust_embed::Embed)]
#[folder = "samples/"]
#[allow_missing = true]
struct Scans;

/// A volume that comes with the service.
#[derive(Debug, Clone)]
pub struct Sample {
    /// What clients are told.
    pub dataset: Dataset,
    /// The scene that shows it.
    pub scene: SceneFile,
    /// Where its voxels come from.
    pub origin: Origin,
}

/// Where a sample's voxels come from.
#[derive(Debug, Clone)]
pub enum Origin {
    /// Computed.
    Builtin(Builtin, [u32; 3]),
    /// A file in the data directory.
    File(PathBuf),
}

/// Every sample; described when first asked for.
pub struct Samples {
    storage: Storage,
    limits: Limits,
    described: OnceLock<Vec<Sample>>,
}

impl Samples {
    /// Nothing is read yet.
    pub fn new(storage: Storage, limits: &Limits) -> Self {
        Self { storage, limits: limits.clone(), described: OnceLock::new() }
    }

    /// Every sample, scans first. The first call reads the scans and blocks for their decoding.
    pub fn all(&self) -> &[Sample] {
        self.described.get_or_init(|| self.describe_all())
    }

    /// One sample; blocks like [`Samples::all`].
    pub fn get(&self, id: &str) -> Option<&Sample> {
        self.all().iter().find(|sample| sample.dataset.id == id)
    }

    fn describe_all(&self) -> Vec<Sample> {
        let names = Scans::iter().filter_map(|file| file.strip_suffix(".json").map(str::to_owned));
        let scans = names.map(|name| (name.clone(), self.scan(&name)));
        let builtins = Builtin::ALL.map(|kind| (kind.name().to_owned(), computed(kind)));
        scans
            .chain(builtins)
            .filter_map(|(name, sample)| {
                sample.inspect_err(|reason| tracing::error!(name, reason, "a sample is left out")).ok()
            })
            .collect()
    }

    fn scan(&self, name: &str) -> Result<Sample, String> {
        let embedded = Scans::get(&format!("{name}.json")).ok_or("its scene is missing")?;
        let text = std::str::from_utf8(&embedded.data).map_err(|error| error.to_string())?;
        let scene = SceneFile::from_json(text).map_err(|error| error.to_string())?;
        if scene.volume.dataset.as_deref() != Some(name) {
            return Err("its scene shows another dataset".into());
        }
        let is_data = |file: &std::borrow::Cow<'static, str>| {
            file.strip_prefix(name).is_some_and(|end| end.starts_with('.') && end != ".json")
        };
        let file = Scans::iter().find(is_data).ok_or("its volume file is missing")?;
        let data = Scans::get(&file).ok_or("its volume file is missing")?;
        let path = self.storage.samples().join(file.as_ref());
        if std::fs::read(&path).ok().as_deref() != Some(data.data.as_ref()) {
            write_atomically(&path, &data.data).map_err(|error| error.to_string())?;
        }
        let read = volumes::read(&path, None, &self.limits, &|_| {}).map_err(|e| e.to_string())?;
        let prepared = PreparedVolume::new(read.volume, &|_| {});
        let mut dataset = super::describe(&prepared, name, &readable(name), read.format.name());
        dataset.sample = true;
        dataset.voxel_type = read.file_type;
        dataset.bytes = data.data.len() as u64;
        dataset.notices = read.notices;
        dataset.attribution =
            Scans::get("README.md").and_then(|readme| section(&String::from_utf8_lossy(&readme.data), name));
        Ok(Sample { dataset, scene, origin: Origin::File(path) })
    }
}

/// The section of a Markdown text under the heading `## name`.
fn section(text: &str, name: &str) -> Option<String> {
    let heading = format!("## {name}");
    let lines = text.lines().skip_while(|line| line.trim() != heading).skip(1);
    let section: Vec<&str> = lines.take_while(|line| !line.starts_with("## ")).collect();
    // Quoted licence texts stay in the file; emphasis and list marks are for Markdown readers.
    let plain = section.into_iter().filter(|line| !line.trim_start().starts_with('>'));
    let plain: Vec<String> = plain.map(|line| line.trim_start_matches("- ").replace("**", "")).collect();
    Some(plain.join("\n").trim().to_owned()).filter(|section| !section.is_empty())
}

/// A computed sample, described without computing it: a small probe tells the type and scale of
/// its voxels, the scene the range of its values.
fn computed(kind: Builtin) -> Result<Sample, String> {
    let in_words = |error: FieldError| error.to_string();
    let scene = builtin::scene(kind).map_err(in_words)?;
    let dims = builtin_dims(&scene.volume);
    let probe = PreparedVolume::new(builtin::build(kind, [PROBE_EDGE; 3], &|_| {}), &|_| {});
    let voxel_bytes = (probe.volume.voxels.bytes() / probe.volume.voxels.len()) as u64;
    let mut dataset = super::describe(&probe, kind.name(), &readable(kind.name()), "builtin");
    dataset.sample = true;
    dataset.dims = dims;
    dataset.spacing = probe.volume.spacing;
    dataset.value_range = scene.value_range.unwrap_or(probe.range);
    dataset.bytes = dims.iter().map(|&edge| u64::from(edge)).product::<u64>() * voxel_bytes;
    Ok(Sample { dataset, scene, origin: Origin::Builtin(kind, dims) })
}

/// Size of a built-in volume a scene asks for.
pub fn builtin_dims(source: &VolumeSource) -> [u32; 3] {
    source.dims.unwrap_or_else(|| builtin::DEFAULT_DIMS.map(|edge| u32::try_from(edge).unwrap_or(u32::MAX)))
}

/// Computes a built-in volume. Blocks.
pub fn build(kind: Builtin, dims: [u32; 3], progress: &(dyn Fn(f32) + Sync)) -> Volume {
    builtin::build(kind, dims.map(|edge| edge as usize), progress)
}

/// `vessel_tree` as `Vessel tree`; scans and names of people by hand.
pub fn readable(name: &str) -> String {
    match name {
        "avm" => return "Head vessels (CT)".into(),
        "stent" => return "Aortic stent (CT)".into(),
        "marschner_lobb" => return "Marschner-Lobb".into(),
        _ => {}
    }
    let words = name.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

impl Sample {
    /// The key of the sample's volume.
    pub fn key(&self) -> Key {
        match &self.origin {
            Origin::Builtin(kind, dims) => Key::Builtin(*kind, *dims),
            Origin::File(_) => Key::dataset(&self.dataset.id),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_is_described_and_its_scene_fits() {
        let root = tempfile::tempdir().unwrap();
        let storage = Storage::open(root.path()).unwrap();
        let samples = Samples::new(storage, &Limits::default());
        let scans = Scans::iter().filter(|file| file.ends_with(".json")).count();
        assert_eq!(samples.all().len(), Builtin::ALL.len() + scans, "none is left out");
        for sample in samples.all() {
            let Dataset { id, dims, value_range, .. } = &sample.dataset;
            assert!(value_range[0] < value_range[1], "{id}");
            assert!(dims.iter().all(|&edge| edge > 1), "{id}");
            assert!(sample.dataset.sample && !sample.dataset.name.is_empty(), "{id}");
            assert!(sample.scene.volume.file.is_none(), "{id}: a client could not name a file");
            let computed = matches!(sample.origin, Origin::Builtin(..));
            assert!(
                computed || sample.dataset.attribution.as_ref().is_some_and(|a| a.contains("Licence")),
                "{id}"
            );
        }
    }

    #[test]
    fn names_are_for_people() {
        assert_eq!(readable("vessel_tree"), "Vessel tree");
    }
}
