// Pass `compose_field`: transmittances from all sources and diffused light as the light field that view
// rays read (README.md, equations 15 to 17).

@group(0) @binding(21) var field_out: texture_storage_3d<rgba16float, write>;
// As in direct_light/look_up.wgsl.
@group(0) @binding(23) var direct_out: texture_storage_3d<rgba16float, write>;
@group(0) @binding(24) var matter: texture_3d<f32>;
@group(0) @binding(31) var<storage, read_write> flows: array<vec4f>;
@group(0) @binding(35) var<storage, read_write> solution: array<vec4f>;
@group(0) @binding(41) var<uniform> compose: Compose;

// Mirrored by `Compose` in server/render/src/uniforms.rs.
struct Compose {
    bands: u32,
    // 0 direct light alone, 1 and P1's, 2 what the heat flow made of it.
    diffusion: u32,
    pad0: u32,
    pad1: u32,
}

const LIGHTS_A_LAYER = 4u;
// Of half floats, with room to spare.
const LARGEST = 60000.0;
// Y_00, and Y_1 by the component of a direction.
const Y_0 = 0.28209479177;
const Y_1 = 0.48860251190;

@compute @workgroup_size(64)
fn compose_field(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    let place = index_in_dispatch(group, lane);
    let index = grid.first + min(place, grid.count - 1u);
    let cell = cell_of(index);
    let bands = steering(compose.bands);
    let diffusion = steering(compose.diffusion);
    let inside = place < grid.count;
    var mean = vec3f(0.0);
    var towards = array<vec3f, 3>();
    if diffusion == 2u {
        mean = max(solution[index].xyz, vec3f(0.0)) * Y_0;
    } else if inside {
        for (var layer = 0u; LIGHTS_A_LAYER * layer < steering(sources.count); layer++) {
            textureStore(direct_out, cell + vec3u(0u, 0u, layer * grid.cells.z), layer_of(layer, index));
        }
    }
    if diffusion != 1u {
        // Without P1, whose boundary lets it in, light from all around is undimmed, as in `local`.
        mean += 4.0 * PI * Y_0 * sources.ambient;
    }
    if diffusion == 1u {
        mean = seen_of(diffused(cell, index), cell, index) * Y_0;
        if bands > 1u {
            // L = (phi + 3 J . w) / 4 pi for light that travels along w, seen from where it comes.
            towards = array<vec3f, 3>(-Y_1 * flux(cell, index, 1u), -Y_1 * flux(cell, index, 2u), -Y_1 * flux(cell, index, 0u));
        }
    }
    if inside {
        store(cell, 0u, bands, mean);
        if bands > 1u {
            for (var k = 1u; k < 4u; k++) { store(cell, k, bands, towards[k - 1u]); }
        }
    }
}

fn store(cell: vec3u, k: u32, bands: u32, radiance: vec3f) {
    let tile = vec3u(k % bands, 0u, k / bands) * grid.cells;
    textureStore(field_out, cell + tile, vec4f(clamp(radiance, vec3f(-LARGEST), vec3f(LARGEST)), 1.0));
}

// Transmittances from the four lights whose places are in a layer.
fn layer_of(layer: u32, index: u32) -> vec4f {
    var four = vec4f(0.0);
    for (var i = 0u; i < steering(sources.count); i++) {
        let slot = lights[i].slot;
        if slot / LIGHTS_A_LAYER == layer { four[slot % LIGHTS_A_LAYER] = transmittances_of(i, index).x; }
    }
    return four;
}

// Fluence of diffused light in a cell; beside matter what its profile, led on to the cell's centre,
// would be there, so that interpolation meets the boundary's value at the face between them.
fn diffused(cell: vec3u, index: u32) -> vec3f {
    if flows[index].x > 0.0 { return max(solution[index].xyz, vec3f(0.0)); }
    var sum = vec3f(0.0);
    var count = 0.0;
    for (var i = 0u; i < 27u; i++) {
        let step = vec3i(vec3u(i % 3u, i / 3u % 3u, i / 9u)) - 1;
        let other = vec3i(cell) + step;
        if all(other >= vec3i(0)) && all(other < vec3i(grid.cells)) {
            let there = index_of(vec3u(other));
            let flow = flows[there].xyz;
            if flow.x > 0.0 {
                let h = length(vec3f(step) * grid.cell_size);
                // phi at the face is phi 4 D / (h + 4 D); as far beyond it lies this cell.
                sum += max(solution[there].xyz, vec3f(0.0)) * max(2.0 * (4.0 * flow / (h + 4.0 * flow)) - 1.0, vec3f(0.0));
                count += 1.0;
            }
        }
    }
    return sum / max(count, 1.0);
}

// Of the diffused fluence in a cell of opaque matter what is seen of it, at its skin: what its own
// profile has at the face, and what a half-space of this matter gives back of the direct light that
// enters (half of it is left where it was taken). Between optical depths of 2 and 8 one goes over into
// the other (README.md, equation 16).
fn seen_of(fluence: vec3f, cell: vec3u, index: u32) -> vec3f {
    let found = textureLoad(matter, vec3i(cell), 0);
    let depth = found.w * (grid.cell_size.x + grid.cell_size.y + grid.cell_size.z) / 3.0;
    let skin = smoothstep(2.0, 8.0, depth);
    var direct = vec3f(0.0);
    if skin > 0.0 {
        for (var i = 0u; i < steering(sources.count); i++) { direct += direct_light(i, cell, index).at_centre; }
    }
    let albedo = 1.0 - found.xyz / max(found.w, 1e-20);
    let k = sqrt(3.0 * max(1.0 - albedo, vec3f(0.0)));
    let given_back = 3.5 * albedo / (1.0 + (2.36 + 1.8 * k) * k);
    return mix(fluence, fluence / (1.0 + 0.75 * depth) + 2.0 * direct * given_back, skin);
}

// Flux -D dphi/dx along an axis: the mean over the cell's two faces.
fn flux(cell: vec3u, index: u32, axis: u32) -> vec3f {
    let own = flows[index];
    if own.x <= 0.0 { return vec3f(0.0); }
    let value = solution[index].xyz;
    let h = grid.cell_size[axis];
    var sum = vec3f(0.0);
    for (var side = 0u; side < 2u; side++) {
        let sign = select(-1.0, 1.0, side == 1u);
        var other = vec3i(cell);
        other[axis] += select(-1, 1, side == 1u);
        var flow = vec4f(0.0);
        var there = 0u;
        if other[axis] >= 0 && other[axis] < i32(grid.cells[axis]) {
            there = index_of(vec3u(other));
            flow = 2.0 * own * flows[there] / max(own + flows[there], vec4f(1e-30));
        }
        if flow.x > 0.0 {
            sum += sign * flow.xyz * (value - solution[there].xyz) / h;
        } else {
            // Marshak: what leaves, less what comes in.
            sum += sign * (value - sources.outside[2u * axis + side].xyz) / (h / (2.0 * own.xyz) + 2.0);
        }
    }
    return 0.5 * sum;
}
