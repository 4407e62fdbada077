//! VTI files, written here.

#![allow(clippy::unwrap_used)]

mod common;

use std::io::Write;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use common::*;
use proto::scene_file::{Endian, VoxelType};

const NAMES: [&str; 10] =
    ["UInt8", "Int8", "UInt16", "Int16", "UInt32", "Int32", "UInt64", "Int64", "Float32", "Float64"];

#[derive(Clone, Copy)]
struct File<'a> {
    endian: Endian,
    wide: bool,
    /// `compressor` attribute and all.
    compressor: &'a str,
    points: &'a str,
    cells: &'a str,
    /// Tag and content.
    appended: &'a [u8],
}

const PLAIN: File<'static> =
    File { endian: Endian::Little, wide: false, compressor: "", points: "", cells: "", appended: b"" };

impl File<'_> {
    fn write(&self, folder: &Path) -> std::path::PathBuf {
        let order = if self.endian == Endian::Big { "BigEndian" } else { "LittleEndian" };
        let integers = if self.wide { "UInt64" } else { "UInt32" };
        let head = format!(
            "<?xml version=\"1.0\"?>\n<!-- a > comment -->\n<VTKFile type=\"ImageData\" \
             byte_order=\"{order}\" header_type=\"{integers}\" {}>\n<ImageData WholeExtent=\"1 5 0 3 2 4\" \
             Origin=\"0 0 0\" Spacing=\"1 2 3\">\n<FieldData><DataArray type=\"String\" format=\"ascii\">1 2\
             </DataArray></FieldData><Piece Extent=\"1 5 0 3 2 4\"><PointData Scalars=\"s\">{}</PointData>\
             <CellData>{}</CellData></Piece></ImageData>",
            self.compressor, self.points, self.cells
        );
        write(folder, "a.vti", &[head.as_bytes(), self.appended, b"</VTKFile>\n"])
    }

    fn integer(&self, value: usize) -> Vec<u8> {
        let mut bytes = (value as u64).to_le_bytes()[..if self.wide { 8 } else { 4 }].to_vec();
        if self.endian == Endian::Big {
            bytes.reverse();
        }
        bytes
    }

    /// Count of bytes and bytes.
    fn counted(&self, body: &[u8]) -> Vec<u8> {
        [self.integer(body.len()), body.to_vec()].concat()
    }

    /// Table and blocks of 64 bytes, apart.
    fn blocks(&self, body: &[u8]) -> [Vec<u8>; 2] {
        let packed: Vec<Vec<u8>> = body
            .chunks(64)
            .map(|block| {
                let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
                encoder.write_all(block).unwrap();
                encoder.finish().unwrap()
            })
            .collect();
        let sizes = packed.iter().map(Vec::len);
        let table = [packed.len(), 64, body.len() % 64].into_iter().chain(sizes);
        [table.flat_map(|n| self.integer(n)).collect(), packed.concat()]
    }
}

fn array(type_name: &str, more: &str, content: &str) -> String {
    format!("<DataArray type=\"{type_name}\" Name=\"s\" {more}>{content}</DataArray>")
}

#[test]
fn every_type_in_every_way_of_writing() {
    let folder = tempfile::tempdir().unwrap();
    for ((voxel_type, ..), name) in TYPES.into_iter().zip(NAMES) {
        let expected = values(voxel_type, 60);
        let check = |file: File<'_>, what: &str| {
            let imported = read(&file.write(folder.path())).unwrap_or_else(|e| panic!("{what}: {e}"));
            assert_eq!((imported.volume.dims, imported.volume.spacing), (DIMS, [1.0, 2.0, 3.0]));
            assert_eq!(imported.file_type, voxel_type);
            assert_eq!(data(&imported), expected, "{name} {what}");
        };
        let text: Vec<String> = expected.iter().map(f64::to_string).collect();
        let points = array(name, "format=\"ascii\"", &text.join("\n "));
        check(File { points: &points, ..PLAIN }, "text");
        for endian in ENDIANS {
            for wide in [false, true] {
                let file = File { endian, wide, ..PLAIN };
                let body = encode(&expected, voxel_type, endian);
                let counted = file.counted(&body);
                let points =
                    array(name, "format=\"binary\"", &format!("\n {}\n ", STANDARD.encode(&counted)));
                check(File { points: &points, ..file }, "inline");
                let points = array(name, "format=\"appended\" offset=\"3\"", "");
                let appended =
                    [b"<AppendedData encoding=\"raw\">\n _<&>", &counted[..], b"</AppendedData>"].concat();
                check(File { points: &points, appended: &appended, ..file }, "appended raw");
                let [table, packed] = file.blocks(&body);
                let zlib = File { compressor: "compressor=\"vtkZLibDataCompressor\"", ..file };
                let both = format!("{}{}", STANDARD.encode(&table), STANDARD.encode(&packed));
                let points = array(
                    name,
                    "format=\"binary\"",
                    &format!("<InformationKey name=\"L2\" location=\"x\"/>{both}"),
                );
                check(File { points: &points, ..zlib }, "inline blocks");
                let points = array(name, "format=\"appended\" offset=\"0\"", "");
                let appended = format!("<AppendedData encoding=\"base64\"> _{both}\n</AppendedData>");
                check(File { points: &points, appended: appended.as_bytes(), ..zlib }, "appended blocks");
            }
        }
    }
}

#[test]
fn arrays_and_components_have_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = |n: usize| (0..n).map(|i| i.to_string()).collect::<Vec<_>>().join(" ");
    let points = format!(
        "{}{}",
        array("Int16", "NumberOfComponents=\"2\" format=\"ascii\"", &numbers(120))
            .replace("\"s\"", "\"pair\""),
        array("UInt8", "format=\"ascii\"", &numbers(60))
    );
    // 4 x 3 x 2 cells
    let cells = array("Float32", "format=\"ascii\"", &numbers(24)).replace("\"s\"", "\"c\"");
    let path = File { points: &points, cells: &cells, ..PLAIN }.write(folder.path());
    let shown = read(&path).unwrap();
    assert_eq!((shown.choices, shown.file_type), (4, VoxelType::Uint8));
    noticed(&shown, "index 2 of 4");
    let second = read_index(&path, 1).unwrap();
    assert_eq!(data(&second)[..3], [1.0, 3.0, 5.0]);
    let cells = read_index(&path, 3).unwrap();
    assert_eq!(cells.volume.dims, [4, 3, 2]);
    noticed(&cells, "cells");
    refused(read_index(&path, 4), "a.vti", &["index", "4"]);
}

#[test]
fn what_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = u8_voxels();
    let counted = STANDARD.encode(PLAIN.counted(&voxels));
    let good = array("UInt8", "format=\"binary\"", &counted);
    let path = File { points: &good, ..PLAIN }.write(folder.path());
    assert!(read(&path).is_ok());
    let text = std::fs::read_to_string(&path).unwrap();
    for (from, to, words) in [
        ("UInt8", "String", "DataArray type"),
        ("ImageData\"", "PolyData\"", "not supported"),
        ("Spacing=\"1 2 3\"", "Spacing=\"1 2\"", "Spacing"),
        ("Spacing=\"1 2 3\"", "Spacing=\"1 nan 3\"", "Spacing"),
        ("Piece Extent=\"1 5 0 3 2 4\"", "Piece Extent=\"1 5 0 3 2 3\"", "Piece"),
        ("1 5 0 3 2 4", "1 6 0 3 2 4", "bytes of the array"),
        ("1 5 0 3 2 4", "1 5 0 3 2 99999999999", "WholeExtent"),
        ("LittleEndian", "MiddleEndian", "byte_order"),
        ("UInt32", "UInt16", "header_type"),
        ("header_type", "compressor=\"vtkLZMADataCompressor\" header_type", "LZMA"),
        ("format=\"binary\"", "format=\"appended\"", "AppendedData"),
        (&counted, "!!!!", "base64"),
        (&counted, "", "DataArray"),
        (&counted, &counted[..40], "voxels"),
        ("</Piece>", "<Piece Extent=\"1 5 0 3 2 4\"/></Piece>", "pieces"),
        ("</CellData>", "</PointData>", "XML"),
    ] {
        let changed = text.replace(from, to);
        assert_ne!(changed, text, "{from}");
        let result = read(&write(folder.path(), "b.vti", &[changed.as_bytes()]));
        if words == "voxels" {
            assert!(result.is_err());
        } else {
            refused(result, "b.vti", &[words]);
        }
    }
}
