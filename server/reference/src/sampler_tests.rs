//! Every sampler against its density: counts in cells of the sphere by chi-square, and the weight
//! of samples against integrals.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use proto::scene_file::{Abc, AshikhminShirley, BlinnPhong, Brdf, HenyeyGreenstein, Lambert, Phase, Schlick};
use scene::light::LightGeometry;
use scene::{EnvironmentImage, Light};

use crate::environment::Environment;
use crate::light::Source;
use crate::random::Random;
use crate::region::Ray;
use crate::statistics::chi_square_of_counts;
use crate::{brdf, phase};

const SAMPLES: u32 = 100_000;
/// Cells of the sphere: in the cosine and in azimuth.
const CELLS: [usize; 2] = [12, 16];
/// Points along each axis of a cell: for smooth densities, and for those with edges.
const SMOOTH: usize = 32;
const EDGES: usize = 160;
/// A right sampler fails one test in a thousand; seeds are fixed.
const LEVEL: f64 = 1e-3;

fn cell_of(w: DVec3) -> usize {
    let ring = ((0.5 * (w.z + 1.0) * CELLS[0] as f64) as usize).min(CELLS[0] - 1);
    let turn = w.y.atan2(w.x).rem_euclid(2.0 * PI) / (2.0 * PI);
    ring * CELLS[1] + ((turn * CELLS[1] as f64) as usize).min(CELLS[1] - 1)
}

/// Probability of counts as uneven as these, if `pdf` is the density of `sample`. Samples that are
/// `None` make a cell of their own, which must hold what the density leaves.
fn p_of(points: usize, sample: impl Fn(&mut Random) -> Option<DVec3>, pdf: impl Fn(DVec3) -> f64) -> f64 {
    let cells = CELLS[0] * CELLS[1];
    let mut counts = vec![0.0; cells + 1];
    let mut random = Random::new(5, 0, 0);
    for _ in 0..SAMPLES {
        counts[sample(&mut random).map_or(cells, cell_of)] += 1.0;
    }
    let mut expected = vec![0.0; cells + 1];
    let middle = |k: usize, count: usize| (k as f64 + 0.5) / count as f64;
    let size = [CELLS[0] * points, CELLS[1] * points];
    for ring in 0..size[0] {
        let z = 2.0 * middle(ring, size[0]) - 1.0;
        for sector in 0..size[1] {
            let (sin, cos) = (2.0 * PI * middle(sector, size[1])).sin_cos();
            let w = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let share = 4.0 * PI / (size[0] * size[1]) as f64;
            expected[ring / points * CELLS[1] + sector / points] += f64::from(SAMPLES) * pdf(w) * share;
        }
    }
    let inside: f64 = expected.iter().sum();
    expected[cells] = (f64::from(SAMPLES) - inside).max(0.0);
    chi_square_of_counts(&counts, &expected)
}

fn assert_samples(
    what: &str,
    points: usize,
    sample: impl Fn(&mut Random) -> Option<DVec3>,
    pdf: impl Fn(DVec3) -> f64,
) {
    let p = p_of(points, sample, pdf);
    assert!(p > LEVEL, "{what}: p = {p}");
}

fn phases() -> Vec<Phase> {
    let hg = |g| Phase::HenyeyGreenstein(HenyeyGreenstein { g });
    let schlick = |k| Phase::Schlick(Schlick { k });
    vec![Phase::Isotropic, hg(0.6), hg(-0.4), hg(0.0), hg(5e-5), schlick(0.7), schlick(-0.3), schlick(0.0)]
}

fn surfaces() -> Vec<Brdf> {
    let blinn_phong = |exponent| Brdf::BlinnPhong(BlinnPhong { diffuse: 0.4, specular: 0.5, exponent });
    let ashikhmin =
        |exponents| Brdf::AshikhminShirley(AshikhminShirley { diffuse: 0.6, specular: 0.3, exponents });
    let abc = |a, b, c| Brdf::Abc(Abc { diffuse: 0.2, a, b, c });
    vec![
        Brdf::Lambert(Lambert { diffuse: 0.8 }),
        blinn_phong(0.0),
        blinn_phong(20.0),
        ashikhmin([8.0, 8.0]),
        ashikhmin([5.0, 40.0]),
        ashikhmin([0.0, 0.0]),
        abc(0.3, 20.0, 1.5),
        abc(0.3, 20.0, 1.0),
        abc(0.3, 0.0, 2.0),
    ]
}

#[test]
fn phase_functions_are_sampled_as_they_are() {
    let travel = DVec3::new(0.3, -0.5, 0.7).normalize();
    for phase in phases() {
        assert_samples(
            &format!("{phase:?}"),
            SMOOTH,
            |random| Some(phase::sample(&phase, travel, random.pair())),
            |w| phase::pdf(&phase, w.dot(travel)),
        );
        // Moments: the whole is 1, and g is the mean cosine of Henyey-Greenstein.
        let count = 100_000;
        let cosine = |i: i32| (f64::from(i) + 0.5) / f64::from(count) * 2.0 - 1.0;
        let moment = |n: i32| -> f64 {
            let terms = (0..count).map(|i| phase::value(&phase, cosine(i)) * cosine(i).powi(n));
            4.0 * PI * terms.sum::<f64>() / f64::from(count)
        };
        assert!((moment(0) - 1.0).abs() < 1e-6, "{phase:?}");
        if let Phase::HenyeyGreenstein(p) = &phase {
            assert!((moment(1) - p.g).abs() < 1e-6, "{phase:?}");
        }
    }
}

#[test]
fn a_wrong_sign_of_g_is_noticed() {
    let (right, wrong) = (HenyeyGreenstein { g: 0.3 }, HenyeyGreenstein { g: -0.3 });
    let (right, wrong) = (Phase::HenyeyGreenstein(right), Phase::HenyeyGreenstein(wrong));
    let p = p_of(
        SMOOTH,
        |random| Some(phase::sample(&right, DVec3::X, random.pair())),
        |w| phase::pdf(&wrong, w.dot(DVec3::X)),
    );
    assert!(p < 1e-9, "{p}");
}

#[test]
fn surfaces_are_sampled_by_their_density() {
    let n = DVec3::new(0.2, 0.4, 0.8).normalize();
    for cos_o in [0.95f64, 0.4] {
        let w_o = crate::frame::around(n, cos_o, 0.7);
        for surface in surfaces() {
            assert_samples(
                &format!("{surface:?} {cos_o}"),
                SMOOTH,
                |random| brdf::sample(&surface, 0.9, n, w_o, random.unit(), random.pair()),
                |w| brdf::pdf(&surface, 0.9, n, w, w_o),
            );
        }
    }
}

#[test]
fn surface_samples_weigh_what_surfaces_reflect() {
    let n = DVec3::Z;
    let w_o = crate::frame::around(n, 0.6, 0.2);
    for surface in surfaces() {
        let reflected = |w: DVec3| brdf::value(&surface, n, w, w_o).element_sum() * w.z.max(0.0);
        let (mut sum, mut squares) = (0.0, 0.0);
        let mut random = Random::new(9, 0, 0);
        for _ in 0..SAMPLES {
            let w = brdf::sample(&surface, 1.0, n, w_o, random.unit(), random.pair());
            let weight = w.map_or(0.0, |w| reflected(w) / brdf::pdf(&surface, 1.0, n, w, w_o));
            sum += weight;
            squares += weight * weight;
        }
        let mean = sum / f64::from(SAMPLES);
        let se = ((squares / f64::from(SAMPLES) - mean * mean).max(0.0) / f64::from(SAMPLES)).sqrt();
        let size = 1000;
        let mut exact = 0.0;
        for k in 0..size * size {
            let at = |i: i32| (f64::from(i) + 0.5) / f64::from(size);
            let w = crate::frame::around(n, at(k / size), 2.0 * PI * at(k % size));
            exact += 2.0 * PI * reflected(w) / f64::from(size * size);
        }
        assert!((mean - exact).abs() < 4.5 * se + 1e-4, "{surface:?}: {mean} +- {se}, {exact}");
    }
}

#[test]
fn light_from_behind_a_surface_is_not_reflected() {
    for surface in surfaces() {
        let w_o = DVec3::new(0.6, 0.0, 0.8);
        assert_eq!(brdf::value(&surface, DVec3::Z, DVec3::new(0.8, 0.0, -0.6), w_o).element_sum(), 0.0);
    }
}

/// The shaders' formulas are mirrored in `scene`; this crate wrote them anew.
#[test]
fn two_writings_of_one_formula_agree() {
    let mut random = Random::new(8, 0, 0);
    for _ in 0..2000 {
        let n = crate::frame::on_sphere(random.pair());
        let [w_i, w_o] = [0, 1].map(|_| {
            let w = crate::frame::on_sphere(random.pair());
            if w.dot(n) < 0.0 { -w } else { w }
        });
        // There cosines of the eye are held at 1e-4, which is no part of the formula.
        if n.dot(w_o) < 1e-3 {
            continue;
        }
        for surface in surfaces() {
            let (ours, theirs) =
                (brdf::value(&surface, n, w_i, w_o), scene::scattering::brdf(&surface, n, w_i, w_o));
            assert!(
                (ours - theirs).length() <= 1e-9 * (1.0 + theirs.length()),
                "{surface:?} {ours} {theirs}"
            );
        }
        for phase in phases() {
            let (ours, theirs) =
                (phase::value(&phase, w_i.dot(w_o)), scene::scattering::phase_function(&phase, w_i.dot(w_o)));
            assert!((ours / theirs - 1.0).abs() < 1e-9, "{phase:?}");
        }
    }
}

/// A picture with a bright spot, a dark half and colours.
fn picture() -> Arc<EnvironmentImage> {
    let (width, height) = (16, 8);
    let texel = |i: usize| match (i % width, i / width) {
        (11, 2) => [40.0, 30.0, 20.0],
        (x, y) if x < 6 => [0.0, 0.1 * y as f32, 0.0],
        (x, _) => [0.5, 0.2, 0.1 * x as f32],
    };
    let rgb: Vec<f32> = (0..width * height).flat_map(texel).collect();
    Arc::new(EnvironmentImage::new(width, height, &rgb).unwrap())
}

#[test]
fn environments_are_sampled_by_their_density() {
    let turned = DMat3::from_rotation_x(1.0) * DMat3::from_rotation_y(0.4);
    let environment = Environment::new(&picture(), turned, DVec3::ONE);
    assert_samples("image", EDGES, |r| environment.sample(r.pair()).map(|(w, _)| w), |w| environment.pdf(w));
    let mut random = Random::new(2, 0, 0);
    for _ in 0..10_000 {
        let (w, pdf) = environment.sample(random.pair()).unwrap();
        assert!((environment.pdf(w) / pdf - 1.0).abs() < 1e-6);
    }
    // Wherever there is light there is density.
    for _ in 0..10_000 {
        let w = crate::frame::on_sphere(random.pair());
        assert!(environment.pdf(w) > 0.0 || environment.radiance(w) == DVec3::ZERO, "{w}");
    }
}

fn sources() -> Vec<(&'static str, Source)> {
    let light = |geometry| Source::new(&Light { id: "l".into(), index: 0, geometry, power: DVec3::ONE });
    let center = DVec3::new(0.1, 0.9, 0.4);
    let normal = DVec3::new(0.2, -0.9, -0.3).normalize();
    let up = (DVec3::X - normal * normal.x).normalize();
    vec![
        ("rectangle", light(LightGeometry::Rectangle { center, normal, up, size: [1.5, 0.7] })),
        ("disk", light(LightGeometry::Disk { center, normal, radius: 0.8 })),
        ("sphere", light(LightGeometry::Sphere { center, radius: 0.5 })),
        ("uniform", light(LightGeometry::UniformEnvironment)),
        ("image", light(LightGeometry::Environment { image: picture(), world_from_map: DMat3::IDENTITY })),
    ]
}

#[test]
fn lights_are_sampled_by_the_density_a_ray_meets() {
    let x = DVec3::new(0.2, -0.1, 0.0);
    for (name, source) in sources() {
        let met = |w: DVec3| source.meet(&Ray { origin: x, direction: w });
        assert_samples(
            name,
            EDGES,
            |random| source.sample(x, random.pair()).map(|towards| towards.w_i),
            |w| met(w).map_or(0.0, |met| met.pdf),
        );
        let mut random = Random::new(3, 0, 0);
        for _ in 0..10_000 {
            let towards = source.sample(x, random.pair()).unwrap();
            // A sample on the very edge may be missed by rounding.
            let Some(met) = met(towards.w_i) else { continue };
            assert!((met.pdf / towards.pdf.unwrap() - 1.0).abs() < 1e-6, "{name}");
            let weight = met.radiance / met.pdf;
            assert!((weight - towards.weight).length() <= 1e-6 * weight.length() + 1e-9, "{name}");
            assert!(met.distance == towards.distance || (met.distance / towards.distance - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn one_sided_lights_shine_to_one_side() {
    for (name, source) in sources() {
        // Beyond the rectangle and the disk; within the sphere.
        let behind = DVec3::new(0.1, 0.9, 0.4) + DVec3::new(0.0, 0.2, 0.05);
        let dark = source.sample(behind, [0.4, 0.6]).is_none();
        assert_eq!(dark, !matches!(name, "uniform" | "image"), "{name}");
        let towards = Ray { origin: behind, direction: -DVec3::Y };
        assert_eq!(source.meet(&towards).is_none(), dark, "{name}");
    }
}
