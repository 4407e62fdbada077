//! Phase functions and BRDFs in f64: the formulas the shaders mirror, and the reflectances the
//! uniform ambient needs. Directions `w_i` (towards the light) and `w_o` (towards the eye) point
//! away from the point; `cos_theta` is between the directions of travel before and after.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use proto::scene_file::{Brdf, Phase};

use crate::material::Material;

/// Density per steradian of scattering by `cos_theta`; integrates to 1 over the sphere.
pub fn phase_function(phase: &Phase, cos_theta: f64) -> f64 {
    match phase {
        Phase::Isotropic => 0.25 / PI,
        Phase::HenyeyGreenstein(p) => {
            let d = 1.0 + p.g * p.g - 2.0 * p.g * cos_theta;
            0.25 / PI * (1.0 - p.g * p.g) / (d * d.sqrt())
        }
        Phase::Schlick(p) => {
            let d = 1.0 - p.k * cos_theta;
            0.25 / PI * (1.0 - p.k * p.k) / (d * d)
        }
    }
}

/// Normalisation of the Blinn-Phong lobe: its reflectance at normal incidence is `specular`
/// (half-vector lobe integrated over the hemisphere).
pub fn blinn_phong_normalisation(exponent: f64) -> f64 {
    (exponent + 2.0) * (exponent + 4.0) / (8.0 * PI * (2f64.powf(-0.5 * exponent) + exponent))
}

/// BRDF without the cosine: x is the factor of the albedo (diffuse), y achromatic (specular).
/// `n` is unit and on the side of `w_o`; light from behind contributes 0.
pub fn brdf(brdf: &Brdf, n: DVec3, w_i: DVec3, w_o: DVec3) -> DVec2 {
    let (n_i, n_o) = (n.dot(w_i), n.dot(w_o).max(1e-4));
    if n_i <= 0.0 {
        return DVec2::ZERO;
    }
    let h = (w_i + w_o).normalize_or_zero();
    let n_h = n.dot(h).clamp(0.0, 1.0);
    match brdf {
        Brdf::Lambert(b) => DVec2::new(b.diffuse / PI, 0.0),
        Brdf::BlinnPhong(b) => {
            let lobe = blinn_phong_normalisation(b.exponent) * n_h.powf(b.exponent);
            DVec2::new(b.diffuse / PI, b.specular * lobe)
        }
        Brdf::Abc(b) => DVec2::new(b.diffuse / PI, b.a / (1.0 + b.b * (1.0 - n_h)).powf(b.c)),
        Brdf::AshikhminShirley(b) => {
            // Ashikhmin, Shirley 2000: An anisotropic Phong BRDF model, eq. 4 and 5.
            let fade = |cosine: f64| 1.0 - (1.0 - 0.5 * cosine).powi(5);
            let diffuse = 28.0 / (23.0 * PI) * b.diffuse * (1.0 - b.specular) * fade(n_i) * fade(n_o);
            let tangent = tangent_of(n);
            let (h_u, h_v) = (h.dot(tangent), h.dot(n.cross(tangent)));
            let across = (h_u * h_u + h_v * h_v).max(1e-12);
            let exponent = (b.exponents[0] * h_u * h_u + b.exponents[1] * h_v * h_v) / across;
            let h_o = h.dot(w_o).clamp(1e-4, 1.0);
            let fresnel = b.specular + (1.0 - b.specular) * (1.0 - h_o).powi(5);
            let scale = ((b.exponents[0] + 1.0) * (b.exponents[1] + 1.0)).sqrt() / (8.0 * PI);
            DVec2::new(diffuse, scale * n_h.powf(exponent) / (h_o * n_i.max(n_o)) * fresnel)
        }
    }
}

/// A unit vector perpendicular to `n` (Duff et al. 2017).
pub fn tangent_of(n: DVec3) -> DVec3 {
    let side = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (side + n.z);
    DVec3::new(1.0 + side * n.x * n.x * a, side * n.x * n.y * a, -side * n.x)
}

/// Share of uniform hemispherical light a surface reflects towards an eye, averaged over the
/// eye's directions with the cosine (bihemispherical reflectance); x diffuse, y specular.
/// Midpoint quadrature: 16 view angles, 48 x 96 light directions.
pub fn ambient_reflectance(material: &Material) -> DVec2 {
    const VIEWS: usize = 16;
    const RINGS: usize = 48;
    const SECTORS: usize = 96;
    let Some(surface) = &material.brdf else {
        return DVec2::ZERO;
    };
    if let Brdf::Lambert(b) = surface {
        return DVec2::new(b.diffuse, 0.0);
    }
    let mut sum = DVec2::ZERO;
    for view in 0..VIEWS {
        // Cosine-weighted: the squared sine is uniform.
        let w_o = direction((view as f64 + 0.5) / VIEWS as f64, 0.0);
        for ring in 0..RINGS {
            for sector in 0..SECTORS {
                let azimuth = 2.0 * PI * (sector as f64 + 0.5) / SECTORS as f64;
                let w_i = direction((ring as f64 + 0.5) / RINGS as f64, azimuth);
                sum += brdf(surface, DVec3::Z, w_i, w_o);
            }
        }
    }
    // Each direction stands for an equal share of the projected hemisphere, pi.
    let reflectance = PI * sum / (VIEWS * RINGS * SECTORS) as f64;
    reflectance.clamp(DVec2::ZERO, DVec2::ONE)
}

fn direction(sine_squared: f64, azimuth: f64) -> DVec3 {
    let sine = sine_squared.sqrt();
    DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), (1.0 - sine_squared).sqrt())
}

#[cfg(test)]
mod tests {
    use proto::scene_file::{Abc, AshikhminShirley, BlinnPhong, HenyeyGreenstein, Lambert, Schlick};

    use super::*;

    #[test]
    fn phase_functions_integrate_to_one_and_scatter_forward() {
        let phases = [
            Phase::Isotropic,
            Phase::HenyeyGreenstein(HenyeyGreenstein { g: 0.7 }),
            Phase::HenyeyGreenstein(HenyeyGreenstein { g: -0.4 }),
            Phase::Schlick(Schlick { k: 0.8 }),
        ];
        for phase in &phases {
            let n = 200_000;
            let integral: f64 = (0..n)
                .map(|i| phase_function(phase, (i as f64 + 0.5) / n as f64 * 2.0 - 1.0) * 4.0 * PI / n as f64)
                .sum();
            assert!((integral - 1.0).abs() < 1e-6, "{phase:?}: {integral}");
        }
        assert!(phase_function(&phases[1], 1.0) > phase_function(&phases[1], -1.0));
    }

    #[test]
    fn surfaces_reflect_no_more_than_they_are_given() {
        let material = |b| Material { phase: Phase::Isotropic, surface: 1.0, brdf: Some(b) };
        let lambert = ambient_reflectance(&material(Brdf::Lambert(Lambert { diffuse: 0.6 })));
        assert_eq!(lambert, DVec2::new(0.6, 0.0));
        for exponent in [0.0, 5.0, 50.0, 400.0] {
            let b = BlinnPhong { diffuse: 0.5, specular: 0.4, exponent };
            let r = ambient_reflectance(&material(Brdf::BlinnPhong(b)));
            assert!((r.x - 0.5).abs() < 1e-9 && r.y > 0.05 && r.y <= 0.4, "{exponent}: {r}");
        }
        let b = AshikhminShirley { diffuse: 1.0, specular: 0.05, exponents: [10.0, 100.0] };
        let r = ambient_reflectance(&material(Brdf::AshikhminShirley(b)));
        assert!(r.x + r.y < 1.0 && r.x > 0.7, "{r}");
        let b = Abc { diffuse: 0.3, a: 0.1, b: 50.0, c: 1.5 };
        assert!(ambient_reflectance(&material(Brdf::Abc(b))).y > 0.0);
    }

    #[test]
    fn reciprocity() {
        let b =
            Brdf::AshikhminShirley(AshikhminShirley { diffuse: 0.7, specular: 0.1, exponents: [20.0, 60.0] });
        let (a, c) = (direction(0.3, 0.4), direction(0.6, 2.0));
        assert!((brdf(&b, DVec3::Z, a, c) - brdf(&b, DVec3::Z, c, a)).length() < 1e-12);
    }
}
