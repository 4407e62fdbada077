//! Which format a file has: by content first, then by name.

use std::path::{Path, PathBuf};

use crate::ReadOptions;
use crate::archive::{Archive, ZIP_MAGIC};
use crate::dicom;
use crate::error::{FormatError, file_name};
use crate::metaimage;
use crate::nifti;
use crate::npy;
use crate::nrrd;
use crate::raw::{self, RawLayout};
use crate::slices;
use crate::stream::Stream;
use crate::vti;
use crate::zarr;

pub(crate) enum Detected {
    Nrrd,
    Nifti,
    Npy,
    MetaImage,
    Vti,
    Tiff,
    /// Slices of a folder, in order.
    Slices(Vec<PathBuf>),
    ZarrFolder(PathBuf),
    ZarrZip(Box<Archive>),
    Dicom,
    Raw(RawLayout),
}

pub(crate) fn detect(path: &Path, options: &ReadOptions<'_>) -> Result<Detected, FormatError> {
    if let Some(folder) = zarr_folder(path) {
        return Ok(Detected::ZarrFolder(folder));
    }
    if path.is_dir() {
        let slices = slices::files_of(path)?;
        return Ok(if slices.is_empty() { Detected::Dicom } else { Detected::Slices(slices) });
    }
    // Content. A raw file that happens to start like one of these is as good as impossible: NIfTI
    // is recognised by two fields 344 bytes apart.
    let mut stream = Stream::open_maybe_gzip(path)?;
    let start = stream.peek_up_to(nifti::DETECTION_BYTES);
    // First: what precedes a DICOM file's own mark may be the start of another format.
    if dicom::is_start(&start) {
        return Ok(Detected::Dicom);
    }
    if start.starts_with(b"#?") {
        return Err(FormatError::unsupported(
            &file_name(path),
            "a Radiance picture",
            "it is light from all directions, not a volume",
        ));
    }
    if start.starts_with(nrrd::MAGIC) {
        return Ok(Detected::Nrrd);
    }
    if start.starts_with(npy::MAGIC) {
        return Ok(Detected::Npy);
    }
    if metaimage::is_header(&start) {
        return Ok(Detected::MetaImage);
    }
    if vti::is_header(&start) {
        return Ok(Detected::Vti);
    }
    if slices::is_tiff(&start) {
        return Ok(Detected::Tiff);
    }
    if start.starts_with(ZIP_MAGIC) {
        let archive = Archive::open(path, &options.limits)?;
        let is_zarr = zarr::root_in(&archive).is_some();
        return Ok(if is_zarr { Detected::ZarrZip(Box::new(archive)) } else { Detected::Dicom });
    }
    if nifti::is_header(&start) {
        return Ok(Detected::Nifti);
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
        Some("npy") => Ok(Detected::Npy),
        Some("mhd" | "mha") => Ok(Detected::MetaImage),
        Some("vti") => Ok(Detected::Vti),
        Some("tif" | "tiff") => Ok(Detected::Tiff),
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

/// The hierarchy that a path names: a folder, or the metadata in it.
fn zarr_folder(path: &Path) -> Option<PathBuf> {
    let is_metadata = matches!(file_name(path).as_str(), ".zattrs" | ".zgroup" | "zarr.json");
    let folder = if is_metadata && path.is_file() { path.parent()? } else { path };
    zarr::is_hierarchy(folder).then(|| folder.to_owned())
}
