//! How large and how good a moving picture may be, so that the next one comes in time.
//!
//! The size follows the measured time per pixel and the measured bytes per pixel; the quality
//! follows the link alone. Sizes are quantised, and grow only when the next step fits with room
//! to spare, so that the picture does not flicker between two of them.

use std::time::Duration;

/// Sizes are multiples of the viewport's edges divided by this.
const LEVELS: u32 = 16;
/// The smallest level: an eighth of the viewport's edges.
const MIN_LEVEL: u32 = 2;
/// The smallest level of a picture at rest.
const PREVIEW_LEVEL: u32 = 4;
/// A larger size must fit into this share of the time.
const GROWTH_SHARE: f64 = 0.85;
/// Weight of the newest measurement.
const NEW_WEIGHT: f64 = 0.35;
/// A measurement counts at most this many times the estimate: one stall (a pipeline compiled, a
/// volume uploaded) is not the new normal.
const MAX_JUMP: f64 = 4.0;
/// What is assumed before the first measurement, milliseconds per pixel.
const FIRST_MILLIS_PER_PIXEL: f64 = 2e-5;
const FIRST_MILLIS_PER_PIXEL_SOFTWARE: f64 = 2e-3;
/// JPEG quality of moving pictures.
const MIN_QUALITY: u8 = 60;
const MAX_QUALITY: u8 = 85;
const QUALITY_STEP: u8 = 5;
/// Share of what the link carries in a frame's time that a frame may take.
const LINK_SHARE: f64 = 0.8;
/// Below this share of the allowance the quality rises again.
const LINK_COMFORT: f64 = 0.5;

/// What a viewer's link was measured to carry.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Link {
    /// Estimated throughput; unknown until large frames were acknowledged.
    pub bytes_per_second: Option<f64>,
    /// Bytes per pixel of the newest moving pictures.
    pub bytes_per_pixel: Option<f64>,
}

/// Size and quality of a moving picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moving {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// JPEG quality.
    pub quality: u8,
}

/// One viewer's pace.
#[derive(Debug, Clone)]
pub struct Pace {
    millis_per_pixel: f64,
    level: u32,
    quality: u8,
}

impl Pace {
    /// A pace that has measured nothing yet.
    pub fn new(software: bool) -> Self {
        let millis_per_pixel =
            if software { FIRST_MILLIS_PER_PIXEL_SOFTWARE } else { FIRST_MILLIS_PER_PIXEL };
        Self { millis_per_pixel, level: MIN_LEVEL, quality: MAX_QUALITY }
    }

    /// Size and quality of the next moving picture of a viewport, to be drawn within `time`.
    pub fn next(&mut self, viewport: (u32, u32), time: Duration, link: Link) -> Moving {
        let allowed_bytes = link.bytes_per_second.map(|rate| rate * time.as_secs_f64() * LINK_SHARE);
        let bytes_per_pixel = link.bytes_per_pixel.unwrap_or(0.0);
        let millis = time.as_secs_f64() * 1e3;
        let fits = |level: u32, share: f64| {
            let pixels = pixels(viewport, level);
            let in_time = pixels * self.millis_per_pixel <= share * millis;
            // Quality gives way before size does.
            let on_link = self.quality > MIN_QUALITY
                || allowed_bytes.is_none_or(|allowed| pixels * bytes_per_pixel <= share * allowed);
            in_time && on_link
        };
        while self.level > MIN_LEVEL && !fits(self.level, 1.0) {
            self.level -= 1;
        }
        while self.level < LEVELS && fits(self.level + 1, GROWTH_SHARE) {
            self.level += 1;
        }
        let bytes = pixels(viewport, self.level) * bytes_per_pixel;
        match allowed_bytes {
            Some(allowed) if bytes > allowed => {
                self.quality = self.quality.saturating_sub(QUALITY_STEP).max(MIN_QUALITY);
            }
            Some(allowed) if bytes > LINK_COMFORT * allowed => {}
            _ => self.quality = (self.quality + QUALITY_STEP).min(MAX_QUALITY),
        }
        let (width, height) = size(viewport, self.level);
        Moving { width, height, quality: self.quality }
    }

    /// Time one pass over so many pixels is expected to take.
    pub fn expected(&self, pixels: u64) -> Duration {
        Duration::from_secs_f64(pixels as f64 * self.millis_per_pixel / 1e3)
    }

    /// The largest size that is expected to be drawn within `time`, but at least a quarter of the
    /// viewport's edges: a sixteenth of the full time.
    pub fn preview_size(&self, viewport: (u32, u32), time: Duration) -> (u32, u32) {
        let millis = time.as_secs_f64() * 1e3;
        let fits = |&level: &u32| pixels(viewport, level) * self.millis_per_pixel <= millis;
        size(viewport, (PREVIEW_LEVEL..=LEVELS).rev().find(fits).unwrap_or(PREVIEW_LEVEL))
    }

    /// A moving picture of so many pixels took so long.
    pub fn measured(&mut self, pixels: u64, spent: Duration) {
        let measured = spent.as_secs_f64() * 1e3 / pixels.max(1) as f64;
        let bounded = measured.min(MAX_JUMP * self.millis_per_pixel);
        self.millis_per_pixel += NEW_WEIGHT * (bounded - self.millis_per_pixel);
    }

    /// A moving picture was given up unfinished after `spent`. Whether a smaller one is possible.
    pub fn too_slow(&mut self, pixels: u64, spent: Duration) -> bool {
        let at_least = spent.as_secs_f64() * 1e3 / pixels.max(1) as f64;
        self.millis_per_pixel = self.millis_per_pixel.max(2.0 * at_least);
        let smaller = self.level > MIN_LEVEL;
        self.level = (self.level - 1).max(MIN_LEVEL);
        smaller
    }
}

fn size((width, height): (u32, u32), level: u32) -> (u32, u32) {
    let scaled = |edge: u32| (u64::from(edge) * u64::from(level)).div_ceil(u64::from(LEVELS)).max(1) as u32;
    (scaled(width), scaled(height))
}

fn pixels(viewport: (u32, u32), level: u32) -> f64 {
    let (width, height) = size(viewport, level);
    f64::from(width) * f64::from(height)
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEWPORT: (u32, u32) = (1280, 720);
    const TIME: Duration = Duration::from_millis(100);

    /// Plays frames on a device of a given speed; returns the last size and its time.
    fn play(pace: &mut Pace, millis_per_pixel: f64, overhead_millis: f64, link: Link) -> (Moving, f64) {
        let mut last = (pace.next(VIEWPORT, TIME, link), 0.0);
        for _ in 0..40 {
            let pixels = u64::from(last.0.width) * u64::from(last.0.height);
            let millis = overhead_millis + pixels as f64 * millis_per_pixel;
            pace.measured(pixels, Duration::from_secs_f64(millis / 1e3));
            last = (pace.next(VIEWPORT, TIME, link), millis);
        }
        last
    }

    #[test]
    fn a_preview_fits_its_time() {
        let mut pace = Pace::new(true);
        play(&mut pace, 1e-2, 0.0, Link::default());
        let full = u64::from(VIEWPORT.0) * u64::from(VIEWPORT.1);
        assert!((pace.expected(full).as_secs_f64() - 9.2).abs() < 0.5);
        let time = Duration::from_millis(500);
        let (width, height) = pace.preview_size(VIEWPORT, time);
        assert_eq!((width, height), (VIEWPORT.0 / 4, VIEWPORT.1 / 4));
        let (wider, _) = pace.preview_size(VIEWPORT, 4 * time);
        assert!(wider > width && wider < VIEWPORT.0);
    }

    #[test]
    fn a_fast_device_draws_everything_and_a_slow_one_as_much_as_fits() {
        let mut pace = Pace::new(true);
        let (moving, _) = play(&mut pace, 1e-6, 1.0, Link::default());
        assert_eq!((moving.width, moving.height, moving.quality), (1280, 720, MAX_QUALITY));
        let (moving, millis) = play(&mut pace, 1e-3, 5.0, Link::default());
        assert!(moving.width < 640 && millis <= 100.0, "{moving:?} {millis}");
        assert!(millis > 55.0, "no more is given up than needed: {millis}");
        let (moving, _) = play(&mut pace, 1.0, 0.0, Link::default());
        assert_eq!((moving.width, moving.height), (160, 90), "never below an eighth");
        let (moving, _) = play(&mut pace, 1e-6, 1.0, Link::default());
        assert_eq!(moving.width, 1280, "recovers");
    }

    #[test]
    fn a_steady_device_gets_a_steady_size() {
        let mut pace = Pace::new(false);
        let (settled, _) = play(&mut pace, 3e-4, 2.0, Link::default());
        for step in 0..30 {
            let noise = if step % 2 == 0 { 0.96 } else { 1.04 };
            let pixels = u64::from(settled.width) * u64::from(settled.height);
            pace.measured(pixels, Duration::from_secs_f64(pixels as f64 * 3e-4 * noise / 1e3 + 2e-3));
            assert_eq!(pace.next(VIEWPORT, TIME, Link::default()), settled);
        }
    }

    #[test]
    fn one_stall_does_not_shrink_the_picture_to_nothing() {
        let mut pace = Pace::new(false);
        let (settled, _) = play(&mut pace, 5e-5, 0.0, Link::default());
        pace.measured(921_600, Duration::from_secs(2));
        let after = pace.next(VIEWPORT, TIME, Link::default());
        assert!(after.width * 2 >= settled.width, "{after:?}");
    }

    #[test]
    fn a_slow_link_lowers_quality_first_then_size() {
        let mut pace = Pace::new(false);
        let link = |rate| Link { bytes_per_second: Some(rate), bytes_per_pixel: Some(0.05) };
        // 46 kB a frame: half a megabyte a second is comfortable.
        let (fine, _) = play(&mut pace, 1e-6, 1.0, link(2e6));
        assert_eq!((fine.width, fine.quality), (1280, MAX_QUALITY));
        let (slow, _) = play(&mut pace, 1e-6, 1.0, link(2e5));
        assert_eq!(slow.quality, MIN_QUALITY);
        assert!(slow.width < 1280);
        let bytes = f64::from(slow.width * slow.height) * 0.05;
        assert!(bytes <= 0.1 * 2e5, "{bytes}");
    }

    #[test]
    fn giving_up_shrinks_until_there_is_no_smaller_size() {
        let mut pace = Pace::new(false);
        let mut pictures = 0;
        loop {
            let moving = pace.next(VIEWPORT, TIME, Link::default());
            pictures += 1;
            let pixels = u64::from(moving.width) * u64::from(moving.height);
            if !pace.too_slow(pixels, Duration::from_secs(1)) {
                break;
            }
        }
        assert!(pictures <= 16);
    }
}
