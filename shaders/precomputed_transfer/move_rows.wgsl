// Matrices of other rows: what a texel had is where its row is now; what had none begins with nothing.

@group(0) @binding(29) var<storage, read> old_words: array<u32>;
@group(0) @binding(35) var<storage, read_write> words: array<u32>;
// Of each row the one it was; NO_ROW: none.
@group(0) @binding(36) var<storage, read> old_row_of: array<u32>;

const NO_ROW = 0xffffffffu;

@compute @workgroup_size(64)
fn move_rows(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = id.y * groups.x * 64u + id.x;
    if index >= arrayLength(&words) { return; }
    let row = index % transfer.rows;
    let old_row = old_row_of[row];
    var held = 0u;
    if old_row != NO_ROW { held = old_words[index / transfer.rows * transfer.old_rows + old_row]; }
    words[index] = held;
}
