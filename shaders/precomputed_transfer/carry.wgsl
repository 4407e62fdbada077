// Photons from the boundary of the volume (sections 6.3.1 and 6.3.2 of the paper), each followed once for
// all basis functions that shine from where it comes (README.md). Every interaction but the first is
// scattered light: its share in the eight texels around it is counted in whole numbers, so the order of
// photons makes no difference, and what a photon brought can be taken away again: it is followed once more
// through matter as it was.

// Pairs of low and high words: tentative collisions, cells looked up, interactions, 1024ths of throughput
// cut off; then one word: photons unfinished.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
// Row of each texel; NO_ROW without one.
@group(0) @binding(28) var<storage, read> texel_rows: array<u32>;
// As the matrices, `channels` planes of coefficients, in units of `transfer.unit`: of whole numbers of 64
// bits low words and high words.
@group(0) @binding(24) var<storage, read_write> low_words: array<atomic<u32>>;
@group(0) @binding(29) var<storage, read_write> high_words: array<atomic<u32>>;

// Bands of the field.
override BANDS: u32 = 1u;
// Whether red, green and blue differ.
override COLOURED: bool = false;

const FUNCTIONS = 8u;
const NO_ROW = 0xffffffffu;
const PHOTON_COUNTERS = 4u;
const CUT_UNIT = 1024.0;
// Shares beyond it are cut: below 2^31.
const MOST_SHARE = 2e9;
var<workgroup> group_counts: array<atomic<u32>, PHOTON_COUNTERS>;
var<workgroup> group_unfinished: atomic<u32>;

@compute @workgroup_size(64)
fn carry_photons(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    always_zero = id.z;
    let inside = id.x < transfer.count;
    let local = min(id.x, transfer.count - 1u);
    var path = paths[local];
    var blocks = vec2u(0u);
    // Values that are loaded here and used behind the loop crash the compiler of Mesa 22's software device;
    // this one is set in it.
    var is_at_work = false;
    if inside && path.stage != DONE {
        let met = histories[path.light];
        bins_met = met.xy;
        blocks = met.zw;
    }
    var interactions = 0u;
    var cut = 0.0;
    var rays = select(0u, steering(transfer.photon_rays), inside && path.stage != DONE);
    var steps = select(0u, steering(transfer.steps), rays > 0u);
    for (var i = 0u; i < rays; i++) {
        is_at_work = true;
        let photon = vec2u(path.light, KEY);
        if path.stage == AT { scatter_on(&path, photon); }
        if path.stage < AT { begin_ray(&path, photon); }
        let flies = path.stage == FLIGHT || path.stage == VIEW;
        let is_looked_at = path.stage == VIEW;
        var whole = max(box_interval(Ray(path.origin, path.direction), -0.5 * frame.size_world, 0.5 * frame.size_world), vec2f(0.0));
        if is_looked_at { whole.y = min(whole.y, reach_of(lattice_step(transfer.dims))); }
        // Lanes that do not fly have nowhere to go (see `path_trace`).
        var flight = path;
        flight.end = select(0.0, path.end, flies);
        let outcome = track(&flight, photon, &steps);
        if flies { path = flight; }
        if outcome != UNFINISHED || !flies {
            let collides = flies && outcome == COLLISION;
            blocks |= blocks_on_way(path.origin, path.direction, whole.x, select(whole.y, path.t, collides), flies);
            let x = path.origin + path.t * path.direction;
            let interacts = collides && !is_looked_at && keeps(x);
            if interacts {
                path.origin = x;
                path.w_o = path.direction;
                path.weight.y = 2.0;
                interactions += 1u;
            }
            // What may be hidden counts as far as it is seen from a way off: as in `trace_photons`.
            let seen = look(&path, photon, x, interacts, path.scatterings > 0u, flies && is_looked_at, outcome == ESCAPE, transfer.dims);
            // What comes before anything that changed is the same in both matters, and stays.
            let is_stale = any((vec4u(bins_met, blocks) & transfer.query) != vec4u(0u));
            if transfer.sign < 0 && seen.is_settled && !is_stale { path.density = f32(path.scatterings + 1u); }
            let counts = seen.is_settled && path.scatterings > 0u && path.weight.y > 0.0 && f32(path.scatterings) >= path.density;
            deposit(path.origin, path.w_o, 0.5 * path.weight.y * path.throughput, photon.x, select(0, transfer.sign, counts));
            if seen.is_settled {
                path.direction = path.w_o;
                path.scatterings += 1u;
            }
            let is_last = seen.is_settled && path.scatterings == transfer.events;
            if flies && !is_looked_at && outcome == LOST || is_last { cut += max_of(path.throughput); }
            path.stage = select(select(DONE, AT, seen.is_settled && !is_last), VIEW + TO_BEGIN, seen.goes_on);
        }
        if path.stage == DONE || steps == 0u { rays = 0u; }
    }
    if inside {
        if is_at_work { histories[path.light] = vec4u(bins_met, blocks); }
        paths[local] = path;
        atomicAdd(&group_unfinished, select(1u, 0u, path.stage == DONE));
        atomicAdd(&group_counts[0], lookups.x);
        atomicAdd(&group_counts[1], lookups.y);
        atomicAdd(&group_counts[2], interactions);
        atomicAdd(&group_counts[3], u32(round(CUT_UNIT * cut)));
    }
    workgroupBarrier();
    if lane < PHOTON_COUNTERS {
        let amount = atomicLoad(&group_counts[lane]);
        let before = atomicAdd(&counters[2u * lane], amount);
        if before + amount < before { atomicAdd(&counters[2u * lane + 1u], 1u); }
    } else if lane == PHOTON_COUNTERS {
        atomicAdd(&counters[2u * PHOTON_COUNTERS], atomicLoad(&group_unfinished));
    }
}

// A photon's share in the eight texels around it, for each function it comes from; `sign` 1: it comes,
// -1: it goes, 0: there is none.
fn deposit(x: vec3f, way: vec3f, throughput: vec3f, photon: u32, sign: i32) {
    let dims = vec3f(transfer.dims);
    let place = clamp(x / frame.size_world + 0.5, vec3f(0.0), vec3f(1.0)) * dims - 0.5;
    let low = floor(place);
    let part = place - low;
    var harmonics = array<f32, 36>();
    for (var k = 0u; k < BANDS * BANDS; k++) { harmonics[k] = spherical_harmonic(k, -way); }
    let flight = FLIGHT_TEXELS * flight_of(photon);
    // Lanes without a photon make no trip.
    let corners = select(0u, 8u, sign != 0);
    for (var corner = 0u; corner < corners; corner++) {
        let upper = vec3u(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let texel_place = vec3u(clamp(low + vec3f(upper), vec3f(0.0), dims - 1.0));
        let near = select(1.0 - part, part, upper == vec3u(1u));
        let row = texel_rows[(texel_place.z * transfer.dims.y + texel_place.y) * transfer.dims.x + texel_place.x];
        // The texel of `flights` that holds the function's index, and the place in it.
        let functions = select(FUNCTIONS, 0u, row == NO_ROW);
        for (var f = 0u; f < functions; f++) {
            let weight = flights[flight + 3u + f / 4u][f % 4u];
            let b = u32(flights[flight + 1u + f / 4u][f % 4u]);
            let share = throughput * (weight * near.x * near.y * near.z / transfer.unit);
            let coefficients = select(0u, BANDS * BANDS, weight > 0.0);
            for (var k = 0u; k < coefficients; k++) {
                let amounts = sign * vec3i(round(clamp(share * harmonics[k], vec3f(-MOST_SHARE), vec3f(MOST_SHARE))));
                if amounts.x != 0 { add(2u * in_matrix(k, b, row), amounts.x); }
                if COLOURED {
                    if amounts.y != 0 { add(2u * in_matrix(BANDS * BANDS + k, b, row), amounts.y); }
                    if amounts.z != 0 { add(2u * in_matrix(2u * BANDS * BANDS + k, b, row), amounts.z); }
                }
            }
        }
    }
}

fn add_to_word(word: u32, amount: u32) -> u32 {
    if (word & 1u) == 0u { return atomicAdd(&low_words[word / 2u], amount); }
    return atomicAdd(&high_words[word / 2u], amount);
}
