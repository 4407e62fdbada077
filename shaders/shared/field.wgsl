// A light field's texture, and what is told of it. Coefficient k of B^2 lies in tile (k % B, k / B) along
// x and z: RGB divided by the field's scale, times the texel's weight. The weight is the alpha of the first
// tile, 0 where light is not known: what is interpolated is divided by it.

@group(0) @binding(13) var light_field: texture_3d<f32>;
@group(0) @binding(14) var light_sampler: sampler;
@group(0) @binding(15) var<uniform> field: Field;

struct Field {
    // Texels of one coefficient.
    dims: vec3f,
    // Radiance of 1 in the texture.
    scale: f32,
    // Cells of the volume's box for `direct_field`.
    direct_cells: vec3f,
    // How far towards a light matter is looked at, world units.
    near: f32,
    // Its nodes: the cells' corners, or their centres.
    direct_nodes: vec3f,
    // 1: clipped matter blocks light.
    clip_blocks: u32,
    // How far off matter was looked at from (photon_map/seen.wgsl), world units.
    reach: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
}
