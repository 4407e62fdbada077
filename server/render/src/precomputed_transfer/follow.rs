//! From the bake of a scene to that of an edited one: photons that met nothing that changed stay.

use std::sync::Arc;

use scene::Scene;

use super::bake::Bake;
use super::buffers::{HISTORY_BYTES, STORAGE, Workshop, matrix_bytes, plane_bytes};
use super::carry::groups_of;
use super::keeping::Keeping;
use super::key::key;
use super::layout::{Layout, Share, is_coloured};
use super::march::Since;
use super::mass::{Mass, NO_ROW, limit};
use super::matter::Matter;
use super::packets::PACKET;
use super::passes::Variant;
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry};
use crate::illumination::Inputs;
use crate::photon_map::stale::Query;
use crate::uniforms;

/// Photons that are looked at for what edits make stale.
const PHOTONS_LOOKED_AT: u64 = 65_536;
/// Runs of photons of different matter, at most: edits that came before the edit before was followed.
const MOST_RUNS: usize = 8;

impl Bake {
    /// Whether the bake of an edited scene may follow from this one: nothing of what it is made for has
    /// changed, and there is something to follow from.
    pub fn may_follow(&self, scene: &Scene) -> bool {
        let mut queries = self.packets.runs().map(|(_, matter)| Query::of_matter(&matter.scene, scene));
        (self.packets.done() > 0 || self.layout.photons == 0)
            && self.held.is_some()
            && self.layout == Layout::of(scene)
            && self.coloured == is_coloured(scene)
            && self.keeping.as_ref().is_none_or(|keeping| !keeping.is_reading())
            && self.packets.runs().count() < MOST_RUNS
            && !queries.any(|query| query.everything)
    }

    /// Bins that photons relied on, of no more than so many that a share is known to 0.2 %.
    pub fn bins_relied_on(&self, gpu: &Gpu) -> Result<Vec<u64>, RenderError> {
        let Some(held) = &self.held else { return Ok(Vec::new()) };
        let count = self.packets.done().min(PHOTONS_LOOKED_AT);
        let histories = gpu.read_buffer(&held.histories, count * HISTORY_BYTES)?;
        let bins = |history: &[u8]| bytemuck::pod_read_unaligned::<u64>(&history[..8]);
        Ok(histories.chunks_exact(HISTORY_BYTES as usize).map(bins).collect())
    }

    /// Whether no photons are between being taken out and coming again.
    pub fn is_free(&self) -> bool {
        self.at_work.is_none()
    }

    /// Becomes the bake of the newest scene, which it may follow to; `false`: a bake from the beginning is as
    /// quick, or is there already, and nothing has changed.
    ///
    /// # Errors
    /// GPU errors.
    pub fn follow(&mut self, inputs: &Inputs<'_>) -> Result<bool, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let variant = Variant::of(scene, inputs.texture, self.layout.bands, self.coloured);
        // What other pipelines compute may differ in the last bit.
        if variant != self.variant {
            return Ok(false);
        }
        let mass = Mass::that_fits(inputs, &self.layout, self.coloured, &mut self.reach)?;
        let key = key(gpu, scene, &self.layout, &mass, &self.tables.hash);
        let is_stored = inputs.bakes.is_some_and(|store| store.has(&key));
        if mass.dims != self.mass.dims || mass.rows.is_empty() || is_stored {
            return Ok(false);
        }
        let texels = self.texels_with(&mass);
        if !self.fits_while_moved(inputs, texels.len()) {
            return Ok(false);
        }
        match &mut self.held {
            Some(held) if held.work.is_none() => {
                held.work = Some(Workshop::new(gpu, &self.layout, &self.tables)?);
            }
            _ => {}
        }
        let stale = self.count_stale(inputs)?;
        let all: u64 = stale.iter().map(|&count| u64::from(count)).sum();
        if all as f64 > inputs.transfer_pipelines.most_stale * self.packets.done() as f64 {
            return Ok(false);
        }
        let same = |matter: &Matter| Since::between(&matter.scene, scene) == Since::Same;
        let beams_stay = mass == self.mass && self.beams.runs().all(|(_, matter)| same(matter));
        self.stale = stale;
        self.kept = self.packets.done() - all;
        self.mass = mass;
        self.matter = Arc::new(Matter::of(inputs)?);
        if beams_stay {
            self.beams.take_over(self.beams.done(), &self.matter);
        } else {
            self.directions_done = 0;
        }
        self.is_behind = true;
        // Of matrices that will be others.
        self.compressing = None;
        self.share = Share::default();
        self.keeping = inputs.bakes.map(|store| Keeping::to_write(store, key));
        self.move_rows(inputs, texels)?;
        self.peak_bytes = self.peak_bytes.max(self.bytes());
        Ok(true)
    }

    /// Of each packet how many photons are stale in the newest scene.
    fn count_stale(&self, inputs: &Inputs<'_>) -> Result<Vec<u32>, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let Some((held, workshop)) = self.at_hand() else { return Ok(Vec::new()) };
        clear(gpu, &workshop.counts);
        for (range, matter) in self.packets.runs() {
            let query = Query::of_matter(&matter.scene, scene);
            self.find_stale(inputs, (held, workshop), range, &query, false);
        }
        let packets = self.packets.done().div_ceil(u64::from(PACKET));
        Ok(bytemuck::pod_collect_to_vec(&gpu.read_buffer(&workshop.counts, 4 * packets)?))
    }

    /// Texels that have rows, and those that are to have one, in their order. As long as an edit is not
    /// followed to its end none goes: another edit may want back what photons left there.
    fn texels_with(&self, mass: &Mass) -> Vec<u32> {
        let held = self.held.iter().flat_map(|held| held.texels.iter().copied());
        let mut all: Vec<u32> = held.chain(mass.rows.iter().map(|row| row.0)).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Whether there is room for so many rows, and for each matrix once more while its rows move.
    fn fits_while_moved(&self, inputs: &Inputs<'_>, rows: usize) -> bool {
        let (largest, all) = matrix_bytes(rows as u64, &self.layout, self.coloured);
        let now = self.held.as_ref().map_or(0, |held| held.texels.len());
        let twice = if rows > now { largest } else { 0 };
        largest <= inputs.gpu.max_binding_bytes() && all + twice <= limit(inputs.gpu)
    }

    /// Once no photon is stale: back to the rows that the matter needs. What is left behind is nothing, for
    /// there is no matter near it.
    pub(super) fn drop_rows(&mut self, inputs: &Inputs<'_>) -> Result<(), RenderError> {
        let texels: Vec<u32> = self.mass.rows.iter().map(|row| row.0).collect();
        if self.held.as_ref().is_some_and(|held| held.texels != texels) {
            self.move_rows(inputs, texels)?;
        }
        if let Some(held) = self.held.as_ref().filter(|_| self.directions_done == 0) {
            clear(inputs.gpu, &held.direct);
        }
        Ok(())
    }

    /// Takes other texels as rows, and what was counted along.
    fn move_rows(&mut self, inputs: &Inputs<'_>, texels: Vec<u32>) -> Result<(), RenderError> {
        let (gpu, pipelines) = (inputs.gpu, inputs.transfer_pipelines);
        let settings = self.settings();
        let Some(held) = &mut self.held else { return Ok(()) };
        if texels != held.texels {
            let row_of = |texel: &u32| held.texels.binary_search(texel).map_or(NO_ROW, |row| row as u32);
            let old_row_of: Vec<u32> = texels.iter().map(row_of).collect();
            let (rows, old_rows) = (texels.len() as u64, held.texels.len() as u64);
            let list = gpu.buffer("rows that were", 4 * rows, STORAGE)?;
            gpu.queue.write_buffer(&list, 0, bytemuck::cast_slice(&old_row_of));
            let settings = uniforms::Transfer { rows: rows as u32, old_rows: old_rows as u32, ..settings };
            gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
            for old in [&mut held.low_words, &mut held.high_words, &mut held.fallen] {
                let numbers = old.size() / 4 / old_rows * rows;
                let new = gpu.buffer("sums that were moved", 4 * numbers, STORAGE)?;
                let entries = [
                    buffer_entry(21, &held.settings),
                    buffer_entry(29, old),
                    buffer_entry(35, &new),
                    buffer_entry(36, &list),
                ];
                let bind_group = pipelines.move_rows.bind(gpu, &entries);
                gpu.dispatch(&pipelines.of(&pipelines.move_rows), &bind_group, groups_of(numbers));
                gpu.wait()?;
                *old = new;
            }
            let plane = plane_bytes(rows, &self.layout);
            held.direct = gpu.buffer("matrices of direct light", plane, STORAGE)?;
            held.masses = gpu.buffer("extinction around texels", 16 * rows, STORAGE)?;
            held.texels = texels;
        }
        held.write_rows(gpu, &self.mass);
        Ok(())
    }
}

fn clear(gpu: &Gpu, buffer: &wgpu::Buffer) {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.clear_buffer(buffer, 0, None);
    gpu.queue.submit([encoder.finish()]);
}
