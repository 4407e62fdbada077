//! Environments that come with the service, computed.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use scene::environment::{EnvironmentError, EnvironmentImage};

/// Texels around the horizon and from pole to pole.
pub const SIZE: [usize; 2] = [512, 256];
/// The sun's radius in the sky, radians: larger than it is, so that few paths miss it.
const SUN_RADIUS: f64 = 0.03;
/// The sun's radiance: about as much light as the clear sky gives.
const SUN_RADIANCE: f64 = 900.0;

/// A computed environment.
pub struct Sample {
    /// Identifier.
    pub id: &'static str,
    /// For people.
    pub name: &'static str,
    radiance: fn(DVec3) -> DVec3,
}

/// All of them.
pub const SAMPLES: [Sample; 3] = [
    Sample { id: "studio", name: "Studio", radiance: studio },
    Sample { id: "clear-sky", name: "Clear sky", radiance: clear_sky },
    Sample { id: "overcast", name: "Overcast", radiance: overcast },
];

impl Sample {
    /// The picture.
    ///
    /// # Errors
    /// A formula that gives no light.
    pub fn image(&self) -> Result<EnvironmentImage, EnvironmentError> {
        let (width, height, rgb) = self.texels();
        EnvironmentImage::new(width, height, &rgb)
    }

    /// Width, height, and linear RGB from the top row.
    fn texels(&self) -> (usize, usize, Vec<f32>) {
        let [width, height] = SIZE;
        let mut rgb = Vec::with_capacity(3 * width * height);
        for row in 0..height {
            let (sin_polar, cos_polar) = ((row as f64 + 0.5) / height as f64 * PI).sin_cos();
            for column in 0..width {
                let (sin, cos) = ((column as f64 + 0.5) / width as f64 * TAU).sin_cos();
                let direction = DVec3::new(sin_polar * sin, cos_polar, -sin_polar * cos);
                rgb.extend((self.radiance)(direction).as_vec3().to_array());
            }
        }
        (width, height, rgb)
    }
}

/// A dark room with a large soft box from the upper left, a weaker one from the right, a narrow one
/// behind, and a floor that gives some light back.
fn studio(direction: DVec3) -> DVec3 {
    let room = DVec3::splat(0.06) + DVec3::splat(0.08) * (-direction.y).max(0.0);
    let boxes = [
        (DVec3::new(-0.6, 0.7, 0.6), 0.42, DVec3::new(9.0, 8.6, 8.0)),
        (DVec3::new(0.9, 0.15, 0.5), 0.35, DVec3::new(1.6, 1.9, 2.3)),
        (DVec3::new(0.2, 0.5, -0.9), 0.22, DVec3::splat(6.0)),
    ];
    boxes.into_iter().fold(room, |sum, (centre, radius, radiance)| {
        // A soft edge, a fifth of the radius wide.
        let angle = direction.angle_between(centre);
        let inside = ((radius * 1.1 - angle) / (radius * 0.2)).clamp(0.0, 1.0);
        sum + radiance * inside * inside * (3.0 - 2.0 * inside)
    })
}

/// Blue above, pale towards the horizon, brown earth below, a sun.
fn clear_sky(direction: DVec3) -> DVec3 {
    let sun = DVec3::new(0.5, 0.6, 0.62).normalize();
    let up = direction.y;
    let sky = DVec3::new(0.75, 0.85, 0.95).lerp(DVec3::new(0.14, 0.30, 0.75), up.max(0.0).powf(0.45));
    let ground = DVec3::new(0.16, 0.13, 0.10);
    let horizon = (up * 20.0 + 0.5).clamp(0.0, 1.0);
    let glow = 1.2 * (-(direction.angle_between(sun) / 0.25).powi(2)).exp();
    let disc = if direction.angle_between(sun) < SUN_RADIUS { SUN_RADIANCE } else { 0.0 };
    ground.lerp(sky + DVec3::new(1.0, 0.9, 0.7) * glow, horizon) + DVec3::new(1.0, 0.93, 0.82) * disc
}

/// The standard overcast sky of the CIE: three times as bright above as at the horizon.
fn overcast(direction: DVec3) -> DVec3 {
    if direction.y >= 0.0 {
        DVec3::new(1.0, 1.02, 1.06) * (1.0 + 2.0 * direction.y) / 3.0 * 1.3
    } else {
        DVec3::splat(0.12)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_light_of_everyday_strength() {
        for sample in SAMPLES {
            let (width, height, rgb) = sample.texels();
            assert_eq!(rgb.len(), 3 * width * height);
            assert!(rgb.iter().all(|x| x.is_finite() && *x >= 0.0));
            let mut mean = 0.0;
            let mut solid_angle = 0.0;
            for (row, texels) in rgb.chunks(3 * width).enumerate() {
                let weight = ((row as f64 + 0.5) / height as f64 * PI).sin();
                mean += weight * texels.iter().map(|x| f64::from(*x)).sum::<f64>() / (3 * width) as f64;
                solid_angle += weight;
            }
            let mean = mean / solid_angle;
            assert!((0.3..2.0).contains(&mean), "{}: {mean}", sample.id);
        }
    }
}
