//! The scene an uploaded volume opens with: chosen from its voxels so that it looks good at once.
//!
//! Scans and simulations share one shape: much of nothing (air, background noise), a large body
//! of middling matter, and a little that is dense. Nothing becomes transparent, the body warm and
//! translucent, the dense part bright and solid. Where these lie is read off the distribution of
//! the data values by Otsu's threshold (N. Otsu, IEEE Trans. SMC 9, 1979), which splits a
//! distribution where the two parts differ most. Label volumes (`scene::labels`) get one colour per
//! label.

mod distribution;

use std::collections::BTreeMap;

use proto::scene_file::{
    Background, BlinnPhong, Brdf, Camera, DirectionalLight, EnvironmentLight, Filter, Light, Material,
    SceneFile, TransferFunction, TransferFunctionPoint, VolumeSource,
};
use scene::labels::{Label, MAX_LABELS, around, labels};
use scene::{Camera as View, Grid, PreparedVolume};

use distribution::{parts, sorted_values, surroundings};

/// Optical depth of the translucent body, seen through all of it.
const BODY_OPTICAL_DEPTH: f64 = 1.4;
/// Extinction of the body is kept within these, per world unit.
const BODY_EXTINCTION: [f64; 2] = [1.0, 25.0];
/// Extinction of the dense part per world unit: opaque within a hundredth of the volume.
const DENSE_EXTINCTION: f64 = 300.0;
/// Warm and translucent.
const BODY_ALBEDO: [f64; 3] = [0.85, 0.52, 0.36];
/// Between body and dense part.
const MIDDLE_ALBEDO: [f64; 3] = [0.93, 0.70, 0.50];
/// Bright and solid.
const DENSE_ALBEDO: [f64; 3] = [0.97, 0.93, 0.86];
/// Dark enough that nothing competes with the picture, not so dark that its edge vanishes.
const BACKGROUND: [f64; 3] = [0.012, 0.014, 0.018];

/// Room around the matter in the picture: share of the half image it may fill.
const FILL: f64 = 0.9;
/// Where unoriented data are looked at from: a little from the right and from above.
const UNORIENTED_YAW_DEGREES: f64 = 25.0;
const UNORIENTED_PITCH_DEGREES: f64 = 18.0;

/// A scene for a volume nobody has described.
pub fn default_scene(prepared: &PreparedVolume, source: VolumeSource) -> SceneFile {
    let mut scene = SceneFile::new(source);
    match labels(&prepared.volume) {
        Some(labels) => show_labels(&mut scene, &labels),
        None => show_scan(&mut scene, prepared, &sorted_values(prepared)),
    }
    scene.materials = materials();
    let anatomical = prepared.volume.orientation.is_some();
    scene.lights = lights(anatomical);
    scene.background = Background::Color(BACKGROUND);
    scene.camera = Some(camera(prepared, &scene, anatomical));
    scene
}

fn show_scan(scene: &mut SceneFile, prepared: &PreparedVolume, values: &[f64]) {
    // Where matter is what lies below its surroundings, the axis is turned around.
    let turned = parts(values)
        .zip(surroundings(&prepared.volume))
        .is_some_and(|(parts, surroundings)| surroundings > parts.air_end);
    let seen = if turned { values.iter().rev().map(|value| -value).collect() } else { values.to_vec() };
    let Some(parts) = parts(&seen) else {
        // One value everywhere: a translucent block is all there is to see.
        scene.transfer_function = TransferFunction { points: vec![point(0.0, 3.0, BODY_ALBEDO, "body")] };
        return;
    };
    // A little above the densest common value, so that the last point is not at the very end.
    let window = [parts.low, parts.high + 0.02 * (parts.high - parts.low)];
    let s = |value: f64| ((value - window[0]) / (window[1] - window[0])).clamp(0.0, 1.0);
    let grid = Grid::new(prepared.volume.dims, prepared.volume.spacing);
    let depth = grid.size_world.element_sum() / 3.0;
    let thickness = (parts.matter_share * depth).max(f64::EPSILON);
    let body = (BODY_OPTICAL_DEPTH / thickness).clamp(BODY_EXTINCTION[0], BODY_EXTINCTION[1]);
    // Noise reaches above the threshold; matter starts thin.
    let foot = parts.air_end + 0.25 * (parts.body - parts.air_end);
    let shoulder = parts.body + 0.5 * (parts.dense - parts.body);
    let mut points = vec![
        point(0.0, 0.0, BODY_ALBEDO, "body"),
        point(s(parts.air_end), 0.0, BODY_ALBEDO, "body"),
        point(s(foot), 0.5 * body, BODY_ALBEDO, "body"),
        point(s(parts.body), body, BODY_ALBEDO, "body"),
        point(s(shoulder), 2.0 * body, MIDDLE_ALBEDO, "dense"),
        point(s(parts.dense), 0.5 * DENSE_EXTINCTION, DENSE_ALBEDO, "dense"),
        point(1.0, DENSE_EXTINCTION, DENSE_ALBEDO, "dense"),
    ];
    // Parts that coincide would make steps that nobody meant.
    points.dedup_by(|later, earlier| {
        let same = later.s - earlier.s < 1e-6;
        if same {
            later.s = earlier.s;
            std::mem::swap(later, earlier);
        }
        same
    });
    scene.value_range = Some(window);
    if turned {
        points.reverse();
        points.iter_mut().for_each(|point| point.s = 1.0 - point.s);
        scene.value_range = Some([-window[1], -window[0]]);
    }
    scene.transfer_function = TransferFunction { points };
}

/// One colour per label; what lies around them is transparent.
fn show_labels(scene: &mut SceneFile, labels: &[Label]) {
    let outside = around(labels);
    let values: Vec<f64> = labels.iter().map(|label| label.value).collect();
    let (first, last) = (values[0], values[values.len() - 1]);
    // Half a label of room at either end: each label owns an interval around its value.
    let room = 0.5 * (last - first) / (values.len() - 1) as f64;
    let window = [first - room, last + room];
    let s = |value: f64| ((value - window[0]) / (window[1] - window[0])).clamp(0.0, 1.0);
    // Where labels are small numbers, a label has the same colour in every volume.
    let numbered = first >= 0.0 && last < MAX_LABELS as f64;
    let mut points = Vec::new();
    for (index, &label) in values.iter().enumerate() {
        let start = index.checked_sub(1).map_or(0.0, |i| s(0.5 * (values[i] + label)));
        let end = values.get(index + 1).map_or(1.0, |next| s(0.5 * (label + next)));
        let extinction = if Some(label) == outside { 0.0 } else { DENSE_EXTINCTION };
        let color = label_color(if numbered { label as usize } else { index });
        points.push(point(start, extinction, color, "dense"));
        points.push(point(end, extinction, color, "dense"));
    }
    scene.volume.filter = Filter::Nearest;
    scene.value_range = Some(window);
    scene.transfer_function = TransferFunction { points };
}

/// Hues of label colours, evenly spaced.
const LABEL_HUES: usize = 16;
/// From one label to the next the hue goes on by this many: almost to the opposite, and to each
/// before any comes again.
const LABEL_HUE_STEP: usize = 7;
/// Mean of red, green and blue, how far each goes from it, and where the first hue lies between
/// two: vivid, pale, muted, dark. Chosen by search so that the two most similar of all colours are as
/// different as can be.
const LABEL_RINGS: [[f64; 3]; 4] = [[0.5, 0.43, 0.0], [0.65, 0.25, 0.0], [0.4, 0.2, 0.5], [0.12, 0.108, 0.5]];

/// Colours that are told apart, one for each of [`MAX_LABELS`] numbers.
fn label_color(number: usize) -> [f64; 3] {
    let [mean, swing, shift] = LABEL_RINGS[number / LABEL_HUES % LABEL_RINGS.len()];
    let step = (LABEL_HUE_STEP * number % LABEL_HUES) as f64 + shift;
    let hue = step / LABEL_HUES as f64 * std::f64::consts::TAU;
    let third = std::f64::consts::TAU / 3.0;
    [0.0, third, 2.0 * third].map(|offset| mean + swing * (hue - offset).cos())
}

fn point(s: f64, extinction: f64, albedo: [f64; 3], material: &str) -> TransferFunctionPoint {
    TransferFunctionPoint {
        s,
        extinction: Some(extinction),
        albedo,
        material: Some(material.into()),
        ..TransferFunctionPoint::default()
    }
}

fn materials() -> BTreeMap<String, Material> {
    let material = |surface, specular, exponent| Material {
        surface,
        brdf: Some(Brdf::BlinnPhong(BlinnPhong { diffuse: 0.85, specular, exponent })),
        ..Material::default()
    };
    [("body", material(0.6, 0.08, 20.0)), ("dense", material(0.95, 0.15, 50.0))]
        .map(|(name, material)| (name.to_owned(), material))
        .into()
}

/// From view axes (right, up, towards the eye) of the default view to the world.
fn world_from_view([right, up, back]: [f64; 3], anatomical: bool) -> [f64; 3] {
    if anatomical { [right, -back, up] } else { [right, up, back] }
}

/// A warm key from the upper left, a cool fill from the right, and light from everywhere.
fn lights(anatomical: bool) -> Vec<Light> {
    let directional = |id: &str, towards: [f64; 3], irradiance| {
        Light::Directional(DirectionalLight {
            id: Some(id.into()),
            enabled: true,
            direction: world_from_view(towards, anatomical),
            irradiance,
        })
    };
    vec![
        directional("key", [0.45, -0.65, -0.65], [2.5, 2.35, 2.1]),
        directional("fill", [-0.8, 0.1, -0.55], [0.45, 0.55, 0.75]),
        Light::Environment(EnvironmentLight {
            id: Some("room".into()),
            enabled: true,
            radiance: Some([0.16, 0.17, 0.19]),
            image: None,
            scale: None,
            rotation_degrees: None,
        }),
    ]
}

/// The default view, close enough that the matter fills the picture.
fn camera(prepared: &PreparedVolume, scene: &SceneFile, anatomical: bool) -> Camera {
    let mut camera = View::default_file(anatomical);
    let [low, high] = matter_bounds(prepared, scene);
    let center: [f64; 3] = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
    let (yaw, pitch) = if anatomical {
        (0.0, 0.0)
    } else {
        (UNORIENTED_YAW_DEGREES.to_radians(), UNORIENTED_PITCH_DEGREES.to_radians())
    };
    let back = world_from_view([yaw.sin() * pitch.cos(), pitch.sin(), yaw.cos() * pitch.cos()], anatomical);
    camera.target = center;
    camera.position = std::array::from_fn(|axis| center[axis] + back[axis]);
    let view = View::from_file(&camera);
    let half = camera.fov_y_degrees.unwrap_or(40.0).to_radians() * 0.5;
    // Every corner shall lie within the image: |x| and |y| at most `FILL tan(half) depth`.
    let mut distance = 0.0f64;
    for corner in 0..8 {
        let offset: [f64; 3] = std::array::from_fn(|axis| {
            if corner >> axis & 1 == 0 { low[axis] - center[axis] } else { high[axis] - center[axis] }
        });
        let along = |direction: [f64; 3]| (0..3).map(|i| offset[i] * direction[i]).sum::<f64>();
        let across = along(view.right.to_array()).abs().max(along(view.up.to_array()).abs());
        distance = distance.max(across / (FILL * half.tan()) + along(back));
    }
    camera.position = std::array::from_fn(|axis| center[axis] + distance.max(0.1) * back[axis]);
    camera
}

/// Corners of the box around all macrocells that can hold matter, world; the whole volume if none.
fn matter_bounds(prepared: &PreparedVolume, scene: &SceneFile) -> [[f64; 3]; 2] {
    let volume = &prepared.volume;
    let grid = Grid::new(volume.dims, volume.spacing);
    let whole = [grid.size_world * -0.5, grid.size_world * 0.5].map(|corner| corner.to_array());
    let Some([low, high]) = scene.value_range else {
        return whole;
    };
    let (function, _) = scene::TransferFunction::from_file(scene);
    let has_matter = |bin: usize| {
        let [from, to] = prepared.bins.interval(bin).map(|v| ((v - low) / (high - low)).clamp(0.0, 1.0));
        let inside = function.points.iter().filter(|p| p.s >= from && p.s <= to);
        // A bin counts if it is more than the thin foot of the body.
        [function.at(from), function.at(to)].iter().chain(inside).any(|p| p.sigma_t > BODY_EXTINCTION[0])
    };
    let bins = (0..64).filter(|&bin| has_matter(bin)).fold(0u64, |mask, bin| mask | 1 << bin);
    let cells = &prepared.macrocells;
    let (mut first, mut last) = (cells.dims, [0; 3]);
    let mut found = false;
    for (index, mask) in cells.masks(scene.volume.filter).iter().enumerate() {
        if mask & bins == 0 {
            continue;
        }
        found = true;
        let at = [
            index % cells.dims[0],
            index / cells.dims[0] % cells.dims[1],
            index / (cells.dims[0] * cells.dims[1]),
        ];
        for axis in 0..3 {
            first[axis] = first[axis].min(at[axis]);
            last[axis] = last[axis].max(at[axis] + 1);
        }
    }
    if !found {
        return whole;
    }
    let edge = scene::macrocells::MACROCELL_EDGE;
    [first, last].map(|cell| {
        let unit = |axis: usize| (cell[axis] * edge) as f64 / volume.dims[axis] as f64;
        std::array::from_fn(|axis| (unit(axis).min(1.0) - 0.5) * grid.size_world[axis])
    })
}

#[cfg(test)]
mod tests;
