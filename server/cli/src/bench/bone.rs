//! A piece of long bone in soft tissue as a CT scanner would see it: values in Hounsfield units, a
//! dense cortex, a mesh of thin trabeculae in the marrow, noise. Made of IEEE operations alone, so
//! the voxels are the same on every machine.

use scene::{Volume, Voxels};

/// Values, Hounsfield units.
const AIR: f64 = -1000.0;
const TISSUE: f64 = 40.0;
const MARROW: f64 = -40.0;
const TRABECULA: f64 = 700.0;
const CORTEX: f64 = 1500.0;
/// Largest deviation of a voxel by noise.
const NOISE: f64 = 20.0;
/// Half-axes of the tissue, world units, across.
const TISSUE_RADII: [f64; 2] = [0.45, 0.38];
/// Radius of the shaft and how much the end flares, world units.
const SHAFT: f64 = 0.14;
const FLARE: f64 = 0.5;
/// Thickness of the cortex, world units.
const WALL: f64 = 0.035;
/// Edge of a cell of the trabecular mesh, world units.
const MESH: f64 = 0.06;

/// A volume of `edge` voxels along each axis; the bone's axis is y.
pub fn bone_like_ct(edge: usize) -> Volume {
    let at = |i: usize| (i as f64 + 0.5) / edge as f64 - 0.5;
    let voxel = |index: usize| {
        let [i, j, k] = [index % edge, index / edge % edge, index / (edge * edge)];
        let noise = NOISE * (2.0 * lattice([i as i64, j as i64, k as i64]) - 1.0);
        (density([at(i), at(j), at(k)]) + noise).round() as i16
    };
    Volume::new([edge; 3], Voxels::I16((0..edge * edge * edge).map(voxel).collect()))
}

/// Hounsfield units at a place in -0.5..0.5.
fn density([x, y, z]: [f64; 3]) -> f64 {
    let [a, b] = TISSUE_RADII;
    if (x / a) * (x / a) + (z / b) * (z / b) > 1.0 {
        return AIR;
    }
    // The axis bends a little; the upper end is wide.
    let (x, z) = (x - 0.12 * y * y, z + 0.04 * y);
    let upper = (y + 0.1).max(0.0);
    let radius = SHAFT + FLARE * upper * upper;
    let depth = radius - (x * x + z * z).sqrt();
    if depth < 0.0 {
        return TISSUE;
    }
    if depth < WALL {
        return CORTEX;
    }
    // Trabeculae: where a smooth noise is near its middle, a mesh of walls; denser to the end.
    let mesh = (noise([x / MESH, y / MESH, z / MESH]) - 0.5).abs();
    if mesh < 0.03 + 0.09 * upper { TRABECULA } else { MARROW }
}

/// Smooth noise, 0..1: trilinear between lattice values, smoothed.
fn noise(place: [f64; 3]) -> f64 {
    let cell = place.map(f64::floor);
    let [u, v, w] = [0, 1, 2].map(|axis| {
        let t = place[axis] - cell[axis];
        t * t * (3.0 - 2.0 * t)
    });
    let corner =
        |dx: i64, dy: i64, dz: i64| lattice([cell[0] as i64 + dx, cell[1] as i64 + dy, cell[2] as i64 + dz]);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let edge = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), u);
    mix(mix(edge(0, 0), edge(1, 0), v), mix(edge(0, 1), edge(1, 1), v), w)
}

/// A value in 0..1 for a point of the lattice: its coordinates hashed (finaliser of SplitMix64).
fn lattice(point: [i64; 3]) -> f64 {
    let mut hash = 0x9e37_79b9_7f4a_7c15u64;
    for coordinate in point {
        hash ^= coordinate as u64;
        hash = (hash ^ (hash >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        hash = (hash ^ (hash >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        hash ^= hash >> 31;
    }
    (hash >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_tissues_are_there_and_the_voxels_are_pinned() {
        let volume = bone_like_ct(32);
        let near = |value: f64| {
            let close = |i: &usize| (volume.value(i % 32, i / 32 % 32, i / 1024) - value).abs() <= NOISE;
            (0..32 * 32 * 32).filter(close).count()
        };
        let counts = [AIR, TISSUE, MARROW, TRABECULA, CORTEX].map(near);
        assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
        assert_eq!(counts.iter().sum::<usize>(), 32 * 32 * 32);
        let prepared = scene::PreparedVolume::new(volume, &|_| {});
        assert_eq!(&prepared.content_hex()[..16], "f83b0be006decd1a");
    }
}
