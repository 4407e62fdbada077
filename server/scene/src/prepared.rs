//! What an import computes once per volume: range, bins, macrocells, histogram, content hash.

use proto::scene_file::Filter;
use rayon::prelude::*;

use crate::bins::{BIN_COUNT, Bins};
use crate::macrocells::Macrocells;
use crate::volume::{Volume, Voxels};

/// Buckets of the display histogram.
pub const HISTOGRAM_BUCKETS: usize = 256;

/// A volume with everything derived from its voxels alone.
#[derive(Debug)]
pub struct PreparedVolume {
    /// The voxels.
    pub volume: Volume,
    /// BLAKE3 of voxels, size, type, slope and intercept: equal content, equal hash.
    pub content: [u8; 32],
    /// Smallest and largest data value.
    pub range: [f64; 2],
    /// Scalar bins.
    pub bins: Bins,
    /// Bin masks of 4^3 blocks.
    pub macrocells: Macrocells,
    /// Share of the macrocells that an edit of each bin touches, 0..1, with linear interpolation.
    pub bin_shares: [f64; BIN_COUNT],
    /// Voxels per bucket; [`HISTOGRAM_BUCKETS`] buckets of equal width over `range`.
    pub histogram: Vec<u64>,
}

impl PreparedVolume {
    /// Scans the volume on all cores; `progress` is called with 0..1 from several threads.
    pub fn new(volume: Volume, progress: &(dyn Fn(f32) + Sync)) -> Self {
        let range = data_range(&volume);
        progress(0.1);
        let bins = Bins::of(&volume, range);
        progress(0.3);
        let histogram = histogram(&volume, range);
        progress(0.5);
        let macrocells = Macrocells::of(&volume, &bins, &|share| progress(0.5 + 0.4 * share));
        let bin_shares = macrocells.shares(Filter::Linear);
        let content = content_hash(&volume);
        progress(1.0);
        Self { volume, content, range, bins, macrocells, bin_shares, histogram }
    }

    /// The content hash as 64 hexadecimal digits.
    pub fn content_hex(&self) -> String {
        blake3::Hash::from_bytes(self.content).to_hex().to_string()
    }
}

fn stored_range<T: Copy + PartialOrd + Send + Sync>(values: &[T]) -> Option<(T, T)> {
    let wider = |a: (T, T), b: (T, T)| (if b.0 < a.0 { b.0 } else { a.0 }, if b.1 > a.1 { b.1 } else { a.1 });
    values.par_iter().map(|&x| (x, x)).reduce_with(wider)
}

fn data_range(volume: &Volume) -> [f64; 2] {
    let stored: Option<(f64, f64)> = match &volume.voxels {
        Voxels::U8(v) => stored_range(v).map(|(a, b)| (a.into(), b.into())),
        Voxels::U16(v) => stored_range(v).map(|(a, b)| (a.into(), b.into())),
        Voxels::I16(v) => stored_range(v).map(|(a, b)| (a.into(), b.into())),
        Voxels::F32(v) => stored_range(v).map(|(a, b)| (a.into(), b.into())),
    };
    let (low, high) = stored.unwrap_or((0.0, 0.0));
    let ends = [low, high].map(|x| volume.slope * x + volume.intercept);
    [ends[0].min(ends[1]), ends[0].max(ends[1])]
}

/// The bucket of a stored value, of [`HISTOGRAM_BUCKETS`] of equal width over data values.
pub(crate) fn bucket_of(volume: &Volume, [low, high]: [f64; 2]) -> impl Fn(f32) -> usize + Sync {
    let scale = if high > low { HISTOGRAM_BUCKETS as f64 / (high - low) } else { 0.0 };
    let (slope, intercept) = (volume.slope, volume.intercept);
    move |stored| {
        let value = slope * f64::from(stored) + intercept;
        (((value - low) * scale) as usize).min(HISTOGRAM_BUCKETS - 1)
    }
}

/// Counts of two parts as counts of both.
pub(crate) fn add_counts(mut a: Vec<u64>, b: Vec<u64>) -> Vec<u64> {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
    a
}

fn histogram(volume: &Volume, range: [f64; 2]) -> Vec<u64> {
    let bucket = bucket_of(volume, range);
    let count = volume.voxels.len();
    let chunk = 1 << 18;
    (0..count.div_ceil(chunk))
        .into_par_iter()
        .map(|i| {
            let mut counts = vec![0u64; HISTOGRAM_BUCKETS];
            for index in i * chunk..((i + 1) * chunk).min(count) {
                counts[bucket(volume.voxels.stored(index))] += 1;
            }
            counts
        })
        .reduce(|| vec![0; HISTOGRAM_BUCKETS], add_counts)
}

fn content_hash(volume: &Volume) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(format!("{:?} {:?}", volume.voxels.voxel_type(), volume.dims).as_bytes());
    hasher.update(&volume.slope.to_le_bytes());
    hasher.update(&volume.intercept.to_le_bytes());
    match &volume.voxels {
        Voxels::U8(v) => hasher.update(v),
        Voxels::U16(v) => hasher.update(bytemuck::cast_slice(v)),
        Voxels::I16(v) => hasher.update(bytemuck::cast_slice(v)),
        Voxels::F32(v) => hasher.update(bytemuck::cast_slice(v)),
    };
    *hasher.finalize().as_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_and_histogram_are_in_data_values() {
        let mut volume = Volume::new([2, 2, 1], Voxels::I16(vec![-10, 0, 0, 10]));
        volume.slope = 2.0;
        volume.intercept = 5.0;
        let prepared = PreparedVolume::new(volume.clone(), &|_| {});
        assert_eq!(prepared.range, [-15.0, 25.0]);
        assert_eq!((prepared.histogram[0], prepared.histogram[255]), (1, 1));
        assert_eq!(prepared.histogram.iter().sum::<u64>(), 4);
        let same = PreparedVolume::new(volume.clone(), &|_| {});
        assert_eq!(prepared.content, same.content);
        volume.slope = 3.0;
        assert_ne!(prepared.content, PreparedVolume::new(volume, &|_| {}).content);
    }
}
