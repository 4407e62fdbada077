//! Label volumes: few whole values, each of which names a kind of matter.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::volume::{Volume, Voxels};

/// Volumes with more distinct values are no label volumes.
pub const MAX_LABELS: usize = 64;
/// Volumes with at most this many whole values always are: no scan has so few.
const SURELY_LABELS: usize = 12;
/// Of more labels, neighbours within the matter are equal at least this often: labels fill regions...
const MIN_EQUAL_SHARE: f64 = 0.6;
/// ...and unequal neighbours are next to each other in order at most this often: what varies
/// smoothly passes through every value on its way.
const MAX_NEXT_SHARE: f64 = 0.8;
/// Rows that neighbours are looked for in, at most.
const MAX_ROWS: usize = 1 << 14;
/// Voxels one thread looks at in one go.
const CHUNK: usize = 1 << 16;

/// A label and its voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Label {
    /// Data value; whole.
    pub value: f64,
    /// Voxels that have it.
    pub count: u64,
}

/// The labels of a label volume, ascending; `None` if it is none.
pub fn labels(volume: &Volume) -> Option<Vec<Label>> {
    let mut found = match &volume.voxels {
        Voxels::U8(v) => distinct(v),
        Voxels::U16(v) => distinct(v),
        Voxels::I16(v) => distinct(v),
        Voxels::F32(v) => distinct(v),
    }?;
    for label in &mut found {
        label.value = volume.slope * label.value + volume.intercept;
    }
    found.sort_by(|a, b| a.value.total_cmp(&b.value));
    let whole = found.iter().all(|label| label.value.fract() == 0.0);
    let named = found.len() > 1 && whole && (found.len() <= SURELY_LABELS || fills_regions(volume, &found));
    named.then_some(found)
}

/// The label of what lies around the others: 0, or without it the most common one.
pub fn around(labels: &[Label]) -> Option<f64> {
    let zero = labels.iter().find(|label| label.value == 0.0);
    zero.or_else(|| labels.iter().max_by_key(|label| label.count)).map(|label| label.value)
}

/// Distinct stored values with their counts, unless there are too many.
fn distinct<T: Copy + PartialEq + Into<f64> + Sync>(voxels: &[T]) -> Option<Vec<Label>> {
    let too_many = AtomicBool::new(false);
    let add = |found: &mut Vec<Label>, value: f64, count: u64| {
        match found.iter_mut().find(|label| label.value == value) {
            Some(label) => label.count += count,
            None => found.push(Label { value, count }),
        }
        if found.len() > MAX_LABELS {
            too_many.store(true, Ordering::Relaxed);
        }
    };
    let found = voxels
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut found = Vec::new();
            for run in chunk.chunk_by(|a, b| a == b) {
                if too_many.load(Ordering::Relaxed) {
                    break;
                }
                add(&mut found, run[0].into(), run.len() as u64);
            }
            found
        })
        .reduce(Vec::new, |mut all, found| {
            found.into_iter().for_each(|label| add(&mut all, label.value, label.count));
            all
        });
    (!too_many.into_inner()).then_some(found)
}

/// Whether equal values lie together, and unequal neighbours differ by more than one step of a
/// smooth field.
fn fills_regions(volume: &Volume, labels: &[Label]) -> bool {
    let around = around(labels);
    let [nx, ny, nz] = volume.dims;
    let rank = |value: f64| labels.partition_point(|label| label.value < value);
    let (mut equal, mut within, mut unequal, mut next) = (0u64, 0u64, 0u64, 0u64);
    let rows = ny * nz;
    // A stride without a common factor with the rows of a slice visits all of them.
    let mut stride = rows.div_ceil(MAX_ROWS);
    while stride > 1 && ny.is_multiple_of(stride) {
        stride += 1;
    }
    for row in (0..rows).step_by(stride) {
        let (y, z) = (row % ny, row / ny);
        for x in 0..nx {
            let value = volume.value(x, y, z);
            for [x, y, z] in [[x + 1, y, z], [x, y + 1, z], [x, y, z + 1]] {
                if x == nx || y == ny || z == nz {
                    continue;
                }
                let other = volume.value(x, y, z);
                if value != other {
                    unequal += 1;
                    next += u64::from(rank(value).abs_diff(rank(other)) == 1);
                }
                if Some(value) != around && Some(other) != around {
                    within += 1;
                    equal += u64::from(value == other);
                }
            }
        }
    }
    let mostly_equal = within > 0 && equal as f64 >= MIN_EQUAL_SHARE * within as f64;
    mostly_equal && next as f64 <= MAX_NEXT_SHARE * unequal as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const EDGE: usize = 40;

    fn volume(value: impl Fn([f64; 3]) -> f64) -> Volume {
        let at = |i: usize| [i % EDGE, i / EDGE % EDGE, i / EDGE / EDGE].map(|i| i as f64 / EDGE as f64);
        Volume::new([EDGE; 3], Voxels::F32((0..EDGE.pow(3)).map(|i| value(at(i)) as f32).collect()))
    }

    fn values(volume: &Volume) -> Option<Vec<f64>> {
        Some(labels(volume)?.into_iter().map(|label| label.value).collect())
    }

    /// Cells of a lattice, each with a label of its own, in disorder.
    fn atlas([x, y, z]: [f64; 3]) -> f64 {
        let cell = [x, y, z].map(|x| (x * 4.0) as usize);
        ((cell[0] + 4 * cell[1] + 16 * cell[2]) * 29 % 60) as f64
    }

    #[test]
    fn masks_and_atlases_are_label_volumes() {
        assert_eq!(values(&volume(|[x, ..]| f64::from(u8::from(x > 0.5)) * 255.0)), Some(vec![0.0, 255.0]));
        assert_eq!(values(&volume(atlas)).map(|found| found.len()), Some(60));
        let count: u64 = labels(&volume(atlas)).unwrap().iter().map(|label| label.count).sum();
        assert_eq!(count, (EDGE as u64).pow(3));
        let mut scaled = volume(atlas);
        scaled.slope = -2.0;
        scaled.intercept = 1.0;
        assert_eq!(values(&scaled).map(|found| (found[0], found[59])), Some((-117.0, 1.0)));
    }

    #[test]
    fn scans_and_fields_of_few_values_are_not() {
        let radius = |p: [f64; 3]| p.map(|x| (x - 0.5).powi(2)).iter().sum::<f64>().sqrt();
        assert_eq!(values(&volume(|p| (40.0 * radius(p)).floor())), None, "a smooth field in steps");
        let noise = |[x, y, z]: [f64; 3]| {
            ((x * 7919.0 + y * 104_729.0 + z * 1_299_709.0).sin() * 43_758.0).fract().abs()
        };
        assert_eq!(values(&volume(|p| (30.0 * noise(p)).floor())), None, "noise");
        assert_eq!(values(&volume(|p| 0.5 * atlas(p))), None, "values that are not whole");
        assert_eq!(values(&volume(|[x, y, z]| (x + 40.0 * y + 1600.0 * z) * 40.0)), None, "too many");
        assert_eq!(values(&volume(|_| 3.0)), None, "one value");
        let column = Volume::new([1, 1, 50], Voxels::U8((0..50).map(|i| i * 5).collect()));
        assert_eq!(values(&column), None, "each value once");
    }

    #[test]
    fn zero_lies_around_the_others_else_what_is_most_common() {
        let label = |value: f64, count| Label { value, count };
        assert_eq!(around(&[label(-1.0, 9), label(0.0, 1), label(2.0, 5)]), Some(0.0));
        assert_eq!(around(&[label(1.0, 3), label(4.0, 7), label(9.0, 2)]), Some(4.0));
        assert_eq!(around(&[]), None);
    }
}
