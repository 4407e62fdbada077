// Pass `gather_lines`: transmittance from the light to the cells of some planes, from the four
// characteristics around each (README.md, equation 6).

@group(0) @binding(24) var matter: texture_3d<f32>;
@group(0) @binding(25) var linear_sampler: sampler;
@group(0) @binding(28) var lines_in: texture_3d<f32>;
// Per light and cell two shares of 65,535: transmittance to the cell's centre, mean over the cell.
@group(0) @binding(29) var<storage, read_write> transmittances: array<u32>;

// Shortest way in the box, along the main axis in cells, by which a characteristic is taken for its neighbour's.
const SHORTEST_WAY = 1e-3;
// Far above the rounding of coordinates, far below a cell.
const TIE = 1e-4;

@compute @workgroup_size(8, 8)
fn gather_lines(@builtin(global_invocation_id) id: vec3u) {
    let plane = sweep.first_plane + id.z;
    if any(id.xy >= sweep.cells.yz) { return; }
    let t = f32(plane) + 0.5;
    let p = vec2f(id.xy) + 0.5;
    var line = Line(p, sweep.slope, t);
    var lattice = (p - sweep.slope * t - sweep.base) / sweep.spacing;
    if sweep.from_place == 1u {
        let offset = vec3f(t, p) - sweep.origin;
        if !belongs(offset) { return; }
        let slope = offset.yz / max(offset.x, 1e-6);
        line = Line(sweep.origin.yz, slope, sweep.origin.x);
        lattice = (slope - sweep.base) / sweep.spacing;
    }
    let enters = line_interval(line).x;
    let metric = line_length(line);
    // What a way that begins elsewhere in the box met less, or more: matter where this one begins.
    let begins = enters + 0.5 * clamp(t - enters, 0.0, 1.0);
    let first = cell_coordinates(floor(begins) + 0.5, line_at(line, begins)) / vec3f(grid_cells());
    let first_sigma = textureSampleLevel(matter, linear_sampler, first, 0.0).w;
    let corner = clamp(floor(lattice), vec2f(0.0), vec2f(sweep.lines - 2u));
    let share = clamp(lattice - corner, vec2f(0.0), vec2f(1.0));
    var sum = vec2f(0.0);
    var weights = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let step = vec2f(vec2u(i & 1u, i >> 1u));
        let neighbour = lattice_line(corner + step);
        let interval = line_interval(neighbour);
        let weight = mix(1.0 - share.x, share.x, step.x) * mix(1.0 - share.y, share.y, step.y);
        // A line that is not in the box here knows nothing.
        if t - interval.x > SHORTEST_WAY && t < interval.y {
            let depths = textureLoad(lines_in, vec3i(vec2i(corner + step), i32(id.z)), 0).xy;
            let more = metric * first_sigma * (interval.x - enters);
            let depth = max(depths.x * metric / line_length(neighbour) + more, 0.0);
            let mean_depth = max(depths.y + depth - depths.x, 0.0);
            sum += weight * exp(-vec2f(depth, mean_depth));
            weights += weight;
        }
    }
    // Nothing lies between a light and the cell it stands in.
    let result = select(vec2f(1.0), sum / max(weights, 1e-20), weights > 0.0);
    transmittances[sweep.slot + cell_index(plane, id.xy)] = pack2x16unorm(result);
}

// Whether light from a place reaches a cell along this sweep's main axis, which is that of the
// largest offset in cells. Sweeps that tie, but for rounding, both serve the cell: the later holds.
fn belongs(offset: vec3f) -> bool {
    let size = abs(offset);
    return offset.x > -TIE && size.x + TIE * (1.0 + size.x) >= max(size.y, size.z);
}

fn cell_index(plane: u32, p: vec2u) -> u32 {
    let a = select(sweep.cells.x - 1u - plane, plane, sweep.forward == 1u);
    if sweep.axis == 0u { return (p.y * sweep.cells.y + p.x) * sweep.cells.x + a; }
    if sweep.axis == 1u { return (p.x * sweep.cells.x + a) * sweep.cells.z + p.y; }
    return (a * sweep.cells.z + p.y) * sweep.cells.y + p.x;
}
