//! Every NRRD, NIfTI and raw file of the shared data draws the right way up and with the right
//! proportions: the picture of an emitting fog is compared with a projection of the voxels
//! computed here, and with the same projection mirrored.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};

use formats::{RawLayout, ReadOptions, read_volume};
use proto::SceneFile;
use proto::scene_file::{Camera, VolumeSource, VoxelType};
use scene::Volume;
use serde_json::json;
use system_tests::{draw, keep, shared_data};

const EDGE: u32 = 72;
/// Height of the picture, world units: the unit box with a margin.
const VIEW_HEIGHT: f64 = 1.1;

/// Raw files, whose layout only their README or sidecar text tells.
const RAW_FILES: [(&str, [u32; 3], VoxelType); 5] = [
    ("raw/Bucky_32x32x32_uint8.raw", [32, 32, 32], VoxelType::Uint8),
    ("raw/fuel_64x64x64_uint8.raw", [64, 64, 64], VoxelType::Uint8),
    ("raw/silicium_98x34x34_uint8.raw", [98, 34, 34], VoxelType::Uint8),
    ("manix128/manix128.raw", [128, 128, 115], VoxelType::Uint8),
    ("voreen/walnut.raw", [128, 96, 114], VoxelType::Uint16),
];

/// Files that hold no volume worth a picture: one slice or less after the reader's choice.
const MIN_EDGE: usize = 2;

fn files_of(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().to_lowercase();
        if path.is_dir() && !name.contains("zarr") && name != "malformed" {
            files.extend(files_of(&path));
        }
        if [".nrrd", ".nhdr", ".nii", ".nii.gz"].iter().any(|end| name.ends_with(end)) {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Emitting fog seen from the default direction, without perspective.
fn fog(oriented: bool) -> SceneFile {
    let mut file = SceneFile::new(VolumeSource { dataset: Some("test".into()), ..VolumeSource::default() });
    let points = json!({"points": [
        {"s": 0, "extinction": 0, "albedo": [0, 0, 0], "emission": [1, 1, 1]},
        {"s": 1, "extinction": 0.2, "albedo": [0, 0, 0], "emission": [1, 1, 1]}
    ]});
    file.transfer_function = serde_json::from_value(points).unwrap();
    let camera = scene::Camera::default_file(oriented);
    file.camera = Some(Camera { fov_y_degrees: None, orthographic_height: Some(VIEW_HEIGHT), ..camera });
    file
}

/// Sum of s along the view direction, at the pixels of the picture: x to the right; for oriented
/// data z up and seen along +y, else y up and seen along -z.
fn projection(volume: &Volume, oriented: bool, range: [f64; 2]) -> Vec<f64> {
    let extent: [f64; 3] = std::array::from_fn(|a| volume.dims[a] as f64 * volume.spacing[a]);
    let longest = extent.into_iter().fold(0.0, f64::max);
    let (up, along) = if oriented { (2, 1) } else { (1, 2) };
    let at = |pixel: u32, axis: usize, flip: bool| {
        let world =
            ((f64::from(pixel) + 0.5) / f64::from(EDGE) - 0.5) * VIEW_HEIGHT * if flip { -1.0 } else { 1.0 };
        let unit = world / (extent[axis] / longest) + 0.5;
        (0.0..1.0).contains(&unit).then(|| (unit * volume.dims[axis] as f64) as usize)
    };
    let mut image = vec![0.0; (EDGE * EDGE) as usize];
    for row in 0..EDGE {
        for column in 0..EDGE {
            let (Some(x), Some(v)) = (at(column, 0, false), at(row, up, true)) else { continue };
            let sum: f64 = (0..volume.dims[along])
                .map(|d| {
                    let value = if oriented { volume.value(x, d, v) } else { volume.value(x, v, d) };
                    ((value - range[0]) / (range[1] - range[0])).clamp(0.0, 1.0)
                })
                .sum();
            image[(row * EDGE + column) as usize] = sum;
        }
    }
    image
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        ab += (x - ma) * (y - mb);
        aa += (x - ma).powi(2);
        bb += (y - mb).powi(2);
    }
    if aa == 0.0 || bb == 0.0 { 0.0 } else { ab / (aa * bb).sqrt() }
}

fn mirrored(image: &[f64], horizontally: bool) -> Vec<f64> {
    let edge = EDGE as usize;
    let index =
        |r: usize, c: usize| if horizontally { r * edge + edge - 1 - c } else { (edge - 1 - r) * edge + c };
    (0..edge * edge).map(|i| image[index(i / edge, i % edge)]).collect()
}

fn check(name: &str, volume: Volume) {
    if volume.dims.iter().any(|&n| n < MIN_EDGE) {
        eprintln!("{name}: a single slice, not drawn");
        return;
    }
    let oriented = volume.orientation.is_some();
    let file = fog(oriented);
    let (picture, radiance, scene) = draw(&file, volume.clone(), (EDGE, EDGE), 4);
    keep(&picture, &name.replace('/', "_"));
    let drawn: Vec<f64> = radiance.rgb.chunks_exact(3).map(|p| f64::from(p[0])).collect();
    if scene.volume.range[0] >= scene.volume.range[1] {
        eprintln!("{name}: one value everywhere, nothing to compare");
        return;
    }
    let expected = projection(&volume, oriented, scene.volume.range);
    let right = correlation(&drawn, &expected);
    // The projection takes the nearest voxel, the picture interpolates: 0.969 for the
    // Marschner-Lobb signal, which lives at the sampling limit; above 0.98 for everything else.
    assert!(right > 0.96, "{name}: the picture correlates with the voxels' projection by {right:.3} only");
    for horizontally in [true, false] {
        let wrong = mirrored(&expected, horizontally);
        // Symmetric data look alike mirrored; everything else must tell the difference.
        if correlation(&wrong, &expected) < 0.99 {
            let mirrored = correlation(&drawn, &wrong);
            assert!(
                mirrored < right - 0.002,
                "{name}: fits its mirror image as well ({mirrored:.4} against {right:.4})"
            );
        }
    }
}

#[test]
fn nrrd_and_nifti_files_draw_the_right_way_up() {
    let Some(data) = shared_data() else { return };
    let files = files_of(&data);
    assert!(files.len() > 20, "found only {} files", files.len());
    for path in files {
        let name = path.strip_prefix(&data).unwrap().display().to_string();
        match read_volume(&path, &ReadOptions::default()) {
            Ok(imported) => check(&name, imported.volume),
            // The readers' own tests say which files must be refused.
            Err(error) => eprintln!("{name}: refused: {error}"),
        }
    }
}

#[test]
fn raw_files_draw_the_right_way_up() {
    let Some(data) = shared_data() else { return };
    for (name, dims, voxel_type) in RAW_FILES {
        let raw = RawLayout { dims, voxel_type, endian: Default::default(), header_bytes: 0, spacing: None };
        let imported =
            read_volume(&data.join(name), &ReadOptions { raw: Some(raw), ..ReadOptions::default() });
        check(name, imported.unwrap().volume);
    }
}
