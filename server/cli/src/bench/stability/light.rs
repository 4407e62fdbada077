//! Hard light: many, none, too near, too strong.

use serde_json::{Value, json};

use super::case::{Case, Expect};

/// Why the error of a light inside matter is not judged.
const SINGULAR: &str =
    "inverse square inside matter: brightness has no bound, nor has the variance of random estimates";

pub fn cases() -> Vec<Case> {
    let of = |name: &str, lights: Value| Case::new("lights", name, json!({"lights": lights}));
    let point = |position: [f64; 3], intensity: f64| json!([{"type": "point", "position": position, "intensity": [intensity, intensity, intensity]}]);
    let sun = |direction: [f64; 3], irradiance: f64| json!([{"type": "directional", "direction": direction, "irradiance": [irradiance, irradiance, irradiance]}]);
    let many = |count: u32| -> Value {
        let light = |i: u32| {
            let angle = f64::from(i) * 0.7;
            json!({"type": "point", "position": [0.9 * angle.cos(), 0.9 * angle.sin(), 0.8],
                "intensity": [0.02, 0.02, 0.03]})
        };
        (0..count).map(light).collect()
    };
    let voxel = 0.5 / 16.0;
    let every_kind = json!([
        {"type": "directional", "direction": [0, -1, 0], "irradiance": [0.5, 0.5, 0.5]},
        {"type": "point", "position": [0.9, 0.5, 0.9], "intensity": [0.5, 0.5, 0.5]},
        {"type": "spot", "position": [0, 1, 0.5], "direction": [0, -1, -0.5], "cone_degrees": [10, 30], "intensity": [1, 1, 1]},
        {"type": "rectangle", "center": [0, 1.5, 0], "normal": [0, -1, 0], "up": [0, 0, 1], "size": [0.2, 0.2], "radiance": [5, 5, 5]},
        {"type": "disk", "center": [0, 0, 1.5], "normal": [0, 0, -1], "radius": 0.1, "radiance": [5, 5, 5]},
        {"type": "sphere", "center": [-1.2, 0, 0.5], "radius": 0.1, "radiance": [5, 5, 5]},
        {"type": "environment", "radiance": [0.1, 0.1, 0.1]}]);
    vec![
        of("none", json!([])).quick(),
        of("one", sun([0.0, -1.0, 0.0], 1.0)),
        of("64", many(64)).quick(),
        of("65", many(65)).expect(Expect::Refused("lights")),
        of("one of every kind", every_kind).quick(),
        of("without power", point([0.5, 0.5, 0.5], 0.0)),
        of("point inside matter", point([0.01, 0.02, 0.03], 0.05)).expect(Expect::Stated(SINGULAR)).quick(),
        of("point on a voxel's centre", point([voxel, voxel, voxel], 0.05)).expect(Expect::Stated(SINGULAR)),
        of("point at the camera", point([0.3, 0.4, 1.6], 1.0)).quick(),
        of("point 1e6 away", point([0.0, 1e6, 0.0], 1e12_f64.min(1e9))),
        of("irradiance 1e9", sun([0.3, -1.0, -0.2], 1e9)).quick(),
        of("irradiance 1e10", sun([0.3, -1.0, -0.2], 1e10)).expect(Expect::Refused("lights[0].irradiance")),
        of("irradiance 1e-30", sun([0.3, -1.0, -0.2], 1e-30)),
        of("direction 0", sun([0.0; 3], 1.0)).expect(Expect::Refused("lights[0].direction")).quick(),
        of("direction 1e-8 long", sun([0.0, -1e-8, 0.0], 1.0)),
        of("direction 1e9 long", sun([1e9, -1e9, 0.0], 1.0)),
        of("spot of no width", json!([{"type": "spot", "position": [0, 1, 0], "direction": [0, -1, 0], "cone_degrees": [0, 0], "intensity": [1, 1, 1]}])),
        of("spot of 180 degrees", json!([{"type": "spot", "position": [0.5, 1, 0.7], "direction": [0, -1, 0], "cone_degrees": [180, 180], "intensity": [1, 1, 1]}])),
        of("sphere of radius 0", json!([{"type": "sphere", "center": [0, 1, 0], "radius": 0, "radiance": [1, 1, 1]}])),
        of("sphere around everything", json!([{"type": "sphere", "center": [0, 0, 0], "radius": 5, "radiance": [1, 1, 1]}]))
            .expect(Expect::Stated("methods that take lights from their centre have it inside matter")),
        of("rectangle through matter", json!([{"type": "rectangle", "center": [0, 0, 0], "normal": [0, -1, 0], "up": [0, 0, 1], "size": [2, 2], "radiance": [1, 1, 1]}]))
            .expect(Expect::Stated(SINGULAR)),
        of("rectangle whose up is its normal", json!([{"type": "rectangle", "center": [0, 1, 0], "normal": [0, 1, 0], "up": [0, 1, 0], "size": [1, 1], "radiance": [1, 1, 1]}]))
            .expect(Expect::Refused("lights[0].up")),
        of("two environments", json!([{"type": "environment", "radiance": [1, 1, 1]}, {"type": "environment", "radiance": [1, 1, 1]}]))
            .expect(Expect::Refused("lights[1]")),
    ]
}
