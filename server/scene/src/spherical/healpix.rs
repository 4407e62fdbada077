//! HEALPix: the sphere in `12 nside^2` pixels of equal area whose centres lie on rings of equal
//! latitude (Gorski et al. 2005: HEALPix, a framework for high-resolution discretization and fast
//! analysis of data distributed on the sphere). Pixels are counted ring by ring from +z on. With
//! `nside` a power of two, each pixel is made of whole pixels of every larger such `nside`.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

/// Pixels of the sphere.
pub fn pixel_count(nside: usize) -> usize {
    12 * nside * nside
}

/// Solid angle of each pixel, steradian.
pub fn solid_angle(nside: usize) -> f64 {
    4.0 * PI / pixel_count(nside) as f64
}

/// Rings of pixels.
pub fn ring_count(nside: usize) -> usize {
    4 * nside - 1
}

/// Pixels of one latitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ring {
    /// Index of its first pixel.
    pub first: usize,
    /// Its pixels, at equal distances of azimuth.
    pub count: usize,
    /// Cosine of the angle from +z of their centres.
    pub z: f64,
    /// Azimuth of the first centre, radians from +x towards +y.
    pub azimuth: f64,
}

/// Ring `index`, 0..`ring_count`, from +z on.
pub fn ring(nside: usize, index: usize) -> Ring {
    let n = nside as f64;
    let mirrored = ring_count(nside) - 1 - index;
    let from_pole = index.min(mirrored) + 1;
    if from_pole < nside {
        // A polar cap: 4 pixels in the first ring, 8 in the second, ...
        let i = from_pole as f64;
        let above = 2 * from_pole * (from_pole - 1);
        let count = 4 * from_pole;
        let north = index < mirrored;
        let first = if north { above } else { pixel_count(nside) - above - count };
        let z = 1.0 - i * i / (3.0 * n * n);
        return Ring { first, count, z: if north { z } else { -z }, azimuth: FRAC_PI_2 * 0.5 / i };
    }
    let belt_ring = index + 1 - nside;
    let first = 2 * nside * (nside - 1) + 4 * nside * belt_ring;
    // Every other ring is turned by half a pixel.
    let shift = if belt_ring.is_multiple_of(2) { 0.5 } else { 0.0 };
    let z = 4.0 / 3.0 - 2.0 * (index + 1) as f64 / (3.0 * n);
    Ring { first, count: 4 * nside, z, azimuth: FRAC_PI_2 * shift / n }
}

/// Centres of all pixels, in their order.
pub fn centres(nside: usize) -> Vec<DVec3> {
    let mut centres = Vec::with_capacity(pixel_count(nside));
    for index in 0..ring_count(nside) {
        let ring = ring(nside, index);
        let sine = (1.0 - ring.z * ring.z).sqrt();
        for k in 0..ring.count {
            let (sin, cos) = (ring.azimuth + 2.0 * PI * k as f64 / ring.count as f64).sin_cos();
            centres.push(DVec3::new(sine * cos, sine * sin, ring.z));
        }
    }
    centres
}

/// The pixel a unit direction lies in.
pub fn pixel_of(nside: usize, direction: DVec3) -> usize {
    let n = nside as f64;
    let z = direction.z.clamp(-1.0, 1.0);
    let quarters = (direction.y.atan2(direction.x) / FRAC_PI_2).rem_euclid(4.0);
    if z.abs() <= 2.0 / 3.0 {
        // Between the caps pixel borders are straight in (azimuth, z): count those that rise and
        // those that fall.
        let rising = (n * (0.5 + quarters) - 0.75 * n * z).floor() as i64;
        let falling = (n * (0.5 + quarters) + 0.75 * n * z).floor() as i64;
        let ring_from_belt = nside as i64 + rising - falling;
        let odd = ring_from_belt & 1;
        let along = (rising + falling + odd + 1 - nside as i64).div_euclid(2).rem_euclid(4 * nside as i64);
        let belt_ring = (ring_from_belt).clamp(0, 2 * nside as i64) as usize;
        return 2 * nside * (nside - 1) + 4 * nside * belt_ring + along as usize;
    }
    let within = quarters.fract();
    let reach = n * (3.0 * (1.0 - z.abs())).sqrt();
    let forward = ((within * reach) as usize).min(nside - 1);
    let backward = (((1.0 - within) * reach) as usize).min(nside - 1);
    // Counted from the pole: the ring, and the place along it.
    let ring = forward + backward + 1;
    let along = ((quarters * ring as f64) as usize).min(4 * ring - 1);
    let above = 2 * ring * (ring - 1);
    if z > 0.0 { above + along } else { pixel_count(nside) - above - 4 * ring + along }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spherical::sh::{MAX_BANDS, basis};

    #[test]
    fn rings_hold_every_pixel_once() {
        for nside in [1, 2, 3, 4, 8, 16] {
            let rings: Vec<Ring> = (0..ring_count(nside)).map(|index| ring(nside, index)).collect();
            let mut next = 0;
            for (ring, below) in rings.iter().zip(rings.iter().skip(1).map(Some).chain([None])) {
                assert_eq!(ring.first, next);
                next += ring.count;
                assert!(below.is_none_or(|below| below.z < ring.z), "nside {nside}");
            }
            assert_eq!(next, pixel_count(nside));
        }
    }

    #[test]
    fn a_centre_lies_in_its_pixel() {
        for nside in [1, 2, 4, 8, 64] {
            for (pixel, centre) in centres(nside).into_iter().enumerate() {
                assert!((centre.length() - 1.0).abs() < 1e-12);
                assert_eq!(pixel_of(nside, centre), pixel, "nside {nside}: {centre}");
            }
        }
    }

    #[test]
    fn pixels_have_equal_areas_and_are_made_of_whole_finer_ones() {
        // Directions by a rule of its own: equal steps in z and azimuth have equal areas.
        const STEPS: usize = 1200;
        for nside in [1, 2, 4] {
            let mut counts = vec![0usize; pixel_count(nside)];
            for i in 0..STEPS {
                let z = 2.0 * (i as f64 + 0.5) / STEPS as f64 - 1.0;
                for j in 0..2 * STEPS {
                    let (sin, cos) = (PI * (j as f64 + 0.37) / STEPS as f64).sin_cos();
                    let sine = (1.0 - z * z).sqrt();
                    counts[pixel_of(nside, DVec3::new(sine * cos, sine * sin, z))] += 1;
                }
            }
            let share = (2 * STEPS * STEPS) as f64 / counts.len() as f64;
            for (pixel, &count) in counts.iter().enumerate() {
                assert!((count as f64 / share - 1.0).abs() < 0.01, "nside {nside}, {pixel}: {count}");
            }
            let mut children = vec![0usize; pixel_count(nside)];
            for centre in centres(16 * nside) {
                children[pixel_of(nside, centre)] += 1;
            }
            assert!(children.iter().all(|&count| count == 256), "nside {nside}: {children:?}");
        }
    }

    #[test]
    fn constants_and_cosines_are_projected() {
        // Equal weights on the centres: what the paper does. Band 2 of a constant is off by 0.7 %.
        let sum = |f: &dyn Fn(DVec3) -> f64, nside: usize| {
            let mut sums = [0.0; MAX_BANDS * MAX_BANDS];
            for centre in centres(nside) {
                let y = basis(3, centre);
                sums.iter_mut().zip(y).for_each(|(sum, y)| *sum += solid_angle(nside) * f(centre) * y);
            }
            sums
        };
        let constant = sum(&|_| 1.0, 4);
        assert!((constant[0] - (4.0 * PI).sqrt()).abs() < 1e-12);
        assert!(constant[1..].iter().all(|c| c.abs() < 0.03), "{constant:?}");
        let cosine = sum(&|w| w.z, 4);
        assert!((cosine[2] - (4.0 * PI / 3.0).sqrt()).abs() < 0.02, "{}", cosine[2]);
        assert!(cosine.iter().enumerate().all(|(k, c)| k == 2 || c.abs() < 0.02), "{cosine:?}");
    }

    #[test]
    fn poles_and_borders_are_somewhere() {
        for nside in [1, 2, 8] {
            for direction in [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y] {
                let pixel = pixel_of(nside, direction);
                let centre = centres(nside)[pixel];
                assert!(centre.dot(direction) > 1.0 - 3.0 * solid_angle(nside), "{nside} {direction}");
            }
        }
    }
}
