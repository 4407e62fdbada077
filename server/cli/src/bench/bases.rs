//! Suite `bases`: light from infinity in few functions. Checkerboards of known frequency and, where they
//! are at hand, real environments, in each basis and number of functions: how far the function is from
//! the map, and what it costs to make and to read. Needs no device.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::{DMat3, DVec3};
use scene::EnvironmentImage;
use scene::spherical::dsf::Dsf;
use scene::spherical::light_basis::LightBasis;
use scene::spherical::sh::Harmonics;
use scene::spherical::sky::{FINE_NSIDE, Sky};
use scene::spherical::srbf::Srbf;
use scene::spherical::{healpix, icosphere};
use serde_json::json;

use super::report::{Line, Table, columns, line_chart, rounded};

/// Squares along an edge of a cube's face.
const CHECKERS: [usize; 3] = [2, 4, 8];
/// Radiance of dark and bright squares.
const DARK_AND_BRIGHT: [f64; 2] = [0.1, 1.0];
/// Subdivisions of the icosahedron: 42, 162, 642, 2562 directions.
const SUBDIVISIONS: [usize; 4] = [1, 2, 3, 4];
/// Bands with about as many harmonics: 36, 169, 676.
const BANDS: [usize; 3] = [6, 13, 26];
/// Widths of the Gaussian that the published projection filters a map with; the last is the paper's.
const WIDTHS: [f64; 3] = [0.25, 0.5, 1.0];
/// Largest radiance of a map without suns.
const BRIGHTEST: f64 = 4.0;
/// Evaluations timed.
const EVALUATIONS: usize = 2000;

/// A basis under test.
struct Candidate {
    label: String,
    basis: LightBasis,
    /// Of a DSF: filtered as published.
    width: Option<f64>,
}

impl Candidate {
    fn project(&self, sky: &Sky) -> Vec<DVec3> {
        match (&self.basis, self.width) {
            (LightBasis::Dsf(dsf), Some(width)) => dsf.project_filtered(sky, DMat3::IDENTITY, width),
            (basis, _) => basis.project(sky, DMat3::IDENTITY),
        }
    }
}

pub fn run(out: &Path) -> anyhow::Result<()> {
    let mut table = Table {
        name: "bases",
        about: json!({
            "map": [healpix::pixel_count(FINE_NSIDE), "pixels of equal area"],
            "error": "root of the integral of the squared difference over the sphere, over that of the map, three channels",
            "without_suns": format!("environments cut off at {BRIGHTEST} times their mean"),
            "threads": rayon::current_num_threads(),
        }),
        columns: columns(&[
            "map",
            "basis",
            "functions",
            "error_percent",
            "mean_error_percent",
            "lowest_radiance",
            "projection_ms",
            "evaluation_us",
        ]),
        rows: Vec::new(),
    };
    let candidates = candidates();
    let mut lines: Vec<Line> = Vec::new();
    for (map, sky) in maps()? {
        for candidate in &candidates {
            let began = Instant::now();
            let coefficients = candidate.project(&sky);
            let projection = began.elapsed().as_secs_f64() * 1e3;
            let found = compared(&candidate.basis, &coefficients, &sky);
            let began = Instant::now();
            let directions: Vec<DVec3> = healpix::centres(FINE_NSIDE);
            let stride = directions.len() / EVALUATIONS;
            let sum: DVec3 = (0..EVALUATIONS)
                .map(|i| candidate.basis.evaluate(&coefficients, directions[i * stride]))
                .sum();
            let evaluation = began.elapsed().as_secs_f64() * 1e6 / EVALUATIONS as f64;
            anyhow::ensure!(sum.is_finite(), "{}: not finite", candidate.label);
            table.rows.push(vec![
                json!(map),
                json!(candidate.label),
                json!(candidate.basis.count()),
                rounded(100.0 * found.error),
                rounded(100.0 * found.mean),
                rounded(found.lowest),
                rounded(projection),
                rounded(evaluation),
            ]);
            // The other widths would hide what is compared.
            if candidate.width.is_none() {
                let label = format!("{map}: {}", candidate.basis.name());
                let point = (candidate.basis.count() as f64, 100.0 * found.error);
                match lines.iter_mut().find(|line| line.label == label) {
                    Some(line) => line.points.push(point),
                    None => lines.push(Line { label, points: vec![point] }),
                }
            }
        }
    }
    table.write(out)?;
    let path = out.join("bases.svg");
    line_chart(&path, "error of light in few functions", "functions", "error, per cent", &lines)
}

fn candidates() -> Vec<Candidate> {
    let mut candidates = Vec::new();
    for subdivisions in SUBDIVISIONS {
        let dsf = Dsf::new(subdivisions);
        let basis = LightBasis::Dsf(dsf.clone());
        candidates.push(Candidate { label: "DSF".into(), basis, width: None });
        for width in WIDTHS {
            let label = match width {
                1.0 => "DSF, filter 1 (as published)".to_owned(),
                _ => format!("DSF, filter {width}"),
            };
            candidates.push(Candidate { label, basis: LightBasis::Dsf(dsf.clone()), width: Some(width) });
        }
    }
    for subdivisions in SUBDIVISIONS {
        let basis = LightBasis::Srbf(Srbf::new(subdivisions));
        candidates.push(Candidate { label: "SRBF".into(), basis, width: None });
    }
    for bands in BANDS {
        let basis = LightBasis::Harmonics(Harmonics::new(bands));
        candidates.push(Candidate { label: "SH".into(), basis, width: None });
    }
    candidates
}

/// How a function differs from the map.
struct Difference {
    /// Relative L2.
    error: f64,
    /// Of the mean, relative.
    mean: f64,
    /// Smallest value of any channel.
    lowest: f64,
}

fn compared(basis: &LightBasis, coefficients: &[DVec3], sky: &Sky) -> Difference {
    use rayon::prelude::*;
    let solid_angle = healpix::solid_angle(FINE_NSIDE);
    let centres = healpix::centres(FINE_NSIDE);
    let values: Vec<DVec3> = centres.par_iter().map(|&w| basis.evaluate(coefficients, w)).collect();
    let (mut squared, mut all, mut lowest, mut sum) = (0.0, 0.0, f64::MAX, DVec3::ZERO);
    for (value, flux) in values.iter().zip(sky.coarser(FINE_NSIDE)) {
        let truth = flux / solid_angle;
        squared += (*value - truth).length_squared();
        all += truth.length_squared();
        lowest = lowest.min(value.min_element());
        sum += *value * solid_angle;
    }
    let (found, wanted) = (sum.element_sum(), sky.total().element_sum());
    Difference { error: (squared / all).sqrt(), mean: found / wanted - 1.0, lowest }
}

/// Checkerboards, and the environments at hand, each whole and without its suns.
fn maps() -> anyhow::Result<Vec<(String, Sky)>> {
    let mut maps: Vec<(String, Sky)> = CHECKERS
        .iter()
        .map(|&squares| {
            (format!("checkers, {squares} a cube edge"), Sky::from_function(|w| checkers(w, squares)))
        })
        .collect();
    // A smooth one: a broad lobe about one direction.
    let towards = icosphere::Icosphere::new(0).vertices[1];
    maps.push((
        "smooth lobe".into(),
        Sky::from_function(|w| DVec3::splat(0.2 + (2.0 * (w.dot(towards) - 1.0)).exp())),
    ));
    let data =
        std::env::var_os("TYNDALL_TEST_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    for file in ["studio.exr", "city.exr", "forest.exr", "studio_small_08_1k.hdr"] {
        let path = data.join("environments").join(file);
        if !path.exists() {
            eprintln!("left out: {file} is not at hand (TYNDALL_TEST_DATA)");
            continue;
        }
        let read = formats::read_environment(&path, &formats::Limits::default())?;
        let image = EnvironmentImage::new(read.width, read.height, &read.rgb)?;
        let whole = Sky::of(&image);
        let most =
            BRIGHTEST * whole.total().element_sum() / (3.0 * 4.0 * PI) * healpix::solid_angle(FINE_NSIDE);
        let cut = whole.limited(DVec3::splat(most));
        let name = file.split('.').next().unwrap_or(file);
        maps.push((name.to_owned(), whole));
        maps.push((format!("{name}, without suns"), cut));
    }
    Ok(maps)
}

/// A cube's faces in squares, seen from its middle.
fn checkers(w: DVec3, squares: usize) -> DVec3 {
    let size = w.abs().max_element();
    let place = (w / size + 1.0) * (0.5 * squares as f64);
    let square = |x: f64| (x as usize).min(squares - 1);
    // On a face its own coordinate is at one end: 0 or squares - 1.
    let sum = square(place.x) + square(place.y) + square(place.z);
    DVec3::splat(DARK_AND_BRIGHT[sum % 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_half_dark_and_errors_are_seen() {
        let sky = Sky::from_function(|w| checkers(w, 4));
        assert!((sky.total().x / (4.0 * PI) - 0.55).abs() < 1e-3);
        let dsf = LightBasis::Dsf(Dsf::new(1));
        let grey = vec![DVec3::splat(0.55); dsf.count()];
        // Half a contrast off everywhere.
        let expected = 0.45 / (0.5_f64 * (0.01 + 1.0)).sqrt();
        let found = compared(&dsf, &grey, &sky);
        assert!((found.error / expected - 1.0).abs() < 0.01, "{}", found.error);
        assert!(found.mean.abs() < 1e-3 && (found.lowest - 0.55).abs() < 1e-9);
    }
}
