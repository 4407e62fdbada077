// How light of texels enters the field.

@group(0) @binding(31) var light_field: texture_storage_3d<rgba16float, write>;

const NO_ROW = 0xffffffffu;
// Largest number of the texture.
const LARGEST = 65504.0;

// Coefficient k of a texel, before it is divided by the mass.
fn hold(texel: u32, k: u32, radiance: vec3f, mass: vec4f) {
    let dims = transfer.dims;
    let texel_place = vec3u(texel % dims.x, texel / dims.x % dims.y, texel / (dims.x * dims.y));
    let tile = vec3u(k % transfer.bands, 0u, k / transfer.bands) * dims;
    let held = clamp(radiance / transfer.scale, vec3f(-LARGEST), vec3f(LARGEST));
    textureStore(light_field, texel_place + tile, vec4f(held, weights_in_field(mass, k)));
}
