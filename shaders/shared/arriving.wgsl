// Rays towards light: what arrives at their beginning. A module that casts them says whether matter glows
// (`GLOW`): then emission is collected on the way.

// A ray this deep in matter is dark: a millionth of the light is left.
const DARK_DEPTH = 13.8;

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
