// Transmittance along each record's rays, from the record to where light enters (eq. 7 without the
// phase function): exact for a linear field, like the ray caster's. Emission is collected on the way
// (section 4.5 of the paper).

// Distances to cells in which matter changed since the rays were cast.
@group(0) @binding(11) var changed_map: texture_3d<u32>;

// A ray this deep in matter is dark: a millionth of the light is left.
const DARK_DEPTH = 13.8;

const RAY_COUNTERS = 4u;
var<workgroup> group_counts: array<atomic<u32>, RAY_COUNTERS>;

@compute @workgroup_size(64)
fn march_records(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    // Lanes without a ray of their own walk the last one's, an empty way: a loop that no lane of a
    // vector takes part in runs to its bound on Mesa 22's software device.
    let index = 64u * group.x + lane;
    let inside = index < steering(records.count);
    let entry = entries[records.first + min(index, records.count - 1u)];
    let column = group.y;
    let x = position_of_record(cell_of_record(entry.y));
    let todo = columns[column];
    var direction = todo.xyz;
    var end = 1e30;
    if column >= records.directions {
        let light = lights[column - records.directions];
        if light.kind != 0u {
            let to_light = light.position - x;
            let squared = max(dot(to_light, to_light), NEAREST_SQUARED);
            direction = to_light * inverseSqrt(squared);
            end = sqrt(squared);
            // In the light itself there is no direction towards it.
            if dot(to_light, to_light) < NEAREST_SQUARED { direction = vec3f(0.0, 0.0, 1.0); end = 0.0; }
        }
    }
    let ray = Ray(x, direction);
    end = min(end, box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y);
    let kept = clip_interval(ray, vec2f(0.0, end));
    let alive = inside && (entry.y & LEFT) == 0u;
    let from_t = min(kept.x, kept.y);
    let test_to = select(from_t, kept.y, alive && todo.w == TEST);
    let is_cast = alive && (todo.w == CAST || meets_change(ray, from_t, test_to));
    var counts = vec4u(u32(is_cast), u32(alive && !is_cast), 0u, 0u);
    let found = arriving(ray, from_t, select(from_t, kept.y, is_cast), &counts);
    if is_cast {
        rays[ray_slot(0u, column, entry.x)] = found.w;
        if GLOW {
            rays[ray_slot(1u, column, entry.x)] = found.x;
            rays[ray_slot(2u, column, entry.x)] = found.y;
            rays[ray_slot(3u, column, entry.x)] = found.z;
        }
        atomicStore(&renewed[entry.x], 1u);
    }
    for (var i = 0u; i < RAY_COUNTERS; i++) {
        atomicAdd(&group_counts[i], counts[i]);
    }
    workgroupBarrier();
    if lane < RAY_COUNTERS {
        add_to_record_counter(lane, atomicLoad(&group_counts[lane]));
    }
}

// Whether the way meets a cell in which matter changed.
fn meets_change(ray: Ray, from_t: f32, to_t: f32) -> bool {
    let grid = grid_of(ray);
    var t = from_t;
    var met = false;
    while t < to_t && !met {
        let clear_to = clear_until(changed_map, grid, t);
        met = clear_to <= t;
        t = clear_to;
    }
    return met;
}

// What arrives at the beginning of a way from matter on it, and the transmittance to its end.
fn arriving(ray: Ray, from_t: f32, to_t: f32, counts: ptr<function, vec4u>) -> vec4f {
    let grid = grid_of(ray);
    var cell = cell_at(grid, from_t);
    var t = from_t;
    var optical_depth = 0.0;
    var radiance = vec3f(0.0);
    // Two loops, as in `integrate` of the ray caster: the inner one leaps and reads voxels until there
    // may be matter.
    while t < to_t {
        var found = false;
        var found_cell = cell;
        var way = vec2f(t);
        var corners = Corners(vec4f(0.0), vec4f(0.0));
        while t < to_t && !found {
            let empty_to = min(empty_until(grid, max(enters_at(grid, cell), from_t)), to_t);
            if empty_to > smallest(leaves_at(grid, cell)) {
                let landing = max(cell_at(grid, empty_to), cell);
                (*counts).w += u32(dot(landing - cell, vec3f(1.0)));
                cell = landing;
            }
            let begin = max(enters_at(grid, cell), from_t);
            let leave = leaves_at(grid, cell);
            t = max(min(smallest(leave), to_t), begin);
            way = vec2f(begin, t);
            found_cell = cell;
            cell += axis_of_smallest(leave);
            (*counts).z += 1u;
            var span = vec2f(0.0);
            if FILTER == 2u {
                let value = voxel_of(grid, found_cell);
                corners = Corners(vec4f(value), vec4f(value));
                span = vec2f(value);
            } else {
                corners = corners_of(grid, found_cell);
                let low = min(corners.near, corners.far);
                let high = max(corners.near, corners.far);
                span = vec2f(min(min(low.x, low.y), min(low.z, low.w)), max(max(high.x, high.y), max(high.z, high.w)));
            }
            found = may_hold_matter(s_of_texel(span.x), s_of_texel(span.y)) && t > begin;
        }
        var cubic = vec4f(frame.s_scale * corners.near.x + frame.s_offset, 0.0, 0.0, 0.0);
        if FILTER != 2u { cubic = cubic_along(grid, found_cell, corners, way.x, way.y); }
        let parts = clamp(ceil(sqrt(bend_of(cubic) / MOST_BEND)), 1.0, MOST_PARTS_BY_BEND);
        var next = select(parts + 1.0, 1.0, found);
        var near = field_point(way.x, s_on(cubic, 0.0));
        while next <= parts {
            let u = next / parts;
            let part = first_part(near, field_point(mix(way.x, way.y, u), s_on(cubic, u)));
            let depth = 0.5 * (part.sigma_t.x + part.sigma_t.y) * (part.end.t - near.t);
            next += select(0.0, 1.0, part.ends_step);
            if GLOW {
                if depth > 0.0 {
                    let weight = centre_of_light(part.sigma_t, depth);
                    let place = place_in(part.piece, mix(near.s, part.end.s, weight));
                    radiance += exp(-optical_depth) * (1.0 - exp(-depth)) * (1.0 - albedo_at(place)) * emission_at(place);
                }
            }
            optical_depth += max(depth, 0.0);
            near = part.end;
        }
        // Behind it nothing matters.
        if optical_depth > DARK_DEPTH { t = to_t; }
    }
    return vec4f(radiance, select(exp(-optical_depth), 0.0, optical_depth > DARK_DEPTH));
}
