// What both passes over records share. A record stands at the centre of a cell of a coarse grid over
// the volume's box; it has one ray for each HEALPix direction (columns 0 .. directions) and one
// towards each light that has a direction of its own (the columns after them).

// In a storage buffer, for Mesa 22's software device crashes where loops and branches follow from more
// than a few members of a uniform.
@group(0) @binding(13) var<storage, read> records: Records;
// Entries of this dispatch: the record's slot, and its cell (10 bits each along x, y, z).
@group(0) @binding(14) var<storage, read> entries: array<vec2u>;
// Unit direction towards the light the column stands for (if it is the same for all records), and what
// is to be done with its rays: KEEP, TEST, CAST.
@group(0) @binding(15) var<storage, read> columns: array<vec4f>;
// What rays found: transmittance at [column][slot]; after all of them, where matter glows, what
// arrives along the ray in red, green and blue, each at [column][slot].
@group(0) @binding(16) var<storage, read_write> rays: array<f32>;
// Of each slot, whether a ray was cast since the record was last projected.
@group(0) @binding(17) var<storage, read_write> renewed: array<atomic<u32>>;
// Pairs of low and high words: rays cast, rays kept; cells looked at, cells skipped; records renewed.
@group(0) @binding(18) var<storage, read_write> record_counters: array<atomic<u32>>;

// Its rays are what they would be, whatever changed.
const KEEP = 0.0;
// Its rays are kept where they meet no cell in which matter changed.
const TEST = 1.0;
// Its rays are cast.
const CAST = 2.0;

// An entry with this bit is none any more: its texels become nothing.
const LEFT = 0x80000000u;

struct Records {
    // Cells of the record grid.
    dims: vec3u,
    // Columns that `rays` has room for.
    columns: u32,
    // Entries of this dispatch.
    first: u32,
    count: u32,
    directions: u32,
    // Slots that a column of `rays` has room for.
    capacity: u32,
    // Bands that are projected.
    bands: u32,
    // The field holds coefficients divided by this.
    scale: f32,
    // Index of the material whose phase function the form `dynamic` folds in.
    material: u32,
    // 1: higher bands are damped.
    window: u32,
    // Lights with rays of their own.
    own_lights: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
    // Where the camera is (form `dynamic`), or its direction of view with w = 0.
    eye: vec4f,
}

// Whether matter glows, so that emission is collected on the way.
override GLOW: bool = false;

fn cell_of_record(code: u32) -> vec3u {
    return vec3u(code, code >> 10u, code >> 20u) & vec3u(1023u);
}

fn position_of_record(cell: vec3u) -> vec3f {
    return ((vec3f(cell) + 0.5) / vec3f(records.dims) - 0.5) * frame.size_world;
}

fn ray_slot(word: u32, column: u32, slot: u32) -> u32 {
    return (word * records.columns + column) * records.capacity + slot;
}

// 64-bit sum in two words.
fn add_to_record_counter(counter: u32, amount: u32) {
    let before = atomicAdd(&record_counters[2u * counter], amount);
    if before + amount < before {
        atomicAdd(&record_counters[2u * counter + 1u], 1u);
    }
}
