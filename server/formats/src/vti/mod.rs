//! VTK image data in XML, `.vti` (docs.vtk.org, "VTK XML formats"): one piece, values on points
//! or cells, as text, base64 or appended, plain or in blocks compressed with zlib or LZ4.

mod base64;
mod blocks;
mod header;

use std::io::{BufReader, Read};
use std::path::Path;

use proto::scene_file::Endian;

use crate::error::{FormatError, quoted};
use crate::orientation::Stored;
use crate::stream::{AsReader, Progress, Stream};
use crate::text::{TextKind, TextReader};
use crate::voxels::{Layout, check_axes, type_bytes};
use crate::{Format, Imported, ReadOptions};
use base64::Base64Reader;
use blocks::{Compressor, Integers};
use header::{Array, Header, Place};

pub(crate) use header::is_header;

/// Reads a VTI file; `index` counts components, then arrays, in file order.
pub(crate) fn read(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    let header = header::read(path, options)?;
    let mut notices = Vec::new();
    let (array, component, choices) = choose(&header, options, &mut notices)?;
    let Some(voxel_type) = array.voxel_type else {
        let expected = "a number type such as UInt8 or Float32";
        return Err(FormatError::field(&header.file, "DataArray type", &array.type_name, expected));
    };
    // Numbers in text have no byte order; the text reader hands them over as little-endian.
    let is_text = matches!(array.place, Some(Place::Text { .. }));
    let layout = Layout {
        voxel_type,
        endian: if is_big(&header)? && !is_text { Endian::Big } else { Endian::Little },
        dims: dims(&header, array, options)?,
        components: array.components,
        volumes: 1,
    };
    let one = ReadOptions { index: Some(component), ..*options };
    let size = layout.check(&header.file, &one, &mut notices)?;
    let stored = Stored {
        dims: layout.dims,
        spacing: numbers(&header.file, "Spacing", header.spacing.as_deref())?.unwrap_or([1.0; 3]),
        spacing_unit: None,
        slope: 1.0,
        intercept: 0.0,
        affine: None,
    };
    stored.check_spacing(&header.file, "Spacing")?;
    if header.direction.as_ref().is_some_and(|text| !is_identity(text)) {
        notices.push("the file's Direction is not applied: the axes stay as stored".to_owned());
    }
    if array.on_cells {
        notices.push("the values belong to cells: each cell becomes a voxel".to_owned());
    }
    let mut stream = open(path, &header, array, &layout, size.total_bytes)?;
    let voxels = layout.read(&size, &mut stream, options, &mut notices)?;
    Ok(Imported {
        volume: stored.into_volume(voxels, &mut notices),
        format: Format::Vti,
        file_type: voxel_type,
        choices,
        choice_names: Vec::new(),
        notices,
    })
}

/// The array and component that `index` stands for, or the one that the file marks to be shown,
/// and how many there are.
fn choose<'h>(
    header: &'h Header,
    options: &ReadOptions<'_>,
    notices: &mut Vec<String>,
) -> Result<(&'h Array, u32, u64), FormatError> {
    // Arrays of other types can be named, so that their refusal says why, but not counted.
    let readable: Vec<&Array> = header.arrays.iter().filter(|array| array.voxel_type.is_some()).collect();
    let Some(first) = readable.first().copied().or(header.arrays.first()) else {
        let expected = "an array of points or cells";
        return Err(FormatError::missing(&header.file, "DataArray", expected));
    };
    let choices = readable.iter().fold(0_u64, |sum, array| sum.saturating_add(array.components));
    let Some(index) = options.index else {
        let active = readable.iter().copied().find(|array| header.active.contains(&array.name));
        let chosen = active.unwrap_or(first);
        if choices > 1 {
            let before = readable.iter().take_while(|array| !std::ptr::eq(**array, chosen));
            let index = before.fold(0_u64, |sum, array| sum.saturating_add(array.components));
            let names: Vec<String> = readable.iter().take(8).map(|array| quoted(&array.name)).collect();
            notices.push(format!(
                "the file holds {choices} components of {} arrays ({}): index {index} of {choices} is \
                 shown, set `index` for another",
                readable.len(),
                names.join(", ")
            ));
        }
        return Ok((chosen, 0, choices));
    };
    let mut left = u64::from(index);
    for array in readable {
        if left < array.components {
            return Ok((array, left as u32, choices));
        }
        left -= array.components;
    }
    let expected = format!("a number below {choices}, the count of arrays and components");
    Err(FormatError::field(&header.file, "index", index, expected))
}

fn is_big(header: &Header) -> Result<bool, FormatError> {
    match header.byte_order.as_deref() {
        None | Some("LittleEndian") => Ok(false),
        Some("BigEndian") => Ok(true),
        Some(other) => {
            Err(FormatError::field(&header.file, "byte_order", other, "LittleEndian or BigEndian"))
        }
    }
}

fn dims(header: &Header, array: &Array, options: &ReadOptions<'_>) -> Result<[usize; 3], FormatError> {
    let text = header.whole_extent.as_deref().unwrap_or_default();
    let ends: Option<Vec<i128>> = text.split_whitespace().map(|n| n.parse().ok()).collect();
    let Some([x0, x1, y0, y1, z0, z1]) = ends.and_then(|ends| <[i128; 6]>::try_from(ends).ok()) else {
        let expected = "first and last index along x, y and z";
        return Err(FormatError::field(&header.file, "WholeExtent", text, expected));
    };
    let count = |first: i128, last: i128| {
        let cells = last.saturating_sub(first);
        // A flat image has one layer of cells.
        if array.on_cells && cells != 0 { cells } else { cells.saturating_add(1) }
    };
    let sizes = [count(x0, x1), count(y0, y1), count(z0, z1)];
    check_axes(&header.file, "WholeExtent", sizes, &options.limits)
}

fn numbers<const N: usize>(
    file: &str,
    field: &str,
    text: Option<&str>,
) -> Result<Option<[f64; N]>, FormatError> {
    let Some(text) = text else { return Ok(None) };
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(|n| n.parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
    numbers.map(Some).ok_or_else(|| FormatError::field(file, field, text, format!("{N} numbers")))
}

fn is_identity(text: &str) -> bool {
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    text.split_whitespace().map(|n| n.parse().unwrap_or(f64::NAN)).eq(identity)
}

/// Opens the voxels of an array, which must be `bytes`.
fn open<'a>(
    path: &Path,
    header: &Header,
    array: &Array,
    layout: &Layout,
    bytes: u64,
) -> Result<Stream<'a>, FormatError> {
    let file = header.file.clone();
    let mut stream = Stream::open(path)?;
    let skip_to = |stream: &mut Stream<'a>, start: u64| stream.skip(start, &mut Progress::new(&|_| {}, 1));
    let (is_base64, length) = match array.place {
        None => {
            let expected = "the voxels between <DataArray> and </DataArray>";
            return Err(FormatError::missing(&file, "DataArray", expected));
        }
        Some(Place::Text { start, length }) => {
            skip_to(&mut stream, start)?;
            let at_most = (length / 2 + 1).saturating_mul(type_bytes(layout.voxel_type));
            let text = BufReader::new(AsReader(stream).take(length));
            let reader = TextReader::new(text, TextKind::Numbers(layout.voxel_type));
            let stream = Stream::decoded(file, Box::new(reader), at_most);
            stream.require(bytes)?;
            return Ok(stream);
        }
        Some(Place::Inline { start, length }) => {
            skip_to(&mut stream, start)?;
            (true, length)
        }
        Some(Place::Appended { offset }) => {
            let Some(appended) = header.appended else {
                return Err(FormatError::missing(&file, "AppendedData", "the data that the arrays refer to"));
            };
            let start = appended.start.saturating_add(offset);
            skip_to(&mut stream, start)?;
            (appended.is_base64, stream.at_most())
        }
    };
    let compressor = match header.compressor.as_deref() {
        None | Some("") => None,
        Some("vtkZLibDataCompressor") => Some(Compressor::Zlib),
        Some("vtkLZ4DataCompressor") => Some(Compressor::Lz4),
        Some(other) => {
            return Err(FormatError::unsupported(
                &file,
                format!("the compressor {}", quoted(other)),
                "write the file with zlib, VTK's default",
            ));
        }
    };
    let is_wide = match header.header_type.as_deref() {
        None | Some("UInt32") => false,
        Some("UInt64") => true,
        Some(other) => {
            return Err(FormatError::field(&file, "header_type", other, "UInt32 or UInt64"));
        }
    };
    if compressor.is_none() {
        stream.require(bytes)?;
    }
    let text = AsReader(stream).take(length);
    let source: Box<dyn Read> = match is_base64 {
        // Appended texts end at the next array or tag, which only the last read may reach.
        true => Box::new(Base64Reader::new(text)),
        false => Box::new(text),
    };
    let integers = Integers { is_wide, is_big: layout.endian == Endian::Big };
    let voxels = blocks::open(&file, source, integers, compressor, bytes)?;
    Ok(Stream::decoded(file, voxels, bytes))
}
