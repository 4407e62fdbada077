//! Casting rays into a view's film, slice by slice.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use scene::Scene;

use super::gathering::{CastRays, PHOTONS_GATHERED};
use super::tracing::COUNTER_BUFFER_BYTES;
use super::{DrawRequest, Renderer};
use crate::error::RenderError;
use crate::frame::{frame_uniform, sample_position};
use crate::gpu::{buffer_entry, texture_entry};
use crate::light_field::LightField;
use crate::photon_map::Gather;
use crate::ray_cast::{Variant, WORKGROUP_EDGE};
use crate::segments::Segments;
use crate::view::{EnvironmentTables, FilmCache, TransferFunctionTables, View, ViewBuffers};
use crate::volume_texture::VolumeTexture;

/// Length a slice aims at where no budget is given: far below any driver's watchdog.
const UNHURRIED_SLICE: Duration = Duration::from_millis(200);
/// A slice aims at this share of the budget, so that the last one seldom overshoots it by much.
const SLICE_SHARE_OF_BUDGET: f64 = 0.5;
/// The first slice of a view, whose speed is unknown, covers this share of the image's rows.
const FIRST_SLICE_SHARE: u32 = 16;
/// A slice has at least about this many pixels: below it, handing a dispatch to the device and
/// waiting for it costs more than casting the rays (3 ms on an idle software device, ten times
/// that on a busy one).
const MIN_SLICE_PIXELS: u32 = 16_384;
/// Unless they take longer than this: then it costs little beside them.
const LONG_SLICE: Duration = Duration::from_millis(100);
/// Names of the words of the counter buffer, in the shader's order.
const COUNTERS: [&str; 6] = [
    "samples_taken",
    "samples_skipped",
    "samples_on_lattice",
    "samples_with_matter",
    "segments_reused",
    "segments_cast",
];

/// The light that rays see beside that of `local`.
pub(super) struct SeenLight<'a> {
    pub field: Option<&'a LightField>,
    /// What is gathered of photons, instead of looked up in the field.
    pub gather: Option<&'a Gather>,
}

/// What every pass of the ray caster over a view reads.
struct BoundTables<'a> {
    texture: &'a VolumeTexture,
    tables: &'a TransferFunctionTables,
    distance_map: &'a wgpu::TextureView,
    lights: &'a wgpu::Buffer,
    light: &'a SeenLight<'a>,
    environment: Option<&'a EnvironmentTables>,
}

/// One sample per pixel: what its slices are dispatched with.
pub(super) struct SamplePass {
    /// Index of the sample.
    sample: u32,
    /// Whether rays are cast in segments, which are kept.
    in_segments: bool,
    /// Whether segments kept before may serve again.
    segments_kept: bool,
    pub pipeline: wgpu::ComputePipeline,
    pub bind_group: wgpu::BindGroup,
}

/// Two words a counter.
const COUNTER_BYTES: u64 = 8 * COUNTERS.len() as u64;

impl Renderer {
    /// Casts rays, rows by rows and pass by pass, until the target or the budget is reached. The last
    /// slice of the target is not waited for.
    pub(super) fn cast_rays(
        &mut self,
        view: &mut View,
        light: &SeenLight<'_>,
        scene: &Scene,
        request: &DrawRequest<'_>,
        began: Instant,
    ) -> Result<(), RenderError> {
        let View {
            volume,
            transfer_function,
            distance_map,
            lights,
            environment,
            film,
            buffers,
            segments,
            ..
        } = view;
        let (
            Some((_, texture)),
            Some((_, tables)),
            Some((_, distance_map)),
            Some((_, lights)),
            Some(film),
            Some(buffers),
        ) = (volume, transfer_function, distance_map, lights, film, buffers)
        else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        self.gpu.queue.write_buffer(&buffers.counters, 0, &[0; COUNTER_BUFFER_BYTES as usize]);
        let mut uniform = frame_uniform(scene, texture, film);
        let environment = environment.as_ref().map(|(_, tables)| tables);
        let tables =
            BoundTables { texture, tables, distance_map, lights: &lights.lights, light, environment };
        let gathered = match light.gather {
            Some(gather) => Some(self.gathering.begin(&self.gpu, gather, scene, film.width)?),
            None => None,
        };
        let mut pass: Option<SamplePass> = None;
        while film.samples < request.target.samples_per_pixel {
            let current = match pass.take().filter(|pass| pass.sample == film.samples) {
                Some(pass) => pass,
                None => self.sample_pass(scene, &tables, buffers, film, segments)?,
            };
            let size = [film.width, film.height];
            let rows = slice_rows(size, film.rows, view.millis_per_megasample, request.budget);
            let rows = gathered.as_ref().map_or(rows, |gathered| rows.min(gathered.most_rows));
            uniform.segments_kept = u32::from(current.segments_kept);
            uniform.first_row = film.rows;
            uniform.row_count = rows;
            uniform.sample_index = film.samples;
            (uniform.subpixel, uniform.lattice_shift) = sample_position(film.samples);
            let gpu = &self.gpu;
            gpu.queue.write_buffer(&buffers.frame, 0, bytemuck::bytes_of(&uniform));
            let slice_began = Instant::now();
            let groups = [film.width, rows].map(|pixels| pixels.div_ceil(WORKGROUP_EDGE));
            gpu.dispatch(&current.pipeline, &current.bind_group, groups);
            if let Some(gathered) = &gathered {
                let rays = CastRays {
                    pass: &current,
                    frame: &mut uniform,
                    buffers,
                    materials: &tables.tables.materials,
                    groups,
                };
                self.gathering.gather(gpu, gathered, rays)?;
            }
            let ends_pass = film.rows + rows >= film.height;
            // The last slice is waited for with the counters: a wait costs as much as a small picture.
            if !(ends_pass && film.samples + 1 >= request.target.samples_per_pixel) {
                gpu.wait()?;
                let megasamples = f64::from(film.width) * f64::from(rows) / 1e6;
                view.millis_per_megasample = slice_began.elapsed().as_secs_f64() * 1e3 / megasamples;
            }
            film.rows += rows;
            if ends_pass {
                if current.in_segments {
                    segments.finish(film.samples, &film.snapshot);
                }
                film.rows = 0;
                film.samples += 1;
            }
            pass = Some(current);
            if request.budget.is_some_and(|budget| began.elapsed() >= budget) {
                break;
            }
        }
        Ok(())
    }

    /// Pipeline and bindings for one sample per pixel of the film.
    fn sample_pass(
        &mut self,
        scene: &Scene,
        tables: &BoundTables<'_>,
        buffers: &ViewBuffers,
        film: &FilmCache,
        segments: &mut Segments,
    ) -> Result<SamplePass, RenderError> {
        let size = (film.width, film.height);
        let layer = film.in_segments.then(|| segments.begin(&self.gpu, size, film.samples, &film.snapshot));
        let layer = layer.flatten();
        let field = tables.light.field;
        let mut variant = Variant::of(scene, tables.texture, field);
        variant.gather = tables.light.gather.is_some();
        let mut changed_map = None;
        if let Some(layer) = &layer {
            variant.keep_segments = true;
            if let Some(distances) = &layer.changed_distances {
                changed_map = Some(self.cell_map("map of changes", scene, distances)?);
            }
        }
        let pipeline = self.ray_caster.pipeline(variant);
        let bindings = self.ray_caster.bindings(variant);
        let parts = self.gathering.parts().filter(|_| variant.gather);
        let segments = layer.as_ref().map_or(&bindings.no_segments, |layer| &layer.buffer);
        let bind_group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("ray_cast"),
            layout: &bindings.bind_group_layout,
            entries: &[
                buffer_entry(0, &buffers.frame),
                texture_entry(1, &tables.tables.points),
                texture_entry(2, &tables.tables.cells),
                buffer_entry(3, &tables.tables.materials),
                buffer_entry(4, tables.lights),
                buffer_entry(5, &buffers.film),
                buffer_entry(6, &buffers.counters),
                texture_entry(7, &tables.texture.view),
                wgpu::BindGroupEntry {
                    binding: 8,
                    resource: wgpu::BindingResource::Sampler(&bindings.sampler),
                },
                texture_entry(9, tables.distance_map),
                buffer_entry(10, segments),
                texture_entry(11, changed_map.as_ref().unwrap_or(tables.distance_map)),
                texture_entry(12, tables.texture.quads.as_ref().unwrap_or(&tables.texture.view)),
                texture_entry(13, field.map_or(&bindings.no_light, |field| &field.view)),
                wgpu::BindGroupEntry {
                    binding: 14,
                    resource: wgpu::BindingResource::Sampler(
                        &bindings.light_samplers[usize::from(field.is_some_and(|field| field.nearest))],
                    ),
                },
                buffer_entry(15, field.map_or(&buffers.frame, |field| &field.uniform)),
                texture_entry(16, field.and_then(LightField::direct).unwrap_or(&bindings.no_light)),
                buffer_entry(17, parts.unwrap_or(&bindings.no_parts)),
                texture_entry(
                    20,
                    tables.environment.map_or(&tables.tables.points, |image| {
                        image.behind.as_ref().unwrap_or(&image.radiance)
                    }),
                ),
            ],
        });
        Ok(SamplePass {
            sample: film.samples,
            in_segments: layer.is_some(),
            segments_kept: changed_map.is_some(),
            pipeline,
            bind_group,
        })
    }

    pub(super) fn read_counters(
        &self,
        view: &View,
        gathers: bool,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<(), RenderError> {
        let Some(buffers) = &view.buffers else { return Ok(()) };
        let bytes = self.gpu.read_buffer(&buffers.counters, COUNTER_BYTES)?;
        name_counters(&COUNTERS, &bytes, counters);
        if gathers {
            let bytes = self.gpu.read_part(&buffers.counters, PHOTONS_GATHERED, 8)?;
            name_counters(&["photons_gathered"], &bytes, counters);
        }
        Ok(())
    }
}

/// Counters of two words, the low one first, by their names.
pub(crate) fn name_counters(names: &[&str], bytes: &[u8], counters: &mut BTreeMap<String, u64>) {
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
    for (name, pair) in names.iter().zip(words.chunks_exact(2)) {
        counters.insert((*name).to_owned(), u64::from(pair[0]) | u64::from(pair[1]) << 32);
    }
}

/// Rows of the next slice of a picture, behind those that are done: whole workgroups, as many as fit the time a
/// slice may take.
fn slice_rows(
    [width, height]: [u32; 2],
    done: u32,
    millis_per_megasample: f64,
    budget: Option<Duration>,
) -> u32 {
    let whole_groups = |rows: u32| rows.max(1).div_ceil(WORKGROUP_EDGE) * WORKGROUP_EDGE;
    let left = height - done;
    if millis_per_megasample <= 0.0 {
        let fewest = MIN_SLICE_PIXELS.div_ceil(width);
        return whole_groups((height / FIRST_SLICE_SHARE).max(fewest)).min(left);
    }
    let row_millis = millis_per_megasample * f64::from(width) / 1e6;
    let rows_in = |time: Duration| (time.as_secs_f64() * 1e3 / row_millis).min(f64::from(height)) as u32;
    let aim = budget.map_or(UNHURRIED_SLICE, |budget| budget.mul_f64(SLICE_SHARE_OF_BUDGET));
    let fewest = MIN_SLICE_PIXELS.div_ceil(width).min(rows_in(LONG_SLICE));
    whole_groups(rows_in(aim).max(fewest)).min(left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_are_worth_their_dispatch_and_slow_rays_come_in_short_ones() {
        let rows = |millis: f64, budget: u64| {
            slice_rows([800, 600], 0, millis, (budget > 0).then(|| Duration::from_millis(budget)))
        };
        assert_eq!(rows(0.0, 20), 40, "nothing is known yet");
        assert_eq!(rows(1000.0, 20), 24, "as many pixels as a dispatch is worth");
        assert_eq!(rows(1000.0, 200), 128);
        assert_eq!(rows(1000.0, 0), 256);
        assert_eq!(rows(10_000.0, 20), 16, "a tenth of a second");
        assert_eq!(rows(200_000.0, 20), 8, "one row of workgroups at least");
        assert_eq!(rows(1e12, 20), 8);
        assert_eq!(slice_rows([800, 600], 595, 1000.0, None), 5, "no more than is left");
    }
}
