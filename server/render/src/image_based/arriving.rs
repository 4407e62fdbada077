//! The light that would arrive at every record if there were no matter, direction by direction: what
//! `project_records` multiplies transmittances with.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use proto::scene_file::RecordForm;
use scene::light::{Light, LightGeometry};
use scene::spherical::sky::{Sky, SkyPixel};
use scene::spherical::{healpix, sh};
use scene::{Records, Scene};

use crate::skies::Skies;

/// The field's largest number of usual light. Half floats reach 65504 and are exact to 5e-4 down to
/// 6e-5: above it is room for records next to a lamp, below it for shadows of a four-millionth.
const USUAL_TEXEL: f64 = 256.0;

/// Light without matter.
pub struct Arriving {
    /// Row k, column p: of pixel p the integral of radiance times spherical harmonic k in red, green and
    /// blue, and of the harmonic alone.
    pub products: Vec<[f32; 4]>,
    /// Lights that get a ray of their own from every record.
    pub lights: Vec<Light>,
    /// The field holds coefficients divided by this.
    pub scale: f32,
    /// Of the paper's forms: share of the light, cut to a few bands, that was negative and is left
    /// out, 0..1.
    pub clamped_share: f64,
}

/// Whether records cast a ray of their own to a light. In the paper's forms those at infinity are part
/// of the environment; in ours what comes from one direction is no part of records.
pub fn has_own_ray(light: &Light, form: RecordForm) -> bool {
    match light.geometry {
        LightGeometry::UniformEnvironment | LightGeometry::Environment { .. } => false,
        LightGeometry::Directional { .. } => false,
        _ => form != RecordForm::Product,
    }
}

impl Arriving {
    /// Of a scene, in `nside` and `bands` (which may be fewer than its settings say).
    pub fn of(scene: &Scene, nside: usize, bands: usize, skies: &mut Skies) -> Self {
        let settings = Records::of(scene);
        let form = settings.form;
        let light_bands = if form == RecordForm::Product { bands } else { settings.bands as usize };
        let mut pixels: Option<Vec<SkyPixel>> = None;
        let mut add = |more: Vec<SkyPixel>, power: DVec3| match &mut pixels {
            None => {
                let scaled = |pixel: SkyPixel| SkyPixel {
                    light: pixel.light.iter().map(|&light| light * power).collect(),
                    ..pixel
                };
                pixels = Some(more.into_iter().map(scaled).collect());
            }
            Some(pixels) => {
                for (pixel, more) in pixels.iter_mut().zip(more) {
                    pixel.light.iter_mut().zip(more.light).for_each(|(sum, light)| *sum += light * power);
                }
            }
        };
        let mut any = false;
        for light in &scene.lights {
            match &light.geometry {
                LightGeometry::UniformEnvironment => {
                    let sky = Sky::uniform(DVec3::ONE);
                    add(sky.pixels(nside, light_bands, DMat3::IDENTITY), light.power);
                }
                LightGeometry::Environment { image, world_from_map } => {
                    add(skies.of(image).pixels(nside, light_bands, *world_from_map), light.power);
                }
                _ => continue,
            }
            any = true;
        }
        if !any {
            add(Sky::uniform(DVec3::ZERO).pixels(nside, light_bands, DMat3::IDENTITY), DVec3::ZERO);
        }
        let mut pixels = pixels.unwrap_or_default();
        let window = |k: usize, bands: usize| {
            let band = ((k as f64) + 0.5).sqrt().floor();
            if settings.window { 0.5 + 0.5 * (PI * band / bands as f64).cos() } else { 1.0 }
        };
        let mut clamped_share = 0.0;
        if form == RecordForm::Product {
            for pixel in &mut pixels {
                for (k, light) in pixel.light.iter_mut().enumerate() {
                    *light *= window(k, bands);
                }
            }
        } else {
            let distant = scene.lights.iter().filter(|light| !has_own_ray(light, form));
            let mut coefficients = vec![DVec3::ZERO; light_bands * light_bands];
            for pixel in &pixels {
                coefficients.iter_mut().zip(&pixel.light).for_each(|(sum, light)| *sum += *light);
            }
            for light in distant {
                if let LightGeometry::Directional { direction } = light.geometry {
                    let y = sh::basis(light_bands, -direction);
                    coefficients.iter_mut().zip(y).for_each(|(sum, y)| *sum += light.power * y);
                }
            }
            for (k, coefficient) in coefficients.iter_mut().enumerate() {
                *coefficient *= window(k, light_bands);
            }
            (pixels, clamped_share) = sampled_at_centres(&coefficients, nside, light_bands, bands);
        }
        let count = bands * bands;
        let lights: Vec<Light> = scene.lights.iter().filter(|l| has_own_ray(l, form)).cloned().collect();
        let texel = |k: usize, pixel: &SkyPixel| {
            let light = pixel.light[k].as_vec3();
            [light.x, light.y, light.z, pixel.solid[k] as f32]
        };
        let products = (0..count).flat_map(|k| pixels.iter().map(move |pixel| texel(k, pixel))).collect();
        let mut fluence: f64 = pixels.iter().map(|pixel| pixel.light[0]).sum::<DVec3>().max_element();
        fluence *= (4.0 * PI).sqrt();
        // Scattered light is that of all lights.
        let scattered = |light: &&Light| settings.exchanges > 0 || has_own_ray(light, form);
        let near = scene.lights.iter().filter(|light| !light.is_environment()).filter(scattered);
        fluence += near.map(|light| largest_irradiance(light, scene)).sum::<f64>();
        let glow = scene.transfer_function.points.iter().map(|point| point.emission.max_element());
        fluence += 4.0 * PI * glow.fold(0.0, f64::max);
        // A power of two, so that it changes no digit of a coefficient.
        let scale = (fluence / USUAL_TEXEL).log2().ceil().exp2() as f32;
        let scale = if scale.is_normal() { scale } else { 1.0 };
        Self { products, lights, scale, clamped_share }
    }
}

/// The paper's light: cut to a few bands, looked at in the centres of pixels, each of which stands for
/// an equal solid angle; and the share of it that was negative.
fn sampled_at_centres(
    coefficients: &[DVec3],
    nside: usize,
    light_bands: usize,
    bands: usize,
) -> (Vec<SkyPixel>, f64) {
    let solid_angle = healpix::solid_angle(nside);
    let (mut negative, mut all) = (0.0, 0.0);
    let pixel = |centre: DVec3| {
        let y = sh::basis(light_bands, centre);
        let seen: DVec3 = coefficients.iter().zip(y).map(|(c, y)| *c * y).sum();
        negative += (-seen).max(DVec3::ZERO).element_sum();
        all += seen.abs().element_sum();
        let arriving = seen.max(DVec3::ZERO) * solid_angle;
        let y = sh::basis(bands, centre);
        SkyPixel {
            light: y[..bands * bands].iter().map(|y| arriving * *y).collect(),
            solid: y[..bands * bands].iter().map(|y| solid_angle * y).collect(),
        }
    };
    let pixels = healpix::centres(nside).into_iter().map(pixel).collect();
    (pixels, if all > 0.0 { negative / all } else { 0.0 })
}

/// Irradiance of a light at a record close to it.
fn largest_irradiance(light: &Light, scene: &Scene) -> f64 {
    let power = light.power.max_element();
    let half_record = 0.5 / f64::from(Records::of(scene).along_longest_edge);
    let nearest = |position: DVec3| {
        let outside = (position.abs() - 0.5 * scene.grid.size_world).max(DVec3::ZERO);
        outside.length().max(half_record)
    };
    match light.geometry {
        LightGeometry::Point { position } | LightGeometry::Spot { position, .. } => {
            power / nearest(position).powi(2)
        }
        LightGeometry::Rectangle { .. } | LightGeometry::Disk { .. } | LightGeometry::Sphere { .. } => {
            power * 2.0 * PI
        }
        _ => power,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proto::SceneFile;
    use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Volume, Voxels};
    use serde_json::json;

    use super::*;

    fn scene(lights: serde_json::Value, settings: serde_json::Value) -> Scene {
        let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "lights": lights,
            "materials": {"m": {"phase": {"type": "henyey_greenstein", "g": 0.5}}},
            "transfer_function": {"points": [{"s": 0, "extinction": 1, "material": "m"}]},
            "illumination": {"method": "image_based"}});
        for (key, value) in settings.as_object().unwrap() {
            file["illumination"][key] = value.clone();
        }
        let rgb: Vec<f32> =
            (0..16 * 8).flat_map(|i| [if i == 37 { 5000.0 } else { 1.0 }, 1.0, 0.2]).collect();
        let image = Arc::new(EnvironmentImage::new(16, 8, &rgb).unwrap());
        let images: EnvironmentImages = [("sky".to_owned(), image)].into();
        let volume = Arc::new(PreparedVolume::new(Volume::new([4; 3], Voxels::U8(vec![9; 64])), &|_| {}));
        Scene::with_images(&SceneFile::from_value(file).unwrap(), volume, &images).unwrap()
    }

    fn sum(arriving: &Arriving, nside: usize, k: usize) -> [f64; 4] {
        let columns = healpix::pixel_count(nside);
        let row = &arriving.products[k * columns..(k + 1) * columns];
        std::array::from_fn(|channel| row.iter().map(|texel| f64::from(texel[channel])).sum())
    }

    #[test]
    fn a_uniform_environment_has_its_mean_alone() {
        let scene = scene(json!([{"type": "environment", "radiance": [2, 1, 0]}]), json!({}));
        for form in ["product", "static"] {
            let scene = Scene { illumination: with_form(&scene, form), ..scene.clone() };
            let arriving = Arriving::of(&scene, 4, 3, &mut Skies::default());
            let mean = (4.0 * PI).sqrt();
            let [r, g, b, solid] = sum(&arriving, 4, 0);
            assert!((r - 2.0 * mean).abs() < 1e-3 && (g - mean).abs() < 1e-3 && b == 0.0, "{form}");
            assert!((solid - mean).abs() < 1e-3);
            assert!(arriving.clamped_share < 1e-6);
            let exact = if form == "product" { 2e-3 } else { 0.1 };
            assert!((1..9).all(|k| sum(&arriving, 4, k)[0].abs() < exact), "{form}");
        }
    }

    fn with_form(scene: &Scene, form: &str) -> proto::scene_file::Illumination {
        let form = serde_json::from_value(json!(form)).unwrap();
        proto::scene_file::Illumination { record_form: form, ..scene.illumination.clone() }
    }

    #[test]
    fn the_product_keeps_all_of_a_small_sun_the_papers_forms_leave_out_what_rings() {
        let sun = scene(json!([{"type": "environment", "image": "sky"}]), json!({}));
        let mut skies = Skies::default();
        let kept = Arriving::of(&sun, 2, 1, &mut skies);
        let total = Sky::of(sun.environment_image().unwrap().0).total();
        assert!((sum(&kept, 2, 0)[0] * (4.0 * PI).sqrt() - total.x).abs() < 1e-3 * total.x);
        assert_eq!(kept.clamped_share, 0.0);
        let cut = Scene { illumination: with_form(&sun, "isotropic"), ..sun.clone() };
        let cut = Arriving::of(&cut, 2, 1, &mut skies);
        assert!(cut.clamped_share > 0.05, "{}", cut.clamped_share);
        let mut windowed = with_form(&sun, "isotropic");
        windowed.record_window = true;
        let windowed = Scene { illumination: windowed, ..sun.clone() };
        let windowed = Arriving::of(&windowed, 2, 1, &mut skies);
        assert!(windowed.clamped_share < 0.5 * cut.clamped_share, "{}", windowed.clamped_share);
        assert_eq!(skies.len(), 1);
    }

    #[test]
    fn lights_with_a_direction_are_no_part_of_records() {
        let lights = json!([{"type": "directional", "direction": [0, -1, 0], "irradiance": [3, 3, 3]},
            {"type": "point", "position": [1, 0, 0], "intensity": [1, 1, 1]}]);
        let lit = scene(lights, json!({}));
        let arriving = Arriving::of(&lit, 1, 3, &mut Skies::default());
        assert!(arriving.lights.is_empty());
        assert!(arriving.products.iter().all(|texel| texel[0] == 0.0));
        let cut = Scene { illumination: with_form(&lit, "static"), ..lit.clone() };
        let cut = Arriving::of(&cut, 2, 3, &mut Skies::default());
        assert_eq!(
            cut.lights.len(),
            1,
            "the paper's form takes the sun as part of the environment, the lamp has a ray"
        );
        let up = sum(&cut, 2, 1)[0];
        assert!(up > 0.5 && cut.clamped_share > 0.05, "{up}");
    }
}
