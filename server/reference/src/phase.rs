//! Phase functions. `cos_theta` is between the directions of travel before and after scattering:
//! 1 is straight on, so a positive asymmetry scatters forward.

use std::f64::consts::PI;

use glam::DVec3;
use proto::scene_file::Phase;

use crate::frame;

/// Below this asymmetry Henyey-Greenstein is sampled as isotropic: its inverse divides by g. The
/// weight of a sample corrects what little that changes.
const NEARLY_ISOTROPIC: f64 = 1e-4;

/// Density per steradian; integrates to 1 over the sphere.
pub fn value(phase: &Phase, cos_theta: f64) -> f64 {
    match phase {
        Phase::Isotropic => 1.0 / (4.0 * PI),
        Phase::HenyeyGreenstein(p) => henyey_greenstein(p.g, cos_theta),
        Phase::Schlick(p) => {
            let base = 1.0 - p.k * cos_theta;
            (1.0 - p.k * p.k) / (4.0 * PI * base * base)
        }
    }
}

fn henyey_greenstein(g: f64, cos_theta: f64) -> f64 {
    // 1 + g^2 - 2 g cos, in a form that does not cancel near the peak.
    let base = (1.0 - g.abs()).powi(2) + 2.0 * g.abs() * (1.0 - g.signum() * cos_theta);
    (1.0 - g * g) / (4.0 * PI * base.powf(1.5))
}

/// Density per steradian with which [`sample`] chooses directions.
pub fn pdf(phase: &Phase, cos_theta: f64) -> f64 {
    match phase {
        Phase::HenyeyGreenstein(p) if p.g.abs() < NEARLY_ISOTROPIC => 1.0 / (4.0 * PI),
        _ => value(phase, cos_theta),
    }
}

/// A direction of travel after scattering, `travel` being the one before.
pub fn sample(phase: &Phase, travel: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let cos_theta = match phase {
        Phase::HenyeyGreenstein(p) if p.g.abs() >= NEARLY_ISOTROPIC => {
            let ratio = (1.0 - p.g * p.g) / (1.0 - p.g + 2.0 * p.g * u);
            (1.0 + p.g * p.g - ratio * ratio) / (2.0 * p.g)
        }
        // The distribution of 1 / (1 - k cos) is uniform between its values at the ends.
        Phase::Schlick(p) => (2.0 * u + p.k - 1.0) / (1.0 + p.k * (2.0 * u - 1.0)),
        _ => 2.0 * u - 1.0,
    };
    frame::around(travel, cos_theta.clamp(-1.0, 1.0), 2.0 * PI * v)
}
