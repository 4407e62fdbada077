//! The fixed-layout headers of NIfTI-1 (348 bytes) and NIfTI-2 (540 bytes), and the extensions
//! behind them.

use proto::scene_file::Endian;

use super::skip_to_voxels;
use crate::ReadOptions;
use crate::error::FormatError;
use crate::stream::{Progress, Stream};

/// Intent code of volumes whose values are labels (NIFTI_INTENT_LABEL).
pub(super) const INTENT_LABEL: i32 = 1002;
/// Bytes of a NIfTI-1 header, also the value of its `sizeof_hdr`.
pub(super) const NIFTI1_BYTES: usize = 348;
/// Bytes of a NIfTI-2 header, also the value of its `sizeof_hdr`.
const NIFTI2_BYTES: usize = 540;
/// Bytes behind the header that say whether extensions follow.
const EXTENDER_BYTES: u64 = 4;
/// Bytes of an extension's size and code.
const EXTENSION_HEAD_BYTES: u64 = 8;

/// Version, byte order and whether the voxels lie in a second file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kind {
    is_nifti2: bool,
    endian: Endian,
    is_pair: bool,
}

/// Recognises a header by `sizeof_hdr` and magic; needs [`NIFTI1_BYTES`] bytes for version 1.
pub(super) fn recognise(start: &[u8]) -> Option<Kind> {
    let size: [u8; 4] = start.get(..4)?.try_into().ok()?;
    let (little, big) = (i32::from_le_bytes(size), i32::from_be_bytes(size));
    let is = |bytes: usize| {
        let bytes = bytes as i32;
        match (little == bytes, big == bytes) {
            (true, _) => Some(Endian::Little),
            (_, true) => Some(Endian::Big),
            _ => None,
        }
    };
    if let Some(endian) = is(NIFTI1_BYTES) {
        let is_pair = match start.get(344..348)? {
            b"n+1\0" => false,
            b"ni1\0" => true,
            _ => return None,
        };
        return Some(Kind { is_nifti2: false, endian, is_pair });
    }
    let endian = is(NIFTI2_BYTES)?;
    let is_pair = match start.get(4..12)? {
        b"n+2\0\r\n\x1a\n" => false,
        b"ni2\0\r\n\x1a\n" => true,
        _ => return None,
    };
    Some(Kind { is_nifti2: true, endian, is_pair })
}

/// Fields that are used, names as in the standard.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    is_nifti2: bool,
    pub(super) endian: Endian,
    /// Voxels lie in a second file.
    pub(super) is_pair: bool,
    pub(super) dim: [i64; 8],
    pub(super) datatype: i16,
    pub(super) pixdim: [f64; 8],
    /// Checked to be a whole number of at least 0.
    pub(super) vox_offset: u64,
    pub(super) scl_slope: f64,
    pub(super) scl_inter: f64,
    xyzt_units: i32,
    pub(super) qform_code: i32,
    pub(super) sform_code: i32,
    /// What the values mean; [`INTENT_LABEL`] matters here.
    pub(super) intent_code: i32,
    /// b, c, d of the rotation.
    pub(super) quatern: [f64; 3],
    pub(super) qoffset: [f64; 3],
    /// Rows of the transform from voxels to RAS.
    pub(super) srow: [[f64; 4]; 3],
}

/// Numbers at fixed places of a header.
struct Bytes<'a> {
    bytes: &'a [u8; NIFTI2_BYTES],
    big: bool,
}

impl Bytes<'_> {
    /// `N` bytes at an offset that is a constant below, in little-endian order.
    fn at<const N: usize>(&self, offset: usize) -> [u8; N] {
        let mut value = [0; N];
        value.copy_from_slice(&self.bytes[offset..offset + N]);
        if self.big {
            value.reverse();
        }
        value
    }

    fn i16(&self, offset: usize) -> i16 {
        i16::from_le_bytes(self.at(offset))
    }

    fn i32(&self, offset: usize) -> i32 {
        i32::from_le_bytes(self.at(offset))
    }

    fn i64(&self, offset: usize) -> i64 {
        i64::from_le_bytes(self.at(offset))
    }

    fn f32s<const N: usize>(&self, offset: usize) -> [f64; N] {
        std::array::from_fn(|i| f64::from(f32::from_le_bytes(self.at(offset + 4 * i))))
    }

    fn f64s<const N: usize>(&self, offset: usize) -> [f64; N] {
        std::array::from_fn(|i| f64::from_le_bytes(self.at(offset + 8 * i)))
    }
}

impl Header {
    /// Reads the header from the start of a stream.
    pub(super) fn read(stream: &mut Stream<'_>) -> Result<Self, FormatError> {
        let file = stream.file.clone();
        stream.require(NIFTI1_BYTES as u64)?;
        let mut bytes = [0; NIFTI2_BYTES];
        stream.read_exact(&mut bytes[..NIFTI1_BYTES])?;
        let Some(kind) = recognise(&bytes[..NIFTI1_BYTES]) else {
            return Err(not_recognised(&file, &bytes));
        };
        if kind.is_nifti2 {
            stream.read_exact(&mut bytes[NIFTI1_BYTES..])?;
        }
        let bytes = Bytes { bytes: &bytes, big: kind.endian == Endian::Big };
        if kind.is_nifti2 { Self::nifti2(&file, kind, &bytes) } else { Self::nifti1(&file, kind, &bytes) }
    }

    fn nifti1(file: &str, kind: Kind, bytes: &Bytes<'_>) -> Result<Self, FormatError> {
        // A float in version 1. Files beyond 2^24 bytes of header do not exist.
        let [vox_offset] = bytes.f32s(108);
        if !(vox_offset >= 0.0 && vox_offset <= u32::MAX.into() && vox_offset.fract() == 0.0) {
            return Err(bad_offset(file, vox_offset));
        }
        let [scl_slope, scl_inter] = bytes.f32s(112);
        Ok(Self {
            is_nifti2: false,
            endian: kind.endian,
            is_pair: kind.is_pair,
            dim: std::array::from_fn(|i| bytes.i16(40 + 2 * i).into()),
            datatype: bytes.i16(70),
            pixdim: bytes.f32s(76),
            vox_offset: vox_offset as u64,
            scl_slope,
            scl_inter,
            xyzt_units: bytes.at::<1>(123)[0].into(),
            qform_code: bytes.i16(252).into(),
            sform_code: bytes.i16(254).into(),
            intent_code: bytes.i16(68).into(),
            quatern: bytes.f32s(256),
            qoffset: bytes.f32s(268),
            srow: [bytes.f32s(280), bytes.f32s(296), bytes.f32s(312)],
        })
    }

    fn nifti2(file: &str, kind: Kind, bytes: &Bytes<'_>) -> Result<Self, FormatError> {
        let vox_offset = bytes.i64(168);
        let [scl_slope, scl_inter] = bytes.f64s(176);
        Ok(Self {
            is_nifti2: true,
            endian: kind.endian,
            is_pair: kind.is_pair,
            dim: std::array::from_fn(|i| bytes.i64(16 + 8 * i)),
            datatype: bytes.i16(12),
            pixdim: bytes.f64s(104),
            vox_offset: u64::try_from(vox_offset).map_err(|_| bad_offset(file, vox_offset))?,
            scl_slope,
            scl_inter,
            xyzt_units: bytes.i32(500),
            qform_code: bytes.i32(344),
            sform_code: bytes.i32(348),
            intent_code: bytes.i32(504),
            quatern: bytes.f64s(352),
            qoffset: bytes.f64s(376),
            srow: [bytes.f64s(400), bytes.f64s(432), bytes.f64s(464)],
        })
    }

    /// Rounding of the header's floats, relative.
    pub(super) fn epsilon(&self) -> f64 {
        if self.is_nifti2 { f64::EPSILON } else { f32::EPSILON.into() }
    }

    /// Unit of length, where the file states one.
    pub(super) fn spacing_unit(&self) -> Option<&'static str> {
        match self.xyzt_units & 7 {
            1 => Some("m"),
            2 => Some("mm"),
            3 => Some("um"),
            _ => None,
        }
    }

    /// Moves a single file's stream from behind the header to the first voxel, over extensions.
    pub(super) fn skip_extensions(
        &self,
        stream: &mut Stream<'_>,
        options: &ReadOptions<'_>,
    ) -> Result<(), FormatError> {
        let header_bytes = if self.is_nifti2 { NIFTI2_BYTES } else { NIFTI1_BYTES } as u64;
        let first = header_bytes + EXTENDER_BYTES;
        // 0 is what careless writers leave there; nothing else can lie before the voxels.
        let offset = if self.vox_offset == 0 { first } else { self.vox_offset };
        if offset < header_bytes {
            let expected = format!("at least {first}, the end of the header");
            return Err(FormatError::field(&stream.file, "vox_offset", offset, expected));
        }
        let mut position = header_bytes;
        if offset >= first {
            let mut extender = [0; EXTENDER_BYTES as usize];
            stream.read_exact(&mut extender)?;
            position = first;
            while extender[0] != 0 && offset - position >= EXTENSION_HEAD_BYTES {
                position += self.skip_extension(stream, offset - position, options)?;
            }
        }
        skip_to_voxels(stream, offset, position, options)
    }

    /// Skips one extension that must end within `room` bytes; returns its size.
    fn skip_extension(
        &self,
        stream: &mut Stream<'_>,
        room: u64,
        options: &ReadOptions<'_>,
    ) -> Result<u64, FormatError> {
        let mut size = [0; 4];
        let mut code = [0; 4];
        stream.read_exact(&mut size)?;
        stream.read_exact(&mut code)?;
        let size = match self.endian {
            Endian::Little => i32::from_le_bytes(size),
            Endian::Big => i32::from_be_bytes(size),
        };
        let limit = room.min(options.limits.max_header_bytes);
        let bytes = u64::try_from(size)
            .ok()
            .filter(|bytes| (EXTENSION_HEAD_BYTES..=limit).contains(bytes))
            .ok_or_else(|| {
            let expected =
                format!("a size from {EXTENSION_HEAD_BYTES} to {limit}, the room before the voxels");
            FormatError::field(&stream.file, "extension esize", size, expected)
        })?;
        stream.skip(bytes - EXTENSION_HEAD_BYTES, &mut Progress::new(&|_| {}, 1))?;
        Ok(bytes)
    }
}

fn bad_offset(file: &str, got: impl std::fmt::Display) -> FormatError {
    FormatError::field(file, "vox_offset", got, "a whole number of bytes inside the file")
}

/// Says which of the two marks of a header is wrong.
fn not_recognised(file: &str, bytes: &[u8; NIFTI2_BYTES]) -> FormatError {
    let size = [bytes[0], bytes[1], bytes[2], bytes[3]];
    let (little, big) = (i32::from_le_bytes(size), i32::from_be_bytes(size));
    let sizes = [NIFTI1_BYTES as i32, NIFTI2_BYTES as i32];
    if sizes.contains(&little) || sizes.contains(&big) {
        let is_first = little == sizes[0] || big == sizes[0];
        let magic = if is_first { &bytes[344..348] } else { &bytes[4..12] };
        let expected = "n+1 or ni1 (NIfTI-1), or n+2 or ni2 (NIfTI-2); ANALYZE files without a \
                        magic are not read, as they do not say where left is";
        return FormatError::field(file, "magic", String::from_utf8_lossy(magic), expected);
    }
    let expected = "348 (NIfTI-1) or 540 (NIfTI-2), in either byte order";
    FormatError::field(file, "sizeof_hdr", little, expected)
}
