// A photon at an interaction: what becomes of it. The module says which stage ends a path: DONE.

// At an interaction: the way on, or the end.
fn scatter_on(path: ptr<function, Path>, photon: vec2u) {
    let x = (*path).origin;
    let back = -(*path).direction;
    // From the place, not from the way to it: a photon that is taken up again has only the place.
    let s = s_of_texel(texel_value(x / frame.size_world + 0.5));
    let place = place_in(piece_of(s, true), s);
    let albedo = albedo_at(place);
    var n = vec3f(0.0);
    if SURFACES {
        if materials[place.material].surface > 0.0 { n = normal_at(x, back); }
    }
    let at = scatterer(materials[place.material], albedo, back, n);
    let way = sample_way_on(at, unit4(draw(path, photon)));
    let density = density_of_way_on(at, way);
    let factor = scattered_light(at, way) / density;
    let chance = unit2(draw(path, photon).xy).x;
    let scattered_on = (*path).throughput * factor;
    // Russian roulette: the brightest channel keeps its value, or comes back towards 1.
    let survival = min(max_of(scattered_on) / min(max_of((*path).throughput), 1.0), 1.0);
    let ends_here = !(density > 0.0 && dot(way, way) > 0.0 && max_of(scattered_on) > 0.0) || chance >= survival;
    (*path).stage = select(FLIGHT + TO_BEGIN, DONE, ends_here);
    if !ends_here {
        (*path).throughput = scattered_on / survival;
        (*path).direction = way;
        (*path).end = FARTHEST;
    }
}
