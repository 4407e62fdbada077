//! Parts of the volume that are left out.

use glam::DVec3;
use proto::scene_file as file;

/// A convex region: what it contains is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// Lower and upper corner in 0..1 volume coordinates.
    pub bounds: [DVec3; 2],
    /// Unit normal and offset, world: keeps `dot(normal, x) >= offset`.
    pub planes: Vec<(DVec3, f64)>,
    /// Whether clipped matter still blocks light.
    pub shadows: bool,
}

impl Clip {
    /// From the checked file form.
    pub fn from_file(clip: &file::Clip) -> Self {
        let planes =
            clip.planes.iter().map(|plane| (DVec3::from_array(plane.normal).normalize(), plane.offset));
        Self {
            bounds: clip.bounds.unwrap_or([[0.0; 3], [1.0; 3]]).map(DVec3::from_array),
            planes: planes.collect(),
            shadows: clip.shadows,
        }
    }
}
