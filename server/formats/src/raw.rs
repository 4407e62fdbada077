//! Raw voxels: no header, the layout comes from the scene or from a JSON file beside the data.

use std::path::{Path, PathBuf};

use proto::scene_file::{Endian, VoxelType};
use serde::Deserialize;

use crate::error::{FormatError, file_name};
use crate::orientation::Stored;
use crate::stream::{Progress, Stream};
use crate::voxels::{Layout, check_axes};
use crate::{Format, Imported, ReadOptions};

/// Largest sidecar that is read, bytes.
const MAX_SIDECAR_BYTES: u64 = 64 << 10;

/// How the voxels of a raw file lie. Also the content of a sidecar; keys are those of a scene's
/// `volume`, unknown ones are errors.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawLayout {
    /// Voxels along x, y, z; x fastest.
    pub dims: [u32; 3],
    /// Type of a voxel.
    #[serde(rename = "type")]
    pub voxel_type: VoxelType,
    /// Byte order.
    #[serde(default)]
    pub endian: Endian,
    /// Bytes before the first voxel.
    #[serde(default)]
    pub header_bytes: u64,
    /// Edges of a voxel along x, y, z; 1 if not given.
    #[serde(default)]
    pub spacing: Option<[f64; 3]>,
}

/// Looks for the sidecar of a raw file: `NAME.raw.json`, then `NAME.json`. `None` if there is
/// neither.
///
/// # Errors
///
/// A sidecar that cannot be read, is no JSON, or has unknown or missing fields.
pub fn read_sidecar(raw_path: &Path) -> Result<Option<RawLayout>, FormatError> {
    let mut appended = raw_path.as_os_str().to_owned();
    appended.push(".json");
    let candidates = [PathBuf::from(appended), raw_path.with_extension("json")];
    let Some(path) = candidates.iter().find(|p| p.is_file() && p.as_path() != raw_path) else {
        return Ok(None);
    };
    let file = file_name(path);
    let mut stream = Stream::open(path)?;
    let length = stream.at_most();
    if length > MAX_SIDECAR_BYTES {
        return Err(FormatError::TooLarge {
            file,
            what: "bytes of a raw file's sidecar",
            got: length.to_string(),
            limit: MAX_SIDECAR_BYTES,
        });
    }
    let mut text = vec![0; length as usize];
    stream.read_exact(&mut text)?;
    let mut json = serde_json::Deserializer::from_slice(&text);
    let layout = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let field = error.path().to_string();
        let expected = "the layout of a raw file: \"dims\", \"type\", and if needed \"endian\", \
                        \"header_bytes\", \"spacing\"";
        FormatError::field(&file, field, error.inner(), expected)
    })?;
    Ok(Some(layout))
}

/// Reads a raw file; one whose name ends in `.gz` is inflated first.
pub(crate) fn read(path: &Path, raw: &RawLayout, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    let file = file_name(path);
    let mut notices = Vec::new();
    let dims = check_axes(&file, "dims", raw.dims.map(i128::from), &options.limits)?;
    let stored = Stored {
        dims,
        spacing: raw.spacing.unwrap_or([1.0; 3]),
        spacing_unit: None,
        slope: 1.0,
        intercept: 0.0,
        affine: None,
    };
    stored.check_spacing(&file, "spacing")?;
    let layout = Layout { voxel_type: raw.voxel_type, endian: raw.endian, dims, components: 1, volumes: 1 };
    let size = layout.check(&file, options, &mut notices)?;
    let compressed = file.to_lowercase().ends_with(".gz");
    let mut stream = if compressed { Stream::open(path)?.into_gzip()? } else { Stream::open(path)? };

    // A raw file proves its layout by its length alone, so here the length must fit exactly.
    let expected_bytes = raw.header_bytes.saturating_add(size.total_bytes);
    if !compressed && stream.at_most() != expected_bytes {
        return Err(wrong_length(&file, raw, &stream, expected_bytes));
    }
    stream.require(expected_bytes)?;
    stream.skip(raw.header_bytes, &mut Progress::new(&|_| {}, 1))?;
    let voxels = layout.read(&size, &mut stream, options, &mut notices)?;
    Ok(Imported {
        volume: stored.into_volume(voxels, &mut notices),
        format: Format::Raw,
        file_type: raw.voxel_type,
        choices: layout.choices(),
        choice_names: Vec::new(),
        notices,
    })
}

fn wrong_length(file: &str, raw: &RawLayout, stream: &Stream<'_>, expected_bytes: u64) -> FormatError {
    let [x, y, z] = raw.dims;
    let name = crate::voxels::type_name(raw.voxel_type);
    let header = raw.header_bytes;
    FormatError::field(
        file,
        "dims, type and header_bytes",
        format!("{} bytes", stream.at_most()),
        format!(
            "a file of {expected_bytes} bytes ({x} x {y} x {z} voxels of {name} after \
             {header} header bytes)"
        ),
    )
}
