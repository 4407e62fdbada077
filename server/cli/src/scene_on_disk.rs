//! Scenes in files: reading, editing, and the volumes they name.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use formats::{RawLayout, ReadOptions};
use proto::SceneFile;
use proto::scene_file::{Light, VolumeSource};
use render::fit::{Fitted, fit};
use render::{RenderError, VolumeCache};
use scene::levels::Reduction;
use scene::part::{Part, Wish};
use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Scene, Volume};
use serde_json::Value;

use crate::Refused;

/// Edge of a built-in volume whose scene names no size.
const DEFAULT_BUILTIN_EDGE: u32 = 64;

/// A scene file under edit, with the volume and the environment image it names kept loaded.
pub struct SceneOnDisk {
    folder: PathBuf,
    json: Value,
    loaded: Option<(VolumeSource, Arc<PreparedVolume>)>,
    images: EnvironmentImages,
    fitted: Option<(Wish, Arc<PreparedVolume>, Fitted)>,
}

impl SceneOnDisk {
    /// Reads a scene; relative paths in it start from its folder.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let json = serde_json::from_str(&text)
            .map_err(|error| Refused(format!("{}: not valid JSON: {error}", path.display())))?;
        let folder = path.parent().map_or_else(PathBuf::new, Path::to_path_buf);
        Ok(Self { folder, json, loaded: None, images: EnvironmentImages::new(), fitted: None })
    }

    /// Applies a JSON merge patch (RFC 7396; arrays are replaced whole).
    pub fn merge(&mut self, patch: &Value) {
        json_patch::merge(&mut self.json, patch);
    }

    /// Sets one value, for example `lights[0].irradiance` to `[1, 1, 1]`.
    pub fn set(&mut self, path: &str, value: Value) -> Result<(), Refused> {
        let mut at = &mut self.json;
        for step in path_steps(path) {
            at = match step {
                Step::Key(key) => {
                    if at.is_null() {
                        *at = Value::Object(serde_json::Map::new());
                    }
                    let object = at.as_object_mut();
                    let object = object
                        .ok_or_else(|| Refused(format!("--set {path}: `{key}` is not in an object")))?;
                    object.entry(key).or_insert(Value::Null)
                }
                Step::Index(index) => {
                    let slot = at.as_array_mut().and_then(|array| array.get_mut(index));
                    slot.ok_or_else(|| Refused(format!("--set {path}: there is no entry [{index}]")))?
                }
            };
        }
        *at = value;
        Ok(())
    }

    /// The checked scene; loads the volume if it is another than before.
    pub fn scene(&mut self) -> anyhow::Result<(SceneFile, Scene)> {
        let refused = |error: proto::FieldError| Refused(error.to_string());
        let file = SceneFile::from_value(self.json.clone()).map_err(refused)?;
        let volume = match &self.loaded {
            Some((source, volume)) if same_voxels(source, &file.volume) => volume.clone(),
            _ => {
                let volume = Arc::new(PreparedVolume::new(self.load(&file.volume)?, &|_| {}));
                self.loaded = Some((file.volume.clone(), volume.clone()));
                volume
            }
        };
        self.load_images(&file)?;
        let scene = Scene::with_images(&file, volume, &self.images).map_err(refused)?;
        render::check(&scene).map_err(refused)?;
        Ok((file, scene))
    }

    /// Loads the environment images of lights that shine, and forgets those not named any more.
    fn load_images(&mut self, file: &SceneFile) -> anyhow::Result<()> {
        let mut images = EnvironmentImages::new();
        for (index, light) in file.lights.iter().enumerate() {
            let Light::Environment(light) = light else { continue };
            let Some(name) = light.image.as_ref().filter(|_| light.enabled) else { continue };
            let image = match self.images.get(name) {
                Some(image) => image.clone(),
                None => {
                    let refused = |error: String| Refused(format!("lights[{index}].image: {error}"));
                    let path = self.folder.join(name);
                    let read = formats::read_environment(&path, &formats::Limits::default())
                        .map_err(|error| refused(error.to_string()))?;
                    for notice in &read.notices {
                        eprintln!("tyndall: {name}: {notice}");
                    }
                    let image = EnvironmentImage::new(read.width, read.height, &read.rgb);
                    Arc::new(image.map_err(|error| refused(error.to_string()))?)
                }
            };
            images.insert(name.clone(), image);
        }
        self.images = images;
        Ok(())
    }

    /// A scene of as much of the volume as it asks for and as the device can show; what is missing
    /// is said on the error output.
    pub fn fit(
        &mut self,
        file: &SceneFile,
        scene: Scene,
        cache: &VolumeCache,
        max_bytes: u64,
    ) -> anyhow::Result<Scene> {
        let wish = Wish::of(&file.volume);
        let whole = scene.volume.clone();
        let known = self.fitted.take().filter(|(held, of, fitted)| {
            Arc::ptr_eq(of, &whole) && held.same_voxels(&wish, fitted.volume.placement.level)
        });
        let fitted = match known {
            Some((_, _, fitted)) => fitted,
            None => {
                let reduction = Reduction::of(wish.filter);
                let part_of = |part: &Part| -> Result<_, RenderError> {
                    Ok(Arc::new(whole.part(part, wish.region, reduction)))
                };
                let fitted = fit(cache, &whole, &wish, max_bytes, part_of)?;
                if let Some(shown) = &fitted.shown {
                    eprintln!("tyndall: volume: {}", shown.notice);
                }
                fitted
            }
        };
        let volume = fitted.volume.clone();
        self.fitted = Some((wish, whole, fitted));
        Ok(scene.with_part(file, volume))
    }

    fn load(&self, source: &VolumeSource) -> anyhow::Result<Volume> {
        if let Some(builtin) = source.builtin {
            let dims = source.dims.unwrap_or([DEFAULT_BUILTIN_EDGE; 3]).map(|n| n as usize);
            return Ok(scene::builtin::build(builtin, dims, &|_| {}));
        }
        let Some(file) = &source.file else {
            let refused = "volume.dataset: datasets live in a running service; name the file instead, for example --set 'volume={\"file\": \"scan.nrrd\"}'";
            return Err(Refused(refused.into()).into());
        };
        let options = ReadOptions {
            raw: raw_layout(source)?,
            index: source.index,
            siblings_only: false,
            ..ReadOptions::default()
        };
        let imported = formats::read_volume(&self.folder.join(file), &options)
            .map_err(|error| Refused(format!("volume.file: {error}")))?;
        for notice in &imported.notices {
            eprintln!("tyndall: {file}: {notice}");
        }
        Ok(imported.volume)
    }
}

/// Layout of a raw file, where the scene gives one.
fn raw_layout(source: &VolumeSource) -> Result<Option<RawLayout>, Refused> {
    let Some(voxel_type) = source.voxel_type else { return Ok(None) };
    let missing = || Refused("volume.dims: a raw file needs its size as well as its type".into());
    Ok(Some(RawLayout {
        dims: source.dims.ok_or_else(missing)?,
        voxel_type,
        endian: source.endian.unwrap_or_default(),
        header_bytes: source.header_bytes.unwrap_or(0),
        spacing: None,
    }))
}

/// Whether two sources name the same voxels (how they are shown may differ).
fn same_voxels(a: &VolumeSource, b: &VolumeSource) -> bool {
    VolumeSource { filter: b.filter, level: b.level, region: b.region, ..a.clone() } == *b
}

enum Step {
    Key(String),
    Index(usize),
}

/// `a.b[2].c` as keys and indices, the notation of field errors.
fn path_steps(path: &str) -> Vec<Step> {
    let mut steps = Vec::new();
    for part in path.split('.') {
        let (key, indices) = part.split_once('[').map_or((part, ""), |(key, rest)| (key, rest));
        if !key.is_empty() {
            steps.push(Step::Key(key.to_owned()));
        }
        let indices = indices.split('[').filter_map(|index| index.trim_end_matches(']').parse().ok());
        steps.extend(indices.map(Step::Index));
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two texels, without compression: 1, 2, 4 and black.
    const PICTURE: &[u8] = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x20\x40\x80\x83\0\0\0\0";

    fn opened(folder: &Path, image: &str) -> anyhow::Error {
        let json = serde_json::json!({"version": 1, "volume": {"builtin": "homogeneous", "dims": [2, 2, 2]},
            "lights": [{"type": "environment", "image": image}]});
        std::fs::write(folder.join("scene.json"), json.to_string()).unwrap();
        let mut scene = SceneOnDisk::read(&folder.join("scene.json")).unwrap();
        let error = scene.scene().unwrap_err();
        assert_eq!(scene.images.len(), usize::from(image == "sky.hdr"));
        if let Some(image) = scene.images.get("sky.hdr") {
            assert_eq!(image.texels(), [[1.0, 2.0, 4.0], [0.0; 3]]);
        }
        error
    }

    #[test]
    fn environment_images_are_read_beside_the_scene_and_refused_by_the_method() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("sky.hdr"), PICTURE).unwrap();
        let error = opened(folder.path(), "sky.hdr");
        assert!(error.to_string().starts_with("lights[0].image: `local` cannot use"), "{error}");
        let error = opened(folder.path(), "missing.hdr");
        assert!(error.to_string().starts_with("lights[0].image: "), "{error}");
        assert!(error.is::<Refused>());
    }
}
