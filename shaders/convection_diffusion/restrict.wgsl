// Pass `restrict_residual`: what the corrections leave, as the right-hand side of the next coarser
// level: means over its cells.

@compute @workgroup_size(64)
fn restrict_residual(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_level(group, lane);
    if place >= level.coarse_count { return; }
    let first = cell_in(place, level.coarse_cells) * level.factors;
    var sum = vec4f(0.0);
    for (var z = 0u; z < level.factors.z; z++) {
        for (var y = 0u; y < level.factors.y; y++) {
            for (var x = 0u; x < level.factors.x; x++) {
                let cell = first + vec3u(x, y, z);
                // Black cells were smoothed last and have nothing left over.
                let red = ((cell.x + cell.y + cell.z) & 1u) == 0u;
                if red && all(cell < level.cells) { sum += left_over(cell); }
            }
        }
    }
    residuals[level.coarse_offset + place] = sum / f32(level.factors.x * level.factors.y * level.factors.z);
}

fn left_over(cell: vec3u) -> vec4f {
    let at = level.offset + (cell.z * level.cells.y + cell.y) * level.cells.x + cell.x;
    let near = around(cell, at);
    let flow = flows_around(flows[at], near);
    let others = flow.x0 * corrections[near.xs.x] + flow.x1 * corrections[near.xs.y] + flow.y0 * corrections[near.ys.x]
        + flow.y1 * corrections[near.ys.y] + flow.z0 * corrections[near.zs.x] + flow.z1 * corrections[near.zs.y];
    return residuals[at] - (losses[at] + sum_of(flow)) * corrections[at] + others;
}
