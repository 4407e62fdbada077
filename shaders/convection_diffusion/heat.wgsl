// Pass `heat_matter`: D, E and b of the paper's heat flow, one implicit step of unit time (README.md,
// equation 13): (1 - div(D grad)) x = direct light, D = spread^2 * scattering albedo / (1 + spread
// sigma_t). Nothing flows through the box's faces, so that light is spread, not lost.

@group(0) @binding(24) var matter: texture_3d<f32>;
@group(0) @binding(31) var<storage, read_write> flows: array<vec4f>;
@group(0) @binding(32) var<storage, read_write> losses: array<vec4f>;
@group(0) @binding(34) var<storage, read_write> residuals: array<vec4f>;
@group(0) @binding(42) var<uniform> heat: Heat;

// Mirrored by `Heat` in server/render/src/uniforms.rs.
struct Heat {
    // How far light is spread in vacuum, world units.
    spread: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@compute @workgroup_size(64)
fn heat_matter(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    let place = index_in_dispatch(group, lane);
    let index = grid.first + min(place, grid.count - 1u);
    let cell = cell_of(index);
    var fluence = vec3f(0.0);
    for (var i = 0u; i < steering(sources.count); i++) {
        fluence += direct_light(i, cell, index).at_centre;
    }
    let found = textureLoad(matter, vec3i(cell), 0);
    let albedo = select(vec3f(1.0), max(found.www - found.xyz, vec3f(0.0)) / max(found.w, 1e-20), found.w > 0.0);
    if place < grid.count {
        flows[index] = vec4f(heat.spread * heat.spread * albedo / (1.0 + heat.spread * found.w), 0.0);
        losses[index] = vec4f(1.0, 1.0, 1.0, 0.0);
        residuals[index] = vec4f(fluence, 0.0);
    }
}
