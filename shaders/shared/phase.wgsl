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
