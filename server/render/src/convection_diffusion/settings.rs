//! What the method takes of a scene: which lights, how fine a grid, which diffusion.

use glam::DVec3;
use proto::scene_file::{Diffusion as Kind, Illumination, LightTransport, Orders};
use scene::Scene;
use scene::light::LightGeometry;

use super::diffusion::largest_buffer;
use super::outside::Outside;
use super::passes::NEAREST;
use super::sweep::Cells;
use crate::direct_light::LIGHTS_A_SLAB;
use crate::gpu::Gpu;
use crate::light_field;

/// Longest edge of a light grid, cells.
const MAX_EDGE: u32 = 512;
/// By how much a grid that does not fit is made coarser at a time.
const COARSER: f64 = 0.9;
/// What half floats hold of the strongest light, so that diffused light may exceed it.
const STRONGEST: f64 = 4000.0;
/// Ratio of the units that fields are told in.
const SCALES: f64 = 16.0;

/// How the scene wants scattered light to be spread.
pub fn kind_of(scene: &Scene) -> Kind {
    match scene.orders {
        Orders::AtMost(1) => Kind::None,
        _ => scene.illumination.diffusion,
    }
}

/// Bands that the field needs: diffused light has its mean and, by P1, its flux, which isotropic
/// matter does not see.
pub fn bands_of(scene: &Scene) -> u32 {
    match kind_of(scene) {
        Kind::P1 => light_field::bands_of(scene, scene.illumination.light_bands.min(2)),
        Kind::Heat | Kind::None => 1,
    }
}

/// What transmittances depend on of the settings.
pub fn transport_of(settings: &Illumination) -> (LightTransport, u32) {
    let steps = if settings.transport == LightTransport::Explicit { settings.explicit_steps } else { 0 };
    (settings.transport, steps)
}

/// Lights with a direction at each place, in the order of `tables::lights`.
pub fn carried(scene: &Scene) -> impl Iterator<Item = &scene::Light> {
    scene.lights.iter().filter(|light| !light.is_environment())
}

/// The light grid of a scene: as fine as it asks for, if the device has room.
pub fn grid_of(scene: &Scene, gpu: &Gpu) -> Cells {
    let lights = carried(scene).count().max(1) as u64;
    let mut share = scene.illumination.light_grid;
    loop {
        let dims = scene.grid.dims.map(|n| ((n as f64 * share).round() as u32).clamp(1, MAX_EDGE));
        let cells = Cells { dims, size: scene.grid.size_world / DVec3::from_array(dims.map(f64::from)) };
        let slabs = (lights as usize).div_ceil(LIGHTS_A_SLAB) as u32;
        let edge = dims.iter().max().copied().unwrap_or(1) * bands_of(scene).max(slabs);
        let fits = largest_buffer(&cells).max(4 * lights * cells.count()) <= gpu.max_binding_bytes()
            && edge <= gpu.max_texture_edge_3d();
        if fits || cells.count() == 1 {
            return cells;
        }
        share *= COARSER;
    }
}

/// The radiance that the field holds as 1: a power of [`SCALES`], so that the unit of the last solution
/// mostly serves the next.
pub fn scale_of(scene: &Scene, outside: &Outside) -> f64 {
    let half = 0.5 * scene.grid.size_world;
    let strongest = |light: &scene::Light| {
        let power = light.power.max_element();
        match &light.geometry {
            LightGeometry::Point { position } | LightGeometry::Spot { position, .. } => {
                let beyond = (position.abs() - half).max(DVec3::ZERO).length();
                power / beyond.max(NEAREST).powi(2)
            }
            LightGeometry::Directional { .. } => power,
            // Radiance from a hemisphere at most.
            _ => power * std::f64::consts::TAU,
        }
    };
    let lights: f64 = carried(scene).map(strongest).sum();
    let all = lights + outside.largest();
    SCALES.powf((all / STRONGEST).clamp(1e-30, 1e30).log(SCALES).ceil())
}
