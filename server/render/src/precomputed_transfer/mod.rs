//! Method `precomputed_transfer`: every texel's answer to each of a few lights is baked once; any light
//! from infinity is then a sum of them (shaders/precomputed_transfer/README.md).

mod bake;
mod basis;
mod beams;
mod buffers;
mod compress;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod compress_tests;
mod cpca;
mod keeping;
mod key;
mod layout;
mod mass;
mod passes;
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

/// The light is not said to be whole before it is.
const NEARLY: f32 = 0.995;

/// The baked light of a session.
#[derive(Default)]
pub(crate) struct PrecomputedTransfer {
    bake: Option<Bake>,
    /// The lights that the field is of, and what they are made of.
    lit: Option<(Vec<Light>, LightVector)>,
    /// Light in matter as it was, shown until there is something of all light in matter as it is.
    old: Option<LightField>,
}

impl PrecomputedTransfer {
    /// Bakes until the deadline, at least one slice of what there is to do, and lights the field with
    /// what is baked then.
    pub fn advance(
        &mut self,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<Progress, RenderError> {
        let scene = &inputs.snapshot.scene;
        if self.bake.as_ref().is_none_or(|bake| !bake.serves(scene)) {
            // The old matrices go first: both need not fit at once.
            let (bake, lit) = (self.bake.take(), self.lit.take());
            if self.old.is_none() && lit.is_some() {
                self.old = bake.map(|bake| bake.field);
            }
            self.bake = Some(Bake::new(inputs)?);
        }
        let Some(bake) = &mut self.bake else {
            return Err(RenderError::Gpu("a bake is missing".into()));
        };
        bake.compress_as(scene);
        let mut work = Work::default();
        while !bake.is_settled() {
            bake.work(inputs, &mut work)?;
            // Others may have something to do for this thread.
            if deadline.is_some_and(|deadline| bake.waits() || Instant::now() >= deadline) {
                break;
            }
        }
        let complete = bake.is_settled();
        let mut changed = false;
        if self.old.is_none() || bake.has_all_light() {
            self.old = None;
            let kept = self.lit.take().filter(|(lights, _)| *lights == scene.lights);
            changed = work.rays + work.photons + work.loaded + work.compressed > 0 || kept.is_none();
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
        let progress = bake.progress();
        Ok(Progress { complete, completeness: if complete { 1.0 } else { progress.min(NEARLY) }, changed })
    }

    pub fn field(&self) -> Option<&LightField> {
        self.old.as_ref().or(self.bake.as_ref().map(|bake| &bake.field))
    }

    /// Whether what is shown is light in matter as it was.
    pub fn shows_old_light(&self) -> bool {
        self.old.is_some()
    }

    pub fn bytes(&self) -> u64 {
        self.bake.as_ref().map_or(0, Bake::bytes) + self.old.as_ref().map_or(0, LightField::bytes)
    }
}
