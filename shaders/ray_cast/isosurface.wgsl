// The first place on the ray that has the isovalue, as an opaque surface in light.

// Halvings of the step in which the field passes the isovalue: to 1/256 of it.
const REFINEMENTS = 8u;

fn isosurface(way: Way, counts: ptr<function, vec4u>) -> vec3f {
    var k = way.first;
    var unknown = k;
    var near_above = false;
    var near_is_known = false;
    while k < way.end {
        let next = leap(way, k, &unknown);
        if next > k {
            (*counts).y += u32(next - k);
            k = next;
            near_is_known = false;
            continue;
        }
        if !near_is_known { near_above = is_above(way.ray, distance_at(way, k)); }
        let far_above = is_above(way.ray, distance_at(way, k + 1.0));
        (*counts).x += 1u;
        if near_above != far_above {
            (*counts).w += 1u;
            var near_t = distance_at(way, k);
            var far_t = distance_at(way, k + 1.0);
            for (var i = 0u; i < REFINEMENTS; i++) {
                let middle = 0.5 * (near_t + far_t);
                if is_above(way.ray, middle) == near_above { near_t = middle; } else { far_t = middle; }
            }
            return surface_radiance(way.ray, 0.5 * (near_t + far_t));
        }
        near_above = far_above;
        near_is_known = true;
        k += 1.0;
    }
    return frame.background;
}

fn is_above(ray: Ray, t: f32) -> bool {
    return s_at(ray, t) >= frame.surface.w;
}

// Light from an opaque surface of the matter that the transfer function has at the isovalue;
// matter without a surface of its own gets a diffuse one.
fn surface_radiance(ray: Ray, t: f32) -> vec3f {
    let s = clamp(frame.surface.w, 0.0, 1.0);
    let place = place_in(piece_from(s, true, table_entry(s).point), s);
    var material = materials[place.material];
    if material.surface <= 0.0 {
        material.brdf = 0u;
        material.diffuse = 1.0;
        material.ambient_diffuse = 1.0;
        material.ambient_specular = 0.0;
    }
    material.surface = 1.0;
    let gradient = gradient_at(uvw_at(ray, t));
    return scattered_radiance(ray.origin + t * ray.direction, -ray.direction, albedo_at(place), material, gradient);
}
