// Three numbers in a word: nine bits each, with the exponent of the largest, which is held between those
// of 2^-15 and 2^16.
fn packed(rgb: vec3f) -> u32 {
    let held = clamp(rgb, vec3f(0.0), vec3f(65408.0));
    let exponent = clamp(bitcast<u32>(max(held.x, max(held.y, held.z))) >> 23u, 111u, 142u) - 111u;
    let mantissas = min(vec3u(held / unit_of(exponent) + 0.5), vec3u(511u));
    return mantissas.x | (mantissas.y << 9u) | (mantissas.z << 18u) | (exponent << 27u);
}

fn unpacked(word: u32) -> vec3f {
    return unit_of(word >> 27u) * vec3f(vec3u(word, word >> 9u, word >> 18u) & vec3u(511u));
}

// Numbers below 2^(exponent - 15) have nine bits of 2^(exponent - 24).
fn unit_of(exponent: u32) -> f32 {
    return bitcast<f32>((exponent + 103u) << 23u);
}
