//! Beams of a bake: what each direction's lose around the rows' texels, and what that is for the matrices.

use std::sync::Arc;

use scene::Scene;

use super::bake::Bake;
use super::basis::mean_shown;
use super::carry::groups_of;
use super::layout::Work;
use super::matter::Matter;
use crate::direct_light::{changed_bins, map_of};
use crate::error::RenderError;
use crate::gpu::{buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::uniforms;

/// Directions marched between looks at the clock.
const MARCHED_AT_ONCE: u64 = 2;
/// Directions whose losses become light between looks at the clock.
const SPREAD_AT_ONCE: u32 = 16;
/// Directions whose stale beams are marched together, and beams of these, at most: a list's bytes are four
/// times as many.
pub const STALE_AT_ONCE: u64 = 16;
pub const MOST_LISTED: u64 = 1 << 20;

/// What became of beams' ways since they were marched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Since {
    /// Nothing.
    Same,
    /// In these bins there is other extinction.
    Bins(u64),
    /// Other places are clipped.
    Other,
}

impl Since {
    pub fn between(old: &Scene, new: &Scene) -> Self {
        if old.clip != new.clip {
            return Self::Other;
        }
        match changed_bins(old, new, false) & new.volume.macrocells.occurring(new.filter) {
            0 => Self::Same,
            bins => Self::Bins(bins),
        }
    }
}

/// Beams that are marched.
#[derive(Clone, Copy)]
enum Beams {
    /// All of a direction.
    All(u32),
    /// As many as are listed.
    Listed(u32),
}

impl Bake {
    /// Some directions of light that has not been scattered: stale ones first, then those that are missing.
    pub(super) fn march(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        while let Some(([first, end], from)) = self.beams.behind(&self.matter) {
            let since = Since::between(&from.scene, &self.matter.scene);
            let end = match since {
                Since::Same => end,
                _ => end.min(first + self.directions_at_once()),
            };
            match since {
                Since::Same => {}
                Since::Bins(bins) => self.march_stale(inputs, [first, end], (&from, bins), work)?,
                Since::Other => self.march_anew(inputs, [first, end], work)?,
            }
            self.beams.take_over(end, &self.matter);
            if since != Since::Same {
                return inputs.gpu.wait();
            }
        }
        let mut marched = self.beams.done();
        if u64::from(self.directions_done) == marched {
            let last = u64::from(self.layout.directions()).min(marched + MARCHED_AT_ONCE);
            self.march_all(inputs, [marched, last], work);
            self.beams.take_over(last, &self.matter);
            marched = last;
        }
        self.spread(inputs, (marched as u32).min(self.directions_done + SPREAD_AT_ONCE), work);
        inputs.gpu.wait()
    }

    /// Directions whose stale beams are listed together.
    fn directions_at_once(&self) -> u64 {
        let beams = self.at_hand().map_or(1, |(_, workshop)| u64::from(workshop.edge * workshop.edge));
        (MOST_LISTED / beams).clamp(1, STALE_AT_ONCE)
    }

    /// All beams of directions.
    fn march_all(&self, inputs: &Inputs<'_>, [first, end]: [u64; 2], work: &mut Work) {
        for direction in first..end {
            work.rays += self.march_beams(inputs, &self.matter, 1, Beams::All(direction as u32));
        }
    }

    /// All beams of directions whose losses are known in other matter.
    fn march_anew(
        &self,
        inputs: &Inputs<'_>,
        [first, end]: [u64; 2],
        work: &mut Work,
    ) -> Result<(), RenderError> {
        let Some((held, _)) = self.at_hand() else { return Ok(()) };
        let plane = 4 * held.texels.len() as u64;
        for direction in first..end {
            let mut encoder = inputs.gpu.device.create_command_encoder(&Default::default());
            encoder.clear_buffer(&held.fallen, direction * plane, Some(plane));
            inputs.gpu.queue.submit([encoder.finish()]);
            self.march_all(inputs, [direction, direction + 1], work);
            inputs.gpu.wait()?;
        }
        Ok(())
    }

    /// Of directions' beams those on whose ways matter changed: first through matter as it was, to take
    /// away what they lost from there on.
    fn march_stale(
        &mut self,
        inputs: &Inputs<'_>,
        [first, end]: [u64; 2],
        (from, bins): (&Arc<Matter>, u64),
        work: &mut Work,
    ) -> Result<(), RenderError> {
        if self.changed_map.as_ref().is_none_or(|(of, _)| *of != bins) {
            self.changed_map = Some((bins, map_of(inputs.gpu, &self.matter.scene, bins)?));
        }
        let listed = self.list_beams(inputs, [first, end])?;
        let Some((_, workshop)) = self.at_hand() else { return Ok(()) };
        let met = mean_shown(self.matter.scene.grid.size_world) / workshop.area;
        if f64::from(listed) > inputs.transfer_pipelines.most_stale * met * (end - first) as f64 {
            return self.march_anew(inputs, [first, end], work);
        }
        if listed > 0 {
            work.rays += self.march_beams(inputs, from, -1, Beams::Listed(listed));
            work.rays += self.march_beams(inputs, &self.matter, 1, Beams::Listed(listed));
        }
        Ok(())
    }

    /// Lists stale beams of directions; how many there are.
    fn list_beams(&self, inputs: &Inputs<'_>, [first, end]: [u64; 2]) -> Result<u32, RenderError> {
        let (gpu, pipelines) = (inputs.gpu, inputs.transfer_pipelines);
        let (Some((held, workshop)), Some((_, changed))) = (self.at_hand(), &self.changed_map) else {
            return Ok(0);
        };
        let settings = uniforms::Transfer {
            clip_shadows: u32::from(self.matter.scene.clip.shadows),
            direction: first as u32,
            tests: (end - first) as u32,
            ..self.settings()
        };
        gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
        gpu.queue.write_buffer(&workshop.counters, 0, &[0; 4]);
        let entries = [
            self.matter.frame(),
            buffer_entry(6, &workshop.counters),
            texture_entry(11, changed),
            buffer_entry(21, &held.settings),
            buffer_entry(22, &workshop.beams),
            buffer_entry(34, &workshop.stale_beams),
        ];
        let beams = u64::from(workshop.edge * workshop.edge) * (end - first);
        let bind_group = pipelines.list_beams.bind(gpu, &entries);
        gpu.dispatch(&pipelines.list_beams(self.variant), &bind_group, groups_of(beams));
        Ok(bytemuck::pod_read_unaligned(&gpu.read_buffer(&workshop.counters, 4)?))
    }

    /// Beams through matter; `sign` 1: their losses come, -1: they go. How many they are.
    fn march_beams(&self, inputs: &Inputs<'_>, matter: &Matter, sign: i32, beams: Beams) -> u64 {
        let (gpu, pipelines) = (inputs.gpu, inputs.transfer_pipelines);
        let Some((held, workshop)) = self.at_hand() else { return 0 };
        let (direction, count, listed) = match beams {
            Beams::All(direction) => (direction, workshop.edge * workshop.edge, 0),
            Beams::Listed(count) => (0, count, 1),
        };
        let settings = uniforms::Transfer {
            clip_shadows: u32::from(matter.scene.clip.shadows),
            unit: workshop.beam_unit,
            direction,
            count,
            listed,
            sign,
            ..self.settings()
        };
        gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
        let quads = inputs.texture.quads.as_ref().unwrap_or(&inputs.texture.view);
        let changed = self.changed_map.as_ref().map_or(&matter.distance_map, |(_, map)| map);
        let mut entries = matter.entries(inputs, &matter.distance_map, &held.settings).to_vec();
        entries.extend([
            texture_entry(11, changed),
            texture_entry(12, quads),
            texture_entry(13, &matter.majorants),
            buffer_entry(22, &workshop.beams),
            buffer_entry(24, &held.fallen),
            buffer_entry(28, &held.texel_rows),
            buffer_entry(33, &workshop.stale_beams),
        ]);
        let bind_group = pipelines.march.bind(gpu, &entries);
        gpu.dispatch(&pipelines.march(self.variant), &bind_group, groups_of(u64::from(count)));
        u64::from(count)
    }

    /// What the beams of directions up to `last` lost becomes direct light.
    fn spread(&mut self, inputs: &Inputs<'_>, last: u32, work: &mut Work) {
        let (gpu, pipelines) = (inputs.gpu, inputs.transfer_pipelines);
        let Some((held, workshop)) = self.at_hand() else { return };
        let entries = [
            buffer_entry(21, &held.settings),
            buffer_entry(23, &workshop.integrals),
            buffer_entry(24, &held.fallen),
            buffer_entry(26, &held.direct),
        ];
        let bind_group = pipelines.spread.bind(gpu, &entries);
        let settings = uniforms::Transfer {
            unit: workshop.beam_unit,
            beam_area: (workshop.area / f64::from(self.mass.largest)) as f32,
            ..self.settings()
        };
        for direction in self.directions_done..last {
            let [first_entry, last_entry] = self.tables.entries(direction);
            let settings = uniforms::Transfer { direction, first_entry, last_entry, ..settings };
            gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
            let groups = groups_of(u64::from(settings.rows));
            gpu.dispatch(&pipelines.of(&pipelines.spread), &bind_group, groups);
        }
        work.spread += u64::from(last - self.directions_done);
        self.directions_done = last;
    }
}
