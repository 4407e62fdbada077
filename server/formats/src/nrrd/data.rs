//! Where the voxels of an NRRD file are: after the header, in another file, or in several.

use std::path::Path;

use proto::scene_file::VoxelType;

use super::Encoding;
use super::header::{Header, is_list};
use crate::ReadOptions;
use crate::detached;
use crate::error::FormatError;
use crate::stream::{Progress, Stream};
use crate::text::{TextKind, TextReader};
use crate::voxels::type_bytes;

/// What messages call the field that names the data files.
const FIELD: &str = "data file";

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
        let (path, options) = (self.path, self.options);
        let decode = move |stream, bytes| self.decode(stream, bytes);
        detached::open_all(path, FIELD, &names, total_bytes, options, decode)
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
        if is_list(value) {
            let names = &self.header.listed_files;
            detached::check_count(&self.header.file, names.len() as i128)?;
            return Ok(names.clone());
        }
        detached::listed_by_pattern(&self.header.file, FIELD, value)
    }
}
