// Pass `upwind_front`: the upwind scheme of the paper, for comparison (README.md,
// equations 18 to 20). Fronts are the cells as many steps along the axes from where the light comes:
// each cell of a front takes from cells of the one before alone. Directly, a front is done at once;
// explicitly, by steps in time at half the Courant number, as published. Two fronts are kept, by place
// across x, where neighbours in a front are neighbours in memory: by cells they would be a row apart.

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
    // Which of a front's steps in time this is: FIRST, LAST.
    step: u32,
    // The dispatch begins here, in cells along y and z.
    origin: vec2u,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(24) var matter: texture_3d<f32>;
@group(0) @binding(29) var<storage, read_write> transmittances: array<u32>;
@group(0) @binding(43) var<uniform> front: Front;
// Transmittance to cells' centres, and their extinction: of the front before and of this one, by turns;
// of each the cells above the light along x, then those below it; of those by y and z.
@group(0) @binding(44) var<storage, read_write> densities: array<vec2f>;

const FIRST = 1u;
const LAST = 2u;

const DEEPEST_SEEN = 0.69314718;

override EXPLICIT: bool = false;

@compute @workgroup_size(8, 8)
fn upwind_front(@builtin(global_invocation_id) id: vec3u) {
    let row = vec2i(id.xy + front.origin);
    if any(row >= vec2i(front.cells.yz)) { return; }
    let across = abs(row - vec2i(front.start.yz));
    let along = i32(front.front) - across.x - across.y;
    if along < 0 { return; }
    for (var side = -1; side <= 1; side += 2) {
        let x = i32(front.start.x) + side * along;
        if x >= 0 && x < i32(front.cells.x) && (along > 0 || side > 0) {
            update(vec3i(x, row));
        }
    }
}

fn update(cell: vec3i) {
    let place = place_of(cell, front.front);
    let sigma = textureLoad(matter, cell, 0).w;
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
        densities[place] = vec2f(1.0, sigma);
        keep(cell, 1.0, 1.0);
        return;
    }
    speeds /= sum;
    // World units of the way through a cell.
    let way = length(direction) / sum;
    var enters = 0.0;
    for (var axis = 0u; axis < 3u; axis++) {
        if speeds[axis] > 0.0 {
            var upwind = cell;
            upwind[axis] -= select(-1, 1, direction[axis] > 0.0);
            var value = 1.0;
            if upwind[axis] >= 0 && upwind[axis] < i32(front.cells[axis]) {
                let before = densities[place_of(upwind, front.front - 1u)];
                value = before.x * exp(-0.5 * way * before.y);
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
        // It begins in the dark.
        value += kept * (select(densities[place].x, 0.0, (front.step & FIRST) != 0u) - value);
    }
    densities[place] = vec2f(value, sigma);
    keep(cell, select(value, enters * 0.5, 0.5 * depth > DEEPEST_SEEN), enters * mean);
}

// Transmittance to where a cell's light is taken (march.wgsl), and its mean over the cell.
fn keep(cell: vec3i, seen: f32, mean: f32) {
    if (front.step & LAST) == 0u { return; }
    let index = (u32(cell.z) * front.cells.y + u32(cell.y)) * front.cells.x + u32(cell.x);
    transmittances[front.slot + index] = pack2x16unorm(clamp(vec2f(seen, mean), vec2f(0.0), vec2f(1.0)));
}

// On which axes the light stands within the grid.
fn light_within() -> vec3<bool> {
    return (front.light >= vec3f(0.0)) & (front.light <= vec3f(front.cells));
}

// Of a cell in the front so many steps from the start.
fn place_of(cell: vec3i, steps: u32) -> u32 {
    let side = select(0u, 1u, cell.x < i32(front.start.x));
    return ((2u * (steps & 1u) + side) * front.cells.z + u32(cell.z)) * front.cells.y + u32(cell.y);
}
