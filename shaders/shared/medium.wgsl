// The scalar field and the transfer function (../README.md): interpolate the data first,
// then look up matter.

// A column a point; rows: (sigma_t, s, 1 / width of the piece above it or 0, material index),
// albedo, emission.
@group(0) @binding(1) var tf_points: texture_2d<f32>;
// A column a cell of TF_CELLS: extinction at its lower edge, slope in s, last point at or below
// the edge, 1 if another point lies inside. Textures, because Mesa's software device reads storage
// buffers at divergent indices one lane at a time.
@group(0) @binding(2) var tf_cells: texture_2d<f32>;
@group(0) @binding(3) var<uniform> materials: array<Material, MAX_MATERIALS>;
@group(0) @binding(7) var volume: texture_3d<f32>;
@group(0) @binding(8) var volume_sampler: sampler;

const TF_CELLS = 1024.0;
// The scene's materials and the isotropic one before them.
const MAX_MATERIALS = 65;

// 0: hardware trilinear filter. 1: f32 interpolation of eight texels. 2: nearest voxel.
override FILTER: u32 = 0u;

struct Material {
    // 0 isotropic, 1 Henyey-Greenstein, 2 Schlick.
    phase: u32,
    // g or k.
    asymmetry: f32,
    // Weight of the BRDF against the phase function.
    surface: f32,
    // 0 Lambert, 1 Blinn-Phong, 2 Ashikhmin-Shirley, 3 ABC.
    brdf: u32,
    // Reflectance of the diffuse part under uniform light, divided by the albedo.
    ambient_diffuse: f32,
    // Reflectance of the specular part under uniform light.
    ambient_specular: f32,
    diffuse: f32,
    specular: f32,
    // Blinn-Phong: exponent, normalisation. Ashikhmin-Shirley: both exponents. ABC: b, c.
    lobe: vec2f,
    pad0: u32,
    pad1: u32,
}

// A place on the transfer function: between point `lower` and the next, at share t.
struct Place {
    lower: u32,
    upper: u32,
    t: f32,
    material: u32,
}

// Texel value at volume coordinates 0..1; edge values extend to the faces.
fn texel_value(uvw: vec3f) -> f32 {
    if FILTER == 0u {
        return textureSampleLevel(volume, volume_sampler, uvw, 0.0).x;
    }
    let last = vec3i(frame.voxels) - 1;
    if FILTER == 2u {
        return textureLoad(volume, clamp(vec3i(floor(uvw * frame.voxels)), vec3i(0), last), 0).x;
    }
    let p = uvw * frame.voxels - 0.5;
    let base = floor(p);
    let f = p - base;
    let a = clamp(vec3i(base), vec3i(0), last);
    let b = clamp(vec3i(base) + 1, vec3i(0), last);
    let x00 = mix(textureLoad(volume, vec3i(a.x, a.y, a.z), 0).x, textureLoad(volume, vec3i(b.x, a.y, a.z), 0).x, f.x);
    let x10 = mix(textureLoad(volume, vec3i(a.x, b.y, a.z), 0).x, textureLoad(volume, vec3i(b.x, b.y, a.z), 0).x, f.x);
    let x01 = mix(textureLoad(volume, vec3i(a.x, a.y, b.z), 0).x, textureLoad(volume, vec3i(b.x, a.y, b.z), 0).x, f.x);
    let x11 = mix(textureLoad(volume, vec3i(a.x, b.y, b.z), 0).x, textureLoad(volume, vec3i(b.x, b.y, b.z), 0).x, f.x);
    return mix(mix(x00, x10, f.y), mix(x01, x11, f.y), f.z);
}

fn s_of_texel(texel: f32) -> f32 {
    return clamp(frame.s_scale * texel + frame.s_offset, 0.0, 1.0);
}

// The cell of s and its column of the table.
fn cell_of(s: f32) -> vec2f {
    let cell = min(floor(s * TF_CELLS), TF_CELLS - 1.0);
    return vec2f(cell, s - cell / TF_CELLS);
}

// Extinction at s, per world unit. Most samples need nothing else. Exactly 0 where it is 0 at
// both ends of a piece.
fn sigma_t_at(s: f32) -> f32 {
    let cell = cell_of(s);
    let entry = textureLoad(tf_cells, vec2u(u32(cell.x), 0u), 0);
    if entry.w == 0.0 { return max(entry.x + entry.y * cell.y, 0.0); }
    let place = place_of(s);
    return mix(point_row(place.lower, 0u).x, point_row(place.upper, 0u).x, place.t);
}

// Where s lies: linear between points, constant beyond the ends, the later of two points at one s.
fn place_of(s: f32) -> Place {
    let last = steering(frame.point_count) - 1u;
    var i = u32(textureLoad(tf_cells, vec2u(u32(cell_of(s).x), 0u), 0).z);
    while i < last && point_row(i + 1u, 0u).y <= s {
        i++;
    }
    let row = point_row(i, 0u);
    return Place(i, min(i + 1u, last), clamp((s - row.y) * row.z, 0.0, 1.0), u32(row.w));
}

fn point_row(point: u32, row: u32) -> vec4f {
    return textureLoad(tf_points, vec2u(point, row), 0);
}

fn albedo_at(place: Place) -> vec3f {
    return mix(point_row(place.lower, 1u).xyz, point_row(place.upper, 1u).xyz, place.t);
}

fn emission_at(place: Place) -> vec3f {
    return mix(point_row(place.lower, 2u).xyz, point_row(place.upper, 2u).xyz, place.t);
}

// Gradient of s in the world by central differences one voxel apart; before clamping to 0..1.
fn gradient_at(uvw: vec3f) -> vec3f {
    let d = 1.0 / frame.voxels;
    let difference = vec3f(
        texel_value(uvw + vec3f(d.x, 0.0, 0.0)) - texel_value(uvw - vec3f(d.x, 0.0, 0.0)),
        texel_value(uvw + vec3f(0.0, d.y, 0.0)) - texel_value(uvw - vec3f(0.0, d.y, 0.0)),
        texel_value(uvw + vec3f(0.0, 0.0, d.z)) - texel_value(uvw - vec3f(0.0, 0.0, d.z)),
    );
    return frame.s_scale * difference / (2.0 * d * frame.size_world);
}
