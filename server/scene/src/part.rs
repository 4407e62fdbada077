//! What is shown of a volume that does not fit: a level of the whole, or a region of it in as fine
//! a level as fits.

use proto::scene_file::{Filter, VolumeSource};

use crate::levels::{Reduction, coarsest, level_dims};
use crate::volume::Volume;

/// Voxels around a region that are kept with it: a gradient at its border is the difference of
/// two samples one voxel off, each interpolated with its neighbour.
const APRON: usize = 2;

/// Lower and upper corner in 0..1 volume coordinates.
pub type UnitBox = [[f64; 3]; 2];

/// Everything.
pub const WHOLE: UnitBox = [[0.0; 3], [1.0; 3]];

/// What a scene asks to see of its volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wish {
    /// Finest level wanted; 0 is full resolution.
    pub level: u32,
    /// The part wanted; its edges are longer than 0.
    pub region: Option<UnitBox>,
    /// How it will be sampled.
    pub filter: Filter,
}

impl Wish {
    /// Of a checked scene file's volume.
    pub fn of(source: &VolumeSource) -> Self {
        Self { level: source.level.unwrap_or(0), region: source.region, filter: source.filter }
    }

    /// Whether both ask for the same voxels of a volume of which `level` is shown.
    pub fn same_voxels(&self, other: &Self, level: u32) -> bool {
        // At full resolution nothing is reduced, however it is sampled.
        let filter = if level == 0 { other.filter } else { self.filter };
        Self { filter, ..*self } == *other
    }
}

/// What a device can hold of one volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// Voxels along an axis.
    pub max_edge: usize,
    /// Bytes of a texture.
    pub max_bytes: u64,
}

impl Room {
    /// Whether so many voxels fit.
    pub fn holds(&self, dims: [usize; 3], texel_bytes: u64) -> bool {
        dims.iter().all(|&n| n <= self.max_edge) && bytes_of(dims, texel_bytes) <= self.max_bytes
    }
}

/// Bytes of a texture.
pub fn bytes_of(dims: [usize; 3], texel_bytes: u64) -> u64 {
    dims.iter().fold(texel_bytes, |bytes, &n| bytes.saturating_mul(n as u64))
}

/// A box of voxels of one level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Part {
    /// The level; 0 is full resolution.
    pub level: u32,
    /// First voxel of the level.
    pub low: [usize; 3],
    /// The voxel beyond the last.
    pub high: [usize; 3],
}

impl Part {
    /// All voxels of a volume.
    pub fn whole(dims: [usize; 3]) -> Self {
        Self { level: 0, low: [0; 3], high: dims }
    }

    /// Voxels along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.high[axis] - self.low[axis])
    }

    /// A region of a volume of `dims` at a level, with what its borders need.
    pub fn of_region(dims: [usize; 3], level: u32, region: Option<UnitBox>) -> Self {
        let dims = level_dims(dims, level);
        let Some([low, high]) = region else {
            return Self { level, low: [0; 3], high: dims };
        };
        let at = |unit: f64, n: usize| unit.clamp(0.0, 1.0) * n as f64;
        Self {
            level,
            low: [0, 1, 2].map(|axis| {
                (at(low[axis], dims[axis]).floor() as usize).min(dims[axis] - 1).saturating_sub(APRON)
            }),
            high: [0, 1, 2]
                .map(|axis| ((at(high[axis], dims[axis]).ceil() as usize).max(1) + APRON).min(dims[axis])),
        }
    }
}

/// The finest part at or above the level of the wish that fits; one voxel if nothing larger does.
pub fn choose(dims: [usize; 3], texel_bytes: u64, wish: &Wish, room: &Room) -> Part {
    let last = coarsest(dims);
    (wish.level.min(last)..last)
        .map(|level| Part::of_region(dims, level, wish.region))
        .find(|part| room.holds(part.dims(), texel_bytes))
        .unwrap_or_else(|| Part::of_region(dims, last, wish.region))
}

/// Where the voxels held lie in the volume they are a part of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Voxels of the whole volume at full resolution.
    pub whole_dims: [usize; 3],
    /// Edges of a voxel at full resolution.
    pub whole_spacing: [f64; 3],
    /// Level of the voxels held.
    pub level: u32,
    /// The box of the voxels held.
    pub held: UnitBox,
    /// The box that is shown of it: what lies beyond serves interpolation only.
    pub shown: UnitBox,
}

impl Placement {
    /// The volume itself.
    pub fn whole(volume: &Volume) -> Self {
        Self { whole_dims: volume.dims, whole_spacing: volume.spacing, level: 0, held: WHOLE, shown: WHOLE }
    }

    /// A part of a volume.
    pub(crate) fn of(volume: &Volume, part: &Part, region: Option<UnitBox>) -> Self {
        let dims = level_dims(volume.dims, part.level);
        let unit = |corner: [usize; 3]| [0, 1, 2].map(|axis| corner[axis] as f64 / dims[axis] as f64);
        Self {
            level: part.level,
            held: [unit(part.low), unit(part.high)],
            shown: region.unwrap_or(WHOLE),
            ..Self::whole(volume)
        }
    }

    /// Whether this is the volume itself, all of it at full resolution.
    pub fn is_whole(&self) -> bool {
        self.level == 0 && self.held == WHOLE && self.shown == WHOLE
    }

    /// Coordinates 0..1 of the whole volume as those of the box held.
    pub fn held_from_whole(&self, unit: [f64; 3]) -> [f64; 3] {
        let [low, high] = self.held;
        [0, 1, 2].map(|axis| (unit[axis] - low[axis]) / (high[axis] - low[axis]))
    }
}

/// How the reduction of a part is named in its content: not at all where nothing is reduced.
pub(crate) fn reduction_name(part: &Part, reduction: Reduction) -> &'static str {
    match (part.level, reduction) {
        (0, _) => "as stored",
        (_, Reduction::Mean) => "mean",
        (_, Reduction::Majority) => "majority",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Wish = Wish { level: 0, region: None, filter: Filter::Linear };

    fn room(max_edge: usize, max_bytes: u64) -> Room {
        Room { max_edge, max_bytes }
    }

    #[test]
    fn the_finest_level_that_fits_is_chosen() {
        let dims = [512, 512, 360];
        let full = 512 * 512 * 360 * 2;
        let level = |wish: &Wish, room: Room| choose(dims, 2, wish, &room).level;
        assert_eq!(choose(dims, 2, &ALL, &room(2048, full)), Part::whole(dims));
        assert_eq!(level(&ALL, room(2048, full - 1)), 1);
        assert_eq!(level(&ALL, room(511, full)), 1, "an edge is too long");
        assert_eq!(level(&ALL, room(2048, full / 8)), 1);
        assert_eq!(level(&ALL, room(2048, full / 8 - 1)), 2);
        assert_eq!(choose(dims, 2, &ALL, &room(2048, 0)).dims(), [1, 1, 1], "never nothing");
        assert_eq!(level(&Wish { level: 3, ..ALL }, room(2048, full)), 3, "as asked");
        assert_eq!(level(&Wish { level: 1, ..ALL }, room(100, full)), 3, "as asked, and fits");
        assert_eq!(choose([1, 1, 1], 4, &Wish { level: 9, ..ALL }, &room(1, 4)), Part::whole([1, 1, 1]));
        assert_eq!(choose([usize::MAX >> 20, 1, 1], 4, &ALL, &room(16, 64)).dims(), [16, 1, 1]);
    }

    #[test]
    fn a_region_is_shown_finer_than_the_whole() {
        let dims = [256, 256, 256];
        let region = Some([[0.25, 0.25, 0.25], [0.5, 0.5, 0.5]]);
        let wish = Wish { region, ..ALL };
        let room = room(2048, 100 * 100 * 100);
        assert_eq!(choose(dims, 1, &ALL, &room).level, 2);
        let part = choose(dims, 1, &wish, &room);
        assert_eq!(part, Part { level: 0, low: [62; 3], high: [130; 3] });
        let small = Room { max_bytes: 68 * 68 * 68 - 1, ..room };
        assert_eq!(choose(dims, 1, &wish, &small), Part { level: 1, low: [30; 3], high: [66; 3] });
    }

    #[test]
    fn regions_stay_in_the_volume_and_hold_a_voxel() {
        for region in [
            [[0.0; 3], [1.0; 3]],
            [[0.0; 3], [1e-9; 3]],
            [[1.0 - 1e-9; 3], [1.0; 3]],
            [[0.499; 3], [0.501; 3]],
        ] {
            for dims in [[1, 1, 1], [3, 200, 7]] {
                for level in 0..9 {
                    let part = Part::of_region(dims, level, Some(region));
                    let level_dims = level_dims(dims, level);
                    for (axis, n) in level_dims.into_iter().enumerate() {
                        assert!(part.low[axis] < part.high[axis] && part.high[axis] <= n, "{part:?}");
                        let [low, high] = region.map(|corner| corner[axis] * n as f64);
                        assert!(part.low[axis] as f64 <= low && part.high[axis] as f64 >= high);
                    }
                }
            }
        }
    }

    #[test]
    fn another_filter_is_another_reduction_but_of_nothing() {
        let labels = Wish { filter: Filter::Nearest, ..ALL };
        assert!(ALL.same_voxels(&labels, 0));
        assert!(!ALL.same_voxels(&labels, 1));
        assert!(!ALL.same_voxels(&Wish { level: 1, ..ALL }, 0));
    }
}
