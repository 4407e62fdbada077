//! What the distribution of a volume's values says: where nothing ends and matter begins.

use std::collections::BTreeMap;

use scene::{PreparedVolume, Volume};

/// Most voxels looked at.
const MAX_SAMPLES: usize = 1 << 18;
/// Share of the values at either end that are taken for outliers.
const OUTLIERS: f64 = 0.001;
/// Buckets that a threshold is sought among.
const BUCKETS: usize = 256;
/// A smallest value is padding if it is this common...
const PADDING_SHARE: f64 = 0.01;
/// ...and this far from the next, as a share of the range.
const PADDING_GAP: f64 = 0.1;
/// Matter that fills more than this share of the volume hides itself: the threshold is raised.
const MAX_MATTER_SHARE: f64 = 0.7;
/// How often the threshold is raised at most.
const MAX_RAISES: usize = 2;
/// The dense part is between these shares of the matter.
const DENSE_SHARE: [f64; 2] = [0.03, 0.35];
/// More distinct values than these on the faces of a volume are not looked at.
const MAX_SURROUNDINGS: usize = 1 << 16;
/// Data values of evenly spread voxels, ascending.
pub(super) fn sorted_values(prepared: &PreparedVolume) -> Vec<f64> {
    let volume = &prepared.volume;
    let count = volume.voxels.len();
    let layer = volume.dims[0] * volume.dims[1];
    // A stride without a common factor with the layer size visits every column.
    let mut stride = count.div_ceil(MAX_SAMPLES).max(1);
    while stride > 1 && greatest_common_divisor(stride, layer) > 1 {
        stride += 1;
    }
    let value = |index| volume.slope * f64::from(volume.voxels.stored(index)) + volume.intercept;
    let mut values: Vec<f64> = (0..count).step_by(stride).map(value).collect();
    values.sort_by(f64::total_cmp);
    values
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// The distinct values, unless there are more than `most`.
pub(super) fn distinct(sorted: &[f64], most: usize) -> Option<Vec<f64>> {
    let mut found: Vec<f64> = Vec::new();
    for &value in sorted {
        if found.last() != Some(&value) {
            if found.len() == most {
                return None;
            }
            found.push(value);
        }
    }
    Some(found)
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get((share * last as f64).round() as usize).copied().unwrap_or(0.0)
}

/// The part of ascending values that lies above a threshold.
fn above(sorted: &[f64], threshold: f64) -> &[f64] {
    &sorted[sorted.partition_point(|&value| value <= threshold)..]
}

/// Otsu's threshold of ascending values: the value that maximises the variance between the two
/// parts, sought among equal steps between the outliers. `None` if the values are all alike.
fn otsu(sorted: &[f64]) -> Option<f64> {
    let (low, high) = (quantile(sorted, OUTLIERS), quantile(sorted, 1.0 - OUTLIERS));
    if high <= low {
        return None;
    }
    let edge = |bucket: usize| low + (high - low) * bucket as f64 / BUCKETS as f64;
    let total = sorted.len() as f64;
    let sum: f64 = sorted.iter().map(|value| value.clamp(low, high)).sum();
    let (mut best, mut thresholds) = (0.0, Vec::new());
    let (mut below, mut sum_below) = (0, 0.0);
    for bucket in 1..BUCKETS {
        let end = sorted.partition_point(|&value| value <= edge(bucket));
        sum_below += sorted[below..end].iter().map(|value| value.clamp(low, high)).sum::<f64>();
        below = end;
        let weight = below as f64;
        if weight == 0.0 || weight == total {
            continue;
        }
        let difference = sum_below / weight - (sum - sum_below) / (total - weight);
        let variance = weight * (total - weight) * difference * difference;
        // Between two separate lumps every threshold is as good: the middle one is taken.
        if variance > best * (1.0 + 1e-9) {
            best = variance;
            thresholds.clear();
        }
        if variance >= best * (1.0 - 1e-9) {
            thresholds.push(edge(bucket));
        }
    }
    thresholds.get(thresholds.len() / 2).copied()
}

/// Where nothing ends, where the body lies, and where the dense part begins; data values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Parts {
    pub low: f64,
    pub air_end: f64,
    pub body: f64,
    pub dense: f64,
    pub high: f64,
    /// Share of all voxels that are matter.
    pub matter_share: f64,
}

pub(super) fn parts(sorted: &[f64]) -> Option<Parts> {
    let inside = without_padding(sorted);
    let mut air_end = otsu(inside)?;
    for _ in 0..MAX_RAISES {
        let matter = above(inside, air_end);
        if (matter.len() as f64) <= MAX_MATTER_SHARE * inside.len() as f64 {
            break;
        }
        match otsu(matter) {
            Some(raised) => air_end = raised,
            None => break,
        }
    }
    let matter = above(inside, air_end);
    let [least, most] = DENSE_SHARE.map(|share| quantile(matter, 1.0 - share));
    let dense = otsu(matter).unwrap_or(least).clamp(most.min(least), least.max(most));
    let high = quantile(inside, 1.0 - OUTLIERS).max(dense);
    Some(Parts {
        low: quantile(inside, OUTLIERS).min(air_end),
        air_end,
        body: quantile(matter, 0.5).min(dense),
        dense,
        high,
        matter_share: matter.len() as f64 / sorted.len() as f64,
    })
}

/// Scanners fill what they did not see with one value far below everything else.
fn without_padding(sorted: &[f64]) -> &[f64] {
    let [Some(&low), Some(&high)] = [sorted.first(), sorted.last()] else {
        return sorted;
    };
    let rest = above(sorted, low);
    let padded = (sorted.len() - rest.len()) as f64 > PADDING_SHARE * sorted.len() as f64;
    match rest.first() {
        Some(&next) if padded && next - low > PADDING_GAP * (high - low) && distinct(rest, 2).is_none() => {
            rest
        }
        _ => sorted,
    }
}

/// The one value that most of the volume's outermost voxels have; scans, which have noise, have
/// none.
pub(super) fn surroundings(volume: &Volume) -> Option<f64> {
    let [nx, ny, nz] = volume.dims;
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    let mut total = 0;
    for z in 0..nz {
        for y in 0..ny {
            let inner = z > 0 && z + 1 < nz && y > 0 && y + 1 < ny;
            let step = if inner { (nx - 1).max(1) } else { 1 };
            for x in (0..nx).step_by(step) {
                let stored = volume.voxels.stored(volume.index(x, y, z));
                *counts.entry(stored.to_bits()).or_default() += 1;
                total += 1;
                if counts.len() > MAX_SURROUNDINGS {
                    return None;
                }
            }
        }
    }
    let (bits, count) = counts.into_iter().max_by_key(|(_, count)| *count)?;
    (2 * count > total).then(|| volume.slope * f64::from(f32::from_bits(bits)) + volume.intercept)
}
