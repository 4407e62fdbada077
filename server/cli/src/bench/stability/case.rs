//! A case: voxels, a scene, and what must come of it.

use std::sync::Arc;

use anyhow::Context;
use proto::scene_file::Builtin;
use proto::{FieldError, SceneFile};
use scene::{EnvironmentImages, PreparedVolume, Volume, Voxels};
use serde_json::{Value, json};

use crate::bench::scenes::{Loaded, prepared};

/// Voxels along each axis where a case does not say.
pub const EDGE: usize = 16;
/// Pixels where a case does not say.
pub const IMAGE: [u32; 2] = [20, 16];
/// Relative error that is good enough where a case does not say: rays of one voxel's step in volumes
/// of 16 voxels.
pub const USUAL_TOLERANCE: f64 = 0.05;

/// One row of the table.
pub struct Case {
    /// What is pushed to its limits.
    pub group: &'static str,
    /// The limit.
    pub name: String,
    /// The voxels.
    pub data: Data,
    /// A JSON merge patch of [`usual_scene`].
    pub patch: Value,
    /// Pixels.
    pub image: [u32; 2],
    /// What must come of it, beside a picture without NaN, panic or error in bounded time.
    pub expect: Expect,
    /// Whether the short form takes it.
    pub quick: bool,
}

/// Where voxels come from.
#[derive(Clone)]
pub enum Data {
    Builtin(Builtin, [usize; 3]),
    /// Floats as they stand in a file, which is read as any file is.
    File([usize; 3], Vec<f32>),
}

/// What must come of a case.
#[derive(Clone, Copy)]
pub enum Expect {
    /// The scene is refused, and this field is named.
    Refused(&'static str),
    /// All pixels have this radiance, up to a share of it.
    Radiance([f64; 3], f64),
    /// The picture is the reference of the method's transport up to this error.
    Reference(f64),
    /// The error is stated, not judged, for this reason.
    Stated(&'static str),
}

impl Case {
    /// A case on the usual volume, judged by the reference.
    pub fn new(group: &'static str, name: impl Into<String>, patch: Value) -> Self {
        Self {
            group,
            name: name.into(),
            data: Data::Builtin(Builtin::ThickBlob, [EDGE; 3]),
            patch,
            image: IMAGE,
            expect: Expect::Reference(USUAL_TOLERANCE),
            quick: false,
        }
    }

    pub fn data(self, data: Data) -> Self {
        Self { data, ..self }
    }

    pub fn image(self, image: [u32; 2]) -> Self {
        Self { image, ..self }
    }

    pub fn expect(self, expect: Expect) -> Self {
        Self { expect, ..self }
    }

    /// Takes it into the short form.
    pub fn quick(self) -> Self {
        Self { quick: true, ..self }
    }

    /// The scene file and its voxels.
    ///
    /// # Errors
    /// `Ok(Err)`: the scene is refused. `Err`: the voxels cannot be made.
    pub fn load(&self) -> anyhow::Result<Result<Loaded, FieldError>> {
        let mut json = usual_scene();
        json_patch::merge(&mut json, &self.patch);
        let file = match SceneFile::from_value(json) {
            Ok(file) => file,
            Err(refused) => return Ok(Err(refused)),
        };
        Ok(Ok(Loaded { file, volume: self.data.load()?, images: EnvironmentImages::new() }))
    }
}

impl Data {
    fn load(&self) -> anyhow::Result<Arc<PreparedVolume>> {
        Ok(match self {
            Data::Builtin(kind, dims) => prepared(scene::builtin::build(*kind, *dims, &|_| {})),
            Data::File(dims, values) => prepared(through_a_file(*dims, values)?),
        })
    }
}

/// Writes values as NRRD and reads them back, as an import does.
fn through_a_file([x, y, z]: [usize; 3], values: &[f32]) -> anyhow::Result<Volume> {
    let mut bytes =
        format!("NRRD0004\ntype: float\ndimension: 3\nsizes: {x} {y} {z}\nencoding: raw\nendian: little\n\n")
            .into_bytes();
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    let path = std::env::temp_dir().join(format!("tyndall-stability-{}.nrrd", std::process::id()));
    std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
    let read = formats::read_volume(&path, &formats::ReadOptions::default());
    let _ = std::fs::remove_file(&path);
    Ok(read?.volume)
}

/// A ball of voxels with NaN, infinities and denormal numbers strewn in, or nothing else.
pub fn broken_values(every: usize) -> Vec<f32> {
    const BAD: [f32; 5] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-42, -0.0];
    let volume = scene::builtin::build(Builtin::ThickBlob, [EDGE; 3], &|_| {});
    let Voxels::U16(voxels) = volume.voxels else { return Vec::new() };
    let value = |(index, voxel): (usize, &u16)| {
        if index.is_multiple_of(every) { BAD[index / every % BAD.len()] } else { f32::from(*voxel) / 65535.0 }
    };
    voxels.iter().enumerate().map(value).collect()
}

/// A soft blob in two lights: nothing about it is hard.
pub fn usual_scene() -> Value {
    json!({
        "version": 1,
        "volume": {"builtin": "thick_blob"},
        "value_range": [0, 1],
        "transfer_function": {"points": [
            {"s": 0.0, "extinction": 0, "albedo": [0.8, 0.7, 0.6], "material": "m"},
            {"s": 0.05, "extinction": 0, "albedo": [0.8, 0.7, 0.6], "material": "m"},
            {"s": 1.0, "extinction": 12, "albedo": [0.8, 0.7, 0.6], "material": "m"}]},
        "materials": {"m": {"phase": {"type": "henyey_greenstein", "g": 0.3}}},
        "lights": [
            {"id": "sun", "type": "directional", "direction": [0.4, -0.7, -0.5], "irradiance": [2, 2, 2]},
            {"id": "room", "type": "environment", "radiance": [0.2, 0.25, 0.3]}],
        "camera": {"position": [0.3, 0.4, 1.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 38},
        "background": [0.05, 0.05, 0.06]
    })
}

/// A box of one value, seen along an axis: every ray goes through one world unit of it.
pub fn slab(extinction: f64, albedo: f64, emission: f64) -> Value {
    json!({
        "volume": {"builtin": "homogeneous"}, "value_range": [0, 255],
        "transfer_function": {"points": [
            {"s": 0, "extinction": extinction, "albedo": [albedo, albedo, albedo], "emission": [emission, emission, emission]}]},
        "lights": [],
        "camera": {"position": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": null, "orthographic_height": 0.8},
        "background": [0.5, 0.5, 0.5]
    })
}
