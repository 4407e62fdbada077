//! NRRD files that are refused, and the limits on those that are not.

mod common;

use common::*;
use formats::{Limits, ReadOptions, read_volume};
use proto::scene_file::VoxelType;

#[test]
fn damaged_data_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = u8_voxels();
    let zipped = gzip(&voxels);
    let read_with = |encoding: &str, more: &str, body: &[u8]| {
        let end = if more.is_empty() { "\n" } else { "\n\n" };
        let text = u8_header(encoding, &format!("{more}{end}"));
        read(&write(folder.path(), "a.nrrd", &[text.as_bytes(), body]))
    };
    refused(read_with("raw", "", &voxels[..59]), "a.nrrd", &["60 bytes", "59 are there"]);
    refused(read_with("gzip", "", &zipped[..zipped.len() - 9]), "a.nrrd", &["gzip", "cut short"]);
    refused(read_with("gzip", "", &zipped[..zipped.len() - 2]), "a.nrrd", &["gzip", "cut short"]);
    let mut flipped = zipped.clone();
    let end = flipped.len();
    flipped[end - 6] ^= 1;
    refused(read_with("gzip", "", &flipped), "a.nrrd", &["gzip", "damaged"]);
    refused(read_with("gzip", "", &voxels), "a.nrrd", &["not gzip"]);
    refused(read_with("gzip", "", &gzip(&voxels[..40])), "a.nrrd", &["end"]);
    refused(read_with("ascii", "", b"1 2 300 4"), "a.nrrd", &["60 bytes"]);
    let words = "1 2 300 ".repeat(30);
    refused(read_with("ascii", "", words.as_bytes()), "a.nrrd", &["300", "u8"]);
    refused(read_with("ascii", "", "7".repeat(300).as_bytes()), "a.nrrd", &["64 characters"]);
    refused(read_with("hex", "", "0g".repeat(60).as_bytes()), "a.nrrd", &["'g'"]);
    refused(read_with("bzip2", "", &voxels), "a.nrrd", &["bzip2", "gzip"]);
    refused(read_with("raw", "byte skip: -2", &voxels), "a.nrrd", &["byte skip", "`-2`"]);
    refused(read_with("raw", "byte skip: 1", &voxels), "a.nrrd", &["60 bytes", "59"]);
    refused(read_with("raw", "byte skip: 18446744073709551615", &voxels), "a.nrrd", &["bytes"]);
    refused(read_with("raw", "line skip: 99", &voxels), "a.nrrd", &["line skip", "`99`"]);
    refused(read_with("raw", "spacings: 1 1 1\nspacings: 1 1 1", &voxels), "a.nrrd", &["second"]);
    refused(read_with("raw", "spacings: 1 1e9 1", &voxels), "a.nrrd", &["longest edge"]);

    // Two members count as one; other bytes behind are ignored, an endless tail is not.
    let (a, b) = voxels.split_at(31);
    let members = [gzip(a), gzip(b)].concat();
    assert_eq!(data(&read_with("gzip", "", &members).unwrap()), values(VoxelType::Uint8, 60));
    let stray = [zipped.clone(), b"padding".to_vec()].concat();
    noticed(&read_with("gzip", "", &stray).unwrap(), "after the end of the gzip data");
    let tail = gzip(&[voxels.clone(), vec![0; 100]].concat());
    noticed(&read_with("gzip", "", &tail).unwrap(), "100 bytes after the last voxel");
    let bomb = gzip(&[voxels.clone(), vec![0; 50 << 20]].concat());
    refused(read_with("gzip", "", &bomb), "a.nrrd", &["go on"]);
    let empty_members = gzip(&[]).repeat(1000);
    refused(read_with("gzip", "", &empty_members), "a.nrrd", &["members"]);
}

#[test]
fn wrong_fields_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let good = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 5 4 3\nencoding: raw\n\n";
    let with = |from: &str, to: &str| {
        let text = good.replace(from, to);
        assert_ne!(text, good);
        read(&write(folder.path(), "a.nrrd", &[text.as_bytes(), &u8_voxels()]))
    };
    refused(with("NRRD0004", "NRRD0009"), "a.nrrd", &["magic", "NRRD0009"]);
    refused(with("uint8", "quaternion"), "a.nrrd", &["type", "`quaternion`", "uint8"]);
    refused(with("uint8", "block"), "a.nrrd", &["block"]);
    refused(with("uint8", "short"), "a.nrrd", &["endian", "got nothing"]);
    refused(with("type: uint8\n", ""), "a.nrrd", &["type", "got nothing"]);
    refused(with("dimension: 3", "dimension: 17"), "a.nrrd", &["dimension", "`17`", "1 to 16"]);
    refused(with("dimension: 3", "dimension: 4"), "a.nrrd", &["sizes", "`5 4 3`", "4 whole"]);
    refused(with("5 4 3", "5 0 3"), "a.nrrd", &["sizes", "`5 0 3`"]);
    refused(with("5 4 3", "5 4 70000"), "a.nrrd", &["sizes", "`70000`", "65536"]);
    refused(with("5 4 3", "60000 60000 60000"), "a.nrrd", &["limit"]);
    refused(with("raw", "zstd"), "a.nrrd", &["encoding", "`zstd`"]);
    refused(with("\n\n", "\nspace: moon\n\n"), "a.nrrd", &["space", "`moon`"]);
    refused(with("\n\n", "\nspace: RAST\n\n"), "a.nrrd", &["RAST", "without time"]);
    refused(with("\n\n", "\nspace directions: (1,0,0)\n\n"), "a.nrrd", &["space", "got nothing"]);
    for directions in
        ["(1,0,0) (0,1,0)", "(1,0,0) (0,1,0) (0,0,x)", "(1,0) (0,1) (1,1)", "((((", "none none none"]
    {
        let text = format!("\nspace: LPS\nspace directions: {directions}\n\n");
        assert!(with("\n\n", &text).is_err(), "{directions}");
    }
    refused(with("\n\n", "\nspacings: 1 1\n\n"), "a.nrrd", &["spacings", "3 values"]);
    refused(with("\n\n", "\nwhat is this\n\n"), "a.nrrd", &["header line", "`what is this`"]);
    noticed(&with("\n\n", "\ncolour: red\n\n").unwrap(), "`colour`");
    let long = format!("\ncontent: {}\n\n", "x".repeat(17 << 20));
    refused(with("\n\n", &long), "a.nrrd", &["header", "limit"]);
}

#[test]
fn limits_and_progress_hold() {
    let folder = tempfile::tempdir().unwrap();
    let body: Vec<u8> = vec![1; 2 * 300 * 200 * 100];
    let text = "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 300 200 100 2\nencoding: gzip\n\n";
    let path = write(folder.path(), "a.nrrd", &[text.as_bytes(), &gzip(&body)]);
    let seen = std::sync::Mutex::new(Vec::new());
    let progress = |fraction: f32| seen.lock().unwrap().push(fraction);
    let options = ReadOptions { progress: &progress, index: Some(1), ..ReadOptions::default() };
    read_volume(&path, &options).unwrap();
    let seen = seen.into_inner().unwrap();
    assert!(seen.len() > 4 && seen.is_sorted(), "{seen:?}");
    assert_eq!(seen.last(), Some(&1.0));
    for limits in [
        Limits { max_voxel_bytes: 5_999_999, ..Limits::default() },
        Limits { max_decoded_bytes: 11_999_999, ..Limits::default() },
        Limits { max_axis: 299, ..Limits::default() },
        Limits { max_header_bytes: 20, ..Limits::default() },
    ] {
        let options = ReadOptions { limits, ..ReadOptions::default() };
        assert!(read_volume(&path, &options).is_err(), "{limits:?}");
    }
}
