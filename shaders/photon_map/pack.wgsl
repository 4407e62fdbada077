// Interactions that rays gather, packed one behind the other, for the host to sort: those of a photon stay in
// order, and the host is told where they begin, for photons come in any order.

// How many there are; behind that of each photon where its own begin, and how many they are.
@group(0) @binding(18) var<storage, read_write> runs: array<atomic<u32>>;
// Two each: place and way, then throughput in a word, by how far it is seen; the last word is the host's.
@group(0) @binding(19) var<storage, read_write> packed_interactions: array<vec4u>;

@compute @workgroup_size(64)
fn pack_interactions(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let inside = id.x < photons.count;
    let local = min(id.x, photons.count - 1u);
    let base = local * photons.slots;
    let count = select(0u, ends[2u * local + 1u].x & ~UNFINISHED_PHOTON, inside);
    var gathered = 0u;
    for (var i = 0u; i < count; i++) {
        gathered += select(0u, 1u, histories[2u * (base + i) + 1u].z > 0u);
    }
    var next = atomicAdd(&runs[0], gathered);
    if inside {
        atomicStore(&runs[1u + 2u * local], next);
        atomicStore(&runs[2u + 2u * local], gathered);
    }
    for (var i = 0u; i < count; i++) {
        let rest = histories[2u * (base + i) + 1u];
        if rest.z > 0u {
            let place = places[base + i].xyz;
            let way = ways[base + i];
            let seen = 0.5 * f32(rest.z) * vec3f(way.w, bitcast<vec2f>(rest.xy));
            packed_interactions[2u * next] = vec4u(bitcast<vec3u>(place), bitcast<u32>(way.x));
            packed_interactions[2u * next + 1u] = vec4u(bitcast<vec2u>(way.yz), packed(seen), 0u);
            next++;
        }
    }
}
