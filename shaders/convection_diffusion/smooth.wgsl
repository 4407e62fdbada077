// Pass `smooth`: half a sweep of Gauss-Seidel, over the cells of one colour of a checkerboard; they
// touch only those of the other.

// 0 red, 1 black.
override COLOUR: u32 = 0u;
// Corrections are 0 so far and not yet written.
override FROM_NOTHING: bool = false;

@compute @workgroup_size(64)
fn smooth_level(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_level(group, lane);
    let halves = vec3u((level.cells.x + 1u) / 2u, level.cells.yz);
    let half_cell = cell_in(place, halves);
    let cell = vec3u(2u * half_cell.x + ((half_cell.y + half_cell.z + COLOUR) & 1u), half_cell.yz);
    if cell.z >= level.cells.z || cell.x >= level.cells.x { return; }
    let at = level.offset + (cell.z * level.cells.y + cell.y) * level.cells.x + cell.x;
    let near = around(cell, at);
    let flow = flows_around(flows[at], near);
    let diagonal = losses[at] + sum_of(flow);
    var sum = residuals[at];
    if !FROM_NOTHING {
        sum += flow.x0 * corrections[near.xs.x] + flow.x1 * corrections[near.xs.y] + flow.y0 * corrections[near.ys.x]
        + flow.y1 * corrections[near.ys.y] + flow.z0 * corrections[near.zs.x] + flow.z1 * corrections[near.zs.y];
    }
    corrections[at] = select(vec4f(0.0), sum / max(diagonal, vec4f(1e-30)), diagonal > vec4f(1e-20));
}
