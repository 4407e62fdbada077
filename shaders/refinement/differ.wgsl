// By how much two films differ, pixel by pixel.

// Sums of radiance and number of samples.
@group(0) @binding(5) var<storage, read_write> film: array<vec4f>;
// Means over paths, and their squared deviations with the number of paths.
@group(0) @binding(6) var<storage, read_write> path_film: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> spreads: array<vec4f>;

@compute @workgroup_size(8, 8)
fn differ(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= part.image) { return; }
    let index = pixel.y * part.image.x + pixel.x;
    let approximate = film[index];
    let spread = spreads[index];
    let apart = path_film[index].rgb - approximate.rgb / max(approximate.a, 1.0);
    let variance = dot(spread.rgb, vec3f(1.0)) / max(spread.w * (spread.w - 1.0), 1.0);
    differences[index] = vec4f(clamp(apart, vec3f(-FARTHEST), vec3f(FARTHEST)), min(variance, FARTHEST * FARTHEST));
    blended[index] = vec4f(0.0);
}
