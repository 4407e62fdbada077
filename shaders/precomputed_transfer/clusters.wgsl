// Light from compressed matrices (eq. 18 and 19 of the paper). `light_directions`: the light vector times
// each direction of each cluster. `light_rows`: a texel's light is the sum of its cluster's, by weights.

// Directions as matrices are laid out, direction by direction where rows are.
@group(0) @binding(24) var<storage, read> directions: array<f32>;
@group(0) @binding(25) var<storage, read> masses: array<vec4f>;
// Of each row.
@group(0) @binding(26) var<storage, read> weights: array<f32>;
@group(0) @binding(27) var<storage, read> clusters: array<u32>;
@group(0) @binding(28) var<storage, read> texel_rows: array<u32>;
// Of each direction, coefficient by coefficient.
@group(0) @binding(29) var<storage, read_write> lit: array<vec4f>;
@group(0) @binding(30) var<storage, read> light_vector: array<vec4f>;

// Directions of a cluster.
const DIRECTIONS = 5u;

@compute @workgroup_size(64)
fn light_directions(@builtin(global_invocation_id) id: vec3u) {
    let coefficients = transfer.bands * transfer.bands;
    let count = arrayLength(&lit) / coefficients;
    if id.x >= count { return; }
    let k = id.y;
    let plane = transfer.bases * count;
    var radiance = vec3f(0.0);
    for (var b = 0u; b < transfer.bases; b++) {
        let place = k * plane + b * count + id.x;
        var response = vec3f(directions[place]);
        if transfer.channels == 3u {
            response.y = directions[coefficients * plane + place];
            response.z = directions[2u * coefficients * plane + place];
        }
        radiance += response * light_vector[b].xyz;
    }
    lit[k * count + id.x] = vec4f(radiance, 0.0);
}

@compute @workgroup_size(64)
fn light_rows(@builtin(global_invocation_id) id: vec3u) {
    let texels = transfer.dims.x * transfer.dims.y * transfer.dims.z;
    if id.x >= texels { return; }
    let k = id.y;
    let row = texel_rows[id.x];
    var radiance = vec3f(0.0);
    var mass = vec4f(0.0);
    if row != NO_ROW { mass = masses[row]; }
    if mass.w > 0.0 {
        let count = arrayLength(&lit) / (transfer.bands * transfer.bands);
        let first = k * count + DIRECTIONS * clusters[row];
        for (var j = 0u; j < DIRECTIONS; j++) {
            radiance += weights[DIRECTIONS * row + j] * lit[first + j].xyz;
        }
    }
    hold(id.x, k, radiance, mass);
}
