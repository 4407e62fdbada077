// The kernel of the gather. Along each axis it is the tent that deposits have, a texel to either side, about
// the two places of the lattice (seen.wgsl) around x, by their distances: so what extinction there is in it is
// interpolated between places exactly, and the quotient of light and matter has one footprint
// (docs/decisions/0040-photons-are-gathered-at-parts-of-rays.md).

@group(0) @binding(13) var<uniform> gather: Gather;

struct Gather {
    // Texels of the field.
    dims: vec3f,
    // Edge of the cells that photons are sorted by, in places.
    places_per_cell: f32,
    // Those cells.
    cells: vec3i,
    // Photons of each part that dispatches before have summed up.
    first: u32,
}

const PLACES_OF_TEXEL = 3.0;

// In places of the lattice, the first of which lies one before the box's lower faces.
fn lattice_of(x: vec3f) -> vec3f {
    return PLACES_OF_TEXEL * (x / frame.size_world + 0.5) * gather.dims + 1.0;
}

// The place below a point, and how far from it to the next the point lies, 0 to 1.
struct Middle {
    low: vec3f,
    part: vec3f,
}

fn middle_of(lattice: vec3f) -> Middle {
    let low = floor(lattice);
    return Middle(low, lattice - low);
}

fn kernel(middle: Middle, lattice: vec3f) -> f32 {
    let from_low = lattice - middle.low;
    let of_low = max(1.0 - abs(from_low) / PLACES_OF_TEXEL, vec3f(0.0));
    let of_high = max(1.0 - abs(from_low - 1.0) / PLACES_OF_TEXEL, vec3f(0.0));
    let along = mix(of_low, of_high, middle.part);
    return along.x * along.y * along.z;
}
