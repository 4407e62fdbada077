//! What a path needs to know of each macrocell: an upper bound of its extinction, or how far the
//! nearest matter is; and the bins whose matter decides that. Derived from the bin masks alone; no
//! voxel is read again.

use proto::scene_file::Filter;
use rayon::prelude::*;

use crate::bins::BIN_COUNT;
use crate::distance::distance_map;
use crate::scene::Scene;

/// Bounds are larger by this share: single precision rounds them and what they bound.
const ROUNDING: f64 = 1e-5;

/// By how much values in single precision may be off, a share of the data's range, with room to spare.
const ROUNDING_OF_VALUES: f64 = 1e-3;

/// A rise that bounds nothing: larger than any other, and its square is finite in single precision.
pub const UNKNOWN_RISE: f32 = f32::from_bits(0x5860_0000);

/// Lower bits that a rise has not: it has a sign of 0, an exponent and four bits.
const RISE_SHIFT: u32 = 19;

/// A value per macrocell each, x fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Majorants {
    /// Above 0: no extinction in the cell is larger, per world unit. Below 0: there is none in any
    /// cell closer than minus this many cells (Chebyshev; the cell itself is at 0).
    pub bounds: Vec<f32>,
    /// Bins that occur in the cell, or in the cells that a bound below 0 speaks of: as long as
    /// matter in none of them changes, what was learned here stays true.
    pub bins: Vec<u64>,
    /// How much extinction can change along one axis from voxel to voxel in the cell, per world unit;
    /// [`UNKNOWN_RISE`] where nothing is known. From `bins`' matter and the bins' edges alone.
    pub rises: Vec<f32>,
    /// Below the first and above the second there is no matter in the cell. Shares of the data's range,
    /// of [`WHOLE_RANGE`]. From `bins`' matter alone, as the bound.
    pub free: Vec<[u16; 2]>,
}

/// What 1 is in [`Majorants::free`].
pub const WHOLE_RANGE: u16 = (1 << LIMIT_BITS) - 1;
/// Bits of a limit.
const LIMIT_BITS: u32 = 10;
/// By how much the limits of [`Majorants::free`] are moved apart, of [`WHOLE_RANGE`]: rounding of what is
/// compared with them. No round number, so that no limit lies where the last digit decides.
const FREE_MARGIN: f64 = 0.0237;

impl Majorants {
    /// The scene's. Without `sampling.skip_empty` no bound is below -1.
    pub fn of(scene: &Scene) -> Self {
        let cells = &scene.volume.macrocells;
        let masks = cells.masks(scene.filter);
        let with_matter = scene.bins_with_matter();
        let largest = scene.classification().largest_sigma_t(&scene.volume.bins);
        let mut distance = distance_map(cells.dims, masks, with_matter);
        if !scene.sampling.skip_empty {
            distance.iter_mut().for_each(|d| *d = (*d).min(1));
        }
        let bound = |(mask, distance): (&u64, &u8)| match distance {
            0 => ((1.0 + ROUNDING) * largest_in(*mask, &largest, scene.filter)) as f32,
            empty => -f32::from(*empty),
        };
        let bounds = masks.par_iter().zip(&distance).map(bound);
        // An extinction that rounds to 0 is matter all the same.
        let bounds = bounds.map(|bound| if bound < 0.0 { bound } else { bound.max(f32::MIN_POSITIVE) });
        Self {
            bounds: bounds.collect(),
            rises: rises(scene, masks),
            bins: bins_nearby(cells.dims, masks, &distance, with_matter),
            free: free_of_matter(scene, masks),
        }
    }

    /// The same with the largest bound everywhere: what a tracker without macrocells would use.
    pub fn global(scene: &Scene) -> Self {
        let local = Self::of(scene);
        let largest = local.bounds.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let all = local.bins.iter().fold(0, |all, bins| all | bins);
        let count = local.bounds.len();
        let (bounds, rises) = (vec![largest; count], vec![UNKNOWN_RISE; count]);
        Self { bounds, rises, bins: vec![all; count], free: vec![[0, WHOLE_RANGE]; count] }
    }

    /// Limits of matter and a rise in one word: 10, 10 and 12 bits, which say all of them.
    pub fn word([below, above]: [u16; 2], rise: f32) -> u32 {
        let rise = rise.to_bits() >> RISE_SHIFT;
        u32::from(below) | u32::from(above) << LIMIT_BITS | rise << (2 * LIMIT_BITS)
    }
}

/// The smallest rise that is not smaller than a number of 0 or more.
fn rounded_up(x: f32) -> f32 {
    let lower_bits = (1 << RISE_SHIFT) - 1;
    if x.is_finite() { f32::from_bits((x.to_bits() + lower_bits) & !lower_bits) } else { x }
}

fn rises(scene: &Scene, masks: &[u64]) -> Vec<f32> {
    let edges = &scene.volume.bins.edges;
    let range = edges[BIN_COUNT] - edges[0];
    if scene.filter == Filter::Nearest || range <= 0.0 {
        return vec![UNKNOWN_RISE; masks.len()];
    }
    let steepest = scene.classification().steepest_sigma_t(&scene.volume.bins);
    let rise = |mask: &u64| {
        // Bins of an interval of values follow one another.
        let bins = mask.trailing_zeros() as usize..BIN_COUNT - mask.leading_zeros() as usize;
        if bins.is_empty() {
            return UNKNOWN_RISE;
        }
        // Neither do two voxels differ by more than the cell's values.
        let apart = edges[bins.end] - edges[bins.start] + ROUNDING_OF_VALUES * range;
        let steepest = steepest[bins].iter().copied().fold(0.0, f64::max);
        rounded_up(((1.0 + ROUNDING) * steepest * apart) as f32).min(UNKNOWN_RISE)
    };
    masks.par_iter().map(rise).collect()
}

fn largest_in(mask: u64, largest: &[f64; BIN_COUNT], filter: Filter) -> f64 {
    let bins: &mut dyn Iterator<Item = usize> = match filter {
        // Bins of an interval of values follow one another.
        Filter::Linear => &mut (mask.trailing_zeros() as usize..BIN_COUNT - mask.leading_zeros() as usize),
        Filter::Nearest => &mut (0..BIN_COUNT).filter(|bin| mask >> bin & 1 == 1),
    };
    bins.fold(0.0, |sum, bin| largest[bin].max(sum))
}

fn free_of_matter(scene: &Scene, masks: &[u64]) -> Vec<[u16; 2]> {
    let [low, high] = scene.volume.range;
    if scene.filter == Filter::Nearest || high <= low {
        return vec![[0, WHOLE_RANGE]; masks.len()];
    }
    let matter = scene.classification().matter_in_bins(&scene.volume.bins);
    let share = |value: f64| (value - low) / (high - low) * f64::from(WHOLE_RANGE);
    let limits = |mask: &u64| {
        // Bins of an interval of values follow one another.
        let bins = mask.trailing_zeros() as usize..BIN_COUNT - mask.leading_zeros() as usize;
        let held = matter.get(bins).unwrap_or_default().iter().flatten();
        let (first, last) = held
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), [a, b]| (a.min(first), b.max(last)));
        // Casts saturate; a cell without matter is not looked into.
        let whole = f64::from(WHOLE_RANGE);
        [
            (share(first) - FREE_MARGIN).floor().min(whole) as u16,
            (share(last) + FREE_MARGIN).ceil().min(whole) as u16,
        ]
    };
    masks.par_iter().map(limits).collect()
}

/// For each cell the bins of all cells closer than its distance: its own at distance 0. At other
/// distances these cells hold none of the bins `with_matter`.
fn bins_nearby(dims: [usize; 3], masks: &[u64], distance: &[u8], with_matter: u64) -> Vec<u64> {
    let mut nearby = masks.to_vec();
    let farthest = distance.iter().copied().max().unwrap_or(0);
    // Bins of the block of `edge` cells along each axis that begins at a cell: two such blocks an
    // axis cover any range of `edge` to `2 edge - 1` cells.
    let mut blocks = masks.to_vec();
    let mut edge = 1;
    while edge < 2 * usize::from(farthest) {
        nearby.par_iter_mut().zip(distance).enumerate().for_each(|(index, (bins, &distance))| {
            let radius = usize::from(distance).saturating_sub(1);
            if distance > 0 && (edge..2 * edge).contains(&(2 * radius + 1)) {
                let ranges = ranges(place(index, dims), dims, radius, edge);
                *bins = union_at(&blocks, dims, ranges) & !with_matter;
            }
        });
        blocks = doubled(blocks, dims, edge);
        edge *= 2;
    }
    nearby
}

/// Where the two blocks begin along each axis that cover the cells within `radius` of a cell.
fn ranges(at: [usize; 3], dims: [usize; 3], radius: usize, edge: usize) -> [[usize; 2]; 3] {
    std::array::from_fn(|axis| {
        let first = at[axis].saturating_sub(radius);
        let last = (at[axis] + radius).min(dims[axis] - 1);
        [first, (last + 1).saturating_sub(edge).max(first)]
    })
}

/// Blocks of twice the edge: each with those that begin `edge` cells further along each axis.
fn doubled(mut blocks: Vec<u64>, [nx, ny, _]: [usize; 3], edge: usize) -> Vec<u64> {
    let rows_apart = |blocks: &mut [u64], length: usize| {
        // Later ones are still as they were when earlier ones take them in.
        for first in 0..blocks.len().saturating_sub(edge * length) / length {
            let (these, further) = blocks[first * length..].split_at_mut(edge * length);
            these[..length].iter_mut().zip(further).for_each(|(bins, more)| *bins |= *more);
        }
    };
    for slice in blocks.chunks_exact_mut(nx * ny) {
        slice.chunks_exact_mut(nx).for_each(|row| rows_apart(row, 1));
        rows_apart(slice, nx);
    }
    rows_apart(&mut blocks, nx * ny);
    blocks
}

fn place(index: usize, [nx, ny, _]: [usize; 3]) -> [usize; 3] {
    [index % nx, index / nx % ny, index / (nx * ny)]
}

fn union_at(blocks: &[u64], [nx, ny, _]: [usize; 3], [xs, ys, zs]: [[usize; 2]; 3]) -> u64 {
    let rows = zs.iter().flat_map(|z| ys.iter().map(move |y| (z * ny + y) * nx));
    rows.fold(0, |all, row| all | blocks[row + xs[0]] | blocks[row + xs[1]])
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proto::SceneFile;
    use serde_json::json;

    use super::*;
    use crate::{PreparedVolume, Volume, Voxels};

    #[test]
    fn bins_nearby_equal_brute_force() {
        let dims = [13, 6, 9];
        let count = dims.iter().product::<usize>() as u64;
        let masks: Vec<u64> =
            (0..count).map(|i| if i * 2654435761 % 83 == 0 { 1 } else { 2 << (i * 7 % 60) }).collect();
        let distance = distance_map(dims, &masks, 1);
        assert!(distance.iter().any(|&d| d > 3));
        let nearby = bins_nearby(dims, &masks, &distance, 1);
        for (index, &bins) in nearby.iter().enumerate() {
            let (at, d) = (place(index, dims), usize::from(distance[index]));
            let near = |other: usize| {
                let to = place(other, dims);
                (0..3).all(|axis| at[axis].abs_diff(to[axis]) < d.max(1))
            };
            let expected = (0..masks.len()).filter(|&o| near(o)).fold(0, |all, o| all | masks[o]);
            assert!(bins & !expected & 1 == 0 && expected & !bins == 0, "cell {at:?} at distance {d}");
            // At the grid's border a block may reach further; not elsewhere.
            let inside = (0..3).all(|axis| at[axis] >= d && at[axis] + d < dims[axis]);
            assert!(!inside || bins == expected, "cell {at:?} at distance {d}");
        }
    }

    #[test]
    fn bounds_hold_and_tell_matter_from_none() {
        let voxels = (0..20 * 12 * 8).map(|i| if i % 20 < 9 { 0 } else { (i % 199) as u8 }).collect();
        let volume = PreparedVolume::new(Volume::new([20, 12, 8], Voxels::U8(voxels)), &|_| {});
        let file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "transfer_function": {"points":
            [{"s": 0.3, "extinction": 0}, {"s": 0.5, "extinction": 40}, {"s": 0.6, "extinction": 1e-42}]}});
        let scene = Scene::new(&SceneFile::from_value(file).unwrap(), Arc::new(volume)).unwrap();
        let majorants = Majorants::of(&scene);
        assert_eq!(majorants.bounds[0], -2.0, "cells 0 and 1 along x hold zeros alone");
        assert_eq!(majorants.bins[0], scene.volume.macrocells.masks(scene.filter)[0]);
        let dense = majorants.bounds.iter().copied().fold(0.0, f32::max);
        assert!((40.0..40.01).contains(&dense), "{dense}");
        assert!(!majorants.bounds.iter().any(|bound| (0.0..f32::MIN_POSITIVE).contains(bound)));
        let volume = &scene.volume;
        let cells = volume.macrocells.dims;
        for (index, &[below, above]) in majorants.free.iter().enumerate() {
            let value = |limit: u16| {
                volume.range[0]
                    + f64::from(limit) / f64::from(WHOLE_RANGE) * (volume.range[1] - volume.range[0])
            };
            let [x, y, z] = place(index, cells);
            if majorants.bounds[index] < 0.0 {
                continue;
            }
            // Values between 0 and 198; matter begins at 0.3 of the window, which is that of the data. A limit
            // is the nearest of its whole shares on the safe side.
            let share = (1.0 + FREE_MARGIN) * 198.0 / f64::from(WHOLE_RANGE);
            let mask = volume.macrocells.masks(scene.filter)[index];
            let begins = (0.3 * 198.0_f64).max(volume.bins.edges[mask.trailing_zeros() as usize]);
            assert!((begins - share..begins).contains(&value(below)), "cell {x} {y} {z}: {below}");
            let ends = volume.bins.edges[BIN_COUNT - mask.leading_zeros() as usize];
            assert!(value(above) >= ends.min(198.0), "cell {x} {y} {z}: {above}");
        }
        for (limits, rise) in majorants.free.iter().zip(&majorants.rises) {
            let word = Majorants::word(*limits, *rise);
            assert_eq!([word & 1023, word >> 10 & 1023].map(|limit| limit as u16), *limits);
            assert_eq!(f32::from_bits(word >> 20 << 19), *rise);
        }
        let global = Majorants::global(&scene);
        assert!(global.bounds.iter().all(|&bound| bound == dense));
    }

    /// Between any two neighbours in a cell, and at any value between theirs.
    #[test]
    fn extinction_changes_by_no_more_than_the_rise_from_voxel_to_voxel() {
        let dims = [20, 12, 9];
        let value = |i: usize| ((i % 20) as f32 * 0.37).sin() + 0.001 * (i * 7919 % 997) as f32;
        let voxels = Voxels::F32((0..dims.iter().product()).map(value).collect());
        let volume = Arc::new(PreparedVolume::new(Volume::new(dims, voxels), &|_| {}));
        let rises = |points: serde_json::Value, filter: &str| {
            let file = json!({"version": 1, "volume": {"builtin": "homogeneous", "filter": filter},
                "value_range": [-0.5, 1.5], "transfer_function": {"points": points}});
            let scene = Scene::new(&SceneFile::from_value(file).unwrap(), volume.clone()).unwrap();
            (Majorants::of(&scene).rises, scene)
        };
        let slopes = json!([{"s": 0.2, "extinction": 0}, {"s": 0.5, "extinction": 1e4},
            {"s": 0.6, "extinction": 100}, {"s": 0.9, "extinction": 5e4}]);
        let (steady, scene) = rises(slopes, "linear");
        let matter = scene.classification();
        let cells = volume.macrocells.dims;
        let mut closest = 0.0_f64;
        for (index, &rise) in steady.iter().enumerate() {
            let first = place(index, cells).map(|at| 4 * at);
            for x in first[0]..(first[0] + 3).min(dims[0] - 1) {
                let row = (first[2] * dims[1] + first[1]) * dims[0];
                let [a, b] = [x, x + 1].map(|x| f64::from(value(row + x)));
                let at = |share: f64| matter.sigma_t_at(a + share * (b - a));
                for step in 0..16 {
                    let [low, high] = [0, 1].map(|more| f64::from(step + more) / 16.0);
                    // So fast it changes here, all the way from one voxel to the next.
                    let change = 16.0 * (at(high) - at(low)).abs();
                    assert!(change <= f64::from(rise), "{index}: {change} {rise}");
                    closest = closest.max(change / f64::from(rise));
                }
            }
        }
        assert!(closest > 0.2, "{closest}");
        let jump = json!([{"s": 0, "extinction": 0}, {"s": 0.9, "extinction": 0},
            {"s": 0.9, "extinction": 10}, {"s": 1, "extinction": 10}]);
        let (jumping, _) = rises(jump.clone(), "linear");
        assert!(jumping.contains(&UNKNOWN_RISE) && jumping.contains(&0.0), "{jumping:?}");
        assert!(rises(jump, "nearest").0.iter().all(|rise| *rise == UNKNOWN_RISE));
    }
}
