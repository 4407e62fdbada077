// Where light from infinity enters the volume's box.

// A place on the faces of the box that are turned to the light, each by what it shows, in edges of the box from
// its middle. `u.x` is used up from the front: for the face, and for the first place along it.
fn on_faces(way: vec3f, shown: vec3f, u: vec2f) -> vec3f {
    let turned = select(vec3f(-0.5), vec3f(0.5), way < vec3f(0.0));
    let at = u.x * (shown.x + shown.y + shown.z);
    if at < shown.x { return vec3f(turned.x, at / shown.x - 0.5, u.y - 0.5); }
    if at < shown.x + shown.y { return vec3f(u.y - 0.5, turned.y, (at - shown.x) / shown.y - 0.5); }
    let last = clamp((at - shown.x - shown.y) / max(shown.z, 1e-30), 0.0, 1.0);
    return vec3f(last - 0.5, u.y - 0.5, turned.z);
}
