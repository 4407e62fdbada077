// The scalar field and the transfer function (../README.md): interpolate the data first,
// then look up matter.

// A column a point; rows: (sigma_t, s, 1 / width of the piece above it or 0, material index),
// albedo, emission.
@group(0) @binding(1) var tf_points: texture_2d<f32>;
// A column a cell of TF_CELLS; rows: extinction at its lower edge, slope in s, last point at or below
// the edge, 1 if another point lies inside; then what extinction integrates to over s from 0 up to the
// edge (the sum of two floats) and the first point inside, 2 if there is none; then extinction from there
// on, its slope, and the integral from the edge to there. Textures, because Mesa's software device reads storage
// buffers at divergent indices one lane at a time.
@group(0) @binding(2) var tf_cells: texture_2d<f32>;
@group(0) @binding(3) var<uniform> materials: array<Material, MAX_MATERIALS>;
@group(0) @binding(7) var volume: texture_3d<f32>;
@group(0) @binding(8) var volume_sampler: sampler;

const TF_CELLS = 1024.0;
// Cells of s in `frame.matter_cells`.
const MATTER_CELLS = 64.0;
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
    // How directions are chosen from the lobe: integral of its half vectors (ABC), and its share
    // of what is reflected, about.
    lobe_mass: f32,
    lobe_reflectance: f32,
    // Factors of the bands of spherical harmonics: six of the phase function, six of the specular lobe.
    bands: array<vec4f, 3>,
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

// What the table knows of s.
struct TableEntry {
    // Extinction at s, per world unit; not meant if `split`.
    sigma_t: f32,
    // Last control point at or below the lower edge of the cell of s; -1 if there is none.
    point: i32,
    // Whether another control point lies within the cell.
    split: bool,
}

fn table_entry(s: f32) -> TableEntry {
    let cell = min(floor(s * TF_CELLS), TF_CELLS - 1.0);
    let entry = textureLoad(tf_cells, vec2u(u32(cell), 0u), 0);
    let sigma_t = max(entry.x + entry.y * (s - cell / TF_CELLS), 0.0);
    return TableEntry(sigma_t, i32(entry.z), entry.w != 0.0);
}

// Whether two values surely lie in the same piece of the transfer function.
fn one_piece(a: TableEntry, b: TableEntry) -> bool {
    return !a.split && !b.split && a.point == b.point;
}

// The piece in which a way from s to larger values begins (`rising`), or to smaller ones: the
// index of its lower control point, -1 below the first. The search starts at `hint`.
fn piece_from(s: f32, rising: bool, hint: i32) -> i32 {
    let count = i32(steering(frame.point_count));
    var piece = hint;
    while piece + 1 < count && begins_below(piece + 1, s, rising) {
        piece++;
    }
    while piece >= 0 && !begins_below(piece, s, rising) {
        piece--;
    }
    return piece;
}

fn begins_below(point: i32, s: f32, or_at: bool) -> bool {
    let lower = point_row(u32(point), 0u).y;
    return lower < s || (or_at && lower == s);
}

// The values of s between which a piece lies; it ends nowhere beyond the outer points.
fn piece_interval(piece: i32) -> vec2f {
    let last = i32(steering(frame.point_count)) - 1;
    let lower = point_row(u32(max(piece, 0)), 0u).y;
    let upper = point_row(u32(min(piece + 1, last)), 0u).y;
    return vec2f(select(lower, -1.0, piece < 0), select(upper, 2.0, piece >= last));
}

// Extinction at s by a piece; exactly 0 where it is 0 at both of its points.
fn sigma_t_in(piece: i32, s: f32) -> f32 {
    let place = place_in(piece, s);
    return mix(point_row(place.lower, 0u).x, point_row(place.upper, 0u).x, place.t);
}

// Where s lies in a piece: constant beyond the outer points.
fn place_in(piece: i32, s: f32) -> Place {
    let last = steering(frame.point_count) - 1u;
    let lower = u32(max(piece, 0));
    let upper = select(min(lower + 1u, last), 0u, piece < 0);
    let row = point_row(lower, 0u);
    return Place(lower, upper, clamp((s - row.y) * row.z, 0.0, 1.0), u32(row.w));
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

// Whether there may be matter at any value from `low` to `high`.
fn may_hold_matter(low: f32, high: f32) -> bool {
    if low > frame.matter_range.y || high < frame.matter_range.x { return false; }
    let first = min(u32(low * MATTER_CELLS), u32(MATTER_CELLS) - 1u);
    let last = min(u32(high * MATTER_CELLS), u32(MATTER_CELLS) - 1u);
    // Bits first .. last of 64 in two words.
    let from_first = select(vec2u(0xffffffffu << first, 0xffffffffu), vec2u(0u, 0xffffffffu << (first - 32u)), first >= 32u);
    let to_last = select(vec2u(0xffffffffu >> (31u - last), 0u), vec2u(0xffffffffu, 0xffffffffu >> (63u - last)), last >= 32u);
    return any((frame.matter_cells & from_first & to_last) != vec2u(0u));
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
