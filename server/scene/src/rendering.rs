//! What a pixel shows: matter in light, or a measure of the values along its ray.

use glam::DVec3;
use proto::scene_file::{Rendering as RenderingFile, RenderingMode};

/// The checked form of `rendering`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rendering {
    /// Matter of the transfer function, in light.
    Volume,
    /// The largest value on the ray.
    Maximum,
    /// The smallest value on the ray.
    Minimum,
    /// The mean value along the ray.
    Average,
    /// The first place on the ray that has this data value, as an opaque surface in light.
    Isosurface {
        /// Data value.
        value: f64,
    },
    /// The value where the ray meets the plane `dot(normal, x) = offset`, world.
    Slice {
        /// Unit length.
        normal: DVec3,
        /// World units.
        offset: f64,
    },
}

impl Rendering {
    /// From a scene file that was checked; `value_range` gives the default isovalue.
    pub(crate) fn from_file(file: &RenderingFile, value_range: [f64; 2]) -> Self {
        match file.mode {
            RenderingMode::Volume => Rendering::Volume,
            RenderingMode::Maximum => Rendering::Maximum,
            RenderingMode::Minimum => Rendering::Minimum,
            RenderingMode::Average => Rendering::Average,
            RenderingMode::Isosurface => Rendering::Isosurface {
                value: file.isovalue.unwrap_or(0.5 * (value_range[0] + value_range[1])),
            },
            RenderingMode::Slice => Rendering::Slice {
                normal: DVec3::from_array(file.slice.normal).normalize(),
                offset: file.slice.offset,
            },
        }
    }

    /// Whether light and matter decide what is seen, not values alone.
    pub fn is_lit(&self) -> bool {
        matches!(self, Rendering::Volume | Rendering::Isosurface { .. })
    }
}
