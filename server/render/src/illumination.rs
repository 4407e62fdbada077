//! Light computed ahead: what the methods keep that does not depend on the camera, for all viewers of
//! a session.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use proto::plan::StaleShares;
use proto::scene_file::Method;
use scene::plan::LightState;
use scene::{Scene, Snapshot};

use crate::convection_diffusion::{self, ConvectionDiffusion};
use crate::direct_light;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::image_based::{self, ImageBased};
use crate::light_field::LightField;
use crate::photon_map::{Gather, PhotonMap, PhotonPipelines};
use crate::precomputed_transfer::{self, BakeStore, PrecomputedTransfer};
use crate::stale_shares;
use crate::view::{EnvironmentTables, LightTables, TransferFunctionTables};
use crate::volume_texture::VolumeTexture;

/// The light of one session. Clones are the same light: views that share it see the same.
#[derive(Clone, Default)]
pub struct Light(Arc<Mutex<Illumination>>);

impl Light {
    pub(crate) fn lock(&self) -> MutexGuard<'_, Illumination> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        self.lock().bytes()
    }

    /// Whether both are the same light.
    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Forgets everything.
    pub fn clear(&self) {
        *self.lock() = Illumination::default();
    }
}

/// What a method reads of a scene on the GPU.
pub(crate) struct Inputs<'a> {
    pub gpu: &'a Arc<Gpu>,
    pub snapshot: &'a Arc<Snapshot>,
    pub texture: &'a VolumeTexture,
    pub tables: &'a TransferFunctionTables,
    /// Lights by kind, with all of their geometry.
    pub lights: &'a LightTables,
    /// Bounds of the extinction, for methods that track paths.
    pub majorants: Option<&'a wgpu::TextureView>,
    /// Distances to matter, a byte per macrocell.
    pub distance_map: Option<&'a wgpu::TextureView>,
    /// Pipelines of method `image_based`.
    pub record_passes: &'a Arc<image_based::Passes>,
    /// The environment's image; a black texel without one.
    pub environment: Option<&'a EnvironmentTables>,
    pub photon_pipelines: &'a PhotonPipelines,
    pub direct_light: &'a Arc<direct_light::Passes>,
    pub convection_diffusion: &'a convection_diffusion::Pipelines,
    pub transfer_pipelines: &'a precomputed_transfer::Pipelines,
    /// Where bakes are kept; `None`: nowhere.
    pub bakes: Option<&'a Arc<BakeStore>>,
}

/// How far a method has got.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Progress {
    /// Nothing is left to do.
    pub complete: bool,
    /// Share of the light that is the newest snapshot's, 0..1.
    pub completeness: f32,
    /// The field is not what it was before.
    pub changed: bool,
}

/// The methods that keep their light in a field.
enum Lit {
    PhotonMap(Box<PhotonMap>),
    ImageBased(Box<ImageBased>),
    ConvectionDiffusion(Box<ConvectionDiffusion>),
    PrecomputedTransfer(Box<PrecomputedTransfer>),
    /// A field from elsewhere.
    #[cfg(test)]
    Given(Box<LightField>),
}

/// The light of a session, and what it is the light of.
#[derive(Default)]
pub(crate) struct Illumination {
    lit: Option<(Method, Lit)>,
    /// The snapshot it is, or is becoming, the light of.
    snapshot: Option<Arc<Snapshot>>,
    progress: Option<Progress>,
    /// Epoch of the snapshot whose matter and lights the field shows.
    lit_epoch: u32,
    /// Counts the states of the field.
    version: u64,
    /// What edits would make stale, and of which version.
    stale_shares: Option<(u64, StaleShares)>,
}

impl Illumination {
    /// Works on the light of the snapshot until the deadline, at least one slice; until it is complete
    /// without one.
    pub fn advance(
        &mut self,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<(), RenderError> {
        let method = inputs.snapshot.scene.method;
        if self.lit.as_ref().is_some_and(|(kept, _)| *kept != method) {
            self.go_over_to(method, &inputs.snapshot.scene);
        }
        self.snapshot = Some(inputs.snapshot.clone());
        let lit = match &mut self.lit {
            Some((_, lit)) => lit,
            none => &mut none.insert((method, Lit::new(inputs)?)).1,
        };
        let advanced = lit.advance(inputs, deadline, counters);
        if advanced.is_err() {
            self.forget();
        }
        let progress = advanced?;
        self.progress = Some(progress);
        if self.lit.as_ref().is_some_and(|(_, lit)| !lit.shows_old_light()) {
            self.lit_epoch = inputs.snapshot.epoch;
        }
        if progress.changed {
            self.version += 1;
        }
        Ok(())
    }

    /// Whether light that is complete is not sorted yet for rays, which are to gather it.
    pub fn is_to_be_sorted(&self, scene: &Scene) -> bool {
        match &self.lit {
            Some((_, Lit::PhotonMap(map))) => self.is_complete() && map.is_to_be_sorted(scene),
            _ => false,
        }
    }

    /// Sorts it.
    pub fn sort(
        &mut self,
        inputs: &Inputs<'_>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<(), RenderError> {
        let Some((_, Lit::PhotonMap(map))) = &mut self.lit else { return Ok(()) };
        let sorted = map.sort(inputs, counters);
        if sorted.is_err() {
            self.forget();
        }
        self.version += 1;
        sorted
    }

    /// Another method begins. A bake takes long to have something of all light: until then the light before is
    /// shown.
    fn go_over_to(&mut self, method: Method, scene: &Scene) {
        let (lit, snapshot, lit_epoch) = (self.lit.take(), self.snapshot.take(), self.lit_epoch);
        self.forget();
        let same_box = |before: &Scene| {
            before.volume.content == scene.volume.content && before.grid.size_world == scene.grid.size_world
        };
        let before =
            snapshot.filter(|before| method == Method::PrecomputedTransfer && same_box(&before.scene));
        let field = lit.and_then(|(_, lit)| lit.into_field());
        if let Some((field, before)) = field.zip(before) {
            let bake = PrecomputedTransfer::after(field, before.scene.lights.clone());
            self.lit = Some((method, Lit::PrecomputedTransfer(Box::new(bake))));
            self.lit_epoch = lit_epoch;
        }
    }

    fn forget(&mut self) {
        *self = Self { version: self.version + 1, ..Self::default() };
    }

    /// What the plan has to know; `film_version`: in which state of the light the film was begun.
    pub fn state(&self, film_version: Option<u64>) -> LightState<'_> {
        let kept = self.field().and(self.snapshot.as_ref());
        LightState {
            scene: kept.map(|snapshot| &snapshot.scene),
            complete: self.is_complete(),
            film_is_lit_by_it: film_version == Some(self.version),
        }
    }

    pub fn is_complete(&self) -> bool {
        self.progress.is_some_and(|progress| progress.complete)
    }

    /// Share of the light that is the newest snapshot's, 0..1.
    pub fn completeness(&self) -> f32 {
        self.progress.map_or(0.0, |progress| progress.completeness)
    }

    /// Epoch of the snapshot whose light there is, before it is complete: an older one's as long as that
    /// is better than what there is of the newest.
    pub fn lit_epoch(&self) -> u32 {
        self.lit_epoch
    }

    pub fn version(&self) -> u64 {
        self.version
    }

    pub fn field(&self) -> Option<&LightField> {
        self.lit.as_ref().and_then(|(_, lit)| lit.field())
    }

    /// What rays gather instead of looking it up in the field.
    pub fn gather(&self) -> Option<&Gather> {
        match &self.lit {
            Some((_, Lit::PhotonMap(map))) => map.gather(),
            _ => None,
        }
    }

    /// What edits would make stale, once the light is complete, where the method remembers. It is read
    /// back once for each state of the light.
    pub fn stale_shares(&mut self, gpu: &Gpu) -> Result<Option<StaleShares>, RenderError> {
        if !self.is_complete() {
            return Ok(None);
        }
        if let Some((_, known)) = self.stale_shares.as_ref().filter(|(of, _)| *of == self.version) {
            return Ok(Some(known.clone()));
        }
        let (what, bins) = match &self.lit {
            Some((_, Lit::PhotonMap(map))) => ("photons", map.bins_relied_on(gpu)?),
            Some((_, Lit::PrecomputedTransfer(light))) => ("baked photons", light.bins_relied_on(gpu)?),
            _ => return Ok(None),
        };
        let shares = stale_shares::of_masks(what, &bins);
        self.stale_shares = shares.clone().map(|shares| (self.version, shares));
        Ok(shares)
    }

    pub fn bytes(&self) -> u64 {
        self.lit.as_ref().map_or(0, |(_, lit)| lit.bytes())
    }

    /// The photon map, for tests of what it holds.
    #[cfg(test)]
    pub fn photon_map(&self) -> Option<&PhotonMap> {
        match &self.lit {
            Some((_, Lit::PhotonMap(map))) => Some(map),
            _ => None,
        }
    }

    /// The baked light, if that is the method.
    #[cfg(test)]
    pub fn precomputed_transfer(&self) -> Option<&PrecomputedTransfer> {
        match &self.lit {
            Some((_, Lit::PrecomputedTransfer(light))) => Some(light),
            _ => None,
        }
    }

    /// The records, if that is the method.
    #[cfg(test)]
    pub fn image_based(&self) -> Option<&ImageBased> {
        match &self.lit {
            Some((_, Lit::ImageBased(records))) => Some(records),
            _ => None,
        }
    }

    /// Takes a field from a test as the light of every scene with this method.
    #[cfg(test)]
    pub fn give(&mut self, method: Method, field: LightField) {
        self.lit = Some((method, Lit::Given(Box::new(field))));
    }
}

impl Lit {
    fn new(inputs: &Inputs<'_>) -> Result<Self, RenderError> {
        match inputs.snapshot.scene.method {
            Method::PhotonMap => Ok(Lit::PhotonMap(Box::new(PhotonMap::new(inputs)?))),
            Method::ImageBased => {
                Ok(Lit::ImageBased(Box::new(ImageBased::new(inputs.record_passes.clone()))))
            }
            Method::ConvectionDiffusion => {
                Ok(Lit::ConvectionDiffusion(Box::new(ConvectionDiffusion::new(inputs)?)))
            }
            Method::PrecomputedTransfer => Ok(Lit::PrecomputedTransfer(Box::default())),
            other => Err(RenderError::Gpu(format!("`{}` keeps no light", other.name()))),
        }
    }

    fn advance(
        &mut self,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<Progress, RenderError> {
        match self {
            Lit::ImageBased(records) => records.advance(inputs, deadline, counters),
            Lit::PhotonMap(map) => map.advance(inputs, deadline, counters),
            #[cfg(test)]
            Lit::Given(_) => Ok(Progress { complete: true, completeness: 1.0, changed: true }),
            Lit::ConvectionDiffusion(light) => light.advance(inputs, deadline, counters),
            Lit::PrecomputedTransfer(light) => light.advance(inputs, deadline, counters),
        }
    }

    fn field(&self) -> Option<&LightField> {
        match self {
            Lit::ImageBased(records) => records.field(),
            Lit::PhotonMap(map) => Some(map.field()),
            Lit::ConvectionDiffusion(light) => light.field(),
            Lit::PrecomputedTransfer(light) => light.field(),
            #[cfg(test)]
            Lit::Given(field) => Some(field),
        }
    }

    fn into_field(self) -> Option<LightField> {
        match self {
            Lit::ImageBased(records) => records.into_field(),
            Lit::PhotonMap(map) => Some(map.into_field()),
            Lit::ConvectionDiffusion(light) => Some(light.into_field()),
            Lit::PrecomputedTransfer(_) => None,
            #[cfg(test)]
            Lit::Given(field) => Some(*field),
        }
    }

    /// Whether the field is of matter as it was before an edit.
    fn shows_old_light(&self) -> bool {
        matches!(self, Lit::PrecomputedTransfer(light) if light.shows_old_light())
    }

    fn bytes(&self) -> u64 {
        match self {
            Lit::ImageBased(records) => records.bytes(),
            Lit::PhotonMap(map) => map.bytes(),
            Lit::ConvectionDiffusion(light) => light.bytes(),
            Lit::PrecomputedTransfer(light) => light.bytes(),
            #[cfg(test)]
            Lit::Given(field) => field.bytes(),
        }
    }
}
