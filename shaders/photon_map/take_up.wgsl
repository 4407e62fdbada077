// Before a trace: which photons are stale, and where each has to be taken up again. Histories grow, so
// an interaction is valid if its own history is. (A pass of its own: in one with the trace it crashes the
// compiler of Mesa 22's software device.)

// How many they are, and at `photons.list` which.
@group(0) @binding(6) var<storage, read_write> stale_photons: array<atomic<u32>>;

@compute @workgroup_size(64)
fn take_up(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let local = min(id.x, photons.count - 1u);
    let base = local * photons.slots;
    // A photon that is not there is emitted; one that is goes on from its last valid interaction.
    var path = emitted(vec2u(photons.first + local, photons.key));
    let nothing_there = steering(photons.everything) == 2u;
    let all = steering(photons.everything) != 0u;
    let end = ends[2u * local];
    let state = ends[2u * local + 1u].x;
    let count = select(state & ~UNFINISHED_PHOTON, 0u, nothing_there);
    let query = vec4u(photons.bins, photons.blocks);
    let is_stale = all || (state & UNFINISHED_PHOTON) != 0u || any((end & query) != vec4u(0u));
    // Histories grow: the first stale interaction ends the valid ones.
    var valid = select(0u, count, is_stale && !all);
    for (var i = 0u; i < valid; i++) {
        if any((histories[2u * (base + i)] & query) != vec4u(0u)) { valid = i; }
    }
    var met = end;
    if is_stale { met = vec4u(0u); }
    if is_stale && valid > 0u {
        let slot = base + valid - 1u;
        path = Path();
        path.stage = AT;
        path.origin = places[slot].xyz;
        path.draws = bitcast<u32>(places[slot].w);
        path.direction = ways[slot].xyz;
        path.throughput = vec3f(ways[slot].w, bitcast<vec2f>(histories[2u * slot + 1u].xy));
        met = histories[2u * slot];
    }
    if !is_stale { path.stage = DONE; }
    path.light = count;
    path.scatterings = select(count, valid, is_stale);
    if id.x < photons.count {
        paths[local] = path;
        ends[2u * local] = met;
        let is_at_work = is_stale && (path.stage != DONE || path.light > path.scatterings);
        ends[2u * local + 1u].x = path.light | select(0u, UNFINISHED_PHOTON, is_at_work);
        if is_stale {
            ends[2u * local + 1u] = vec4u(ends[2u * local + 1u].x, 0u, 0u, 0u);
            let place = atomicAdd(&stale_photons[0], 1u);
            atomicStore(&stale_photons[photons.list + place], local);
        }
    }
}
