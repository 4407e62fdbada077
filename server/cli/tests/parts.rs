//! `tyndall render` of volumes that are larger than what the device may hold.

#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};

/// A ball in 24^3 voxels of one byte: 13,824 bytes.
fn scene(folder: &Path) -> std::path::PathBuf {
    let mut nrrd = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 24 24 24\nencoding: raw\n\n".to_vec();
    nrrd.extend((0..24 * 24 * 24).map(|i: i32| {
        let radius = [i % 24, i / 24 % 24, i / 576]
            .map(|i| f64::from(i) - 11.5)
            .map(|x| x * x)
            .iter()
            .sum::<f64>()
            .sqrt();
        ((12.0 - radius).max(0.0) * 20.0) as u8
    }));
    std::fs::write(folder.join("ball.nrrd"), nrrd).unwrap();
    let scene = json!({
        "version": 1, "volume": {"file": "ball.nrrd"},
        "transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 0.2, "extinction": 0}, {"s": 1, "extinction": 40}]},
        "lights": [{"type": "environment", "radiance": [1, 1, 1]}]
    });
    let path = folder.join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    path
}

fn tyndall(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tyndall")).args(arguments).output().unwrap()
}

/// What is said on the error output; the picture is in `out`.
fn render(scene: &Path, out: &Path, more: &[&str]) -> String {
    let mut arguments =
        vec!["render", scene.to_str().unwrap(), "-o", out.to_str().unwrap(), "--size", "48x40"];
    arguments.extend(more);
    let output = tyndall(&arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    said.lines().filter(|line| line.starts_with("tyndall: volume: ")).collect::<Vec<_>>().join("\n")
}

/// Mean difference of two pictures over the mean of the first.
fn difference(a: &Path, b: &Path) -> f64 {
    // A header of 128 bytes, then float32.
    let values = |path: &Path| -> Vec<f64> {
        let bytes = std::fs::read(path).unwrap();
        bytes[128..].chunks_exact(4).map(|x| f64::from(f32::from_le_bytes(x.try_into().unwrap()))).collect()
    };
    let (a, b) = (values(a), values(b));
    assert_eq!(a.len(), 48 * 40 * 3);
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.iter().sum::<f64>()
}

#[test]
fn what_does_not_fit_is_drawn_coarser_with_a_notice() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let [full, coarse, region, clipped] =
        ["full", "coarse", "region", "clipped"].map(|name| folder.path().join(name).with_extension("npy"));
    assert_eq!(render(&scene, &full, &[]), "");
    let most = ["--max-texture-bytes", "2000"];
    assert_eq!(
        render(&scene, &coarse, &most),
        "tyndall: volume: shown at 1/2 resolution (12x12x12 of 24x24x24): the full volume needs 14 kB of the 2.0 kB allowed"
    );
    let apart = difference(&full, &coarse);
    assert!(apart > 0.0 && apart < 0.15, "{apart}");
    // A region of it fits, and looks like that part of the whole.
    let here = "volume.region=[[0.4,0.4,0.4],[0.6,0.6,0.6]]";
    let said = render(&scene, &region, &["--max-texture-bytes", "2000", "--set", here]);
    assert!(said.starts_with("tyndall: volume: region shown at full resolution"), "{said}");
    render(&scene, &clipped, &["--set", "clip={\"box\":[[0.4,0.4,0.4],[0.6,0.6,0.6]]}"]);
    let apart = difference(&clipped, &region);
    assert!(apart < 0.02, "{apart}");
    assert!(difference(&clipped, &coarse) > 0.1, "the comparison can fail");
}

#[test]
fn an_edit_may_go_into_a_region_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let [into, back, plain, edited] =
        ["into.json", "back.json", "plain.npy", "edited.npy"].map(|name| folder.path().join(name));
    std::fs::write(&into, r#"{"volume": {"region": [[0.1, 0.2, 0.3], [0.5, 0.5, 0.5]]}}"#).unwrap();
    std::fs::write(&back, r#"{"volume": {"region": null}}"#).unwrap();
    render(&scene, &plain, &[]);
    let said = render(&scene, &edited, &["--edit", into.to_str().unwrap(), "--edit", back.to_str().unwrap()]);
    assert!(said.contains("region shown at full resolution"), "{said}");
    assert_eq!(difference(&plain, &edited), 0.0);
}

#[test]
fn import_names_the_labels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.nrrd");
    let mut nrrd = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n\n".to_vec();
    nrrd.extend((0..64).map(|i| [0u8, 3, 7][i / 24]));
    std::fs::write(&path, nrrd).unwrap();
    let output = tyndall(&["import", path.to_str().unwrap()]);
    assert!(output.status.success());
    let described: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(described["labels"], json!([0.0, 3.0, 7.0]));
    scene(folder.path());
    let output = tyndall(&["import", folder.path().join("ball.nrrd").to_str().unwrap()]);
    let described: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(described["labels"], Value::Null);
}
