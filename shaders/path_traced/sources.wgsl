// Light as it arrives at a point: looked for towards a light, or met by a ray. Sphere lights shine
// outwards, rectangles and disks to their normal's side; lights do not block one another.

@group(0) @binding(4) var<uniform> sources: array<Source, MAX_LIGHTS>;
// For each texel: the share of draws that stay with it, the texel that takes the others, and the
// density per steradian with which its directions are drawn (alias method; Walker 1977).
@group(0) @binding(12) var environment_draws: texture_2d<f32>;

const MAX_LIGHTS = 64;

struct Source {
    // Position of point and spot, centre of rectangle, disk and sphere.
    position: vec3f,
    kind: u32,
    // The way a directional light or the axis of a spot travels; normal of rectangle and disk.
    direction: vec3f,
    // Rectangle and disk: area. Sphere: radius.
    extent: f32,
    // Irradiance, radiant intensity, radiance or factor of the image, by kind.
    power: vec3f,
    cos_inner: f32,
    // Half the edges of a rectangle.
    half_u: vec3f,
    cos_outer: f32,
    half_v: vec3f,
    pad0: u32,
}

const DIRECTIONAL = 0u;
const POINT = 1u;
const SPOT = 2u;
const RECTANGLE = 3u;
const DISK = 4u;
const SPHERE = 5u;
const UNIFORM = 6u;
const IMAGE = 7u;

// Farther than any light with a place.
const FARTHEST = 1e30;

// A direction towards a light.
struct Towards {
    w_i: vec3f,
    distance: f32,
    // Radiance over density; irradiance of lights that have one direction only. 0: no light.
    weight: vec3f,
    // Per steradian; 0 for lights that have one direction only, which no ray meets by chance.
    density: f32,
}

fn towards(index: u32, x: vec3f, bits: vec4u) -> Towards {
    let light = sources[index];
    let u = unit2(bits.zw);
    var chosen = Towards(-light.direction, FARTHEST, light.power, 0.0);
    if light.kind == UNIFORM {
        chosen.w_i = around(vec3f(0.0, 0.0, 1.0), 2.0 * u.x, 2.0 * PI * u.y);
        chosen.density = INVERSE_4PI;
        chosen.weight = light.power / INVERSE_4PI;
    }
    if ENVIRONMENT_IMAGE {
        if light.kind == IMAGE { chosen = towards_image(light.power, bits); }
    }
    if LIGHTS_WITH_A_PLACE {
        if light.kind >= POINT && light.kind <= SPHERE { chosen = towards_place(light, x, u); }
    }
    return chosen;
}

fn towards_place(light: Source, x: vec3f, u: vec2f) -> Towards {
    var nothing = Towards(vec3f(0.0), 0.0, vec3f(0.0), 0.0);
    let to_center = light.position - x;
    if light.kind == SPHERE {
        let cap = cap(to_center, light.extent);
        if cap <= 0.0 { return nothing; }
        let w_i = around(normalize(to_center), u.x * cap, 2.0 * PI * u.y);
        // On the rim rounding may miss the sphere; it is as far away there as its rim.
        let rim = sqrt(max(dot(to_center, to_center) - light.extent * light.extent, 0.0));
        let near = near_side(to_center, light.extent, w_i);
        return Towards(w_i, select(near, rim, near < 0.0), light.power * (2.0 * PI * cap), 1.0 / (2.0 * PI * cap));
    }
    var to_light = to_center;
    if light.kind == RECTANGLE {
        to_light += (2.0 * u.x - 1.0) * light.half_u + (2.0 * u.y - 1.0) * light.half_v;
    } else if light.kind == DISK {
        let azimuth = 2.0 * PI * u.y;
        let tangent = tangent_of(light.direction);
        let across = cos(azimuth) * tangent + sin(azimuth) * cross(light.direction, tangent);
        to_light += sqrt(u.x) * length(light.half_u) * across;
    }
    let squared = dot(to_light, to_light);
    if !(squared > 1e-30) { return nothing; }
    let distance = sqrt(squared);
    let w_i = to_light / distance;
    let cosine = -dot(w_i, light.direction);
    if light.kind >= RECTANGLE {
        if cosine <= 0.0 || light.extent <= 0.0 { return nothing; }
        let density = squared / (cosine * light.extent);
        return Towards(w_i, distance, light.power / density, density);
    }
    let share = select(1.0, cone(cosine, light.cos_inner, light.cos_outer), light.kind == SPOT);
    return Towards(w_i, distance, light.power * (share / squared), 0.0);
}

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

// Share of a spot's intensity at a cosine from its axis.
fn cone(cosine: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    if cosine >= cos_inner { return 1.0; }
    if cosine <= cos_outer { return 0.0; }
    return smoothstep(cos_outer, cos_inner, cosine);
}

// 1 minus the cosine of the cone under which a sphere is seen from outside; 0 from inside.
fn cap(to_center: vec3f, radius: f32) -> f32 {
    let sine_squared = radius * radius / dot(to_center, to_center);
    return select(0.0, sine_squared / (1.0 + sqrt(max(1.0 - sine_squared, 0.0))), sine_squared < 1.0);
}

// Distance to the near side of a sphere that lies ahead; -1 where the direction misses it.
fn near_side(to_center: vec3f, radius: f32, direction: vec3f) -> f32 {
    let along = dot(to_center, direction);
    let miss = to_center - along * direction;
    let depth_squared = radius * radius - dot(miss, miss);
    return select(-1.0, along - sqrt(max(depth_squared, 0.0)), along > 0.0 && depth_squared >= 0.0);
}

// Weight of a direction that was chosen with density `chosen` and might have been with `other`
// (Veach 1997).
fn power_heuristic(chosen: f32, other: f32) -> f32 {
    let ratio = other / chosen;
    return 1.0 / (1.0 + ratio * ratio);
}

fn image_density(towards: vec3f) -> f32 {
    let size = vec2i(textureDimensions(environment));
    let texel = clamp(vec2i(image_place(towards) * vec2f(size)), vec2i(0), size - 1);
    return textureLoad(environment_draws, texel, 0).z;
}

fn towards_image(power: vec3f, bits: vec4u) -> Towards {
    let size = textureDimensions(environment);
    var texel = high_product(bits.x, size.x * size.y);
    let draw = textureLoad(environment_draws, vec2u(texel % size.x, texel / size.x), 0);
    if unit2(bits.yy).x >= draw.x { texel = u32(draw.y); }
    let column = texel % size.x;
    let row = texel / size.x;
    let density = textureLoad(environment_draws, vec2u(column, row), 0).z;
    if density <= 0.0 { return Towards(vec3f(0.0), 0.0, vec3f(0.0), 0.0); }
    let u = unit2(bits.zw);
    // Uniform over the texel's solid angle, in the squared sine of half the polar angle, measured
    // from the nearer pole.
    let mirrored = 2u * row >= size.y;
    let from_pole = f32(select(row, size.y - 1u - row, mirrored));
    let edges = sin(0.5 * PI / f32(size.y) * vec2f(from_pole, from_pole + 1.0));
    let half_sine = mix(edges.x * edges.x, edges.y * edges.y, u.y);
    let cosine = select(1.0, -1.0, mirrored) * (1.0 - 2.0 * half_sine);
    let sine = 2.0 * sqrt(half_sine * (1.0 - half_sine));
    let azimuth = 2.0 * PI * (f32(column) + u.x) / f32(size.x);
    let map = vec3f(sine * sin(azimuth), cosine, -sine * cos(azimuth));
    let w_i = normalize(map.x * frame.map_x + map.y * frame.map_y + map.z * frame.map_z);
    return Towards(w_i, FARTHEST, power * image_radiance(w_i) / density, density);
}

// The upper word of the product.
fn high_product(a: u32, b: u32) -> u32 {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let middle = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let other = (a & 0xffffu) * (b >> 16u) + (middle & 0xffffu);
    return (a >> 16u) * (b >> 16u) + (middle >> 16u) + (other >> 16u);
}
