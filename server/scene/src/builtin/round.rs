//! Two simple round bodies: a thick blob with a soft skin, and nested shells cut open.

use super::grid::Point;
use super::vector::{coverage, length, smooth_min, smoothstep, sub};

/// Centres (world) and radii of the lumps that melt into the blob.
const LUMPS: [(Point, f64); 6] = [
    ([-0.06, -0.05, 0.0], 0.27),
    ([0.16, 0.09, 0.04], 0.19),
    ([-0.17, 0.17, -0.05], 0.14),
    ([0.13, -0.19, 0.12], 0.15),
    ([-0.22, -0.17, 0.12], 0.13),
    ([0.03, 0.22, 0.12], 0.11),
];
/// Lumps closer than this melt into each other, world units.
const MELT: f64 = 0.13;
/// Depth over which the blob's value rises from 0 at the skin to 1, world units.
const BLOB_SKIN: f64 = 0.14;

/// Thick blob: 0 outside, rising smoothly to 1 deep inside.
pub(crate) fn thick_blob(p: Point) -> f64 {
    let mut distance = f64::INFINITY;
    for (center, radius) in LUMPS {
        distance = smooth_min(distance, length(sub(p, center)) - radius, MELT);
    }
    smoothstep(0.0, BLOB_SKIN, -distance)
}

/// Outer radius, thickness (world units) and value of each shell, from outside in; the last is
/// a full ball. Gaps between them are empty.
pub const SHELLS: [(f64, f64, f64); 4] =
    [(0.44, 0.05, 0.25), (0.34, 0.05, 0.5), (0.24, 0.05, 0.75), (0.13, 0.13, 1.0)];
/// Width of the shells' edges, world units.
const SHELL_EDGE: f64 = 0.01;
/// How deep the cut goes into each shell: the cut keeps what lies this far beyond the planes
/// x, y, z = 0, world units, so that inner shells stand out of the opening.
const CUT_STEP: [f64; 4] = [-0.04, 0.0, 0.03, f64::INFINITY];

/// Nested shells of different values; the octant towards +x, +y, +z is cut away in steps.
pub(crate) fn nested_shells(p: Point) -> f64 {
    let radius = length(p);
    let mut value: f64 = 0.0;
    for ((outer, thickness, shell_value), cut) in SHELLS.into_iter().zip(CUT_STEP) {
        let shell = (radius - outer).max(outer - thickness - radius);
        let shell = if thickness < outer { shell } else { radius - outer };
        // Distance into the cut-away octant, positive inside it.
        let cut_away = (p[0] - cut).min(p[1] - cut).min(p[2] - cut);
        value = value.max(shell_value * coverage(shell.max(cut_away), SHELL_EDGE));
    }
    value
}
