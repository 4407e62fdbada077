//! Where the voxels lie in the world: the box spans `dims * spacing`, scaled uniformly so that
//! its longest edge is 1 world unit, centred at the origin; samples sit at voxel centres. A part of a
//! volume keeps its place in the box of the whole.

use glam::DVec3;

use crate::part::Placement;

/// Geometry of a volume in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Edges of the box, world units; the largest is 1 if it is a whole volume's.
    pub size_world: DVec3,
    /// Centre of the box, world; the origin if it is a whole volume's.
    pub center_world: DVec3,
    /// World units per unit of the file's spacing.
    pub world_from_spacing: f64,
}

impl Grid {
    /// Geometry of `dims` voxels with edges `spacing` (any unit, positive).
    pub fn new(dims: [usize; 3], spacing: [f64; 3]) -> Self {
        let extent = DVec3::from_array(std::array::from_fn(|axis| dims[axis] as f64 * spacing[axis]));
        let world_from_spacing = 1.0 / extent.max_element();
        Self { dims, size_world: extent * world_from_spacing, center_world: DVec3::ZERO, world_from_spacing }
    }

    /// Geometry of `dims` voxels that are placed in a volume with edges `whole_spacing` of a voxel.
    pub fn placed(dims: [usize; 3], placement: &Placement, whole_spacing: [f64; 3]) -> Self {
        let whole = Self::new(placement.whole_dims, whole_spacing);
        if placement.is_whole() {
            return whole;
        }
        let [low, high] = placement.held.map(DVec3::from_array);
        Self {
            dims,
            size_world: (high - low) * whole.size_world,
            center_world: whole.world_from_unit(0.5 * (low + high)),
            world_from_spacing: whole.world_from_spacing,
        }
    }

    /// Edges of one voxel, world units.
    pub fn voxel_size_world(&self) -> DVec3 {
        self.size_world / DVec3::from_array(self.dims.map(|n| n as f64))
    }

    /// Shortest edge of a voxel, world units.
    pub fn smallest_voxel_edge_world(&self) -> f64 {
        self.voxel_size_world().min_element()
    }

    /// World position of coordinates 0..1 of the box.
    pub fn world_from_unit(&self, unit: DVec3) -> DVec3 {
        self.center_world + (unit - 0.5) * self.size_world
    }

    /// Coordinates 0..1 of the box of a world position.
    pub fn unit_from_world(&self, world: DVec3) -> DVec3 {
        (world - self.center_world) / self.size_world + 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::levels::Reduction;
    use crate::part::Part;
    use crate::{PreparedVolume, Volume, Voxels};

    #[test]
    fn an_anisotropic_scan_is_not_squashed() {
        let grid = Grid::new([100, 100, 50], [1.0, 1.0, 4.0]);
        assert!((grid.size_world - DVec3::new(0.5, 0.5, 1.0)).length() < 1e-12);
        assert!((grid.voxel_size_world() - DVec3::new(0.005, 0.005, 0.02)).length() < 1e-12);
        assert_eq!(grid.world_from_unit(DVec3::splat(0.5)), DVec3::ZERO);
    }

    #[test]
    fn a_part_keeps_its_place() {
        let volume = Volume {
            spacing: [1.0, 1.0, 4.0],
            ..Volume::new([40, 21, 10], Voxels::U8(vec![0; 40 * 21 * 10]))
        };
        let whole = Grid::new(volume.dims, volume.spacing);
        let prepared = PreparedVolume::new(volume, &|_| {});
        let part = Part { level: 1, low: [5, 0, 2], high: [15, 11, 4] };
        let held = prepared.part(&part, None, Reduction::Mean);
        let grid = Grid::placed(held.volume.dims, &held.placement, [1.0, 1.0, 4.0]);
        assert_eq!(grid.dims, [10, 11, 2]);
        assert!((grid.voxel_size_world() * DVec3::new(20.0, 11.0, 5.0) - whole.size_world).length() < 1e-12);
        let corner = grid.world_from_unit(DVec3::ZERO);
        assert!((corner - whole.world_from_unit(DVec3::new(0.25, 0.0, 0.4))).length() < 1e-12);
        let unit = DVec3::new(0.3, 0.8, 0.1);
        assert!((grid.unit_from_world(grid.world_from_unit(unit)) - unit).length() < 1e-12);
        let all = Placement::whole(&prepared.volume);
        assert_eq!(Grid::placed(prepared.volume.dims, &all, [1.0, 1.0, 4.0]), whole);
    }
}
