//! The text header: a magic line, fields, key/value pairs and comments, up to a blank line.

use std::collections::BTreeMap;
use std::path::Path;

use super::MAGIC;
use crate::ReadOptions;
use crate::error::{FormatError, quoted};
use crate::stream::Stream;
use crate::voxels::LABEL_NOTICE;

/// Most axes an NRRD file may have, by the format's own limit.
const MAX_DIMENSION: usize = 16;
/// Newest version of the format; its digit follows the magic.
const NEWEST_VERSION: u8 = b'5';

/// Key of the first segment of a segmentation (`.seg.nrrd`, written by 3D Slicer).
const LABEL_KEY: &str = "Segment0_ID";

/// Fields that are read, names in lower case without blanks (the format allows both
/// `data file` and `datafile`).
const USED: [&str; 20] = [
    "type",
    "dimension",
    "sizes",
    "encoding",
    "endian",
    "datafile",
    "byteskip",
    "lineskip",
    "spacings",
    "axismins",
    "axismaxs",
    "centers",
    "centerings",
    "space",
    "spacedimension",
    "spacedirections",
    "spaceorigin",
    "spaceunits",
    "kinds",
    "units",
];
/// Fields of the format that do not matter here.
const UNUSED: [&str; 11] = [
    "content",
    "number",
    "blocksize",
    "min",
    "max",
    "oldmin",
    "oldmax",
    "thicknesses",
    "labels",
    "sampleunits",
    "measurementframe",
];

/// Fields of a header, not yet interpreted.
pub(super) struct Header {
    /// File name for messages.
    pub(super) file: String,
    fields: BTreeMap<String, String>,
    /// Lines after `data file: LIST`.
    pub(super) listed_files: Vec<String>,
    pub(super) notices: Vec<String>,
}

/// Reads the header and returns what follows it.
pub(super) fn read<'a>(path: &Path, options: &ReadOptions<'_>) -> Result<(Header, Stream<'a>), FormatError> {
    let mut stream = Stream::open(path)?;
    let file = stream.file.clone();
    let mut left = options.limits.max_header_bytes;
    let magic = stream.read_line(left)?.unwrap_or_default();
    let version = magic.strip_prefix(MAGIC);
    if !matches!(version, Some([digit]) if (b'1'..=NEWEST_VERSION).contains(digit)) {
        let got = String::from_utf8_lossy(&magic[..magic.len().min(16)]).into_owned();
        let expected = "NRRD0001 to NRRD0005 at the start of the file";
        return Err(FormatError::field(&file, "magic", got, expected));
    }
    let mut header = Header { file, fields: BTreeMap::new(), listed_files: Vec::new(), notices: Vec::new() };
    loop {
        let Some(line) = stream.read_line(left)? else {
            // A detached header may end with the file; an attached one has no data then.
            if header.get("datafile").is_some() {
                break;
            }
            let expected = "a blank line between the fields and the data";
            return Err(FormatError::missing(&header.file, "end of header", expected));
        };
        left = left.saturating_sub(line.len() as u64 + 1);
        if line.is_empty() {
            break;
        }
        header.add_line(&String::from_utf8_lossy(&line))?;
    }
    Ok((header, stream))
}

impl Header {
    fn add_line(&mut self, line: &str) -> Result<(), FormatError> {
        if line.starts_with('#') {
            return Ok(());
        }
        if self.get("datafile").is_some_and(is_list) {
            self.listed_files.push(line.trim().to_owned());
            return Ok(());
        }
        let Some((name, value)) = line.split_once(':') else {
            let expected = "`field: value`, `key:=value` or `# comment`";
            return Err(FormatError::field(&self.file, "header line", line, expected));
        };
        if value.starts_with('=') {
            // Segmentations list their segments as `Segment0_ID:=...`.
            if name == LABEL_KEY {
                self.notices.push(LABEL_NOTICE.to_owned());
            }
            return Ok(());
        }
        let name: String = name.to_lowercase().split_whitespace().collect();
        if UNUSED.contains(&name.as_str()) {
            return Ok(());
        }
        if !USED.contains(&name.as_str()) {
            if value.contains(":=") {
                return Ok(()); // a key with a colon in it
            }
            self.notices.push(format!("the unknown header field {} is ignored", quoted(&name)));
            return Ok(());
        }
        if self.fields.insert(name.clone(), value.trim().to_owned()).is_some() {
            return Err(FormatError::field(&self.file, name, "a second value", "one value"));
        }
        Ok(())
    }

    /// Value of a field; names in lower case without blanks.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(name).map(String::as_str)
    }

    pub(super) fn required(&self, name: &str, expected: &str) -> Result<&str, FormatError> {
        self.get(name).ok_or_else(|| FormatError::missing(&self.file, name, expected))
    }

    /// The axis lengths; at least one, at most 16 of them.
    pub(super) fn sizes(&self) -> Result<Vec<i128>, FormatError> {
        let text = self.required("dimension", "the number of axes")?;
        let dimension: usize =
            text.parse().ok().filter(|d| (1..=MAX_DIMENSION).contains(d)).ok_or_else(|| {
                let expected = format!("a number of axes from 1 to {MAX_DIMENSION}");
                FormatError::field(&self.file, "dimension", text, expected)
            })?;
        let text = self.required("sizes", "the length of each axis")?;
        let sizes: Option<Vec<i128>> =
            text.split_whitespace().map(|size| size.parse::<u64>().ok().map(i128::from)).collect();
        sizes.filter(|sizes| sizes.len() == dimension && sizes.iter().all(|size| *size >= 1)).ok_or_else(
            || {
                let expected = format!("{dimension} whole numbers of at least 1, one per axis");
                FormatError::field(&self.file, "sizes", text, expected)
            },
        )
    }

    /// One value per axis of a field with white space between values.
    pub(super) fn per_axis(&self, name: &str, dimension: usize) -> Result<Option<Vec<&str>>, FormatError> {
        let Some(text) = self.get(name) else {
            return Ok(None);
        };
        let values: Vec<&str> = text.split_whitespace().take(dimension + 1).collect();
        if values.len() != dimension {
            let expected = format!("{dimension} values, one per axis");
            return Err(FormatError::field(&self.file, name, text, expected));
        }
        Ok(Some(values))
    }

    /// One number per axis; NaN stands for unknown.
    pub(super) fn numbers_per_axis(
        &self,
        name: &str,
        dimension: usize,
    ) -> Result<Option<Vec<f64>>, FormatError> {
        let Some(values) = self.per_axis(name, dimension)? else {
            return Ok(None);
        };
        let numbers: Option<Vec<f64>> = values.iter().map(|value| value.parse().ok()).collect();
        let error = || FormatError::field(&self.file, name, values.join(" "), "numbers");
        numbers.ok_or_else(error).map(Some)
    }
}

/// Whether a `data file` field announces a list of names on the lines that follow.
pub(super) fn is_list(value: &str) -> bool {
    value.split_whitespace().next() == Some("LIST")
}
