//! Voxels in memory, in world order: x fastest, then y, then z.

use proto::scene_file::VoxelType;

/// Stored voxels. Anything wider than these is converted to `f32` on import, with a notice.
#[derive(Debug, Clone, PartialEq)]
pub enum Voxels {
    /// Unsigned 8-bit.
    U8(Vec<u8>),
    /// Unsigned 16-bit.
    U16(Vec<u16>),
    /// Signed 16-bit (8-bit signed files are widened to this).
    I16(Vec<i16>),
    /// 32-bit float, every value finite.
    F32(Vec<f32>),
}

impl Voxels {
    /// Number of voxels.
    pub fn len(&self) -> usize {
        match self {
            Voxels::U8(v) => v.len(),
            Voxels::U16(v) => v.len(),
            Voxels::I16(v) => v.len(),
            Voxels::F32(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Stored value at a linear index, before slope and intercept.
    pub fn stored(&self, index: usize) -> f32 {
        match self {
            Voxels::U8(v) => f32::from(v[index]),
            Voxels::U16(v) => f32::from(v[index]),
            Voxels::I16(v) => f32::from(v[index]),
            Voxels::F32(v) => v[index],
        }
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        match self {
            Voxels::U8(v) => v.len(),
            Voxels::U16(v) => 2 * v.len(),
            Voxels::I16(v) => 2 * v.len(),
            Voxels::F32(v) => 4 * v.len(),
        }
    }

    /// Type of a stored voxel.
    pub fn voxel_type(&self) -> VoxelType {
        match self {
            Voxels::U8(_) => VoxelType::Uint8,
            Voxels::U16(_) => VoxelType::Uint16,
            Voxels::I16(_) => VoxelType::Int16,
            Voxels::F32(_) => VoxelType::Float32,
        }
    }
}

/// Where the world axes point in the patient, after reordering to the closest LPS: +x towards
/// the patient's left, +y posterior, +z superior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orientation {
    /// Unit directions of the grid axes i, j, k in LPS patient space. Close to the identity;
    /// what is left is the oblique remainder, kept for labels and never resampled.
    pub lps_from_grid: [[f64; 3]; 3],
    /// Centre of the first voxel in LPS patient space, in the unit of the spacing.
    pub origin: [f64; 3],
}

/// A scalar field on a regular grid.
///
/// The data value of a voxel is `slope * stored + intercept`; interpolation is linear, so it
/// commutes with that.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// Voxels along x, y, z; each at least 1.
    pub dims: [usize; 3],
    /// Edge lengths of a voxel along x, y, z; finite, positive.
    pub spacing: [f64; 3],
    /// Unit of the spacing where the file says so, for example `mm`.
    pub spacing_unit: Option<String>,
    /// `dims[0] * dims[1] * dims[2]` voxels.
    pub voxels: Voxels,
    /// Data value per stored unit; finite, not 0.
    pub slope: f64,
    /// Data value of stored 0; finite.
    pub intercept: f64,
    /// Present if the axes are anatomical.
    pub orientation: Option<Orientation>,
}

impl Volume {
    /// A volume without orientation, spacing 1, data values as stored.
    pub fn new(dims: [usize; 3], voxels: Voxels) -> Self {
        assert_eq!(dims.iter().product::<usize>(), voxels.len(), "one value per voxel");
        Self {
            dims,
            spacing: [1.0; 3],
            spacing_unit: None,
            voxels,
            slope: 1.0,
            intercept: 0.0,
            orientation: None,
        }
    }

    /// Linear index of voxel (x, y, z).
    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Data value at voxel (x, y, z).
    pub fn value(&self, x: usize, y: usize, z: usize) -> f64 {
        self.slope * f64::from(self.voxels.stored(self.index(x, y, z))) + self.intercept
    }
}
