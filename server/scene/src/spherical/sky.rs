//! Light from all directions in pixels of equal area: what arrives from each, with exact solid
//! angles.
//!
//! An environment image is poured into a fine HEALPix map once: every texel is cut into pieces
//! smaller than a pixel, and each piece brings its radiance (bilinear between texel centres) times
//! its solid angle. So no light is lost, however bright and small it is. A rotation then only turns
//! the map's centres.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::healpix;
use super::sh::{MAX_COEFFICIENTS, basis};
use crate::environment::EnvironmentImage;

/// `nside` of the fine map: 49,152 pixels of 0.92 degrees.
pub const FINE_NSIDE: usize = 64;

/// Most pieces along the edge of a texel.
const MAX_PIECES: usize = 4096;

/// Radiance times solid angle from each pixel of a fine HEALPix map, linear RGB.
#[derive(Debug, Clone, PartialEq)]
pub struct Sky {
    flux: Vec<DVec3>,
}

/// What arrives from one pixel of a coarser map.
#[derive(Debug, Clone, PartialEq)]
pub struct SkyPixel {
    /// Integrals of radiance times each spherical harmonic over the pixel, linear RGB.
    pub light: Vec<DVec3>,
    /// Integrals of each spherical harmonic over the pixel.
    pub solid: Vec<f64>,
}

impl Sky {
    /// One radiance from everywhere.
    pub fn uniform(radiance: DVec3) -> Self {
        Self { flux: vec![radiance * healpix::solid_angle(FINE_NSIDE); healpix::pixel_count(FINE_NSIDE)] }
    }

    /// The light of an image, in the image's own axes.
    pub fn of(image: &EnvironmentImage) -> Self {
        let (width, height) = (image.width(), image.height());
        // Half a pixel's edge, at most.
        let piece = 0.5 * healpix::solid_angle(FINE_NSIDE).sqrt();
        let pieces = |texels: usize, angle: f64| {
            ((angle / piece / texels as f64).ceil() as usize).clamp(1, MAX_PIECES)
        };
        let (across, down) = (pieces(width, 2.0 * PI), pieces(height, PI));
        let row = |y: usize| {
            let mut flux: Vec<(usize, DVec3)> = Vec::with_capacity(width * across);
            for part in 0..down {
                let v = (y as f64 + (part as f64 + 0.5) / down as f64) / height as f64;
                let edge = |at: usize| (PI * (y as f64 + at as f64 / down as f64) / height as f64).cos();
                let solid_angle = 2.0 * PI / (width * across) as f64 * (edge(part) - edge(part + 1));
                let (sine, cosine) = (PI * v).sin_cos();
                for x in 0..width * across {
                    let u = (x as f64 + 0.5) / (width * across) as f64;
                    let (sin, cos) = (2.0 * PI * u).sin_cos();
                    let direction = DVec3::new(sine * sin, cosine, -sine * cos);
                    let pixel = healpix::pixel_of(FINE_NSIDE, direction);
                    let arriving = bilinear(image, u, v) * solid_angle;
                    match flux.last_mut() {
                        Some((last, sum)) if *last == pixel => *sum += arriving,
                        _ => flux.push((pixel, arriving)),
                    }
                }
            }
            flux
        };
        let mut flux = vec![DVec3::ZERO; healpix::pixel_count(FINE_NSIDE)];
        // In the order of rows, so that every run gives the same sums.
        let rows: Vec<usize> = (0..height).collect();
        for some in rows.chunks(ROWS_AT_ONCE) {
            let poured: Vec<Vec<(usize, DVec3)>> = some.par_iter().map(|&y| row(y)).collect();
            poured.into_iter().flatten().for_each(|(pixel, arriving)| flux[pixel] += arriving);
        }
        Self { flux }
    }

    /// The light of a formula, looked at in the middles of pixels.
    pub fn from_function(radiance: impl Fn(DVec3) -> DVec3) -> Self {
        let solid_angle = healpix::solid_angle(FINE_NSIDE);
        Self { flux: healpix::centres(FINE_NSIDE).into_iter().map(|w| radiance(w) * solid_angle).collect() }
    }

    /// This sky with no pixel brighter than that: radiance times solid angle of a pixel of the fine map.
    pub fn limited(&self, most: DVec3) -> Self {
        Self { flux: self.flux.iter().map(|flux| flux.min(most)).collect() }
    }

    /// Radiance times solid angle from each pixel of a map with `nside` (a power of two no larger than
    /// the fine one's), in the sky's own axes.
    pub fn coarser(&self, nside: usize) -> Vec<DVec3> {
        if nside >= FINE_NSIDE {
            return self.flux.clone();
        }
        let mut sums = vec![DVec3::ZERO; healpix::pixel_count(nside)];
        for (centre, flux) in healpix::centres(FINE_NSIDE).into_iter().zip(&self.flux) {
            sums[healpix::pixel_of(nside, centre)] += *flux;
        }
        sums
    }

    /// All that arrives, radiance integrated over the sphere.
    pub fn total(&self) -> DVec3 {
        self.flux.iter().sum()
    }

    /// Irradiance on a plane with a normal, unit, in the sky's own axes.
    pub fn irradiance(&self, normal: DVec3) -> DVec3 {
        let from = |(centre, flux): (DVec3, &DVec3)| *flux * centre.dot(normal).max(0.0);
        healpix::centres(FINE_NSIDE).into_iter().zip(&self.flux).map(from).sum()
    }

    /// What arrives from each pixel of a map with `nside` (a power of two no larger than the fine
    /// one's), the sky turned by `world_from_map`; `bands` 1..=6.
    pub fn pixels(&self, nside: usize, bands: usize, world_from_map: DMat3) -> Vec<SkyPixel> {
        let count = bands * bands;
        let empty = || SkyPixel { light: vec![DVec3::ZERO; count], solid: vec![0.0; count] };
        let mut pixels = vec![empty(); healpix::pixel_count(nside)];
        let fine: Vec<DVec3> = healpix::centres(FINE_NSIDE);
        let place = |direction: DVec3| (healpix::pixel_of(nside, direction), basis(bands, direction));
        let places = |turn: DMat3| -> Vec<(usize, [f64; MAX_COEFFICIENTS])> {
            fine.par_iter().map(|&centre| place(turn * centre)).collect()
        };
        let solid_angle = healpix::solid_angle(FINE_NSIDE);
        let still = places(DMat3::IDENTITY);
        for (pixel, y) in &still {
            pixels[*pixel].solid.iter_mut().zip(y).for_each(|(sum, y)| *sum += solid_angle * y);
        }
        let turned = if world_from_map == DMat3::IDENTITY { still } else { places(world_from_map) };
        for ((pixel, y), flux) in turned.iter().zip(&self.flux) {
            pixels[*pixel].light.iter_mut().zip(y).for_each(|(sum, y)| *sum += *flux * *y);
        }
        pixels
    }
}

/// Rows of an image poured at once: bounds the memory for what they bring.
const ROWS_AT_ONCE: usize = 64;

/// Radiance at column u, row v, each 0..1 over the image.
fn bilinear(image: &EnvironmentImage, u: f64, v: f64) -> DVec3 {
    let (width, height) = (image.width(), image.height());
    let (x, y) = (u * width as f64 - 0.5, v * height as f64 - 0.5);
    let (column, row) = (x.floor(), y.floor());
    let texel = |dx: i64, dy: i64| {
        let column = (column as i64 + dx).rem_euclid(width as i64) as usize;
        let row = (row as i64 + dy).clamp(0, height as i64 - 1) as usize;
        DVec3::from_array(image.texels()[row * width + column].map(f64::from))
    };
    let above = texel(0, 0).lerp(texel(1, 0), x - column);
    let below = texel(0, 1).lerp(texel(1, 1), x - column);
    above.lerp(below, y - row)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: usize, height: usize, radiance: impl Fn(usize, usize) -> f32) -> EnvironmentImage {
        let texel = |i: usize| [radiance(i % width, i / width), 1.0, 0.5];
        let rgb: Vec<f32> = (0..width * height).flat_map(texel).collect();
        EnvironmentImage::new(width, height, &rgb).unwrap()
    }

    #[test]
    fn no_light_is_lost() {
        // A sun of one texel among darkness, near a pole and at the horizon.
        for sun in [(3, 1), (200, 60)] {
            let image = image(256, 128, |x, y| if (x, y) == sun { 34_000.0 } else { 0.0 });
            let sky = Sky::of(&image);
            let edge = |y: usize| (PI * y as f64 / 128.0).cos();
            // Bilinear: a tent of twice the texel's edge, with rows weighted by their solid angles.
            let solid_angle = 2.0 * PI / 256.0 * (edge(sun.1) - edge(sun.1 + 1));
            let total = sky.total();
            assert!((total.x / (34_000.0 * solid_angle) - 1.0).abs() < 0.02, "{total}");
            assert!((total.y / (4.0 * PI) - 1.0).abs() < 1e-9, "{total}");
            let sum: DVec3 = sky.pixels(2, 1, DMat3::IDENTITY).iter().map(|pixel| pixel.light[0]).sum();
            assert!((sum * (4.0 * PI).sqrt() - total).length() < 1e-9 * total.length());
        }
    }

    #[test]
    fn light_comes_from_where_the_image_shows_it() {
        let image = image(64, 32, |x, y| if (x, y) == (48, 8) { 1000.0 } else { 0.0 });
        let sky = Sky::of(&image);
        let (u, v) = (2.0 * PI * 48.5 / 64.0, PI * 8.5 / 32.0);
        let direction = DVec3::new(v.sin() * u.sin(), v.cos(), -v.sin() * u.cos());
        let turn = crate::environment::world_from_map([20.0, 30.0, -40.0]);
        for world_from_map in [DMat3::IDENTITY, turn] {
            let pixels = sky.pixels(4, 3, world_from_map);
            let sum = |k: usize| -> f64 { pixels.iter().map(|pixel| pixel.light[k].x).sum() };
            let seen = DVec3::new(sum(3), sum(1), sum(2)).normalize();
            assert!(seen.dot(world_from_map * direction) > 0.9995, "{seen} {}", world_from_map * direction);
            let brightest =
                (0..pixels.len()).max_by(|&a, &b| pixels[a].light[0].x.total_cmp(&pixels[b].light[0].x));
            assert_eq!(brightest, Some(healpix::pixel_of(4, world_from_map * direction)));
        }
    }

    #[test]
    fn a_uniform_sky_is_the_same_from_every_pixel() {
        let pixels = Sky::uniform(DVec3::new(2.0, 1.0, 0.0)).pixels(2, 3, DMat3::IDENTITY);
        for pixel in &pixels {
            for (light, solid) in pixel.light.iter().zip(&pixel.solid) {
                assert!((light.x - 2.0 * solid).abs() < 1e-12 && light.z == 0.0);
            }
        }
        let sum = |k: usize| pixels.iter().map(|pixel| pixel.solid[k]).sum::<f64>();
        assert!((sum(0) - (4.0 * PI).sqrt()).abs() < 1e-9);
        assert!((1..9).all(|k| sum(k).abs() < 1e-3));
    }
}
