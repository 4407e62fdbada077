// One film of two: an approximate picture without noise, and a noisy one without bias.

@group(0) @binding(0) var<uniform> image: vec4u;
@group(0) @binding(1) var<storage, read> film: array<vec4f>;
@group(0) @binding(2) var<storage, read> path_film: array<vec4f>;
// See compare.wgsl.
@group(0) @binding(3) var<storage, read> tiles: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> blended: array<vec4f>;
// Of each tile: expected squared error of its values, and the sum of their squares.
@group(0) @binding(5) var<storage, read_write> errors: array<vec2f>;

const EDGE = 8u;

var<workgroup> sums: array<vec2f, 64>;

@compute @workgroup_size(8, 8)
fn blend(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let pixel = group.xy * EDGE + local.xy;
    var mine = vec2f(0.0);
    if all(pixel < image.xy) {
        let index = pixel.y * image.x + pixel.x;
        let spread = spread_at(pixel, groups.xy);
        let share = share_of_paths(spread);
        let approximate = film[index];
        let value = mix(approximate.rgb / max(approximate.a, 1.0), path_film[index].rgb, share);
        blended[index] = vec4f(value, 1.0);
        mine = vec2f(expected_error(spread, share), dot(value, value));
    }
    sums[lane] = mine;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if lane < half { sums[lane] += sums[lane + half]; }
        workgroupBarrier();
    }
    if lane == 0u { errors[group.y * groups.x + group.x] = sums[0]; }
}

// What is known around a pixel, interpolated between the middles of tiles.
fn spread_at(pixel: vec2u, tile_count: vec2u) -> vec4f {
    let place = max((vec2f(pixel) + 0.5) / f32(EDGE) - 0.5, vec2f(0.0));
    let first = min(vec2u(place), tile_count - 1u);
    let next = min(first + 1u, tile_count - 1u);
    let along = fract(place);
    let top = mix(tiles[first.y * tile_count.x + first.x], tiles[first.y * tile_count.x + next.x], along.x);
    let below = mix(tiles[next.y * tile_count.x + first.x], tiles[next.y * tile_count.x + next.x], along.x);
    return mix(top, below, along.y);
}

// The share that makes the expected squared error least, with the bias that the approximation is known to
// have.
fn share_of_paths(spread: vec4f) -> f32 {
    if spread.x <= 0.0 { return 0.0; }
    return spread.x / (spread.x + spread.y);
}

// Stein's unbiased estimate of the mean squared error.
fn expected_error(spread: vec4f, share: f32) -> f32 {
    let rest = 1.0 - share;
    return spread.y * (2.0 * share - 1.0) + rest * rest * spread.z;
}
