//! Hard matter: extinction, albedo, phase, transfer functions.

use proto::scene_file::Builtin;
use serde_json::{Value, json};

use super::case::{Case, Data, Expect, slab};

/// Radiance behind the box of [`slab`].
const BACKGROUND: f64 = 0.5;
const EMISSION: f64 = 2.0;
/// Extinctions: none, denormal in f64, denormal in f32, and what lies between glass and rock.
const EXTINCTIONS: [f64; 10] = [0.0, 1e-310, 1e-40, 1e-6, 1e-3, 1.0, 1e2, 1e3, 1e4, 1e6];

pub fn cases() -> Vec<Case> {
    let mut cases = extinctions();
    cases.extend(albedos());
    cases.extend(phases());
    cases.extend(transfer_functions());
    cases
}

fn uniform_box(case: Case) -> Case {
    case.data(Data::Builtin(Builtin::Homogeneous, [4; 3]))
}

fn extinctions() -> Vec<Case> {
    let mut cases = Vec::new();
    for extinction in EXTINCTIONS {
        let transmittance = (-extinction).exp();
        let expected = transmittance * BACKGROUND + (1.0 - transmittance) * EMISSION;
        let case = Case::new(
            "extinction",
            format!("{extinction:e}, black matter that glows"),
            slab(extinction, 0.0, EMISSION),
        );
        let case = uniform_box(case).expect(Expect::Radiance([expected; 3], 2e-3));
        let lit = Case::new("extinction", format!("{extinction:e}, white matter"), white(extinction));
        // A reference of all orders takes half a minute for white matter of 1e6.
        let quick = |case: Case, among: &[f64]| if among.contains(&extinction) { case.quick() } else { case };
        cases.push(quick(case, &[0.0, 1e-40, 1.0, 1e6]));
        cases.push(quick(lit.expect(of_white(extinction)), &[0.0, 1e-40, 1.0, 1e4]));
    }
    cases
}

fn white(extinction: f64) -> Value {
    // Where a path takes thousands of events it is cut, and the share that is lost is told.
    let longest_path = if extinction > 1e5 { 40 } else { 100_000 };
    json!({"illumination": {"longest_path": longest_path}, "transfer_function": {"points": [
        {"s": 0.0, "extinction": 0}, {"s": 0.3, "extinction": 0}, {"s": 0.7, "extinction": extinction}]}})
}

/// Behind the first thousandth of a voxel nothing is seen: a step of one voxel sees too deep a
/// place by a share of the light's change, which for soft light is small.
fn of_white(extinction: f64) -> Expect {
    if extinction > 100.0 { Expect::Reference(0.15) } else { Expect::Reference(super::case::USUAL_TOLERANCE) }
}

fn albedos() -> Vec<Case> {
    let with = |albedo: [f64; 3], extinction: f64| {
        json!({"transfer_function": {"points": [
            {"s": 0.0, "extinction": 0, "albedo": albedo}, {"s": 0.05, "extinction": 0, "albedo": albedo},
            {"s": 1.0, "extinction": extinction, "albedo": albedo}]}})
    };
    let of = |name: &str, albedo, extinction| Case::new("albedo", name, with(albedo, extinction));
    let mut emitting = with([1.0; 3], 12.0);
    emitting["transfer_function"]["points"][2]["emission"] = json!([1e6, 1e6, 1e6]);
    vec![
        of("0", [0.0; 3], 12.0),
        of("1", [1.0; 3], 12.0).quick(),
        of("1, extinction 1e4", [1.0; 3], 1e4).expect(Expect::Reference(0.15)),
        of("1, 0, 0", [1.0, 0.0, 0.0], 12.0).quick(),
        of("0, 1, 0.5", [0.0, 1.0, 0.5], 12.0),
        Case::new("albedo", "1 at the top, emission 1e6 that it must not show there", emitting),
        uniform_box(Case::new(
            "albedo",
            "1, emission 1e6: nothing is absorbed, nothing glows",
            slab(2.0, 1.0, 1e6),
        ))
        .expect(Expect::Radiance([BACKGROUND * (-2.0f64).exp(); 3], 2e-3)),
    ]
}

fn phases() -> Vec<Case> {
    let mut cases = Vec::new();
    for g in [0.99f64, -0.99, 0.999, -0.999] {
        for (kind, key) in [("henyey_greenstein", "g"), ("schlick", "k")] {
            let patch = json!({"materials": {"m": {"phase": {"type": kind, key: g}}}});
            let mut patch_without_g = patch;
            if kind == "schlick" {
                patch_without_g["materials"]["m"]["phase"]["g"] = Value::Null;
            }
            let case = Case::new("phase", format!("{kind} {g}"), patch_without_g);
            cases.push(if g.abs() > 0.99 { case.quick() } else { case });
        }
    }
    // Looking into the light: the peak of the phase function.
    let into_the_light = json!({
        "materials": {"m": {"phase": {"type": "henyey_greenstein", "g": 0.999}}},
        "lights": [{"id": "sun", "type": "directional", "direction": [0.3, 0.4, 1.6], "irradiance": [2, 2, 2]}],
        "camera": {"position": [0.3, 0.4, 1.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 12}});
    cases.push(
        Case::new("phase", "henyey_greenstein 0.999, looking into the light", into_the_light)
            .expect(Expect::Stated("the peak is narrower than a pixel: few samples hit it")),
    );
    for exponent in [0.0, 1e4] {
        let patch = json!({"materials": {"m": {"surface": 1, "phase": null, "brdf":
            {"type": "ashikhmin_shirley", "diffuse": 0.5, "specular": 0.5, "exponents": [exponent, 1e4 - exponent]}}}});
        let case = Case::new(
            "phase",
            format!("Ashikhmin-Shirley, exponents {exponent} and {}", 1e4 - exponent),
            patch,
        );
        cases.push(case.expect(Expect::Stated("highlights narrower than a pixel")));
    }
    cases
}

fn transfer_functions() -> Vec<Case> {
    let of = |name: &str, points: Value| {
        Case::new("transfer function", name, json!({"transfer_function": {"points": points}}))
    };
    let many: Vec<Value> = (0..256)
        .map(
            |i| json!({"s": f64::from(i) / 255.0, "extinction": f64::from(i % 7), "albedo": [0.5, 0.6, 0.7]}),
        )
        .collect();
    vec![
        of("a step of no width", json!([{"s": 0.5, "extinction": 0}, {"s": 0.5, "extinction": 12}])).quick(),
        of(
            "steps of no width at 0 and 1",
            json!([
            {"s": 0, "extinction": 3}, {"s": 0, "extinction": 0}, {"s": 1, "extinction": 0}, {"s": 1, "extinction": 9}]),
        )
        // Matter begins where values reach 1, between two samples: an error of the first order.
        .expect(Expect::Reference(0.25)),
        of(
            "the same point five times",
            json!([
            {"s": 0.4, "extinction": 0}, {"s": 0.4, "extinction": 5}, {"s": 0.4, "extinction": 5},
            {"s": 0.4, "extinction": 900}, {"s": 0.4, "extinction": 6}]),
        ),
        of("256 points", json!(many)),
        of("257 points", json!((0..257).map(|_| json!({"s": 0.5, "extinction": 1})).collect::<Vec<_>>()))
            .expect(Expect::Refused("transfer_function.points")),
        of("no point", json!([])).expect(Expect::Refused("transfer_function.points")),
        of("all zero", json!([{"s": 0, "extinction": 0}, {"s": 1, "extinction": 0}])).quick(),
        of("all one", json!([{"s": 0, "extinction": 1}, {"s": 1, "extinction": 1}])),
        of("opacity 1 everywhere", json!([{"s": 0, "opacity": 1}])),
        of("points out of order", json!([{"s": 0.6, "extinction": 1}, {"s": 0.2, "extinction": 1}]))
            .expect(Expect::Refused("transfer_function.points[1].s")),
        of("extinction below 0", json!([{"s": 0, "extinction": -1}]))
            .expect(Expect::Refused("transfer_function.points[0].extinction")),
    ]
}
