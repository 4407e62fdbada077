// The environment's image, and what lies behind the volume.

// Radiance, linear RGB, without the light's factor; rows from the top.
@group(0) @binding(20) var environment: texture_2d<f32>;

override ENVIRONMENT_IMAGE: bool = true;

fn seen_behind(direction: vec3f) -> vec3f {
    // One of the two is black.
    var radiance = frame.background;
    if ENVIRONMENT_IMAGE { radiance += frame.backdrop * image_radiance(direction); }
    return radiance;
}

// Column and row of the texel a direction lies in, as fractions 0..1.
fn image_place(towards: vec3f) -> vec2f {
    let map = vec3f(dot(frame.map_x, towards), dot(frame.map_y, towards),
        dot(frame.map_z, towards));
    let turns = atan2(map.x, -map.z) / (2.0 * PI);
    return vec2f(turns - floor(turns), atan2(length(map.xz), map.y) / PI);
}

// Bilinear between texel centres; columns wrap around, rows end.
fn image_radiance(towards: vec3f) -> vec3f {
    let size = vec2i(textureDimensions(environment));
    let place = image_place(towards) * vec2f(size) - 0.5;
    let low = floor(place);
    let part = place - low;
    // Lanes that do not take part may hold anything: they must not read beside the image, either.
    let column = clamp(i32(low.x), -1, size.x - 1);
    let columns = vec2i(select(column, size.x - 1, column < 0), select(column + 1, 0, column + 1 == size.x));
    let rows = clamp(vec2i(i32(low.y)) + vec2i(0, 1), vec2i(0), vec2i(size.y - 1));
    let above = mix(image_texel(columns.x, rows.x), image_texel(columns.y, rows.x), part.x);
    let below = mix(image_texel(columns.x, rows.y), image_texel(columns.y, rows.y), part.x);
    return mix(above, below, part.y);
}

fn image_texel(column: i32, row: i32) -> vec3f {
    return textureLoad(environment, vec2i(column, row), 0).xyz;
}
