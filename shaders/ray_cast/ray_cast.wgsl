// Ray caster: L = T * background + integral of T * (sigma_s L_i + sigma_a L_e) dt.
//
// The chord of the ray through the volume's box is cut into equal steps; the lattice depends on
// camera, volume and quality alone, never on the transfer function. The field is read at the ends
// of each step and taken as linear between them; where it crosses control points of the transfer
// function the step is split, and within each part extinction is integrated exactly:
// alpha = 1 - exp(-(sigma_a + sigma_b) / 2 * length). Steps of the transfer function, thin peaks
// and homogeneous matter are therefore exact for a linear field; the error is of second order in
// the step.
// Skipping drops only steps within macrocells whose bins hold no matter: their extinction is
// exactly zero and the image does not change by a bit.

@group(0) @binding(5) var<storage, read_write> film: array<vec4f>;
// Pairs of low and high words: samples (steps) taken, skipped, on the lattice; parts with matter;
// view-ray segments kept, cast.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;

// What a pixel shows.
override MODE: u32 = 0u;
const VOLUME = 0u;
const MAXIMUM = 1u;
const MINIMUM = 2u;
const AVERAGE = 3u;
const ISOSURFACE = 4u;
const SLICE = 5u;

// Keeps a quotient of extinctions finite.
const SMALLEST_EXTINCTION = 1e-30;

const COUNTERS = 6u;
var<workgroup> group_counts: array<atomic<u32>, COUNTERS>;

@compute @workgroup_size(8, 8)
fn ray_cast(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = id.z;
    // taken, skipped, on the lattice, with matter
    var counts = vec4u(0u);
    // Invocations beyond the edge march the last pixel's ray and drop the result: a loop that no
    // lane of a vector takes part in runs to its bound on Mesa 22's software device.
    let inside = id.x < frame.image.x && id.y < frame.row_count;
    let column = min(id.x, frame.image.x - 1u);
    let pixel = vec2u(column, frame.first_row + min(id.y, frame.row_count - 1u));
    let index = pixel.y * frame.image.x + pixel.x;
    let radiance = seen(camera_ray(vec2f(pixel) + frame.subpixel), index, inside, &counts);
    if inside {
        if steering(frame.sample_index) == 0u {
            film[index] = vec4f(radiance, 1.0);
        } else {
            film[index] += vec4f(radiance, 1.0);
        }
    } else {
        counts = vec4u(0u);
        segment_counts = vec2u(0u);
    }
    for (var i = 0u; i < 4u; i++) {
        atomicAdd(&group_counts[i], counts[i]);
    }
    if KEEP_SEGMENTS {
        atomicAdd(&group_counts[4], segment_counts.x);
        atomicAdd(&group_counts[5], segment_counts.y);
    }
    workgroupBarrier();
    if lane < COUNTERS {
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

// `keep`: whether what is found out about the pixel may be written down.
fn seen(eye_ray: Ray, pixel_index: u32, keep: bool, counts: ptr<function, vec4u>) -> vec3f {
    let way = way_of(eye_ray);
    if !way.meets { return frame.background; }
    (*counts).z += u32(max(way.end - way.first, 0.0));
    if MODE == VOLUME {
        if KEEP_SEGMENTS { return through_segments(way, pixel_index, keep, counts); }
        let all = integrate(way, way.first, way.end, counts);
        return all.xyz + select(all.w, 0.0, all.w < frame.termination) * frame.background;
    }
    if MODE == ISOSURFACE { return isosurface(way, counts); }
    return values(way, counts);
}

// Radiance from steps first .. end of the lattice, and their transmittance. Summed up segment by
// segment (segments.wgsl), so that whole rays and kept segments add the same numbers in the same
// order.
fn integrate(way: Way, first: f32, end: f32, counts: ptr<function, vec4u>) -> vec4f {
    let ray = way.ray;
    let w_o = -ray.direction;
    // Of the segments before, and of this one.
    var radiance_before = vec3f(0.0);
    var transmittance_before = 1.0;
    var radiance = vec3f(0.0);
    var transmittance = 1.0;
    var segment = segment_of(way, first);
    var march = March(first, first, FieldPoint(), FieldPoint(), false, false);
    // Two loops, because the software device executes all branches of a loop for all lanes: the
    // inner one is short.
    while march.k < end {
        var found = march.within_step;
        while march.k < end && !found {
            if !begin_step(way, end, &march, counts) { continue; }
            found = !is_empty(march.near, march.far);
            if !found {
                march.near = march.far;
                march.near_is_known = true;
                march.k += 1.0;
            }
        }
        if !found { break; }
        let now_in = segment_of(way, march.k);
        if now_in != segment {
            radiance_before += transmittance_before * radiance;
            transmittance_before *= transmittance;
            radiance = vec3f(0.0);
            transmittance = 1.0;
            segment = now_in;
            if transmittance_before < frame.termination { break; }
        }
        let near = march.near;
        let part = first_part(near, march.far);
        let optical_depth = 0.5 * (part.sigma_t.x + part.sigma_t.y) * (part.end.t - near.t);
        march.near = part.end;
        march.near_is_known = true;
        march.within_step = !part.ends_step;
        march.k += select(0.0, 1.0, part.ends_step);
        if optical_depth > 0.0 {
            (*counts).w += 1u;
            let through = exp(-optical_depth);
            let weight = centre_of_light(part.sigma_t, optical_depth);
            let x = ray.origin + mix(near.t, part.end.t, weight) * ray.direction;
            let place = place_in(part.piece, mix(near.s, part.end.s, weight));
            let albedo = albedo_at(place);
            let material = materials[place.material];
            var gradient = vec3f(0.0);
            if SURFACES {
                if material.surface > 0.0 { gradient = gradient_at(x / frame.size_world + 0.5); }
            }
            var source = scattered_radiance(x, w_o, albedo, material, gradient);
            if EMISSION { source += (1.0 - albedo) * emission_at(place); }
            radiance += transmittance * (1.0 - through) * source;
            transmittance *= through;
            if transmittance < frame.termination { break; }
        }
    }
    radiance_before += transmittance_before * radiance;
    return vec4f(radiance_before, transmittance_before * transmittance);
}

// Where a ray has got to: what is left of step k is from `near`, on the lattice or where the field
// crosses a control point, to `far`.
struct March {
    k: f32,
    // The first lattice point whose macrocell has not been looked up yet.
    unknown: f32,
    near: FieldPoint,
    far: FieldPoint,
    near_is_known: bool,
    within_step: bool,
}

// Reads the field at the ends of step k; or leaps on, and returns false.
fn begin_step(way: Way, end: f32, march: ptr<function, March>, counts: ptr<function, vec4u>) -> bool {
    let k = (*march).k;
    var unknown = (*march).unknown;
    let next = min(leap(way, k, &unknown), end);
    (*march).unknown = unknown;
    if next > k {
        (*counts).y += u32(next - k);
        (*march).k = next;
        (*march).near_is_known = false;
        return false;
    }
    (*counts).x += 1u;
    let t = distance_at(way, k);
    let next_t = distance_at(way, k + 1.0);
    if FILTER == 2u {
        // Not interpolated: one voxel's matter for the whole step.
        (*march).far = field_at(way.ray, 0.5 * (t + next_t));
        (*march).near = (*march).far;
        (*march).near.t = t;
        (*march).far.t = next_t;
        return true;
    }
    if !(*march).near_is_known { (*march).near = field_at(way.ray, t); }
    (*march).far = field_at(way.ray, next_t);
    return true;
}

// Where along a part of given extinction at its ends and optical depth what is linear along it has
// its mean, weighted by the light that reaches the eye from there (0: near end, 1: far end). In
// thin matter the centre of extinction, in dense matter the skin.
fn centre_of_light(sigma_t: vec2f, optical_depth: f32) -> f32 {
    let near_share = sigma_t.x / max(sigma_t.x + sigma_t.y, SMALLEST_EXTINCTION);
    // Mean optical depth, by the light from there, as a share of the whole.
    let mean_depth = select(1.0 / optical_depth - 1.0 / (exp(optical_depth) - 1.0),
        0.5 - optical_depth / 12.0, optical_depth < 0.05);
    let thin = (2.0 - near_share) / 3.0 - share_at_depth(near_share, 0.5);
    return share_at_depth(near_share, mean_depth) + 2.0 * mean_depth * thin;
}

// Share of the length after which a share of the optical depth is reached, for extinction that is
// linear along it: the root of (1 - 2n) x^2 + 2n x = depth.
fn share_at_depth(near_share: f32, depth: f32) -> f32 {
    let root = sqrt(max(near_share * near_share + (1.0 - 2.0 * near_share) * depth, 0.0));
    return depth / max(near_share + root, 1e-10);
}

struct FieldPoint {
    t: f32,
    s: f32,
    extinction: TableEntry,
}

fn field_at(ray: Ray, t: f32) -> FieldPoint {
    let s = s_of_texel(texel_value(uvw_at(ray, t)));
    return FieldPoint(t, s, table_entry(s));
}

// Whether a step lies in one piece of the transfer function, without extinction.
fn is_empty(near: FieldPoint, far: FieldPoint) -> bool {
    return one_piece(near.extinction, far.extinction)
        && near.extinction.sigma_t + far.extinction.sigma_t <= 0.0;
}

// The first part of a step on which s, taken as linear along the step, stays within one piece of
// the transfer function: extinction, albedo and emission are linear there.
struct Part {
    end: FieldPoint,
    ends_step: bool,
    // Extinction at both ends, within the piece.
    sigma_t: vec2f,
    piece: i32,
}

fn first_part(near: FieldPoint, far: FieldPoint) -> Part {
    if one_piece(near.extinction, far.extinction) {
        return Part(far, true, vec2f(near.extinction.sigma_t, far.extinction.sigma_t), near.extinction.point);
    }
    let rising = far.s >= near.s;
    let piece = piece_from(near.s, rising, near.extinction.point);
    let border = select(piece_interval(piece).x, piece_interval(piece).y, rising);
    let ends_step = select(far.s >= border, far.s <= border, rising);
    var end = far;
    if !ends_step {
        end.s = border;
        end.t = mix(near.t, far.t, (border - near.s) / (far.s - near.s));
        // The entry is the far point's: no longer one piece with any, and the search starts there.
        end.extinction = TableEntry(0.0, piece, true);
    }
    return Part(end, ends_step, vec2f(sigma_t_in(piece, near.s), sigma_t_in(piece, end.s)), piece);
}
