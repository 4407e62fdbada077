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
// SUMS sums, then partial sums.
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

// The six neighbours of a cell, -x, +x, -y, ...: their places, and 1 / h^2 towards them, 0 where there
// is none (its place is the cell's own). No loops and no branches: a software device takes every one of
// them for all lanes.
struct Around {
    xs: vec2u,
    ys: vec2u,
    zs: vec2u,
    x_weights: vec2f,
    y_weights: vec2f,
    z_weights: vec2f,
}

fn around(cell: vec3u, at: u32) -> Around {
    let below = vec3<bool>(cell > vec3u(0u));
    let above = cell + 1u < level.cells;
    let row = level.cells.x;
    let layer = level.cells.x * level.cells.y;
    let w = level.weights;
    return Around(
        vec2u(select(at, at - 1u, below.x), select(at, at + 1u, above.x)),
        vec2u(select(at, at - row, below.y), select(at, at + row, above.y)),
        vec2u(select(at, at - layer, below.z), select(at, at + layer, above.z)),
        select(vec2f(0.0), w.xx, vec2<bool>(below.x, above.x)),
        select(vec2f(0.0), w.yy, vec2<bool>(below.y, above.y)),
        select(vec2f(0.0), w.zz, vec2<bool>(below.z, above.z)),
    );
}

// G towards each neighbour.
struct Flows {
    x0: vec4f,
    x1: vec4f,
    y0: vec4f,
    y1: vec4f,
    z0: vec4f,
    z1: vec4f,
}

fn flows_around(own: vec4f, near: Around) -> Flows {
    return Flows(
        between(own, flows[near.xs.x]) * near.x_weights.x,
        between(own, flows[near.xs.y]) * near.x_weights.y,
        between(own, flows[near.ys.x]) * near.y_weights.x,
        between(own, flows[near.ys.y]) * near.y_weights.y,
        between(own, flows[near.zs.x]) * near.z_weights.x,
        between(own, flows[near.zs.y]) * near.z_weights.y,
    );
}

fn sum_of(flow: Flows) -> vec4f {
    return flow.x0 + flow.x1 + flow.y0 + flow.y1 + flow.z0 + flow.z1;
}
