// Characteristics of one light: straight lines along which it travels, laid out as a lattice that is
// sheared (light from afar) or fans out (from a place). Coordinates are cells: `t` along the main
// axis in the way the light travels, 0 at the face of the box it enters by; `p` the two others.
// Mirrored by `Sweep` in server/render/src/uniforms.rs.

struct Sweep {
    // Cells along the main axis and the two others.
    cells: vec3u,
    // Main axis: 0 x, 1 y, 2 z; the others follow in turn.
    axis: u32,
    // Edges of a cell along the main axis and the two others, world units.
    cell_size: vec3f,
    // 1: the light travels towards larger indices.
    forward: u32,
    // From a place: where, as t and p.
    origin: vec3f,
    // 1: the characteristics come from `origin`. 0: they are parallel.
    from_place: u32,
    // Of characteristic (0, 0): p at t = 0 if parallel, else its slope dp/dt.
    base: vec2f,
    // What the next characteristic adds to that.
    spacing: vec2f,
    // Slope of parallel characteristics.
    slope: vec2f,
    // Characteristics along both lattice directions.
    lines: vec2u,
    // Planes of this dispatch: first_plane .. first_plane + plane_count, plane m at t = m + 1/2.
    first_plane: u32,
    plane_count: u32,
    // First plane of the whole sweep; nothing is known before it.
    start_plane: u32,
    // Where the light's transmittances stand among those of all lights, in cells.
    slot: u32,
}

@group(0) @binding(23) var<uniform> sweep: Sweep;

// p as a function of t: at t0, and its slope.
struct Line {
    p0: vec2f,
    slope: vec2f,
    t0: f32,
}

fn lattice_line(line: vec2f) -> Line {
    let value = sweep.base + line * sweep.spacing;
    if sweep.from_place == 1u { return Line(sweep.origin.yz, value, sweep.origin.x); }
    return Line(value, sweep.slope, 0.0);
}

fn line_at(line: Line, t: f32) -> vec2f {
    return line.p0 + line.slope * (t - line.t0);
}

// Between which t a line is within the box, and beyond the light.
fn line_interval(line: Line) -> vec2f {
    let high = vec2f(sweep.cells.yz);
    let level = abs(line.slope) < vec2f(1e-9);
    let slope = select(line.slope, vec2f(1e-9), level);
    let a = line.t0 - line.p0 / slope;
    let b = line.t0 + (high - line.p0) / slope;
    let outside = level & ((line.p0 < vec2f(0.0)) | (line.p0 > high));
    let near = select(min(a, b), vec2f(-1e30), level & !outside);
    let far = select(max(a, b), vec2f(select(1e30, -1e30, any(outside))), level);
    let first = select(0.0, max(line.t0, 0.0), sweep.from_place == 1u);
    return vec2f(max(first, max(near.x, near.y)), min(f32(sweep.cells.x), min(far.x, far.y)));
}

// World units on the line for each unit of t.
fn line_length(line: Line) -> f32 {
    return length(vec3f(1.0, line.slope) * sweep.cell_size);
}

// Coordinates t, p as x, y, z in cells.
fn cell_coordinates(t: f32, p: vec2f) -> vec3f {
    let a = select(f32(sweep.cells.x) - t, t, sweep.forward == 1u);
    if sweep.axis == 0u { return vec3f(a, p); }
    if sweep.axis == 1u { return vec3f(p.y, a, p.x); }
    return vec3f(p, a);
}

// Cells along x, y, z.
fn grid_cells() -> vec3u {
    if sweep.axis == 0u { return sweep.cells; }
    if sweep.axis == 1u { return sweep.cells.zxy; }
    return sweep.cells.yzx;
}
