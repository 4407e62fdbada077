// Light that has not been scattered yet (eq. 2 of the paper), from one direction at a time for all basis
// functions that shine from there. Beams of equal width, side by side, cross the box; what each loses in
// a part of its way falls to the eight texels around the middle of the loss, as a photon's share does:
// light and extinction have the same footprint, however opaque matter is.

// Of each direction.
@group(0) @binding(22) var<storage, read> beams: array<Beams>;
// Row of each texel; NO_ROW without one.
@group(0) @binding(28) var<storage, read> texel_rows: array<u32>;
// Of each row what fell to it, in units of `transfer.unit`.
@group(0) @binding(24) var<storage, read_write> fallen: array<atomic<u32>>;

const NO_ROW = 0xffffffffu;
// A beam this deep in matter is dark: a millionth of it is left.
const DARK_DEPTH = 13.8;
// Longest part of a way that falls to one place, texels.
const MOST_PART = 0.5;

struct Beams {
    // Towards the light.
    towards: vec3f,
    // Along each edge of the square of beams.
    edge: u32,
    // From one beam to the next, world units.
    across: vec3f,
    pad0: f32,
    down: vec3f,
    pad1: f32,
    // Of the first beam, outside of the box.
    origin: vec3f,
    pad2: f32,
}

@compute @workgroup_size(64)
fn march_transfer(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    always_zero = id.z;
    let index = id.y * groups.x * 64u + id.x;
    let way = -beams[transfer.direction].towards;
    let edge = steering(beams[transfer.direction].edge);
    // Lanes without a beam walk an empty way: see `march_records`.
    let inside = index < edge * edge;
    let start = beams[transfer.direction].origin + f32(index % edge) * beams[transfer.direction].across
        + f32(index / edge) * beams[transfer.direction].down;
    let enter = max(box_interval(Ray(start, way), -0.5 * frame.size_world, 0.5 * frame.size_world).x, 0.0);
    // From the box on, so that the way there costs no precision.
    let ray = Ray(start + enter * way, way);
    let whole = vec2f(0.0, box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y);
    let kept = clip_interval(ray, whole);
    let blocks = clipped_matter_blocks();
    let from_t = select(max(kept.x, 0.0), 0.0, blocks);
    let to_t = select(kept.y, whole.y, blocks);
    fall(ray, from_t, select(from_t, to_t, inside && to_t > from_t));
}

fn clipped_matter_blocks() -> bool {
    return steering(transfer.clip_shadows) == 1u;
}

// A beam's way, from cell to cell, like the ray caster's.
fn fall(ray: Ray, from_t: f32, to_t: f32) {
    let grid = grid_of(ray);
    let texel_length = min(frame.size_world.x / f32(transfer.dims.x),
        min(frame.size_world.y / f32(transfer.dims.y), frame.size_world.z / f32(transfer.dims.z)));
    var cell = cell_at(grid, from_t);
    var t = from_t;
    var transmittance = 1.0;
    var optical_depth = 0.0;
    // Two loops, as in `integrate` of the ray caster: the inner one leaps and reads voxels until there
    // may be matter.
    while t < to_t {
        var found = false;
        var found_cell = cell;
        var way = vec2f(t);
        var corners = Corners(vec4f(0.0), vec4f(0.0));
        while t < to_t && !found {
            let empty_to = min(empty_until(grid, max(enters_at(grid, cell), from_t)), to_t);
            if empty_to > smallest(leaves_at(grid, cell)) { cell = max(cell_at(grid, empty_to), cell); }
            let begin = max(enters_at(grid, cell), from_t);
            let leave = leaves_at(grid, cell);
            t = max(min(smallest(leave), to_t), begin);
            way = vec2f(begin, t);
            found_cell = cell;
            cell += axis_of_smallest(leave);
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
        let by_bend = ceil(sqrt(bend_of(cubic) / MOST_BEND));
        let by_length = ceil((way.y - way.x) / (MOST_PART * texel_length));
        let parts = clamp(max(by_bend, by_length), 1.0, MOST_PARTS_BY_BEND);
        var next = select(parts + 1.0, 1.0, found);
        var near = field_point(way.x, s_on(cubic, 0.0));
        while next <= parts {
            let u = next / parts;
            let part = first_part(near, field_point(mix(way.x, way.y, u), s_on(cubic, u)));
            let depth = max(0.5 * (part.sigma_t.x + part.sigma_t.y) * (part.end.t - near.t), 0.0);
            next += select(0.0, 1.0, part.ends_step);
            let left = exp(-depth);
            let middle = mix(near.t, part.end.t, centre_of_light(part.sigma_t, max(depth, 1e-6)));
            share_out(ray.origin + middle * ray.direction, transmittance * (1.0 - left));
            transmittance *= left;
            optical_depth += depth;
            near = part.end;
        }
        if optical_depth > DARK_DEPTH { t = to_t; }
    }
}

fn share_out(x: vec3f, lost: f32) {
    let dims = vec3f(transfer.dims);
    let place = clamp(x / frame.size_world + 0.5, vec3f(0.0), vec3f(1.0)) * dims - 0.5;
    let low = floor(place);
    let part = place - low;
    let corners = select(0u, 8u, lost > 0.0 && keeps(x));
    for (var corner = 0u; corner < corners; corner++) {
        let upper = vec3u(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let texel_place = vec3u(clamp(low + vec3f(upper), vec3f(0.0), dims - 1.0));
        let near = select(1.0 - part, part, upper == vec3u(1u));
        let row = texel_rows[(texel_place.z * transfer.dims.y + texel_place.y) * transfer.dims.x + texel_place.x];
        let amount = u32(round(lost * near.x * near.y * near.z / transfer.unit));
        if row != NO_ROW { atomicAdd(&fallen[row], amount); }
    }
}
