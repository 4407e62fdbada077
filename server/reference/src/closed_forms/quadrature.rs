//! Integrals of smooth functions.

use std::f64::consts::PI;
use std::sync::LazyLock;

/// Points of the rule that an interval gets before it is halved.
const POINTS: usize = 12;
/// Most halvings: beyond them an interval is too short to matter.
const MAX_DEPTH: u32 = 24;

static RULE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(POINTS));

/// Places in 0..1 and weights of the Gauss-Legendre rule, exact for polynomials of degree
/// `2 count - 1`.
pub fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let n = count as f64;
    let root = |k: usize| {
        // Newton's method on the Legendre polynomial, from Tricomi's estimate of its root.
        let mut x = (PI * (k as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 0.0;
        for _ in 0..100 {
            let (mut before, mut here) = (1.0, x);
            for m in 2..=count {
                let m = m as f64;
                (before, here) = (here, ((2.0 * m - 1.0) * x * here - (m - 1.0) * before) / m);
            }
            slope = n * (before - x * here) / (1.0 - x * x);
            let step = here / slope;
            x -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(root).collect()
}

/// Integral from `a` to `b`; intervals are halved until a rule and its halves agree to
/// `tolerance`, absolute.
pub fn integrate(function: impl Fn(f64) -> f64, a: f64, b: f64, tolerance: f64) -> f64 {
    let whole = rule(&function, a, b);
    halve(&function, [a, b], whole, tolerance, MAX_DEPTH)
}

fn rule(function: &impl Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    (b - a) * RULE.iter().map(|(x, weight)| weight * function(a + (b - a) * x)).sum::<f64>()
}

fn halve(f: &impl Fn(f64) -> f64, [a, b]: [f64; 2], whole: f64, tolerance: f64, depth: u32) -> f64 {
    let middle = 0.5 * (a + b);
    let (left, right) = (rule(f, a, middle), rule(f, middle, b));
    if (left + right - whole).abs() <= tolerance || depth == 0 {
        return left + right;
    }
    halve(f, [a, middle], left, tolerance, depth - 1) + halve(f, [middle, b], right, tolerance, depth - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_integrate_polynomials_exactly() {
        for count in [2, 5, 12, 64] {
            let degree = 2 * count as i32 - 1;
            let sum: f64 = gauss_legendre(count).iter().map(|(x, w)| w * x.powi(degree)).sum();
            assert!((sum * f64::from(degree + 1) - 1.0).abs() < 1e-13, "{count}: {sum}");
        }
    }

    #[test]
    fn kinks_and_peaks_are_found() {
        let kink = integrate(|x| (x - 0.3f64).abs(), 0.0, 1.0, 1e-10);
        assert!((kink - 0.29).abs() < 1e-9, "{kink}");
        let peak = integrate(|x| 1e-3 / (x * x + 1e-6), -1.0, 1.0, 1e-10);
        assert!((peak - 2.0 * 1e3f64.atan()).abs() < 1e-9, "{peak}");
    }
}
