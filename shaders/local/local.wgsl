// Method `local`: classic shading. Single scattering of every light, nothing in between, and a
// uniform ambient (README.md). Exact in vacuum and thin matter; no shadows. Beside a light field it is
// what lights bring by themselves, through what is in between.

// Scattered radiance towards w_o per unit of extinction: sigma_s * L_i / sigma_t. `gradient` is
// that of s, world; where it vanishes the surface weight is 0.
fn scattered_radiance(x: vec3f, w_o: vec3f, albedo: vec3f, material: Material, gradient: vec3f) -> vec3f {
    let facing = surface_facing(w_o, material, gradient);
    let n = facing.xyz;
    let surface = facing.w;

    // Uniform ambient: the phase function integrates to 1, the BRDF to its reflectance.
    var sum = vec3f(0.0);
    if FIELD_BANDS == 0u {
        let reflected = albedo * material.ambient_diffuse + material.ambient_specular;
        sum = frame.ambient * mix(albedo, reflected, surface);
    }
    for (var i = 0u; i < steering(frame.light_count); i++) {
        var light = incident_light(i, x);
        var scattered = (1.0 - surface) * phase_function(material, dot(-light.w_i, w_o)) * albedo;
        if surface > 0.0 {
            let f_r = brdf(material, n, light.w_i, w_o);
            scattered += surface * (f_r.x * albedo + f_r.y) * max(dot(n, light.w_i), 0.0);
        }
        scattered *= light.irradiance;
        if DIRECT {
            let brightest = max(scattered.x, max(scattered.y, scattered.z));
            scattered *= transmittance_from(i, x, light.w_i, brightest > 0.0);
        }
        sum += scattered;
    }
    return sum;
}

// The surface's normal on the side of w_o, and its weight.
fn surface_facing(w_o: vec3f, material: Material, gradient: vec3f) -> vec4f {
    // A change of s by a millionth per voxel is rounding noise.
    let steepness = length(gradient);
    let voxel = frame.size_world / frame.voxels;
    let flat_field = steepness * min(voxel.x, min(voxel.y, voxel.z)) < 1e-6;
    let n = gradient / max(steepness, 1e-20);
    return vec4f(select(n, -n, dot(n, w_o) < 0.0), select(material.surface, 0.0, flat_field));
}
