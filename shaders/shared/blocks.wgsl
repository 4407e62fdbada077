// Blocks of 4^3 in the volume's box that a way leads through, if it is `wanted`, as a mask.
fn blocks_on_way(origin: vec3f, direction: vec3f, from_t: f32, to_t: f32, wanted: bool) -> vec2u {
    let per_world = 4.0 / frame.size_world;
    let start = (origin + 0.5 * frame.size_world) * per_world;
    let slope = direction * per_world;
    let tiny = select(vec3f(PARALLEL), vec3f(-PARALLEL), slope < vec3f(0.0));
    let inverse = 1.0 / select(slope, tiny, abs(slope) < vec3f(PARALLEL));
    // Half a block at most; far less than one where the way is long.
    let margin = 1e-5;
    var mask = vec2u(0u);
    var t = from_t;
    // Through at most 10 blocks.
    var left = select(0u, 12u, wanted && to_t > from_t);
    while left > 0u {
        left -= 1u;
        let block = clamp(floor(start + min(t + margin, to_t) * slope), vec3f(0.0), vec3f(3.0));
        mask |= block_bit(block);
        mask |= block_bit(clamp(floor(start + t * slope), vec3f(0.0), vec3f(3.0)));
        let leave = max((block - start) * inverse, (block + 1.0 - start) * inverse);
        t = max(t + margin, min(leave.x, min(leave.y, leave.z)));
        if t >= to_t { left = 0u; }
    }
    return mask;
}

fn block_bit(block: vec3f) -> vec2u {
    let index = u32(block.x + 4.0 * block.y + 16.0 * block.z);
    return select(vec2u(1u << index, 0u), vec2u(0u, 1u << (index - 32u)), index >= 32u);
}
