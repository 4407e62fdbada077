// Faces of a cell through which diffused light leaves matter, and light from outside enters (README.md,
// equation 11). Face 2 a is the lower one along axis a, 2 a + 1 the upper.

@group(0) @binding(24) var matter: texture_3d<f32>;

// Whether the box or the matter ends at a face.
fn is_open(cell: vec3u, face: u32) -> bool {
    let axis = face >> 1u;
    var other = vec3i(cell);
    other[axis] += select(1, -1, (face & 1u) == 0u);
    let inside = other[axis] >= 0 && other[axis] < i32(grid.cells[axis]);
    let beyond = textureLoad(matter, clamp(other, vec3i(0), vec3i(grid.cells) - 1), 0).w;
    return !inside || beyond <= 0.0;
}

// What an open face takes of the fluence, and gives of that from outside, per unit of volume.
fn leak_through(face: u32, flow: vec3f) -> vec3f {
    let h = grid.cell_size[face >> 1u];
    return 1.0 / (h * (h / (2.0 * flow) + 2.0));
}
