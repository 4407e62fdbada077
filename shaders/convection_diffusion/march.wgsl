// Pass `march_lines`: optical depth along each characteristic, plane by plane. Exact for matter that
// is constant within a cell along the main axis and linear across it (README.md, equations 4 and 5).

@group(0) @binding(24) var matter: texture_3d<f32>;
@group(0) @binding(25) var linear_sampler: sampler;
// Optical depth from where a line enters the box to where the last dispatch ended.
@group(0) @binding(26) var<storage, read_write> depths: array<f32>;
// Per line and plane: optical depth to the plane, and the negative logarithm of the mean
// transmittance over the cell around it.
@group(0) @binding(27) var lines_out: texture_storage_3d<rg32float, write>;

// Optical depth within a cell at which its light is taken, at most: ln 2. Of opaque matter no more is
// seen than a skin, and the centre of a cell may lie far below it (README.md, equation 5).
const DEEPEST_SEEN = 0.69314718;

@compute @workgroup_size(8, 8)
fn march_lines(@builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) group: vec3u) {
    always_zero = group.z;
    // Lines beyond the edge march the last one again and drop it.
    let inside = all(id.xy < sweep.lines);
    let lattice = min(id.xy, sweep.lines - 1u);
    let line = lattice_line(vec2f(lattice));
    let interval = line_interval(line);
    let metric = line_length(line);
    let index = lattice.y * sweep.lines.x + lattice.x;
    let first = steering(sweep.first_plane);
    var depth = depths[index];
    if first == steering(sweep.start_plane) { depth = 0.0; }
    for (var i = 0u; i < steering(sweep.plane_count); i++) {
        let plane = f32(first + i);
        let enter = max(plane, interval.x);
        let leave = min(plane + 1.0, interval.y);
        let part = max(leave - enter, 0.0);
        let uvw = cell_coordinates(plane + 0.5, line_at(line, 0.5 * (enter + leave))) / vec3f(grid_cells());
        let sigma = textureSampleLevel(matter, linear_sampler, uvw, 0.0).w * metric;
        let to_centre = min(clamp(plane + 0.5 - enter, 0.0, part) * sigma, DEEPEST_SEEN);
        let across = part * sigma;
        let values = vec2f(depth + to_centre, depth + minus_log_mean(across));
        if inside { textureStore(lines_out, vec3u(lattice, i), vec4f(values, 0.0, 0.0)); }
        depth += across;
    }
    if inside { depths[index] = depth; }
}

// -ln((1 - exp(-x)) / x)
fn minus_log_mean(x: f32) -> f32 {
    if x < 0.02 { return x * (0.5 - x / 24.0); }
    return log(x / (1.0 - exp(-x)));
}
