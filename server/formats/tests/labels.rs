//! Files that say that their values are labels.

mod common;

use common::*;
use proto::scene_file::{Endian, VoxelType};

#[test]
fn label_volumes_are_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = u8_voxels();
    for version in [1, 2] {
        let plain = NiftiFile { version, ..NiftiFile::new(2, &DIMS) };
        let labels = NiftiFile { intent_code: 1002, ..plain.clone() };
        let path = write(folder.path(), "a.nii", &[&plain.bytes(&voxels)]);
        assert!(!read(&path).unwrap().notices.iter().any(|notice| notice.contains("label")));
        let path = write(folder.path(), "b.nii", &[&labels.bytes(&voxels)]);
        noticed(&read(&path).unwrap(), "label volume");
    }
    let header = u8_header("raw", "Segment0_ID:=Segment_1\nSegment0_Name:=liver\n\n");
    let path = write(folder.path(), "a.seg.nrrd", &[header.as_bytes(), &voxels]);
    let imported = read(&path).unwrap();
    noticed(&imported, "label volume");
    assert_eq!(data(&imported), values(VoxelType::Uint8, 60));
    assert_eq!(encode(&data(&imported), VoxelType::Uint8, Endian::Little), voxels);
}

#[test]
fn label_volumes_are_told_from_scans_by_their_voxels() {
    let Some(folder) = shared_data("labels of shared label volumes and scans") else { return };
    let labels = |file: &str| {
        let found = scene::labels::labels(&read(&folder.join(file)).unwrap().volume);
        found.map(|labels| labels.iter().map(|label| label.value).collect::<Vec<f64>>())
    };
    assert_eq!(labels("pyradiomics_nrrd/brain1_label.nrrd"), Some(vec![0.0, 1.0]));
    let cells = labels("tiff/mask3d.tif").unwrap();
    assert_eq!((cells.len(), cells[0], cells[51]), (52, 0.0, 162.0));
    assert_eq!(labels("vti/frog_tissues.vti").map(|tissues| tissues.len()), Some(26));
    // 64 whole numbers, each a slab of its own beside the next: a ramp.
    assert_eq!(labels("nifti/minimal.nii.gz"), None);
    assert_eq!(labels("pyradiomics_nrrd/brain1_image.nrrd"), None);
}
