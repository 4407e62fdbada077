// Splits the finest part off the differences, and finds out what it is worth in each tile.

// Standard errors that the bias is taken below its estimate.
const CAUTION = 1.0;

@compute @workgroup_size(8, 8)
fn split(
    @builtin(global_invocation_id) pixel: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    // Squared difference, variance, the square of what one exceeds the other by, and pixels.
    var mine = vec4f(0.0);
    if all(pixel.xy < part.image) {
        let index = pixel.y * part.image.x + pixel.x;
        let smooth_one = around(pixel.xy);
        smoothed[index] = select(vec4f(0.0), smooth_one, part.stride > 0u);
        let of_part = differences[index].rgb - smoothed[index].rgb;
        let squares = vec2f(dot(of_part, of_part), smooth_one.a * part.noise);
        let excess = squares.x - squares.y;
        mine = vec4f(squares, excess * excess, 1.0);
    }
    add_up(mine, lane);
    if lane == 0u {
        let mean = sums[0].xyz / sums[0].w;
        let excess = mean.x - mean.y;
        let scatter = sqrt(max(mean.z - excess * excess, 0.0) / sums[0].w);
        tiles[group.y * groups.x + group.x] = vec2f(max(excess - CAUTION * scatter, 0.0), mean.y);
    }
}

// Differences smoothed by 1 2 1 along both axes, variances by the squares of that, both of sum 1.
fn around(pixel: vec2u) -> vec4f {
    if part.stride == 0u { return differences[pixel.y * part.image.x + pixel.x]; }
    var sum = vec4f(0.0);
    for (var y = 0u; y < 3u; y++) {
        for (var x = 0u; x < 3u; x++) {
            let tap = min(max(pixel + vec2u(x, y) * part.stride, vec2u(part.stride)) - part.stride, part.image - 1u);
            let weight = select(1.0, 2.0, x == 1u) * select(1.0, 2.0, y == 1u);
            sum += differences[tap.y * part.image.x + tap.x] * vec4f(vec3f(weight / 16.0), weight * weight / 36.0);
        }
    }
    return sum;
}
