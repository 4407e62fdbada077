//! Pictures of light from all directions.
//!
//! Latitude-longitude: the texel at column u, row v (texel centres, each 0..1 over the image) shows
//! the radiance that arrives from the direction `(sin(v') sin(u'), cos(v'), -sin(v') cos(u'))` of
//! the map, `u' = 2 pi u`, `v' = pi v`. Between texel centres radiance is bilinear; columns wrap
//! around, rows beyond the first and the last repeat them.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use glam::DMat3;

use crate::suns::Split;

/// An environment's texels. Equal content compares equal.
pub struct EnvironmentImage {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
    content: [u8; 32],
    split: OnceLock<Option<Split>>,
}

/// Loaded images by the text that names them in the scene file.
pub type EnvironmentImages = BTreeMap<String, Arc<EnvironmentImage>>;

/// Why texels are no environment.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EnvironmentError {
    /// The number of texels is not that of the size, or is 0.
    #[error("{width} x {height} texels of three numbers are needed, got {numbers} numbers")]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Numbers given.
        numbers: usize,
    },
    /// A number is negative or not finite.
    #[error("radiance must be finite and >= 0, got {value} in texel {texel}")]
    Radiance {
        /// Index of the texel, rows from the top.
        texel: usize,
        /// What it holds, as text.
        value: String,
    },
}

impl EnvironmentImage {
    /// From linear RGB, rows from the top (+y), `3 * width * height` numbers.
    ///
    /// # Errors
    /// The number of texels does not fit, or a number is negative or not finite.
    pub fn new(width: usize, height: usize, rgb: &[f32]) -> Result<Self, EnvironmentError> {
        let (texels, rest) = rgb.as_chunks::<3>();
        if texels.is_empty() || !rest.is_empty() || width.checked_mul(height) != Some(texels.len()) {
            return Err(EnvironmentError::Size { width, height, numbers: rgb.len() });
        }
        if let Some(at) = rgb.iter().position(|x| !x.is_finite() || *x < 0.0) {
            return Err(EnvironmentError::Radiance { texel: at / 3, value: rgb[at].to_string() });
        }
        let mut hasher = blake3::Hasher::new();
        hasher.update(format!("{width} {height}").as_bytes());
        hasher.update(bytemuck::cast_slice(rgb));
        Ok(Self {
            width,
            height,
            texels: texels.to_vec(),
            content: *hasher.finalize().as_bytes(),
            split: OnceLock::new(),
        })
    }

    /// Texels around the horizon.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Texels from the +y pole to the -y pole.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Linear RGB radiance, rows from the top; finite, >= 0.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Linear RGB radiance, mean over all directions; each texel stands for its solid angle.
    pub fn mean_radiance(&self) -> [f64; 3] {
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for (row, texels) in self.texels.chunks(self.width).enumerate() {
            // Of a row between two polar angles: the difference of their cosines.
            let cosine = |edge: usize| (std::f64::consts::PI * edge as f64 / self.height as f64).cos();
            let weight = (cosine(row) - cosine(row + 1)) / self.width as f64;
            for texel in texels {
                (0..3).for_each(|channel| sum[channel] += weight * f64::from(texel[channel]));
                weights += weight;
            }
        }
        sum.map(|channel: f64| channel / weights)
    }

    /// Its small suns, and what is left of it without them; `None`: it has none. Found when first asked
    /// for.
    pub fn split(&self) -> Option<&Split> {
        self.split.get_or_init(|| Split::of(self)).as_ref()
    }

    /// BLAKE3 of size and texels: equal content, equal hash.
    pub fn content(&self) -> [u8; 32] {
        self.content
    }
}

impl PartialEq for EnvironmentImage {
    fn eq(&self, other: &Self) -> bool {
        self.content == other.content
    }
}

impl std::fmt::Debug for EnvironmentImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let hash = blake3::Hash::from_bytes(self.content).to_hex();
        write!(f, "EnvironmentImage({} x {}, {})", self.width, self.height, &hash[..8])
    }
}

/// Rotation about x, then y, then z, right-handed, in degrees: `world = Rz Ry Rx map`.
pub(crate) fn world_from_map([x, y, z]: [f64; 3]) -> DMat3 {
    DMat3::from_rotation_z(z.to_radians())
        * DMat3::from_rotation_y(y.to_radians())
        * DMat3::from_rotation_x(x.to_radians())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proto::SceneFile;
    use serde_json::json;

    use super::*;
    use crate::changes::{Changes, LightChange};
    use crate::scene::{Background, Scene};
    use crate::{PreparedVolume, Volume, Voxels};

    #[test]
    fn the_mean_is_over_directions_and_not_over_texels() {
        let mean =
            |width, height, rgb: &[f32]| EnvironmentImage::new(width, height, rgb).unwrap().mean_radiance();
        let all = mean(4, 3, &[[0.5f32, 1.0, 2.0]; 12].concat());
        all.iter().zip([0.5, 1.0, 2.0]).for_each(|(got, expected)| assert!((got - expected).abs() < 1e-12));
        // The cap above 60 degrees of latitude is (1 - cos 30) / 2 of all directions.
        let mut cap = [[0.0f32; 3]; 12];
        cap[0] = [1.0; 3];
        cap[1] = [1.0; 3];
        let share = (1.0 - (std::f64::consts::PI / 6.0).cos()) / 2.0;
        assert!((mean(2, 6, &cap.concat())[0] - share).abs() < 1e-12);
    }

    /// A scene lit by the image `sky`.
    fn scene(light: serde_json::Value, sky: Option<&[f32]>) -> Result<Scene, proto::FieldError> {
        let mut lights = vec![json!({"type": "environment", "image": "sky"})];
        for (key, value) in light.as_object().unwrap() {
            lights[0][key] = value.clone();
        }
        let file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "lights": lights,
            "background": "environment"});
        let volume = PreparedVolume::new(Volume::new([1; 3], Voxels::U8(vec![1])), &|_| {});
        let image = sky.map(|rgb| ("sky".to_owned(), Arc::new(EnvironmentImage::new(1, 1, rgb).unwrap())));
        let file = SceneFile::from_value(file).unwrap();
        Scene::with_images(&file, Arc::new(volume), &image.into_iter().collect())
    }

    #[test]
    fn scenes_need_the_images_of_lights_that_shine() {
        assert_eq!(scene(json!({}), None).unwrap_err().field, "lights[0].image");
        let off = scene(json!({"enabled": false}), None).unwrap();
        assert!(off.lights.is_empty() && off.background == Background::Color(DVec3::ZERO));
        let lit = scene(json!({"scale": 2.0}), Some(&[1.0, 2.0, 3.0])).unwrap();
        assert_eq!(lit.lights[0].power, DVec3::splat(2.0));
        assert!(matches!(lit.background, Background::Image { scale, .. } if scale == DVec3::splat(2.0)));
    }

    #[test]
    fn another_image_is_a_change_the_same_one_loaded_again_is_none() {
        let old = scene(json!({}), Some(&[1.0, 2.0, 3.0])).unwrap();
        let same = scene(json!({}), Some(&[1.0, 2.0, 3.0])).unwrap();
        assert!(Changes::between(&old, &same).is_empty());
        let other = scene(json!({}), Some(&[1.0, 2.0, 4.0])).unwrap();
        let changes = Changes::between(&old, &other);
        assert!(changes.background && changes.lights == [("0".to_owned(), LightChange::Moved)]);
        let turned = scene(json!({"rotation_degrees": [0, 90, 0]}), Some(&[1.0, 2.0, 3.0])).unwrap();
        assert_eq!(Changes::between(&old, &turned).lights, [("0".to_owned(), LightChange::Moved)]);
        let brighter = scene(json!({"scale": 2}), Some(&[1.0, 2.0, 3.0])).unwrap();
        assert_eq!(Changes::between(&old, &brighter).lights, [("0".to_owned(), LightChange::Recolored)]);
    }

    #[test]
    fn content_tells_images_apart() {
        let image = |rgb: &[f32]| EnvironmentImage::new(2, 1, rgb).unwrap();
        let a = image(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(a, image(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
        assert_ne!(a, image(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.5]));
        assert_ne!(a, EnvironmentImage::new(1, 2, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]).unwrap());
    }

    #[test]
    fn wrong_texels_are_refused() {
        let new = |width, height, rgb: &[f32]| EnvironmentImage::new(width, height, rgb);
        assert!(matches!(new(2, 1, &[0.0; 3]), Err(EnvironmentError::Size { .. })));
        assert!(matches!(new(0, 0, &[]), Err(EnvironmentError::Size { .. })));
        assert!(matches!(new(usize::MAX, 2, &[0.0; 6]), Err(EnvironmentError::Size { .. })));
        let refused = new(1, 2, &[0.0, 0.0, 0.0, 1.0, f32::NAN, 0.0]).unwrap_err();
        assert_eq!(refused.to_string(), "radiance must be finite and >= 0, got NaN in texel 1");
        assert!(new(1, 1, &[0.0, -1.0, 0.0]).is_err());
    }

    #[test]
    fn rotations_are_right_handed_about_x_then_y_then_z() {
        let close = |a: DVec3, b: DVec3| (a - b).length() < 1e-12;
        assert!(close(world_from_map([90.0, 0.0, 0.0]) * DVec3::Y, DVec3::Z));
        assert!(close(world_from_map([0.0, 90.0, 0.0]) * DVec3::Z, DVec3::X));
        assert!(close(world_from_map([0.0, 0.0, 90.0]) * DVec3::X, DVec3::Y));
        assert!(close(world_from_map([90.0, 90.0, 0.0]) * DVec3::Y, DVec3::X), "x comes first");
    }
}
