//! LDR-FLIP: how different two displayed pictures look side by side (Andersson, Nilsson,
//! Akenine-Möller, Oskarsson, Åström, Fairchild 2020, "FLIP: A Difference Evaluator for Alternating
//! Images").
//!
//! Colours are blurred as the eye blurs them at the viewing distance, compared in a perceptually
//! uniform space, and the difference is raised where edges or points of one picture are missing in
//! the other. 0: no difference, 1: the largest. Pictures are sRGB values, 0..1, rows from the top.

/// Pixels per degree of the viewer's field of view: a screen 0.7 m wide with 3840 pixels, seen from
/// 0.7 m, as in the paper.
pub const PIXELS_PER_DEGREE: f64 = 0.7 * (3840.0 / 0.7) * (std::f64::consts::PI / 180.0);

/// Exponent of the colour difference, q_c.
const COLOUR_EXPONENT: f64 = 0.7;
/// Colour differences up to this share of the largest, p_c, take the share p_t of the result.
const COLOUR_SHARE: f64 = 0.4;
const COLOUR_TARGET: f64 = 0.95;
/// Width of an edge that is seen, w, degrees.
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of the feature difference, q_f.
const FEATURE_EXPONENT: f64 = 0.5;
/// Standard deviations that a filter reaches.
const REACH: f64 = 3.0;
/// The contrast sensitivity of each opponent channel: a_1, b_1, a_2, b_2 of a sum of Gaussians.
const SENSITIVITY: [[f64; 4]; 3] =
    [[1.0, 0.0047, 0.0, 1e-5], [1.0, 0.0053, 0.0, 1e-5], [34.1, 0.04, 13.5, 0.025]];
/// Linear sRGB to CIE XYZ, D65.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

type Color = [f64; 3];

/// A picture of `width` columns.
struct Plane {
    width: usize,
    height: usize,
    pixels: Vec<Color>,
}

/// FLIP of each pixel, 0..1.
///
/// # Panics
/// The pictures have different sizes, or no pixels.
pub fn flip(reference: &[Color], test: &[Color], width: usize) -> Vec<f64> {
    assert!(width > 0 && reference.len() == test.len() && reference.len() >= width, "one size");
    let height = reference.len() / width;
    let opponent = |srgb: &[Color]| {
        let pixels = srgb.iter().map(|&pixel| opponent_from_xyz(xyz(pixel.map(linear)))).collect();
        Plane { width, height, pixels }
    };
    let (reference, test) = (opponent(reference), opponent(test));
    let colour = colour_difference(&reference, &test);
    let feature = feature_difference(&reference, &test);
    colour.iter().zip(&feature).map(|(colour, feature)| colour.powf(1.0 - feature)).collect()
}

/// The mean of [`flip`].
pub fn mean_flip(reference: &[Color], test: &[Color], width: usize) -> f64 {
    let all = flip(reference, test, width);
    all.iter().sum::<f64>() / all.len() as f64
}

/// Section 4.1: difference of the colours that the eye can tell apart, 0..1.
fn colour_difference(reference: &Plane, test: &Plane) -> Vec<f64> {
    let perceived = |plane: &Plane| -> Vec<Color> {
        let filtered = blurred(plane);
        filtered
            .into_iter()
            .map(|pixel| hunt(lab(xyz(rgb(xyz_from_opponent(pixel)).map(|x| x.clamp(0.0, 1.0))))))
            .collect()
    };
    let primary = |rgb: Color| hunt(lab(xyz(rgb)));
    let largest = hyab(primary([0.0, 1.0, 0.0]), primary([0.0, 0.0, 1.0])).powf(COLOUR_EXPONENT);
    let knee = COLOUR_SHARE * largest;
    let spread = |difference: f64| {
        if difference < knee {
            COLOUR_TARGET / knee * difference
        } else {
            COLOUR_TARGET + (difference - knee) / (largest - knee) * (1.0 - COLOUR_TARGET)
        }
    };
    let (reference, test) = (perceived(reference), perceived(test));
    reference.iter().zip(&test).map(|(&a, &b)| spread(hyab(a, b).powf(COLOUR_EXPONENT))).collect()
}

/// Each opponent channel through its contrast sensitivity. A sum of Gaussians is not separable, but
/// each of its terms is.
fn blurred(plane: &Plane) -> Vec<Color> {
    let widest = SENSITIVITY.iter().flat_map(|[_, b1, _, b2]| [*b1, *b2]).fold(0.0, f64::max);
    let pi = std::f64::consts::PI;
    let radius = (REACH * (widest / (2.0 * pi * pi)).sqrt() * PIXELS_PER_DEGREE).ceil() as i64;
    let gaussian = |b: f64| -> Vec<f64> {
        let at = |x: i64| (-(pi * x as f64 / PIXELS_PER_DEGREE).powi(2) / b).exp();
        (-radius..=radius).map(at).collect()
    };
    let mut result = vec![[0.0; 3]; plane.pixels.len()];
    for (channel, [a1, b1, a2, b2]) in SENSITIVITY.into_iter().enumerate() {
        let values: Vec<f64> = plane.pixels.iter().map(|pixel| pixel[channel]).collect();
        let mut weight = 0.0;
        for (a, b) in [(a1, b1), (a2, b2)].into_iter().filter(|(a, _)| *a > 0.0) {
            let kernel = gaussian(b);
            let amplitude = a * (pi / b).sqrt();
            weight += amplitude * kernel.iter().sum::<f64>().powi(2);
            let filtered = convolved(&values, plane.width, plane.height, &kernel, &kernel);
            result.iter_mut().zip(filtered).for_each(|(pixel, x)| pixel[channel] += amplitude * x);
        }
        result.iter_mut().for_each(|pixel| pixel[channel] /= weight);
    }
    result
}

/// Section 4.2: difference of edges and of points, 0..1.
fn feature_difference(reference: &Plane, test: &Plane) -> Vec<f64> {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (REACH * deviation).ceil() as i64;
    let gaussian = |x: i64| (-(x as f64).powi(2) / (2.0 * deviation * deviation)).exp();
    let kernel = |weight: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let raw: Vec<f64> = (-radius..=radius).map(|x| weight(x as f64) * gaussian(x)).collect();
        // Positive weights sum to 1, negative ones to -1.
        let positive: f64 = raw.iter().filter(|x| **x > 0.0).sum();
        let negative: f64 = raw.iter().filter(|x| **x < 0.0).map(|x| -x).sum();
        raw.iter()
            .map(|&x| if x > 0.0 { x / positive } else { x / negative.max(f64::MIN_POSITIVE) })
            .collect()
    };
    let smooth = kernel(&|_| 1.0);
    let edge = kernel(&|x| -x);
    let point = kernel(&|x| x * x / (deviation * deviation) - 1.0);
    let strength = |plane: &Plane, detector: &[f64]| -> Vec<f64> {
        let grey: Vec<f64> = plane.pixels.iter().map(|pixel| (pixel[0] + 16.0) / 116.0).collect();
        let across = convolved(&grey, plane.width, plane.height, detector, &smooth);
        let down = convolved(&grey, plane.width, plane.height, &smooth, detector);
        across.iter().zip(&down).map(|(x, y)| x.hypot(*y)).collect()
    };
    let difference = |detector: &[f64]| -> Vec<f64> {
        let (a, b) = (strength(reference, detector), strength(test, detector));
        a.iter().zip(&b).map(|(a, b)| (a - b).abs()).collect()
    };
    let (edges, points) = (difference(&edge), difference(&point));
    let both = |(edge, point): (&f64, &f64)| (edge.max(*point) / 2f64.sqrt()).powf(FEATURE_EXPONENT);
    edges.iter().zip(&points).map(both).collect()
}

/// A separable filter; pixels beyond the border repeat it.
fn convolved(values: &[f64], width: usize, height: usize, across: &[f64], down: &[f64]) -> Vec<f64> {
    let radius = (across.len() / 2) as i64;
    let filter = |kernel: &[f64], at: i64, count: usize, value: &dyn Fn(usize) -> f64| -> f64 {
        let place = |k: usize| (at + k as i64 - radius).clamp(0, count as i64 - 1) as usize;
        kernel.iter().enumerate().map(|(k, weight)| weight * value(place(k))).sum()
    };
    let mut rows = vec![0.0; values.len()];
    for (index, sum) in rows.iter_mut().enumerate() {
        let (x, y) = (index % width, index / width);
        *sum = filter(across, x as i64, width, &|x| values[y * width + x]);
    }
    (0..values.len())
        .map(|index| {
            let (x, y) = (index % width, index / width);
            filter(down, y as i64, height, &|y| rows[y * width + x])
        })
        .collect()
}

fn linear(srgb: f64) -> f64 {
    if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

fn times(matrix: [[f64; 3]; 3], v: Color) -> Color {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn xyz(rgb: Color) -> Color {
    times(XYZ_FROM_RGB, rgb)
}

/// By Cramer's rule.
fn rgb(xyz: Color) -> Color {
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(XYZ_FROM_RGB);
    [0, 1, 2].map(|column| {
        let mut replaced = XYZ_FROM_RGB;
        replaced.iter_mut().zip(xyz).for_each(|(row, x)| row[column] = x);
        determinant(replaced) / whole
    })
}

fn white() -> Color {
    xyz([1.0; 3])
}

/// The opponent space Y Cx Cz.
fn opponent_from_xyz(xyz: Color) -> Color {
    let white = white();
    let [x, y, z] = [0, 1, 2].map(|i| xyz[i] / white[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn xyz_from_opponent([luma, cx, cz]: Color) -> Color {
    let white = white();
    let y = (luma + 16.0) / 116.0;
    [(y + cx / 500.0) * white[0], y * white[1], (y - cz / 200.0) * white[2]]
}

/// CIE 1976 L*a*b*.
fn lab(xyz: Color) -> Color {
    const DELTA: f64 = 6.0 / 29.0;
    let white = white();
    let f = |t: f64| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i] / white[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The Hunt effect: colours look more colourful where it is brighter.
fn hunt([lightness, a, b]: Color) -> Color {
    [lightness, 0.01 * lightness * a, 0.01 * lightness * b]
}

fn hyab(a: Color, b: Color) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 32;
    const HEIGHT: usize = 24;

    /// Ramps and a pattern; the changed one has less contrast and a bar.
    fn pattern(changed: bool) -> Vec<Color> {
        let pixel = |index: usize| {
            let (x, y) = (index % WIDTH, index / WIDTH);
            let ramps = [x as f64 / (WIDTH - 1) as f64, y as f64 / (HEIGHT - 1) as f64];
            let third = ((x * 7 + y * 3) % 11) as f64 / 10.0;
            if !changed {
                return [ramps[0], ramps[1], third];
            }
            let bar = if (10..14).contains(&x) { 0.3 } else { 0.0 };
            [ramps[0] * 0.9 + 0.05, (ramps[1] + bar).min(1.0), third * 0.8]
        };
        (0..WIDTH * HEIGHT).map(pixel).collect()
    }

    /// What the authors' own program (version 1.7) gives for these pictures.
    #[test]
    fn agrees_with_the_authors_program() {
        let (a, b) = (pattern(false), pattern(true));
        let all = flip(&a, &b, WIDTH);
        let published = [
            ([0, 0], 0.303_495_5),
            ([12, 10], 0.966_323_6),
            ([31, 23], 0.342_987_6),
            ([5, 20], 0.437_163_8),
            ([14, 3], 0.450_171_5),
        ];
        for ([x, y], expected) in published {
            let found = all[y * WIDTH + x];
            assert!((found - expected).abs() < 2e-4, "({x}, {y}): {found}, expected {expected}");
        }
        assert!((mean_flip(&a, &b, WIDTH) - 0.445_379_5).abs() < 1e-4);
    }

    #[test]
    fn extremes() {
        let flat = |color: Color| vec![color; 256];
        let of = |a, b| mean_flip(&flat(a), &flat(b), 16);
        assert_eq!(mean_flip(&pattern(false), &pattern(false), WIDTH), 0.0);
        assert!((of([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]) - 1.0).abs() < 1e-9);
        assert!((of([0.0; 3], [1.0; 3]) - 0.967_391).abs() < 1e-4);
    }
}
