//! Bytes at random: no reader panics, hangs or takes more memory than its limits allow.

mod common;

use std::path::Path;
use std::time::{Duration, Instant};

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

const NRRD_TEXT: &str = "NRRD0005\ntype: float\ndimension: 4\nspace: RAS\nsizes: 2 5 4 3\n\
    space directions: none (1,0,0) (0,0,-2) (0,1,0)\nspace origin: (1,2,3)\nendian: big\n\
    kinds: list domain domain domain\nbyte skip: 0\nline skip: 0\n";

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
    fn random_bytes(bytes in prop::collection::vec(any::<u8>(), 0..2000), name in "[a-z]{1,3}") {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.nrrd", "a.nii", "a.nii.gz", "a.raw", "a.dcm", "a.zip", &name] {
            read_quickly(&write(folder.path(), name, &[&bytes]));
        }
        read_quickly(&write(folder.path(), "a.nrrd", &[b"NRRD0004\n", &bytes]));
    }
}
