//! A room of labels, open towards +z: made for `nearest` filtering, one label per material, as
//! the synthetic box of the Historygrams paper (Jönsson et al. 2012, figure 4).
//!
//! The walls follow the faces of the box whatever its aspect; their thickness and the sphere
//! scale with its shortest edge.

use super::grid::{Grid, Point};
use super::vector::{length, sub};

/// Inside of the room.
pub const AIR: u8 = 0;
/// Wall at -x.
pub const LEFT_WALL: u8 = 1;
/// Wall at +x.
pub const RIGHT_WALL: u8 = 2;
/// Back wall (-z), floor (-y) and ceiling (+y).
pub const WHITE_WALL: u8 = 3;
/// The tall block, left, at the back.
pub const BLOCK: u8 = 4;
/// The sphere, right, at the front.
pub const SPHERE: u8 = 5;

/// Thickness of the walls as a share of the shortest edge of the box. Walls are complete on
/// grids of at least 10 voxels per edge.
pub const WALL: f64 = 0.05;

/// The tall block in volume coordinates; it stands on the floor.
const BLOCK_BOX: [[f64; 3]; 2] = [[0.16, 0.0, 0.14], [0.48, 0.64, 0.46]];
/// Centre of the sphere in volume coordinates along x and z; it lies on the floor.
const SPHERE_AT: [f64; 2] = [0.68, 0.62];
/// Radius of the sphere as a share of the shortest edge.
const SPHERE_RADIUS: f64 = 0.19;

/// The label at a world position.
pub(crate) fn label(grid: &Grid, p: Point) -> u8 {
    let [hx, hy, hz] = grid.half;
    let shortest_edge = 2.0 * hx.min(hy).min(hz);
    let wall = WALL * shortest_edge;
    if p[1] < -hy + wall || p[1] > hy - wall || p[2] < -hz + wall {
        return WHITE_WALL;
    }
    if p[0] < -hx + wall {
        return LEFT_WALL;
    }
    if p[0] > hx - wall {
        return RIGHT_WALL;
    }
    let volume: Point = std::array::from_fn(|axis| p[axis] / (2.0 * grid.half[axis]) + 0.5);
    if (0..3).all(|axis| (BLOCK_BOX[0][axis]..BLOCK_BOX[1][axis]).contains(&volume[axis])) {
        return BLOCK;
    }
    let radius = SPHERE_RADIUS * shortest_edge;
    let center = [(SPHERE_AT[0] - 0.5) * 2.0 * hx, -hy + wall + radius, (SPHERE_AT[1] - 0.5) * 2.0 * hz];
    if length(sub(p, center)) < radius { SPHERE } else { AIR }
}
