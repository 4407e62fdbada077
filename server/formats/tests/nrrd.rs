//! NRRD files that the tests write themselves.

mod common;

use common::*;
use formats::{Format, ReadOptions, read_volume};
use proto::scene_file::{Endian, VoxelType};
use scene::Voxels;

#[test]
fn every_type_byte_order_and_encoding_reads_the_same() {
    let folder = tempfile::tempdir().unwrap();
    for (voxel_type, _, name, _) in TYPES {
        let expected = values(voxel_type, 60);
        for endian in ENDIANS {
            for encoding in ["raw", "gzip", "ascii", "hex"] {
                let bytes = encode(&expected, voxel_type, endian);
                let body = match encoding {
                    "raw" => bytes,
                    "gzip" => gzip(&bytes),
                    "ascii" => {
                        let words: Vec<String> = expected.iter().map(f64::to_string).collect();
                        words.join(" \n").into_bytes()
                    }
                    _ => bytes.iter().map(|b| format!("{b:02x}\n")).collect::<String>().into_bytes(),
                };
                let text = nrrd_header(name, endian, encoding, "spacings: 1 2 0.5\n\n");
                let path = write(folder.path(), "a.nrrd", &[text.as_bytes(), &body]);
                let imported = read(&path).unwrap();
                assert_eq!(imported.file_type, voxel_type);
                assert_eq!(imported.format, Format::Nrrd);
                assert_eq!(imported.volume.dims, DIMS);
                assert_eq!(imported.volume.spacing, [1.0, 2.0, 0.5]);
                assert_eq!(data(&imported), expected, "{name} {endian:?} {encoding}");
                assert!(imported.notices.is_empty(), "{:?}", imported.notices);
                let stored = imported.volume.voxels.voxel_type();
                let expected_type = match voxel_type {
                    VoxelType::Uint8 | VoxelType::Uint16 | VoxelType::Int16 => voxel_type,
                    VoxelType::Int8 => VoxelType::Int16,
                    _ => VoxelType::Float32,
                };
                assert_eq!(stored, expected_type);
            }
        }
    }
}

#[test]
fn detached_data_are_found_with_skips() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = u8_voxels();
    let check = |text: String| {
        let path = write(folder.path(), "a.nhdr", &[text.as_bytes()]);
        assert_eq!(data(&read(&path).unwrap()), values(VoxelType::Uint8, 60), "{text}");
    };
    write(folder.path(), "plain.raw", &[&voxels]);
    write(folder.path(), "with blank.raw", &[&voxels]);
    write(folder.path(), "junk.raw", &[b"seven b", &voxels]);
    write(folder.path(), "lines.raw", &[b"one\ntwo\nabc", &voxels]);
    write(folder.path(), "zip.gz", &[&gzip(&voxels)]);
    write(folder.path(), "lines.gz", &[b"a line\n", &gzip(&[b"xyz", voxels.as_slice()].concat())]);
    check(u8_header("raw", "data file: plain.raw\n"));
    check(u8_header("raw", "datafile: ./plain.raw\n\n"));
    check(u8_header("raw", "data file: with blank.raw\n"));
    check(u8_header("raw", "byte skip: 7\ndata file: junk.raw\n"));
    check(u8_header("raw", "byteskip: -1\ndata file: junk.raw\n"));
    check(u8_header("raw", "line skip: 2\nbyte skip: 3\ndata file: lines.raw\n"));
    check(u8_header("gzip", "data file: zip.gz\n"));
    check(u8_header("gzip", "lineskip: 1\nbyte skip: 3\ndata file: lines.gz\n"));
    // Windows line ends, and a detached header under the name of an attached one
    check(u8_header("raw", "data file: plain.raw\n").replace('\n', "\r\n"));
    let path = write(folder.path(), "b.nrrd", &[u8_header("raw", "datafile: plain.raw").as_bytes()]);
    assert_eq!(data(&read(&path).unwrap()), values(VoxelType::Uint8, 60));
}

#[test]
fn data_spread_over_files_are_joined() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = u8_voxels();
    for (i, slice) in voxels.chunks(20).enumerate() {
        write(folder.path(), &format!("s{:03}.raw", 5 - 2 * i), &[b"x", slice]);
        write(folder.path(), &format!("s{i}.gz"), &[&gzip(slice)]);
    }
    let check = |text: String| {
        let path = write(folder.path(), "a.nhdr", &[text.as_bytes()]);
        assert_eq!(data(&read(&path).unwrap()), values(VoxelType::Uint8, 60), "{text}");
    };
    check(u8_header("raw", "byte skip: 1\ndata file: s%03d.raw 5 1 -2\n"));
    check(u8_header("raw", "byte skip: -1\ndata file: LIST\ns005.raw\ns003.raw\ns001.raw\n"));
    check(u8_header("gzip", "data file: s%d.gz 0 2 1 2\n"));

    let refuse = |more: &str, pieces: &[&str]| {
        let path = write(folder.path(), "a.nhdr", &[u8_header("raw", more).as_bytes()]);
        refused(read(&path), "a.nhdr", pieces);
    };
    refuse("data file: s%03d.raw 5 1 2\n", &["data file", "step"]);
    refuse("data file: s%03d.raw 0 900000000 1\n", &["data files", "900000001", "16384"]);
    refuse("data file: s%099d.raw 0 1 1\n", &["data file", "pattern"]);
    refuse("data file: LIST\ns005.raw\ns003.raw\ns001.raw\ns001.raw\ns1\ns2\ns3\n", &["7 files"]);
    refuse("data file: LIST\n", &["0 files"]);
    let path = write(
        folder.path(),
        "b.nhdr",
        &[u8_header("raw", "data file: LIST\ns005.raw\ns003.raw\n").as_bytes()],
    );
    refused(read(&path), "s005.raw", &["30 bytes", "21 are there"]);
}

#[test]
fn strangers_cannot_point_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let outside = write(folder.path(), "outside.raw", &[&u8_voxels()]);
    let absolute = outside.to_str().unwrap();
    let trusting = ReadOptions { siblings_only: false, ..ReadOptions::default() };
    for name in ["../outside.raw", absolute, "../inner/../outside.raw"] {
        let text = u8_header("raw", &format!("data file: {name}\n"));
        let path = write(&inner, "a.nhdr", &[text.as_bytes()]);
        refused(read(&path), "a.nhdr", &["data file", "same folder"]);
        assert_eq!(
            data(&read_volume(&path, &trusting).unwrap()),
            values(VoxelType::Uint8, 60),
            "the command line may"
        );
    }
    for name in ["http://host/x.raw", "file:///etc/hostname", "..", ".", "", "missing.raw"] {
        for options in [ReadOptions::default(), trusting] {
            let text = u8_header("raw", &format!("data file: {name}\n"));
            let path = write(&inner, "a.nhdr", &[text.as_bytes()]);
            assert!(read_volume(&path, &options).is_err(), "{name}");
        }
    }
    let path = write(&inner, "self.nhdr", &[u8_header("raw", "data file: self.nhdr\n").as_bytes()]);
    refused(read_volume(&path, &trusting), "self.nhdr", &["itself"]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&outside, inner.join("link.raw")).unwrap();
        let path = write(&inner, "a.nhdr", &[u8_header("raw", "data file: link.raw\n").as_bytes()]);
        refused(read(&path), "a.nhdr", &["link"]);
        assert!(read_volume(&path, &trusting).is_ok());
        let path = write(&inner, "a.nhdr", &[u8_header("raw", "data file: /dev/zero\n").as_bytes()]);
        refused(read_volume(&path, &trusting), "zero", &["regular file"]);
    }
}

#[test]
fn values_that_do_not_fit_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut expected = values(VoxelType::Float64, 60);
    expected[7] = f64::NAN;
    expected[8] = f64::NEG_INFINITY;
    expected[9] = 1e300;
    expected[10] = 0.1;
    let text = nrrd_header("double", Endian::Big, "raw", "\n");
    let body = encode(&expected, VoxelType::Float64, Endian::Big);
    let imported = read(&write(folder.path(), "a.nrrd", &[text.as_bytes(), &body])).unwrap();
    noticed(&imported, "3 of 60 voxels were NaN");
    noticed(&imported, "became -46.75, the smallest finite value");
    noticed(&imported, "1 of 60 voxels lost precision from float64");
    assert_eq!(data(&imported)[7..10], [-46.75; 3]);

    let mut expected = values(VoxelType::Int32, 60);
    expected[0] = 16_777_217.0;
    let text = nrrd_header("int", Endian::Little, "raw", "\n");
    let body = encode(&expected, VoxelType::Int32, Endian::Little);
    let imported = read(&write(folder.path(), "a.nrrd", &[text.as_bytes(), &body])).unwrap();
    noticed(&imported, "1 of 60 voxels lost precision from int32");

    let body = [f32::NAN.to_le_bytes(); 60].concat();
    let text = nrrd_header("float", Endian::Little, "raw", "\n");
    let imported = read(&write(folder.path(), "a.nrrd", &[text.as_bytes(), &body])).unwrap();
    noticed(&imported, "60 of 60");
    assert_eq!(imported.volume.voxels, Voxels::F32(vec![0.0; 60]));
}
