//! Gradient noise from an integer hash: no tables, no transcendental functions, hence the same
//! bits on every machine.

use super::grid::Point;

/// A well-mixed 32-bit hash of an integer: two rounds of xor-shift and odd multiplication, with
/// the low-bias constants that Chris Wellons found by search ("hash-prospector").
pub(crate) fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A number in 0..1 that depends on `key` alone.
pub(crate) fn unit(key: u32) -> f64 {
    f64::from(mix(key)) / f64::from(u32::MAX)
}

/// Smooth noise around 0, mostly within -0.5..0.5 and always within -1.5..1.5, with features one unit of `p` wide. Continuous with its
/// first two derivatives; 0 at every integer point. Different seeds give unrelated noise.
pub(crate) fn gradient_noise(p: Point, seed: u32) -> f64 {
    let cell = p.map(f64::floor);
    let local = [p[0] - cell[0], p[1] - cell[1], p[2] - cell[2]];
    let fade = local.map(|t| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    let corner = |dx: u32, dy: u32, dz: u32| {
        let lattice = |axis: usize, d: u32| (cell[axis] as i32 as u32).wrapping_add(d);
        let key = mix(lattice(0, dx) ^ mix(lattice(1, dy) ^ mix(lattice(2, dz) ^ mix(seed))));
        // Ten bits for each component of the gradient, each in -1..1.
        let component = |shift: u32| f64::from((key >> shift) & 1023) * (2.0 / 1023.0) - 1.0;
        component(0) * (local[0] - f64::from(dx))
            + component(10) * (local[1] - f64::from(dy))
            + component(20) * (local[2] - f64::from(dz))
    };
    let mix_along = |t: f64, a: f64, b: f64| a + t * (b - a);
    let edge = |dy, dz| mix_along(fade[0], corner(0, dy, dz), corner(1, dy, dz));
    let face = |dz| mix_along(fade[1], edge(0, dz), edge(1, dz));
    mix_along(fade[2], face(0), face(1))
}

/// Sum of `octaves` noises, each twice as fine and half as strong as the one before.
pub(crate) fn fractal_noise(p: Point, octaves: u32, seed: u32) -> f64 {
    let mut sum = 0.0;
    let (mut frequency, mut amplitude) = (1.0, 1.0);
    for octave in 0..octaves {
        // A shift per octave keeps the zeros at lattice points from falling on each other.
        let shift = 0.37 * f64::from(octave);
        sum += amplitude * gradient_noise(p.map(|x| x * frequency + shift), seed.wrapping_add(octave));
        frequency *= 2.0;
        amplitude *= 0.5;
    }
    sum
}

/// Three unrelated [`fractal_noise`] values as a displacement.
pub(crate) fn vector_noise(p: Point, octaves: u32, seed: u32) -> Point {
    const AXIS_STRIDE: u32 = 101;
    std::array::from_fn(|axis| fractal_noise(p, octaves, seed + AXIS_STRIDE * axis as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_vanishes_at_lattice_points_and_is_continuous_across_cells() {
        for i in -5..5 {
            let p = [f64::from(i), f64::from(2 * i), f64::from(-i)];
            assert_eq!(gradient_noise(p, 7), 0.0);
            let beside = |x: f64| gradient_noise([f64::from(i) + x, 0.3, -1.6], 7);
            assert!((beside(1e-9) - beside(-1e-9)).abs() < 1e-7);
        }
    }

    #[test]
    fn noise_has_mean_zero_and_keeps_its_range() {
        let (mut sum, mut squares, mut largest) = (0.0, 0.0, 0.0_f64);
        let count = 20_000;
        for i in 0..count {
            let p = [0, 1, 2].map(|axis| unit(3 * i + axis) * 100.0 - 50.0);
            let value = gradient_noise(p, 3);
            sum += value;
            squares += value * value;
            largest = largest.max(value.abs());
        }
        let mean = sum / f64::from(count);
        let deviation = (squares / f64::from(count)).sqrt();
        // The standard error of the mean is deviation / sqrt(count).
        assert!(mean.abs() < 5.0 * deviation / f64::from(count).sqrt(), "mean {mean}");
        assert!((0.1..0.4).contains(&deviation), "deviation {deviation}");
        assert!(largest < 1.5, "largest {largest}");
    }
}
