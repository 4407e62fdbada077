// Light from a light field: incident radiance as spherical harmonics on a grid over the volume's box,
// whichever method computed it (field.wgsl). Directions point to where light comes from.

// Bands; 0: there is no field.
override FIELD_BANDS: u32 = 0u;
// Whether what lights bring by themselves is not in it, but in `direct_field` (direct_light/nodes.wgsl).
override DIRECT: bool = false;

// Whether there is matter that is opaque within a texel, so that texels hold the mean of what is seen of its
// skin.
override SKINS: bool = false;
// Whether it is told where these are seen from.
override FACED: bool = false;

// Below this weight nothing is known.
const LEAST_WEIGHT = 1e-6;
// Factors of the cosine clamped to the upper hemisphere, divided by pi (Ramamoorthi, Hanrahan 2001).
const COSINE_BANDS = array<f32, 6>(1.0, 0.6666666667, 0.25, 0.0, -0.0416666667, 0.0);

// What of the radiance is wanted: the phase function's part about -w_o, the diffuse part about n, the
// specular part about the mirror direction.
struct Wanted {
    behind: vec3f,
    phase: vec3f,
    n: vec3f,
    diffuse: vec3f,
    mirror: vec3f,
    specular: f32,
}

// Scattered radiance towards w_o per unit of extinction, as in local/local.wgsl.
fn scattered_from_field(x: vec3f, w_o: vec3f, albedo: vec3f, material: Material, gradient: vec3f, sigma_t: f32) -> vec3f {
    let facing = surface_facing(w_o, material, gradient);
    let n = facing.xyz;
    var wanted = Wanted(-w_o, (1.0 - facing.w) * albedo, n, facing.w * material.ambient_diffuse * albedo,
        2.0 * dot(n, w_o) * n - w_o, facing.w * material.ambient_specular);
    let inside = clamp((x / frame.size_world + 0.5) * field.dims, vec3f(0.5), field.dims - 0.5);
    let bands = f32(FIELD_BANDS);
    let texture_from_texel = 1.0 / (field.dims * vec3f(bands, 1.0, bands));
    let at = inside * texture_from_texel;
    let first = textureSampleLevel(light_field, light_sampler, at, 0.0);
    if FACED && SKINS && SURFACES && FIELD_BANDS > 1u {
        let seen_from = vec3f(texel_of_field(at, 1u).w, texel_of_field(at, 2u).w, texel_of_field(at, 3u).w) / max(first.w, LEAST_WEIGHT);
        let of_skins = 1.0 / facing_share(seen_from, n, sigma_t);
        wanted.diffuse *= of_skins;
        wanted.specular *= of_skins;
    }
    var sum = first.xyz * factor(wanted, material, 0u, 0u);
    if FIELD_BANDS > 1u {
        for (var k = 1u; k < 4u; k++) { sum += coefficient(at, k) * factor(wanted, material, 1u, k); }
    }
    if FIELD_BANDS > 2u {
        for (var k = 4u; k < 9u; k++) { sum += coefficient(at, k) * factor(wanted, material, 2u, k); }
    }
    for (var l = 3u; l < FIELD_BANDS; l++) {
        for (var k = l * l; k < (l + 1u) * (l + 1u); k++) {
            sum += coefficient(at, k) * factor(wanted, material, l, k);
        }
    }
    // Bands that are cut off leave ripples, below 0, too.
    return max(sum, vec3f(0.0)) * select(0.0, field.scale / first.w, first.w > LEAST_WEIGHT);
}

// No smaller share of the skins around a place faces anything.
const LEAST_FACING = 0.3;

// Optical depths between which matter comes to be a skin.
const SKIN_DEPTHS = vec2f(2.0, 10.0);

// Cosines of the ways that a flat skin was looked along, and what they counted (photon_map/seen.wgsl).
const COSINES = vec3f(1.0, 0.70710678, 0.57735027);
const COUNTED = vec3f(0.198, 0.451, 0.351);

// What is seen of thick matter at a slant, over the mean of the ways that it was looked along, under light from
// all around. The half-space of albedo a sends 1 - gamma H(mu) (Chandrasekhar 1960), which is in proportion to
// 1 / (1 + 2 gamma mu) with H as (1 + 2 mu) / (1 + 2 gamma mu) (Hapke 1981), gamma^2 = (1 - a) / (1 - a g). Light
// that a surface reflects is not scattered in the skin again: gamma = 1.
fn seen_at_a_slant(w_o: vec3f, albedo: vec3f, material: Material, gradient: vec3f, sigma_t: f32) -> vec3f {
    let steepness = length(gradient);
    let slant = abs(dot(gradient, w_o)) / max(steepness, 1e-20);
    let inside = sqrt(max(1.0 - albedo, vec3f(0.0)) / max(1.0 - albedo * band_of(material, 1u), vec3f(1e-6)));
    let gamma = 2.0 * mix(inside, vec3f(1.0), material.surface);
    let mean = COUNTED.x / (1.0 + gamma * COSINES.x) + COUNTED.y / (1.0 + gamma * COSINES.y)
        + COUNTED.z / (1.0 + gamma * COSINES.z);
    let is_skin = smoothstep(SKIN_DEPTHS.x, SKIN_DEPTHS.y, sigma_t * field.reach);
    return mix(vec3f(1.0), 1.0 / ((1.0 + gamma * slant) * mean), select(0.0, is_skin, steepness > 0.0));
}

// How much of the skins around a place is turned to n, beside half of what is not: a surface is lit from the
// side that it is turned to, and its skin alone catches that light. Where there are two skins, of a wall, they
// are counted together, and only one is lit from there.
fn facing_share(seen_from: vec3f, n: vec3f, sigma_t: f32) -> f32 {
    let of_one_skin = dot(COUNTED, COSINES);
    let share = clamp(0.5 + 0.5 * dot(seen_from, n) / of_one_skin, LEAST_FACING, 1.0);
    return mix(1.0, share, smoothstep(SKIN_DEPTHS.x, SKIN_DEPTHS.y, sigma_t * field.reach));
}

fn coefficient(at: vec3f, k: u32) -> vec3f {
    return texel_of_field(at, k).xyz;
}

fn texel_of_field(at: vec3f, k: u32) -> vec4f {
    // At least 1, or the code of variants without a field would divide by 0.
    let bands = max(FIELD_BANDS, 1u);
    let tile = vec3f(f32(k % bands), 0.0, f32(k / bands)) / f32(bands);
    return textureSampleLevel(light_field, light_sampler, at + tile, 0.0);
}

fn factor(wanted: Wanted, material: Material, l: u32, k: u32) -> vec3f {
    var value = wanted.phase * (band_of(material, l) * spherical_harmonic(k, wanted.behind));
    if SURFACES {
        value += wanted.diffuse * (COSINE_BANDS[l] * spherical_harmonic(k, wanted.n));
        value += wanted.specular * band_of(material, l + 6u) * spherical_harmonic(k, wanted.mirror);
    }
    return value;
}

fn band_of(material: Material, i: u32) -> f32 {
    return material.bands[i / 4u][i % 4u];
}
