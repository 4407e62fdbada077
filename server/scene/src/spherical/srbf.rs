//! Spherical radial basis functions (Tsai, Shih 2006: All-Frequency Precomputed Radiance Transfer Using
//! Spherical Radial Basis Functions and Clustered Tensor Approximation): Gaussians on the sphere,
//! `exp(lambda (w . w_k - 1))`, about even directions. They are not orthogonal: coefficients are the
//! best in least squares, from the functions' inner products, which have a closed form.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::healpix;
use super::icosphere::Icosphere;
use super::sky::{FINE_NSIDE, Sky};

/// Value of a Gaussian half way to the nearest other one. Narrower ones leave holes, wider ones make
/// the inner products nearly singular.
const VALUE_HALF_WAY: f64 = 0.7;
/// Below this a Gaussian is 0.
const LEAST: f64 = 1e-9;
/// The solver ends at this residual, relative, or after so many steps.
const RESIDUAL: f64 = 1e-10;
const MAX_STEPS: usize = 1000;

/// A basis of such functions, of equal width.
#[derive(Debug, Clone)]
pub struct Srbf {
    directions: Vec<DVec3>,
    sharpness: f64,
    /// Inner products, row by row.
    gram: Vec<f64>,
}

impl Srbf {
    /// With 12, 42, 162, 642 or 2562 functions for 0..=4 subdivisions.
    pub fn new(subdivisions: usize) -> Self {
        let sphere = Icosphere::new(subdivisions);
        let half_way = (0.5 * sphere.smallest_angle()).cos();
        let sharpness = VALUE_HALF_WAY.ln() / (half_way - 1.0);
        let directions = sphere.vertices;
        let inner = |a: &DVec3, b: &DVec3| {
            // Of exp(l (a . w - 1)) and exp(l (b . w - 1)): 4 pi exp(-2 l) sinh(|r|) / |r| with
            // r = l (a + b).
            let r = sharpness * (*a + *b).length();
            let shrink = |x: f64| (x - 2.0 * sharpness).exp();
            if r < 1e-6 { 4.0 * PI * shrink(0.0) } else { 2.0 * PI * (shrink(r) - shrink(-r)) / r }
        };
        let row = |a: &DVec3| directions.iter().map(|b| inner(a, b)).collect::<Vec<f64>>();
        let gram = directions.par_iter().flat_map_iter(row).collect();
        Self { directions, sharpness, gram }
    }

    /// Basis functions.
    pub fn count(&self) -> usize {
        self.directions.len()
    }

    /// The function with these coefficients at a unit direction.
    pub fn evaluate(&self, coefficients: &[DVec3], direction: DVec3) -> DVec3 {
        let terms = self.directions.iter().zip(coefficients);
        terms.map(|(&about, c)| *c * self.value(about, direction)).sum()
    }

    fn value(&self, about: DVec3, direction: DVec3) -> f64 {
        (self.sharpness * (about.dot(direction) - 1.0)).exp()
    }

    /// Coefficients of an environment turned by `world_from_map`, best in least squares.
    pub fn project(&self, sky: &Sky, world_from_map: DMat3) -> Vec<DVec3> {
        let (centres, flux) = (healpix::centres(FINE_NSIDE), sky.coarser(FINE_NSIDE));
        let nearest = 1.0 + LEAST.ln() / self.sharpness;
        let inner = |about: &DVec3| -> DVec3 {
            let towards = world_from_map.transpose() * *about;
            let close = centres.iter().zip(&flux).filter(|(centre, _)| centre.dot(towards) > nearest);
            close.map(|(&centre, flux)| *flux * self.value(towards, centre)).sum()
        };
        let products: Vec<DVec3> = self.directions.par_iter().map(inner).collect();
        self.solve(&products)
    }

    /// Coefficients of light from one unit direction with this irradiance on a plane it is
    /// perpendicular to.
    pub fn directional(&self, towards: DVec3, irradiance: DVec3) -> Vec<DVec3> {
        let products: Vec<DVec3> =
            self.directions.iter().map(|&about| irradiance * self.value(about, towards)).collect();
        self.solve(&products)
    }

    /// Coefficients whose inner products with the functions are these: conjugate gradients, three
    /// channels side by side.
    fn solve(&self, products: &[DVec3]) -> Vec<DVec3> {
        let count = self.count();
        let dot = |a: &[DVec3], b: &[DVec3]| -> DVec3 { a.iter().zip(b).map(|(x, y)| *x * *y).sum() };
        let mut solution = vec![DVec3::ZERO; count];
        let mut residual = products.to_vec();
        let mut way = residual.clone();
        let mut squared = dot(&residual, &residual);
        let aim = squared * (RESIDUAL * RESIDUAL);
        let ratio = |a: DVec3, b: DVec3| DVec3::select(b.cmpgt(DVec3::ZERO), a / b, DVec3::ZERO);
        for _ in 0..MAX_STEPS {
            if !squared.cmpgt(aim).any() {
                break;
            }
            let row = |row: &[f64]| -> DVec3 { row.iter().zip(&way).map(|(g, w)| *w * *g).sum() };
            let image: Vec<DVec3> = self.gram.par_chunks(count).map(row).collect();
            let step = ratio(squared, dot(&way, &image));
            for i in 0..count {
                solution[i] += step * way[i];
                residual[i] -= step * image[i];
            }
            let next = dot(&residual, &residual);
            let keep = ratio(next, squared);
            way.iter_mut().zip(&residual).for_each(|(way, r)| *way = *r + keep * *way);
            squared = next;
        }
        solution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inner_products_are_the_integrals() {
        let srbf = Srbf::new(1);
        let integral = |a: DVec3, b: DVec3| -> f64 {
            let values = healpix::centres(64).into_iter().map(|w| srbf.value(a, w) * srbf.value(b, w));
            values.sum::<f64>() * healpix::solid_angle(64)
        };
        for k in [0, 1, 13, 40] {
            let expected = integral(srbf.directions[0], srbf.directions[k]);
            assert!(
                (srbf.gram[k] - expected).abs() < 1e-4 * srbf.gram[0],
                "{k}: {} {expected}",
                srbf.gram[k]
            );
        }
    }

    #[test]
    fn functions_of_the_basis_come_back_turned() {
        let srbf = Srbf::new(1);
        let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
        let about = [(3, 1.0), (17, -0.5), (30, 2.0)];
        let value =
            |w: DVec3| -> f64 { about.iter().map(|&(k, c)| c * srbf.value(srbf.directions[k], w)).sum() };
        let sky = Sky::from_function(|w| DVec3::new(value(turn * w), 1.0, 0.0));
        let coefficients = srbf.project(&sky, turn);
        for (k, c) in coefficients.iter().enumerate() {
            let expected = about.iter().find(|a| a.0 == k).map_or(0.0, |a| a.1);
            assert!((c.x - expected).abs() < 5e-3 && c.z == 0.0, "{k}: {c}");
        }
        // One everywhere is no sum of Gaussians, but nearly.
        for w in healpix::centres(8) {
            assert!((srbf.evaluate(&coefficients, w).y - 1.0).abs() < 0.03);
        }
    }

    #[test]
    fn a_sun_is_brightest_where_it_stands() {
        let srbf = Srbf::new(2);
        let towards = DVec3::new(0.48, 0.6, 0.64);
        let coefficients = srbf.directional(towards, DVec3::ONE);
        let brightest = healpix::centres(16).into_iter().map(|w| (srbf.evaluate(&coefficients, w).x, w));
        let (_, w) = brightest.fold((0.0, DVec3::X), |best, next| if next.0 > best.0 { next } else { best });
        assert!(w.dot(towards) > 0.98, "{w}");
    }
}
