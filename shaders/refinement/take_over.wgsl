// Takes over of a part of the differences what makes the expected squared error least.

@compute @workgroup_size(8, 8)
fn take_over(@builtin(global_invocation_id) pixel: vec3u, @builtin(num_workgroups) groups: vec3u) {
    if any(pixel.xy >= part.image) { return; }
    let index = pixel.y * part.image.x + pixel.x;
    let known = known_at(pixel.xy, groups.xy);
    let share = select(0.0, known.x / (known.x + known.y), known.x > 0.0);
    let of_part = differences[index].rgb - smoothed[index].rgb;
    blended[index] += share * vec4f(of_part, part.centre);
}

// Bias and variance around a pixel, interpolated between the middles of tiles.
fn known_at(pixel: vec2u, tile_count: vec2u) -> vec2f {
    let place = max((vec2f(pixel) + 0.5) / f32(EDGE) - 0.5, vec2f(0.0));
    let first = min(vec2u(place), tile_count - 1u);
    let next = min(first + 1u, tile_count - 1u);
    let along = fract(place);
    let top = mix(tiles[first.y * tile_count.x + first.x], tiles[first.y * tile_count.x + next.x], along.x);
    let below = mix(tiles[next.y * tile_count.x + first.x], tiles[next.y * tile_count.x + next.x], along.x);
    return mix(top, below, along.y);
}
