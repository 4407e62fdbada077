//! Parts of the volume that are left out.

use glam::DVec3;
use proto::scene_file as file;

use crate::part::{Placement, WHOLE};

/// A convex region: what it contains is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// Lower and upper corner in 0..1 coordinates of the box of the voxels held.
    pub bounds: [DVec3; 2],
    /// Unit normal and offset, world: keeps `dot(normal, x) >= offset`.
    pub planes: Vec<(DVec3, f64)>,
    /// Whether clipped matter still blocks light.
    pub shadows: bool,
}

impl Clip {
    /// From the checked file form, whose box is one of the whole volume. Of a part no more is kept
    /// than is to be shown of it.
    pub fn from_file(clip: &file::Clip, placement: &Placement) -> Self {
        let [low, high] = clip.bounds.unwrap_or(WHOLE).map(DVec3::from_array);
        let [first, last] = placement.shown.map(DVec3::from_array);
        let low = low.clamp(first, last);
        let kept = [low, high.clamp(low, last)];
        let planes =
            clip.planes.iter().map(|plane| (DVec3::from_array(plane.normal).normalize(), plane.offset));
        Self {
            bounds: kept.map(|corner| DVec3::from_array(placement.held_from_whole(corner.to_array()))),
            planes: planes.collect(),
            shadows: clip.shadows,
        }
    }

    /// The part of `interval` at which `start + t * along` (world) lies on the kept side of every
    /// plane; `None` if there is none. What is kept is convex, so it is one interval.
    pub(crate) fn cut_by_planes(&self, start: DVec3, along: DVec3, interval: [f64; 2]) -> Option<[f64; 2]> {
        let [mut near, mut far] = interval;
        for &(normal, offset) in &self.planes {
            let (height, slope) = (normal.dot(start) - offset, normal.dot(along));
            if slope > 0.0 {
                near = near.max(-height / slope);
            } else if slope < 0.0 {
                far = far.min(-height / slope);
            } else if height < 0.0 {
                return None;
            }
        }
        Some([near, far])
    }
}
