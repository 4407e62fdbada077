//! Whose turn it is. Everybody has an account of turns; who had fewest is next.
//!
//! What counts is pictures: the turns for one count as one together, when it is done, however long they
//! took. On a busy machine it is chance whose turn takes long and is cut off; by their time equal
//! viewers would get unequal numbers of pictures, and if who was cut off waited for all others, the
//! picture would be the older for it. Who has more to do, so that even the quickest of some pictures
//! takes twice as long as others' do, is charged twice and for every turn. Equal viewers then get
//! equally many pictures, even if one is drawn larger than another and another finishes early, and
//! whatever a turn was allotted when fewer shared the device. Who does nothing saves nothing up.

use std::cmp::Ordering;
use std::time::{Duration, Instant};

/// Turns that somebody whose link or hand paused for a moment may catch up on.
const CREDIT_TURNS: u64 = 2;
/// So many turns count as one, even if they do not end with a picture.
const TURNS_OF_PICTURE: u32 = 4;
/// Share of all pictures that are quicker than one that nothing disturbs.
const UNDISTURBED: f32 = 0.25;
/// Whose quickest picture takes so many times that has more to do, and is charged so much.
const HEAVY: u64 = 2;
/// Pictures that tell what one takes: of one account, and of all.
const OWN_PICTURES: usize = 9;
const ALL_PICTURES: usize = 33;

/// What the newest pictures took, in allotments.
#[derive(Debug, Clone, Copy)]
struct Newest<const N: usize> {
    took: [f32; N],
    count: usize,
}

impl<const N: usize> Default for Newest<N> {
    fn default() -> Self {
        Self { took: [0.0; N], count: 0 }
    }
}

impl<const N: usize> Newest<N> {
    fn add(&mut self, took: f32) {
        self.took[self.count % N] = took;
        self.count += 1;
    }

    /// What the picture at a share of them took, 0 the quickest; `None` before there are enough.
    fn at(&self, share: f32) -> Option<f32> {
        let mut sorted = (self.count >= N).then_some(self.took)?;
        sorted.sort_unstable_by(f32::total_cmp);
        Some(sorted[(share * (N - 1) as f32) as usize])
    }
}

/// Turns somebody had. Who had fewer is less.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Account {
    turns: u64,
    newest: Newest<OWN_PICTURES>,
    /// Turns for the picture under way, and what they took.
    under_way: (u32, f32),
}

impl Ord for Account {
    fn cmp(&self, other: &Self) -> Ordering {
        self.turns.cmp(&other.turns)
    }
}

impl PartialOrd for Account {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Account {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Account {}

/// How far all accounts have come. It never goes back.
#[derive(Debug, Default)]
pub(super) struct Turns {
    clock: u64,
    newest: Newest<ALL_PICTURES>,
}

impl Turns {
    /// The account of somebody new: without arrears, without credit.
    pub fn join(&self) -> Account {
        Account { turns: self.clock, ..Account::default() }
    }

    /// Charges a turn that was allotted some time and took some, and may have ended with a picture.
    pub fn charge(&mut self, account: &mut Account, allotted: Duration, spent: Duration, is_picture: bool) {
        let (before, took) = account.under_way;
        let took = took + (spent.as_secs_f64() / allotted.as_secs_f64().max(f64::MIN_POSITIVE)) as f32;
        account.under_way = (before + 1, took);
        if is_picture {
            account.newest.add(took);
            self.newest.add(took);
            account.under_way = (0, 0.0);
        }
        let has_more_to_do = match (account.newest.at(0.0), self.newest.at(UNDISTURBED)) {
            (Some(quickest), Some(usual)) => quickest > HEAVY as f32 * usual,
            _ => false,
        };
        let begin = account.turns.max(self.clock.saturating_sub(CREDIT_TURNS));
        self.clock = self.clock.max(begin);
        let is_over = is_picture || (before + 1).is_multiple_of(TURNS_OF_PICTURE);
        account.turns = begin
            + match has_more_to_do {
                true => HEAVY,
                false => u64::from(is_over),
            };
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
    #[derive(Debug, Clone, Copy)]
    struct Device {
        picture: f64,
        pixel: f64,
    }

    struct Viewer {
        account: Account,
        pace: Pace,
        in_flight: Vec<Duration>,
        /// Pixels and time of a picture that its turn did not finish.
        left: Option<(u64, Duration)>,
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

    type Charge = fn(&mut Turns, &mut Account, Duration, Duration, bool);

    /// What disturbs turns: a share of them takes five times as long, the others half to one and a half.
    const QUIET: f64 = 0.1;
    const BUSY: f64 = 0.35;
    /// As long as the suite `load` measures, and long enough for rules to show through chance.
    const SECONDS: u64 = 16;
    const LONG_SECONDS: u64 = 250;

    /// Plays viewers that move all the time on a device whose costs vary; a picture that takes longer
    /// than its turn goes on in the next. How many pictures the worst of them got for each of the best.
    fn play(viewers: usize, device: Device, disturbed: f64, seconds: u64, charge: Charge) -> f64 {
        let mut chance = Chance(7);
        let mut turns = Turns::default();
        let mut all: Vec<Viewer> = (0..viewers)
            .map(|_| Viewer {
                account: turns.join(),
                pace: Pace::new(true),
                in_flight: Vec::new(),
                left: None,
                pictures: 0,
            })
            .collect();
        let mut now = Duration::ZERO;
        // Sizes are found in it.
        let warm_up = Duration::from_secs(seconds / 4);
        while now < warm_up + Duration::from_secs(seconds) {
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
            let (pixels, missing) = viewer.left.take().unwrap_or_else(|| {
                let Moving { width, height, .. } = viewer.pace.next(VIEWPORT, time, Link::default());
                let pixels = u64::from(width) * u64::from(height);
                let slow = if chance.next() < disturbed { 5.0 } else { 0.5 + chance.next() };
                let millis = (device.picture + pixels as f64 * device.pixel) * slow;
                viewer.pace.measured(pixels, Duration::from_secs_f64(millis / 1e3));
                (pixels, Duration::from_secs_f64(millis / 1e3))
            });
            // It ends with the slice after its time.
            let spent = missing.min(time + LEAST);
            charge(&mut turns, &mut viewer.account, time, spent, spent == missing);
            now += spent;
            if spent < missing {
                viewer.left = Some((pixels, missing - spent));
                continue;
            }
            viewer.in_flight.push(now + ACKNOWLEDGED_AFTER);
            viewer.pictures += u32::from(now >= warm_up);
        }
        let pictures = all.iter().map(|viewer| f64::from(viewer.pictures));
        pictures.clone().fold(f64::INFINITY, f64::min) / pictures.fold(0.0, f64::max)
    }

    const DEVICES: [Device; 5] = [
        Device { picture: 3.0, pixel: 1e-4 },
        Device { picture: 3.0, pixel: 1e-3 },
        Device { picture: 3.0, pixel: 5e-3 },
        Device { picture: 30.0, pixel: 1e-3 },
        Device { picture: 0.5, pixel: 1e-5 },
    ];

    #[test]
    fn equal_viewers_get_equally_many_pictures() {
        for viewers in [2, 4, 8, 16, 32] {
            for device in DEVICES {
                let worst = play(viewers, device, QUIET, LONG_SECONDS, Turns::charge);
                assert!(worst >= 0.9, "{viewers} viewers, {device:?}: {worst}");
            }
        }
    }

    #[test]
    fn on_a_busy_machine_too_and_in_a_short_time() {
        for viewers in [4, 8, 16] {
            for device in DEVICES {
                let worst = play(viewers, device, BUSY, SECONDS, Turns::charge);
                assert!(worst >= 0.9, "{viewers} viewers, {device:?}: {worst}");
            }
        }
    }

    #[test]
    fn charged_with_their_time_they_would_not() {
        let device = Device { picture: 30.0, pixel: 1e-3 };
        let by_time: Charge = |_, account, _, spent, _| account.turns += spent.as_micros() as u64;
        let worst = play(16, device, BUSY, SECONDS, by_time);
        assert!(worst < 0.8, "{worst}");
        // One to two turns, by time.
        let one_to_two: Charge = |_, account, allotted, spent, _| {
            let turns = spent.as_secs_f64() / allotted.as_secs_f64();
            account.turns += (1000.0 * turns.clamp(1.0, 2.0)) as u64;
        };
        let worst = play(16, device, BUSY, SECONDS, one_to_two);
        assert!(worst < 0.8, "{worst}");
    }

    #[test]
    fn who_was_idle_catches_up_on_two_turns_at_most() {
        let mut turns = Turns::default();
        let time = Duration::from_millis(10);
        let (mut busy, mut idle) = (turns.join(), turns.join());
        for _ in 0..100 {
            turns.charge(&mut busy, time, time, true);
        }
        let mut caught_up = 0;
        while idle < busy {
            turns.charge(&mut idle, time, time, true);
            caught_up += 1;
        }
        assert_eq!(caught_up, CREDIT_TURNS + 1);
        let joined = turns.join();
        assert!(joined <= busy && busy.turns - joined.turns <= 1, "{joined:?} {busy:?}");
    }

    #[test]
    fn turns_for_one_picture_count_as_one_together() {
        let mut turns = Turns::default();
        let allotted = Duration::from_millis(10);
        let mut account = turns.join();
        let mut charged = |millis, is_picture| {
            let before = account.turns;
            turns.charge(&mut account, allotted, Duration::from_millis(millis), is_picture);
            account.turns - before
        };
        assert_eq!([charged(0, true), charged(10, true), charged(500, true)], [1; 3]);
        assert_eq!(
            [charged(15, false), charged(15, false), charged(5, true), charged(10, true)],
            [0, 0, 1, 1]
        );
        let endless: Vec<u64> = (0..8).map(|_| charged(10, false)).collect();
        assert_eq!(endless, [0, 0, 0, 1, 0, 0, 0, 1], "what does not end lets others go on");
        let mut account = turns.join();
        turns.charge(&mut account, Duration::ZERO, allotted, true);
    }

    #[test]
    fn who_has_more_to_do_has_half_the_turns() {
        let mut turns = Turns::default();
        let allotted = Duration::from_millis(25);
        let (mut light, mut heavy) = (turns.join(), turns.join());
        let mut had = [0, 0];
        for _ in 0..600 {
            let is_light = light <= heavy;
            had[usize::from(!is_light)] += 1;
            let (account, millis) = if is_light { (&mut light, 20) } else { (&mut heavy, 100) };
            turns.charge(account, allotted, Duration::from_millis(millis), true);
        }
        let share = f64::from(had[1]) / f64::from(had[0]);
        assert!((0.48..0.56).contains(&share), "{had:?}");
    }

    #[test]
    fn who_moved_alone_owes_nothing_to_those_who_join() {
        let mut turns = Turns::default();
        let mut first = turns.join();
        for _ in 0..50 {
            turns.charge(&mut first, WHOLE, WHOLE, true);
        }
        let joined = turns.join();
        assert!(first.turns - joined.turns <= 1, "one turn ahead, however long it was");
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
