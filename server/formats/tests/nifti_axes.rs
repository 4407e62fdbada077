//! Axes of NIfTI files: sform, qform and pixdim.

#![allow(clippy::unwrap_used)]

mod common;

use common::*;

/// The unit quaternion (b, c, d) of a rotation given by its columns.
fn quaternion(columns: [[f64; 3]; 3]) -> [f64; 3] {
    // Of the four squares at least one is 1/4 or more; divide by that one.
    let [x, y, z] = columns;
    let squares = [
        1.0 + x[0] + y[1] + z[2],
        1.0 + x[0] - y[1] - z[2],
        1.0 - x[0] + y[1] - z[2],
        1.0 - x[0] - y[1] + z[2],
    ];
    let largest = (0..4).max_by(|a, b| squares[*a].total_cmp(&squares[*b])).unwrap();
    let q = squares[largest].sqrt() / 2.0;
    let wx = (y[2] - z[1]) / (4.0 * q);
    let wy = (z[0] - x[2]) / (4.0 * q);
    let wz = (x[1] - y[0]) / (4.0 * q);
    let xy = (x[1] + y[0]) / (4.0 * q);
    let xz = (x[2] + z[0]) / (4.0 * q);
    let yz = (y[2] + z[1]) / (4.0 * q);
    let [w, b, c, d] = [[q, wx, wy, wz], [wx, q, xy, xz], [wy, xy, q, yz], [wz, xz, yz, q]][largest];
    // NIfTI takes the real part as positive.
    [b, c, d].map(|v| if w < 0.0 { -v } else { v })
}

fn determinant([a, b, c]: [[f64; 3]; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[test]
fn all_48_axis_orders_come_back_to_one_volume() {
    let folder = tempfile::tempdir().unwrap();
    let value = |x: usize, y: usize, z: usize| (x + 10 * y + 50 * z) as u8;
    let permutations = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut files = std::collections::HashSet::new();
    for permutation in permutations {
        for signs in 0..8_usize {
            // File axis `a` runs along LPS axis `permutation[a]`, against it where a bit is set.
            let against = [0, 1, 2].map(|a: usize| signs >> a & 1 == 1);
            let dims = permutation.map(|world| DIMS[world]);
            let mut voxels = Vec::new();
            for k in 0..dims[2] {
                for j in 0..dims[1] {
                    for i in 0..dims[0] {
                        let mut at = [0; 3];
                        for (a, index) in [i, j, k].into_iter().enumerate() {
                            let n = dims[a];
                            at[permutation[a]] = if against[a] { n - 1 - index } else { index };
                        }
                        voxels.push(value(at[0], at[1], at[2]));
                    }
                }
            }
            // RAS is LPS with x and y turned; edges along the world axes are 1, 2, 3.
            let mut columns = [[0.0; 3]; 3];
            let mut pixdim = [1.0; 8];
            let mut origin_lps = [10.0, 20.0, 30.0];
            for a in 0..3 {
                let world = permutation[a];
                let to_ras = if world < 2 { -1.0 } else { 1.0 };
                columns[a][world] = if against[a] { -to_ras } else { to_ras };
                pixdim[a + 1] = (world + 1) as f64;
                if against[a] {
                    origin_lps[world] += pixdim[a + 1] * (dims[a] - 1) as f64;
                }
            }
            let origin = [-origin_lps[0], -origin_lps[1], origin_lps[2]];
            let srow = [0, 1, 2].map(|row: usize| {
                let scaled = [0, 1, 2].map(|a: usize| columns[a][row] * pixdim[a + 1]);
                [scaled[0], scaled[1], scaled[2], origin[row]]
            });
            if determinant(columns) < 0.0 {
                pixdim[0] = -1.0;
            }
            let rotation = [columns[0], columns[1], columns[2].map(|v| v * pixdim[0])];
            let file = NiftiFile { pixdim, ..NiftiFile::new(2, &dims) };
            let by_sform = NiftiFile { sform_code: 1, srow, ..file.clone() };
            let by_qform =
                NiftiFile { qform_code: 1, quatern: quaternion(rotation), qoffset: origin, ..file.clone() };
            let both = NiftiFile { sform_code: 4, srow, ..by_qform.clone() };
            files.insert(by_sform.bytes(&voxels));
            for (file, name) in [(by_sform, "sform"), (by_qform, "qform"), (both, "both")] {
                let path = write(folder.path(), "a.nii", &[&file.bytes(&voxels)]);
                let imported = read(&path).unwrap();
                let volume = &imported.volume;
                assert_eq!(volume.dims, DIMS);
                assert_eq!(volume.spacing, [1.0, 2.0, 3.0]);
                assert!(imported.notices.is_empty(), "{name} {:?}", imported.notices);
                let orientation = volume.orientation.unwrap();
                for k in 0..3 {
                    let at = orientation.origin[k];
                    assert!((at - [10.0, 20.0, 30.0][k]).abs() < 1e-5, "{name} {orientation:?}");
                    for j in 0..3 {
                        let identity = f64::from(u8::from(j == k));
                        assert!((orientation.lps_from_grid[k][j] - identity).abs() < 1e-6);
                    }
                }
                for z in 0..DIMS[2] {
                    for y in 0..DIMS[1] {
                        for x in 0..DIMS[0] {
                            let expected = f64::from(value(x, y, z));
                            assert_eq!(volume.value(x, y, z), expected, "{name} {permutation:?}");
                        }
                    }
                }
            }
        }
    }
    assert_eq!(files.len(), 48, "the files must differ, or the test proves nothing");
}

#[test]
fn unusable_transforms_fall_back() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = vec![1; 60];
    let good = [[-2.0, 0.0, 0.0, 1.0], [0.0, -2.0, 0.0, 2.0], [0.0, 0.0, 2.0, 3.0]];
    let base = NiftiFile::new(2, &DIMS);
    let read_file = |file: &NiftiFile| read(&write(folder.path(), "a.nii", &[&file.bytes(&voxels)])).unwrap();
    let sform = NiftiFile { sform_code: 1, srow: good, ..base.clone() };
    assert_eq!(read_file(&sform).volume.spacing, [2.0; 3], "the sform's lengths win over pixdim");

    let mut singular = sform.clone();
    singular.srow[2] = [0.0; 4];
    let imported = read_file(&singular);
    assert_eq!((imported.volume.orientation, imported.volume.spacing), (None, [1.0; 3]));
    noticed(&imported, "sform cannot be used");
    noticed(&imported, "as stored");

    let both = NiftiFile { qform_code: 1, ..singular.clone() };
    let imported = read_file(&both);
    assert!(imported.volume.orientation.is_some(), "the qform takes over");
    noticed(&imported, "sform cannot be used");
    noticed(&read_file(&NiftiFile { qform_code: 1, ..sform.clone() }), "sform and qform differ");

    let mut absurd = sform.clone();
    absurd.srow[0][0] = f64::NAN;
    assert_eq!(read_file(&absurd).volume.orientation, None);
    let quatern = [f64::NAN, 0.0, 0.0];
    let imported = read_file(&NiftiFile { qform_code: 1, quatern, ..base.clone() });
    assert_eq!(imported.volume.orientation, None);
    noticed(&imported, "qform cannot be used");

    let pixdim = [1.0, f64::NAN, 0.0, -2.0, 1.0, 1.0, 1.0, 1.0];
    let imported = read_file(&NiftiFile { pixdim, ..base.clone() });
    assert_eq!(imported.volume.spacing, [1.0, 1.0, 2.0]);
    assert_eq!(imported.notices.len(), 3);
    for (units, name) in [(0, None), (1, Some("m")), (2 + 8, Some("mm")), (3, Some("um"))] {
        let imported = read_file(&NiftiFile { units, ..base.clone() });
        assert_eq!(imported.volume.spacing_unit.as_deref(), name);
    }
}
