//! Method `precomputed_transfer`: every texel's answer to each of a few lights is baked once; any light
//! from infinity is then a sum of them (shaders/precomputed_transfer/README.md).

mod bake;
mod basis;
mod beams;
mod buffers;
mod carry;
mod compress;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod compress_tests;
mod cpca;
mod follow;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod follow_tests;
mod keeping;
mod key;
mod layout;
mod march;
mod mass;
mod matter;
mod packets;
mod passes;
mod reach;
mod store;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod store_tests;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod tests;

use std::collections::BTreeMap;
use std::time::Instant;

use proto::FieldError;
use scene::light::LightGeometry;
use scene::{Light, Scene};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::illumination::{Inputs, Progress};
use crate::light_field::LightField;
use bake::Bake;
use basis::LightVector;
use layout::Work;
pub(crate) use passes::Pipelines;
pub use store::{BakeStore, DEFAULT_BAKE_BYTES};

/// Refuses lights that are not at infinity, in words.
///
/// # Errors
/// The light.
pub(crate) fn check(scene: &Scene) -> Result<(), FieldError> {
    let is_near = |light: &&Light| {
        !matches!(
            light.geometry,
            LightGeometry::Directional { .. }
                | LightGeometry::UniformEnvironment
                | LightGeometry::Environment { .. }
        )
    };
    let Some(light) = scene.lights.iter().find(is_near) else { return Ok(()) };
    let message = "`precomputed_transfer` takes directional lights and environments only";
    Err(FieldError::new(format!("lights[{}].type", light.index), message))
}

/// The light is not said to be whole before it is: while it is baked at most the first, then, while the bake is
/// stored and compressed, the second. Viewers get a picture where there is more than before, and so learn of it.
const NEARLY_MADE: f32 = 0.99;
const MADE: f32 = 0.995;

/// The baked light of a session.
#[derive(Default)]
pub(crate) struct PrecomputedTransfer {
    bake: Option<Bake>,
    /// The lights that the field is of, and what they are made of.
    lit: Option<(Vec<Light>, LightVector)>,
    /// Light in matter as it was, shown until there is something of all light in matter as it is.
    old: Option<LightField>,
    /// The lights of `old`, if another method made it: those of the scene have not changed since.
    lights_before: Option<Vec<Light>>,
    /// Whether the newest scene waits for photons that are at work for another one.
    waits: bool,
}

impl PrecomputedTransfer {
    /// With the light that another method made for these lights, to be shown until there is something of all
    /// light.
    pub fn after(field: LightField, lights: Vec<Light>) -> Self {
        Self { old: Some(field), lights_before: Some(lights), ..Self::default() }
    }

    /// The bake that is, or will be, the scene's: the one there is, if it serves or can follow, or a new one.
    fn bring<'a>(
        bake: &'a mut Option<Bake>,
        inputs: &Inputs<'_>,
        old: &mut Option<LightField>,
        lit: &mut Option<(Vec<Light>, LightVector)>,
    ) -> Result<&'a mut Bake, RenderError> {
        let scene = &inputs.snapshot.scene;
        let stays = match bake {
            Some(bake) if bake.serves(scene) => true,
            // Photons that were taken out have to come again first.
            Some(bake) if bake.may_follow(scene) => !bake.is_free() || bake.follow(inputs)?,
            _ => false,
        };
        if !stays {
            // The old matrices go first: both need not fit at once.
            let was_lit = lit.take().is_some();
            let (reach, field) = bake.take().map_or((None, None), |bake| (bake.reach, Some(bake.field)));
            if old.is_none() && was_lit {
                *old = field;
            }
            *bake = Some(Bake::new(inputs, reach)?);
        }
        bake.as_mut().ok_or_else(|| RenderError::Gpu("a bake is missing".into()))
    }

    /// Bakes until the deadline, at least one slice of what there is to do, and lights the field with
    /// what is baked then.
    pub fn advance(
        &mut self,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<Progress, RenderError> {
        let scene = &inputs.snapshot.scene;
        if self.lights_before.take_if(|before| *before != scene.lights).is_some() {
            self.old = None;
        }
        let mut work = Work::default();
        let bake = loop {
            let bake = Self::bring(&mut self.bake, inputs, &mut self.old, &mut self.lit)?;
            self.waits = !bake.serves(scene);
            bake.compress_as(scene);
            if bake.is_settled() && !self.waits {
                break bake;
            }
            // Who has no time to end at cannot wait for others, who may have their turn later.
            let waits_for_another = deadline.is_some() && bake.waits_for_another();
            if self.waits {
                bake.carry(inputs, &mut work)?
            } else if !waits_for_another {
                bake.work(inputs, &mut work)?
            }
            // Others may have something to do for this thread.
            if deadline.is_some_and(|deadline| bake.waits() || Instant::now() >= deadline) {
                break bake;
            }
        };
        let complete = bake.is_settled() && !self.waits;
        let mut changed = false;
        let is_mixed = bake.is_behind() || self.waits;
        if !is_mixed && (self.old.is_none() || bake.has_all_light()) {
            (self.old, self.lights_before) = (None, None);
            let kept = self.lit.take().filter(|(lights, _)| *lights == scene.lights);
            let more = work.rays + work.spread + work.photons + work.loaded + work.compressed;
            changed = more > 0 || work.caught_up || kept.is_none();
            let lit = match kept {
                Some(lit) => lit,
                None => (scene.lights.clone(), bake.light_of(scene)),
            };
            let (_, light) = self.lit.insert(lit);
            if changed {
                bake.relight(inputs, light)?;
            }
        }
        let mut count = |name: &str, value: u64| counters.insert(name.to_owned(), value);
        count("transfer_rays_marched", work.rays);
        count("transfer_photons_traced", work.photons);
        count("transfer_photons_retraced", work.retraced);
        count("transfer_photons_kept", bake.kept);
        count("transfer_interactions", work.interactions);
        count("tentative_collisions", work.tentative_collisions);
        count("cells_looked_up", work.cells);
        count("throughput_cut_1024ths", work.cut_1024ths);
        count("transfer_rows", bake.rows());
        count("transfer_rows_lit", if changed { bake.rows() } else { 0 });
        count("transfer_peak_bytes", bake.peak_bytes);
        count("bakes_loaded", work.loaded);
        count("bakes_stored", work.stored);
        if let Some(error) = bake.compression_error() {
            count("transfer_compression_error_ppm", (error * 1e6).round() as u64);
        }
        let is_made = bake.is_complete() && !self.waits;
        if is_made && !complete {
            count("transfer_made", 1);
        }
        let completeness = match is_made {
            _ if complete => 1.0,
            true => MADE,
            false => bake.progress().min(NEARLY_MADE),
        };
        Ok(Progress { complete, completeness, changed })
    }

    pub fn field(&self) -> Option<&LightField> {
        self.old.as_ref().or(self.bake.as_ref().map(|bake| &bake.field))
    }

    /// Whether what is shown is light in matter as it was.
    pub fn shows_old_light(&self) -> bool {
        let is_mixed = self.waits || self.bake.as_ref().is_some_and(Bake::is_behind);
        self.old.is_some() || is_mixed && self.lit.is_some()
    }

    /// Bins that photons relied on: of all, or of many the first, which are as random as the others.
    pub fn bins_relied_on(&self, gpu: &Gpu) -> Result<Vec<u64>, RenderError> {
        self.bake.as_ref().map_or(Ok(Vec::new()), |bake| bake.bins_relied_on(gpu))
    }

    /// The bake, for tests of what it holds.
    #[cfg(test)]
    pub fn bake(&self) -> Option<&Bake> {
        self.bake.as_ref()
    }

    pub fn bytes(&self) -> u64 {
        self.bake.as_ref().map_or(0, Bake::bytes) + self.old.as_ref().map_or(0, LightField::bytes)
    }
}
