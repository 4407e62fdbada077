//! The light of a scene, carried over a grid and spread: what is stale is done again, slice by slice.

mod work;

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use proto::scene_file::Diffusion as Kind;
use scene::changes::LightChange;
use scene::light::LightGeometry;
use scene::plan::changes_of_light;
use scene::{Scene, Snapshot};

use super::diffusion::{Diffusion, Grids};
use super::outside::Outside;
use super::passes::Passes;
use super::settings::{bands_of, carried, grid_of, kind_of, transport_of};
use super::stale::{Region, changed_region};
use super::sweep::Cells;
use super::transport::{Lines, Matter, Transport, storage};
use super::upwind::{Fronts, Upwind};
use crate::direct_light::LIGHTS_A_SLAB;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::illumination::{Inputs, Progress};
use crate::light_field::{self, Direct, LightField};
use crate::skies::Skies;
use crate::uniforms::Sweep;

/// Pipelines of the method, for all sessions of a device; compiled when first needed.
#[derive(Default)]
pub(crate) struct Pipelines(OnceLock<Arc<Solvers>>);

struct Solvers {
    transport: Transport,
    upwind: Upwind,
    diffusion: Diffusion,
    passes: Passes,
}

impl Pipelines {
    fn get(&self, gpu: &Arc<Gpu>) -> Arc<Solvers> {
        let compile = || {
            Arc::new(Solvers {
                transport: Transport::new(gpu.clone()),
                upwind: Upwind::new(gpu.clone()),
                diffusion: Diffusion::new(gpu.clone()),
                passes: Passes::new(gpu.clone()),
            })
        };
        self.0.get_or_init(compile).clone()
    }
}

/// What of a light's transmittances is not the newest scene's.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stale {
    Nothing,
    /// What lies behind the cells of a region.
    Behind(Region),
    Everything,
}

impl Stale {
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (Stale::Nothing, x) | (x, Stale::Nothing) => x,
            (Stale::Behind(a), Stale::Behind(b)) => Stale::Behind(a.and(&b)),
            _ => Stale::Everything,
        }
    }
}

/// Room for one light's transmittances.
struct Slot {
    light: Option<(String, LightGeometry)>,
    stale: Stale,
}

/// Sweeps of one light under way.
struct Carrying {
    slot: usize,
    /// What was stale before.
    was: Stale,
    /// Sweeps to come, and the plane from which each is gathered; the last is next.
    sweeps: Vec<(Sweep, u32)>,
    lines: Option<Lines>,
    /// In place of sweeps, for the upwind scheme.
    fronts: Option<Fronts>,
}

/// Transmittances of four lights a slab, in half floats.
struct Slabs {
    slabs: usize,
    dims: [u32; 3],
    view: wgpu::TextureView,
}

impl Slabs {
    fn new(gpu: &Gpu, dims: [u32; 3], lights: usize) -> Result<Self, RenderError> {
        let slabs = lights.div_ceil(LIGHTS_A_SLAB).max(1);
        let [width, height, depth] = dims;
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth * slabs as u32 };
        let texture = light_field::texture(gpu, size)?;
        Ok(Self { slabs, dims, view: texture.create_view(&wgpu::TextureViewDescriptor::default()) })
    }

    fn bytes(&self) -> u64 {
        let texels = self.dims.iter().map(|&n| u64::from(n)).product::<u64>();
        light_field::TEXEL_BYTES * texels * self.slabs as u64
    }
}

/// The light of one session by this method.
pub(crate) struct ConvectionDiffusion {
    gpu: Arc<Gpu>,
    solvers: Arc<Solvers>,
    snapshot: Arc<Snapshot>,
    cells: Cells,
    matter: Matter,
    slots: Vec<Slot>,
    transmittances: wgpu::Buffer,
    diffused: Option<Grids>,
    /// Light from all around.
    outside: Outside,
    skies: Skies,
    field: LightField,
    /// Transmittances as view rays read them.
    direct: Slabs,
    /// Cells whose matter is not the newest scene's.
    unfilled: Option<Region>,
    carrying: Option<Carrying>,
    /// Whether D and E are not the newest matter's.
    unprepared: bool,
    /// Whether the diffused light is not that of the newest sources.
    unsolved: bool,
    /// A solution under way.
    solving: Option<Solving>,
    /// First cell that is not composed of the newest light; the field as a whole is, if there is none.
    uncomposed: Option<u32>,
    /// Whether direct light was composed while diffused light is under way.
    shown_direct: bool,
}

/// How far a solution has come: norms of the residual over the right-hand side's.
#[derive(Debug, Clone, Copy)]
struct Solving {
    iterations: u32,
    first: f32,
    now: f32,
}

impl Solving {
    /// Share of the digits that are wanted, 0..1: each iteration wins about as many.
    fn share(&self, wanted: f32) -> f32 {
        let share = (self.first / self.now).ln() / (self.first / wanted).ln();
        if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    }
}

impl ConvectionDiffusion {
    /// Light that is not there yet.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(inputs: &Inputs<'_>) -> Result<Self, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let cells = grid_of(scene, gpu);
        let mut light = Self {
            gpu: gpu.clone(),
            solvers: inputs.convection_diffusion.get(gpu),
            snapshot: inputs.snapshot.clone(),
            cells,
            matter: Matter::new(gpu, &cells)?,
            slots: Vec::new(),
            transmittances: storage(gpu, "transmittances", 4 * cells.count())?,
            diffused: None,
            outside: Outside::default(),
            skies: Skies::default(),
            field: LightField::new(gpu, cells.dims, bands_of(scene))?,
            direct: Slabs::new(gpu, cells.dims, carried(scene).count())?,
            unfilled: Some(Region::all(&cells)),
            carrying: None,
            unprepared: true,
            unsolved: true,
            solving: None,
            uncomposed: Some(0),
            shown_direct: false,
        };
        light.take_lights(scene)?;
        light.make_room_for_diffusion(scene)?;
        light.make_room_for_light(scene)?;
        Ok(light)
    }

    /// What the ray caster reads.
    pub fn field(&self) -> Option<&LightField> {
        Some(&self.field)
    }

    pub fn into_field(self) -> LightField {
        self.field
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let diffused = self.diffused.as_ref().map_or(0, Grids::bytes);
        self.field.bytes()
            + self.direct.bytes()
            + Matter::bytes(&self.cells)
            + self.transmittances.size()
            + diffused
    }

    /// Fluence of diffused light in every cell, four floats each.
    #[cfg(test)]
    pub fn solution(&self) -> Option<&wgpu::Buffer> {
        self.diffused.as_ref().map(|grids| &grids.solution)
    }

    /// The unit it is told in.
    #[cfg(test)]
    pub fn scale(&self) -> f64 {
        super::settings::scale_of(&self.snapshot.scene, &self.outside)
    }

    #[cfg(test)]
    pub fn cells(&self) -> Cells {
        self.cells
    }

    /// Brings the light nearer to the newest snapshot until the deadline, at least one slice.
    ///
    /// # Errors
    /// Out of memory; the device's.
    pub fn advance(
        &mut self,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<Progress, RenderError> {
        if !Arc::ptr_eq(&self.snapshot, inputs.snapshot) {
            self.take(inputs)?;
        }
        let mut changed = false;
        while self.work(inputs, deadline.is_some(), counters, &mut changed)? {
            if let Some(deadline) = deadline {
                self.gpu.wait()?;
                if Instant::now() >= deadline {
                    break;
                }
            }
        }
        let complete = self.is_complete();
        Ok(Progress { complete, completeness: self.completeness(), changed })
    }

    fn is_complete(&self) -> bool {
        self.unfilled.is_none()
            && self.carrying.is_none()
            && self.slots.iter().all(|slot| slot.stale == Stale::Nothing)
            && !self.unsolved
            && self.solving.is_none()
            && self.uncomposed.is_none()
    }

    /// Share of the light that is the newest scene's, by its stages.
    fn completeness(&self) -> f32 {
        let lights = self.slots.iter().filter(|slot| slot.light.is_some()).count().max(1) as f32;
        let stale = self.slots.iter().filter(|slot| slot.stale != Stale::Nothing).count() as f32;
        let stale = stale + if self.carrying.is_some() { 0.5 } else { 0.0 };
        let carried = if self.unfilled.is_some() { 0.0 } else { 1.0 - (stale / lights).min(1.0) };
        if self.is_complete() {
            return 1.0;
        }
        let wanted = self.snapshot.scene.illumination.max_residual as f32;
        let solved = match &self.solving {
            _ if self.unsolved => 0.0,
            Some(solving) => solving.share(wanted),
            None => 1.0,
        };
        0.5 * carried + 0.4 * solved * carried
    }

    /// Takes a newer snapshot: finds out what it makes stale.
    fn take(&mut self, inputs: &Inputs<'_>) -> Result<(), RenderError> {
        let new = inputs.snapshot.clone();
        let changes = changes_of_light(&self.snapshot.scene, &new.scene);
        if changes.is_empty() {
            // Another camera, or the same scene from another viewer.
            self.snapshot = new;
            return Ok(());
        }
        let scene = &new.scene;
        let cells = grid_of(scene, &self.gpu);
        if changes.volume || cells != self.cells {
            *self = Self::new(inputs)?;
            return Ok(());
        }
        let old_kind = kind_of(&self.snapshot.scene);
        if changes.bins != 0 || changes.clip || changes.clip_shadows {
            let everywhere = changes.clip || changes.clip_shadows;
            let region = match everywhere {
                true => Some(Region::all(&self.cells)),
                false => changed_region(scene, changes.bins, &self.cells),
            };
            if let Some(region) = region {
                self.unfilled = Some(self.unfilled.map_or(region, |other| other.and(&region)));
                self.mark_lights(Stale::Behind(region));
                self.unprepared = true;
                self.unsolved = true;
            }
        }
        self.take_lights(scene)?;
        let recolored = |(_, change): &(String, LightChange)| *change == LightChange::Recolored;
        if changes.lights.iter().any(recolored) || !changes.lights.is_empty() {
            self.unsolved = true;
        }
        if old_kind != kind_of(scene) || changes.light_settings || changes.orders {
            self.unprepared = true;
            self.unsolved = true;
            if old_kind != kind_of(scene) {
                self.make_room_for_diffusion(scene)?;
            }
        }
        if transport_of(&self.snapshot.scene.illumination) != transport_of(&scene.illumination) {
            self.mark_lights(Stale::Everything);
        }
        self.make_room_for_light(scene)?;
        self.snapshot = new;
        if !self.is_complete() {
            self.uncomposed = Some(0);
            self.solving = None;
            self.unsolved = true;
            self.shown_direct = false;
        }
        Ok(())
    }

    /// Marks what is stale of all lights; sweeps under way begin again.
    fn mark_lights(&mut self, stale: Stale) {
        if let Some(carrying) = self.carrying.take() {
            self.slots[carrying.slot].stale = carrying.was;
        }
        for slot in self.slots.iter_mut().filter(|slot| slot.light.is_some()) {
            slot.stale = slot.stale.and(stale);
        }
    }

    /// Gives every light of the scene a slot; those that are where they were keep theirs.
    fn take_lights(&mut self, scene: &Scene) -> Result<(), RenderError> {
        self.outside = Outside::of(scene, &mut self.skies);
        for slot in 0..self.slots.len() {
            let stays = self.slots[slot].light.as_ref().is_some_and(|(id, geometry)| {
                carried(scene).any(|light| light.id == *id && light.geometry == *geometry)
            });
            if !stays {
                if self.carrying.as_ref().is_some_and(|carrying| carrying.slot == slot) {
                    self.carrying = None;
                }
                self.slots[slot] = Slot { light: None, stale: Stale::Nothing };
            }
        }
        for light in carried(scene) {
            let held = |slot: &Slot| slot.light.as_ref().is_some_and(|(id, _)| *id == light.id);
            if self.slots.iter().any(held) {
                continue;
            }
            let slot =
                Slot { light: Some((light.id.clone(), light.geometry.clone())), stale: Stale::Everything };
            match self.slots.iter().position(|slot| slot.light.is_none()) {
                Some(free) => self.slots[free] = slot,
                None => self.slots.push(slot),
            }
        }
        let wanted = 4 * self.cells.count() * self.slots.len().max(1) as u64;
        if self.transmittances.size() < wanted {
            let larger = storage(&self.gpu, "transmittances", wanted)?;
            let mut encoder =
                self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&self.transmittances, 0, &larger, 0, self.transmittances.size());
            self.gpu.queue.submit([encoder.finish()]);
            self.transmittances = larger;
        }
        Ok(())
    }

    /// Gives the field the bands and the layers of transmittances that the scene needs.
    fn make_room_for_light(&mut self, scene: &Scene) -> Result<(), RenderError> {
        if self.field.bands != bands_of(scene) {
            self.field = LightField::new(&self.gpu, self.cells.dims, bands_of(scene))?;
            self.uncomposed = Some(0);
        }
        let lights = carried(scene).count();
        if self.direct.slabs * LIGHTS_A_SLAB < lights {
            self.direct = Slabs::new(&self.gpu, self.cells.dims, lights)?;
            self.uncomposed = Some(0);
        }
        // The heat flow takes direct light as well.
        match kind_of(scene) {
            Kind::Heat => self.field.take_direct_in(),
            Kind::P1 | Kind::None => {
                let dims = self.cells.dims;
                self.field.set_direct(Direct {
                    view: self.direct.view.clone(),
                    cells: dims,
                    nodes: dims,
                    near: 0.0,
                    near_parts: 0,
                    clipped_matter_blocks: scene.clip.shadows,
                });
            }
        }
        Ok(())
    }

    fn make_room_for_diffusion(&mut self, scene: &Scene) -> Result<(), RenderError> {
        self.diffused = None;
        if kind_of(scene) != Kind::None {
            self.diffused = Some(self.solvers.diffusion.grids(&self.cells)?);
        }
        Ok(())
    }
}
