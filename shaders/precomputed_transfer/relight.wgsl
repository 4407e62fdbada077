// From matrices to light. `take_in`: what a batch of photons brought becomes part of the matrices.
// `relight`: the light vector times each texel's matrix is the light field (eq. 15 of the paper).

@group(0) @binding(24) var<storage, read_write> scattered_light: array<f32>;
@group(0) @binding(25) var<storage, read> masses: array<f32>;
@group(0) @binding(26) var<storage, read> direct_light: array<f32>;
@group(0) @binding(28) var<storage, read> texel_rows: array<u32>;
@group(0) @binding(29) var<storage, read_write> sums: array<i32>;
// Radiance of each basis light, linear RGB.
@group(0) @binding(30) var<storage, read> light_vector: array<vec4f>;

@compute @workgroup_size(64)
fn take_in(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = id.y * groups.x * 64u + id.x;
    if index < arrayLength(&sums) {
        scattered_light[index] += f32(sums[index]) * transfer.unit;
        sums[index] = 0;
    }
}

@compute @workgroup_size(64)
fn relight(@builtin(global_invocation_id) id: vec3u) {
    let texels = transfer.dims.x * transfer.dims.y * transfer.dims.z;
    if id.x >= texels { return; }
    let k = id.y;
    let row = texel_rows[id.x];
    var radiance = vec3f(0.0);
    var mass = 0.0;
    if row != NO_ROW {
        mass = masses[row];
        let coefficients = transfer.bands * transfer.bands;
        for (var b = 0u; b < transfer.bases; b++) {
            var response = vec3f(scattered_light[in_matrix(k, b, row)]);
            if transfer.channels == 3u {
                response.y = scattered_light[in_matrix(coefficients + k, b, row)];
                response.z = scattered_light[in_matrix(2u * coefficients + k, b, row)];
            }
            response = transfer.photon_factor * response + direct_light[in_matrix(k, b, row)];
            radiance += response * light_vector[b].xyz;
        }
    }
    hold(id.x, k, radiance, mass);
}
