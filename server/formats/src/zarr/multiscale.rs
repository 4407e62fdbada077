//! What OME-Zarr adds to Zarr: axes, levels, scales.

use serde_json::Value;

use super::array::Array;
use super::store::{Part, Store};
use crate::ReadOptions;
use crate::error::{FormatError, quoted};

/// Most levels of an image.
const MAX_LEVELS: usize = 64;
/// Most axes of an image.
const MAX_AXES: usize = 8;
/// Longest unit that is kept, in characters.
const MAX_UNIT_CHARS: usize = 16;

/// An axis of the image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    /// In lower case.
    pub(super) name: String,
    is_space: bool,
    unit: Option<String>,
}

/// One resolution of the image.
#[derive(Debug, Clone)]
pub(super) struct Level {
    pub(super) path: String,
    /// Step along each axis.
    pub(super) scale: Vec<f64>,
}

/// The first image of a hierarchy.
#[derive(Debug)]
pub(super) struct Multiscale {
    pub(super) axes: Vec<Axis>,
    /// From fine to coarse.
    pub(super) levels: Vec<Level>,
}

impl Multiscale {
    pub(super) fn load(
        store: &mut Store,
        options: &ReadOptions<'_>,
        notices: &mut Vec<String>,
    ) -> Result<Self, FormatError> {
        // The image is the hierarchy itself, or the first one in it, where converters put it.
        for (prefix, attributes) in [("", ""), ("0/", "0/")] {
            let v2 = json(store, &format!("{attributes}.zattrs"), options)?;
            let v3 = json(store, &format!("{attributes}zarr.json"), options)?;
            let list = [
                v2.as_ref().map(|v2| &v2["multiscales"]),
                v3.as_ref().map(|v3| &v3["attributes"]["ome"]["multiscales"]),
            ]
            .into_iter()
            .flatten()
            .find_map(Value::as_array);
            let Some(list) = list else { continue };
            if list.len() > 1 || !prefix.is_empty() {
                notices.push("the file may hold several images: the first is read".to_owned());
            }
            return Self::parse(&store.file, prefix, list.first().unwrap_or(&Value::Null));
        }
        Err(FormatError::missing(&store.file, "multiscales", "the image's description (OME-Zarr 0.4 or 0.5)"))
    }

    fn parse(file: &str, prefix: &str, json: &Value) -> Result<Self, FormatError> {
        let levels = json["datasets"].as_array().filter(|list| (1..=MAX_LEVELS).contains(&list.len()));
        let Some(levels) = levels else {
            let expected = format!("1 to {MAX_LEVELS} datasets");
            return Err(FormatError::field(file, "datasets", &json["datasets"], expected));
        };
        let axes = axes(file, &json["axes"])?;
        let outer = scale(file, &json["coordinateTransformations"], axes.len())?;
        let levels = levels.iter().map(|level| {
            let path = level["path"].as_str().unwrap_or_default();
            let inner = scale(file, &level["coordinateTransformations"], axes.len())?;
            let scale = inner.iter().zip(&outer).map(|(inner, outer)| inner * outer).collect();
            Ok(Level { path: format!("{prefix}{}", path.trim_end_matches('/')), scale })
        });
        let levels = levels.collect::<Result<_, FormatError>>()?;
        Ok(Self { axes, levels })
    }

    /// The axes of space in the order of the array, at most three.
    pub(super) fn space(&self) -> Vec<usize> {
        (0..self.axes.len()).filter(|axis| self.axes[*axis].is_space).collect()
    }

    /// Which world axis (0 to 2) an axis is by its name.
    pub(super) fn world_axis(&self, axis: usize) -> Option<usize> {
        ["x", "y", "z"].iter().position(|name| self.axes[axis].name == *name)
    }

    /// The unit that all axes of space share.
    pub(super) fn unit(&self, notices: &mut Vec<String>) -> Option<String> {
        let mut units = self.axes.iter().filter(|axis| axis.is_space).map(|axis| axis.unit.as_deref());
        let first = units.next()?;
        if units.any(|unit| unit != first) {
            notices.push("the axes have different units: none is taken".to_owned());
            return None;
        }
        let short = match first? {
            "nanometer" => "nm",
            "micrometer" => "um",
            "millimeter" => "mm",
            "centimeter" => "cm",
            "meter" => "m",
            other => other,
        };
        Some(short.chars().take(MAX_UNIT_CHARS).collect())
    }
}

fn axes(file: &str, json: &Value) -> Result<Vec<Axis>, FormatError> {
    let wrong = |expected: &str| FormatError::field(file, "axes", json, expected);
    let list = match json {
        // Version 0.2 and before knew only these.
        Value::Null => return Ok(["t", "c", "z", "y", "x"].map(axis_named).to_vec()),
        Value::Array(list) if (2..=MAX_AXES).contains(&list.len()) => list,
        _ => return Err(wrong("2 to 8 axes")),
    };
    let mut axes = Vec::new();
    for axis in list {
        // Version 0.3 has the names alone.
        let name = axis.as_str().or(axis["name"].as_str()).ok_or_else(|| wrong("axes with names"))?;
        let mut found = axis_named(name);
        if let Some(kind) = axis["type"].as_str() {
            found.is_space = kind == "space";
        }
        found.unit = axis["unit"].as_str().map(str::to_owned);
        if axes.iter().any(|other: &Axis| other.name == found.name) {
            return Err(wrong(&format!("axes with different names (`{name}` is there twice)")));
        }
        axes.push(found);
    }
    let space = axes.iter().filter(|axis| axis.is_space).count();
    if !(2..=3).contains(&space) {
        return Err(wrong("two or three axes of space"));
    }
    Ok(axes)
}

fn axis_named(name: &str) -> Axis {
    let name = name.to_lowercase();
    let is_space = matches!(name.as_str(), "x" | "y" | "z");
    Axis { name, is_space, unit: None }
}

/// The scale among transformations; 1 along every axis if there is none.
fn scale(file: &str, json: &Value, axes: usize) -> Result<Vec<f64>, FormatError> {
    let scale = json.as_array().and_then(|list| list.iter().find(|step| step["type"] == "scale"));
    let Some(scale) = scale else { return Ok(vec![1.0; axes]) };
    let numbers: Option<Vec<f64>> =
        scale["scale"].as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
    numbers.filter(|numbers| numbers.len() == axes).ok_or_else(|| {
        FormatError::field(file, "scale", &scale["scale"], format!("{axes} numbers, one per axis"))
    })
}

impl Level {
    /// The metadata of the level's array.
    pub(super) fn array(&self, store: &mut Store, options: &ReadOptions<'_>) -> Result<Array, FormatError> {
        if let Some(v2) = json(store, &format!("{}/.zarray", self.path), options)? {
            return Array::parse_v2(&store.file, &self.path, &v2);
        }
        if let Some(v3) = json(store, &format!("{}/zarr.json", self.path), options)? {
            return Array::parse_v3(&store.file, &self.path, &v3);
        }
        let field = format!("array {}", quoted(&self.path));
        Err(FormatError::missing(&store.file, &field, "its .zarray or zarr.json"))
    }
}

/// A JSON document of the hierarchy; `None` if it is not there.
fn json(store: &mut Store, key: &str, options: &ReadOptions<'_>) -> Result<Option<Value>, FormatError> {
    let Some(bytes) = store.get(key, Part::Whole, options.limits.max_header_bytes)? else {
        return Ok(None);
    };
    serde_json::from_slice(&bytes)
        .map(Some)
        .map_err(|error| FormatError::corrupt(&store.file, format!("{key} is no JSON: {error}")))
}
