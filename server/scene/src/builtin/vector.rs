//! The few vector operations the formulas need. IEEE additions, products and square roots only,
//! so they give the same bits on every machine.

use super::grid::Point;

pub(crate) fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn scale(a: Point, factor: f64) -> Point {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// Unit vector along `a`, which must not be 0.
pub(crate) fn normalized(a: Point) -> Point {
    scale(a, 1.0 / length(a))
}

/// 0 below `low`, 1 above `high`, a cubic with flat ends between.
pub(crate) fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Smooth minimum of two distances: differs from the minimum only where they are closer than
/// `width` to each other, by at most `width / 4`.
pub(crate) fn smooth_min(a: f64, b: f64, width: f64) -> f64 {
    let overlap = (1.0 - (a - b).abs() / width).max(0.0);
    a.min(b) - 0.25 * width * overlap * overlap
}

/// Share of matter at signed distance `distance` (negative inside) from a surface whose edge is
/// `width` wide: 1 inside, 0 outside, 0.5 on the surface.
pub(crate) fn coverage(distance: f64, width: f64) -> f64 {
    (0.5 - distance / width).clamp(0.0, 1.0)
}
