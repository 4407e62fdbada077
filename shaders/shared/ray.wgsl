// View rays and their way through the volume's box.

struct Ray {
    origin: vec3f,
    // Unit length.
    direction: vec3f,
}

// Smallest magnitude of a direction component in a division: 1 / 1e-12 times any world
// coordinate stays far below the largest f32, and a ray this close to an axis misses a slab by
// less than a rounding error.
const PARALLEL = 1e-12;

// Ray through image point p, pixels from the upper left corner; pixels are square.
fn camera_ray(p: vec2f) -> Ray {
    let image = vec2f(frame.image);
    let u = (2.0 * p.x - image.x) / image.y;
    let v = (image.y - 2.0 * p.y) / image.y;
    let offset = frame.half_height * (u * frame.right + v * frame.up);
    if steering(frame.projection) == 0u {
        return Ray(frame.eye, normalize(frame.forward + offset));
    }
    return Ray(frame.eye + offset, frame.forward);
}

// Distances at which the ray enters and leaves an axis-aligned box; empty if x >= y.
fn box_interval(ray: Ray, low: vec3f, high: vec3f) -> vec2f {
    let tiny = select(vec3f(PARALLEL), vec3f(-PARALLEL), ray.direction < vec3f(0.0));
    let direction = select(ray.direction, tiny, abs(ray.direction) < vec3f(PARALLEL));
    let a = (low - ray.origin) / direction;
    let b = (high - ray.origin) / direction;
    let near = min(a, b);
    let far = max(a, b);
    return vec2f(max(max(near.x, near.y), near.z), min(min(far.x, far.y), far.z));
}

// The part of `interval` inside the clip box and on the kept side of every clip plane. What is
// kept is convex, so it is one interval.
fn clip_interval(ray: Ray, interval: vec2f) -> vec2f {
    let inside = box_interval(ray, frame.clip_low, frame.clip_high);
    var kept = vec2f(max(interval.x, inside.x), min(interval.y, inside.y));
    for (var i = 0u; i < steering(frame.plane_count); i++) {
        let plane = frame.planes[i];
        let height = dot(plane.xyz, ray.origin) - plane.w;
        let slope = dot(plane.xyz, ray.direction);
        if abs(slope) < PARALLEL {
            if height < 0.0 { return vec2f(0.0, -1.0); }
        } else if slope > 0.0 {
            kept.x = max(kept.x, -height / slope);
        } else {
            kept.y = min(kept.y, -height / slope);
        }
    }
    return kept;
}
