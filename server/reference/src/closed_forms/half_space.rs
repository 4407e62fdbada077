//! Isotropic scattering of all orders in a half-space (Chandrasekhar, Radiative Transfer, 1950,
//! chapters III and V).

use std::f64::consts::PI;

use super::quadrature::gauss_legendre;

/// Nodes of the integral equation.
const NODES: usize = 64;
/// Relative change of H at which its iteration ends, and the most rounds of it.
const CONVERGED: f64 = 1e-13;
const MAX_ROUNDS: usize = 10_000;

/// Homogeneous isotropic matter that fills the space behind a plane.
pub struct HalfSpace {
    albedo: f64,
    /// Cosine, weight and H at the nodes.
    nodes: Vec<(f64, f64, f64)>,
}

impl HalfSpace {
    /// Solves for H by iteration; `albedo` in 0..1.
    pub fn new(albedo: f64) -> Self {
        // H rises steeply at grazing angles: nodes in the cube root of the cosine.
        let rule = gauss_legendre(NODES);
        let nodes = rule.into_iter().map(|(x, weight)| (x * x * x, 3.0 * x * x * weight, 1.0)).collect();
        let mut half_space = Self { albedo, nodes };
        for _ in 0..MAX_ROUNDS {
            let mut change: f64 = 0.0;
            for k in 0..NODES {
                let (cosine, weight, before) = half_space.nodes[k];
                let after = half_space.h(cosine);
                change = change.max((after / before - 1.0).abs());
                half_space.nodes[k] = (cosine, weight, after);
            }
            if change < CONVERGED {
                break;
            }
        }
        half_space
    }

    /// Chandrasekhar's H at the cosine of an angle from the normal:
    /// `1 / H = sqrt(1 - albedo) + albedo / 2 * integral of m H(m) / (m + cosine) over m`.
    pub fn h(&self, cosine: f64) -> f64 {
        let terms = self.nodes.iter().map(|(m, weight, h)| weight * m * h / (m + cosine));
        1.0 / ((1.0 - self.albedo).sqrt() + 0.5 * self.albedo * terms.sum::<f64>())
    }

    /// Radiance at `cos_out` from the normal per irradiance, on a plane that faces the light, of a
    /// directional light at `cos_in`.
    pub fn reflected(&self, cos_in: f64, cos_out: f64) -> f64 {
        self.albedo / (4.0 * PI) * cos_in / (cos_in + cos_out) * self.h(cos_in) * self.h(cos_out)
    }

    /// Radiance at `cos_out` from the normal per radiance of a uniform environment.
    pub fn reflected_environment(&self, cos_out: f64) -> f64 {
        1.0 - (1.0 - self.albedo).sqrt() * self.h(cos_out)
    }
}

#[cfg(test)]
mod tests {
    use super::super::quadrature::integrate;
    use super::*;

    #[test]
    fn h_has_its_known_moments() {
        for albedo in [0.3f64, 0.5, 0.9, 0.99, 1.0] {
            let half_space = HalfSpace::new(albedo);
            let zeroth = integrate(|m| half_space.h(m), 0.0, 1.0, 1e-10);
            let expected = 2.0 * (1.0 - (1.0 - albedo).sqrt()) / albedo;
            assert!((zeroth - expected).abs() < 1e-7, "{albedo}: {zeroth} {expected}");
        }
        let conservative = HalfSpace::new(1.0);
        let first = integrate(|m| m * conservative.h(m), 0.0, 1.0, 1e-10);
        assert!((first - 2.0 / 3f64.sqrt()).abs() < 1e-7, "{first}");
    }

    #[test]
    fn h_satisfies_its_other_equation() {
        let half_space = HalfSpace::new(0.9);
        for cosine in [0.05, 0.4, 1.0] {
            let h = half_space.h(cosine);
            let integral = integrate(|m| half_space.h(m) / (m + cosine), 0.0, 1.0, 1e-10);
            assert!((h - (1.0 + 0.45 * cosine * h * integral)).abs() < 1e-7, "{cosine}");
        }
    }

    #[test]
    fn a_directional_light_from_everywhere_is_an_environment() {
        let half_space = HalfSpace::new(0.9);
        let over_sky = integrate(|m| 2.0 * PI * half_space.reflected(m, 0.7), 0.0, 1.0, 1e-10);
        assert!((over_sky - half_space.reflected_environment(0.7)).abs() < 1e-7, "{over_sky}");
    }
}
