// From the film's sums to 8-bit sRGB: mean, exposure, tone mapping, sRGB curve (IEC 61966-2-1).

struct ToneMap {
    // Linear radiance is multiplied by this.
    exposure: f32,
    // 0 Khronos PBR Neutral, 1 linear (clipped), 2 Reinhard on the luminance.
    operator_id: u32,
    pixel_count: u32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> tone: ToneMap;
@group(0) @binding(1) var<storage, read> film: array<vec4f>;
// One pixel a word, red in the lowest byte, alpha 255.
@group(0) @binding(2) var<storage, read_write> picture: array<u32>;

// Largest radiance kept: sums of it stay finite.
const BRIGHTEST = 1e6;

@compute @workgroup_size(64)
fn tone_map(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = id.y * groups.x * 64u + id.x;
    if index >= tone.pixel_count { return; }
    let sum = film[index];
    let radiance = clamp(tone.exposure * sum.rgb / max(sum.a, 1.0), vec3f(0.0), vec3f(BRIGHTEST));
    var display = radiance;
    // `id.z` is 0: see `steering` in shared/frame.wgsl.
    switch tone.operator_id + id.z {
        case 1u: {}
        case 2u: {
            let luminance = dot(radiance, vec3f(0.2126, 0.7152, 0.0722));
            display = radiance / (1.0 + luminance);
        }
        default: { display = pbr_neutral(radiance); }
    }
    let bytes = vec3u(round(255.0 * srgb(clamp(display, vec3f(0.0), vec3f(1.0)))));
    picture[index] = bytes.r | bytes.g << 8u | bytes.b << 16u | 0xff000000u;
}

fn srgb(linear: vec3f) -> vec3f {
    let low = 12.92 * linear;
    let high = 1.055 * pow(linear, vec3f(1.0 / 2.4)) - 0.055;
    return select(high, low, linear <= vec3f(0.0031308));
}

// Khronos PBR Neutral (2024): colours up to 0.8 - offset stay as they are but for a small toe,
// brighter ones are compressed towards 1 and desaturated.
fn pbr_neutral(color: vec3f) -> vec3f {
    let start = 0.8 - 0.04;
    let desaturation = 0.15;
    let darkest = min(color.r, min(color.g, color.b));
    let toe = select(0.04, darkest - 6.25 * darkest * darkest, darkest < 0.08);
    let shifted = color - toe;
    let peak = max(shifted.r, max(shifted.g, shifted.b));
    if peak < start { return shifted; }
    let room = 1.0 - start;
    let compressed = 1.0 - room * room / (peak + room - start);
    let scaled = shifted * compressed / peak;
    let fade = 1.0 - 1.0 / (desaturation * (peak - compressed) + 1.0);
    return mix(scaled, vec3f(compressed), fade);
}
