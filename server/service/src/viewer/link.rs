//! What a viewer's link carries, estimated from how long frames take to be acknowledged.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::render_thread::Link;

/// Weight of the newest measurement.
const NEW_WEIGHT: f64 = 0.3;
/// Acknowledgements among which the fastest gives the link's latency.
const LATENCY_WINDOW: usize = 32;
/// Transfer times below this say only that the link is not the bottleneck.
const MEASURABLE: Duration = Duration::from_millis(4);
/// Sent frames remembered; more are never in flight.
const MAX_REMEMBERED: usize = 16;
/// Longest decoding time a viewer is believed.
const MAX_DECODE: Duration = Duration::from_secs(2);

/// Measures one viewer's link.
#[derive(Debug, Default)]
pub struct LinkMeter {
    sent: VecDeque<Sent>,
    /// Times from sending to acknowledgement, decoding not counted.
    round_trips: VecDeque<Duration>,
    link: Link,
    acknowledged: u32,
    /// From sending a frame to its acknowledgement, the newest, until it was asked for.
    age: Option<Duration>,
}

#[derive(Debug)]
struct Sent {
    frame: u32,
    /// Bytes that had to pass: its own, and those in flight before it.
    bytes: u64,
    own_bytes: u64,
    at: Instant,
}

impl LinkMeter {
    /// A frame was sent; `moving_pixels` if it is a moving picture of so many pixels.
    pub fn sent(&mut self, frame: u32, bytes: u64, moving_pixels: Option<u64>, at: Instant) {
        let before: u64 = self.sent.iter().map(|sent| sent.own_bytes).sum();
        self.sent.push_back(Sent { frame, bytes: before + bytes, own_bytes: bytes, at });
        if self.sent.len() > MAX_REMEMBERED {
            self.sent.pop_front();
        }
        if let Some(pixels) = moving_pixels {
            average(&mut self.link.bytes_per_pixel, bytes as f64 / pixels.max(1) as f64);
        }
    }

    /// A viewer acknowledged a frame, and with it all before. Returns the newest acknowledged
    /// frame; frames that were never sent cannot be acknowledged.
    pub fn acknowledged(&mut self, frame: u32, decode_millis: f64, now: Instant) -> u32 {
        if let Some(position) = self.sent.iter().position(|sent| sent.frame == frame) {
            let newest = self.sent.drain(..=position).next_back();
            if let Some(sent) = newest {
                self.acknowledged = self.acknowledged.max(frame);
                self.measure(&sent, decode_millis, now);
            }
        }
        self.acknowledged
    }

    /// From sending the newest frame that was acknowledged to its acknowledgement; told once.
    pub fn take_age(&mut self) -> Option<Duration> {
        self.age.take()
    }

    /// What is known so far.
    pub fn link(&self) -> Link {
        self.link
    }

    fn measure(&mut self, sent: &Sent, decode_millis: f64, now: Instant) {
        let decode = Duration::try_from_secs_f64(decode_millis / 1e3).unwrap_or_default().min(MAX_DECODE);
        self.age = Some(now.saturating_duration_since(sent.at));
        let round_trip = now.saturating_duration_since(sent.at).saturating_sub(decode);
        self.round_trips.push_back(round_trip);
        if self.round_trips.len() > LATENCY_WINDOW {
            self.round_trips.pop_front();
        }
        let latency = self.round_trips.iter().min().copied().unwrap_or_default();
        let transfer = round_trip.saturating_sub(latency);
        let rate = |time: Duration| sent.bytes as f64 / time.as_secs_f64();
        if transfer > MEASURABLE {
            average(&mut self.link.bytes_per_second, rate(transfer));
        } else if self.link.bytes_per_second.is_some_and(|known| known < rate(MEASURABLE)) {
            average(&mut self.link.bytes_per_second, rate(MEASURABLE));
        }
    }
}

fn average(value: &mut Option<f64>, measured: f64) {
    let known = value.unwrap_or(measured);
    *value = Some(known + NEW_WEIGHT * (measured - known));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sends frames over a link of a given rate and latency, one at a time.
    fn play(
        meter: &mut LinkMeter,
        frames: std::ops::Range<u32>,
        bytes: impl Fn(u32) -> u64,
        rate: f64,
        latency: f64,
    ) {
        let mut now = Instant::now();
        for frame in frames {
            meter.sent(frame, bytes(frame), Some(100_000), now);
            now += Duration::from_secs_f64(latency + bytes(frame) as f64 / rate + 0.005);
            assert_eq!(meter.acknowledged(frame, 5.0, now), frame);
        }
    }

    #[test]
    fn latency_is_not_taken_for_a_slow_link() {
        let mut meter = LinkMeter::default();
        play(&mut meter, 1..40, |frame| 20_000 + u64::from(frame % 7) * 1000, 1e8, 0.2);
        let rate = meter.link().bytes_per_second;
        assert!(rate.is_none_or(|rate| rate > 2e6), "{rate:?}");
    }

    #[test]
    fn throughput_is_found_and_recovers() {
        let mut meter = LinkMeter::default();
        play(&mut meter, 1..60, |frame| 10_000 + u64::from(frame % 5) * 30_000, 1e6, 0.03);
        let slow = meter.link().bytes_per_second.unwrap();
        assert!((0.7e6..2e6).contains(&slow), "{slow}");
        play(&mut meter, 60..200, |frame| 10_000 + u64::from(frame % 5) * 30_000, 1e8, 0.03);
        assert!(meter.link().bytes_per_second.unwrap() > 2.0 * slow);
    }

    #[test]
    fn only_sent_frames_can_be_acknowledged() {
        let mut meter = LinkMeter::default();
        let now = Instant::now();
        meter.sent(1, 10, None, now);
        meter.sent(2, 10, None, now);
        assert_eq!(meter.acknowledged(99, 0.0, now), 0);
        assert_eq!(meter.acknowledged(2, f64::NAN, now), 2, "acknowledges the first, too");
        assert_eq!(meter.acknowledged(1, 0.0, now), 2);
        assert_eq!(meter.acknowledged(u32::MAX, -1.0, now), 2);
    }
}
