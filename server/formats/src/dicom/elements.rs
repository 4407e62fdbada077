//! Walking through the elements of a DICOM data set (PS3.5, section 7), front to back.
//!
//! An own walker: it borrows what it shows, so that nothing is reserved on a length's word, keeps
//! its place in nested sequences on a bounded stack of its own, and steps over everything that is
//! not asked for: names, dates of birth and private elements are never decoded. The decision
//! record on DICOM says how `dicom-object` compares.

use std::ops::Range;

use crate::error::FormatError;

/// Group and element number.
pub(super) type Tag = u32;

/// Deepest nesting of sequences that is followed; real files have fewer than ten levels.
const MAX_DEPTH: usize = 1024;
const UNDEFINED_LENGTH: u32 = u32::MAX;
const ITEM: Tag = 0xFFFE_E000;
const ITEM_END: Tag = 0xFFFE_E00D;
const SEQUENCE_END: Tag = 0xFFFE_E0DD;
/// Pixels as integers; of undefined length, a list of compressed fragments.
pub(super) const PIXEL_DATA: Tag = 0x7FE0_0010;
/// Value representations with a length of four bytes after two unused ones.
const LONG_LENGTHS: [&[u8; 2]; 13] =
    [b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"];

/// How the elements of a data set are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Encoding {
    /// Elements state their value representation.
    pub(super) explicit: bool,
    /// Numbers are big-endian.
    pub(super) big: bool,
}

/// What the walker meets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Event {
    /// An element with its value's place in the data.
    Element(Tag, Range<usize>),
    /// Compressed pixel data: places of offset table and fragments.
    Fragments(Vec<Range<usize>>),
    /// A sequence begins.
    SequenceStart(Tag),
    /// It ends.
    SequenceEnd,
    /// An item of a sequence begins.
    ItemStart,
    /// It ends.
    ItemEnd,
}

enum Level {
    Sequence { end: Option<usize>, outer: Encoding },
    Item { end: Option<usize> },
}

/// A walk through a data set.
pub(super) struct Walker<'a> {
    file: &'a str,
    data: &'a [u8],
    at: usize,
    encoding: Encoding,
    levels: Vec<Level>,
    /// Sequences of defined length that are entered; others are stepped over.
    wanted: &'a [Tag],
}

impl<'a> Walker<'a> {
    /// Starts at `at`.
    pub(super) fn new(
        file: &'a str,
        data: &'a [u8],
        at: usize,
        encoding: Encoding,
        wanted: &'a [Tag],
    ) -> Self {
        Self { file, data, at, encoding, levels: Vec::new(), wanted }
    }

    /// The next event; `None` at the end.
    ///
    /// # Errors
    /// Lengths beyond the data, delimiters out of place, nesting beyond [`MAX_DEPTH`].
    pub(super) fn next(&mut self) -> Result<Option<Event>, FormatError> {
        match self.levels.last() {
            Some(Level::Sequence { end: Some(end), outer }) if self.at >= *end => {
                self.encoding = *outer;
                self.levels.pop();
                Ok(Some(Event::SequenceEnd))
            }
            Some(Level::Item { end: Some(end) }) if self.at >= *end => {
                self.levels.pop();
                Ok(Some(Event::ItemEnd))
            }
            Some(Level::Sequence { .. }) => self.item(),
            // Fewer bytes than a header at the end of the data set are padding.
            None if self.data.len() - self.at < 8 => Ok(None),
            _ => self.element().map(Some),
        }
    }

    fn item(&mut self) -> Result<Option<Event>, FormatError> {
        let tag = self.tag()?;
        let length = self.u32()?;
        match tag {
            ITEM => {
                let end = self.end(tag, length)?;
                self.push(Level::Item { end })?;
                Ok(Some(Event::ItemStart))
            }
            SEQUENCE_END => {
                if let Some(Level::Sequence { outer, .. }) = self.levels.pop() {
                    self.encoding = outer;
                }
                Ok(Some(Event::SequenceEnd))
            }
            _ => Err(self.damaged(format!("{} where an item of a sequence should begin", name(tag)))),
        }
    }

    fn element(&mut self) -> Result<Event, FormatError> {
        let tag = self.tag()?;
        if tag == ITEM_END && matches!(self.levels.last(), Some(Level::Item { .. })) {
            self.u32()?;
            self.levels.pop();
            return Ok(Event::ItemEnd);
        }
        if tag >> 16 == 0xFFFE {
            return Err(self.damaged(format!("delimiter {} out of place", name(tag))));
        }
        let (representation, length) = self.representation_and_length(tag)?;
        if length == UNDEFINED_LENGTH {
            if tag == PIXEL_DATA && self.levels.is_empty() {
                return self.fragments().map(Event::Fragments);
            }
            // A sequence of unknown representation is written with implicit ones (PS3.5, 6.2.2).
            let inner = match representation {
                Some([b'U', b'N']) => Encoding { explicit: false, big: false },
                _ => self.encoding,
            };
            self.enter(None, inner)?;
            return Ok(Event::SequenceStart(tag));
        }
        let end = self.end(tag, length)?;
        if self.wanted.contains(&tag) && matches!(representation, None | Some([b'S', b'Q'])) {
            self.enter(end, self.encoding)?;
            return Ok(Event::SequenceStart(tag));
        }
        let start = self.at;
        self.at = end.unwrap_or(start);
        Ok(Event::Element(tag, start..self.at))
    }

    /// Representation if it is stated, and length of an element.
    fn representation_and_length(&mut self, tag: Tag) -> Result<(Option<[u8; 2]>, u32), FormatError> {
        if !self.encoding.explicit {
            return Ok((None, self.u32()?));
        }
        let &[a, b] = self.take(2)? else { return Err(self.too_short()) };
        if !a.is_ascii_uppercase() || !b.is_ascii_uppercase() {
            return Err(self.damaged(format!("{} has no value representation", name(tag))));
        }
        let length = if LONG_LENGTHS.contains(&&[a, b]) {
            self.take(2)?;
            self.u32()?
        } else {
            u32::from(self.u16()?)
        };
        Ok((Some([a, b]), length))
    }

    /// Items of compressed pixel data: the offset table first.
    fn fragments(&mut self) -> Result<Vec<Range<usize>>, FormatError> {
        let mut fragments = Vec::new();
        loop {
            let tag = self.tag()?;
            let length = self.u32()?;
            match tag {
                ITEM => {
                    let start = self.at;
                    let Some(end) = self.end(tag, length)? else {
                        return Err(self.damaged("a fragment of pixel data has no length".into()));
                    };
                    self.at = end;
                    fragments.push(start..end);
                }
                SEQUENCE_END => return Ok(fragments),
                _ => return Err(self.damaged(format!("{} among fragments of pixel data", name(tag)))),
            }
        }
    }

    fn enter(&mut self, end: Option<usize>, inner: Encoding) -> Result<(), FormatError> {
        let outer = std::mem::replace(&mut self.encoding, inner);
        self.push(Level::Sequence { end, outer })
    }

    fn push(&mut self, level: Level) -> Result<(), FormatError> {
        if self.levels.len() >= 2 * MAX_DEPTH {
            return Err(self.damaged(format!("sequences nested more than {MAX_DEPTH} deep")));
        }
        self.levels.push(level);
        Ok(())
    }

    /// Where a value of a length ends; `None` if it does not say.
    fn end(&self, tag: Tag, length: u32) -> Result<Option<usize>, FormatError> {
        if length == UNDEFINED_LENGTH {
            return Ok(None);
        }
        let left = self.data.len() - self.at;
        match usize::try_from(length) {
            Ok(length) if length <= left => Ok(Some(self.at + length)),
            _ => Err(FormatError::Truncated {
                file: self.file.to_owned(),
                needed: u64::from(length),
                available: format!("for element {}, and {left} are left", name(tag)),
            }),
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        let bytes = self.data.get(self.at..self.at + count).ok_or_else(|| self.too_short())?;
        self.at += count;
        Ok(bytes)
    }

    fn u16(&mut self) -> Result<u16, FormatError> {
        let big = self.encoding.big;
        Ok(self.take(2).map(|bytes| number(bytes, big))? as u16)
    }

    fn u32(&mut self) -> Result<u32, FormatError> {
        let big = self.encoding.big;
        Ok(self.take(4).map(|bytes| number(bytes, big))? as u32)
    }

    fn tag(&mut self) -> Result<Tag, FormatError> {
        Ok(u32::from(self.u16()?) << 16 | u32::from(self.u16()?))
    }

    fn too_short(&self) -> FormatError {
        self.damaged("it ends within an element".into())
    }

    fn damaged(&self, what: String) -> FormatError {
        FormatError::corrupt(self.file, format!("the DICOM data set is damaged at byte {}: {what}", self.at))
    }
}

/// An unsigned number of at most eight bytes.
pub(super) fn number(bytes: &[u8], big: bool) -> u64 {
    let join = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
    if big { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) }
}

/// A tag as people write it.
pub(super) fn name(tag: Tag) -> String {
    format!("({:04X},{:04X})", tag >> 16, tag & 0xFFFF)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(data: &[u8], explicit: bool) -> Result<Vec<Event>, FormatError> {
        let encoding = Encoding { explicit, big: false };
        let mut walker = Walker::new("a", data, 0, encoding, &[0x5200_9229]);
        let mut events = Vec::new();
        while let Some(event) = walker.next()? {
            events.push(event);
        }
        Ok(events)
    }

    #[test]
    fn sequences_of_both_lengths_are_walked() {
        let inner = [0x28, 0, 0x30, 0, b'D', b'S', 2, 0, b'1', b' '];
        let mut data = vec![0, 0x52, 0x29, 0x92, b'S', b'Q', 0, 0, 18, 0, 0, 0];
        data.extend([0xFE, 0xFF, 0, 0xE0, 10, 0, 0, 0]);
        data.extend(inner);
        // The same in a private sequence of undefined length.
        data.extend([9, 0, 1, 0x10, b'S', b'Q', 0, 0, 255, 255, 255, 255]);
        data.extend([0xFE, 0xFF, 0, 0xE0, 255, 255, 255, 255]);
        data.extend(inner);
        data.extend([0xFE, 0xFF, 0x0D, 0xE0, 0, 0, 0, 0, 0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]);
        let found = events(&data, true).unwrap();
        let of_one = |tag, start| {
            vec![
                Event::SequenceStart(tag),
                Event::ItemStart,
                Event::Element(0x0028_0030, start..start + 2),
                Event::ItemEnd,
                Event::SequenceEnd,
            ]
        };
        assert_eq!(found, [of_one(0x5200_9229, 28), of_one(0x0009_1001, 58)].concat());
    }

    #[test]
    fn lengths_and_delimiters_that_lie_are_found() {
        let long = [0x28, 0, 0x30, 0, 0xFE, 255, 255, 255, 0];
        assert!(events(&long, false).unwrap_err().to_string().contains("(0028,0030)"));
        let stray = [0xFE, 0xFF, 0x0D, 0xE0, 0, 0, 0, 0];
        assert!(events(&stray, false).unwrap_err().to_string().contains("out of place"));
        let nested = [9, 0, 1, 0x10, 255, 255, 255, 255, 0xFE, 0xFF, 0, 0xE0, 255, 255, 255, 255];
        assert!(events(&nested.repeat(400), false).unwrap_err().to_string().contains("within"));
        assert!(events(&nested.repeat(100_000), false).unwrap_err().to_string().contains("deep"));
    }
}
