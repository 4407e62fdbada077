//! The shared hostile files: every NRRD, NIfTI, DICOM and zip file meets its verdict, in bounded time and
//! memory. One test in a program of its own, as it measures the memory of the whole process.

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
    let mut series = BTreeMap::new();
    for (name, verdict) in &manifest {
        if let Some((folder, _)) = name.rsplit_once('/').filter(|(folder, _)| folder.contains("/series_")) {
            series.insert(folder.to_owned(), verdict);
        } else if name.starts_with("dicom/") || name.starts_with("zip/") {
            check(&folder, name, verdict, true);
            checked += 1;
        }
        if name.starts_with("nrrd/") || name.starts_with("nifti/") {
            check(&folder, name, verdict, true);
            checked += 1;
        }
        // A trusted header may point anywhere, so its verdict depends on what lies there.
        let points_elsewhere = name.contains("abs") || name.contains("dotdot");
        if name.starts_with("nrrd/datafile_") && !points_elsewhere {
            check(&folder, name, verdict, false);
        }
    }
    // The verdicts on slices are on the series they belong to.
    for (name, verdict) in &series {
        check(&folder, name, verdict, true);
        checked += 1;
    }
    assert!(checked >= 70, "only {checked} of the files were found");
    match (before, peak_memory_kib()) {
        (Some(before), Some(after)) => {
            assert!(after - before < MAX_MEMORY_KIB, "{} KiB", after - before);
            eprintln!("{checked} hostile files added {} KiB at the peak", after - before);
        }
        _ => eprintln!("LEFT OUT, no /proc/self/status here: the bound on memory"),
    }
}
