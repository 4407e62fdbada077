//! What a bake is made for, beside matter, and how much of it was done.

use std::time::Duration;

use proto::scene_file::{Filter, Orders};
use scene::Scene;

use crate::light_field;

/// Another layout is another bake.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    pub lights: u32,
    pub longest: u32,
    pub nside: usize,
    pub photons: u64,
    pub events: u32,
    pub bands: u32,
    pub orders: Orders,
    pub nearest: bool,
}

impl Layout {
    pub fn of(scene: &Scene) -> Self {
        let settings = &scene.illumination;
        let events = match scene.orders {
            Orders::All => settings.transfer_events,
            Orders::AtMost(count) => count.min(settings.transfer_events),
        };
        Self {
            lights: settings.transfer_lights,
            longest: settings.transfer_grid,
            nside: f64::from(settings.transfer_directions / 12).sqrt().round() as usize,
            // What has been scattered at most once was marched.
            photons: if events > 1 { u64::from(settings.transfer_photons) } else { 0 },
            events,
            bands: light_field::bands_of(scene, settings.transfer_bands),
            orders: scene.orders,
            nearest: scene.filter == Filter::Nearest,
        }
    }

    /// Directions that light is marched from.
    pub fn directions(&self) -> u32 {
        (12 * self.nside * self.nside) as u32
    }
}

/// Whether albedo differs between red, green and blue.
pub fn is_coloured(scene: &Scene) -> bool {
    let grey = |albedo: glam::DVec3| albedo.x == albedo.y && albedo.y == albedo.z;
    !scene.transfer_function.points.iter().all(|point| grey(point.albedo))
}

/// Exact work of a call.
#[derive(Debug, Clone, Copy, Default)]
pub struct Work {
    pub rays: u64,
    pub photons: u64,
    /// Of these photons those that were there before an edit.
    pub retraced: u64,
    /// Directions whose losses became light.
    pub spread: u64,
    /// Whether an edit was followed to its end.
    pub caught_up: bool,
    pub interactions: u64,
    pub tentative_collisions: u64,
    pub cells: u64,
    pub cut_1024ths: u64,
    /// Files that bakes came from, and went to.
    pub loaded: u64,
    pub stored: u64,
    /// Bakes that were compressed.
    pub compressed: u64,
}

/// Share of a bake that is done, in time: directions and photons by what they were seen to take.
#[derive(Debug, Default)]
pub struct Share {
    /// Of directions, then of photons: how many were done at the first look, how many since then and
    /// in what time.
    first: Option<[u64; 2]>,
    took: [Duration; 2],
    largest: f64,
}

impl Share {
    /// Time that went into directions (0) or photons (1).
    pub fn took(&mut self, what: usize, time: Duration) {
        self.took[what] += time;
    }

    /// Takes in how many are `done` of `all`; 0..1, never less than before.
    pub fn of(&mut self, done: [u64; 2], all: [u64; 2]) -> f64 {
        let first = *self.first.get_or_insert(done);
        let cost = [0, 1].map(|i| {
            let seen = done[i].saturating_sub(first[i]);
            if seen > 0 { Some(self.took[i].as_secs_f64() / seen as f64) } else { None }
        });
        let share = |i: usize| if all[i] > 0 { done[i] as f64 / all[i] as f64 } else { 1.0 };
        let share = match cost {
            [Some(a), Some(b)] if a > 0.0 || b > 0.0 => {
                let time = |of: [u64; 2]| a * of[0] as f64 + b * of[1] as f64;
                time(done) / time(all)
            }
            // Of one it is not known how long it takes: it may be nearly all.
            _ => share(0).min(share(1)),
        };
        self.largest = if done == all { 1.0 } else { self.largest.max(share.min(1.0)) };
        self.largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_time_and_never_fall() {
        let mut share = Share::default();
        let all = [100, 1000];
        assert_eq!(share.of([0, 0], all), 0.0);
        // A hundred photons in 9 seconds, ten directions in one: 90 and 10 are to be expected.
        share.took(1, Duration::from_secs(9));
        assert_eq!(share.of([0, 100], all), 0.0);
        share.took(0, Duration::from_secs(1));
        assert!((share.of([10, 100], all) - 0.1).abs() < 1e-9);
        share.took(1, Duration::from_secs(900));
        assert!(share.of([10, 100], all) >= 0.1);
        assert_eq!(share.of(all, all), 1.0);
        // What was done by another process took no time here.
        let mut resumed = Share::default();
        assert_eq!(resumed.of([100, 500], all), 0.5);
        // There may be nothing of a kind, or little: all of it says nothing of the other.
        assert_eq!(Share::default().of([50, 0], [100, 0]), 0.5);
        assert_eq!(Share::default().of([0, 10], [100, 10]), 0.0);
    }
}
