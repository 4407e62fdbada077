//! Empty-space distance map over macrocells.
//!
//! For each cell the Chebyshev distance, in cells, to the nearest cell whose bin mask meets the
//! bins with matter (0: the cell itself). A ray in a cell at distance d may leap to the border of
//! the block of cells closer than d. Updated from the masks alone; no voxel is read again.

/// Largest distance stored; beyond it a leap is merely shorter than it could be.
pub const MAX_DISTANCE: u8 = 255;

/// Distance of every cell, x fastest. `dims` are cells along x, y, z.
pub fn distance_map(dims: [usize; 3], masks: &[u64], bins_with_matter: u64) -> Vec<u8> {
    let mut distance: Vec<u8> =
        masks.iter().map(|mask| if mask & bins_with_matter != 0 { 0 } else { MAX_DISTANCE }).collect();
    // All 26 neighbours are at Chebyshev distance 1, so two raster passes (over the 13 neighbours
    // before a cell, then over the 13 after it) give the distance exactly (Rosenfeld, Pfaltz 1968).
    sweep(&mut distance, dims, false);
    sweep(&mut distance, dims, true);
    distance
}

fn sweep(distance: &mut [u8], dims: [usize; 3], backward: bool) {
    let [nx, ny, nz] = dims.map(|n| n as isize);
    let index = |x: isize, y: isize, z: isize| ((z * ny + y) * nx + x) as usize;
    let count = (nx * ny * nz) as usize;
    let before: Vec<[isize; 3]> = (0..27)
        .map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1])
        .filter(|&[x, y, z]| z * 9 + y * 3 + x < 0)
        .collect();
    let sign = if backward { -1 } else { 1 };
    for step in 0..count {
        let at = if backward { count - 1 - step } else { step };
        if distance[at] == 0 {
            continue;
        }
        let (x, y, z) = (at as isize % nx, at as isize / nx % ny, at as isize / (nx * ny));
        let mut nearest = distance[at];
        for &[dx, dy, dz] in &before {
            let (x, y, z) = (x + sign * dx, y + sign * dy, z + sign * dz);
            if (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z) {
                nearest = nearest.min(distance[index(x, y, z)].saturating_add(1));
            }
        }
        distance[at] = nearest;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_brute_force() {
        let dims = [9, 7, 5];
        let masks: Vec<u64> = (0..315u64).map(|i| u64::from((i * 2654435761) % 97 == 0)).collect();
        let map = distance_map(dims, &masks, 1);
        let coordinates = |i: usize| [i % 9, i / 9 % 7, i / 63].map(|x| x as i64);
        for (i, &distance) in map.iter().enumerate() {
            let expected = (0..315)
                .filter(|&j| masks[j] == 1)
                .map(|j| {
                    let (a, b) = (coordinates(i), coordinates(j));
                    (0..3).map(|k| (a[k] - b[k]).abs()).max().unwrap()
                })
                .min()
                .unwrap();
            assert_eq!(i64::from(distance), expected, "cell {i}");
        }
    }

    #[test]
    fn empty_volume_is_far_everywhere() {
        assert!(distance_map([4, 4, 4], &[2; 64], 1).iter().all(|&d| d == MAX_DISTANCE));
    }
}
