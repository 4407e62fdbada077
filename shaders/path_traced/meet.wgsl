// Light that a path's ray meets by chance.

// The path finds light of the sources with an extent that its ray meets before `end`, each weighted
// against the chance of having looked for it. Without `looks` none.
fn meet_lights(path: ptr<function, Path>, ray: Ray, end: f32, looks: bool) {
    var sum = vec3f(0.0);
    let count = select(0u, steering(path_tracer.source_count), looks);
    for (var i = 0u; i < count; i++) {
        let light = sources[i];
        var met = vec2f(FARTHEST, 0.0);
        var radiance = light.power;
        if light.kind == UNIFORM { met.y = INVERSE_4PI; }
        if ENVIRONMENT_IMAGE {
            if light.kind == IMAGE {
                met.y = image_density(ray.direction);
                radiance *= image_radiance(ray.direction);
            }
        }
        if LIGHTS_WITH_A_PLACE {
            if light.kind >= RECTANGLE && light.kind <= SPHERE { met = meet(light, ray); }
        }
        if met.y > 0.0 && (met.x < end || end >= FARTHEST) {
            let weighted = radiance * power_heuristic((*path).density, met.y);
            if LIGHT_LAYERS { find(path, i, (*path).throughput * weighted); } else { sum += weighted; }
        }
    }
    if !LIGHT_LAYERS { (*path).radiance += (*path).throughput * sum; }
}

// Distance of a light with a place that a ray meets, and the density with which `towards` would
// have chosen the direction; 0 if it is not met.
fn meet(light: Source, ray: Ray) -> vec2f {
    let to_center = light.position - ray.origin;
    if light.kind == SPHERE {
        let cap = cap(to_center, light.extent);
        let near = near_side(to_center, light.extent, ray.direction);
        return vec2f(near, select(0.0, 1.0 / (2.0 * PI * cap), cap > 0.0 && near >= 0.0));
    }
    let cosine = -dot(ray.direction, light.direction);
    if cosine <= 0.0 || light.extent <= 0.0 { return vec2f(0.0); }
    let distance = -dot(to_center, light.direction) / cosine;
    let off = distance * ray.direction - to_center;
    let u = light.half_u;
    let v = light.half_v;
    let on_rectangle = abs(dot(off, u)) <= dot(u, u) && abs(dot(off, v)) <= dot(v, v);
    let on_light = select(on_rectangle, dot(off, off) <= dot(u, u), light.kind == DISK);
    let density = distance * distance / (cosine * light.extent);
    return vec2f(distance, select(0.0, density, distance > 0.0 && on_light));
}

// Weight of a direction that was chosen with density `chosen` and might have been with `other`
// (Veach 1997).
fn power_heuristic(chosen: f32, other: f32) -> f32 {
    let ratio = other / chosen;
    return 1.0 / (1.0 + ratio * ratio);
}
