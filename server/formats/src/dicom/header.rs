//! What is taken from a DICOM file: the image and its place. Nothing that names a patient.

use std::io::Read;
use std::ops::Range;

use flate2::bufread::DeflateDecoder;

use super::elements::{Encoding, Event, PIXEL_DATA, Tag, Walker, number};
use super::frames::{Frame, Groups, PER_FRAME, SHARED};
use crate::Limits;
use crate::error::{FormatError, quoted};
use crate::orientation::Vec3;

/// Bytes from the front that [`is_dicom`] looks at.
pub(super) const DETECTION_BYTES: usize = 144;
const PREAMBLE_BYTES: usize = 128;
const MAGIC: &[u8] = b"DICM";
/// Most frames of a file.
pub(super) const MAX_FRAMES: usize = 1 << 16;
/// Largest text value that is taken, bytes; those of series are shorter by far.
const MAX_TEXT_BYTES: usize = 1 << 10;

/// How pixels are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Codec {
    Native,
    Rle,
    Jpeg,
    JpegLs,
    Jpeg2000,
}

/// Where the pixels of a file are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Pixels {
    /// Integers of `bits_allocated` bits.
    Integers(Range<usize>),
    /// 32-bit floats.
    Floats(Range<usize>),
    /// 64-bit floats.
    Doubles(Range<usize>),
    /// Compressed: offset table, then fragments.
    Fragments(Vec<Range<usize>>),
}

/// A DICOM file with an image.
pub(super) struct Image {
    /// The data set, inflated where it was deflated; places of pixels count in it.
    pub(super) data: Vec<u8>,
    pub(super) big: bool,
    pub(super) codec: Codec,
    pub(super) pixels: Pixels,
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) bits_allocated: u32,
    pub(super) bits_stored: u32,
    pub(super) high_bit: u32,
    pub(super) signed: bool,
    pub(super) inverted: bool,
    pub(super) padding: Option<i64>,
    pub(super) modality: String,
    pub(super) series_uid: String,
    pub(super) series_number: i64,
    pub(super) description: String,
    pub(super) instance: i64,
    pub(super) frames: Vec<Frame>,
    /// Edge along the slices' normal as the tags state it; the positions decide where there are
    /// several.
    pub(super) stated_step: Option<f64>,
}

/// Whether a file starts as DICOM files do: by its magic, or without a preamble by its first
/// element.
pub(super) fn is_dicom(start: &[u8]) -> bool {
    if start.get(PREAMBLE_BYTES..).is_some_and(|rest| rest.starts_with(MAGIC)) {
        return true;
    }
    bare_start(start).is_some()
}

/// How a file without preamble is written, judged by its first element: file meta information
/// (`Some(None)`), or the data set at once.
fn bare_start(start: &[u8]) -> Option<Option<Encoding>> {
    let first = start.get(..8)?;
    if first.starts_with(b"\x02\x00\x00\x00UL") {
        return Some(None);
    }
    // Group 8 opens data sets: its length, character set, image type, class, instance.
    let [8, 0, 0 | 5 | 8 | 0x16 | 0x18, 0] = first[..4] else { return None };
    match &first[4..6] {
        b"UL" | b"CS" | b"UI" => Some(Some(Encoding { explicit: true, big: false })),
        _ if (1..=64).contains(&number(&first[4..8], false)) => {
            Some(Some(Encoding { explicit: false, big: false }))
        }
        _ => None,
    }
}

struct Syntax {
    encoding: Encoding,
    deflated: bool,
    codec: Codec,
}

fn syntax(file: &str, uid: &str) -> Result<Syntax, FormatError> {
    let (explicit, big, deflated) = match uid {
        "1.2.840.10008.1.2" => (false, false, false),
        "1.2.840.10008.1.2.2" => (true, true, false),
        "1.2.840.10008.1.2.1.99" => (true, false, true),
        _ => (true, false, false),
    };
    let codec = match uid.strip_prefix("1.2.840.10008.1.2") {
        Some("" | ".1" | ".2" | ".1.99") => Codec::Native,
        Some(".5") => Codec::Rle,
        Some(".4.50" | ".4.51" | ".4.57" | ".4.70") => Codec::Jpeg,
        Some(".4.80" | ".4.81") => Codec::JpegLs,
        Some(".4.90" | ".4.91") => Codec::Jpeg2000,
        _ => {
            return Err(FormatError::unsupported(
                file,
                format!("transfer syntax {}", quoted(uid)),
                "convert the files, for example to Explicit VR Little Endian",
            ));
        }
    };
    Ok(Syntax { encoding: Encoding { explicit, big }, deflated, codec })
}

/// Reads a file's headers. `None` for files without an image: reports, directories.
///
/// # Errors
/// Damage, values that cannot be right, and what is not supported; the message names the file.
pub(super) fn parse(file: &str, data: Vec<u8>, limits: &Limits) -> Result<Option<Image>, FormatError> {
    let (syntax, start) = read_meta(file, &data)?;
    let (data, start) = match syntax.deflated {
        true => (inflate(file, data.get(start..).unwrap_or_default(), limits)?, 0),
        false => (data, start),
    };
    let mut fields = Fields::default();
    let pixels = collect(file, &data, start, syntax.encoding, &mut fields)?;
    let Some(pixels) = pixels else { return Ok(None) };
    build(file, data, &syntax, pixels, fields).map(Some)
}

/// Transfer syntax, and where the data set begins.
fn read_meta(file: &str, data: &[u8]) -> Result<(Syntax, usize), FormatError> {
    const META: Encoding = Encoding { explicit: true, big: false };
    const GROUP_LENGTH: Tag = 0x0002_0000;
    const TRANSFER_SYNTAX: Tag = 0x0002_0010;
    let native = |encoding| Syntax { encoding, deflated: false, codec: Codec::Native };
    let has_magic = data.get(PREAMBLE_BYTES..).is_some_and(|rest| rest.starts_with(MAGIC));
    let begin = match (has_magic, bare_start(data)) {
        (true, _) => PREAMBLE_BYTES + MAGIC.len(),
        (false, Some(None)) => 0,
        (false, Some(Some(encoding))) => return Ok((native(encoding), 0)),
        (false, None) => return Err(FormatError::corrupt(file, "not a DICOM file")),
    };
    let mut at = begin;
    let mut end = None;
    let mut uid = None;
    // Each element stands alone, as what follows the group may be written differently.
    while data.get(at..at + 2) == Some(&[2, 0]) && end.is_none_or(|end| at < end) {
        let mut walker = Walker::new(file, data, at, META, &[]);
        let Some(Event::Element(tag, value)) = walker.next()? else { break };
        at = value.end;
        match tag {
            GROUP_LENGTH => end = Some(at.saturating_add(number(&data[value], false) as usize)),
            TRANSFER_SYNTAX => uid = Some(text(&data[value])),
            _ => {}
        }
    }
    match uid {
        Some(uid) => Ok((syntax(file, &uid)?, at)),
        None => Err(FormatError::missing(file, "TransferSyntaxUID", "the file meta information to name it")),
    }
}

fn inflate(file: &str, compressed: &[u8], limits: &Limits) -> Result<Vec<u8>, FormatError> {
    let limit = limits.max_voxel_bytes.saturating_add(limits.max_header_bytes);
    let mut data = Vec::new();
    DeflateDecoder::new(compressed)
        .take(limit.saturating_add(1))
        .read_to_end(&mut data)
        .map_err(|error| FormatError::corrupt(file, format!("the deflated data are damaged ({error})")))?;
    if data.len() as u64 > limit {
        return Err(FormatError::TooLarge {
            file: file.to_owned(),
            what: "bytes of a deflated DICOM file",
            got: format!("more than {limit}"),
            limit,
        });
    }
    Ok(data)
}

/// Values as the data set has them, before they are judged.
#[derive(Default)]
struct Fields {
    rows: Option<u64>,
    columns: Option<u64>,
    samples: Option<u64>,
    photometric: String,
    bits_allocated: Option<u64>,
    bits_stored: Option<u64>,
    high_bit: Option<u64>,
    signed: bool,
    frame_count: Option<i64>,
    padding: Option<u64>,
    modality: String,
    series_uid: String,
    series_number: i64,
    description: String,
    instance: i64,
    dose_scaling: Option<f64>,
    frame_offsets: Vec<f64>,
    /// Spacing of a projection's detector, used where there is no other.
    detector_spacing: Option<[f64; 2]>,
    groups: Groups,
}

fn collect(
    file: &str,
    data: &[u8],
    start: usize,
    encoding: Encoding,
    fields: &mut Fields,
) -> Result<Option<Pixels>, FormatError> {
    let mut walker = Walker::new(file, data, start, encoding, &super::frames::WANTED);
    let mut path: Vec<Tag> = Vec::new();
    while let Some(event) = walker.next()? {
        match event {
            Event::Fragments(fragments) => return Ok(Some(Pixels::Fragments(fragments))),
            Event::Element(PIXEL_DATA, value) if path.is_empty() => {
                return Ok(Some(Pixels::Integers(value)));
            }
            Event::Element(0x7FE0_0008, value) if path.is_empty() => {
                return Ok(Some(Pixels::Floats(value)));
            }
            Event::Element(0x7FE0_0009, value) if path.is_empty() => {
                return Ok(Some(Pixels::Doubles(value)));
            }
            Event::Element(tag, value) => {
                let value = &data[value];
                match path[..] {
                    [] => fields.element(tag, value, encoding.big),
                    [group @ (SHARED | PER_FRAME), _] => fields.groups.element(group, tag, value, encoding),
                    _ => {}
                }
            }
            Event::SequenceStart(tag) => path.push(tag),
            Event::SequenceEnd => {
                path.pop();
            }
            Event::ItemStart if path[..] == [PER_FRAME] => {
                if !fields.groups.begin_frame() {
                    let expected = format!("at most {MAX_FRAMES} frames");
                    return Err(FormatError::field(
                        file,
                        "PerFrameFunctionalGroupsSequence",
                        "more",
                        expected,
                    ));
                }
            }
            Event::ItemStart | Event::ItemEnd => {}
        }
    }
    Ok(None)
}

impl Fields {
    fn element(&mut self, tag: Tag, value: &[u8], big: bool) {
        let short = || (value.len() >= 2).then(|| number(&value[..2], big));
        match tag {
            0x0008_0060 => self.modality = text(value),
            0x0008_103E => self.description = text(value),
            0x0020_000E => self.series_uid = text(value),
            0x0020_0011 => self.series_number = integer(value).unwrap_or(0),
            0x0020_0013 => self.instance = integer(value).unwrap_or(0),
            0x0028_0002 => self.samples = short(),
            0x0028_0004 => self.photometric = text(value),
            0x0028_0008 => self.frame_count = integer(value),
            0x0028_0010 => self.rows = short(),
            0x0028_0011 => self.columns = short(),
            0x0028_0100 => self.bits_allocated = short(),
            0x0028_0101 => self.bits_stored = short(),
            0x0028_0102 => self.high_bit = short(),
            0x0028_0103 => self.signed = short() == Some(1),
            0x0028_0120 => self.padding = short(),
            0x0018_1164 | 0x0018_2010 => self.detector_spacing = decimals(value),
            0x3004_000C => self.frame_offsets = all_decimals(value),
            0x3004_000E => self.dose_scaling = decimals(value).map(|[value]| value),
            _ => self.groups.root(tag, value),
        }
    }
}

fn build(
    file: &str,
    data: Vec<u8>,
    syntax: &Syntax,
    pixels: Pixels,
    fields: Fields,
) -> Result<Image, FormatError> {
    let refuse = |field: &str, got: String, expected: &str| FormatError::field(file, field, got, expected);
    let edge = |name: &str, value: Option<u64>| match value.and_then(|n| usize::try_from(n).ok()) {
        Some(edge @ 1..) => Ok(edge),
        _ => Err(refuse(name, format!("{value:?}"), "at least 1")),
    };
    let rows = edge("Rows", fields.rows)?;
    let columns = edge("Columns", fields.columns)?;
    let gray = fields.photometric.starts_with("MONOCHROME");
    if fields.samples.unwrap_or(1) != 1 || !(gray || fields.photometric.is_empty()) {
        let what = format!("a colour image ({})", quoted(&fields.photometric));
        return Err(FormatError::unsupported(file, what, "volumes are of one value per voxel"));
    }
    let bits_allocated = match &pixels {
        Pixels::Floats(_) => 32,
        Pixels::Doubles(_) => 64,
        _ => match fields.bits_allocated {
            Some(bits @ (8 | 16 | 32)) => bits as u32,
            Some(1) => {
                let help = "convert the segmentation to a label map of 8-bit voxels";
                return Err(FormatError::unsupported(file, "an image of single bits", help));
            }
            other => return Err(refuse("BitsAllocated", format!("{other:?}"), "8, 16 or 32")),
        },
    };
    let stored = fields.bits_stored.unwrap_or(u64::from(bits_allocated));
    let bits_stored = match stored {
        1.. if stored <= u64::from(bits_allocated) => stored as u32,
        _ => {
            let expected = format!("from 1 to BitsAllocated, {bits_allocated}");
            return Err(refuse("BitsStored", stored.to_string(), &expected));
        }
    };
    let high = fields.high_bit.unwrap_or(u64::from(bits_stored) - 1);
    if high + 1 < u64::from(bits_stored) || high >= u64::from(bits_allocated) {
        let expected = format!("from BitsStored - 1 to {}", bits_allocated - 1);
        return Err(refuse("HighBit", high.to_string(), &expected));
    }
    let count = fields.frame_count.unwrap_or(1);
    let frame_count = match usize::try_from(count) {
        Ok(count @ 1..=MAX_FRAMES) => count,
        _ => {
            let expected = format!("from 1 to {MAX_FRAMES}");
            return Err(refuse("NumberOfFrames", count.to_string(), &expected));
        }
    };
    let padding = fields.padding.map(|raw| match fields.signed {
        true => i64::from(raw as u16 as i16),
        false => raw as i64,
    });
    let mut frames = fields.groups.into_frames(frame_count, fields.detector_spacing);
    for frame in &mut frames.list {
        if let Some(scaling) = fields.dose_scaling {
            (frame.slope, frame.intercept) = (scaling, 0.0);
        }
        frame.check_orientation(file)?;
    }
    move_along_normal(&mut frames.list, &fields.frame_offsets);
    Ok(Image {
        data,
        big: syntax.encoding.big,
        codec: syntax.codec,
        pixels,
        rows,
        columns,
        bits_allocated,
        bits_stored,
        high_bit: high as u32,
        signed: fields.signed,
        inverted: fields.photometric == "MONOCHROME1",
        padding,
        modality: fields.modality,
        series_uid: fields.series_uid,
        series_number: fields.series_number,
        description: fields.description,
        instance: fields.instance,
        frames: frames.list,
        stated_step: frames.stated_step,
    })
}

/// Dose grids have one position and a list of offsets along the normal.
fn move_along_normal(frames: &mut [Frame], offsets: &[f64]) {
    let Some(first) = offsets.first() else { return };
    if offsets.len() != frames.len() {
        return;
    }
    for (frame, offset) in frames.iter_mut().zip(offsets) {
        if let (Some(position), Some(normal)) = (frame.position, frame.normal()) {
            frame.position = Some([0, 1, 2].map(|k| position[k] + (offset - first) * normal[k]));
        }
    }
}

/// A text value without padding.
pub(super) fn text(value: &[u8]) -> String {
    let value = &value[..value.len().min(MAX_TEXT_BYTES)];
    String::from_utf8_lossy(value).trim_matches(['\0', ' ']).to_owned()
}

fn integer(value: &[u8]) -> Option<i64> {
    text(value).split('\\').next()?.trim().parse().ok()
}

/// Exactly `N` decimal strings.
pub(super) fn decimals<const N: usize>(value: &[u8]) -> Option<[f64; N]> {
    let all: Vec<f64> = text(value).split('\\').map_while(|part| part.trim().parse().ok()).collect();
    all.get(..N)?.try_into().ok()
}

fn all_decimals(value: &[u8]) -> Vec<f64> {
    let parts = value.split(|byte| *byte == b'\\').take(MAX_FRAMES);
    parts.map_while(|part| text(part).trim().parse().ok()).filter(|v: &f64| v.is_finite()).collect()
}

/// A position or direction.
pub(super) fn vector(value: &[u8]) -> Option<Vec3> {
    decimals(value).filter(|v: &Vec3| v.iter().all(|c| c.is_finite()))
}
