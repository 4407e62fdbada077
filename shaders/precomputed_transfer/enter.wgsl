// Photons set out from the boundary of the volume (section 6.3.1 of the paper).

// Which they are, where they do not follow one another.
@group(0) @binding(33) var<storage, read> list: array<u32>;

// Photons enter through the faces of the box that are turned to the light, each face by what it shows of
// itself: cosine and area of eq. 12. So none leaves at once.
@compute @workgroup_size(64)
fn enter_photons(@builtin(global_invocation_id) id: vec3u) {
    always_zero = id.z;
    let local = min(id.x, transfer.count - 1u);
    let is_listed = transfer.listed == 1u;
    var index = transfer.first + local;
    if is_listed { index = list[local]; }
    let way = -flights[FLIGHT_TEXELS * flight_of(index)].xyz;
    var path = Path();
    // Those of a flight are spread evenly.
    let u = unit4(sobol4(index / transfer.flights, flight_of(index)));
    let shown = abs(way) * frame.size_world.yzx * frame.size_world.zxy;
    let all = shown.x + shown.y + shown.z;
    path.stage = FLIGHT + TO_BEGIN;
    path.origin = on_faces(way, shown, u.xy) * frame.size_world;
    path.direction = way;
    path.throughput = vec3f(all / transfer.mean_shown);
    path.end = FARTHEST;
    path.light = index;
    // Photons that were taken away come again from the first interaction that was.
    if is_listed && transfer.sign > 0 { path.density = paths[local].density; }
    if id.x < transfer.count {
        paths[local] = path;
        histories[index] = vec4u(0u);
    }
}
