//! A turbulent plume of smoke that rises along +y.
//!
//! A column that widens with height is pushed aside by fractal noise (domain warping), rolled up
//! by ring vortices, and frayed by finer noise. Everything is a function of the world position.

use super::grid::Point;
use super::noise::{fractal_noise, gradient_noise, vector_noise};
use super::vector::{add, scale, smoothstep};

/// Seeds of the noises.
const SWAY_SEED: u32 = 11;
const WARP_SEED: u32 = 1000;
const CURL_SEED: u32 = 2000;
const FRAY_SEED: u32 = 3000;

/// No smoke further than this from the axis, world units; keeps the plume inside the unit box.
const REACH: f64 = 0.47;

/// A vortex: it turns what is near its circle. The circle is tilted and off the axis, so that
/// the curls on the two sides differ.
struct Vortex {
    /// Middle of the circle: world x, height above the source, world z.
    center: Point,
    /// Rise of the circle's plane per world unit along x and along z.
    tilt: [f64; 2],
    /// Radius of the circle, and how far from it the turning reaches, world units.
    radius: f64,
    reach: f64,
    /// Tangent of half the angle turned at the circle.
    half_turn: f64,
    /// How much the column bulges at this height, world units.
    bulge: f64,
}

const VORTICES: [Vortex; 5] = [
    Vortex {
        center: [0.01, 0.20, 0.0],
        tilt: [0.5, 0.2],
        radius: 0.05,
        reach: 0.06,
        half_turn: 1.2,
        bulge: 0.012,
    },
    Vortex {
        center: [-0.02, 0.33, 0.01],
        tilt: [-0.6, 0.3],
        radius: 0.085,
        reach: 0.09,
        half_turn: 1.6,
        bulge: 0.03,
    },
    Vortex {
        center: [0.03, 0.47, -0.01],
        tilt: [0.55, -0.3],
        radius: 0.11,
        reach: 0.12,
        half_turn: 1.9,
        bulge: 0.05,
    },
    Vortex {
        center: [-0.03, 0.62, 0.02],
        tilt: [-0.45, -0.2],
        radius: 0.14,
        reach: 0.14,
        half_turn: 2.2,
        bulge: 0.07,
    },
    Vortex {
        center: [0.02, 0.78, 0.0],
        tilt: [0.25, 0.2],
        radius: 0.18,
        reach: 0.17,
        half_turn: 2.6,
        bulge: 0.12,
    },
];

/// The density at a world position, 0..1; the source is at the bottom of the unit box.
pub(crate) fn density(p: Point) -> f64 {
    if p[0] * p[0] + p[2] * p[2] > REACH * REACH {
        return 0.0;
    }
    let height = p[1] + 0.5;
    let up = height.clamp(0.0, 1.0);

    // Sway with the wind, more the higher.
    let sway = |seed| 0.20 * up * gradient_noise([0.3, 2.3 * height, 0.7], seed);
    let mut q = [p[0] - sway(SWAY_SEED), height, p[2] - sway(SWAY_SEED + 1)];

    // Push by large eddies, then by smaller ones seen from where the large ones put us.
    q = add(q, scale(vector_noise(scale(p, 4.2), 2, WARP_SEED), 0.012 + 0.085 * up));
    q = add(q, scale(vector_noise(scale(q, 9.5), 3, CURL_SEED), 0.010 + 0.045 * up));

    // Roll up around the vortices, from the lowest to the highest.
    let mut column = 0.026 + 0.07 * up;
    for vortex in &VORTICES {
        let nearness;
        (q, nearness) = roll(vortex, q);
        column += vortex.bulge * nearness;
    }

    // 1 on the axis, 0 at the edge of the column; fine noise frays the edge and mottles inside.
    let inside = 1.0 - (q[0] * q[0] + q[2] * q[2]).sqrt() / column;
    let fray = fractal_noise(scale(q, 14.0), 4, FRAY_SEED);
    let body = smoothstep(0.0, 0.8, inside + (0.2 + 0.5 * up) * fray);
    let mottled = body * (0.70 + 0.75 * fray).clamp(0.08, 1.0);

    // Thin out with height, end below the top of the box and before the reach.
    let top = 1.0 - smoothstep(0.78, 0.97, height);
    let distance = (p[0] * p[0] + p[2] * p[2]).sqrt();
    let side = 1.0 - smoothstep(0.8 * REACH, REACH, distance);
    mottled * (1.0 - 0.3 * up) * top * side
}

/// Turns `q` around the circle of the vortex in the plane through its axis, most at the circle
/// and not at all beyond its reach; also returns how near the height is to the vortex, 0..1. The
/// rotation is written with the tangent of half the angle, so that no sine is needed.
fn roll(vortex: &Vortex, q: Point) -> (Point, f64) {
    let (x, z) = (q[0] - vortex.center[0], q[2] - vortex.center[2]);
    let rho = (x * x + z * z).sqrt();
    let b = q[1] - vortex.center[1] - vortex.tilt[0] * x - vortex.tilt[1] * z;
    let from_plane = b / vortex.reach;
    let nearness = (1.0 - from_plane * from_plane).max(0.0);
    let a = rho - vortex.radius;
    let near = 1.0 - (a * a + b * b) / (vortex.reach * vortex.reach);
    if near <= 0.0 || rho == 0.0 {
        return (q, nearness);
    }
    let t = vortex.half_turn * near * near;
    let (cos, sin) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
    let stretch = (vortex.radius + a * cos - b * sin) / rho;
    let turned =
        [vortex.center[0] + x * stretch, q[1] + (a * sin + b * cos) - b, vortex.center[2] + z * stretch];
    (turned, nearness)
}
