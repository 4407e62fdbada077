// After an edit of matter: tiles start again whose paths relied on bins that changed. The others
// stay as they are.

@group(0) @binding(0) var<uniform> restart: Restart;
@group(0) @binding(1) var<storage, read_write> film: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> spreads: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> tiles: array<u32>;

struct Restart {
    image: vec2u,
    // Bins in which matter changed.
    bins: vec2u,
}

@compute @workgroup_size(8, 8)
fn restart_tiles(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = 2u * (group.y * ((restart.image.x + 7u) / 8u) + group.x);
    let stale = (tiles[tile] & restart.bins.x | tiles[tile + 1u] & restart.bins.y) != 0u;
    workgroupBarrier();
    if stale && all(id.xy < restart.image) {
        let index = id.y * restart.image.x + id.x;
        film[index] = vec4f(0.0);
        spreads[index] = vec4f(0.0);
    }
    if stale && lane == 0u {
        tiles[tile] = 0u;
        tiles[tile + 1u] = 0u;
    }
}
