// Numbers that are spread more evenly than random ones: of 2^k that follow one another from a multiple of 2^k
// on each 2^-k of the cube, cut in halves along its axes, holds about one. The first four dimensions of Sobol's
// sequence (Joe, Kuo 2008: Constructing Sobol sequences with better two-dimensional projections), scrambled by
// hashing (Burley 2020: Practical hash-based Owen scrambling).

// Number `index` of the sequence with this seed, four words.
fn sobol4(index: u32, seed: u32) -> vec4u {
    // Direction numbers by the recurrences of x + 1, x^2 + x + 1 and x^3 + x + 1.
    var one = 0x80000000u;
    var two = vec2u(0x80000000u, 0xc0000000u);
    var three = vec3u(0x80000000u, 0xc0000000u, 0x20000000u);
    var sum = vec3u(0u);
    for (var k = 0u; k < 32u && index >> k != 0u; k++) {
        if (index >> k & 1u) == 1u { sum ^= vec3u(one, two.x, three.x); }
        one ^= one >> 1u;
        two = vec2u(two.y, two.y ^ two.x ^ (two.x >> 2u));
        three = vec3u(three.y, three.z, three.y ^ three.x ^ (three.x >> 3u));
    }
    let seeds = pcg4d(vec4u(seed, 1u, 2u, 3u));
    return owen_scrambled(vec4u(reverseBits(index), sum), seeds);
}

// Each bit is turned or not by a hash of those above it and of the seed (Vegdahl 2021: Building a better LK hash).
fn owen_scrambled(words: vec4u, seeds: vec4u) -> vec4u {
    var v = reverseBits(words);
    v ^= v * 0x3d20adeau;
    v += seeds;
    v *= (seeds >> vec4u(16u)) | vec4u(1u);
    v ^= v * 0x05526c56u;
    v ^= v * 0x53a22864u;
    return reverseBits(v);
}
