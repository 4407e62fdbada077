//! Real spherical harmonics: orthonormal, without the Condon-Shortley phase. Coefficient
//! `k = l (l + 1) + m` of band `l`; `Y_1 = 0.4886 (y, z, x)`.
//!
//! Rotationally symmetric functions act on them band by band (Funk, Hecke): the integral of
//! `f(cos(w, w_0)) L(w)` over the sphere is the sum of `factor_l L_lm Y_lm(w_0)` with
//! `factor_l = 2 pi * integral of f(c) P_l(c) dc`.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use proto::scene_file::{Brdf, Phase};
use rayon::prelude::*;

use super::healpix;
use super::sky::{FINE_NSIDE, Sky};

/// Most bands.
pub const MAX_BANDS: usize = 6;
/// Most coefficients.
pub const MAX_COEFFICIENTS: usize = MAX_BANDS * MAX_BANDS;
/// A factor for each band.
pub type Bands = [f64; MAX_BANDS];

/// Factors of the cosine clamped to the upper hemisphere: irradiance from radiance (Ramamoorthi,
/// Hanrahan 2001).
pub const COSINE: Bands = [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0, -PI / 24.0, 0.0];

/// The first `bands` bands, 1..=6, at a unit direction: `bands^2` values, the others 0.
pub fn basis(bands: usize, direction: DVec3) -> [f64; MAX_COEFFICIENTS] {
    let mut values = [0.0; MAX_COEFFICIENTS];
    legendre(bands, direction, |l, m, cosine, sine| {
        let (n, centre) = (normalisation(l, m), l * (l + 1));
        values[centre + m] = n * cosine;
        if m > 0 {
            values[centre - m] = n * sine;
        }
    });
    values
}

/// Associated Legendre functions without the phase, of the first `bands` bands, times cosine and sine
/// of m azimuths: `(l, m, P cos, P sin)` for 0 <= m <= l.
fn legendre(bands: usize, direction: DVec3, mut take: impl FnMut(usize, usize, f64, f64)) {
    let (x, y, z) = (direction.x, direction.y, direction.z);
    // sin^m(theta) times cosine and sine of m azimuths.
    let (mut cosine, mut sine) = (1.0, 0.0);
    // P_m^m / sin^m(theta), without the phase.
    let mut first = 1.0;
    for m in 0..bands {
        let (mut before, mut legendre) = (0.0, first);
        for l in m..bands {
            take(l, m, legendre * cosine, legendre * sine);
            let next = ((2 * l + 1) as f64 * z * legendre - (l + m) as f64 * before) / (l + 1 - m) as f64;
            (before, legendre) = (legendre, next);
        }
        first *= (2 * m + 1) as f64;
        (cosine, sine) = (cosine * x - sine * y, cosine * y + sine * x);
    }
}

/// Most bands of [`Harmonics`].
pub const MAX_LIGHT_BANDS: usize = 26;

/// Spherical harmonics of more bands, as a basis for light.
#[derive(Debug, Clone)]
pub struct Harmonics {
    bands: usize,
    /// At `l (l + 1) + m`, m >= 0.
    normalisations: Vec<f64>,
}

impl Harmonics {
    /// `bands` 1..=26.
    pub fn new(bands: usize) -> Self {
        let bands = bands.clamp(1, MAX_LIGHT_BANDS);
        let mut normalisations = vec![0.0; bands * bands];
        for l in 0..bands {
            (0..=l).for_each(|m| normalisations[l * (l + 1) + m] = normalisation(l, m));
        }
        Self { bands, normalisations }
    }

    /// Basis functions: the square of the bands.
    pub fn count(&self) -> usize {
        self.bands * self.bands
    }

    /// All functions at a unit direction, into `values`.
    pub fn values(&self, direction: DVec3, values: &mut [f64]) {
        legendre(self.bands, direction, |l, m, cosine, sine| {
            let centre = l * (l + 1);
            let n = self.normalisations[centre + m];
            values[centre + m] = n * cosine;
            if m > 0 {
                values[centre - m] = n * sine;
            }
        });
    }

    /// The function with these coefficients at a unit direction.
    pub fn evaluate(&self, coefficients: &[DVec3], direction: DVec3) -> DVec3 {
        let mut values = vec![0.0; self.count()];
        self.values(direction, &mut values);
        coefficients.iter().zip(values).map(|(c, y)| *c * y).sum()
    }

    /// Coefficients of an environment turned by `world_from_map`: integrals of radiance times each
    /// function.
    pub fn project(&self, sky: &Sky, world_from_map: DMat3) -> Vec<DVec3> {
        let centres = healpix::centres(FINE_NSIDE);
        let flux = sky.coarser(FINE_NSIDE);
        let pixels: Vec<usize> = (0..centres.len()).collect();
        // In pieces of fixed size, summed in order: threads make no difference.
        let piece = |pixels: &[usize]| {
            let (mut sums, mut values) = (vec![DVec3::ZERO; self.count()], vec![0.0; self.count()]);
            for &pixel in pixels {
                self.values(world_from_map * centres[pixel], &mut values);
                sums.iter_mut().zip(&values).for_each(|(sum, y)| *sum += flux[pixel] * *y);
            }
            sums
        };
        let pieces: Vec<Vec<DVec3>> = pixels.par_chunks(PIXELS_AT_ONCE).map(piece).collect();
        let mut sums = vec![DVec3::ZERO; self.count()];
        for piece in pieces {
            sums.iter_mut().zip(piece).for_each(|(sum, more)| *sum += more);
        }
        sums
    }

    /// Coefficients of light from one unit direction with this irradiance on a plane it is
    /// perpendicular to.
    pub fn directional(&self, towards: DVec3, irradiance: DVec3) -> Vec<DVec3> {
        let mut values = vec![0.0; self.count()];
        self.values(towards, &mut values);
        values.into_iter().map(|y| irradiance * y).collect()
    }
}

/// Pixels of a sky that a thread takes at a time.
const PIXELS_AT_ONCE: usize = 2048;

fn normalisation(l: usize, m: usize) -> f64 {
    let ratio: f64 = (l - m + 1..=l + m).map(|i| i as f64).product();
    let doubled = if m == 0 { 1.0 } else { 2.0 };
    (doubled * (2 * l + 1) as f64 / (4.0 * PI * ratio)).sqrt()
}

/// Factors of a phase function: what is scattered towards `w_o` is evaluated at `-w_o`, for
/// directions point towards where light comes from.
pub fn phase_bands(phase: &Phase) -> Bands {
    match phase {
        Phase::Isotropic => [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        Phase::HenyeyGreenstein(p) => std::array::from_fn(|l| p.g.powi(l as i32)),
        Phase::Schlick(p) => schlick_bands(p.k),
    }
}

/// Factors of `(1 - k^2) / (4 pi (1 - k c)^2)`: integrated over its distribution function, which
/// flattens the peak (closed forms cancel for small k).
fn schlick_bands(k: f64) -> Bands {
    const NODES: usize = 64;
    // With u uniform from -1 to 1, c = (u + k) / (1 + k u) is distributed as wanted.
    let mut factors = [0.0; MAX_BANDS];
    for i in 0..NODES {
        let (node, weight) = gauss_legendre(NODES, i);
        let c = (node + k) / (1.0 + k * node);
        for (factor, legendre) in factors.iter_mut().zip(legendre_polynomials(c)) {
            *factor += 0.5 * weight * legendre;
        }
    }
    factors
}

/// `P_0 .. P_5` at a cosine.
pub fn legendre_polynomials(c: f64) -> Bands {
    let mut p = [1.0, c, 0.0, 0.0, 0.0, 0.0];
    for l in 1..MAX_BANDS - 1 {
        p[l + 1] = ((2 * l + 1) as f64 * c * p[l] - l as f64 * p[l - 1]) / (l + 1) as f64;
    }
    p
}

/// Node `i` of `n` and its weight for the integral from -1 to 1 (Newton's method).
fn gauss_legendre(n: usize, i: usize) -> (f64, f64) {
    let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
    let mut slope = 1.0;
    for _ in 0..64 {
        let (mut before, mut p) = (1.0, x);
        for l in 1..n {
            (before, p) = (p, ((2 * l + 1) as f64 * x * p - l as f64 * before) / (l + 1) as f64);
        }
        slope = n as f64 * (x * p - before) / (x * x - 1.0);
        let step = p / slope;
        x -= step;
        if step.abs() < 1e-15 {
            break;
        }
    }
    (x, 2.0 / ((1.0 - x * x) * slope * slope))
}

/// Factors of a specular lobe about the mirror direction, 1 in band 0: a Gaussian on the sphere
/// whose width is that of the half-vector lobe, doubled by the reflection. 0 without a lobe.
pub fn specular_bands(brdf: Option<&Brdf>) -> Bands {
    // Exponent of cos^n about the half vector.
    let exponent = match brdf {
        None | Some(Brdf::Lambert(_)) => return [0.0; MAX_BANDS],
        Some(Brdf::BlinnPhong(b)) => b.exponent,
        Some(Brdf::AshikhminShirley(b)) => (b.exponents[0] * b.exponents[1]).sqrt(),
        Some(Brdf::Abc(b)) => b.b * b.c,
    };
    // About the mirror direction angles are twice as large: cos^(n / 4).
    let narrowness = (0.25 * exponent).max(0.25);
    std::array::from_fn(|l| (-((l * (l + 1)) as f64) / (2.0 * narrowness)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::scene_file::{HenyeyGreenstein, Schlick};

    /// Sum over the sphere by a product rule that is exact for the products of two bases.
    fn integrate(mut f: impl FnMut(DVec3, f64)) {
        const RINGS: usize = 12;
        const SECTORS: usize = 24;
        for ring in 0..RINGS {
            let (z, weight) = gauss_legendre(RINGS, ring);
            let sine = (1.0 - z * z).sqrt();
            for sector in 0..SECTORS {
                let azimuth = 2.0 * PI * (sector as f64 + 0.3) / SECTORS as f64;
                let direction = DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), z);
                f(direction, weight * 2.0 * PI / SECTORS as f64);
            }
        }
    }

    #[test]
    fn the_basis_is_orthonormal() {
        let mut gram = vec![[0.0; MAX_COEFFICIENTS]; MAX_COEFFICIENTS];
        integrate(|direction, weight| {
            let y = basis(MAX_BANDS, direction);
            for (row, a) in gram.iter_mut().zip(y) {
                row.iter_mut().zip(y).for_each(|(sum, b)| *sum += weight * a * b);
            }
        });
        for (i, row) in gram.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                let expected = f64::from(u8::from(i == j));
                assert!((value - expected).abs() < 1e-12, "{i} {j}: {value}");
            }
        }
    }

    #[test]
    fn first_bands_are_as_documented() {
        let d = DVec3::new(0.36, 0.48, 0.8);
        let y = basis(2, d);
        let c = (0.75 / PI).sqrt();
        assert!((y[0] - (0.25 / PI).sqrt()).abs() < 1e-15);
        for (value, expected) in y[1..4].iter().zip([c * d.y, c * d.z, c * d.x]) {
            assert!((value - expected).abs() < 1e-15);
        }
        assert!(y[4..].iter().all(|&value| value == 0.0));
    }

    /// The convolution with a lobe is the band-wise product.
    fn convolves(f: impl Fn(f64) -> f64, factors: Bands, bands: usize) {
        let about = DVec3::new(-0.6, 0.64, 0.48);
        let mut sums = [0.0; MAX_COEFFICIENTS];
        const FINE: usize = 600;
        for i in 0..FINE {
            let (z, weight) = gauss_legendre(FINE, i);
            for j in 0..48 {
                let azimuth = 2.0 * PI * f64::from(j) / 48.0;
                let sine = (1.0 - z * z).sqrt();
                let local = DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), z);
                // z is about the lobe's axis.
                let (u, v) = about.any_orthonormal_pair();
                let w = local.x * u + local.y * v + local.z * about;
                for (sum, y) in sums.iter_mut().zip(basis(bands, w)) {
                    *sum += weight * 2.0 * PI / 48.0 * f(z) * y;
                }
            }
        }
        let y = basis(bands, about);
        for (l, factor) in factors.iter().enumerate().take(bands) {
            for k in l * l..(l + 1) * (l + 1) {
                assert!((sums[k] - factor * y[k]).abs() < 2e-5, "{l}: {} {}", sums[k], factor * y[k]);
            }
        }
    }

    #[test]
    fn factors_are_those_of_the_lobes() {
        for g in [-0.7, 0.0, 0.3, 0.8] {
            for phase in [Phase::HenyeyGreenstein(HenyeyGreenstein { g }), Phase::Schlick(Schlick { k: g })] {
                convolves(|c| crate::scattering::phase_function(&phase, c), phase_bands(&phase), MAX_BANDS);
            }
        }
        convolves(|c| c.max(0.0), COSINE, MAX_BANDS);
    }

    #[test]
    fn lobes_narrow_with_their_exponent() {
        let lobe = |exponent| {
            let b = proto::scene_file::BlinnPhong { diffuse: 0.0, specular: 1.0, exponent };
            specular_bands(Some(&Brdf::BlinnPhong(b)))
        };
        let (wide, narrow) = (lobe(4.0), lobe(400.0));
        assert!(wide[0] == 1.0 && narrow[0] == 1.0);
        assert!((1..MAX_BANDS).all(|l| wide[l] < narrow[l] && narrow[l] < narrow[l - 1]));
        assert_eq!(specular_bands(None), [0.0; MAX_BANDS]);
    }

    #[test]
    fn many_bands_begin_with_the_few_and_are_orthonormal() {
        let harmonics = Harmonics::new(MAX_LIGHT_BANDS);
        assert_eq!(harmonics.count(), 676);
        let direction = DVec3::new(0.36, 0.48, -0.8);
        let mut values = vec![0.0; 676];
        harmonics.values(direction, &mut values);
        assert_eq!(values[..36], basis(6, direction));
        // Addition theorem: the squares of a band sum to (2 l + 1) / 4 pi, whatever the direction.
        for w in healpix::centres(4) {
            harmonics.values(w, &mut values);
            for l in 0..MAX_LIGHT_BANDS {
                let sum: f64 = values[l * l..(l + 1) * (l + 1)].iter().map(|y| y * y).sum();
                assert!((sum * 4.0 * PI / (2 * l + 1) as f64 - 1.0).abs() < 1e-11, "{l} {w}");
            }
        }
    }

    #[test]
    fn light_of_few_bands_comes_back_and_turns() {
        let harmonics = Harmonics::new(12);
        let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
        let mut values = vec![0.0; 144];
        harmonics.values(DVec3::new(0.6, 0.64, 0.48), &mut values);
        let wanted: Vec<DVec3> = values.iter().map(|&y| DVec3::new(y, 2.0 * y, -y)).collect();
        let sky = Sky::from_function(|w| harmonics.evaluate(&wanted, turn * w));
        for (found, wanted) in harmonics.project(&sky, turn).iter().zip(&wanted) {
            assert!((*found - *wanted).length() < 0.02, "{found} {wanted}");
        }
        // Turning the map turns the function, whatever the map.
        let sky = Sky::from_function(|w| DVec3::splat(if w.x > 0.3 { 1.0 } else { 0.0 }));
        let (still, turned) = (harmonics.project(&sky, DMat3::IDENTITY), harmonics.project(&sky, turn));
        for w in healpix::centres(4) {
            let (a, b) = (harmonics.evaluate(&still, w), harmonics.evaluate(&turned, turn * w));
            assert!((a - b).length() < 1e-10, "{a} {b}");
        }
    }

    #[test]
    fn a_sun_is_the_limit_of_a_small_spot() {
        let harmonics = Harmonics::new(8);
        let towards = DVec3::new(0.36, 0.48, 0.8);
        let radius: f64 = 0.05;
        let spot = Sky::from_function(|w| DVec3::splat(f64::from(u8::from(w.dot(towards) > radius.cos()))));
        let irradiance = spot.total();
        let sun = harmonics.directional(towards, irradiance);
        for (a, b) in sun.iter().zip(harmonics.project(&spot, DMat3::IDENTITY)) {
            assert!((*a - b).length() < 0.05 * irradiance.x, "{a} {b}");
        }
    }
}
