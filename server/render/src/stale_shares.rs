//! What an edit of each bin would make stale, from what is kept: every photon, and every tile of
//! paths, remembers the bins it relied on.

use proto::plan::StaleShares;
use scene::bins::BIN_COUNT;

/// Shares from the bins that each of the things counted relied on; `None` if there is none.
pub(crate) fn of_masks(what: &str, masks: &[u64]) -> Option<StaleShares> {
    if masks.is_empty() {
        return None;
    }
    let mut counts = [0_u32; BIN_COUNT];
    for &mask in masks {
        let mut rest = mask;
        while rest != 0 {
            counts[rest.trailing_zeros() as usize] += 1;
            rest &= rest - 1;
        }
    }
    let share = |&count: &u32| (f64::from(count) / masks.len() as f64) as f32;
    Some(StaleShares {
        what: what.to_owned(),
        counted: masks.len() as u64,
        of_bins: counts.iter().map(share).collect(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn each_bin_has_the_share_that_relied_on_it() {
        assert_eq!(of_masks("photons", &[]), None);
        let shares = of_masks("photons", &[0b1, 0b11, 1 << 63, 0]).unwrap();
        assert_eq!((shares.what.as_str(), shares.counted), ("photons", 4));
        assert_eq!(shares.of_bins.len(), 64);
        let expected = |bin: usize| [(0, 0.5), (1, 0.25), (63, 0.25)].iter().find(|e| e.0 == bin);
        for (bin, share) in shares.of_bins.iter().enumerate() {
            assert_eq!(*share, expected(bin).map_or(0.0, |e| e.1), "bin {bin}");
        }
    }
}
