//! Pages of TIFF files, through the crate `tiff`.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use half::f16;
use proto::scene_file::VoxelType;
use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::Page;
use crate::ReadOptions;
use crate::error::FormatError;
use crate::stream::Stream;

/// Bytes of one value of a directory: strip tables of a large page, a long description.
const MAX_TAG_BYTES: usize = 16 << 20;
/// Memory for the values of a directory's entry, bytes; the decoder takes 32 bytes for each and
/// reserves them by the count that the entry states. Room for a table of four million strips.
const MAX_TABLE_BYTES: usize = 128 << 20;
/// Largest page that is decoded, bytes.
const MAX_PAGE_BYTES: u64 = 4 << 30;
/// Bytes that a compressed strip may take beyond what it decodes to.
const STRIP_SLACK_BYTES: usize = 1 << 20;
/// `NewSubfileType` of a smaller version of another page.
const REDUCED: u32 = 1;

/// A TIFF file, read page by page from front to back.
pub(super) struct TiffPages {
    file: String,
    decoder: Decoder<BufReader<File>>,
    /// Page that the decoder stands at.
    at: usize,
}

/// What a walk along all pages found.
pub(super) struct Walked {
    pub(super) page: Page,
    /// Numbers of the pages that are slices, thumbnails left out.
    pub(super) places: Vec<usize>,
}

impl TiffPages {
    /// Opens a file to look at its pages.
    pub(super) fn open(path: &Path) -> Result<Self, FormatError> {
        Self::with_room(path, 0)
    }

    /// Opens a file to decode pages of a size that has been held against the limits.
    pub(super) fn open_for(path: &Path, page: Page) -> Result<Self, FormatError> {
        Self::with_room(path, page.bytes().min(MAX_PAGE_BYTES))
    }

    fn with_room(path: &Path, page_bytes: u64) -> Result<Self, FormatError> {
        let (file, reader, _) = Stream::open(path)?.into_plain()?;
        // One limit of the decoder bounds both tables and pages.
        let room = usize::try_from(page_bytes).unwrap_or(usize::MAX).max(MAX_TABLE_BYTES);
        let mut limits = Limits::default();
        limits.ifd_value_size = MAX_TAG_BYTES;
        limits.decoding_buffer_size = room;
        limits.intermediate_buffer_size = room.saturating_add(STRIP_SLACK_BYTES);
        let decoder = Decoder::new(reader).map_err(|error| refused(&file, 0, &error))?;
        Ok(Self { file, decoder: decoder.with_limits(limits), at: 0 })
    }

    /// Text of the first page's description; empty if there is none.
    pub(super) fn description(&mut self) -> String {
        self.decoder.get_tag_ascii_string(Tag::ImageDescription).unwrap_or_default()
    }

    /// Pixels per unit along x and y, where the first page says so.
    pub(super) fn resolution(&mut self) -> [Option<f64>; 2] {
        [Tag::XResolution, Tag::YResolution].map(|tag| match self.decoder.get_tag(tag).ok()? {
            Value::Rational(numerator, denominator) => Some(f64::from(numerator) / f64::from(denominator)),
            other => other.into_f64().ok(),
        })
    }

    /// Looks at every page.
    pub(super) fn walk(
        &mut self,
        options: &ReadOptions<'_>,
        notices: &mut Vec<String>,
    ) -> Result<Walked, FormatError> {
        let mut places = Vec::new();
        let mut first: Option<Page> = None;
        let mut reduced = 0_u32;
        loop {
            let kind = self.decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType).ok().flatten();
            if kind.is_some_and(|kind| kind & REDUCED != 0) {
                reduced += 1;
            } else {
                let page = self.page()?;
                let expected = *first.get_or_insert(page);
                if page != expected {
                    return Err(different(&self.file, self.at, page, expected));
                }
                places.push(self.at);
            }
            if !self.decoder.more_images() {
                break;
            }
            if places.len() + reduced as usize >= options.limits.max_axis as usize {
                return Err(FormatError::TooLarge {
                    file: self.file.clone(),
                    what: "pages",
                    got: "more".to_owned(),
                    limit: u64::from(options.limits.max_axis),
                });
            }
            self.next()?;
        }
        if reduced > 0 {
            notices.push(format!("{reduced} pages are smaller versions of others and left out"));
        }
        let page =
            first.ok_or_else(|| FormatError::missing(&self.file, "pages", "a page of full resolution"))?;
        // The walk ends at the last page; description and resolution are those of the first.
        self.decoder.seek_to_image(0).map_err(|error| refused(&self.file, 0, &error))?;
        self.at = 0;
        Ok(Walked { page, places })
    }

    fn next(&mut self) -> Result<(), FormatError> {
        self.at += 1;
        self.decoder.next_image().map_err(|error| refused(&self.file, self.at, &error))
    }

    fn page(&mut self) -> Result<Page, FormatError> {
        let (file, at) = (&self.file, self.at);
        let decoder = &mut self.decoder;
        let (width, height) = decoder.dimensions().map_err(|error| refused(file, at, &error))?;
        let colour = decoder.colortype().map_err(|error| refused(file, at, &error))?;
        let mut tag = |tag, default: u16| -> Result<u16, FormatError> {
            let value = decoder.find_tag_unsigned_vec(tag).map_err(|error| refused(file, at, &error))?;
            Ok(value.and_then(|values| values.first().copied()).unwrap_or(default))
        };
        let format = tag(Tag::SampleFormat, 1)?;
        let planar = tag(Tag::PlanarConfiguration, 1)?;
        let components = colour.num_samples();
        if planar == 2 && components > 1 {
            return Err(FormatError::unsupported(
                file,
                "a page with its channels in separate planes",
                "write the channels interleaved, or as pages of their own",
            ));
        }
        let bits = colour.bit_depth();
        let (voxel_type, is_half) = match (format, bits) {
            (1, 8) => (VoxelType::Uint8, false),
            (1, 16) => (VoxelType::Uint16, false),
            (1, 32) => (VoxelType::Uint32, false),
            (1, 64) => (VoxelType::Uint64, false),
            (2, 8) => (VoxelType::Int8, false),
            (2, 16) => (VoxelType::Int16, false),
            (2, 32) => (VoxelType::Int32, false),
            (2, 64) => (VoxelType::Int64, false),
            (3, 16) => (VoxelType::Float32, true),
            (3, 32) => (VoxelType::Float32, false),
            (3, 64) => (VoxelType::Float64, false),
            _ => {
                return Err(FormatError::unsupported(
                    file,
                    format!("a page of {bits} bits per sample in sample format {format}"),
                    "write integers of 8, 16, 32 or 64 bits, or floats of 16, 32 or 64",
                ));
            }
        };
        Ok(Page { width, height, components, voxel_type, is_half })
    }

    /// Decodes a page, which must not lie before the last one, to little-endian bytes.
    pub(super) fn decode(&mut self, place: usize, expected: Page) -> Result<Vec<u8>, FormatError> {
        if place < self.at {
            self.decoder.seek_to_image(place).map_err(|error| refused(&self.file, place, &error))?;
            self.at = place;
        }
        while self.at < place {
            self.next()?;
        }
        let page = self.page()?;
        if page != expected {
            return Err(different(&self.file, place, page, expected));
        }
        let bytes = page.bytes();
        if bytes > MAX_PAGE_BYTES {
            return Err(FormatError::TooLarge {
                file: self.file.clone(),
                what: "bytes of a page",
                got: bytes.to_string(),
                limit: MAX_PAGE_BYTES,
            });
        }
        let result = self.decoder.read_image().map_err(|error| refused(&self.file, place, &error))?;
        let decoded = little_endian(result);
        match decoded.len() as u64 == bytes {
            true => Ok(decoded),
            false => Err(FormatError::corrupt(
                &self.file,
                format!("page {place} decodes to {} bytes, not {bytes}", decoded.len()),
            )),
        }
    }
}

fn little_endian(result: DecodingResult) -> Vec<u8> {
    macro_rules! bytes {
        ($values:expr) => {
            $values.iter().flat_map(|value| value.to_le_bytes()).collect()
        };
    }
    match result {
        DecodingResult::U8(values) => values,
        DecodingResult::I8(values) => bytes!(values),
        DecodingResult::U16(values) => bytes!(values),
        DecodingResult::I16(values) => bytes!(values),
        DecodingResult::U32(values) => bytes!(values),
        DecodingResult::I32(values) => bytes!(values),
        DecodingResult::U64(values) => bytes!(values),
        DecodingResult::I64(values) => bytes!(values),
        DecodingResult::F16(values) => {
            values.iter().flat_map(|value: &f16| value.to_f32().to_le_bytes()).collect()
        }
        DecodingResult::F32(values) => bytes!(values),
        DecodingResult::F64(values) => bytes!(values),
    }
}

fn different(file: &str, place: usize, page: Page, expected: Page) -> FormatError {
    let words = |page: Page| {
        let Page { width, height, components, voxel_type, .. } = page;
        let name = crate::voxels::type_name(voxel_type);
        format!("{width} x {height} of {components} x {name}")
    };
    FormatError::field(
        file,
        format!("page {place}"),
        words(page),
        format!("{}, as the first", words(expected)),
    )
}

fn refused(file: &str, place: usize, error: &tiff::TiffError) -> FormatError {
    FormatError::corrupt(file, format!("page {place} cannot be read: {error}"))
}
