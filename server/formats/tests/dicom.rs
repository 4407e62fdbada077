//! DICOM series written here: order, spacing, choice, scaling, and what is refused.

#![allow(clippy::unwrap_used)]

mod common;

use std::io::Write;
use std::path::Path;

use common::*;
use scene::Voxels;

/// Writes a file and returns nothing; names are out of order on purpose.
fn put(folder: &Path, name: &str, file: &DicomFile) {
    write(folder, name, &[&file.bytes()]);
}

/// Three slices 2.5 mm apart, named and numbered against their order.
fn series(folder: &Path) {
    for (name, instance, z, first) in [("a", 1, 5.0, 200), ("b", 2, 0.0, 0), ("c", 3, 2.5, 100)] {
        put(folder, name, &DicomFile::slice("1", instance, z, first));
    }
}

#[test]
fn slices_are_sorted_by_position() {
    let folder = tempfile::tempdir().unwrap();
    series(folder.path());
    let imported = read(folder.path()).unwrap();
    let volume = &imported.volume;
    assert_eq!(volume.dims, [4, 3, 3]);
    assert_eq!(volume.spacing, [0.5, 0.75, 2.5]);
    assert_eq!(volume.spacing_unit.as_deref(), Some("mm"));
    assert_eq!(volume.orientation.unwrap().origin, [-10.0, -20.0, 0.0]);
    assert_eq!(volume.value(0, 0, 0), -1000.0);
    assert_eq!(volume.value(3, 2, 1), -1000.0 + 111.0);
    assert_eq!(volume.value(0, 0, 2), -800.0);
    // Hounsfield units are stored as they are.
    assert!(matches!(volume.voxels, Voxels::I16(_)) && volume.intercept == 0.0);
    assert_eq!(imported.choice_names, ["CT series 1 (4 x 3, 3 slices)"]);
    assert!(imported.notices.is_empty(), "{:?}", imported.notices);
    let said = formats::describe(&imported).to_string();
    assert!(!said.contains("DOE") && !said.contains("4711"), "{said}");
}

#[test]
fn a_zip_archive_reads_as_its_folder_does() {
    let folder = tempfile::tempdir().unwrap();
    series(folder.path());
    let plain = read(folder.path()).unwrap();
    let path = folder.path().join("scan.zip");
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    for name in ["a", "b", "c"] {
        zip.start_file(format!("scan/{name}"), zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&std::fs::read(folder.path().join(name)).unwrap()).unwrap();
    }
    zip.start_file("scan/notes.txt", zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(b"hello").unwrap();
    zip.finish().unwrap();
    let zipped = read(&path).unwrap();
    assert!(plain.volume == zipped.volume);
    noticed(&zipped, "1 files that are not DICOM");
}

#[test]
fn several_series_are_listed_and_chosen() {
    let folder = tempfile::tempdir().unwrap();
    series(folder.path());
    std::fs::create_dir(folder.path().join("more")).unwrap();
    for (name, z) in [("x", 0.0), ("y", 1.0)] {
        put(&folder.path().join("more"), name, &DicomFile::slice("2", 1, z, 50));
    }
    let first = read(folder.path()).unwrap();
    assert_eq!((first.choices, first.volume.dims[2]), (2, 3));
    noticed(&first, "1: CT series 2 (4 x 3, 2 slices)");
    let second = read_index(folder.path(), 1).unwrap();
    assert_eq!((second.volume.dims[2], second.volume.value(0, 0, 0)), (2, -950.0));
    refused(read_index(folder.path(), 2), "", &["below 2"]);
    // A single file is itself alone.
    assert_eq!(read(&folder.path().join("a")).unwrap().volume.dims, [4, 3, 1]);
}

#[test]
fn moments_are_volumes_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    for (name, instance, z, first) in
        [("a", 1, 0.0, 0), ("b", 2, 1.0, 10), ("c", 3, 0.0, 100), ("d", 4, 1.0, 110)]
    {
        put(folder.path(), name, &DicomFile::slice("1", instance, z, first));
    }
    let second = read_index(folder.path(), 1).unwrap();
    assert_eq!((second.choices, second.volume.value(0, 0, 1)), (2, -890.0));
}

#[test]
fn missing_and_doubled_slices_are_told() {
    let folder = tempfile::tempdir().unwrap();
    for (name, z) in [("a", 0.0), ("b", 1.0), ("c", 2.0), ("e", 4.0)] {
        put(folder.path(), name, &DicomFile::slice("1", 1, z, (10.0 * z) as i16));
    }
    let gap = read(folder.path()).unwrap();
    assert_eq!((gap.volume.dims[2], gap.volume.spacing[2]), (5, 1.0));
    assert_eq!(gap.volume.value(0, 0, 3), -970.0);
    noticed(&gap, "1 missing between slices at 2.000 and 4.000 mm");
    put(folder.path(), "d", &DicomFile::slice("1", 9, 2.0, 7));
    let doubled = read(folder.path()).unwrap();
    assert_eq!(doubled.volume.value(0, 0, 2), -980.0);
    noticed(&doubled, "1 of 5 slices lie where another one does");
    put(folder.path(), "f", &DicomFile::slice("1", 9, 60.0, 7));
    refused(read(folder.path()), "", &["missing", "gaps"]);
}

#[test]
fn slices_scaled_differently_become_floats() {
    let folder = tempfile::tempdir().unwrap();
    put(folder.path(), "a", &DicomFile::slice("1", 1, 0.0, 10));
    let mut other = DicomFile::slice("1", 2, 1.0, 10);
    other.text(0x0028_1053, "DS", "0.5");
    put(folder.path(), "b", &other);
    let imported = read(folder.path()).unwrap();
    assert!(matches!(imported.volume.voxels, Voxels::F32(_)));
    assert_eq!([imported.volume.value(0, 0, 0), imported.volume.value(0, 0, 1)], [-990.0, -995.0]);
    noticed(&imported, "differ in rescale");
}

#[test]
fn tilted_stacks_padding_and_inversion_are_told() {
    let folder = tempfile::tempdir().unwrap();
    for (name, y, z) in [("a", -20.0, 0.0), ("b", -19.0, 2.0), ("c", -18.0, 4.0)] {
        let mut file = DicomFile::slice("1", 1, z, 100);
        file.text(0x0020_0032, "DS", &format!("-10\\{y}\\{z}"));
        file.text(0x0028_0004, "CS", "MONOCHROME1");
        file.number(0x0028_0120, (-2000_i16) as u16);
        file.pixels[0] = -2000;
        put(folder.path(), name, &file);
    }
    let imported = read(folder.path()).unwrap();
    assert_eq!(imported.volume.spacing[2], 2.0);
    noticed(&imported, "gantry tilt of 26.6 degrees");
    noticed(&imported, "MONOCHROME1");
    noticed(&imported, "3 pixels outside of the scan");
    assert_eq!(imported.volume.value(0, 0, 0), -899.0);
}

#[test]
fn bits_beyond_the_stored_ones_are_masked() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = DicomFile::slice("1", 1, 0.0, 0);
    file.number(0x0028_0101, 12);
    file.number(0x0028_0102, 11);
    // An overlay bit on top; the sign of 12 bits.
    file.pixels[0] = 0x1005;
    file.pixels[1] = 0x0FFF;
    put(folder.path(), "a.dcm", &file);
    let volume = read(&folder.path().join("a.dcm")).unwrap().volume;
    assert_eq!([volume.value(0, 0, 0), volume.value(1, 0, 0)], [-995.0, -1001.0]);
}

#[test]
fn what_is_no_volume_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let refuse = |change: &dyn Fn(&mut DicomFile), pieces: &[&str]| {
        let mut file = DicomFile::slice("1", 1, 0.0, 0);
        change(&mut file);
        put(folder.path(), "a.dcm", &file);
        refused(read(&folder.path().join("a.dcm")), "a.dcm", pieces);
    };
    refuse(&|f| f.text(0x0028_0004, "CS", "RGB"), &["colour"]);
    refuse(&|f| f.number(0x0028_0101, 17), &["BitsStored"]);
    refuse(&|f| f.number(0x0028_0100, 12), &["BitsAllocated"]);
    refuse(&|f| f.number(0x0028_0010, 65_535), &["ends too early"]);
    refuse(&|f| f.text(0x0020_0037, "DS", "1\\0\\0\\1\\0\\0"), &["ImageOrientationPatient"]);
    refuse(&|f| f.text(0x0028_0030, "DS", "0\\0"), &["PixelSpacing"]);
    refuse(&|f| f.text(0x0028_0008, "IS", "0"), &["NumberOfFrames"]);
    refuse(&|f| f.pixels.truncate(5), &["ends too early"]);
    let empty = tempfile::tempdir().unwrap();
    refused(read(empty.path()), "", &["no DICOM image"]);
    let mixed = tempfile::tempdir().unwrap();
    put(mixed.path(), "a.dcm", &DicomFile::slice("1", 1, 0.0, 0));
    let mut turned = DicomFile::slice("1", 2, 1.0, 0);
    turned.text(0x0020_0037, "DS", "0\\1\\0\\0\\0\\1");
    put(mixed.path(), "b.dcm", &turned);
    refused(read(mixed.path()), "a.dcm", &["b.dcm", "agree"]);
}

#[test]
fn frames_have_places_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = DicomFile::slice("1", 1, 0.0, 0);
    for tag in [0x0020_0032, 0x0028_1052, 0x0028_1053] {
        file.elements.remove(&tag);
    }
    file.text(0x0028_0008, "IS", "2");
    file.pixels = (0..24).collect();
    // Per-frame groups as one implicit value would hide: written as an explicit sequence.
    let element = |tag: u32, representation: &str, value: &[u8]| {
        let mut out = [((tag >> 16) as u16).to_le_bytes(), (tag as u16).to_le_bytes()].concat();
        out.extend(representation.as_bytes());
        match representation {
            "SQ" => out.extend([&[0, 0], &(value.len() as u32).to_le_bytes()[..]].concat()),
            _ => out.extend((value.len() as u16).to_le_bytes()),
        }
        out.extend(value);
        out
    };
    let item =
        |value: &[u8]| [&[0xFE, 0xFF, 0, 0xE0][..], &(value.len() as u32).to_le_bytes(), value].concat();
    let frame = |z: &str, slope: &str| {
        let position = element(0x0020_0032, "DS", format!("0\\0\\{z} ").as_bytes());
        let scaling =
            [element(0x0028_1052, "DS", b"5 "), element(0x0028_1053, "DS", slope.as_bytes())].concat();
        item(
            &[element(0x0020_9113, "SQ", &item(&position)), element(0x0028_9145, "SQ", &item(&scaling))]
                .concat(),
        )
    };
    let groups = element(0x5200_9230, "SQ", &[frame("-3", "1 "), frame("-6", "2 ")].concat());
    let bytes = file.bytes();
    let pixels_at = bytes.len() - 12 - 48;
    let all = [&bytes[..pixels_at], &groups, &bytes[pixels_at..]].concat();
    let path = write(folder.path(), "a.dcm", &[&all]);
    let volume = read(&path).unwrap().volume;
    assert_eq!((volume.dims, volume.spacing[2]), ([4, 3, 2], 3.0));
    // The second frame lies below the first.
    assert_eq!([volume.value(0, 0, 0), volume.value(0, 0, 1)], [29.0, 5.0]);
    assert_eq!(volume.orientation.unwrap().origin[2], -6.0);
}
