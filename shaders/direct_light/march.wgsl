// How much of each light reaches the nodes of a grid over the volume's box: one light and a run of nodes a
// dispatch (README.md). Nodes lie on the box's faces, too, where light enters unhindered.

// In a storage buffer, for Mesa 22's software device crashes where loops and branches follow from more
// than a few members of a uniform.
@group(0) @binding(13) var<storage, read> run: DirectRun;
// Of each four lights and each node: the share of what would arrive if nothing were in between.
@group(0) @binding(14) var<storage, read_write> shares: array<vec4f>;
// Pairs of low and high words: nodes looked up anew, nodes kept, cells looked at, cells skipped.
@group(0) @binding(18) var<storage, read_write> node_counters: array<atomic<u32>>;
@group(0) @binding(19) var direct_field: texture_storage_3d<rgba16float, write>;

const GLOW = false;
const NODE_COUNTERS = 4u;
var<workgroup> group_counts: array<atomic<u32>, NODE_COUNTERS>;

struct DirectRun {
    // Nodes along each axis.
    nodes: vec3u,
    // The light's place in the field.
    slot: u32,
    // Nodes of this dispatch.
    first: u32,
    count: u32,
    // 1: nodes whose rays meet no cell in which matter changed are kept.
    tests: u32,
    // Rays of a node: places on the light.
    rays: u32,
    // Position of point and spot, centre of rectangle, disk and sphere.
    position: vec3f,
    // As in shared/sources.wgsl.
    kind: u32,
    // The way a directional light travels; normal of rectangle and disk.
    direction: vec3f,
    // Rectangle and disk: area. Sphere: radius.
    extent: f32,
    // Half the edges of a rectangle; two radii of a disk.
    half_u: vec3f,
    pad0: u32,
    half_v: vec3f,
    pad1: u32,
}

const DIRECTIONAL = 0u;
const RECTANGLE = 3u;
const DISK = 4u;
const SPHERE = 5u;

@compute @workgroup_size(64)
fn march_direct(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    // Lanes without a node walk the last one's rays, empty ways: see `march_records`.
    let local = 64u * group.x + lane;
    let inside = local < steering(run.count);
    let node = run.first + min(local, run.count - 1u);
    let nodes = run.nodes;
    let at = vec3u(node % nodes.x, node / nodes.x % nodes.y, node / (nodes.x * nodes.y));
    let x = (vec3f(at) / max(vec3f(nodes) - 1.0, vec3f(1.0)) - 0.5) * frame.size_world;
    var is_stale = steering(run.tests) == 0u;
    for (var i = 0u; i < steering(run.rays); i++) {
        let towards = towards_light(i, x);
        let kept = kept_of(towards, x);
        is_stale = meets_change(Ray(x, towards.w_i), kept.x, select(kept.x, kept.y, inside && !is_stale)) || is_stale;
    }
    let is_cast = inside && is_stale;
    var counts = vec4u(u32(is_cast), u32(inside && !is_stale), 0u, 0u);
    // Of what would arrive, and of what arrives.
    var sent = 0.0;
    var found = 0.0;
    for (var i = 0u; i < steering(run.rays); i++) {
        let towards = towards_light(i, x);
        let kept = kept_of(towards, x);
        let through = arriving(Ray(x, towards.w_i), kept.x, select(kept.x, kept.y, is_cast), &counts).w;
        sent += towards.weight;
        found += towards.weight * through;
    }
    if is_cast {
        let all = nodes.x * nodes.y * nodes.z;
        let four = run.slot / 4u;
        shares[four * all + node][run.slot % 4u] = found / whole(x, sent);
        textureStore(direct_field, vec3u(at.xy, at.z + four * nodes.z), shares[four * all + node]);
    }
    for (var i = 0u; i < NODE_COUNTERS; i++) {
        atomicAdd(&group_counts[i], counts[i]);
    }
    workgroupBarrier();
    if lane < NODE_COUNTERS {
        let amount = atomicLoad(&group_counts[lane]);
        let before = atomicAdd(&node_counters[2u * lane], amount);
        if before + amount < before { atomicAdd(&node_counters[2u * lane + 1u], 1u); }
    }
}

// The part of a way to the light on which there may be matter.
fn kept_of(towards: TowardsLight, x: vec3f) -> vec2f {
    let ray = Ray(x, towards.w_i);
    let end = min(towards.distance, box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y);
    let kept = clip_interval(ray, vec2f(0.0, end));
    return vec2f(min(kept.x, kept.y), kept.y);
}

struct TowardsLight {
    w_i: vec3f,
    distance: f32,
    // Share of what arrives if nothing is in between, to any unit.
    weight: f32,
}

// One of a light's places, evenly spread (Roberts: the R2 sequence); the only one of lights without
// extent.
fn towards_light(i: u32, x: vec3f) -> TowardsLight {
    let kind = steering(run.kind);
    if kind == DIRECTIONAL { return TowardsLight(-run.direction, 1e30, 1.0); }
    let u = fract(0.5 + f32(i) * vec2f(0.7548776662, 0.5698402910));
    let on_disk = sqrt(u.x) * vec2f(cos(2.0 * PI * u.y), sin(2.0 * PI * u.y));
    var place = run.position;
    if kind == RECTANGLE { place += (2.0 * u.x - 1.0) * run.half_u + (2.0 * u.y - 1.0) * run.half_v; }
    if kind == DISK { place += on_disk.x * run.half_u + on_disk.y * run.half_v; }
    if kind == SPHERE {
        // The disk that is seen of it.
        let axis = normalize(run.position - x + vec3f(0.0, 0.0, 1e-20));
        let side = select(-1.0, 1.0, axis.z >= 0.0);
        let a = -1.0 / (side + axis.z);
        let tangent = vec3f(1.0 + side * axis.x * axis.x * a, side * axis.x * axis.y * a, -side * axis.x);
        place += run.extent * (on_disk.x * tangent + on_disk.y * cross(axis, tangent));
    }
    let to_place = place - x;
    let squared = max(dot(to_place, to_place), NEAREST_SQUARED);
    // In the light itself there is no direction towards it.
    if dot(to_place, to_place) < NEAREST_SQUARED { return TowardsLight(vec3f(0.0, 0.0, 1.0), 0.0, 1.0); }
    let w_i = to_place * inverseSqrt(squared);
    var weight = 1.0;
    if kind == RECTANGLE || kind == DISK {
        let part = run.extent / f32(run.rays);
        weight = part * max(-dot(w_i, run.direction), 0.0) / (squared + part / PI);
    }
    return TowardsLight(w_i, sqrt(squared), weight);
}

// What view rays take for what would arrive if nothing were in between (`incident_light`), in the unit of
// the weights: so that light of panels close by is as bright as it is, not as one place makes it.
fn whole(x: vec3f, sent: f32) -> f32 {
    let kind = steering(run.kind);
    if kind != RECTANGLE && kind != DISK { return sent; }
    let to_light = run.position - x;
    let squared = max(dot(to_light, to_light), NEAREST_SQUARED);
    let cosine = max(-dot(to_light * inverseSqrt(squared), run.direction), 0.0);
    // Beside the panel view rays see nothing of it.
    return max(run.extent * cosine / (squared + run.extent / PI), max(sent / LARGEST_SHARE, 1e-30));
}

const LARGEST_SHARE = 8.0;
// Squared distance below which there is no direction to a light, as in shared/light.wgsl.
const NEAREST_SQUARED = 1e-8;
