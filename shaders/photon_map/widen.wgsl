// The kernel is widened where photons are few: a texel's light, and the extinction it is compared with, come to
// be more or less those of the mean around it. How much is told by the noise that so many photons have, against
// how far the texels around are from their mean (J.-S. Lee, Digital image enhancement and noise filtering by use
// of local statistics, 1980): where they differ as much as noise does, it is the mean; where light and shadow
// meet, and where photons are many, what was found.

@group(0) @binding(0) var<uniform> fill: Fill;
// Coefficients, and with the first of them the extinction that counts around texels.
@group(0) @binding(1) var found: texture_3d<f32>;
// As fill.wgsl wrote it.
@group(0) @binding(10) var<storage, read> doubt: array<vec2f>;
@group(0) @binding(5) var light_field: texture_storage_3d<rgba16float, write>;

override BANDS: u32 = 1u;

const AROUND = 27u;
// Weights along each axis.
const NEAR = vec3f(0.25, 0.5, 0.25);
// The mean of a skin is taken along the skin: where more than a share of the extinction is hidden, texels count
// less the more their extinction differs, and the part of it that counts; up to the power of LIKENESS.
const HIDDEN = 0.3;
const STEEPNESS = 16.0;
const LIKENESS = 8.0;
// 0 to the power of 0 is not a number everywhere.
const LEAST_LIKENESS = 1e-4;

@compute @workgroup_size(4, 4, 4)
fn widen_field(@builtin(global_invocation_id) texel: vec3u) {
    if any(texel >= fill.dims) { return; }
    let own = matter_of(vec3i(texel));
    var shares = array<f32, AROUND>();
    var all = 0.0;
    // Light, extinction that counts, variance.
    var mean = vec3f(0.0);
    for (var i = 0u; i < AROUND; i++) {
        let at = neighbour(texel, i);
        let matter = matter_of(at.xyz);
        shares[i] = NEAR[i % 3u] * NEAR[i / 3u % 3u] * NEAR[i / 9u] * f32(at.w) * likeness(own, matter);
        all += shares[i];
        mean += shares[i] * vec3f(light_of(at.xyz), matter.x, doubt[index_of(at.xyz)].x);
    }
    mean /= all;
    let radiance = mean.x / max(mean.y, 1e-30);
    var spread = 0.0;
    for (var i = 0u; i < AROUND; i++) {
        let at = neighbour(texel, i).xyz;
        let off = light_of(at) - radiance * matter_of(at).x;
        spread += shares[i] / all * off * off;
    }
    // Where there is no matter nothing is looked up.
    let is_settled = own.x <= 0.0 || mean.z <= 0.0;
    let kept = select(clamp(1.0 - mean.z / max(spread, 1e-30), 0.0, 1.0), 1.0, is_settled);
    let taken = select(0u, AROUND, kept < 1.0);
    for (var k = 0u; k < BANDS * BANDS; k++) {
        let tile = vec3i(vec3u(k % BANDS, 0u, k / BANDS) * fill.dims);
        var sum = vec4f(0.0);
        for (var i = 0u; i < taken; i++) {
            sum += shares[i] / all * textureLoad(found, neighbour(texel, i).xyz + tile, 0);
        }
        let place = vec3i(texel) + tile;
        textureStore(light_field, place, mix(sum, textureLoad(found, place, 0), kept));
    }
}

// The i-th of the texels around one, and whether it is one (w).
fn neighbour(texel: vec3u, i: u32) -> vec4i {
    let at = vec3i(texel) + vec3i(vec3u(i % 3u, i / 3u % 3u, i / 9u)) - 1;
    let held = clamp(at, vec3i(0), vec3i(fill.dims) - 1);
    return vec4i(held, i32(all(held == at)));
}

// The extinction around a texel: what counts of it, and all.
fn matter_of(texel: vec3i) -> vec2f {
    return vec2f(textureLoad(found, texel, 0).w, doubt[index_of(texel)].y);
}

fn light_of(texel: vec3i) -> f32 {
    return mean_of(textureLoad(found, texel, 0).xyz);
}

fn likeness(a: vec2f, b: vec2f) -> f32 {
    let low = min(a, b) / max(max(a, b), vec2f(1e-30));
    let counts = min(a.x / max(a.y, 1e-30), b.x / max(b.y, 1e-30));
    return pow(clamp(low.x * low.y, LEAST_LIKENESS, 1.0), clamp(STEEPNESS * (1.0 - counts - HIDDEN), 0.0, LIKENESS));
}

fn index_of(texel: vec3i) -> u32 {
    let at = vec3u(texel);
    return (at.z * fill.dims.y + at.y) * fill.dims.x + at.x;
}
