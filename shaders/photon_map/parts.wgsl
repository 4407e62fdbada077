// Parts of view rays with matter in them, for which light is still to be gathered: `ray_cast` writes them
// down, `gather_photons` sums up what is scattered there, `add_gathered` puts it into the film.

// Parts of a ray that are written down in one dispatch.
const PARTS = 64u;

struct SeenPart {
    x: vec3f,
    material: u32,
    albedo: vec3f,
    // Weight of the BRDF against the phase function.
    surface: f32,
    // Normal on the side of the eye.
    n: vec3f,
    // With a ray's first part: its parts that are written down.
    count: u32,
    // What the film has of what is scattered here.
    weight: vec3f,
    pad0: u32,
    // Of the photons so far: flux that is scattered towards the eye, times the kernel.
    gathered: vec3f,
    pad1: u32,
}

// The i-th part of each pixel of the dispatch behind the (i - 1)-th of all.
@group(0) @binding(17) var<storage, read_write> seen_parts: array<SeenPart>;

// A pixel's place in a dispatch of whole rows.
fn place_of_pixel(pixel: vec2u) -> u32 {
    return (pixel.y - frame.first_row) * frame.image.x + pixel.x;
}

// Eight lanes that a processor executes in step are 4 x 2 neighbours, not a row.
fn pixel_of_lane(group: vec2u, lane: u32) -> vec2u {
    return 8u * group + vec2u((lane & 3u) | ((lane >> 1u) & 4u), ((lane >> 2u) & 1u) | ((lane >> 3u) & 6u));
}
