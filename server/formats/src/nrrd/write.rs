//! Writing NRRD.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use scene::{Volume, Voxels};

use crate::error::{FormatError, file_name};

/// Voxels turned into bytes per step.
const CHUNK_VOXELS: usize = 1 << 18;

/// Writes a volume as NRRD (version 4, gzip), which [`crate::read_volume`] reads back: voxels
/// equal, geometry to rounding.
///
/// NRRD knows no slope and intercept. A volume that has them is written as its data values in
/// 32-bit floats, so that every reader sees the right numbers. The file appears under its name
/// only once it is complete.
///
/// # Errors
///
/// The system's, when the file cannot be written.
pub fn write_nrrd(path: &Path, volume: &Volume) -> Result<(), FormatError> {
    let file = file_name(path);
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(".unfinished");
    let unfinished = Path::new(&unfinished);
    let written = write_to(unfinished, volume)
        .and_then(|()| std::fs::rename(unfinished, path))
        .map_err(FormatError::io(&file, "write"));
    if written.is_err() {
        // Best effort: the error that matters is returned.
        let _ = std::fs::remove_file(unfinished);
    }
    written
}

fn write_to(path: &Path, volume: &Volume) -> io::Result<()> {
    let scaled = volume.slope != 1.0 || volume.intercept != 0.0;
    let mut file = BufWriter::new(File::create(path)?);
    file.write_all(header(volume, scaled).as_bytes())?;
    let mut gzip = GzEncoder::new(file, Compression::fast());
    match &volume.voxels {
        voxels if scaled => write_scaled(&mut gzip, volume, voxels)?,
        Voxels::U8(values) => gzip.write_all(values)?,
        Voxels::U16(values) => write_values(&mut gzip, values, u16::to_le_bytes)?,
        Voxels::I16(values) => write_values(&mut gzip, values, i16::to_le_bytes)?,
        Voxels::F32(values) => write_values(&mut gzip, values, f32::to_le_bytes)?,
    }
    gzip.finish()?.into_inner()?.sync_all()
}

fn header(volume: &Volume, scaled: bool) -> String {
    let [x, y, z] = volume.dims;
    let voxel_type = match volume.voxels {
        _ if scaled => "float",
        Voxels::U8(_) => "uint8",
        Voxels::U16(_) => "uint16",
        Voxels::I16(_) => "int16",
        Voxels::F32(_) => "float",
    };
    let vector = |[a, b, c]: [f64; 3]| format!("({a},{b},{c})");
    let unit = volume.spacing_unit.as_ref().map(|unit| {
        let unit: String = unit.chars().filter(|c| !c.is_control() && *c != '"').collect();
        format!("\"{unit}\" \"{unit}\" \"{unit}\"")
    });
    let mut text = format!("NRRD0004\ntype: {voxel_type}\ndimension: 3\n");
    // Writing to a string cannot fail.
    if let Some(orientation) = &volume.orientation {
        let step = |axis: usize| vector(orientation.lps_from_grid[axis].map(|c| c * volume.spacing[axis]));
        let _ = write!(
            text,
            "space: left-posterior-superior\nsizes: {x} {y} {z}\nspace directions: {} {} {}\n\
             kinds: domain domain domain\nspace origin: {}\n",
            step(0),
            step(1),
            step(2),
            vector(orientation.origin)
        );
        if let Some(unit) = unit {
            let _ = writeln!(text, "space units: {unit}");
        }
    } else {
        let [sx, sy, sz] = volume.spacing;
        let _ = write!(text, "sizes: {x} {y} {z}\nspacings: {sx} {sy} {sz}\n");
        if let Some(unit) = unit {
            let _ = writeln!(text, "units: {unit}");
        }
    }
    text.push_str("endian: little\nencoding: gzip\n\n");
    text
}

fn write_values<T: Copy, const N: usize>(
    out: &mut impl Write,
    values: &[T],
    to_bytes: impl Fn(T) -> [u8; N],
) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(CHUNK_VOXELS.min(values.len()) * N);
    for chunk in values.chunks(CHUNK_VOXELS) {
        bytes.clear();
        bytes.extend(chunk.iter().flat_map(|value| to_bytes(*value)));
        out.write_all(&bytes)?;
    }
    Ok(())
}

fn write_scaled(out: &mut impl Write, volume: &Volume, voxels: &Voxels) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(CHUNK_VOXELS.min(voxels.len()) * 4);
    for start in (0..voxels.len()).step_by(CHUNK_VOXELS) {
        bytes.clear();
        for index in start..(start + CHUNK_VOXELS).min(voxels.len()) {
            let value = volume.slope * f64::from(voxels.stored(index)) + volume.intercept;
            bytes.extend_from_slice(&(value as f32).to_le_bytes());
        }
        out.write_all(&bytes)?;
    }
    Ok(())
}
