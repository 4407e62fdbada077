//! The test signal for reconstruction filters of Marschner and Lobb, "An Evaluation of
//! Reconstruction Filters for Volume Rendering", IEEE Visualization 1994:
//!
//! `rho(x,y,z) = (1 - sin(pi z / 2) + alpha (1 + rho_r(sqrt(x^2 + y^2)))) / (2 (1 + alpha))`,
//! `rho_r(r) = cos(2 pi f_M cos(pi r / 2))`, on -1..1 along each axis, `f_M = 6`,
//! `alpha = 0.25`. The paper samples it at 40^3 and shows the surface `rho = 0.5`.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::grid::Point;

/// Frequency of the ripple.
pub const FREQUENCY: f64 = 6.0;
/// Amplitude of the ripple.
pub const ALPHA: f64 = 0.25;

/// The signal at a world position; the unit box is -1..1 of the paper.
pub(crate) fn value(p: Point) -> f64 {
    let [x, y, z] = p.map(|c| 2.0 * c);
    let ripple = libm::cos(TAU * FREQUENCY * libm::cos(FRAC_PI_2 * (x * x + y * y).sqrt()));
    (1.0 - libm::sin(FRAC_PI_2 * z) + ALPHA * (1.0 + ripple)) / (2.0 * (1.0 + ALPHA))
}
