//! Scene files: examples of the contract, errors that name the field, round trips.

#![allow(clippy::unwrap_used, clippy::expect_used)]

use proptest::prelude::*;
use proto::scene_file::*;
use serde_json::json;

fn error(value: serde_json::Value) -> String {
    SceneFile::from_value(value).expect_err("must be refused").to_string()
}

fn with(patch: serde_json::Value) -> serde_json::Value {
    let mut scene = json!({"version": 1, "volume": {"builtin": "pillars", "dims": [8, 8, 8]}});
    for (key, value) in patch.as_object().unwrap() {
        scene[key] = value.clone();
    }
    scene
}

#[test]
fn reads_every_key_of_the_contract() {
    let text = r#"{
      "version": 1,
      "volume": {"file": "engine.raw", "filter": "nearest", "dims": [4,5,6], "type": "uint16", "endian": "big", "header_bytes": 7, "index": 1, "level": 2, "region": [[0,0.25,0.5],[1,0.5,1]]},
      "value_range": [0, 255], "spacing": [1, 1, 2], "density": 1.5,
      "transfer_function": {"points": [
        {"s": 0.0, "extinction": 0.0, "albedo": [1,1,1], "emission": [0,0,0], "material": "default"},
        {"s": 1.0, "opacity": 0.5, "albedo": [0.9,0.6,0.4], "material": "bone"}]},
      "materials": {"default": {"phase": {"type": "henyey_greenstein", "g": 0.3}}, "fog": {"phase": {"type": "schlick", "k": -0.5}}, "plain": {"phase": {"type": "isotropic"}},
        "bone": {"surface": 1.0, "brdf": {"type": "ashikhmin_shirley", "diffuse": 0.7, "specular": 0.05, "exponents": [200,200]}},
        "skin": {"surface": 0.5, "brdf": {"type": "lambert", "diffuse": 0.7}},
        "wax": {"surface": 0.5, "brdf": {"type": "blinn_phong", "diffuse": 0.7, "specular": 0.2, "exponent": 40}},
        "gloss": {"surface": 0.5, "brdf": {"type": "abc", "diffuse": 0.7, "a": 1, "b": 2, "c": 3}}},
      "lights": [
        {"id": "sun", "type": "directional", "direction": [0,-1,0], "irradiance": [3,3,3]},
        {"type": "point", "position": [0.2,0.3,0.1], "intensity": [1,1,1]},
        {"type": "spot", "position": [0,1,0], "direction": [0,-1,0], "cone_degrees": [20,30], "intensity": [1,1,1]},
        {"type": "rectangle", "center": [0,1,0], "normal": [0,-1,0], "up": [0,0,1], "size": [0.5,0.5], "radiance": [5,5,5]},
        {"type": "disk", "center": [0,1,0], "normal": [0,-1,0], "radius": 0.2, "radiance": [5,5,5]},
        {"type": "sphere", "center": [0,1,0], "radius": 0.1, "radiance": [5,5,5]},
        {"type": "environment", "image": "studio.hdr", "scale": 1.0, "rotation_degrees": [0,0,0]}],
      "camera": {"position": [0,0,2.5], "target": [0,0,0], "up": [0,1,0], "fov_y_degrees": 40},
      "clip": {"box": [[0,0,0],[1,1,1]], "planes": [{"normal": [0,0,1], "offset": 0.1}], "shadows": false},
      "background": "environment", "scattering": {"orders": 3}, "illumination": {"method": "photon_map"},
      "image": {"width": 256, "height": 128}}"#;
    let scene = SceneFile::from_json(text).unwrap();
    assert_eq!(scene.lights.len(), 7);
    assert_eq!(scene.background, Background::Environment);
    assert_eq!(scene.scattering.orders, Orders::AtMost(3));
    let again = SceneFile::from_value(serde_json::to_value(&scene).unwrap()).unwrap();
    assert_eq!(scene, again);
}

#[test]
fn opacity_becomes_extinction_as_the_contract_says() {
    let point = |opacity| TransferFunctionPoint { opacity: Some(opacity), ..Default::default() };
    assert!((point(0.5).sigma_t() - 0.5f64.ln().abs() / 0.01).abs() < 1e-9);
    assert_eq!(point(1.0).sigma_t(), point(0.9999).sigma_t());
    assert_eq!(point(0.0).sigma_t(), 0.0);
}

#[test]
fn errors_name_the_field() {
    let point = |p| with(json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}, p]}}));
    let region = |r| with(json!({"volume": {"builtin": "pillars", "region": r}}));
    let cases = [
        (region(json!([[0, 0, 0], [1, 1, 1.5]])), "volume.region[1][2]: must be from 0 to 1, got 1.5"),
        (region(json!([[0, 0.5, 0], [1, 0.5, 1]])), "volume.region[1][1]: must be above the lower corner"),
        (with(json!({"volume": {"builtin": "pillars", "level": 99}})), "volume.level: must be from 0 to 16"),
        (
            point(json!({"s": 1, "extinction": -1})),
            "transfer_function.points[1].extinction: must be finite and >= 0",
        ),
        (point(json!({"s": 1, "extinction": "x"})), "transfer_function.points[1].extinction: invalid type"),
        (
            point(json!({"s": 1, "opacity": 2})),
            "transfer_function.points[1].opacity: must be from 0 to 1, got 2",
        ),
        (
            point(json!({"s": 1, "extinction": 1, "albedo": [0, 0, 2]})),
            "transfer_function.points[1].albedo[2]: ",
        ),
        (point(json!({"s": 1})), "transfer_function.points[1].extinction: is missing"),
        (
            point(json!({"s": 1, "extinction": 1, "material": "bone"})),
            "transfer_function.points[1].material: `bone` is not in",
        ),
        (
            with(json!({"lights": [{"type": "point", "position": [0, "a", 0], "intensity": [1, 1, 1]}]})),
            "lights[0].position[1]: invalid type",
        ),
        (with(json!({"lights": [{"type": "torch"}]})), "lights[0].type: unknown type `torch`"),
        (with(json!({"lights": [{"direction": [0, 0, 1]}]})), "lights[0].type: is missing"),
        (
            with(
                json!({"lights": [{"type": "directional", "direction": [0, 0, 0], "irradiance": [1, 1, 1]}]}),
            ),
            "lights[0].direction: must not be the zero vector",
        ),
        (
            with(
                json!({"lights": [{"type": "directional", "direction": [0, 0, 1], "irradiance": [1, 1, 1], "colour": 1}]}),
            ),
            "lights[0].colour: unknown field `colour`",
        ),
        (
            with(json!({"materials": {"m": {"phase": {"type": "isotropic", "g": 1}}}})),
            "materials.m.phase.g: unknown field",
        ),
        (with(json!({"materials": {"m": {"surface": 0.5}}})), "materials.m.brdf: is missing"),
        (with(json!({"illumination": {"method": "magic"}})), "illumination.method: unknown variant `magic`"),
        (
            with(json!({"illumination": {"gather": "eye"}})),
            "illumination.gather: unknown variant `eye`, expected `field` or `ray`",
        ),
        (
            with(json!({"illumination": {"transfer_clusters": 31}})),
            "illumination.transfer_clusters: must be 0 or from 32 to 256, got 31",
        ),
        (
            with(
                json!({"camera": {"position": [0, 0, 1], "target": [0, 0, 0], "up": [0, 0, 1], "fov_y_degrees": 40}}),
            ),
            "camera.up: must not be parallel",
        ),
        (with(json!({"volume": {"builtin": "pillars", "file": "x.nrrd"}})), "volume: needs exactly one"),
        (with(json!({"value_range": [2, 1]})), "value_range: must ascend"),
        (with(json!({"background": "sky"})), "background: must be three numbers"),
        (with(json!({"scattering": {"orders": 0}})), "scattering.orders: must be"),
        (with(json!({"sky": 1})), "sky: unknown field `sky`"),
        (with(json!({"version": 2})), "version: must be 1"),
    ];
    for (value, expected) in cases {
        let text = error(value);
        assert!(text.starts_with(expected), "expected `{expected}`, got `{text}`");
    }
    let overflow = r#"{"version": 1, "volume": {"builtin": "pillars"}, "density": 1e999}"#;
    assert!(SceneFile::from_json(overflow).is_err());
}

fn triple(range: std::ops::Range<f64>) -> impl Strategy<Value = [f64; 3]> + Clone {
    [range.clone(), range.clone(), range]
}

fn any_light() -> impl Strategy<Value = Light> {
    let direction = triple(0.1..1.0);
    prop_oneof![
        (direction.clone(), triple(0.0..9.0)).prop_map(|(direction, irradiance)| {
            Light::Directional(DirectionalLight { id: None, enabled: true, direction, irradiance })
        }),
        (triple(-2.0..2.0), triple(0.0..9.0), any::<bool>()).prop_map(|(position, intensity, enabled)| {
            Light::Point(PointLight { id: None, enabled, position, intensity })
        }),
        (triple(-2.0..2.0), direction.clone(), triple(0.0..9.0), 0.0..40.0).prop_map(
            |(position, direction, intensity, inner)| {
                Light::Spot(SpotLight {
                    id: None,
                    enabled: true,
                    position,
                    direction,
                    cone_degrees: [inner, inner + 10.0],
                    intensity,
                })
            }
        ),
        (triple(-2.0..2.0), direction, 0.0..3.0, triple(0.0..9.0)).prop_map(
            |(center, normal, radius, radiance)| {
                Light::Disk(DiskLight { id: None, enabled: true, center, normal, radius, radiance })
            }
        ),
    ]
}

fn any_point() -> impl Strategy<Value = TransferFunctionPoint> {
    (any::<bool>(), 0.0..1.0f64, triple(0.0..1.0), triple(0.0..5.0), any::<bool>()).prop_map(
        |(as_opacity, amount, albedo, emission, named)| TransferFunctionPoint {
            s: 0.0,
            extinction: (!as_opacity).then_some(amount * 500.0),
            opacity: as_opacity.then_some(amount),
            albedo,
            emission,
            material: named.then(|| "m".to_owned()),
        },
    )
}

fn any_scene() -> impl Strategy<Value = SceneFile> {
    (
        prop::collection::vec(any_point(), 1..12),
        prop::collection::vec(any_light(), 0..8),
        prop::option::of((triple(1.0..3.0), 5.0..90.0)),
        prop::option::of(triple(0.0..0.5)),
        prop_oneof![Just(Orders::All), (1u32..9).prop_map(Orders::AtMost)],
        prop_oneof![Just(Background::Environment), triple(0.0..1.0).prop_map(Background::Color)],
        -0.9..0.9f64,
        0usize..9,
    )
        .prop_map(|(mut points, lights, camera, clip, orders, background, g, builtin)| {
            let last = points.len().max(2) - 1;
            for (index, point) in points.iter_mut().enumerate() {
                point.s = index as f64 / last as f64;
            }
            let mut scene = SceneFile::new(VolumeSource {
                builtin: Some(Builtin::ALL[builtin]),
                dims: Some([8, 9, 10]),
                ..VolumeSource::default()
            });
            scene.transfer_function = TransferFunction { points };
            scene.materials.insert(
                "m".into(),
                Material { phase: Phase::HenyeyGreenstein(HenyeyGreenstein { g }), ..Material::default() },
            );
            scene.lights = lights;
            scene.camera = camera.map(|(position, fov)| Camera {
                position,
                target: [0.0; 3],
                up: [0.0, 1.0, 0.0],
                fov_y_degrees: Some(fov),
                orthographic_height: None,
            });
            scene.clip.bounds = clip.map(|low| [low, [1.0; 3]]);
            scene.scattering.orders = orders;
            scene.background = background;
            scene
        })
}

proptest! {
    /// Whatever is written reads back equal, through text.
    #[test]
    fn written_scenes_read_back_equal(scene in any_scene()) {
        prop_assert_eq!(scene.validate(), Ok(()));
        let text = serde_json::to_string(&scene).unwrap();
        prop_assert_eq!(SceneFile::from_json(&text), Ok(scene));
    }

    /// No text makes the decoder panic.
    #[test]
    fn arbitrary_text_never_panics(text in "\\PC{0,200}") {
        let _ = SceneFile::from_json(&text);
    }
}
