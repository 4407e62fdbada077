//! Photons of a bake: into the sums, and out of them again where matter has changed since.

use std::time::{Duration, Instant};

use proto::scene_file::Orders;

use super::bake::Bake;
use super::buffers::{COUNTER_BYTES, COUNTERS, Held, Workshop, batch_of};
use super::layout::Work;
use super::packets::{Window, window};
use super::passes::GROUP;
use crate::error::RenderError;
use crate::gpu::buffer_entry;
use crate::illumination::Inputs;
use crate::photon_map::stale::Query;
use crate::uniforms;

/// Rays of an invocation: fewest and most.
pub const RAYS: [u32; 2] = [2, 64];
/// Numbers that an invocation may add up with its rays. All loops of eight lanes together end after
/// 65,535 turns on Mesa 22's software device; a share has up to 6 functions in 8 texels.
const MOST_TURNS: u32 = 24_000;
const TURNS_OF_A_SHARE: u32 = 48;
/// Cells and tentative collisions of an invocation.
const STEPS: u32 = 16_384;
const STEPS_SOFTWARE: u32 = 4096;
/// Time a dispatch aims at.
const DISPATCH_AIM: Duration = Duration::from_millis(50);
/// Most workgroups along an axis of a dispatch.
const MAX_GROUPS: u32 = 65_535;
/// What shares are counted in: a photon begins with a throughput of about 1, its share in a texel for one
/// function is a hundredth as a rule.
pub const PHOTON_UNIT: f64 = 1.0 / 1_048_576.0;

/// Workgroups for so many invocations.
pub fn groups_of(invocations: u64) -> [u32; 2] {
    let groups = invocations.div_ceil(u64::from(GROUP)) as u32;
    let columns = groups.clamp(1, MAX_GROUPS);
    [columns, groups.div_ceil(columns)]
}

/// Bins, then blocks, as shaders take them.
pub fn words_of(query: &Query) -> [u32; 4] {
    let halves = |mask: u64| [mask as u32, (mask >> 32) as u32];
    let ([a, b], [c, d]) = (halves(query.bins), halves(query.blocks));
    [a, b, c, d]
}

impl Bake {
    /// One dispatch of photons: those that are stale first, then those that are not there yet.
    pub(super) fn carry(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        let Some(mut window) =
            self.at_work.take().map_or_else(|| self.next_window(inputs), |w| Ok(Some(w)))?
        else {
            return Ok(());
        };
        let finished = self.fly(inputs, &mut window, work)?;
        self.at_work = match (finished, window.leaving) {
            (false, _) => Some(window),
            (true, true) => Some(Window { leaving: false, entered: false, ..window }),
            (true, false) => {
                work.photons += u64::from(window.count);
                work.retraced += if window.from.is_some() { u64::from(window.count) } else { 0 };
                self.packets.take_over(window.end, &window.to);
                None
            }
        };
        Ok(())
    }

    /// Photons to be worked on next; `None`: none is stale any more, and none is missing.
    fn next_window(&mut self, inputs: &Inputs<'_>) -> Result<Option<Window>, RenderError> {
        let batch = batch_of(inputs.gpu);
        while let Some((range, from)) = self.packets.behind(&self.matter) {
            let (end, count) = window(&self.stale, range, batch);
            if count == 0 {
                self.packets.take_over(end, &self.matter);
                continue;
            }
            let query = Query::of_matter(&from.scene, &self.matter.scene);
            self.list_stale(inputs, [range[0], end], &query);
            let to = self.matter.clone();
            let from = Some(from);
            return Ok(Some(Window { end, first: 0, count, from, to, leaving: true, entered: false }));
        }
        let first = self.packets.done();
        let count = u64::from(batch).min(self.layout.photons - first);
        let window = Window {
            end: first + count,
            first,
            count: count as u32,
            from: None,
            to: self.matter.clone(),
            leaving: false,
            entered: false,
        };
        Ok((count > 0).then_some(window))
    }

    /// One dispatch; whether all photons of the window are at their ends.
    fn fly(
        &mut self,
        inputs: &Inputs<'_>,
        window: &mut Window,
        work: &mut Work,
    ) -> Result<bool, RenderError> {
        let (gpu, pipelines) = (inputs.gpu, inputs.transfer_pipelines);
        let Some((held, workshop)) = self.at_hand() else {
            return Err(RenderError::Gpu("buffers of a bake are missing".into()));
        };
        let matter = window.from.as_ref().filter(|_| window.leaving).unwrap_or(&window.to);
        let query = match &window.from {
            Some(from) => Query::of_matter(&from.scene, &window.to.scene),
            None => Query::default(),
        };
        let most_rays = MOST_TURNS / (TURNS_OF_A_SHARE * self.layout.bands * self.layout.bands);
        let settings = uniforms::Transfer {
            clip_shadows: u32::from(matter.scene.clip.shadows),
            first: window.first as u32,
            count: window.count,
            photon_rays: self.rays.min(most_rays).max(1),
            steps: if gpu.info().software { STEPS_SOFTWARE } else { STEPS },
            flights: workshop.flight_count,
            stride: workshop.stride,
            sign: if window.leaving { -1 } else { 1 },
            query: words_of(&query),
            listed: u32::from(window.from.is_some()),
            ..self.settings()
        };
        gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
        gpu.queue.write_buffer(&workshop.counters, 0, &[0; COUNTER_BYTES as usize]);
        let groups = [window.count.div_ceil(GROUP), 1];
        if !window.entered {
            let entries = [
                matter.frame(),
                buffer_entry(10, &workshop.paths),
                buffer_entry(21, &held.settings),
                buffer_entry(27, &workshop.flights),
                buffer_entry(32, &held.histories),
                buffer_entry(33, &workshop.list),
            ];
            gpu.dispatch(&pipelines.of(&pipelines.enter), &pipelines.enter.bind(gpu, &entries), groups);
            window.entered = true;
        }
        let mut entries = matter.entries(inputs, &matter.majorants, &held.settings).to_vec();
        entries.extend([
            buffer_entry(3, &matter.materials),
            buffer_entry(6, &workshop.counters),
            buffer_entry(10, &workshop.paths),
            buffer_entry(24, &held.low_words),
            buffer_entry(27, &workshop.flights),
            buffer_entry(28, &held.texel_rows),
            buffer_entry(29, &held.high_words),
            buffer_entry(32, &held.histories),
        ]);
        let bind_group = pipelines.carry.bind(gpu, &entries);
        let began = Instant::now();
        gpu.dispatch(&pipelines.carry(self.variant), &bind_group, groups);
        let bytes = gpu.read_buffer(&workshop.counters, COUNTER_BYTES)?;
        let took = began.elapsed();
        if took < DISPATCH_AIM / 2 {
            self.rays = (2 * self.rays).min(RAYS[1]);
        } else if took > 2 * DISPATCH_AIM {
            self.rays = (self.rays / 2).max(RAYS[0]);
        }
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
        let count = |i: usize| u64::from(words[2 * i]) | u64::from(words[2 * i + 1]) << 32;
        work.tentative_collisions += count(0);
        work.cells += count(1);
        work.interactions += count(2);
        // What the scene asks to leave out is not lost, nor is what leaves.
        let asked = matches!(self.layout.orders, Orders::AtMost(n) if n <= self.layout.events);
        work.cut_1024ths += if asked || window.leaving { 0 } else { count(3) };
        Ok(words[2 * COUNTERS] == 0)
    }

    /// Lists the photons of a range that relied on what changed.
    fn list_stale(&self, inputs: &Inputs<'_>, range: [u64; 2], query: &Query) {
        let Some((held, workshop)) = self.at_hand() else { return };
        inputs.gpu.queue.write_buffer(&workshop.counts, 0, &[0; 4]);
        self.find_stale(inputs, (held, workshop), range, query, true);
    }

    /// Counts stale photons of a range by packets, or lists them.
    pub(super) fn find_stale(
        &self,
        inputs: &Inputs<'_>,
        (held, workshop): (&Held, &Workshop),
        [first, end]: [u64; 2],
        query: &Query,
        lists: bool,
    ) {
        let (gpu, pipelines) = (inputs.gpu, inputs.transfer_pipelines);
        let settings = uniforms::Transfer {
            first: first as u32,
            count: (end - first) as u32,
            query: words_of(query),
            ..self.settings()
        };
        gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
        let module = if lists { &pipelines.list_stale } else { &pipelines.count_stale };
        let mut entries = vec![
            buffer_entry(21, &held.settings),
            buffer_entry(32, &held.histories),
            buffer_entry(34, &workshop.counts),
        ];
        if lists {
            entries.push(buffer_entry(33, &workshop.list));
        }
        let bind_group = module.bind(gpu, &entries);
        gpu.dispatch(&pipelines.of(module), &bind_group, groups_of(end - first));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_have_room_and_digits() {
        // All photons that may be asked for, all of their interactions in one texel, and heavier than usual;
        // and a usual share.
        let [all, usual] = [8.0 * 16_777_216.0 * 256.0, 0.01].map(|share| share / PHOTON_UNIT);
        assert!(all < 2.0_f64.powi(62) && usual > 10_000.0, "{all} {usual}");
        assert_eq!(PHOTON_UNIT.log2().fract(), 0.0);
    }

    #[test]
    fn groups_are_enough() {
        for invocations in [0, 1, 64, 65, 4_194_240, 4_194_241, 16_777_216] {
            let [columns, rows] = groups_of(invocations);
            assert!(u64::from(columns) * u64::from(rows) * 64 >= invocations && columns <= 65_535);
        }
    }
}
