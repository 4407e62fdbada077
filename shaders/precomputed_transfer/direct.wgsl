// Light that arrives without having been scattered (eq. 2 of the paper), from one direction at a time
// for all basis functions that shine from there: their integrals over the direction's pixel times the
// transmittance. Like what photons bring, a texel's mean over the matter around it: times its mass.

// Emission is the ray caster's.
override GLOW: bool = false;

// Directions towards the light.
@group(0) @binding(22) var<storage, read> directions: array<vec4f>;
// Of a direction, for each function that is not 0 in its pixel: which, and its integrals with each
// spherical harmonic of the field.
@group(0) @binding(23) var<storage, read> integrals: array<f32>;
// Of each row: which texel it is of.
@group(0) @binding(24) var<storage, read> row_texels: array<u32>;
// Of each row: extinction around its texel, over the largest one.
@group(0) @binding(25) var<storage, read> masses: array<f32>;
@group(0) @binding(26) var<storage, read_write> direct_light: array<f32>;

@compute @workgroup_size(64)
fn march_transfer(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    // Lanes without a row walk an empty way: see `march_records`.
    let inside = id.x < steering(transfer.rows);
    let row = min(id.x, transfer.rows - 1u);
    let index = row_texels[row];
    let texel_place = vec3u(index % transfer.dims.x, index / transfer.dims.x % transfer.dims.y, index / (transfer.dims.x * transfer.dims.y));
    let x = place_around(texel_place, unit4(pcg4d(vec4u(index, transfer.direction, 0u, 0u))));
    let ray = Ray(x, directions[transfer.direction].xyz);
    let whole = vec2f(0.0, box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y);
    var kept = clip_interval(ray, whole);
    if steering(transfer.clip_shadows) == 1u { kept = whole; }
    let from_t = min(kept.x, kept.y);
    var counts = vec4u(0u);
    let found = arriving(ray, from_t, select(from_t, kept.y, inside), &counts);
    let coefficients = transfer.bands * transfer.bands;
    if inside {
        let weight = found.w * masses[row];
        for (var entry = steering(transfer.first_entry); entry < steering(transfer.last_entry); entry++) {
            let first = entry * (coefficients + 1u);
            let b = u32(integrals[first]);
            for (var k = 0u; k < coefficients; k++) {
                direct_light[in_matrix(k, b, row)] += weight * integrals[first + 1u + k];
            }
        }
    }
}

// A place in the texel's footprint, with a chance in proportion to extinction and to the texel's share
// of it: of eight places, one in each octant, shifted together.
fn place_around(texel_place: vec3u, u: vec4f) -> vec3f {
    let dims = vec3f(transfer.dims);
    let middle = (vec3f(texel_place) + 0.5) / dims;
    var chosen = middle;
    var sum = 0.0;
    var left = u.w;
    for (var i = 0u; i < 8u; i++) {
        let offset = vec3f(f32(i & 1u), f32((i >> 1u) & 1u), f32(i >> 2u)) + u.xyz - 1.0;
        let uvw = middle + offset / dims;
        // Beyond the outermost centres a texel is alone.
        let alone = (uvw * dims < vec3f(0.5)) | (uvw * dims > dims - 0.5);
        let near = select(1.0 - abs(offset), vec3f(1.0), alone);
        let place = (uvw - 0.5) * frame.size_world;
        var weight = 0.0;
        let wanted = all(uvw > vec3f(0.0)) && all(uvw < vec3f(1.0)) && keeps(place);
        if wanted {
            let s = s_of_texel(texel_value(uvw));
            weight = min(sigma_t_in(piece_of(s, wanted), s), transfer.most) * near.x * near.y * near.z;
        }
        sum += weight;
        // Each has its chance although the others are not known yet; what is left of the random number
        // is as good as new.
        let share = select(0.0, weight / sum, sum > 0.0);
        let takes = left < share;
        if takes { chosen = uvw; }
        left = select((left - share) / max(1.0 - share, 1e-12), left / max(share, 1e-12), takes);
    }
    return (chosen - 0.5) * frame.size_world;
}
