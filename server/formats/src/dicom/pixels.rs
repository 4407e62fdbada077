//! One frame's pixels: where its bytes are, and how samples become stored values.

use std::borrow::Cow;
use std::ops::Range;

use super::codec::{self, Shape};
use super::elements::number;
use super::header::{Codec, Image, Pixels};
use crate::error::FormatError;

/// Start of a JPEG family stream: one such fragment per frame where there is no offset table.
const STARTS: [[u8; 3]; 2] = [[0xFF, 0xD8, 0xFF], [0xFF, 0x4F, 0xFF]];

/// Stored values of a frame, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Plane {
    /// Integers, of at most 32 bits.
    Integers(Vec<i64>),
    /// Floats.
    Floats(Vec<f64>),
}

impl Image {
    /// Pixels of a frame.
    pub(super) fn plane_len(&self) -> usize {
        self.rows * self.columns
    }

    /// Whether values are stored as floats.
    pub(super) fn is_float(&self) -> bool {
        !matches!(self.pixels, Pixels::Integers(_) | Pixels::Fragments(_))
    }

    /// Refuses a file that has fewer bytes of pixels than its header promises; to be called
    /// before memory is reserved for them.
    pub(super) fn check_length(&self, file: &str) -> Result<(), FormatError> {
        let place = match &self.pixels {
            Pixels::Integers(place) | Pixels::Floats(place) | Pixels::Doubles(place) => place,
            Pixels::Fragments(fragments) => {
                if fragments.len() < 2 {
                    return Err(FormatError::corrupt(file, "the compressed pixel data are empty"));
                }
                return self.frame_fragments(file, 0).map(drop);
            }
        };
        if self.codec != Codec::Native {
            return Err(FormatError::corrupt(
                file,
                "the pixel data are not compressed, though the header says so",
            ));
        }
        let needed = self.plane_len() as u64 * self.frames.len() as u64 * u64::from(self.bits_allocated / 8);
        match needed <= place.len() as u64 {
            true => Ok(()),
            false => Err(FormatError::Truncated {
                file: file.to_owned(),
                needed,
                available: format!("{} are there", place.len()),
            }),
        }
    }

    /// Decodes a frame.
    pub(super) fn plane(&self, file: &str, frame: usize) -> Result<Plane, FormatError> {
        let place = |all: &Range<usize>, bytes: usize| {
            let plane_bytes = self.plane_len() * bytes;
            let start = all.start + frame * plane_bytes;
            self.data
                .get(start..start + plane_bytes)
                .ok_or_else(|| FormatError::corrupt(file, "the pixel data end too early"))
        };
        let big = self.big;
        match &self.pixels {
            Pixels::Floats(all) => {
                let bytes = place(all, 4)?.chunks_exact(4);
                let values = bytes.map(|b| f64::from(f32::from_bits(number(b, big) as u32)));
                Ok(Plane::Floats(values.collect()))
            }
            Pixels::Doubles(all) => {
                let values = place(all, 8)?.chunks_exact(8).map(|b| f64::from_bits(number(b, big)));
                Ok(Plane::Floats(values.collect()))
            }
            Pixels::Integers(all) => {
                let per_sample = self.bits_allocated as usize / 8;
                let bytes = place(all, per_sample)?.chunks_exact(per_sample);
                let shift = self.high_bit + 1 - self.bits_stored;
                Ok(Plane::Integers(bytes.map(|b| self.stored(number(b, big) as u32, shift)).collect()))
            }
            Pixels::Fragments(_) => {
                let shape =
                    Shape { rows: self.rows, columns: self.columns, bits_allocated: self.bits_allocated };
                let compressed = self.frame_fragments(file, frame)?;
                let samples = codec::decode(self.codec, &compressed, shape).map_err(|why| {
                    FormatError::corrupt(file, format!("frame {} cannot be decoded: {why}", frame + 1))
                })?;
                // RLE keeps samples as they were; the others align them at the lowest bit.
                let rle = self.codec == Codec::Rle;
                let shift = if rle { self.high_bit + 1 - self.bits_stored } else { 0 };
                Ok(Plane::Integers(samples.iter().map(|sample| self.stored(*sample, shift)).collect()))
            }
        }
    }

    /// The stored bits of a sample as a number; other bits (overlays once lay there) are masked.
    fn stored(&self, sample: u32, shift: u32) -> i64 {
        let unused = 32 - self.bits_stored;
        let aligned = sample >> shift << unused;
        match self.signed {
            true => i64::from(aligned as i32 >> unused),
            false => i64::from(aligned >> unused),
        }
    }

    /// The compressed bytes of a frame: one fragment, or several put together.
    fn frame_fragments(&self, file: &str, frame: usize) -> Result<Cow<'_, [u8]>, FormatError> {
        let Pixels::Fragments(all) = &self.pixels else {
            return Err(FormatError::corrupt(file, "the pixel data are not compressed"));
        };
        let Some((table, fragments)) = all.split_first() else {
            return Err(FormatError::corrupt(file, "the compressed pixel data are empty"));
        };
        let count = self.frames.len();
        let own = if count == 1 {
            fragments
        } else if fragments.len() == count {
            &fragments[frame..=frame]
        } else {
            let starts = self.starts(table.clone(), fragments);
            let first = starts.get(frame).copied().filter(|_| starts.len() == count);
            let Some(first) = first else {
                let got = format!("{} fragments", fragments.len());
                let expected = format!("a way to tell its {count} frames apart");
                return Err(FormatError::field(file, "PixelData", got, expected));
            };
            &fragments[first..starts.get(frame + 1).copied().unwrap_or(fragments.len())]
        };
        match own {
            [one] => Ok(Cow::Borrowed(&self.data[one.clone()])),
            several => {
                Ok(Cow::Owned(several.iter().flat_map(|place| &self.data[place.clone()]).copied().collect()))
            }
        }
    }

    /// The first fragment of each frame: from the offset table, or by how fragments begin.
    fn starts(&self, table: Range<usize>, fragments: &[Range<usize>]) -> Vec<usize> {
        let base = fragments.first().map_or(0, |first| first.start);
        let by_table: Vec<usize> = self.data[table]
            .chunks_exact(4)
            .filter_map(|offset| {
                let at = base.checked_add(number(offset, false) as usize)?;
                fragments.binary_search_by_key(&at, |place| place.start).ok()
            })
            .collect();
        if by_table.len() == self.frames.len() && by_table.is_sorted() {
            return by_table;
        }
        let begins = |place: &Range<usize>| {
            let bytes = &self.data[place.clone()];
            STARTS.iter().any(|start| bytes.starts_with(start))
        };
        (0..fragments.len()).filter(|&index| begins(&fragments[index])).collect()
    }
}
