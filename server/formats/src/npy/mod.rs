//! NumPy `.npy` (numpy.org/doc/stable/reference/generated/numpy.lib.format.html): versions 1 to
//! 3, arrays of two to four axes in C or Fortran order.
//!
//! An array is indexed `[z, y, x]`, as NumPy users write volumes, whatever its order in memory.
//! An own reader, so that the bounds of all readers hold: the header is small, sizes are checked
//! before memory is reserved, and voxels are converted as they come.

mod literal;

use std::path::Path;

use proto::scene_file::{Endian, VoxelType};

use crate::error::FormatError;
use crate::half_float;
use crate::orientation::Stored;
use crate::reorder::{Axes, reorder_voxels};
use crate::stream::Stream;
use crate::voxels::{Layout, check_axes};
use crate::{Format, Imported, ReadOptions};
use literal::Header;

/// What every NumPy file starts with.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header, bytes; NumPy's own have 128.
const MAX_HEADER_BYTES: u64 = 64 << 10;
/// The last of four axes counts as components if it is no longer than this (RGBA).
const MAX_GUESSED_COMPONENTS: i128 = 4;

/// Reads a NumPy file, which may be compressed with gzip as a whole.
pub(crate) fn read(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    read_stream(Stream::open_maybe_gzip(path)?, options)
}

/// Reads an array from a stream that stands at the magic.
pub(crate) fn read_stream(
    mut stream: Stream<'_>,
    options: &ReadOptions<'_>,
) -> Result<Imported, FormatError> {
    let file = stream.file.clone();
    let header = read_header(&mut stream, options)?;
    let mut notices = Vec::new();
    let Some(descr) = &header.descr else {
        return Err(FormatError::unsupported(
            &file,
            "an array of structures",
            "save one of its fields, for example np.save('a.npy', a['field'])",
        ));
    };
    let (voxel_type, endian, is_half) = voxel_type(&file, descr)?;
    let sizes = Sizes::new(&file, &header, &mut notices)?;
    let dims = check_axes(&file, "shape", sizes.space, &options.limits)?;
    let count = |n: i128| {
        let expected = "axes of at least 1";
        u64::try_from(n)
            .ok()
            .filter(|n| *n >= 1)
            .ok_or_else(|| FormatError::field(&file, "shape", format!("{:?}", header.shape), expected))
    };
    let layout = Layout {
        voxel_type,
        endian: if is_half { Endian::Little } else { endian },
        dims,
        components: count(sizes.components)?,
        volumes: count(sizes.volumes)?,
    };
    let size = layout.check(&file, options, &mut notices)?;
    let stored = Stored {
        dims: if header.fortran_order { [dims[2], dims[1], dims[0]] } else { dims },
        spacing: [1.0; 3],
        spacing_unit: None,
        slope: 1.0,
        intercept: 0.0,
        affine: None,
    };
    stored.check_spacing(&file, "shape")?;
    notices.push("the file gives no spacing: 1 is taken along every axis".to_owned());
    if is_half {
        notices.push(half_float::NOTICE.to_owned());
        stream = half_float::widen(stream, endian);
    }
    let mut voxels = layout.read(&size, &mut stream, options, &mut notices)?;
    if header.fortran_order {
        voxels = reorder_voxels(voxels, dims, Axes { permutation: [2, 1, 0], flip: [false; 3] });
    }
    Ok(Imported {
        volume: stored.into_volume(voxels, &mut notices),
        format: Format::Npy,
        file_type: voxel_type,
        choices: layout.choices(),
        choice_names: Vec::new(),
        notices,
    })
}

fn read_header(stream: &mut Stream<'_>, options: &ReadOptions<'_>) -> Result<Header, FormatError> {
    let file = stream.file.clone();
    let mut start = [0; 8];
    stream.read_exact(&mut start)?;
    let version = start[6];
    if !start.starts_with(MAGIC) || !(1..=3).contains(&version) {
        let expected = "the bytes \\x93NUMPY and a version from 1 to 3 at the start of the file";
        return Err(FormatError::field(&file, "magic", start.escape_ascii(), expected));
    }
    let length = if version == 1 {
        let mut bytes = [0; 2];
        stream.read_exact(&mut bytes)?;
        u64::from(u16::from_le_bytes(bytes))
    } else {
        let mut bytes = [0; 4];
        stream.read_exact(&mut bytes)?;
        u64::from(u32::from_le_bytes(bytes))
    };
    let limit = MAX_HEADER_BYTES.min(options.limits.max_header_bytes);
    if length > limit {
        let what = "bytes of header";
        return Err(FormatError::TooLarge { file, what, got: length.to_string(), limit });
    }
    stream.require(length)?;
    let mut text = vec![0; length as usize];
    stream.read_exact(&mut text)?;
    literal::parse(&file, &String::from_utf8_lossy(&text))
}

/// Axes in the order of memory, fastest first.
struct Sizes {
    space: [i128; 3],
    components: i128,
    volumes: i128,
}

impl Sizes {
    fn new(file: &str, header: &Header, notices: &mut Vec<String>) -> Result<Self, FormatError> {
        let shape = &header.shape;
        let colours_last = "the last axis is taken for components, the others for z, y, x";
        let (space, components, volumes) = match *shape.as_slice() {
            [y, x] => {
                notices.push("the image is flat: it becomes one slice".to_owned());
                ([1, y, x], 1, 1)
            }
            [z, y, x] => ([z, y, x], 1, 1),
            [z, y, x, c] if c <= MAX_GUESSED_COMPONENTS => {
                notices.push(colours_last.to_owned());
                ([z, y, x], c, 1)
            }
            [t, z, y, x] => {
                notices.push("the first axis is taken for volumes, the others for z, y, x".to_owned());
                ([z, y, x], 1, t)
            }
            _ => {
                let expected = "two to four axes, as in [z, y, x]";
                return Err(FormatError::field(file, "shape", format!("{shape:?}"), expected));
            }
        };
        let [z, y, x] = space;
        // Fortran order stores the first axis fastest: volumes and components change places.
        Ok(match header.fortran_order {
            false => Self { space: [x, y, z], components, volumes },
            true => Self { space: [z, y, x], components: volumes, volumes: components },
        })
    }
}

/// Type, byte order, and whether it is a 16-bit float that has to be widened.
fn voxel_type(file: &str, descr: &str) -> Result<(VoxelType, Endian, bool), FormatError> {
    let (order, name) = match descr.as_bytes().first() {
        Some(b'<' | b'>' | b'|' | b'=') => descr.split_at(1),
        _ => ("=", descr),
    };
    let endian = if order == ">" { Endian::Big } else { Endian::Little };
    let voxel_type = match name {
        "u1" | "B" | "b1" | "?" => VoxelType::Uint8,
        "i1" | "b" => VoxelType::Int8,
        "u2" => VoxelType::Uint16,
        "i2" => VoxelType::Int16,
        "u4" => VoxelType::Uint32,
        "i4" => VoxelType::Int32,
        "u8" => VoxelType::Uint64,
        "i8" => VoxelType::Int64,
        "f2" => return Ok((VoxelType::Float32, endian, true)),
        "f4" => VoxelType::Float32,
        "f8" => VoxelType::Float64,
        _ => {
            let what = match name.as_bytes().first() {
                Some(b'O') => "an array of Python objects (its data would be a program)".to_owned(),
                Some(b'c') => "an array of complex numbers".to_owned(),
                _ => format!("the array type {}", crate::error::quoted(descr)),
            };
            let help = "save the array as numbers, for example np.save('a.npy', a.astype('float32'))";
            return Err(FormatError::unsupported(file, what, help));
        }
    };
    Ok((voxel_type, endian, false))
}
