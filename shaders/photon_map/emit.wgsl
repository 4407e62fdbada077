// Photons leave a light towards the volume's box, or the sphere around it, wherever in it there is matter:
// neither clipping nor the transfer function changes them. What a light sends is divided by its power and by
// `photons.reference`, so that throughputs begin near 1 whatever the light.

fn emitted(photon: vec2u) -> Path {
    var path = Path();
    path.stage = DONE;
    let light = sources[steering(photons.light)];
    let u = unit4(sobol4(photon.x, photon.y));
    var way = light.direction;
    var throughput = vec3f(1.0);
    var origin = light.position;
    // Lights at infinity shine on the faces of the box that are turned to them, each by what it shows.
    let at_infinity = light.kind == DIRECTIONAL || light.kind == UNIFORM || light.kind == IMAGE;
    if light.kind == UNIFORM { way = around(vec3f(0.0, 0.0, 1.0), 2.0 * u.x, 2.0 * PI * u.y); }
    if ENVIRONMENT_IMAGE {
        if light.kind == IMAGE {
            let chosen = towards_image_evenly(vec3f(1.0), u.xy);
            way = -chosen.w_i;
            throughput = chosen.weight / photons.reference;
        }
    }
    if at_infinity {
        let shown = abs(way) * frame.size_world.yzx * frame.size_world.zxy;
        let all = shown.x + shown.y + shown.z;
        origin = on_faces(way, shown, u.zw) * frame.size_world;
        throughput *= all / (PI * photons.radius * photons.radius);
    } else if light.kind == POINT || light.kind == SPOT {
        let chosen = from_place(light.position, light.direction, 0.0, u, photons.radius, light);
        way = chosen.way;
        origin = chosen.origin;
        throughput = vec3f(chosen.weight / photons.reference);
    } else {
        let start = place_on(light, u);
        let chosen = from_place(start.place, start.normal, 1.0, u, photons.radius, light);
        way = chosen.way;
        origin = chosen.origin;
        throughput = vec3f(chosen.weight / photons.reference);
    }
    // A photon that brings nothing is at its end.
    path.stage = select(DONE, FLIGHT + TO_BEGIN, max_of(throughput) > 0.0 && max_of(throughput) < 1e6);
    path.origin = origin;
    path.direction = way;
    path.throughput = throughput;
    path.end = FARTHEST;
    return path;
}

struct Start {
    place: vec3f,
    normal: vec3f,
}

// A place on a light with an extent, evenly.
fn place_on(light: Source, u: vec4f) -> Start {
    var start = Start(light.position, light.direction);
    if light.kind == RECTANGLE {
        start.place += (2.0 * u.x - 1.0) * light.half_u + (2.0 * u.y - 1.0) * light.half_v;
    } else if light.kind == DISK {
        let azimuth = 2.0 * PI * u.y;
        let tangent = tangent_of(light.direction);
        let across = cos(azimuth) * tangent + sin(azimuth) * cross(light.direction, tangent);
        start.place += sqrt(u.x) * length(light.half_u) * across;
    } else {
        start.normal = around(vec3f(0.0, 0.0, 1.0), 2.0 * u.x, 2.0 * PI * u.y);
        start.place += light.extent * start.normal;
    }
    return start;
}

struct Emitted {
    origin: vec3f,
    way: vec3f,
    // Intensity over density.
    weight: f32,
}

// From a place: into the cone in which the sphere is seen from outside; into the whole sphere, the
// hemisphere (`cosine` = 1) or the spot's cone from inside, and into that cone if it is the narrower.
fn from_place(place: vec3f, axis: vec3f, cosine: f32, u: vec4f, radius: f32, light: Source) -> Emitted {
    let far = dot(place, place) > radius * radius;
    var towards_box = cap(place, radius);
    if !far || towards_box <= 0.0 { towards_box = 2.0; }
    let is_spot = light.kind == SPOT;
    let spot_cap = 1.0 - light.cos_outer;
    let about_axis = cosine > 0.0 && towards_box > 0.99 || is_spot && spot_cap < towards_box;
    var range = towards_box;
    if about_axis { range = select(1.0, spot_cap, is_spot); }
    var middle = vec3f(0.0, 0.0, 1.0);
    if about_axis { middle = axis; } else if far { middle = -normalize(place); }
    let versine = range * u.z;
    let way = around(middle, versine, 2.0 * PI * u.w);
    var weight = 2.0 * PI * range;
    if is_spot { weight *= cone(dot(way, axis), light.cos_inner, light.cos_outer); }
    if cosine > 0.0 { weight *= max(dot(way, axis), 0.0); }
    var origin = place;
    if far && !about_axis {
        // Where it enters the sphere, in coordinates along and across the line to the middle, without
        // differences of large numbers.
        let distance = length(place);
        let sine_squared = versine * (2.0 - versine);
        let depth = sqrt(max(radius * radius - distance * distance * sine_squared, 0.0));
        let c = 1.0 - versine;
        let across = way - c * middle;
        origin = (-distance * sine_squared - depth * c) * middle + (distance * c - depth) * across;
    }
    return Emitted(origin, way, weight);
}
