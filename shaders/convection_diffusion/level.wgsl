// Diffusion on the light grid and on coarser ones of it (README.md, equations 9 to 14):
//
//     E x - div(D grad x) = b,    (A x)_i = E_i x_i + sum over faces of G (x_i - x_j),
//     G = 2 D_i D_j / (D_i + D_j) / h^2
//
// for red, green and blue at once, in vec4f whose fourth component is 0. Where D is 0 nothing flows.
// All levels stand in one buffer each, the finest first. Mirrored by `Level` in
// server/render/src/uniforms.rs.

struct Level {
    cells: vec3u,
    // Where its cells begin in the buffers of all levels.
    offset: u32,
    // 1 / h^2 along x, y, z; world units.
    weights: vec3f,
    count: u32,
    // The next coarser level.
    coarse_cells: vec3u,
    coarse_offset: u32,
    // Cells of this level in one of the next, along x, y, z: 1 or 2.
    factors: vec3u,
    coarse_count: u32,
}

@group(0) @binding(30) var<uniform> level: Level;
// D.
@group(0) @binding(31) var<storage, read_write> flows: array<vec4f>;
// E.
@group(0) @binding(32) var<storage, read_write> losses: array<vec4f>;
// Corrections: on the finest level the preconditioned residual z.
@group(0) @binding(33) var<storage, read_write> corrections: array<vec4f>;
// Right-hand sides of the corrections: on the finest level b, then the residual r.
@group(0) @binding(34) var<storage, read_write> residuals: array<vec4f>;
// Of the finest level alone: x, search direction p, A p.
@group(0) @binding(35) var<storage, read_write> solution: array<vec4f>;
@group(0) @binding(36) var<storage, read_write> directions: array<vec4f>;
@group(0) @binding(37) var<storage, read_write> images: array<vec4f>;
// SUMS sums, then one partial sum for each workgroup.
@group(0) @binding(38) var<storage, read_write> sums: array<vec4f>;

// Workgroups in a row of a dispatch; GROUP_ROW in transport.rs.
const GROUP_ROW = 32768u;

fn index_in_level(group: vec3u, lane: u32) -> u32 {
    return (group.y * GROUP_ROW + group.x) * 64u + lane;
}

fn cell_in(index: u32, cells: vec3u) -> vec3u {
    let layer = cells.x * cells.y;
    let rest = index % layer;
    return vec3u(rest % cells.x, rest / cells.x, index / layer);
}

// Harmonic mean: what flows through two halves in a row.
fn between(a: vec4f, b: vec4f) -> vec4f {
    return 2.0 * a * b / max(a + b, vec4f(1e-30));
}

// Neighbour `face` (-x, +x, -y, ...) of a cell, if it is there.
struct Neighbour {
    there: bool,
    index: u32,
    weight: f32,
}

fn neighbour(cell: vec3u, index: u32, face: u32) -> Neighbour {
    let axis = face >> 1u;
    let strides = vec3u(1u, level.cells.x, level.cells.x * level.cells.y);
    if (face & 1u) == 0u {
        return Neighbour(cell[axis] > 0u, index - strides[axis], level.weights[axis]);
    }
    return Neighbour(cell[axis] + 1u < level.cells[axis], index + strides[axis], level.weights[axis]);
}
