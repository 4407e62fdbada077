// A view ray's way through the volume: its lattice of sample positions, and the leaps over blocks
// in which there is nothing to see.

@group(0) @binding(9) var distance_map: texture_3d<u32>;

const MACROCELL_EDGE = 4.0;
// A leap lands this far (world units) before the border it aims at: rounding in t.
const LEAP_MARGIN_WORLD = 2e-6;

// Lattice points lie at distances (k - shift) * step, k = 0, 1, ..., cut to what is kept of the ray;
// step k lies between the points k and k + 1. Steps first .. end cover what is kept.
struct Way {
    // From where the ray enters the box.
    ray: Ray,
    step: f32,
    shift: f32,
    kept: vec2f,
    first: f32,
    end: f32,
    // Whether anything is kept.
    meets: bool,
}

fn way_of(eye_ray: Ray) -> Way {
    let enter = max(box_interval(eye_ray, -0.5 * frame.size_world, 0.5 * frame.size_world).x, 0.0);
    // From the box on, so that a distant eye costs no precision.
    let ray = Ray(eye_ray.origin + enter * eye_ray.direction, eye_ray.direction);
    let chord = box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y;
    let kept = clip_interval(ray, vec2f(0.0, chord));
    var way = Way();
    if !(chord > 0.0 && kept.y > kept.x) { return way; }
    let steps = ceil(chord / frame.step_world);
    way = Way(ray, chord / steps, frame.lattice_shift, kept, 0.0, 0.0, true);
    way.first = max(floor(index_at(way, kept.x)), 0.0);
    way.end = min(ceil(index_at(way, kept.y)), steps + 1.0);
    return way;
}

fn distance_at(way: Way, k: f32) -> f32 {
    return clamp((k - way.shift) * way.step, way.kept.x, way.kept.y);
}

fn index_at(way: Way, t: f32) -> f32 {
    return t / way.step + way.shift;
}

fn uvw_at(ray: Ray, t: f32) -> vec3f {
    return (ray.origin + t * ray.direction) / frame.size_world + 0.5;
}

// The lattice point at or after k from which on there may be something to see. `unknown` is the
// first point whose macrocell has not been looked up yet.
fn leap(way: Way, k: f32, unknown: ptr<function, f32>) -> f32 {
    if steering(frame.skip_empty) == 0u { return k; }
    return leap_by(distance_map, way, k, unknown);
}

// The same by any map of distances to marked cells.
fn leap_by(map: texture_3d<u32>, way: Way, k: f32, unknown: ptr<function, f32>) -> f32 {
    if k < *unknown { return k; }
    let uvw = uvw_at(way.ray, distance_at(way, k));
    let distance = cell_distance(map, uvw);
    let leave = index_at(way, block_end(way.ray, uvw, max(distance, 1.0)));
    if distance == 0.0 {
        // This cell may show something: no look-up until the ray has left it.
        *unknown = ceil(leave);
        return k;
    }
    return clamp(floor(leave), k, way.end);
}

// Cells to the nearest marked cell, 0 in such a cell.
fn cell_distance(map: texture_3d<u32>, uvw: vec3f) -> f32 {
    let cells = vec3i(textureDimensions(map));
    let cell = vec3i(floor(uvw * frame.voxels / MACROCELL_EDGE));
    return f32(textureLoad(map, clamp(cell, vec3i(0), cells - 1), 0).x);
}

// Distance at which the ray leaves the block of cells closer than `distance` to the cell at uvw.
fn block_end(ray: Ray, uvw: vec3f, distance: f32) -> f32 {
    let cell = floor(uvw * frame.voxels / MACROCELL_EDGE);
    let world_from_cell = MACROCELL_EDGE * frame.size_world / frame.voxels;
    let low = (cell - (distance - 1.0)) * world_from_cell - 0.5 * frame.size_world;
    let high = (cell + distance) * world_from_cell - 0.5 * frame.size_world;
    return box_interval(ray, low, high).y - LEAP_MARGIN_WORLD;
}
