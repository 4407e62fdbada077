// From matrices to light: the light vector times each texel's matrix is the light field (eq. 15 of the
// paper).

@group(0) @binding(25) var<storage, read> masses: array<vec4f>;
@group(0) @binding(26) var<storage, read> direct_light: array<f32>;
@group(0) @binding(28) var<storage, read> texel_rows: array<u32>;
// What photons brought, in units of `transfer.unit`: of whole numbers of 64 bits low and high words.
@group(0) @binding(24) var<storage, read> low_words: array<u32>;
@group(0) @binding(29) var<storage, read> high_words: array<u32>;
// Radiance of each basis light, linear RGB.
@group(0) @binding(30) var<storage, read> light_vector: array<vec4f>;

fn scattered(plane: u32, b: u32, row: u32) -> f32 {
    let place = in_matrix(plane, b, row);
    return whole_number(low_words[place], high_words[place]) * transfer.unit;
}

@compute @workgroup_size(64)
fn relight(@builtin(global_invocation_id) id: vec3u) {
    let texels = transfer.dims.x * transfer.dims.y * transfer.dims.z;
    if id.x >= texels { return; }
    let k = id.y;
    let row = texel_rows[id.x];
    var radiance = vec3f(0.0);
    var mass = vec4f(0.0);
    if row != NO_ROW { mass = masses[row]; }
    if mass.w > 0.0 {
        let coefficients = transfer.bands * transfer.bands;
        for (var b = 0u; b < transfer.bases; b++) {
            var response = vec3f(scattered(k, b, row));
            if transfer.channels == 3u {
                response.y = scattered(coefficients + k, b, row);
                response.z = scattered(2u * coefficients + k, b, row);
            }
            response = transfer.photon_factor * response + direct_light[in_matrix(k, b, row)];
            radiance += response * light_vector[b].xyz;
        }
    }
    hold(id.x, k, radiance, mass);
}
