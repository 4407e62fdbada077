// How much of a light reaches a place: exact for a linear field over the last bit of the way, where
// matter's own skin shades it; from there on by interpolation between nodes (README.md).

// Parts of the last bit of the way: a constant, for Mesa 22's software device crashes on a bound that
// is loaded.
override NEAR_PARTS: u32 = 4u;

// Of the ray caster's table of lights; `w_i` as `incident_light` has it.
fn transmittance_from(light: u32, x: vec3f, w_i: vec3f) -> f32 {
    let ray = Ray(x, w_i);
    var end = field.near;
    if LIGHTS_WITH_A_PLACE {
        if lights[light].kind != 0u { end = min(end, length(lights[light].position - x)); }
    }
    end = max(min(end, box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world).y), 0.0);
    var kept = vec2f(0.0, end);
    if field.clip_blocks == 0u { kept = clip_interval(ray, kept); }
    kept.y = max(kept.x, kept.y);
    let near = exp(-depth_between(ray, kept));
    return near * share_of(lights[light].slot, x + end * w_i);
}

// Optical depth of a way of a few voxels. (Loops end by their bounds: see `piece_of`.)
fn depth_between(ray: Ray, way: vec2f) -> f32 {
    var depth = 0.0;
    if NEAR_PARTS == 0u { return depth; }
    if FILTER == 2u {
        let grid = grid_of(ray);
        var cell = cell_at(grid, way.x);
        var t = way.x;
        for (var i = 0u; i < NEAR_PARTS; i++) {
            let s = s_of_texel(voxel_of(grid, cell));
            let leave = leaves_at(grid, cell);
            let end = clamp(smallest(leave), t, way.y);
            let at = field_point(t, s);
            let part = first_part(at, at);
            depth += part.sigma_t.x * (end - t);
            cell += axis_of_smallest(leave);
            t = end;
        }
        return depth;
    }
    var near = field_point(way.x, s_of_texel(texel_value(uvw_at(ray, way.x))));
    var next = 1u;
    // Where control points split parts there are more turns than parts.
    for (var i = 0u; i < 2u * NEAR_PARTS; i++) {
        let t = mix(way.x, way.y, f32(min(next, NEAR_PARTS)) / f32(NEAR_PARTS));
        let part = first_part(near, field_point(t, s_of_texel(texel_value(uvw_at(ray, t)))));
        depth += 0.5 * (part.sigma_t.x + part.sigma_t.y) * (part.end.t - near.t);
        next += select(0u, 1u, part.ends_step);
        near = part.end;
    }
    return max(depth, 0.0);
}
