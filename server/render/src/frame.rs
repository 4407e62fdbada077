//! What a dispatch of the ray caster is told of a scene.

use glam::{DMat3, DVec3};
use scene::{Background, Rendering, Scene};

use crate::tables;
use crate::uniforms::{FrameUniform, MAX_PLANES};
use crate::view::FilmCache;
use crate::volume_texture::VolumeTexture;

/// Position in the pixel square and shift of the lattice along the ray, in steps, of sample
/// `index`. The first stands in the middle of everything; the others follow the additive
/// recurrence of Roberts (R3), so that n samples are close to evenly spread for every n. They are
/// the same for every pixel: the picture shows no noise, and accumulation refines the lattice.
pub(crate) fn sample_position(index: u32) -> ([f32; 2], f32) {
    // Reciprocal powers of the root of x^4 = x + 1.
    const ROOT: f64 = 1.220_744_084_605_759_5;
    let part = |power: i32, start: f64| (start + f64::from(index) * ROOT.powi(-power)).fract() as f32;
    ([part(1, 0.5), part(2, 0.5)], part(3, 0.0))
}

/// `surface` of the frame uniform.
fn surface(scene: &Scene) -> [f32; 4] {
    match scene.rendering {
        Rendering::Slice { normal, offset } => normal.extend(offset).as_vec4().to_array(),
        Rendering::Isosurface { value } => {
            let [low, high] = scene.value_range;
            let s = if high > low { (value - low) / (high - low) } else { f64::MAX };
            [0.0, 0.0, 0.0, s.clamp(-1e30, 1e30) as f32]
        }
        _ => [0.0; 4],
    }
}

/// For passes that have no picture.
pub(crate) fn scene_uniform(scene: &Scene, texture: &VolumeTexture) -> FrameUniform {
    frame_of(scene, texture, [1, 1])
}

pub(crate) fn frame_uniform(scene: &Scene, texture: &VolumeTexture, film: &FilmCache) -> FrameUniform {
    frame_of(scene, texture, [film.width, film.height])
}

fn frame_of(scene: &Scene, texture: &VolumeTexture, image: [u32; 2]) -> FrameUniform {
    use scene::camera::Projection;
    let camera = &scene.camera;
    let (projection, half_height) = match camera.projection {
        Projection::Perspective { tan_half_fov_y } => (0, tan_half_fov_y),
        Projection::Orthographic { half_height } => (1, half_height),
    };
    let (s_scale, s_offset) = texture.s_from_texel(scene);
    let (value_scale, value_offset) = texture.share_from_texel(scene, scene.volume.range);
    let mut planes = [[0.0; 4]; MAX_PLANES];
    for (slot, (normal, offset)) in planes.iter_mut().zip(&scene.clip.planes) {
        *slot = normal.extend(*offset).as_vec4().to_array();
    }
    let (background, backdrop) = match &scene.background {
        Background::Color(color) => (*color, DVec3::ZERO),
        Background::Image { scale, .. } => (DVec3::ZERO, *scale),
    };
    let map = scene.environment_image().map_or(DMat3::IDENTITY, |(_, world_from_map)| world_from_map);
    let (matter_cells, matter_range) = tables::matter_in_s(&scene.transfer_function);
    FrameUniform {
        eye: tables::vector(camera.eye),
        half_height: half_height as f32,
        forward: tables::vector(camera.forward),
        projection,
        right: tables::vector(camera.right),
        step_world: scene.step_world() as f32,
        up: tables::vector(camera.up),
        termination: scene.sampling.termination_transmittance as f32,
        size_world: tables::vector(scene.grid.size_world),
        s_scale: s_scale as f32,
        voxels: scene.grid.dims.map(|n| n as f32),
        s_offset: s_offset as f32,
        clip_low: tables::vector(scene.grid.world_from_unit(scene.clip.bounds[0])),
        plane_count: scene.clip.planes.len() as u32,
        clip_high: tables::vector(scene.grid.world_from_unit(scene.clip.bounds[1])),
        light_count: tables::lights(scene).len() as u32,
        background: tables::vector(background),
        skip_empty: u32::from(scene.sampling.skip_empty),
        ambient: tables::vector(tables::ambient(scene)),
        point_count: scene.transfer_function.points.len() as u32,
        image,
        first_row: 0,
        row_count: 0,
        subpixel: [0.5; 2],
        lattice_shift: 0.0,
        sample_index: 0,
        segments_kept: 0,
        first_part: 0,
        matter_cells: [matter_cells as u32, (matter_cells >> 32) as u32],
        matter_range,
        value_scale: value_scale as f32,
        value_offset: value_offset as f32,
        surface: surface(scene),
        map_x: tables::vector(map.x_axis),
        pad3: 0,
        map_y: tables::vector(map.y_axis),
        pad4: 0,
        map_z: tables::vector(map.z_axis),
        pad5: 0,
        backdrop: tables::vector(backdrop),
        pad6: 0,
        planes,
    }
}
