//! A branching tree of vessels, grown by a fixed rule and stored as soft-edged tubes.
//!
//! Radii follow C. D. Murray, "The Physiological Principle of Minimum Work" (PNAS 1926): at a
//! fork `r0^3 = r1^3 + r2^3`; the angles follow his companion paper "... Applied to the Angle of
//! Branching of Arteries" (J. Gen. Physiol. 1926):
//! `cos(theta1) = (r0^4 + r1^4 - r2^4) / (2 r0^2 r1^2)`.

use super::grid::{Grid, Point, Progress, fill_slices, fraction};
use super::noise::unit;
use super::vector::{add, coverage, cross, dot, length, normalized, scale, sub};

/// Radius of the trunk, world units.
const TRUNK_RADIUS: f64 = 0.0185;
/// Where the trunk enters, world, and the direction of flow.
const ROOT: Point = [0.02, -0.5, 0.0];
const ROOT_DIRECTION: Point = [-0.12, 1.0, 0.06];
/// Length of a vessel in units of its radius.
const LENGTH_PER_RADIUS: f64 = 11.8;
/// The trunk is this much shorter, to leave room for the crown.
const TRUNK_LENGTH: f64 = 0.4;
/// Vessels thinner than this end, world units.
const THINNEST: f64 = 0.0037;
/// Share of the flow that the larger child gets: base and random part.
const FLOW_SHARE: [f64; 2] = [0.5, 0.2];
/// Pieces a vessel is bent from, and how much each piece turns aside at random.
const PIECES: u32 = 6;
const WANDER: f64 = 0.18;
/// Growth turns away from this point, a little below the root; how much with each piece.
const ROOT_FOCUS: Point = [0.0, -0.7, 0.0];
const TROPISM: f64 = 0.05;
/// Successive forks turn their plane by the golden angle, about 137.5 degrees: cosine and sine.
const GOLDEN: [f64; 2] = [-0.737_368_878_078_320_1, 0.675_490_294_261_523_6];
/// Width of the edge between blood and air, world units.
const EDGE: f64 = 0.016;
/// Half the diameter of what is nonzero around a vessel's axis is its radius plus this.
const MARGIN: f64 = 0.5 * EDGE;
/// Growth stays in a ball of about this radius around the origin: pieces bend inwards with the
/// fourth power of their distance relative to it, this strongly at the radius itself and at most
/// four times as much.
const CROWN_RADIUS: f64 = 0.42;
const CROWN_BEND: f64 = 0.16;

/// A piece of vessel: a tube with round ends whose radius changes linearly.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tube {
    /// Ends, world.
    pub ends: [Point; 2],
    /// Radii at the ends, world units.
    pub radii: [f64; 2],
}

impl Tube {
    /// Signed distance to the surface, negative inside (exact for small taper).
    fn distance(&self, p: Point) -> f64 {
        let [a, b] = self.ends;
        let axis = sub(b, a);
        let offset = sub(p, a);
        let along = (dot(offset, axis) / dot(axis, axis)).clamp(0.0, 1.0);
        let radius = self.radii[0] + along * (self.radii[1] - self.radii[0]);
        length(sub(offset, scale(axis, along))) - radius
    }
}

/// A vessel about to grow.
struct Bud {
    position: Point,
    direction: Point,
    /// Unit vector across `direction`: the plane of the next fork.
    side: Point,
    /// Radius of the vessel, and of the one it leaves.
    radius: f64,
    parent_radius: f64,
    /// Number of the vessel in a binary heap: children of n are 2n and 2n + 1.
    number: u32,
}

/// Every tube of the tree, the same on every machine.
pub(crate) fn grow() -> Vec<Tube> {
    let direction = normalized(ROOT_DIRECTION);
    let trunk = Bud {
        position: ROOT,
        direction,
        side: normalized(cross(direction, [0.0, 0.0, 1.0])),
        radius: TRUNK_RADIUS,
        parent_radius: TRUNK_RADIUS,
        number: 1,
    };
    let mut tubes = Vec::new();
    let mut buds = vec![trunk];
    while let Some(bud) = buds.pop() {
        let (tip, direction, side) = grow_vessel(&bud, &mut tubes);
        buds.extend(fork(&bud, tip, direction, side));
    }
    tubes
}

/// Grows one vessel piece by piece; returns its tip, direction and side there.
fn grow_vessel(bud: &Bud, tubes: &mut Vec<Tube>) -> (Point, Point, Point) {
    let random = |salt: u32| unit(bud.number * 64 + salt);
    let shortened = if bud.number == 1 { TRUNK_LENGTH } else { 0.8 + 0.4 * random(0) };
    let piece_length = shortened * bud.radius * LENGTH_PER_RADIUS / f64::from(PIECES);
    let (mut position, mut direction, mut side) = (bud.position, bud.direction, bud.side);
    let mut radius = bud.parent_radius;
    for piece in 0..PIECES {
        // Wander, grow away from the root, and turn back before the skin of the crown.
        let aside = |salt: u32| WANDER * (2.0 * random(1 + 2 * piece + salt) - 1.0);
        let across = cross(direction, side);
        let away = normalized(sub(position, ROOT_FOCUS));
        let out = dot(position, position) / (CROWN_RADIUS * CROWN_RADIUS);
        let bend = CROWN_BEND * (out * out).min(4.0);
        direction = add(direction, add(scale(side, aside(0)), scale(across, aside(1))));
        direction = add(direction, scale(away, TROPISM));
        direction = normalized(sub(direction, scale(position, bend)));
        side = normalized(sub(side, scale(direction, dot(side, direction))));

        // The radius of the parent gives way to the vessel's own within the first piece.
        let next = add(position, scale(direction, piece_length));
        tubes.push(Tube { ends: [position, next], radii: [radius, bud.radius] });
        (position, radius) = (next, bud.radius);
    }
    (position, direction, side)
}

/// The two children of a vessel that are not too thin.
fn fork(bud: &Bud, tip: Point, direction: Point, side: Point) -> Vec<Bud> {
    let flow = FLOW_SHARE[0] + FLOW_SHARE[1] * unit(bud.number * 64 + 63);
    let radii = [flow, 1.0 - flow].map(|share| bud.radius * libm::cbrt(share));
    let across = cross(direction, side);
    let plane = add(scale(side, GOLDEN[0]), scale(across, GOLDEN[1]));
    let fourth = |r: f64| r * r * r * r;
    let mut children = Vec::new();
    for child in 0..2 {
        let (own, other) = (radii[child], radii[1 - child]);
        if own < THINNEST {
            continue;
        }
        let cos =
            (fourth(bud.radius) + fourth(own) - fourth(other)) / (2.0 * bud.radius * bud.radius * own * own);
        let cos = cos.clamp(-1.0, 1.0);
        let sin = (1.0 - cos * cos).sqrt() * if child == 0 { 1.0 } else { -1.0 };
        let turned = add(scale(direction, cos), scale(plane, sin));
        children.push(Bud {
            position: tip,
            direction: turned,
            side: normalized(sub(plane, scale(turned, dot(plane, turned)))),
            radius: own,
            parent_radius: own.max(0.9 * bud.radius),
            number: 2 * bud.number + child as u32,
        });
    }
    children
}

/// 16-bit shares of vessel per voxel: 1 inside, 0.5 on the wall, 0 outside.
pub(crate) fn voxels(grid: &Grid, progress: Progress<'_>) -> Vec<u16> {
    let tubes = grow();
    fill_slices(grid, progress, |z, slice: &mut [u16]| {
        let z = grid.center(2, z);
        // Each tube writes the voxels of its bounding box; the larger value wins, so the order
        // of the tubes does not matter.
        for tube in &tubes {
            let reach = tube.radii[0].max(tube.radii[1]) + MARGIN;
            let span = |axis: usize| {
                let (a, b) = (tube.ends[0][axis], tube.ends[1][axis]);
                (0.5 * (a + b), 0.5 * (a - b).abs() + reach)
            };
            let (center_z, reach_z) = span(2);
            if (z - center_z).abs() > reach_z {
                continue;
            }
            let (center_x, reach_x) = span(0);
            let (center_y, reach_y) = span(1);
            for y in grid.range(1, center_y, reach_y) {
                let row = &mut slice[y * grid.dims[0]..][..grid.dims[0]];
                let y = grid.center(1, y);
                for x in grid.range(0, center_x, reach_x) {
                    let value = coverage(tube.distance([grid.center(0, x), y, z]), EDGE);
                    row[x] = row[x].max(fraction(value));
                }
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bud(number: u32) -> Bud {
        let direction = [0.0, 1.0, 0.0];
        let side = [1.0, 0.0, 0.0];
        Bud { position: [0.0; 3], direction, side, radius: 0.02, parent_radius: 0.02, number }
    }

    #[test]
    fn forks_obey_murray() {
        for number in 1..50 {
            let bud = bud(number);
            let children = fork(&bud, bud.position, bud.direction, bud.side);
            assert_eq!(children.len(), 2);
            let cubes: f64 = children.iter().map(|c| c.radius.powi(3)).sum();
            assert!((cubes / bud.radius.powi(3) - 1.0).abs() < 1e-12);
            // Least volume also balances the pull of the vessels, r^2 along each direction.
            let mut pull = scale(bud.direction, -bud.radius * bud.radius);
            for child in &children {
                assert!((length(child.direction) - 1.0).abs() < 1e-12);
                assert!(dot(child.direction, child.side).abs() < 1e-12);
                pull = add(pull, scale(child.direction, child.radius * child.radius));
            }
            assert!(length(pull) < 1e-9 * bud.radius, "unbalanced: {pull:?}");
        }
    }

    #[test]
    fn every_tube_starts_where_another_ends_or_at_the_root() {
        let tubes = grow();
        assert!(tubes.len() > 100);
        for tube in &tubes {
            let start = tube.ends[0];
            assert!(start == ROOT || tubes.iter().any(|other| other.ends[1] == start));
            assert!(tube.radii.iter().all(|&r| (THINNEST..=TRUNK_RADIUS).contains(&r)));
        }
    }

    #[test]
    fn distance_to_a_tapered_tube() {
        let tube = Tube { ends: [[0.0; 3], [2.0, 0.0, 0.0]], radii: [0.5, 0.3] };
        assert!((tube.distance([1.0, 1.0, 0.0]) - 0.6).abs() < 1e-12);
        assert!((tube.distance([3.0, 0.0, 0.0]) - 0.7).abs() < 1e-12);
        assert!((tube.distance([0.0; 3]) + 0.5).abs() < 1e-12);
    }
}
