//! Light layers of method `path_traced`: another mix of them is, bit by bit, the picture that would
//! be drawn from scratch, and the layers together are the picture without layers.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Arc;
use std::time::Duration;

use common::{draw, json_merge, prepared, renderer};
use glam::DVec3;
use proto::SceneFile;
use reference::statistics::z_test_image;
use reference::{Progress, Request};
use render::{DrawRequest, Drawn, RenderError, Renderer, View};
use scene::plan::{FilmPlan, Pass, Target};
use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Scene, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

const TARGET: Target = Target { width: 40, height: 28, samples_per_pixel: 7 };

/// Two balls far apart, of values around 100 and around 200, in air.
fn balls() -> Arc<PreparedVolume> {
    let voxel = |i: usize| {
        let [x, y, z] = [i % 32, i / 32 % 32, i / 1024].map(|v| v as f64 - 15.5);
        let distance = |cx: f64| ((x - cx).powi(2) + (y - cx).powi(2) + z * z).sqrt();
        let ball = |cx: f64, value: f64| (value * (1.0 - (distance(cx) / 7.0).powi(2))).max(0.0);
        ball(-9.0, 100.0).max(ball(9.0, 220.0)) as u8
    };
    prepared(Volume::new([32; 3], Voxels::U8((0..32_768).map(voxel).collect())))
}

fn sky() -> EnvironmentImages {
    let texel = |i: usize| [0.3, 0.4, if i == 5 { 9.0 } else { 0.5 }];
    let rgb: Vec<f32> = (0..8 * 4).flat_map(texel).collect();
    [("sky".to_owned(), Arc::new(EnvironmentImage::new(8, 4, &rgb).unwrap()))].into()
}

fn sun(irradiance: [f64; 3]) -> Value {
    json!({"id": "sun", "type": "directional", "direction": [0, -0.2, -1], "irradiance": irradiance})
}

fn lamp(intensity: [f64; 3]) -> Value {
    json!({"id": "lamp", "type": "point", "position": [0.2, 1.1, 0.9], "intensity": intensity})
}

fn panel(radiance: [f64; 3]) -> Value {
    json!({"id": "panel", "type": "rectangle", "center": [-1, 0.2, 0.6], "normal": [1, 0, -0.4], "up": [0, 1, 0],
        "size": [0.7, 0.5], "radiance": radiance})
}

fn globe(radiance: [f64; 3]) -> Value {
    json!({"id": "globe", "type": "sphere", "center": [0.1, -0.1, 0.1], "radius": 0.12, "radiance": radiance})
}

fn uniform(radiance: [f64; 3]) -> Value {
    json!({"id": "sky", "type": "environment", "radiance": radiance})
}

fn image(scale: f64) -> Value {
    json!({"id": "sky", "type": "environment", "image": "sky", "rotation_degrees": [10, 40, 0], "scale": scale})
}

fn off(mut light: Value) -> Value {
    light["enabled"] = json!(false);
    light
}

/// Surfaces and glowing matter, before a background.
fn file(patch: Value) -> Value {
    let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "value_range": [0, 255],
        "illumination": {"method": "path_traced", "light_layers": true},
        "materials": {"m": {"surface": 0.5, "brdf": {"type": "blinn_phong", "diffuse": 0.7, "specular": 0.3, "exponent": 20}}},
        "transfer_function": {"points": matter(60.0, 2.0)},
        "camera": {"position": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 25},
        "background": [0.1, 0.2, 0.3]});
    json_merge(&mut file, patch);
    file
}

/// Extinction of the dense ball and glow of the other.
fn matter(dense: f64, glow: f64) -> Value {
    json!([{"s": 0.1, "extinction": 0}, {"s": 0.3, "extinction": 20, "albedo": [0.9, 0.6, 0.4], "material": "m"},
        {"s": 0.38, "extinction": 9, "emission": [glow, 0.5 * glow, 0]}, {"s": 0.45, "extinction": 5},
        {"s": 0.5, "extinction": dense, "albedo": [0.5, 0.8, 0.9]}, {"s": 0.8, "extinction": dense}])
}

fn snapshot(volume: &Arc<PreparedVolume>, patch: Value) -> Arc<Snapshot> {
    let file = SceneFile::from_value(file(patch)).unwrap();
    Arc::new(Snapshot { epoch: 1, scene: Scene::with_images(&file, volume.clone(), &sky()).unwrap() })
}

/// The picture without layers.
fn without_layers(patch: &Value) -> Value {
    let mut patch = patch.clone();
    patch["illumination"] = json!({"method": "path_traced"});
    patch
}

fn bits(renderer: &mut Renderer, view: &View) -> Vec<u32> {
    renderer.radiance(view).unwrap().rgb.iter().map(|x| x.to_bits()).collect()
}

fn from_scratch(renderer: &mut Renderer, snapshot: &Arc<Snapshot>) -> Vec<u32> {
    let mut view = View::new();
    draw(renderer, &mut view, snapshot, TARGET);
    bits(renderer, &view)
}

fn in_one_slice(renderer: &mut Renderer, view: &mut View, snapshot: &Arc<Snapshot>) -> Drawn {
    let budget = Some(Duration::from_micros(1));
    renderer.draw(view, &DrawRequest { snapshot, target: TARGET, budget }).unwrap()
}

/// Each list begins with a scene; the others differ in colours, strengths and switches alone.
fn mixes() -> Vec<Vec<Value>> {
    let [white, red, blue] = [[3.0; 3], [3.0, 0.0, 0.0], [0.1, 0.2, 4.0]];
    vec![
        vec![
            json!({"lights": [sun(white), lamp(red), panel(blue), globe(white), uniform([0.2, 0.3, 0.4])]}),
            json!({"lights": [sun(blue), lamp(red), panel(blue), globe(white), uniform([0.2, 0.3, 0.4])]}),
            json!({"lights": [sun(blue), off(lamp(white)), panel(red), globe(white), uniform([0.0, 0.1, 0.0])]}),
            json!({"lights": [off(sun(blue)), off(lamp(white)), off(panel(red)), off(globe(white)), off(uniform([1.0; 3]))]}),
            json!({"lights": [sun([1e9; 3]), lamp(red), panel([0.0; 3]), globe(white), uniform([1e-9; 3])]}),
            json!({"lights": [sun(white), lamp(red), panel(blue), globe(white), uniform([0.2, 0.3, 0.4])],
                "background": [7, 0, 0.5]}),
        ],
        vec![
            json!({"lights": [image(0.6), sun(white)], "background": "environment"}),
            json!({"lights": [image(2.5), sun(red)], "background": "environment"}),
            json!({"lights": [off(image(2.5)), sun(blue)], "background": "environment"}),
        ],
        // The first mix lacks a light that is switched on later.
        vec![
            json!({"lights": [off(uniform([1.0; 3])), panel(red)], "background": "environment"}),
            json!({"lights": [uniform([0.4, 0.5, 0.9]), panel(red)], "background": "environment"}),
        ],
        vec![json!({"lights": []}), json!({"lights": [], "background": [1, 1, 0.5]})],
    ]
}

#[test]
fn another_mix_is_the_picture_from_scratch_and_follows_no_path() {
    let mut renderer = renderer();
    let volume = balls();
    for patches in mixes() {
        let mut view = View::new();
        let mut shown = Vec::new();
        for (index, patch) in patches.iter().enumerate() {
            let scene = snapshot(&volume, patch.clone());
            let plan = renderer.plan(&view, &scene, TARGET);
            let drawn = draw(&mut renderer, &mut view, &scene, TARGET);
            let paths = u64::from(TARGET.width * TARGET.height * TARGET.samples_per_pixel);
            // Those that shine, what lies behind them, and what glows.
            let shining = scene.scene.lights.iter().filter(|light| light.shines()).count() as u64;
            let behind = u64::from(scene.scene.background.power() != DVec3::ZERO);
            let layers = shining + behind + 1;
            if index == 0 {
                assert_eq!((plan.film, drawn.counters["paths"]), (FilmPlan::Restart, paths));
            } else {
                assert_eq!((plan.film, drawn.counters["paths"]), (FilmPlan::Mix, 0), "{patch}");
                let mixed = u64::from(TARGET.width * TARGET.height) * layers;
                assert_eq!(drawn.counters["pixels_of_layers_mixed"], mixed);
                let running: Vec<_> = plan.passes.iter().filter(|pass| pass.runs).collect();
                assert_eq!(
                    running.iter().map(|p| p.pass).collect::<Vec<_>>(),
                    [Pass::MixLights, Pass::ToneMap]
                );
                assert!(running[0].reason.starts_with("mixed anew: "), "{}", running[0].reason);
            }
            let picture = bits(&mut renderer, &view);
            assert!(picture == from_scratch(&mut renderer, &scene), "edit {index}: {patch}");
            assert!(picture.iter().all(|&x| f32::from_bits(x).is_finite()), "{patch}");
            assert!(!shown.contains(&picture), "{patch} changes nothing");
            // What is on screen, too.
            let on_screen = renderer.picture(&mut view).unwrap();
            let mut fresh = View::new();
            draw(&mut renderer, &mut fresh, &scene, TARGET);
            assert!(on_screen == renderer.picture(&mut fresh).unwrap(), "tone-mapped {patch}");
            shown.push(picture);
        }
    }
}

#[test]
fn layers_are_together_the_picture_without_them() {
    let mut renderer = renderer();
    let volume = balls();
    for patches in mixes() {
        // With all lights shining in all colours paths take the same ways.
        let mut patch = patches[0].clone();
        for light in patch["lights"].as_array_mut().unwrap() {
            light["enabled"] = json!(true);
            for key in ["irradiance", "intensity", "radiance"] {
                if light.get(key).is_some() {
                    light[key] = json!([2, 0.5, 1.5]);
                }
            }
        }
        let mut of = |patch| {
            let mut view = View::new();
            let drawn = draw(&mut renderer, &mut view, &snapshot(&volume, patch), TARGET);
            assert_eq!(drawn.counters["paths_not_finite"], 0);
            (renderer.radiance(&view).unwrap().rgb, drawn.counters["tentative_collisions"])
        };
        let ((whole, work), (mixed, same)) = (of(without_layers(&patch)), of(patch.clone()));
        assert_eq!(work, same, "{patch}");
        let off = |(a, b): (&f32, &f32)| (a - b).abs() / a.abs().max(1e-3);
        let worst = whole.iter().zip(&mixed).map(off).fold(0.0, f32::max);
        assert!(worst < 1e-5, "{worst} {patch}");
        assert!(whole.iter().any(|&x| x > 0.05), "{patch}");
    }
}

/// Where lights are off or have one colour, paths of layers look for light that others do not.
#[test]
fn mixes_agree_with_the_reference() {
    let volume = balls();
    let [width, height, paths] = [10, 8, 2048];
    let target = Target { width, height, samples_per_pixel: paths };
    let pixels = |rgb: Vec<f32>| -> Vec<[f64; 3]> {
        rgb.as_chunks::<3>().0.iter().map(|p| p.map(f64::from)).collect()
    };
    let of = |patch: Value| {
        let mut renderer = renderer();
        let mut view = View::new();
        draw(&mut renderer, &mut view, &snapshot(&volume, patch), target);
        (pixels(renderer.radiance(&view).unwrap().rgb), pixels(renderer.standard_error(&view).unwrap().rgb))
    };
    for (patch, other) in
        [(mixes()[0][2].clone(), mixes()[0][1].clone()), (mixes()[1][2].clone(), mixes()[1][1].clone())]
    {
        let scene = &snapshot(&volume, without_layers(&patch)).scene;
        let request = Request { seed: 7, ..Request::new(width, height, paths) };
        let truth = reference::render(scene, &request, &Progress::default()).unwrap();
        // A layered picture's own errors rest on two numbers a pixel; those of one without layers miss
        // what one path in thousands finds in the layers alone.
        let plain = of(without_layers(&patch)).1;
        let test = |patch| {
            let (picture, own) = of(patch);
            let larger = |(a, b): (&[f64; 3], &[f64; 3])| std::array::from_fn(|i| a[i].max(b[i]));
            let errors: Vec<[f64; 3]> = own.iter().zip(&plain).map(larger).collect();
            z_test_image(&picture, &errors, &truth.mean, &truth.standard_error)
        };
        let (right, wrong) = (test(patch), test(other));
        eprintln!(
            "worst z {:.2}, mean z^2 {:.3}; of another mix {:.1}",
            right.worst_z, right.mean_square, wrong.worst_z
        );
        assert!(right.passes(1e-4 / 2.0), "{right:?}");
        assert!(!wrong.passes(1e-9), "{wrong:?}");
    }
}

/// Edits of lights and matter, one after the other, some superseded before the picture is complete.
#[test]
fn edits_end_up_in_the_picture_from_scratch_whatever_came_before() {
    let mut renderer = renderer();
    let volume = balls();
    let with = |dense: f64, lights: Value| json!({"lights": lights, "transfer_function": {"points": matter(dense, 2.0)}});
    let [white, red, blue] = [[3.0; 3], [3.0, 0.5, 0.1], [0.1, 0.2, 4.0]];
    let tiles = |plan| matches!(plan, FilmPlan::RestartTiles { .. });
    let keeps = |plan| matches!(plan, FilmPlan::Mix | FilmPlan::Refine);
    let anew = |plan| plan == FilmPlan::Restart;
    type Check = fn(FilmPlan) -> bool;
    // Scene, what is to become of the film, and whether the picture is finished.
    let edits: Vec<(Value, Check, bool)> = vec![
        (with(60.0, json!([sun(white), panel(red)])), anew, false),
        (with(60.0, json!([sun(blue), panel(red)])), keeps, false),
        (with(60.0, json!([sun(blue), off(panel(red))])), keeps, true),
        (with(60.0, json!([sun(red), panel(white)])), keeps, true),
        (with(30.0, json!([sun(red), panel(white)])), tiles, true),
        (with(30.0, json!([sun(white), panel(blue)])), keeps, true),
        // Both at once, and a mix in the middle of it.
        (with(90.0, json!([sun(white), panel(red)])), tiles, false),
        (with(90.0, json!([sun(blue), panel(red)])), keeps, false),
        (with(40.0, json!([off(sun(blue)), panel(white)])), tiles, true),
        (with(40.0, json!([panel(white), sun(blue)])), anew, true),
        (with(40.0, json!([panel(white), sun(blue), lamp(white)])), anew, false),
        (with(40.0, json!([panel(white), lamp(white)])), anew, true),
        (with(40.0, json!([panel(white), lamp(red)])), keeps, true),
    ];
    let mut view = View::new();
    for (index, (patch, fits, finish)) in edits.into_iter().enumerate() {
        let scene = snapshot(&volume, patch);
        let plan = renderer.plan(&view, &scene, TARGET).film;
        assert!(fits(plan), "edit {index}: {plan:?}");
        if finish {
            let drawn = draw(&mut renderer, &mut view, &scene, TARGET);
            if let Some(&kept) = drawn.counters.get("tiles_reused") {
                eprintln!("edit {index}: {kept} tiles stay");
                assert!(kept > 0);
            }
            let fresh = from_scratch(&mut renderer, &scene);
            assert!(bits(&mut renderer, &view) == fresh, "edit {index} differs from a fresh picture");
        } else {
            assert!(!in_one_slice(&mut renderer, &mut view, &scene).complete, "edit {index}");
        }
    }
    // Layers switched off and on, and another method between them.
    let lights = json!({"lights": [sun(white), off(panel(red))]});
    let mut local = lights.clone();
    local["illumination"] = json!({"method": "local", "light_layers": true});
    local["background"] = json!([0, 0, 1]);
    for patch in [without_layers(&lights), lights.clone(), local, lights] {
        let scene = snapshot(&volume, patch.clone());
        assert_eq!(renderer.plan(&view, &scene, TARGET).film, FilmPlan::Restart, "{patch}");
        draw(&mut renderer, &mut view, &scene, TARGET);
        assert!(bits(&mut renderer, &view) == from_scratch(&mut renderer, &scene), "{patch}");
    }
}

#[test]
fn interrupted_pictures_are_mixed_pictures_of_fewer_paths() {
    let mut renderer = renderer();
    let volume = balls();
    let lights = |color: [f64; 3]| json!({"lights": [sun(color), uniform([0.2, 0.3, 0.4])]});
    let of = |color| snapshot(&volume, lights(color));
    let mut view = View::new();
    let slices = [(); 4].map(|()| in_one_slice(&mut renderer, &mut view, &of([3.0; 3])));
    let drawn = &slices[3];
    assert!(!drawn.complete);
    let picture = renderer.radiance(&view).unwrap().rgb;
    let share = picture.iter().filter(|&&x| x > 0.0).count() as f64 / picture.len() as f64;
    eprintln!("{:.0} % of the values are there after four dispatches", 100.0 * share);
    assert!(share > 0.1 && share < 1.0, "some paths have ended, and not all: {share}");
    // Whoever waits no longer, but makes the light twice as strong, sees twice the light.
    let target = Target { samples_per_pixel: drawn.samples_per_pixel, ..TARGET };
    let doubled = of([6.0; 3]);
    let request = DrawRequest { snapshot: &doubled, target, budget: None };
    assert_eq!(renderer.plan(&view, &doubled, target).film, FilmPlan::Mix);
    assert_eq!(renderer.draw(&mut view, &request).unwrap().counters["paths"], 0);
    let brighter = renderer.radiance(&view).unwrap().rgb;
    assert!(picture.iter().zip(&brighter).all(|(a, b)| b >= a && *b <= 2.0 * a));
    assert!(picture.iter().zip(&brighter).any(|(a, b)| *b > 1.5 * a));
}

/// Rows are worked on in bands, whose layers lie in different buffers.
#[test]
fn large_pictures_are_mixed_from_all_their_bands() {
    let mut renderer = renderer();
    let volume = balls();
    let target = Target { width: 144, height: 240, samples_per_pixel: 3 };
    let lights = |color: [f64; 3]| json!({"lights": [sun(color), uniform([0.2, 0.3, 0.4])]});
    let mut of = |patches: &[Value]| {
        let mut view = View::new();
        for patch in patches {
            // Recoloured in the middle of the picture, and again at its end.
            let scene = snapshot(&volume, patch.clone());
            let budget = Some(Duration::from_millis(100));
            let request = DrawRequest { snapshot: &scene, target, budget };
            assert!(!renderer.draw(&mut view, &request).unwrap().complete);
        }
        for patch in patches.iter().chain(&patches[..1]) {
            draw(&mut renderer, &mut view, &snapshot(&volume, patch.clone()), target);
        }
        renderer.radiance(&view).unwrap().rgb
    };
    let (first, second) = (lights([3.0, 1.0, 0.5]), lights([1.0, 2.0, 6.0]));
    let fresh = of(std::slice::from_ref(&second));
    assert!(of(&[second.clone(), first]) == fresh);
    let whole = of(&[without_layers(&second)]);
    let off = |(a, b): (&f32, &f32)| (a - b).abs() / a.abs().max(1e-3);
    let worst = whole.iter().zip(&fresh).map(off).fold(0.0, f32::max);
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn the_error_of_a_mix_is_its_difference_from_a_better_picture() {
    let mut renderer = renderer();
    let volume = balls();
    let of =
        |sun_color, panel_color| snapshot(&volume, json!({"lights": [sun(sun_color), panel(panel_color)]}));
    let target = Target { width: 48, height: 36, samples_per_pixel: 64 };
    let better = Target { samples_per_pixel: 1024, ..target };
    let (mut view, mut truth) = (View::new(), View::new());
    for (sun_color, panel_color) in
        [([3.0; 3], [3.0; 3]), ([0.0; 3], [4.0, 1.0, 0.0]), ([1.0, 0.0, 0.0], [0.0; 3])]
    {
        let scene = of(sun_color, panel_color);
        let estimate = draw(&mut renderer, &mut view, &scene, target).estimate.unwrap().relative_error;
        draw(&mut renderer, &mut truth, &scene, better);
        let (picture, truth) =
            (renderer.radiance(&view).unwrap().rgb, renderer.radiance(&truth).unwrap().rgb);
        let squares =
            |values: &mut dyn Iterator<Item = f32>| values.map(|x| f64::from(x).powi(2)).sum::<f64>();
        let off = squares(&mut picture.iter().zip(&truth).map(|(a, b)| a - b));
        let difference = (off / squares(&mut truth.iter().copied())).sqrt();
        eprintln!("estimate {estimate}, difference {difference}");
        assert!(
            (0.7..1.3).contains(&(difference / estimate)),
            "estimate {estimate}, difference {difference}"
        );
    }
    // A picture that was good enough goes on where another mix of it is not.
    let strict = |sun_color, panel_color, error: f64| {
        let mut patch = json!({"lights": [sun(sun_color), panel(panel_color)]});
        patch["illumination"] = json!({"method": "path_traced", "light_layers": true, "max_error": error});
        snapshot(&volume, patch)
    };
    let mut view = View::new();
    let of_panel = draw(&mut renderer, &mut view, &strict([0.0; 3], [3.0; 3], 0.04), better);
    assert!(of_panel.estimate.unwrap().relative_error <= 0.04 && of_panel.samples_per_pixel < 1024);
    let of_sun = draw(&mut renderer, &mut view, &strict([3.0; 3], [0.0; 3], 0.04), better);
    assert!(of_sun.samples_per_pixel > of_panel.samples_per_pixel && of_sun.counters["paths"] > 0);
    assert!(of_sun.estimate.unwrap().relative_error <= 0.04);
    // And one that is good enough stays.
    let fainter = draw(&mut renderer, &mut view, &strict([1.0; 3], [0.0; 3], 0.04), better);
    assert_eq!((fainter.counters["paths"], fainter.samples_per_pixel), (0, of_sun.samples_per_pixel));
}

#[test]
fn what_is_too_much_is_refused_and_what_layers_take_is_told() {
    let mut renderer = renderer();
    let volume = balls();
    let lamps = |count: usize| {
        let lamp = |i: usize| json!({"id": i.to_string(), "type": "point", "position": [i, 1, 1], "intensity": [1, 1, 1]});
        json!({"lights": (0..count).map(lamp).collect::<Vec<_>>()})
    };
    assert_eq!(render::check(&snapshot(&volume, lamps(8)).scene), Ok(()));
    let refused = render::check(&snapshot(&volume, lamps(9)).scene).unwrap_err();
    assert_eq!(refused.to_string(), "illumination.light_layers: is for at most 8 lights, and there are 9");
    assert_eq!(render::check(&snapshot(&volume, without_layers(&lamps(9))).scene), Ok(()));
    let huge = Target { width: 2400, height: 1200, samples_per_pixel: 1 };
    let scene = snapshot(&volume, lamps(8));
    let request = DrawRequest { snapshot: &scene, target: huge, budget: Some(Duration::from_millis(1)) };
    let mut view = View::new();
    let Err(RenderError::Refused(error)) = renderer.draw(&mut view, &request) else { panic!("not refused") };
    assert_eq!(error.field, "illumination.light_layers");
    eprintln!("{error}");
    // Another size then works in the same view.
    let layered = draw(&mut renderer, &mut view, &scene, TARGET).gpu_bytes["paths"];
    let plain = snapshot(&volume, without_layers(&lamps(8)));
    let plain = draw(&mut renderer, &mut View::new(), &plain, TARGET).gpu_bytes["paths"];
    let pixels = u64::from(TARGET.width * TARGET.height);
    assert_eq!(
        layered - plain,
        (24 + 12) * 10 * pixels,
        "24 bytes a pixel, and 12 while paths are under way"
    );
}
