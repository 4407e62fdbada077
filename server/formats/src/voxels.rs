//! Bytes to voxels: types, byte order, choice of a component or volume, non-finite values.

use proto::scene_file::{Endian, VoxelType};
use rayon::prelude::*;
use scene::Voxels;

use crate::error::FormatError;
use crate::stream::{Progress, Stream};
use crate::{Limits, ReadOptions};

/// Bytes decoded per step: large against call overhead, small against the cache.
const CHUNK_BYTES: u64 = 1 << 20;
/// Most components a voxel may have (diffusion series store hundreds).
const MAX_COMPONENTS: u64 = 1 << 16;
/// Voxels that one thread looks at in one go.
const PARALLEL_CHUNK: usize = 1 << 18;

/// What the user is told where a file says that its values are labels.
pub(crate) const LABEL_NOTICE: &str =
    "looks like a label volume: use nearest filtering, as values between labels mean nothing";

/// Bytes of one voxel of a type.
pub(crate) fn type_bytes(voxel_type: VoxelType) -> u64 {
    match voxel_type {
        VoxelType::Uint8 | VoxelType::Int8 => 1,
        VoxelType::Uint16 | VoxelType::Int16 => 2,
        VoxelType::Uint32 | VoxelType::Int32 | VoxelType::Float32 => 4,
        VoxelType::Uint64 | VoxelType::Int64 | VoxelType::Float64 => 8,
    }
}

/// Bytes in memory of one voxel of a type; see [`Voxels`].
fn memory_bytes(voxel_type: VoxelType) -> u64 {
    match voxel_type {
        VoxelType::Uint8 => 1,
        VoxelType::Int8 | VoxelType::Uint16 | VoxelType::Int16 => 2,
        _ => 4,
    }
}

/// Name of a type as scene files spell it.
pub(crate) fn type_name(voxel_type: VoxelType) -> &'static str {
    match voxel_type {
        VoxelType::Uint8 => "uint8",
        VoxelType::Int8 => "int8",
        VoxelType::Uint16 => "uint16",
        VoxelType::Int16 => "int16",
        VoxelType::Uint32 => "uint32",
        VoxelType::Int32 => "int32",
        VoxelType::Uint64 => "uint64",
        VoxelType::Int64 => "int64",
        VoxelType::Float32 => "float32",
        VoxelType::Float64 => "float64",
    }
}

/// How voxels lie in a file: components fastest, then x, y, z, then volumes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    pub(crate) voxel_type: VoxelType,
    pub(crate) endian: Endian,
    /// Voxels along the file's three spatial axes, checked by [`check_axes`].
    pub(crate) dims: [usize; 3],
    /// Values per voxel, at least 1.
    pub(crate) components: u64,
    /// Volumes one after the other, at least 1.
    pub(crate) volumes: u64,
}

/// What a checked layout costs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Size {
    /// Voxels of one volume.
    voxels: usize,
    /// Bytes of one volume in the file.
    volume_bytes: u64,
    /// Bytes of all volumes in the file.
    pub(crate) total_bytes: u64,
    component: u64,
    /// Which of the volumes is chosen.
    pub(crate) volume: u64,
}

/// Checks axis lengths from a header and brings them into memory's type.
pub(crate) fn check_axes(
    file: &str,
    field: &str,
    sizes: [i128; 3],
    limits: &Limits,
) -> Result<[usize; 3], FormatError> {
    let mut dims = [0; 3];
    for (dim, size) in dims.iter_mut().zip(sizes) {
        let max = limits.max_axis;
        *dim = usize::try_from(size)
            .ok()
            .filter(|n| *n >= 1 && *n <= max as usize)
            .ok_or_else(|| FormatError::field(file, field, size, format!("voxel counts from 1 to {max}")))?;
    }
    Ok(dims)
}

impl Layout {
    /// Number of volumes and components to choose from.
    pub(crate) fn choices(&self) -> u64 {
        self.components.saturating_mul(self.volumes)
    }

    /// Sizes in bytes, held against the limits, and the chosen volume and component.
    pub(crate) fn check(
        &self,
        file: &str,
        options: &ReadOptions<'_>,
        notices: &mut Vec<String>,
    ) -> Result<Size, FormatError> {
        let limits = &options.limits;
        if self.components > MAX_COMPONENTS {
            return Err(FormatError::TooLarge {
                file: file.to_owned(),
                what: "components per voxel",
                got: self.components.to_string(),
                limit: MAX_COMPONENTS,
            });
        }
        let product =
            |factors: &[u64]| factors.iter().try_fold(1_u64, |product, factor| product.checked_mul(*factor));
        let [x, y, z] = self.dims.map(|n| n as u64);
        let volume_bytes = product(&[x, y, z, self.components, type_bytes(self.voxel_type)]);
        let total_bytes = volume_bytes.and_then(|bytes| bytes.checked_mul(self.volumes));
        let in_memory = product(&[x, y, z, memory_bytes(self.voxel_type)]);
        let checked = |what, bytes: Option<u64>, limit| {
            bytes.filter(|n| *n <= limit).ok_or_else(|| FormatError::TooLarge {
                file: file.to_owned(),
                what,
                got: bytes.map_or("more than 2^64".to_owned(), |n| n.to_string()),
                limit,
            })
        };
        checked("bytes of voxels in memory", in_memory, limits.max_voxel_bytes)?;
        let total_bytes = checked("bytes of voxels", total_bytes, limits.max_decoded_bytes)?;

        let choices = self.choices();
        if choices > 1 && options.index.is_none() {
            let holds = match (self.volumes, self.components) {
                (1, components) => format!("{components} components"),
                (volumes, 1) => format!("{volumes} volumes"),
                (volumes, components) => format!("{volumes} volumes of {components} components"),
            };
            notices.push(format!(
                "the file holds {holds}: index 0 of {choices} is shown, set `index` for another"
            ));
        }
        let index = u64::from(options.index.unwrap_or(0));
        if index >= choices {
            return Err(FormatError::field(
                file,
                "index",
                index,
                format!("a number below {choices}, the count of volumes and components"),
            ));
        }
        Ok(Size {
            // The byte limit was checked above; on a narrower machine the count must fit too.
            voxels: usize::try_from(x * y * z)
                .map_err(|_| FormatError::corrupt(file, "more voxels than memory can address"))?,
            volume_bytes: volume_bytes.unwrap_or(total_bytes),
            total_bytes,
            component: index % self.components,
            volume: index / self.components,
        })
    }

    /// Reads the chosen volume from a stream that stands at the first voxel of the file.
    pub(crate) fn read(
        &self,
        size: &Size,
        stream: &mut Stream<'_>,
        options: &ReadOptions<'_>,
        notices: &mut Vec<String>,
    ) -> Result<Voxels, FormatError> {
        stream.require(size.total_bytes)?;
        let mut progress = Progress::new(options.progress, size.total_bytes);
        stream.skip(size.volume * size.volume_bytes, &mut progress)?;
        let voxels = self.read_volume(size, stream, &mut progress, notices)?;
        stream.skip((self.volumes - 1 - size.volume) * size.volume_bytes, &mut progress)?;
        notices.extend(stream.finish()?);
        Ok(voxels)
    }

    /// Reads the chosen volume from a stream that holds nothing else.
    pub(crate) fn read_chosen(
        &self,
        size: &Size,
        stream: &mut Stream<'_>,
        options: &ReadOptions<'_>,
        notices: &mut Vec<String>,
    ) -> Result<Voxels, FormatError> {
        stream.require(size.volume_bytes)?;
        let mut progress = Progress::new(options.progress, size.volume_bytes);
        let voxels = self.read_volume(size, stream, &mut progress, notices)?;
        notices.extend(stream.finish()?);
        Ok(voxels)
    }

    fn read_volume(
        &self,
        size: &Size,
        stream: &mut Stream<'_>,
        progress: &mut Progress<'_>,
        notices: &mut Vec<String>,
    ) -> Result<Voxels, FormatError> {
        let mut source = Source { layout: self, size, stream, progress };
        let big = self.endian == Endian::Big;
        let mut inexact = 0_u64;
        // Reads values of a type and converts each with the closure.
        macro_rules! read {
            ($type:ty, $convert:expr) => {
                match big {
                    true => source.read(|bytes| $convert(<$type>::from_be_bytes(bytes)))?,
                    false => source.read(|bytes| $convert(<$type>::from_le_bytes(bytes)))?,
                }
            };
        }
        // The same for types wider than f32's 24 bits; counts values that change.
        macro_rules! read_wide {
            ($type:ty, $exact:ty) => {
                read!($type, |value: $type| {
                    let narrow = value as f32;
                    inexact += u64::from(narrow as $exact != value as $exact);
                    narrow
                })
            };
        }
        let mut voxels = match self.voxel_type {
            VoxelType::Uint8 => Voxels::U8(read!(u8, |v| v)),
            VoxelType::Int8 => Voxels::I16(read!(i8, i16::from)),
            VoxelType::Uint16 => Voxels::U16(read!(u16, |v| v)),
            VoxelType::Int16 => Voxels::I16(read!(i16, |v| v)),
            VoxelType::Float32 => Voxels::F32(read!(f32, |v| v)),
            VoxelType::Uint32 => Voxels::F32(read_wide!(u32, f64)),
            VoxelType::Int32 => Voxels::F32(read_wide!(i32, f64)),
            VoxelType::Uint64 => Voxels::F32(read_wide!(u64, i128)),
            VoxelType::Int64 => Voxels::F32(read_wide!(i64, i128)),
            // NaN differs from itself and is reported on its own below.
            VoxelType::Float64 => Voxels::F32(read!(f64, |value: f64| {
                let narrow = value as f32;
                inexact += u64::from(narrow.is_finite() && f64::from(narrow) != value);
                narrow
            })),
        };
        if inexact > 0 {
            notices.push(format!(
                "{inexact} of {} voxels lost precision from {} to float32",
                size.voxels,
                type_name(self.voxel_type)
            ));
        }
        if let Voxels::F32(values) = &mut voxels {
            notices.extend(replace_non_finite(values));
        }
        Ok(voxels)
    }
}

struct Source<'a, 's, 'p> {
    layout: &'a Layout,
    size: &'a Size,
    stream: &'a mut Stream<'s>,
    progress: &'a mut Progress<'p>,
}

impl Source<'_, '_, '_> {
    /// Reads one component of one volume in chunks and converts each value.
    fn read<const N: usize, T>(
        &mut self,
        mut convert: impl FnMut([u8; N]) -> T,
    ) -> Result<Vec<T>, FormatError> {
        let mut values = Vec::new();
        values.try_reserve_exact(self.size.voxels).map_err(|_| {
            FormatError::corrupt(
                &self.stream.file,
                format!("no memory for {} voxels on this machine", self.size.voxels),
            )
        })?;
        // Both factors are bounded: MAX_COMPONENTS and 8 bytes.
        let voxel_bytes = self.layout.components as usize * N;
        let offset = self.size.component as usize * N;
        let chunk_voxels = (CHUNK_BYTES as usize / voxel_bytes).max(1).min(self.size.voxels);
        let mut buffer = vec![0; chunk_voxels * voxel_bytes];
        while values.len() < self.size.voxels {
            let voxels = chunk_voxels.min(self.size.voxels - values.len());
            let chunk = &mut buffer[..voxels * voxel_bytes];
            self.stream.read_exact(chunk)?;
            self.progress.advance(chunk.len() as u64);
            if self.layout.components == 1 {
                let (packed, _) = chunk.as_chunks::<N>();
                values.extend(packed.iter().map(|bytes| convert(*bytes)));
            } else {
                values.extend(chunk.chunks_exact(voxel_bytes).map(|voxel| {
                    let mut bytes = [0; N];
                    bytes.copy_from_slice(&voxel[offset..offset + N]);
                    convert(bytes)
                }));
            }
        }
        Ok(values)
    }
}

/// Replaces NaN and infinities by the smallest finite value (0 if there is none). Returns a
/// notice if there were any.
fn replace_non_finite(values: &mut [f32]) -> Option<String> {
    let (bad, smallest) = values
        .par_chunks(PARALLEL_CHUNK)
        .map(|chunk| {
            chunk.iter().fold((0_u64, f32::INFINITY), |(bad, smallest), v| match v.is_finite() {
                true => (bad, smallest.min(*v)),
                false => (bad + 1, smallest),
            })
        })
        .reduce(|| (0, f32::INFINITY), |a, b| (a.0 + b.0, a.1.min(b.1)));
    if bad == 0 {
        return None;
    }
    let total = values.len();
    let (replacement, which) = match smallest.is_finite() {
        true => (smallest, "the smallest finite value"),
        false => (0.0, "as no voxel is finite"),
    };
    for value in values.iter_mut().filter(|value| !value.is_finite()) {
        *value = replacement;
    }
    Some(format!(
        "{bad} of {total} voxels were NaN, infinite or beyond the range of float32 and became \
         {replacement}, {which}"
    ))
}
