// What is kept of photons. Each interaction is stored with the bins and blocks that everything up to it
// relied on: its historygram.

// Of the photons at work.
@group(0) @binding(10) var<storage, read_write> paths: array<Path>;
@group(0) @binding(13) var<uniform> photons: Photons;
// Of each photon `slots` interactions: place, and random numbers drawn before it scatters.
@group(0) @binding(14) var<storage, read_write> places: array<vec4f>;
// The way it travels when it arrives, and throughput of red.
@group(0) @binding(15) var<storage, read_write> ways: array<vec4f>;
// Throughput of green and blue; bins, blocks: everything that was relied on up to here.
@group(0) @binding(16) var<storage, read_write> histories: array<vec4u>;
// Of each photon two: what all of its way relied on; and the number of its interactions, and the
// throughput that it left the volume with (0: it did not).
@group(0) @binding(17) var<storage, read_write> ends: array<vec4u>;

struct Photons {
    // Photons at work: `count` from the light's photon `first` on.
    first: u32,
    count: u32,
    // Of the light: key of its random numbers, place in the table.
    key: u32,
    light: u32,
    // Most interactions of a photon.
    slots: u32,
    // Of one invocation: rays, and cells and tentative collisions.
    rays: u32,
    steps: u32,
    // 1: the light shines from one direction on each place: what it brings by itself is kept apart.
    direct: u32,
    // What changed: interactions that relied on it are stale.
    bins: vec2u,
    blocks: vec2u,
    // Texels of the light sums.
    dims: vec3u,
    // 1: all interactions are stale; 2: there are none.
    everything: u32,
    // Of the sphere around the volume's box.
    radius: f32,
    // Mean of what a light sends towards the sphere, so that throughputs begin near 1.
    reference: f32,
    seed: u32,
    // 1: clipped matter blocks light.
    clip_shadows: u32,
    // Photons that are worked on: their number, where their list begins in `counters`, and where that of
    // those begins that are left unfinished.
    listed: u32,
    list: u32,
    next_list: u32,
    pad0: u32,
}

// Stages beside those of shared/path.wgsl.
const AT = 8u;
const DONE = 9u;

const UNFINISHED_PHOTON = 0x80000000u;

fn seed() -> u32 {
    return photons.seed;
}

fn clipped_matter_blocks() -> bool {
    return steering(photons.clip_shadows) == 1u;
}
