//! Metadata of one array: Zarr version 2 (`.zarray`) and 3 (`zarr.json`).

use proto::scene_file::{Endian, VoxelType};
use serde_json::Value;

use super::codec::Codec;
use crate::error::FormatError;
use crate::voxels::type_bytes;

/// Most axes of an array.
const MAX_AXES: usize = 8;
/// Most codecs of a chain.
const MAX_CODECS: usize = 8;

/// How the chunks of an array are stored.
#[derive(Debug, Clone)]
pub(super) struct Array {
    pub(super) shape: Vec<u64>,
    /// Shape of what is decoded at once: a chunk, or an inner chunk of a shard.
    pub(super) chunk: Vec<u64>,
    pub(super) voxel_type: VoxelType,
    pub(super) is_half: bool,
    pub(super) endian: Endian,
    /// Bytes of one value that is nowhere stored.
    pub(super) fill: Vec<u8>,
    /// Axes of a chunk from slowest to fastest.
    pub(super) order: Vec<usize>,
    pub(super) codecs: Vec<Codec>,
    pub(super) keys: Keys,
    pub(super) shard: Option<Shard>,
}

/// How chunks are named.
#[derive(Debug, Clone)]
pub(super) struct Keys {
    prefix: &'static str,
    separator: String,
}

/// A file of several inner chunks with a table of where they lie.
#[derive(Debug, Clone)]
pub(super) struct Shard {
    /// Inner chunks along each axis.
    pub(super) counts: Vec<u64>,
    pub(super) index_codecs: Vec<Codec>,
    pub(super) index_at_end: bool,
}

impl Keys {
    pub(super) fn key(&self, at: &[u64]) -> String {
        let numbers: Vec<String> = at.iter().map(u64::to_string).collect();
        let joined = numbers.join(&self.separator);
        if self.prefix.is_empty() { joined } else { format!("{}{}{joined}", self.prefix, self.separator) }
    }
}

impl Array {
    /// Bytes of one stored value.
    pub(super) fn value_bytes(&self) -> u64 {
        if self.is_half { 2 } else { type_bytes(self.voxel_type) }
    }

    pub(super) fn parse_v2(file: &str, path: &str, json: &Value) -> Result<Self, FormatError> {
        let field = Fields { file, path, json };
        if json["zarr_format"] != 2 {
            return Err(field.wrong("zarr_format", "2"));
        }
        let shape = field.sizes("shape")?;
        let chunk = field.sizes("chunks")?;
        field.same_rank(&shape, &chunk, "chunks")?;
        let name = json["dtype"].as_str().ok_or_else(|| field.wrong("dtype", "a number type, like <u2"))?;
        let endian = if name.starts_with('>') { Endian::Big } else { Endian::Little };
        let (voxel_type, is_half) = match name.trim_start_matches(['<', '>', '|', '=']) {
            "u1" | "b1" => (VoxelType::Uint8, false),
            "i1" => (VoxelType::Int8, false),
            "u2" => (VoxelType::Uint16, false),
            "i2" => (VoxelType::Int16, false),
            "u4" => (VoxelType::Uint32, false),
            "i4" => (VoxelType::Int32, false),
            "u8" => (VoxelType::Uint64, false),
            "i8" => (VoxelType::Int64, false),
            "f2" => (VoxelType::Float32, true),
            "f4" => (VoxelType::Float32, false),
            "f8" => (VoxelType::Float64, false),
            _ => return Err(field.wrong("dtype", "a number type, like <u2")),
        };
        let no_filters = match &json["filters"] {
            Value::Null => true,
            Value::Array(filters) => filters.is_empty(),
            _ => false,
        };
        if !no_filters {
            return Err(field.wrong("filters", "none"));
        }
        let codecs = match &json["compressor"] {
            Value::Null => Vec::new(),
            compressor => vec![match compressor["id"].as_str() {
                Some("blosc") => Codec::Blosc,
                Some("gzip") => Codec::Gzip,
                Some("zlib") => Codec::Zlib,
                Some("zstd") => Codec::Zstd,
                Some("lz4") => Codec::SizedLz4,
                _ => return Err(field.wrong("compressor", "blosc, gzip, zlib, zstd, lz4 or none")),
            }],
        };
        let mut order: Vec<usize> = (0..shape.len()).collect();
        match json["order"].as_str() {
            None | Some("C") => {}
            Some("F") => order.reverse(),
            _ => return Err(field.wrong("order", "C or F")),
        }
        let separator = match &json["dimension_separator"] {
            Value::Null => ".",
            Value::String(text) if text == "." || text == "/" => text,
            _ => return Err(field.wrong("dimension_separator", ". or /")),
        };
        let keys = Keys { prefix: "", separator: separator.to_owned() };
        let fill = fill(&field, &json["fill_value"], voxel_type, is_half, endian)?;
        Ok(Self { shape, chunk, voxel_type, is_half, endian, fill, order, codecs, keys, shard: None })
    }

    pub(super) fn parse_v3(file: &str, path: &str, json: &Value) -> Result<Self, FormatError> {
        let field = Fields { file, path, json };
        if json["zarr_format"] != 3 || json["node_type"] != "array" {
            return Err(field.wrong("node_type", "array of zarr_format 3"));
        }
        let shape = field.sizes("shape")?;
        if json["chunk_grid"]["name"] != "regular" {
            return Err(field.wrong("chunk_grid", "regular"));
        }
        let outer = field.sizes_of(&json["chunk_grid"]["configuration"]["chunk_shape"], "chunk_shape")?;
        field.same_rank(&shape, &outer, "chunk_shape")?;
        let (voxel_type, is_half) = match json["data_type"].as_str() {
            Some("uint8" | "bool") => (VoxelType::Uint8, false),
            Some("int8") => (VoxelType::Int8, false),
            Some("uint16") => (VoxelType::Uint16, false),
            Some("int16") => (VoxelType::Int16, false),
            Some("uint32") => (VoxelType::Uint32, false),
            Some("int32") => (VoxelType::Int32, false),
            Some("uint64") => (VoxelType::Uint64, false),
            Some("int64") => (VoxelType::Int64, false),
            Some("float16") => (VoxelType::Float32, true),
            Some("float32") => (VoxelType::Float32, false),
            Some("float64") => (VoxelType::Float64, false),
            _ => return Err(field.wrong("data_type", "a number type, like uint16")),
        };
        let encoding = &json["chunk_key_encoding"];
        let separator = &encoding["configuration"]["separator"];
        let keys = match (encoding["name"].as_str(), separator.as_str()) {
            (Some("default"), None | Some("/")) => Keys { prefix: "c", separator: "/".into() },
            (Some("default"), Some(".")) => Keys { prefix: "c", separator: ".".into() },
            (Some("v2"), None | Some(".")) => Keys { prefix: "", separator: ".".into() },
            (Some("v2"), Some("/")) => Keys { prefix: "", separator: "/".into() },
            _ => return Err(field.wrong("chunk_key_encoding", "default or v2")),
        };
        let outer_chain = Chain::parse(&field, &json["codecs"], shape.len())?;
        let (chain, chunk, shard) = match &outer_chain.sharding {
            None => (outer_chain, outer, None),
            Some(configuration) => {
                let inner = field.sizes_of(&configuration["chunk_shape"], "sharding chunk_shape")?;
                field.same_rank(&shape, &inner, "sharding chunk_shape")?;
                let divides = outer.iter().zip(&inner).all(|(outer, inner)| outer.is_multiple_of(*inner));
                if !divides || !outer_chain.codecs.is_empty() || outer_chain.transposes {
                    return Err(field.wrong("codecs", "shards that whole inner chunks fill, on their own"));
                }
                let chain = Chain::parse(&field, &configuration["codecs"], shape.len())?;
                let index = Chain::parse(&field, &configuration["index_codecs"], shape.len() + 1)?;
                let index_is_plain = index.codecs.iter().all(|codec| *codec == Codec::Crc32c);
                if chain.sharding.is_some() || index.sharding.is_some() || !index_is_plain || index.transposes
                {
                    return Err(field.wrong("codecs", "one level of shards, the index plain or with crc32c"));
                }
                let shard = Shard {
                    counts: outer.iter().zip(&inner).map(|(outer, inner)| outer / inner).collect(),
                    index_codecs: index.codecs,
                    index_at_end: match configuration["index_location"].as_str() {
                        None | Some("end") => true,
                        Some("start") => false,
                        Some(_) => return Err(field.wrong("codecs", "index_location start or end")),
                    },
                };
                (chain, inner, Some(shard))
            }
        };
        let Chain { order, endian, codecs, .. } = chain;
        let fill = fill(&field, &json["fill_value"], voxel_type, is_half, endian)?;
        Ok(Self { shape, chunk, voxel_type, is_half, endian, fill, order, codecs, keys, shard })
    }
}

/// A chain of codecs of version 3.
struct Chain<'a> {
    order: Vec<usize>,
    transposes: bool,
    endian: Endian,
    codecs: Vec<Codec>,
    sharding: Option<&'a Value>,
}

impl<'a> Chain<'a> {
    fn parse(field: &Fields<'_>, json: &'a Value, rank: usize) -> Result<Self, FormatError> {
        let wrong = |expected: &str| field.wrong("codecs", expected);
        let list = json.as_array().filter(|list| (1..=MAX_CODECS).contains(&list.len()));
        let list = list.ok_or_else(|| wrong("a short list of codecs"))?;
        let mut order: Vec<usize> = (0..rank).collect();
        let mut chain = Self {
            order: order.clone(),
            transposes: false,
            endian: Endian::Little,
            codecs: Vec::new(),
            sharding: None,
        };
        let mut has_bytes = false;
        for codec in list {
            let configuration = &codec["configuration"];
            let name = codec["name"].as_str().unwrap_or_default();
            match name {
                "transpose" if !has_bytes && !chain.transposes => {
                    let axes = configuration["order"].as_array().map(Vec::as_slice).unwrap_or_default();
                    order = axes.iter().filter_map(|axis| usize::try_from(axis.as_u64()?).ok()).collect();
                    let mut sorted = order.clone();
                    sorted.sort_unstable();
                    if !sorted.into_iter().eq(0..rank) {
                        return Err(wrong("a transpose of all axes"));
                    }
                    chain.order.clone_from(&order);
                    chain.transposes = true;
                }
                "bytes" if !has_bytes => {
                    has_bytes = true;
                    chain.endian = match configuration["endian"].as_str() {
                        Some("big") => Endian::Big,
                        None | Some("little") => Endian::Little,
                        Some(_) => return Err(wrong("endian little or big")),
                    };
                }
                "sharding_indexed" if !has_bytes => {
                    has_bytes = true;
                    chain.sharding = Some(configuration);
                }
                "gzip" | "zstd" | "blosc" | "crc32c" if has_bytes => chain.codecs.push(match name {
                    "gzip" => Codec::Gzip,
                    "zstd" => Codec::Zstd,
                    "blosc" => Codec::Blosc,
                    _ => Codec::Crc32c,
                }),
                _ => {
                    let expected = "transpose, bytes or sharding_indexed, then gzip, zstd, blosc, crc32c";
                    return Err(wrong(expected));
                }
            }
        }
        if !has_bytes {
            return Err(wrong("bytes or sharding_indexed among them"));
        }
        Ok(chain)
    }
}

/// Access to metadata with errors that name the field.
struct Fields<'a> {
    file: &'a str,
    path: &'a str,
    json: &'a Value,
}

impl Fields<'_> {
    fn wrong(&self, name: &str, expected: &str) -> FormatError {
        FormatError::field(self.file, format!("{}: {name}", self.path), &self.json[name], expected)
    }

    fn sizes(&self, name: &str) -> Result<Vec<u64>, FormatError> {
        self.sizes_of(&self.json[name], name)
    }

    fn sizes_of(&self, json: &Value, name: &str) -> Result<Vec<u64>, FormatError> {
        let sizes: Option<Vec<u64>> =
            json.as_array().and_then(|list| list.iter().map(|n| n.as_u64().filter(|n| *n >= 1)).collect());
        sizes.filter(|sizes| (2..=MAX_AXES).contains(&sizes.len())).ok_or_else(|| {
            let expected = format!("2 to {MAX_AXES} whole numbers of at least 1");
            FormatError::field(self.file, format!("{}: {name}", self.path), json, expected)
        })
    }

    fn same_rank(&self, shape: &[u64], chunk: &[u64], name: &str) -> Result<(), FormatError> {
        match shape.len() == chunk.len() {
            true => Ok(()),
            false => Err(self.wrong(name, "one number per axis")),
        }
    }
}

/// The bytes of the fill value.
fn fill(
    field: &Fields<'_>,
    value: &Value,
    voxel_type: VoxelType,
    is_half: bool,
    endian: Endian,
) -> Result<Vec<u8>, FormatError> {
    let expected = "a number of the array's type";
    let wrong = || field.wrong("fill_value", expected);
    let is_float = matches!(voxel_type, VoxelType::Float32 | VoxelType::Float64);
    let number = match value {
        Value::Null => 0.0,
        Value::Bool(flag) => f64::from(u8::from(*flag)),
        Value::Number(number) => number.as_f64().ok_or_else(wrong)?,
        Value::String(text) if is_float => match text.as_str() {
            "NaN" => f64::NAN,
            "Infinity" => f64::INFINITY,
            "-Infinity" => f64::NEG_INFINITY,
            _ => return Err(wrong()),
        },
        _ => return Err(wrong()),
    };
    macro_rules! bytes {
        ($value:expr) => {
            match endian {
                Endian::Little => $value.to_le_bytes().to_vec(),
                Endian::Big => $value.to_be_bytes().to_vec(),
            }
        };
    }
    macro_rules! whole {
        ($type:ty) => {{
            // Exact for whole numbers; large 64-bit ones come from the text itself.
            let exact = value.as_i64().map(i128::from).or(value.as_u64().map(i128::from));
            let whole = exact.unwrap_or(number as i128);
            if exact.is_none() && whole as f64 != number {
                return Err(wrong());
            }
            bytes!(<$type>::try_from(whole).map_err(|_| wrong())?)
        }};
    }
    Ok(match voxel_type {
        VoxelType::Uint8 => whole!(u8),
        VoxelType::Int8 => whole!(i8),
        VoxelType::Uint16 => whole!(u16),
        VoxelType::Int16 => whole!(i16),
        VoxelType::Uint32 => whole!(u32),
        VoxelType::Int32 => whole!(i32),
        VoxelType::Uint64 => whole!(u64),
        VoxelType::Int64 => whole!(i64),
        VoxelType::Float32 if is_half => bytes!(half::f16::from_f64(number)),
        VoxelType::Float32 => bytes!((number as f32)),
        VoxelType::Float64 => bytes!(number),
    })
}
