// Phase functions; each integrates to 1 over the sphere. cos_theta is between the directions of
// travel before and after scattering, so positive asymmetry scatters forward. Mirrored in
// server/scene/src/scattering.rs; server/render/tests/scattering.rs compares the two.

const PI = 3.14159265358979;
const INVERSE_4PI = 0.0795774715459477;

fn phase_function(material: Material, cos_theta: f32) -> f32 {
    let g = material.asymmetry;
    var p = INVERSE_4PI;
    if HENYEY_GREENSTEIN {
        // Henyey, Greenstein 1941.
        let d = max(1.0 + g * g - 2.0 * g * cos_theta, 1e-7);
        if material.phase == 1u { p *= (1.0 - g * g) / (d * sqrt(d)); }
    }
    if SCHLICK {
        // Schlick's approximation, k in place of g.
        let d = 1.0 - g * cos_theta;
        if material.phase == 2u { p *= (1.0 - g * g) / max(d * d, 1e-7); }
    }
    return p;
}

// The same for light from w_i to w_o, exact in narrow lobes, too: the denominators are sums of
// positive terms, (1 - |g|)^2 + 2 |g| h and 1 - |g| + |g| h, with h the distance of the cosine from
// the lobe's middle.
fn phase_between(material: Material, w_i: vec3f, w_o: vec3f) -> f32 {
    var p = INVERSE_4PI;
    if HENYEY_GREENSTEIN || SCHLICK {
        let g = abs(material.asymmetry);
        let off = w_i + select(-w_o, w_o, material.asymmetry >= 0.0);
        let h = 0.5 * dot(off, off);
        let rest = 1.0 - g;
        if HENYEY_GREENSTEIN {
            let d = rest * rest + 2.0 * g * h;
            if material.phase == 1u { p *= rest * (1.0 + g) / (d * sqrt(d)); }
        }
        if SCHLICK {
            let d = rest + g * h;
            if material.phase == 2u { p *= rest * (1.0 + g) / (d * d); }
        }
    }
    return p;
}
