// Pass `p1_matter`: D and E of the P1 approximation in each cell (README.md, equations 9 to 11).
// Vacuum takes no part: light that leaves matter through a face towards it does not come back
// (Marshak's boundary).

@group(0) @binding(31) var<storage, read_write> flows: array<vec4f>;
@group(0) @binding(32) var<storage, read_write> losses: array<vec4f>;
@group(0) @binding(22) var<storage, read_write> cosines: array<f32>;

// Transport extinction below which matter counts as this thin, per world unit: a mean free path no
// longer than the box.
const THINNEST = 1.0;

@compute @workgroup_size(64)
fn p1_matter(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_dispatch(group, lane);
    if place >= grid.count { return; }
    let index = grid.first + place;
    let cell = cell_of(index);
    let found = textureLoad(matter, vec3i(cell), 0);
    if found.w <= 0.0 {
        flows[index] = vec4f(0.0);
        losses[index] = vec4f(0.0);
        return;
    }
    let absorption = found.xyz;
    let scattering = max(found.www - absorption, vec3f(0.0));
    let transport = max(absorption + (1.0 - cosines[index]) * scattering, vec3f(THINNEST));
    let flow = 1.0 / (3.0 * transport);
    var leak = vec3f(0.0);
    for (var face = 0u; face < 6u; face++) {
        if is_open(cell, face) { leak += leak_through(face, vec3f(flow)); }
    }
    flows[index] = vec4f(flow, 0.0);
    losses[index] = vec4f(absorption + leak, 0.0);
}
