//! Local frames and directions in them.

use std::f64::consts::PI;

use glam::DVec3;

/// Two unit vectors that make a right-handed frame with the unit vector `n` (Duff et al. 2017).
/// Which way the tangents point matters only to surfaces with two exponents.
pub fn tangents(n: DVec3) -> (DVec3, DVec3) {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let first = DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    let second = DVec3::new(b, sign + n.y * n.y * a, -n.y);
    (first, second)
}

/// The unit vector at `cos_theta` from the unit vector `axis`, at an azimuth in radians.
pub fn around(axis: DVec3, cos_theta: f64, azimuth: f64) -> DVec3 {
    let (u, v) = tangents(axis);
    let sin_theta = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
    (sin_theta * (azimuth.cos() * u + azimuth.sin() * v) + cos_theta * axis).normalize()
}

/// A uniform direction from two numbers in 0..1.
pub fn on_sphere([u, v]: [f64; 2]) -> DVec3 {
    around(DVec3::Z, 1.0 - 2.0 * u, 2.0 * PI * v)
}

/// A uniform point of the unit disk from two numbers in 0..1.
pub fn on_disk([u, v]: [f64; 2]) -> [f64; 2] {
    let (radius, azimuth) = (u.sqrt(), 2.0 * PI * v);
    [radius * azimuth.cos(), radius * azimuth.sin()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for i in 0..100 {
            let n = on_sphere([(f64::from(i) + 0.5) / 100.0, f64::from(i) * 0.618 % 1.0]);
            let (u, v) = tangents(n);
            assert!(u.dot(n).abs() < 1e-14 && v.dot(n).abs() < 1e-14 && (u.length() - 1.0).abs() < 1e-14);
            assert!((u.cross(v) - n).length() < 1e-14, "{n}");
        }
        assert!((tangents(-DVec3::Z).0.length() - 1.0).abs() < 1e-14);
    }
}
