// Light at rest is looked at from a way off (seen.wgsl): along one of the 26 ways, and from the other side.

// `path.weight.x` of a path that is looked at along the first of two ways; `path.weight.y`: how many were open.
const FIRST_WAY = 1.0;

// Whether an interaction may be hidden from a way off (seen.wgsl).
fn may_be_hidden(x: vec3f, dims: vec3u) -> bool {
    let macrocell = macrocell_at(x / frame.size_world + 0.5);
    bins_met |= macrocell.yz;
    return bound_at(macrocell) * reach_of(lattice_step(dims)) > SEEN_FROM;
}

// What comes next for light at rest.
struct Look {
    // It is looked at along a way, or another.
    goes_on: bool,
    // What is seen of it is known.
    is_settled: bool,
}

// First it is looked at along a way, then from the other side: of a skin one is open. `rests`: at x, where it may be
// hidden if `asks`; `returns`: from a way that it was looked at along, which was open or not.
fn look(path: ptr<function, Path>, photon: vec2u, x: vec3f, rests: bool, asks: bool, returns: bool, is_open: bool, dims: vec3u) -> Look {
    let is_asked = rests && asks && may_be_hidden(x, dims);
    let is_turned = returns && (*path).weight.x == FIRST_WAY;
    if is_asked {
        (*path).direction = way_to_neighbour(unit4(draw(path, photon)), dims);
        (*path).weight.x = FIRST_WAY;
        (*path).weight.y = 0.0;
    }
    if returns { (*path).weight.y += select(0.0, 1.0, is_open); }
    if is_turned {
        (*path).direction = -(*path).direction;
        (*path).weight.x = 0.0;
    }
    if is_asked || is_turned { (*path).end = reach_of(lattice_step(dims)); }
    return Look(is_asked || is_turned, returns && !is_turned || rests && !is_asked);
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
