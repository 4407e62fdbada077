// What passes over the texels of the field share.

struct Fill {
    // Texels of the field.
    dims: vec3u,
    // 1: all bricks; else those that were touched.
    everything: u32,
    // Flux of a photon over the field's scale.
    flux: vec3f,
    // 1: of the first light; 2: of the last one.
    turn: u32,
    // Brings the extinction around texels to about 1 at most.
    weight_of_mass: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

fn mean_of(rgb: vec3f) -> f32 {
    return dot(rgb, vec3f(1.0 / 3.0));
}
