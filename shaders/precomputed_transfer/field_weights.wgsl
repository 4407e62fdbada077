// What a light field holds beside its coefficients: with the first one how much matter there is around the
// texel, with the next three as much times where it is seen from (photon_map/mass.wgsl).

// `mass`: how much there is in w, as much times x, y, z of where it is seen from.
fn weights_in_field(mass: vec4f, k: u32) -> f32 {
    return select(0.0, array<f32, 4>(mass.w, mass.x, mass.y, mass.z)[min(k, 3u)], k < 4u);
}
