//! Light from all around, as the boundary of diffused light takes it.

use std::f64::consts::PI;

use glam::DVec3;
use scene::Scene;
use scene::light::LightGeometry;

use crate::skies::Skies;

/// Of the environments of a scene; small suns of images are lights of their own.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Outside {
    /// Mean radiance over all directions.
    pub mean: DVec3,
    /// Irradiance on faces that look down and up each axis: x, x, y, y, z, z.
    pub on_faces: [DVec3; 6],
}

impl Outside {
    /// Adds up what environments of the scene bring.
    pub fn of(scene: &Scene, skies: &mut Skies) -> Self {
        let mut outside = Self::default();
        for light in &scene.lights {
            let (mean, on_faces) = match &light.geometry {
                LightGeometry::UniformEnvironment => (DVec3::ONE, [DVec3::splat(PI); 6]),
                LightGeometry::Environment { image, world_from_map } => {
                    let sky = skies.of(image);
                    let from_world = world_from_map.transpose();
                    let on = |face| sky.irradiance(from_world * normal(face));
                    (sky.total() / (4.0 * PI), std::array::from_fn(on))
                }
                _ => continue,
            };
            outside.mean += light.power * mean;
            for (sum, irradiance) in outside.on_faces.iter_mut().zip(on_faces) {
                *sum += light.power * irradiance;
            }
        }
        outside
    }

    /// The largest fluence that it brings by a face.
    pub fn largest(&self) -> f64 {
        self.on_faces.iter().map(|irradiance| 4.0 * irradiance.max_element()).fold(0.0, f64::max)
    }
}

/// Outwards, of a face.
fn normal(face: usize) -> DVec3 {
    let mut normal = DVec3::ZERO;
    normal[face / 2] = if face.is_multiple_of(2) { -1.0 } else { 1.0 };
    normal
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proto::SceneFile;
    use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Volume, Voxels};
    use serde_json::json;

    use super::*;

    /// Under a sky that is 3 above and 1 below, faces that look up, aside and down.
    #[test]
    fn faces_see_the_half_they_look_at() {
        let rgb: Vec<f32> = (0..128 * 64).flat_map(|i| [if i < 128 * 32 { 3.0 } else { 1.0 }; 3]).collect();
        let image = Arc::new(EnvironmentImage::new(128, 64, &rgb).unwrap());
        let images: EnvironmentImages = [("sky".to_owned(), image)].into();
        let outside = |rotation: [f64; 3]| {
            let file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
                "lights": [{"type": "environment", "image": "sky", "rotation_degrees": rotation, "scale": 2}],
                "transfer_function": {"points": [{"s": 0, "extinction": 1}]}});
            let volume = Arc::new(PreparedVolume::new(Volume::new([4; 3], Voxels::U8(vec![9; 64])), &|_| {}));
            let scene = Scene::with_images(&SceneFile::from_value(file).unwrap(), volume, &images).unwrap();
            Outside::of(&scene, &mut Skies::default())
        };
        let found = outside([0.0; 3]);
        let near = |found: DVec3, expected: f64| (found - expected).abs().max_element() < 0.02 * expected;
        assert!(near(found.mean, 4.0), "{found:?}");
        for (face, expected) in [(0, 4.0), (1, 4.0), (2, 2.0), (3, 6.0), (4, 4.0), (5, 4.0)] {
            assert!(near(found.on_faces[face], expected * PI), "{face}: {found:?}");
        }
        let turned = outside([180.0, 0.0, 0.0]);
        assert!(turned.on_faces.iter().filter(|irradiance| near(**irradiance, 2.0 * PI)).count() == 1);
    }
}
