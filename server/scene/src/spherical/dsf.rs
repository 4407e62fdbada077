//! Discrete spherical functions (Zhang, Dong, Ma 2013: Real-Time Volume Rendering in Dynamic Lighting
//! Environments Using Precomputed Photon Mapping, section 5): values at even directions, and between
//! them their mean, weighted by a kernel that ends where the next direction begins.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::healpix;
use super::icosphere::{Icosphere, angle};
use super::sky::{FINE_NSIDE, Sky};

/// Pixels of a basis function when its solid angle is measured.
const PIXELS_OF_A_FUNCTION: usize = 300;
/// Pixels along the radius of a function, at least, when an environment is projected, if there are
/// enough of them.
const PIXELS_OF_A_RADIUS: f64 = 8.0;
/// Pixels of a sky that a thread takes at a time.
const PIXELS_AT_ONCE: usize = 1024;
/// The Gaussian ends after so many standard deviations: at 0.03 % of its peak.
const FILTER_END: f64 = 4.0;
/// Pixels along a standard deviation, at least, if there are enough of them.
const PIXELS_OF_A_DEVIATION: f64 = 4.0;

/// The coarsest map whose pixels have at most this edge, radians; the finest if there is none.
fn nside_for(edge: f64) -> usize {
    let mut nside = FINE_NSIDE;
    while nside > 1 && healpix::solid_angle(nside / 2).sqrt() < edge {
        nside /= 2;
    }
    nside
}

/// A basis of such functions: each is the interpolation of 1 at one direction and 0 at all others.
#[derive(Debug, Clone)]
pub struct Dsf {
    sphere: Icosphere,
    /// Radius of the kernel: the smallest angle between two directions, radians.
    radius: f64,
    /// Its cosine, a little less.
    nearest: f64,
    /// Of each triangle the directions whose kernels reach into it: `near[starts[t]..starts[t + 1]]`.
    near: Vec<usize>,
    starts: Vec<usize>,
    /// Integral of each basis function, steradian.
    solid_angles: Vec<f64>,
}

impl Dsf {
    /// With 12, 42, 162, 642 or 2562 directions for 0..=4 subdivisions.
    pub fn new(subdivisions: usize) -> Self {
        let sphere = Icosphere::new(subdivisions);
        let radius = sphere.smallest_angle();
        let (mut near, mut starts) = (Vec::new(), vec![0]);
        for corners in sphere.triangles() {
            let [a, b, c] = corners.map(|corner| sphere.vertices[corner]);
            let middle = (a + b + c).normalize();
            let reach =
                radius + [a, b, c].map(|corner| angle(corner, middle)).into_iter().fold(0.0, f64::max);
            let cosine = (reach + 1e-9).cos();
            let reaches = |&direction: &usize| sphere.vertices[direction].dot(middle) > cosine;
            near.extend((0..sphere.vertices.len()).filter(reaches));
            starts.push(near.len());
        }
        let nearest = (radius + 1e-9).cos();
        let mut dsf = Self { sphere, radius, nearest, near, starts, solid_angles: Vec::new() };
        dsf.solid_angles = dsf.measured();
        dsf
    }

    /// Integrals of the basis functions; they sum to 4 pi because the functions sum to 1.
    fn measured(&self) -> Vec<f64> {
        let wanted = (self.count() * PIXELS_OF_A_FUNCTION / 12) as f64;
        let nside = (wanted.sqrt() as usize).next_power_of_two();
        let mut sums = vec![0.0; self.count()];
        let weights: Vec<_> = healpix::centres(nside).into_par_iter().map(|w| self.weights(w)).collect();
        for (index, weight) in weights.into_iter().flatten() {
            sums[index] += weight * healpix::solid_angle(nside);
        }
        sums
    }

    /// Basis functions.
    pub fn count(&self) -> usize {
        self.sphere.vertices.len()
    }

    /// The directions at which the functions are 1, unit vectors.
    pub fn directions(&self) -> &[DVec3] {
        &self.sphere.vertices
    }

    /// Radius of the kernel, radians.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Integral of each basis function over the sphere, steradian.
    pub fn solid_angles(&self) -> &[f64] {
        &self.solid_angles
    }

    /// The basis functions that are not 0 at a unit direction, with their values, which sum to 1
    /// (eq. 7 with the kernel of eq. 8).
    pub fn weights(&self, direction: DVec3) -> Vec<(usize, f64)> {
        let triangle = self.sphere.triangle_of(direction);
        let candidates = &self.near[self.starts[triangle]..self.starts[triangle + 1]];
        let kernel = |&index: &usize| {
            if self.sphere.vertices[index].dot(direction) < self.nearest {
                return None;
            }
            let share = angle(self.sphere.vertices[index], direction) / self.radius;
            let below = 1.0 - share * share;
            (below > 0.0).then_some((index, below * below * below))
        };
        let mut weights: Vec<(usize, f64)> = candidates.iter().filter_map(kernel).collect();
        let sum: f64 = weights.iter().map(|weight| weight.1).sum();
        weights.iter_mut().for_each(|weight| weight.1 /= sum);
        weights
    }

    /// The function with these coefficients at a unit direction (eq. 10).
    pub fn evaluate(&self, coefficients: &[DVec3], direction: DVec3) -> DVec3 {
        self.weights(direction).into_iter().map(|(index, weight)| weight * coefficients[index]).sum()
    }

    /// Coefficients of an environment turned by `world_from_map`: its mean under each function. So light
    /// is neither lost nor won, wherever a sun stands, and the sum of lights is the light of their sum.
    pub fn project(&self, sky: &Sky, world_from_map: DMat3) -> Vec<DVec3> {
        let nside = nside_for(self.radius / PIXELS_OF_A_RADIUS);
        let (centres, flux) = (healpix::centres(nside), sky.coarser(nside));
        let pixels: Vec<(DVec3, DVec3)> = centres.into_iter().zip(flux).collect();
        // In pieces of fixed size, summed in order: threads make no difference.
        let piece = |pixels: &[(DVec3, DVec3)]| -> Vec<(usize, [DVec3; 2])> {
            let solid_angle = DVec3::splat(healpix::solid_angle(nside));
            let shares = |(centre, flux): &(DVec3, DVec3)| {
                let flux = *flux;
                let weights = self.weights(world_from_map * *centre).into_iter();
                weights.map(move |(index, weight)| (index, [weight * flux, weight * solid_angle]))
            };
            pixels.iter().flat_map(shares).collect()
        };
        let pieces: Vec<_> = pixels.par_chunks(PIXELS_AT_ONCE).map(piece).collect();
        let mut sums = vec![[DVec3::ZERO; 2]; self.count()];
        for (index, [light, solid_angle]) in pieces.into_iter().flatten() {
            sums[index][0] += light;
            sums[index][1] += solid_angle;
        }
        sums.into_iter().map(|[light, solid_angle]| light / solid_angle).collect()
    }

    /// The same as published (section 8.1), for comparison: the mean around each direction, weighted by a
    /// Gaussian and by solid angles, all times what makes the integral over the sphere the
    /// environment's. `width`: the Gaussian's standard deviation in smallest
    /// angles between directions, > 0.
    pub fn project_filtered(&self, sky: &Sky, world_from_map: DMat3, width: f64) -> Vec<DVec3> {
        let deviation = width * self.radius;
        let nside = nside_for(deviation / PIXELS_OF_A_DEVIATION);
        let (centres, flux) = (healpix::centres(nside), sky.coarser(nside));
        let (sharpness, nearest) = (0.5 / (deviation * deviation), (FILTER_END * deviation).min(PI).cos());
        let mean = |direction: &DVec3| {
            let towards = world_from_map.transpose() * *direction;
            let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
            for (centre, flux) in centres.iter().zip(&flux) {
                if centre.dot(towards) > nearest {
                    // The squared chord is the squared angle, about; it is as good a distance.
                    let weight = (-sharpness * (*centre - towards).length_squared()).exp();
                    sum += weight * *flux;
                    weights += weight * healpix::solid_angle(nside);
                }
            }
            sum / weights
        };
        let mut coefficients: Vec<DVec3> = self.directions().par_iter().map(mean).collect();
        let total = self.integral(&coefficients);
        let factor = DVec3::select(total.cmpgt(DVec3::ZERO), sky.total() / total, DVec3::ONE);
        coefficients.iter_mut().for_each(|coefficient| *coefficient *= factor);
        coefficients
    }

    /// Coefficients of light from one unit direction with this irradiance on a plane it is
    /// perpendicular to: the three directions around it share it, each spread over the solid angle of
    /// its function.
    pub fn directional(&self, towards: DVec3, irradiance: DVec3) -> Vec<DVec3> {
        let mut coefficients = vec![DVec3::ZERO; self.count()];
        for (index, weight) in self.sphere.barycentric(towards) {
            coefficients[index] += irradiance * (weight / self.solid_angles[index]);
        }
        coefficients
    }

    /// Integral over the sphere of the function with these coefficients.
    pub fn integral(&self, coefficients: &[DVec3]) -> DVec3 {
        coefficients.iter().zip(&self.solid_angles).map(|(c, &solid_angle)| *c * solid_angle).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_sum_to_one_everywhere_and_reach_everywhere() {
        for subdivisions in 0..=4 {
            let dsf = Dsf::new(subdivisions);
            let nside = if subdivisions == 4 { 256 } else { 64 };
            for direction in healpix::centres(nside) {
                let weights = dsf.weights(direction);
                let sum: f64 = weights.iter().map(|weight| weight.1).sum();
                assert!((sum - 1.0).abs() < 1e-12, "{subdivisions} {direction}");
                // Before it is divided by their sum: nowhere is a hole, and nowhere nearly one.
                let deepest = weights.iter().map(|&(k, _)| angle(dsf.directions()[k], direction));
                assert!(deepest.fold(f64::MAX, f64::min) < 0.8 * dsf.radius(), "{subdivisions} {direction}");
                assert!(weights.len() <= 6);
            }
            let whole: f64 = dsf.solid_angles().iter().sum();
            assert!((whole - 4.0 * PI).abs() < 1e-9);
            // Even, but for the vertices of the icosahedron, which have five neighbours.
            let even = 4.0 * PI / dsf.count() as f64;
            assert!(dsf.solid_angles().iter().all(|s| (0.6..1.4).contains(&(s / even))));
        }
    }

    #[test]
    fn candidates_of_a_triangle_are_all_that_reach_into_it() {
        let dsf = Dsf::new(3);
        for direction in healpix::centres(32) {
            let all = dsf.directions().iter().filter(|&&w| angle(w, direction) < dsf.radius()).count();
            assert_eq!(dsf.weights(direction).iter().filter(|w| w.1 > 1e-30).count(), all);
        }
    }

    #[test]
    fn values_at_the_directions_come_back() {
        let dsf = Dsf::new(2);
        let coefficients: Vec<DVec3> = (0..dsf.count()).map(|k| DVec3::new(k as f64, 1.0, -1.0)).collect();
        for (k, &direction) in dsf.directions().iter().enumerate() {
            let value = dsf.evaluate(&coefficients, direction);
            assert!((value - coefficients[k]).length() < 1e-9 * (1.0 + k as f64), "{value}");
        }
    }

    #[test]
    fn light_is_neither_lost_nor_won() {
        let power = DVec3::new(3.0, 1.0, 0.5);
        let uniform = Sky::uniform(power);
        for subdivisions in 1..=3 {
            let dsf = Dsf::new(subdivisions);
            for coefficient in dsf.project(&uniform, DMat3::IDENTITY) {
                assert!((coefficient - power).length() < 1e-12, "{coefficient}");
            }
            for direction in [DVec3::Y, DVec3::new(0.48, 0.6, 0.64), dsf.directions()[7]] {
                let sun = dsf.directional(direction, power);
                assert!((dsf.integral(&sun) - power).length() < 1e-12);
                let middle: DVec3 = sun
                    .iter()
                    .zip(dsf.directions())
                    .zip(dsf.solid_angles())
                    .map(|((s, w), o)| s.x * o * *w)
                    .sum();
                assert!(angle(middle.normalize(), direction) < 0.2 * dsf.radius());
            }
        }
    }

    #[test]
    fn a_sun_between_directions_keeps_its_light_and_its_place() {
        let dsf = Dsf::new(2);
        for towards in [dsf.directions()[60], DVec3::new(0.48, 0.6, 0.64), DVec3::new(-0.6, 0.0, 0.8)] {
            let sky = Sky::from_function(|w| DVec3::splat(if angle(w, towards) < 0.05 { 1e4 } else { 1.0 }));
            let coefficients = dsf.project(&sky, DMat3::IDENTITY);
            let ratio = dsf.integral(&coefficients) / sky.total();
            assert!((ratio.x - 1.0).abs() < 0.02, "{towards}: {ratio}");
            for (coefficient, &w) in coefficients.iter().zip(dsf.directions()) {
                if angle(w, towards) > dsf.radius() + 0.06 {
                    assert!((coefficient.x - 1.0).abs() < 1e-12, "the sky beside it is as it was");
                }
            }
        }
    }

    #[test]
    fn an_environment_is_where_it_was_and_turns() {
        let spot = |towards: DVec3| {
            Sky::from_function(|w| DVec3::splat(if angle(w, towards) < 0.3 { 5.0 } else { 0.2 }))
        };
        let dsf = Dsf::new(3);
        let towards = DVec3::new(0.48, 0.6, 0.64);
        let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.1);
        for (sky, world_from_map) in
            [(spot(towards), DMat3::IDENTITY), (spot(turn.transpose() * towards), turn)]
        {
            let coefficients = dsf.project(&sky, world_from_map);
            assert!((dsf.integral(&coefficients) - sky.total()).length() < 1e-2 * sky.total().length());
            for (coefficient, &w) in coefficients.iter().zip(dsf.directions()) {
                let off = angle(w, towards) - 0.3;
                // The border is blurred by the functions.
                if off.abs() > dsf.radius() {
                    let expected = if off < 0.0 { 5.0 } else { 0.2 };
                    assert!((coefficient.x / expected - 1.0).abs() < 0.05, "{off}: {coefficient}");
                }
            }
        }
    }
}
