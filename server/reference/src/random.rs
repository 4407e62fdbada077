//! Random numbers from counters: the n-th number of a path is a hash of seed, pixel, sample and
//! n. No state is shared, so neither threads nor the order of pixels change a picture.

/// The numbers of one path.
pub struct Random {
    keys: [u64; 2],
    count: u64,
}

/// 2^64 divided by the golden ratio: consecutive multiples are far apart.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
/// Spacing of the doubles in 0.5..1, and of the numbers returned.
const UNIT: f64 = 1.0 / (1u64 << 53) as f64;

/// A permutation of the 64-bit numbers in which each bit depends on all (the finaliser of
/// SplitMix64: Steele, Lea, Flood 2014).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

impl Random {
    /// The numbers of sample `sample` of pixel `pixel`.
    pub fn new(seed: u64, pixel: u64, sample: u64) -> Self {
        let first = mix(mix(mix(seed ^ GOLDEN).wrapping_add(pixel)).wrapping_add(sample));
        Self { keys: [first, mix(first ^ GOLDEN)], count: 0 }
    }

    /// The next number, 0 <= u < 1, a multiple of 2^-53.
    pub fn unit(&mut self) -> f64 {
        self.count += 1;
        let hash = mix(mix(self.keys[0].wrapping_add(self.count.wrapping_mul(GOLDEN))) ^ self.keys[1]);
        (hash >> 11) as f64 * UNIT
    }

    /// The next two numbers.
    pub fn pair(&mut self) -> [f64; 2] {
        [self.unit(), self.unit()]
    }

    /// An exponentially distributed number with mean 1; finite.
    pub fn exponential(&mut self) -> f64 {
        -(1.0 - self.unit()).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_uniform_and_neighbours_unrelated() {
        // Moments over streams (pixel, sample) and along one, each within 5 standard errors.
        let across: Vec<f64> = (0..100_000u64).map(|i| Random::new(7, i % 300, i / 300).unit()).collect();
        let mut random = Random::new(7, 1, 2);
        let along: Vec<f64> = (0..100_000).map(|_| random.unit()).collect();
        for numbers in [across, along] {
            let n = numbers.len() as f64;
            let mean = numbers.iter().sum::<f64>() / n;
            assert!((mean - 0.5).abs() < 5.0 / (12.0 * n).sqrt(), "{mean}");
            let square = numbers.iter().map(|u| u * u).sum::<f64>() / n;
            assert!((square - 1.0 / 3.0).abs() < 5.0 * (4.0f64 / 45.0 / n).sqrt(), "{square}");
            let lagged = numbers.windows(2).map(|w| (w[0] - 0.5) * (w[1] - 0.5)).sum::<f64>() / n;
            assert!(lagged.abs() < 5.0 / 12.0 / n.sqrt(), "{lagged}");
        }
    }

    #[test]
    fn a_stream_depends_on_each_of_its_keys() {
        let first = |seed, pixel, sample| Random::new(seed, pixel, sample).unit();
        let all = [first(0, 0, 0), first(1, 0, 0), first(0, 1, 0), first(0, 0, 1)];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b), "{all:?}");
        }
        assert_eq!(first(3, 4, 5), first(3, 4, 5));
    }
}
