//! Hard views: cameras, pictures, clip regions.

use proto::scene_file::Builtin;
use serde_json::{Value, json};

use super::case::{Case, Data, Expect, slab};

pub fn cases() -> Vec<Case> {
    let mut cases = cameras();
    cases.extend(pictures());
    cases.extend(clips());
    cases
}

fn camera(position: [f64; 3], target: [f64; 3], fov: f64) -> Value {
    json!({"camera": {"position": position, "target": target, "up": [0, 1, 0], "fov_y_degrees": fov}})
}

fn cameras() -> Vec<Case> {
    let of = |name: &str, position, target, fov| Case::new("camera", name, camera(position, target, fov));
    let parallel =
        json!({"camera": {"position": [0, 2, 0], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 38}});
    vec![
        of("inside matter", [0.02, 0.03, 0.01], [1.0, 0.2, 0.3], 60.0).quick(),
        of("at the centre, a voxel's corner", [0.0; 3], [0.0, 0.0, -1.0], 60.0),
        of("on a face", [0.0, 0.0, 0.5], [0.0, 0.0, -1.0], 60.0).quick(),
        of("on an edge", [0.5, 0.1, 0.5], [0.0, 0.0, 0.0], 60.0),
        of("in a face's plane, along it", [0.0, 0.5, 1.5], [0.0, 0.5, 0.0], 40.0),
        of("along an axis", [0.0, 0.0, 2.0], [0.0, 0.0, 0.0], 30.0).quick(),
        of("along a diagonal", [1.2, 1.2, 1.2], [0.0, 0.0, 0.0], 30.0),
        of("1e4 away", [0.0, 0.0, 1e4], [0.0, 0.0, 0.0], 0.1)
            .expect(Expect::Stated("the box fills less than a tenth of the picture: few pixels, by edges")),
        of("1e9 away", [0.0, 0.0, 1e9], [0.0, 0.0, 0.0], 0.1).quick(),
        of("looking away", [0.0, 0.0, 2.0], [0.0, 0.0, 4.0], 40.0),
        of("field of view 0.1 degrees", [0.3, 0.4, 1.6], [0.0, 0.0, 0.0], 0.1).quick(),
        of("field of view 179 degrees, from outside", [0.0, 0.0, 0.9], [0.0, 0.0, 0.0], 179.0)
            .expect(Expect::Stated("the volume is smaller than a pixel")),
        of("field of view 179 degrees, from inside", [0.02, 0.03, 0.01], [1.0, 0.2, 0.3], 179.0).quick(),
        of("field of view 180 degrees", [0.0, 0.0, 2.0], [0.0, 0.0, 0.0], 180.0)
            .expect(Expect::Refused("camera.fov_y_degrees")),
        of("looking at itself", [1.0; 3], [1.0; 3], 40.0).expect(Expect::Refused("camera.target")),
        Case::new("camera", "up along the view", parallel).expect(Expect::Refused("camera.up")),
    ]
}

fn pictures() -> Vec<Case> {
    // A long thin picture all of whose rays go through one world unit of matter.
    let mut long = slab(1.0, 0.0, 2.0);
    long["camera"]["orthographic_height"] = json!(0.003);
    let transmittance = (-1.0f64).exp();
    let expected = 0.5 * transmittance + 2.0 * (1.0 - transmittance);
    vec![
        Case::new("picture", "1x1", json!({})).image([1, 1]).quick(),
        Case::new("picture", "4096x16", long)
            .data(Data::Builtin(Builtin::Homogeneous, [4; 3]))
            .image([4096, 16])
            .expect(Expect::Radiance([expected; 3], 2e-3))
            .quick(),
        Case::new("picture", "1x300", json!({})).image([1, 300]),
    ]
}

fn clips() -> Vec<Case> {
    let of = |name: &str, clip: Value| Case::new("clip", name, json!({"clip": clip}));
    let plane = |normal: [f64; 3], offset: f64| json!({"planes": [{"normal": normal, "offset": offset}]});
    vec![
        of("a box of no volume", json!({"box": [[0.5, 0, 0], [0.5, 1, 1]]})).quick(),
        of("a thousandth of the volume", json!({"box": [[0.5, 0, 0], [0.501, 1, 1]]})),
        of("a plane that keeps nothing", plane([0.0, 0.0, 1.0], 9.0)),
        of("a plane through the middle, askew", plane([1.0, 2.0, 3.0], 0.0)).quick(),
        of("a plane 1e9 away", plane([0.0, 1.0, 0.0], -1e9)),
        of("a plane without direction", plane([0.0; 3], 0.0))
            .expect(Expect::Refused("clip.planes[0].normal")),
    ]
}
