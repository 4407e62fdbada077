// Interactions that rays gather, packed one behind the other, for the host to sort: those of a photon stay in
// order, and the host is told where they begin, for photons come in any order.

// How many there are; behind that of each photon where its own begin, and how many they are.
@group(0) @binding(18) var<storage, read_write> runs: array<atomic<u32>>;
// Two each: place and way, then throughput as half floats, by how far it is seen.
@group(0) @binding(19) var<storage, read_write> packed: array<vec4u>;

// Largest half float.
const LARGEST = 65504.0;

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
            let throughput = min(seen, vec3f(LARGEST));
            packed[2u * next] = vec4u(bitcast<vec3u>(place), bitcast<u32>(way.x));
            packed[2u * next + 1u] = vec4u(bitcast<vec2u>(way.yz), pack2x16float(throughput.xy),
                pack2x16float(vec2f(throughput.z, 0.0)));
            next++;
        }
    }
}
