// How much of a light reaches a place: exact for a linear field over the last bit of the way, where
// matter's own skin shades it; from there on by interpolation between nodes (README.md).

// Parts of the last bit of the way: a constant, for Mesa 22's software device crashes on a bound that
// is loaded.
override NEAR_PARTS: u32 = 4u;
// Parts that a ray looks at, on the ways to all lights from all of its places; from there on nodes have the last
// word.
override MOST_NEAR_TURNS: u32 = 0xffffffffu;
var<private> near_turns: u32;
// Optical depth behind which nothing is seen of a light.
const OPAQUE = 20.0;
// Smaller changes of s are lost in rounding.
const LEAST_CHANGE = 1e-5;

// Of the ray caster's table of lights; `w_i` as `incident_light` has it. Matter in between is looked at
// where it is wanted, and where light comes as far as that. (Not by a branch: see `ray_cast`.)
fn transmittance_from(light: u32, x: vec3f, w_i: vec3f, is_wanted: bool) -> f32 {
    let ray = Ray(x, w_i);
    var end = select(0.0, field.near, near_turns < MOST_NEAR_TURNS);
    if LIGHTS_WITH_A_PLACE {
        if lights[light].kind != 0u { end = min(end, length(lights[light].position - x)); }
    }
    end = max(min(end, box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y), 0.0);
    var kept = vec2f(0.0, end);
    if field.clip_blocks == 0u { kept = clip_interval(ray, kept); }
    kept.y = max(kept.x, kept.y);
    let share = share_of(lights[light].slot, x + end * w_i);
    if !is_wanted || share <= 0.0 { kept.y = kept.x; }
    return exp(-depth_between(ray, kept)) * share;
}

// Optical depth of a way of a few voxels.
fn depth_between(ray: Ray, way: vec2f) -> f32 {
    var depth = 0.0;
    if NEAR_PARTS == 0u { return depth; }
    if FILTER == 2u {
        let grid = grid_of(ray);
        var cell = cell_at(grid, way.x);
        var t = way.x;
        for (var i = 0u; i < NEAR_PARTS && t < way.y && depth < OPAQUE; i++) {
            // Two loops in it look for the piece of the transfer function.
            near_turns += 3u;
            let s = s_of_texel(voxel_of(grid, cell));
            let leave = leaves_at(grid, cell);
            let end = clamp(smallest(leave), t, way.y);
            let at = field_point(t, s);
            let part = first_part(at, at);
            depth += part.sigma_t.x * (end - t);
            cell += axis_of_smallest(leave);
            t = end;
        }
        return depth;
    }
    let length = (way.y - way.x) / f32(NEAR_PARTS);
    var near = summed_to(s_of_texel(texel_value(uvw_at(ray, way.x))));
    for (var i = 1u; i <= NEAR_PARTS && length > 0.0 && depth < OPAQUE; i++) {
        near_turns++;
        let far = summed_to(s_of_texel(texel_value(uvw_at(ray, way.x + f32(i) * length))));
        depth += mean_extinction(near, far) * length;
        near = far;
    }
    return depth;
}

// What extinction integrates to over s from 0 up to s: the sum of two floats and of what lies in the cell.
struct Summed {
    s: f32,
    to_cell: vec2f,
    in_cell: f32,
    // At s.
    sigma_t: f32,
}

fn summed_to(s: f32) -> Summed {
    let cell = min(floor(s * TF_CELLS), TF_CELLS - 1.0);
    let line = textureLoad(tf_cells, vec2u(u32(cell), 0u), 0);
    let sum = textureLoad(tf_cells, vec2u(u32(cell), 1u), 0);
    let rest = textureLoad(tf_cells, vec2u(u32(cell), 2u), 0);
    // Before the first point in the cell, or from there on.
    let is_before = s < sum.z;
    let from_line = s - select(sum.z, cell / TF_CELLS, is_before);
    let at_line = select(rest.xyz, vec3f(line.xy, 0.0), is_before);
    let sigma_t = max(at_line.x + at_line.y * from_line, 0.0);
    return Summed(s, sum.xy, at_line.z + 0.5 * (at_line.x + sigma_t) * from_line, sigma_t);
}

// Of a way on which s is linear: exact, whatever points of the transfer function it crosses.
fn mean_extinction(near: Summed, far: Summed) -> f32 {
    let change = far.s - near.s;
    let sums = (far.to_cell.x - near.to_cell.x) + ((far.to_cell.y - near.to_cell.y) + (far.in_cell - near.in_cell));
    return select(max(sums / change, 0.0), 0.5 * (near.sigma_t + far.sigma_t), abs(change) < LEAST_CHANGE);
}
