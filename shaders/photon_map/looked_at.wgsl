// Light at rest is looked at from a way off (seen.wgsl): along one of the 26 ways, and from the other side.

// `path.weight.x` of a path that is looked at along the first of two ways; `path.weight.y`: how many were open.
const FIRST_WAY = 1.0;

// Whether an interaction may be hidden from a way off (seen.wgsl).
fn may_be_hidden(x: vec3f, dims: vec3u) -> bool {
    let macrocell = macrocell_at(x / frame.size_world + 0.5);
    bins_met |= macrocell.yz;
    return bound_at(macrocell) * reach_of(lattice_step(dims)) > SEEN_FROM;
}

// One of the ways of seen.wgsl, by its share.
fn way_to_neighbour(u: vec4f, dims: vec3u) -> vec3f {
    let faces = 6.0 * SHARES.x;
    let edges = 12.0 * SHARES.y;
    let signs = select(vec3f(-1.0), vec3f(1.0), u.yzw < vec3f(0.5));
    // Two bits for the axis are left of numbers that were compared with one half.
    let axis = u32(fract(2.0 * u.y) * 3.0);
    let along = vec3f(vec3u(axis) == vec3u(0u, 1u, 2u));
    var onward = signs;
    if u.x < faces { onward = signs * along; } else if u.x < faces + edges { onward = signs * (1.0 - along); }
    return normalize(onward * lattice_step(dims));
}
