//! NIfTI-1 and NIfTI-2: `.nii`, `.nii.gz`, and pairs of `.hdr` and `.img`.
//!
//! An own reader: of the `nifti` crate, version 0.18 takes files whose `sizeof_hdr` or
//! `vox_offset` are wrong, panics on RGB voxels, reserves what a hostile extension asks for, and
//! refuses NIfTI-2. The header has a fixed layout, so reading it is the smaller part.

mod header;
mod placement;

use std::path::{Path, PathBuf};

use proto::scene_file::VoxelType;

use crate::describe::stored_range;
use crate::error::{FormatError, file_name};
use crate::orientation::Stored;
use crate::stream::{Progress, Stream};
use crate::voxels::{LABEL_NOTICE, Layout, check_axes};
use crate::{Format, Imported, ReadOptions};
use header::Header;

/// Bytes of a file that [`is_header`] needs.
pub(crate) const DETECTION_BYTES: usize = header::NIFTI1_BYTES;

/// Whether a file starts with a NIfTI header.
pub(crate) fn is_header(start: &[u8]) -> bool {
    header::recognise(start).is_some()
}

/// A voxel as NIfTI's `datatype` has it: one or several components of a type.
struct Datatype {
    voxel_type: VoxelType,
    components: u64,
    /// What the components are called, where there are several.
    names: &'static [&'static str],
}

/// Reads a NIfTI file or pair; either file of a pair may be given.
pub(crate) fn read(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    let header_path = header_path(path)?;
    let mut stream = Stream::open_maybe_gzip(&header_path)?;
    let file = stream.file.clone();
    let mut notices = Vec::new();
    let header = Header::read(&mut stream)?;
    let datatype = datatype(&file, header.datatype)?;

    // Axes: the first three are space, the others count volumes.
    let rank = usize::try_from(header.dim[0]).ok().filter(|rank| (1..=7).contains(rank));
    let Some(rank) = rank else {
        let expected = "a number of axes from 1 to 7";
        return Err(FormatError::field(&file, "dim[0]", header.dim[0], expected));
    };
    let size_of = |axis: usize| {
        if axis <= rank { i128::from(header.dim[axis]) } else { 1 }
    };
    let dims = check_axes(&file, "dim", [1, 2, 3].map(size_of), &options.limits)?;
    let mut volumes = 1_u64;
    for axis in 4..=7 {
        volumes = u64::try_from(size_of(axis))
            .ok()
            .filter(|size| *size >= 1)
            .and_then(|size| volumes.checked_mul(size))
            .ok_or_else(|| {
                let expected = "at least 1, and a product of all that fits the file";
                FormatError::field(&file, format!("dim[{axis}]"), size_of(axis), expected)
            })?;
    }
    let layout = Layout {
        voxel_type: datatype.voxel_type,
        endian: header.endian,
        dims,
        components: datatype.components,
        volumes,
    };
    let size = layout.check(&file, options, &mut notices)?;
    if datatype.components > 1 {
        let component = u64::from(options.index.unwrap_or(0)) % datatype.components;
        let name = datatype.names.get(component as usize).copied().unwrap_or("first");
        notices.push(format!(
            "voxels of {} components ({}): the {name} component is read",
            datatype.components,
            datatype.names.join(", ")
        ));
    }

    if header.intent_code == header::INTENT_LABEL {
        notices.push(LABEL_NOTICE.to_owned());
    }
    let (spacing, affine) = placement::place(&header, dims, &mut notices);
    let mut stored = Stored {
        dims,
        spacing,
        spacing_unit: header.spacing_unit().map(str::to_owned),
        slope: 1.0,
        intercept: 0.0,
        affine,
    };
    stored.check_spacing(&file, "pixdim")?;

    // Data: behind the header, or in the second file of the pair.
    if header.is_pair {
        stream = Stream::open_maybe_gzip(&image_path(&header_path, options)?)?;
        skip_to_voxels(&mut stream, header.vox_offset, 0, options)?;
    } else {
        header.skip_extensions(&mut stream, options)?;
    }
    let voxels = layout.read(&size, &mut stream, options, &mut notices)?;
    if datatype.components == 1 {
        (stored.slope, stored.intercept) = scaling(&header, stored_range(&voxels), &mut notices);
    }
    Ok(Imported {
        volume: stored.into_volume(voxels, &mut notices),
        format: Format::Nifti,
        file_type: datatype.voxel_type,
        choices: layout.choices(),
        choice_names: Vec::new(),
        notices,
    })
}

/// Skips to `offset`, of which `done` bytes are behind us, after checking that it is there.
fn skip_to_voxels(
    stream: &mut Stream<'_>,
    offset: u64,
    done: u64,
    options: &ReadOptions<'_>,
) -> Result<(), FormatError> {
    let rest = offset.saturating_sub(done);
    if rest > stream.at_most() {
        let expected = "a position inside the file";
        return Err(FormatError::field(&stream.file, "vox_offset", offset, expected));
    }
    let limit = options.limits.max_header_bytes;
    if offset > limit {
        return Err(FormatError::TooLarge {
            file: stream.file.clone(),
            what: "bytes before the voxels (vox_offset)",
            got: offset.to_string(),
            limit,
        });
    }
    stream.skip(rest, &mut Progress::new(&|_| {}, 1))
}

fn datatype(file: &str, code: i16) -> Result<Datatype, FormatError> {
    let (voxel_type, names): (_, &[_]) = match code {
        2 => (VoxelType::Uint8, &[]),
        4 => (VoxelType::Int16, &[]),
        8 => (VoxelType::Int32, &[]),
        16 => (VoxelType::Float32, &[]),
        32 => (VoxelType::Float32, &["real", "imaginary"]),
        64 => (VoxelType::Float64, &[]),
        128 => (VoxelType::Uint8, &["red", "green", "blue"]),
        256 => (VoxelType::Int8, &[]),
        512 => (VoxelType::Uint16, &[]),
        768 => (VoxelType::Uint32, &[]),
        1024 => (VoxelType::Int64, &[]),
        1280 => (VoxelType::Uint64, &[]),
        1792 => (VoxelType::Float64, &["real", "imaginary"]),
        2304 => (VoxelType::Uint8, &["red", "green", "blue", "alpha"]),
        1 | 1536 | 2048 => {
            let name = match code {
                1 => "single bits",
                1536 => "128-bit floats",
                _ => "256-bit complex numbers",
            };
            return Err(FormatError::unsupported(
                file,
                format!("datatype {code} ({name})"),
                "convert the voxels, for example to float32",
            ));
        }
        _ => {
            let expected = "a NIfTI type code, for example 2 (uint8), 4 (int16) or 16 (float32)";
            return Err(FormatError::field(file, "datatype", code, expected));
        }
    };
    Ok(Datatype { voxel_type, components: names.len().max(1) as u64, names })
}

/// Slope and intercept, where they are set and lead to finite data values.
fn scaling(header: &Header, stored_range: [f64; 2], notices: &mut Vec<String>) -> (f64, f64) {
    let (slope, intercept) = (header.scl_slope, header.scl_inter);
    if slope == 0.0 {
        return (1.0, 0.0);
    }
    let fits = |stored: f64| (slope * stored + intercept).abs() <= f64::from(f32::MAX);
    if slope.is_finite() && intercept.is_finite() && stored_range.into_iter().all(fits) {
        return (slope, intercept);
    }
    notices.push(format!(
        "scl_slope {slope} and scl_inter {intercept} do not lead to finite values: the values are \
         taken as stored"
    ));
    (1.0, 0.0)
}

/// Path of the header, given either file of a pair.
fn header_path(path: &Path) -> Result<PathBuf, FormatError> {
    match other_of_pair(path, "img", "hdr") {
        None => Ok(path.to_owned()),
        Some(found) => found.ok_or_else(|| {
            let file = file_name(path);
            FormatError::missing(&file, "header", "the .hdr file of the pair in the same folder")
        }),
    }
}

/// Path of the voxels of a pair, given its header.
fn image_path(header_path: &Path, options: &ReadOptions<'_>) -> Result<PathBuf, FormatError> {
    let file = file_name(header_path);
    let expected = "the .img file of the pair in the same folder (magic ni1: header and voxels \
                    lie in two files)";
    let path = other_of_pair(header_path, "hdr", "img")
        .flatten()
        .ok_or_else(|| FormatError::missing(&file, "voxels", expected))?;
    let is_link = path.symlink_metadata().is_ok_and(|m| m.file_type().is_symlink());
    if options.siblings_only && is_link {
        return Err(FormatError::field(&file, "voxels", file_name(&path), "a file, not a link"));
    }
    Ok(path)
}

/// For `NAME.from` or `NAME.from.gz`: which of `NAME.to` and `NAME.to.gz` is there. `None` if the
/// path ends otherwise.
fn other_of_pair(path: &Path, from: &str, to: &str) -> Option<Option<PathBuf>> {
    let name = path.file_name()?.to_str()?;
    let lower = name.to_lowercase();
    let bare = lower.strip_suffix(".gz").unwrap_or(&lower);
    let stem = name.get(..bare.strip_suffix(from)?.len()).filter(|stem| stem.ends_with('.'))?;
    let endings = [to.to_owned(), format!("{to}.gz"), to.to_uppercase(), format!("{to}.GZ")];
    Some(endings.iter().map(|end| path.with_file_name(format!("{stem}{end}"))).find(|p| p.is_file()))
}
