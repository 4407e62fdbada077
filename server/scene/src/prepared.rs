//! What an import computes once per volume: range, bins, macrocells, histogram, content hash.

use proto::scene_file::Filter;
use rayon::prelude::*;

use crate::bins::{BIN_COUNT, Bins};
use crate::levels::{Reduction, block, level_dims};
use crate::macrocells::Macrocells;
use crate::part::{Part, Placement, UnitBox, reduction_name};
use crate::volume::{Orientation, Volume, Voxels};

/// Buckets of the display histogram.
pub const HISTOGRAM_BUCKETS: usize = 256;

/// A volume with everything derived from its voxels alone; or a part of one ([`Self::part`]), which
/// keeps the whole volume's range, bins and histogram, so that a transfer function means the same.
#[derive(Debug)]
pub struct PreparedVolume {
    /// The voxels.
    pub volume: Volume,
    /// Where they lie in the whole volume.
    pub placement: Placement,
    /// BLAKE3 of voxels, size, type, slope and intercept: equal content, equal hash.
    pub content: [u8; 32],
    /// Smallest and largest data value of the whole volume.
    pub range: [f64; 2],
    /// Scalar bins of the whole volume.
    pub bins: Bins,
    /// Bin masks of 4^3 blocks of the voxels held.
    pub macrocells: Macrocells,
    /// Share of the macrocells that an edit of each bin touches, 0..1, with linear interpolation.
    pub bin_shares: [f64; BIN_COUNT],
    /// The whole volume's voxels per bucket; [`HISTOGRAM_BUCKETS`] buckets of equal width over
    /// `range`.
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
        let placement = Placement::whole(&volume);
        Self { volume, placement, content, range, bins, macrocells, bin_shares, histogram }
    }

    /// The part of this whole volume that is shown as `region`, the volume if there is none.
    pub fn part(&self, part: &Part, region: Option<UnitBox>, reduction: Reduction) -> Self {
        let whole = &self.volume;
        let level = level_dims(whole.dims, part.level);
        let spacing =
            [0, 1, 2].map(|axis| whole.spacing[axis] * whole.dims[axis] as f64 / level[axis] as f64);
        let origin_of = |orientation: Orientation| {
            // From the centre of the whole volume's first voxel to that of the first one held.
            let offset = [0, 1, 2]
                .map(|axis| (part.low[axis] as f64 + 0.5) * spacing[axis] - 0.5 * whole.spacing[axis]);
            let along = |i: usize| -> f64 {
                (0..3).map(|axis| offset[axis] * orientation.lps_from_grid[axis][i]).sum()
            };
            Orientation { origin: [0, 1, 2].map(|i| orientation.origin[i] + along(i)), ..orientation }
        };
        let volume = Volume {
            dims: part.dims(),
            spacing,
            spacing_unit: whole.spacing_unit.clone(),
            voxels: block(whole, part.level, part.low, part.high, reduction),
            slope: whole.slope,
            intercept: whole.intercept,
            orientation: whole.orientation.map(origin_of),
        };
        Self {
            macrocells: Macrocells::of(&volume, &self.bins, &|_| {}),
            placement: Placement::of(whole, part, region),
            content: self.part_content(part, reduction),
            range: self.range,
            bins: self.bins.clone(),
            bin_shares: self.bin_shares,
            histogram: self.histogram.clone(),
            volume,
        }
    }

    /// The content hash of a part of this whole volume: of what it follows from.
    pub fn part_content(&self, part: &Part, reduction: Reduction) -> [u8; 32] {
        if *part == Part::whole(self.volume.dims) {
            return self.content;
        }
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.content);
        hasher.update(format!("{part:?} {}", reduction_name(part, reduction)).as_bytes());
        *hasher.finalize().as_bytes()
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
