// Pass `restrict_residual`: what the corrections leave, as the right-hand side of the next coarser
// level: means over its cells.

@compute @workgroup_size(64)
fn restrict_residual(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_level(group, lane);
    if place >= level.coarse_count { return; }
    let first = cell_in(place, level.coarse_cells) * level.factors;
    var sum = vec4f(0.0);
    for (var i = 0u; i < 8u; i++) {
        let step = vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u);
        let cell = first + step;
        if all(step < level.factors) && all(cell < level.cells) {
            sum += left_over(cell);
        }
    }
    residuals[level.coarse_offset + place] = sum / f32(level.factors.x * level.factors.y * level.factors.z);
}

fn left_over(cell: vec3u) -> vec4f {
    let index = (cell.z * level.cells.y + cell.y) * level.cells.x + cell.x;
    let at = level.offset + index;
    let value = corrections[at];
    let own = flows[at];
    var rest = residuals[at] - losses[at] * value;
    for (var face = 0u; face < 6u; face++) {
        let other = neighbour(cell, index, face);
        if other.there {
            let there = level.offset + other.index;
            rest -= between(own, flows[there]) * other.weight * (value - corrections[there]);
        }
    }
    return rest;
}
