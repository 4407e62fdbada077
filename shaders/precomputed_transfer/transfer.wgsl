// What the passes of a bake share. A texel of the field whose surroundings hold matter has a row; the
// matrices of all rows lie coefficient by coefficient, light by light, row by row.

// In a storage buffer, for Mesa 22's software device crashes where loops and branches follow from more
// than a few members of a uniform.
@group(0) @binding(21) var<storage, read> transfer: Transfer;

struct Transfer {
    // Texels of the field.
    dims: vec3u,
    // Basis lights.
    bases: u32,
    rows: u32,
    // Bands of the field.
    bands: u32,
    // 3 where albedo is coloured, else 1: of what photons bring.
    channels: u32,
    // 1: clipped matter blocks light.
    clip_shadows: u32,
    // Photons of this dispatch: `count` from `first` on; or as many as are listed.
    first: u32,
    count: u32,
    // Most interactions of a photon.
    events: u32,
    // Of one invocation: rays, and cells and tentative collisions.
    photon_rays: u32,
    steps: u32,
    // Directions of photons, and the step from one photon's to the next one's.
    flights: u32,
    stride: u32,
    // The direction that light is marched from.
    direction: u32,
    // Its entries in the list: from the first to before the last.
    first_entry: u32,
    last_entry: u32,
    // What a share is counted in.
    unit: f32,
    // Mean area that the box shows.
    mean_shown: f32,
    // What shares of photons are multiplied with when they become light.
    photon_factor: f32,
    // The field holds radiance divided by this.
    scale: f32,
    // Cross-section of a beam over the largest mass.
    beam_area: f32,
    // 1: photons' shares come, -1: they go.
    sign: i32,
    // Bins, then blocks, in which matter changed: what photons relied on is stale there.
    query: vec4u,
    // 1: the photons at work, or the beams, are those of the list.
    listed: u32,
    // Rows there were before, where rows move.
    old_rows: u32,
    // Directions whose beams are tested.
    tests: u32,
    pad0: u32,
}

// Place of a number: coefficient k of a channel's plane, basis light b, row.
fn in_matrix(plane: u32, b: u32, row: u32) -> u32 {
    return (plane * transfer.bases + b) * transfer.rows + row;
}
