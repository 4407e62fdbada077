//! Drawing a scene to be measured.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use proto::rest::DeviceInfo;
use render::{AdapterPolicy, DrawRequest, Gpu, RenderError, Renderer, View};
use scene::plan::Target;
use scene::{Integrator, Scene, Snapshot};

/// Pictures drawn to take a time from; the quickest counts.
const TIMED_RUNS: usize = 7;
/// No further picture is drawn for its time once this long was spent.
const TIMED_FOR: Duration = Duration::from_secs(4);
/// Pixels along each axis of the picture that compiles and uploads.
const WARM_UP_EDGE: u32 = 8;

/// A renderer that draws each scene into a view of its own.
pub struct Canvas {
    renderer: Renderer,
}

/// A finished picture and what it took.
pub struct Drawing {
    /// Linear RGB, rows from the top.
    pub radiance: Vec<[f64; 3]>,
    /// Of each value, where the picture is a random estimate; else 0.
    pub standard_error: Vec<[f64; 3]>,
    /// Wall clock, from an empty view to the finished film, read-back of counters included, that of
    /// the picture not. The volume was on the device.
    pub millis: f64,
    /// Times [`Renderer::draw`] returned, and the longest it took.
    pub slices: u32,
    /// Milliseconds.
    pub longest_slice_millis: f64,
    /// Exact work, of all slices.
    pub counters: BTreeMap<String, u64>,
}

impl Canvas {
    /// Opens the device and compiles what every scene needs.
    ///
    /// # Errors
    /// No device, or it refuses.
    pub fn open() -> Result<Self, RenderError> {
        Ok(Self { renderer: Renderer::new(Gpu::open(AdapterPolicy::Any)?)? })
    }

    /// What draws.
    pub fn device(&self) -> &DeviceInfo {
        self.renderer.gpu().info()
    }

    /// The renderer, for measurements that keep a view.
    pub fn renderer(&mut self) -> &mut Renderer {
        &mut self.renderer
    }

    /// Draws into an empty view, with as many samples per pixel as the scene asks for, in slices of
    /// about `slice` (`None`: as long as it takes). Gives up after `patience`.
    ///
    /// # Errors
    /// As [`Renderer::draw`].
    pub fn draw(
        &mut self,
        scene: &Scene,
        [width, height]: [u32; 2],
        slice: Option<Duration>,
        patience: Duration,
    ) -> Result<Drawing, RenderError> {
        let snapshot = Arc::new(Snapshot { epoch: 1, scene: scene.clone() });
        let target = Target { width, height, samples_per_pixel: scene.samples_at_rest() };
        let mut view = View::new();
        let (mut slices, mut longest) = (0, 0.0f64);
        let mut counters = BTreeMap::new();
        let began = Instant::now();
        loop {
            let slice_began = Instant::now();
            let request = DrawRequest { snapshot: &snapshot, target, budget: slice };
            let drawn = self.renderer.draw(&mut view, &request)?;
            slices += 1;
            longest = longest.max(slice_began.elapsed().as_secs_f64() * 1e3);
            for (name, count) in drawn.counters {
                *counters.entry(name).or_insert(0) += count;
            }
            if drawn.complete {
                break;
            }
            if began.elapsed() > patience {
                let seconds = patience.as_secs_f64();
                return Err(RenderError::Gpu(format!("not finished after {seconds} s and {slices} slices")));
            }
        }
        let millis = began.elapsed().as_secs_f64() * 1e3;
        let pixels = |rgb: Vec<f32>| -> Vec<[f64; 3]> {
            rgb.as_chunks::<3>().0.iter().map(|pixel| pixel.map(f64::from)).collect()
        };
        let radiance = pixels(self.renderer.radiance(&view)?.rgb);
        let standard_error = match scene.integrator() {
            Integrator::PathTracer => pixels(self.renderer.standard_error(&view)?.rgb),
            Integrator::RayCaster => vec![[0.0; 3]; radiance.len()],
        };
        Ok(Drawing { radiance, standard_error, millis, slices, longest_slice_millis: longest, counters })
    }

    /// Draws for its time: pipelines are compiled and the volume is on the device before, and of a
    /// few pictures the quickest counts.
    ///
    /// # Errors
    /// As [`Canvas::draw`].
    pub fn time(
        &mut self,
        scene: &Scene,
        size: [u32; 2],
        patience: Duration,
    ) -> Result<Drawing, RenderError> {
        let mut small = scene.clone();
        small.sampling.samples_per_pixel = 1;
        small.paths.per_pixel = 1;
        self.draw(&small, [WARM_UP_EDGE; 2], None, patience)?;
        let began = Instant::now();
        let mut best = self.draw(scene, size, None, patience)?;
        for _ in 1..TIMED_RUNS {
            if began.elapsed() > TIMED_FOR {
                break;
            }
            let again = self.draw(scene, size, None, patience)?;
            if again.millis < best.millis {
                best = again;
            }
        }
        Ok(best)
    }
}
