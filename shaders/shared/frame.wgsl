// What one dispatch of the ray caster needs to know. Mirrored by `FrameUniform` in
// server/render/src/uniforms.rs; a test proves the offsets equal.

struct Frame {
    eye: vec3f,
    // Perspective: tan(fov_y / 2). Orthographic: half the image's height, world units.
    half_height: f32,
    forward: vec3f,
    // 0 perspective, 1 orthographic.
    projection: u32,
    right: vec3f,
    // Distance between samples on a view ray, world units.
    step_world: f32,
    up: vec3f,
    // A ray ends when its transmittance falls below this.
    termination: f32,
    // Edges of the volume's box, world units.
    size_world: vec3f,
    // s = clamp(s_scale * texel + s_offset, 0, 1).
    s_scale: f32,
    // Voxels along x, y, z.
    voxels: vec3f,
    s_offset: f32,
    // Clip box, world.
    clip_low: vec3f,
    plane_count: u32,
    clip_high: vec3f,
    light_count: u32,
    background: vec3f,
    // 1: leap over macrocells without matter. Never changes the image.
    skip_empty: u32,
    // Radiance of the uniform environment light.
    ambient: vec3f,
    point_count: u32,
    // Image size, pixels.
    image: vec2u,
    // Rows of this dispatch: first_row .. first_row + row_count.
    first_row: u32,
    row_count: u32,
    // Position in the pixel square, 0..1.
    subpixel: vec2f,
    // Shift of the sample lattice along the ray, in steps, 0..1.
    lattice_shift: f32,
    // Samples per pixel the film holds before this pass.
    sample_index: u32,
    // 1: view-ray segments may be used again.
    segments_kept: u32,
    // Where light is gathered at parts of rays: the first part that is written down.
    first_part: u32,
    // Of 64 cells of s, in two words, those in which there is matter.
    matter_cells: vec2u,
    // Smallest and largest s at which there is matter.
    matter_range: vec2f,
    // value_scale * texel + value_offset: share of the data's range, 0..1.
    value_scale: f32,
    value_offset: f32,
    // Slice: the points with dot(xyz, x) = w. Isosurface: w is its s, not clamped.
    surface: vec4f,
    // The environment map's axes in the world.
    map_x: vec3f,
    pad3: u32,
    map_y: vec3f,
    pad4: u32,
    map_z: vec3f,
    pad5: u32,
    // Factor of the image behind the volume; 0 without one.
    backdrop: vec3f,
    pad6: u32,
    // Each keeps dot(xyz, x) >= w; unit normals.
    planes: array<vec4f, 8>,
}

@group(0) @binding(0) var<uniform> frame: Frame;

// Always 0; the entry point sets it from an id that is 0 by the size of the dispatch.
var<private> always_zero: u32;

// Uniform values that steer control flow pass through here. Mesa's software device (22.3) compiles
// a shader anew for every value of a uniform that a branch or a loop bound depends on alone: 250 ms
// whenever the number of lights, of samples or of clip planes changed.
fn steering(value: u32) -> u32 {
    return value + always_zero;
}
