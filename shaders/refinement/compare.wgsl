// How far two films are apart, tile by tile, and how far they would be by the noise of one alone.

@group(0) @binding(0) var<uniform> image: vec4u;
// Sums of radiance and number of samples.
@group(0) @binding(1) var<storage, read> film: array<vec4f>;
// Means over paths, and their squared deviations with the number of paths.
@group(0) @binding(2) var<storage, read> path_film: array<vec4f>;
@group(0) @binding(3) var<storage, read> spreads: array<vec4f>;
// Of a tile, per pixel: squared bias that the approximation has at least, variance of the paths' mean, and
// squared difference.
@group(0) @binding(4) var<storage, read_write> tiles: array<vec4f>;

const EDGE = 8u;
// Larger differences count as this: their fourth powers stay finite.
const FARTHEST = 1e8;
// Standard errors that the bias is taken below its estimate.
const CAUTION = 1.0;

// Squared difference, variance, the square of what one exceeds the other by, and pixels.
var<workgroup> sums: array<vec4f, 64>;

@compute @workgroup_size(8, 8)
fn compare(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let pixel = group.xy * EDGE + local.xy;
    var mine = vec4f(0.0);
    if all(pixel < image.xy) {
        let index = pixel.y * image.x + pixel.x;
        let approximate = film[index];
        let spread = spreads[index];
        let apart = abs(path_film[index].rgb - approximate.rgb / max(approximate.a, 1.0));
        let difference = min(apart, vec3f(FARTHEST));
        let variance = min(spread.rgb / max(spread.w * (spread.w - 1.0), 1.0), vec3f(FARTHEST * FARTHEST));
        let squares = vec2f(dot(difference, difference), dot(variance, vec3f(1.0)));
        let excess = squares.x - squares.y;
        mine = vec4f(squares, excess * excess, 1.0);
    }
    sums[lane] = mine;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if lane < half { sums[lane] += sums[lane + half]; }
        workgroupBarrier();
    }
    if lane == 0u {
        let mean = sums[0].xyz / sums[0].w;
        let excess = mean.x - mean.y;
        let scatter = sqrt(max(mean.z - excess * excess, 0.0) / sums[0].w);
        tiles[group.y * groups.x + group.x] = vec4f(max(excess - CAUTION * scatter, 0.0), mean.yx, 0.0);
    }
}
