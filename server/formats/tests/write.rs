//! NRRD files that are written read back as they were.

mod common;

use common::*;
use formats::write_nrrd;
use proto::scene_file::VoxelType;
use scene::{Orientation, Volume, Voxels};

fn volumes() -> Vec<Volume> {
    let floats = values(VoxelType::Float32, 60);
    [
        Voxels::U8(values(VoxelType::Uint8, 60).iter().map(|v| *v as u8).collect()),
        Voxels::U16(values(VoxelType::Uint16, 60).iter().map(|v| *v as u16).collect()),
        Voxels::I16(values(VoxelType::Int16, 60).iter().map(|v| *v as i16).collect()),
        Voxels::F32(floats.iter().map(|v| *v as f32 / 3.0).collect()),
    ]
    .into_iter()
    .map(|voxels| Volume {
        spacing: [0.1, 1.0 / 3.0, 7.25],
        spacing_unit: Some("mm".to_owned()),
        ..Volume::new(DIMS, voxels)
    })
    .collect()
}

#[test]
fn every_stored_type_reads_back_equal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    for volume in volumes() {
        write_nrrd(&path, &volume).unwrap();
        let imported = read(&path).unwrap();
        assert_eq!(imported.volume, volume);
        assert!(imported.notices.is_empty(), "{:?}", imported.notices);
    }
    let names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(names.len(), 1, "nothing unfinished is left");
    let missing = folder.path().join("no/such/folder/a.nrrd");
    assert!(write_nrrd(&missing, &volumes()[0]).is_err());
}

#[test]
fn orientation_reads_back_to_rounding() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    let (s, c) = 0.3_f64.sin_cos();
    let orientation = Orientation {
        lps_from_grid: [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]],
        origin: [-17.3, 4.0, 1e-3],
    };
    let volume = Volume { orientation: Some(orientation), ..volumes().remove(0) };
    write_nrrd(&path, &volume).unwrap();
    let back = read(&path).unwrap().volume;
    assert_eq!(back.voxels, volume.voxels);
    assert_eq!(back.spacing_unit, volume.spacing_unit);
    let found = back.orientation.unwrap();
    assert_eq!(found.origin, orientation.origin);
    for axis in 0..3 {
        assert!((back.spacing[axis] / volume.spacing[axis] - 1.0).abs() < 1e-14);
        for k in 0..3 {
            let difference = found.lps_from_grid[axis][k] - orientation.lps_from_grid[axis][k];
            assert!(difference.abs() < 1e-14);
        }
    }
}

#[test]
fn scaled_volumes_are_written_as_data_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    for volume in volumes() {
        let volume = Volume { slope: -0.3, intercept: 1000.0, ..volume };
        write_nrrd(&path, &volume).unwrap();
        let back = read(&path).unwrap().volume;
        assert_eq!((back.slope, back.intercept), (1.0, 0.0));
        for z in 0..DIMS[2] {
            for y in 0..DIMS[1] {
                for x in 0..DIMS[0] {
                    assert_eq!(back.value(x, y, z) as f32, volume.value(x, y, z) as f32);
                }
            }
        }
    }
}

#[test]
fn descriptions_hold_what_the_command_prints() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    write_nrrd(&path, &volumes()[2]).unwrap();
    let json = formats::describe(&read(&path).unwrap());
    let expected = serde_json::json!({
        "format": "nrrd", "dims": [5, 4, 3], "spacing": [0.1, 1.0 / 3.0, 7.25],
        "spacing_unit": "mm", "type": "int16", "stored_type": "int16", "range": [-47.0, 2136.0],
        "slope": 1.0, "intercept": 0.0, "orientation": null, "choices": 1, "choice_names": [], "labels": null,
        "notices": []
    });
    assert_eq!(json, expected);
}
