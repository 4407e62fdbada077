//! Refinement at rest: paths beneath a picture in approximate light, until they are known better.

use std::sync::Arc;
use std::time::Instant;

use scene::plan::{FilmPlan, Pass, Target, good_enough};
use scene::{Scene, Snapshot};

use super::tracing::{PathEstimate, ratio_of_sums};
use super::{DrawRequest, Drawn, Renderer};
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry};
use crate::path_tracer::TILE_EDGE;
use crate::shaders;
use crate::view::{FILM_PIXEL_BYTES, View};

/// Fewest paths of a pixel whose spread tells anything.
const FEWEST_PATHS: u32 = 8;
/// Most paths of a pixel between two looks at the error.
const MOST_PATHS_AT_ONCE: u32 = 32;
/// Bytes of what is known of a tile.
const TILE_BYTES: u64 = 16;
/// Bytes of a tile's expected error and brightness.
const ERROR_BYTES: u64 = 8;

/// Pipelines of shaders/refinement.
pub(super) struct Pipelines {
    compare: wgpu::ComputePipeline,
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
        Self { compare: pipeline("compare", shaders::COMPARE), blend: pipeline("blend", shaders::BLEND) }
    }
}

/// What refines a view's film.
pub(crate) struct Refinement {
    /// Paths have a film of their own.
    view: View,
    /// The newest scene, and the same as paths see it.
    scenes: Option<[Arc<Snapshot>; 2]>,
    uniform: wgpu::Buffer,
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
        self.view.total_bytes() + buffers.map(wgpu::Buffer::size).iter().sum::<u64>()
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
        Ok(Refinement {
            view: View::new(),
            scenes: None,
            uniform: gpu.buffer("refinement", 16, uniform)?,
            tiles: gpu.buffer("differences", tiles * TILE_BYTES, storage)?,
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
        view: &View,
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
        let size = [refinement.width, refinement.height, 0, 0];
        self.gpu.queue.write_buffer(&refinement.uniform, 0, bytemuck::cast_slice(&size));
        let groups = refinement.tiles();
        let entries = [
            buffer_entry(0, &refinement.uniform),
            buffer_entry(1, &own.film),
            buffer_entry(2, &followed.film),
            buffer_entry(3, &paths.spreads),
            buffer_entry(4, &refinement.tiles),
        ];
        self.dispatch_with(&self.refining.compare, &entries, groups);
        let entries = [
            buffer_entry(0, &refinement.uniform),
            buffer_entry(1, &own.film),
            buffer_entry(2, &followed.film),
            buffer_entry(3, &refinement.tiles),
            buffer_entry(4, &refinement.blended),
            buffer_entry(5, &refinement.errors),
        ];
        self.dispatch_with(&self.refining.blend, &entries, groups);
        let bytes = u64::from(groups[0]) * u64::from(groups[1]) * ERROR_BYTES;
        Ok(ratio_of_sums(&self.gpu.read_buffer(&refinement.errors, bytes)?))
    }
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
