//! Raw files and their sidecars.

mod common;

use common::*;
use formats::{Format, RawLayout, ReadOptions, read_sidecar, read_volume};
use proto::scene_file::{Endian, VoxelType};

fn layout(voxel_type: VoxelType, endian: Endian, header_bytes: u64) -> RawLayout {
    RawLayout { dims: DIMS.map(|n| n as u32), voxel_type, endian, header_bytes, spacing: None }
}

fn read_as(path: &std::path::Path, layout: RawLayout) -> Result<formats::Imported, formats::FormatError> {
    read_volume(path, &ReadOptions { raw: Some(layout), ..ReadOptions::default() })
}

#[test]
fn every_type_reads_by_layout_and_by_sidecar() {
    let folder = tempfile::tempdir().unwrap();
    for (voxel_type, ..) in TYPES {
        let expected = values(voxel_type, 60);
        for endian in ENDIANS {
            let voxels = encode(&expected, voxel_type, endian);
            let path = write(folder.path(), "a.raw", &[b"head", &voxels]);
            let imported = read_as(&path, layout(voxel_type, endian, 4)).unwrap();
            assert_eq!(imported.format, Format::Raw);
            assert_eq!((imported.volume.dims, imported.volume.spacing), (DIMS, [1.0; 3]));
            assert_eq!(data(&imported), expected);

            let json = serde_json::json!({
                "dims": DIMS, "type": voxel_type, "endian": endian, "header_bytes": 4,
                "spacing": [1, 2, 0.5]
            });
            write(folder.path(), "a.json", &[json.to_string().as_bytes()]);
            let imported = read(&path).unwrap();
            assert_eq!(imported.volume.spacing, [1.0, 2.0, 0.5]);
            assert_eq!(data(&imported), expected);
            let zipped = write(folder.path(), "z.raw.gz", &[&gzip(&[b"head", &voxels[..]].concat())]);
            assert_eq!(data(&read_as(&zipped, layout(voxel_type, endian, 4)).unwrap()), expected);
        }
    }
}

#[test]
fn the_sidecar_with_the_longer_name_wins() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "a.raw", &[&[1; 60]]);
    assert_eq!(read_sidecar(&path).unwrap(), None);
    write(folder.path(), "a.json", &[b"{\"version\": 1}"]);
    refused(read(&path), "a.json", &["version", "dims"]);
    write(folder.path(), "a.raw.json", &[b"{\"dims\": [5, 4, 3], \"type\": \"uint8\"}"]);
    let found = read_sidecar(&path).unwrap().unwrap();
    assert_eq!(found, layout(VoxelType::Uint8, Endian::Little, 0));
    assert!(read(&path).is_ok());
    for (text, piece) in [
        ("{\"dims\": [5, 4, 3]}", "type"),
        ("{\"dims\": [5, 4], \"type\": \"uint8\"}", "dims"),
        ("{\"dims\": [5, 4, -3], \"type\": \"uint8\"}", "dims[2]"),
        ("{\"dims\": [5, 4, 3], \"type\": \"uchar\"}", "uchar"),
        ("not json", "dims"),
    ] {
        write(folder.path(), "a.raw.json", &[text.as_bytes()]);
        refused(read(&path), "a.raw.json", &[piece]);
    }
    write(folder.path(), "a.raw.json", &["x".repeat(70_000).as_bytes()]);
    refused(read(&path), "a.raw.json", &["65536"]);
}

#[test]
fn what_is_missing_or_wrong_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "a.raw", &[&[1; 60]]);
    refused(read(&path), "a.raw", &["dims", "type", "endian", "header_bytes", "NAME.json"]);
    refused(
        read_as(&path, layout(VoxelType::Uint16, Endian::Little, 0)),
        "a.raw",
        &["60 bytes", "a file of 120 bytes (5 x 4 x 3 voxels of uint16 after 0 header bytes)"],
    );
    let short = layout(VoxelType::Uint8, Endian::Little, 1);
    refused(read_as(&path, short), "a.raw", &["60 bytes", "61 bytes"]);
    let absurd = layout(VoxelType::Uint8, Endian::Little, u64::MAX);
    refused(read_as(&path, absurd), "a.raw", &["60 bytes"]);
    let zero = RawLayout { dims: [5, 0, 3], ..short };
    refused(read_as(&path, zero), "a.raw", &["dims", "`0`"]);
    let huge = RawLayout { dims: [65536; 3], ..short };
    refused(read_as(&path, huge), "a.raw", &["limit"]);
    let flat = RawLayout { spacing: Some([1.0, 0.0, 1.0]), ..short };
    refused(read_as(&path, flat), "a.raw", &["spacing", "0.0"]);
    for name in ["a.dat", "a.vvd"] {
        let path = write(folder.path(), name, &[b"ObjectFileName: a.raw\n"]);
        refused(read(&path), name, &["NAME.json", "\"dims\""]);
    }
    let path = write(folder.path(), "a.txt", &[b"hello"]);
    refused(read(&path), "a.txt", &[".nrrd", ".nii", "raw"]);
    refused(read(&folder.path().join("absent.nrrd")), "absent.nrrd", &["open"]);
    refused(read(folder.path()), "", &["no DICOM image"]);
}

#[test]
fn content_decides_before_name_and_layout() {
    let folder = tempfile::tempdir().unwrap();
    let nrrd = b"NRRD0001\ntype: uint8\ndimension: 3\nsizes: 2 1 1\nencoding: raw\n\nab";
    let path = write(folder.path(), "a.raw", &[nrrd]);
    assert_eq!(read(&path).unwrap().format, Format::Nrrd);
    let with_layout = read_as(&path, layout(VoxelType::Uint8, Endian::Little, 0)).unwrap();
    assert_eq!(with_layout.format, Format::Nrrd);
    let file = NiftiFile::new(2, &DIMS);
    let path = write(folder.path(), "b.nrrd", &[&file.bytes(&[1; 60])]);
    assert_eq!(read(&path).unwrap().format, Format::Nifti);
    let path = write(folder.path(), "c.nrrd", &[&[1; 60]]);
    refused(read(&path), "c.nrrd", &["magic"]);
    let as_raw = read_as(&path, layout(VoxelType::Uint8, Endian::Little, 0)).unwrap();
    assert_eq!(as_raw.format, Format::Raw);
}
