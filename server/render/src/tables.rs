//! Scene to shader tables: transfer function, materials, lights.

use std::f64::consts::PI;

use glam::DVec3;
use proto::scene_file::{Brdf, Method, Phase};
use scene::Scene;
use scene::light::{Light, LightGeometry};
use scene::scattering::{ambient_reflectance, blinn_phong_normalisation};
use scene::spherical::sh;
use scene::transfer_function::TransferFunction;

use crate::direct_light::in_parts;
use crate::uniforms;

/// Cells of the extinction table over `s`; equals `TF_CELLS` in shaders/shared/medium.wgsl.
pub const TRANSFER_FUNCTION_CELLS: usize = 1024;

/// Cells of `s` that are told apart when a ray asks whether there may be matter; equals
/// `MATTER_CELLS` in shaders/shared/medium.wgsl.
pub const MATTER_CELLS: u32 = 64;

/// What arithmetic in f32 may move `s` by, with room to spare.
const S_SLACK: f64 = 1e-5;

/// Rows of the point table.
pub const POINT_ROWS: usize = 3;

/// Rows of the table of cells.
pub const CELL_ROWS: usize = 3;

/// Materials a scene may have and the isotropic one before them; as in shaders/shared/medium.wgsl.
pub const MAX_MATERIALS: usize = proto::scene_file::limits::MAX_MATERIALS + 1;

/// Lights a scene may have; as in shaders/shared/light.wgsl.
pub const MAX_LIGHTS: usize = proto::scene_file::limits::MAX_LIGHTS;

pub fn vector(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// Texels of `tf_points`, row by row: a column a point (see shaders/shared/medium.wgsl).
pub fn transfer_function_points(scene: &Scene) -> Vec<[f32; 4]> {
    let points = &scene.transfer_function.points;
    let first = |(index, point): (usize, &scene::transfer_function::Point)| {
        let width = points.get(index + 1).map_or(0.0, |next| next.s as f32 - point.s as f32);
        let inverse = if width > 0.0 { 1.0 / width } else { 0.0 };
        [point.sigma_t as f32, point.s as f32, inverse, point.material as f32]
    };
    let color = |c: DVec3| [c.x as f32, c.y as f32, c.z as f32, 0.0];
    let rows = points.iter().enumerate().map(first);
    let rows = rows.chain(points.iter().map(|point| color(point.albedo)));
    rows.chain(points.iter().map(|point| color(point.emission))).collect()
}

/// Texels of `tf_cells`, row by row ([`CELL_ROWS`]): extinction at the cell's lower edge, its slope,
/// the last point at or below the edge, and 1 if another point lies inside (then the points decide).
/// Then [`integrals_of_cells`].
pub fn transfer_function_cells(function: &TransferFunction) -> Vec<[f32; 4]> {
    let edge = |cell: usize| cell as f64 / TRANSFER_FUNCTION_CELLS as f64;
    (0..TRANSFER_FUNCTION_CELLS)
        .map(|cell| {
            // Points are compared as the shader sees them, in f32; cell edges are exact in it.
            let at_or_below = |s: f64| function.points.partition_point(|point| point.s as f32 <= s as f32);
            let (below, inside) = (at_or_below(edge(cell)), at_or_below(edge(cell + 1)));
            let lower = function.at(edge(cell)).sigma_t;
            // The slope of the whole piece, from its own two points.
            let slope =
                match (below.checked_sub(1).and_then(|i| function.points.get(i)), function.points.get(below))
                {
                    (Some(a), Some(b)) if b.s > a.s => (b.sigma_t - a.sigma_t) / (b.s - a.s),
                    _ => 0.0,
                };
            [lower as f32, slope as f32, below as f32 - 1.0, f32::from(u8::from(inside > below))]
        })
        .chain(integrals_of_cells(function))
        .collect()
}

/// What [`TransferFunction::sigma_t`] integrates to from 0 on, at cells' lower edges, as the sum of two
/// floats, and where in the cell it goes on by another line than the one from the edge (2: nowhere); then
/// extinction on that line, its slope, and what it integrates to from the edge up to there.
fn integrals_of_cells(function: &TransferFunction) -> Vec<[f32; 4]> {
    let width = 1.0 / TRANSFER_FUNCTION_CELLS as f64;
    let edge = |cell: usize| cell as f64 * width;
    let mut before = 0.0;
    let (firsts, seconds): (Vec<_>, Vec<_>) = (0..TRANSFER_FUNCTION_CELLS)
        .map(|cell| {
            let (low, high) = (edge(cell), edge(cell + 1));
            let whole = function.integral(low, high);
            let inside = function.points.iter().filter(|point| low < point.s && point.s <= high);
            let places: Vec<f64> = inside.map(|point| point.s).collect();
            let begins = before;
            before += whole;
            let (hi, lo) = (begins as f32, (begins - f64::from(begins as f32)) as f32);
            let (Some(&first), Some(&last)) = (places.first(), places.last()) else {
                return ([hi, lo, 2.0, 0.0], [0.0; 4]);
            };
            let up_to = function.integral(low, first);
            let after = function.at(first).sigma_t;
            let rest = high - first;
            let is_one_line = first == last;
            let line = if rest == 0.0 {
                [after, 0.0]
            } else if is_one_line {
                [after, 2.0 * ((whole - up_to) / rest - after) / rest]
            } else {
                // More points than cells tell apart: their mean.
                [(whole - up_to) / rest, 0.0]
            };
            ([hi, lo, first as f32, 0.0], [line[0] as f32, line[1] as f32, up_to as f32, 0.0])
        })
        .unzip();
    [firsts, seconds].concat()
}

/// Of [`MATTER_CELLS`] equal cells of `s` those in which there is matter, as bits; and the smallest
/// and largest `s` with matter (the former above the latter where there is none).
pub fn matter_in_s(function: &TransferFunction) -> (u64, [f32; 2]) {
    let with_matter = |low: f64, high: f64| function.largest_sigma_t(low - S_SLACK, high + S_SLACK) > 0.0;
    let edge = |cell: u32| f64::from(cell) / f64::from(MATTER_CELLS);
    let cells = (0..MATTER_CELLS).filter(|&cell| with_matter(edge(cell), edge(cell + 1)));
    let points = &function.points;
    let pieces = || points.windows(2).filter(|piece| piece.iter().any(|point| point.sigma_t > 0.0));
    let ends = |index: usize| points.get(index).filter(|point| point.sigma_t > 0.0);
    let low = ends(0).map(|_| 0.0).or(pieces().next().map(|piece| piece[0].s));
    let last = ends(points.len().wrapping_sub(1)).map(|_| 1.0);
    let high = last.or(pieces().next_back().map(|piece| piece[1].s));
    let range = [low.map_or(2.0, |s| s - S_SLACK), high.map_or(-1.0, |s| s + S_SLACK)];
    (cells.fold(0, |mask, cell| mask | 1 << cell), range.map(|s| s as f32))
}

pub fn materials(scene: &Scene) -> Vec<uniforms::Material> {
    scene.materials.iter().map(material).collect()
}

fn material(material: &scene::material::Material) -> uniforms::Material {
    let (phase, asymmetry) = match &material.phase {
        Phase::Isotropic => (0, 0.0),
        Phase::HenyeyGreenstein(p) => (1, p.g),
        Phase::Schlick(p) => (2, p.k),
    };
    let (brdf, diffuse, specular, lobe) = match &material.brdf {
        None => (0, 0.0, 0.0, [0.0; 2]),
        Some(Brdf::Lambert(b)) => (0, b.diffuse, 0.0, [0.0; 2]),
        Some(Brdf::BlinnPhong(b)) => {
            (1, b.diffuse, b.specular, [b.exponent, blinn_phong_normalisation(b.exponent)])
        }
        Some(Brdf::AshikhminShirley(b)) => (2, b.diffuse, b.specular, b.exponents),
        Some(Brdf::Abc(b)) => (3, b.diffuse, b.a, [b.b, b.c]),
    };
    let ambient = ambient_reflectance(material);
    let (lobe_mass, lobe_reflectance) = match &material.brdf {
        None | Some(Brdf::Lambert(_)) => (1.0, 0.0),
        Some(Brdf::BlinnPhong(b)) => (1.0, b.specular),
        // Fresnel: grazing reflection exceeds the reflectance at normal incidence.
        Some(Brdf::AshikhminShirley(b)) => (1.0, b.specular.max(0.05)),
        // Solid angles are 4 cos larger for directions than for half vectors.
        Some(Brdf::Abc(b)) => {
            let mass = abc_mass(b.b, b.c);
            (mass, 8.0 * PI * b.a * mass)
        }
    };
    uniforms::Material {
        phase,
        asymmetry: asymmetry as f32,
        surface: material.surface as f32,
        brdf,
        ambient_diffuse: ambient.x as f32,
        ambient_specular: ambient.y as f32,
        diffuse: diffuse as f32,
        specular: specular as f32,
        lobe: lobe.map(|x| x as f32),
        lobe_mass: lobe_mass as f32,
        lobe_reflectance: lobe_reflectance as f32,
        bands: bands(material),
    }
}

/// Factors of spherical-harmonic bands: six of the phase function, six of the specular lobe.
fn bands(material: &scene::material::Material) -> [[f32; 4]; 3] {
    let phase = sh::phase_bands(&material.phase);
    let specular = sh::specular_bands(material.brdf.as_ref());
    let factor = |i: usize| (if i < sh::MAX_BANDS { phase[i] } else { specular[i - sh::MAX_BANDS] }) as f32;
    [0, 4, 8].map(|first| [0, 1, 2, 3].map(|i| factor(first + i)))
}

/// Integral of `(1 + b y)^-c` over y from 0 to 1.
fn abc_mass(b: f64, c: f64) -> f64 {
    let log = b.ln_1p();
    let scaled = if b < 1e-12 { 1.0 } else { log / b };
    let x = (1.0 - c) * log;
    if x.abs() < 1e-12 { scaled } else { scaled * x.exp_m1() / x }
}

/// Lights as the path tracer samples them, environments included; of unit power where what each of
/// them brings is kept apart.
pub fn sources(scene: &Scene) -> Vec<uniforms::Source> {
    let in_layers = scene.has_light_layers();
    let power = |light: &Light| if in_layers { DVec3::ONE } else { light.power };
    scene.lights.iter().map(|light| source(light, power(light))).collect()
}

/// One of [`sources`], of the given power.
pub fn source(light: &Light, power: DVec3) -> uniforms::Source {
    let base = uniforms::Source { power: vector(power), ..uniforms::Source::default() };
    match &light.geometry {
        LightGeometry::Directional { direction } => {
            uniforms::Source { kind: 0, direction: vector(*direction), ..base }
        }
        LightGeometry::Point { position } => {
            uniforms::Source { kind: 1, position: vector(*position), ..base }
        }
        LightGeometry::Spot { position, direction, cos_inner, cos_outer } => uniforms::Source {
            kind: 2,
            position: vector(*position),
            direction: vector(*direction),
            cos_inner: *cos_inner as f32,
            cos_outer: *cos_outer as f32,
            ..base
        },
        LightGeometry::Rectangle { center, normal, up, size } => uniforms::Source {
            kind: 3,
            position: vector(*center),
            direction: vector(*normal),
            extent: (size[0] * size[1]) as f32,
            half_u: vector(0.5 * size[0] * up.cross(*normal)),
            half_v: vector(0.5 * size[1] * *up),
            ..base
        },
        LightGeometry::Disk { center, normal, radius } => uniforms::Source {
            kind: 4,
            position: vector(*center),
            direction: vector(*normal),
            extent: (PI * radius * radius) as f32,
            half_u: vector(DVec3::X * *radius),
            ..base
        },
        LightGeometry::Sphere { center, radius } => {
            uniforms::Source { kind: 5, position: vector(*center), extent: *radius as f32, ..base }
        }
        LightGeometry::UniformEnvironment => uniforms::Source { kind: 6, ..base },
        LightGeometry::Environment { .. } => uniforms::Source { kind: 7, ..base },
    }
}

/// Lights but environments: a uniform one is a single colour (see [`ambient`]), images are refused
/// (see [`crate::check`]).
pub fn lights(scene: &Scene) -> Vec<uniforms::Light> {
    let in_slots = by_slot(scene);
    let slot = |id: &str| in_slots.iter().position(|light| light.id == id).unwrap_or(0) as u32;
    let with_slot = |of: &Light| light(of).map(|table| uniforms::Light { slot: slot(&of.id), ..table });
    of_table(scene).iter().filter_map(with_slot).collect()
}

/// Lights of the table, in the scene's order: those with an extent in parts, where nodes hold what each
/// part brings.
fn of_table(scene: &Scene) -> Vec<Light> {
    let lights = scene.lights.iter().filter(|light| is_in_light_table(light)).cloned().collect();
    match scene.illumination.method {
        Method::PhotonMap | Method::ImageBased => in_parts(scene, lights),
        _ => lights,
    }
}

/// Lights of the table of [`lights`] as fields of direct light hold them: in the order of their names, so
/// that another order of lights is the same field.
pub fn by_slot(scene: &Scene) -> Vec<Light> {
    let mut lights = of_table(scene);
    lights.sort_by(|a, b| a.id.cmp(&b.id));
    lights
}

/// Whether a light is in the table of [`lights`]: one that shines from one direction on each place.
pub fn is_in_light_table(light: &Light) -> bool {
    !light.is_environment()
}

/// Radiance of the uniform environment, black without one.
pub fn ambient(scene: &Scene) -> DVec3 {
    let uniform = scene.lights.iter().filter(|light| light.geometry == LightGeometry::UniformEnvironment);
    uniform.map(|light| light.power).sum()
}

/// A light but environments.
pub fn light(light: &Light) -> Option<uniforms::Light> {
    let base = uniforms::Light { power: vector(light.power), ..uniforms::Light::default() };
    let table = match light.geometry {
        LightGeometry::UniformEnvironment | LightGeometry::Environment { .. } => return None,
        LightGeometry::Directional { direction } => {
            uniforms::Light { kind: 0, direction: vector(direction), ..base }
        }
        LightGeometry::Point { position } => uniforms::Light { kind: 1, position: vector(position), ..base },
        LightGeometry::Spot { position, direction, cos_inner, cos_outer } => uniforms::Light {
            kind: 2,
            position: vector(position),
            direction: vector(direction),
            cos_inner: cos_inner as f32,
            cos_outer: cos_outer as f32,
            ..base
        },
        LightGeometry::Rectangle { center, normal, size, .. } => uniforms::Light {
            kind: 3,
            position: vector(center),
            direction: vector(normal),
            extent: (size[0] * size[1]) as f32,
            ..base
        },
        LightGeometry::Disk { center, normal, radius } => uniforms::Light {
            kind: 3,
            position: vector(center),
            direction: vector(normal),
            extent: (PI * radius * radius) as f32,
            ..base
        },
        LightGeometry::Sphere { center, radius } => {
            uniforms::Light { kind: 4, position: vector(center), extent: radius as f32, ..base }
        }
    };
    Some(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::transfer_function::Point;

    fn function(points: &[(f64, f64)]) -> TransferFunction {
        let point = |&(s, sigma_t): &(f64, f64)| Point {
            s,
            sigma_t,
            albedo: DVec3::ONE,
            emission: DVec3::ZERO,
            material: 0,
        };
        TransferFunction { points: points.iter().map(point).collect() }
    }

    /// The mean over a way in s, as `mean_extinction` in shaders/direct_light/look_up.wgsl has it.
    #[test]
    fn cells_know_what_extinction_integrates_to() {
        let functions = [
            function(&[(0.0, 0.0), (0.16, 0.0), (0.42, 260.0), (1.0, 400.0)]),
            // Jumps, down, too, on an edge and within a cell; thin matter above dense.
            function(&[(0.25, 1e6), (0.25, 2.0), (0.3, 0.0), (0.5003, 0.0), (0.5003, 9.0), (0.9, 1e-3)]),
            function(&[(1.0, 7.0)]),
        ];
        for function in &functions {
            let texels = transfer_function_cells(function);
            let integral = |s: f64| {
                let cell = ((s * TRANSFER_FUNCTION_CELLS as f64) as usize).min(TRANSFER_FUNCTION_CELLS - 1);
                let [line, sum, rest] =
                    [0, 1, 2].map(|row| texels[row * TRANSFER_FUNCTION_CELLS + cell].map(f64::from));
                let ds = s - cell as f64 / TRANSFER_FUNCTION_CELLS as f64;
                let within = if s < sum[2] {
                    ds * (line[0] + 0.5 * line[1] * ds)
                } else {
                    rest[2] + (s - sum[2]) * (rest[0] + 0.5 * rest[1] * (s - sum[2]))
                };
                sum[0] + sum[1] + within
            };
            let mut expected = 0.0;
            for i in 0..20_000 {
                let [low, high] = [i, i + 1].map(|i| f64::from(i) / 20_000.0);
                expected += function.integral(low, high);
                let off = (integral(high) - expected).abs();
                assert!(
                    off <= 1e-6 * function.at(high).sigma_t + 1e-9 * expected + 1e-9,
                    "{function:?}: {high}, {off}"
                );
            }
        }
    }

    #[test]
    fn no_matter_lies_outside_of_its_cells_and_range() {
        let functions = [
            function(&[(0.0, 0.0), (0.16, 0.0), (0.42, 260.0), (1.0, 400.0)]),
            function(&[(0.2, 3.0), (0.3, 0.0), (0.5, 0.0), (0.5, 9.0), (0.501, 9.0), (0.501, 0.0)]),
            function(&[(0.3, 0.0), (0.7, 1e-3), (0.71, 0.0), (0.9, 0.0), (0.95, 2.0)]),
            function(&[(0.4, 0.0)]),
            function(&[(0.4, 1.0)]),
        ];
        for function in &functions {
            let (cells, [low, high]) = matter_in_s(function);
            let mut used = 0;
            for i in 0..=100_000 {
                let s = f64::from(i) / 1e5;
                if function.at(s).sigma_t > 0.0 {
                    let cell = ((s * f64::from(MATTER_CELLS)) as u32).min(MATTER_CELLS - 1);
                    used |= 1 << cell;
                    assert!(cells >> cell & 1 == 1, "{function:?}: cell of {s}");
                    assert!((low..=high).contains(&(s as f32)), "{function:?}: {s} outside {low}..{high}");
                }
            }
            // No more than cells that matter touches from outside.
            assert!(cells & !(used | used << 1 | used >> 1) == 0, "{function:?}: {cells:x} for {used:x}");
        }
        assert!(matter_in_s(&functions[3]).0 == 0);
    }
}
