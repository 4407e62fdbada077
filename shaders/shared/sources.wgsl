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
    return from_texel(power, vec2u(column, row), unit2(bits.zw), density);
}

// As above, but evenly spread numbers `u` give evenly spread directions: the row by its share and the column
// by its share of the row, and what is left of both within the texel.
fn towards_image_evenly(power: vec3f, u: vec2f) -> Towards {
    let size = textureDimensions(environment);
    let row = first_beyond(u.y, size.y, vec2u(0u, 1u), 0u);
    let column = first_beyond(u.x, size.x, vec2u(1u, 0u), row.index);
    let density = textureLoad(environment_draws, vec2u(column.index, row.index), 0).z;
    if density <= 0.0 { return Towards(vec3f(0.0), 0.0, vec3f(0.0), 0.0); }
    // Rows below the middle are measured upwards.
    let down = select(row.part, 1.0 - row.part, 2u * row.index >= size.y);
    return from_texel(power, vec2u(column.index, row.index), vec2f(column.part, down), density);
}

struct Found {
    index: u32,
    // How far between its running sum and the one before.
    part: f32,
}

// The first of `count` rows, or columns of a row, whose running sum of shares is beyond `u`.
fn first_beyond(u: f32, count: u32, along: vec2u, row: u32) -> Found {
    var low = 0u;
    var high = count - 1u;
    for (var i = 0u; i < 32u && low < high; i++) {
        let middle = (low + high) / 2u;
        if running_sum(middle, along, row) > u { high = middle; } else { low = middle + 1u; }
    }
    let before = select(0.0, running_sum(max(low, 1u) - 1u, along, row), low > 0u);
    let share = running_sum(low, along, row) - before;
    return Found(low, clamp((u - before) / max(share, 1e-30), 0.0, 1.0));
}

fn running_sum(index: u32, along: vec2u, row: u32) -> f32 {
    let texel = along * index + vec2u(0u, row);
    if along.y == 1u { return textureLoad(environment, texel, 0).w; }
    return textureLoad(environment_draws, texel, 0).w;
}

// A direction uniform over a texel's solid angle, in the squared sine of half the polar angle, measured
// from the nearer pole; `u`: along the row, and away from that pole.
fn from_texel(power: vec3f, texel: vec2u, u: vec2f, density: f32) -> Towards {
    let size = textureDimensions(environment);
    let mirrored = 2u * texel.y >= size.y;
    let from_pole = f32(select(texel.y, size.y - 1u - texel.y, mirrored));
    let edges = sin(0.5 * PI / f32(size.y) * vec2f(from_pole, from_pole + 1.0));
    let half_sine = mix(edges.x * edges.x, edges.y * edges.y, u.y);
    let cosine = select(1.0, -1.0, mirrored) * (1.0 - 2.0 * half_sine);
    let sine = 2.0 * sqrt(half_sine * (1.0 - half_sine));
    let azimuth = 2.0 * PI * (f32(texel.x) + u.x) / f32(size.x);
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
