//! Levels of a volume: the same box with half as many voxels along each axis, for devices that
//! have no room for all of them.
//!
//! Level 0 is the volume itself; level `l` has `ceil(n / 2^l)` voxels along an axis of `n`. The box
//! stays the same, so a voxel of a level covers exactly `n / ceil(n / 2)` voxels of the level
//! before: two where `n` is even, a little less where it is odd. Its value is the mean over what it
//! covers, each voxel weighted by its covered share, so that means are kept for odd sizes, too; or
//! the value that covers most of it, for labels, which have no mean.

use rayon::prelude::*;

use crate::volume::{Volume, Voxels};

/// How several voxels become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reduction {
    /// The mean, rounded to the nearest stored value, ties to the even one.
    Mean,
    /// The value that covers most; of equals the one that comes first in memory.
    Majority,
}

impl Reduction {
    /// What suits how samples are read: interpolated values are averaged, labels are counted.
    pub fn of(filter: proto::scene_file::Filter) -> Self {
        match filter {
            proto::scene_file::Filter::Linear => Reduction::Mean,
            proto::scene_file::Filter::Nearest => Reduction::Majority,
        }
    }
}

/// Voxels of a level.
pub fn level_dims(dims: [usize; 3], level: u32) -> [usize; 3] {
    dims.map(|n| n.div_ceil(1usize.checked_shl(level).unwrap_or(usize::MAX)).max(1))
}

/// The coarsest level: one voxel.
pub fn coarsest(dims: [usize; 3]) -> u32 {
    let longest = dims.into_iter().max().unwrap_or(1).max(1);
    usize::BITS - (longest - 1).leading_zeros()
}

/// The voxels `low .. high` of level `level` of a volume.
///
/// Only what they cover is read.
pub fn block(volume: &Volume, level: u32, low: [usize; 3], high: [usize; 3], reduction: Reduction) -> Voxels {
    match &volume.voxels {
        Voxels::U8(v) => Voxels::U8(block_of(v, volume.dims, level, low, high, reduction)),
        Voxels::U16(v) => Voxels::U16(block_of(v, volume.dims, level, low, high, reduction)),
        Voxels::I16(v) => Voxels::I16(block_of(v, volume.dims, level, low, high, reduction)),
        Voxels::F32(v) => Voxels::F32(block_of(v, volume.dims, level, low, high, reduction)),
    }
}

/// A stored voxel. The mean of values of a type, rounded to it, lies between the smallest and
/// the largest: rounding is monotone, and both are values of the type.
trait Stored: Copy + PartialEq + Send + Sync {
    fn wide(self) -> f64;
    fn narrow(mean: f64) -> Self;
}

macro_rules! stored_integer {
    ($($integer:ty),+) => {$(
        impl Stored for $integer {
            fn wide(self) -> f64 {
                self.into()
            }
            fn narrow(mean: f64) -> Self {
                mean.round_ties_even() as $integer
            }
        }
    )+};
}

stored_integer!(u8, u16, i16);

impl Stored for f32 {
    fn wide(self) -> f64 {
        self.into()
    }
    fn narrow(mean: f64) -> Self {
        mean as f32
    }
}

/// Part of a level: the voxels from `low` on, x fastest, of a level of `whole` voxels.
struct Source<'a, T> {
    voxels: &'a [T],
    low: [usize; 3],
    dims: [usize; 3],
    whole: [usize; 3],
}

fn block_of<T: Stored>(
    voxels: &[T],
    dims: [usize; 3],
    level: u32,
    low: [usize; 3],
    high: [usize; 3],
    reduction: Reduction,
) -> Vec<T> {
    if level == 0 {
        return crop(&Source { voxels, low: [0; 3], dims, whole: dims }, low, high);
    }
    let axis_taps: [Vec<Taps>; 3] = std::array::from_fn(|axis| {
        let (fine, coarse) = (level_dims(dims, level - 1)[axis], level_dims(dims, level)[axis]);
        (low[axis]..high[axis]).map(|i| Taps::of(i, fine, coarse)).collect()
    });
    if level == 1 {
        return reduced(&Source { voxels, low: [0; 3], dims, whole: dims }, &axis_taps, reduction);
    }
    // The part of the finer level that is covered.
    let ends = |axis: usize| {
        let (first, last) = (axis_taps[axis].first(), axis_taps[axis].last());
        first.zip(last).map_or((0, 0), |(first, last)| (first.start, last.start + last.count))
    };
    let (fine_low, fine_high) = ([0, 1, 2].map(|a| ends(a).0), [0, 1, 2].map(|a| ends(a).1));
    let finer = block_of(voxels, dims, level - 1, fine_low, fine_high, reduction);
    let extent = [0, 1, 2].map(|axis| fine_high[axis] - fine_low[axis]);
    let whole = level_dims(dims, level - 1);
    reduced(&Source { voxels: &finer, low: fine_low, dims: extent, whole }, &axis_taps, reduction)
}

fn crop<T: Stored>(source: &Source<'_, T>, low: [usize; 3], high: [usize; 3]) -> Vec<T> {
    let mut voxels = Vec::with_capacity((0..3).map(|axis| high[axis] - low[axis]).product());
    for z in low[2]..high[2] {
        for y in low[1]..high[1] {
            let row = (z * source.dims[1] + y) * source.dims[0];
            voxels.extend_from_slice(&source.voxels[row + low[0]..row + high[0]]);
        }
    }
    voxels
}

/// The voxels along one axis that one voxel of the next level covers, and their shares.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Taps {
    start: usize,
    count: usize,
    /// Covered shares of the voxels, times a common factor that makes them whole.
    weights: [f64; MAX_TAPS],
}

/// Most voxels a coarser one, which is at most two long, reaches into along an axis.
const MAX_TAPS: usize = 3;

impl Taps {
    /// Of voxel `index` of `coarse` along an axis of `fine`, `coarse = ceil(fine / 2)`.
    fn of(index: usize, fine: usize, coarse: usize) -> Self {
        // In units of 1 / coarse of a fine voxel, all borders are whole numbers.
        let (from, to) = (index * fine, (index + 1) * fine);
        let start = from / coarse;
        let end = to.div_ceil(coarse);
        let mut weights = [0.0; MAX_TAPS];
        for (voxel, weight) in (start..end).zip(&mut weights) {
            *weight = (to.min((voxel + 1) * coarse) - from.max(voxel * coarse)) as f64;
        }
        Self { start, count: end - start, weights }
    }

    fn weighted(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (self.start..self.start + self.count).zip(self.weights)
    }

    fn total(&self) -> f64 {
        self.weights.iter().sum()
    }
}

/// The voxels whose taps are given, slice by slice on all cores; what each is does not depend on
/// the others.
fn reduced<T: Stored>(source: &Source<'_, T>, taps: &[Vec<Taps>; 3], reduction: Reduction) -> Vec<T> {
    let slices: Vec<Vec<T>> = taps[2]
        .par_iter()
        .map(|z| match reduction {
            Reduction::Mean => slice_of_means(source, [&taps[0], &taps[1]], z),
            Reduction::Majority => slice_of_majorities(source, [&taps[0], &taps[1]], z),
        })
        .collect();
    slices.concat()
}

impl<T: Stored> Source<'_, T> {
    /// Where the row (y, z) of the level begins in the voxels held.
    fn row(&self, y: usize, z: usize) -> usize {
        debug_assert!(y < self.whole[1] && z < self.whole[2]);
        ((z - self.low[2]) * self.dims[1] + y - self.low[1]) * self.dims[0]
    }
}

fn slice_of_means<T: Stored>(source: &Source<'_, T>, [xs, ys]: [&[Taps]; 2], z: &Taps) -> Vec<T> {
    let mut slice = Vec::with_capacity(xs.len() * ys.len());
    let mut sums = vec![0.0; source.dims[0]];
    for y in ys {
        // Rows first, added up in f64: exact for integers.
        sums.fill(0.0);
        for (at_z, weight_z) in z.weighted() {
            for (at_y, weight_y) in y.weighted() {
                let row = source.row(at_y, at_z);
                let weight = weight_y * weight_z;
                for (sum, voxel) in sums.iter_mut().zip(&source.voxels[row..]) {
                    *sum += weight * voxel.wide();
                }
            }
        }
        let rows_total = z.total() * y.total();
        for x in xs {
            let sum: f64 = x.weighted().map(|(at, weight)| weight * sums[at - source.low[0]]).sum();
            slice.push(T::narrow(sum / (rows_total * x.total())));
        }
    }
    slice
}

fn slice_of_majorities<T: Stored>(source: &Source<'_, T>, [xs, ys]: [&[Taps]; 2], z: &Taps) -> Vec<T> {
    let mut slice = Vec::with_capacity(xs.len() * ys.len());
    let mut found: Vec<(T, f64)> = Vec::with_capacity(MAX_TAPS * MAX_TAPS * MAX_TAPS);
    for y in ys {
        for x in xs {
            found.clear();
            for (at_z, weight_z) in z.weighted() {
                for (at_y, weight_y) in y.weighted() {
                    let row = source.row(at_y, at_z);
                    for (at_x, weight_x) in x.weighted() {
                        let voxel = source.voxels[row + at_x - source.low[0]];
                        let weight = weight_x * weight_y * weight_z;
                        match found.iter_mut().find(|(value, _)| *value == voxel) {
                            Some((_, sum)) => *sum += weight,
                            None => found.push((voxel, weight)),
                        }
                    }
                }
            }
            let most =
                found.iter().copied().reduce(|best, other| if other.1 > best.1 { other } else { best });
            slice.extend(most.map(|(value, _)| value));
        }
    }
    slice
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(count: usize, mut value: impl FnMut(u32) -> u16) -> Voxels {
        let mut state = 7u32;
        let next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            value(state >> 8)
        };
        Voxels::U16(std::iter::repeat_with(next).take(count).collect())
    }

    fn level(volume: &Volume, level: u32, reduction: Reduction) -> Volume {
        let dims = level_dims(volume.dims, level);
        Volume::new(dims, block(volume, level, [0; 3], dims, reduction))
    }

    fn mean(voxels: &Voxels) -> f64 {
        (0..voxels.len()).map(|i| f64::from(voxels.stored(i))).sum::<f64>() / voxels.len() as f64
    }

    #[test]
    fn dims_halve_up_to_one_voxel() {
        assert_eq!(level_dims([5, 4, 1], 0), [5, 4, 1]);
        assert_eq!(level_dims([5, 4, 1], 1), [3, 2, 1]);
        assert_eq!(level_dims([5, 4, 1], 3), [1, 1, 1]);
        assert_eq!(level_dims([5, 4, 1], 200), [1, 1, 1]);
        for dims in [[1, 1, 1], [2, 1, 1], [3, 4, 5], [16, 17, 2]] {
            let last = coarsest(dims);
            assert_eq!(level_dims(dims, last), [1, 1, 1], "{dims:?}");
            assert!(last == 0 || level_dims(dims, last - 1) != [1, 1, 1], "{dims:?}");
        }
    }

    #[test]
    fn a_constant_stays_constant() {
        for voxels in [
            Voxels::U8(vec![201; 7 * 5 * 3]),
            Voxels::I16(vec![-1234; 7 * 5 * 3]),
            Voxels::F32(vec![0.1; 7 * 5 * 3]),
        ] {
            let volume = Volume::new([7, 5, 3], voxels);
            for reduction in [Reduction::Mean, Reduction::Majority] {
                for l in 1..=3 {
                    let reduced = level(&volume, l, reduction);
                    let same = |i| reduced.voxels.stored(i) == volume.voxels.stored(0);
                    assert!((0..reduced.voxels.len()).all(same), "{reduction:?} level {l}");
                }
            }
        }
    }

    /// A voxel of a level shows the ramp's value at its own centre, so nothing has moved.
    #[test]
    fn a_ramp_stays_in_place_for_even_and_odd_sizes() {
        for n in [8usize, 9, 31] {
            let ramp = |axis: usize| {
                let at = |i: usize| [i % n, i / n % n, i / (n * n)][axis] as f32 + 0.5;
                Volume::new([n; 3], Voxels::F32((0..n * n * n).map(at).collect()))
            };
            for axis in 0..3 {
                let reduced = level(&ramp(axis), 1, Reduction::Mean);
                let m = reduced.dims[0];
                let edge = n as f64 / m as f64;
                for i in 0..m * m * m {
                    let at = [i % m, i / m % m, i / (m * m)][axis];
                    let centre = (at as f64 + 0.5) * edge;
                    let value = f64::from(reduced.voxels.stored(i));
                    // A fine voxel's own slope is not seen: its value stands for all of it.
                    assert!((value - centre).abs() <= 0.13, "{n}: {value} at {centre}");
                }
                assert!((mean(&reduced.voxels) - 0.5 * n as f64).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn means_and_range_are_kept() {
        for dims in [[16, 16, 16], [17, 9, 33], [1, 40, 3], [1, 1, 1], [2, 1, 64]] {
            let count = dims.iter().product();
            let volume = Volume::new(dims, random(count, |x| 1000 + (x % 50_000) as u16));
            let wide = mean(&volume.voxels);
            for l in 1..=coarsest(dims) {
                let reduced = level(&volume, l, Reduction::Mean);
                assert_eq!(reduced.dims, level_dims(dims, l));
                // Each level rounds each voxel by half a unit at most.
                let error = (mean(&reduced.voxels) - wide).abs();
                assert!(error <= 0.5 * f64::from(l), "{dims:?} level {l}: off by {error}");
                let inside = |i| (1000.0..51_000.0).contains(&reduced.voxels.stored(i));
                assert!((0..reduced.voxels.len()).all(inside));
            }
        }
    }

    #[test]
    fn labels_are_counted_and_never_mixed() {
        // Of eight voxels five are 7; the mean, 5, is no label.
        let volume = Volume::new([2, 2, 2], Voxels::U8(vec![7, 1, 7, 1, 7, 7, 1, 7]));
        assert_eq!(level(&volume, 1, Reduction::Majority).voxels, Voxels::U8(vec![7]));
        // Of equals the first.
        let volume = Volume::new([2, 1, 1], Voxels::U8(vec![9, 3]));
        assert_eq!(level(&volume, 1, Reduction::Majority).voxels, Voxels::U8(vec![9]));
        // Three voxels become two of one and a half: the outer ones cover more.
        let volume = Volume::new([3, 1, 1], Voxels::U8(vec![5, 0, 6]));
        assert_eq!(level(&volume, 1, Reduction::Majority).voxels, Voxels::U8(vec![5, 6]));
        let labels = [0, 3, 4, 250];
        let volume = Volume::new([9, 10, 11], random(990, |x| labels[x as usize % 4]));
        let reduced = level(&volume, 2, Reduction::Majority);
        let known = |i| labels.iter().any(|&label| f32::from(label) == reduced.voxels.stored(i));
        assert!((0..reduced.voxels.len()).all(known));
    }

    #[test]
    fn a_block_equals_that_part_of_the_level() {
        let dims = [21, 14, 9];
        let volume = Volume::new(dims, random(21 * 14 * 9, |x| x as u16));
        for reduction in [Reduction::Mean, Reduction::Majority] {
            for l in 0..=3 {
                let whole = level(&volume, l, reduction);
                let low = whole.dims.map(|n| n / 3);
                let high = whole.dims.map(|n| (n / 3 + 2).min(n));
                let Voxels::U16(part) = block(&volume, l, low, high, reduction) else { panic!() };
                let mut part = part.into_iter();
                for z in low[2]..high[2] {
                    for y in low[1]..high[1] {
                        for x in low[0]..high[0] {
                            let expected = whole.voxels.stored(whole.index(x, y, z));
                            assert_eq!(part.next().map(f32::from), Some(expected), "level {l} {x} {y} {z}");
                        }
                    }
                }
                assert_eq!(part.next(), None);
            }
        }
    }

    #[test]
    fn threads_do_not_matter() {
        let volume = Volume::new([40, 33, 21], random(40 * 33 * 21, |x| x as u16));
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let alone = one.install(|| level(&volume, 2, Reduction::Mean));
        assert_eq!(alone, level(&volume, 2, Reduction::Mean));
    }
}
