// Which photons an edit makes stale: those whose ways relied on bins or blocks in which matter changed.
// `count_stale`: how many of each packet. `list_stale`: which, of `transfer.count` photons from
// `transfer.first` on.

// Of each photon bins and blocks that all of its way relied on: its historygram.
@group(0) @binding(32) var<storage, read> histories: array<vec4u>;
@group(0) @binding(33) var<storage, read_write> list: array<u32>;
// Of each packet its stale photons; when they are listed the first says how many there are.
@group(0) @binding(34) var<storage, read_write> counts: array<atomic<u32>>;

const PACKET = 4096u;

fn photon_of(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

fn is_stale(index: u32) -> bool {
    return index < transfer.count && any((histories[transfer.first + index] & transfer.query) != vec4u(0u));
}

@compute @workgroup_size(64)
fn count_stale(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = photon_of(id, groups);
    if is_stale(min(index, transfer.count)) { atomicAdd(&counts[(transfer.first + index) / PACKET], 1u); }
}

@compute @workgroup_size(64)
fn list_stale(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = photon_of(id, groups);
    if is_stale(min(index, transfer.count)) {
        let place = atomicAdd(&counts[0], 1u);
        if place < arrayLength(&list) { list[place] = transfer.first + index; }
    }
}
