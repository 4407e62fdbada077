//! Convex regions of the volume's box, and view rays.

use glam::DVec3;
use scene::camera::Projection;
use scene::{Camera, Scene};

/// A ray; `direction` has unit length.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

impl Ray {
    /// The point at distance `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

/// The ray through the image point (x, y), in pixels from the upper left corner of an image of
/// `width` x `height` square pixels.
pub fn camera_ray(camera: &Camera, [x, y]: [f64; 2], width: u32, height: u32) -> Ray {
    let pixel = 2.0 / f64::from(height);
    let across = pixel * (x - 0.5 * f64::from(width));
    let upwards = pixel * (0.5 * f64::from(height) - y);
    let offset = across * camera.right + upwards * camera.up;
    match camera.projection {
        Projection::Perspective { tan_half_fov_y } => {
            let direction = (camera.forward + tan_half_fov_y * offset).normalize();
            Ray { origin: camera.eye, direction }
        }
        Projection::Orthographic { half_height } => {
            Ray { origin: camera.eye + half_height * offset, direction: camera.forward }
        }
    }
}

/// A box and half-spaces: what all of them contain.
pub struct Region {
    low: DVec3,
    high: DVec3,
    /// Keeps `dot(normal, x) >= offset`.
    planes: Vec<(DVec3, f64)>,
}

impl Region {
    /// The whole box of the volume.
    pub fn whole(scene: &Scene) -> Self {
        let high = 0.5 * scene.grid.size_world;
        Self { low: -high, high, planes: Vec::new() }
    }

    /// What the scene's clip box and clip planes keep.
    pub fn kept(scene: &Scene) -> Self {
        let half = 0.5 * scene.grid.size_world;
        let [low, high] = scene.clip.bounds.map(|corner| (2.0 * corner - 1.0) * half);
        Self { low: low.max(-half), high: high.min(half), planes: scene.clip.planes.clone() }
    }

    /// Whether it contains a point.
    pub fn contains(&self, x: DVec3) -> bool {
        x.cmpge(self.low).all()
            && x.cmple(self.high).all()
            && self.planes.iter().all(|(normal, offset)| normal.dot(x) >= *offset)
    }

    /// The part of a ray ahead of its origin that lies inside.
    pub fn interval(&self, ray: &Ray) -> Option<[f64; 2]> {
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        // Keeps the part where height + slope * t >= 0.
        let mut keep = |height: f64, slope: f64| {
            if slope > 0.0 {
                near = near.max(-height / slope);
            } else if slope < 0.0 {
                far = far.min(-height / slope);
            } else if height < 0.0 {
                far = f64::NEG_INFINITY;
            }
        };
        for axis in 0..3 {
            keep(ray.origin[axis] - self.low[axis], ray.direction[axis]);
            keep(self.high[axis] - ray.origin[axis], -ray.direction[axis]);
        }
        for (normal, offset) in &self.planes {
            keep(normal.dot(ray.origin) - offset, normal.dot(ray.direction));
        }
        (near < far).then_some([near, far])
    }
}
