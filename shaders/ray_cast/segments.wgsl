// View-ray segments: what a ray met, kept in pieces, so that an edit of matter casts anew only the
// pieces it touches.
//
// A ray is divided into SEGMENTS parts of equal length. Of each its own radiance and
// transmittance are kept, whatever lies before it, and put together from the eye on:
// L = sum of T_before * L_segment, T_before = product of the transmittances before.
// A kept segment is stale if the ray meets, within it, a macrocell that holds a bin in which matter
// changed: the ray is led over the distance map of such cells as it is over the one of emptiness,
// and what is not leapt over may have changed. So nothing need be noted down while casting.
// A segment behind the place where the ray ends is not cast; if it is stale, it is forgotten.

// Per segment and pixel, and for the sum of a pixel's segments, the bits of radiance and transmittance, the sign bit of the latter set; all
// zero: not known.
@group(0) @binding(10) var<storage, read_write> segments: array<vec4u>;
// Distances to cells in which matter changed since the kept segments were cast.
@group(0) @binding(11) var changed_map: texture_3d<u32>;

// Segments of a ray.
override SEGMENTS: u32 = 1u;
// Whether they are kept; else rays are cast whole.
override KEEP_SEGMENTS: bool = false;
const KNOWN = 0x80000000u;

// Kept, whether they are seen or not; cast.
var<private> segment_counts: vec2u;

fn through_segments(way: Way, pixel_index: u32, keep: bool, counts: ptr<function, vec4u>) -> vec3f {
    let pixels = frame.image.x * frame.image.y;
    let stale = stale_segments(way);
    // After the segments: what they come to, put together.
    let sum_slot = SEGMENTS * pixels + pixel_index;
    let sum = segments[sum_slot];
    var radiance = bitcast<vec3f>(sum.xyz);
    var transmittance = bitcast<f32>(sum.w & ~KNOWN);
    let is_current = stale == 0u && sum.w != 0u;
    if is_current {
        segment_counts.x = SEGMENTS;
    } else {
        radiance = vec3f(0.0);
        transmittance = 1.0;
    }
    var i = select(0u, SEGMENTS, is_current);
    while i < SEGMENTS {
        // On over what is known, and over what is not seen.
        var needed = false;
        while i < SEGMENTS && !needed {
            let slot = i * pixels + pixel_index;
            let is_stale = (stale & (1u << i)) != 0u;
            let segment = select(segments[slot], vec4u(0u), is_stale);
            let seen = transmittance >= frame.termination;
            needed = seen && segment.w == 0u;
            if segment.w != 0u { segment_counts.x += 1u; }
            if seen && !needed {
                radiance += transmittance * bitcast<vec3f>(segment.xyz);
                transmittance *= bitcast<f32>(segment.w & ~KNOWN);
            }
            if !needed {
                if keep && is_stale { segments[slot] = segment; }
                i++;
            }
        }
        // Lanes that need nothing walk an empty way (see `ray_cast`).
        let first = segment_start(way, min(i, SEGMENTS - 1u));
        let end = segment_end(way, min(i, SEGMENTS - 1u));
        let found = integrate(way, first, select(first, end, needed), counts);
        if needed {
            if keep { segments[i * pixels + pixel_index] = bitcast<vec4u>(found) | vec4u(0u, 0u, 0u, KNOWN); }
            segment_counts.y += 1u;
            radiance += transmittance * found.xyz;
            transmittance *= found.w;
            i++;
        }
    }
    if keep && !is_current {
        segments[sum_slot] = vec4u(bitcast<vec3u>(radiance), bitcast<u32>(transmittance) | KNOWN);
    }
    return radiance + select(transmittance, 0.0, transmittance < frame.termination) * seen_behind(way.ray.direction);
}

// Where segment i begins.
fn segment_start(way: Way, i: u32) -> f32 {
    return mix(way.kept.x, way.kept.y, f32(i) / f32(SEGMENTS));
}

fn segment_end(way: Way, i: u32) -> f32 {
    if i + 1u >= SEGMENTS { return way.kept.y; }
    return segment_start(way, i + 1u);
}

// The segment that begins at a distance or holds it.
fn segment_at(way: Way, t: f32) -> u32 {
    let share = (t - way.kept.x) / (way.kept.y - way.kept.x);
    let i = u32(clamp(share * f32(SEGMENTS), 0.0, f32(SEGMENTS - 1u)));
    // The quotient may round across the border.
    if t >= segment_end(way, i) { return min(i + 1u, SEGMENTS - 1u); }
    if t < segment_start(way, i) { return i - 1u; }
    return i;
}

// A bit for each segment that may have changed.
fn stale_segments(way: Way) -> u32 {
    var stale = 0u;
    var t = way.kept.x;
    // Without kept segments everything is stale, and there is nothing to walk for.
    let grid = grid_of(way.ray);
    let end = select(t, way.kept.y, steering(frame.segments_kept) != 0u);
    while t < end {
        let clear_to = clear_until(changed_map, grid, t);
        if clear_to > t {
            t = clear_to;
        } else {
            let segment = segment_at(way, t);
            stale |= 1u << segment;
            // What else the segment holds does not matter.
            t = segment_end(way, segment);
        }
    }
    return select(0xffffffffu, stale, end > way.kept.x);
}
