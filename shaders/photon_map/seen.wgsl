// How far matter is seen. In a texel that holds opaque matter light gets to its skin only, and only its skin
// is seen: so photons, and the extinction that they are compared with, count as far as they can be seen from
// some way off, on average over all directions. Fluence is their quotient whatever the directions are, if
// both take the same ones: those to the 26 neighbours in a lattice of `PLACES` a texel.

// Places of the lattice along an axis of a texel.
const PLACES = 3u;
// How far off it is looked at from, in places.
const REACH = 4u;
// Optical depth of that way, by the bound of the macrocell, from which on it makes a difference.
const SEEN_FROM = 0.5;
// Share of the sphere around each neighbour across a face, an edge, a corner.
const SHARES = vec3f(0.0457779, 0.0369806, 0.0351956);

// From place to place, for so many texels.
fn lattice_step(dims: vec3u) -> vec3f {
    return frame.size_world / (vec3f(dims) * f32(PLACES));
}

fn reach_of(step: vec3f) -> f32 {
    return f32(REACH) * (step.x + step.y + step.z) / 3.0;
}

// The macrocell around a place, as the table of macrocells has it.
fn macrocell_at(uvw: vec3f) -> vec4u {
    let last = vec3i(textureDimensions(macrocells)) - 1;
    return textureLoad(macrocells, clamp(vec3i(floor(uvw * frame.voxels / 4.0)), vec3i(0), last), 0);
}

// Bound of the extinction in a macrocell; 0 or less: there is none.
fn bound_at(macrocell: vec4u) -> f32 {
    return bitcast<f32>(macrocell.x);
}
