//! TIFF stacks and folders of slices. The files are written by the crates `tiff` and `image`; other
//! writers' files are among the shared data.

#![allow(clippy::unwrap_used)]

mod common;

use std::fs::File;
use std::path::Path;

use common::*;
use formats::Format;
use tiff::encoder::colortype::{Gray8, Gray16, Gray32Float, GrayI16, RGB8};
use tiff::encoder::{Rational, TiffEncoder};
use tiff::tags::Tag;

/// Six pages of 5 x 4; each value tells its place.
fn value(page: usize, pixel: usize) -> u16 {
    (1000 * page + pixel) as u16
}

fn stack(path: &Path, description: &str) {
    let mut encoder = TiffEncoder::new(File::create(path).unwrap()).unwrap();
    for page in 0..6 {
        let pixels: Vec<u16> = (0..20).map(|pixel| value(page, pixel)).collect();
        let mut image = encoder.new_image::<Gray16>(5, 4).unwrap();
        image.encoder().write_tag(Tag::ImageDescription, description).unwrap();
        image.x_resolution(Rational { n: 4, d: 1 });
        image.y_resolution(Rational { n: 2, d: 1 });
        image.write_data(&pixels).unwrap();
    }
}

#[test]
fn pages_are_slices() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    stack(&path, "nothing special");
    let imported = read(&path).unwrap();
    assert_eq!((imported.volume.dims, imported.choices, imported.format), ([5, 4, 6], 1, Format::Tiff));
    assert_eq!(imported.volume.value(3, 2, 4), f64::from(value(4, 13)));
    // Dots per inch of a print say nothing about voxels.
    assert_eq!(imported.volume.spacing, [1.0; 3]);
    // The content tells the format, not the name.
    let renamed = folder.path().join("a.dat");
    std::fs::copy(&path, &renamed).unwrap();
    assert_eq!(read(&renamed).unwrap().volume, imported.volume);
}

#[test]
fn hyperstacks_of_imagej_have_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    stack(&path, "ImageJ=1.53t\nimages=6\nchannels=2\nslices=3\nhyperstack=true\nunit=um\nspacing=1.5\n");
    let imported = read_index(&path, 1).unwrap();
    assert_eq!((imported.volume.dims, imported.choices), ([5, 4, 3], 2));
    assert_eq!(imported.volume.spacing, [0.25, 0.5, 1.5]);
    assert_eq!(imported.volume.spacing_unit.as_deref(), Some("um"));
    assert_eq!(imported.volume.value(0, 0, 2), f64::from(value(5, 0)));
}

#[test]
fn other_types_and_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let encoder = || TiffEncoder::new(File::create(&path).unwrap()).unwrap();
    encoder().write_image::<Gray32Float>(2, 1, &[0.5, f32::NAN]).unwrap();
    let imported = read(&path).unwrap();
    assert_eq!(data(&imported), [0.5, 0.5]);
    noticed(&imported, "1 of 2 voxels");
    encoder().write_image::<GrayI16>(2, 1, &[-5, 7]).unwrap();
    assert_eq!(data(&read(&path).unwrap()), [-5.0, 7.0]);
    encoder().write_image::<RGB8>(2, 1, &[1, 2, 3, 4, 5, 6]).unwrap();
    let green = read_index(&path, 1).unwrap();
    assert_eq!((data(&green), green.choices), (vec![2.0, 5.0], 3));
    noticed(&green, "one of them");
}

/// A page of 3 x 2 bytes, little-endian, with the entries given besides those every page has.
fn page_by_hand(more: &[(u16, u16, u32)]) -> Vec<u8> {
    const SHORT: u16 = 3;
    const LONG: u16 = 4;
    // The strip follows the header at once.
    let mut entries = vec![
        (Tag::ImageWidth.to_u16(), SHORT, 3),
        (Tag::ImageLength.to_u16(), SHORT, 2),
        (Tag::BitsPerSample.to_u16(), SHORT, 8),
        (Tag::Compression.to_u16(), SHORT, 1),
        (Tag::PhotometricInterpretation.to_u16(), SHORT, 1),
        (Tag::StripOffsets.to_u16(), LONG, 8),
    ];
    entries.extend_from_slice(more);
    entries.sort_unstable();
    let mut bytes = b"II*\0\x0e\0\0\0\x01\x02\x03\x04\x05\x06".to_vec();
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, value) in entries {
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(1u32.to_le_bytes());
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([0; 4]);
    bytes
}

#[test]
fn without_rows_per_strip_a_page_is_one_strip() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let counted = (Tag::StripByteCounts.to_u16(), 4, 6);
    let rows = |rows: u32| (Tag::RowsPerStrip.to_u16(), 4, rows);
    for more in [vec![counted], vec![counted, rows(2)], vec![counted, rows(u32::MAX)]] {
        std::fs::write(&path, page_by_hand(&more)).unwrap();
        let imported = read(&path).unwrap_or_else(|error| panic!("{more:?}: {error}"));
        assert_eq!(imported.volume.dims, [3, 2, 1], "{more:?}");
        assert_eq!(data(&imported), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "{more:?}");
    }
    // Two strips of one row, of which the page has one.
    std::fs::write(&path, page_by_hand(&[counted, rows(1)])).unwrap();
    assert!(read(&path).is_err());
}

#[test]
fn folders_of_slices_are_read_in_the_order_of_their_numbers() {
    for kind in ["png", "tif"] {
        let folder = tempfile::tempdir().unwrap();
        for z in 0..12_u16 {
            let path = folder.path().join(format!("s{z}.{kind}"));
            let pixels: Vec<u16> = (0..20).map(|pixel| value(z.into(), pixel)).collect();
            if kind == "png" {
                image::ImageBuffer::<image::Luma<u16>, _>::from_raw(5, 4, pixels)
                    .unwrap()
                    .save(&path)
                    .unwrap();
            } else {
                let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
                encoder.write_image::<Gray16>(5, 4, &pixels).unwrap();
            }
        }
        write(folder.path(), "notes.txt", &[b"not a slice"]);
        let imported = read(folder.path()).unwrap();
        assert_eq!(imported.volume.dims, [5, 4, 12]);
        assert_eq!(imported.volume.value(1, 0, 10), f64::from(value(10, 1)), "{kind}");
        assert_eq!(imported.format.name(), if kind == "png" { "png" } else { "tiff" });

        // One slice of another size, or cut short, spoils them all.
        let path = folder.path().join(format!("s5.{kind}"));
        let good = std::fs::read(&path).unwrap();
        std::fs::write(&path, &good[..good.len() / 2]).unwrap();
        refused(read(folder.path()), "", &["s5"]);
        if kind == "png" {
            image::GrayImage::new(5, 5).save(&path).unwrap();
        } else {
            let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
            encoder.write_image::<Gray8>(5, 4, &[0; 20]).unwrap();
        }
        refused(read(folder.path()), "s5", &["expected"]);
    }
    let empty = tempfile::tempdir().unwrap();
    refused(read(empty.path()), "", &["no DICOM image"]);
}

#[test]
fn pages_that_differ_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
    encoder.write_image::<Gray8>(5, 4, &[0; 20]).unwrap();
    encoder.write_image::<Gray8>(4, 5, &[0; 20]).unwrap();
    refused(read(&path), "a.tif", &["page 1", "4 x 5", "5 x 4"]);
}

/// The decoder reserves memory for as many values as the entry of a directory states.
#[test]
fn tables_that_lie_about_their_length_reserve_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    stack(&path, "nothing special");
    let mut bytes = std::fs::read(&path).unwrap();
    // The sample format of the last page: one 16-bit number.
    let entry = [0x53, 0x01, 3, 0, 1, 0, 0, 0];
    let last = bytes.windows(entry.len()).rposition(|window| window == entry).unwrap();
    bytes[last + 4..last + 8].copy_from_slice(&0x03FF_FFFF_u32.to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    refused(read(&path), "a.tif", &["page 5", "limits"]);
}
