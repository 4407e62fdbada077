// What beams lost around a row's texel becomes the answer to every basis function that shines from their
// direction's pixel: times the integrals of function times harmonic over the pixel.

// Of a direction, for each function that is not 0 in its pixel: which, and its integrals with each
// spherical harmonic of the field.
@group(0) @binding(23) var<storage, read> integrals: array<f32>;
@group(0) @binding(24) var<storage, read> fallen: array<u32>;
@group(0) @binding(26) var<storage, read_write> direct_light: array<f32>;

@compute @workgroup_size(64)
fn spread_beams(@builtin(global_invocation_id) id: vec3u) {
    let row = id.x;
    if row >= transfer.rows { return; }
    let lost = f32(fallen[transfer.direction * transfer.rows + row]) * transfer.unit * transfer.beam_area;
    let coefficients = transfer.bands * transfer.bands;
    for (var entry = transfer.first_entry; entry < transfer.last_entry; entry++) {
        let first = entry * (coefficients + 1u);
        let b = u32(integrals[first]);
        for (var k = 0u; k < coefficients; k++) {
            direct_light[in_matrix(k, b, row)] += lost * integrals[first + 1u + k];
        }
    }
}
