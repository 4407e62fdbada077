// Method `path_traced`: an unbiased estimate of each pixel by paths of light followed from the eye
// (README.md). An invocation works on one pixel: where its path has got to is kept between
// dispatches, so that no dispatch is long, whatever the scene.

// Mean radiance, and 1. Means, not sums: adding up what is always the same would drift.
@group(0) @binding(5) var<storage, read_write> film: array<vec4f>;
// Pairs of low and high words: tentative collisions, cells looked up, scattering events, shadow
// rays, paths, paths dropped because they were not finite, 1024ths of throughput cut off; then one
// word: pixels unfinished.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
// Paths under way, of the rows at work.
@group(0) @binding(10) var<storage, read_write> paths: array<Path>;
@group(0) @binding(13) var<uniform> path_tracer: PathTracer;
// Sums of squared deviations from the mean (Welford 1962), and the number of paths.
@group(0) @binding(14) var<storage, read_write> spreads: array<vec4f>;
// For each tile of 8 x 8 pixels two words: the bins its paths relied on.
@group(0) @binding(15) var<storage, read_write> tiles: array<atomic<u32>>;

struct PathTracer {
    seed: u32,
    // Paths each pixel shall have.
    wanted: u32,
    // Of one invocation: rays, and cells and tentative collisions.
    rays: u32,
    steps: u32,
    source_count: u32,
    // Scattering events after which light is not followed.
    orders: u32,
    // Scattering events after which a path is cut.
    longest: u32,
    // 1: no path is under way.
    fresh: u32,
    // 1: clipped matter blocks light.
    clip_shadows: u32,
    // 1: a ray after the last scattering event can find light.
    last_ray_matters: u32,
    pad0: u32,
    pad1: u32,
}

// A path under way.
struct Path {
    // The present ray.
    origin: vec3f,
    // How far it has come.
    t: f32,
    direction: vec3f,
    // Where along it a cell is looked up next.
    lookup: f32,
    throughput: vec3f,
    // To the next tentative collision.
    optical_depth: f32,
    // Found so far.
    radiance: vec3f,
    // Of a shadow ray, so far.
    transmittance: f32,
    // The last scattering event: towards the eye, the surface's normal (0: none), and s.
    w_o: vec3f,
    s: f32,
    n: vec3f,
    // Of the present ray's direction.
    density: f32,
    // What a shadow ray brings if nothing is in its way.
    weight: vec3f,
    // The present ray's; before it has begun, of the light it is meant for.
    end: f32,
    stage: u32,
    // Next light to look for.
    light: u32,
    scatterings: u32,
    // Random numbers drawn.
    draws: u32,
}

// What the present ray is.
const START = 0u;
// From the eye.
const VIEW = 1u;
// From a scattering event on.
const FLIGHT = 2u;
// Towards a light.
const SHADOW = 3u;
// Added to these while the ray has not begun.
const TO_BEGIN = 4u;

const PATH_COUNTERS = 7u;
const CUT_UNIT = 1024.0;
var<workgroup> group_counts: array<atomic<u32>, PATH_COUNTERS>;
var<workgroup> group_unfinished: atomic<u32>;

@compute @workgroup_size(8, 8)
fn path_trace(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    always_zero = id.z;
    let inside = id.x < frame.image.x && id.y < frame.row_count;
    let column = min(id.x, frame.image.x - 1u);
    let row = min(id.y, frame.row_count - 1u);
    slot = row * frame.image.x + column;
    let index = (frame.first_row + row) * frame.image.x + column;
    let place = vec2f(f32(column), f32(frame.first_row + row));
    var path = paths[slot];
    if steering(path_tracer.fresh) == 1u { path.stage = START; }
    var mean = film[index];
    var spread = spreads[index];
    // scattering events, shadow rays, paths, not finite
    var counts = vec4u(0u);
    var cut_off = 0.0;
    // Idle invocations make no trip through the loop; a loop that no lane takes part in otherwise
    // runs to its bound on Mesa 22's software device.
    var rays = select(0u, steering(path_tracer.rays), inside && u32(spread.w) < steering(path_tracer.wanted));
    var steps = select(0u, steering(path_tracer.steps), rays > 0u);
    for (var i = 0u; i < rays; i++) {
        let pixel = vec2u(index, u32(spread.w));
        if LIGHT_LAYERS { forget_findings(path.stage == START); }
        if path.stage == START { begin_path(&path, pixel, place); }
        begin_ray(&path, pixel);
        let outcome = track(&path, pixel, &steps);
        var cut = 0.0;
        let done = advance(&path, pixel, outcome, &cut, &counts);
        var finite = true;
        if LIGHT_LAYERS { finite = keep_findings(done, pixel.y); }
        if done {
            path.stage = START;
            counts.z += 1u;
            cut_off += cut;
            if LIGHT_LAYERS {
                counts.w += select(1u, 0u, finite);
                spread.w += 1.0;
            } else {
                var radiance = path.radiance;
                // A sum that is not finite stays so; everything finite is taken as it is.
                if !(dot(radiance, vec3f(1.0)) < 1e30) {
                    radiance = vec3f(0.0);
                    counts.w += 1u;
                }
                let deviation = radiance - mean.xyz;
                mean = vec4f(mean.xyz + deviation / (spread.w + 1.0), 1.0);
                spread += vec4f(deviation * (radiance - mean.xyz), 1.0);
            }
        }
        if u32(spread.w) >= steering(path_tracer.wanted) || steps == 0u { rays = 0u; }
    }
    let tile = 2u * (group.y + frame.first_row / 8u) * ((frame.image.x + 7u) / 8u) + 2u * group.x;
    if inside {
        paths[slot] = path;
        // With layers the film is summed up from them by `mix_lights`.
        if !LIGHT_LAYERS { film[index] = mean; }
        spreads[index] = spread;
        atomicOr(&tiles[tile], bins_met.x);
        atomicOr(&tiles[tile + 1u], bins_met.y);
        atomicAdd(&group_unfinished, select(0u, 1u, u32(spread.w) < steering(path_tracer.wanted)));
        atomicAdd(&group_counts[0], lookups.x);
        atomicAdd(&group_counts[1], lookups.y);
        for (var i = 0u; i < 4u; i++) {
            atomicAdd(&group_counts[2u + i], counts[i]);
        }
        atomicAdd(&group_counts[6], u32(round(CUT_UNIT * cut_off)));
    }
    workgroupBarrier();
    if lane < PATH_COUNTERS {
        let amount = atomicLoad(&group_counts[lane]);
        let before = atomicAdd(&counters[2u * lane], amount);
        if before + amount < before { atomicAdd(&counters[2u * lane + 1u], 1u); }
    } else if lane == PATH_COUNTERS {
        atomicAdd(&counters[2u * PATH_COUNTERS], atomicLoad(&group_unfinished));
    }
}

// A new path: its place in the pixel is uniform over the pixel's square.
fn begin_path(path: ptr<function, Path>, pixel: vec2u, place: vec2f) {
    *path = Path();
    let u = unit2(draw(path, pixel).xy);
    let ray = camera_ray(place + u);
    let enter = max(box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).x, 0.0);
    // From the box on, so that a distant eye costs no precision.
    (*path).origin = ray.origin + enter * ray.direction;
    (*path).direction = ray.direction;
    (*path).throughput = vec3f(1.0);
    (*path).end = FARTHEST;
    (*path).stage = VIEW + TO_BEGIN;
}

// The part of a new ray on which there may be matter, and its way to the first tentative collision.
fn begin_ray(path: ptr<function, Path>, pixel: vec2u) {
    let ray = Ray((*path).origin, (*path).direction);
    var whole = box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world);
    whole.x = max(whole.x, 0.0);
    let kept = clip_interval(ray, whole);
    if (*path).stage < TO_BEGIN { return; }
    (*path).stage -= TO_BEGIN;
    let all = (*path).stage != VIEW && steering(path_tracer.clip_shadows) == 1u;
    let interval = select(kept, whole, all);
    (*path).t = interval.x;
    (*path).lookup = interval.x;
    (*path).end = min(interval.y, (*path).end);
    (*path).optical_depth = -log(unit2(draw(path, pixel).xy).x);
    (*path).transmittance = 1.0;
}

// What follows from what became of a ray: the next ray; true when the path is at its end.
fn advance(
    path: ptr<function, Path>,
    pixel: vec2u,
    outcome: u32,
    cut: ptr<function, f32>,
    counts: ptr<function, vec4u>,
) -> bool {
    if outcome == UNFINISHED { return false; }
    let stage = (*path).stage;
    let brightest = max_of((*path).throughput);
    let ray = Ray((*path).origin, (*path).direction);
    if stage == SHADOW {
        // Lost: the transmittance counts as 0.
        if outcome == ESCAPE { find(path, (*path).light - 1u, (*path).transmittance * (*path).weight); }
    } else {
        let met_until = select((*path).t, FARTHEST, outcome == ESCAPE);
        let looks = stage == FLIGHT && outcome != LOST;
        meet_lights(path, ray, met_until, looks);
        if outcome == ESCAPE {
            if stage == VIEW { find(path, layer_behind(), seen_behind(ray.direction)); }
            return true;
        }
        if outcome == LOST {
            *cut = brightest;
            return true;
        }
        let x = ray.origin + (*path).t * ray.direction;
        // Clipped matter absorbs: the eye's ray meets none, light's may.
        if stage == FLIGHT && !keeps(x) { return true; }
        let place = place_in(piece_of((*path).s, true), (*path).s);
        let albedo = albedo_at(place);
        if EMISSION {
            // sigma_a L_e / sigma_t.
            find(path, layer_of_glow(), (*path).throughput * (1.0 - albedo) * emission_at(place));
        }
        if (*path).scatterings == steering(path_tracer.orders) { return true; }
        if (*path).scatterings == steering(path_tracer.longest) {
            *cut = brightest;
            return true;
        }
        (*path).scatterings += 1u;
        (*counts).x += 1u;
        (*path).origin = x;
        (*path).w_o = -ray.direction;
        (*path).n = vec3f(0.0);
        if SURFACES {
            if materials[place.material].surface > 0.0 { (*path).n = normal_at(x, -ray.direction); }
        }
        (*path).light = 0u;
    }
    return scatter(path, pixel, counts);
}

// At a scattering event: a shadow ray to the next light that can be seen in its direction, or after
// the last one the way on.
fn scatter(path: ptr<function, Path>, pixel: vec2u, counts: ptr<function, vec4u>) -> bool {
    let place = place_in(piece_of((*path).s, true), (*path).s);
    let at = scatterer(materials[place.material], albedo_at(place), (*path).w_o, (*path).n);
    let count = steering(path_tracer.source_count);
    var found = false;
    for (var i = (*path).light; i < count; i++) {
        let light = towards((*path).light, (*path).origin, draw(path, pixel));
        (*path).light += 1u;
        var weight = vec3f(0.0);
        if max_of(light.weight) > 0.0 {
            weight = (*path).throughput * scattered(at, light.w_i) * light.weight;
            if light.density > 0.0 { weight *= power_heuristic(light.density, direction_density(at, light.w_i)); }
        }
        if max_of(weight) > 0.0 {
            (*path).weight = weight;
            (*path).direction = light.w_i;
            (*path).end = light.distance;
            (*path).stage = SHADOW + TO_BEGIN;
            (*counts).y += 1u;
            found = true;
            i = count;
        }
    }
    if found { return false; }
    if (*path).scatterings == steering(path_tracer.orders) && steering(path_tracer.last_ray_matters) == 0u { return true; }
    let w_i = sample_direction(at, unit4(draw(path, pixel)));
    let density = direction_density(at, w_i);
    let scattered_on = (*path).throughput * scattered(at, w_i) / density;
    if !(density > 0.0 && dot(w_i, w_i) > 0.0 && max_of(scattered_on) > 0.0) { return true; }
    // Russian roulette: the brightest channel does not change its value.
    let survival = min(max_of(scattered_on) / max_of((*path).throughput), 1.0);
    if unit2(draw(path, pixel).xy).x >= survival { return true; }
    (*path).throughput = scattered_on / survival;
    (*path).direction = w_i;
    (*path).density = density;
    (*path).end = FARTHEST;
    (*path).stage = FLIGHT + TO_BEGIN;
    return false;
}

fn max_of(v: vec3f) -> f32 {
    return max(v.x, max(v.y, v.z));
}

// Whether matter at a place is not clipped away.
fn keeps(x: vec3f) -> bool {
    var inside = all(x >= frame.clip_low) && all(x <= frame.clip_high);
    for (var i = 0u; i < steering(frame.plane_count); i++) {
        inside = inside && dot(frame.planes[i].xyz, x) >= frame.planes[i].w;
    }
    return inside;
}
