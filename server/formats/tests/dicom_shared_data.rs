//! The shared DICOM files, against numbers computed with pydicom 3.0.2 and its decoder plug-ins, and
//! against each other.

#![allow(clippy::unwrap_used)]

mod common;

use std::path::PathBuf;

use common::*;
use formats::Imported;

/// What a file must come to; one line of `dicom_data.json`.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Expected {
    /// Path in the shared DICOM data.
    file: String,
    /// Not an image of one value per pixel, damaged, or of an unsupported syntax.
    #[serde(default)]
    refused: bool,
    /// Columns, rows, frames.
    #[serde(default)]
    voxels: [usize; 3],
    /// Of data values.
    #[serde(default)]
    range: [f64; 2],
    #[serde(default)]
    sum: f64,
    /// Decoders may differ by rounding.
    #[serde(default)]
    lossy: bool,
}

/// Mean difference per voxel that lossy decoders may have from each other.
const LOSSY_DIFFERENCE: f64 = 0.6;
/// 12-bit extended JPEG: no kept crate decodes it.
const UNSUPPORTED: [&str; 1] = ["dicom_transfer_syntax/JPGExtended.dcm"];

fn dicom(left_out: &str) -> Option<PathBuf> {
    shared_data(left_out).map(|folder| folder.join("dicom"))
}

fn sorted(mut dims: [usize; 3]) -> [usize; 3] {
    dims.sort();
    dims
}

#[test]
fn every_dicom_file_reads_as_pydicom_does() {
    let Some(folder) = dicom("expected sizes, ranges and sums of real DICOM files") else { return };
    let all: Vec<Expected> = serde_json::from_str(include_str!("dicom_data.json")).unwrap();
    assert!(all.len() > 50);
    let mut wrong = Vec::new();
    for expected in &all {
        let file = &expected.file;
        let result = read(&folder.join(file));
        if expected.refused || UNSUPPORTED.contains(&file.as_str()) {
            match result {
                Ok(_) => wrong.push(format!("{file}: accepted")),
                Err(error) => eprintln!("refused: {error}"),
            }
            continue;
        }
        let imported = match result {
            Ok(imported) => imported,
            Err(error) => {
                wrong.push(format!("{file}: {error}"));
                continue;
            }
        };
        let range = formats::data_range(&imported.volume);
        let sum: f64 = data(&imported).iter().sum();
        let count = imported.volume.voxels.len() as f64;
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs().max(1e-3);
        let sums_agree = match expected.lossy {
            true => (sum - expected.sum).abs() <= LOSSY_DIFFERENCE * count,
            false => {
                close(sum, expected.sum)
                    && close(range[0], expected.range[0])
                    && close(range[1], expected.range[1])
            }
        };
        if sorted(imported.volume.dims) != sorted(expected.voxels) || !sums_agree {
            wrong.push(format!(
                "{file}: {:?} {range:?} {sum}, not {:?} {:?} {}",
                imported.volume.dims, expected.voxels, expected.range, expected.sum
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn one_image_in_every_reversible_syntax_is_one_image() {
    let Some(folder) = dicom("one image in every transfer syntax") else { return };
    let read = |name: String| read(&folder.join("dicom_transfer_syntax/wg04").join(name)).unwrap();
    for image in ["CT1", "CT2", "MR4"] {
        let plain = read(format!("{image}_UNC.dcm")).volume;
        for syntax in ["RLE", "JPLL", "JLSL", "J2KR"] {
            let other = read(format!("{image}_{syntax}.dcm")).volume;
            assert!(plain.voxels == other.voxels, "{image} {syntax}: voxels differ");
            assert_eq!((plain.slope, plain.intercept), (other.slope, other.intercept));
            assert_eq!(plain.orientation, other.orientation, "{image} {syntax}");
        }
        // The lossy ones are near, and not equal; in CT1 the padding is no longer recognised.
        for syntax in ["JLSN", "J2KI"].into_iter().filter(|_| image != "CT1") {
            let other = read(format!("{image}_{syntax}.dcm")).volume;
            let differ = |i: usize| f64::from((plain.voxels.stored(i) - other.voxels.stored(i)).abs());
            let mean = (0..plain.voxels.len()).map(differ).sum::<f64>() / plain.voxels.len() as f64;
            assert!(mean > 0.0 && mean < 20.0, "{image} {syntax}: {mean}");
            eprintln!("{image} {syntax}: mean difference {mean:.3} stored values");
        }
    }
}

fn spacing_is(imported: &Imported, expected: [f64; 3]) {
    for (found, expected) in imported.volume.spacing.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 2e-3, "{:?}", imported.volume.spacing);
    }
}

#[test]
fn series_are_put_together_by_their_positions() {
    let Some(folder) = dicom("series of slices") else { return };
    // Tags say 2 mm; the positions are 7 mm apart. The first file has bytes after its pixels.
    let brain = read(&folder.join("dicom_mr_brain20")).unwrap();
    assert_eq!(sorted(brain.volume.dims), [20, 256, 256]);
    spacing_is(&brain, [0.859375, 0.859375, 7.0]);
    noticed(&brain, "the positions are taken");
    assert_eq!(brain.choices, 1);
    let orientation = brain.volume.orientation.unwrap();
    assert!((orientation.lps_from_grid[2][2] - 0.99096).abs() < 1e-4, "{orientation:?}");
    let ct = read(&folder.join("dicom_ct3")).unwrap();
    assert_eq!(ct.volume.dims, [512, 512, 3]);
    spacing_is(&ct, [0.810547, 0.810547, 1.0]);
    // Sorted upwards, though the files run downwards.
    assert!((ct.volume.orientation.unwrap().origin[2] + 128.69).abs() < 1e-5);
    let many = read(&folder.join("dicom_transfer_syntax/wg04")).unwrap();
    assert!(many.choices > 1 && many.choice_names.len() as u64 == many.choices);
    noticed(&many, "set `index` for another");
    let dose = read(&folder.join("dicom_transfer_syntax/rtdose.dcm")).unwrap();
    assert_eq!(dose.volume.dims, [10, 10, 15]);
    eprintln!("{}", formats::describe(&dose));
    eprintln!("{}", formats::describe(&read(&folder.join("dicom_multiframe/emri_small.dcm")).unwrap()));
}

/// Damaged copies of each file that are read.
const DAMAGED_COPIES: u64 = 150;
/// Longest time one of them may take.
const MAX_TIME: std::time::Duration = std::time::Duration::from_secs(5);

#[test]
fn damaged_compressed_pixels_end_in_words() {
    let Some(folder) = dicom("compressed pixels with damage") else { return };
    let temporary = tempfile::tempdir().unwrap();
    let mut refused = 0;
    for name in ["MR_small_RLE", "MR_small_jp2klossless", "MR_small_jpeg_ls_lossless", "wg04/MR4_JPLL"] {
        let whole = std::fs::read(folder.join(format!("dicom_transfer_syntax/{name}.dcm"))).unwrap();
        let pixels = whole.windows(4).position(|tag| tag == [0xE0, 0x7F, 0x10, 0]).unwrap() + 20;
        // A fixed series of places and values: Knuth's generator.
        let mut state = 1_u64;
        let mut next = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        for copy in 0..DAMAGED_COPIES {
            let mut bytes = whole.clone();
            for _ in 0..=copy % 4 {
                // Half of the damage goes where the stream states its own layout.
                let reach = if next(2) == 0 { 100 } else { bytes.len() - pixels };
                let at = pixels + next(reach);
                bytes[at] = next(256) as u8;
            }
            let path = write(temporary.path(), "a.dcm", &[&bytes]);
            let start = std::time::Instant::now();
            refused += u32::from(read(&path).is_err());
            assert!(start.elapsed() < MAX_TIME, "{name} {copy}: {:?}", start.elapsed());
        }
    }
    eprintln!("{refused} of {} damaged files were refused", 4 * DAMAGED_COPIES);
    assert!(refused > 50);
}
