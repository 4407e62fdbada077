//! Method `image_based` against closed forms; and what edits redo.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Duration;

use common::{draw, homogeneous, json_merge, prepared, radiance, renderer, snapshot, target};
use glam::DVec3;
use proptest::prelude::*;
use reference::closed_forms::{HomogeneousBox, henyey_greenstein, isotropic};
use render::{DrawRequest, Drawn, View};
use scene::plan::Pass;
use scene::{PreparedVolume, Volume, Voxels};
use serde_json::{Value, json};

const SIGMA_T: f64 = 3.0;
const ALBEDO: f64 = 0.8;

fn cube(settings: Value, lights: Value, phase: Value) -> Value {
    let mut illumination = json!({"method": "image_based", "records": 48, "record_directions": 48});
    json_merge(&mut illumination, settings);
    json!({"illumination": illumination, "lights": lights,
        "materials": {"m": {"phase": phase}},
        "transfer_function": {"points": [{"s": 0, "extinction": SIGMA_T, "albedo": [ALBEDO, ALBEDO, ALBEDO], "material": "m"}]},
        "camera": {"position": [1.3, 0.9, 1.7], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 35},
        "sampling": {"termination_transmittance": 0, "step_voxels": 0.5}})
}

/// Pixels: closed forms take a while.
const SIZE: [u32; 2] = [4, 3];
const ONE: [u32; 2] = [1, 1];

/// A picture of the cube by a formula of the view ray.
fn picture([width, height]: [u32; 2], formula: impl Fn((DVec3, DVec3)) -> f64) -> Vec<f64> {
    let any = cube(json!({}), json!([]), json!({"type": "isotropic"}));
    let camera = snapshot(&homogeneous([16; 3]), any, 1).scene.camera;
    let ray = |i: u32| camera.ray(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5, width, height);
    (0..width * height).map(|i| formula(ray(i))).collect()
}

/// Single scattering of a uniform environment of radiance 1 by midpoint rules: the closed form with a
/// phase function takes minutes.
fn scattered_once((origin, direction): (DVec3, DVec3), scatter: impl Fn(DVec3, DVec3) -> f64) -> f64 {
    const STEPS: usize = 60;
    const RINGS: usize = 80;
    let Some([near, far]) = CUBE.chord(origin, direction) else { return 0.0 };
    let step = (far - near) / STEPS as f64;
    let middle = |i: usize, count: usize| (i as f64 + 0.5) / count as f64;
    let at = |i: usize| {
        let t = step * (i as f64 + 0.5);
        let x = origin + (near + t) * direction;
        let towards = |k: usize| {
            let z = 2.0 * middle(k / (2 * RINGS), RINGS) - 1.0;
            let (sin, cos) = (2.0 * PI * middle(k % (2 * RINGS), 2 * RINGS)).sin_cos();
            let w_i = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            scatter(w_i, -direction) * CUBE.transmittance(x, w_i)
        };
        let count = 2 * RINGS * RINGS;
        let arriving = (0..count).map(towards).sum::<f64>() * 4.0 * PI / count as f64;
        SIGMA_T * (-SIGMA_T * t).exp() * arriving * step
    };
    (0..STEPS).map(at).sum()
}

/// Relative L2 difference of a scene from such a picture.
fn off(scene: Value, expected: &[f64]) -> f64 {
    let snapshot = snapshot(&homogeneous([16; 3]), scene, 1);
    let [width, height] = if expected.len() == 1 { ONE } else { SIZE };
    let image = radiance(&snapshot, target(width, height, 1));
    let got = image.rgb.chunks_exact(3).map(|pixel| f64::from(pixel[0]));
    let difference: f64 = got.zip(expected).map(|(got, expected)| (got - expected).powi(2)).sum();
    (difference / expected.iter().map(|x| x * x).sum::<f64>()).sqrt()
}

const CUBE: HomogeneousBox = HomogeneousBox { size: DVec3::ONE, sigma_t: SIGMA_T };

#[test]
fn single_scattering_of_a_uniform_environment() {
    let sky = json!([{"type": "environment", "radiance": [2, 2, 2]}]);
    let scene = |settings| cube(settings, sky.clone(), json!({"type": "isotropic"}));
    let expected = &picture(SIZE, |ray| CUBE.lit_by_environment(ray, 2.0, isotropic(ALBEDO)));
    let found = off(scene(json!({})), expected);
    eprintln!("uniform environment: {found:.2e}");
    assert!(found < 0.01, "{found}");
    // The comparison can fail: the paper's cells, one record for each.
    let rough = off(scene(json!({"record_lookup": "containing", "records": 4})), expected);
    assert!(rough > 3.0 * found && rough > 0.02, "{rough}");
}

#[test]
fn single_scattering_of_a_sun_and_of_a_lamp() {
    let travel = DVec3::new(-0.36, -0.8, 0.48);
    let sun = json!([{"type": "directional", "direction": travel.to_array(), "irradiance": [3, 3, 3]}]);
    let scene = |lights| cube(json!({"record_directions": 12}), lights, json!({"type": "isotropic"}));
    let found =
        off(scene(sun), &picture(SIZE, |ray| CUBE.lit_by_directional(ray, (travel, 3.0), isotropic(ALBEDO))));
    eprintln!("directional: {found:.2e}");
    assert!(found < 0.02, "{found}");
    let place = DVec3::new(0.4, 1.1, 0.3);
    let lamp = json!([{"type": "point", "position": place.to_array(), "intensity": [3, 3, 3]}]);
    let found =
        off(scene(lamp), &picture(SIZE, |ray| CUBE.lit_by_point(ray, (place, 3.0), isotropic(ALBEDO))));
    eprintln!("point: {found:.2e}");
    assert!(found < 0.02, "{found}");
}

#[test]
fn phase_functions_act_band_by_band() {
    let (g, bands) = (0.4, 6);
    let phase = json!({"type": "henyey_greenstein", "g": g});
    let sky = json!([{"type": "environment", "radiance": [2, 2, 2]}]);
    let scene = |bands: u32| cube(json!({"record_bands": bands}), sky.clone(), phase.clone());
    let expected = &picture(ONE, |ray| 2.0 * scattered_once(ray, henyey_greenstein(ALBEDO, g)));
    let found = off(scene(bands), expected);
    let few = off(scene(1), expected);
    eprintln!("henyey-greenstein: {found:.2e}, with one band {few:.2e}");
    assert!(found < 0.01, "{found}");
    assert!(few > 2.0 * found, "{few}");
    let travel = DVec3::new(-0.36, -0.8, 0.48);
    let sun = json!([{"type": "directional", "direction": travel.to_array(), "irradiance": [3, 3, 3]}]);
    let expected =
        picture(SIZE, |ray| CUBE.lit_by_directional(ray, (travel, 3.0), henyey_greenstein(ALBEDO, g)));
    let found = off(cube(json!({"record_bands": 1}), sun, phase), &expected);
    eprintln!("henyey-greenstein, sun: {found:.2e}");
    assert!(found < 0.01, "{found}");
}

#[test]
fn the_papers_forms_agree_where_they_claim_to() {
    let sky = json!([{"type": "environment", "radiance": [2, 2, 2]}]);
    let isotropic_phase = json!({"type": "isotropic"});
    let expected = &picture(SIZE, |ray| CUBE.lit_by_environment(ray, 2.0, isotropic(ALBEDO)));
    for form in ["product", "isotropic", "static", "dynamic"] {
        let found = off(cube(json!({"record_form": form}), sky.clone(), isotropic_phase.clone()), expected);
        eprintln!("{form}: {found:.2e}");
        assert!(found < 0.02, "{form}: {found}");
    }
    let g = 0.4;
    let phase = json!({"type": "henyey_greenstein", "g": g});
    let expected = &picture(ONE, |ray| 2.0 * scattered_once(ray, henyey_greenstein(ALBEDO, g)));
    // The static form has its harmonics at the centres of 48 pixels.
    for (form, most) in [("static", 0.04), ("dynamic", 0.02)] {
        let found = off(cube(json!({"record_form": form}), sky.clone(), phase.clone()), expected);
        eprintln!("{form}, henyey-greenstein: {found:.2e}");
        assert!(found < most, "{form}: {found}");
    }
}

/// Two blobs in air.
fn blobs() -> Arc<PreparedVolume> {
    let dims = [40usize, 33, 28];
    let voxels = (0..dims.iter().product::<usize>()).map(|i| {
        let p = DVec3::new((i % 40) as f64, (i / 40 % 33) as f64, (i / 1320) as f64);
        let bump = |c: DVec3, r: f64| (1.0 - (p - c).length() / r).max(0.0);
        let value = bump(DVec3::new(9.0, 9.0, 9.0), 8.0) + 0.6 * bump(DVec3::new(30.0, 22.0, 20.0), 7.0);
        (value * 60000.0).min(65535.0) as u16
    });
    prepared(Volume::new(dims, Voxels::U16(voxels.collect())))
}

fn base() -> Value {
    json!({
        "transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 0.1, "extinction": 0}, {"s": 0.3, "extinction": 60, "albedo": [0.9, 0.5, 0.2], "material": "skin"}, {"s": 1, "extinction": 200, "material": "skin"}]},
        "materials": {"skin": {"surface": 0.5, "phase": {"type": "henyey_greenstein", "g": 0.3}, "brdf": {"type": "blinn_phong", "diffuse": 0.8, "specular": 0.2, "exponent": 30}}},
        "lights": [{"id": "key", "type": "directional", "direction": [-1, -1, -1], "irradiance": [3, 3, 3]}, {"id": "sky", "type": "environment", "radiance": [0.2, 0.2, 0.3]}],
        "camera": {"position": [1.0, 0.7, 1.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40},
        "illumination": {"method": "image_based", "records": 14, "record_directions": 12}
    })
}

fn settings(patch: Value) -> Value {
    let mut illumination = base()["illumination"].clone();
    json_merge(&mut illumination, patch);
    json!({"illumination": illumination})
}

/// An edit of one part of the scene.
fn any_edit() -> impl Strategy<Value = Value> {
    let key = |e: f64, x: f64| json!({"id": "key", "type": "directional", "direction": [x, -1, -1], "irradiance": [e, e, 1]});
    prop_oneof![
        (0.02..0.6f64, 1.0..300.0f64).prop_map(|(s, top)| json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": s, "extinction": 0}, {"s": s + 0.1, "extinction": top, "material": "skin"}, {"s": 1, "extinction": top}]}})),
        (0.0..1.0f64).prop_map(|g| json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 0.1, "extinction": 0}, {"s": 0.5, "extinction": 90, "albedo": [g, g, 0.3]}, {"s": 0.5, "extinction": 0}]}})),
        (0.1..1.0f64).prop_map(|g| json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 0.2, "extinction": 0}, {"s": 0.5, "extinction": 40, "albedo": [0.5, 0.5, 0.3], "emission": [g, 0, 0.1]}]}})),
        (-1.0..1.0f64, -1.0..1.0f64).prop_map(|(x, y)| json!({"camera": {"position": [x, y, 1.7], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40}})),
        (0.0..50.0f64, -1.0..1.0f64).prop_map(move |(e, x)| json!({"lights": [key(e, x)]})),
        (0.0..5.0f64).prop_map(move |e| json!({"lights": [{"id": "lamp", "type": "point", "position": [0.3, 0.1, e], "intensity": [e, 1, 1]}, key(e, -1.0)]})),
        (0.0..5.0f64).prop_map(|e| json!({"lights": [{"id": "sky", "type": "environment", "radiance": [e, 0.3, 1]}]})),
        (0.1..1.0f64, any::<bool>()).prop_map(|(x, shadows)| json!({"clip": {"box": [[0, 0, 0], [x, 1, 1]], "shadows": shadows}})),
        (0.2..3.0f64).prop_map(|d| json!({"density": d})),
        prop_oneof![Just("linear"), Just("nearest")].prop_map(|f| json!({"volume": {"builtin": "homogeneous", "filter": f}})),
        (0.3..1.0f64).prop_map(|top| json!({"value_range": [0, top * 60000.0]})),
        prop_oneof![Just("product"), Just("isotropic"), Just("static"), Just("dynamic")].prop_map(|form| settings(json!({"record_form": form}))),
        prop_oneof![Just("trilinear"), Just("containing")].prop_map(|lookup| settings(json!({"record_lookup": lookup}))),
        (0..4u32).prop_map(|rounds| settings(json!({"record_exchange": rounds}))),
        (1..6u32).prop_map(|bands| settings(json!({"record_bands": bands, "record_window": bands > 3}))),
    ]
}

fn merged(edits: &[Value]) -> Value {
    let mut scene = base();
    edits.iter().for_each(|edit| json_merge(&mut scene, edit.clone()));
    scene
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    /// Also where each edit comes before the one before it has been worked on to its end.
    #[test]
    fn incremental_equals_from_scratch(edits in prop::collection::vec(any_edit(), 1..6), hurried in any::<bool>()) {
        let volume = blobs();
        let mut renderer = renderer();
        let mut running = View::new();
        for count in 0..=edits.len() {
            let newest = snapshot(&volume, merged(&edits[..count]), count as u32 + 1);
            if hurried && count < edits.len() {
                let request = DrawRequest { snapshot: &newest, target: target(16, 16, 1), budget: Some(Duration::from_millis(1)) };
                renderer.draw(&mut running, &request).unwrap();
                continue;
            }
            draw(&mut renderer, &mut running, &newest, target(40, 32, 1));
            let mut fresh = View::new();
            draw(&mut renderer, &mut fresh, &newest, target(40, 32, 1));
            let (a, b) = (renderer.radiance(&running).unwrap(), renderer.radiance(&fresh).unwrap());
            prop_assert!(a.rgb.iter().all(|x| x.is_finite() && *x >= 0.0));
            prop_assert!(a == b, "after edit {}", count);
        }
    }

    #[test]
    fn skipped_equals_unskipped(edits in prop::collection::vec(any_edit(), 0..4)) {
        let volume = blobs();
        let mut renderer = renderer();
        let image = |renderer: &mut render::Renderer, skip: bool| {
            let mut scene = merged(&edits);
            scene["sampling"]["skip_empty"] = json!(skip);
            let mut view = View::new();
            let drawn = draw(renderer, &mut view, &snapshot(&volume, scene, 1), target(40, 32, 1));
            (renderer.radiance(&view).unwrap(), drawn.counters)
        };
        let (skipped, a) = image(&mut renderer, true);
        let (plain, b) = image(&mut renderer, false);
        prop_assert!(skipped == plain, "images differ");
        let of = |counters: &BTreeMap<String, u64>, name: &str| counters.get(name).copied().unwrap_or(0);
        for cast in ["record_rays_cast", "direct_nodes_cast"] {
            prop_assert_eq!(of(&a, cast), of(&b, cast));
        }
        prop_assert_eq!(of(&b, "record_cells_skipped") + of(&b, "direct_cells_skipped"), 0);
    }
}

/// More bands make another field, which is read as the one before.
#[test]
fn another_number_of_bands_leaves_the_lookup_as_it_is() {
    let plain = json!({"transfer_function": {"points": [{"s": 0.1, "extinction": 0}, {"s": 0.5, "extinction": 90}]},
        "illumination": {"method": "image_based", "record_directions": 12, "records": 14,
            "record_lookup": "containing"}});
    let skin = json!({"transfer_function": {"points": [{"s": 0.1, "extinction": 0},
        {"s": 0.5, "extinction": 90, "material": "skin"}]}});
    let volume = blobs();
    let mut renderer = renderer();
    let mut running = View::new();
    for count in 1..=2 {
        let newest = snapshot(&volume, merged(&[plain.clone(), skin.clone()][..count]), count as u32);
        draw(&mut renderer, &mut running, &newest, target(40, 32, 1));
        let mut fresh = View::new();
        draw(&mut renderer, &mut fresh, &newest, target(40, 32, 1));
        assert!(renderer.radiance(&running).unwrap() == renderer.radiance(&fresh).unwrap(), "edit {count}");
    }
}

/// A view of two blobs whose light is complete.
struct Lit {
    view: View,
    volume: Arc<PreparedVolume>,
}

impl Lit {
    fn new() -> Self {
        let mut lit = Self { view: View::new(), volume: blobs() };
        let drawn = lit.draw(json!({}));
        assert!(
            drawn.counters["records"] > 100 && drawn.counters["records_renewed"] == drawn.counters["records"]
        );
        assert_eq!(drawn.counters["record_rays_cast"], 12 * drawn.counters["records"]);
        assert!(drawn.counters["record_cells_skipped"] > 0);
        lit
    }

    /// Draws the base scene with an edit.
    fn draw(&mut self, edit: Value) -> Drawn {
        let snapshot = snapshot(&self.volume, merged(&[edit]), 2);
        draw(&mut renderer(), &mut self.view, &snapshot, target(32, 24, 1))
    }
}

fn count(drawn: &Drawn, name: &str) -> u64 {
    drawn.counters.get(name).copied().unwrap_or(0)
}

#[test]
fn edits_redo_what_they_touch_and_nothing_else() {
    let mut lit = Lit::new();
    let records = |drawn: &Drawn| drawn.counters["records"];
    // A camera edit: the light stays.
    let turned = lit.draw(json!({"camera": {"position": [-1.0, 0.7, 1.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40}}));
    assert!(!turned.plan.runs(Pass::Illuminate) && turned.plan.runs(Pass::RayCast));
    // A colour of matter: no ray is cast.
    let mut colour = base()["transfer_function"].clone();
    colour["points"][2]["albedo"] = json!([0.1, 0.5, 0.2]);
    let coloured = lit.draw(json!({"transfer_function": colour}));
    assert_eq!(count(&coloured, "record_rays_cast"), 0);
    // A light's colour: nothing of the light is computed.
    let nodes = |drawn: &Drawn| count(drawn, "direct_nodes_cast");
    let tinted = lit.draw(json!({"transfer_function": colour, "lights": [{"id": "key", "type": "directional", "direction": [-1, -1, -1], "irradiance": [1, 3, 3]}, base()["lights"][1]]}));
    assert_eq!(
        (count(&tinted, "record_rays_cast"), nodes(&tinted), count(&tinted, "records_renewed")),
        (0, 0, 0)
    );
    // Another sky: no ray is cast, every coefficient is written.
    let recoloured = lit.draw(json!({"lights": [base()["lights"][0], {"id": "sky", "type": "environment", "radiance": [0.5, 0.2, 0.3]}]}));
    assert!(recoloured.plan.runs(Pass::Illuminate));
    assert_eq!(count(&recoloured, "record_rays_cast"), 0);
    // A light that moves: its nodes.
    let moved = lit.draw(json!({"lights": [{"id": "key", "type": "directional", "direction": [-1, -1, 0], "irradiance": [3, 3, 3]}, base()["lights"][1]]}));
    assert!(count(&moved, "record_rays_cast") == 0 && nodes(&moved) > 0);
    lit.draw(json!({}));
    // Matter that only the inside of one blob has: rays that miss it are kept.
    let inside = |densest: f64| {
        let mut matter = base()["transfer_function"].clone();
        matter["points"][3] = json!({"s": 0.75, "extinction": 150, "material": "skin"});
        matter["points"]
            .as_array_mut()
            .unwrap()
            .push(json!({"s": 1, "extinction": densest, "material": "skin"}));
        json!({"transfer_function": matter})
    };
    lit.draw(inside(200.0));
    let inner = lit.draw(inside(400.0));
    let (cast, kept) = (count(&inner, "record_rays_cast"), count(&inner, "record_rays_kept"));
    assert_eq!(cast + kept, 12 * records(&inner));
    assert!(cast > 0 && kept > 4 * cast, "{cast} rays cast, {kept} kept");
    assert!(count(&inner, "records_renewed") < records(&inner));
}

#[test]
fn records_that_no_matter_reads_go_and_come_back() {
    let mut lit = Lit::new();
    let all = lit.draw(json!({"camera": {"position": [0, 0.7, 1.6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40}}));
    let none = lit.draw(json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}]}}));
    assert_eq!(none.counters["records"], 0);
    assert!(none.complete && all.complete);
    let back = lit.draw(json!({}));
    assert_eq!(count(&back, "records_renewed"), back.counters["records"]);
}

#[test]
fn slices_end_with_the_picture_drawn_at_once() {
    let volume = homogeneous([1; 3]);
    let sky = json!([{"type": "environment", "radiance": [2, 2, 2]}]);
    let scene = cube(json!({"records": 32, "record_directions": 12}), sky, json!({"type": "isotropic"}));
    let snapshot = snapshot(&volume, scene, 1);
    let mut renderer = renderer();
    let mut view = View::new();
    let request = DrawRequest {
        snapshot: &snapshot,
        target: target(24, 20, 2),
        budget: Some(Duration::from_millis(10)),
    };
    let mut calls = 0;
    while !renderer.draw(&mut view, &request).unwrap().complete {
        calls += 1;
    }
    let mut fresh = View::new();
    draw(&mut renderer, &mut fresh, &snapshot, target(24, 20, 2));
    let [a, b] = [&view, &fresh].map(|view| renderer.radiance(view).unwrap());
    let mean = |image: &render::Radiance| image.rgb.iter().map(|x| f64::from(*x)).sum::<f64>();
    assert!(calls > 1 && a == b, "{calls} calls: {} for {}", mean(&a), mean(&b));
}
