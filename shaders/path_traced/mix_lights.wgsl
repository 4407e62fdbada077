// A film from its light layers: their sum, each in its colour and strength; and how well it is known,
// from the difference between the mixes of the paths of even and of odd number. A dispatch takes the
// rows whose layers are in one buffer.

@group(0) @binding(0) var<uniform> lights: Mix;
// Layer by layer: means over the paths of even and of odd number, RGB each.
@group(0) @binding(1) var<storage, read> layers: array<f32>;
@group(0) @binding(2) var<storage, read_write> film: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> spreads: array<vec4f>;

const MAX_LAYERS = 10;
// Sums in brighter colours than numbers can hold stay finite.
const BRIGHTEST = 1e30;

struct Mix {
    first_pixel: u32,
    pixel_count: u32,
    // Layers that are not black.
    term_count: u32,
    pad0: u32,
    // Linear RGB, and the number of the layer.
    powers: array<vec4f, MAX_LAYERS>,
}

@compute @workgroup_size(64)
fn mix_lights(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = id.y * groups.x * 64u + id.x;
    if pixel >= lights.pixel_count { return; }
    var even = vec3f(0.0);
    var odd = vec3f(0.0);
    // `id.z` is 0: see `steering` in shared/frame.wgsl.
    for (var term = 0u; term < lights.term_count + id.z; term++) {
        let power = lights.powers[term];
        let at = 6u * (u32(power.w) * lights.pixel_count + pixel);
        even += power.xyz * vec3f(layers[at], layers[at + 1u], layers[at + 2u]);
        odd += power.xyz * vec3f(layers[at + 3u], layers[at + 4u], layers[at + 5u]);
    }
    let index = lights.first_pixel + pixel;
    let count = spreads[index].w;
    let evens = ceil(0.5 * count);
    let odds = count - evens;
    // Where there are no paths yet, layers hold another picture's.
    even = select(vec3f(0.0), even, evens > 0.0);
    odd = select(even, odd, odds > 0.0);
    let n = max(count, 1.0);
    let mean = even + odds / n * (odd - even);
    film[index] = vec4f(min(mean, vec3f(BRIGHTEST)), min(count, 1.0));
    // The difference has the variance of one path times 1/evens + 1/odds. Squared deviations are n - 1
    // times that of one path.
    let difference = even - odd;
    spreads[index] = vec4f(evens * odds / n * (n - 1.0) * difference * difference, count);
}
