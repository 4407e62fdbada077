//! Hard data: shapes, spacings, values.

use proto::scene_file::Builtin;
use serde_json::{Value, json};

use super::case::{Case, Data, EDGE, Expect, broken_values};

pub fn cases() -> Vec<Case> {
    let mut cases = shapes();
    cases.extend(values());
    cases
}

fn shapes() -> Vec<Case> {
    let of = |name: &str, dims: [usize; 3], patch: Value| {
        Case::new("shape", name, patch).data(Data::Builtin(Builtin::SmokePlume, dims))
    };
    let spacing = |spacing: [f64; 3]| json!({"spacing": spacing});
    vec![
        of("spacing 1:1:100", [24, 24, 4], spacing([1.0, 1.0, 100.0])).quick(),
        of("spacing 100:1:1", [4, 24, 24], spacing([100.0, 1.0, 1.0])),
        of("spacing 1e-9", [EDGE; 3], spacing([1e-9; 3])),
        of("spacing 1e9", [EDGE; 3], spacing([1e9; 3])),
        of("spacing 0", [EDGE; 3], spacing([1.0, 0.0, 1.0])).expect(Expect::Refused("spacing[1]")),
        of("one voxel thick", [EDGE, EDGE, 1], json!({})).quick(),
        of("one voxel thick, seen along it", [EDGE, 1, EDGE], json!({})),
        Case::new("shape", "1x1x1", solid()).data(Data::Builtin(Builtin::Homogeneous, [1; 3])).quick(),
        Case::new("shape", "3x3x2000", solid())
            .data(Data::Builtin(Builtin::Homogeneous, [3, 3, 2000]))
            .quick(),
        of("2000x2x3", [2000, 2, 3], json!({})),
    ]
}

/// Matter for data of one value.
fn solid() -> Value {
    json!({"value_range": [0, 255], "transfer_function": {"points": [
        {"s": 0, "extinction": 0, "albedo": [0.8, 0.7, 0.6]}, {"s": 1, "extinction": 9, "albedo": [0.8, 0.7, 0.6]}]}})
}

fn values() -> Vec<Case> {
    let of = |name: &str, values: Vec<f32>| {
        Case::new("values", name, json!({})).data(Data::File([EDGE; 3], values))
    };
    let count = EDGE * EDGE * EDGE;
    let own_range = json!({"value_range": null});
    let constant = |name: &str, value: f32| Case { patch: own_range.clone(), ..of(name, vec![value; count]) };
    let wide: Vec<f32> = (0..count).map(|i| if i % 97 == 0 { f32::MAX } else { i as f32 }).collect();
    vec![
        of("NaN, infinities and denormals strewn in", broken_values(37))
            .expect(Expect::Stated("holes one voxel wide: finer than the step"))
            .quick(),
        of("nothing but NaN and infinities", broken_values(1)),
        constant("0 everywhere, range of the data", 0.0).quick(),
        constant("7 everywhere, range of the data", 7.0),
        constant("largest f32 everywhere", f32::MAX),
        Case { patch: own_range.clone(), ..of("from 0 to the largest f32", wide) }
            .expect(Expect::Stated("single voxels stand out: finer than the step")),
        Case {
            patch: json!({"value_range": [0.5, 0.500_001]}),
            ..of("a window of 1e-6", broken_values(usize::MAX))
        }
        .expect(Expect::Stated("a step in the data, finer than the step of rays")),
    ]
}
