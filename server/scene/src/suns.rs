//! Small suns in environment images, told apart as directional lights.
//!
//! A sun of a few texels behind forward-scattering matter needs all bands of spherical harmonics, and casts
//! sharp shadows. Methods that keep light in few bands on a coarse grid treat it as what it nearly is: light
//! from one direction. What is left of the image has the rest; together they bring the same irradiance as
//! the image, with its radiance bilinear between texel centres.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::environment::EnvironmentImage;
use crate::light::{Light, LightGeometry};
use crate::scene::Scene;

/// Most suns of an image.
pub const MAX_SUNS: usize = 4;
/// A sun's texels lie within this angle of its brightest one, radians: 3 degrees.
const RADIUS: f64 = 0.052;
/// A texel shines where it is brighter than the mean over all directions by this factor.
const BRIGHTER: f64 = 8.0;
/// A sun brings at least this share of all light.
const LEAST_SHARE: f64 = 0.02;

/// One sun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Towards it, unit, in the image's axes.
    pub towards: DVec3,
    /// Irradiance on a plane that faces it, linear RGB, for a factor of 1.
    pub irradiance: DVec3,
}

/// An image in two parts.
#[derive(Debug)]
pub struct Split {
    /// What is left.
    pub rest: Arc<EnvironmentImage>,
    /// At least one, the brightest first.
    pub suns: Vec<Sun>,
}

/// Integral over the sphere of what a texel of radiance 1 in this row adds to an image that is bilinear
/// between texel centres, steradians. Columns wrap around; the outermost rows reach to the poles.
fn solid_angle(row: usize, width: usize, height: usize) -> f64 {
    let step = PI / height as f64;
    let centre = (row as f64 + 0.5) * step;
    let (sine, cosine) = centre.sin_cos();
    let above = if row == 0 { 1.0 - cosine } else { (sine - (centre - step).sin()) / step - cosine };
    let below = if row + 1 == height { 1.0 + cosine } else { cosine - ((centre + step).sin() - sine) / step };
    2.0 * PI / width as f64 * (above + below)
}

fn towards(x: usize, y: usize, image: &EnvironmentImage) -> DVec3 {
    let (sin, cos) = (2.0 * PI * (x as f64 + 0.5) / image.width() as f64).sin_cos();
    let (sine, cosine) = (PI * (y as f64 + 0.5) / image.height() as f64).sin_cos();
    DVec3::new(sine * sin, cosine, -sine * cos)
}

/// Irradiance over all directions (fluence) that an image brings, linear RGB.
pub fn fluence(image: &EnvironmentImage) -> DVec3 {
    let texel = |(i, texel): (usize, &[f32; 3])| {
        let weight = solid_angle(i / image.width(), image.width(), image.height());
        DVec3::from_array(texel.map(f64::from)) * weight
    };
    image.texels().iter().enumerate().map(texel).sum()
}

impl Split {
    /// Takes small suns out of an image, if there are any.
    pub fn of(image: &EnvironmentImage) -> Option<Self> {
        let (width, height) = (image.width(), image.height());
        let all = fluence(image);
        let brightest = |texel: &[f32; 3]| f64::from(texel[0].max(texel[1]).max(texel[2]));
        let usual = all.max_element() / (4.0 * PI);
        let mut shining: Vec<usize> =
            (0..width * height).filter(|&i| brightest(&image.texels()[i]) > BRIGHTER * usual).collect();
        // Of equally bright ones the first.
        shining.sort_by(|&a, &b| {
            brightest(&image.texels()[b]).total_cmp(&brightest(&image.texels()[a])).then(a.cmp(&b))
        });
        let mut texels = image.texels().to_vec();
        let mut suns = Vec::new();
        while suns.len() < MAX_SUNS && !shining.is_empty() {
            let middle = towards(shining[0] % width, shining[0] / width, image);
            let (own, others): (Vec<usize>, Vec<usize>) = shining
                .into_iter()
                .partition(|&i| towards(i % width, i / width, image).dot(middle) >= RADIUS.cos());
            shining = others;
            let (mut irradiance, mut mean) = (DVec3::ZERO, DVec3::ZERO);
            let mut left = Vec::new();
            for &i in &own {
                // As bright as usual is left, in its colour.
                let kept = texels[i].map(|channel| channel * (usual / brightest(&texels[i])) as f32);
                let [before, after] = [texels[i], kept].map(|texel| DVec3::from_array(texel.map(f64::from)));
                let taken = (before - after) * solid_angle(i / width, width, height);
                irradiance += taken;
                mean += taken.element_sum() * towards(i % width, i / width, image);
                left.push((i, kept));
            }
            if irradiance.max_element() < LEAST_SHARE * all.max_element() {
                continue;
            }
            left.into_iter().for_each(|(i, kept)| texels[i] = kept);
            suns.push(Sun { towards: mean.normalize(), irradiance });
        }
        suns.sort_by(|a, b| b.irradiance.element_sum().total_cmp(&a.irradiance.element_sum()));
        let rest = EnvironmentImage::new(width, height, texels.as_flattened()).ok()?;
        (!suns.is_empty()).then(|| Self { rest: Arc::new(rest), suns })
    }
}

impl Scene {
    /// The scene with small suns of its environment images as lights of their own, if there are any and
    /// there is room among the lights: it is lit the same. What is seen behind the volume is as before.
    #[must_use]
    pub fn with_suns_apart(&self) -> Option<Self> {
        let mut lights = Vec::with_capacity(self.lights.len() + MAX_SUNS);
        for light in &self.lights {
            match &light.geometry {
                LightGeometry::Environment { image, world_from_map } => match image.split() {
                    Some(split) => lights.extend(apart(light, split, *world_from_map)),
                    None => lights.push(light.clone()),
                },
                _ => lights.push(light.clone()),
            }
        }
        let has_room = lights.len() <= proto::scene_file::limits::MAX_LIGHTS;
        (lights.len() > self.lights.len() && has_room).then(|| Self { lights, ..self.clone() })
    }
}

/// The light without its suns, and they.
fn apart(light: &Light, split: &Split, world_from_map: DMat3) -> Vec<Light> {
    let rest = LightGeometry::Environment { image: split.rest.clone(), world_from_map };
    let sun = |(number, sun): (usize, &Sun)| Light {
        // No identifier of a scene file has a line break.
        id: format!("{}\nsun {number}", light.id),
        index: light.index,
        geometry: LightGeometry::Directional { direction: -(world_from_map * sun.towards) },
        power: light.power * sun.irradiance,
    };
    let suns = split.suns.iter().enumerate().map(sun);
    std::iter::once(Light { geometry: rest, ..light.clone() }).chain(suns).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spherical::sky::Sky;

    /// Blue above, brown below, and bright texels.
    fn sky(bright: &[(usize, [f32; 3])]) -> EnvironmentImage {
        let mut texels: Vec<[f32; 3]> =
            (0..64 * 32).map(|i| if i < 1024 { [0.2, 0.3, 0.5] } else { [0.06, 0.05, 0.03] }).collect();
        bright.iter().for_each(|&(i, texel)| texels[i] = texel);
        EnvironmentImage::new(64, 32, texels.as_flattened()).unwrap()
    }

    fn agrees(a: DVec3, b: DVec3, share: f64) {
        assert!((a - b).abs().max_element() <= share * b.max_element(), "{a} for {b}");
    }

    #[test]
    fn texels_stand_for_all_directions() {
        for (width, height) in [(1, 1), (3, 2), (64, 32)] {
            let all: f64 = (0..height).map(|y| width as f64 * solid_angle(y, width, height)).sum();
            assert!((all - 4.0 * PI).abs() < 1e-12, "{width} x {height}: {all}");
        }
        let image = sky(&[(64 * 8 + 58, [260.0, 230.0, 180.0]), (3, [50.0, 10.0, 4.0])]);
        agrees(fluence(&image), Sky::of(&image).total(), 2e-4);
    }

    #[test]
    fn parts_bring_the_light_of_the_whole() {
        let image = sky(&[
            (64 * 8 + 58, [260.0, 230.0, 180.0]),
            (64 * 8 + 59, [250.0, 230.0, 180.0]),
            (64 * 20 + 5, [90.0, 10.0, 3.0]),
        ]);
        let split = Split::of(&image).unwrap();
        assert_eq!(split.suns.len(), 3);
        let suns: DVec3 = split.suns.iter().map(|sun| sun.irradiance).sum();
        agrees(suns + fluence(&split.rest), fluence(&image), 1e-6);
        agrees(suns + Sky::of(&split.rest).total(), Sky::of(&image).total(), 2e-4);
        agrees(split.suns[0].towards, towards(58, 8, &image), 1e-9);
        assert!(split.suns[0].irradiance.x > split.suns[1].irradiance.x);
        let brightest = split.rest.texels().iter().flatten().copied().fold(0.0, f32::max);
        assert!(f64::from(brightest) <= 2.0 * fluence(&image).max_element() / (4.0 * PI), "{brightest}");
    }

    #[test]
    fn neighbouring_texels_of_a_fine_image_are_one_sun() {
        let (width, height) = (512, 256);
        let mut texels = vec![[0.2_f32, 0.3, 0.5]; width * height];
        for (x, y) in [(100, 60), (101, 60), (100, 61), (101, 61)] {
            texels[y * width + x] = [9000.0; 3];
        }
        let image = EnvironmentImage::new(width, height, texels.as_flattened()).unwrap();
        let split = Split::of(&image).unwrap();
        assert_eq!(split.suns.len(), 1);
        let middle = (towards(100, 60, &image) + towards(101, 61, &image)).normalize();
        assert!(split.suns[0].towards.dot(middle) > 1.0 - 1e-6);
        agrees(split.suns[0].irradiance + fluence(&split.rest), fluence(&image), 1e-6);
    }

    #[test]
    fn broad_and_weak_lights_stay_in_the_image() {
        assert!(Split::of(&sky(&[])).is_none());
        assert!(Split::of(&sky(&[(64 * 9 + 3, [6.0; 3])])).is_none());
        let black = EnvironmentImage::new(2, 1, &[0.0; 6]).unwrap();
        assert!(Split::of(&black).is_none());
    }

    #[test]
    fn suns_are_bounded() {
        let bright: Vec<_> = (0..30).map(|i| (64 * 12 + 2 * i, [200.0 + i as f32; 3])).collect();
        let image = sky(&bright);
        let split = Split::of(&image).unwrap();
        assert!(split.suns.len() <= MAX_SUNS);
        let suns: DVec3 = split.suns.iter().map(|sun| sun.irradiance).sum();
        agrees(suns + fluence(&split.rest), fluence(&image), 1e-6);
    }
}
