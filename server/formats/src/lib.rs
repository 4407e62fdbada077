//! Readers for volume files; hostile input dies here.
//!
//! [`read_volume`] recognises a file by its content, then by its name, and returns a
//! [`scene::Volume`] in world order. Every reader follows one path: the header decides how many
//! bytes the voxels take, that is held against [`Limits`] and against what the file can hold at
//! all, and only then is memory reserved. Decoding runs in bounded chunks, so a file that lies
//! about its size costs no more than it is worth.
//!
//! | module | what it does |
//! |---|---|
//! | `stream`, `gzip`, `text` | bytes of a file, decoded, with a bound on how many can come |
//! | `voxels` | bytes to voxels: types, byte order, components, non-finite values |
//! | `orientation`, `reorder` | axis order and directions to the closest LPS |
//! | `archive` | zip files: entries, names and sizes bounded |
//! | `detached` | data files that a header names |
//! | `half_float` | 16-bit floats |
//! | `slices` | TIFF files of several pages, folders of TIFF or PNG slices |
//! | `nrrd`, `nifti`, `npy`, `metaimage`, `vti`, `zarr`, `raw` | headers |
//! | `dicom` | series of slices |
//! | `environment` | images of light from all directions |
//! | `describe` | what `tyndall import` prints |

mod archive;
mod describe;
mod detached;
mod detect;
mod dicom;
mod environment;
mod error;
mod gzip;
mod half_float;
mod metaimage;
mod nifti;
mod npy;
mod nrrd;
mod orientation;
mod raw;
mod reorder;
mod slices;
mod stream;
mod text;
mod voxels;
mod vti;
mod zarr;

use std::path::Path;

use proto::scene_file::VoxelType;
use scene::Volume;

pub use describe::{data_range, describe};
pub use dicom::is_dicom;
pub use environment::{ENVIRONMENT_BUDGET, Environment, MAX_RADIANCE, read_environment};
pub use error::FormatError;
pub use nrrd::write::write_nrrd;
pub use raw::{RawLayout, read_sidecar};

/// File formats this crate reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// NRRD, attached (`.nrrd`) or detached (`.nhdr` with data files).
    Nrrd,
    /// NIfTI-1 and NIfTI-2, single file or `.hdr`/`.img` pair, plain or gzip.
    Nifti,
    /// NumPy array, `.npy`.
    Npy,
    /// MetaImage, `.mha` or `.mhd` with data files.
    MetaImage,
    /// VTK image data in XML, `.vti`.
    Vti,
    /// TIFF: a file of several pages, or a folder of slices.
    Tiff,
    /// A folder of PNG slices.
    Png,
    /// OME-Zarr, in a folder or a zip archive.
    OmeZarr,
    /// Voxels without a header; the layout comes from elsewhere.
    Raw,
    /// DICOM: a series in a folder or zip archive, or a single file.
    Dicom,
}

impl Format {
    /// Name used in messages and JSON, for example `nrrd`.
    pub fn name(self) -> &'static str {
        match self {
            Format::Nrrd => "nrrd",
            Format::Nifti => "nifti",
            Format::Npy => "npy",
            Format::MetaImage => "metaimage",
            Format::Vti => "vti",
            Format::Tiff => "tiff",
            Format::Png => "png",
            Format::OmeZarr => "ome-zarr",
            Format::Raw => "raw",
            Format::Dicom => "dicom",
        }
    }
}

/// What a file may cost. A file beyond any of these is refused before memory is reserved for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the voxels in memory. Reordering axes holds them twice for a moment.
    pub max_voxel_bytes: u64,
    /// Decoded bytes of all voxels of the file, volumes and components that are not chosen
    /// included; bounds the time spent on inflating.
    pub max_decoded_bytes: u64,
    /// Bytes before the voxels: header, extensions.
    pub max_header_bytes: u64,
    /// Voxels along one axis.
    pub max_axis: u32,
}

impl Default for Limits {
    /// 4 GiB in memory, 16 GiB decoded, 16 MiB of header, 65,536 voxels along an axis.
    fn default() -> Self {
        Self {
            max_voxel_bytes: 4 << 30,
            max_decoded_bytes: 16 << 30,
            max_header_bytes: 16 << 20,
            max_axis: 1 << 16,
        }
    }
}

/// How to read a file.
#[derive(Clone, Copy)]
pub struct ReadOptions<'a> {
    /// Layout of a raw file; without it the sidecar `NAME.json` is looked for.
    pub raw: Option<RawLayout>,
    /// Which volume or component of a file that holds several, counted in file order
    /// (components fastest). `None` is the first, with a notice.
    pub index: Option<u32>,
    /// What the file may cost.
    pub limits: Limits,
    /// For files from strangers: detached data must be a plain file, no link, in the folder of
    /// its header. Otherwise it may lie anywhere.
    pub siblings_only: bool,
    /// Told how far decoding has come, from 0 to 1, from the calling thread.
    pub progress: &'a (dyn Fn(f32) + Sync),
}

impl Default for ReadOptions<'_> {
    /// First volume, default limits, detached data from the header's folder only, no progress.
    fn default() -> Self {
        fn ignore(_: f32) {}
        Self { raw: None, index: None, limits: Limits::default(), siblings_only: true, progress: &ignore }
    }
}

/// A volume and what was found out about its file.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The volume, in world order.
    pub volume: Volume,
    /// Format of the file.
    pub format: Format,
    /// Type of a voxel (or component) in the file.
    pub file_type: VoxelType,
    /// How many volumes or components the file offers; `index` counts below this.
    pub choices: u64,
    /// What the choices are called, in the order of `index`; empty where they have no names.
    pub choice_names: Vec<String>,
    /// What was changed, ignored or assumed, one sentence each, for the user to see.
    pub notices: Vec<String>,
}

/// Reads a volume file, or a folder with a series of slices.
///
/// The format is decided by content first and by name second. Axes of files with anatomical
/// orientation are permuted and flipped to the closest LPS; nothing is resampled.
///
/// # Errors
///
/// [`FormatError`] says which file and field is wrong, what was found and what was expected.
pub fn read_volume(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    match detect::detect(path, options)? {
        detect::Detected::Nrrd => nrrd::read(path, options),
        detect::Detected::Nifti => nifti::read(path, options),
        detect::Detected::Dicom => dicom::read(path, options),
        detect::Detected::Npy => npy::read(path, options),
        detect::Detected::MetaImage => metaimage::read(path, options),
        detect::Detected::Vti => vti::read(path, options),
        detect::Detected::Tiff => slices::read_stack(path, options),
        detect::Detected::Slices(files) => slices::read_files(path, files, options),
        detect::Detected::ZarrFolder(folder) => zarr::read_folder(&folder, options),
        detect::Detected::ZarrZip(archive) => zarr::read_zip(*archive, options),
        detect::Detected::Raw(layout) => raw::read(path, &layout, options),
    }
}
