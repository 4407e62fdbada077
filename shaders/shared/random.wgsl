// Random numbers by counting: any one can be had without those before it.

// Four well mixed words of four words (PCG4D; Jarzynski, Olano 2020: Hash functions for GPU
// rendering).
fn pcg4d(seed: vec4u) -> vec4u {
    var v = seed * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Numbers evenly spread over the middles of 2^23 parts of 0..1: never 0 or 1, and 1 - u is exact.
fn unit4(bits: vec4u) -> vec4f {
    return (vec4f(bits >> vec4u(9u)) + 0.5) * 1.1920928955078125e-7;
}

fn unit2(bits: vec2u) -> vec2f {
    return unit4(vec4u(bits, bits)).xy;
}
