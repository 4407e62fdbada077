// Pass `coarsen_level`: D and E of the next coarser level: means over its cells, vacuum included.

@compute @workgroup_size(64)
fn coarsen_level(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = index_in_level(group, lane);
    if place >= level.coarse_count { return; }
    let first = cell_in(place, level.coarse_cells) * level.factors;
    var flow = vec4f(0.0);
    var loss = vec4f(0.0);
    for (var i = 0u; i < 8u; i++) {
        let step = vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u);
        let cell = first + step;
        if all(step < level.factors) && all(cell < level.cells) {
            let at = level.offset + (cell.z * level.cells.y + cell.y) * level.cells.x + cell.x;
            flow += flows[at];
            loss += losses[at];
        }
    }
    let mean = 1.0 / f32(level.factors.x * level.factors.y * level.factors.z);
    flows[level.coarse_offset + place] = flow * mean;
    losses[level.coarse_offset + place] = loss * mean;
}
