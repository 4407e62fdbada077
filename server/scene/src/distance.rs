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

/// One pass: every cell against the 13 neighbours before it in the order of the sweep. Row by row,
/// so that the compiler can take many cells at a time.
fn sweep(distance: &mut [u8], [nx, ny, nz]: [usize; 3], backward: bool) {
    // Of the rows before this one, the smallest distance at each x; one cell wider on both sides.
    let mut nearest = vec![MAX_DISTANCE; nx + 2];
    for step in 0..ny * nz {
        let row = if backward { ny * nz - 1 - step } else { step };
        let (y, z) = (row % ny, row / ny);
        nearest.fill(MAX_DISTANCE);
        for (dy, dz) in [(-1, -1), (0, -1), (1, -1), (-1, 0)] {
            let (dy, dz) = if backward { (-dy, -dz) } else { (dy, dz) };
            let (Some(y), Some(z)) = (y.checked_add_signed(dy), z.checked_add_signed(dz)) else { continue };
            if y < ny && z < nz {
                let before = &distance[(z * ny + y) * nx..][..nx];
                nearest[1..].iter_mut().zip(before).for_each(|(near, &d)| *near = d.min(*near));
            }
        }
        let cells = &mut distance[row * nx..][..nx];
        for (x, cell) in cells.iter_mut().enumerate() {
            let around = nearest[x].min(nearest[x + 1]).min(nearest[x + 2]);
            *cell = around.saturating_add(1).min(*cell);
        }
        let mut previous = MAX_DISTANCE;
        let mut along = |cell: &mut u8| {
            *cell = previous.saturating_add(1).min(*cell);
            previous = *cell;
        };
        if backward {
            cells.iter_mut().rev().for_each(&mut along)
        } else {
            cells.iter_mut().for_each(&mut along)
        }
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
