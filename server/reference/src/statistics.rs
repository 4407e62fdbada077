//! Comparing estimated pictures: whether they agree, and by how much they differ.
//!
//! Pictures are slices of pixels with three channels; errors of different pixels are taken as
//! independent, those of one pixel's channels are not.

use std::f64::consts::SQRT_2;

/// Differences up to this share of the root mean square of both pictures are rounding of f32, not
/// error: it is added to the standard errors.
const ROUNDING: f64 = 1e-7;

/// Pixels of a picture.
pub type Pixels<'a> = &'a [[f64; 3]];

/// Whether two estimates may be of one picture. Each `p` is the probability of a difference as
/// large or larger if they are, with the number of tests made taken into account.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZTest {
    /// Largest `|a - b| / sqrt(se_a^2 + se_b^2)`.
    pub worst_z: f64,
    /// Pixel and channel of it.
    pub worst_at: [usize; 2],
    /// Of the worst z (Sidak over pixels and channels).
    pub p_worst: f64,
    /// Mean of the z^2 of the worst channel; 1 is expected. Pixels that are equal and without
    /// error in both pictures are left out.
    pub mean_square: f64,
    /// Of the sum of z^2 (chi-square; Bonferroni over channels).
    pub p_mean_square: f64,
    /// Difference of the means of all pixels over its standard error, in the worst channel.
    pub mean_z: f64,
    /// Of that difference (Bonferroni over channels).
    pub p_mean: f64,
}

impl ZTest {
    /// Whether none of the three tests says, at `level` together, that the pictures differ.
    pub fn passes(&self, level: f64) -> bool {
        self.p_worst.min(self.p_mean_square).min(self.p_mean) * 3.0 >= level
    }
}

/// Compares two independent estimates. A formula's standard errors are 0.
///
/// Standard errors must come from enough samples for means to be normal: hundreds for a smooth
/// integrand, more where rare paths are bright. No pixels at all agree.
///
/// # Panics
/// The slices have different lengths.
pub fn z_test_image(a_mean: Pixels, a_se: Pixels, b_mean: Pixels, b_se: Pixels) -> ZTest {
    let count = a_mean.len();
    assert!([a_se.len(), b_mean.len(), b_se.len()] == [count; 3], "pictures of one size");
    let squares: f64 = a_mean.iter().chain(b_mean).flatten().map(|x| x * x).sum();
    let rounding = ROUNDING * (squares / (6 * count.max(1)) as f64).sqrt();
    let mut test = ZTest {
        worst_z: 0.0,
        worst_at: [0, 0],
        p_worst: 1.0,
        mean_square: 0.0,
        p_mean_square: 1.0,
        mean_z: 0.0,
        p_mean: 1.0,
    };
    for channel in 0..3 {
        let (mut sum_of_squares, mut difference_sum, mut variance_sum) = (0.0, 0.0, 0.0);
        let mut uncertain = 0;
        for pixel in 0..count {
            let difference = a_mean[pixel][channel] - b_mean[pixel][channel];
            let noise = a_se[pixel][channel].powi(2) + b_se[pixel][channel].powi(2);
            // Pixels that are equal and certain, such as black ones, say nothing about the errors.
            if difference == 0.0 && noise == 0.0 {
                continue;
            }
            uncertain += 1;
            let variance = noise + rounding * rounding;
            // What is not a number agrees with nothing.
            let z = if difference.is_nan() { f64::INFINITY } else { difference.abs() / variance.sqrt() };
            if z > test.worst_z {
                (test.worst_z, test.worst_at) = (z, [pixel, channel]);
            }
            sum_of_squares += z * z;
            difference_sum += difference;
            variance_sum += variance;
        }
        if uncertain == 0 {
            continue;
        }
        let mean_square = sum_of_squares / f64::from(uncertain);
        if mean_square > test.mean_square {
            test.mean_square = mean_square;
            test.p_mean_square = (3.0 * chi_square_p(sum_of_squares, f64::from(uncertain))).min(1.0);
        }
        let mean_z = if difference_sum == 0.0 { 0.0 } else { difference_sum / variance_sum.sqrt() };
        if mean_z.is_nan() || mean_z.abs() > test.mean_z.abs() {
            (test.mean_z, test.p_mean) = (mean_z, (3.0 * normal_p(mean_z)).min(1.0));
        }
    }
    // 1 - (1 - p)^n without cancellation.
    let tests = (3 * count).max(1) as f64;
    test.p_worst = -(tests * (-normal_p(test.worst_z)).ln_1p()).exp_m1();
    test
}

/// How far a picture is from a reference that has an error of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Relative L2 error with what is owed to noise taken out:
    /// `sqrt((sum (x - r)^2 - se_x^2 - se_r^2) / (sum r^2 - se_r^2))`, 0 where noise exceeds it.
    pub relative_l2: f64,
    /// Standard error of `relative_l2`. An error below about twice this is not told from 0.
    pub uncertainty: f64,
    /// Mean of `x - r` over the mean of `r`: negative where the picture is too dark.
    pub bias: f64,
    /// Standard error of `bias`.
    pub bias_uncertainty: f64,
    /// 95th percentile over pixels of the length of `x - r` over the root mean square length of
    /// `r`; noise included.
    pub percentile_95: f64,
}

/// Compares a picture with a reference; standard errors that are not known, or are meant to count
/// as error, are 0.
///
/// # Panics
/// The slices have different lengths, or there are no pixels.
pub fn difference(mean: Pixels, se: Pixels, reference: Pixels, reference_se: Pixels) -> Difference {
    let count = mean.len();
    assert!([se.len(), reference.len(), reference_se.len()] == [count; 3] && count > 0, "one size");
    let (mut squares, mut squares_variance, mut power) = (0.0, 0.0, 0.0);
    let (mut sum, mut sum_variance, mut light) = (0.0, 0.0, 0.0);
    let mut lengths = Vec::with_capacity(count);
    for pixel in 0..count {
        let mut length_squared = 0.0;
        // Channels share their paths: their errors are taken as fully correlated.
        let (mut pixel_deviation, mut pixel_sum_deviation) = (0.0, 0.0);
        for channel in 0..3 {
            let (d, r) = (mean[pixel][channel] - reference[pixel][channel], reference[pixel][channel]);
            let reference_variance = reference_se[pixel][channel].powi(2);
            let variance = se[pixel][channel].powi(2) + reference_variance;
            squares += d * d - variance;
            power += r * r - reference_variance;
            // Of the square of a normal variable, whose mean square is estimated by d^2 - variance.
            let deviation = (4.0 * (d * d - variance).max(0.0) * variance + 2.0 * variance * variance).sqrt();
            pixel_deviation += deviation;
            pixel_sum_deviation += variance.sqrt();
            sum += d;
            light += r;
            length_squared += d * d;
        }
        squares_variance += pixel_deviation * pixel_deviation;
        sum_variance += pixel_sum_deviation * pixel_sum_deviation;
        lengths.push(length_squared.sqrt());
    }
    lengths.sort_by(f64::total_cmp);
    let percentile = lengths[((0.95 * count as f64).ceil() as usize).clamp(1, count) - 1];
    let power = power.max(f64::MIN_POSITIVE);
    let (squared, squared_uncertainty) = (squares / power, squares_variance.sqrt() / power);
    let relative_l2 = squared.max(0.0).sqrt();
    Difference {
        relative_l2,
        // Of a root: half the relative error of the square, but no more than the root of an error
        // that could as well be 0.
        uncertainty: (squared_uncertainty / (2.0 * relative_l2)).min(squared_uncertainty.sqrt()),
        bias: sum / light,
        bias_uncertainty: sum_variance.sqrt() / light.abs(),
        percentile_95: percentile / (power / count as f64).sqrt(),
    }
}

/// Probability that a normal variable lies farther from its mean than `z` standard deviations.
pub fn normal_p(z: f64) -> f64 {
    if z.is_nan() { 0.0 } else { libm::erfc(z.abs() / SQRT_2) }
}

/// Probability that a chi-square variable with `degrees` of freedom exceeds `x`.
pub fn chi_square_p(x: f64, degrees: f64) -> f64 {
    if x.is_nan() || x == f64::INFINITY {
        return 0.0;
    }
    upper_gamma(0.5 * degrees, 0.5 * x)
}

/// Outcomes that expect fewer counts than this are taken together.
const FEWEST_EXPECTED: f64 = 10.0;

/// Probability of counts as far from the expected ones, or farther, if those are right; 0 if there are
/// many where next to none are expected. Both have the same sum.
pub fn chi_square_of_counts(counts: &[f64], expected: &[f64]) -> f64 {
    let (mut rest, mut rest_expected) = (0.0, 0.0);
    let (mut sum, mut degrees) = (0.0, -1.0);
    for (count, expected) in counts.iter().zip(expected) {
        if *expected < FEWEST_EXPECTED {
            rest += count;
            rest_expected += expected;
        } else {
            sum += (count - expected).powi(2) / expected;
            degrees += 1.0;
        }
    }
    if rest_expected >= FEWEST_EXPECTED {
        sum += (rest - rest_expected).powi(2) / rest_expected;
        degrees += 1.0;
    } else if rest > rest_expected + 8.0 * (rest_expected + 1.0).sqrt() {
        return 0.0;
    }
    chi_square_p(sum, degrees)
}

/// The regularised upper incomplete gamma function: by its series below the mean, by its
/// continued fraction (Lentz's method) above.
fn upper_gamma(a: f64, x: f64) -> f64 {
    const MAX_TERMS: usize = 100_000;
    const CONVERGED: f64 = 1e-15;
    if x <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - libm::lgamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for k in 1..MAX_TERMS {
            term *= x / (a + k as f64);
            sum += term;
            if term < sum * CONVERGED {
                break;
            }
        }
        return (1.0 - scale * sum).clamp(0.0, 1.0);
    }
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / f64::MIN_POSITIVE;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for k in 1..MAX_TERMS {
        let k = k as f64;
        let numerator = -k * (k - a);
        b += 2.0;
        d = 1.0 / (numerator * d + b);
        c = b + numerator / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < CONVERGED {
            break;
        }
    }
    (scale * fraction).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// A normal variable (Box, Muller 1958).
    fn normal(random: &mut Random) -> f64 {
        (2.0 * random.exponential()).sqrt() * (2.0 * std::f64::consts::PI * random.unit()).cos()
    }

    /// A picture around `truth` with standard errors that differ by pixel; channels share errors.
    fn noisy(truth: f64, seed: u64) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let pixel = |i: u64| {
            let mut random = Random::new(seed, i, 0);
            let se = 0.01 + 0.02 * random.unit();
            let error = se * normal(&mut random);
            ([truth + error, truth + error, 2.0 * truth + error], [se; 3])
        };
        (0..256).map(pixel).unzip()
    }

    #[test]
    fn probabilities_agree_with_elementary_ones() {
        for x in [0.1, 1.0, 3.0, 10.0, 50.0] {
            assert!((chi_square_p(x, 2.0) / (-0.5 * x).exp() - 1.0).abs() < 1e-10, "{x}");
            assert!((chi_square_p(x, 1.0) / normal_p(x.sqrt()) - 1.0).abs() < 1e-9, "{x}");
            let four = (-0.5 * x).exp() * (1.0 + 0.5 * x);
            assert!((chi_square_p(x, 4.0) / four - 1.0).abs() < 1e-10, "{x}");
        }
        assert!((chi_square_p(5000.0, 5000.0) - 0.5).abs() < 0.01);
        assert!((normal_p(1.959_963_985) - 0.05).abs() < 1e-9);
    }

    #[test]
    fn equal_pictures_pass_as_often_as_they_should() {
        let level = 0.05;
        let pass = |seed: &u64| {
            let ((a, a_se), (b, b_se)) = (noisy(1.0, 2 * seed), noisy(1.0, 2 * seed + 1));
            z_test_image(&a, &a_se, &b, &b_se).passes(level)
        };
        let passed = (0..1000).filter(pass).count();
        // Corrections for many tests only make it more lenient.
        assert!((930..=1000).contains(&passed), "{passed}");
    }

    #[test]
    fn a_bias_a_spot_and_wrong_errors_are_noticed() {
        let ((a, a_se), (mut b, b_se)) = (noisy(1.0, 1), noisy(1.0, 2));
        let level = 1e-6;
        assert!(z_test_image(&a, &a_se, &b, &b_se).passes(level));
        let (biased, biased_se) = noisy(1.01, 3);
        let test = z_test_image(&a, &a_se, &biased, &biased_se);
        assert!(!test.passes(level) && test.mean_z < -5.0, "{test:?}");
        b[77][1] += 0.5;
        let test = z_test_image(&a, &a_se, &b, &b_se);
        assert!(!test.passes(level) && test.worst_at == [77, 1], "{test:?}");
        b[77][1] = f64::NAN;
        assert!(!z_test_image(&a, &a_se, &b, &b_se).passes(level));
        let too_sure: Vec<_> = a_se.iter().map(|se| se.map(|x| 0.4 * x)).collect();
        let test = z_test_image(&a, &too_sure, &vec![[1.0, 1.0, 2.0]; 256], &vec![[0.0; 3]; 256]);
        assert!(test.p_mean_square < 1e-9, "{test:?}");
    }

    #[test]
    fn noise_is_taken_out_of_the_error() {
        let truth = vec![[1.0, 1.0, 2.0]; 256];
        let none = vec![[0.0; 3]; 256];
        let (a, a_se) = noisy(1.0, 4);
        let clean = difference(&a, &a_se, &truth, &none);
        assert!(clean.relative_l2 < 2.5 * clean.uncertainty, "{clean:?}");
        let raw = difference(&a, &none, &truth, &none);
        assert!(raw.relative_l2 > 0.01, "{raw:?}");
        // 5 % everywhere, seen through noise on both sides.
        let darker: Vec<_> = truth.iter().map(|pixel| pixel.map(|x| 0.95 * x)).collect();
        let (reference, reference_se) = noisy(1.0, 5);
        let found = difference(&darker, &none, &reference, &reference_se);
        assert!((found.relative_l2 - 0.05).abs() < 3.0 * found.uncertainty, "{found:?}");
        assert!((found.bias + 0.05).abs() < 3.0 * found.bias_uncertainty, "{found:?}");
        assert!(found.uncertainty < 0.005 && found.percentile_95 > 0.05, "{found:?}");
    }
}
