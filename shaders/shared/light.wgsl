// Analytic lights as seen from a point. The uniform environment is not in the table: see
// `frame.ambient`.

@group(0) @binding(4) var<uniform> lights: array<Light, MAX_LIGHTS>;

const MAX_LIGHTS = 64;

struct Light {
    // Position of point, spot, rectangle, disk and sphere lights.
    position: vec3f,
    // 0 directional, 1 point, 2 spot, 3 rectangle or disk, 4 sphere.
    kind: u32,
    // The way a directional light or the axis of a spot travels; normal of rectangle and disk.
    direction: vec3f,
    // Rectangle and disk: area. Sphere: radius.
    extent: f32,
    // Irradiance, radiant intensity or radiance, by kind.
    power: vec3f,
    cos_inner: f32,
    cos_outer: f32,
    // Its place in fields of direct light, whatever the order of lights.
    slot: u32,
    pad0: u32,
    pad1: u32,
}

struct Incident {
    // Towards the light, unit.
    w_i: vec3f,
    // On a plane that faces the light.
    irradiance: vec3f,
}

// Squared distance below which inverse-square falloff is held: 1e-4 world units, a hundredth of
// a voxel of a 100^3 volume.
const NEAREST_SQUARED = 1e-8;

// Light from light `index` at x, nothing in between. Area lights act from their centre with the
// solid angle of their projected area (exact for small or distant lights).
fn incident_light(index: u32, x: vec3f) -> Incident {
    let light = lights[index];
    var incident = Incident(-light.direction, light.power);
    if !LIGHTS_WITH_A_PLACE { return incident; }
    if light.kind != 0u {
        let to_light = light.position - x;
        let squared = max(dot(to_light, to_light), NEAREST_SQUARED);
        incident.w_i = to_light * inverseSqrt(squared);
        var falloff = 1.0 / squared;
        let cosine = -dot(incident.w_i, light.direction);
        if light.kind == 2u {
            var inside = select(0.0, 1.0, cosine >= light.cos_inner);
            if light.cos_inner > light.cos_outer {
                inside = smoothstep(light.cos_outer, light.cos_inner, cosine);
            }
            falloff = inside / squared;
        } else if light.kind == 3u {
            falloff = light.extent * max(cosine, 0.0) / (squared + light.extent / PI);
        } else if light.kind == 4u {
            let sine_squared = min(light.extent * light.extent / squared, 1.0);
            falloff = 2.0 * PI * (1.0 - sqrt(1.0 - sine_squared));
        }
        incident.irradiance = light.power * falloff;
    }
    return incident;
}
