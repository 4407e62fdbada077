// Pass `prolong_correction`: adds the next coarser level's correction to the cells it stands for.

@compute @workgroup_size(64)
fn prolong_correction(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = index_in_level(group, lane);
    if index >= level.count { return; }
    let coarse = cell_in(index, level.cells) / level.factors;
    let parent = (coarse.z * level.coarse_cells.y + coarse.y) * level.coarse_cells.x + coarse.x;
    corrections[level.offset + index] += corrections[level.coarse_offset + parent];
}
