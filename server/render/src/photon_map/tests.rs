//! Photon maps against what they must equal.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot};
use serde_json::{Value, json};

use super::{PhotonPipelines, PhotonTrial};
use crate::shaders;
use crate::test_support::{balls, renderer};
use crate::{DrawRequest, Drawn, Renderer, View};

fn file(patches: &[Value]) -> Value {
    let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"},
        "camera": {"position": [0.4, 0.5, 2.4], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 30},
        "background": [0.02, 0.02, 0.02],
        "lights": [{"id": "sun", "type": "directional", "direction": [-1, -1, -0.5], "irradiance": [3, 3, 3]}],
        "transfer_function": {"points": [
            {"s": 0.1, "extinction": 0, "albedo": [0.9, 0.9, 0.9]},
            {"s": 0.3, "extinction": 12, "albedo": [0.9, 0.5, 0.3]},
            {"s": 0.6, "extinction": 20, "albedo": [0.4, 0.9, 0.5]},
            {"s": 0.95, "extinction": 40, "albedo": [0.6, 0.6, 0.95]}]},
        "illumination": {"method": "photon_map", "photons": 4096, "photon_grid": 16, "photon_events": 8}});
    for patch in patches {
        json_patch::merge(&mut file, patch);
    }
    file
}

pub(super) fn snapshot(volume: &Arc<PreparedVolume>, patches: &[Value], epoch: u32) -> Arc<Snapshot> {
    let file = proto::SceneFile::from_value(file(patches)).unwrap();
    Arc::new(Snapshot { epoch, scene: Scene::new(&file, volume.clone()).unwrap() })
}

pub(super) const TARGET: Target = Target { width: 32, height: 32, samples_per_pixel: 1 };

pub(super) fn draw(renderer: &mut Renderer, view: &mut View, snapshot: &Arc<Snapshot>) -> Drawn {
    let drawn = renderer.draw(view, &DrawRequest { snapshot, target: TARGET, budget: None }).unwrap();
    assert!(drawn.complete && drawn.illumination == 1.0);
    drawn
}

/// Photons and light sums, by light; and the picture.
fn result(renderer: &mut Renderer, view: &View) -> (BTreeMap<String, Vec<Vec<u8>>>, Vec<f32>) {
    let light = view.light.lock();
    let contents = light.photon_map().unwrap().contents(renderer.gpu()).unwrap();
    drop(light);
    (contents, renderer.radiance(view).unwrap().rgb)
}

fn from_scratch(
    renderer: &mut Renderer,
    snapshot: &Arc<Snapshot>,
) -> (BTreeMap<String, Vec<Vec<u8>>>, Vec<f32>) {
    let mut view = View::new();
    draw(renderer, &mut view, snapshot);
    result(renderer, &view)
}

/// Whether a view holds what one would that had never seen another scene; else what differs.
pub(super) fn equal(renderer: &mut Renderer, view: &View, snapshot: &Arc<Snapshot>) -> Result<(), String> {
    let (photons, picture) = result(renderer, view);
    let (expected, expected_picture) = from_scratch(renderer, snapshot);
    if !photons.keys().eq(expected.keys()) {
        return Err("other lights".into());
    }
    for (id, buffers) in &expected {
        if let Some(index) = photons[id].iter().zip(buffers).position(|(a, b)| a != b) {
            return Err(format!("buffer {index} of light {id}"));
        }
    }
    let differs = |(a, b): (&f32, &f32)| a.to_bits() != b.to_bits();
    match picture.iter().zip(&expected_picture).position(differs) {
        Some(value) => Err(format!("value {value} of the picture")),
        None => Ok(()),
    }
}

/// A mean over pixels of what a method shows.
fn mean(renderer: &mut Renderer, volume: &Arc<PreparedVolume>, patches: &[Value]) -> f64 {
    let snapshot = snapshot(volume, patches, 1);
    let mut view = View::new();
    let target = Target { samples_per_pixel: snapshot.scene.samples_at_rest(), ..TARGET };
    renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None }).unwrap();
    let rgb = renderer.radiance(&view).unwrap().rgb;
    rgb.iter().map(|&x| f64::from(x)).sum::<f64>() / rgb.len() as f64
}

/// Every kind of light brings about as much as the unbiased path tracer says.
#[test]
fn every_light_is_as_bright_as_followed_from_the_eye() {
    let mut renderer = renderer();
    let volume = balls(24);
    let lights = [
        json!({"type": "directional", "direction": [-1, -1, -0.5], "irradiance": [3, 3, 3]}),
        json!({"type": "environment", "radiance": [1, 0.6, 0.3]}),
        json!({"type": "point", "position": [1.2, 0.9, 0.7], "intensity": [5, 5, 5]}),
        json!({"type": "point", "position": [0.02, 0.01, 0.45], "intensity": [0.2, 0.2, 0.2]}),
        json!({"type": "spot", "position": [0.9, 1.3, 0.4], "direction": [-0.9, -1.3, -0.4],
            "intensity": [8, 8, 8], "cone_degrees": [10, 16]}),
        json!({"type": "sphere", "center": [0.2, 1.1, 0.8], "radius": 0.2, "radiance": [20, 20, 20]}),
        json!({"type": "rectangle", "center": [0.3, 0.2, 1.4], "normal": [-0.2, -0.1, -1], "up": [0, 1, 0],
            "size": [0.8, 0.5], "radiance": [6, 6, 6]}),
        json!({"type": "disk", "center": [1.2, 0.1, 0.0], "normal": [-1, 0, 0], "radius": 0.3,
            "radiance": [9, 9, 9]}),
    ];
    for light in lights {
        let lit = json!({"lights": [light], "background": [0, 0, 0], "density": 0.2});
        let traced = json!({"illumination": {"method": "path_traced", "paths_per_pixel": 64}});
        let photons = json!({"illumination": {"photons": 262144, "photon_grid": 24}});
        let found = mean(&mut renderer, &volume, &[lit.clone(), photons]);
        let expected = mean(&mut renderer, &volume, &[lit.clone(), traced]);
        eprintln!("{found:.5} {expected:.5} {:+.3} {}", found / expected - 1.0, lit["lights"][0]);
        assert!((found / expected - 1.0).abs() < 0.03, "{found} for {expected}: {lit}");
    }
}

/// So do phase functions, surfaces and limits of the scattering orders.
#[test]
fn all_matter_is_as_bright_as_followed_from_the_eye() {
    let mut renderer = renderer();
    let volume = balls(24);
    let points = json!({"points": [
        {"s": 0.1, "extinction": 0, "albedo": [0.9, 0.9, 0.9], "material": "m"},
        {"s": 0.4, "extinction": 4, "albedo": [0.9, 0.7, 0.5], "material": "m"}]});
    let matter = |material: Value, orders: Value| {
        json!({"materials": {"m": material}, "transfer_function": points, "background": [0, 0, 0],
            "scattering": {"orders": orders}})
    };
    let cases = [
        matter(json!({}), json!(1)),
        matter(json!({}), json!(2)),
        matter(json!({"phase": {"type": "henyey_greenstein", "g": 0.6}}), json!("all")),
        matter(json!({"phase": {"type": "henyey_greenstein", "g": -0.4}}), json!(1)),
        matter(json!({"phase": {"type": "schlick", "k": 0.5}}), json!(3)),
        matter(json!({"surface": 1.0, "brdf": {"type": "lambert", "diffuse": 0.8}}), json!("all")),
        matter(
            json!({"surface": 0.5, "brdf": {"type": "blinn_phong", "diffuse": 0.5, "specular": 0.4,
            "exponent": 8}}),
            json!("all"),
        ),
    ];
    for case in cases {
        let traced = json!({"illumination": {"method": "path_traced", "paths_per_pixel": 64}});
        let photons = json!({"illumination": {"photons": 32768, "photon_grid": 24, "photon_bands": 4}});
        let found = mean(&mut renderer, &volume, &[case.clone(), photons]);
        let expected = mean(&mut renderer, &volume, &[case.clone(), traced]);
        eprintln!("{found:.5} {expected:.5} {:+.3} {}", found / expected - 1.0, case["materials"]["m"]);
        assert!((found / expected - 1.0).abs() < 0.08, "{found} for {expected}: {case}");
    }
}

/// So does matter that is opaque within a texel, whatever part of it it fills: a wall of a fifth of a texel,
/// and balls of many. Without that only its skin counts they are off by more than is allowed.
#[test]
fn opaque_matter_is_as_bright_as_followed_from_the_eye() {
    let mut renderer = renderer();
    let opaque = json!({"points": [
        {"s": 0.1, "extinction": 0, "albedo": [0.7, 0.7, 0.7]},
        {"s": 0.3, "extinction": 400, "albedo": [0.7, 0.7, 0.7]}]});
    let sky = json!({"transfer_function": opaque, "background": [0, 0, 0],
        "lights": [{"id": "sky", "type": "environment", "radiance": [1, 1, 1]}]});
    for (name, volume) in [("wall", wall(40)), ("balls", balls(24))] {
        let traced = json!({"illumination": {"method": "path_traced", "paths_per_pixel": 64}});
        let photons = json!({"illumination": {"photons": 16384, "photon_grid": 8}});
        let found = mean(&mut renderer, &volume, &[sky.clone(), photons]);
        let expected = mean(&mut renderer, &volume, &[sky.clone(), traced]);
        eprintln!("{name}: {found:.5} {expected:.5} {:+.3}", found / expected - 1.0);
        assert!((found / expected - 1.0).abs() < 0.15, "{name}: {found} for {expected}");
    }
}

/// A wall across the volume, one voxel thick, and turned to the camera.
fn wall(edge: usize) -> Arc<PreparedVolume> {
    let voxels = (0..edge.pow(3)).map(|i| if i / (edge * edge) == edge / 2 { 255 } else { 0 }).collect();
    Arc::new(PreparedVolume::new(scene::Volume::new([edge; 3], scene::Voxels::U8(voxels)), &|_| {}))
}

/// As many bands as matter asks for, or as the scene does.
#[test]
fn bands_follow_phase_functions_and_surfaces() {
    let volume = balls(8);
    let bands = |material: Value, asked: u32| {
        let points = json!({"points": [{"s": 0, "extinction": 1, "material": "m"}]});
        let scene = json!({"materials": {"m": material}, "transfer_function": points,
            "illumination": {"photon_bands": asked}});
        super::bands_of(&snapshot(&volume, &[scene], 1).scene)
    };
    let forward = |g: f64| json!({"phase": {"type": "henyey_greenstein", "g": g}});
    assert_eq!([0.1, 0.5, -0.5, 0.7, 0.8, 0.95].map(|g| bands(forward(g), 0)), [2, 3, 3, 5, 6, 3]);
    assert_eq!(
        (bands(json!({}), 0), bands(json!({"surface": 0.2, "brdf": {"type": "lambert", "diffuse": 0.8}}), 0)),
        (1, 3)
    );
    assert_eq!((bands(json!({}), 4), bands(forward(0.8), 2)), (1, 2));
}

pub(super) fn edits() -> Vec<(&'static str, Value)> {
    let points = |scale: f64, red: f64| {
        json!({"transfer_function": {"points": [
            {"s": 0.1, "extinction": 0, "albedo": [0.9, 0.9, 0.9]},
            {"s": 0.3, "extinction": 12, "albedo": [red, 0.5, 0.3]},
            {"s": 0.6, "extinction": 20, "albedo": [0.4, 0.9, 0.5]},
            {"s": 0.95, "extinction": 40.0 * scale, "albedo": [0.6, 0.6, 0.95]}]}})
    };
    let sun =
        json!({"id": "sun", "type": "directional", "direction": [-1, -1, -0.5], "irradiance": [3, 3, 3]});
    let lamp = |x: f64, power: f64| json!({"id": "lamp", "type": "point", "position": [x, 0.9, 0.9], "intensity": [power, power, power]});
    vec![
        ("colour", points(1.0, 0.2)),
        ("opacity", points(3.0, 0.2)),
        ("to nothing", points(0.0, 0.2)),
        ("and back", points(1.0, 0.9)),
        ("density", json!({"density": 1.7})),
        ("a light more", json!({"lights": [sun, lamp(1.0, 2.0)]})),
        ("a light brighter", json!({"lights": [sun, lamp(1.0, 5.0)]})),
        ("a light moves", json!({"lights": [sun, lamp(0.3, 5.0)]})),
        ("clip box", json!({"clip": {"box": [[0, 0, 0], [1, 0.55, 1]]}})),
        (
            "clip plane",
            json!({"clip": {"box": [[0, 0, 0], [1, 1, 1]],
            "planes": [{"normal": [1, 0.3, 0], "offset": -0.1}]}}),
        ),
        ("clipped matter casts no shadows", json!({"clip": {"shadows": false}})),
        ("another clip plane", json!({"clip": {"planes": [{"normal": [0, 1, 0.2], "offset": -0.2}]}})),
        ("other order of lights", json!({"lights": [lamp(0.3, 5.0), sun]})),
        ("a light less", json!({"lights": [lamp(0.3, 5.0)]})),
        (
            "another kind of light",
            json!({"lights": [{"id": "lamp", "type": "environment", "radiance": [1, 1, 1]}]}),
        ),
        ("and back to the lamp", json!({"lights": [lamp(0.3, 5.0)]})),
        ("longer voxels", json!({"spacing": [1.0, 1.0, 1.02]})),
        ("window", json!({"value_range": [0.0, 200.0]})),
        (
            "a surface",
            json!({"materials": {"shiny": {"surface": 0.8,
                "brdf": {"type": "blinn_phong", "diffuse": 0.6, "specular": 0.3, "exponent": 30}}},
            "transfer_function": {"points": [
                {"s": 0.1, "extinction": 0, "albedo": [0.9, 0.9, 0.9]},
                {"s": 0.3, "extinction": 12, "albedo": [0.9, 0.5, 0.3]},
                {"s": 0.6, "extinction": 30, "albedo": [0.4, 0.9, 0.5], "material": "shiny"},
                {"s": 0.95, "extinction": 40, "albedo": [0.6, 0.6, 0.95]}]}}),
        ),
        ("the camera", json!({"camera": {"position": [1.5, 0.5, 1.8]}})),
    ]
}

/// Lights with more stale photons than this begin again.
fn begin_again_above(renderer: &Renderer, begin_again_share: f64) {
    renderer.try_photons(PhotonTrial { begin_again_share, ..PhotonTrial::default() });
}

/// Never beginning again: whatever can be followed is.
const NEVER: f64 = 1.0;

/// Edits one after the other; an error names the first after which photons, sums or picture are not
/// those of a map made from scratch.
fn follow(renderer: &mut Renderer, edits: &[(&str, Value)], begin_again_share: f64) -> Result<(), String> {
    begin_again_above(renderer, begin_again_share);
    let volume = balls(24);
    let mut patches = vec![];
    let mut view = View::new();
    draw(renderer, &mut view, &snapshot(&volume, &patches, 1));
    for (epoch, (name, edit)) in edits.iter().enumerate() {
        patches.push(edit.clone());
        let snapshot = snapshot(&volume, &patches, epoch as u32 + 2);
        let drawn = draw(renderer, &mut view, &snapshot);
        let count = |what: &str| drawn.counters.get(what).copied().unwrap_or(0);
        let (anew, kept) = (count("photons_recomputed"), count("photons_reused"));
        eprintln!("{name}: {anew} photons anew, {kept} kept, {} bricks", count("bricks_recomputed"));
        let same = equal(renderer, &view, &snapshot).map_err(|what| format!("{name}: {what}"));
        if same.is_err() {
            renderer.try_photons(PhotonTrial::default());
            return same;
        }
    }
    renderer.try_photons(PhotonTrial::default());
    Ok(())
}

#[test]
fn edits_leave_what_a_new_map_would_be() {
    for begin_again_share in [NEVER, PhotonTrial::default().begin_again_share] {
        follow(&mut renderer(), &edits(), begin_again_share).unwrap();
    }
}

/// Without any one of its remedies the map is wrong after some edit, and the comparison finds it.
#[test]
fn every_remedy_is_needed() {
    let history = "histories[2u * slot] = vec4u(bins_met, blocks);";
    let mutants = [
        ("bins that a free flight met", true, history, &*format!("bins_met = vec2u(0u); {history}")),
        (
            "what a photon that left relied on",
            true,
            "ends[2u * local] = vec4u(bins_met, blocks);",
            "if path.light > 0u { ends[2u * local] = histories[2u * (local * photons.slots + path.light - 1u)]; } else { ends[2u * local] = vec4u(0u); }",
        ),
        (
            "what hides an interaction",
            true,
            history,
            "if !is_looked_at { before_it = vec4u(bins_met, blocks); } histories[2u * slot] = before_it;",
        ),
        ("blocks", true, "blocks |= blocks_on_way(path.origin, path.direction, whole.x, until, flies);", ""),
        ("going back to the last valid interaction", false, "{ valid = i; }", "{ valid = i + 1u; }"),
        (
            "taking out what was there",
            true,
            "var halves = select(0, -i32(histories[2u * slot + 1u].z), undoes);",
            "var halves = 0;",
        ),
        (
            "random numbers drawn so far",
            false,
            "path.draws = bitcast<u32>(places[slot].w);",
            "path.draws = 0u;",
        ),
        (
            "random numbers drawn while looking",
            true,
            "places[slot].w = bitcast<f32>(path.draws);",
            "if !is_looked_at { places[slot].w = bitcast<f32>(path.draws); }",
        ),
    ];
    let gpu = renderer().gpu().clone();
    for (what, in_trace, original, broken) in mutants {
        let source = if in_trace { shaders::TRACE_PHOTONS } else { shaders::TAKE_UP };
        assert!(source.contains(original), "{what}: the shader has not `{original}`");
        // What `before_it` is set to when an interaction is stored is what was relied on before it was looked at.
        let mutant = source.replacen(original, broken, 1).replacen(
            "if seen.is_settled {",
            "if seen.goes_on && !is_looked_at { before_it = vec4u(bins_met, blocks); } if seen.is_settled {",
            usize::from(broken.contains("before_it")),
        ) + "\nvar<private> before_it: vec4u;\n";
        let (trace, take_up) = match in_trace {
            true => (mutant.into(), shaders::TAKE_UP.into()),
            false => (shaders::TRACE_PHOTONS.into(), mutant.into()),
        };
        let mut renderer = renderer();
        let whole = renderer.photon_pipelines.clone();
        renderer.photon_pipelines = Arc::new(PhotonPipelines::of_sources(gpu.clone(), trace, take_up));
        let found = follow(&mut renderer, &edits(), NEVER);
        renderer.photon_pipelines = whole;
        eprintln!("without {what}: {found:?}");
        assert!(found.is_err(), "without {what} nothing is wrong");
    }
}

/// Where most photons are stale, all are followed anew; where fewer are, the others are kept.
#[test]
fn an_edit_of_most_photons_begins_again() {
    let mut renderer = renderer();
    let volume = balls(24);
    let mut view = View::new();
    draw(&mut renderer, &mut view, &snapshot(&volume, &[], 1));
    let edits = edits();
    let (most, some) = (edits[0].1.clone(), edits[1].1.clone());
    begin_again_above(&renderer, 0.5);
    let drawn = draw(&mut renderer, &mut view, &snapshot(&volume, std::slice::from_ref(&most), 2));
    assert_eq!((drawn.counters["lights_begun_again"], drawn.counters["photons_reused"]), (1, 0));
    let drawn = draw(&mut renderer, &mut view, &snapshot(&volume, &[most, some], 3));
    renderer.try_photons(PhotonTrial::default());
    let reused = drawn.counters["photons_reused"];
    assert!(drawn.counters["lights_begun_again"] == 0 && reused > 2048 && reused < 4096, "{reused}");
}

/// Nodes of direct light that are kept although matter on their rays changed are found.
#[test]
fn direct_light_is_looked_up_anew_where_matter_changed() {
    let test = "is_stale = meets_change(Ray(x, towards.w_i), kept.x, select(kept.x, kept.y, inside && !is_stale)) || is_stale;";
    assert!(shaders::MARCH_DIRECT.contains(test));
    let mut renderer = renderer();
    let broken = shaders::MARCH_DIRECT.replacen(test, "", 1);
    let passes = crate::direct_light::Passes::of_source(renderer.gpu().clone(), broken.into());
    let whole = std::mem::replace(&mut renderer.direct_light, Arc::new(passes));
    let found = follow(&mut renderer, &edits(), NEVER);
    renderer.direct_light = whole;
    assert!(found.as_ref().is_err_and(|what| what.contains("direct light")), "{found:?}");
}

/// A map that would take all memory is refused in words, and the view is none the worse for it.
#[test]
fn a_map_that_is_too_large_is_refused() {
    let mut renderer = renderer();
    let volume = balls(24);
    let small = snapshot(&volume, &[], 1);
    let large = json!({"illumination": {"photons": 16_000_000, "photon_events": 200}});
    let large = snapshot(&volume, &[large], 2);
    let mut view = View::new();
    draw(&mut renderer, &mut view, &small);
    let request = DrawRequest { snapshot: &large, target: TARGET, budget: None };
    let refused = renderer.draw(&mut view, &request).unwrap_err().to_string();
    assert!(refused.contains("16000000 photons") && refused.contains("MiB"), "{refused}");
    draw(&mut renderer, &mut view, &snapshot(&volume, &[], 3));
    equal(&mut renderer, &view, &small).unwrap();
}

/// Edits that come while the map is being brought up to the one before.
#[test]
fn interrupted_updates_leave_nothing_behind() {
    let mut renderer = renderer();
    let volume = balls(24);
    let many = json!({"illumination": {"photons": 40000}, "density": 2.0});
    let mut patches = vec![many];
    let mut view = View::new();
    draw(&mut renderer, &mut view, &snapshot(&volume, &patches, 1));
    let mut unfinished = 0;
    for (epoch, (_, edit)) in edits().into_iter().enumerate() {
        patches.push(edit);
        let snapshot = snapshot(&volume, &patches, epoch as u32 + 2);
        let request =
            DrawRequest { snapshot: &snapshot, target: TARGET, budget: Some(Duration::from_micros(1)) };
        unfinished += usize::from(renderer.draw(&mut view, &request).unwrap().illumination < 1.0);
        if epoch % 5 == 4 {
            draw(&mut renderer, &mut view, &snapshot);
            equal(&mut renderer, &view, &snapshot).unwrap();
        }
    }
    assert!(unfinished > 5, "only {unfinished} updates were interrupted");
}

/// What the map tells of its photons is what edits then find stale.
#[test]
fn an_edit_redoes_as_many_photons_as_were_told_to_rely_on_its_bins() {
    let mut renderer = renderer();
    let volume = balls(24);
    let other = |s: f64| {
        json!({"transfer_function": {"points": [
            {"s": 0.1, "extinction": 0, "albedo": [0.9, 0.9, 0.9]},
            {"s": 0.3, "extinction": 12, "albedo": [0.9, 0.5, 0.3]},
            {"s": 0.6, "extinction": 20, "albedo": [0.4, 0.9, 0.5]},
            {"s": s, "extinction": 40, "albedo": [0.6, 0.95, 0.6]}]}})
    };
    for s in [0.95, 0.8] {
        let (old, new) = (snapshot(&volume, &[], 1), snapshot(&volume, &[other(s)], 2));
        let mut view = View::new();
        assert_eq!(renderer.stale_shares(&view).unwrap(), None);
        draw(&mut renderer, &mut view, &old);
        let masks = view.light.lock().photon_map().unwrap().bins_relied_on(renderer.gpu()).unwrap();
        let shares = renderer.stale_shares(&view).unwrap().unwrap();
        assert_eq!((masks.len(), shares.counted), (4096, 4096), "all are few enough to be looked at");
        let changed = scene::Changes::between(&old.scene, &new.scene).bins
            & old.scene.volume.macrocells.occurring(old.scene.filter);
        let stale = masks.iter().filter(|&mask| mask & changed != 0).count();
        begin_again_above(&renderer, NEVER);
        let redone = draw(&mut renderer, &mut view, &new).counters["photons_recomputed"];
        renderer.try_photons(PhotonTrial::default());
        assert_eq!(redone, stale as u64, "s = {s}");
        assert!(stale > 0 && stale < masks.len(), "the edit is of a part: {stale}");
        // No bin alone costs more than all of them together, nor do they more than their sum.
        let of_changed = (0..64).filter(|bin| changed >> bin & 1 == 1).map(|bin| shares.of_bins[bin]);
        let (most, sum) = of_changed.fold((0.0_f32, 0.0), |(most, sum), one| (most.max(one), sum + one));
        let share = stale as f32 / masks.len() as f32;
        assert!(most <= share + 1e-6 && share <= sum + 1e-6, "{most} {share} {sum}");
    }
}
