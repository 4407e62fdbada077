// What was gathered into the film: over the extinction in the kernel, in order along the ray.

@group(0) @binding(5) var<storage, read_write> film: array<vec4f>;
// Extinction times the kernel's tents about each place of the lattice, integrated over the volume.
@group(0) @binding(18) var extinction_around: texture_3d<f32>;

// Below this nothing is known.
const LEAST_EXTINCTION = 1e-20;

@compute @workgroup_size(8, 8)
fn add_gathered(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let id = pixel_of_lane(group.xy, lane);
    let inside = id.x < frame.image.x && id.y < frame.row_count;
    let pixel = vec2u(min(id.x, frame.image.x - 1u), frame.first_row + min(id.y, frame.row_count - 1u));
    let stride = frame.image.x * frame.row_count;
    let place = place_of_pixel(pixel);
    let count = select(0u, seen_parts[place].count, inside);
    var radiance = vec3f(0.0);
    for (var i = 0u; i < PARTS; i++) {
        if i < count {
            let part = seen_parts[i * stride + place];
            let mass = extinction_in_kernel(middle_of(lattice_of(part.x)));
            radiance += part.weight * part.gathered * select(0.0, 1.0 / mass, mass > LEAST_EXTINCTION);
        }
    }
    if inside {
        let index = pixel.y * frame.image.x + pixel.x;
        film[index] += vec4f(radiance, 0.0);
    }
}

fn extinction_in_kernel(middle: Middle) -> f32 {
    let last = vec3i(textureDimensions(extinction_around)) - 1;
    var sum = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let upper = vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u);
        let near = select(1.0 - middle.part, middle.part, upper == vec3u(1u));
        let place = clamp(vec3i(middle.low) + vec3i(upper), vec3i(0), last);
        sum += near.x * near.y * near.z * textureLoad(extinction_around, place, 0).x;
    }
    return sum;
}
