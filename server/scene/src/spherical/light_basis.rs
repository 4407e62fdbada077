//! Functions that light from infinity is made of: three families with one face, to be compared.

use glam::{DMat3, DVec3};

use super::dsf::Dsf;
use super::sh::Harmonics;
use super::sky::Sky;
use super::srbf::Srbf;

/// A basis of functions on the sphere. Coefficients are radiance, linear RGB, or, for spherical
/// harmonics, radiance times the root of a solid angle.
#[derive(Debug, Clone)]
pub enum LightBasis {
    /// Local interpolation between even directions.
    Dsf(Dsf),
    /// Gaussians about even directions.
    Srbf(Srbf),
    /// Spherical harmonics.
    Harmonics(Harmonics),
}

impl LightBasis {
    /// Name in tables.
    pub fn name(&self) -> &'static str {
        match self {
            LightBasis::Dsf(_) => "DSF",
            LightBasis::Srbf(_) => "SRBF",
            LightBasis::Harmonics(_) => "SH",
        }
    }

    /// Basis functions.
    pub fn count(&self) -> usize {
        match self {
            LightBasis::Dsf(basis) => basis.count(),
            LightBasis::Srbf(basis) => basis.count(),
            LightBasis::Harmonics(basis) => basis.count(),
        }
    }

    /// Coefficients of an environment turned by `world_from_map`.
    pub fn project(&self, sky: &Sky, world_from_map: DMat3) -> Vec<DVec3> {
        match self {
            LightBasis::Dsf(basis) => basis.project(sky, world_from_map),
            LightBasis::Srbf(basis) => basis.project(sky, world_from_map),
            LightBasis::Harmonics(basis) => basis.project(sky, world_from_map),
        }
    }

    /// Coefficients of light from one unit direction with this irradiance on a plane it is
    /// perpendicular to.
    pub fn directional(&self, towards: DVec3, irradiance: DVec3) -> Vec<DVec3> {
        match self {
            LightBasis::Dsf(basis) => basis.directional(towards, irradiance),
            LightBasis::Srbf(basis) => basis.directional(towards, irradiance),
            LightBasis::Harmonics(basis) => basis.directional(towards, irradiance),
        }
    }

    /// The function with these coefficients at a unit direction.
    pub fn evaluate(&self, coefficients: &[DVec3], direction: DVec3) -> DVec3 {
        match self {
            LightBasis::Dsf(basis) => basis.evaluate(coefficients, direction),
            LightBasis::Srbf(basis) => basis.evaluate(coefficients, direction),
            LightBasis::Harmonics(basis) => basis.evaluate(coefficients, direction),
        }
    }
}
