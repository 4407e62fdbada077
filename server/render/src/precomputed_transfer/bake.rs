//! A bake: each texel's answer to every basis light, for matter as it is.

use std::sync::Arc;
use std::time::Instant;

use scene::{Changes, Scene};

use super::basis::{Basis, LightVector, mean_shown, photon_factor};
use super::buffers::{Held, Tables, Workshop};
use super::carry::{PHOTON_UNIT, RAYS};
use super::compress::{Compressed, Compressing, Shape};
use super::keeping::{Keeping, Step};
use super::key::key;
use super::layout::{Layout, Share, Work, is_coloured};
use super::mass::Mass;
use super::matter::Matter;
use super::packets::{Packets, Window};
use super::passes::{GROUP, Variant};
use super::reach::Reach;
use super::store::Done;
use crate::error::RenderError;
use crate::gpu::{buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::light_field::LightField;
use crate::photon_map::reach_of;
use crate::uniforms;

/// The bake of a session, finished or under way.
pub struct Bake {
    pub(super) layout: Layout,
    /// What it is, or is becoming, the bake of: as it was when it began.
    pub(super) matter: Arc<Matter>,
    pub(super) variant: Variant,
    basis: Basis,
    pub(super) tables: Tables,
    pub(super) reach: Option<Reach>,
    pub(super) mass: Mass,
    /// Matrices and tables; `None`: there is no matter, or they are compressed.
    pub(super) held: Option<Held>,
    /// Clusters to compress the finished matrices into; 0: none.
    clusters: u32,
    pub(super) compressing: Option<Compressing>,
    compressed: Option<Compressed>,
    pub field: LightField,
    pub(super) coloured: bool,
    /// Whose losses and photons there are: directions, and photons.
    pub(super) beams: Packets,
    pub(super) packets: Packets,
    /// Directions whose losses are part of the matrices.
    pub(super) directions_done: u32,
    /// Photons at work; of each packet how many are stale, and all that were kept after the last edit.
    pub(super) at_work: Option<Window>,
    pub(super) stale: Vec<u32>,
    pub kept: u64,
    pub(super) rays: u32,
    /// Distances to changes of these bins.
    pub(super) changed_map: Option<(u64, wgpu::TextureView)>,
    /// Whether an edit was not followed to its end: some of it is light in matter as it was.
    pub(super) is_behind: bool,
    /// `None`: it is kept nowhere else.
    pub(super) keeping: Option<Keeping>,
    pub(super) share: Share,
    /// Largest memory so far, bytes.
    pub peak_bytes: u64,
}

impl Bake {
    /// `reach`: of the bake before, if there was one.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(inputs: &Inputs<'_>, mut reach: Option<Reach>) -> Result<Self, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let layout = Layout::of(scene);
        let coloured = is_coloured(scene);
        let mass = Mass::that_fits(inputs, &layout, coloured, &mut reach)?;
        let mut field = LightField::new(gpu, mass.dims, layout.bands)?;
        field.nearest = layout.nearest;
        field.faced = true;
        let basis = Basis::new(layout.lights);
        let tables = Tables::new(&basis, &layout, scene.grid.size_world, mass.dims);
        let held = match mass.rows.is_empty() {
            true => None,
            false => Some(Held::new(gpu, &layout, &tables, &mass, coloured)?),
        };
        let keeping = held.as_ref().zip(inputs.bakes).map(|(held, store)| {
            let key = key(gpu, scene, &layout, &mass, &tables.hash);
            Keeping::new(store, key, &held.matrices())
        });
        let mut bake = Self {
            matter: Arc::new(Matter::of(inputs)?),
            variant: Variant::of(scene, inputs.texture, layout.bands, coloured),
            basis,
            tables,
            reach,
            mass,
            held,
            clusters: scene.illumination.transfer_clusters,
            compressing: None,
            compressed: None,
            field,
            coloured,
            beams: Packets::default(),
            packets: Packets::default(),
            directions_done: 0,
            at_work: None,
            stale: Vec::new(),
            kept: 0,
            rays: RAYS[0],
            changed_map: None,
            is_behind: false,
            keeping,
            share: Share::default(),
            layout,
            peak_bytes: 0,
        };
        if bake.held.is_none() {
            bake.take_as_done(Done { photons: bake.layout.photons, directions: bake.layout.directions() });
        }
        bake.peak_bytes = bake.bytes();
        Ok(bake)
    }

    /// Photons and directions that there are, all of them the matter's.
    fn take_as_done(&mut self, done: Done) {
        self.directions_done = done.directions.min(self.layout.directions());
        self.beams.take_over(u64::from(self.directions_done), &self.matter);
        self.packets.take_over(done.photons.min(self.layout.photons), &self.matter);
    }

    /// Whether it is, or is becoming, the bake of a scene: lights, camera and film do not matter.
    pub fn serves(&self, scene: &Scene) -> bool {
        // Compressed matrices are those of one number of clusters.
        let recompressed = self.clusters != scene.illumination.transfer_clusters;
        if self.layout != Layout::of(scene) || recompressed && self.compressed.is_some() {
            return false;
        }
        let changes = Changes::between(&self.matter.scene, scene);
        let bins = changes.bins & scene.volume.macrocells.occurring(scene.filter);
        !changes.volume && bins == 0 && !changes.clip && !changes.clip_shadows
    }

    /// Whether every direction is marched and every photon flown: what is left is to store and to compress it.
    pub fn is_complete(&self) -> bool {
        !self.is_behind && self.has_all_directions() && self.packets.done() == self.layout.photons
    }

    fn has_all_directions(&self) -> bool {
        self.directions_done == self.layout.directions()
    }

    /// Whether some of it is light in matter as it was.
    pub fn is_behind(&self) -> bool {
        self.is_behind
    }

    /// Whether there is nothing left to do, storing and compressing it included.
    pub fn is_settled(&self) -> bool {
        let is_compressed = self.clusters == 0 || self.held.is_none();
        self.is_complete() && is_compressed && self.keeping.as_ref().is_none_or(Keeping::is_idle)
    }

    /// Whether there is nothing to do but to wait for a thread, or for somebody else.
    pub fn waits(&self) -> bool {
        let elsewhere = self.keeping.as_ref().and_then(Keeping::elsewhere);
        elsewhere.is_some() || self.compressing.as_ref().is_some_and(Compressing::waits)
    }

    /// Whether somebody else makes the same bake, and this one has not begun. Waits for a moment.
    pub fn waits_for_another(&mut self) -> bool {
        let has_begun =
            self.is_behind || self.at_work.is_some() || self.directions_done > 0 || self.packets.done() > 0;
        match (&mut self.keeping, &self.held) {
            (Some(keeping), Some(held)) if !has_begun => keeping.waits_for_another(&held.matrices()),
            _ => false,
        }
    }

    /// Into how many clusters the matrices of a bake that serves the scene go.
    pub fn compress_as(&mut self, scene: &Scene) {
        let clusters = scene.illumination.transfer_clusters;
        if clusters != self.clusters {
            self.clusters = clusters;
            self.compressing = None;
        }
    }

    /// What compression left out of the matrices, relative L2; `None`: they are not compressed.
    pub fn compression_error(&self) -> Option<f64> {
        self.compressed.as_ref().map(|compressed| compressed.error)
    }

    /// Whether it has something of all light: what follows takes noise away and nothing else.
    pub fn has_all_light(&self) -> bool {
        let has_photons = self.packets.done() > 0 || self.layout.photons == 0;
        !self.is_behind && self.has_all_directions() && has_photons
    }

    /// Share of the work that is done, in time, 0..1.
    pub fn progress(&mut self) -> f32 {
        if let Some(progress) = self.keeping.as_ref().and_then(Keeping::elsewhere) {
            return progress;
        }
        let done = [u64::from(self.directions_done), self.packets.current(&self.matter)];
        self.share.of(done, [u64::from(self.layout.directions()), self.layout.photons]) as f32
    }

    pub fn rows(&self) -> u64 {
        self.mass.rows.len() as u64
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let matrices = self.held.as_ref().map_or(0, Held::bytes);
        self.field.bytes() + matrices + self.compressed.as_ref().map_or(0, Compressed::bytes)
    }

    /// The light of a scene, made of basis lights.
    pub fn light_of(&mut self, scene: &Scene) -> LightVector {
        self.basis.light_of(scene)
    }

    /// One slice of work.
    pub fn work(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        if self.is_with_the_disk(inputs, work)? {
            return Ok(());
        }
        if self.is_complete() {
            return self.compress(inputs, work);
        }
        // A batch of photons first: from then on it is known how long the rest takes.
        let began = Instant::now();
        let is_stale = self.at_work.is_some() || self.packets.behind(&self.matter).is_some();
        let lacks_photons = self.packets.done() < self.layout.photons;
        let comes_first = self.packets.done() == 0 || self.has_all_directions();
        let carries = is_stale || lacks_photons && comes_first;
        if carries {
            self.carry(inputs, work)?;
        } else if !self.has_all_directions() {
            if self.is_behind {
                self.drop_rows(inputs)?;
            }
            self.march(inputs, work)?;
        }
        self.share.took(usize::from(carries), began.elapsed());
        self.catch_up(inputs, work)?;
        let complete = self.is_complete();
        let progress = self.progress();
        if let Some(keeping) = &mut self.keeping {
            keeping.is_worked_on(progress);
        }
        let done = Done { photons: self.packets.done(), directions: self.directions_done };
        let is_whole = self.at_work.is_none() && !self.is_behind;
        if let Some(held) = &mut self.held {
            let matrices = held.matrices();
            match &mut self.keeping {
                Some(keeping) if complete || is_whole && keeping.is_due() => {
                    keeping.write(done, &matrices);
                }
                _ => {}
            }
            if let Some(keeping) = self.keeping.as_ref().filter(|_| complete) {
                keeping.is_left();
            }
            if complete {
                held.work = None;
            }
        }
        Ok(())
    }

    /// If nothing is left of matter as it was: there is nothing but light in matter as it is.
    fn catch_up(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        let is_stale = self.at_work.is_some()
            || self.packets.behind(&self.matter).is_some()
            || self.beams.behind(&self.matter).is_some();
        if self.is_behind && !is_stale && self.has_all_directions() {
            self.drop_rows(inputs)?;
            self.is_behind = false;
            self.changed_map = None;
            work.caught_up = true;
        }
        Ok(())
    }

    /// A slice of reading or writing, if there is something to read or write.
    fn is_with_the_disk(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<bool, RenderError> {
        let (Some(keeping), Some(held)) = (&mut self.keeping, &mut self.held) else { return Ok(false) };
        let step = keeping.step(inputs.gpu, &held.matrices())?;
        match step {
            Step::Free | Step::Missed => return Ok(false),
            Step::Busy => {}
            Step::Stored => work.stored += 1,
            Step::Loaded(done) => {
                work.loaded += 1;
                let Done { photons, directions } = done;
                tracing::info!(photons, directions, "a bake goes on from where it was stored");
                self.take_as_done(done);
                if self.is_complete() {
                    self.held.iter_mut().for_each(|held| held.work = None);
                }
            }
        }
        Ok(true)
    }

    /// A slice of compressing. Compressed matrices take the place of the others.
    fn compress(&mut self, inputs: &Inputs<'_>, work: &mut Work) -> Result<(), RenderError> {
        let settings = self.settings();
        let Some(held) = &self.held else { return Ok(()) };
        let compressing = match &mut self.compressing {
            Some(compressing) => compressing,
            none => none.insert(Compressing::new(Shape::of(&settings), self.clusters)?),
        };
        let Some(clusters) = compressing.step(inputs.gpu, &held.of_light())? else { return Ok(()) };
        let compressed = Compressed::new(inputs.gpu, held, &clusters, self.layout.bands)?;
        tracing::info!(error = compressed.error, clusters = self.clusters, "baked light is compressed");
        (self.held, self.compressing, self.compressed) = (None, None, Some(compressed));
        work.compressed += 1;
        Ok(())
    }

    /// The buffers, as long as there is work to do.
    pub(super) fn at_hand(&self) -> Option<(&Held, &Workshop)> {
        self.held.as_ref().and_then(|held| Some((held, held.work.as_ref()?)))
    }

    /// What all passes are told.
    pub(super) fn settings(&self) -> uniforms::Transfer {
        let size = self.matter.scene.grid.size_world;
        let largest = f64::from(self.mass.largest);
        let factor = photon_factor(size, self.packets.done(), largest);
        uniforms::Transfer {
            dims: self.mass.dims,
            bases: self.layout.lights,
            rows: self.held.as_ref().map_or(0, |held| held.texels.len() as u32),
            bands: self.layout.bands,
            channels: if self.coloured { 3 } else { 1 },
            events: self.layout.events,
            unit: PHOTON_UNIT as f32,
            mean_shown: mean_shown(size) as f32,
            photon_factor: if self.packets.done() > 0 { factor as f32 } else { 0.0 },
            scale: 1.0,
            sign: 1,
            ..uniforms::Transfer::default()
        }
    }

    /// Light times matrices into the field.
    pub fn relight(&mut self, inputs: &Inputs<'_>, light: &LightVector) -> Result<(), RenderError> {
        let (gpu, pipelines) = (inputs.gpu, inputs.transfer_pipelines);
        self.field.set_scale(light.scale);
        self.field.set_reach(reach_of(&self.matter.scene, self.mass.dims) as f32);
        let settings = uniforms::Transfer { scale: light.scale, ..self.settings() };
        if let Some(compressed) = &self.compressed {
            return compressed.relight(gpu, pipelines, &settings, light, &self.field.view);
        }
        let Some(held) = &self.held else { return Ok(()) };
        gpu.queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
        gpu.queue.write_buffer(&held.lights, 0, bytemuck::cast_slice(&light.texels));
        let bind_group = pipelines.relight.bind(
            gpu,
            &[
                buffer_entry(21, &held.settings),
                buffer_entry(24, &held.low_words),
                buffer_entry(25, &held.masses),
                buffer_entry(26, &held.direct),
                buffer_entry(28, &held.texel_rows),
                buffer_entry(29, &held.high_words),
                buffer_entry(30, &held.lights),
                texture_entry(31, &self.field.view),
            ],
        );
        let texels: u32 = self.mass.dims.iter().product();
        let coefficients = self.layout.bands * self.layout.bands;
        gpu.dispatch(&pipelines.of(&pipelines.relight), &bind_group, [texels.div_ceil(GROUP), coefficients]);
        gpu.wait()
    }
}
