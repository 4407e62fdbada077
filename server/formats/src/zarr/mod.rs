//! OME-Zarr (ngff.openmicroscopy.org) 0.4 on Zarr 2 and 0.5 on Zarr 3, in a folder or a zip
//! archive: the finest level that fits the limits, one channel and time of it.
//!
//! An own reader, see `docs/decisions/0011-own-ome-zarr-reader.md`.

mod array;
mod blosc;
mod codec;
mod multiscale;
mod slabs;
mod store;

use std::cell::Cell;
use std::path::Path;
use std::rc::Rc;

use proto::scene_file::Endian;

use crate::archive::Archive;
use crate::error::FormatError;
use crate::half_float;
use crate::orientation::Stored;
use crate::reorder::{Axes, reorder_voxels};
use crate::stream::Stream;
use crate::voxels::{Layout, Size, check_axes};
use crate::{Format, Imported, ReadOptions};
use array::Array;
use multiscale::{Level, Multiscale};
use slabs::{Cut, Slabs};
use store::Store;
pub(crate) use store::root_in;

/// Whether a folder is a Zarr hierarchy.
pub(crate) fn is_hierarchy(folder: &Path) -> bool {
    [".zattrs", ".zgroup", "zarr.json"].iter().any(|name| folder.join(name).is_file())
}

/// Reads the hierarchy in a folder.
pub(crate) fn read_folder(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    read(Store::folder(path, options)?, options)
}

/// Reads the hierarchy in a zip archive.
pub(crate) fn read_zip(archive: Archive, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    read(Store::zip(archive)?, options)
}

/// A level that can be read.
struct Chosen {
    level: Level,
    array: Array,
    cut: Cut,
    layout: Layout,
    size: Size,
    choices: u64,
}

fn read(mut store: Store, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    let file = store.file.clone();
    let mut notices = Vec::new();
    let multiscale = Multiscale::load(&mut store, options, &mut notices)?;
    let Chosen { level, array, cut, layout, size, choices } =
        choose_level(&mut store, &multiscale, options, &mut notices)?;

    let space = multiscale.space();
    // File axis 0 is the fastest: the last one of space.
    let world_axes: Option<Vec<usize>> =
        space.iter().rev().map(|axis| multiscale.world_axis(*axis)).collect();
    let mut permutation = [0, 1, 2];
    if let Some(world_axes) = world_axes.filter(|axes| axes.len() == permutation.len()) {
        for (position, world) in world_axes.into_iter().enumerate() {
            permutation[world] = position;
        }
    }
    let file_spacing: Vec<f64> = space.iter().rev().map(|axis| level.scale[*axis]).collect();
    let spacing_of = |position: usize| file_spacing.get(position).copied().unwrap_or(1.0);
    let stored = Stored {
        dims: permutation.map(|position| layout.dims[position]),
        spacing: permutation.map(spacing_of),
        spacing_unit: multiscale.unit(&mut notices),
        slope: 1.0,
        intercept: 0.0,
        affine: None,
    };
    stored.check_spacing(&file, "scale")?;
    if space.len() == 2 {
        notices.push("the image is flat: it becomes one slice".to_owned());
    }

    let missing = Rc::new(Cell::new((0, 0)));
    let told = missing.clone();
    let at_most = layout.dims.iter().map(|n| *n as u64).product::<u64>() * array.value_bytes();
    let (is_half, endian) = (array.is_half, array.endian);
    let on_end = Box::new(move |absent, total| told.set((absent, total)));
    let reader = Slabs::new(store, level.path, array, cut, on_end);
    let mut stream = Stream::decoded(file, Box::new(reader), at_most);
    if is_half {
        notices.push(half_float::NOTICE.to_owned());
        stream = half_float::widen(stream, endian);
    }
    let voxels = layout.read_chosen(&size, &mut stream, options, &mut notices)?;
    if let (absent @ 1.., total) = missing.get() {
        notices.push(format!("{absent} of {total} chunks are not stored: they hold the fill value"));
    }
    let axes = Axes { permutation, flip: [false; 3] };
    let voxels = reorder_voxels(voxels, layout.dims, axes);
    Ok(Imported {
        volume: stored.into_volume(voxels, &mut notices),
        format: Format::OmeZarr,
        file_type: layout.voxel_type,
        choices,
        choice_names: Vec::new(),
        notices,
    })
}

/// The finest level that fits the limits and has chunks.
fn choose_level(
    store: &mut Store,
    multiscale: &Multiscale,
    options: &ReadOptions<'_>,
    notices: &mut Vec<String>,
) -> Result<Chosen, FormatError> {
    let count = multiscale.levels.len();
    let mut first_error = None;
    let mut passed_over = Vec::new();
    for (number, level) in multiscale.levels.iter().enumerate() {
        let array = level.array(store, options)?;
        if !store.has_chunks(&level.path) {
            passed_over.push(format!("level {number} has no chunks"));
            continue;
        }
        let mut about = Vec::new();
        match fit(&store.file, multiscale, level, array, options, &mut about) {
            Ok(chosen) => {
                notices.append(&mut about);
                let [x, y, z] = chosen.layout.dims;
                if count > 1 {
                    let why = match passed_over.is_empty() {
                        true => "the finest".to_owned(),
                        false => passed_over.join(", "),
                    };
                    notices.push(format!(
                        "level {number} of {count} is read, {x} x {y} x {z} as stored ({why})"
                    ));
                }
                return Ok(chosen);
            }
            Err(error) => {
                passed_over.push(format!("level {number} is too large"));
                first_error.get_or_insert(error);
            }
        }
    }
    Err(first_error.unwrap_or_else(|| {
        FormatError::missing(&store.file, "chunks", "at least one stored chunk of one level")
    }))
}

/// Holds a level against the limits.
fn fit(
    file: &str,
    multiscale: &Multiscale,
    level: &Level,
    array: Array,
    options: &ReadOptions<'_>,
    notices: &mut Vec<String>,
) -> Result<Chosen, FormatError> {
    if array.shape.len() != multiscale.axes.len() {
        let expected = format!("{} axes, as in `axes`", multiscale.axes.len());
        let field = format!("{}: shape", level.path);
        return Err(FormatError::field(file, field, format!("{:?}", array.shape), expected));
    }
    let space = multiscale.space();
    let size_of =
        |position: usize| space.iter().rev().nth(position).map_or(1, |axis| i128::from(array.shape[*axis]));
    let dims = check_axes(file, "shape", [size_of(0), size_of(1), size_of(2)], &options.limits)?;
    let layout = Layout {
        voxel_type: array.voxel_type,
        endian: if array.is_half { Endian::Little } else { array.endian },
        dims,
        components: 1,
        volumes: 1,
    };
    let whole = ReadOptions { index: None, ..*options };
    let size = layout.check(file, &whole, notices)?;

    // The chosen place on the axes that are not space, the last of them counted fastest.
    let others: Vec<usize> = (0..array.shape.len()).filter(|axis| !space.contains(axis)).collect();
    let choices = others.iter().fold(1_u64, |product, axis| product.saturating_mul(array.shape[*axis]));
    let index = u64::from(options.index.unwrap_or(0));
    if index >= choices {
        let expected = format!("a number below {choices}, the count of channels and times");
        return Err(FormatError::field(file, "index", index, expected));
    }
    if choices > 1 && options.index.is_none() {
        let names: Vec<&str> = others.iter().map(|axis| multiscale.axes[*axis].name.as_str()).collect();
        notices.push(format!(
            "the file holds {choices} volumes (axes {}): index 0 of {choices} is shown, set `index` for \
             another",
            names.join(", ")
        ));
    }
    let mut at = vec![0; array.shape.len()];
    let mut rest = index;
    for axis in others.iter().rev() {
        at[*axis] = rest % array.shape[*axis];
        rest /= array.shape[*axis];
    }
    let cut = Cut { space, at };
    slabs::check(file, &array, &cut, options.limits.max_voxel_bytes)?;
    let level = level.clone();
    Ok(Chosen { level, array, cut, layout, size, choices })
}
