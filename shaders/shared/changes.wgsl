// Whether an edit concerns rays.

// Distances to cells in which matter changed since the rays were cast.
@group(0) @binding(11) var changed_map: texture_3d<u32>;

// Where the way first meets a cell in which matter changed; its end if it meets none.
fn first_change(ray: Ray, from_t: f32, to_t: f32) -> f32 {
    let grid = grid_of(ray);
    var t = from_t;
    var met = false;
    while t < to_t && !met {
        let clear_to = clear_until(changed_map, grid, t);
        met = clear_to <= t;
        t = clear_to;
    }
    return min(t, to_t);
}

fn meets_change(ray: Ray, from_t: f32, to_t: f32) -> bool {
    return first_change(ray, from_t, to_t) < to_t;
}
