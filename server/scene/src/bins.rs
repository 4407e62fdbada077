//! 64 scalar bins over the data's own values: the alphabet of every historygram.
//!
//! Edges are chosen at import by equal population, so that air and outliers do not eat them: a
//! value that alone holds more than its share (air) gets a bin of its own, and the other bins
//! share the rest. Bins are a property of the data, not of the window, so a window edit is an
//! edit like any other.

use rayon::prelude::*;

use crate::volume::{Volume, Voxels};

/// Number of bins; a set of bins is a `u64`.
pub const BIN_COUNT: usize = 64;

/// Most values looked at to place the edges of float data; a stride spreads them over the volume.
const MAX_SORTED_VALUES: usize = 1 << 20;

/// Bin edges in data values.
#[derive(Debug, Clone, PartialEq)]
pub struct Bins {
    /// `edges[i] .. edges[i + 1]` is bin `i`; ascending; the first is the smallest value of the
    /// data, the last its largest. With fewer distinct values than bins the bins at the end have both
    /// edges at the largest value; only the last of them holds any (that value).
    pub edges: [f64; BIN_COUNT + 1],
}

impl Bins {
    /// Bins of a volume's data values; `range` is the smallest and largest of them.
    pub fn of(volume: &Volume, range: [f64; 2]) -> Self {
        let mut values = stored_value_counts(&volume.voxels);
        if volume.slope < 0.0 {
            values.reverse();
        }
        let total: u64 = values.iter().map(|&(_, count)| count).sum();
        let data_value = |stored: f64| volume.slope * stored + volume.intercept;
        let mut edges = [range[1]; BIN_COUNT + 1];
        edges[0] = range[0];
        // Close a bin as soon as it holds its share of what is left.
        let (mut bin, mut in_bin, mut left) = (0, 0, total);
        for pair in values.windows(2) {
            let [(value, count), (next, _)] = [pair[0], pair[1]];
            in_bin += count;
            let bins_left = (BIN_COUNT - bin) as u64;
            if in_bin * bins_left >= left && bin + 1 < BIN_COUNT {
                bin += 1;
                // Halfway, so that interpolation noise around a common value stays in its bin.
                edges[bin] = (0.5 * (data_value(value) + data_value(next))).clamp(range[0], range[1]);
                left -= in_bin;
                in_bin = 0;
            }
        }
        Self { edges }
    }

    /// The bin a data value lies in; values outside the data's range belong to the outer bins.
    pub fn bin(&self, value: f64) -> usize {
        // Interior edges at or below the value.
        self.edges[1..BIN_COUNT].partition_point(|&edge| edge <= value)
    }

    /// All bins an interval of data values touches.
    pub fn mask_of_interval(&self, low: f64, high: f64) -> u64 {
        let (first, last) = (self.bin(low), self.bin(high));
        let up_to_last = u64::MAX >> (BIN_COUNT - 1 - last);
        up_to_last & (u64::MAX << first)
    }

    /// Data values of a bin, closed on both sides.
    pub fn interval(&self, bin: usize) -> [f64; 2] {
        [self.edges[bin], self.edges[bin + 1]]
    }
}

/// Distinct stored values, ascending, with how often they occur (of a strided subset for floats).
fn stored_value_counts(voxels: &Voxels) -> Vec<(f64, u64)> {
    match voxels {
        Voxels::U8(v) => integer_counts(v, 1 << 8, |x| usize::from(*x), |i| i as f64),
        Voxels::U16(v) => integer_counts(v, 1 << 16, |x| usize::from(*x), |i| i as f64),
        Voxels::I16(v) => {
            let offset = -i32::from(i16::MIN);
            integer_counts(
                v,
                1 << 16,
                |x| (i32::from(*x) + offset) as usize,
                |i| i as f64 - f64::from(offset),
            )
        }
        Voxels::F32(v) => {
            let stride = v.len().div_ceil(MAX_SORTED_VALUES).max(1);
            let mut values: Vec<f32> = v.iter().copied().step_by(stride).collect();
            values.par_sort_unstable_by(f32::total_cmp);
            let mut counts: Vec<(f64, u64)> = Vec::new();
            for value in values {
                match counts.last_mut() {
                    Some((last, count)) if *last == f64::from(value) => *count += 1,
                    _ => counts.push((f64::from(value), 1)),
                }
            }
            counts
        }
    }
}

fn integer_counts<T: Sync>(
    values: &[T],
    size: usize,
    index: impl Fn(&T) -> usize + Sync,
    value: impl Fn(usize) -> f64,
) -> Vec<(f64, u64)> {
    let counts = values
        .par_chunks(1 << 18)
        .map(|chunk| {
            let mut counts = vec![0u64; size];
            for x in chunk {
                counts[index(x)] += 1;
            }
            counts
        })
        .reduce(
            || vec![0; size],
            |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                a
            },
        );
    let occurring = counts.into_iter().enumerate().filter(|&(_, count)| count > 0);
    occurring.map(|(i, count)| (value(i), count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn air_does_not_eat_the_bins() {
        let mut values = vec![0u16; 100_000];
        values.extend((0..10_000u16).map(|i| 1000 + i % 1000));
        let bins = Bins::of(&Volume::new([values.len(), 1, 1], Voxels::U16(values)), [0.0, 1999.0]);
        assert_eq!(bins.bin(0.0), 0);
        assert_eq!(bins.bin(1000.0), 1, "air has a bin of its own");
        assert_eq!(bins.bin(1999.0), 63, "the last bin is reached");
        let populated = (0..64).filter(|&b| bins.edges[b] < bins.edges[b + 1]).count();
        assert_eq!(populated, 64);
    }

    #[test]
    fn few_values_and_one_value_work() {
        let bins = Bins::of(&Volume::new([4, 1, 1], Voxels::U8(vec![0, 3, 3, 9])), [0.0, 9.0]);
        assert_eq!([0.0, 3.0, 9.0].map(|v| bins.bin(v)), [0, 1, 63.min(bins.bin(9.0))]);
        assert!(bins.bin(3.0) != bins.bin(9.0));
        let one = Bins::of(&Volume::new([2, 1, 1], Voxels::F32(vec![5.0, 5.0])), [5.0, 5.0]);
        assert_eq!(one.mask_of_interval(5.0, 5.0).count_ones(), 1);
    }

    #[test]
    fn negative_slope_keeps_edges_ascending() {
        let mut volume = Volume::new([4, 1, 1], Voxels::U8(vec![0, 10, 20, 30]));
        volume.slope = -1.0;
        let bins = Bins::of(&volume, [-30.0, 0.0]);
        assert!(bins.edges.windows(2).all(|pair| pair[0] <= pair[1]));
        assert!(bins.bin(-30.0) < bins.bin(-20.0) && bins.bin(-10.0) < bins.bin(0.0));
    }

    #[test]
    fn masks_are_contiguous_and_exact() {
        let values: Vec<f32> = (0..6400).map(|i| i as f32).collect();
        let bins = Bins::of(&Volume::new([6400, 1, 1], Voxels::F32(values)), [0.0, 6399.0]);
        let mask = bins.mask_of_interval(250.0, 899.0);
        for bin in 0..BIN_COUNT {
            let [low, high] = bins.interval(bin);
            let touches = low <= 899.0 && (high > 250.0 || bin == 63);
            assert_eq!(mask >> bin & 1 == 1, touches, "bin {bin} {low}..{high}");
        }
    }
}
