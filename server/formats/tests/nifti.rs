//! NIfTI files that the tests write themselves.

mod common;

use common::*;
use formats::{Format, Limits, ReadOptions, read_volume};
use proto::scene_file::{Endian, VoxelType};

#[test]
fn every_type_byte_order_version_and_container_reads_the_same() {
    let folder = tempfile::tempdir().unwrap();
    for (voxel_type, _, _, code) in TYPES {
        let expected = values(voxel_type, 60);
        for endian in ENDIANS {
            for version in [1, 2] {
                let file = NiftiFile {
                    version,
                    endian,
                    pixdim: [1.0, 1.0, 2.0, 0.5, 0.0, 0.0, 0.0, 0.0],
                    ..NiftiFile::new(code, &DIMS)
                };
                let voxels = encode(&expected, voxel_type, endian);
                let single = file.bytes(&voxels);
                let pair = NiftiFile { is_pair: true, ..file };
                write(folder.path(), "p.img", &[&voxels]);
                write(folder.path(), "z.img.gz", &[&gzip(&voxels)]);
                for path in [
                    write(folder.path(), "a.nii", &[&single]),
                    write(folder.path(), "a.nii.gz", &[&gzip(&single)]),
                    write(folder.path(), "named_wrongly", &[&gzip(&single)]),
                    write(folder.path(), "p.hdr", &[&pair.header()]),
                    write(folder.path(), "z.hdr.gz", &[&gzip(&pair.header())]),
                    folder.path().join("p.img"),
                ] {
                    let imported = read(&path).unwrap();
                    let volume = &imported.volume;
                    assert_eq!(imported.format, Format::Nifti);
                    assert_eq!(imported.file_type, voxel_type);
                    assert_eq!((volume.dims, volume.spacing), (DIMS, [1.0, 2.0, 0.5]));
                    assert_eq!(volume.spacing_unit.as_deref(), Some("mm"));
                    assert_eq!(volume.orientation, None);
                    assert_eq!(data(&imported), expected, "{path:?} {voxel_type:?} {endian:?}");
                    assert!(imported.notices.is_empty(), "{:?}", imported.notices);
                }
            }
        }
    }
}

#[test]
fn slope_and_intercept_follow_the_standard() {
    let folder = tempfile::tempdir().unwrap();
    let nan = f64::NAN;
    let infinite = f64::INFINITY;
    for (slope, inter, expected, notice) in [
        (0.0, 5.0, (1.0, 0.0), false),
        (1.0, 0.0, (1.0, 0.0), false),
        (0.5, -3.0, (0.5, -3.0), false),
        (-1.0, 0.0, (-1.0, 0.0), false),
        (nan, 5.0, (1.0, 0.0), true),
        (infinite, 5.0, (1.0, 0.0), true),
        (2.0, nan, (1.0, 0.0), true),
        (3e38, 0.0, (1.0, 0.0), true),
    ] {
        for version in [1, 2] {
            let file = NiftiFile { version, slope, inter, ..NiftiFile::new(2, &DIMS) };
            let voxels = encode(&values(VoxelType::Uint8, 60), VoxelType::Uint8, Endian::Little);
            let path = write(folder.path(), "a.nii", &[&file.bytes(&voxels)]);
            let imported = read(&path).unwrap();
            let volume = &imported.volume;
            assert_eq!((volume.slope, volume.intercept), expected, "{slope} {inter}");
            assert_eq!(!imported.notices.is_empty(), notice, "{slope} {inter}");
            assert_eq!(volume.value(1, 0, 0), expected.0 * 10.0 + expected.1);
            let range = formats::data_range(volume);
            assert!(range[0] < range[1], "{range:?}");
        }
    }
}

#[test]
fn series_colours_and_complex_numbers_offer_a_choice() {
    let folder = tempfile::tempdir().unwrap();
    let expected = values(VoxelType::Int16, 60 * 6);
    let file = NiftiFile::new(4, &[5, 4, 3, 2, 3]);
    let bytes = file.bytes(&encode(&expected, VoxelType::Int16, Endian::Little));
    for path in [write(folder.path(), "a.nii", &[&bytes]), write(folder.path(), "a.nii.gz", &[&gzip(&bytes)])]
    {
        let imported = read(&path).unwrap();
        noticed(&imported, "6 volumes: index 0 of 6");
        assert_eq!(data(&imported), expected[..60]);
        for index in 0..6 {
            let imported = read_index(&path, index).unwrap();
            let start = 60 * index as usize;
            assert_eq!(data(&imported), expected[start..start + 60]);
            assert!(imported.notices.is_empty());
            assert_eq!(imported.choices, 6);
        }
        refused(read_index(&path, 6), "a.nii", &["index", "`6`", "below 6"]);
        let limits = Limits { max_decoded_bytes: 719, ..Limits::default() };
        assert!(read_volume(&path, &ReadOptions { limits, ..ReadOptions::default() }).is_err());
    }
    // A cut series is refused even if the chosen volume is whole.
    let cut = write(folder.path(), "cut.nii", &[&bytes[..bytes.len() - 1]]);
    refused(read(&cut), "cut.nii", &["720 bytes", "719"]);
    let zipped = gzip(&bytes[..bytes.len() - 1]);
    refused(read(&write(folder.path(), "cut.nii.gz", &[&zipped])), "cut.nii.gz", &["end"]);

    for (code, voxel_type, components, name) in [
        (128, VoxelType::Uint8, 3, "green"),
        (2304, VoxelType::Uint8, 4, "green"),
        (32, VoxelType::Float32, 2, "imaginary"),
        (1792, VoxelType::Float64, 2, "imaginary"),
    ] {
        let expected = values(voxel_type, 60 * components);
        let file = NiftiFile { slope: 2.0, ..NiftiFile::new(code, &DIMS) };
        let bytes = file.bytes(&encode(&expected, voxel_type, Endian::Little));
        let path = write(folder.path(), "a.nii", &[&bytes]);
        let imported = read_index(&path, 1).unwrap();
        noticed(&imported, name);
        let component: Vec<f64> = expected.iter().skip(1).step_by(components).copied().collect();
        assert_eq!(data(&imported), component);
        assert_eq!(imported.choices, components as u64);
        assert_eq!(imported.file_type, voxel_type);
    }
}

#[test]
fn extensions_are_skipped_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    let expected = values(VoxelType::Uint8, 60);
    let voxels = encode(&expected, VoxelType::Uint8, Endian::Little);
    let extension = |size: i32, endian: Endian| {
        let size = if endian == Endian::Big { size.to_be_bytes() } else { size.to_le_bytes() };
        [vec![1, 0, 0, 0], size.to_vec(), vec![0, 0, 0, 6], vec![b'x'; 24]].concat()
    };
    for version in [1, 2] {
        for endian in ENDIANS {
            let base = NiftiFile { version, endian, ..NiftiFile::new(2, &DIMS) };
            let file = NiftiFile { extensions: extension(32, endian), ..base.clone() };
            for bytes in [file.bytes(&voxels), gzip(&file.bytes(&voxels))] {
                let imported = read(&write(folder.path(), "a.nii", &[&bytes])).unwrap();
                assert_eq!(data(&imported), expected);
            }
            for size in [-16, 0, 7, 33, i32::MAX, i32::MIN] {
                let file = NiftiFile { extensions: extension(size, endian), ..base.clone() };
                let path = write(folder.path(), "a.nii", &[&file.bytes(&voxels)]);
                refused(read(&path), "a.nii", &["esize", &size.to_string()]);
            }
            let careless = NiftiFile { vox_offset: Some(0.0), ..base.clone() };
            let path = write(folder.path(), "a.nii", &[&careless.bytes(&voxels)]);
            assert_eq!(data(&read(&path).unwrap()), expected);
            for offset in [1.0, -352.0, 1e9] {
                let file = NiftiFile { vox_offset: Some(offset), ..base.clone() };
                let path = write(folder.path(), "a.nii", &[&file.bytes(&voxels)]);
                refused(read(&path), "a.nii", &["vox_offset"]);
            }
        }
    }
    for offset in [f64::NAN, f64::INFINITY, 352.5] {
        let file = NiftiFile { vox_offset: Some(offset), ..NiftiFile::new(2, &DIMS) };
        let path = write(folder.path(), "a.nii", &[&file.bytes(&voxels)]);
        refused(read(&path), "a.nii", &["vox_offset", "whole number"]);
    }
}

#[test]
fn wrong_fields_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let base = NiftiFile::new(2, &DIMS);
    let read_bytes = |bytes: &[u8]| read(&write(folder.path(), "a.nii", &[bytes, &[1; 60]]));
    let read_file = |file: NiftiFile| read_bytes(&file.header());
    let with_dim = |axis: usize, size: i64| {
        let mut file = base.clone();
        file.dim[axis] = size;
        file
    };
    for rank in [0, -3, 8, i64::from(i16::MIN)] {
        refused(read_file(with_dim(0, rank)), "a.nii", &["dim[0]", "1 to 7"]);
    }
    refused(read_file(with_dim(2, 0)), "a.nii", &["dim", "`0`"]);
    refused(read_file(with_dim(2, -4)), "a.nii", &["dim", "`-4`"]);
    refused(read_file(NiftiFile { version: 2, ..with_dim(2, 1 << 40) }), "a.nii", &["dim", "65536"]);
    let mut huge = NiftiFile { version: 2, ..base.clone() };
    huge.dim = [7, 2, 2, 2, 1 << 62, 1 << 62, 2, 2];
    refused(read_file(huge), "a.nii", &["dim[5]"]);
    let mut largest = base.clone();
    largest.dim = [7, 32767, 32767, 32767, 32767, 32767, 32767, 32767];
    refused(read_file(largest), "a.nii", &["limit"]);
    for code in [1, 1536, 2048] {
        let file = NiftiFile { datatype: code, ..base.clone() };
        refused(read_file(file), "a.nii", &["datatype", "not supported", "float32"]);
    }
    refused(read_file(NiftiFile { datatype: 9999, ..base.clone() }), "a.nii", &["`9999`"]);
    let mut bytes = base.header();
    bytes[344..348].copy_from_slice(b"abcd");
    refused(read_bytes(&bytes), "a.nii", &["magic", "abcd"]);
    bytes[0] = 7;
    refused(read_bytes(&bytes), "a.nii", &["sizeof_hdr", "348"]);
    refused(read(&write(folder.path(), "b.nii", &[b"short"])), "b.nii", &["too early", "348"]);
    refused(read(&write(folder.path(), "c.nii", &[b""])), "c.nii", &["too early"]);
    let pair = NiftiFile { is_pair: true, ..base };
    refused(read(&write(folder.path(), "d.hdr", &[&pair.header()])), "d.hdr", &[".img"]);
    refused(read(&write(folder.path(), "e.img", &[&[0; 60]])), "e.img", &[".hdr"]);
}
