//! Axis order and directions: from the file's axes to the closest LPS, by permutation and flips.
//!
//! World axis `w` takes file axis `permutation[w]`, reversed where `flip[w]`. Of the six
//! permutations the one with the largest sum of |cos| between axes and LPS directions wins, the
//! earlier one in [`PERMUTATIONS`] on a tie; what remains oblique stays in the [`Orientation`].

use scene::{Orientation, Volume, Voxels};

use crate::error::FormatError;
use crate::reorder::{Axes, reorder_voxels};

/// Smallest and largest edge of a voxel, in the file's unit. Far outside of anything real, far
/// inside of what single precision can square.
const SPACING_RANGE: [f64; 2] = [1e-15, 1e15];
/// Largest ratio between the edges of the volume's box; beyond it single-precision ray positions
/// cannot resolve the thin side.
const MAX_EDGE_RATIO: f64 = 1e6;
/// Volume of the parallelepiped of three unit directions below which they count as singular.
const MIN_DETERMINANT: f64 = 1e-6;
/// Largest |cos| between two axes that counts as perpendicular (0.06 degrees).
const MAX_SHEAR_COS: f64 = 1e-3;
/// By how much another permutation must be closer to LPS; keeps 45 degree ties where they are.
const TIE_MARGIN: f64 = 1e-9;
const PERMUTATIONS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

pub(crate) type Vec3 = [f64; 3];

pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Whether a voxel edge can be worked with.
pub(crate) fn spacing_is_usable(spacing: f64) -> bool {
    (SPACING_RANGE[0]..=SPACING_RANGE[1]).contains(&spacing)
}

/// Where a file's grid lies in patient space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Affine {
    /// Unit direction of each file axis, in LPS.
    pub(crate) directions: [Vec3; 3],
    /// Step along each file axis.
    pub(crate) spacing: Vec3,
    /// Centre of the file's first voxel, in LPS.
    pub(crate) origin: Vec3,
}

impl Affine {
    /// From the step vectors of the file axes; `None` if they are not finite, out of range or
    /// do not span space.
    pub(crate) fn from_columns(columns: [Vec3; 3], origin: Vec3) -> Option<Self> {
        let spacing = columns.map(norm);
        if !spacing.iter().all(|s| spacing_is_usable(*s)) || !origin.iter().all(|o| o.is_finite()) {
            return None;
        }
        let unit = |axis: usize| columns[axis].map(|c| c / spacing[axis]);
        let directions = [unit(0), unit(1), unit(2)];
        let determinant = dot(directions[0], cross(directions[1], directions[2]));
        (determinant.abs() >= MIN_DETERMINANT).then_some(Self { directions, spacing, origin })
    }

    /// Whether the axes stand perpendicular on each other, as rendering takes them to be.
    fn is_sheared(&self) -> bool {
        let [a, b, c] = self.directions;
        [dot(a, b), dot(b, c), dot(c, a)].iter().any(|cos| cos.abs() > MAX_SHEAR_COS)
    }

    fn closest_lps(&self) -> Axes {
        let closeness = |permutation: [usize; 3]| -> f64 {
            (0..3).map(|world| self.directions[permutation[world]][world].abs()).sum()
        };
        let mut best = PERMUTATIONS[0];
        for candidate in PERMUTATIONS {
            if closeness(candidate) > closeness(best) + TIE_MARGIN {
                best = candidate;
            }
        }
        let flip = [0, 1, 2].map(|world| self.directions[best[world]][world] < 0.0);
        Axes { permutation: best, flip }
    }
}

/// What a reader knows about a volume before its axes are put in order.
pub(crate) struct Stored {
    pub(crate) dims: [usize; 3],
    /// Of the file axes; replaced by the affine's where there is one.
    pub(crate) spacing: Vec3,
    pub(crate) spacing_unit: Option<String>,
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
    pub(crate) affine: Option<Affine>,
}

impl Stored {
    /// Refuses spacings that cannot be drawn; to be called before the voxels are read.
    pub(crate) fn check_spacing(&self, file: &str, field: &str) -> Result<(), FormatError> {
        let spacing = self.affine.map_or(self.spacing, |affine| affine.spacing);
        let [low, high] = SPACING_RANGE;
        if !spacing.iter().all(|s| spacing_is_usable(*s)) {
            let expected = format!("voxel edges from {low:e} to {high:e}");
            return Err(FormatError::field(file, field, format!("{spacing:?}"), expected));
        }
        let edges = [0, 1, 2].map(|axis| spacing[axis] * self.dims[axis] as f64);
        let longest = edges.iter().copied().fold(0.0, f64::max);
        let shortest = edges.iter().copied().fold(f64::INFINITY, f64::min);
        if longest > MAX_EDGE_RATIO * shortest {
            let expected =
                format!("a box whose longest edge is at most {MAX_EDGE_RATIO:e} times its shortest");
            return Err(FormatError::field(file, field, format!("edges {edges:?}"), expected));
        }
        Ok(())
    }

    /// Puts the voxels in world order.
    pub(crate) fn into_volume(self, voxels: Voxels, notices: &mut Vec<String>) -> Volume {
        let Stored { dims, spacing, spacing_unit, slope, intercept, affine } = self;
        let volume = Volume { dims, spacing, spacing_unit, voxels, slope, intercept, orientation: None };
        let Some(affine) = affine else { return volume };
        if affine.is_sheared() {
            notices.push("the axes are not perpendicular; the volume is drawn as if they were".into());
        }
        let axes = affine.closest_lps();
        let Axes { permutation, flip } = axes;
        let mut origin = affine.origin;
        let mut lps_from_grid = [[0.0; 3]; 3];
        for world in 0..3 {
            let axis = permutation[world];
            let direction = affine.directions[axis];
            let sign = if flip[world] { -1.0 } else { 1.0 };
            lps_from_grid[world] = direction.map(|c| sign * c + 0.0);
            if flip[world] {
                // The new first voxel is the old last one along this axis.
                let length = affine.spacing[axis] * (dims[axis] - 1) as f64;
                origin = [0, 1, 2].map(|k| origin[k] + length * direction[k]);
            }
        }
        Volume {
            dims: permutation.map(|axis| dims[axis]),
            spacing: permutation.map(|axis| affine.spacing[axis]),
            voxels: reorder_voxels(volume.voxels, dims, axes),
            orientation: Some(Orientation { lps_from_grid, origin }),
            ..volume
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_48_axis_orders_come_back_to_one_volume() {
        // dims all different, one larger than a tile of the reordering
        let world_dims = [35, 4, 5];
        let value = |x: usize, y: usize, z: usize| (x + 100 * y + 1000 * z) as u16;
        let mut seen = std::collections::HashSet::new();
        for permutation in PERMUTATIONS {
            for signs in 0..8_usize {
                let flip = [0, 1, 2].map(|w| signs >> w & 1 == 1);
                // Write the file that this order would have stored.
                let mut dims = [0; 3];
                let mut directions = [[0.0; 3]; 3];
                let mut origin = [10.0, 20.0, 30.0];
                for world in 0..3 {
                    let axis = permutation[world];
                    dims[axis] = world_dims[world];
                    directions[axis][world] = if flip[world] { -1.0 } else { 1.0 };
                    if flip[world] {
                        origin[world] += (world_dims[world] - 1) as f64 * (world + 1) as f64;
                    }
                }
                let mut spacing = [0.0; 3];
                for world in 0..3 {
                    spacing[permutation[world]] = (world + 1) as f64;
                }
                let mut stored = vec![0; world_dims.iter().product()];
                for z in 0..world_dims[2] {
                    for y in 0..world_dims[1] {
                        for x in 0..world_dims[0] {
                            let mut at = [0; 3];
                            for (world, i) in [x, y, z].into_iter().enumerate() {
                                let n = world_dims[world];
                                at[permutation[world]] = if flip[world] { n - 1 - i } else { i };
                            }
                            stored[(at[2] * dims[1] + at[1]) * dims[0] + at[0]] = value(x, y, z);
                        }
                    }
                }
                seen.insert(stored.clone());
                let volume = Stored {
                    dims,
                    spacing,
                    spacing_unit: None,
                    slope: 1.0,
                    intercept: 0.0,
                    affine: Some(Affine { directions, spacing, origin }),
                }
                .into_volume(Voxels::U16(stored), &mut Vec::new());
                assert_eq!(volume.dims, world_dims);
                assert_eq!(volume.spacing, [1.0, 2.0, 3.0]);
                let orientation = volume.orientation.unwrap();
                assert_eq!(orientation.origin, [10.0, 20.0, 30.0]);
                assert_eq!(orientation.lps_from_grid, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
                for z in 0..world_dims[2] {
                    for y in 0..world_dims[1] {
                        for x in 0..world_dims[0] {
                            assert_eq!(volume.value(x, y, z), f64::from(value(x, y, z)));
                        }
                    }
                }
            }
        }
        assert_eq!(seen.len(), 48, "the files must differ, or the test proves nothing");
    }

    #[test]
    fn ties_at_45_degrees_keep_the_order() {
        let s = std::f64::consts::FRAC_1_SQRT_2;
        let columns = [[s, s, 0.0], [-s, s, 0.0], [0.0, 0.0, 1.0]];
        let affine = Affine::from_columns(columns, [0.0; 3]).unwrap();
        assert_eq!(affine.closest_lps().permutation, [0, 1, 2]);
    }

    #[test]
    fn flat_or_absurd_axes_are_no_affine() {
        let x = [1.0, 0.0, 0.0];
        let y = [0.0, 1.0, 0.0];
        assert!(Affine::from_columns([x, y, [1.0, 1.0, 0.0]], [0.0; 3]).is_none());
        assert!(Affine::from_columns([x, y, [0.0; 3]], [0.0; 3]).is_none());
        assert!(Affine::from_columns([x, y, [0.0, 0.0, f64::NAN]], [0.0; 3]).is_none());
        assert!(Affine::from_columns([x, y, [0.0, 0.0, 1e300]], [0.0; 3]).is_none());
        assert!(Affine::from_columns([x, y, [0.0, 0.0, 1.0]], [f64::INFINITY; 3]).is_none());
        assert!(Affine::from_columns([x, y, [0.0, 0.0, 1.0]], [0.0; 3]).is_some());
    }
}
