//! How far a picture is from a reference, each number with what the reference's own noise makes of it.

use proto::scene_file::Film;
use reference::statistics::{Difference, difference};

use crate::bench::display::displayed;
use crate::bench::flip::mean_flip;
use crate::bench::references::Truth;

/// A picture against a reference.
#[derive(Debug, Clone, Copy)]
pub struct Errors {
    /// Relative L2, bias and 95th percentile of linear radiance.
    pub linear: Difference,
    /// What the 95th percentile would be of a picture without any error, by the reference's noise.
    pub percentile_95_floor: f64,
    /// Mean FLIP of the displayed pictures.
    pub flip: f64,
    /// What it would be of a picture without any error.
    pub flip_floor: f64,
}

impl Errors {
    /// Compares; all of the picture's own noise counts as error.
    pub fn of(picture: &[[f64; 3]], truth: &Truth, film: &Film, width: usize) -> Self {
        let exact = vec![[0.0; 3]; picture.len()];
        let linear = difference(picture, &exact, &truth.mean, &truth.standard_error);
        let shown = displayed(&truth.mean, film);
        // A picture without error differs from the reference by noise like the reference's.
        let perfect = noisy(truth);
        let floor = difference(&perfect, &exact, &truth.mean, &truth.standard_error);
        Self {
            linear,
            percentile_95_floor: floor.percentile_95,
            flip: mean_flip(&shown, &displayed(picture, film), width),
            flip_floor: mean_flip(&shown, &displayed(&perfect, film), width),
        }
    }
}

/// The reference moved by noise of its own size; channels share theirs, as they share paths.
fn noisy(truth: &Truth) -> Vec<[f64; 3]> {
    let moved = |(index, (mean, error)): (usize, (&[f64; 3], &[f64; 3]))| {
        let z = normal(index as u64);
        [0, 1, 2].map(|channel| mean[channel] + z * error[channel])
    };
    truth.mean.iter().zip(&truth.standard_error).enumerate().map(moved).collect()
}

/// A normal variable for an index (Box, Muller 1958).
fn normal(index: u64) -> f64 {
    let [u, v] = [unit(2 * index), unit(2 * index + 1)];
    (-2.0 * (1.0 - u).ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}

/// 0..1 for an index (finaliser of SplitMix64).
fn unit(index: u64) -> f64 {
    let mut hash = index.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x1234_5678_9abc_def1);
    hash = (hash ^ (hash >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    hash = (hash ^ (hash >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((hash ^ (hash >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::references::Made;

    fn truth(error: f64) -> Truth {
        let made = serde_json::json!({"width": 16, "height": 16, "samples": 4, "relative_error": 0.0,
            "cut": 0.0, "lost": 0, "seconds": 0.0});
        let made: Made = serde_json::from_value(made).unwrap();
        Truth { mean: vec![[0.4; 3]; 256], standard_error: vec![[error; 3]; 256], made, cached: false }
    }

    #[test]
    fn floors_are_what_a_right_picture_gets() {
        let truth = truth(0.02);
        let found = Errors::of(&noisy(&truth), &truth, &Film::default(), 16);
        assert_eq!((found.flip, found.linear.percentile_95), (found.flip_floor, found.percentile_95_floor));
        assert!(found.flip_floor > 1e-3 && found.percentile_95_floor > 0.05, "{found:?}");
        // Its noise is known: no error is left.
        assert!(found.linear.relative_l2 <= 2.5 * found.linear.uncertainty, "{found:?}");
    }

    #[test]
    fn a_wrong_picture_is_above_the_floors() {
        let truth = truth(0.002);
        let darker: Vec<_> = truth.mean.iter().map(|pixel| pixel.map(|x| 0.8 * x)).collect();
        let found = Errors::of(&darker, &truth, &Film::default(), 16);
        assert!((found.linear.bias + 0.2).abs() < 0.01 && found.flip > 5.0 * found.flip_floor, "{found:?}");
    }
}
