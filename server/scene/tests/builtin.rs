//! Properties of the built-in volumes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU32, Ordering};

use proto::scene_file::Builtin;
use scene::builtin::{buckyball, build, cornell_box, marschner_lobb, pillars};
use scene::{Volume, Voxels};

/// Largest difference of two equal fractions after quantization to 16 bits.
const QUANTUM: f64 = 1.01 / 65535.0;

fn volume(kind: Builtin, dims: [usize; 3]) -> Volume {
    build(kind, dims, &|_| {})
}

fn values(volume: &Volume) -> impl Iterator<Item = f64> {
    (0..volume.voxels.len()).map(|i| volume.slope * f64::from(volume.voxels.stored(i)) + volume.intercept)
}

fn positions(dims: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..dims[2]).flat_map(move |z| (0..dims[1]).flat_map(move |y| (0..dims[0]).map(move |x| [x, y, z])))
}

/// World coordinate of a voxel centre of an n^3 grid.
fn world(p: [usize; 3], n: usize) -> [f64; 3] {
    p.map(|i| (i as f64 + 0.5) / n as f64 - 0.5)
}

#[test]
fn odd_and_tiny_sizes_are_complete_and_finite() {
    for dims in [[1, 1, 1], [3, 5, 7], [1, 64, 1], [64, 1, 2], [2, 3, 40], [17, 16, 15]] {
        for kind in Builtin::ALL {
            let volume = volume(kind, dims);
            assert_eq!(volume.dims, dims);
            assert_eq!(volume.voxels.len(), dims.iter().product::<usize>());
            let top = match kind {
                Builtin::CornellBox => f64::from(cornell_box::SPHERE),
                Builtin::Homogeneous => 255.0,
                _ => 1.0,
            };
            for value in values(&volume) {
                assert!((0.0..=top).contains(&value), "{} {dims:?}: {value}", kind.name());
            }
        }
    }
}

#[test]
fn progress_ends_at_one() {
    let largest = AtomicU32::new(0);
    // Positive floats order like their bits.
    build(Builtin::VesselTree, [16, 16, 9], &|share| {
        assert!(share > 0.0 && share <= 1.0);
        largest.fetch_max(share.to_bits(), Ordering::Relaxed);
    });
    assert_eq!(f32::from_bits(largest.into_inner()), 1.0);
}

#[test]
fn sizes_agree_where_their_voxel_centres_coincide() {
    // Centre i of 16 is centre 3 i + 1 of 48.
    for kind in Builtin::ALL {
        let (coarse, fine) = (volume(kind, [16; 3]), volume(kind, [48; 3]));
        for [x, y, z] in positions([16; 3]) {
            let (a, b) = (coarse.value(x, y, z), fine.value(3 * x + 1, 3 * y + 1, 3 * z + 1));
            assert!((a - b).abs() <= QUANTUM, "{} at {x} {y} {z}: {a} {b}", kind.name());
        }
    }
}

#[test]
fn a_flat_box_shows_the_middle_of_the_cube() {
    let follows_faces = [Builtin::CornellBox, Builtin::Pillars];
    for kind in Builtin::ALL.into_iter().filter(|kind| !follows_faces.contains(kind)) {
        let (slab, cube) = (volume(kind, [32, 16, 8]), volume(kind, [32; 3]));
        for [x, y, z] in positions([32, 16, 8]) {
            let (a, b) = (slab.value(x, y, z), cube.value(x, y + 8, z + 12));
            assert!((a - b).abs() <= QUANTUM, "{} at {x} {y} {z}: {a} {b}", kind.name());
        }
    }
}

#[test]
fn threads_do_not_matter() {
    for kind in Builtin::ALL {
        let in_pool = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| volume(kind, [21, 20, 19]))
        };
        assert_eq!(in_pool(1), in_pool(3), "{}", kind.name());
    }
}

/// Any change of a formula shows here; a new value needs a reason in the commit.
#[test]
fn voxels_are_pinned() {
    let pinned = BTreeMap::from(PINNED);
    for kind in Builtin::ALL {
        let hash = match volume(kind, [40, 36, 32]).voxels {
            Voxels::U8(v) => blake3::hash(&v),
            Voxels::U16(v) => blake3::hash(&v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>()),
            Voxels::I16(v) => blake3::hash(&v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>()),
            Voxels::F32(v) => blake3::hash(&v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>()),
        };
        let hash = hash.to_hex();
        assert_eq!(pinned.get(kind.name()), Some(&&hash[..16]), "{}: {}", kind.name(), &hash[..16]);
    }
}

const PINNED: [(&str, &str); 9] = [
    ("cornell_box", "fb29dff330f1a1ab"),
    ("pillars", "7dde00699fb352c2"),
    ("buckyball", "2a1c0f1fa481df1a"),
    ("smoke_plume", "b5efc9c1be9c0c9d"),
    ("vessel_tree", "3936f11acf6f0318"),
    ("thick_blob", "2aba6bcba8044b5c"),
    ("nested_shells", "0e97ba76b4c16653"),
    ("marschner_lobb", "740ba6dbf85ff04f"),
    ("homogeneous", "61ee76de70ea47b7"),
];

#[test]
fn cornell_box_has_its_labels_where_they_belong() {
    use cornell_box::{AIR, BLOCK, LEFT_WALL, RIGHT_WALL, SPHERE, WHITE_WALL};
    let n = 40;
    let room = volume(Builtin::CornellBox, [n; 3]);
    let label = |x, y, z| room.value(x, y, z) as u8;
    let present: BTreeSet<u8> = positions([n; 3]).map(|[x, y, z]| label(x, y, z)).collect();
    assert_eq!(present, BTreeSet::from([AIR, LEFT_WALL, RIGHT_WALL, WHITE_WALL, BLOCK, SPHERE]));

    // Walls are two voxels thick at this size.
    assert_eq!(cornell_box::WALL * n as f64, 2.0);
    for (a, b) in [(2, 37), (20, 30), (37, 39)] {
        for depth in 0..2 {
            assert_eq!(label(depth, a, b), LEFT_WALL);
            assert_eq!(label(n - 1 - depth, a, b), RIGHT_WALL);
            assert_eq!(label(a, depth, b), WHITE_WALL);
            assert_eq!(label(a, n - 1 - depth, b), WHITE_WALL);
            assert_eq!(label(a, b.min(37), depth), WHITE_WALL);
        }
    }
    for [x, y, z] in positions([n; 3]) {
        let inside = [x, y].iter().all(|i| (2..38).contains(i)) && z >= 2;
        let wall = matches!(label(x, y, z), LEFT_WALL | RIGHT_WALL | WHITE_WALL);
        assert_eq!(wall, !inside, "{x} {y} {z}");
    }
    // Open towards +z, and both bodies stand on the floor, apart from each other and the walls.
    assert!(
        positions([n; 3])
            .filter(|p| p[2] == n - 1)
            .all(|[x, y, z]| { [x, y].iter().any(|i| !(2..38).contains(i)) || label(x, y, z) == AIR })
    );
    let mut spans = Vec::new();
    for body in [BLOCK, SPHERE] {
        let of_body: Vec<_> = positions([n; 3]).filter(|&[x, y, z]| label(x, y, z) == body).collect();
        let span = |axis: usize| {
            let along = of_body.iter().map(|p| p[axis]);
            (along.clone().min().unwrap(), along.max().unwrap())
        };
        assert_eq!(span(1).0, 2, "body {body} stands on the floor");
        assert!(span(0).0 > 2 && span(0).1 < 37 && span(2).0 > 2 && span(2).1 < 37);
        spans.push((span(0), span(2)));
    }
    let [(block_x, block_z), (sphere_x, sphere_z)] = spans[..] else { panic!("two bodies") };
    assert!(block_x.1 < sphere_x.0 || block_z.1 < sphere_z.0, "{spans:?}");
}

#[test]
fn cornell_box_follows_the_faces_of_any_box() {
    let dims = [60, 40, 80];
    let room = volume(Builtin::CornellBox, dims);
    assert_eq!(room.value(1, 20, 70) as u8, cornell_box::LEFT_WALL);
    assert_eq!(room.value(58, 20, 70) as u8, cornell_box::RIGHT_WALL);
    assert_eq!(room.value(30, 0, 70) as u8, cornell_box::WHITE_WALL);
    assert_eq!(room.value(30, 20, 79) as u8, cornell_box::AIR);
    let labels: BTreeSet<u8> = values(&room).map(|v| v as u8).collect();
    assert_eq!(labels.len(), 6);
}

#[test]
fn buckyball_has_sixty_maxima_at_the_atoms() {
    // An odd size has a voxel on each mirror plane, so no maximum is split between two.
    let n = 101;
    let ball = volume(Builtin::Buckyball, [n; 3]);
    let atoms = buckyball::atoms();
    let mut found = vec![0; atoms.len()];
    for [x, y, z] in positions([n; 3]) {
        let here = ball.value(x, y, z);
        let inner = [x, y, z].iter().all(|i| (1..n - 1).contains(i));
        if !inner || here == 0.0 {
            continue;
        }
        let is_maximum = positions([3; 3])
            .filter(|&d| d != [1, 1, 1])
            .all(|[dx, dy, dz]| ball.value(x + dx - 1, y + dy - 1, z + dz - 1) < here);
        if is_maximum {
            let p = world([x, y, z], n);
            let at = atoms
                .iter()
                .position(|atom| (0..3).all(|axis| (atom[axis] - p[axis]).abs() < 0.75 / n as f64));
            found[at.unwrap_or_else(|| panic!("a maximum away from every atom: {p:?}"))] += 1;
            assert!((0.8..=1.0).contains(&here));
        }
    }
    assert_eq!(found, vec![1; 60]);
}

#[test]
fn pillars_stand_apart_on_a_floor() {
    let n = 96;
    let field = volume(Builtin::Pillars, [n; 3]);
    let slice = |y: usize| -> Vec<f64> {
        (0..n).flat_map(|z| (0..n).map(move |x| (x, z))).map(|(x, z)| field.value(x, y, z)).collect()
    };
    // The floor is 0.05 thick: 4.8 voxels.
    for y in 0..4 {
        assert!(slice(y).iter().all(|&v| v > pillars::FLOOR - 0.01));
        assert!(slice(y).iter().any(|&v| (v - pillars::FLOOR).abs() < QUANTUM));
    }
    let above = slice(7);
    assert!(above.contains(&0.0));
    assert_eq!(components([n, n, 1], |[x, z, _]| above[z * n + x] > 0.5).len(), 25);
    assert!(slice(n - 1).iter().all(|&v| v == 0.0));
}

#[test]
fn vessel_tree_is_sparse_connected_and_visible() {
    let n = 128;
    let tree = volume(Builtin::VesselTree, [n; 3]);
    let matter = values(&tree).filter(|&v| v > 0.0).count();
    assert!((matter as f64) < 0.01 * (n * n * n) as f64, "{matter} voxels");
    let sizes = components([n; 3], |[x, y, z]| tree.value(x, y, z) > 0.0);
    assert_eq!(sizes.len(), 1, "one tree, not {sizes:?}");
    // Nothing is cut off but the trunk, at the bottom.
    for [x, y, z] in positions([n; 3]) {
        let on_face = [x, y, z].iter().any(|&i| i == 0 || i == n - 1);
        assert!(!on_face || y == 0 || tree.value(x, y, z) == 0.0, "cut at {x} {y} {z}");
    }
    // Half the size still shows it: the same share of the box, and solid vessels.
    let half = volume(Builtin::VesselTree, [64; 3]);
    let half_matter = values(&half).filter(|&v| v > 0.0).count();
    assert!((0.9..1.1).contains(&(8.0 * half_matter as f64 / matter as f64)));
    assert!(values(&half).filter(|&v| v > 0.5).count() > 300);
}

#[test]
fn round_bodies_and_smoke_end_before_the_faces() {
    let n = 48;
    for kind in [Builtin::Buckyball, Builtin::SmokePlume, Builtin::ThickBlob, Builtin::NestedShells] {
        let body = volume(kind, [n; 3]);
        for [x, y, z] in positions([n; 3]) {
            let on_face = [x, y, z].iter().any(|&i| i == 0 || i == n - 1);
            let source = kind == Builtin::SmokePlume && y == 0;
            assert!(!on_face || source || body.value(x, y, z) == 0.0, "{} {x} {y} {z}", kind.name());
        }
        let (low, high) = values(&body).fold((1.0_f64, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        assert!(low == 0.0 && high > 0.7, "{}: {low}..{high}", kind.name());
    }
}

#[test]
fn nested_shells_show_every_value_through_the_cut() {
    // Along the diagonal into the cut octant only the core is left; opposite, every shell.
    let n = 128;
    let shells = volume(Builtin::NestedShells, [n; 3]);
    let along = |i: usize| shells.value(i, i, i);
    let plateaus: BTreeSet<u32> = (0..n / 2).map(|i| (along(i) * 8.0).round() as u32).collect();
    assert!([0, 2, 4, 6, 8].iter().all(|v| plateaus.contains(v)), "{plateaus:?}");
    let first_in_cut = (n / 2..n).rev().map(along).find(|&v| v > 0.9);
    assert!(first_in_cut.is_some());
    let in_cut: f64 = (90..n).map(along).sum();
    assert_eq!(in_cut, 0.0);
}

#[test]
fn marschner_lobb_matches_the_published_formula() {
    let n = 41;
    let signal = volume(Builtin::MarschnerLobb, [n; 3]);
    for p @ [i, j, k] in positions([n; 3]) {
        let [x, y, z] = world(p, n).map(|c| 2.0 * c);
        let half_pi = std::f64::consts::FRAC_PI_2;
        let r = x.hypot(y);
        let rho_r = (4.0 * half_pi * marschner_lobb::FREQUENCY * (half_pi * r).cos()).cos();
        let alpha = marschner_lobb::ALPHA;
        let expected = (1.0 - (half_pi * z).sin() + alpha * (1.0 + rho_r)) / (2.0 * (1.0 + alpha));
        assert!((signal.value(i, j, k) - expected).abs() < 1e-6);
    }
    // At the origin rho = (1 + 2 alpha) / (2 (1 + alpha)) = 0.6.
    assert!((signal.value(20, 20, 20) - 0.6).abs() < 1e-6);
    assert_eq!((marschner_lobb::FREQUENCY, marschner_lobb::ALPHA), (6.0, 0.25));
}

#[test]
fn homogeneous_is_constant() {
    assert!(values(&volume(Builtin::Homogeneous, [9, 10, 11])).all(|v| v == 255.0));
}

/// Sizes of the 26-connected components of the voxels that are `solid`.
fn components(dims: [usize; 3], solid: impl Fn([usize; 3]) -> bool) -> Vec<usize> {
    let index = |p: [usize; 3]| (p[2] * dims[1] + p[1]) * dims[0] + p[0];
    let mut open: Vec<bool> = positions(dims).map(&solid).collect();
    let mut sizes = Vec::new();
    for seed in positions(dims) {
        let mut stack = if open[index(seed)] {
            vec![seed]
        } else {
            continue;
        };
        open[index(seed)] = false;
        let mut size = 0;
        while let Some(p) = stack.pop() {
            size += 1;
            for d in positions([3; 3]) {
                let next: [usize; 3] = std::array::from_fn(|a| (p[a] + d[a]).wrapping_sub(1));
                if (0..3).all(|a| next[a] < dims[a]) && open[index(next)] {
                    open[index(next)] = false;
                    stack.push(next);
                }
            }
        }
        sizes.push(size);
    }
    sizes
}
