//! The view: from pixels to rays.

use glam::DVec3;
use proto::scene_file as file;

/// Vertical angle of view where the file names none.
const DEFAULT_FOV_Y_DEGREES: f64 = 40.0;
/// Distance of the default camera from the centre: the unit box fits with a margin.
const DEFAULT_DISTANCE_WORLD: f64 = 2.2;

/// An orthonormal view frame and a projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Eye, world.
    pub eye: DVec3,
    /// View direction, unit.
    pub forward: DVec3,
    /// To the right in the image, unit.
    pub right: DVec3,
    /// Upwards in the image, unit.
    pub up: DVec3,
    /// How rays spread.
    pub projection: Projection,
}

/// How rays spread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// From the eye; half the image's height at distance 1 from it.
    Perspective {
        /// `tan(fov_y / 2)`.
        tan_half_fov_y: f64,
    },
    /// Parallel to `forward`, starting in the plane through the eye.
    Orthographic {
        /// Half the image's height, world units.
        half_height: f64,
    },
}

impl Camera {
    /// From the checked file form.
    pub fn from_file(camera: &file::Camera) -> Self {
        let eye = DVec3::from_array(camera.position);
        let forward = (DVec3::from_array(camera.target) - eye).normalize();
        let right = forward.cross(DVec3::from_array(camera.up)).normalize();
        let projection = match (camera.orthographic_height, camera.fov_y_degrees) {
            (Some(height), _) => Projection::Orthographic { half_height: 0.5 * height },
            (None, fov) => Projection::Perspective {
                tan_half_fov_y: (0.5 * fov.unwrap_or(DEFAULT_FOV_Y_DEGREES).to_radians()).tan(),
            },
        };
        Self { eye, forward, right, up: right.cross(forward), projection }
    }

    /// The view a scene without a camera gets: anatomical data from the front (looking along +y,
    /// up +z), other data looking along -z, up +y.
    pub fn default_file(anatomical: bool) -> file::Camera {
        let (position, up) = if anatomical {
            ([0.0, -DEFAULT_DISTANCE_WORLD, 0.0], [0.0, 0.0, 1.0])
        } else {
            ([0.0, 0.0, DEFAULT_DISTANCE_WORLD], [0.0, 1.0, 0.0])
        };
        file::Camera {
            position,
            target: [0.0; 3],
            up,
            fov_y_degrees: Some(DEFAULT_FOV_Y_DEGREES),
            orthographic_height: None,
        }
    }

    /// Origin and unit direction of the ray through image point (x, y), in pixels from the upper
    /// left corner of an image of `width` x `height` square pixels.
    pub fn ray(&self, x: f64, y: f64, width: u32, height: u32) -> (DVec3, DVec3) {
        let (width, height) = (f64::from(width), f64::from(height));
        // -1..1 over the height, square pixels.
        let (u, v) = ((2.0 * x - width) / height, (height - 2.0 * y) / height);
        match self.projection {
            Projection::Perspective { tan_half_fov_y: t } => {
                (self.eye, (self.forward + t * (u * self.right + v * self.up)).normalize())
            }
            Projection::Orthographic { half_height: h } => {
                (self.eye + h * (u * self.right + v * self.up), self.forward)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_is_up_and_right_is_right() {
        let camera = Camera::from_file(&Camera::default_file(false));
        let (_, center) = camera.ray(50.0, 25.0, 100, 50);
        assert!((center - DVec3::NEG_Z).length() < 1e-12);
        let (_, corner) = camera.ray(100.0, 0.0, 100, 50);
        assert!(corner.x > 0.0 && corner.y > 0.0, "upper right corner looks right and up");
        let t = 20f64.to_radians().tan();
        assert!((corner.y / -corner.z - t).abs() < 1e-12, "fov is the vertical angle");
        assert!((corner.x / -corner.z - 2.0 * t).abs() < 1e-12, "square pixels");
    }

    #[test]
    fn anatomical_front_view_shows_the_patients_left_on_the_right() {
        let camera = Camera::from_file(&Camera::default_file(true));
        assert!((camera.right - DVec3::X).length() < 1e-12);
        assert!((camera.up - DVec3::Z).length() < 1e-12);
    }

    #[test]
    fn orthographic_height_is_the_whole_image() {
        let mut file = Camera::default_file(false);
        file.fov_y_degrees = None;
        file.orthographic_height = Some(1.2);
        let camera = Camera::from_file(&file);
        let (top, direction) = camera.ray(10.0, 0.0, 20, 20);
        let (bottom, _) = camera.ray(10.0, 20.0, 20, 20);
        assert!(((top - bottom).y - 1.2).abs() < 1e-12);
        assert_eq!(direction, DVec3::NEG_Z);
    }
}
