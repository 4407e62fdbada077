// Pass `light_coefficients`: what matter does to light in each cell of the light grid, as means over
// points of the cell (README.md, equations 1 to 3). The transfer function is applied before the mean
// is taken: a mean of values would turn two kinds of matter into a third.

// Absorption, linear RGB, and extinction, per world unit. Absorption is kept rather than scattering,
// because half floats hold a small number well and a small difference badly.
@group(0) @binding(21) var matter_out: texture_storage_3d<rgba16float, write>;
// Mean cosine of scattering.
@group(0) @binding(22) var<storage, read_write> cosines: array<f32>;

// Largest extinction that half floats hold, with room to spare. Matter this dense lets no light
// through a cell of any grid.
const LARGEST_EXTINCTION = 60000.0;
// Of a point, so that sums stay finite.
const MOST = 1e30;

@compute @workgroup_size(64)
fn light_coefficients(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    let place = index_in_dispatch(group, lane);
    // Those beyond the end do the last cell again: a loop that no lane takes part in runs to its bound
    // on Mesa 22's software device.
    let index = grid.first + min(place, grid.count - 1u);
    let cell = cell_of(index);
    var absorption = vec3f(0.0);
    var scattering = vec3f(0.0);
    var extinction = 0.0;
    var forward = 0.0;
    let points = vec3u(steering(grid.points.x), steering(grid.points.y), steering(grid.points.z));
    for (var z = 0u; z < points.z; z++) {
        for (var y = 0u; y < points.y; y++) {
            for (var x = 0u; x < points.x; x++) {
                let within = (vec3f(vec3u(x, y, z)) + 0.5) / vec3f(points);
                let uvw = (vec3f(cell) + within) / vec3f(grid.cells);
                let s = s_of_texel(texel_value(uvw));
                let piece = piece_from(s, true, table_entry(s).point);
                // Clipped matter is not there, or blocks light and scatters none.
                let kept = is_kept(uvw);
                let sigma_t = select(0.0, min(sigma_t_in(piece, s), MOST), kept || grid.clip_shadows == 1u);
                let found = place_in(piece, s);
                let material = materials[found.material];
                let albedo = albedo_at(found);
                let reflected = albedo * material.ambient_diffuse + material.ambient_specular;
                let scattered = select(vec3f(0.0), min(mix(albedo, reflected, material.surface), vec3f(1.0)), kept);
                extinction += sigma_t;
                absorption += sigma_t * (1.0 - scattered);
                scattering += sigma_t * scattered;
                forward += select(0.0, sigma_t * (1.0 - material.surface) * dot(albedo, vec3f(1.0)) * material.bands[0].y, kept);
            }
        }
    }
    if place >= grid.count { return; }
    let mean = 1.0 / f32(points.x * points.y * points.z);
    let sigma_t = extinction * mean;
    let hold = min(1.0, LARGEST_EXTINCTION / max(sigma_t, 1.0)) * mean;
    textureStore(matter_out, cell, vec4f(absorption, extinction) * hold);
    cosines[index] = clamp(forward / max(dot(scattering, vec3f(1.0)), 1e-20), -1.0, 1.0);
}

// Whether a place is not clipped away.
fn is_kept(uvw: vec3f) -> bool {
    let x = (uvw - 0.5) * frame.size_world;
    var kept = all(x >= frame.clip_low) && all(x <= frame.clip_high);
    for (var i = 0u; i < steering(frame.plane_count); i++) {
        kept = kept && dot(frame.planes[i].xyz, x) >= frame.planes[i].w;
    }
    return kept;
}
