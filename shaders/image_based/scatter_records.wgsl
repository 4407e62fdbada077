// Pass `scatter_records`: what matter in each record's cell scatters on, of the light there is so far
// (README.md, equation d). Means over a cell, as bands of the direction it comes from.

@group(0) @binding(21) var source_out: texture_storage_3d<rgba16float, write>;
@group(0) @binding(22) var<storage, read> cosines: array<f32>;
// Absorption RGB and extinction (convection_diffusion/coefficients.wgsl).
@group(0) @binding(24) var matter: texture_3d<f32>;

// Bands of what is scattered: 1 where all matter is isotropic, or 2.
override SOURCE_BANDS: u32 = 1u;

// Largest optical depth of a cell: more lets no more light through, and half floats end at 65504.
const OPAQUE_CELL = 64.0;
const LARGEST = 65504.0;
// Places of a cell at which light is looked up that comes straight from its source.
const PLACES = 8u;

@compute @workgroup_size(64)
fn scatter_records(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    always_zero = group.z;
    let place = index_in_dispatch(group, lane);
    let cell = cell_of(grid.first + min(place, grid.count - 1u));
    let index = index_of(cell);
    var light = array<vec3f, 4>();
    let tiles = textureDimensions(light_field).x / grid.cells.x;
    for (var k = 0u; k < SOURCE_BANDS * SOURCE_BANDS; k++) {
        light[k] = textureLoad(light_field, cell + tile(k, tiles), 0).xyz;
    }
    for (var i = 0u; i < steering(frame.light_count); i++) {
        for (var p = 0u; p < PLACES; p++) {
            let within = 0.25 + 0.5 * vec3f(vec3u(p & 1u, (p >> 1u) & 1u, p >> 2u));
            let x = ((vec3f(cell) + within) / vec3f(grid.cells) - 0.5) * frame.size_world;
            let incident = incident_light(i, x);
            let arriving = incident.irradiance * (share_of(lights[i].slot, x) / (f32(PLACES) * field.scale));
            for (var k = 0u; k < SOURCE_BANDS * SOURCE_BANDS; k++) {
                light[k] += arriving * spherical_harmonic(k, incident.w_i);
            }
        }
    }
    let found = textureLoad(matter, cell, 0);
    // Optical depths of a cell.
    let edge = max(grid.cell_size.x, max(grid.cell_size.y, grid.cell_size.z));
    let depth = min(found.w * edge, OPAQUE_CELL);
    let scattering = depth * clamp(1.0 - found.xyz / max(found.w, 1e-20), vec3f(0.0), vec3f(1.0));
    if place >= grid.count { return; }
    for (var k = 0u; k < SOURCE_BANDS * SOURCE_BANDS; k++) {
        let scattered = scattering * light[k] * select(cosines[index], 1.0, k == 0u);
        let texel = vec4f(clamp(scattered, vec3f(-LARGEST), vec3f(LARGEST)), depth);
        textureStore(source_out, cell + tile(k, SOURCE_BANDS), texel);
    }
}

// Where coefficient k lies in a field of so many bands.
fn tile(k: u32, bands: u32) -> vec3u {
    return vec3u(k % bands, 0u, k / bands) * grid.cells;
}
