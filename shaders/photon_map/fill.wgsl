// Light sums into the light field: for each light in turn its sums times its colour, and as the texels'
// weights the extinction around them. Look-ups divide what they interpolate by the weight that they
// interpolate, so both have the same footprint at every place, beside skins, too.

@group(0) @binding(0) var<uniform> fill: Fill;
@group(0) @binding(1) var<storage, read> sums: array<u32>;
@group(0) @binding(2) var<storage, read> moments: array<u32>;
@group(0) @binding(3) var<storage, read> touched: array<u32>;
// Of each texel and coefficient: lights so far.
@group(0) @binding(9) var<storage, read_write> totals: array<vec4f>;
@group(0) @binding(5) var light_field: texture_storage_3d<rgba16float, write>;
// Of each texel, for widen.wgsl: variance of the first coefficient, mean of its three channels, as so many
// photons have; and the extinction around it, whether it is seen or not.
@group(0) @binding(10) var<storage, read_write> doubt: array<vec2f>;

override BANDS: u32 = 1u;
const UNIT = 262144.0;
// A photon's share of a texel, squared, over the share: on average over places.
const SHARE_OF_SHARE = 0.296;
const Y_00 = 0.2820948;
// Largest number of the texture.
const LARGEST = 65504.0;

@compute @workgroup_size(4, 4, 4)
fn fill_field(@builtin(global_invocation_id) texel: vec3u, @builtin(workgroup_id) brick: vec3u) {
    let bricks = (fill.dims + 3u) / 4u;
    let is_touched = touched[(brick.z * bricks.y + brick.y) * bricks.x + brick.x] != 0u;
    if any(texel >= fill.dims) || !(is_touched || fill.everything == 1u) { return; }
    let index = (texel.z * fill.dims.y + texel.y) * fill.dims.x + texel.x;
    var mass = 0.0;
    let is_last = (fill.turn & 2u) != 0u;
    if is_last {
        mass = mass_around(texel, 0u);
        doubt[index].y = mass_around(texel, 8u) * fill.weight_of_mass;
    }
    let coefficients = BANDS * BANDS;
    for (var k = 0u; k < coefficients; k++) {
        let at = index * coefficients + k;
        let first = 6u * at;
        let sum = vec3f(number(first), number(first + 2u), number(first + 4u)) / UNIT;
        var total = fill.flux * sum;
        if k == 0u {
            let of_one = fill.weight_of_mass * fill.weight_of_mass * SHARE_OF_SHARE * Y_00 * mean_of(fill.flux);
            let of_light = of_one * mean_of(total);
            doubt[index].x = of_light + select(doubt[index].x, 0.0, (fill.turn & 1u) != 0u);
        }
        if (fill.turn & 1u) == 0u { total += totals[at].xyz; }
        totals[at] = vec4f(total, 0.0);
        if is_last {
            let tile = vec3u(k % BANDS, 0u, k / BANDS) * fill.dims;
            var radiance = vec3f(0.0);
            if mass > 0.0 { radiance = clamp(total * fill.weight_of_mass, vec3f(-LARGEST), vec3f(LARGEST)); }
            let weight = select(0.0, mass * fill.weight_of_mass, k == 0u);
            textureStore(light_field, texel + tile, vec4f(radiance, weight));
        }
    }
}

fn number(first: u32) -> f32 {
    return whole_number(sums[first], sums[first + 1u]);
}

// What the cells around a texel have for it. At the border both corners of a cell may be the same
// texel.
fn mass_around(texel: vec3u, which: u32) -> f32 {
    var sum = 0.0;
    let across = fill.dims + 1u;
    for (var i = 0u; i < 8u; i++) {
        let cell = texel + vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u);
        let first = which + 16u * ((cell.z * across.y + cell.y) * across.x + cell.x);
        for (var corner = 0u; corner < 8u; corner++) {
            let upper = vec3u(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
            let held = clamp(vec3i(cell) - 1 + vec3i(upper), vec3i(0), vec3i(fill.dims) - 1);
            if all(held == vec3i(texel)) { sum += bitcast<f32>(moments[first + corner]); }
        }
    }
    return sum;
}
