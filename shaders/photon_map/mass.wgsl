// How much extinction there is around the texels of the field: what photons' interactions are compared
// with. Between eight texel centres extinction is added up with their trilinear weights, which are the
// shares of `deposit`: the quotient of the two is fluence, wherever matter begins and ends.

// Cells between texel centres, one more than texels along each axis: of each eight sums of what counts, as their
// bits, and for each of them the sum of all extinction, or, if it is `FACED`, the mean direction that it is seen
// from, in 127ths of 1 (x, y, z). Behind them, if they are `PLACES_KEPT`, what counts of the extinction at each
// place of the lattice.
@group(0) @binding(14) var<storage, read_write> moments: array<u32>;
// Blocks of 2^3 cells to be added up.
@group(0) @binding(15) var<storage, read> blocks: array<u32>;
@group(0) @binding(13) var<uniform> mass: Mass;
@group(0) @binding(9) var macrocells: texture_3d<u32>;

struct Mass {
    // Texels of the field.
    dims: vec3u,
    // Blocks to be added up.
    count: u32,
}

// Whether it is told where matter is seen from.
override FACED: bool = false;
// Whether places are kept one by one, too; not if it is `FACED`.
override PLACES_KEPT: bool = false;
// Cells along an axis of a block, and its places; with what they are looked at through.
const CELLS = 2u;
const INNER = CELLS * PLACES;
const OUTER = INNER + 2u * REACH;
const INNER_PLACES = INNER * INNER * INNER;
const OUTER_PLACES = OUTER * OUTER * OUTER;
const LANES = 64u;

// Extinction at the block's places and around them; below 0: of what may be hidden.
var<workgroup> extinction: array<f32, OUTER_PLACES>;
// What counts of it (w), and as much times where it is seen from.
var<workgroup> counted: array<vec4f, INNER_PLACES>;
var<workgroup> any_dense: atomic<u32>;

@compute @workgroup_size(64)
fn add_up_mass(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    always_zero = group.z;
    let which = group.y * groups.x + group.x;
    let block_index = blocks[min(which, mass.count - 1u)];
    let across = (mass.dims + CELLS) / CELLS;
    let block = vec3u(block_index % across.x, block_index / across.x % across.y, block_index / (across.x * across.y));
    let first_cell = CELLS * block;
    let step = lattice_step(mass.dims);
    for (var i = lane; i < INNER_PLACES; i += LANES) {
        let place = vec3u(i % INNER, i / INNER % INNER, i / (INNER * INNER)) + REACH;
        let found = extinction_of(first_cell, place, step);
        extinction[index_of(place)] = found;
        if found < 0.0 { atomicStore(&any_dense, 1u); }
    }
    workgroupBarrier();
    let looks = atomicLoad(&any_dense) == 1u;
    for (var i = select(OUTER_PLACES, lane, looks); i < OUTER_PLACES; i += LANES) {
        let place = vec3u(i % OUTER, i / OUTER % OUTER, i / (OUTER * OUTER));
        let is_inner = all(place >= vec3u(REACH)) && all(place < vec3u(REACH + INNER));
        if !is_inner { extinction[i] = extinction_of(first_cell, place, step); }
    }
    workgroupBarrier();
    for (var i = lane; i < INNER_PLACES; i += LANES) {
        let place = vec3u(i % INNER, i / INNER % INNER, i / (INNER * INNER)) + REACH;
        let found = extinction[index_of(place)];
        counted[i] = vec4f(0.0, 0.0, 0.0, found);
        if found < 0.0 { counted[i] = seen_of(place, -found, step); }
    }
    workgroupBarrier();
    if PLACES_KEPT {
        let cells = mass.dims + 1u;
        let lattice = PLACES * cells;
        for (var i = lane; i < INNER_PLACES; i += LANES) {
            let place = PLACES * first_cell + vec3u(i % INNER, i / INNER % INNER, i / (INNER * INNER));
            if which < mass.count && all(place < lattice) {
                let index = (place.z * lattice.y + place.y) * lattice.x + place.x;
                moments[16u * cells.x * cells.y * cells.z + index] = bitcast<u32>(counted[i].w);
            }
        }
    }
    // Of eight cells eight sums.
    let cell_in_block = vec3u(lane >> 3u & 1u, lane >> 4u & 1u, lane >> 5u);
    let upper = vec3u(lane & 1u, lane >> 1u & 1u, lane >> 2u & 1u);
    var sum = vec4f(0.0);
    var all_of_it = 0.0;
    for (var i = 0u; i < PLACES * PLACES * PLACES; i++) {
        let place = vec3u(i % PLACES, i / PLACES % PLACES, i / (PLACES * PLACES));
        let part = (vec3f(place) + 0.5) / f32(PLACES);
        let near = select(1.0 - part, part, upper == vec3u(1u));
        let at = PLACES * cell_in_block + place;
        sum += counted[(at.z * INNER + at.y) * INNER + at.x] * (near.x * near.y * near.z);
        all_of_it += abs(extinction[index_of(at + REACH)]) * (near.x * near.y * near.z);
    }
    let cell = first_cell + cell_in_block;
    if which < mass.count && all(cell <= mass.dims) {
        let index = (cell.z * (mass.dims.y + 1u) + cell.y) * (mass.dims.x + 1u) + cell.x;
        let seen_from = sum.xyz / max(sum.w, 1e-30);
        let first = 16u * index + (lane & 7u);
        let volume = step.x * step.y * step.z;
        moments[first] = bitcast<u32>(sum.w * volume);
        moments[first + 8u] = select(bitcast<u32>(all_of_it * volume), pack4x8snorm(vec4f(seen_from, 0.0)), FACED);
    }
}

fn index_of(place: vec3u) -> u32 {
    return (place.z * OUTER + place.y) * OUTER + place.x;
}

// Extinction of a place of a block, from two points in it; cells at the border stick half out of the box.
// Opaque walls that are thinner than a place, but not than half of one, lie around one of the points.
fn extinction_of(first_cell: vec3u, place: vec3u, step: vec3f) -> f32 {
    let low = extinction_at(first_cell, vec3f(place) + 0.25);
    let high = extinction_at(first_cell, vec3f(place) + 0.75);
    let mean = 0.5 * (low.x + high.x);
    let most = max(low.x, high.x);
    let place_length = (step.x + step.y + step.z) / 3.0;
    let is_opaque = most * place_length > 1.0;
    let bound = max(low.y, high.y);
    return select(mean, -select(mean, most, is_opaque), bound * reach_of(step) > SEEN_FROM);
}

// Extinction at a point, and the bound of its macrocell.
fn extinction_at(first_cell: vec3u, place: vec3f) -> vec2f {
    let texels = vec3f(first_cell) - 0.5 + (place - f32(REACH)) / f32(PLACES);
    let uvw = texels / vec3f(mass.dims);
    let inside = all(uvw > vec3f(0.0)) && all(uvw < vec3f(1.0));
    if !inside || !keeps((uvw - 0.5) * frame.size_world) { return vec2f(0.0); }
    let bound = bound_at(macrocell_at(uvw));
    if bound <= 0.0 { return vec2f(0.0); }
    let s = s_of_texel(texel_value(uvw));
    return vec2f(sigma_t_in(piece_of(s, true), s), bound);
}

// Extinction at a place times what is left of its light some way off, on average over directions. Along
// each the extinction between two places is that of the first: so the place itself, however thick it is,
// is integrated, and so is a skin that is thinner than it. As `counted`.
fn seen_of(place: vec3u, sigma_t: f32, step: vec3f) -> vec4f {
    let reach = reach_of(step);
    var seen = vec4f(0.0);
    for (var way = 0u; way < 27u; way++) {
        let onward = vec3i(vec3u(way % 3u, way / 3u % 3u, way / 9u)) - 1;
        let kind = u32(dot(abs(onward), vec3i(1)));
        let length_of_step = length(vec3f(onward) * step);
        // From the middle of the place on.
        let steps = reach / max(length_of_step, 1e-30) - 0.5;
        var depth = 0.0;
        for (var i = 1; i <= i32(REACH); i++) {
            let part = clamp(steps - f32(i - 1), 0.0, 1.0);
            depth += abs(extinction[index_of(vec3u(vec3i(place) + i * onward))]) * length_of_step * part;
        }
        let own = sigma_t * length_of_step;
        // (1 - exp(-own)) / own, which is 1 for thin matter.
        let through = select((1.0 - exp(-own)) / own, 1.0 - 0.5 * own, own < 1e-3);
        let towards = vec3f(onward) * step / max(length_of_step, 1e-30);
        if kind > 0u { seen += SHARES[kind - 1u] * sigma_t * through * exp(-depth) * vec4f(towards, 1.0); }
    }
    return seen;
}
