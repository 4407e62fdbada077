// Light sums: what the photons of a light bring to the texels of its field, in whole numbers.

// Of each texel and coefficient red, green, blue: 64 bits in two words, in units of 1 / UNIT.
@group(0) @binding(18) var<storage, read_write> sums: array<atomic<u32>>;
// Of each brick of 4^3 texels: 1 if a sum changed.
@group(0) @binding(19) var<storage, read_write> touched: array<u32>;

// Bands of the field.
override BANDS: u32 = 1u;
const UNIT = 262144.0;
const BRICK_EDGE = 4u;

// A photon's share in the eight texels around it; `sign` 1: it comes, -1: it goes, 0: there is none.
fn deposit(x: vec3f, way: vec3f, throughput: vec3f, sign: i32) {
    let dims = vec3f(photons.dims);
    let place = clamp(x / frame.size_world + 0.5, vec3f(0.0), vec3f(1.0)) * dims - 0.5;
    let low = floor(place);
    let part = place - low;
    let coefficients = BANDS * BANDS;
    var harmonics = array<f32, 36>();
    for (var k = 0u; k < coefficients; k++) { harmonics[k] = spherical_harmonic(k, -way); }
    // Lanes without a photon make no trip.
    let corners = select(0u, 8u, sign != 0);
    for (var corner = 0u; corner < corners; corner++) {
        let upper = vec3u(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let texel = vec3u(clamp(low + vec3f(upper), vec3f(0.0), dims - 1.0));
        let near = select(1.0 - part, part, upper == vec3u(1u));
        let share = near.x * near.y * near.z;
        let index = (texel.z * photons.dims.y + texel.y) * photons.dims.x + texel.x;
        let brick = texel / BRICK_EDGE;
        let bricks = (photons.dims + BRICK_EDGE - 1u) / BRICK_EDGE;
        touched[(brick.z * bricks.y + brick.y) * bricks.x + brick.x] = 1u;
        for (var k = 0u; k < coefficients; k++) {
            let amounts = sign * vec3i(round(clamp(throughput * (share * harmonics[k]) * UNIT, vec3f(-2e9), vec3f(2e9))));
            let first = 6u * (index * coefficients + k);
            add(first, amounts.x);
            add(first + 2u, amounts.y);
            add(first + 4u, amounts.z);
        }
    }
}

fn add_to_word(word: u32, amount: u32) -> u32 {
    return atomicAdd(&sums[word], amount);
}
