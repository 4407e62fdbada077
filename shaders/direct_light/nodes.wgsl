// Shares of light at nodes, interpolated.

// Of four lights a slab along z, and of each node: the share of the light that reaches it.
@group(0) @binding(16) var direct_field: texture_3d<f32>;

// Of the light in a slot, at a place.
fn share_of(slot: u32, x: vec3f) -> f32 {
    let cells = field.direct_cells;
    let nodes = field.direct_nodes;
    let place = (x / frame.size_world + 0.5) * cells + 0.5 * (nodes - cells);
    let layers = f32(textureDimensions(direct_field).z) / nodes.z;
    let slab = clamp(place, vec3f(0.5), nodes - 0.5) + vec3f(0.0, 0.0, f32(slot / 4u) * nodes.z);
    let four = textureSampleLevel(direct_field, light_sampler, slab / (nodes * vec3f(1.0, 1.0, layers)), 0.0);
    return four[slot % 4u];
}
