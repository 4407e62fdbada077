//! The shared hostile files: every file of a format that is read meets its verdict, in bounded
//! time and memory. One test in a program of its own, as it measures the memory of the whole process.

#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use common::*;

/// Longest time one file may take.
const MAX_TIME: Duration = Duration::from_secs(5);
/// Most memory that all of them together may add at the peak. The largest volume among the
/// accepted ones has 4096 voxels; the buffers of one reader take 2 MiB.
const MAX_MEMORY_KIB: u64 = 32 << 10;

#[derive(serde::Deserialize)]
struct Verdict {
    expect: String,
    why: String,
}

/// Peak memory of this process in KiB; `None` where the system does not tell.
fn peak_memory_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

fn check(folder: &Path, name: &str, verdict: &Verdict, siblings_only: bool) {
    let start = Instant::now();
    let options = formats::ReadOptions { siblings_only, ..formats::ReadOptions::default() };
    let result = formats::read_volume(&folder.join(name), &options);
    let took = start.elapsed();
    assert!(took < MAX_TIME, "{name}: {took:?}");
    match (verdict.expect.as_str(), result) {
        (_, Ok(_)) if KNOWN_REFUSALS.contains(&name) => panic!("{name} is read now: take it off the list"),
        (_, Err(_)) if KNOWN_REFUSALS.contains(&name) => {}
        ("reject", Err(error)) => {
            let file = name.rsplit('/').next().unwrap();
            // Of a series, the message names the file at fault, or the folder.
            let message = error.to_string();
            let is_slice = message.split(".dcm").next().is_some_and(|s| s.parse::<u32>().is_ok());
            assert!(message.starts_with(file) || is_slice, "{error}");
        }
        ("accept" | "accept_sanitised", Ok(imported)) => {
            let volume = &imported.volume;
            assert!(volume.spacing.iter().all(|s| s.is_finite() && *s > 0.0), "{name}");
            assert!(volume.slope.is_finite() && volume.slope != 0.0, "{name}");
            assert!(data(&imported).iter().all(|v| v.is_finite()), "{name}");
        }
        (expected, Ok(_)) => panic!("{name} ({}): accepted, not {expected}", verdict.why),
        (expected, Err(error)) => panic!("{name} ({}): {error}, not {expected}", verdict.why),
    }
}

/// Folders of the archive whose files are volumes of their own.
const FOLDERS: [&str; 7] = ["nrrd/", "nifti/", "metaimage/", "npy/", "tiff/", "vti/", "zip/"];
/// Files that are refused although others read them: the crate `tiff` takes no page without rows per
/// strip.
const KNOWN_REFUSALS: [&str; 1] = ["tiff/edge_rows_per_strip_0.tif"];
/// Metadata that the archive leaves out of some hierarchies; their names, chunks and verdicts tell
/// what it was.
const ZATTRS: &str = r#"{"multiscales": [{"version": "0.4", "axes": [
    {"name": "z", "type": "space"}, {"name": "y", "type": "space"}, {"name": "x", "type": "space"}],
    "datasets": [{"path": "0", "coordinateTransformations": [{"type": "scale", "scale": [2, 1, 1]}]}]}]}"#;

/// What `.zarray` says of a hierarchy whose own is missing.
fn zarray(name: &str) -> String {
    let (mut shape, mut chunks, mut compressor, mut fill) = ("16, 16, 16", "8, 8, 8", "null", "77");
    match name {
        "bad_blosc_lie" => compressor = r#"{"id": "blosc", "cname": "lz4", "clevel": 5, "shuffle": 1}"#,
        "bad_compressor" => compressor = r#"{"id": "unknown"}"#,
        "bad_chunk_zero" => chunks = "0, 8, 8",
        "bad_fill_nan_int" => fill = "\"NaN\"",
        "bad_shape_huge" => shape = "1099511627776, 1099511627776, 1099511627776",
        _ => {}
    }
    format!(
        r#"{{"zarr_format": 2, "shape": [{shape}], "chunks": [{chunks}], "dtype": "|u1",
            "compressor": {compressor}, "fill_value": {fill}, "order": "C", "filters": null,
            "dimension_separator": "/"}}"#
    )
}

/// Completes a hierarchy and returns its path within the archive.
fn hierarchy(folder: &Path, file: &str) -> String {
    let root = file.split_inclusive('/').take(2).collect::<String>();
    let root = root.trim_end_matches('/').to_owned();
    let path = folder.join(&root);
    if !path.join(".zattrs").exists() {
        std::fs::write(path.join(".zattrs"), ZATTRS).unwrap();
    }
    if !path.join("0/.zarray").exists() {
        std::fs::create_dir_all(path.join("0")).unwrap();
        let name = root.trim_start_matches("omezarr/").trim_end_matches(".ome.zarr");
        std::fs::write(path.join("0/.zarray"), zarray(name)).unwrap();
    }
    // The chunk that is short is missing as well.
    if root.ends_with("bad_short_chunk.ome.zarr") && !path.join("0/0/0/0").exists() {
        std::fs::write(path.join("0/0/0/0"), [7; 100]).unwrap();
    }
    root
}

/// Environment images: as for volumes.
fn check_environment(folder: &Path, name: &str, verdict: &Verdict) {
    let start = Instant::now();
    let result = formats::read_environment(&folder.join(name), &formats::Limits::default());
    assert!(start.elapsed() < MAX_TIME, "{name}: {:?}", start.elapsed());
    match (verdict.expect.as_str(), result) {
        ("reject", Err(_)) => {}
        ("accept" | "accept_sanitised", Ok(environment)) => {
            assert_eq!(environment.rgb.len(), 3 * environment.width * environment.height);
            assert!(environment.rgb.iter().all(|v| (0.0..=formats::MAX_RADIANCE).contains(v)), "{name}");
        }
        (expected, result) => panic!("{name} ({}): {result:?}, not {expected}", verdict.why),
    }
}

#[test]
fn every_file_meets_its_verdict() {
    let Some(shared) = shared_data("hostile files") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let unpacked = Command::new("tar")
        .arg("-xJf")
        .arg(shared.join("malformed/malformed.tar.xz"))
        .arg("-C")
        .arg(folder.path())
        .status();
    if !unpacked.is_ok_and(|status| status.success()) {
        eprintln!("LEFT OUT, `tar -xJ` does not work here: hostile files");
        return;
    }
    let folder = folder.path().join("malformed");
    let manifest = std::fs::read(folder.join("manifest.json")).unwrap();
    let manifest: BTreeMap<String, Verdict> = serde_json::from_slice(&manifest).unwrap();
    let before = peak_memory_kib();
    let mut checked = 0;
    let mut hierarchies = std::collections::BTreeSet::new();
    let mut series = BTreeMap::new();
    for (name, verdict) in &manifest {
        if let Some((folder, _)) = name.rsplit_once('/').filter(|(folder, _)| folder.contains("/series_")) {
            series.insert(folder.to_owned(), verdict);
        } else if name.starts_with("dicom/") {
            check(&folder, name, verdict, true);
            checked += 1;
        }
        if FOLDERS.iter().any(|of_volumes| name.starts_with(of_volumes)) {
            check(&folder, name, verdict, true);
            checked += 1;
        }
        if name.starts_with("envmap/") {
            check_environment(&folder, name, verdict);
            checked += 1;
        }
        // Each hierarchy is listed with all its files, but checked once.
        if name.starts_with("omezarr/") {
            let root = hierarchy(&folder, name);
            if hierarchies.insert(root.clone()) {
                check(&folder, &root, verdict, true);
                checked += 1;
            }
        }
        // A trusted header may point anywhere, so its verdict depends on what lies there.
        let points_elsewhere = name.contains("abs") || name.contains("dotdot");
        if (name.starts_with("nrrd/datafile_") || name.starts_with("metaimage/datafile_"))
            && !points_elsewhere
        {
            check(&folder, name, verdict, false);
        }
    }
    // The verdicts on slices are on the series they belong to.
    for (name, verdict) in &series {
        check(&folder, name, verdict, true);
        checked += 1;
    }
    assert!(checked >= 120, "only {checked} of the files were found");
    match (before, peak_memory_kib()) {
        (Some(before), Some(after)) => {
            assert!(after - before < MAX_MEMORY_KIB, "{} KiB", after - before);
            eprintln!("{checked} hostile files added {} KiB at the peak", after - before);
        }
        _ => eprintln!("LEFT OUT, no /proc/self/status here: the bound on memory"),
    }
}
