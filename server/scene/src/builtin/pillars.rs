//! A field of round pillars on a floor: many occluders, long shadows.
//!
//! Values: 0 air, [`FLOOR`] and 1 for the pillars. The floor lies on the face at -y and heights
//! scale with the box; pillars have fixed places in the world, so a narrower box holds fewer.

use super::grid::{Grid, Point};
use super::noise::unit;
use super::vector::{coverage, smooth_min};

/// Value of the floor.
pub const FLOOR: f64 = 0.4;

/// Width of the edge between matter and air, world units.
const EDGE: f64 = 0.01;
/// Thickness of the floor, world units.
const FLOOR_THICKNESS: f64 = 0.05;
/// Pillars along x and along z, and the distance of their axes, world units.
const COUNT: i32 = 5;
const PITCH: f64 = 0.19;
/// Each pillar is moved by up to this from its place in the grid, world units.
const JITTER: f64 = 0.025;
/// Radius of a shaft, world units: base and random part.
const RADIUS: [f64; 2] = [0.034, 0.014];
/// Base and capital are wider than the shaft by this, and as high, world units.
const LEDGE: f64 = 0.014;
const LEDGE_HEIGHT: f64 = 0.035;
/// Height of a pillar as a share of the box: base and random part.
const HEIGHT: [f64; 2] = [0.30, 0.58];
/// Shafts meet their ledges with this fillet, world units.
const FILLET: f64 = 0.012;

/// One pillar: its axis (world x, z), top (world y) and shaft radius.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pillar {
    axis: [f64; 2],
    top: f64,
    radius: f64,
}

/// Every pillar, the same on every machine.
pub(crate) fn layout(grid: &Grid) -> Vec<Pillar> {
    let height = 2.0 * grid.half[1];
    let middle = f64::from(COUNT - 1) / 2.0;
    let mut pillars = Vec::new();
    for row in 0..COUNT {
        for column in 0..COUNT {
            let number = (row * COUNT + column) as u32;
            let random = |salt: u32| unit(number * 8 + salt);
            let place = |index: i32, salt: u32| {
                (f64::from(index) - middle) * PITCH + (random(salt) * 2.0 - 1.0) * JITTER
            };
            // Lower in front (row grows towards +z), so that the back stays in sight.
            let recede = 1.0 - 0.5 * f64::from(row) / f64::from(COUNT - 1);
            pillars.push(Pillar {
                axis: [place(column, 0), place(row, 1)],
                top: -grid.half[1] + height * (HEIGHT[0] + HEIGHT[1] * random(2)) * recede,
                radius: RADIUS[0] + RADIUS[1] * random(3),
            });
        }
    }
    pillars
}

/// The value at a world position, 0..1.
pub(crate) fn value(grid: &Grid, pillars: &[Pillar], p: Point) -> f64 {
    let floor_top = -grid.half[1] + FLOOR_THICKNESS;
    let mut value = FLOOR * coverage(p[1] - floor_top, EDGE);
    for pillar in pillars {
        let (dx, dz) = (p[0] - pillar.axis[0], p[2] - pillar.axis[1]);
        let rho = (dx * dx + dz * dz).sqrt();
        // Nothing of a pillar lies further from its axis than this.
        if rho > pillar.radius + LEDGE + EDGE {
            continue;
        }
        let shaft = rho - pillar.radius;
        let ledge =
            |middle: f64| (rho - pillar.radius - LEDGE).max((p[1] - middle).abs() - 0.5 * LEDGE_HEIGHT);
        let base = ledge(floor_top + 0.5 * LEDGE_HEIGHT);
        let capital = ledge(pillar.top - 0.5 * LEDGE_HEIGHT);
        let profile = smooth_min(shaft, smooth_min(base, capital, FILLET), FILLET);
        let distance = profile.max(p[1] - pillar.top).max(floor_top - EDGE - p[1]);
        value = value.max(coverage(distance, EDGE));
    }
    value
}
