//! Scattering at a place: `(1 - w) * phase + w * f_r * |n . w_i|`.

use glam::DVec3;
use proto::scene_file::Brdf;
use scene::material::Material;

use crate::random::Random;
use crate::{brdf, phase};

/// How matter at a place scatters light towards `w_o`.
pub struct Scatterer<'a> {
    material: &'a Material,
    albedo: DVec3,
    w_o: DVec3,
    /// BRDF, unit normal on the side of `w_o`, and weight; `None` where there is no surface.
    surface: Option<(&'a Brdf, DVec3, f64)>,
}

impl<'a> Scatterer<'a> {
    /// `normal` is unit, on either side; `None` where the field is flat.
    pub fn new(material: &'a Material, albedo: DVec3, w_o: DVec3, normal: Option<DVec3>) -> Self {
        let brdf = material.brdf.as_ref().filter(|_| material.surface > 0.0);
        let surface = brdf.zip(normal).map(|(brdf, normal)| {
            let n = if normal.dot(w_o) < 0.0 { -normal } else { normal };
            (brdf, n, material.surface)
        });
        Self { material, albedo, w_o, surface }
    }

    /// Weight of the surface.
    fn weight(&self) -> f64 {
        self.surface.map_or(0.0, |(_, _, weight)| weight)
    }

    fn cos_theta(&self, w_i: DVec3) -> f64 {
        (-w_i).dot(self.w_o)
    }

    /// Radiance scattered per unit of extinction, of irradiance from `w_i`; linear RGB, per
    /// steradian.
    pub fn value(&self, w_i: DVec3) -> DVec3 {
        let phase = phase::value(&self.material.phase, self.cos_theta(w_i));
        let mut value = (1.0 - self.weight()) * phase * self.albedo;
        if let Some((brdf, n, weight)) = self.surface {
            let f_r = brdf::value(brdf, n, w_i, self.w_o);
            value += weight * n.dot(w_i).max(0.0) * (f_r.x * self.albedo + f_r.y);
        }
        value
    }

    /// Density per steradian with which [`Scatterer::sample`] chooses `w_i`.
    pub fn pdf(&self, w_i: DVec3) -> f64 {
        let mut pdf = (1.0 - self.weight()) * phase::pdf(&self.material.phase, self.cos_theta(w_i));
        if let Some((brdf, n, weight)) = self.surface {
            pdf += weight * brdf::pdf(brdf, self.albedo.max_element(), n, w_i, self.w_o);
        }
        pdf
    }

    /// A direction towards light; `None` where nothing comes of the choice.
    pub fn sample(&self, random: &mut Random) -> Option<DVec3> {
        let (choice, lobe, uv) = (random.unit(), random.unit(), random.pair());
        match self.surface {
            Some((brdf, n, weight)) if choice < weight => {
                brdf::sample(brdf, self.albedo.max_element(), n, self.w_o, lobe, uv)
            }
            // Followed from the eye, light travels along -w_o before and -w_i after; phase
            // functions depend on the angle alone.
            _ => Some(phase::sample(&self.material.phase, -self.w_o, uv)),
        }
    }
}
