//! Refinement at rest: paths beneath a picture in approximate light, until they are known better.

use std::sync::Arc;
use std::time::Instant;

use scene::plan::{FilmPlan, Pass, Target, good_enough};
use scene::{Scene, Snapshot};

use super::tracing::PathEstimate;
use super::{DrawRequest, Drawn, Renderer};
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry};
use crate::path_tracer::TILE_EDGE;
use crate::shaders;
use crate::uniforms::DifferencePart;
use crate::view::{FILM_PIXEL_BYTES, View};

/// Fewest paths of a pixel whose spread tells anything.
const FEWEST_PATHS: u32 = 8;
/// Most paths of a pixel between two looks at the error.
const MOST_PATHS_AT_ONCE: u32 = 32;
/// Bytes of what is known of a tile.
const TILE_BYTES: u64 = 8;
/// Bytes of a tile's expected error and brightness.
const ERROR_BYTES: u64 = 8;

/// Parts that differences are split into, from fine to smooth: see `DifferencePart`. Smoothing is by 1 2 1 along both
/// axes, so the figures follow for noise that is independent from pixel to pixel: variance of a part, and
/// weight of a pixel in it.
const PARTS: [(u32, f32, f32); 3] =
    [(1, 41.0 / 64.0, 0.75), (2, 0.074_462_89, 3.0 / 16.0), (0, 0.029_541_016, 1.0 / 16.0)];

/// Pipelines of shaders/refinement.
pub(super) struct Pipelines {
    differ: wgpu::ComputePipeline,
    split: wgpu::ComputePipeline,
    take_over: wgpu::ComputePipeline,
    blend: wgpu::ComputePipeline,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Self {
        let pipeline = |pass, source: &'static str| {
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(pass),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            gpu.compute_pipeline(pass, None, &module, &[])
        };
        Self {
            differ: pipeline("differ", shaders::DIFFER),
            split: pipeline("split", shaders::SPLIT),
            take_over: pipeline("take_over", shaders::TAKE_OVER),
            blend: pipeline("blend", shaders::BLEND),
        }
    }
}

/// What refines a view's film.
pub(crate) struct Refinement {
    /// Paths have a film of their own.
    view: View,
    /// The newest scene, and the same as paths see it.
    scenes: Option<[Arc<Snapshot>; 2]>,
    uniform: wgpu::Buffer,
    /// What the films differ by: whole, and smoothed once and twice.
    differences: [wgpu::Buffer; 3],
    tiles: wgpu::Buffer,
    errors: wgpu::Buffer,
    /// Both films in one.
    pub blended: wgpu::Buffer,
    width: u32,
    height: u32,
    /// Paths of each pixel in the blended film; 0: that is another picture's.
    pub paths: u32,
    estimate: Option<PathEstimate>,
}

impl Refinement {
    /// Bytes of all buffers.
    pub fn bytes(&self) -> u64 {
        let buffers = [&self.uniform, &self.tiles, &self.errors, &self.blended];
        let sizes = buffers.into_iter().chain(&self.differences).map(wgpu::Buffer::size);
        self.view.total_bytes() + sizes.sum::<u64>()
    }

    /// What it holds is not the film's any more. Paths may serve again: their plan knows.
    pub fn forget(&mut self) {
        (self.paths, self.estimate) = (0, None);
    }

    /// Whether it is as good as the scene asks for.
    fn is_known(&self, scene: &Scene) -> bool {
        self.estimate.is_some_and(|estimate| good_enough(scene, estimate.relative_error))
    }

    fn tiles(&self) -> [u32; 2] {
        [self.width, self.height].map(|edge| edge.div_ceil(TILE_EDGE))
    }

    /// The snapshot as paths see it.
    fn path_traced(&mut self, snapshot: &Arc<Snapshot>) -> Arc<Snapshot> {
        match &self.scenes {
            Some([of, traced]) if Arc::ptr_eq(of, snapshot) => traced.clone(),
            _ => {
                let traced =
                    Arc::new(Snapshot { epoch: snapshot.epoch, scene: snapshot.scene.path_traced() });
                self.scenes = Some([snapshot.clone(), traced.clone()]);
                traced
            }
        }
    }
}

impl Renderer {
    /// Draws the view's film, and refines it by paths where the scene asks for it.
    pub(super) fn draw_refined(
        &mut self,
        view: &mut View,
        request: &DrawRequest<'_>,
    ) -> Result<Drawn, RenderError> {
        let began = Instant::now();
        let scene = &request.snapshot.scene;
        let [own, paths] = scene.samples_and_paths(request.target.samples_per_pixel);
        let target = Target { samples_per_pixel: own, ..request.target };
        if !scene.is_refined() {
            view.refinement = None;
        }
        let mut drawn = self.draw_film(view, &DrawRequest { target, ..*request })?;
        if drawn.plan.film != FilmPlan::Keep
            && let Some(refinement) = &mut view.refinement
        {
            refinement.forget();
        }
        if drawn.complete && paths > 0 {
            let Target { width, height, .. } = target;
            let kept = view.refinement.take().filter(|old| (old.width, old.height) == (width, height));
            let mut refinement = match kept {
                Some(refinement) => refinement,
                None => Box::new(self.refinement(width, height)?),
            };
            self.refine(view, &mut refinement, request, began, &mut drawn)?;
            drawn.gpu_bytes.insert("refinement".into(), refinement.bytes());
            view.refinement = Some(refinement);
        }
        Ok(drawn)
    }

    fn refinement(&self, width: u32, height: u32) -> Result<Refinement, RenderError> {
        let storage =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let tiles = u64::from(width.div_ceil(TILE_EDGE)) * u64::from(height.div_ceil(TILE_EDGE));
        let pixels = u64::from(width) * u64::from(height);
        let gpu = &self.gpu;
        let difference = || gpu.buffer("differences", pixels * FILM_PIXEL_BYTES, storage);
        Ok(Refinement {
            view: View::new(),
            scenes: None,
            uniform: gpu.buffer("refinement", std::mem::size_of::<DifferencePart>() as u64, uniform)?,
            differences: [difference()?, difference()?, difference()?],
            tiles: gpu.buffer("tiles of differences", tiles * TILE_BYTES, storage)?,
            errors: gpu.buffer("expected errors", tiles * ERROR_BYTES, storage)?,
            blended: gpu.buffer("the blended film", pixels * FILM_PIXEL_BYTES, storage)?,
            width,
            height,
            paths: 0,
            estimate: None,
        })
    }

    /// Follows paths for what is left of the budget, and blends them in.
    fn refine(
        &mut self,
        view: &mut View,
        refinement: &mut Refinement,
        request: &DrawRequest<'_>,
        began: Instant,
        drawn: &mut Drawn,
    ) -> Result<(), RenderError> {
        let scene = &request.snapshot.scene;
        let [_, paths] = scene.samples_and_paths(request.target.samples_per_pixel);
        let left = || request.budget.map(|budget| budget.saturating_sub(began.elapsed()));
        let is_spent = || left().is_some_and(|left| left.is_zero());
        let was_busy = drawn.plan.film != FilmPlan::Keep || drawn.plan.runs(Pass::Illuminate);
        drawn.complete = false;
        // Whoever drew already leaves paths to the next turn if its time is up.
        let mut goes_on = !(was_busy && is_spent());
        while goes_on && !refinement.is_known(scene) {
            let snapshot = refinement.path_traced(request.snapshot);
            let held = refinement.paths;
            // Where the error may be the end of it, it is looked at after every few paths.
            let next = if scene.paths.max_error > 0.0 {
                held.saturating_add(held.clamp(FEWEST_PATHS, MOST_PATHS_AT_ONCE)).min(paths)
            } else {
                paths
            };
            let target = Target { samples_per_pixel: next, ..request.target };
            let request = DrawRequest { snapshot: &snapshot, target, budget: left() };
            let followed = self.draw_film(&mut refinement.view, &request)?;
            if followed.samples_per_pixel < FEWEST_PATHS {
                refinement.forget();
            } else if followed.pass_share == 0.0
                && (followed.plan.film != FilmPlan::Keep || refinement.paths == 0)
            {
                refinement.paths = followed.samples_per_pixel;
                let cut = followed.estimate.map_or(0.0, |estimate| estimate.cut);
                let relative_error = self.blend(view, refinement)?;
                // The same number of paths may have found something else.
                view.picture = None;
                refinement.estimate = Some(PathEstimate { relative_error, cut });
            }
            // Paths alone may be known well enough, too.
            let ended = followed.complete && (followed.samples_per_pixel < next || next == paths);
            drawn.complete = ended;
            drawn.take_over(followed);
            goes_on = !ended && !is_spent();
        }
        drawn.complete |= refinement.is_known(scene);
        drawn.samples_per_pixel += refinement.paths;
        drawn.estimate = refinement.estimate;
        Ok(())
    }

    /// Blends both films; the expected relative error of what comes of it.
    fn blend(&self, view: &View, refinement: &Refinement) -> Result<f64, RenderError> {
        let (Some(own), Some(followed), Some(paths)) =
            (&view.buffers, &refinement.view.buffers, &refinement.view.paths)
        else {
            return Err(RenderError::Gpu("a film of the refinement is missing".into()));
        };
        let Refinement { width, height, uniform, differences, tiles, errors, blended, .. } = refinement;
        let groups = refinement.tiles();
        let image = [*width, *height];
        let run = |pipeline, part: DifferencePart, entries: &[(u32, &wgpu::Buffer)]| {
            self.gpu.queue.write_buffer(uniform, 0, bytemuck::bytes_of(&part));
            let all = std::iter::once((0, uniform)).chain(entries.iter().copied());
            let all: Vec<_> = all.map(|(binding, buffer)| buffer_entry(binding, buffer)).collect();
            self.dispatch_with(pipeline, &all, groups);
        };
        let whole = DifferencePart { image, ..DifferencePart::default() };
        let [first, ..] = differences;
        let films = [(1, first), (3, blended), (5, &own.film), (6, &followed.film), (7, &paths.spreads)];
        run(&self.refining.differ, whole, &films);
        for (index, (stride, noise, centre)) in PARTS.into_iter().enumerate() {
            let part = DifferencePart { image, stride, noise, centre, ..DifferencePart::default() };
            // The last part is smoothed to nothing, in place of the first.
            let smoothed = &differences[if stride > 0 { index + 1 } else { 1 }];
            let buffers = [(1, &differences[index]), (2, smoothed), (4, tiles)];
            run(&self.refining.split, part, &buffers);
            run(&self.refining.take_over, part, &[buffers.as_slice(), &[(3, blended)]].concat());
        }
        run(&self.refining.blend, whole, &[(1, first), (3, blended), (5, &own.film), (6, errors)]);
        let bytes = u64::from(groups[0]) * u64::from(groups[1]) * ERROR_BYTES;
        Ok(expected_error(&self.gpu.read_buffer(&refinement.errors, bytes)?))
    }
}

/// Relative error of a film from the expected squared errors and the squares of its tiles: one standard
/// error above the estimate, for that of few tiles is rough; and no less than that, for estimates below zero
/// mean that noise hides it.
fn expected_error(bytes: &[u8]) -> f64 {
    let tiles: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(bytes);
    let total = |which: usize| tiles.iter().map(|tile| f64::from(tile[which])).sum::<f64>();
    let (squared_error, squared_value) = (total(0), total(1));
    let count = tiles.len() as f64;
    let apart = |tile: &[f32; 2]| (f64::from(tile[0]) - squared_error / count).powi(2);
    let scatter = (tiles.iter().map(apart).sum::<f64>() * count / (count - 1.0).max(1.0)).sqrt();
    let at_most = squared_error.max(0.0) + scatter;
    if squared_value > 0.0 { (at_most / squared_value).sqrt() } else { 0.0 }
}

impl Drawn {
    /// Adds what paths did for it.
    fn take_over(&mut self, followed: Drawn) {
        self.plan.refined_by(&followed.plan);
        self.pass_share = followed.pass_share;
        self.drew |= followed.drew;
        for stage in followed.stages {
            stage.add_to(&mut self.stages);
        }
        for (name, count) in followed.counters {
            *self.counters.entry(name).or_default() += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_below_the_noise_of_their_estimate_are_not_known() {
        let told = |tiles: &[[f32; 2]]| expected_error(bytemuck::cast_slice(tiles));
        assert!((told(&[[0.01, 1.0]; 4]) - 0.1).abs() < 1e-6);
        // Noise that is more than the paths' spread says, and less: the mean is below zero.
        let noisy = told(&[[0.01, 1.0], [-0.03, 1.0], [0.02, 1.0], [-0.04, 1.0]]);
        assert!(noisy > 0.1, "{noisy}");
        assert_eq!(told(&[[0.0; 2]; 3]), 0.0);
    }
}
