// The scalar field and the transfer function (methods.md section 1): interpolate the data first,
// then look up matter.

@group(0) @binding(1) var<storage, read> tf_points: array<TransferFunctionPoint>;
// Entry c: the last point at or below s = c / TF_CELLS.
@group(0) @binding(2) var<storage, read> tf_cells: array<u32>;
@group(0) @binding(3) var<uniform> materials: array<Material, MAX_MATERIALS>;
@group(0) @binding(7) var volume: texture_3d<f32>;
@group(0) @binding(8) var volume_sampler: sampler;

const TF_CELLS = 256u;
// The scene's materials and the isotropic one before them.
const MAX_MATERIALS = 65;

// 0: hardware trilinear filter. 1: f32 interpolation of eight texels. 2: nearest voxel.
override FILTER: u32 = 0u;

struct TransferFunctionPoint {
    albedo: vec3f,
    // Extinction per world unit.
    sigma_t: f32,
    emission: vec3f,
    s: f32,
    material: u32,
    // 1 / (next point's s - s); 0 at the last point and at a step.
    inverse_width: f32,
    pad0: u32,
    pad1: u32,
}

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

// Where s lies: linear between points, constant beyond the ends, the later of two points at one s.
fn place_of(s: f32) -> Place {
    let last = frame.point_count - 1u;
    var i = tf_cells[min(u32(s * f32(TF_CELLS)), TF_CELLS - 1u)];
    while i < last && tf_points[i + 1u].s <= s {
        i++;
    }
    return Place(i, min(i + 1u, last), clamp((s - tf_points[i].s) * tf_points[i].inverse_width, 0.0, 1.0));
}

// One property at a time: most samples need the extinction alone.
fn sigma_t_at(place: Place) -> f32 {
    return mix(tf_points[place.lower].sigma_t, tf_points[place.upper].sigma_t, place.t);
}

fn albedo_at(place: Place) -> vec3f {
    return mix(tf_points[place.lower].albedo, tf_points[place.upper].albedo, place.t);
}

fn emission_at(place: Place) -> vec3f {
    return mix(tf_points[place.lower].emission, tf_points[place.upper].emission, place.t);
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
