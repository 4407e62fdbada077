//! Light sources: where they are apart from how strong they are, so that a recoloured light is
//! told apart from a moved one.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use proto::scene_file as file;

use crate::environment::{EnvironmentImage, EnvironmentImages, world_from_map};

/// A light. Switched off it has no power. Lights are equal that shine alike: their place in the file
/// does not matter.
#[derive(Debug, Clone)]
pub struct Light {
    /// Stable name.
    pub id: String,
    /// Its place among the lights of the scene file, from 0, for errors that name a field.
    pub index: usize,
    /// Where it is and how it spreads.
    pub geometry: LightGeometry,
    /// Linear RGB; irradiance (directional), radiant intensity (point, spot), radiance (others), or
    /// the factor of an environment image.
    pub power: DVec3,
}

impl PartialEq for Light {
    fn eq(&self, other: &Self) -> bool {
        (&self.id, &self.geometry, self.power) == (&other.id, &other.geometry, other.power)
    }
}

/// Placement of a light; directions are normalised, `up` is perpendicular to `normal`.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub enum LightGeometry {
    /// `direction`: the way the light travels.
    Directional {
        direction: DVec3,
    },
    Point {
        position: DVec3,
    },
    /// Cosines of the half-angles: full above the first, smoothstep to 0 at the second.
    Spot {
        position: DVec3,
        direction: DVec3,
        cos_inner: f64,
        cos_outer: f64,
    },
    /// Edges are `size[0]` along `up x normal` and `size[1]` along `up`.
    Rectangle {
        center: DVec3,
        normal: DVec3,
        up: DVec3,
        size: [f64; 2],
    },
    Disk {
        center: DVec3,
        normal: DVec3,
        radius: f64,
    },
    Sphere {
        center: DVec3,
        radius: f64,
    },
    /// Uniform radiance from every direction.
    UniformEnvironment,
    /// Radiance from every direction, seen in a picture; `world_from_map` rotates it.
    Environment {
        image: Arc<EnvironmentImage>,
        world_from_map: DMat3,
    },
}

impl LightGeometry {
    /// Moves the light; those at infinity stay.
    pub fn move_by(&mut self, offset: DVec3) {
        match self {
            LightGeometry::Point { position } | LightGeometry::Spot { position, .. } => *position += offset,
            LightGeometry::Rectangle { center, .. }
            | LightGeometry::Disk { center, .. }
            | LightGeometry::Sphere { center, .. } => *center += offset,
            _ => {}
        }
    }
}

impl Light {
    /// Whether it comes from everywhere, instead of from one direction at each place.
    pub fn is_environment(&self) -> bool {
        matches!(self.geometry, LightGeometry::UniformEnvironment | LightGeometry::Environment { .. })
    }

    /// Whether it is neither off nor black.
    pub fn shines(&self) -> bool {
        self.power != DVec3::ZERO
    }

    /// From the checked file form; `None` for an environment that is off and whose image is not in
    /// `images`.
    ///
    /// # Errors
    /// The image of an environment that is on is not in `images`.
    pub fn from_file(
        light: &file::Light,
        index: usize,
        images: &EnvironmentImages,
    ) -> Result<Option<Self>, proto::FieldError> {
        let v = DVec3::from_array;
        let unit = |a: [f64; 3]| v(a).normalize();
        let (geometry, power) = match light {
            file::Light::Directional(l) => {
                (LightGeometry::Directional { direction: unit(l.direction) }, l.irradiance)
            }
            file::Light::Point(l) => (LightGeometry::Point { position: v(l.position) }, l.intensity),
            file::Light::Spot(l) => {
                let [inner, outer] = l.cone_degrees.map(|degrees| degrees.to_radians().cos());
                let (position, direction) = (v(l.position), unit(l.direction));
                (LightGeometry::Spot { position, direction, cos_inner: inner, cos_outer: outer }, l.intensity)
            }
            file::Light::Rectangle(l) => {
                let normal = unit(l.normal);
                let up = (v(l.up) - normal * normal.dot(v(l.up))).normalize();
                (LightGeometry::Rectangle { center: v(l.center), normal, up, size: l.size }, l.radiance)
            }
            file::Light::Disk(l) => {
                let (center, normal) = (v(l.center), unit(l.normal));
                (LightGeometry::Disk { center, normal, radius: l.radius }, l.radiance)
            }
            file::Light::Sphere(l) => {
                (LightGeometry::Sphere { center: v(l.center), radius: l.radius }, l.radiance)
            }
            file::Light::Environment(l) => match (l.radiance, &l.image) {
                (Some(radiance), _) => (LightGeometry::UniformEnvironment, radiance),
                (None, name) => {
                    let Some(image) = name.as_ref().and_then(|name| images.get(name)) else {
                        if !l.enabled {
                            return Ok(None);
                        }
                        let message = "no image of this name is loaded; give a uniform `radiance` instead";
                        return Err(proto::FieldError::new(format!("lights[{index}].image"), message));
                    };
                    let world_from_map = world_from_map(l.rotation_degrees.unwrap_or_default());
                    let geometry = LightGeometry::Environment { image: image.clone(), world_from_map };
                    (geometry, [l.scale.unwrap_or(1.0); 3])
                }
            },
        };
        let id = light.id().map_or_else(|| index.to_string(), str::to_owned);
        let power = if light.enabled() { v(power) } else { DVec3::ZERO };
        Ok(Some(Self { id, index, geometry, power }))
    }
}
