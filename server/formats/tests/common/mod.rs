//! Files that the tests write themselves, and where the shared test data are.
#![allow(dead_code, clippy::unwrap_used)]

use std::io::Write;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use formats::{FormatError, Imported, ReadOptions};
use proto::scene_file::{Endian, VoxelType};

/// All voxel types with their sizes in bytes, NRRD names and NIfTI codes.
pub const TYPES: [(VoxelType, usize, &str, i16); 10] = [
    (VoxelType::Uint8, 1, "uint8", 2),
    (VoxelType::Int8, 1, "signed char", 256),
    (VoxelType::Uint16, 2, "unsigned short", 512),
    (VoxelType::Int16, 2, "short", 4),
    (VoxelType::Uint32, 4, "uint", 768),
    (VoxelType::Int32, 4, "int32_t", 8),
    (VoxelType::Uint64, 8, "ulonglong", 1280),
    (VoxelType::Int64, 8, "long long int", 1024),
    (VoxelType::Float32, 4, "float", 16),
    (VoxelType::Float64, 8, "double", 64),
];

pub const ENDIANS: [Endian; 2] = [Endian::Little, Endian::Big];

/// Dims of the small test volume, all different.
pub const DIMS: [usize; 3] = [5, 4, 3];

/// Values no two neighbours share, that show swapped bytes, and that every type holds exactly.
pub fn values(voxel_type: VoxelType, count: usize) -> Vec<f64> {
    let is_byte = matches!(voxel_type, VoxelType::Uint8 | VoxelType::Int8);
    let is_signed =
        !matches!(voxel_type, VoxelType::Uint8 | VoxelType::Uint16 | VoxelType::Uint32 | VoxelType::Uint64);
    let is_float = matches!(voxel_type, VoxelType::Float32 | VoxelType::Float64);
    (0..count)
        .map(|i| {
            let value = if is_byte { (7 * i + 3) % 120 } else { 37 * i + 3 } as f64;
            value - if is_signed { 50.0 } else { 0.0 } + if is_float { 0.25 } else { 0.0 }
        })
        .collect()
}

/// Values as the bytes of a type.
pub fn encode(values: &[f64], voxel_type: VoxelType, endian: Endian) -> Vec<u8> {
    let mut bytes = Vec::new();
    macro_rules! push {
        ($type:ty) => {
            for value in values {
                let value = *value as $type;
                match endian {
                    Endian::Little => bytes.extend(value.to_le_bytes()),
                    Endian::Big => bytes.extend(value.to_be_bytes()),
                }
            }
        };
    }
    match voxel_type {
        VoxelType::Uint8 => push!(u8),
        VoxelType::Int8 => push!(i8),
        VoxelType::Uint16 => push!(u16),
        VoxelType::Int16 => push!(i16),
        VoxelType::Uint32 => push!(u32),
        VoxelType::Int32 => push!(i32),
        VoxelType::Uint64 => push!(u64),
        VoxelType::Int64 => push!(i64),
        VoxelType::Float32 => push!(f32),
        VoxelType::Float64 => push!(f64),
    }
    bytes
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Writes a file from pieces and returns its path.
pub fn write(folder: &Path, name: &str, pieces: &[&[u8]]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, pieces.concat()).unwrap();
    path
}

pub fn read(path: &Path) -> Result<Imported, FormatError> {
    formats::read_volume(path, &ReadOptions::default())
}

pub fn read_index(path: &Path, index: u32) -> Result<Imported, FormatError> {
    formats::read_volume(path, &ReadOptions { index: Some(index), ..ReadOptions::default() })
}

/// All data values in memory order.
pub fn data(imported: &Imported) -> Vec<f64> {
    let volume = &imported.volume;
    (0..volume.voxels.len())
        .map(|i| volume.slope * f64::from(volume.voxels.stored(i)) + volume.intercept)
        .collect()
}

/// The message of a refusal; it must name the file and every given piece.
pub fn refused(result: Result<Imported, FormatError>, file: &str, pieces: &[&str]) {
    let message = match result {
        Ok(imported) => panic!("{file} was accepted: {}", formats::describe(&imported)),
        Err(error) => error.to_string(),
    };
    for piece in [&[file], pieces].concat() {
        assert!(message.contains(piece), "no {piece:?} in: {message}");
    }
}

pub fn noticed(imported: &Imported, piece: &str) {
    let found = imported.notices.iter().any(|notice| notice.contains(piece));
    assert!(found, "no {piece:?} in {:?}", imported.notices);
}

/// The shared test data, or `None` after saying what is left out.
pub fn shared_data(left_out: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("TYNDALL_TEST_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("LEFT OUT, no test data at {}: {left_out}", folder.display());
    None
}

/// An attached NRRD header of [`DIMS`] up to and including the given lines.
pub fn nrrd_header(type_name: &str, endian: Endian, encoding: &str, more: &str) -> String {
    let endian = if endian == Endian::Big { "big" } else { "little" };
    let [x, y, z] = DIMS;
    format!(
        "NRRD0004\n# a comment: with a colon\ntype: {type_name}\ndimension: 3\n\
         sizes: {x} {y} {z}\nkey: with colon:=ignored\nkey:=ignored\nendian: {endian}\n\
         encoding: {encoding}\n{more}"
    )
}

/// The same for bytes.
pub fn u8_header(encoding: &str, more: &str) -> String {
    nrrd_header("uint8", Endian::Little, encoding, more)
}

/// [`values`] of [`DIMS`] as bytes.
pub fn u8_voxels() -> Vec<u8> {
    encode(&values(VoxelType::Uint8, 60), VoxelType::Uint8, Endian::Little)
}

/// A NIfTI file to be written, fields as in the standard.
#[derive(Clone)]
pub struct NiftiFile {
    pub version: u8,
    pub endian: Endian,
    pub is_pair: bool,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub pixdim: [f64; 8],
    pub vox_offset: Option<f64>,
    pub slope: f64,
    pub inter: f64,
    pub units: u8,
    pub qform_code: i16,
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub sform_code: i16,
    pub srow: [[f64; 4]; 3],
    pub intent_code: i16,
    /// Behind the header, the four extender bytes included.
    pub extensions: Vec<u8>,
}

impl NiftiFile {
    pub fn new(datatype: i16, dims: &[usize]) -> Self {
        let mut dim = [1; 8];
        dim[0] = dims.len() as i64;
        for (axis, size) in dims.iter().enumerate() {
            dim[axis + 1] = *size as i64;
        }
        Self {
            version: 1,
            endian: Endian::Little,
            is_pair: false,
            dim,
            datatype,
            pixdim: [1.0; 8],
            vox_offset: None,
            slope: 0.0,
            inter: 0.0,
            units: 2,
            qform_code: 0,
            quatern: [0.0; 3],
            qoffset: [0.0; 3],
            sform_code: 0,
            srow: [[0.0; 4]; 3],
            intent_code: 0,
            extensions: vec![0; 4],
        }
    }

    /// Header and extensions.
    pub fn header(&self) -> Vec<u8> {
        let is_first = self.version == 1;
        let size = if is_first { 348 } else { 540 };
        let mut bytes = vec![0; size];
        let big = self.endian == Endian::Big;
        let mut put = |at: usize, value: &[u8]| {
            bytes[at..at + value.len()].copy_from_slice(value);
            if big {
                bytes[at..at + value.len()].reverse();
            }
        };
        let after_header = if self.is_pair { 0 } else { size + self.extensions.len() };
        let vox_offset = self.vox_offset.unwrap_or(after_header as f64);
        put(0, &(size as i32).to_le_bytes());
        if is_first {
            for axis in 0..8 {
                put(40 + 2 * axis, &(self.dim[axis] as i16).to_le_bytes());
                put(76 + 4 * axis, &(self.pixdim[axis] as f32).to_le_bytes());
            }
            put(70, &self.datatype.to_le_bytes());
            put(108, &(vox_offset as f32).to_le_bytes());
            put(112, &(self.slope as f32).to_le_bytes());
            put(116, &(self.inter as f32).to_le_bytes());
            put(123, &[self.units]);
            put(252, &self.qform_code.to_le_bytes());
            put(254, &self.sform_code.to_le_bytes());
            put(68, &self.intent_code.to_le_bytes());
            for k in 0..3 {
                put(256 + 4 * k, &(self.quatern[k] as f32).to_le_bytes());
                put(268 + 4 * k, &(self.qoffset[k] as f32).to_le_bytes());
                for j in 0..4 {
                    put(280 + 16 * k + 4 * j, &(self.srow[k][j] as f32).to_le_bytes());
                }
            }
        } else {
            for axis in 0..8 {
                put(16 + 8 * axis, &self.dim[axis].to_le_bytes());
                put(104 + 8 * axis, &self.pixdim[axis].to_le_bytes());
            }
            put(12, &self.datatype.to_le_bytes());
            put(168, &(vox_offset as i64).to_le_bytes());
            put(176, &self.slope.to_le_bytes());
            put(184, &self.inter.to_le_bytes());
            put(500, &i32::from(self.units).to_le_bytes());
            put(344, &i32::from(self.qform_code).to_le_bytes());
            put(348, &i32::from(self.sform_code).to_le_bytes());
            put(504, &i32::from(self.intent_code).to_le_bytes());
            for k in 0..3 {
                put(352 + 8 * k, &self.quatern[k].to_le_bytes());
                put(376 + 8 * k, &self.qoffset[k].to_le_bytes());
                for j in 0..4 {
                    put(400 + 32 * k + 8 * j, &self.srow[k][j].to_le_bytes());
                }
            }
        }
        let magic: &[u8] = match (is_first, self.is_pair) {
            (true, false) => b"n+1\0",
            (true, true) => b"ni1\0",
            (false, false) => b"n+2\0\r\n\x1a\n",
            (false, true) => b"ni2\0\r\n\x1a\n",
        };
        let at = if is_first { 344 } else { 4 };
        bytes[at..at + magic.len()].copy_from_slice(magic);
        bytes.extend(&self.extensions);
        bytes
    }

    /// The whole single file.
    pub fn bytes(&self, voxels: &[u8]) -> Vec<u8> {
        [self.header(), voxels.to_vec()].concat()
    }
}

/// A DICOM file to be written: Explicit VR Little Endian, 16-bit signed.
#[derive(Clone)]
pub struct DicomFile {
    pub elements: std::collections::BTreeMap<u32, (&'static str, Vec<u8>)>,
    pub pixels: Vec<i16>,
}

impl DicomFile {
    /// An axial slice of 4 x 3 pixels, 0.5 and 0.75 mm apart, at a height.
    pub fn slice(series: &str, instance: i32, z: f64, first: i16) -> Self {
        let mut file = Self { elements: Default::default(), pixels: (0..12).map(|i| first + i).collect() };
        for (tag, representation, value) in [
            (0x0008_0060, "CS", "CT".to_owned()),
            (0x0008_103E, "LO", format!("series {series}")),
            (0x0010_0010, "PN", "DOE^JANE".to_owned()),
            (0x0010_0020, "LO", "PATIENT-4711".to_owned()),
            (0x0020_000E, "UI", format!("1.2.3.{series}")),
            (0x0020_0013, "IS", instance.to_string()),
            (0x0020_0032, "DS", format!("-10\\-20\\{z}")),
            (0x0020_0037, "DS", "1\\0\\0\\0\\1\\0".to_owned()),
            (0x0028_0004, "CS", "MONOCHROME2".to_owned()),
            (0x0028_0030, "DS", "0.75\\0.5".to_owned()),
            (0x0028_1052, "DS", "-1000".to_owned()),
            (0x0028_1053, "DS", "1".to_owned()),
        ] {
            file.text(tag, representation, &value);
        }
        for (tag, value) in [
            (0x0028_0002, 1),
            (0x0028_0010, 3),
            (0x0028_0011, 4),
            (0x0028_0100, 16),
            (0x0028_0101, 16),
            (0x0028_0102, 15),
            (0x0028_0103, 1),
        ] {
            file.number(tag, value);
        }
        file
    }

    pub fn text(&mut self, tag: u32, representation: &'static str, value: &str) {
        self.elements.insert(tag, (representation, value.as_bytes().to_vec()));
    }

    pub fn number(&mut self, tag: u32, value: u16) {
        self.elements.insert(tag, ("US", value.to_le_bytes().to_vec()));
    }

    pub fn bytes(&self) -> Vec<u8> {
        fn element(out: &mut Vec<u8>, tag: u32, representation: &str, mut value: Vec<u8>) {
            if value.len() % 2 == 1 {
                value.push(if representation == "UI" { 0 } else { b' ' });
            }
            out.extend(((tag >> 16) as u16).to_le_bytes());
            out.extend((tag as u16).to_le_bytes());
            out.extend(representation.as_bytes());
            if representation == "OW" {
                out.extend([0, 0]);
                out.extend((value.len() as u32).to_le_bytes());
            } else {
                out.extend((value.len() as u16).to_le_bytes());
            }
            out.extend(value);
        }
        let mut meta = Vec::new();
        element(&mut meta, 0x0002_0010, "UI", b"1.2.840.10008.1.2.1".to_vec());
        let mut out = vec![0; 128];
        out.extend(b"DICM");
        element(&mut out, 0x0002_0000, "UL", (meta.len() as u32).to_le_bytes().to_vec());
        out.extend(meta);
        for (tag, (representation, value)) in &self.elements {
            element(&mut out, *tag, representation, value.clone());
        }
        let pixels = self.pixels.iter().flat_map(|value| value.to_le_bytes()).collect();
        element(&mut out, 0x7FE0_0010, "OW", pixels);
        out
    }
}

/// NRRD fields of two volumes of 5 x 4 x 3 floats; encoding and data follow.
pub const NRRD_TEXT: &str = "NRRD0005\ntype: float\ndimension: 4\nspace: RAS\nsizes: 2 5 4 3\n\
    space directions: none (1,0,0) (0,0,-2) (0,1,0)\nspace origin: (1,2,3)\nendian: big\n\
    kinds: list domain domain domain\nbyte skip: 0\nline skip: 0\n";

/// MetaImage keys of two volumes of 5 x 4 x 3 floats; the data file follows.
pub const METAIMAGE_TEXT: &str = "ObjectType = Image\nNDims = 4\nDimSize = 5 4 3 2\n\
    BinaryDataByteOrderMSB = True\nElementType = MET_FLOAT\nElementSpacing = 1 2 3 4\n\
    TransformMatrix = 0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1\nOffset = 1 2 3 4\n";

/// A Zarr 2 array of one chunk, 2 x 3 x 4.
pub const ZARRAY: &str = "{\"zarr_format\": 2, \"shape\": [2, 3, 4], \"chunks\": [2, 3, 4], \
    \"dtype\": \"<u2\", \"compressor\": {\"id\": \"blosc\"}, \"fill_value\": 0, \"order\": \"C\", \
    \"filters\": null}";

/// A Zarr 3 array of one chunk, 2 x 3 x 4, in a shard of its own.
pub const ZARR_JSON: &str = "{\"zarr_format\": 3, \"node_type\": \"array\", \"shape\": [2, 3, 4], \
    \"data_type\": \"uint16\", \"chunk_grid\": {\"name\": \"regular\", \"configuration\": \
    {\"chunk_shape\": [2, 3, 4]}}, \"chunk_key_encoding\": {\"name\": \"default\"}, \"codecs\": \
    [{\"name\": \"sharding_indexed\", \"configuration\": {\"chunk_shape\": [2, 3, 4], \"codecs\": \
    [{\"name\": \"bytes\"}, {\"name\": \"gzip\"}], \"index_codecs\": [{\"name\": \"bytes\"}]}}], \
    \"fill_value\": 0}";
