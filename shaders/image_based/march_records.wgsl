// Transmittance along each record's rays, from the record to where light enters (eq. 7 without the
// phase function): exact for a linear field, like the ray caster's. Emission is collected on the way
// (section 4.5 of the paper).

// Distances to cells in which matter changed since the rays were cast.
@group(0) @binding(11) var changed_map: texture_3d<u32>;

const RAY_COUNTERS = 4u;
var<workgroup> group_counts: array<atomic<u32>, RAY_COUNTERS>;

@compute @workgroup_size(64)
fn march_records(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    // Lanes without a ray of their own walk the last one's, an empty way: a loop that no lane of a
    // vector takes part in runs to its bound on Mesa 22's software device.
    let index = 64u * group.x + lane;
    let inside = index < steering(records.count);
    let entry = entries[records.first + min(index, records.count - 1u)];
    let column = group.y;
    let x = position_of_record(cell_of_record(entry.y));
    let todo = columns[column];
    var direction = todo.xyz;
    var end = 1e30;
    if column >= records.directions {
        let light = lights[column - records.directions];
        if light.kind != 0u {
            let to_light = light.position - x;
            let squared = max(dot(to_light, to_light), NEAREST_SQUARED);
            direction = to_light * inverseSqrt(squared);
            end = sqrt(squared);
            // In the light itself there is no direction towards it.
            if dot(to_light, to_light) < NEAREST_SQUARED { direction = vec3f(0.0, 0.0, 1.0); end = 0.0; }
        }
    }
    let ray = Ray(x, direction);
    end = min(end, box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y);
    let kept = clip_interval(ray, vec2f(0.0, end));
    let alive = inside && (entry.y & LEFT) == 0u;
    let from_t = min(kept.x, kept.y);
    let test_to = select(from_t, kept.y, alive && todo.w == TEST);
    let is_cast = alive && (todo.w == CAST || meets_change(ray, from_t, test_to));
    var counts = vec4u(u32(is_cast), u32(alive && !is_cast), 0u, 0u);
    let found = arriving(ray, from_t, select(from_t, kept.y, is_cast), &counts);
    if is_cast {
        rays[ray_slot(0u, column, entry.x)] = found.w;
        if GLOW {
            rays[ray_slot(1u, column, entry.x)] = found.x;
            rays[ray_slot(2u, column, entry.x)] = found.y;
            rays[ray_slot(3u, column, entry.x)] = found.z;
        }
        atomicStore(&renewed[entry.x], 1u);
    }
    for (var i = 0u; i < RAY_COUNTERS; i++) {
        atomicAdd(&group_counts[i], counts[i]);
    }
    workgroupBarrier();
    if lane < RAY_COUNTERS {
        add_to_record_counter(lane, atomicLoad(&group_counts[lane]));
    }
}

// Whether the way meets a cell in which matter changed.
fn meets_change(ray: Ray, from_t: f32, to_t: f32) -> bool {
    let grid = grid_of(ray);
    var t = from_t;
    var met = false;
    while t < to_t && !met {
        let clear_to = clear_until(changed_map, grid, t);
        met = clear_to <= t;
        t = clear_to;
    }
    return met;
}
