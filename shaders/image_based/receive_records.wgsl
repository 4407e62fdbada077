// Pass `receive_records`: along each record's rays, the light that matter of the cells on the way
// scatters towards it (README.md, equation e). The cells' mean extinction says where on the way it comes
// from; how much of the way is seen is said by the ray's own transmittance, so that what is neither
// received nor let through is absorbed, and white matter in white light stays white.

// Optical depths of a cell: of scattering times light, by bands of direction; of extinction in alpha.
@group(0) @binding(21) var source: texture_3d<f32>;
@group(0) @binding(22) var source_sampler: sampler;
// At [column][slot], divided by the field's scale, as `packed` has it.
@group(0) @binding(23) var<storage, read_write> received: array<u32>;

override SOURCE_BANDS: u32 = 1u;

// Behind this transmittance nothing matters.
const DARK = 1e-3;
// A way with less matter than this in cells scatters nothing.
const LEAST_MATTER = 1e-4;

@compute @workgroup_size(64)
fn receive_records(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    let index = 64u * group.x + lane;
    let inside = index < steering(records.count);
    let entry = entries[records.first + min(index, records.count - 1u)];
    let column = group.y;
    let ray = Ray(position_of_record(cell_of_record(entry.y)), columns[column].xyz);
    let cell = frame.size_world / vec3f(records.dims);
    let edge = max(cell.x, max(cell.y, cell.z));
    let end = max(box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y, 0.0);
    // About a cell each. Lanes without a ray take none: see march_records.wgsl.
    let steps = max(ceil(end / edge), 1.0);
    let step = end / steps;
    let todo = select(0.0, steps, inside);
    var radiance = vec3f(0.0);
    var through = 1.0;
    var i = 0.0;
    while i < todo {
        let at = place_of(ray.origin + (i + 0.5) * step * ray.direction);
        let first = textureSampleLevel(source, source_sampler, at, 0.0);
        var scattered = first.xyz * spherical_harmonic(0u, ray.direction);
        if SOURCE_BANDS > 1u {
            for (var k = 1u; k < SOURCE_BANDS * SOURCE_BANDS; k++) {
                let tile = vec3f(f32(k % SOURCE_BANDS), 0.0, f32(k / SOURCE_BANDS)) / f32(SOURCE_BANDS);
                let coefficient = textureSampleLevel(source, source_sampler, at + tile, 0.0).xyz;
                scattered += coefficient * spherical_harmonic(k, ray.direction);
            }
            scattered = max(scattered, vec3f(0.0));
        }
        let left = exp(-first.w * step / edge);
        radiance += through * (1.0 - left) / max(first.w, 1e-6) * scattered;
        through *= left;
        i = select(i + 1.0, todo, through < DARK);
    }
    let own = rays[ray_slot(0u, column, entry.x)];
    radiance *= (1.0 - own) / max(1.0 - through, LEAST_MATTER);
    if inside { received[column * records.capacity + entry.x] = packed(radiance); }
}

// Of a place in the world, in the first tile of the texture.
fn place_of(x: vec3f) -> vec3f {
    let dims = vec3f(records.dims);
    let texel = clamp((x / frame.size_world + 0.5) * dims, vec3f(0.5), dims - 0.5);
    return texel / (dims * vec3f(f32(SOURCE_BANDS), 1.0, f32(SOURCE_BANDS)));
}
