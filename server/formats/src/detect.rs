//! Which format a file has: by content first, then by name.

use std::path::Path;

use crate::ReadOptions;
use crate::archive;
use crate::dicom;
use crate::error::{FormatError, file_name};
use crate::nifti;
use crate::nrrd;
use crate::raw::{self, RawLayout};
use crate::stream::Stream;

pub(crate) enum Detected {
    Nrrd,
    Nifti,
    Dicom,
    Raw(RawLayout),
}

pub(crate) fn detect(path: &Path, options: &ReadOptions<'_>) -> Result<Detected, FormatError> {
    if path.is_dir() {
        return Ok(Detected::Dicom);
    }
    // Content. A raw file that happens to start like one of these is as good as impossible: NIfTI
    // is recognised by two fields 344 bytes apart.
    let mut stream = Stream::open_maybe_gzip(path)?;
    let start = stream.peek_up_to(nifti::DETECTION_BYTES);
    if start.starts_with(nrrd::MAGIC) {
        return Ok(Detected::Nrrd);
    }
    if nifti::is_header(&start) {
        return Ok(Detected::Nifti);
    }
    if dicom::is_start(&start) || start.starts_with(archive::ZIP_MAGIC) {
        return Ok(Detected::Dicom);
    }
    if let Some(layout) = options.raw {
        return Ok(Detected::Raw(layout));
    }

    // Name.
    let file = file_name(path);
    let lower = file.to_lowercase();
    let bare = lower.strip_suffix(".gz").unwrap_or(&lower);
    match bare.rsplit_once('.').map(|(_, extension)| extension) {
        Some("nrrd" | "nhdr") => Ok(Detected::Nrrd),
        Some("nii" | "hdr" | "img") => Ok(Detected::Nifti),
        Some("dcm") => Ok(Detected::Dicom),
        extension => match (raw::read_sidecar(path)?, extension) {
            (Some(layout), _) => Ok(Detected::Raw(layout)),
            (None, Some("raw")) => Err(FormatError::RawWithoutLayout { file }),
            (None, Some("dat" | "vvd")) => Err(FormatError::Unsupported {
                what: format!("a .{} description of a raw file", extension.unwrap_or_default()),
                help: "open the .raw file and describe it in NAME.json beside it, for example \
                       {\"dims\": [64, 64, 64], \"type\": \"uint8\", \"endian\": \"little\", \
                       \"header_bytes\": 0, \"spacing\": [1, 1, 1]}"
                    .to_owned(),
                file,
            }),
            (None, _) => Err(FormatError::Unrecognised { file }),
        },
    }
}
