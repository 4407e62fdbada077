//! One case per reader: bytes are put where the reader looks for them and are read, and what the
//! reader accepts must keep the promises of [`scene::Volume`](../../scene) and of the limits.
//!
//! Each case returns whether the file was accepted.

use std::fs;
use std::path::{Path, PathBuf};

use formats::{ENVIRONMENT_BUDGET, Limits, MAX_RADIANCE, ReadOptions, read_environment, read_volume};

/// Reads bytes with the help of files in a folder; whether they were accepted.
pub type Case = fn(&Path, &[u8]) -> bool;

/// All cases with their names, which are those of the fuzz targets and of the folders of seeds.
pub const CASES: [(&str, Case); 12] = [
    ("archive", archive),
    ("dicom", dicom),
    ("environment", environment),
    ("metaimage", metaimage),
    ("nifti", nifti),
    ("npy", npy),
    ("nrrd", nrrd),
    ("png", png),
    ("raw", raw),
    ("tiff", tiff),
    ("vti", vti),
    ("zarr", zarr),
];

/// Data files that a header may name: `d1.raw` and `d2.raw`, half of 5 x 4 x 3 floats each for
/// two volumes.
const DETACHED: [u8; 240] = [7; 240];
/// Between the parts of a Zarr hierarchy.
const PART: &[u8] = b"\n%\n";
/// The slice that stands beside the one under test.
const NEIGHBOUR: &[u8] = include_bytes!("../seeds/dicom/slice_2.dcm");

/// A zip archive, of slices or of an OME-Zarr hierarchy.
pub fn archive(folder: &Path, bytes: &[u8]) -> bool {
    read(&put(folder, "a.zip", bytes))
}

/// A DICOM file by itself, then in a series with another slice.
pub fn dicom(folder: &Path, bytes: &[u8]) -> bool {
    let series = folder.join("series");
    let path = put(&series, "a.dcm", bytes);
    keep(&series, "b.dcm", NEIGHBOUR);
    read(&series);
    read(&path)
}

/// A Radiance or OpenEXR picture, told apart by content.
pub fn environment(folder: &Path, bytes: &[u8]) -> bool {
    let Ok(picture) = read_environment(&put(folder, "a.picture", bytes), &limits()) else { return false };
    let (width, height) = (picture.width, picture.height);
    assert!((1..=ENVIRONMENT_BUDGET[0]).contains(&width) && (1..=ENVIRONMENT_BUDGET[1]).contains(&height));
    assert_eq!(picture.rgb.len(), 3 * width * height);
    assert!(picture.rgb.iter().all(|value| (0.0..=MAX_RADIANCE).contains(value)));
    true
}

/// A MetaImage file that may name `d1.raw` and `d2.raw`.
pub fn metaimage(folder: &Path, bytes: &[u8]) -> bool {
    keep(folder, "d1.raw", &DETACHED);
    keep(folder, "d2.raw", &DETACHED);
    read(&put(folder, "a.mha", bytes))
}

/// A NIfTI file; the header of a pair finds voxels beside it.
pub fn nifti(folder: &Path, bytes: &[u8]) -> bool {
    let has = |at: usize, magic: &[u8]| bytes.get(at..).is_some_and(|rest| rest.starts_with(magic));
    if has(344, b"ni1\0") || has(4, b"ni2\0") {
        keep(folder, "pair.img", &[DETACHED, DETACHED].concat());
        return read(&put(folder, "pair.hdr", bytes));
    }
    read(&put(folder, "a.nii", bytes))
}

/// A NumPy file.
pub fn npy(folder: &Path, bytes: &[u8]) -> bool {
    read(&put(folder, "a.npy", bytes))
}

/// An NRRD file that may name `d1.raw` and `d2.raw`.
pub fn nrrd(folder: &Path, bytes: &[u8]) -> bool {
    keep(folder, "d1.raw", &DETACHED);
    keep(folder, "d2.raw", &DETACHED);
    read(&put(folder, "a.nrrd", bytes))
}

/// A folder of two PNG slices, both the same.
pub fn png(folder: &Path, bytes: &[u8]) -> bool {
    let slices = folder.join("slices");
    put(&slices, "1.png", bytes);
    put(&slices, "2.png", bytes);
    read(&slices)
}

/// A raw file: its sidecar in the first line, voxels behind it, gzip or not.
pub fn raw(folder: &Path, bytes: &[u8]) -> bool {
    let end = bytes.iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len());
    let (sidecar, voxels) = (&bytes[..end], bytes.get(end + 1..).unwrap_or_default());
    let name = if voxels.starts_with(&[0x1F, 0x8B]) { "a.raw.gz" } else { "a.raw" };
    put(folder, &format!("{name}.json"), sidecar);
    read(&put(folder, name, voxels))
}

/// A TIFF file.
pub fn tiff(folder: &Path, bytes: &[u8]) -> bool {
    read(&put(folder, "a.tif", bytes))
}

/// A VTI file.
pub fn vti(folder: &Path, bytes: &[u8]) -> bool {
    read(&put(folder, "a.vti", bytes))
}

/// An OME-Zarr hierarchy of one array and one chunk: metadata of the group, metadata of the
/// array, chunk, with [`PART`] between them. An archive's checksums would keep changes from
/// the reader.
pub fn zarr(folder: &Path, bytes: &[u8]) -> bool {
    let (group, rest) = split(bytes);
    let (array, chunk) = split(rest);
    let is_third = array.windows(9).any(|text| text == b"node_type");
    let (root, names) = match is_third {
        true => (folder.join("zarr3"), ["zarr.json", "0/zarr.json", "0/c/0/0/0"]),
        false => (folder.join("zarr2"), [".zattrs", "0/.zarray", "0/0.0.0"]),
    };
    for (name, part) in names.into_iter().zip([group, array, chunk]) {
        put(&root, name, part);
    }
    read(&root)
}

fn split(bytes: &[u8]) -> (&[u8], &[u8]) {
    match bytes.windows(PART.len()).position(|window| window == PART) {
        Some(at) => (&bytes[..at], &bytes[at + PART.len()..]),
        None => (bytes, &[]),
    }
}

/// Small: a size that slips through stays cheap to read.
fn limits() -> Limits {
    Limits { max_voxel_bytes: 1 << 20, max_decoded_bytes: 4 << 20, ..Limits::default() }
}

/// Reads the first volume, the last one, and one beyond it.
fn read(path: &Path) -> bool {
    let choices = match read_index(path, None) {
        Some(choices) => choices,
        None => return false,
    };
    let index = |number: u64| u32::try_from(number).ok();
    if let Some(last) = index(choices - 1).filter(|last| *last > 0) {
        read_index(path, Some(last));
    }
    if let Some(beyond) = index(choices) {
        assert!(read_index(path, Some(beyond)).is_none(), "volume {beyond} of {choices} was read");
    }
    true
}

/// Number of volumes on offer, after a look at the one that was read; `None` if it was refused.
fn read_index(path: &Path, index: Option<u32>) -> Option<u64> {
    let limits = limits();
    let imported = match read_volume(path, &ReadOptions { index, limits, ..ReadOptions::default() }) {
        Ok(imported) => imported,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return None;
        }
    };
    let volume = &imported.volume;
    assert!(volume.dims.iter().all(|size| (1..=limits.max_axis as usize).contains(size)));
    assert_eq!(volume.dims.iter().product::<usize>(), volume.voxels.len());
    assert!(volume.voxels.bytes() as u64 <= limits.max_voxel_bytes);
    assert!(volume.spacing.iter().all(|edge| edge.is_finite() && *edge > 0.0), "{:?}", volume.spacing);
    assert!(volume.slope.is_finite() && volume.slope != 0.0 && volume.intercept.is_finite());
    let [low, high] = formats::data_range(volume);
    assert!(low.is_finite() && high.is_finite() && low <= high, "{low} {high}");
    if let Some(orientation) = &volume.orientation {
        assert!(orientation.origin.iter().all(|place| place.is_finite()));
        for direction in orientation.lps_from_grid {
            let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() < 1e-6, "{direction:?}");
        }
    }
    assert!(imported.choices > 0 && u64::from(index.unwrap_or(0)) < imported.choices);
    let description = formats::describe(&imported);
    assert!(description["range"][0].is_number() && description["spacing"][2].is_number());
    Some(imported.choices)
}

/// Writes a file; folders on the way are made.
fn put(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    if fs::write(&path, bytes).is_err() {
        fs::create_dir_all(path.parent().expect("a file in a folder")).expect("a folder to write to");
        fs::write(&path, bytes).expect("a file that can be written");
    }
    path
}

/// Writes a file that is always the same, once.
fn keep(folder: &Path, name: &str, bytes: &[u8]) {
    if !folder.join(name).is_file() {
        put(folder, name, bytes);
    }
}
