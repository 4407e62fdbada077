//! The text header: lines `Key = Value`, the last of which is `ElementDataFile`.

use std::collections::BTreeMap;
use std::path::Path;

use crate::ReadOptions;
use crate::error::{FormatError, quoted};
use crate::stream::Stream;

/// Keys that are read. Of keys with several names the first that is there counts.
const USED: [&str; 25] = [
    "ObjectType",
    "NDims",
    "DimSize",
    "ElementType",
    "ElementNumberOfChannels",
    "BinaryData",
    "BinaryDataByteOrderMSB",
    "ElementByteOrderMSB",
    "CompressedData",
    "CompressedDataSize",
    "HeaderSize",
    "TransformMatrix",
    "Rotation",
    "Orientation",
    "Offset",
    "Position",
    "Origin",
    "ElementSpacing",
    "ElementSize",
    "AnatomicalOrientation",
    "DistanceUnits",
    "ElementToIntensityFunctionSlope",
    "ElementToIntensityFunctionOffset",
    "ElementDataFile",
    "ObjectSubType",
];
/// Keys that do not matter here.
const UNUSED: [&str; 11] = [
    "CenterOfRotation",
    "Comment",
    "Name",
    "ID",
    "ParentID",
    "Color",
    "Modality",
    "SequenceID",
    "ElementMin",
    "ElementMax",
    "AcquisitionDate",
];

/// Values of a header, not yet interpreted.
pub(super) struct Header {
    /// File name for messages.
    pub(super) file: String,
    fields: BTreeMap<String, String>,
    /// Lines after `ElementDataFile = LIST`.
    pub(super) listed_files: Vec<String>,
    pub(super) notices: Vec<String>,
}

/// Reads the header and returns what follows it.
pub(super) fn read<'a>(path: &Path, options: &ReadOptions<'_>) -> Result<(Header, Stream<'a>), FormatError> {
    let mut stream = Stream::open(path)?;
    let mut left = options.limits.max_header_bytes;
    let mut header = Header {
        file: stream.file.clone(),
        fields: BTreeMap::new(),
        listed_files: Vec::new(),
        notices: Vec::new(),
    };
    while let Some(line) = stream.read_line(left)? {
        left = left.saturating_sub(line.len() as u64 + 1);
        let line = String::from_utf8_lossy(&line);
        match header.get("ElementDataFile") {
            Some(_) if line.trim().is_empty() => {}
            Some(_) => header.listed_files.push(line.trim().to_owned()),
            None => header.add_line(&line)?,
        }
        // The voxels of a single file follow at once; only a list of names goes on.
        if header.get("ElementDataFile").is_some_and(|value| !is_list(value)) {
            break;
        }
    }
    Ok((header, stream))
}

/// Whether the voxels lie in files that are named on the lines that follow.
pub(super) fn is_list(value: &str) -> bool {
    value.split_whitespace().next() == Some("LIST")
}

impl Header {
    fn add_line(&mut self, line: &str) -> Result<(), FormatError> {
        if line.trim().is_empty() {
            return Ok(());
        }
        let Some((key, value)) = line.split_once(['=', ':']) else {
            let expected = "`Key = Value`, the last one ElementDataFile";
            return Err(FormatError::field(&self.file, "header line", line, expected));
        };
        let (key, value) = (key.trim(), value.trim());
        if !USED.contains(&key) {
            if !UNUSED.contains(&key) {
                self.notices.push(format!("the unknown header field {} is ignored", quoted(key)));
            }
            return Ok(());
        }
        if self.fields.insert(key.to_owned(), value.to_owned()).is_some() {
            return Err(FormatError::field(&self.file, key, "a second value", "one value"));
        }
        Ok(())
    }

    pub(super) fn get(&self, key: &str) -> Option<&str> {
        self.fields.get(key).map(String::as_str)
    }

    pub(super) fn required(&self, key: &str, expected: &str) -> Result<&str, FormatError> {
        self.get(key).ok_or_else(|| FormatError::missing(&self.file, key, expected))
    }

    /// Which of several names of one field is there, and its value.
    pub(super) fn first_of<'k>(&self, keys: &[&'k str]) -> Option<(&'k str, &str)> {
        keys.iter().find_map(|key| Some((*key, self.get(key)?)))
    }

    /// `True` or `False`; `default` if it is not there.
    pub(super) fn flag(&self, keys: &[&str], default: bool) -> Result<bool, FormatError> {
        match self.first_of(keys) {
            None => Ok(default),
            Some((_, "True" | "true" | "TRUE" | "T" | "t" | "1")) => Ok(true),
            Some((_, "False" | "false" | "FALSE" | "F" | "f" | "0")) => Ok(false),
            Some((key, other)) => Err(FormatError::field(&self.file, key, other, "True or False")),
        }
    }

    /// As many numbers as asked for.
    pub(super) fn numbers(&self, keys: &[&str], count: usize) -> Result<Option<Vec<f64>>, FormatError> {
        let Some((key, text)) = self.first_of(keys) else {
            return Ok(None);
        };
        let numbers: Option<Vec<f64>> =
            text.split_whitespace().take(count + 1).map(|n| n.parse().ok()).collect();
        let right = numbers.filter(|n| n.len() == count && n.iter().all(|n| n.is_finite()));
        right.ok_or_else(|| FormatError::field(&self.file, key, text, format!("{count} numbers"))).map(Some)
    }

    /// One whole number of at least `least`.
    pub(super) fn count(&self, key: &str, least: i64) -> Result<Option<i64>, FormatError> {
        let Some(text) = self.get(key) else { return Ok(None) };
        text.parse().ok().filter(|n| *n >= least).map(Some).ok_or_else(|| {
            let expected = format!("a whole number of at least {least}");
            FormatError::field(&self.file, key, text, expected)
        })
    }
}
