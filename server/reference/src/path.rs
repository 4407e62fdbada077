//! One path from the eye: an unbiased estimate of a pixel's radiance.

use glam::DVec3;
use proto::scene_file::Orders;
use scene::{Background, Scene};

use crate::environment::Environment;
use crate::light::Source;
use crate::medium::{Flight, Medium, Way};
use crate::random::Random;
use crate::region::Ray;
use crate::scatter::Scatterer;

/// What a scene's light paths need, prepared once.
pub struct Tracer<'a> {
    scene: &'a Scene,
    /// Its matter.
    pub medium: Medium<'a>,
    sources: Vec<Source>,
    /// The image seen behind the volume, if there is one.
    backdrop: Option<Environment>,
    /// Scattering events after which light is not followed: by the scene.
    orders: u32,
    /// Scattering events after which a path is cut: by the request.
    longest: u32,
    /// Whether a ray that left its last scattering event can find light.
    last_ray_matters: bool,
}

/// What a path brought.
#[derive(Debug, Clone, Copy, Default)]
pub struct Traced {
    /// Linear RGB.
    pub radiance: DVec3,
    /// Throughput, largest channel, that was cut off.
    pub cut: f64,
}

impl<'a> Tracer<'a> {
    /// Prepares a scene; paths end after `longest` scattering events.
    pub fn new(scene: &'a Scene, longest: u32) -> Self {
        let sources: Vec<_> = scene.lights.iter().map(Source::new).collect();
        let glows = scene.transfer_function.points.iter().any(|point| point.emission.max_element() > 0.0);
        Self {
            scene,
            medium: Medium::new(scene),
            last_ray_matters: glows || sources.iter().any(Source::can_be_met),
            sources,
            backdrop: backdrop(&scene.background),
            orders: match scene.orders {
                Orders::All => u32::MAX,
                Orders::AtMost(count) => count,
            },
            longest,
        }
    }

    /// Radiance behind the volume along a ray from the eye.
    pub fn background(&self, ray: &Ray) -> DVec3 {
        match (&self.scene.background, &self.backdrop) {
            (Background::Color(color), _) => *color,
            (Background::Image { .. }, Some(image)) => image.radiance(ray.direction),
            (Background::Image { .. }, None) => DVec3::ZERO,
        }
    }

    /// Follows a path that starts with a ray from the eye.
    pub fn trace(&self, eye_ray: Ray, random: &mut Random) -> Traced {
        let mut traced = Traced::default();
        let mut ray = eye_ray;
        let mut throughput = DVec3::ONE;
        let mut flight = self.medium.flight(&ray, Way::View, random);
        if let Flight::Escape = flight {
            traced.radiance = self.background(&ray);
            return traced;
        }
        let mut scatterings = 0;
        loop {
            let (t, s) = match flight {
                Flight::Collision(t, s) => (t, s),
                Flight::Escape => return traced,
                Flight::Lost => {
                    traced.cut += throughput.max_element();
                    return traced;
                }
            };
            let x = ray.at(t);
            // Clipped matter absorbs: the eye's ray meets none, light's may.
            if scatterings > 0 && !self.medium.keeps(x) {
                return traced;
            }
            let matter = self.medium.field.matter_on(self.medium.field.piece(s), s);
            // sigma_a L_e / sigma_t.
            traced.radiance += throughput * (1.0 - matter.albedo) * matter.emission;
            if scatterings == self.orders {
                return traced;
            }
            if scatterings == self.longest {
                traced.cut += throughput.max_element();
                return traced;
            }
            scatterings += 1;

            let material = &self.scene.materials[matter.material];
            let normal = if material.surface > 0.0 { self.medium.field.normal(x) } else { None };
            let scatterer = Scatterer::new(material, matter.albedo, -ray.direction, normal);
            traced.radiance += throughput * self.direct_light(x, &scatterer, random);
            if scatterings == self.orders && !self.last_ray_matters {
                return traced;
            }

            // Go on in a direction chosen by the scattering function.
            let Some(w_i) = scatterer.sample(random) else { return traced };
            let pdf = scatterer.pdf(w_i);
            let scattered = throughput * scatterer.value(w_i) / pdf;
            if scattered == DVec3::ZERO || pdf <= 0.0 {
                return traced;
            }
            // Russian roulette: the brightest channel does not change its value.
            let survival = (scattered.max_element() / throughput.max_element()).min(1.0);
            if random.unit() >= survival {
                return traced;
            }
            throughput = scattered / survival;
            ray = Ray { origin: x, direction: w_i };
            flight = self.medium.flight(&ray, Way::Light, random);
            traced.radiance += throughput * self.light_met(&ray, pdf, flight);
        }
    }

    /// Light scattered at `x` that was looked for in the lights' directions.
    fn direct_light(&self, x: DVec3, scatterer: &Scatterer<'_>, random: &mut Random) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for source in &self.sources {
            let Some(towards) = source.sample(x, random.pair()) else { continue };
            let mut scattered = scatterer.value(towards.w_i) * towards.weight;
            if scattered == DVec3::ZERO {
                continue;
            }
            if let Some(pdf) = towards.pdf {
                scattered *= power_heuristic(pdf, scatterer.pdf(towards.w_i));
            }
            let ray = Ray { origin: x, direction: towards.w_i };
            sum += scattered * self.medium.transmittance(&ray, towards.distance, random);
        }
        sum
    }

    /// Light of the lights that a ray meets before its flight ends. `pdf`: density with which the
    /// scattering function chose the ray. Lights do not block: a ray may meet several.
    fn light_met(&self, ray: &Ray, pdf: f64, flight: Flight) -> DVec3 {
        let end = match flight {
            Flight::Collision(t, _) => t,
            Flight::Escape => f64::INFINITY,
            Flight::Lost => return DVec3::ZERO,
        };
        let met = self.sources.iter().filter_map(|source| source.meet(ray));
        let reached = met.filter(|met| met.distance < end || end == f64::INFINITY);
        reached.map(|met| met.radiance * power_heuristic(pdf, met.pdf)).sum()
    }
}

/// The environment image behind the volume.
fn backdrop(background: &Background) -> Option<Environment> {
    match background {
        Background::Color(_) => None,
        Background::Image { image, world_from_map, scale } => {
            Some(Environment::new(image, *world_from_map, *scale))
        }
    }
}

/// Weight of a direction that was chosen with density `this` and might have been with `other`
/// (Veach 1997). Only the ratio matters, so that no square overflows.
fn power_heuristic(this: f64, other: f64) -> f64 {
    if this <= 0.0 {
        return 0.0;
    }
    let ratio = other / this;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_ways_of_finding_a_light_share_it() {
        for (a, b) in [(1.0, 1.0), (0.3, 7.0), (1e300, 1e-300), (2.0, 0.0)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-12, "{a} {b}");
        }
    }
}
