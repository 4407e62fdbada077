//! MetaImage (`.mha`, or `.mhd` with data files), by the documentation of MetaIO
//! (itk.org/Wiki/ITK/MetaIO/Documentation): binary or text, plain or zlib, one data file, a list
//! or a pattern. Directions are in LPS, as in ITK.

mod header;

use std::path::Path;

use proto::scene_file::{Endian, VoxelType};

use crate::detached;
use crate::error::FormatError;
use crate::orientation::{Affine, Stored, Vec3, cross, norm};
use crate::stream::{Progress, Stream};
use crate::text::{TextKind, TextReader};
use crate::voxels::{Layout, check_axes, type_bytes};
use crate::{Format, Imported, ReadOptions};
use header::{Header, is_list};

/// What messages call the field that names the data files.
const FIELD: &str = "ElementDataFile";
/// Most axes: space and volumes.
const MAX_DIMENSION: i64 = 4;

/// Whether a file starts like a MetaImage header: with the field that comes first by convention.
pub(crate) fn is_header(start: &[u8]) -> bool {
    [&b"ObjectType"[..], b"NDims"].iter().any(|key| {
        let after = start.strip_prefix(*key).unwrap_or_default();
        after.trim_ascii_start().starts_with(b"=")
    })
}

/// Reads a MetaImage file; the header's data may lie in other files.
pub(crate) fn read(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    let (header, rest) = header::read(path, options)?;
    let mut notices = header.notices.clone();
    if let Some(kind) = header.get("ObjectType").filter(|kind| *kind != "Image") {
        return Err(FormatError::field(&header.file, "ObjectType", kind, "Image"));
    }
    let voxel_type = voxel_type(&header)?;
    let is_text = !header.flag(&["BinaryData"], true)?;
    let is_big = header.flag(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"], false)?;
    let dimension = header.count("NDims", 2)?.unwrap_or(3);
    if dimension > MAX_DIMENSION {
        let expected = format!("a number of axes from 2 to {MAX_DIMENSION}");
        return Err(FormatError::field(&header.file, "NDims", dimension, expected));
    }
    let dimension = dimension as usize;
    let text = header.required("DimSize", "the length of each axis")?;
    let sizes: Option<Vec<i128>> = text.split_whitespace().map(|n| n.parse().ok()).collect();
    let sizes = sizes.filter(|sizes| sizes.len() == dimension).ok_or_else(|| {
        let expected = format!("{dimension} whole numbers, one per axis");
        FormatError::field(&header.file, "DimSize", text, expected)
    })?;
    let of_space = [0, 1, 2].map(|axis| sizes.get(axis).copied().unwrap_or(1));
    let dims = check_axes(&header.file, "DimSize", of_space, &options.limits)?;
    let volumes = sizes.get(3).copied().unwrap_or(1);
    let volumes = u64::try_from(volumes)
        .ok()
        .filter(|n| *n >= 1)
        .ok_or_else(|| FormatError::field(&header.file, "DimSize", text, "axes of at least 1"))?;
    if dimension == 2 {
        notices.push("the image is flat: it becomes one slice".to_owned());
    }

    let layout = Layout {
        voxel_type,
        // Numbers in text have no byte order; the text reader hands them over as little-endian.
        endian: if is_big && !is_text { Endian::Big } else { Endian::Little },
        dims,
        components: header.count("ElementNumberOfChannels", 1)?.unwrap_or(1).unsigned_abs(),
        volumes,
    };
    let size = layout.check(&header.file, options, &mut notices)?;
    let stored = place(&header, dims, dimension, &mut notices)?;
    stored.check_spacing(&header.file, "ElementSpacing")?;
    let source = Source { path, header: &header, is_text, voxel_type, options };
    let mut stream = source.open(rest, size.total_bytes)?;
    let voxels = layout.read(&size, &mut stream, options, &mut notices)?;
    Ok(Imported {
        volume: stored.into_volume(voxels, &mut notices),
        format: Format::MetaImage,
        file_type: voxel_type,
        choices: layout.choices(),
        choice_names: Vec::new(),
        notices,
    })
}

fn voxel_type(header: &Header) -> Result<VoxelType, FormatError> {
    let expected = "MET_CHAR, MET_UCHAR, MET_SHORT, MET_USHORT, MET_INT, MET_UINT, MET_LONG, \
                    MET_ULONG, MET_LONG_LONG, MET_ULONG_LONG, MET_FLOAT or MET_DOUBLE";
    let name = header.required("ElementType", expected)?;
    Ok(match name.strip_suffix("_ARRAY").unwrap_or(name) {
        "MET_CHAR" | "MET_ASCII_CHAR" => VoxelType::Int8,
        "MET_UCHAR" => VoxelType::Uint8,
        "MET_SHORT" => VoxelType::Int16,
        "MET_USHORT" => VoxelType::Uint16,
        // A long has four bytes in MetaIO on every system.
        "MET_INT" | "MET_LONG" => VoxelType::Int32,
        "MET_UINT" | "MET_ULONG" => VoxelType::Uint32,
        "MET_LONG_LONG" => VoxelType::Int64,
        "MET_ULONG_LONG" => VoxelType::Uint64,
        "MET_FLOAT" => VoxelType::Float32,
        "MET_DOUBLE" => VoxelType::Float64,
        _ => return Err(FormatError::field(&header.file, "ElementType", name, expected)),
    })
}

/// Spacing, data values and place in patient space.
fn place(
    header: &Header,
    dims: [usize; 3],
    dimension: usize,
    notices: &mut Vec<String>,
) -> Result<Stored, FormatError> {
    let spatial = dimension.min(3);
    let mut spacing = [1.0; 3];
    match header.numbers(&["ElementSpacing", "ElementSize"], dimension)? {
        Some(steps) => {
            for (spacing, step) in spacing.iter_mut().zip(&steps[..spatial]) {
                *spacing = step.abs();
            }
            if steps.iter().any(|step| *step < 0.0) {
                notices.push("negative spacings: their size is taken, the axes stay as stored".to_owned());
            }
        }
        None => notices.push("the file gives no spacing: 1 is taken along every axis".to_owned()),
    }
    let matrix_keys = ["TransformMatrix", "Rotation", "Orientation"];
    let matrix = header.numbers(&matrix_keys, dimension * dimension)?;
    let origin = header.numbers(&["Offset", "Position", "Origin"], dimension)?.unwrap_or_default();
    let anatomical = header.get("AnatomicalOrientation");
    let directions = match matrix {
        Some(matrix) => {
            // Row by row the directions of the axes.
            let mut directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            for (axis, direction) in directions.iter_mut().enumerate().take(spatial) {
                *direction = [0.0; 3];
                direction[..spatial].copy_from_slice(&matrix[axis * dimension..axis * dimension + spatial]);
            }
            if spatial == 2 {
                let normal = cross(directions[0], directions[1]);
                directions[2] = normal.map(|c| c / norm(normal));
            }
            let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let says_nothing = directions == identity && anatomical.is_some_and(|name| name.contains('?'));
            (!says_nothing).then_some(directions)
        }
        None => anatomical.and_then(letters),
    };
    let affine = directions
        .map(|directions| {
            let mut first = [0.0; 3];
            for (first, origin) in first.iter_mut().zip(origin.iter().take(spatial)) {
                *first = *origin;
            }
            unit_columns(directions, spacing, first).ok_or_else(|| {
                let (key, text) = header.first_of(&matrix_keys).unwrap_or_default();
                let expected = "directions that span space, and a usable spacing";
                FormatError::field(&header.file, key, text, expected)
            })
        })
        .transpose()?;
    let scale = |key: &str, default: f64| -> Result<f64, FormatError> {
        Ok(header.numbers(&[key], 1)?.and_then(|numbers| numbers.first().copied()).unwrap_or(default))
    };
    let (mut slope, mut intercept) =
        (scale("ElementToIntensityFunctionSlope", 1.0)?, scale("ElementToIntensityFunctionOffset", 0.0)?);
    if slope == 0.0 || slope.abs().max(intercept.abs()) > f64::from(f32::MAX).sqrt() {
        notices.push(format!("the slope {slope} and offset {intercept} cannot be used: values as stored"));
        (slope, intercept) = (1.0, 0.0);
    }
    let spacing_unit = header
        .get("DistanceUnits")
        .filter(|unit| matches!(*unit, "mm" | "cm" | "m" | "um"))
        .map(str::to_owned);
    Ok(Stored { dims, spacing, spacing_unit, slope, intercept, affine })
}

/// Steps along the axes; ITK's directions are unit vectors, others are brought to that length.
fn unit_columns(directions: [Vec3; 3], spacing: Vec3, origin: Vec3) -> Option<Affine> {
    let column = |axis: usize| {
        let length = norm(directions[axis]);
        directions[axis].map(|c| c / length * spacing[axis])
    };
    let mut affine = Affine::from_columns([column(0), column(1), column(2)], origin)?;
    affine.spacing = spacing;
    Some(affine)
}

/// Directions from letters that say which side each axis starts from: `RAI` is LPS. `None` for
/// anything else.
fn letters(name: &str) -> Option<[Vec3; 3]> {
    let mut directions = [[0.0; 3]; 3];
    let mut seen = [false; 3];
    let bytes: &[u8; 3] = name.as_bytes().try_into().ok()?;
    for (direction, letter) in directions.iter_mut().zip(bytes) {
        let (axis, sign) = match letter {
            b'R' => (0, 1.0),
            b'L' => (0, -1.0),
            b'A' => (1, 1.0),
            b'P' => (1, -1.0),
            b'I' => (2, 1.0),
            b'S' => (2, -1.0),
            _ => return None,
        };
        if std::mem::replace(&mut seen[axis], true) {
            return None;
        }
        direction[axis] = sign;
    }
    Some(directions)
}

/// Everything needed to open the data of a header.
struct Source<'a> {
    path: &'a Path,
    header: &'a Header,
    is_text: bool,
    voxel_type: VoxelType,
    options: &'a ReadOptions<'a>,
}

impl<'a> Source<'a> {
    /// Opens the data as one stream of `total_bytes`, of which it is certain that they can come.
    fn open(self, attached: Stream<'a>, total_bytes: u64) -> Result<Stream<'a>, FormatError> {
        let file = &self.header.file;
        let expected = "LOCAL, LIST, a pattern or the name of a file";
        let value = self.header.required(FIELD, expected)?;
        if matches!(value, "LOCAL" | "Local" | "local") {
            return self.decode(attached, total_bytes);
        }
        let names = match is_list(value) {
            true => {
                detached::check_count(file, self.header.listed_files.len() as i128)?;
                self.header.listed_files.clone()
            }
            false => detached::listed_by_pattern(file, FIELD, value)?,
        };
        let (path, options) = (self.path, self.options);
        let decode = move |stream, bytes| self.decode(stream, bytes);
        detached::open_all(path, FIELD, &names, total_bytes, options, decode)
    }

    /// Applies the skip and the encoding to one file, and makes sure that it can hold the bytes.
    fn decode(&self, mut stream: Stream<'a>, bytes: u64) -> Result<Stream<'a>, FormatError> {
        let compressed = self.header.flag(&["CompressedData"], false)?;
        match self.header.count("HeaderSize", -1)?.unwrap_or(0) {
            -1 if compressed || self.is_text => {
                let expected = "-1 with plain binary data only";
                return Err(FormatError::field(&self.header.file, "HeaderSize", -1, expected));
            }
            // The voxels are the last bytes of the file.
            -1 => {
                stream.require(bytes)?;
                let before = stream.at_most() - bytes;
                stream.skip(before, &mut Progress::new(&|_| {}, 1))?;
            }
            skip => stream.skip(skip.unsigned_abs(), &mut Progress::new(&|_| {}, 1))?,
        }
        if compressed {
            stream = stream.into_zlib()?;
        } else if self.is_text {
            let kind = TextKind::Numbers(self.voxel_type);
            stream = stream.into_text(|reader| TextReader::new(reader, kind), type_bytes(self.voxel_type))?;
        }
        stream.require(bytes)?;
        Ok(stream)
    }
}
