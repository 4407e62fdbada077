// Surface reflection. n points to the viewer's side, w_i towards the light, w_o towards the eye;
// light from behind contributes nothing. x: factor of the albedo (diffuse); y: achromatic
// (specular). The cosine is not included. Mirrored in server/scene/src/scattering.rs;
// server/render/tests/scattering.rs compares the two.

fn brdf(material: Material, n: vec3f, w_i: vec3f, w_o: vec3f) -> vec2f {
    let n_i = dot(n, w_i);
    let n_o = max(dot(n, w_o), 1e-4);
    if n_i <= 0.0 { return vec2f(0.0); }
    let half_vector = w_i + w_o;
    let h = half_vector / max(length(half_vector), 1e-6);
    let n_h = clamp(dot(n, h), 0.0, 1.0);
    let lambert = material.diffuse / PI;
    var f_r = vec2f(lambert, 0.0);
    if BLINN_PHONG {
        if material.brdf == 1u { f_r.y = material.specular * material.lobe.y * pow(n_h, material.lobe.x); }
    }
    if ASHIKHMIN_SHIRLEY {
        if material.brdf == 2u {
            f_r = ashikhmin_shirley(material, n, h, n_i, n_o, n_h, clamp(dot(h, w_o), 1e-4, 1.0));
        }
    }
    if ABC {
        if material.brdf == 3u {
            f_r.y = material.specular / pow(1.0 + material.lobe.x * (1.0 - n_h), material.lobe.y);
        }
    }
    return f_r;
}

// Ashikhmin, Shirley 2000: An anisotropic Phong BRDF model, eq. 4 and 5.
fn ashikhmin_shirley(material: Material, n: vec3f, h: vec3f, n_i: f32, n_o: f32, n_h: f32, h_o: f32) -> vec2f {
    let fade_i = 1.0 - pow(1.0 - 0.5 * n_i, 5.0);
    let fade_o = 1.0 - pow(1.0 - 0.5 * n_o, 5.0);
    let diffuse = 28.0 / (23.0 * PI) * material.diffuse * (1.0 - material.specular) * fade_i * fade_o;
    // Share of the two exponents by the azimuth of h around n.
    let tangent = tangent_of(n);
    let h_u = dot(h, tangent);
    let h_v = dot(h, cross(n, tangent));
    let across = max(h_u * h_u + h_v * h_v, 1e-12);
    let exponent = (material.lobe.x * h_u * h_u + material.lobe.y * h_v * h_v) / across;
    let fresnel = material.specular + (1.0 - material.specular) * pow(1.0 - h_o, 5.0);
    let scale = sqrt((material.lobe.x + 1.0) * (material.lobe.y + 1.0)) / (8.0 * PI);
    return vec2f(diffuse, scale * pow(n_h, exponent) / (h_o * max(n_i, n_o)) * fresnel);
}

// A unit vector perpendicular to n (Duff et al. 2017).
fn tangent_of(n: vec3f) -> vec3f {
    let side = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (side + n.z);
    return vec3f(1.0 + side * n.x * n.x * a, side * n.x * n.y * a, -side * n.x);
}
