//! Surface reflection, without the cosine. `n` is a unit vector on the side of `w_o`; `w_i` points
//! towards the light, `w_o` towards the eye; light from behind the surface contributes nothing.
//! Formulas: method `local`'s README, and README.md here for how each is sampled.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use proto::scene_file::{AshikhminShirley, Brdf};

use crate::frame::{around, on_disk, tangents};

/// x: factor of the albedo (diffuse); y: achromatic (specular). Per steradian.
pub fn value(brdf: &Brdf, n: DVec3, w_i: DVec3, w_o: DVec3) -> DVec2 {
    let (n_i, n_o) = (n.dot(w_i), n.dot(w_o));
    if n_i <= 0.0 || n_o <= 0.0 {
        return DVec2::ZERO;
    }
    let h = (w_i + w_o).normalize();
    let n_h = n.dot(h).min(1.0);
    match brdf {
        Brdf::Lambert(b) => DVec2::new(b.diffuse / PI, 0.0),
        Brdf::BlinnPhong(b) => {
            let e = b.exponent;
            let scale = (e + 2.0) * (e + 4.0) / (8.0 * PI * ((-0.5 * e).exp2() + e));
            DVec2::new(b.diffuse / PI, b.specular * scale * n_h.powf(e))
        }
        Brdf::Abc(b) => DVec2::new(b.diffuse / PI, b.a * (1.0 + b.b * (1.0 - n_h)).powf(-b.c)),
        Brdf::AshikhminShirley(b) => {
            let faded = |cosine: f64| 1.0 - (1.0 - 0.5 * cosine).powi(5);
            let diffuse = 28.0 / (23.0 * PI) * b.diffuse * (1.0 - b.specular) * faded(n_i) * faded(n_o);
            let h_o = h.dot(w_o);
            let fresnel = b.specular + (1.0 - b.specular) * (1.0 - h_o).powi(5);
            // The published scale has 8 pi where the density of half vectors has 2 pi.
            let lobe = 0.25 * anisotropic_density(b, n, h);
            DVec2::new(diffuse, lobe * fresnel / (h_o * n_i.max(n_o)))
        }
    }
}

/// Density per steradian of half vectors around `n` with two exponents (Ashikhmin, Shirley 2000).
fn anisotropic_density(b: &AshikhminShirley, n: DVec3, h: DVec3) -> f64 {
    let (u, v) = tangents(n);
    let squares = [h.dot(u).powi(2), h.dot(v).powi(2)];
    let across = squares[0] + squares[1];
    let exponent =
        if across > 0.0 { (b.exponents[0] * squares[0] + b.exponents[1] * squares[1]) / across } else { 0.0 };
    let scale = ((b.exponents[0] + 1.0) * (b.exponents[1] + 1.0)).sqrt() / (2.0 * PI);
    scale * n.dot(h).clamp(0.0, 1.0).powf(exponent)
}

/// Density per steradian of half vectors that the specular lobe is sampled with.
fn half_vector_density(brdf: &Brdf, n: DVec3, h: DVec3) -> f64 {
    let n_h = n.dot(h).clamp(0.0, 1.0);
    match brdf {
        Brdf::Lambert(_) => 0.0,
        Brdf::BlinnPhong(b) => (b.exponent + 1.0) / (2.0 * PI) * n_h.powf(b.exponent),
        Brdf::AshikhminShirley(b) => anisotropic_density(b, n, h),
        Brdf::Abc(b) => (1.0 + b.b * (1.0 - n_h)).powf(-b.c) / (2.0 * PI * abc_mass(b.b, b.c, 1.0)),
    }
}

/// Integral of `(1 + b y)^-c` over y from 0 to `end`.
fn abc_mass(b: f64, c: f64, end: f64) -> f64 {
    let log = (b * end).ln_1p();
    // log(1 + b y) / b tends to y as b goes to 0.
    let scaled = if b * end < 1e-12 { end } else { log / b };
    let x = (1.0 - c) * log;
    // (exp(x) - 1) / x tends to 1 as x goes to 0.
    if x.abs() < 1e-12 { scaled } else { scaled * x.exp_m1() / x }
}

/// The y at which [`abc_mass`] reaches the share `u` of its value at 1.
fn abc_inverse(b: f64, c: f64, u: f64) -> f64 {
    if b < 1e-12 {
        return u;
    }
    let whole = (1.0 - c) * b.ln_1p();
    // log(1 + b y), from the inverse of the mass; by its limit where c is 1.
    let log = if whole.abs() < 1e-12 { u * b.ln_1p() } else { (u * whole.exp_m1()).ln_1p() / (1.0 - c) };
    (log.exp_m1() / b).clamp(0.0, 1.0)
}

/// Share of samples that go to the specular lobe, for surfaces whose diffuse part is multiplied by
/// `albedo` (the largest of its channels). Any value in 0..1 is right where both parts shine; this
/// one follows what they reflect.
pub fn specular_share(brdf: &Brdf, albedo: f64) -> f64 {
    let (diffuse, specular) = match brdf {
        Brdf::Lambert(_) => return 0.0,
        Brdf::BlinnPhong(b) => (b.diffuse, b.specular),
        // Fresnel: grazing reflection exceeds the reflectance at normal incidence.
        Brdf::AshikhminShirley(b) => (b.diffuse * (1.0 - b.specular), b.specular.max(0.05)),
        // Reflectance of a lobe of this mass around the normal, solid angles being 4 cos larger
        // for directions than for half vectors.
        Brdf::Abc(b) => (b.diffuse, 8.0 * PI * b.a * abc_mass(b.b, b.c, 1.0)),
    };
    let (diffuse, specular) = (diffuse * albedo, specular.min(1.0));
    match (diffuse > 0.0, specular > 0.0) {
        (_, false) => 0.0,
        (false, true) => 1.0,
        _ => (specular / (diffuse + specular)).clamp(0.1, 0.9),
    }
}

/// Density per steradian with which [`sample`] chooses `w_i`. Integrates to at most 1: half
/// vectors that would reflect from behind are lost.
pub fn pdf(brdf: &Brdf, albedo: f64, n: DVec3, w_i: DVec3, w_o: DVec3) -> f64 {
    let share = specular_share(brdf, albedo);
    let mut density = (1.0 - share) * n.dot(w_i).max(0.0) / PI;
    let sum = w_i + w_o;
    if share > 0.0 && sum.length_squared() > 0.0 {
        let h = sum.normalize();
        if n.dot(h) > 0.0 {
            density += share * half_vector_density(brdf, n, h) / (4.0 * h.dot(w_o));
        }
    }
    density
}

/// A direction towards light, from the specular lobe if the number `lobe` in 0..1 is below
/// [`specular_share`]; `None` where the sampled half vector is turned away from the eye.
pub fn sample(brdf: &Brdf, albedo: f64, n: DVec3, w_o: DVec3, lobe: f64, uv: [f64; 2]) -> Option<DVec3> {
    if lobe >= specular_share(brdf, albedo) {
        // Cosine-weighted: uniform on the disk below.
        let [x, y] = on_disk(uv);
        let (u, v) = tangents(n);
        return Some((x * u + y * v + (1.0 - x * x - y * y).max(0.0).sqrt() * n).normalize());
    }
    let [u, v] = uv;
    let (cosine, azimuth) = match brdf {
        Brdf::Lambert(_) => return None,
        Brdf::BlinnPhong(b) => ((1.0 - u).powf(1.0 / (b.exponent + 1.0)), 2.0 * PI * v),
        Brdf::Abc(b) => (1.0 - abc_inverse(b.b, b.c, u), 2.0 * PI * v),
        Brdf::AshikhminShirley(b) => {
            // A quarter turn at a time, the tangent of the azimuth being scaled.
            let [e_u, e_v] = b.exponents;
            let quarter = (4.0 * v).floor().min(3.0);
            let within = 4.0 * v - quarter;
            let mirrored = if quarter % 2.0 == 0.0 { within } else { 1.0 - within };
            let angle = (((e_u + 1.0) / (e_v + 1.0)).sqrt() * (0.5 * PI * mirrored).tan()).atan();
            let from_axis = if quarter % 2.0 == 0.0 { angle } else { 0.5 * PI - angle };
            let azimuth = 0.5 * PI * quarter + from_axis;
            let exponent = e_u * azimuth.cos().powi(2) + e_v * azimuth.sin().powi(2);
            ((1.0 - u).powf(1.0 / (exponent + 1.0)), azimuth)
        }
    };
    let h = around(n, cosine.min(1.0), azimuth);
    let h_o = h.dot(w_o);
    (h_o > 0.0).then(|| (2.0 * h_o * h - w_o).normalize())
}
