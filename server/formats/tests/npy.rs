//! NumPy arrays, written here byte by byte.

mod common;

use common::*;
use proto::scene_file::{Endian, VoxelType};

/// A file of version 1.
fn npy(descr: &str, fortran: bool, shape: &str, body: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let header = format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}\n");
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), body].concat()
}

const LETTERS: [&str; 10] = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"];

#[test]
fn every_type_in_both_byte_orders() {
    let folder = tempfile::tempdir().unwrap();
    for ((voxel_type, ..), letters) in TYPES.into_iter().zip(LETTERS) {
        for endian in ENDIANS {
            let expected = values(voxel_type, 60);
            let order = if endian == Endian::Big { '>' } else { '<' };
            let body = encode(&expected, voxel_type, endian);
            let bytes = npy(&format!("'{order}{letters}'"), false, "(3, 4, 5)", &body);
            let imported = read(&write(folder.path(), "a.npy", &[&bytes])).unwrap();
            assert_eq!(imported.volume.dims, DIMS);
            assert_eq!(imported.file_type, voxel_type);
            assert_eq!(data(&imported), expected, "{letters} {endian:?}");
            // The name does not matter, nor does a layer of gzip.
            let zipped = read(&write(folder.path(), "b.bin", &[&gzip(&bytes)])).unwrap();
            assert_eq!(zipped.volume, imported.volume);
        }
    }
}

#[test]
fn half_floats_and_flags() {
    let folder = tempfile::tempdir().unwrap();
    // 1, -2, 0.5, infinity
    let halves: [u16; 4] = [0x3c00, 0xc000, 0x3800, 0x7c00];
    for order in ['<', '>'] {
        let body: Vec<u8> = halves
            .iter()
            .flat_map(|h| if order == '<' { h.to_le_bytes() } else { h.to_be_bytes() })
            .collect();
        let bytes = npy(&format!("'{order}f2'"), false, "(1, 2, 2)", &body);
        let imported = read(&write(folder.path(), "a.npy", &[&bytes])).unwrap();
        assert_eq!(data(&imported), [1.0, -2.0, 0.5, -2.0]);
        noticed(&imported, "16-bit floats");
        noticed(&imported, "1 of 4 voxels");
    }
    let bytes = npy("'|b1'", false, "(1, 2, 2)", &[0, 1, 1, 0]);
    assert_eq!(data(&read(&write(folder.path(), "b.npy", &[&bytes])).unwrap()), [0.0, 1.0, 1.0, 0.0]);
}

#[test]
fn the_index_is_zyx_in_either_order_of_memory() {
    let folder = tempfile::tempdir().unwrap();
    let [x, y, z] = DIMS;
    let c_order: Vec<u8> = (0..60).collect();
    // The same array with z fastest.
    let mut fortran = vec![0; 60];
    for (i, value) in c_order.iter().enumerate() {
        let (ix, iy, iz) = (i % x, i / x % y, i / x / y);
        fortran[(ix * y + iy) * z + iz] = *value;
    }
    let a = read(&write(folder.path(), "a.npy", &[&npy("'|u1'", false, "(3, 4, 5)", &c_order)])).unwrap();
    let b = read(&write(folder.path(), "b.npy", &[&npy("'|u1'", true, "(3, 4, 5)", &fortran)])).unwrap();
    assert_eq!(a.volume, b.volume);
    assert_eq!(a.volume.value(1, 2, 2), f64::from(c_order[(2 * y + 2) * x + 1]));
    // Components last in memory order C are components; last in order Fortran they are volumes.
    let shape = "(2, 2, 5, 3)";
    let c = write(folder.path(), "c.npy", &[&npy("'|u1'", false, shape, &c_order)]);
    let imported = read_index(&c, 2).unwrap();
    assert_eq!((imported.volume.dims, imported.choices), ([5, 2, 2], 3));
    assert_eq!(data(&imported), (0..20).map(|i| f64::from(3 * i + 2)).collect::<Vec<_>>());
    let volumes = write(folder.path(), "d.npy", &[&npy("'|u1'", false, "(2, 2, 3, 5)", &c_order)]);
    assert_eq!(data(&read_index(&volumes, 1).unwrap()), (30..60).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn a_flat_array_is_one_slice() {
    let folder = tempfile::tempdir().unwrap();
    let body = encode(&values(VoxelType::Float64, 20), VoxelType::Float64, Endian::Little);
    let imported = read(&write(folder.path(), "a.npy", &[&npy("'<f8'", false, "(4, 5)", &body)])).unwrap();
    assert_eq!(imported.volume.dims, [5, 4, 1]);
    noticed(&imported, "one slice");
}

#[test]
fn what_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (descr, shape, words) in [
        ("'|O'", "(3, 4, 5)", "Python objects"),
        ("[('a', '<u2')]", "(3, 4, 5)", "structures"),
        ("'<c8'", "(3, 4, 5)", "complex"),
        ("'<U3'", "(3, 4, 5)", "array type"),
        ("'|u1'", "()", "shape"),
        ("'|u1'", "(60,)", "shape"),
        ("'|u1'", "(0, 4, 5)", "shape"),
        ("'|u1'", "(-3, 4, 5)", "shape"),
        ("'|u1'", "(3, 4, 6)", "ends too early"),
        ("'|u1'", "(99999999999, 4, 6)", "shape"),
    ] {
        let path = write(folder.path(), "a.npy", &[&npy(descr, false, shape, &[0; 60])]);
        refused(read(&path), "a.npy", &[words]);
    }
    let lies = [b"\x93NUMPY\x02\x00", &u32::MAX.to_le_bytes()[..]].concat();
    refused(read(&write(folder.path(), "b.npy", &[&lies])), "b.npy", &["header"]);
}
