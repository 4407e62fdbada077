//! Where the voxels lie in the world: the box spans `dims * spacing`, scaled uniformly so that
//! its longest edge is 1 world unit, centred at the origin; samples sit at voxel centres.

use glam::DVec3;

/// Geometry of a volume in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Edge lengths of the box, world units; the largest is 1.
    pub size_world: DVec3,
    /// World units per unit of the file's spacing.
    pub world_from_spacing: f64,
}

impl Grid {
    /// Geometry of `dims` voxels with edges `spacing` (any unit, positive).
    pub fn new(dims: [usize; 3], spacing: [f64; 3]) -> Self {
        let extent = DVec3::from_array(std::array::from_fn(|axis| dims[axis] as f64 * spacing[axis]));
        let world_from_spacing = 1.0 / extent.max_element();
        Self { dims, size_world: extent * world_from_spacing, world_from_spacing }
    }

    /// Edges of one voxel, world units.
    pub fn voxel_size_world(&self) -> DVec3 {
        self.size_world / DVec3::from_array(self.dims.map(|n| n as f64))
    }

    /// Shortest edge of a voxel, world units.
    pub fn smallest_voxel_edge_world(&self) -> f64 {
        self.voxel_size_world().min_element()
    }

    /// World position of volume coordinates 0..1.
    pub fn world_from_unit(&self, unit: DVec3) -> DVec3 {
        (unit - 0.5) * self.size_world
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_anisotropic_scan_is_not_squashed() {
        let grid = Grid::new([100, 100, 50], [1.0, 1.0, 4.0]);
        assert!((grid.size_world - DVec3::new(0.5, 0.5, 1.0)).length() < 1e-12);
        assert!((grid.voxel_size_world() - DVec3::new(0.005, 0.005, 0.02)).length() < 1e-12);
        assert_eq!(grid.world_from_unit(DVec3::splat(0.5)), DVec3::ZERO);
    }
}
