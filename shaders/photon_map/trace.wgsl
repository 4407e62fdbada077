// Method `photon_map`: photons followed from a light, each interaction stored with the bins and blocks
// that everything up to it relied on (its historygram), so that after an edit a photon is taken up
// again behind its last valid interaction (README.md). An invocation works on one photon: where it has
// got to is kept between dispatches, so that no dispatch is long. Only photons that are listed are worked
// on: invocations run in step, and one photon among many that are left alone would cost as much as all.
//
// Every stored interaction is also part of the light sums (deposit.wgsl): taken out before it is
// overwritten, added when it is stored. Sums are integers: their order makes no difference, and a
// photon taken out leaves nothing behind.

// Pairs of low and high words: tentative collisions, cells looked up, interactions, 1024ths of throughput
// cut off; then one word: photons unfinished. Behind them lists of photons.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
const PHOTON_COUNTERS = 4u;
const CUT_UNIT = 1024.0;
// Whether histories are kept; without them edits cannot be followed, and only costs are compared.
override MASKS: bool = true;
var<workgroup> group_counts: array<atomic<u32>, PHOTON_COUNTERS>;

@compute @workgroup_size(64)
fn trace_photons(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    always_zero = id.z;
    let inside = id.x < photons.listed;
    let place = photons.list + min(id.x, photons.listed - 1u);
    let local = min(atomicLoad(&counters[place]), photons.count - 1u);
    var path = paths[local];
    var blocks = vec2u(0u);
    // Values that are loaded here and used behind the loop crash the compiler of Mesa 22's software
    // device; this one is set in it.
    var is_at_work = false;
    // While a photon is under way, what it relied on is kept at its end.
    let works = path.stage != DONE || path.light > path.scatterings;
    if inside && works {
        let met = ends[2u * local];
        bins_met = met.xy;
        blocks = met.zw;
    }
    var interactions = 0u;
    var cut = 0.0;
    var rays = select(0u, steering(photons.rays), inside && works);
    var steps = select(0u, steering(photons.steps), rays > 0u);
    for (var i = 0u; i < rays; i++) {
        is_at_work = true;
        let photon = vec2u(photons.first + local, photons.key);
        let base = local * photons.slots;
        // Interactions that are stale are taken out first, the last one first.
        let undoes = path.light > path.scatterings;
        var slot = base + path.light - 1u;
        // Of its light so many halves come, or go.
        var halves = select(0, -i32(histories[2u * slot + 1u].z), undoes);
        if !undoes && path.stage == AT { scatter_on(&path, photon); }
        if !undoes && path.stage < AT { begin_ray(&path, photon); }
        let flies = !undoes && (path.stage == FLIGHT || path.stage == VIEW);
        let is_looked_at = path.stage == VIEW;
        var whole = max(box_interval(Ray(path.origin, path.direction), -0.5 * frame.size_world, 0.5 * frame.size_world), vec2f(0.0));
        if is_looked_at { whole.y = min(whole.y, reach_of(lattice_step(photons.dims))); }
        // Lanes that do not fly have nowhere to go (see `path_trace`).
        var flight = path;
        flight.end = select(0.0, path.end, flies);
        var outcome = track(&flight, photon, &steps);
        if flies { path = flight; }
        if !undoes && (outcome != UNFINISHED || !flies) {
            let collides = flies && outcome == COLLISION;
            let until = select(whole.y, path.t, collides);
            if MASKS { blocks |= blocks_on_way(path.origin, path.direction, whole.x, until, flies); }
            let x = path.origin + path.t * path.direction;
            let stores = collides && !is_looked_at && keeps(x);
            slot = base + path.light;
            if stores {
                places[slot] = vec4f(x, 0.0);
                ways[slot] = vec4f(path.direction, path.throughput.x);
                histories[2u * slot + 1u] = vec4u(bitcast<vec2u>(path.throughput.yz), 0u, 0u);
                path.origin = x;
                interactions += 1u;
            }
            // What has not been scattered is not the field's where it is kept apart. What may be hidden counts
            // if it is seen from a way off.
            let is_apart = path.light == 0u && steering(photons.direct) == 1u;
            let seen = look(&path, photon, x, stores, !is_apart, flies && is_looked_at, outcome == ESCAPE, photons.dims);
            if seen.is_settled {
                // Taken up again from here, a photon has drawn as many numbers.
                places[slot].w = bitcast<f32>(path.draws);
                path.direction = ways[slot].xyz;
                if MASKS { histories[2u * slot] = vec4u(bins_met, blocks); }
                halves = select(select(2, i32(path.weight.y), is_looked_at), 0, is_apart);
                histories[2u * slot + 1u].z = u32(halves);
                path.light += 1u;
                path.scatterings += 1u;
            }
            let is_last = seen.is_settled && path.light == photons.slots;
            if flies && !is_looked_at && outcome == LOST || is_last { cut += max_of(path.throughput); }
            if flies && !is_looked_at && outcome == ESCAPE {
                let left_with = bitcast<vec3u>(path.throughput);
                ends[2u * local + 1u] = vec4u(ends[2u * local + 1u].x, left_with);
            }
            path.stage = select(select(DONE, AT, seen.is_settled && !is_last), VIEW + TO_BEGIN, seen.goes_on);
        }
        deposit(places[slot].xyz, ways[slot].xyz,
            0.5 * f32(abs(halves)) * vec3f(ways[slot].w, bitcast<vec2f>(histories[2u * slot + 1u].xy)), sign(halves));
        if undoes { path.light -= 1u; }
        if path.stage == DONE && path.light == path.scatterings || steps == 0u { rays = 0u; }
    }
    let finished = path.stage == DONE && path.light == path.scatterings;
    if inside {
        // Read again: a value that was loaded before the loop crashes Mesa's compiler here.
        let local = min(atomicLoad(&counters[place]), photons.count - 1u);
        paths[local] = path;
        if is_at_work {
            if MASKS { ends[2u * local] = vec4u(bins_met, blocks); }
            ends[2u * local + 1u].x = path.light | select(UNFINISHED_PHOTON, 0u, finished);
        }
        if !finished {
            let next = atomicAdd(&counters[2u * PHOTON_COUNTERS], 1u);
            atomicStore(&counters[photons.next_list + next], local);
        }
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
    }
}
