// A path of light under way, kept between dispatches: from the eye (path_traced) or from a light
// (photon_map). A module that follows paths says how they are told apart, `seed()`, and whether
// `clipped_matter_blocks()`.

// A path under way.
struct Path {
    // The present ray.
    origin: vec3f,
    // How far it has come.
    t: f32,
    direction: vec3f,
    // Where along it a cell is looked up next.
    lookup: f32,
    throughput: vec3f,
    // To the next tentative collision.
    optical_depth: f32,
    // Found so far.
    radiance: vec3f,
    // Of a shadow ray, so far.
    transmittance: f32,
    // The last scattering event: towards the eye, the surface's normal (0: none), and s.
    w_o: vec3f,
    s: f32,
    n: vec3f,
    // Of the present ray's direction.
    density: f32,
    // What a shadow ray brings if nothing is in its way.
    weight: vec3f,
    // The present ray's; before it has begun, of the light it is meant for.
    end: f32,
    stage: u32,
    // Next light to look for.
    light: u32,
    scatterings: u32,
    // Random numbers drawn.
    draws: u32,
}

// Farther than any light with a place.
const FARTHEST = 1e30;

// What the present ray is.
const START = 0u;
// From the eye.
const VIEW = 1u;
// From a scattering event on.
const FLIGHT = 2u;
// Towards a light.
const SHADOW = 3u;
// Added to these while the ray has not begun.
const TO_BEGIN = 4u;

// The part of a new ray on which there may be matter, and its way to the first tentative collision.
fn begin_ray(path: ptr<function, Path>, pixel: vec2u) {
    let ray = Ray((*path).origin, (*path).direction);
    var whole = box_interval(ray, -0.5 * frame.size_world, 0.5 * frame.size_world);
    whole.x = max(whole.x, 0.0);
    let kept = clip_interval(ray, whole);
    if (*path).stage < TO_BEGIN { return; }
    (*path).stage -= TO_BEGIN;
    let all = (*path).stage != VIEW && clipped_matter_blocks();
    let interval = select(kept, whole, all);
    (*path).t = interval.x;
    (*path).lookup = interval.x;
    (*path).end = min(interval.y, (*path).end);
    (*path).optical_depth = -log(unit2(draw(path, pixel).xy).x);
    (*path).transmittance = 1.0;
}

fn max_of(v: vec3f) -> f32 {
    return max(v.x, max(v.y, v.z));
}
