//! The seeds of the fuzz targets (`server/formats/fuzz`): small valid files of every kind. Every
//! one runs through its case here, so that the targets' promises hold in an ordinary test run.
//!
//! `TYNDALL_BLESS=1` writes the seeds anew. A file whose name starts with `refused` is kept for
//! what it once broke.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

#[path = "../fuzz/src/cases.rs"]
mod cases;

use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use cases::CASES;
use common::*;
use exr::prelude::{Compression, Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};
use image::{DynamicImage, ImageFormat};
use proto::scene_file::{Endian, VoxelType};
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32Float, RGB8};
use zip::write::{SimpleFileOptions, ZipWriter};

/// Largest seed, bytes: the fuzzer starts from small files.
const MAX_SEED_BYTES: u64 = 2 << 10;
/// All seeds together, bytes.
const MAX_SEEDS_BYTES: u64 = 60 << 10;

/// Target, name and content.
type Seed = (&'static str, String, Vec<u8>);

#[test]
fn every_seed_is_read() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
    if std::env::var_os("TYNDALL_BLESS").is_some() {
        for (target, name, bytes) in seeds() {
            fs::create_dir_all(root.join(target)).unwrap();
            fs::write(root.join(target).join(name), bytes).unwrap();
        }
    }
    let scratch = tempfile::tempdir().unwrap();
    let mut all_bytes = 0;
    for (target, case) in CASES {
        let seeds = files(&root.join(target));
        assert!(seeds.len() > 1, "{target} has {} seeds", seeds.len());
        for path in seeds {
            let bytes = fs::read(&path).unwrap();
            let kept = path.file_name().unwrap().to_string_lossy().starts_with("refused");
            assert_eq!(case(scratch.path(), &bytes), !kept, "{}", path.display());
            assert!(bytes.len() as u64 <= MAX_SEED_BYTES, "{}: {} bytes", path.display(), bytes.len());
            all_bytes += bytes.len() as u64;
        }
    }
    assert!(all_bytes <= MAX_SEEDS_BYTES, "{all_bytes} bytes");
}

#[test]
fn every_target_has_a_case_and_seeds() {
    let names: Vec<String> = CASES.iter().map(|(name, _)| (*name).to_owned()).collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let stems = |folder: PathBuf| -> Vec<String> {
        files(&folder).iter().map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect()
    };
    assert_eq!(stems(folder.join("fuzz_targets")), names);
    assert_eq!(stems(folder.join("seeds")), names);
}

/// What lies in a folder, by name.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// 5 x 4 x 3 floats.
fn floats(endian: Endian) -> Vec<u8> {
    encode(&values(VoxelType::Float32, 60), VoxelType::Float32, endian)
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn seeds() -> Vec<Seed> {
    let mut seeds = Vec::new();
    let mut add = |target, name: &str, bytes: Vec<u8>| seeds.push((target, name.to_owned(), bytes));
    text_headers(&mut add);
    nifti(&mut add);
    arrays(&mut add);
    vti(&mut add);
    pictures(&mut add);
    zarr(&mut add);
    dicom(&mut add);
    seeds
}

/// Takes a seed.
type Add<'a> = &'a mut dyn FnMut(&'static str, &str, Vec<u8>);

fn text_headers(add: Add<'_>) {
    let two = [floats(Endian::Big), floats(Endian::Big)].concat();
    let ascii = "1.5 ".repeat(120).into_bytes();
    for (name, encoding, body) in [
        ("raw.nrrd", "raw", two.clone()),
        ("gzip.nrrd", "gzip", gzip(&two)),
        ("ascii.nrrd", "ascii", ascii.clone()),
        ("hex.nrrd", "hex", "3f800000".repeat(120).into_bytes()),
        ("detached.nrrd", "raw\ndata file: d%d.raw 1 2 1", Vec::new()),
        ("list.nrrd", "raw\ndata file: LIST\nd1.raw\nd2.raw", Vec::new()),
    ] {
        add("nrrd", name, [format!("{NRRD_TEXT}encoding: {encoding}\n\n").as_bytes(), &body].concat());
    }
    let plain = u8_header("raw", "spacings: 1 2 0.5\nunits: \"mm\" \"mm\" \"mm\"\n\n");
    add("nrrd", "plain.nrrd", [plain.as_bytes(), &u8_voxels()].concat());

    for (name, more, data_file, body) in [
        ("local.mha", "", "LOCAL", two.clone()),
        ("zlib.mha", "CompressedData = True\n", "LOCAL", zlib(&two)),
        ("ascii.mha", "BinaryData = False\n", "LOCAL", ascii),
        ("detached.mhd", "HeaderSize = 0\n", "d%d.raw 1 2 1", Vec::new()),
        ("list.mhd", "", "LIST\nd1.raw\nd2.raw", Vec::new()),
    ] {
        let header = format!("{METAIMAGE_TEXT}{more}ElementDataFile = {data_file}\n");
        add("metaimage", name, [header.as_bytes(), &body].concat());
    }
}

fn nifti(add: Add<'_>) {
    let file = |version, endian| NiftiFile {
        version,
        endian,
        qform_code: 1,
        sform_code: 1,
        srow: [[-2.0, 0.0, 0.0, 1.0], [0.0, -2.0, 0.0, 2.0], [0.0, 0.0, 2.0, 3.0]],
        slope: 1.5,
        extensions: match endian {
            Endian::Little => [vec![1, 0, 0, 0, 16, 0, 0, 0], vec![0; 12]].concat(),
            Endian::Big => [vec![1, 0, 0, 0, 0, 0, 0, 16], vec![0; 12]].concat(),
        },
        ..NiftiFile::new(16, &[5, 4, 3, 2])
    };
    let two = |endian| [floats(endian), floats(endian)].concat();
    let first = file(1, Endian::Little);
    add("nifti", "first.nii", first.bytes(&two(Endian::Little)));
    add("nifti", "first.nii.gz", gzip(&first.bytes(&two(Endian::Little))));
    add("nifti", "second.nii", file(2, Endian::Big).bytes(&two(Endian::Big)));
    let turned = NiftiFile { sform_code: 0, quatern: [0.5, 0.5, 0.5], ..NiftiFile::new(4, &[5, 4, 3]) };
    add("nifti", "turned.nii", turned.bytes(&[1; 120]));
    for (name, version) in [("pair.hdr", 1), ("second_pair.hdr", 2)] {
        let pair = NiftiFile { is_pair: true, ..file(version, Endian::Little) };
        add("nifti", name, pair.header());
    }
}

fn arrays(add: Add<'_>) {
    for (name, descr, order, bytes) in [
        ("half.npy", "<f2", "False", 120),
        ("big.npy", ">i4", "True", 240),
        ("bytes.npy", "|u1", "False", 60),
    ] {
        let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': (3, 4, 5), }}\n");
        let length = (header.len() as u16).to_le_bytes();
        add("npy", name, [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), &vec![7; bytes]].concat());
    }
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2, 2), }\n";
    let length = (header.len() as u32).to_le_bytes();
    add("npy", "long.npy", [b"\x93NUMPY\x02\x00", &length[..], header.as_bytes(), &[0; 96]].concat());

    let bytes = b"{\"dims\": [5, 4, 3], \"type\": \"uint8\"}\n";
    add("raw", "bytes", [&bytes[..], &u8_voxels()].concat());
    let floats_layout = b"{\"dims\": [5, 4, 3], \"type\": \"float32\", \"endian\": \"big\", \
        \"header_bytes\": 4, \"spacing\": [1, 2, 0.5]}\n";
    let body = [b"head", &floats(Endian::Big)[..]].concat();
    add("raw", "floats", [&floats_layout[..], &body].concat());
    add("raw", "floats_gzip", [&floats_layout[..], &gzip(&body)].concat());
}

fn vti(add: Add<'_>) {
    let body = floats(Endian::Little);
    let counted = [&240_u32.to_le_bytes()[..], &body].concat();
    let packed = zlib(&body);
    let table: Vec<u8> =
        [1, 240, 0, packed.len() as u32].iter().flat_map(|n: &u32| n.to_le_bytes()).collect();
    let ascii: String = values(VoxelType::Float32, 60).iter().map(|value| format!("{value} ")).collect();
    for (name, attributes, format, content, appended) in [
        ("ascii.vti", "", "ascii", ascii, Vec::new()),
        ("binary.vti", "", "binary", STANDARD.encode(&counted), Vec::new()),
        (
            "zlib.vti",
            "compressor=\"vtkZLibDataCompressor\"",
            "binary",
            STANDARD.encode(&table) + &STANDARD.encode(&packed),
            Vec::new(),
        ),
        (
            "appended.vti",
            "",
            "appended\" offset=\"0",
            String::new(),
            [b"<AppendedData encoding=\"raw\">_", &counted[..], b"</AppendedData>"].concat(),
        ),
        (
            "appended_text.vti",
            "",
            "appended\" offset=\"0",
            String::new(),
            format!("<AppendedData encoding=\"base64\">_{}</AppendedData>", STANDARD.encode(&counted)).into(),
        ),
    ] {
        let xml = format!(
            "<?xml version=\"1.0\"?><VTKFile type=\"ImageData\" byte_order=\"LittleEndian\" \
             header_type=\"UInt32\" {attributes}><ImageData WholeExtent=\"0 4 0 3 0 2\" Spacing=\"1 2 3\">\
             <Piece Extent=\"0 4 0 3 0 2\"><PointData Scalars=\"s\"><DataArray type=\"Float32\" Name=\"s\" \
             NumberOfComponents=\"1\" format=\"{format}\">{content}</DataArray></PointData></Piece>\
             </ImageData>"
        );
        add("vti", name, [xml.as_bytes(), &appended, b"</VTKFile>"].concat());
    }
}

fn tiff_pages<C: ColorType<Inner: Copy>>(compression: tiff::encoder::Compression, value: C::Inner) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut file = Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap().with_compression(compression);
    for _ in 0..3 {
        let samples = 20 * C::BITS_PER_SAMPLE.len();
        encoder.write_image::<C>(5, 4, &vec![value; samples]).unwrap();
    }
    file.into_inner()
}

fn pictures(add: Add<'_>) {
    use tiff::encoder::Compression::{Deflate, Lzw, Packbits, Uncompressed};
    add("tiff", "plain.tif", tiff_pages::<Gray16>(Uncompressed, 700));
    add("tiff", "lzw.tif", tiff_pages::<Gray16>(Lzw, 700));
    add("tiff", "deflate.tif", tiff_pages::<Gray32Float>(Deflate(Default::default()), 0.5));
    add("tiff", "packbits.tif", tiff_pages::<Gray8>(Packbits, 7));
    add("tiff", "colours.tif", tiff_pages::<RGB8>(Uncompressed, 7));

    for (name, picture) in [
        ("grey.png", DynamicImage::new_luma8(5, 4)),
        ("deep.png", DynamicImage::new_luma16(5, 4)),
        ("alpha.png", DynamicImage::new_luma_a8(5, 4)),
        ("colours.png", DynamicImage::new_rgb8(5, 4)),
    ] {
        let mut file = Cursor::new(Vec::new());
        picture.write_to(&mut file, ImageFormat::Png).unwrap();
        add("png", name, file.into_inner());
    }

    let mut file = Cursor::new(Vec::new());
    let light = image::Rgb32FImage::from_fn(9, 6, |x, y| image::Rgb([x as f32, 0.5, 300.0 * y as f32]));
    light.write_to(&mut file, ImageFormat::Hdr).unwrap();
    add("environment", "runs.hdr", file.into_inner());
    let flat: Vec<u8> = (0..24).flat_map(|i| [10 * i, 20, 30, 128]).collect();
    add(
        "environment",
        "flat.hdr",
        [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 6\n", &flat[..]].concat(),
    );
    for (name, compression) in [
        ("plain.exr", Compression::Uncompressed),
        ("runs.exr", Compression::RLE),
        ("zip.exr", Compression::ZIP16),
        ("piz.exr", Compression::PIZ),
        ("pxr24.exr", Compression::PXR24),
        ("b44.exr", Compression::B44),
    ] {
        let channels =
            SpecificChannels::rgb(|at: exr::math::Vec2<usize>| (at.x() as f32, 0.5_f32, at.y() as f32));
        let encoding = Encoding { compression, ..Encoding::UNCOMPRESSED };
        let layer = Layer::new((9, 6), LayerAttributes::named("light"), encoding, channels);
        let mut file = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut file).unwrap();
        add("environment", name, file.into_inner());
    }
}

fn multiscales() -> &'static str {
    "[{\"axes\": [{\"name\": \"z\"}, {\"name\": \"y\"}, {\"name\": \"x\", \"unit\": \"micrometer\"}], \
     \"datasets\": [{\"path\": \"0\", \"coordinateTransformations\": \
     [{\"type\": \"scale\", \"scale\": [2, 1, 0.5]}]}]}]"
}

fn zarr(add: Add<'_>) {
    let voxels = [7; 48];
    let second = format!("{{\"multiscales\": {}}}", multiscales());
    let third = format!("{{\"attributes\": {{\"ome\": {{\"multiscales\": {}}}}}}}", multiscales());
    // Blosc: one block, stored streams
    let blosc =
        [&[2, 1, 0x11 | 1 << 5, 2, 48, 0, 0, 0, 48, 0, 0, 0, 72, 0, 0, 0, 20, 0, 0, 0][..], &[48, 0, 0, 0]];
    let blosc = [&blosc.concat()[..], &voxels].concat();
    let lz4 = [&48_u32.to_le_bytes()[..], &lz4_flex::block::compress(&voxels)].concat();
    let zstd = ruzstd::encoding::compress_to_vec(&voxels[..], ruzstd::encoding::CompressionLevel::Fastest);
    let index = [0_u64, gzip(&voxels).len() as u64].map(u64::to_le_bytes).concat();
    let shard = [gzip(&voxels), index].concat();
    let packed = |id: &str| ZARRAY.replace("blosc", id);
    let stored = ZARRAY.replace("{\"id\": \"blosc\"}", "null");
    for (name, group, array, chunk) in [
        ("stored", &second, &stored, voxels.to_vec()),
        ("blosc", &second, &packed("blosc"), blosc),
        ("gzip", &second, &packed("gzip"), gzip(&voxels)),
        ("zlib", &second, &packed("zlib"), zlib(&voxels)),
        ("lz4", &second, &packed("lz4"), lz4),
        ("zstd", &second, &packed("zstd"), zstd),
        ("shard", &third, &ZARR_JSON.to_owned(), shard.clone()),
    ] {
        add("zarr", name, [group.as_bytes(), array.as_bytes(), &chunk].join(&b"\n%\n"[..]));
    }
    let chunk: (&str, &[u8]) = ("0/0.0.0", &voxels);
    let files = [(".zattrs", second.as_bytes()), ("0/.zarray", stored.as_bytes()), chunk];
    add("archive", "zarr.zip", zipped(&files, zip::CompressionMethod::Stored));
    let files =
        [("zarr.json", third.as_bytes()), ("0/zarr.json", ZARR_JSON.as_bytes()), ("0/c/0/0/0", &shard)];
    add("archive", "shard.zip", zipped(&files, zip::CompressionMethod::Deflated));
}

fn zipped(files: &[(&str, &[u8])], method: zip::CompressionMethod) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        writer.start_file(*name, SimpleFileOptions::default().compression_method(method)).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// Bytes before the transfer syntax in what [`DicomFile`] writes, and behind it.
const META_AT: usize = 132 + 12;
const META_END: usize = META_AT + 8 + 20;

/// A data set, its tail cut off, in another transfer syntax, with a new tail.
fn in_syntax(syntax: &str, data_set: &[u8], tail: &[u8]) -> Vec<u8> {
    let mut value = syntax.as_bytes().to_vec();
    value.resize(value.len().next_multiple_of(2), 0);
    let meta = [&[2, 0, 0x10, 0, b'U', b'I', value.len() as u8, 0][..], &value].concat();
    let length = [&[2, 0, 0, 0, b'U', b'L', 4, 0][..], &(meta.len() as u32).to_le_bytes()].concat();
    [&[0; 128], &b"DICM"[..], &length, &meta, data_set, tail].concat()
}

fn encapsulated(syntax: &str, frame: &[u8]) -> Vec<u8> {
    let item = |bytes: &[u8]| {
        let padded = [bytes, &[0][..bytes.len() % 2]].concat();
        [&[0xFE, 0xFF, 0, 0xE0][..], &(padded.len() as u32).to_le_bytes(), &padded].concat()
    };
    let mut slice = DicomFile::slice("1", 1, 5.0, 3);
    slice.pixels = Vec::new();
    for (tag, value) in [(0x0028_0100, 8), (0x0028_0101, 8), (0x0028_0102, 7), (0x0028_0103, 0)] {
        slice.number(tag, value);
    }
    let plain = slice.bytes();
    let start = [0xE0, 0x7F, 0x10, 0, b'O', b'B', 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
    let end = [0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0];
    let tail = [&start[..], &item(&[]), &item(frame), &end].concat();
    in_syntax(syntax, &plain[META_END..plain.len() - 12], &tail)
}

fn dicom(add: Add<'_>) {
    let slices: Vec<Vec<u8>> =
        (1..3).map(|number| DicomFile::slice("1", number, 4.0 + f64::from(number), 3).bytes()).collect();
    add(
        "archive",
        "slices.zip",
        zipped(&[("a", &slices[0]), ("b", &slices[1])], zip::CompressionMethod::Deflated),
    );
    for (number, slice) in (1..).zip(slices) {
        add("dicom", &format!("slice_{number}.dcm"), slice);
    }
    let mut frames = DicomFile::slice("1", 1, 5.0, 0);
    frames.text(0x0028_0008, "IS", "2");
    frames.pixels = (0..24).collect();
    add("dicom", "frames.dcm", frames.bytes());

    let pixels: Vec<u8> = (0..12).map(|i| 20 * i).collect();
    let run = [&[1_u32.to_le_bytes(), 64_u32.to_le_bytes()].concat()[..], &[0; 56], &[244, 7]].concat();
    add("dicom", "runs.dcm", encapsulated("1.2.840.10008.1.2.5", &run));
    let mut jpeg = Cursor::new(Vec::new());
    let picture = image::GrayImage::from_raw(4, 3, pixels.clone()).unwrap();
    picture.write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
    add("dicom", "jpeg.dcm", encapsulated("1.2.840.10008.1.2.4.50", &jpeg.into_inner()));
    let info = charls::FrameInfo { width: 4, height: 3, bits_per_sample: 8, component_count: 1 };
    let jpeg_ls = charls::CharLS::default().encode(info, 0, &pixels).unwrap();
    add("dicom", "jpeg_ls.dcm", encapsulated("1.2.840.10008.1.2.4.80", &jpeg_ls));
    add("dicom", "jpeg_2000.dcm", encapsulated("1.2.840.10008.1.2.4.90", &empty_jpeg_2000()));
}

/// 4 x 3 pixels of 8 bits in one code block that contributes nothing (ISO/IEC 15444-1, annex A).
fn empty_jpeg_2000() -> Vec<u8> {
    let sizes: Vec<u8> = [4_u32, 3, 0, 0, 4, 3, 0, 0].iter().flat_map(|n| n.to_be_bytes()).collect();
    let main = [
        &[0xFF, 0x4F, 0xFF, 0x51, 0, 41, 0, 0][..],
        &sizes,
        &[0, 1, 7, 1, 1],
        // COD: one layer, no colour transform, no levels, blocks of 64 x 64, the reversible wavelet
        &[0xFF, 0x52, 0, 12, 0, 0, 0, 1, 0, 0, 4, 4, 0, 1],
        // QCD: no quantisation, two guard bits
        &[0xFF, 0x5C, 0, 4, 0x40, 8 << 3],
    ];
    // One tile part of 12 + 2 + 1 bytes, an empty packet.
    let tile = [0xFF, 0x90, 0, 10, 0, 0, 0, 0, 0, 15, 0, 1, 0xFF, 0x93, 0, 0xFF, 0xD9];
    [&main.concat()[..], &tile].concat()
}
