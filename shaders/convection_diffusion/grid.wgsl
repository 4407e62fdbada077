// The grid of the light field: cells over the volume's box, x fastest. One dispatch goes over a run
// of them, 64 to a workgroup. Mirrored by `LightGrid` in server/render/src/uniforms.rs.

struct LightGrid {
    // Cells along x, y, z.
    cells: vec3u,
    // First cell of this dispatch.
    first: u32,
    // Edges of a cell, world units.
    cell_size: vec3f,
    // Cells of this dispatch.
    count: u32,
    // Points along x, y, z of a cell at which matter is looked at.
    points: vec3u,
    // Workgroups in a row of the dispatch.
    row: u32,
    // 1: clipped matter blocks light all the same.
    clip_shadows: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(20) var<uniform> grid: LightGrid;

// Index of an invocation in its dispatch; `grid.count` and above for those beyond its end.
fn index_in_dispatch(group: vec3u, lane: u32) -> u32 {
    return (group.y * grid.row + group.x) * 64u + lane;
}

fn cell_of(index: u32) -> vec3u {
    let layer = grid.cells.x * grid.cells.y;
    let rest = index % layer;
    return vec3u(rest % grid.cells.x, rest / grid.cells.x, index / layer);
}

fn index_of(cell: vec3u) -> u32 {
    return (cell.z * grid.cells.y + cell.y) * grid.cells.x + cell.x;
}
