//! Whose turn it is. Everybody has an account of turns; who had fewest is next.
//!
//! A turn counts as one even if it took less time than it was allotted, and as no more than two if it
//! took more. Equal viewers then get equally many pictures, even if one is drawn larger than another
//! and another finishes early, and whatever a turn was allotted when fewer shared the device. Who does
//! nothing saves nothing up.

use std::time::{Duration, Instant};

/// Turns are counted in this many parts.
const PARTS: u64 = 1000;
/// Turns that somebody whose link or hand paused for a moment may catch up on.
const CREDIT_TURNS: u64 = 2;
/// A turn counts as so many at most. Its work is bounded by its slices; what takes longer is a stall
/// of the machine or a picture that cannot be smaller, and by time alone whoever it happened to would
/// get fewer pictures than others.
const MOST_TURNS: u64 = 2;

/// Turns somebody had, in parts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Account(u64);

/// How far all accounts have come. It never goes back.
#[derive(Debug, Default)]
pub(super) struct Turns {
    clock: u64,
}

impl Turns {
    /// The account of somebody new: without arrears, without credit.
    pub fn join(&self) -> Account {
        Account(self.clock)
    }

    /// Charges a turn that was allotted some time and took some.
    pub fn charge(&mut self, account: &mut Account, allotted: Duration, spent: Duration) {
        let begin = account.0.max(self.clock.saturating_sub(CREDIT_TURNS * PARTS));
        self.clock = self.clock.max(begin);
        let turns = spent.as_secs_f64() / allotted.as_secs_f64().max(f64::MIN_POSITIVE);
        account.0 = begin + ((turns * PARTS as f64) as u64).clamp(PARTS, MOST_TURNS * PARTS);
    }
}

/// Part of the time that goes to a class of work while another goes before it.
const SHARE_IN_WAITING: u32 = 10;

/// How long a class of work waits for one that goes before it. It gets a turn after a while, but no
/// more than a tenth of the time, however long its turns turn out to be: who moves should hardly notice.
#[derive(Debug)]
pub(super) struct Patience {
    least: Duration,
    since: Instant,
    pause: Duration,
}

impl Patience {
    /// One that lasts no shorter than `least`.
    pub fn new(least: Duration, now: Instant) -> Self {
        Self { least, since: now, pause: least }
    }

    /// Whether it has lasted long enough.
    pub fn is_over(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.since) > self.pause
    }

    /// Nobody of the class waits.
    pub fn nobody_waits(&mut self, now: Instant) {
        self.since = now;
    }

    /// The class had a turn, which took so long.
    pub fn had_turn(&mut self, now: Instant, spent: Duration) {
        self.since = now;
        self.pause = self.least.max(spent * (SHARE_IN_WAITING - 1));
    }
}

/// Time for a moving picture where `sharers` viewers move at once: `whole` is shared, but nobody
/// gets less than `least`, below which handing work to the device and reading pictures back would
/// be most of the time.
pub(super) fn allotment(whole: Duration, least: Duration, sharers: u32) -> Duration {
    (whole / sharers.max(1)).max(least).min(whole)
}

#[cfg(test)]
mod tests {
    use super::super::pace::{Link, Moving, Pace};
    use super::*;

    const VIEWPORT: (u32, u32) = (512, 512);
    const WHOLE: Duration = Duration::from_millis(120);
    const LEAST: Duration = Duration::from_millis(25);
    /// What encoding, sending and acknowledging a picture take.
    const ACKNOWLEDGED_AFTER: Duration = Duration::from_millis(40);
    const IN_FLIGHT: usize = 2;

    /// A device: what a picture costs besides its pixels, and each pixel, milliseconds.
    #[derive(Clone, Copy)]
    struct Device {
        picture: f64,
        pixel: f64,
    }

    struct Viewer {
        account: Account,
        pace: Pace,
        in_flight: Vec<Duration>,
        pictures: u32,
    }

    /// Numbers from 0 to 1 that look random and are always the same.
    struct Chance(u32);

    impl Chance {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(self.0 >> 8) / f64::from(1 << 24)
        }
    }

    type Charge = fn(&mut Turns, &mut Account, Duration, Duration);

    /// Plays viewers that move all the time on a device whose costs vary from half to five times
    /// the usual; how many pictures the worst of them got for each of the best.
    fn play(viewers: usize, device: Device, charge: Charge) -> f64 {
        let mut chance = Chance(7);
        let mut turns = Turns::default();
        let mut all: Vec<Viewer> = (0..viewers)
            .map(|_| Viewer {
                account: turns.join(),
                pace: Pace::new(true),
                in_flight: Vec::new(),
                pictures: 0,
            })
            .collect();
        let mut now = Duration::ZERO;
        while now < Duration::from_secs(8 * viewers as u64) {
            for viewer in &mut all {
                viewer.in_flight.retain(|&until| until > now);
            }
            let wanting = all.iter().filter(|viewer| viewer.in_flight.len() < IN_FLIGHT);
            let sharers = wanting.clone().count() as u32;
            let next = all
                .iter_mut()
                .filter(|viewer| viewer.in_flight.len() < IN_FLIGHT)
                .min_by_key(|viewer| viewer.account);
            let Some(viewer) = next else {
                now += Duration::from_millis(1);
                continue;
            };
            let time = allotment(WHOLE, LEAST, sharers);
            let Moving { width, height, .. } = viewer.pace.next(VIEWPORT, time, Link::default());
            let pixels = u64::from(width) * u64::from(height);
            let disturbed = if chance.next() < 0.1 { 5.0 } else { 0.5 + chance.next() };
            let millis = (device.picture + pixels as f64 * device.pixel) * disturbed;
            let spent = Duration::from_secs_f64(millis / 1e3);
            viewer.pace.measured(pixels, spent);
            charge(&mut turns, &mut viewer.account, time, spent);
            now += spent;
            viewer.in_flight.push(now + ACKNOWLEDGED_AFTER);
            viewer.pictures += 1;
        }
        let pictures = all.iter().map(|viewer| f64::from(viewer.pictures));
        pictures.clone().fold(f64::INFINITY, f64::min) / pictures.fold(0.0, f64::max)
    }

    #[test]
    fn equal_viewers_get_equally_many_pictures() {
        for viewers in [2, 4, 8, 16, 32] {
            for (picture, pixel) in [(3.0, 1e-4), (3.0, 1e-3), (3.0, 5e-3), (30.0, 1e-3), (0.5, 1e-5)] {
                let worst = play(viewers, Device { picture, pixel }, Turns::charge);
                assert!(worst >= 0.8, "{viewers} viewers, {picture} and {pixel} ms: {worst}");
            }
        }
    }

    #[test]
    fn charged_with_their_time_alone_they_would_not() {
        let device = Device { picture: 30.0, pixel: 1e-3 };
        let worst = play(32, device, |_, account, _, spent| account.0 += spent.as_micros() as u64);
        assert!(worst < 0.8, "{worst}");
        assert!(play(32, device, Turns::charge) > 0.9);
    }

    #[test]
    fn who_was_idle_catches_up_on_two_turns_at_most() {
        let mut turns = Turns::default();
        let time = Duration::from_millis(10);
        let (mut busy, mut idle) = (turns.join(), turns.join());
        for _ in 0..100 {
            turns.charge(&mut busy, time, time);
        }
        let mut caught_up = 0;
        while idle < busy {
            turns.charge(&mut idle, time, time);
            caught_up += 1;
        }
        assert_eq!(caught_up, CREDIT_TURNS + 1);
        let joined = turns.join();
        assert!(joined <= busy && busy.0 - joined.0 <= PARTS, "{joined:?} {busy:?}");
    }

    #[test]
    fn a_turn_counts_as_one_to_two() {
        let mut turns = Turns::default();
        let allotted = Duration::from_millis(10);
        for (millis, parts) in [(0, PARTS), (10, PARTS), (15, PARTS * 3 / 2), (500, 2 * PARTS)] {
            let mut account = turns.join();
            let before = account.0;
            turns.charge(&mut account, allotted, Duration::from_millis(millis));
            assert_eq!(account.0 - before, parts, "{millis} ms");
        }
        let mut account = turns.join();
        turns.charge(&mut account, Duration::ZERO, allotted);
    }

    #[test]
    fn who_moved_alone_owes_nothing_to_those_who_join() {
        let mut turns = Turns::default();
        let mut first = turns.join();
        for _ in 0..50 {
            turns.charge(&mut first, WHOLE, WHOLE);
        }
        let joined = turns.join();
        assert!(first.0 - joined.0 <= PARTS, "one turn ahead, however long it was");
    }

    #[test]
    fn who_waits_gets_a_turn_in_time_and_a_tenth_of_the_time() {
        let least = Duration::from_millis(250);
        for millis in [5, 25, 100, 400] {
            let spent = Duration::from_millis(millis);
            let began = Instant::now();
            let (mut now, mut used, mut longest) = (began, Duration::ZERO, Duration::ZERO);
            let mut patience = Patience::new(least, now);
            let mut last = now;
            while now < began + Duration::from_secs(60) {
                if patience.is_over(now) {
                    longest = longest.max(now - last);
                    now += spent;
                    used += spent;
                    patience.had_turn(now, spent);
                    last = now;
                } else {
                    now += Duration::from_millis(20);
                }
            }
            let share = used.as_secs_f64() / 60.0;
            assert!((0.015..=0.105).contains(&share), "{millis} ms: {share}");
            assert!(longest <= least.max(spent * 9) + Duration::from_millis(20), "{longest:?}");
        }
        let now = Instant::now();
        let mut patience = Patience::new(least, now);
        patience.nobody_waits(now + least);
        assert!(!patience.is_over(now + least), "who comes later waits from then");
    }

    #[test]
    fn nobody_gets_less_than_the_least() {
        assert_eq!(allotment(WHOLE, LEAST, 1), WHOLE);
        assert_eq!(allotment(WHOLE, LEAST, 2), WHOLE / 2);
        assert_eq!(allotment(WHOLE, LEAST, 64), LEAST);
        assert_eq!(allotment(WHOLE, LEAST, 0), WHOLE);
        assert_eq!(allotment(LEAST, WHOLE, 3), LEAST, "never more than the whole");
    }
}
