//! Pictures that can be written down: what every method is held against first.
//!
//! Units as everywhere: lengths in world units, extinction per world unit. One colour channel at a
//! time. Errors of the quadratures are below 1e-6 of the result.

mod half_space;
mod quadrature;

use std::f64::consts::PI;

use glam::DVec3;

pub use half_space::HalfSpace;
use quadrature::integrate;

/// Difference between a rule and its halves that ends the halving of outer and inner integrals,
/// absolute; the error is much smaller. Results are of the order of 1.
const OUTER_TOLERANCE: f64 = 1e-7;
const INNER_TOLERANCE: f64 = 1e-6;

/// Share of light that passes `length` of homogeneous matter.
pub fn transmittance(sigma_t: f64, length: f64) -> f64 {
    (-sigma_t * length).exp()
}

/// Radiance of homogeneous glowing matter of albedo 0, `length` deep along the ray.
pub fn emission(sigma_t: f64, emitted: f64, length: f64) -> f64 {
    -emitted * (-sigma_t * length).exp_m1()
}

/// Irradiance of a point light on a plane that faces it.
pub fn point_irradiance(intensity: f64, distance: f64) -> f64 {
    intensity / (distance * distance)
}

/// Radiance of any phase-only matter of albedo 1 in a uniform environment, and of a surface that
/// reflects all: it cannot be told from the environment.
pub fn white_furnace(radiance: f64) -> f64 {
    radiance
}

/// Isotropic phase function, times an albedo: a scattering function for [`HomogeneousBox`].
pub fn isotropic(albedo: f64) -> impl Fn(DVec3, DVec3) -> f64 {
    move |_, _| albedo / (4.0 * PI)
}

/// Henyey-Greenstein phase function, times an albedo; g > 0 scatters forward.
pub fn henyey_greenstein(albedo: f64, g: f64) -> impl Fn(DVec3, DVec3) -> f64 {
    move |w_i, w_o| {
        let cos_theta = -w_i.dot(w_o);
        albedo * (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos_theta).powf(1.5))
    }
}

/// Lambert surface with a fixed normal, which is turned to the eye's side; the cosine is included.
pub fn lambert(reflectance: f64, normal: DVec3) -> impl Fn(DVec3, DVec3) -> f64 {
    move |w_i, w_o| {
        let n = if normal.dot(w_o) < 0.0 { -normal } else { normal };
        reflectance / PI * n.dot(w_i).max(0.0)
    }
}

/// A box of homogeneous matter around the origin.
#[derive(Debug, Clone, Copy)]
pub struct HomogeneousBox {
    /// Edges, world units.
    pub size: DVec3,
    /// Extinction.
    pub sigma_t: f64,
}

impl HomogeneousBox {
    /// Distances at which a ray with unit `direction` enters and leaves; `None` if it misses.
    pub fn chord(&self, origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let (a, b) = ((-0.5 * self.size - origin) / direction, (0.5 * self.size - origin) / direction);
        let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        (near < far).then_some([near, far])
    }

    /// Share of light from behind that reaches the eye.
    pub fn transmittance(&self, origin: DVec3, direction: DVec3) -> f64 {
        self.chord(origin, direction).map_or(1.0, |[near, far]| transmittance(self.sigma_t, far - near))
    }

    /// Way from a point inside to the surface.
    fn way_out(&self, x: DVec3, direction: DVec3) -> f64 {
        let ways: [f64; 3] = std::array::from_fn(|axis| match direction[axis] {
            0.0 => f64::INFINITY,
            slope => (0.5 * self.size[axis] - x[axis] * slope.signum()) / slope.abs(),
        });
        ways[0].min(ways[1]).min(ways[2]).max(0.0)
    }

    /// Radiance towards the eye of light scattered once, `scattered(x)` being what a unit of
    /// extinction at `x` sends there.
    fn seen(&self, origin: DVec3, direction: DVec3, scattered: impl Fn(DVec3) -> f64) -> f64 {
        let Some([near, far]) = self.chord(origin, direction) else { return 0.0 };
        // In the share of light stopped before t the weight is 1.
        let stopped = 1.0 - transmittance(self.sigma_t, far - near);
        let at = |share: f64| origin + (near - (-share).ln_1p() / self.sigma_t) * direction;
        integrate(|share| scattered(at(share)), 0.0, stopped, OUTER_TOLERANCE)
    }

    /// Single scattering of a directional light that travels along `travel` with `irradiance`.
    /// `scatter(w_i, w_o)`: per unit of extinction and irradiance, albedo and cosine included.
    pub fn lit_by_directional(
        &self,
        (origin, direction): (DVec3, DVec3),
        (travel, irradiance): (DVec3, f64),
        scatter: impl Fn(DVec3, DVec3) -> f64,
    ) -> f64 {
        let weight = irradiance * scatter(-travel, -direction);
        weight * self.seen(origin, direction, |x| transmittance(self.sigma_t, self.way_out(x, -travel)))
    }

    /// Single scattering of a point light, outside of the box or inside but not on the ray.
    pub fn lit_by_point(
        &self,
        (origin, direction): (DVec3, DVec3),
        (position, intensity): (DVec3, f64),
        scatter: impl Fn(DVec3, DVec3) -> f64,
    ) -> f64 {
        self.seen(origin, direction, |x| {
            let distance = (position - x).length();
            let w_i = (position - x) / distance;
            point_irradiance(intensity, distance)
                * scatter(w_i, -direction)
                * transmittance(self.sigma_t, self.way_out(x, w_i).min(distance))
        })
    }

    /// Single scattering of a uniform environment.
    pub fn lit_by_environment(
        &self,
        (origin, direction): (DVec3, DVec3),
        radiance: f64,
        scatter: impl Fn(DVec3, DVec3) -> f64,
    ) -> f64 {
        self.seen(origin, direction, |x| radiance * self.over_directions(x, |w_i| scatter(w_i, -direction)))
    }

    /// Integral over the directions from a point inside of a function times the transmittance to
    /// the surface. Each face is cut into four triangles around the foot of its perpendicular;
    /// over the polar angle and azimuth there, everything is smooth.
    fn over_directions(&self, x: DVec3, function: impl Fn(DVec3) -> f64) -> f64 {
        let mut sum = 0.0;
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let normal = side * DVec3::AXES[axis];
                let height = (0.5 * self.size[axis] - side * x[axis]).max(0.0);
                for (towards, along) in [(1, 2), (2, 1)] {
                    let (towards, along) = ((axis + towards) % 3, (axis + along) % 3);
                    for edge_side in [-1.0, 1.0] {
                        let edge = edge_side * DVec3::AXES[towards];
                        let to_edge = (0.5 * self.size[towards] - edge_side * x[towards]).max(0.0);
                        let ends = [-1.0, 1.0]
                            .map(|end: f64| (end * 0.5 * self.size[along] - x[along]).atan2(to_edge));
                        let over_azimuth = |azimuth: f64| {
                            let outwards = azimuth.cos() * edge + azimuth.sin() * DVec3::AXES[along];
                            let reach = to_edge / azimuth.cos();
                            let lowest = height / height.hypot(reach).max(f64::MIN_POSITIVE);
                            let over_cosine = |cosine: f64| {
                                let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
                                function(cosine * normal + sine * outwards)
                                    * transmittance(self.sigma_t, height / cosine)
                            };
                            integrate(over_cosine, lowest, 1.0, INNER_TOLERANCE)
                        };
                        sum += integrate(over_azimuth, ends[0], ends[1], INNER_TOLERANCE);
                    }
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: HomogeneousBox = HomogeneousBox { size: DVec3::ONE, sigma_t: 2.0 };

    #[test]
    fn directions_around_a_point_make_a_sphere() {
        let vacuum = HomogeneousBox { sigma_t: 0.0, ..CUBE };
        for x in [DVec3::ZERO, DVec3::new(0.3, -0.2, 0.49), DVec3::new(0.5, 0.1, 0.2)] {
            let whole = vacuum.over_directions(x, |_| 1.0);
            assert!((whole / (4.0 * PI) - 1.0).abs() < 1e-7, "{x}: {whole}");
            let half = vacuum.over_directions(x, |w| w.x.max(0.0));
            assert!((half / PI - 1.0).abs() < 1e-5, "{x}: {half}");
        }
    }

    #[test]
    fn directions_agree_with_a_plain_grid() {
        let x = DVec3::new(0.2, -0.1, 0.35);
        let count = 1000;
        let mut sum = 0.0;
        for k in 0..count * count {
            let at = |i: usize| (i as f64 + 0.5) / count as f64;
            let w = crate::frame::on_sphere([at(k / count), at(k % count)]);
            sum += transmittance(2.0, CUBE.way_out(x, w)) * (1.0 + 0.5 * w.x);
        }
        let grid = 4.0 * PI * sum / (count * count) as f64;
        let exact = CUBE.over_directions(x, |w| 1.0 + 0.5 * w.x);
        assert!((grid / exact - 1.0).abs() < 1e-5, "{grid} {exact}");
    }

    #[test]
    fn light_along_the_view_ray_is_elementary() {
        // The eye looks along -z, light travels along -z: both ways are the depth z, so that the
        // radiance is E p (1 - exp(-2 sigma)) / 2.
        let ray = (DVec3::new(0.1, 0.2, 2.0), -DVec3::Z);
        let got = CUBE.lit_by_directional(ray, (-DVec3::Z, 3.0), isotropic(0.8));
        let expected = 3.0 * 0.8 / (4.0 * PI) * 0.5 * (1.0 - (-4.0f64).exp());
        assert!((got / expected - 1.0).abs() < 1e-9, "{got} {expected}");
        // A far point light is a directional one.
        let far = CUBE.lit_by_point(ray, (DVec3::new(0.0, 0.0, 1e4), 3e8), isotropic(0.8));
        assert!((far / expected - 1.0).abs() < 1e-3, "{far} {expected}");
    }

    #[test]
    fn thin_matter_scatters_the_environment_it_sees() {
        let thin = HomogeneousBox { sigma_t: 1e-4, ..CUBE };
        let ray = (DVec3::new(0.1, 0.2, 2.0), -DVec3::Z);
        let got = thin.lit_by_environment(ray, 5.0, isotropic(0.5));
        assert!((got / (5.0 * 0.5 * 1e-4) - 1.0).abs() < 3e-4, "{got}");
    }
}
