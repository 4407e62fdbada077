//! Scene to shader tables: transfer function, materials, lights.

use glam::DVec3;
use proto::scene_file::{Brdf, Phase};
use scene::Scene;
use scene::light::{Light, LightGeometry};
use scene::scattering::{ambient_reflectance, blinn_phong_normalisation};

use crate::uniforms;

/// Entries of the table that finds the transfer-function point below an `s`; equals `TF_CELLS`.
pub const TRANSFER_FUNCTION_CELLS: usize = 256;

/// Materials a scene may have and the isotropic one before them; as in shaders/shared/medium.wgsl.
pub const MAX_MATERIALS: usize = proto::scene_file::limits::MAX_MATERIALS + 1;

/// Lights a scene may have; as in shaders/shared/light.wgsl.
pub const MAX_LIGHTS: usize = proto::scene_file::limits::MAX_LIGHTS;

pub fn vector(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// Control points with the reciprocal width of the piece that starts there.
pub fn transfer_function_points(scene: &Scene) -> Vec<uniforms::TransferFunctionPoint> {
    let points = &scene.transfer_function.points;
    let entry = |(index, point): (usize, &scene::transfer_function::Point)| {
        let width = points.get(index + 1).map_or(0.0, |next| next.s as f32 - point.s as f32);
        uniforms::TransferFunctionPoint {
            albedo: vector(point.albedo),
            sigma_t: point.sigma_t as f32,
            emission: vector(point.emission),
            s: point.s as f32,
            material: point.material as u32,
            inverse_width: if width > 0.0 { 1.0 / width } else { 0.0 },
            ..uniforms::TransferFunctionPoint::default()
        }
    };
    points.iter().enumerate().map(entry).collect()
}

/// Entry c: the last point at or below `c / TRANSFER_FUNCTION_CELLS`, 0 if there is none.
pub fn transfer_function_cells(scene: &Scene) -> Vec<u32> {
    let points = &scene.transfer_function.points;
    (0..TRANSFER_FUNCTION_CELLS)
        .map(|cell| {
            let s = cell as f32 / TRANSFER_FUNCTION_CELLS as f32;
            (points.partition_point(|point| point.s as f32 <= s).max(1) - 1) as u32
        })
        .collect()
}

pub fn materials(scene: &Scene) -> Vec<uniforms::Material> {
    scene.materials.iter().map(material).collect()
}

fn material(material: &scene::material::Material) -> uniforms::Material {
    let (phase, asymmetry) = match &material.phase {
        Phase::Isotropic => (0, 0.0),
        Phase::HenyeyGreenstein(p) => (1, p.g),
        Phase::Schlick(p) => (2, p.k),
    };
    let (brdf, diffuse, specular, lobe) = match &material.brdf {
        None => (0, 0.0, 0.0, [0.0; 2]),
        Some(Brdf::Lambert(b)) => (0, b.diffuse, 0.0, [0.0; 2]),
        Some(Brdf::BlinnPhong(b)) => {
            (1, b.diffuse, b.specular, [b.exponent, blinn_phong_normalisation(b.exponent)])
        }
        Some(Brdf::AshikhminShirley(b)) => (2, b.diffuse, b.specular, b.exponents),
        Some(Brdf::Abc(b)) => (3, b.diffuse, b.a, [b.b, b.c]),
    };
    let ambient = ambient_reflectance(material);
    uniforms::Material {
        phase,
        asymmetry: asymmetry as f32,
        surface: material.surface as f32,
        brdf,
        ambient_diffuse: ambient.x as f32,
        ambient_specular: ambient.y as f32,
        diffuse: diffuse as f32,
        specular: specular as f32,
        lobe: lobe.map(|x| x as f32),
        ..uniforms::Material::default()
    }
}

/// Lights but the uniform environment, which is a single colour (see [`ambient`]).
pub fn lights(scene: &Scene) -> Vec<uniforms::Light> {
    scene.lights.iter().filter_map(light).collect()
}

/// Radiance of the uniform environment, black without one.
pub fn ambient(scene: &Scene) -> DVec3 {
    let uniform = scene.lights.iter().filter(|light| light.geometry == LightGeometry::UniformEnvironment);
    uniform.map(|light| light.power).sum()
}

fn light(light: &Light) -> Option<uniforms::Light> {
    let base = uniforms::Light { power: vector(light.power), ..uniforms::Light::default() };
    let table = match light.geometry {
        LightGeometry::UniformEnvironment => return None,
        LightGeometry::Directional { direction } => {
            uniforms::Light { kind: 0, direction: vector(direction), ..base }
        }
        LightGeometry::Point { position } => uniforms::Light { kind: 1, position: vector(position), ..base },
        LightGeometry::Spot { position, direction, cos_inner, cos_outer } => uniforms::Light {
            kind: 2,
            position: vector(position),
            direction: vector(direction),
            cos_inner: cos_inner as f32,
            cos_outer: cos_outer as f32,
            ..base
        },
        LightGeometry::Rectangle { center, normal, size, .. } => uniforms::Light {
            kind: 3,
            position: vector(center),
            direction: vector(normal),
            extent: (size[0] * size[1]) as f32,
            ..base
        },
        LightGeometry::Disk { center, normal, radius } => uniforms::Light {
            kind: 3,
            position: vector(center),
            direction: vector(normal),
            extent: (std::f64::consts::PI * radius * radius) as f32,
            ..base
        },
        LightGeometry::Sphere { center, radius } => {
            uniforms::Light { kind: 4, position: vector(center), extent: radius as f32, ..base }
        }
    };
    Some(table)
}
