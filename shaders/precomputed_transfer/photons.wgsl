// Photons of a bake, as the passes that work on them know them.

@group(0) @binding(10) var<storage, read_write> paths: array<Path>;
// Of each direction of photons: towards the light; then FUNCTIONS indices and as many weights.
@group(0) @binding(27) var<storage, read> flights: array<vec4f>;
// Of each photon bins and blocks that all of its way relied on: its historygram.
@group(0) @binding(32) var<storage, read_write> histories: array<vec4u>;

const FLIGHT_TEXELS = 5u;
// Stages beside those of shared/path.wgsl.
const AT = 8u;
const DONE = 9u;
// Told apart from photons of other methods.
const KEY = 0x70767274u;

fn seed() -> u32 {
    return 0u;
}

fn clipped_matter_blocks() -> bool {
    return steering(transfer.clip_shadows) == 1u;
}

fn flight_of(photon: u32) -> u32 {
    return photon % transfer.flights * transfer.stride % transfer.flights;
}
