//! Stored values of slices to the voxels of a volume.

use proto::scene_file::VoxelType;
use rayon::prelude::*;
use scene::Voxels;

use super::HEADERS_SHARE;
use super::header::{self, Image};
use super::pixels::Plane;
use super::series::{Group, Layer, Slice, Stack};
use super::source::Source;
use crate::error::FormatError;
use crate::{Limits, ReadOptions};

/// Bytes of files that are decoded side by side.
const BATCH_BYTES: usize = 64 << 20;
/// Frames that are decoded side by side.
const BATCH_FRAMES: usize = 16;
/// Padding is replaced where it lies beyond the other values by more than this share of their
/// range: nearer it does no harm.
const PADDING_MARGIN: f64 = 0.05;

/// What the pixels of a volume are.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kind {
    /// Type in the file.
    pub(super) file_type: VoxelType,
    /// Stored value of pixels outside of what was scanned.
    pub(super) padding: Option<i64>,
    bits_stored: u32,
    signed: bool,
    float: bool,
    inverted: bool,
    scaling: Scaling,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Scaling {
    /// One slope and intercept for all.
    Uniform(f64, f64),
    /// Each slice its own, applied as it is read.
    PerSlice,
}

/// Voxels with the scaling that is left to apply.
pub(super) struct Filled {
    pub(super) voxels: Voxels,
    pub(super) slope: f64,
    pub(super) intercept: f64,
}

impl Kind {
    pub(super) fn of(image: &Image) -> Self {
        let file_type = match (image.bits_allocated, image.signed, image.is_float()) {
            (64, _, true) => VoxelType::Float64,
            (_, _, true) => VoxelType::Float32,
            (8, false, _) => VoxelType::Uint8,
            (8, true, _) => VoxelType::Int8,
            (16, false, _) => VoxelType::Uint16,
            (16, true, _) => VoxelType::Int16,
            (_, false, _) => VoxelType::Uint32,
            (_, true, _) => VoxelType::Int32,
        };
        Self {
            file_type,
            padding: image.padding,
            bits_stored: image.bits_stored,
            signed: image.signed,
            float: image.is_float(),
            inverted: image.inverted,
            scaling: Scaling::Uniform(1.0, 0.0),
        }
    }

    /// A kind that holds the values of both.
    pub(super) fn joined(self, other: &Kind) -> Self {
        if self == *other {
            return self;
        }
        // A sign and 16 unsigned bits do not go together in 16 bits.
        let mixed_signs = self.signed != other.signed;
        let bits = self.bits_stored.max(other.bits_stored) + u32::from(mixed_signs);
        let wider = if other.bits_stored > self.bits_stored { other.file_type } else { self.file_type };
        Self {
            file_type: wider,
            padding: self.padding.filter(|padding| other.padding == Some(*padding)),
            bits_stored: bits,
            signed: self.signed || other.signed,
            float: self.float || other.float,
            inverted: self.inverted && other.inverted,
            scaling: self.scaling,
        }
    }

    /// With the scaling of the slices; an unusable one counts as none.
    pub(super) fn with_scaling(mut self, slices: &[Slice], notices: &mut Vec<String>) -> Self {
        let unusable = slices.iter().filter(|slice| usable(slice).is_none()).count();
        if unusable > 0 {
            notices.push(format!(
                "the rescale slope and intercept of {unusable} slices cannot be used: their values are \
                 taken as stored"
            ));
        }
        let mut all = slices.iter().map(|slice| usable(slice).unwrap_or((1.0, 0.0)));
        let first = all.next().unwrap_or((1.0, 0.0));
        let uniform = all.all(|other| other == first);
        self.scaling = if uniform { Scaling::Uniform(first.0, first.1) } else { Scaling::PerSlice };
        if !uniform {
            notices.push("the slices differ in rescale slope or intercept: each has its own applied".into());
        }
        if self.inverted {
            notices
                .push("MONOCHROME1: low values are meant to be bright; the values stay as they are".into());
        }
        self
    }

    /// Whether values become 32-bit floats as they are read.
    fn as_floats(&self) -> bool {
        self.float || self.bits_stored > 16 || self.scaling == Scaling::PerSlice
    }

    /// An empty volume; holds the size against the limits first.
    pub(super) fn check_memory(
        &self,
        file: &str,
        dims: [usize; 3],
        limits: &Limits,
    ) -> Result<(), FormatError> {
        let voxel_bytes = if self.as_floats() {
            4
        } else if self.is_byte() {
            1
        } else {
            2
        };
        let bytes = dims.iter().try_fold(voxel_bytes, |sum: u64, n| sum.checked_mul(*n as u64));
        match bytes {
            Some(bytes) if bytes <= limits.max_voxel_bytes => Ok(()),
            _ => Err(FormatError::TooLarge {
                file: file.to_owned(),
                what: "bytes of voxels in memory",
                got: bytes.map_or("more than 2^64".to_owned(), |n| n.to_string()),
                limit: limits.max_voxel_bytes,
            }),
        }
    }

    fn is_byte(&self) -> bool {
        self.bits_stored <= 8 && !self.signed
    }

    /// Scaling of a slice that is applied as it is read.
    fn applied(&self, slice: &Slice) -> (f64, f64) {
        match self.scaling {
            Scaling::PerSlice => usable(slice).unwrap_or((1.0, 0.0)),
            Scaling::Uniform(slope, intercept) if self.as_floats() => (slope, intercept),
            Scaling::Uniform(..) => (1.0, 0.0),
        }
    }
}

/// Slope and intercept of a slice that lead to finite values in single precision.
fn usable(slice: &Slice) -> Option<(f64, f64)> {
    let range = f64::from(f32::MAX) / f64::from(u32::MAX);
    let fits = |value: f64| value.is_finite() && value.abs() < range;
    (fits(slice.slope) && fits(slice.intercept) && slice.slope != 0.0)
        .then_some((slice.slope, slice.intercept))
}

/// Reads the pixels of a stack.
pub(super) fn fill(
    source: &Source,
    group: &Group,
    stack: &Stack,
    kind: &Kind,
    options: &ReadOptions<'_>,
) -> Result<Filled, FormatError> {
    let (slope, intercept) = match kind.scaling {
        Scaling::Uniform(slope, intercept) if !kind.as_floats() => (slope, intercept),
        _ => (1.0, 0.0),
    };
    let planes = Planes { source, group, stack, kind, options };
    let voxels = if kind.as_floats() {
        Voxels::F32(planes.read(|value| (value as f32).clamp(f32::MIN, f32::MAX))?)
    } else if kind.is_byte() {
        Voxels::U8(planes.read(|value| value.round() as u8)?)
    } else if kind.signed {
        Voxels::I16(planes.read(|value| value.round() as i16)?)
    } else {
        Voxels::U16(planes.read(|value| value.round() as u16)?)
    };
    Ok(Filled { voxels, slope, intercept })
}

struct Planes<'a> {
    source: &'a Source,
    group: &'a Group,
    stack: &'a Stack,
    kind: &'a Kind,
    options: &'a ReadOptions<'a>,
}

impl Planes<'_> {
    /// All layers, file by file.
    fn read<T: Copy + Default + Send + Sync + Into<f64>>(
        &self,
        convert: impl Fn(f64) -> T + Sync,
    ) -> Result<Vec<T>, FormatError> {
        let plane_len = self.group.key.rows * self.group.key.columns;
        let total = plane_len * self.stack.layers.len();
        let mut voxels: Vec<T> = Vec::new();
        voxels.try_reserve_exact(total).map_err(|_| {
            let what = format!("no memory for {total} voxels on this machine");
            FormatError::corrupt(&self.source.name, what)
        })?;
        voxels.resize(total, T::default());
        // Where each stored slice goes, in the order of the files.
        let mut places: Vec<(&Slice, usize)> = Vec::new();
        for (layer, content) in self.stack.layers.iter().enumerate() {
            if let Layer::Stored(index) = content {
                places.push((&self.group.slices[*index], layer));
            }
        }
        places.sort_by_key(|(slice, _)| (slice.file, slice.frame));
        let mut done = 0;
        let of_files: Vec<&[(&Slice, usize)]> = places.chunk_by(|a, b| a.0.file == b.0.file).collect();
        let mut rest = &of_files[..];
        while !rest.is_empty() {
            let (images, taken) = self.load_batch(rest)?;
            let jobs: Vec<(&Image, &Slice, usize)> = images
                .iter()
                .zip(rest)
                .flat_map(|(image, slices)| slices.iter().map(move |(slice, layer)| (image, *slice, *layer)))
                .collect();
            for batch in jobs.chunks(BATCH_FRAMES) {
                let decoded: Vec<_> = batch
                    .par_iter()
                    .map(|(image, slice, layer)| Ok((*layer, self.plane(image, slice, &convert)?)))
                    .collect::<Result<_, FormatError>>()?;
                for (layer, plane) in decoded {
                    voxels[layer * plane_len..(layer + 1) * plane_len].copy_from_slice(&plane);
                    done += 1;
                }
                let share = done as f32 / places.len() as f32;
                (self.options.progress)(HEADERS_SHARE + (1.0 - HEADERS_SHARE) * share);
            }
            rest = &rest[taken..];
        }
        self.interpolate(&mut voxels, plane_len, &convert);
        Ok(voxels)
    }

    /// Opens as many files as a batch holds, at least one.
    fn load_batch(&self, files: &[&[(&Slice, usize)]]) -> Result<(Vec<Image>, usize), FormatError> {
        let mut images: Vec<Image> = Vec::new();
        let mut bytes = 0;
        for slices in files.iter().take(BATCH_FRAMES) {
            if bytes > BATCH_BYTES {
                break;
            }
            let Some((slice, _)) = slices.first() else { break };
            let file = self.source.file(slice.file);
            let data = self.source.load(slice.file, self.options)?;
            let changed = || FormatError::corrupt(&file, "it changed while it was read");
            let image = header::parse(&file, data, &self.options.limits)?.ok_or_else(changed)?;
            let same = (image.rows, image.columns) == (self.group.key.rows, self.group.key.columns);
            if !same || slices.iter().any(|(slice, _)| slice.frame >= image.frames.len()) {
                return Err(changed());
            }
            bytes += image.data.len();
            images.push(image);
        }
        let taken = images.len();
        Ok((images, taken))
    }

    fn plane<T>(
        &self,
        image: &Image,
        slice: &Slice,
        convert: &impl Fn(f64) -> T,
    ) -> Result<Vec<T>, FormatError> {
        let (slope, intercept) = self.kind.applied(slice);
        let scaled = |value: f64| convert(slope * value + intercept);
        Ok(match image.plane(&self.source.file(slice.file), slice.frame)? {
            Plane::Integers(values) => values.into_iter().map(|value| scaled(value as f64)).collect(),
            Plane::Floats(values) => {
                // NaN and infinities have no place in a volume.
                let finite = |value: f64| if (value as f32).is_finite() { value } else { 0.0 };
                values.into_iter().map(|value| scaled(finite(value))).collect()
            }
        })
    }

    /// Fills layers between stored ones.
    fn interpolate<T: Copy + Into<f64>>(
        &self,
        voxels: &mut [T],
        plane_len: usize,
        convert: &impl Fn(f64) -> T,
    ) {
        let layers = &self.stack.layers;
        let layer_of = |index: usize| layers.iter().position(|layer| *layer == Layer::Stored(index));
        for (layer, content) in layers.iter().enumerate() {
            let Layer::Between(below, above, share) = *content else { continue };
            let (Some(below), Some(above)) = (layer_of(below), layer_of(above)) else { continue };
            for at in 0..plane_len {
                let a: f64 = voxels[below * plane_len + at].into();
                let b: f64 = voxels[above * plane_len + at].into();
                voxels[layer * plane_len + at] = convert(a + share * (b - a));
            }
        }
    }
}

impl Filled {
    /// Replaces padding that would stretch the range of values, and applies whole-number
    /// intercepts that fit: Hounsfield units are then stored as they are.
    pub(super) fn without_padding(self, padding: Option<i64>, notices: &mut Vec<String>) -> Self {
        let Self { mut voxels, slope, mut intercept } = self;
        if let Some(padding) = padding {
            let replaced = match &mut voxels {
                Voxels::U8(values) => replace(values, padding),
                Voxels::U16(values) => replace(values, padding),
                Voxels::I16(values) => replace(values, padding),
                // Scaled already: the stored value is no longer there.
                Voxels::F32(_) => 0,
            };
            if replaced > 0 {
                notices.push(format!(
                    "{replaced} pixels outside of the scan (padding {padding}) became the lowest value"
                ));
            }
        }
        if slope == 1.0 && intercept.fract() == 0.0 && intercept != 0.0 {
            let shifted = match &voxels {
                Voxels::U8(values) => shifted(values, intercept),
                Voxels::U16(values) => shifted(values, intercept),
                Voxels::I16(values) => shifted(values, intercept),
                Voxels::F32(_) => None,
            };
            if let Some(shifted) = shifted {
                voxels = Voxels::I16(shifted);
                intercept = 0.0;
            }
        }
        Self { voxels, slope, intercept }
    }
}

/// Replaces a padding value far beyond all others by the lowest of them; returns how often.
fn replace<T: Copy + PartialOrd + TryFrom<i64> + Into<f64>>(values: &mut [T], padding: i64) -> usize {
    let Ok(padding) = T::try_from(padding) else { return 0 };
    let mut others = values.iter().copied().filter(|value| *value != padding);
    let Some(first) = others.next() else { return 0 };
    let (low, high) = others.fold((first, first), |(low, high), value| {
        (if value < low { value } else { low }, if value > high { value } else { high })
    });
    let (below, above, at): (f64, f64, f64) = (low.into(), high.into(), padding.into());
    let beyond = (below - at).max(at - above);
    if beyond <= PADDING_MARGIN * (above - below) {
        return 0;
    }
    let mut replaced = 0;
    for value in values.iter_mut().filter(|value| **value == padding) {
        *value = low;
        replaced += 1;
    }
    replaced
}

fn shifted<T: Copy + Into<f64>>(values: &[T], by: f64) -> Option<Vec<i16>> {
    let fits = f64::from(i16::MIN)..=f64::from(i16::MAX);
    let shift = |value: &T| {
        let value: f64 = (*value).into() + by;
        fits.contains(&value).then_some(value as i16)
    };
    values.iter().map(shift).collect()
}
