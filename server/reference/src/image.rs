//! Pictures: samples of all pixels, their means and standard errors, and when to stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use glam::DVec3;
use proto::FieldError;
use rayon::prelude::*;
use scene::{Rendering, Scene};

use crate::local::LocalTracer;
use crate::path::{Traced, Tracer};
use crate::random::Random;
use crate::region::camera_ray;

/// Scattering events after which [`Request::new`] cuts a path.
pub const DEFAULT_LONGEST_PATH: u32 = 100_000;
/// Samples a pixel needs before its spread is trusted to end a picture.
const SAMPLES_BEFORE_ERROR: u32 = 16;
/// Time between two reports.
const REPORT_INTERVAL: Duration = Duration::from_millis(250);

/// Which ways of light count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transport {
    /// All of them, up to the scene's scattering orders.
    Full,
    /// What method `local` draws: single scattering, no shadows, area lights acting from their
    /// centre, uniform ambient from everywhere. Deterministic but for the place in the pixel.
    Local,
}

/// What a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixel {
    /// The mean over its square.
    Square,
    /// The ray through its centre, to compare with a picture of one sample per pixel.
    Center,
}

/// What to estimate, and how well.
#[derive(Debug, Clone)]
pub struct Request {
    /// Pixels, at least 1.
    pub width: u32,
    /// Pixels, at least 1.
    pub height: u32,
    /// Which ways of light count.
    pub transport: Transport,
    /// What a pixel shows.
    pub pixel: Pixel,
    /// Equal seeds give equal pictures.
    pub seed: u64,
    /// Samples per pixel to end at, at least 2.
    pub samples: u32,
    /// Time to end at; whole passes over the picture count, so that a picture takes at least one.
    pub time: Option<Duration>,
    /// Relative error to end at: root mean square of the standard errors over that of the
    /// means. Looked at after each pass, from 16 samples on; ending by it favours low estimates
    /// a little, so a strict test should end by samples.
    pub relative_error: Option<f64>,
    /// Scattering events after which a path is cut ([`Estimate::cut`]).
    pub longest_path: u32,
}

impl Request {
    /// Full transport to a number of samples per pixel.
    pub fn new(width: u32, height: u32, samples: u32) -> Self {
        Self {
            width,
            height,
            transport: Transport::Full,
            pixel: Pixel::Square,
            seed: 0,
            samples,
            time: None,
            relative_error: None,
            longest_path: DEFAULT_LONGEST_PATH,
        }
    }
}

/// How far a picture has come.
#[derive(Debug, Clone, Copy)]
pub struct Report {
    /// Samples of every pixel so far.
    pub samples: u32,
    /// Share of the work done, 0..1, by whichever limit is nearest.
    pub share: f64,
    /// Time left, by that share.
    pub remaining: Duration,
}

/// How to watch and to end a picture from outside.
#[derive(Default)]
pub struct Progress<'a> {
    /// Called about four times a second, from any thread.
    pub report: Option<&'a (dyn Fn(Report) + Sync)>,
    /// Ends the picture soon after it becomes true.
    pub cancel: Option<&'a AtomicBool>,
}

/// Why a picture ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Ended {
    Samples,
    Time,
    RelativeError,
    Cancelled,
}

/// An estimated picture; rows from the top.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Mean radiance of each pixel, linear RGB.
    pub mean: Vec<[f64; 3]>,
    /// Standard errors of the means.
    pub standard_error: Vec<[f64; 3]>,
    /// Samples of every pixel. 0 and black if the picture was ended before its first pass.
    pub samples: u32,
    /// What cutting long paths left out, as mean throughput: no more than this times the largest
    /// radiance that light sources show is missing from the mean of the pixels.
    pub cut: f64,
    /// Rays given up because matter is far thinner than its surroundings' densest place; their
    /// light counts as 0. Anything but 0 makes the picture suspect.
    pub lost: u64,
    /// Root mean square of the standard errors over that of the means; 0 for a black picture.
    pub relative_error: f64,
    /// Time taken.
    pub elapsed: Duration,
    /// Why it ended.
    pub ended: Ended,
}

/// Running moments of a pixel (Welford 1962).
#[derive(Clone, Copy, Default)]
struct Moments {
    samples: u32,
    mean: DVec3,
    squares: DVec3,
    cut: f64,
}

impl Moments {
    fn add(&mut self, traced: Traced) {
        self.samples += 1;
        let difference = traced.radiance - self.mean;
        self.mean += difference / f64::from(self.samples);
        self.squares += difference * (traced.radiance - self.mean);
        self.cut += traced.cut;
    }

    /// Variance of the mean.
    fn variance(&self) -> DVec3 {
        let n = f64::from(self.samples);
        if self.samples < 2 { DVec3::ZERO } else { self.squares / (n * (n - 1.0)) }
    }
}

enum Integrator<'a> {
    Full(Tracer<'a>),
    Local(LocalTracer<'a>),
}

/// Estimates the picture of a scene. Uses rayon's current thread pool; the result does not depend
/// on its size.
///
/// # Errors
/// Only matter in light is judged: other rendering modes are refused, and images that
/// [`Transport::Local`] does not know; sizes or samples of 0. The field is named.
pub fn render(scene: &Scene, request: &Request, progress: &Progress<'_>) -> Result<Estimate, FieldError> {
    if scene.rendering != Rendering::Volume {
        return Err(FieldError::new("rendering.mode", "the reference draws `volume` only"));
    }
    if request.width == 0 || request.height == 0 || request.samples < 2 {
        return Err(FieldError::new("image", "must have pixels, with at least 2 samples each"));
    }
    let began = Instant::now();
    // A part of a volume lies off the origin; rays here start from a box around it.
    let scene = &scene.centred();
    let integrator = match request.transport {
        Transport::Full => Integrator::Full(Tracer::new(scene, request.longest_path)),
        Transport::Local => Integrator::Local(LocalTracer::new(scene)?),
    };
    let mut painting =
        Painting { scene, request, progress, integrator, began, last_report: Mutex::new(began) };
    Ok(painting.paint())
}

struct Painting<'a> {
    scene: &'a Scene,
    request: &'a Request,
    progress: &'a Progress<'a>,
    integrator: Integrator<'a>,
    began: Instant,
    last_report: Mutex<Instant>,
}

impl Painting<'_> {
    fn paint(&mut self) -> Estimate {
        let count = self.request.width as usize * self.request.height as usize;
        let mut pixels = vec![Moments::default(); count];
        let mut done = 0;
        // Passes grow with the samples there are; one that is broken off is dropped whole, so that
        // what counts depends on nothing but the number of samples.
        let ended = loop {
            if done >= self.request.samples {
                break Ended::Samples;
            }
            let more = (done / 8).max(2).min(self.request.samples - done);
            match self.pass(&pixels, done, more) {
                Ok(added) => pixels = added,
                Err(ended) => break ended,
            }
            done += more;
            // A picture that is black so far says nothing about its error.
            let target = self.request.relative_error.filter(|_| done >= SAMPLES_BEFORE_ERROR);
            if target.zip(relative_error(&pixels)).is_some_and(|(target, error)| error <= target) {
                break Ended::RelativeError;
            }
            if self.out_of_time() {
                break Ended::Time;
            }
        };
        let samples = f64::from(done.max(1)) * count as f64;
        Estimate {
            width: self.request.width,
            height: self.request.height,
            mean: pixels.iter().map(|pixel| pixel.mean.to_array()).collect(),
            standard_error: pixels.iter().map(|p| p.variance().map(f64::sqrt).to_array()).collect(),
            samples: done,
            cut: pixels.iter().map(|pixel| pixel.cut).sum::<f64>() / samples,
            lost: match &self.integrator {
                Integrator::Full(tracer) => tracer.medium.lost(),
                Integrator::Local(_) => 0,
            },
            relative_error: relative_error(&pixels).unwrap_or(0.0),
            elapsed: self.began.elapsed(),
            ended,
        }
    }

    /// Adds `more` samples to pixels that have `done`.
    fn pass(&self, pixels: &[Moments], done: u32, more: u32) -> Result<Vec<Moments>, Ended> {
        let width = self.request.width as usize;
        let mut next = pixels.to_vec();
        let error = relative_error(pixels).unwrap_or(0.0);
        let rows_done = AtomicUsize::new(0);
        // 0: going on. The first pass is finished whatever time it takes.
        let ended = AtomicU64::new(0);
        next.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                for sample in done..done + more {
                    if self.progress.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
                        ended.store(2, Ordering::Relaxed);
                    } else if done > 0 && self.out_of_time() {
                        ended.fetch_max(1, Ordering::Relaxed);
                    }
                    if ended.load(Ordering::Relaxed) != 0 {
                        return;
                    }
                    pixel.add(self.sample(x, y, sample));
                }
            }
            let rows = rows_done.fetch_add(1, Ordering::Relaxed) + 1;
            let partly = f64::from(more) * rows as f64 / f64::from(self.request.height);
            self.report(done, f64::from(done) + partly, error);
        });
        match ended.into_inner() {
            0 => Ok(next),
            1 => Err(Ended::Time),
            _ => Err(Ended::Cancelled),
        }
    }

    fn sample(&self, x: usize, y: usize, sample: u32) -> Traced {
        let pixel = (y * self.request.width as usize + x) as u64;
        let mut random = Random::new(self.request.seed, pixel, u64::from(sample));
        let [u, v] = match self.request.pixel {
            Pixel::Square => random.pair(),
            Pixel::Center => [0.5; 2],
        };
        let place = [x as f64 + u, y as f64 + v];
        let ray = camera_ray(&self.scene.camera, place, self.request.width, self.request.height);
        match &self.integrator {
            Integrator::Full(tracer) => tracer.trace(ray, &mut random),
            Integrator::Local(tracer) => Traced { radiance: tracer.trace(ray), cut: 0.0 },
        }
    }

    fn out_of_time(&self) -> bool {
        self.request.time.is_some_and(|time| self.began.elapsed() >= time)
    }

    fn report(&self, samples: u32, samples_with_parts: f64, error: f64) {
        let Some(report) = self.progress.report else { return };
        let Ok(mut last) = self.last_report.try_lock() else { return };
        if last.elapsed() < REPORT_INTERVAL {
            return;
        }
        *last = Instant::now();
        let elapsed = self.began.elapsed();
        let mut share = samples_with_parts / f64::from(self.request.samples);
        if let Some(time) = self.request.time {
            share = share.max(elapsed.as_secs_f64() / time.as_secs_f64().max(1e-9));
        }
        if let Some(target) = self.request.relative_error
            && error > 0.0
        {
            // The error falls with the root of the samples.
            share = share.max((target / error).powi(2));
        }
        let share = share.clamp(1e-9, 1.0);
        let remaining = elapsed.as_secs_f64() * (1.0 / share - 1.0);
        let remaining = Duration::try_from_secs_f64(remaining).unwrap_or(Duration::MAX);
        report(Report { samples, share, remaining });
    }
}

/// Root mean square of the standard errors over that of the means; `None` for a black picture.
fn relative_error(pixels: &[Moments]) -> Option<f64> {
    let variance: f64 = pixels.iter().map(|pixel| pixel.variance().element_sum()).sum();
    let squares: f64 = pixels.iter().map(|pixel| pixel.mean.length_squared()).sum();
    (squares > 0.0).then(|| (variance / squares).sqrt())
}
