//! Why a file was refused.

use std::fmt::Display;
use std::io;
use std::path::Path;

/// Longest piece of a file's own text that is repeated in a message, in characters.
const MAX_QUOTED_CHARS: usize = 80;

/// Why a file was refused. Every message names the file and says what would help.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The operating system refused.
    #[error("{file}: cannot {action}: {source}")]
    Io {
        /// File name.
        file: String,
        /// What was tried, for example `open`.
        action: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// A header field is missing or has a value that cannot be right.
    #[error("{file}: {field}: expected {expected}, got {got}")]
    Field {
        /// File name.
        file: String,
        /// Field as the format calls it.
        field: String,
        /// What was found.
        got: String,
        /// What would be right.
        expected: String,
    },
    /// Legal, but not read here.
    #[error("{file}: {what} is not supported; {help}")]
    Unsupported {
        /// File name.
        file: String,
        /// What the file uses.
        what: String,
        /// What to do instead.
        help: String,
    },
    /// Fewer bytes than the header promises.
    #[error(
        "{file}: ends too early: the header asks for {needed} bytes of data, {available}; \
         the file is cut short or its header is wrong"
    )]
    Truncated {
        /// File name.
        file: String,
        /// Bytes the header asks for.
        needed: u64,
        /// How many there are, as a phrase.
        available: String,
    },
    /// More than the limits allow.
    #[error("{file}: {what}: {got} is more than the limit of {limit}")]
    TooLarge {
        /// File name.
        file: String,
        /// What is too large, with its unit.
        what: &'static str,
        /// How large it is.
        got: String,
        /// The limit.
        limit: u64,
    },
    /// The data are damaged.
    #[error("{file}: {what}")]
    Corrupt {
        /// File name.
        file: String,
        /// What is wrong.
        what: String,
    },
    /// Neither content nor name tell the format.
    #[error(
        "{file}: not a volume file known here; known are NRRD (.nrrd, .nhdr), NIfTI (.nii, \
         .nii.gz, .hdr with .img), DICOM (.dcm, folders and .zip of them), MetaImage (.mha, .mhd), \
         NumPy (.npy), VTK images (.vti), TIFF stacks, folders of TIFF or PNG slices, OME-Zarr \
         (folder or .zip) and raw voxels with a layout: {RAW_HELP}"
    )]
    Unrecognised {
        /// File name.
        file: String,
    },
    /// A raw file without a layout.
    #[error("{file}: a raw file does not say how its voxels lie; {RAW_HELP}")]
    RawWithoutLayout {
        /// File name.
        file: String,
    },
}

/// How to describe a raw file.
const RAW_HELP: &str = "give \"dims\": [x, y, z], \"type\" (uint8, int8, uint16, int16, uint32, \
     int32, uint64, int64, float32 or float64), \"endian\" (little or big, default little) and \
     \"header_bytes\" (default 0) in the scene, or in NAME.json beside NAME.raw, for example \
     {\"dims\": [128, 96, 114], \"type\": \"uint16\", \"endian\": \"little\", \
     \"header_bytes\": 0, \"spacing\": [1, 1, 1]}";

impl FormatError {
    /// A header field with a wrong value; the value is quoted and cut to a readable length.
    pub(crate) fn field(
        file: &str,
        field: impl Into<String>,
        got: impl Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Field {
            file: file.to_owned(),
            field: field.into(),
            got: quoted(&got.to_string()),
            expected: expected.into(),
        }
    }

    /// A header field that is not there.
    pub(crate) fn missing(file: &str, field: &str, expected: impl Into<String>) -> Self {
        Self::Field {
            file: file.to_owned(),
            field: field.to_owned(),
            got: "nothing".to_owned(),
            expected: expected.into(),
        }
    }

    /// Something legal that is not read here.
    pub(crate) fn unsupported(file: &str, what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Unsupported { file: file.to_owned(), what: what.into(), help: help.into() }
    }

    /// Damaged data.
    pub(crate) fn corrupt(file: &str, what: impl Into<String>) -> Self {
        Self::Corrupt { file: file.to_owned(), what: what.into() }
    }

    /// Returns a function that wraps the system's errors.
    pub(crate) fn io(file: &str, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { file: file.to_owned(), action, source }
    }
}

/// A piece of a file's own text, safe and short enough for a message.
pub(crate) fn quoted(text: &str) -> String {
    let mut short: String = text.chars().take(MAX_QUOTED_CHARS).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    format!("`{}`", short.escape_debug())
}

/// The last component of a path, for messages.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
