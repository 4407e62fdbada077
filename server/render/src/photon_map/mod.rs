//! Method `photon_map`: photons with historygrams, and the light field they make
//! (shaders/photon_map/README.md).

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod energy;
mod field;
mod gather;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod gather_tests;
mod lights;
mod pipelines;
pub(crate) mod stale;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod tests;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod widen_tests;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use proto::scene_file::LightGather;
use scene::scene::Snapshot;
use scene::spherical::sh;
use scene::{Light, Scene};

use crate::direct_light::DirectLight;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::illumination::{Inputs, Progress};
use crate::light_field::{self, LightField};
use crate::tables;
use field::FieldOfPhotons;
pub(crate) use field::{blocks_with, reach_of};
pub(crate) use gather::Gather;
use lights::{InFlight, Left, LightPhotons};
pub use pipelines::PhotonTrial;
pub(crate) use pipelines::{MassKept, PhotonPipelines};

/// GPU memory of a map. The software device's is the server's own.
const MAX_BYTES: u64 = 16 << 30;
const MAX_BYTES_SOFTWARE: u64 = 2 << 30;

/// Photons that are looked at, of all lights together, for what edits make stale: a share is known to
/// 0.2 % (one standard error), and 2 MiB are read back.
const PHOTONS_LOOKED_AT: u32 = 65_536;

/// Share of a band of light from one direction, scattered twice, that may be cut off.
const CUT_OFF: f64 = 0.05;

/// Where more than this share of the last band is left, all bands together cannot show the peak: they ring
/// more than few do (|g| = 0.9 on a dense ball: 27 % off with six bands, 18 % with three).
const PEAK: f64 = 0.25;

/// Of light as a surface sees it.
const BANDS_OF_A_COSINE: u32 = 3;

/// What a map is laid out for: another layout is another map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Layout {
    /// Photons of a light.
    photons: u32,
    /// Most interactions of a photon.
    slots: u32,
    /// Texels of the field.
    dims: [u32; 3],
    bands: u32,
    nearest: bool,
    volume: [u8; 32],
    /// Edges of the volume's box, world units, as bits: photons are taken out of the texels they are in.
    size_world: [u64; 3],
}

impl Layout {
    fn of(scene: &Scene) -> Self {
        use proto::scene_file::{Filter, Orders};
        let settings = &scene.illumination;
        let slots = match scene.orders {
            Orders::All => settings.photon_events,
            Orders::AtMost(count) => count.min(settings.photon_events),
        };
        Self {
            photons: settings.photons,
            slots,
            dims: light_field::dims(scene, settings.photon_grid),
            bands: bands_of(scene),
            nearest: scene.filter == Filter::Nearest,
            volume: scene.volume.content,
            size_world: scene.grid.size_world.to_array().map(f64::to_bits),
        }
    }
}

/// Whether rays gather the photons themselves.
fn is_gathered(scene: &Scene) -> bool {
    scene.illumination.gather == LightGather::Ray
}

/// Bands of the field: those that were asked for, or so many that of twice scattered light hardly
/// anything is cut off, for what is cut off rings; peaks too narrow for all are left to few. Surfaces see a
/// cosine of light, whose bands are three.
fn bands_of(scene: &Scene) -> u32 {
    let asked = scene.illumination.photon_bands;
    let needed = |point: &scene::transfer_function::Point| {
        let material = &scene.materials[point.material];
        let factors = sh::phase_bands(&material.phase);
        let seen = |least: f64| factors.iter().rposition(|factor| factor * factor > least);
        let last = match seen(PEAK) {
            Some(last) if last + 1 == factors.len() => BANDS_OF_A_COSINE,
            _ => seen(CUT_OFF).unwrap_or(0) as u32 + 1,
        };
        let least = if material.surface > 0.0 { BANDS_OF_A_COSINE } else { 2 };
        last.max(least)
    };
    let most = match asked {
        0 => scene.transfer_function.points.iter().map(needed).max().unwrap_or(1),
        _ => asked,
    };
    light_field::bands_of(scene, most)
}

/// The photon map of a session.
pub(crate) struct PhotonMap {
    layout: Layout,
    in_flight: InFlight,
    field: FieldOfPhotons,
    /// What lights with a direction bring by themselves.
    direct: DirectLight,
    /// By the light's identifier.
    lights: BTreeMap<String, LightPhotons>,
    /// What rays gather of the photons, if they do: of all of them as they are, once they are complete.
    gather: Option<Gather>,
    /// What the field was filled for: colours of lights, and how many photons share them.
    filled: Option<(Arc<Snapshot>, u64)>,
}

impl PhotonMap {
    /// # Errors
    /// Out of memory; a field too large for the device.
    pub fn new(inputs: &Inputs<'_>) -> Result<Self, RenderError> {
        let layout = Layout::of(&inputs.snapshot.scene);
        Ok(Self {
            layout,
            in_flight: InFlight::new(inputs.gpu)?,
            field: FieldOfPhotons::new(inputs.gpu, layout.dims, layout.bands)?,
            direct: DirectLight::new(inputs.direct_light.clone()),
            lights: BTreeMap::new(),
            gather: None,
            filled: None,
        })
    }

    /// Traces stale photons until the deadline, and brings the field up to what is there then.
    pub fn advance(
        &mut self,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<Progress, RenderError> {
        let scene = &inputs.snapshot.scene;
        if Layout::of(scene) != self.layout {
            *self = Self::new(inputs)?;
        }
        let direct = self.direct.advance(inputs, deadline, counters)?;
        if let Some(look_up) = self.direct.look_up(scene) {
            self.field.light.set_direct(look_up);
        }
        let mut changed = self.field.bring_mass_to(inputs)?;
        changed |= self.bring_lights_to(inputs)?;
        let mut work = Work::default();
        let is_late = || deadline.is_some_and(|deadline| Instant::now() >= deadline);
        let mut goes_on = true;
        // Of each light in turn, so that none is missing for long.
        while goes_on {
            goes_on = false;
            for (index, light) in scene.lights.iter().enumerate() {
                let Some(photons) = self.lights.get_mut(&light.id) else { continue };
                let turn = Turn { inputs, light, index, field: &self.field, layout: self.layout };
                let mut left = photons.trace_some(&turn, &mut self.in_flight, &mut work)?;
                while left == Left::SamePhotons && !is_late() {
                    left = photons.trace_some(&turn, &mut self.in_flight, &mut work)?;
                }
                goes_on |= left != Left::Nothing;
                if is_late() {
                    goes_on = false;
                    break;
                }
            }
        }
        changed |= work.dispatches > 0;
        changed |= self.gather.is_some() && !is_gathered(scene);
        if changed {
            self.gather = None;
        }
        let traced = self.lights.values().map(LightPhotons::traced).sum();
        let recoloured = self
            .filled
            .as_ref()
            .is_none_or(|(then, shared)| then.scene.lights != scene.lights || *shared != traced);
        if changed || recoloured {
            self.field.fill(inputs, &self.lights, recoloured)?;
            if let Some(gather) = &mut self.gather {
                gather.recolour(inputs.gpu, scene, &self.lights)?;
            }
            self.filled = Some((inputs.snapshot.clone(), traced));
        }
        let (current, total) = self.photons_current(inputs.snapshot);
        work.count(counters, total);
        counters.insert("bricks_recomputed".into(), self.field.bricks_filled);
        counters.insert("bricks_reused".into(), self.field.bricks() - self.field.bricks_filled);
        let share = |done: u64, all: u64| if all > 0 { done as f32 / all as f32 } else { 1.0 };
        Ok(Progress {
            complete: current == total && direct.done == direct.all,
            completeness: share(current, total).min(share(direct.done, direct.all)),
            changed: changed || recoloured || direct.changed,
        })
    }

    /// Whether rays are to gather photons that are not sorted for them.
    pub fn is_to_be_sorted(&self, scene: &Scene) -> bool {
        is_gathered(scene) && self.gather.is_none()
    }

    /// Sorts complete photons for rays.
    pub fn sort(
        &mut self,
        inputs: &Inputs<'_>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<(), RenderError> {
        let gather = Gather::new(inputs, &self.lights, &self.field)?;
        counters.insert("interactions_sorted".into(), gather.count);
        self.gather = Some(gather);
        Ok(())
    }

    /// What rays gather, if it is not to be looked up in the field.
    pub fn gather(&self) -> Option<&Gather> {
        self.gather.as_ref()
    }

    /// Drops photons of lights that are gone, and makes room for those of new ones. Whether anything
    /// was there to be dropped.
    fn bring_lights_to(&mut self, inputs: &Inputs<'_>) -> Result<bool, RenderError> {
        let scene = &inputs.snapshot.scene;
        let before = self.lights.len();
        // A light of another kind is another light: its sums have another form.
        self.lights.retain(|id, photons| {
            let light = scene.lights.iter().find(|light| light.id == *id);
            light.is_some_and(|light| tables::is_in_light_table(light) == photons.direct)
        });
        let dropped = self.lights.len() < before;
        let limit = if inputs.gpu.info().software { MAX_BYTES_SOFTWARE } else { MAX_BYTES };
        let needed =
            self.field.bytes() + scene.lights.len() as u64 * LightPhotons::bytes_of(self.layout, &self.field);
        if needed > limit {
            let Layout { photons, slots, .. } = self.layout;
            let lights = scene.lights.len();
            return Err(RenderError::TooLarge {
                what: format!(
                    "a photon map of {photons} photons with {slots} events from each of {lights} lights, {} MiB",
                    needed >> 20
                ),
                limit: format!("{} MiB; fewer photons, events or lights need less", limit >> 20),
            });
        }
        for light in &scene.lights {
            if !self.lights.contains_key(&light.id) {
                let photons = LightPhotons::new(inputs.gpu, light, self.layout, &self.field)?;
                self.lights.insert(light.id.clone(), photons);
            }
        }
        if dropped {
            self.filled = None;
        }
        Ok(dropped)
    }

    /// Photons that are the snapshot's, and all.
    fn photons_current(&self, snapshot: &Arc<Snapshot>) -> (u64, u64) {
        let total = self.lights.len() as u64 * u64::from(self.layout.photons);
        let current = self.lights.values().map(|photons| photons.current(snapshot)).sum();
        (current, total)
    }

    pub fn field(&self) -> &LightField {
        &self.field.light
    }

    pub fn into_field(self) -> LightField {
        self.field.light
    }

    /// Bins that photons relied on: of all, or of many the first of each light, which are as random as
    /// the others.
    pub fn bins_relied_on(&self, gpu: &Gpu) -> Result<Vec<u64>, RenderError> {
        let each = PHOTONS_LOOKED_AT / (self.lights.len() as u32).max(1);
        let mut bins = Vec::new();
        for photons in self.lights.values() {
            bins.extend(photons.first_bins(gpu, each)?);
        }
        Ok(bins)
    }

    pub fn bytes(&self) -> u64 {
        let photons: u64 = self.lights.values().map(LightPhotons::bytes).sum();
        let sorted = self.gather.as_ref().map_or(0, Gather::bytes);
        self.in_flight.bytes() + self.field.bytes() + self.direct.bytes() + photons + sorted
    }

    /// Every buffer of a light's photons and its sums, for tests of equality.
    #[cfg(test)]
    pub fn contents(&self, gpu: &Gpu) -> Result<BTreeMap<String, Vec<Vec<u8>>>, RenderError> {
        let direct = bytemuck::cast_slice(&self.direct.contents(gpu)?).to_vec();
        let of_lights = self.lights.iter().map(|(id, photons)| Ok((id.clone(), photons.contents(gpu)?)));
        of_lights.chain([Ok(("direct light".into(), vec![direct]))]).collect()
    }

    /// What lights with a direction bring by themselves.
    #[cfg(test)]
    pub fn direct(&self) -> &DirectLight {
        &self.direct
    }
}

impl crate::Renderer {
    /// Makes photon maps this way from now on, to compare what that costs.
    pub fn try_photons(&self, trial: PhotonTrial) {
        self.photon_pipelines.set_trial(trial);
    }
}

/// A light's turn.
struct Turn<'a> {
    inputs: &'a Inputs<'a>,
    light: &'a Light,
    /// Its place in the table of sources.
    index: usize,
    field: &'a FieldOfPhotons,
    layout: Layout,
}

/// Work of a call.
#[derive(Default)]
struct Work {
    dispatches: u64,
    tentative_collisions: u64,
    cells: u64,
    interactions: u64,
    recomputed: u64,
    cut_1024ths: u64,
    begun_again: u64,
}

impl Work {
    fn count(&self, counters: &mut BTreeMap<String, u64>, total: u64) {
        counters.insert("photons_recomputed".into(), self.recomputed);
        counters.insert("photons_reused".into(), total.saturating_sub(self.recomputed));
        counters.insert("photon_interactions".into(), self.interactions);
        counters.insert("tentative_collisions".into(), self.tentative_collisions);
        counters.insert("cells_looked_up".into(), self.cells);
        counters.insert("throughput_cut_1024ths".into(), self.cut_1024ths);
        counters.insert("lights_begun_again".into(), self.begun_again);
    }
}
