// What the passes of the refinement share: films of differences, and what is known of tiles.

// One of the parts that differences are split into, from fine to smooth.
struct DifferencePart {
    image: vec2u,
    // Pixels between the taps of the smoothing that ends this part; 0: all that is left belongs to it.
    stride: u32,
    // Variance of this part of white noise of variance 1.
    noise: f32,
    // Weight of a pixel in its own part.
    centre: f32,
    pad0: f32,
    pad1: vec2f,
}

@group(0) @binding(0) var<uniform> part: DifferencePart;
// Paths minus approximation, red, green and blue; variance of all three by the noise of paths.
@group(0) @binding(1) var<storage, read_write> differences: array<vec4f>;
// The same, smoothed once more.
@group(0) @binding(2) var<storage, read_write> smoothed: array<vec4f>;
// What is taken over of the differences, and what of a pixel's own noise that is.
@group(0) @binding(3) var<storage, read_write> blended: array<vec4f>;
// Of a tile, per pixel: squared bias that the approximation has at least in this part, and variance.
@group(0) @binding(4) var<storage, read_write> tiles: array<vec2f>;

// Pixels along the edge of a tile, which is a workgroup.
const EDGE = 8u;
// Larger differences count as this: their fourth powers stay finite.
const FARTHEST = 1e8;

var<workgroup> sums: array<vec4f, 64>;

// Adds up a tile's values: the sum is in `sums[0]`.
fn add_up(mine: vec4f, lane: u32) {
    sums[lane] = mine;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if lane < half { sums[lane] += sums[lane + half]; }
        workgroupBarrier();
    }
}
