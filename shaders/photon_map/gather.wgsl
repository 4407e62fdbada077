// What photons bring to parts of view rays: for each part the sum over the interactions around it of
// throughput times the light's flux, scattered towards the eye by phase function and BRDF, times the kernel.
// An invocation has one part. (All loops of eight lanes end after 65,535 turns together on Mesa 22's software
// device: so many photons a dispatch, and as many dispatches as the fullest kernel takes.)

// Pairs of low and high words, as in ray_cast/ray_cast.wgsl; photons gathered are the pair behind those. Then
// one word: parts of the ray with the most; and one: whether photons are left to be gathered.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
const PHOTONS_GATHERED = 12u;
const PHOTONS_LEFT = 15u;
// Interactions, sorted by cell; two texels each: place in the lattice and way, throughput and light. Row by row.
@group(0) @binding(14) var interactions: texture_2d<u32>;
// The first interaction of each cell, and, behind the last cell along x, of the next row.
@group(0) @binding(15) var cell_starts: texture_3d<u32>;
// Flux of a photon of each light.
@group(0) @binding(16) var flux_of_lights: texture_2d<f32>;

override MOST_PHOTONS: u32 = 65536u;

var<workgroup> group_photons: atomic<u32>;
var<workgroup> group_left: atomic<u32>;

@compute @workgroup_size(8, 8)
fn gather_photons(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let id = pixel_of_lane(group.xy, lane);
    let inside = id.x < frame.image.x && id.y < frame.row_count;
    let pixel = vec2u(min(id.x, frame.image.x - 1u), frame.first_row + min(id.y, frame.row_count - 1u));
    let slot = group.z * frame.image.x * frame.row_count + place_of_pixel(pixel);
    let works = inside && group.z < seen_parts[place_of_pixel(pixel)].count;
    let w_o = -camera_ray(vec2f(pixel) + frame.subpixel).direction;
    let part = seen_parts[slot];
    let material = materials[min(part.material, u32(MAX_MATERIALS) - 1u)];
    let middle = middle_of(lattice_of(part.x));
    let width = i32(textureDimensions(interactions).x);

    // Cells that the kernel reaches into.
    let low = vec3i(floor((middle.low - PLACES_OF_TEXEL) / gather.places_per_cell));
    let high = vec3i(floor((middle.low + PLACES_OF_TEXEL) / gather.places_per_cell)) + 1;
    let along_x = clamp(vec2i(low.x, high.x), vec2i(0), vec2i(gather.cells.x));
    let rows = select(0, (high.y - low.y) * (high.z - low.z), works);
    var sum = vec3f(0.0);
    var skip = i32(gather.first);
    var wanted = i32(MOST_PHOTONS);
    var left = 0;
    // Lanes without a part make no trip.
    for (var row = 0; row < rows; row++) {
        let cell = vec2i(low.y + row % (high.y - low.y), low.z + row / (high.y - low.y));
        let is_in = all(cell >= vec2i(0)) && all(cell < gather.cells.yz);
        let of_row = clamp(cell, vec2i(0), gather.cells.yz - 1);
        var next = i32(textureLoad(cell_starts, vec3i(along_x.x, of_row), 0).x);
        let end = select(next, i32(textureLoad(cell_starts, vec3i(along_x.y, of_row), 0).x), is_in);
        let skipped = min(skip, end - next);
        skip -= skipped;
        next += skipped;
        let stop = min(end, next + wanted);
        wanted -= stop - next;
        left += end - stop;
        while next < stop {
            let texel = 2 * next;
            let at = vec2i(texel % width, texel / width);
            let first = textureLoad(interactions, at, 0);
            let second = textureLoad(interactions, at + vec2i(1, 0), 0);
            let way = bitcast<vec3f>(vec3u(first.w, second.xy));
            let throughput = unpacked(second.z);
            let flux = textureLoad(flux_of_lights, vec2u(second.w, 0u), 0).xyz;
            var scattered = (1.0 - part.surface) * phase_function(material, dot(way, w_o)) * part.albedo;
            if SURFACES {
                if part.surface > 0.0 {
                    let f_r = brdf(material, part.n, -way, w_o);
                    scattered += part.surface * (f_r.x * part.albedo + f_r.y) * max(dot(part.n, -way), 0.0);
                }
            }
            sum += kernel(middle, bitcast<vec3f>(first.xyz)) * scattered * throughput * flux;
            next++;
        }
    }
    if works { seen_parts[slot].gathered += sum; }
    atomicAdd(&group_photons, select(0u, MOST_PHOTONS - u32(wanted), works));
    atomicMax(&group_left, u32(left));
    workgroupBarrier();
    if lane == 0u {
        let amount = atomicLoad(&group_photons);
        let before = atomicAdd(&counters[PHOTONS_GATHERED], amount);
        if before + amount < before { atomicAdd(&counters[PHOTONS_GATHERED + 1u], 1u); }
        atomicMax(&counters[PHOTONS_LEFT], atomicLoad(&group_left));
    }
}
