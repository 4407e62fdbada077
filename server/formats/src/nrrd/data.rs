//! Where the voxels of an NRRD file are: after the header, in another file, or in several.

use std::path::{Component, Path, PathBuf};

use proto::scene_file::VoxelType;

use super::Encoding;
use super::header::{Header, is_list};
use crate::ReadOptions;
use crate::error::{FormatError, quoted};
use crate::stream::{Progress, Stream};
use crate::text::{TextKind, TextReader};
use crate::voxels::type_bytes;

/// Most files the voxels may be spread over.
const MAX_DATA_FILES: usize = 1 << 14;
/// Most digits a number in a file name pattern is padded to.
const MAX_PATTERN_WIDTH: usize = 32;

/// Everything needed to open the data of a header.
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) header: &'a Header,
    pub(super) encoding: Encoding,
    pub(super) voxel_type: VoxelType,
    pub(super) options: &'a ReadOptions<'a>,
}

/// Bytes to skip before the voxels.
#[derive(Clone, Copy)]
enum ByteSkip {
    Bytes(u64),
    /// The voxels are the last bytes of the file.
    FromEnd,
}

impl<'a> Source<'a> {
    /// Opens the data as one stream of `total_bytes` decoded bytes, of which it is certain that
    /// they can come. `attached` stands behind the header.
    pub(super) fn open(self, attached: Stream<'a>, total_bytes: u64) -> Result<Stream<'a>, FormatError> {
        let Some(value) = self.header.get("datafile") else {
            return self.decode(attached, total_bytes);
        };
        let names = self.data_files(value)?;
        let count = names.len() as u64;
        if count == 0 || !total_bytes.is_multiple_of(count) {
            let expected = format!("a number of files that divides the {total_bytes} bytes of data");
            let got = format!("{count} files");
            return Err(FormatError::field(&self.header.file, "data file", got, expected));
        }
        let paths: Vec<PathBuf> = names.iter().map(|name| self.resolve(name)).collect::<Result<_, _>>()?;
        let part_bytes = total_bytes / count;
        if let [path] = paths.as_slice() {
            return self.decode(Stream::open(path)?, part_bytes);
        }
        for path in &paths {
            self.decode(Stream::open(path)?, part_bytes)?;
        }
        let file = self.header.file.clone();
        let open = move |part: usize| match paths.get(part) {
            Some(path) => self.decode(Stream::open(path)?, part_bytes),
            None => Err(FormatError::corrupt(&self.header.file, "a data file is missing")),
        };
        Ok(Stream::parts(file, count as usize, part_bytes, Box::new(open)))
    }

    /// Applies skips and encoding to one file, and makes sure that it can hold the bytes.
    fn decode(&self, mut stream: Stream<'a>, bytes: u64) -> Result<Stream<'a>, FormatError> {
        stream.skip_lines(self.skip_field("lineskip", "line skip")?)?;
        let skip = self.byte_skip()?;
        if self.encoding == Encoding::Gzip {
            stream = stream.into_gzip()?;
        }
        match skip {
            ByteSkip::Bytes(0) => {}
            // The skipped bytes are decoded ones; text encodings skip characters.
            ByteSkip::Bytes(n) => stream.skip(n, &mut Progress::new(&|_| {}, 1))?,
            ByteSkip::FromEnd => {
                stream.require(bytes)?;
                let n = stream.at_most() - bytes;
                stream.skip(n, &mut Progress::new(&|_| {}, 1))?;
            }
        }
        let kind = match self.encoding {
            Encoding::Raw | Encoding::Gzip => None,
            Encoding::Ascii => Some((TextKind::Numbers(self.voxel_type), type_bytes(self.voxel_type))),
            Encoding::Hex => Some((TextKind::Hex, 1)),
        };
        if let Some((kind, bytes_per_pair)) = kind {
            stream = stream.into_text(|reader| TextReader::new(reader, kind), bytes_per_pair)?;
        }
        stream.require(bytes)?;
        Ok(stream)
    }

    fn byte_skip(&self) -> Result<ByteSkip, FormatError> {
        if self.header.get("byteskip") != Some("-1") {
            return Ok(ByteSkip::Bytes(self.skip_field("byteskip", "byte skip")?));
        }
        if self.encoding != Encoding::Raw {
            let expected = "-1 with the encoding raw only";
            return Err(FormatError::field(&self.header.file, "byte skip", "-1", expected));
        }
        Ok(ByteSkip::FromEnd)
    }

    fn skip_field(&self, name: &str, shown_name: &str) -> Result<u64, FormatError> {
        let Some(text) = self.header.get(name) else {
            return Ok(0);
        };
        text.parse().map_err(|_| {
            let or_end = if name == "byteskip" { ", or -1 for the end of the file" } else { "" };
            let expected = format!("a whole number of at least 0{or_end}");
            FormatError::field(&self.header.file, shown_name, text, expected)
        })
    }

    /// Names of the data files in the order of their slices.
    fn data_files(&self, value: &str) -> Result<Vec<String>, FormatError> {
        let too_many = |count: String| FormatError::TooLarge {
            file: self.header.file.clone(),
            what: "data files",
            got: count,
            limit: MAX_DATA_FILES as u64,
        };
        if is_list(value) {
            let names = &self.header.listed_files;
            if names.len() > MAX_DATA_FILES {
                return Err(too_many(names.len().to_string()));
            }
            return Ok(names.clone());
        }
        // `NAME%03d.raw FIRST LAST STEP [DIMENSION]`; anything else is a name, blanks and all.
        let words: Vec<&str> = value.split_whitespace().collect();
        let numbers: Vec<i64> = words.iter().skip(1).map_while(|w| w.parse().ok()).collect();
        if !value.contains('%') || numbers.len() < 3 || numbers.len() + 1 != words.len() {
            return Ok(vec![value.to_owned()]);
        }
        let error = |expected: &str| FormatError::field(&self.header.file, "data file", value, expected);
        let pattern = Pattern::parse(words[0])
            .ok_or_else(|| error("a pattern with one number, like slice%03d.raw 1 20 1"))?;
        let (first, last, step) = (numbers[0], numbers[1], numbers[2]);
        let span = i128::from(last) - i128::from(first);
        if step == 0 || span.signum() * i128::from(step).signum() < 0 {
            return Err(error("first, last and a step that leads from one to the other"));
        }
        let count = span / i128::from(step) + 1;
        if count > MAX_DATA_FILES as i128 {
            return Err(too_many(count.to_string()));
        }
        Ok((0..count).map(|i| pattern.name(i128::from(first) + i * i128::from(step))).collect())
    }

    /// Path of a data file, which must be another one than the header.
    fn resolve(&self, name: &str) -> Result<PathBuf, FormatError> {
        let error = |got: String, expected: &str| FormatError::Field {
            file: self.header.file.clone(),
            field: "data file".to_owned(),
            got,
            expected: expected.to_owned(),
        };
        if name.contains("://") || name.starts_with("file:") {
            return Err(error(quoted(name), "the name of a file, not an address"));
        }
        let relative = Path::new(name);
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let path = folder.join(relative);
        if self.options.siblings_only {
            let mut components = relative.components().filter(|part| !matches!(part, Component::CurDir));
            let is_plain =
                matches!((components.next(), components.next()), (Some(Component::Normal(_)), None));
            if !is_plain || name.contains('\\') {
                let expected = "the plain name of a file in the same folder as the header";
                return Err(error(quoted(name), expected));
            }
            if path.symlink_metadata().is_ok_and(|m| m.file_type().is_symlink()) {
                let expected = "a file, not a link, in the same folder as the header";
                return Err(error(quoted(name), expected));
            }
        }
        let target = path.canonicalize().map_err(|e| {
            let expected = "the name of a file that comes with the header";
            error(format!("{} ({e})", quoted(name)), expected)
        })?;
        if self.path.canonicalize().is_ok_and(|header| header == target) {
            return Err(error(quoted(name), "another file than the header itself"));
        }
        Ok(path)
    }
}

/// A file name with one number in it, as `%d`, `%3d` or `%03d`.
struct Pattern<'a> {
    before: &'a str,
    zeros: bool,
    width: usize,
    after: &'a str,
}

impl<'a> Pattern<'a> {
    fn parse(text: &'a str) -> Option<Self> {
        let (before, rest) = text.split_once('%')?;
        let (digits, after) = rest.split_once('d')?;
        if !digits.bytes().all(|b| b.is_ascii_digit()) || after.contains('%') {
            return None;
        }
        let width = if digits.is_empty() { 0 } else { digits.parse().ok()? };
        (width <= MAX_PATTERN_WIDTH).then_some(Self { before, zeros: digits.starts_with('0'), width, after })
    }

    fn name(&self, number: i128) -> String {
        let Self { before, zeros, width, after } = self;
        match zeros {
            true => format!("{before}{number:0width$}{after}"),
            false => format!("{before}{number:width$}{after}"),
        }
    }
}
