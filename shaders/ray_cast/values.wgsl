// Measures of the values along a ray, or at a plane, as greys of the window: no matter, no light.

fn values(way: Way, counts: ptr<function, vec4u>) -> vec3f {
    if MODE == SLICE { return slice(way, counts); }
    var t = distance_at(way, way.first);
    var value = s_at(way.ray, t);
    var largest = value;
    var smallest = value;
    // Of the field, linear between lattice points, over the way.
    var integral = 0.0;
    for (var k = way.first; k < way.end; k += 1.0) {
        let next_t = distance_at(way, k + 1.0);
        let next = s_at(way.ray, next_t);
        largest = max(largest, next);
        smallest = min(smallest, next);
        integral += 0.5 * (value + next) * (next_t - t);
        value = next;
        t = next_t;
        (*counts).x += 1u;
    }
    if MODE == MAXIMUM { return grey(largest); }
    if MODE == MINIMUM { return grey(smallest); }
    return grey(integral / (way.kept.y - way.kept.x));
}

// The value where the ray meets the plane; the background where it does not within what is kept.
fn slice(way: Way, counts: ptr<function, vec4u>) -> vec3f {
    let approach = dot(frame.surface.xyz, way.ray.direction);
    if abs(approach) < PARALLEL { return frame.background; }
    let t = (frame.surface.w - dot(frame.surface.xyz, way.ray.origin)) / approach;
    if !(t >= way.kept.x && t <= way.kept.y) { return frame.background; }
    (*counts).x += 1u;
    return grey(s_at(way.ray, t));
}

// The field before it is clamped to what is in view.
fn s_at(ray: Ray, t: f32) -> f32 {
    return frame.s_scale * texel_value(uvw_at(ray, t)) + frame.s_offset;
}

// Radiance that the screen shows as the share s of its grey scale (inverse of the sRGB curve).
fn grey(s: f32) -> vec3f {
    let code = clamp(s, 0.0, 1.0);
    return vec3f(select(pow((code + 0.055) / 1.055, 2.4), code / 12.92, code <= 0.04045));
}
