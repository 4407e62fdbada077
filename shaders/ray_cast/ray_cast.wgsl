// Ray caster: L = T * background + integral of T * (sigma_s L_i + sigma_a L_e) dt.
//
// The chord of the ray through the volume's box is cut into equal steps; the lattice depends on
// camera, volume and quality alone, never on the transfer function. One sample stands at the
// middle of each step (second order); within a step matter is taken as constant, so homogeneous
// matter is exact:  alpha = 1 - exp(-sigma_t * step).
// Skipping drops only samples in macrocells whose bins hold no matter: their extinction is
// exactly zero and the image does not change by a bit.

@group(0) @binding(5) var<storage, read_write> film: array<vec4f>;
// Pairs of low and high words: samples taken, samples skipped, samples on the lattice, samples
// with matter.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(9) var distance_map: texture_3d<u32>;

// Gradients are needed: some material has a surface and there is light.
override SHADED: bool = true;
// Some matter emits.
override EMISSIVE: bool = true;

const MACROCELL_EDGE = 8.0;
// A leap lands this far (world units) before the border it aims at: rounding in t.
const LEAP_MARGIN_WORLD = 2e-6;

var<workgroup> group_counts: array<atomic<u32>, 4>;

@compute @workgroup_size(8, 8)
fn ray_cast(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    // taken, skipped, on the lattice, with matter
    var counts = vec4u(0u);
    if id.x < frame.image.x && id.y < frame.row_count {
        let pixel = vec2u(id.x, frame.first_row + id.y);
        let radiance = integrate(camera_ray(vec2f(pixel) + frame.subpixel), &counts);
        let index = pixel.y * frame.image.x + pixel.x;
        if frame.sample_index == 0u {
            film[index] = vec4f(radiance, 1.0);
        } else {
            film[index] += vec4f(radiance, 1.0);
        }
    }
    for (var i = 0u; i < 4u; i++) {
        atomicAdd(&group_counts[i], counts[i]);
    }
    workgroupBarrier();
    if lane < 4u {
        add_to_counter(lane, atomicLoad(&group_counts[lane]));
    }
}

// 64-bit sum in two words.
fn add_to_counter(counter: u32, amount: u32) {
    let before = atomicAdd(&counters[2u * counter], amount);
    if before + amount < before {
        atomicAdd(&counters[2u * counter + 1u], 1u);
    }
}

fn integrate(ray: Ray, counts: ptr<function, vec4u>) -> vec3f {
    let box = box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world);
    let enter = max(box.x, 0.0);
    let chord = box.y - enter;
    if !(chord > 0.0) { return frame.background; }
    let steps = ceil(chord / frame.step_world);
    let step = chord / steps;
    let kept = clip_interval(ray, vec2f(enter, box.y));
    if !(kept.y > kept.x) { return frame.background; }

    // Step k covers enter + (k - shift) * step and one step further, cut to what is kept.
    let shift = frame.lattice_shift;
    var k = max(floor((kept.x - enter) / step + shift), 0.0);
    let last = min(ceil((kept.y - enter) / step + shift), steps + 1.0) - 1.0;
    (*counts).z += u32(max(last - k + 1.0, 0.0));

    let w_o = -ray.direction;
    // The first step whose macrocell has not been looked up yet.
    var unknown = k;
    var transmittance = 1.0;
    var radiance = vec3f(0.0);
    while k <= last {
        let start = max(enter + (k - shift) * step, kept.x);
        let end = min(enter + (k + 1.0 - shift) * step, kept.y);
        let x = ray.origin + 0.5 * (start + end) * ray.direction;
        let uvw = x / frame.size_world + 0.5;

        if frame.skip_empty == 1u && k >= unknown {
            let distance = cell_distance(uvw);
            if distance > 0.0 {
                let next = max(leap(ray, uvw, distance, enter, step, shift), k + 1.0);
                (*counts).y += u32(min(next, last + 1.0) - k);
                k = next;
                unknown = k;
                continue;
            }
            // This cell holds matter: no look-up until the ray has left it.
            unknown = leap(ray, uvw, 1.0, enter, step, shift);
        }

        (*counts).x += 1u;
        k += 1.0;
        let s = s_of_texel(texel_value(uvw));
        let sigma_t = sigma_t_at(s);
        if sigma_t <= 0.0 || end <= start { continue; }
        (*counts).w += 1u;
        let through = exp(-sigma_t * (end - start));
        let place = place_of(s);
        let albedo = albedo_at(place);
        let material = materials[place.material];
        var gradient = vec3f(0.0);
        if SHADED {
            if material.surface > 0.0 { gradient = gradient_at(uvw); }
        }
        var source = scattered_radiance(x, w_o, albedo, material, gradient);
        if EMISSIVE { source += (1.0 - albedo) * emission_at(place); }
        radiance += transmittance * (1.0 - through) * source;
        transmittance *= through;
        if transmittance < frame.termination { return radiance; }
    }
    return radiance + transmittance * frame.background;
}

// Cells to the nearest cell with matter, 0 in such a cell.
fn cell_distance(uvw: vec3f) -> f32 {
    let cells = vec3i(textureDimensions(distance_map));
    let cell = vec3i(floor(uvw * frame.voxels / MACROCELL_EDGE));
    return f32(textureLoad(distance_map, clamp(cell, vec3i(0), cells - 1), 0).x);
}

// First step whose middle lies beyond the block of cells closer than `distance`.
fn leap(ray: Ray, uvw: vec3f, distance: f32, enter: f32, step: f32, shift: f32) -> f32 {
    let cell = floor(uvw * frame.voxels / MACROCELL_EDGE);
    let world_from_cell = MACROCELL_EDGE * frame.size_world / frame.voxels;
    let low = (cell - (distance - 1.0)) * world_from_cell - 0.5 * frame.size_world;
    let high = (cell + distance) * world_from_cell - 0.5 * frame.size_world;
    let leave = box_interval(ray, low, high).y - LEAP_MARGIN_WORLD;
    return ceil((leave - enter) / step + shift - 0.5);
}
