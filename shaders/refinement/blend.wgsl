// The film that is shown, and what its error is expected to be.

@group(0) @binding(5) var<storage, read_write> film: array<vec4f>;
// Of each tile: expected squared error of its values, and the sum of their squares.
@group(0) @binding(6) var<storage, read_write> errors: array<vec2f>;

@compute @workgroup_size(8, 8)
fn blend(
    @builtin(global_invocation_id) pixel: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    var mine = vec4f(0.0);
    if all(pixel.xy < part.image) {
        let index = pixel.y * part.image.x + pixel.x;
        let approximate = film[index];
        let taken = blended[index];
        // Sums of parts may fall below 0 where both pictures are dark.
        let value = max(approximate.rgb / max(approximate.a, 1.0) + taken.rgb, vec3f(0.0));
        blended[index] = vec4f(value, 1.0);
        // `differences` are whole again: see `Renderer::blend`.
        let difference = differences[index];
        let left = difference.rgb - taken.rgb;
        // Stein's unbiased estimate.
        mine = vec4f(dot(left, left) + difference.a * (2.0 * taken.a - 1.0), dot(value, value), 0.0, 0.0);
    }
    add_up(mine, lane);
    if lane == 0u { errors[group.y * groups.x + group.x] = sums[0].xy; }
}
