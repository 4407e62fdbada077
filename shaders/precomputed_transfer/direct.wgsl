// Light that has not been scattered yet (eq. 2 of the paper), from one direction at a time for all basis
// functions that shine from there. Beams of equal width, side by side, cross the box; what each loses in
// a part of its way falls to the eight texels around the middle of the loss, as a photon's share does:
// light and extinction have the same footprint, however opaque matter is. Sums are whole numbers, so what a
// beam lost in matter as it was can be taken away again.

// Of each direction.
@group(0) @binding(22) var<storage, read> beams: array<Beams>;
// Bounds of the extinction in macrocells (shared/tracking.wgsl).
@group(0) @binding(13) var bounds: texture_3d<u32>;
// Row of each texel; NO_ROW without one.
@group(0) @binding(28) var<storage, read> texel_rows: array<u32>;
// Of each direction what fell to each row, in units of `transfer.unit`.
@group(0) @binding(24) var<storage, read_write> fallen: array<atomic<u32>>;
// Beams to be marched if `transfer.listed`: direction and place in its square; and how they get there.
@group(0) @binding(33) var<storage, read> list: array<u32>;
@group(0) @binding(34) var<storage, read_write> listed: array<u32>;
@group(0) @binding(6) var<storage, read_write> listed_count: array<atomic<u32>>;

const NO_ROW = 0xffffffffu;
// A beam this deep in matter is dark: a millionth of it is left.
const DARK_DEPTH = 13.8;
// Longest part of a way that falls to one place, texels.
const MOST_PART = 0.5;
// Bits of a beam's place in the list; above them is its direction.
const PLACE_BITS = 20u;
// So far before matter that changed losses are the same as they were, voxels.
const CHANGE_MARGIN = 2.0;

// How far off it is looked at from, in texels; and through how many ways of the sphere, of a flat skin, by
// their cosines to it: as photon_map/seen.wgsl has it, which counts matter and photons.
const REACH_TEXELS = 1.3333333;
const COSINES = vec3f(1.0, 0.70710678, 0.57735027);
const WAYS_OUT = vec3f(0.0457779, 0.1479224, 0.1407824);
// Nothing is seen through so much, and products with it are finite.
const DEEP = 1e4;
// Optical depth over that distance, by the bound of the macrocell, from which on it makes a difference.
const SEEN_FROM = 0.5;

// The direction that the invocation's beam comes from, and from where on its losses count.
var<private> direction: u32;
var<private> counted_from: f32;

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

// A beam's way, and the part of it that may lie in matter.
struct BeamWay {
    ray: Ray,
    from_t: f32,
    // Not beyond `from_t` where there is no such part.
    to_t: f32,
}

fn beam_way(from_direction: u32, index: u32) -> BeamWay {
    let way = -beams[from_direction].towards;
    let edge = steering(beams[from_direction].edge);
    let start = beams[from_direction].origin + f32(index % edge) * beams[from_direction].across
        + f32(index / edge) * beams[from_direction].down;
    let enter = max(box_interval(Ray(start, way), -0.5 * frame.size_world, 0.5 * frame.size_world).x, 0.0);
    // From the box on, so that the way there costs no precision.
    let ray = Ray(start + enter * way, way);
    let whole = vec2f(0.0, box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y);
    let kept = clip_interval(ray, whole);
    let blocks = clipped_matter_blocks();
    let from_t = select(max(kept.x, 0.0), 0.0, blocks);
    return BeamWay(ray, from_t, max(select(kept.y, whole.y, blocks), from_t));
}

@compute @workgroup_size(64)
fn march_transfer(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    always_zero = id.z;
    var index = id.y * groups.x * 64u + id.x;
    // Lanes without a beam walk an empty way: see `march_records`.
    let inside = index < transfer.count;
    direction = transfer.direction;
    let is_listed = transfer.listed == 1u;
    if is_listed {
        let beam = list[min(index, transfer.count - 1u)];
        direction = beam >> PLACE_BITS;
        index = beam & ((1u << PLACE_BITS) - 1u);
    }
    let way = beam_way(direction, index);
    let to_t = select(way.from_t, way.to_t, inside);
    let voxel = frame.size_world / frame.voxels;
    let margin = CHANGE_MARGIN * max(voxel.x, max(voxel.y, voxel.z));
    counted_from = first_change(way.ray, way.from_t, select(way.from_t, to_t, is_listed)) - margin;
    fall(way.ray, way.from_t, to_t);
}

// Lists beams of `transfer.tests` directions, from `transfer.direction` on, on whose ways matter changed.
@compute @workgroup_size(64)
fn list_beams(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    always_zero = id.z;
    let index = id.y * groups.x * 64u + id.x;
    let all = beams[transfer.direction].edge * beams[transfer.direction].edge;
    let from_direction = transfer.direction + min(index / all, transfer.tests - 1u);
    let way = beam_way(from_direction, index % all);
    let to_t = select(way.from_t, way.to_t, index < all * transfer.tests);
    if first_change(way.ray, way.from_t, to_t) < to_t {
        listed[atomicAdd(&listed_count[0], 1u)] = (from_direction << PLACE_BITS) | (index % all);
    }
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
    // Of what the beam has just passed, up to there: a depth that fades over the reach.
    var above = 0.0;
    var passed_t = from_t;
    // To the normal of the skin that it came through last.
    var cosine = 1.0;
    let texel = frame.size_world / vec3f(transfer.dims);
    let reach = REACH_TEXELS * (texel.x + texel.y + texel.z) / 3.0;
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
        let middle_of_cell = ray.origin + 0.5 * (way.x + way.y) * ray.direction;
        let may_hide = known_bound(middle_of_cell) * reach > SEEN_FROM;
        let cosine_here = skin_cosine(ray.direction, middle_of_cell, cosine);
        var next = select(parts + 1.0, 1.0, found);
        var near = field_point(way.x, s_on(cubic, 0.0));
        while next <= parts {
            let u = next / parts;
            let part = first_part(near, field_point(mix(way.x, way.y, u), s_on(cubic, u)));
            let depth = max(0.5 * (part.sigma_t.x + part.sigma_t.y) * (part.end.t - near.t), 0.0);
            next += select(0.0, 1.0, part.ends_step);
            let left = exp(-depth);
            let middle = mix(near.t, part.end.t, centre_of_light(part.sigma_t, max(depth, 1e-6)));
            let lost = transmittance * (1.0 - left);
            let x = ray.origin + middle * ray.direction;
            // Parts without matter change nothing, for some are leapt over.
            if depth > 0.0 {
                cosine = cosine_here;
                above *= exp((passed_t - near.t) / reach);
                let sigma_t = 0.5 * (part.sigma_t.x + part.sigma_t.y);
                let seen = select(1.0, seen_of_loss(cosine, above, depth, sigma_t * reach), may_hide);
                share_out(x, select(0.0, lost * seen, middle >= counted_from));
                above = min(above + depth, DEEP) * exp((near.t - part.end.t) / reach);
                passed_t = part.end.t;
            }
            transmittance *= left;
            optical_depth += depth;
            near = part.end;
        }
        if optical_depth > DARK_DEPTH { t = to_t; }
    }
}

// Bound of the extinction around a place.
fn known_bound(x: vec3f) -> f32 {
    let place = vec3i(floor((x / frame.size_world + 0.5) * frame.voxels / MACROCELL_EDGE));
    return bitcast<f32>(textureLoad(bounds, clamp(place, vec3i(0), vec3i(textureDimensions(bounds)) - 1), 0).x);
}

// Cosine of a beam to the skin's normal, `before` where there is none: behind a skin the field is even.
fn skin_cosine(direction: vec3f, x: vec3f, before: f32) -> f32 {
    let gradient = gradient_at(x / frame.size_world + 0.5);
    // Of a window of no width gradients have no length.
    let largest = max(abs(gradient.x), max(abs(gradient.y), abs(gradient.z)));
    let has_length = largest > 1e-30 && largest < 1e30;
    let n = gradient / select(1.0, largest, has_length);
    return select(before, min(abs(dot(n, direction)) / length(n), 1.0), has_length);
}

// How much of what is lost in a part of the beam's way is seen from a way off, in a skin that is flat there:
// on average over where it is lost, and over ways. Ways out of it are as deep as the beam's, by the cosines of
// both; others are as deep as matter is dense. `above`: optical depth of what lies above the skin; `within_reach`:
// that of the part's matter all the way.
fn seen_of_loss(cosine: f32, above: f32, depth: f32, within_reach: f32) -> f32 {
    let deeper = cosine / COSINES;
    let lost = max(1.0 - exp(-min(depth, DEEP)), 1e-20);
    let out = exp(-above * deeper) * (1.0 - exp(-min(depth, DEEP) * (1.0 + deeper))) / ((1.0 + deeper) * lost);
    let others = 1.0 - dot(WAYS_OUT, vec3f(1.0));
    return dot(WAYS_OUT, out) + others * exp(-within_reach);
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
        // Whole numbers wrap round: adding -1 times an amount takes it away.
        let change = select(amount, ~amount + 1u, transfer.sign < 0);
        if row != NO_ROW { atomicAdd(&fallen[direction * transfer.rows + row], change); }
    }
}
