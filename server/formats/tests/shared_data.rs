//! The shared test data: every file of a format that is read, against numbers computed with nibabel
//! 5.4.2, pynrrd 1.1.3, SimpleITK 2.5.7, pyvista 0.49.1, tifffile 2026.3.3, zarr 3.1.6 and numpy
//! 2.4.6 (reoriented to LPS by nibabel or SimpleITK where there is an orientation).

#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;

use common::*;
use formats::{Imported, RawLayout, ReadOptions, read_volume};
use proto::scene_file::{Endian, VoxelType};

/// What a file must come to; one line of `shared_data.json`.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Expected {
    /// Path in the shared data.
    file: String,
    dims: [usize; 3],
    /// To seven digits.
    spacing: [f64; 3],
    /// The file's type.
    #[serde(rename = "type")]
    voxel_type: VoxelType,
    range: [f64; 2],
    /// Of all data values.
    sum: f64,
    /// Data values at (x/3, y/2, 2z/3) and (x/2, y/4, z/2).
    probes: [f64; 2],
    /// Centre of the first voxel in LPS; `None` for files without orientation.
    origin: Option<[f64; 3]>,
}

/// Expected numbers of all files, of which raw ones need a layout.
fn expected(raw: bool) -> Vec<Expected> {
    let all: Vec<Expected> = serde_json::from_str(include_str!("shared_data.json")).unwrap();
    let chosen: Vec<_> = all.into_iter().filter(|e| e.file.ends_with(".raw") == raw).collect();
    assert!(chosen.len() >= 6);
    chosen
}

fn check(imported: &Imported, expected: &Expected) {
    let volume = &imported.volume;
    let file = &expected.file;
    let [x, y, z] = volume.dims;
    assert_eq!(volume.dims, expected.dims, "{file}");
    for (found, expected) in volume.spacing.iter().zip(expected.spacing) {
        assert!((found / expected - 1.0).abs() < 1e-6, "{file}: spacing {found} {expected}");
    }
    assert_eq!(imported.file_type, expected.voxel_type, "{file}");
    let close = |found: f64, expected: f64| {
        assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{file}: {found} {expected}");
    };
    let range = formats::data_range(volume);
    close(range[0], expected.range[0]);
    close(range[1], expected.range[1]);
    close(data(imported).iter().sum(), expected.sum);
    close(volume.value(x / 3, y / 2, 2 * z / 3), expected.probes[0]);
    close(volume.value(x / 2, y / 4, z / 2), expected.probes[1]);
    assert_eq!(volume.orientation.is_some(), expected.origin.is_some(), "{file}");
    if let (Some(orientation), Some(origin)) = (volume.orientation, expected.origin) {
        for (found, expected) in orientation.origin.iter().zip(origin) {
            assert!((found - expected).abs() < 2e-5, "{file}: {orientation:?}");
        }
    }
}

#[test]
fn every_file_reads_as_other_readers_do() {
    let Some(folder) = shared_data("expected dims, spacing, range of real files") else {
        return;
    };
    let all = expected(false);
    for expected in &all {
        check(&read(&folder.join(&expected.file)).unwrap(), expected);
    }
    // Nothing new lies there unnoticed.
    for kind in std::fs::read_dir(&folder).unwrap() {
        let kind = kind.unwrap().path();
        let files = kind.is_dir().then(|| std::fs::read_dir(&kind).unwrap());
        for file in files.into_iter().flatten() {
            let path = file.unwrap().path();
            let name = path.strip_prefix(&folder).unwrap().to_str().unwrap();
            let endings = [
                ".nrrd", ".nhdr", ".nii", ".nii.gz", ".hdr", ".mhd", ".mha", ".npy", ".vti", ".tif", ".zarr",
            ];
            let is_volume = endings.iter().any(|end| name.ends_with(end));
            if is_volume && !name.starts_with("environments/") {
                let known = all.iter().any(|expected| expected.file == name);
                assert!(known, "{name} has no expected numbers");
            }
        }
    }
}

#[test]
fn eight_orientations_are_one_volume() {
    let Some(folder) = shared_data("the eight orientations of one brain") else {
        return;
    };
    let [first, others @ ..] = ["LPS", "ASL", "IAR", "LAS", "PIL", "RAS", "RPI", "SPR"]
        .map(|name| read(&folder.join(format!("nifti_orientations/{name}.nii.gz"))).unwrap().volume);
    for other in others {
        assert!(first.voxels == other.voxels, "voxels differ");
        assert_eq!((first.dims, first.spacing), (other.dims, other.spacing));
        assert_eq!((first.slope, first.intercept), (other.slope, other.intercept));
        let (a, b) = (first.orientation.unwrap(), other.orientation.unwrap());
        assert_eq!(a.lps_from_grid, b.lps_from_grid);
        for k in 0..3 {
            assert!((a.origin[k] - b.origin[k]).abs() < 1e-5, "{a:?} {b:?}");
        }
    }
}

#[test]
fn the_same_scan_as_nrrd_and_as_nifti_agrees() {
    let Some(folder) = shared_data("FLAIR as NRRD and as NIfTI") else {
        return;
    };
    let nrrd = read(&folder.join("nifti/FLAIR.nrrd")).unwrap().volume;
    let nifti = read(&folder.join("nifti/FLAIR.nii.gz")).unwrap().volume;
    assert!(nrrd.voxels == nifti.voxels, "voxels differ");
    assert_eq!(nrrd.dims, nifti.dims);
    let (a, b) = (nrrd.orientation.unwrap(), nifti.orientation.unwrap());
    for axis in 0..3 {
        assert!((nrrd.spacing[axis] - nifti.spacing[axis]).abs() < 1e-9);
        assert!((a.origin[axis] - b.origin[axis]).abs() < 1e-5, "{a:?} {b:?}");
        for k in 0..3 {
            assert!((a.lps_from_grid[axis][k] - b.lps_from_grid[axis][k]).abs() < 1e-6);
        }
    }
}

fn read_as(path: &Path, layout: RawLayout) -> Result<Imported, formats::FormatError> {
    read_volume(path, &ReadOptions { raw: Some(layout), ..ReadOptions::default() })
}

#[test]
fn raw_files_read_with_the_layout_their_neighbours_tell() {
    let Some(folder) = shared_data("raw files") else {
        return;
    };
    for expected in &expected(true) {
        let path = folder.join(&expected.file);
        let name = expected.file.rsplit('/').next().unwrap();
        refused(read(&path), name, &["NAME.json"]);
        let layout = RawLayout {
            dims: expected.dims.map(|n| n as u32),
            voxel_type: expected.voxel_type,
            endian: Endian::Little,
            header_bytes: 0,
            spacing: Some(expected.spacing),
        };
        check(&read_as(&path, layout).unwrap(), expected);
        let wrong = RawLayout { dims: layout.dims.map(|n| n - 1), ..layout };
        refused(read_as(&path, wrong), name, &["bytes"]);
    }
    let layout = RawLayout {
        dims: [41; 3],
        voxel_type: VoxelType::Uint8,
        endian: Endian::Little,
        header_bytes: 0,
        spacing: None,
    };
    let plain = read_as(&folder.join("volvis/nucleon.raw"), layout).unwrap().volume;
    let compressed = read_as(&folder.join("volvis/nucleon.raw.gz"), layout).unwrap().volume;
    assert!(plain == compressed);
    for name in ["raw/fuel_64x64x64_uint8.dat", "manix128/manix128.dat", "voreen/walnut.vvd"] {
        refused(read(&folder.join(name)), "", &["not supported", "NAME.json"]);
    }
}

#[test]
fn other_volumes_of_a_series_are_reached() {
    let Some(folder) = shared_data("a series of 20 volumes") else {
        return;
    };
    for (index, sum) in SERIES_SUMS {
        let imported = read_index(&folder.join("nibabel/functional.nii"), index).unwrap();
        let found: f64 = data(&imported).iter().sum();
        assert!((found - sum).abs() < 1e-9 * sum, "{index}: {found} {sum}");
    }
}

/// Sums of the data values of some volumes of the series.
const SERIES_SUMS: [(u32, f64); 3] =
    [(0, 3883746.552329719), (7, 3891898.799704373), (19, 3888072.273083091)];
