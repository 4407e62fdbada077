//! NRRD, versions 1 to 5 (teem.sourceforge.net/nrrd/format.html): attached and detached headers,
//! encodings raw, gzip, ascii and hex. The bzip2 encoding is refused.

mod data;
mod geometry;
mod header;
pub(crate) mod write;

use std::path::Path;

use proto::scene_file::{Endian, VoxelType};

use crate::error::FormatError;
use crate::voxels::{Layout, type_bytes};
use crate::{Format, Imported, ReadOptions};
use header::Header;

/// What every NRRD file starts with; a version digit follows.
pub(crate) const MAGIC: &[u8] = b"NRRD000";

/// How the voxels are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Raw,
    Gzip,
    Ascii,
    Hex,
}

/// Reads an NRRD file; the header's data may lie in other files.
pub(crate) fn read(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    let (header, rest) = header::read(path, options)?;
    let mut notices = header.notices.clone();
    let voxel_type = voxel_type(&header)?;
    let encoding = encoding(&header)?;
    let endian = endian(&header, voxel_type, encoding)?;
    let axes = geometry::axes(&header, options, &mut notices)?;
    let layout = Layout {
        voxel_type,
        endian,
        dims: axes.stored.dims,
        components: axes.components,
        volumes: axes.volumes,
    };
    let size = layout.check(&header.file, options, &mut notices)?;
    let source = data::Source { path, header: &header, encoding, voxel_type, options };
    let mut stream = source.open(rest, size.total_bytes)?;
    let voxels = layout.read(&size, &mut stream, options, &mut notices)?;
    Ok(Imported {
        volume: axes.stored.into_volume(voxels, &mut notices),
        format: Format::Nrrd,
        file_type: voxel_type,
        choices: layout.choices(),
        choice_names: Vec::new(),
        notices,
    })
}

fn voxel_type(header: &Header) -> Result<VoxelType, FormatError> {
    let name = header.required("type", "the type of a voxel, for example uint8")?;
    Ok(match name.to_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => VoxelType::Int8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => VoxelType::Uint8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => VoxelType::Int16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => VoxelType::Uint16,
        "int" | "signed int" | "int32" | "int32_t" => VoxelType::Int32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => VoxelType::Uint32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => VoxelType::Int64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            VoxelType::Uint64
        }
        "float" => VoxelType::Float32,
        "double" => VoxelType::Float64,
        "block" => {
            return Err(FormatError::unsupported(
                &header.file,
                "the type block (bytes without meaning)",
                "give the voxels a number type",
            ));
        }
        _ => {
            let expected = "int8, uint8, int16, uint16, int32, uint32, int64, uint64, float or \
                            double, or one of their C names";
            return Err(FormatError::field(&header.file, "type", name, expected));
        }
    })
}

fn encoding(header: &Header) -> Result<Encoding, FormatError> {
    let name = header.required("encoding", "raw, gzip, ascii or hex")?;
    match name.to_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gz" | "gzip" => Ok(Encoding::Gzip),
        "txt" | "text" | "ascii" => Ok(Encoding::Ascii),
        "hex" => Ok(Encoding::Hex),
        "bz2" | "bzip2" => Err(FormatError::unsupported(
            &header.file,
            "the encoding bzip2",
            "write the file with gzip, for example `unu save -f nrrd -e gzip -i in.nrrd -o out.nrrd`",
        )),
        _ => Err(FormatError::field(&header.file, "encoding", name, "raw, gzip, ascii or hex")),
    }
}

fn endian(header: &Header, voxel_type: VoxelType, encoding: Encoding) -> Result<Endian, FormatError> {
    let expected = "little or big, needed for voxels of more than one byte";
    match header.get("endian").map(str::to_lowercase).as_deref() {
        // Numbers in text have no byte order; the text reader hands them over as little-endian.
        _ if encoding == Encoding::Ascii => Ok(Endian::Little),
        Some("little") => Ok(Endian::Little),
        Some("big") => Ok(Endian::Big),
        Some(other) => Err(FormatError::field(&header.file, "endian", other, expected)),
        None if type_bytes(voxel_type) == 1 => Ok(Endian::Little),
        None => Err(FormatError::missing(&header.file, "endian", expected)),
    }
}
