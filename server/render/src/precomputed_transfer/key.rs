//! What a bake follows from, as a hash: bakes with the same are the same bit by bit.

use scene::Scene;

use super::layout::Layout;
use super::mass::Mass;
use super::store::Key;
use crate::gpu::Gpu;
use crate::shaders;

/// Counts changes of what the processor does for a bake, beyond the tables that it makes.
const BAKE_VERSION: u32 = 4;

/// Of a bake's scene: nothing of lights, camera or film.
pub fn key(gpu: &Gpu, scene: &Scene, layout: &Layout, mass: &Mass, tables: &[u8; 32]) -> Key {
    let mut hasher = blake3::Hasher::new();
    // A part's end must not be another one's beginning.
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    add(&BAKE_VERSION.to_le_bytes());
    // Other devices and drivers round otherwise.
    let info = gpu.info();
    add(format!("{} {} {}", info.name, info.driver, info.software).as_bytes());
    for source in [
        shaders::MARCH_TRANSFER,
        shaders::SPREAD_BEAMS,
        shaders::ENTER_PHOTONS,
        shaders::CARRY_PHOTONS,
        shaders::RELIGHT,
        shaders::ADD_UP_MASS,
    ] {
        add(source.as_bytes());
    }
    add(tables);
    add(&scene.volume.content);
    let grid = &scene.grid;
    add(format!("{:?} {:?} {layout:?} {:?}", grid.dims, grid.size_world, scene.filter).as_bytes());
    add(format!("{:?} {:?}", scene.value_range, scene.clip).as_bytes());
    for point in &scene.transfer_function.points {
        let scene::transfer_function::Point { s, sigma_t, albedo, material, emission: _ } = point;
        add(format!("{s:?} {sigma_t:?} {albedo:?} {:?}", scene.materials[*material]).as_bytes());
    }
    // The grid that there was room for.
    add(format!("{:?}", mass.dims).as_bytes());
    for (texel, mass) in &mass.rows {
        add(&texel.to_le_bytes());
        add(bytemuck::cast_slice(&mass.to_array()));
    }
    *hasher.finalize().as_bytes()
}
