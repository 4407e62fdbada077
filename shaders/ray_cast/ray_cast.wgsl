// Ray caster: L = T * background + integral of T * (sigma_s L_i + sigma_a L_e) dt.
//
// A ray is led from cell to cell of the field (cells.wgsl); which cells it meets depends on camera and
// volume alone, never on the transfer function. In a cell the field along the ray is a cubic
// polynomial. It is cut into parts in which it hardly bends, and each is taken as linear; where it
// crosses control points of the transfer function a part is split, and within each piece extinction
// is integrated exactly: alpha = 1 - exp(-(sigma_a + sigma_b) / 2 * length). Steps of the transfer
// function, thin peaks and homogeneous matter are therefore exact for a linear field.
// Skipping drops only cells within macrocells whose bins hold no matter: their extinction is exactly
// zero and the image does not change by a bit.

@group(0) @binding(5) var<storage, read_write> film: array<vec4f>;
// Pairs of low and high words: cells (steps, where there is no matter in light) looked at, skipped, on
// the ray; parts with matter;
// view-ray segments kept, cast. Behind them, where light is gathered at parts, words of photon_map/gather.wgsl.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;

// What a pixel shows.
override MODE: u32 = 0u;
const VOLUME = 0u;
const MAXIMUM = 1u;
const MINIMUM = 2u;
const AVERAGE = 3u;
const ISOSURFACE = 4u;
const SLICE = 5u;

const COUNTERS = 6u;
const MOST_PARTS = 14u;
var<workgroup> group_counts: array<atomic<u32>, COUNTERS>;

@compute @workgroup_size(8, 8)
fn ray_cast(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    let id = pixel_of_lane(group.xy, lane);
    // taken, skipped, on the lattice, with matter
    var counts = vec4u(0u);
    // Invocations beyond the edge march the last pixel's ray and drop the result: a loop that no
    // lane of a vector takes part in runs to its bound on Mesa 22's software device.
    let inside = id.x < frame.image.x && id.y < frame.row_count;
    let column = min(id.x, frame.image.x - 1u);
    let pixel = vec2u(column, frame.first_row + min(id.y, frame.row_count - 1u));
    let index = pixel.y * frame.image.x + pixel.x;
    if GATHER {
        part_place = place_of_pixel(pixel);
        writes_parts = inside;
    }
    let radiance = seen(camera_ray(vec2f(pixel) + frame.subpixel), index, inside, &counts);
    if GATHER {
        if inside {
            seen_parts[part_place].count = min(max(parts_met, frame.first_part) - frame.first_part, PARTS);
            atomicMax(&counters[MOST_PARTS], parts_met);
        }
    }
    // Rays are cast again for the parts behind the first ones, and nothing else.
    let is_first_time = !GATHER || steering(frame.first_part) == 0u;
    if inside && is_first_time {
        if steering(frame.sample_index) == 0u {
            film[index] = vec4f(radiance, 1.0);
        } else {
            film[index] += vec4f(radiance, 1.0);
        }
    } else {
        counts = vec4u(0u);
        segment_counts = vec2u(0u);
    }
    for (var i = 0u; i < 4u; i++) {
        atomicAdd(&group_counts[i], counts[i]);
    }
    if KEEP_SEGMENTS {
        atomicAdd(&group_counts[4], segment_counts.x);
        atomicAdd(&group_counts[5], segment_counts.y);
    }
    workgroupBarrier();
    if lane < COUNTERS {
        add_to_counter(lane, atomicLoad(&group_counts[lane]));
    }
}

// 64-bit sum in two words.
fn add_to_counter(counter: u32, amount: u32) {
    let before = atomicAdd(&counters[2u * counter], amount);
    if before + amount < before {
        atomicAdd(&counters[2u * counter + 1u], 1u);
    }
}

// `keep`: whether what is found out about the pixel may be written down.
fn seen(eye_ray: Ray, pixel_index: u32, keep: bool, counts: ptr<function, vec4u>) -> vec3f {
    let way = way_of(eye_ray);
    if !way.meets { return seen_behind(eye_ray.direction); }
    if MODE == VOLUME {
        (*counts).z += u32(cells_between(grid_of(way.ray), way.kept.x, way.kept.y));
        if KEEP_SEGMENTS { return through_segments(way, pixel_index, keep, counts); }
        let all = integrate(way, way.kept.x, way.kept.y, counts);
        return all.xyz + select(all.w, 0.0, all.w < frame.termination) * seen_behind(eye_ray.direction);
    }
    (*counts).z += u32(max(way.end - way.first, 0.0));
    if MODE == ISOSURFACE { return isosurface(way, counts); }
    return values(way, counts);
}

// Radiance from one distance to another, and the transmittance between them. Summed up segment by
// segment (segments.wgsl), so that whole rays and kept segments add the same numbers in the same
// order.
fn integrate(way: Way, from_t: f32, to_t: f32, counts: ptr<function, vec4u>) -> vec4f {
    let ray = way.ray;
    let w_o = -ray.direction;
    let grid = grid_of(ray);
    // Of the segments before, and of this one.
    var radiance_before = vec3f(0.0);
    var transmittance_before = 1.0;
    var radiance = vec3f(0.0);
    var transmittance = 1.0;
    var segment = segment_at(way, from_t);
    var march = March();
    march.cell = cell_at(grid, from_t);
    march.t = from_t;
    march.floor_t = from_t;
    // Two loops, because the software device executes all branches of a loop for all lanes: the
    // inner one is short.
    while march.t < to_t {
        while march.t < to_t && !march.has_found {
            visit_cell(way, grid, to_t, &march, counts);
        }
        let t = march.found_t;
        if march.has_found && march.segment != segment {
            radiance_before += transmittance_before * radiance;
            transmittance_before *= transmittance;
            radiance = vec3f(0.0);
            transmittance = 1.0;
            segment = march.segment;
            if transmittance_before < frame.termination { break; }
        }
        var cubic = vec4f(frame.s_scale * march.corners.near.x + frame.s_offset, 0.0, 0.0, 0.0);
        if FILTER != 2u { cubic = cubic_along(grid, march.found, march.corners, t.x, t.y); }
        let most_bend = select(MOST_BEND, MOST_BEND_OF_SURFACES, SURFACES);
        let by_bend = min(ceil(sqrt(bend_of(cubic) / most_bend)), MOST_PARTS_BY_BEND);
        var parts = max(max(by_bend, ceil((t.y - t.x) / frame.step_world)), 1.0);
        // The next part, whose end is `far`; what is left of it begins at `near`.
        var near = field_point(t.x, s_on(cubic, 0.0));
        if DIRECT {
            // Light gets no deeper into matter than sight: where both fade, parts are short.
            let densest = max(near.extinction.sigma_t, table_entry(s_on(cubic, 1.0)).sigma_t);
            parts = max(parts, min(ceil(densest * (t.y - t.x) / MOST_DEPTH_OF_A_PART), MOST_PARTS_BY_DEPTH));
        }
        var next = select(parts + 1.0, 1.0, march.has_found);
        march.has_found = false;
        while next <= parts {
            let u = next / parts;
            let part = first_part(near, field_point(mix(t.x, t.y, u), s_on(cubic, u)));
            let optical_depth = 0.5 * (part.sigma_t.x + part.sigma_t.y) * (part.end.t - near.t);
            next += select(0.0, 1.0, part.ends_step);
            if optical_depth > 0.0 {
                (*counts).w += 1u;
                let through = exp(-optical_depth);
                let weight = centre_of_light(part.sigma_t, optical_depth);
                let x = ray.origin + mix(near.t, part.end.t, weight) * ray.direction;
                let place = place_in(part.piece, mix(near.s, part.end.s, weight));
                let albedo = albedo_at(place);
                let material = materials[place.material];
                var gradient = vec3f(0.0);
                if SURFACES || SKINS {
                    if material.surface > 0.0 || SKINS { gradient = gradient_at(x / frame.size_world + 0.5); }
                }
                var source = vec3f(0.0);
                if FIELD_BANDS > 0u && !GATHER { source = scattered_from_field(x, w_o, albedo, material, gradient, max(part.sigma_t.x, part.sigma_t.y)); }
                var at_a_slant = vec3f(1.0);
                if SKINS { at_a_slant = seen_at_a_slant(w_o, albedo, material, gradient, max(part.sigma_t.x, part.sigma_t.y)); }
                if GATHER {
                    let weight = transmittance_before * transmittance * (1.0 - through);
                    write_part(x, w_o, albedo, place.material, gradient, weight * at_a_slant);
                }
                source *= at_a_slant;
                if FIELD_BANDS == 0u || DIRECT { source += scattered_radiance(x, w_o, albedo, material, gradient); }
                if EMISSION { source += (1.0 - albedo) * emission_at(place); }
                radiance += transmittance * (1.0 - through) * source;
                transmittance *= through;
                if transmittance < frame.termination {
                    // Nothing behind it is seen.
                    next = parts + 1.0;
                    march.t = to_t;
                }
            }
            near = part.end;
        }
    }
    radiance_before += transmittance_before * radiance;
    return vec4f(radiance_before, transmittance_before * transmittance);
}

// Whether light is gathered at parts of rays, when these are cast, instead of looked up.
override GATHER: bool = false;
// Of the pixel's parts: where the first is written, if any are, and how many were met.
var<private> part_place: u32;
var<private> writes_parts: bool;
var<private> parts_met: u32;

fn write_part(x: vec3f, w_o: vec3f, albedo: vec3f, material: u32, gradient: vec3f, weight: vec3f) {
    let i = parts_met - frame.first_part;
    if writes_parts && parts_met >= frame.first_part && i < PARTS {
        let facing = surface_facing(w_o, materials[material], gradient);
        let slot = i * frame.image.x * frame.row_count + part_place;
        seen_parts[slot] = SeenPart(x, material, albedo, facing.w, facing.xyz, 0u, weight, 0u, vec3f(0.0), 0u);
    }
    parts_met++;
}

// Where a ray has got to.
struct March {
    // The cell to be looked at next; the ray has got to t.
    cell: vec3f,
    t: f32,
    // Before it lies what is not this cell's: where the ray or the segment begins.
    floor_t: f32,
    // The last cell that was looked at, what of it lies within one segment, and whether it may hold
    // matter that has not been seen yet.
    found: vec3f,
    found_t: vec2f,
    corners: Corners,
    segment: u32,
    has_found: bool,
}

// Looks at the next cell, or at the one at the far border of an empty block.
fn visit_cell(way: Way, grid: Grid, to_t: f32, march: ptr<function, March>, counts: ptr<function, vec4u>) {
    let floor_t = (*march).floor_t;
    var cell = (*march).cell;
    let empty_to = min(empty_until(grid, max(enters_at(grid, cell), floor_t)), to_t);
    if empty_to > smallest(leaves_at(grid, cell)) {
        let landing = max(cell_at(grid, empty_to), cell);
        (*counts).y += u32(dot(landing - cell, vec3f(1.0)));
        cell = landing;
    }
    let begin = max(enters_at(grid, cell), floor_t);
    let leave = leaves_at(grid, cell);
    // A cell is cut where a segment ends.
    let segment = segment_at(way, begin);
    let limit = min(segment_end(way, segment), to_t);
    let end = max(min(smallest(leave), limit), begin);
    (*counts).x += u32(begin > floor_t || floor_t == way.kept.x);
    (*march).t = end;
    (*march).found = cell;
    (*march).found_t = vec2f(begin, end);
    (*march).segment = segment;
    if smallest(leave) > limit { (*march).floor_t = limit; }
    (*march).cell = select(cell + axis_of_smallest(leave), cell, smallest(leave) > limit);
    var span = vec2f(0.0);
    if FILTER == 2u {
        let value = voxel_of(grid, cell);
        (*march).corners = Corners(vec4f(value), vec4f(value));
        span = vec2f(value);
    } else {
        let corners = corners_of(grid, cell);
        let low = min(corners.near, corners.far);
        let high = max(corners.near, corners.far);
        span = vec2f(min(min(low.x, low.y), min(low.z, low.w)), max(max(high.x, high.y), max(high.z, high.w)));
        (*march).corners = corners;
    }
    (*march).has_found = may_hold_matter(s_of_texel(span.x), s_of_texel(span.y)) && end > begin;
}
