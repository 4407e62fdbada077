//! Following paths into a view's film, band by band of rows, dispatch by dispatch.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use proto::scene_file::Orders;
use scene::light::LightGeometry;
use scene::plan::{Target, good_enough};
use scene::{Background, Majorants, Scene};

use super::layers::{LightLayers, behind_in_layers, layer_count};
use super::{DrawRequest, Radiance, Renderer};
use crate::environment_map;
use crate::error::RenderError;
use crate::film::in_a_row;
use crate::frame::frame_uniform;
use crate::gpu::{buffer_entry, texture_entry};
use crate::path_tracer::{ERROR_BLOCK, PathVariant, TILE_EDGE};
use crate::uniforms;
use crate::view::{EnvironmentTables, FILM_PIXEL_BYTES, View};

/// Length a dispatch aims at where no budget is given: far below any driver's watchdog.
const UNHURRIED_DISPATCH: Duration = Duration::from_millis(100);
/// A dispatch aims at this share of the budget, so that the last one seldom overshoots it by much.
const DISPATCH_SHARE_OF_BUDGET: f64 = 0.5;
/// Pixels whose paths are under way at once: enough to fill the device.
const BAND_PIXELS: u32 = 1 << 18;
/// The same on a software device, where one ray for each of more pixels takes longer than a slice.
const BAND_PIXELS_SOFTWARE: u32 = 1 << 14;
/// Most paths that a pass adds to each pixel.
const MOST_PATHS_A_PASS: u32 = 32;
/// Most rays of a path in a dispatch.
const MOST_RAYS: u32 = 1 << 12;
/// Mesa's software device leaves every loop of a shader once all of them together have made 65,535
/// turns, for eight pixels in step: what was to be summed up in them is lost. Eight pixels take at
/// most twice eight times these steps, and a turn for each light and ray.
const MOST_RAYS_SOFTWARE: u32 = 64;
const MOST_STEPS_SOFTWARE: u32 = 2048;
/// Pixels that devices work on in step: where one has paths to follow, the others cost as much.
const LANES: u32 = 32;
const LANES_SOFTWARE: u32 = 8;
/// Cells and tentative collisions for each ray, on average.
const STEPS_A_RAY: u32 = 64;
/// Fewest paths of a pixel whose spread tells how well the picture is known.
const FEWEST_FOR_ERROR: u32 = 16;
/// Names of the counters, in the shader's order.
const COUNTERS: [&str; 7] = [
    "tentative_collisions",
    "cells_visited",
    "scattering_events",
    "shadow_rays",
    "paths",
    "paths_not_finite",
    "throughput_cut_1024ths",
];
/// Bytes of counters that are kept over a call, two words each.
const KEPT_COUNTER_BYTES: u64 = 8 * COUNTERS.len() as u64;
/// With the number of unfinished pixels behind them.
const COUNTER_BYTES: u64 = KEPT_COUNTER_BYTES + 4;
/// Bytes of the shader's counter buffer.
pub(super) const COUNTER_BUFFER_BYTES: u64 = 64;
/// Bytes of a path under way.
const PATH_BYTES: u64 = std::mem::size_of::<uniforms::Path>() as u64;
/// Bytes of a tile's bins.
const TILE_BYTES: u64 = 8;

/// What the path tracer keeps of a film beside the film.
pub(crate) struct PathFilm {
    /// Squared deviations and number of paths of each pixel.
    pub(super) spreads: wgpu::Buffer,
    /// What each light brings, if that is kept apart.
    pub(super) layers: Option<LightLayers>,
    /// In place of layers where there are none, and of what paths under way found for them.
    unused: [wgpu::Buffer; 2],
    /// Bins that each tile's paths relied on.
    tiles: wgpu::Buffer,
    /// Paths under way.
    paths: wgpu::Buffer,
    uniform: wgpu::Buffer,
    sums: wgpu::Buffer,
    width: u32,
    height: u32,
    /// Paths of every pixel of each strip of tiles.
    strips: Vec<u32>,
    /// Rows at work.
    band: Option<Band>,
    /// Rays of a path in the next dispatch.
    rays: u32,
    /// Bins of each tile when the last pass ended.
    tile_bins: Vec<u64>,
    /// Since the film began: throughput that was cut off, and paths.
    cut: f64,
    traced: f64,
    /// How well the film is known, once it is.
    pub estimate: Option<PathEstimate>,
    /// What the last edit left, of all tiles.
    pub tiles_kept: Option<TilesKept>,
}

#[derive(Debug, Clone, Copy)]
struct Band {
    first_row: u32,
    rows: u32,
    /// Paths its pixels shall have.
    wanted: u32,
    /// Pixels that a dispatch has left unfinished; `None` before the first.
    unfinished: Option<u32>,
}

impl Band {
    /// How many times the rays of all pixels the unfinished ones may follow in the same time: reading
    /// and writing what is kept of each pixel would take most of it otherwise.
    fn patience(&self, width: u32, lanes: u32) -> u32 {
        let groups = self.unfinished.map_or(u32::MAX, |pixels| pixels.saturating_mul(lanes));
        (self.rows * width / groups.max(1)).max(1)
    }
}

/// How well a path-traced film is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathEstimate {
    /// Root mean square of the pixels' standard errors over that of their means.
    pub relative_error: f64,
    /// Mean throughput of paths that were cut: no more than it times the largest radiance in sight
    /// is missing from the mean pixel.
    pub cut: f64,
}

/// What an edit of matter left of a path-traced film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TilesKept {
    pub total: u64,
    pub kept: u64,
}

impl PathFilm {
    /// Bytes of all buffers.
    pub fn bytes(&self) -> u64 {
        let buffers = [&self.spreads, &self.tiles, &self.paths, &self.sums];
        buffers.map(wgpu::Buffer::size).iter().sum::<u64>()
            + self.layers.as_ref().map_or(0, LightLayers::bytes)
    }

    /// Bins that the paths of each tile relied on, when the last pass ended.
    pub fn tile_bins(&self) -> &[u64] {
        &self.tile_bins
    }

    fn tiles_across(&self) -> usize {
        self.width.div_ceil(TILE_EDGE) as usize
    }
}

impl Renderer {
    /// A texel for each macrocell: the bits of its bound of the extinction, the bins it relies on, and between
    /// which values its matter lies and how fast extinction changes.
    pub(super) fn majorant_map(&self, view: &View, scene: &Scene) -> Result<wgpu::TextureView, RenderError> {
        let majorants = if view.global_majorant { Majorants::global(scene) } else { Majorants::of(scene) };
        let Majorants { bounds, rises, bins, free } = &majorants;
        let texel = |index: usize| {
            let [low, high] = halves(bins[index]);
            [bounds[index].to_bits(), low, high, Majorants::word(free[index], rises[index])]
        };
        let texels: Vec<[u32; 4]> = (0..bounds.len()).map(texel).collect();
        let [width, height, depth] = scene.volume.macrocells.dims.map(|n| n as u32);
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
        let (dimension, format) = (wgpu::TextureDimension::D3, wgpu::TextureFormat::Rgba32Uint);
        self.gpu.filled_texture("majorants", size, dimension, format, bytemuck::cast_slice(&texels))
    }

    /// The environment image and the table its directions are drawn with; a black texel without one.
    pub(super) fn environment_tables(&self, scene: &Scene) -> Result<EnvironmentTables, RenderError> {
        let Some((image, _)) = scene.environment_image() else {
            return Ok(EnvironmentTables {
                radiance: self.table("no environment", &[[0.0; 4]], [1, 1])?,
                draws: self.table("no environment", &[[0.0; 4]], [1, 1])?,
                behind: None,
            });
        };
        let size = [image.width() as u32, image.height() as u32];
        let limit = self.gpu.device.limits().max_texture_dimension_2d;
        if size.iter().any(|&edge| edge > limit) {
            return Err(RenderError::TooLarge {
                what: format!("an environment image of {} x {} texels", size[0], size[1]),
                limit: format!("{limit} texels along an edge"),
            });
        }
        let behind = match &scene.background {
            Background::Image { image: seen, .. } if seen != image => {
                Some(self.table("image behind the volume", &environment_map::radiance(seen), size)?)
            }
            _ => None,
        };
        Ok(EnvironmentTables {
            behind,
            radiance: self.table("environment", &environment_map::radiance(image), size)?,
            draws: self.table("draws of the environment", &environment_map::draws(image), size)?,
        })
    }

    /// An empty path film of the film's size.
    pub(super) fn begin_paths(
        &self,
        view: &mut View,
        scene: &Scene,
        target: Target,
    ) -> Result<(), RenderError> {
        let Target { width, height, .. } = target;
        let layers = layer_count(scene);
        let fits = |paths: &PathFilm| {
            (paths.width, paths.height) == (width, height)
                && paths.layers.as_ref().map(LightLayers::count) == layers
        };
        if !view.paths.as_ref().is_some_and(fits) {
            view.paths = None;
            view.paths = Some(self.path_film(width, height, layers)?);
        }
        let (Some(paths), Some(buffers)) = (&mut view.paths, &view.buffers) else { return Ok(()) };
        let pixels = u64::from(width) * u64::from(height);
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(&buffers.film, 0, Some(pixels * FILM_PIXEL_BYTES));
        encoder.clear_buffer(&paths.spreads, 0, None);
        encoder.clear_buffer(&paths.tiles, 0, None);
        self.gpu.queue.submit([encoder.finish()]);
        if let Some(layers) = &mut paths.layers {
            layers.begin(scene);
        }
        paths.strips.fill(0);
        (paths.band, paths.estimate, paths.tiles_kept) = (None, None, None);
        (paths.cut, paths.traced) = (0.0, 0.0);
        paths.tile_bins.clear();
        Ok(())
    }

    fn path_film(&self, width: u32, height: u32, layers: Option<usize>) -> Result<PathFilm, RenderError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let pixels = u64::from(width) * u64::from(height);
        let strips = height.div_ceil(TILE_EDGE);
        let tiles = u64::from(width.div_ceil(TILE_EDGE)) * u64::from(strips);
        let band_pixels = u64::from(self.band_rows(width).min(height)) * u64::from(width);
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let gpu = &self.gpu;
        Ok(PathFilm {
            layers: match layers {
                Some(count) => Some(LightLayers::new(gpu, count, [width, height], self.band_rows(width))?),
                None => None,
            },
            unused: [gpu.buffer("no layers", 0, usage)?, gpu.buffer("no layers", 0, usage)?],
            spreads: gpu.buffer("spreads", pixels * FILM_PIXEL_BYTES, usage)?,
            tiles: gpu.buffer("tiles", tiles * TILE_BYTES, usage)?,
            paths: gpu.buffer("paths under way", band_pixels * PATH_BYTES, usage)?,
            uniform: gpu.buffer(
                "path tracer",
                std::mem::size_of::<uniforms::PathTracer>() as u64,
                uniform,
            )?,
            sums: gpu.buffer("error sums", pixels.div_ceil(u64::from(ERROR_BLOCK)) * 8, usage)?,
            width,
            height,
            strips: vec![0; strips as usize],
            band: None,
            rays: 1,
            tile_bins: Vec::new(),
            cut: 0.0,
            traced: 0.0,
            estimate: None,
            tiles_kept: None,
        })
    }

    /// Rows of a band: whole tiles.
    fn band_rows(&self, width: u32) -> u32 {
        let pixels = if self.gpu.info().software { BAND_PIXELS_SOFTWARE } else { BAND_PIXELS };
        (pixels / width / TILE_EDGE).max(1) * TILE_EDGE
    }

    /// Tiles whose paths relied on bins in which matter changed start again.
    pub(super) fn restart_tiles(&self, view: &mut View, bins: u64) -> Result<(), RenderError> {
        let (Some(paths), Some(buffers), Some(film)) = (&mut view.paths, &view.buffers, &mut view.film)
        else {
            return Err(RenderError::Gpu("the film of an edit is missing".into()));
        };
        let met = self.read_tiles(paths)?;
        let across = paths.tiles_across();
        for (strip, tiles) in paths.strips.iter_mut().zip(met.chunks_exact(across)) {
            if tiles.iter().any(|met| met & bins != 0) {
                *strip = 0;
            }
        }
        let kept = met.iter().filter(|met| *met & bins == 0).count() as u64;
        paths.tiles_kept = Some(TilesKept { total: met.len() as u64, kept });
        paths.estimate = None;
        film.samples = paths.strips.iter().copied().min().unwrap_or(0);
        // Paths under way begin anew: they come out the same.
        paths.band = None;
        let uniform = uniforms::Restart { image: [paths.width, paths.height], bins: halves(bins) };
        self.gpu.queue.write_buffer(&paths.uniform, 0, bytemuck::bytes_of(&uniform));
        let pipeline = &self.path_tracer.restart;
        let entries = [
            buffer_entry(0, &paths.uniform),
            buffer_entry(1, &buffers.film),
            buffer_entry(2, &paths.spreads),
            buffer_entry(3, &paths.tiles),
        ];
        self.dispatch_with(pipeline, &entries, [across as u32, paths.strips.len() as u32]);
        Ok(())
    }

    fn read_tiles(&self, paths: &PathFilm) -> Result<Vec<u64>, RenderError> {
        let count = paths.tiles_across() * paths.strips.len();
        let bytes = self.gpu.read_buffer(&paths.tiles, count as u64 * TILE_BYTES)?;
        let words: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok(words.into_iter().map(|[low, high]| u64::from(low) | u64::from(high) << 32).collect())
    }

    /// One dispatch of a pipeline with a layout of its own.
    pub(super) fn dispatch_with(
        &self,
        pipeline: &wgpu::ComputePipeline,
        entries: &[wgpu::BindGroupEntry<'_>],
        groups: [u32; 2],
    ) {
        let device = &self.gpu.device;
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries,
        });
        self.gpu.dispatch(pipeline, &bind_group, groups);
    }

    /// Follows paths until the target, the error or the budget is reached. The counters of the call
    /// are added up on the device; see [`Renderer::read_path_counters`].
    pub(super) fn trace_paths(
        &mut self,
        view: &mut View,
        scene: &Scene,
        request: &DrawRequest<'_>,
        began: Instant,
    ) -> Result<(), RenderError> {
        let pipeline = self.path_tracer.pipeline(PathVariant::of(scene));
        let View { volume, transfer_function, majorants, lights, environment, film, buffers, paths, .. } =
            view;
        let (
            Some((_, texture)),
            Some((_, tables)),
            Some((_, majorants)),
            Some((_, lights)),
            Some((_, environment)),
            Some(film),
            Some(buffers),
            Some(paths),
        ) = (volume, transfer_function, majorants, lights, environment, film, buffers, paths)
        else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        let gpu = self.gpu.clone();
        gpu.queue.write_buffer(&buffers.counters, 0, &[0; COUNTER_BUFFER_BYTES as usize]);
        let bind_group = |paths: &PathFilm, band: &Band| {
            let layers = paths.layers.as_ref().and_then(|layers| layers.of_band(band.first_row));
            let [layers, findings] = layers.unwrap_or(paths.unused.each_ref());
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("path_trace"),
                layout: &self.path_tracer.bind_group_layout,
                entries: &[
                    buffer_entry(0, &buffers.frame),
                    texture_entry(1, &tables.points),
                    texture_entry(2, &tables.cells),
                    buffer_entry(3, &tables.materials),
                    buffer_entry(4, &lights.sources),
                    buffer_entry(5, &buffers.film),
                    buffer_entry(6, &buffers.counters),
                    texture_entry(7, &texture.view),
                    wgpu::BindGroupEntry {
                        binding: 8,
                        resource: wgpu::BindingResource::Sampler(&self.path_tracer.sampler),
                    },
                    texture_entry(9, majorants),
                    buffer_entry(10, &paths.paths),
                    texture_entry(20, &environment.radiance),
                    texture_entry(12, &environment.draws),
                    buffer_entry(13, &paths.uniform),
                    buffer_entry(14, &paths.spreads),
                    buffer_entry(15, &paths.tiles),
                    buffer_entry(16, layers),
                    buffer_entry(17, findings),
                ],
            })
        };
        // Of a band by its first row: each has layers of its own.
        let mut bound: Option<(u32, wgpu::BindGroup)> = None;
        self.mix_anew(paths, buffers, scene)?;
        let mut frame = frame_uniform(scene, texture, film);
        let mut uniform = path_uniform(scene);
        if paths.layers.is_some() {
            [frame.background, frame.backdrop] = behind_in_layers(scene);
        }
        let aim = request.budget.map_or(UNHURRIED_DISPATCH, |b| b.mul_f64(DISPATCH_SHARE_OF_BUDGET));
        let wanted_at_most = request.target.samples_per_pixel;
        let (most_rays, most_steps, lanes) = match gpu.info().software {
            true => (MOST_RAYS_SOFTWARE, MOST_STEPS_SOFTWARE, LANES_SOFTWARE),
            false => (MOST_RAYS, MOST_RAYS * STEPS_A_RAY, LANES),
        };
        while film.samples < wanted_at_most {
            if paths.estimate.is_some_and(|estimate| good_enough(scene, estimate.relative_error)) {
                break;
            }
            let Some(band) = self.next_band(paths, film.samples, wanted_at_most) else {
                // A pass is through.
                film.samples = paths.strips.iter().copied().min().unwrap_or(0);
                film.rows = 0;
                paths.tile_bins = self.read_tiles(paths)?;
                self.mix_changed(paths, buffers)?;
                if film.samples >= FEWEST_FOR_ERROR.min(wanted_at_most).max(2) {
                    self.estimate(paths, &buffers.film)?;
                }
                continue;
            };
            (frame.first_row, frame.row_count) = (band.first_row, band.rows);
            (uniform.wanted, uniform.fresh) = (band.wanted, u32::from(band.unfinished.is_none()));
            let rays = paths.rays.saturating_mul(band.patience(paths.width, lanes)).min(most_rays);
            (uniform.rays, uniform.steps) = (rays, (rays * STEPS_A_RAY).min(most_steps));
            gpu.queue.write_buffer(&buffers.frame, 0, bytemuck::bytes_of(&frame));
            gpu.queue.write_buffer(&paths.uniform, 0, bytemuck::bytes_of(&uniform));
            gpu.queue.write_buffer(&buffers.counters, KEPT_COUNTER_BYTES, &[0; 4]);
            let dispatch_began = Instant::now();
            let groups = [paths.width.div_ceil(TILE_EDGE), band.rows.div_ceil(TILE_EDGE)];
            let bind_group = match bound.take().filter(|(first_row, _)| *first_row == band.first_row) {
                Some((_, bind_group)) => bind_group,
                None => bind_group(paths, &band),
            };
            gpu.dispatch(&pipeline, &bind_group, groups);
            bound = Some((band.first_row, bind_group));
            if let Some(layers) = &mut paths.layers {
                layers.changed(band.first_row);
            }
            let counters = gpu.read_buffer(&buffers.counters, COUNTER_BYTES)?;
            let took = dispatch_began.elapsed();
            if took < aim / 2 {
                paths.rays = (2 * paths.rays).min(most_rays);
            } else if took > aim.mul_f64(1.5) {
                paths.rays = (paths.rays / 2).max(1);
            }
            // Something on the film is not of a whole pass any more.
            film.rows = 1;
            let unfinished = bytemuck::pod_read_unaligned(&counters[KEPT_COUNTER_BYTES as usize..]);
            if unfinished > 0 {
                paths.band = Some(Band { unfinished: Some(unfinished), ..band });
            } else {
                let first = (band.first_row / TILE_EDGE) as usize;
                let count = band.rows.div_ceil(TILE_EDGE) as usize;
                for strip in &mut paths.strips[first..first + count] {
                    *strip = band.wanted.max(*strip);
                }
                paths.band = None;
            }
            if request.budget.is_some_and(|budget| began.elapsed() >= budget) {
                break;
            }
        }
        self.mix_changed(paths, buffers)
    }

    /// The band at work, or the first that lacks paths of the present pass; `None` at its end.
    fn next_band(&self, paths: &PathFilm, samples: u32, wanted_at_most: u32) -> Option<Band> {
        if let Some(band) = paths.band {
            return Some(band);
        }
        // Passes double what is there: the first pictures come soon, and few pixels wait for the last.
        let wanted = samples.saturating_add(samples.clamp(1, MOST_PATHS_A_PASS)).min(wanted_at_most);
        let rows = self.band_rows(paths.width);
        let strips_of_a_band = (rows / TILE_EDGE) as usize;
        let index =
            paths.strips.chunks(strips_of_a_band).position(|strips| strips.iter().any(|&s| s < wanted))?;
        let first_row = index as u32 * rows;
        Some(Band { first_row, rows: rows.min(paths.height - first_row), wanted, unfinished: None })
    }

    /// Estimates how well the film is known.
    pub(super) fn estimate(&self, paths: &mut PathFilm, film: &wgpu::Buffer) -> Result<(), RenderError> {
        let relative_error = self.relative_error(paths, film)?;
        paths.estimate = Some(PathEstimate { relative_error, cut: paths.cut / paths.traced.max(1.0) });
        Ok(())
    }

    /// Relative standard error of the film.
    fn relative_error(&self, paths: &PathFilm, film: &wgpu::Buffer) -> Result<f64, RenderError> {
        let pixels = paths.width * paths.height;
        let blocks = pixels.div_ceil(ERROR_BLOCK);
        self.gpu.queue.write_buffer(&paths.uniform, 0, bytemuck::cast_slice(&[pixels, 0, 0, 0]));
        let entries = [
            buffer_entry(0, &paths.uniform),
            buffer_entry(1, film),
            buffer_entry(2, &paths.spreads),
            buffer_entry(3, &paths.sums),
        ];
        self.dispatch_with(&self.path_tracer.error, &entries, in_a_row(blocks));
        let bytes = self.gpu.read_buffer(&paths.sums, u64::from(blocks) * 8)?;
        let sums: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(&bytes);
        let total = |which: usize| sums.iter().map(|sum| f64::from(sum[which])).sum::<f64>();
        let (variance, squared_mean) = (total(0), total(1));
        Ok(if squared_mean > 0.0 { (variance / squared_mean).sqrt() } else { 0.0 })
    }

    /// Standard error of each value of [`Renderer::radiance`], of a path-traced film. With light
    /// layers it is that of one degree of freedom: the difference of two halves of the paths.
    ///
    /// # Errors
    /// GPU errors; a view whose film is not path-traced.
    pub fn standard_error(&self, view: &View) -> Result<Radiance, RenderError> {
        let (Some(film), Some(paths)) = (&view.film, &view.paths) else {
            return Err(RenderError::Gpu("the view's film is not path-traced".into()));
        };
        let bytes = u64::from(film.width) * u64::from(film.height) * FILM_PIXEL_BYTES;
        let spreads: Vec<[f32; 4]> =
            bytemuck::pod_collect_to_vec(&self.gpu.read_buffer(&paths.spreads, bytes)?);
        let error = |&[r, g, b, count]: &[f32; 4]| {
            let share = 1.0 / (count * (count - 1.0)).max(1.0);
            [r, g, b].map(|spread| (spread * share).sqrt())
        };
        let rgb = spreads.iter().flat_map(error).collect();
        Ok(Radiance { width: film.width, height: film.height, rgb })
    }

    /// The counters of the last call, by name; what was cut is added to the film's estimate.
    pub(super) fn read_path_counters(
        &self,
        view: &mut View,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<(), RenderError> {
        let (Some(buffers), Some(paths)) = (&view.buffers, &mut view.paths) else { return Ok(()) };
        let bytes = self.gpu.read_buffer(&buffers.counters, KEPT_COUNTER_BYTES)?;
        super::casting::name_counters(&COUNTERS, &bytes, counters);
        let count = |name: &str| counters.get(name).copied().unwrap_or(0) as f64;
        paths.cut += count("throughput_cut_1024ths") / 1024.0;
        paths.traced += count("paths");
        if let Some(estimate) = &mut paths.estimate {
            estimate.cut = paths.cut / paths.traced.max(1.0);
        }
        Ok(())
    }
}

fn halves(bins: u64) -> [u32; 2] {
    [bins as u32, (bins >> 32) as u32]
}

/// What does not change between the dispatches of a scene.
fn path_uniform(scene: &Scene) -> uniforms::PathTracer {
    let has_extent = |light: &scene::Light| {
        use LightGeometry::{Directional, Point, Spot};
        !matches!(light.geometry, Directional { .. } | Point { .. } | Spot { .. })
    };
    uniforms::PathTracer {
        source_count: scene.lights.len() as u32,
        orders: match scene.orders {
            Orders::All => u32::MAX,
            Orders::AtMost(count) => count,
        },
        longest: scene.paths.longest,
        clip_shadows: u32::from(scene.clip.shadows),
        last_ray_matters: u32::from(scene.glows() || scene.lights.iter().any(has_extent)),
        ..uniforms::PathTracer::default()
    }
}
