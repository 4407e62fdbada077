//! The basis lights as the passes of a bake take them, and a scene's light made of them.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use glam::DVec3;
use scene::Scene;
use scene::light::LightGeometry;
use scene::spherical::dsf::Dsf;
use scene::spherical::sky::Sky;
use scene::spherical::{healpix, sh};

/// Directions of photons for a basis light, at least.
const FLIGHTS_OF_A_LIGHT: usize = 64;
/// Functions of a direction, as in shaders/precomputed_transfer/carry.wgsl: there are six at most.
const FUNCTIONS: usize = 8;
/// `nside` of the map that functions are integrated over.
const FINE_NSIDE: usize = 64;
/// The field's largest number of usual light, as of `image_based`: above it is room for suns, below it
/// for shadows of a four-millionth.
const USUAL_TEXEL: f64 = 256.0;

/// Basis lights: discrete spherical functions, each a light.
pub struct Basis {
    pub dsf: Dsf,
    /// Environment images, poured into equal pixels: the last one.
    sky: Option<([u8; 32], Sky)>,
}

/// Directions that photons come from.
pub struct Flights {
    /// Of each its direction; then indices of functions; then their values: five texels.
    pub texels: Vec<[f32; 4]>,
    pub count: u32,
    /// From one photon to the next: photons in their order are spread evenly at any time.
    pub stride: u32,
}

/// Directions that light is marched from.
pub struct Directions {
    /// Unit vectors towards the light.
    pub towards: Vec<DVec3>,
    /// Of each function in a direction's pixel: its index, and its integrals with each spherical
    /// harmonic.
    pub integrals: Vec<f32>,
    /// Of each direction its entries in `integrals`: the first one, and the one behind the last.
    pub entries: Vec<[u32; 2]>,
}

/// A scene's light.
#[derive(Debug, Clone, PartialEq)]
pub struct LightVector {
    /// Radiance of each basis light.
    pub texels: Vec<[f32; 4]>,
    /// The field holds coefficients divided by this.
    pub scale: f32,
}

impl Basis {
    /// With 42, 162 or 642 lights.
    pub fn new(lights: u32) -> Self {
        let subdivisions = match lights {
            42 => 1,
            162 => 2,
            _ => 3,
        };
        Self { dsf: Dsf::new(subdivisions), sky: None }
    }

    pub fn flights(&self) -> Flights {
        let wanted = (FLIGHTS_OF_A_LIGHT * self.dsf.count() / 12) as f64;
        let nside = (wanted.sqrt().ceil() as usize).next_power_of_two();
        let centres = healpix::centres(nside);
        let weights: Vec<_> = centres.iter().map(|&centre| self.dsf.weights(centre)).collect();
        let exact = self.exact(weights.iter().flatten(), healpix::solid_angle(nside));
        let mut texels = Vec::with_capacity(5 * centres.len());
        for (centre, weights) in centres.iter().zip(&weights) {
            let (mut indices, mut values) = ([0.0; FUNCTIONS], [0.0; FUNCTIONS]);
            for (place, &(index, weight)) in weights.iter().take(FUNCTIONS).enumerate() {
                (indices[place], values[place]) = (index as f32, (weight * exact[index]) as f32);
            }
            let w = centre.as_vec3();
            texels.push([w.x, w.y, w.z, 0.0]);
            for half in indices.as_chunks::<4>().0.iter().chain(values.as_chunks::<4>().0) {
                texels.push(*half);
            }
        }
        let count = centres.len();
        // The golden section, without a common divisor.
        let mut stride = (count as f64 * 0.618_033_988_749_894_9) as usize | 1;
        while stride.is_multiple_of(3) {
            stride += 2;
        }
        Flights { texels, count: count as u32, stride: stride as u32 }
    }

    /// `nside` of the directions: a power of two up to 16.
    pub fn directions(&self, nside: usize, bands: usize) -> Directions {
        let centres = healpix::centres(FINE_NSIDE);
        let weights: Vec<_> = centres.iter().map(|&centre| self.dsf.weights(centre)).collect();
        let solid_angle = healpix::solid_angle(FINE_NSIDE);
        let exact = self.exact(weights.iter().flatten(), solid_angle);
        let coefficients = bands * bands;
        let mut pixels = vec![BTreeMap::<usize, Vec<f64>>::new(); healpix::pixel_count(nside)];
        for (&centre, weights) in centres.iter().zip(&weights) {
            let harmonics = sh::basis(bands, centre);
            let pixel = &mut pixels[healpix::pixel_of(nside, centre)];
            for &(index, weight) in weights {
                let sums = pixel.entry(index).or_insert_with(|| vec![0.0; coefficients]);
                let share = weight * exact[index] * solid_angle;
                sums.iter_mut().zip(harmonics).for_each(|(sum, y)| *sum += share * y);
            }
        }
        let (mut integrals, mut entries, mut count) = (Vec::new(), Vec::new(), 0);
        for pixel in pixels {
            let first = count;
            for (index, sums) in pixel {
                integrals.push(index as f32);
                integrals.extend(sums.iter().map(|&sum| sum as f32));
                count += 1;
            }
            entries.push([first, count]);
        }
        Directions { towards: healpix::centres(nside), integrals, entries }
    }

    /// Of each function what makes its sum over pixels its integral.
    fn exact<'a>(&self, weights: impl Iterator<Item = &'a (usize, f64)>, solid_angle: f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.dsf.count()];
        weights.for_each(|&(index, weight)| sums[index] += weight * solid_angle);
        sums.iter().zip(self.dsf.solid_angles()).map(|(sum, exact)| exact / sum).collect()
    }

    /// The scene's light from infinity.
    pub fn light_of(&mut self, scene: &Scene) -> LightVector {
        let mut sums = vec![DVec3::ZERO; self.dsf.count()];
        for light in &scene.lights {
            let add = |more: Vec<DVec3>, sums: &mut Vec<DVec3>| {
                sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += light.power * more);
            };
            match &light.geometry {
                LightGeometry::UniformEnvironment => sums.iter_mut().for_each(|sum| *sum += light.power),
                LightGeometry::Directional { direction } => {
                    add(self.dsf.directional(-*direction, DVec3::ONE), &mut sums);
                }
                LightGeometry::Environment { image, world_from_map } => {
                    let content = image.content();
                    let kept = self.sky.take().filter(|(of, _)| *of == content);
                    let (_, sky) = self.sky.insert(kept.unwrap_or_else(|| (content, Sky::of(image))));
                    add(self.dsf.project(sky, *world_from_map), &mut sums);
                }
                _ => {}
            }
        }
        let fluence = self.dsf.integral(&sums).max_element();
        // A power of two, so that it changes no digit of a coefficient.
        let scale = (fluence / USUAL_TEXEL).log2().ceil().exp2() as f32;
        let texels = sums.iter().map(|light| light.extend(0.0).as_vec4().to_array()).collect();
        LightVector { texels, scale: if scale.is_normal() { scale } else { 1.0 } }
    }
}

/// Area that a box shows, on average over all directions.
pub fn mean_shown(size: DVec3) -> f64 {
    0.5 * (size.x * size.y + size.y * size.z + size.z * size.x)
}

/// What a share of the photons' sums is, as light times mass: flux of a photon over the throughput it
/// begins with.
pub fn photon_factor(size: DVec3, photons: u64, largest_mass: f64) -> f64 {
    4.0 * PI * mean_shown(size) / (photons.max(1) as f64 * largest_mass)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_hold_every_function_whole() {
        for lights in [42, 162, 642] {
            let basis = Basis::new(lights);
            let flights = basis.flights();
            let mut sums = vec![0.0; lights as usize];
            for flight in flights.texels.as_chunks::<5>().0 {
                let whole: f32 = flight[3].iter().chain(&flight[4]).sum();
                assert!((whole - 1.0).abs() < 0.02, "{whole}");
                for f in 0..8 {
                    sums[flight[1 + f / 4][f % 4] as usize] += f64::from(flight[3 + f / 4][f % 4]);
                }
            }
            let directions = basis.directions(4, 2);
            let mut marched = vec![[0.0; 4]; lights as usize];
            for entry in directions.integrals.as_chunks::<5>().0 {
                (0..4).for_each(|k| marched[entry[0] as usize][k] += f64::from(entry[1 + k]));
            }
            assert_eq!(directions.entries.last().unwrap()[1] as usize * 5, directions.integrals.len());
            for (index, &exact) in basis.dsf.solid_angles().iter().enumerate() {
                let flown = sums[index] * 4.0 * PI / f64::from(flights.count);
                assert!((flown / exact - 1.0).abs() < 1e-5, "{flown} {exact}");
                assert!((marched[index][0] * (4.0 * PI).sqrt() / exact - 1.0).abs() < 1e-5);
                // Band 1 points to the function's direction.
                let [_, y, z, x] = marched[index];
                let middle = DVec3::new(x, y, z).normalize();
                assert!(middle.dot(basis.dsf.directions()[index]) > 0.995);
            }
        }
    }

    #[test]
    fn photons_come_from_everywhere_at_any_time() {
        let flights = Basis::new(42).flights();
        let mut seen = vec![false; flights.count as usize];
        for photon in 0..flights.count {
            seen[(u64::from(photon) * u64::from(flights.stride) % u64::from(flights.count)) as usize] = true;
        }
        assert!(seen.iter().all(|&seen| seen), "the stride leads to every direction");
        let some = 257;
        let mean: DVec3 = (0..some)
            .map(|photon| {
                let flight = photon * flights.stride as usize % flights.count as usize;
                let [x, y, z, _] = flights.texels[5 * flight].map(f64::from);
                DVec3::new(x, y, z) / some as f64
            })
            .sum();
        assert!(mean.length() < 0.02, "{mean}");
    }
}
