//! Axes of NRRD files: which are space, where they point, how long their steps are.

mod common;

use common::*;
use proto::scene_file::VoxelType;

/// Direction as written in the file, the world axis it runs along, and whether against it.
type FileAxis = (&'static str, usize, bool);

#[test]
fn spaces_and_axis_orders_come_to_one_lps_volume() {
    let folder = tempfile::tempdir().unwrap();
    // The same patient, stored four ways; world dims are DIMS, voxel (x, y, z) has this value.
    let value = |x: usize, y: usize, z: usize| (x + 10 * y + 50 * z) as u8;
    // (space, per file axis: direction in that space, world axis, against it?)
    let cases: [(&str, [FileAxis; 3], &str); 4] = [
        ("LPS", [("(1,0,0)", 0, false), ("(0,2,0)", 1, false), ("(0,0,3)", 2, false)], "(10,20,30)"),
        ("RAS", [("(0,0,3)", 2, false), ("(1,0,0)", 0, true), ("(0,2,0)", 1, true)], "(-14,-26,30)"),
        (
            "left-anterior-superior",
            [("( 0, -2, 0 )", 1, false), ("(1,0,0)", 0, false), ("(0,0,-3)", 2, true)],
            "(10,-20,36)",
        ),
        (
            "right-anterior-superior",
            [("(0,2,0)", 1, true), ("(0,0,-3)", 2, true), ("(-1,0,0)", 0, false)],
            "(-10,-26,36)",
        ),
    ];
    for (space, axes, origin) in cases {
        let dims = axes.map(|(_, world, _)| DIMS[world]);
        let mut voxels = Vec::new();
        for k in 0..dims[2] {
            for j in 0..dims[1] {
                for i in 0..dims[0] {
                    let mut at = [0; 3];
                    for ((_, world, against), index) in axes.into_iter().zip([i, j, k]) {
                        at[world] = if against { DIMS[world] - 1 - index } else { index };
                    }
                    voxels.push(value(at[0], at[1], at[2]));
                }
            }
        }
        // A second time step behind and two components in front, both marked as no space.
        for four in ["", "front", "back"] {
            let (sizes, directions, body) = {
                let sizes = format!("{} {} {}", dims[0], dims[1], dims[2]);
                let directions = axes.map(|(direction, ..)| direction).join(" ");
                match four {
                    "front" => (
                        format!("2 {sizes}"),
                        format!("none {directions}"),
                        voxels.iter().flat_map(|v| [*v, 255 - v]).collect(),
                    ),
                    "back" => (
                        format!("{sizes} 2"),
                        format!("{directions} none"),
                        [voxels.clone(), voxels.iter().map(|v| 255 - v).collect()].concat(),
                    ),
                    _ => (sizes, directions, voxels.clone()),
                }
            };
            let dimension = if four.is_empty() { 3 } else { 4 };
            let text = format!(
                "NRRD0005\ntype: uchar\ndimension: {dimension}\nspace: {space}\nsizes: {sizes}\n\
                 space directions: {directions}\nspace origin: {origin}\n\
                 space units: \"mm\" \"mm\" \"mm\"\nencoding: raw\n\n"
            );
            let path = write(folder.path(), "a.nrrd", &[text.as_bytes(), &body]);
            let imported = read(&path).unwrap();
            let volume = &imported.volume;
            assert_eq!(volume.dims, DIMS, "{space}");
            assert_eq!(volume.spacing, [1.0, 2.0, 3.0]);
            assert_eq!(volume.spacing_unit.as_deref(), Some("mm"));
            let orientation = volume.orientation.unwrap();
            assert_eq!(orientation.origin, [10.0, 20.0, 30.0], "{space} {four}");
            assert_eq!(orientation.lps_from_grid, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
            for z in 0..DIMS[2] {
                for y in 0..DIMS[1] {
                    for x in 0..DIMS[0] {
                        assert_eq!(volume.value(x, y, z), f64::from(value(x, y, z)), "{space}");
                    }
                }
            }
            if !four.is_empty() {
                assert_eq!(imported.choices, 2);
                noticed(&imported, "index 0 of 2");
                let second = read_index(&path, 1).unwrap();
                assert!(second.notices.is_empty());
                assert_eq!(second.volume.value(1, 2, 0), 255.0 - f64::from(value(1, 2, 0)));
                refused(read_index(&path, 2), "a.nrrd", &["index", "`2`", "below 2"]);
            }
        }
    }
}

#[test]
fn oblique_axes_keep_their_remainder() {
    let folder = tempfile::tempdir().unwrap();
    let text = u8_header(
        "raw",
        "space: LPS\nspace directions: (0.6,0.8,0) (0.8,-0.6,0) (0,0,2)\nspace origin: (1,2,3)\n\n",
    );
    let path = write(folder.path(), "a.nrrd", &[text.as_bytes(), &u8_voxels()]);
    let volume = read(&path).unwrap().volume;
    // 0.8 + 0.8 beats 0.6 + 0.6: the first two axes change places
    assert_eq!(volume.dims, [4, 5, 3]);
    let orientation = volume.orientation.unwrap();
    assert_eq!(orientation.lps_from_grid, [[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]);
    assert_eq!(orientation.origin, [1.0, 2.0, 3.0]);
    assert_eq!(volume.spacing, [1.0, 1.0, 2.0]);
    let expected = values(VoxelType::Uint8, 60);
    assert_eq!(volume.value(3, 1, 2), expected[(2 * 4 + 3) * 5 + 1]);

    let sheared = text.replace("(0,0,2)", "(0,1,2)");
    let path = write(folder.path(), "b.nrrd", &[sheared.as_bytes(), &u8_voxels()]);
    noticed(&read(&path).unwrap(), "not perpendicular");
    let other = text.replace("LPS", "scanner-xyz");
    let path = write(folder.path(), "c.nrrd", &[other.as_bytes(), &u8_voxels()]);
    let imported = read(&path).unwrap();
    assert_eq!(imported.volume.dims, DIMS, "not anatomical: as stored");
    assert_eq!(imported.volume.orientation, None);
    assert_eq!(imported.volume.spacing, [1.0, 1.0, 2.0]);
}

#[test]
fn axes_without_directions_are_told_by_kind() {
    let folder = tempfile::tempdir().unwrap();
    let read_with = |sizes: &str, more: &str, count: usize| {
        let dimension = sizes.split(' ').count();
        let text =
            format!("NRRD0004\ntype: uchar\ndimension: {dimension}\nsizes: {sizes}\nencoding: raw\n{more}\n");
        let bytes: Vec<u8> = (0..count).map(|i| (i % 251) as u8).collect();
        read(&write(folder.path(), "a.nrrd", &[text.as_bytes(), &bytes]))
    };
    let color = read_with("3 5 4 2", "kinds: RGB-color domain domain domain\n", 120).unwrap();
    assert_eq!((color.volume.dims, color.choices), ([5, 4, 2], 3));
    assert_eq!(data(&color)[..3], [0.0, 3.0, 6.0]);
    let time = read_with("5 4 3 2", "kinds: space space space time\nspacings: 1 2 3 nan\n", 120);
    assert_eq!(time.unwrap().volume.spacing, [1.0, 2.0, 3.0]);
    let guessed = read_with("3 5 4 2", "", 120).unwrap();
    assert_eq!((guessed.volume.dims, guessed.choices), ([5, 4, 2], 3));
    noticed(&guessed, "does not say which");
    let guessed = read_with("5 4 3 2", "", 120).unwrap();
    assert_eq!((guessed.volume.dims, guessed.choices), ([5, 4, 3], 2));
    let flat = read_with("5 4", "spacings: 2 3\n", 20).unwrap();
    assert_eq!((flat.volume.dims, flat.volume.spacing), ([5, 4, 1], [2.0, 3.0, 1.0]));
    noticed(&flat, "flat");
    let between = read_with("5 2 4 3", "kinds: domain list domain domain\n", 120);
    refused(between, "a.nrrd", &["between the axes", "unu permute"]);
    let cells = read_with("5 4 3", "axis mins: 0 0 0\naxis maxs: 10 8 3\n", 60).unwrap();
    assert_eq!(cells.volume.spacing, [2.0, 2.0, 1.0]);
    let more = "axis mins: 0 0 0\naxis maxs: 8 6 4\ncenterings: node node node\n";
    assert_eq!(read_with("5 4 3", more, 60).unwrap().volume.spacing, [2.0, 2.0, 2.0]);
    let units = read_with("5 4 3", "spacings: 1 1 1\nunits: \"um\" \"um\" \"um\"\n", 60).unwrap();
    assert_eq!(units.volume.spacing_unit.as_deref(), Some("um"));
}
