//! Data files that a header names: one, a list, or a pattern with a number.

use std::path::{Component, Path, PathBuf};

use crate::ReadOptions;
use crate::error::{FormatError, file_name, quoted};
use crate::stream::Stream;

/// Most files the voxels may be spread over.
const MAX_DATA_FILES: usize = 1 << 14;
/// Most digits a number in a file name pattern is padded to.
const MAX_PATTERN_WIDTH: usize = 32;

/// Refuses a header that spreads its voxels over too many files.
pub(crate) fn check_count(file: &str, count: i128) -> Result<(), FormatError> {
    if count <= MAX_DATA_FILES as i128 {
        return Ok(());
    }
    Err(FormatError::TooLarge {
        file: file.to_owned(),
        what: "data files",
        got: count.to_string(),
        limit: MAX_DATA_FILES as u64,
    })
}

/// Names from `NAME%03d.raw FIRST LAST STEP [DIMENSION]`; anything else is one name, blanks and
/// all.
pub(crate) fn listed_by_pattern(file: &str, field: &str, value: &str) -> Result<Vec<String>, FormatError> {
    let words: Vec<&str> = value.split_whitespace().collect();
    let numbers: Vec<i64> = words.iter().skip(1).map_while(|w| w.parse().ok()).collect();
    if !value.contains('%') || numbers.len() < 3 || numbers.len() + 1 != words.len() {
        return Ok(vec![value.to_owned()]);
    }
    let error = |expected: &str| FormatError::field(file, field, value, expected);
    let pattern = Pattern::parse(words[0])
        .ok_or_else(|| error("a pattern with one number, like slice%03d.raw 1 20 1"))?;
    let (first, last, step) = (numbers[0], numbers[1], numbers[2]);
    let span = i128::from(last) - i128::from(first);
    if step == 0 || span.signum() * i128::from(step).signum() < 0 {
        return Err(error("first, last and a step that leads from one to the other"));
    }
    let count = span / i128::from(step) + 1;
    check_count(file, count)?;
    Ok((0..count).map(|i| pattern.name(i128::from(first) + i * i128::from(step))).collect())
}

/// The files that field `field` of the header at `header` names, one after the other, as one stream
/// of `total_bytes` decoded bytes: an equal share from each. `decode` brings a file to its decoded
/// bytes and makes sure that there can be so many; it is asked for every file before anything is
/// read.
pub(crate) fn open_all<'a>(
    header: &Path,
    field: &str,
    names: &[String],
    total_bytes: u64,
    options: &ReadOptions<'_>,
    decode: impl Fn(Stream<'a>, u64) -> Result<Stream<'a>, FormatError> + 'a,
) -> Result<Stream<'a>, FormatError> {
    let file = file_name(header);
    let count = names.len() as u64;
    if count == 0 || !total_bytes.is_multiple_of(count) {
        let expected = format!("a number of files that divides the {total_bytes} bytes of data");
        return Err(FormatError::field(&file, field, format!("{count} files"), expected));
    }
    let paths = names.iter().map(|name| resolve(header, field, name, options));
    let paths = paths.collect::<Result<Vec<PathBuf>, _>>()?;
    let part_bytes = total_bytes / count;
    if let [path] = paths.as_slice() {
        return decode(Stream::open(path)?, part_bytes);
    }
    for path in &paths {
        decode(Stream::open(path)?, part_bytes)?;
    }
    let name = file.clone();
    let open = move |part: usize| match paths.get(part) {
        Some(path) => decode(Stream::open(path)?, part_bytes),
        None => Err(FormatError::corrupt(&file, "a data file is missing")),
    };
    Ok(Stream::parts(name, count as usize, part_bytes, Box::new(open)))
}

/// Path of a data file that a header at `header` names; it must be another file than the header,
/// and for files from strangers a plain file beside it.
pub(crate) fn resolve(
    header: &Path,
    field: &str,
    name: &str,
    options: &ReadOptions<'_>,
) -> Result<PathBuf, FormatError> {
    let error = |got: String, expected: &str| FormatError::Field {
        file: file_name(header),
        field: field.to_owned(),
        got,
        expected: expected.to_owned(),
    };
    if name.contains("://") || name.starts_with("file:") {
        return Err(error(quoted(name), "the name of a file, not an address"));
    }
    let relative = Path::new(name);
    let folder = header.parent().unwrap_or(Path::new(""));
    let path = folder.join(relative);
    if options.siblings_only {
        let mut components = relative.components().filter(|part| !matches!(part, Component::CurDir));
        let is_plain = matches!((components.next(), components.next()), (Some(Component::Normal(_)), None));
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
    if header.canonicalize().is_ok_and(|header| header == target) {
        return Err(error(quoted(name), "another file than the header itself"));
    }
    Ok(path)
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
