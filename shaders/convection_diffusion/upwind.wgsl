// Passes `upwind_front` and `pack_fronts`: the upwind scheme of the paper, for comparison (README.md,
// equations 18 to 20). Fronts are the cells as many steps along the axes from where the light comes:
// each cell of a front takes from cells of the one before alone. Directly, a front is done at once;
// explicitly, by steps in time at half the Courant number, as published.

struct Front {
    cells: vec3u,
    // Steps from `start` of the front.
    front: u32,
    // Edges of a cell, world units.
    cell_size: vec3f,
    // 1: from a place. 0: parallel.
    from_place: u32,
    // The light, in cells; or the direction it travels.
    light: vec3f,
    slot: u32,
    // The cell nearest to the light.
    start: vec3u,
    pad0: u32,
}

@group(0) @binding(24) var matter: texture_3d<f32>;
@group(0) @binding(29) var<storage, read_write> transmittances: array<u32>;
@group(0) @binding(43) var<uniform> front: Front;
// Transmittance to each cell's centre, to where its light is taken (march.wgsl), and its mean over the
// cell.
@group(0) @binding(44) var<storage, read_write> densities: array<vec4f>;

const DEEPEST_SEEN = 0.69314718;

override EXPLICIT: bool = false;

@compute @workgroup_size(8, 8)
fn upwind_front(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= front.cells.y || id.y >= front.cells.z { return; }
    let across = abs(vec2i(id.xy) - vec2i(front.start.yz));
    let along = i32(front.front) - across.x - across.y;
    if along < 0 { return; }
    for (var side = -1; side <= 1; side += 2) {
        let x = i32(front.start.x) + side * along;
        if x >= 0 && x < i32(front.cells.x) && (along > 0 || side > 0) {
            update(vec3i(x, vec2i(id.xy)));
        }
    }
}

fn update(cell: vec3i) {
    let index = index_at(cell);
    var direction = front.light;
    if front.from_place == 1u {
        direction = (vec3f(cell) + 0.5 - front.light) * front.cell_size;
    }
    let from_start = cell - vec3i(front.start);
    // Along axes on which the light stands in the cell's own layer, nothing comes from upwind.
    let own_layer = (from_start == vec3i(0)) & vec3<bool>(front.from_place == 1u) & light_within();
    var speeds = select(abs(direction) / front.cell_size, vec3f(0.0), own_layer);
    let sum = speeds.x + speeds.y + speeds.z;
    if sum <= 0.0 {
        densities[index] = vec4f(1.0);
        return;
    }
    speeds /= sum;
    // World units of the way through a cell.
    let way = length(direction) / sum;
    let sigma = textureLoad(matter, cell, 0).w;
    var enters = 0.0;
    for (var axis = 0u; axis < 3u; axis++) {
        if speeds[axis] > 0.0 {
            var upwind = cell;
            upwind[axis] -= select(-1, 1, direction[axis] > 0.0);
            var value = 1.0;
            if upwind[axis] >= 0 && upwind[axis] < i32(front.cells[axis]) {
                value = densities[index_at(upwind)].x * exp(-0.5 * way * textureLoad(matter, upwind, 0).w);
            }
            enters += speeds[axis] * value;
        }
    }
    let depth = way * sigma;
    let mean = select((1.0 - exp(-depth)) / max(depth, 1e-20), 1.0 - 0.5 * depth, depth < 1e-3);
    var value = enters * exp(-0.5 * depth);
    if EXPLICIT {
        // One step: what is there keeps this share of its distance from the steady state.
        let shortest = min(front.cell_size.x, min(front.cell_size.y, front.cell_size.z));
        let courant = 0.5 * shortest / way;
        let through = exp(-depth);
        let kept = through * (1.0 - courant) / (courant + through * (1.0 - courant));
        value += kept * (densities[index].x - value);
    }
    densities[index] = vec4f(value, select(value, enters * 0.5, 0.5 * depth > DEEPEST_SEEN), enters * mean, 0.0);
}

// On which axes the light stands within the grid.
fn light_within() -> vec3<bool> {
    return (front.light >= vec3f(0.0)) & (front.light <= vec3f(front.cells));
}

fn index_at(cell: vec3i) -> u32 {
    return (u32(cell.z) * front.cells.y + u32(cell.y)) * front.cells.x + u32(cell.x);
}

@compute @workgroup_size(8, 8)
fn pack_fronts(@builtin(global_invocation_id) id: vec3u) {
    if any(id >= front.cells) { return; }
    let index = index_at(vec3i(id));
    transmittances[front.slot + index] = pack2x16unorm(clamp(densities[index].yz, vec2f(0.0), vec2f(1.0)));
}
