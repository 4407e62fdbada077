//! The short forms of `tyndall bench`: what got worse, or fails on numbers that hurt, fails here.

#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

/// Each suite uses all processors: one after the other is quickest.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Runs the short form of a suite; gives its table.
fn quick(suite: &str, table: &str, folder: &Path) -> Vec<Value> {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let output = Command::new(env!("CARGO_BIN_EXE_tyndall"))
        .args(["bench", suite, "--quick", "--out", folder.to_str().unwrap()])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}\n{}", String::from_utf8_lossy(&output.stdout));
    let text = std::fs::read_to_string(folder.join(format!("{table}.json"))).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    assert!(!report["about"]["device"]["name"].as_str().unwrap().is_empty(), "the device is named");
    report["rows"].as_array().unwrap().clone()
}

#[test]
fn errors_and_work_are_no_more_than_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let rows = quick("accuracy", "accuracy", folder.path());
    let scenes: std::collections::BTreeSet<&str> =
        rows.iter().map(|row| row["scene"].as_str().unwrap()).collect();
    assert!(scenes.len() >= 5, "{scenes:?}");
    // Every point has an error and its uncertainty, or says why there is none.
    for row in &rows {
        let measured = row["full_relative_l2"].is_number() && row["full_uncertainty"].is_number();
        assert!(measured != row["left_out"].is_string(), "{row}");
    }
    let page = std::fs::read_to_string(folder.path().join("accuracy.html")).unwrap();
    for scene in scenes {
        assert!(page.contains(&format!("<h2 id=\"{scene}\">")), "{scene}");
        let drawn = rows.iter().any(|row| row["scene"] == scene && row["left_out"].is_null());
        assert_eq!(folder.path().join(format!("accuracy-{scene}.svg")).exists(), drawn, "{scene}");
    }
}

#[test]
fn numbers_that_hurt_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let rows = quick("stability", "stability", folder.path());
    assert!(rows.len() > 40, "{}", rows.len());
}

#[test]
fn what_is_not_needed_is_left_out_and_not_missed() {
    let folder = tempfile::tempdir().unwrap();
    let rows = quick("skip", "skip-kinds", folder.path());
    for kind in ["unchanged scene", "albedo 0", "hidden viewer"] {
        let row = rows.iter().find(|row| row["not_needed"] == kind).unwrap();
        assert_eq!(row["work_left_out"], 0, "{row}");
        assert!(row["work_done"].as_u64().unwrap() > 0, "{row}");
    }
}
