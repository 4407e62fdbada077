//! Bytes at random: no reader panics, hangs or takes more memory than its limits allow.

#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use common::*;
use formats::{Limits, ReadOptions, read_volume};
use proptest::prelude::*;

/// Longest time one small file may take.
const MAX_TIME: Duration = Duration::from_secs(5);

/// Small limits: a mutated size that slips through stays cheap to read.
fn limits() -> Limits {
    Limits { max_voxel_bytes: 1 << 20, max_decoded_bytes: 4 << 20, ..Limits::default() }
}

/// One change to a file.
#[derive(Debug, Clone)]
enum Mutation {
    Set(usize, u8),
    Insert(usize, Vec<u8>),
    Remove(usize, usize),
    Cut(usize),
    /// Replaces a run of digits by another number.
    Number(usize, String),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let number = prop_oneof![
        Just("0".to_owned()),
        Just("-1".to_owned()),
        Just("nan".to_owned()),
        Just("1e400".to_owned()),
        Just("18446744073709551615".to_owned()),
        Just("170141183460469231731687303715884105728".to_owned()),
        any::<i64>().prop_map(|n| n.to_string()),
        any::<f64>().prop_map(|n| n.to_string()),
    ];
    prop_oneof![
        (any::<usize>(), any::<u8>()).prop_map(|(at, value)| Mutation::Set(at, value)),
        (any::<usize>(), prop::collection::vec(any::<u8>(), 1..9))
            .prop_map(|(at, bytes)| Mutation::Insert(at, bytes)),
        (any::<usize>(), 1..64_usize).prop_map(|(at, count)| Mutation::Remove(at, count)),
        any::<usize>().prop_map(Mutation::Cut),
        (any::<usize>(), number).prop_map(|(at, number)| Mutation::Number(at, number)),
    ]
}

fn apply(bytes: &mut Vec<u8>, header_bytes: usize, mutation: &Mutation) {
    let place = |at: usize| at % header_bytes.min(bytes.len()).max(1);
    match mutation {
        _ if bytes.is_empty() => {}
        Mutation::Set(at, value) => {
            let at = place(*at);
            bytes[at] = *value;
        }
        Mutation::Insert(at, new) => {
            let at = place(*at);
            bytes.splice(at..at, new.iter().copied());
        }
        Mutation::Remove(at, count) => {
            let at = place(*at);
            let end = (at + count).min(bytes.len());
            bytes.drain(at..end);
        }
        Mutation::Cut(at) => bytes.truncate(at % bytes.len()),
        Mutation::Number(at, number) => {
            let start = place(*at);
            if let Some(first) = bytes[start..].iter().position(u8::is_ascii_digit) {
                let first = start + first;
                let digits = bytes[first..].iter().take_while(|b| b.is_ascii_digit()).count();
                bytes.splice(first..first + digits, number.bytes());
            }
        }
    }
}

fn read_quickly(path: &Path) {
    let start = Instant::now();
    let options = ReadOptions { limits: limits(), ..ReadOptions::default() };
    if let Ok(imported) = read_volume(path, &options) {
        // What was accepted is sound.
        let volume = &imported.volume;
        assert_eq!(volume.dims.iter().product::<usize>(), volume.voxels.len());
        assert!(volume.spacing.iter().all(|s| s.is_finite() && *s > 0.0));
        assert!(volume.slope.is_finite() && volume.slope != 0.0 && volume.intercept.is_finite());
        assert!(formats::data_range(volume).iter().all(|v| v.is_finite()));
    }
    assert!(start.elapsed() < MAX_TIME, "{:?}", start.elapsed());
}

fn nifti(version: u8) -> NiftiFile {
    NiftiFile {
        version,
        qform_code: 1,
        sform_code: 1,
        srow: [[-2.0, 0.0, 0.0, 1.0], [0.0, -2.0, 0.0, 2.0], [0.0, 0.0, 2.0, 3.0]],
        slope: 1.5,
        extensions: [vec![1, 0, 0, 0, 16, 0, 0, 0], vec![0; 12]].concat(),
        ..NiftiFile::new(16, &[5, 4, 3, 2])
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_nrrd(mutations in prop::collection::vec(mutation(), 1..6), kind in 0..4) {
        let folder = tempfile::tempdir().unwrap();
        let voxels = vec![7; 480];
        let (encoding, body) = match kind {
            0 => ("raw", voxels),
            1 => ("gzip", gzip(&voxels)),
            2 => ("ascii", "1.5 ".repeat(120).into_bytes()),
            _ => {
                write(folder.path(), "d1.raw", &[&voxels[..240]]);
                write(folder.path(), "d2.raw", &[&voxels[..240]]);
                ("raw\ndata file: d%d.raw 1 2 1", Vec::new())
            }
        };
        let header = format!("{NRRD_TEXT}encoding: {encoding}\n\n");
        let mut bytes = [header.as_bytes(), &body].concat();
        for mutation in &mutations {
            apply(&mut bytes, header.len() + 20, mutation);
        }
        read_quickly(&write(folder.path(), "a.nrrd", &[&bytes]));
    }

    #[test]
    fn mutated_nifti(
        mutations in prop::collection::vec(mutation(), 1..6), version in 1..3_u8, zip in any::<bool>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let file = nifti(version);
        let mut bytes = file.bytes(&[7; 480]);
        for mutation in &mutations {
            apply(&mut bytes, file.header().len(), mutation);
        }
        if zip {
            bytes = gzip(&bytes);
        }
        read_quickly(&write(folder.path(), "a.nii", &[&bytes]));
    }

    #[test]
    fn mutated_dicom(mutations in prop::collection::vec(mutation(), 1..6)) {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = DicomFile::slice("1", 1, 5.0, 3).bytes();
        let headers = bytes.len() - 24;
        for mutation in &mutations {
            apply(&mut bytes, headers, mutation);
        }
        read_quickly(&write(folder.path(), "a.dcm", &[&bytes]));
        write(folder.path(), "b.dcm", &[&DicomFile::slice("1", 2, 6.0, 3).bytes()]);
        read_quickly(folder.path());
    }

    #[test]
    fn mutated_gzip(mutations in prop::collection::vec(mutation(), 1..4)) {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = gzip(&nifti(1).bytes(&[7; 480]));
        let all = bytes.len();
        for mutation in &mutations {
            apply(&mut bytes, all, mutation);
        }
        read_quickly(&write(folder.path(), "a.nii.gz", &[&bytes]));
    }

    #[test]
    fn mutated_npy(mutations in prop::collection::vec(mutation(), 1..6), kind in 0..3_usize) {
        let folder = tempfile::tempdir().unwrap();
        let (descr, order) = [("<f2", "False"), (">i4", "True"), ("|u1", "False")][kind];
        let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': (2, 3, 4, 5), }}\n");
        let length = (header.len() as u16).to_le_bytes();
        let mut bytes = [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), &[7; 480]].concat();
        for mutation in &mutations {
            apply(&mut bytes, header.len() + 10, mutation);
        }
        read_quickly(&write(folder.path(), "a.npy", &[&bytes]));
    }

    #[test]
    fn mutated_metaimage(mutations in prop::collection::vec(mutation(), 1..6), kind in 0..4) {
        let folder = tempfile::tempdir().unwrap();
        let voxels = vec![7; 480];
        let (more, data_file, body) = match kind {
            0 => ("", "LOCAL", voxels),
            1 => ("CompressedData = True\nCompressedDataSize = 20\n", "LOCAL", gzip(&voxels)),
            2 => ("BinaryData = False\n", "LOCAL", "1.5 ".repeat(120).into_bytes()),
            _ => {
                write(folder.path(), "d1.raw", &[&voxels[..240]]);
                write(folder.path(), "d2.raw", &[&voxels[..240]]);
                ("HeaderSize = 0\n", "d%d.raw 1 2 1", Vec::new())
            }
        };
        let header = format!("{METAIMAGE_TEXT}{more}ElementDataFile = {data_file}\n");
        let mut bytes = [header.as_bytes(), &body].concat();
        for mutation in &mutations {
            apply(&mut bytes, header.len() + 20, mutation);
        }
        read_quickly(&write(folder.path(), "a.mha", &[&bytes]));
    }

    #[test]
    fn mutated_vti(mutations in prop::collection::vec(mutation(), 1..6), kind in 0..4) {
        let folder = tempfile::tempdir().unwrap();
        let counted = [&240_u32.to_le_bytes()[..], &[7; 240]].concat();
        let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut packed, &[7; 240]).unwrap();
        let packed = packed.finish().unwrap();
        let table: Vec<u8> =
            [1, 240, 0, packed.len() as u32].iter().flat_map(|n: &u32| n.to_le_bytes()).collect();
        let (attributes, format, content, appended) = match kind {
            0 => ("", "ascii", "1.5 ".repeat(60), Vec::new()),
            1 => ("", "binary", STANDARD.encode(&counted), Vec::new()),
            2 => (
                "compressor=\"vtkZLibDataCompressor\"",
                "binary",
                STANDARD.encode(&table) + &STANDARD.encode(&packed),
                Vec::new(),
            ),
            _ => {
                let appended = [b"<AppendedData encoding=\"raw\">_", &counted[..], b"</AppendedData>"];
                ("", "appended\" offset=\"0", String::new(), appended.concat())
            }
        };
        let xml = format!(
            "<?xml version=\"1.0\"?><VTKFile type=\"ImageData\" byte_order=\"LittleEndian\" \
             header_type=\"UInt32\" {attributes}><ImageData WholeExtent=\"0 4 0 3 0 2\" Spacing=\"1 2 3\">\
             <Piece Extent=\"0 4 0 3 0 2\"><PointData Scalars=\"s\"><DataArray type=\"Float32\" Name=\"s\" \
             NumberOfComponents=\"1\" format=\"{format}\">{content}</DataArray></PointData></Piece>\
             </ImageData>"
        );
        let mut bytes = [xml.as_bytes(), &appended, b"</VTKFile>"].concat();
        let all = bytes.len();
        for mutation in &mutations {
            apply(&mut bytes, all, mutation);
        }
        read_quickly(&write(folder.path(), "a.vti", &[&bytes]));
    }

    #[test]
    fn mutated_tiff(mutations in prop::collection::vec(mutation(), 1..6), packed in any::<bool>()) {
        let folder = tempfile::tempdir().unwrap();
        let mut file = std::io::Cursor::new(Vec::new());
        let compression = match packed {
            true => tiff::encoder::Compression::Lzw,
            false => tiff::encoder::Compression::Uncompressed,
        };
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap().with_compression(compression);
        for _ in 0..3 {
            encoder.write_image::<tiff::encoder::colortype::Gray16>(5, 4, &[7; 20]).unwrap();
        }
        let mut bytes = file.into_inner();
        let all = bytes.len();
        for mutation in &mutations {
            apply(&mut bytes, all, mutation);
        }
        read_quickly(&write(folder.path(), "a.tif", &[&bytes]));
    }

    #[test]
    fn mutated_zarr(mutations in prop::collection::vec(mutation(), 1..6), target in 0..4_usize, version in 2..4) {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let multiscales = "[{\"axes\": [{\"name\": \"z\"}, {\"name\": \"y\"}, {\"name\": \"x\"}], \
            \"datasets\": [{\"path\": \"0\", \"coordinateTransformations\": \
            [{\"type\": \"scale\", \"scale\": [2, 1, 0.5]}]}]}]";
        let (group, array, chunk) = if version == 2 { (".zattrs", "0/.zarray", "0/0.0.0") }
            else { ("zarr.json", "0/zarr.json", "0/c/0/0/0") };
        let group_text = match version {
            2 => format!("{{\"multiscales\": {multiscales}}}"),
            _ => format!("{{\"attributes\": {{\"ome\": {{\"multiscales\": {multiscales}}}}}}}"),
        };
        let array_text = match version {
            2 => ZARRAY.to_owned(),
            _ => ZARR_JSON.to_owned(),
        };
        let body = match version {
            2 => {
                // Blosc: one block, stored streams
                let mut blosc = vec![2, 1, 0x11 | 1 << 5, 2, 48, 0, 0, 0, 48, 0, 0, 0, 72, 0, 0, 0, 20, 0, 0, 0];
                blosc.extend([48, 0, 0, 0]);
                blosc.extend([7; 48]);
                blosc
            }
            _ => [gzip(&[7; 48]), [0, 0, 0, 0, 0, 0, 0, 0, 30, 0, 0, 0, 0, 0, 0, 0].to_vec()].concat(),
        };
        std::fs::create_dir_all(root.join("0/c/0/0")).unwrap();
        let files = [(group, group_text.into_bytes()), (array, array_text.into_bytes()), (chunk, body)];
        for (number, (name, mut bytes)) in files.into_iter().enumerate() {
            let all = bytes.len();
            for mutation in mutations.iter().filter(|_| target == number || target == 3) {
                apply(&mut bytes, all, mutation);
            }
            write(root, name, &[&bytes]);
        }
        read_quickly(root);
    }

    #[test]
    fn mutated_environments(mutations in prop::collection::vec(mutation(), 1..6), is_exr in any::<bool>()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(if is_exr { "a.exr" } else { "a.hdr" });
        image::Rgb32FImage::from_pixel(9, 6, image::Rgb([0.5, 1.0, 30_000.0])).save(&path).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let all = bytes.len();
        for mutation in &mutations {
            apply(&mut bytes, all, mutation);
        }
        std::fs::write(&path, bytes).unwrap();
        let start = Instant::now();
        if let Ok(environment) = formats::read_environment(&path, &limits()) {
            assert!(environment.rgb.iter().all(|v| (0.0..=formats::MAX_RADIANCE).contains(v)));
        }
        assert!(start.elapsed() < MAX_TIME, "{:?}", start.elapsed());
    }

    #[test]
    fn random_bytes(bytes in prop::collection::vec(any::<u8>(), 0..2000), name in "[a-z]{1,3}") {
        let folder = tempfile::tempdir().unwrap();
        for name in
            ["a.nrrd", "a.nii", "a.nii.gz", "a.mha", "a.npy", "a.tif", "a.vti", "a.zip", "a.raw", "a.dcm", &name]
        {
            read_quickly(&write(folder.path(), name, &[&bytes]));
        }
        read_quickly(&write(folder.path(), "a.nrrd", &[b"NRRD0004\n", &bytes]));
    }
}
