// Pass `p1_source`: light scattered for the first time, and light from all around that comes in by the
// faces of matter: the right-hand side of the P1 approximation (README.md, equation 12).

@group(0) @binding(31) var<storage, read_write> flows: array<vec4f>;
@group(0) @binding(34) var<storage, read_write> residuals: array<vec4f>;

@compute @workgroup_size(64)
fn p1_source(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    let place = index_in_dispatch(group, lane);
    let index = grid.first + min(place, grid.count - 1u);
    let cell = cell_of(index);
    var fluence = vec3f(0.0);
    for (var i = 0u; i < steering(sources.count); i++) {
        fluence += direct_light(i, cell, index).mean;
    }
    let found = textureLoad(matter, vec3i(cell), 0);
    let scattering = max(found.www - found.xyz, vec3f(0.0));
    if place >= grid.count { return; }
    var entering = vec3f(0.0);
    let flow = flows[index].xyz;
    if flow.x > 0.0 {
        for (var face = 0u; face < 6u; face++) {
            if is_open(cell, face) { entering += leak_through(face, flow) * sources.outside[face].xyz; }
        }
    }
    residuals[index] = vec4f(scattering * fluence + entering, 0.0);
}
