//! MetaImage files, written here.

#![allow(clippy::unwrap_used)]

mod common;

use std::io::Write;
use std::path::Path;

use common::*;
use formats::{ReadOptions, read_volume};
use proto::scene_file::{Endian, VoxelType};

const NAMES: [&str; 10] =
    ["UCHAR", "CHAR", "USHORT", "SHORT", "UINT", "INT", "ULONG_LONG", "LONG_LONG", "FLOAT", "DOUBLE"];

fn header(more: &str, data_file: &str) -> String {
    format!(
        "ObjectType = Image\nNDims = 3\nDimSize = 5 4 3\nElementSpacing = 1 2 3\n{more}ElementDataFile = {data_file}\n"
    )
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn every_type_plain_packed_and_as_text() {
    let folder = tempfile::tempdir().unwrap();
    for ((voxel_type, ..), name) in TYPES.into_iter().zip(NAMES) {
        let expected = values(voxel_type, 60);
        for endian in ENDIANS {
            let order = if endian == Endian::Big { "True" } else { "False" };
            let fields = format!("ElementType = MET_{name}\nBinaryDataByteOrderMSB = {order}\n");
            let body = encode(&expected, voxel_type, endian);
            let plain = write(folder.path(), "a.mha", &[header(&fields, "LOCAL").as_bytes(), &body]);
            let imported = read(&plain).unwrap();
            assert_eq!(imported.volume.spacing, [1.0, 2.0, 3.0]);
            assert_eq!(data(&imported), expected, "{name} {endian:?}");
            for packed in [zlib(&body), gzip(&body)] {
                let fields = format!("{fields}CompressedData = True\nCompressedDataSize = 7\n");
                write(folder.path(), "b.zraw", &[&packed]);
                let detached = write(folder.path(), "b.mhd", &[header(&fields, "b.zraw").as_bytes()]);
                assert_eq!(read(&detached).unwrap().volume, imported.volume);
            }
        }
        let text: Vec<String> = expected.iter().map(f64::to_string).collect();
        let fields = format!("BinaryData = False\nElementType = MET_{name}\n");
        let path =
            write(folder.path(), "c.mha", &[header(&fields, "LOCAL").as_bytes(), text.join(" ").as_bytes()]);
        assert_eq!(data(&read(&path).unwrap()), expected);
    }
}

#[test]
fn lists_patterns_and_skips() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = u8_voxels();
    for (i, slice) in voxels.chunks(20).enumerate() {
        write(folder.path(), &format!("s{}.raw", i + 1), &[b"junk", slice]);
    }
    let fields = "ElementType = MET_UCHAR\nHeaderSize = 4\n";
    for data_file in ["LIST\ns1.raw\ns2.raw\ns3.raw", "LIST 2D\ns1.raw\ns2.raw\ns3.raw\n\n", "s%d.raw 1 3 1"]
    {
        let path = write(folder.path(), "a.mhd", &[header(fields, data_file).as_bytes()]);
        assert_eq!(data(&read(&path).unwrap()), values(VoxelType::Uint8, 60), "{data_file}");
    }
    write(folder.path(), "end.raw", &[b"any length of junk", &voxels]);
    let fields = "ElementType = MET_UCHAR\nHeaderSize = -1\n";
    let path = write(folder.path(), "b.mhd", &[header(fields, "end.raw").as_bytes()]);
    assert_eq!(data(&read(&path).unwrap()), values(VoxelType::Uint8, 60));
}

#[test]
fn directions_are_lps_and_rows_of_the_matrix() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = u8_voxels();
    // The file's x runs backwards through y, its y through x: dims swap.
    let fields = "ElementType = MET_UCHAR\nTransformMatrix = 0 -1 0 1 0 0 0 0 1\nOffset = 10 20 30\n\
                  AnatomicalOrientation = RAI\n";
    let volume =
        read(&write(folder.path(), "a.mha", &[header(fields, "LOCAL").as_bytes(), &voxels])).unwrap().volume;
    assert_eq!((volume.dims, volume.spacing), ([4, 5, 3], [2.0, 1.0, 3.0]));
    assert_eq!(volume.orientation.unwrap().origin, [10.0, 20.0 - 4.0, 30.0]);
    let stored = values(VoxelType::Uint8, 60);
    assert_eq!(volume.value(1, 4, 0), stored[5]);
    // Letters alone say which side an axis starts from; question marks say nothing.
    let letters = "ElementType = MET_UCHAR\nAnatomicalOrientation = LPI\n";
    let volume =
        read(&write(folder.path(), "b.mha", &[header(letters, "LOCAL").as_bytes(), &voxels])).unwrap().volume;
    assert_eq!(volume.value(4, 3, 0), stored[0]);
    let unknown = "ElementType = MET_UCHAR\nAnatomicalOrientation = ???\n\
                   TransformMatrix = 1 0 0 0 1 0 0 0 1\n";
    let volume =
        read(&write(folder.path(), "c.mha", &[header(unknown, "LOCAL").as_bytes(), &voxels])).unwrap().volume;
    assert!(volume.orientation.is_none());
}

#[test]
fn channels_and_volumes_have_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = u8_voxels();
    let text = "NDims = 3\nDimSize = 5 2 2\nElementNumberOfChannels = 3\nElementType = MET_UCHAR_ARRAY\n\
                ElementSpacing = 1 1 1\nElementDataFile = LOCAL\n";
    let path = write(folder.path(), "a.mha", &[text.as_bytes(), &voxels]);
    let expected: Vec<f64> = values(VoxelType::Uint8, 60).into_iter().skip(2).step_by(3).collect();
    assert_eq!(data(&read_index(&path, 2).unwrap()), expected);
    let text = "NDims = 4\nDimSize = 5 2 2 3\nElementType = MET_UCHAR\nElementSpacing = 1 1 1 9\n\
                ElementDataFile = LOCAL\n";
    let path = write(folder.path(), "b.mha", &[text.as_bytes(), &voxels]);
    assert_eq!(data(&read_index(&path, 1).unwrap()), values(VoxelType::Uint8, 60)[20..40]);
}

fn with(folder: &Path, fields: &str, data_file: &str) -> Result<formats::Imported, formats::FormatError> {
    read(&write(folder, "a.mha", &[header(fields, data_file).as_bytes(), &u8_voxels()]))
}

#[test]
fn what_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let fields = "ElementType = MET_UCHAR\n";
    assert!(with(folder, fields, "LOCAL").is_ok());
    for (more, field) in [
        ("ElementType = MET_OTHER\n", "ElementType"),
        ("ElementType = MET_USHORT\n", "ends too early"),
        ("ElementType = MET_UCHAR\nElementType = MET_UCHAR\n", "ElementType"),
        ("ElementType = MET_UCHAR\nTransformMatrix = 0 0 0 0 0 0 0 0 0\n", "TransformMatrix"),
        ("ElementType = MET_UCHAR\nTransformMatrix = 1 0 0\n", "TransformMatrix"),
        ("ElementType = MET_UCHAR\nHeaderSize = 4611686018427387904\n", "ends too early"),
        ("ElementType = MET_UCHAR\nHeaderSize = -2\n", "HeaderSize"),
        ("ElementType = MET_UCHAR\nElementNumberOfChannels = 2147483647\n", "components"),
        ("ElementType = MET_UCHAR\nBinaryData = maybe\n", "BinaryData"),
        ("ElementType = MET_UCHAR\nCompressedData = True\n", "damaged"),
    ] {
        refused(with(folder, more, "LOCAL"), "a.mha", &[field]);
    }
    std::fs::create_dir(folder.join("sub")).unwrap();
    write(&folder.join("sub"), "a.raw", &[&u8_voxels()]);
    for name in ["/etc/passwd", "../a.raw", "sub/a.raw", "a.mha", "gone.raw", "http://host/a.raw"] {
        refused(with(folder, fields, name), "a.mha", &["ElementDataFile"]);
    }
    // A header that is trusted may point into folders.
    let options = ReadOptions { siblings_only: false, ..ReadOptions::default() };
    write(folder, "b.mhd", &[header(fields, "sub/a.raw").as_bytes()]);
    assert!(read_volume(&folder.join("b.mhd"), &options).is_ok());
}
