// Photons from the boundary of the volume (sections 6.3.1 and 6.3.2 of the paper), each followed once for
// all basis functions that shine from where it comes (README.md). Every interaction but the first is
// scattered light: its share in the eight texels around it is counted in whole numbers, so the order of
// photons makes no difference.

@group(0) @binding(10) var<storage, read_write> paths: array<Path>;
// Pairs of low and high words: tentative collisions, cells looked up, interactions, 1024ths of throughput
// cut off; then one word: photons unfinished.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
// Of each direction of photons: towards the light; then FUNCTIONS indices and as many weights.
@group(0) @binding(27) var<storage, read> flights: array<vec4f>;
// Row of each texel; NO_ROW without one.
@group(0) @binding(28) var<storage, read> texel_rows: array<u32>;
// As the matrices, `channels` planes of coefficients.
@group(0) @binding(29) var<storage, read_write> sums: array<atomic<i32>>;

// Bands of the field.
override BANDS: u32 = 1u;
// Whether red, green and blue differ.
override COLOURED: bool = false;

const FUNCTIONS = 8u;
const FLIGHT_TEXELS = 5u;
const NO_ROW = 0xffffffffu;
// Stages beside those of shared/path.wgsl.
const AT = 8u;
const DONE = 9u;
const PHOTON_COUNTERS = 4u;
const CUT_UNIT = 1024.0;
// Told apart from photons of other methods.
const KEY = 0x70767274u;
// Shares beyond it are cut: sums of all photons of a batch stay below 2^31.
const MOST_SHARE = 1e6;
var<workgroup> group_counts: array<atomic<u32>, PHOTON_COUNTERS>;
var<workgroup> group_unfinished: atomic<u32>;

fn seed() -> u32 {
    return 0u;
}

fn clipped_matter_blocks() -> bool {
    return steering(transfer.clip_shadows) == 1u;
}

fn flight_of(photon: u32) -> u32 {
    return photon % transfer.flights * transfer.stride % transfer.flights;
}

// Photons enter through the faces of the box that are turned to the light, each face by what it shows of
// itself: cosine and area of eq. 12. So none leaves at once.
@compute @workgroup_size(64)
fn enter_photons(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let local = min(id.x, transfer.count - 1u);
    let photon = vec2u(transfer.first + local, KEY);
    let way = -flights[FLIGHT_TEXELS * flight_of(photon.x)].xyz;
    var path = Path();
    let u = unit4(draw(&path, photon));
    let shown = abs(way) * frame.size_world.yzx * frame.size_world.zxy;
    let all = shown.x + shown.y + shown.z;
    let turned = select(vec3f(-0.5), vec3f(0.5), way < vec3f(0.0));
    var place = u.xyz - 0.5;
    if u.w * all < shown.x {
        place.x = turned.x;
    } else if u.w * all < shown.x + shown.y {
        place.y = turned.y;
    } else {
        place.z = turned.z;
    }
    path.stage = FLIGHT + TO_BEGIN;
    path.origin = place * frame.size_world;
    path.direction = way;
    path.throughput = vec3f(all / transfer.mean_shown);
    path.end = FARTHEST;
    if id.x < transfer.count { paths[local] = path; }
}

@compute @workgroup_size(64)
fn carry_photons(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    always_zero = id.z;
    let inside = id.x < transfer.count;
    let local = min(id.x, transfer.count - 1u);
    var path = paths[local];
    var interactions = 0u;
    var cut = 0.0;
    var rays = select(0u, steering(transfer.photon_rays), inside && path.stage != DONE);
    var steps = select(0u, steering(transfer.steps), rays > 0u);
    for (var i = 0u; i < rays; i++) {
        let photon = vec2u(transfer.first + local, KEY);
        if path.stage == AT { scatter_on(&path, photon); }
        if path.stage == FLIGHT + TO_BEGIN { begin_ray(&path, photon); }
        let flies = path.stage == FLIGHT;
        // Lanes that do not fly have nowhere to go (see `path_trace`).
        var flight = path;
        flight.end = select(0.0, path.end, flies);
        let outcome = track(&flight, photon, &steps);
        if flies { path = flight; }
        if outcome != UNFINISHED || !flies {
            let x = path.origin + path.t * path.direction;
            let collides = flies && outcome == COLLISION && keeps(x);
            deposit(x, path.direction, path.throughput, photon.x, collides && path.scatterings > 0u);
            if collides {
                path.origin = x;
                path.scatterings += 1u;
                interactions += 1u;
            }
            let last = path.scatterings == transfer.events;
            if flies && (outcome == LOST || collides && last) { cut += max_of(path.throughput); }
            path.stage = select(DONE, AT, collides && !last);
        }
        if path.stage == DONE || steps == 0u { rays = 0u; }
    }
    if inside {
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

// A photon's share in the eight texels around it, for each function it comes from.
fn deposit(x: vec3f, way: vec3f, throughput: vec3f, photon: u32, is_there: bool) {
    let dims = vec3f(transfer.dims);
    let place = clamp(x / frame.size_world + 0.5, vec3f(0.0), vec3f(1.0)) * dims - 0.5;
    let low = floor(place);
    let part = place - low;
    var harmonics = array<f32, 36>();
    for (var k = 0u; k < BANDS * BANDS; k++) { harmonics[k] = spherical_harmonic(k, -way); }
    let flight = FLIGHT_TEXELS * flight_of(photon);
    // Lanes without a photon make no trip.
    let corners = select(0u, 8u, is_there);
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
                let amounts = vec3i(round(clamp(share * harmonics[k], vec3f(-MOST_SHARE), vec3f(MOST_SHARE))));
                if amounts.x != 0 { atomicAdd(&sums[in_matrix(k, b, row)], amounts.x); }
                if COLOURED {
                    if amounts.y != 0 { atomicAdd(&sums[in_matrix(BANDS * BANDS + k, b, row)], amounts.y); }
                    if amounts.z != 0 { atomicAdd(&sums[in_matrix(2u * BANDS * BANDS + k, b, row)], amounts.z); }
                }
            }
        }
    }
}
