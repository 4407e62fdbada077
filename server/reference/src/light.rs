//! Light as it arrives at a point: chosen towards a light, or met by a ray.

use std::f64::consts::PI;

use glam::DVec3;
use scene::Light;
use scene::light::LightGeometry;

use crate::environment::Environment;
use crate::frame;
use crate::region::Ray;

/// A light with what is needed to sample it.
pub struct Source {
    shape: Shape,
    /// Irradiance, radiant intensity or radiance, by kind.
    power: DVec3,
}

enum Shape {
    Directional { travel: DVec3 },
    Point { position: DVec3 },
    Spot { position: DVec3, axis: DVec3, cos_inner: f64, cos_outer: f64 },
    Rectangle { center: DVec3, normal: DVec3, half_edges: [DVec3; 2] },
    Disk { center: DVec3, normal: DVec3, radius: f64 },
    Sphere { center: DVec3, radius: f64 },
    Uniform,
    Image(Environment),
}

/// A direction towards a light.
#[derive(Debug, Clone, Copy)]
pub struct Towards {
    /// Unit, from the point to the light.
    pub w_i: DVec3,
    /// To the light, world units; infinite for lights without a place.
    pub distance: f64,
    /// Radiance divided by the density of the direction; irradiance of lights that have one
    /// direction only.
    pub weight: DVec3,
    /// Density of the direction per steradian; `None` for lights that have one direction only,
    /// which no ray meets by chance.
    pub pdf: Option<f64>,
}

/// A light met by a ray.
#[derive(Debug, Clone, Copy)]
pub struct Met {
    /// World units; infinite for environments.
    pub distance: f64,
    /// Linear RGB.
    pub radiance: DVec3,
    /// Density per steradian with which [`Source::sample`] would have chosen the direction.
    pub pdf: f64,
}

impl Source {
    /// Prepares a light of the scene.
    pub fn new(light: &Light) -> Self {
        let shape = match &light.geometry {
            LightGeometry::Directional { direction } => Shape::Directional { travel: *direction },
            LightGeometry::Point { position } => Shape::Point { position: *position },
            LightGeometry::Spot { position, direction, cos_inner, cos_outer } => Shape::Spot {
                position: *position,
                axis: *direction,
                cos_inner: *cos_inner,
                cos_outer: *cos_outer,
            },
            LightGeometry::Rectangle { center, normal, up, size } => Shape::Rectangle {
                center: *center,
                normal: *normal,
                half_edges: [0.5 * size[0] * up.cross(*normal), 0.5 * size[1] * *up],
            },
            LightGeometry::Disk { center, normal, radius } => {
                Shape::Disk { center: *center, normal: *normal, radius: *radius }
            }
            LightGeometry::Sphere { center, radius } => Shape::Sphere { center: *center, radius: *radius },
            LightGeometry::UniformEnvironment => Shape::Uniform,
            LightGeometry::Environment { image, world_from_map } => {
                Shape::Image(Environment::new(image, *world_from_map, light.power))
            }
        };
        Self { shape, power: light.power }
    }

    /// Whether rays can meet it: it has an extent.
    pub fn can_be_met(&self) -> bool {
        !matches!(self.shape, Shape::Directional { .. } | Shape::Point { .. } | Shape::Spot { .. })
    }

    /// A direction from `x` towards the light; `None` where no light comes from the choice.
    pub fn sample(&self, x: DVec3, uv: [f64; 2]) -> Option<Towards> {
        match &self.shape {
            Shape::Directional { travel } => {
                Some(Towards { w_i: -*travel, distance: f64::INFINITY, weight: self.power, pdf: None })
            }
            Shape::Point { position } => self.towards_point(*position - x, |_| 1.0),
            Shape::Spot { position, axis, cos_inner, cos_outer } => {
                self.towards_point(*position - x, |w_i| cone(-w_i.dot(*axis), *cos_inner, *cos_outer))
            }
            Shape::Rectangle { center, normal, half_edges: [a, b] } => {
                let place = *center + (2.0 * uv[0] - 1.0) * *a + (2.0 * uv[1] - 1.0) * *b;
                self.towards_area(place - x, *normal, 4.0 * a.length() * b.length())
            }
            Shape::Disk { center, normal, radius } => {
                let ([a, b], (u, v)) = (frame::on_disk(uv), frame::tangents(*normal));
                self.towards_area(*center + *radius * (a * u + b * v) - x, *normal, PI * radius * radius)
            }
            Shape::Sphere { center, radius } => {
                let cap = cap(*center - x, *radius)?;
                let axis = (*center - x).normalize();
                let w_i = frame::around(axis, 1.0 - uv[0] * cap, 2.0 * PI * uv[1]);
                // On the rim rounding may miss the sphere; it is as far away there as its rim.
                let squared = (*center - x).length_squared();
                let rim = (squared - radius * radius).max(0.0).sqrt();
                let distance = near_side(*center - x, *radius, w_i).unwrap_or(rim);
                let pdf = 1.0 / (2.0 * PI * cap);
                Some(Towards { w_i, distance, weight: self.power / pdf, pdf: Some(pdf) })
            }
            Shape::Uniform => {
                let pdf = 1.0 / (4.0 * PI);
                let (w_i, distance) = (frame::on_sphere(uv), f64::INFINITY);
                Some(Towards { w_i, distance, weight: self.power / pdf, pdf: Some(pdf) })
            }
            Shape::Image(environment) => {
                let (w_i, pdf) = environment.sample(uv)?;
                let weight = environment.radiance(w_i) / pdf;
                Some(Towards { w_i, distance: f64::INFINITY, weight, pdf: Some(pdf) })
            }
        }
    }

    fn towards_point(&self, to_light: DVec3, share: impl Fn(DVec3) -> f64) -> Option<Towards> {
        let distance = to_light.length();
        let w_i = to_light.try_normalize()?;
        let weight = self.power * share(w_i) / (distance * distance);
        (weight != DVec3::ZERO).then_some(Towards { w_i, distance, weight, pdf: None })
    }

    fn towards_area(&self, to_light: DVec3, normal: DVec3, area: f64) -> Option<Towards> {
        let distance = to_light.length();
        let w_i = to_light.try_normalize()?;
        let cosine = -w_i.dot(normal);
        if cosine <= 0.0 || area <= 0.0 {
            return None;
        }
        let pdf = distance * distance / (cosine * area);
        Some(Towards { w_i, distance, weight: self.power / pdf, pdf: Some(pdf) })
    }

    /// What a ray meets of it.
    pub fn meet(&self, ray: &Ray) -> Option<Met> {
        let met = |distance: f64, pdf: f64| Some(Met { distance, radiance: self.power, pdf });
        // Distance and density where the ray passes a one-sided plane at a place on the light.
        let on_plane = |center: DVec3, normal: DVec3, area: f64, holds: &dyn Fn(DVec3) -> bool| {
            let cosine = -ray.direction.dot(normal);
            if cosine <= 0.0 || area <= 0.0 {
                return None;
            }
            let distance = (ray.origin - center).dot(normal) / cosine;
            let inside = distance > 0.0 && holds(ray.at(distance) - center);
            inside.then_some((distance, distance * distance / (cosine * area)))
        };
        match &self.shape {
            Shape::Directional { .. } | Shape::Point { .. } | Shape::Spot { .. } => None,
            Shape::Rectangle { center, normal, half_edges: [a, b] } => {
                let inside = |offset: DVec3| {
                    offset.dot(*a).abs() <= a.length_squared() && offset.dot(*b).abs() <= b.length_squared()
                };
                let (distance, pdf) = on_plane(*center, *normal, 4.0 * a.length() * b.length(), &inside)?;
                met(distance, pdf)
            }
            Shape::Disk { center, normal, radius } => {
                let inside = |offset: DVec3| offset.length_squared() <= radius * radius;
                let (distance, pdf) = on_plane(*center, *normal, PI * radius * radius, &inside)?;
                met(distance, pdf)
            }
            Shape::Sphere { center, radius } => {
                let cap = cap(*center - ray.origin, *radius)?;
                let distance = near_side(*center - ray.origin, *radius, ray.direction)?;
                met(distance, 1.0 / (2.0 * PI * cap))
            }
            Shape::Uniform => met(f64::INFINITY, 1.0 / (4.0 * PI)),
            Shape::Image(environment) => {
                let radiance = environment.radiance(ray.direction);
                Some(Met { distance: f64::INFINITY, radiance, pdf: environment.pdf(ray.direction) })
            }
        }
    }
}

/// Share of a spot's intensity at a cosine from its axis: 1 inside the inner cone, smoothstep in
/// the cosine to 0 at the outer one.
pub fn cone(cosine: f64, cos_inner: f64, cos_outer: f64) -> f64 {
    if cosine >= cos_inner {
        return 1.0;
    }
    if cosine <= cos_outer {
        return 0.0;
    }
    let x = (cosine - cos_outer) / (cos_inner - cos_outer);
    x * x * (3.0 - 2.0 * x)
}

/// 1 minus the cosine of the cone under which a sphere is seen from outside; `None` from inside,
/// where it is dark: it shines outwards.
fn cap(to_center: DVec3, radius: f64) -> Option<f64> {
    let sine_squared = radius * radius / to_center.length_squared();
    (sine_squared < 1.0 && sine_squared > 0.0).then(|| sine_squared / (1.0 + (1.0 - sine_squared).sqrt()))
}

/// Distance to the near side of a sphere that lies ahead; `None` where the direction misses it.
fn near_side(to_center: DVec3, radius: f64, direction: DVec3) -> Option<f64> {
    let along = to_center.dot(direction);
    let miss = to_center - along * direction;
    let depth_squared = radius * radius - miss.length_squared();
    (along > 0.0 && depth_squared >= 0.0).then(|| along - depth_squared.sqrt())
}
