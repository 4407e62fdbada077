// A place in the volume: the matter there, and whether it is clipped away.

// The piece of the transfer function that holds at s, if `wanted`: the last control point at or
// below it. Loops end by their bounds: see `ray_cast` in ray_cast/ray_cast.wgsl.
fn piece_of(s: f32, wanted: bool) -> i32 {
    let entry = table_entry(s);
    var piece = entry.point;
    let last = i32(steering(frame.point_count)) - 1;
    var more = select(0, last - piece, wanted && entry.split);
    for (var i = 0; i < more; i++) {
        let next = begins_below(piece + 1, s, true);
        piece += select(0, 1, next);
        more = select(0, more, next);
    }
    return piece;
}

// Whether matter at a place is not clipped away.
fn keeps(x: vec3f) -> bool {
    var inside = all(x >= frame.clip_low) && all(x <= frame.clip_high);
    for (var i = 0u; i < steering(frame.plane_count); i++) {
        inside = inside && dot(frame.planes[i].xyz, x) >= frame.planes[i].w;
    }
    return inside;
}
