//! The light of a scene, carried over a grid and spread: what is stale is done again, slice by slice.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use glam::DVec3;
use proto::FieldError;
use proto::scene_file::{Diffusion as Kind, Illumination, LightTransport, Orders};
use scene::changes::LightChange;
use scene::light::LightGeometry;
use scene::plan::changes_of_light;
use scene::{Scene, Snapshot};

use super::diffusion::{Diffusion, Grids, largest_buffer};
use super::passes::Passes;
use super::stale::{Region, changed_region, first_plane_within};
use super::sweep::{Cells, sweeps};
use super::transport::{Lines, Matter, Transport, storage};
use super::upwind::{Fronts, Upwind};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::illumination::{Inputs, Progress};
use crate::light_field::LightField;
use crate::tables;
use crate::uniforms::{MAX_FIELD_LIGHTS, Sweep};

/// Points at which matter is looked at in one dispatch, about.
const POINTS_PER_SLICE: u64 = 4 << 20;
/// Cells composed in one dispatch, about.
const CELLS_PER_SLICE: u32 = 1 << 18;
/// Iterations after which diffusion is taken as it is; what is left is told.
const MAX_ITERATIONS: u32 = 100;
/// Longest edge of a light grid, cells.
const MAX_EDGE: u32 = 512;
/// By how much a grid that does not fit is made coarser at a time.
const COARSER: f64 = 0.9;
/// What half floats hold of the strongest light, so that diffused light may exceed it.
const STRONGEST: f64 = 4000.0;

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

/// The light of one session by this method.
pub(crate) struct ConvectionDiffusion {
    gpu: Arc<Gpu>,
    solvers: Arc<Solvers>,
    snapshot: Arc<Snapshot>,
    cells: Cells,
    matter: Matter,
    slots: Vec<Slot>,
    transmittances: wgpu::Buffer,
    diffused: Option<(Grids, wgpu::Buffer)>,
    field: LightField,
    /// Cells whose matter is not the newest scene's.
    unfilled: Option<Region>,
    carrying: Option<Carrying>,
    /// Whether D and E are not the newest matter's.
    unprepared: bool,
    /// Whether the diffused light is not that of the newest sources.
    unsolved: bool,
    /// Iterations done of a solution under way.
    iterations: Option<u32>,
    /// First cell that is not composed of the newest light; the field as a whole is, if there is none.
    uncomposed: Option<u32>,
    /// Whether direct light was composed while diffused light is under way.
    shown_direct: bool,
}

/// How the scene wants scattered light to be spread.
fn kind_of(scene: &Scene) -> Kind {
    match scene.orders {
        Orders::AtMost(1) => Kind::None,
        _ => scene.illumination.diffusion,
    }
}

/// Refuses lights that the method does not take, in words. Environment images are refused elsewhere.
///
/// # Errors
/// The field that asks for it.
pub(crate) fn check(scene: &Scene) -> Result<(), FieldError> {
    let count = carried(scene).count();
    if count > MAX_FIELD_LIGHTS {
        let message =
            format!("`convection_diffusion` takes at most {MAX_FIELD_LIGHTS} lights; there are {count}");
        return Err(FieldError::new("lights", message));
    }
    let around = scene.lights.iter().find(|light| light.geometry == LightGeometry::UniformEnvironment);
    match around {
        Some(light) if kind_of(scene) != Kind::P1 => {
            let message = "`convection_diffusion` takes light from all around only where it is diffused: \
                           with `scattering.orders` above 1 and `illumination.diffusion` `p1`";
            Err(FieldError::new(format!("lights[{}].radiance", light.id), message))
        }
        _ => Ok(()),
    }
}

/// What transmittances depend on of the settings.
fn transport_of(settings: &Illumination) -> (LightTransport, u32) {
    let steps = if settings.transport == LightTransport::Explicit { settings.explicit_steps } else { 0 };
    (settings.transport, steps)
}

/// Lights with a direction at each place, in the order of `tables::lights`.
fn carried(scene: &Scene) -> impl Iterator<Item = &scene::Light> {
    scene.lights.iter().filter(|light| {
        !matches!(light.geometry, LightGeometry::UniformEnvironment | LightGeometry::Environment { .. })
    })
}

/// The light grid of a scene: as fine as it asks for, if the device has room.
fn grid_of(scene: &Scene, gpu: &Gpu) -> Cells {
    let lights = carried(scene).count().max(1) as u64;
    let mut share = scene.illumination.light_grid;
    loop {
        let dims = scene.grid.dims.map(|n| ((n as f64 * share).round() as u32).clamp(1, MAX_EDGE));
        let cells = Cells { dims, size: scene.grid.size_world / DVec3::from_array(dims.map(f64::from)) };
        let edge = dims.iter().max().copied().unwrap_or(1) * scene.illumination.light_bands;
        let fits = largest_buffer(&cells).max(4 * lights * cells.count()) <= gpu.max_binding_bytes()
            && edge <= gpu.max_texture_edge_3d();
        if fits || cells.count() == 1 {
            return cells;
        }
        share *= COARSER;
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
            field: LightField::new(gpu, cells.dims, scene.illumination.light_bands)?,
            unfilled: Some(Region::all(&cells)),
            carrying: None,
            unprepared: true,
            unsolved: true,
            iterations: None,
            uncomposed: Some(0),
            shown_direct: false,
        };
        light.take_lights(scene)?;
        light.make_room_for_diffusion(scene)?;
        Ok(light)
    }

    /// What the ray caster reads.
    pub fn field(&self) -> Option<&LightField> {
        Some(&self.field)
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let diffused = self.diffused.as_ref().map_or(0, |(grids, leaks)| grids.bytes() + leaks.size());
        self.field.bytes() + Matter::bytes(&self.cells) + self.transmittances.size() + diffused
    }

    /// Fluence of diffused light in every cell, four floats each.
    #[cfg(test)]
    pub fn solution(&self) -> Option<&wgpu::Buffer> {
        self.diffused.as_ref().map(|(grids, _)| &grids.solution)
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
            && self.iterations.is_none()
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
        let solved = if self.unsolved || self.iterations.is_some() { 0.0 } else { 1.0 };
        0.5 * carried + 0.4 * solved * carried
    }

    /// Takes a newer snapshot: finds out what it makes stale.
    fn take(&mut self, inputs: &Inputs<'_>) -> Result<(), RenderError> {
        let new = inputs.snapshot.clone();
        let changes = changes_of_light(&self.snapshot.scene, &new.scene);
        let scene = &new.scene;
        let cells = grid_of(scene, &self.gpu);
        let same_form = cells == self.cells && scene.illumination.light_bands == self.field.bands;
        if changes.volume || !same_form {
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
        self.snapshot = new;
        if !self.is_complete() {
            self.uncomposed = Some(0);
            self.iterations = None;
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

    fn make_room_for_diffusion(&mut self, scene: &Scene) -> Result<(), RenderError> {
        self.diffused = None;
        if kind_of(scene) != Kind::None {
            let grids = self.solvers.diffusion.grids(&self.cells)?;
            let leaks = storage(&self.gpu, "leaks", 16 * self.cells.count())?;
            self.diffused = Some((grids, leaks));
        }
        Ok(())
    }

    /// One slice of what is to be done first; whether there was anything.
    fn work(
        &mut self,
        inputs: &Inputs<'_>,
        sliced: bool,
        counters: &mut BTreeMap<String, u64>,
        changed: &mut bool,
    ) -> Result<bool, RenderError> {
        let mut count = |name: &str, amount: u64| *counters.entry(name.to_owned()).or_default() += amount;
        if let Some(region) = self.unfilled {
            count("light_cells_filled", self.fill(inputs, region)?);
        } else if self.carrying.is_some() {
            count("light_cells_carried", self.carry()?);
        } else if let Some(slot) = self.slots.iter().position(|slot| slot.stale != Stale::Nothing) {
            self.begin_carrying(slot)?;
        } else if sliced && self.unsolved && !self.shown_direct && self.uncomposed.is_some() {
            // What is known of the new light is shown before all of it is.
            count("light_cells_composed", self.compose(inputs, changed)?);
            if self.uncomposed.is_none() {
                self.shown_direct = true;
                self.uncomposed = Some(0);
            }
        } else if self.unsolved {
            self.begin_solving(inputs)?;
        } else if let Some(iterations) = self.iterations {
            count("light_iterations", 1);
            self.iterate(iterations)?;
        } else if self.uncomposed.is_some() {
            count("light_cells_composed", self.compose(inputs, changed)?);
        } else {
            return Ok(false);
        }
        Ok(!self.is_complete())
    }

    /// Looks at matter in some layers of the region; how many cells.
    fn fill(&mut self, inputs: &Inputs<'_>, region: Region) -> Result<u64, RenderError> {
        let layer = self.cells.dims[0] * self.cells.dims[1];
        let points = self.solvers.transport.points(&self.cells, &self.snapshot.scene);
        let per_layer = u64::from(layer) * points.iter().map(|&n| u64::from(n)).product::<u64>();
        let layers = (POINTS_PER_SLICE / per_layer.max(1)).max(1) as u32;
        let (low, high) = (region.low[2], region.high[2]);
        let end = high.min(low + layers);
        let (first, cells) = (low * layer, (end - low) * layer);
        let Inputs { snapshot, texture, tables, .. } = inputs;
        self.solvers.transport.fill(&self.matter, &self.cells, [first, cells], snapshot, texture, tables)?;
        self.unfilled = (end < high).then_some(Region { low: [region.low[0], region.low[1], end], ..region });
        Ok(u64::from(cells))
    }

    fn begin_carrying(&mut self, slot: usize) -> Result<(), RenderError> {
        let Slot { light, stale } = &mut self.slots[slot];
        let was = *stale;
        *stale = Stale::Nothing;
        let Some((_, geometry)) = light else { return Ok(()) };
        let offset = (slot as u64 * self.cells.count()) as u32;
        let settings = &self.snapshot.scene.illumination;
        let mut carrying = Carrying { slot, was, sweeps: Vec::new(), lines: None, fronts: None };
        if settings.transport == LightTransport::Characteristics {
            for sweep in sweeps(geometry, &self.cells, offset) {
                let from = match was {
                    Stale::Behind(region) => first_plane_within(&sweep, &region),
                    _ => Some(sweep.start_plane),
                };
                carrying.sweeps.extend(from.map(|from| (sweep, from)));
            }
        } else {
            let steps = match settings.transport {
                LightTransport::Explicit => settings.explicit_steps,
                _ => 0,
            };
            let (matter, out) = (&self.matter, &self.transmittances);
            carrying.fronts = self.solvers.upwind.begin(geometry, &self.cells, offset, steps, matter, out)?;
        }
        let any = !carrying.sweeps.is_empty() || carrying.fronts.is_some();
        self.carrying = any.then_some(carrying);
        Ok(())
    }

    /// Goes on with the sweeps under way; how many cells got light.
    fn carry(&mut self) -> Result<u64, RenderError> {
        let Some(carrying) = &mut self.carrying else { return Ok(0) };
        if let Some(fronts) = &mut carrying.fronts {
            let (done, cells) = self.solvers.upwind.advance(fronts);
            if done {
                self.carrying = None;
            }
            return Ok(cells);
        }
        let transport = &self.solvers.transport;
        let mut lines = match carrying.lines.take() {
            Some(lines) => lines,
            None => match carrying.sweeps.pop() {
                Some((sweep, from)) => transport.begin(sweep, from)?,
                None => {
                    self.carrying = None;
                    return Ok(0);
                }
            },
        };
        let (done, cells) = transport.advance(&mut lines, &self.matter, &self.transmittances)?;
        if !done {
            carrying.lines = Some(lines);
        } else if carrying.sweeps.is_empty() {
            self.carrying = None;
        }
        Ok(cells)
    }

    fn slots_in_order(&self, scene: &Scene) -> Vec<u32> {
        let place = |light: &scene::Light| {
            let held = |slot: &Slot| slot.light.as_ref().is_some_and(|(id, _)| *id == light.id);
            self.slots.iter().position(held).unwrap_or(0) as u64 * self.cells.count()
        };
        carried(scene).take(MAX_FIELD_LIGHTS).map(|light| place(light) as u32).collect()
    }

    fn begin_solving(&mut self, inputs: &Inputs<'_>) -> Result<(), RenderError> {
        self.unsolved = false;
        let Some((grids, leaks)) = &self.diffused else { return Ok(()) };
        let scene = &self.snapshot.scene;
        let Solvers { passes, diffusion, .. } = &*self.solvers;
        let light = passes.light(&self.cells, scene, &self.slots_in_order(scene))?;
        let bound = super::passes::Bound {
            matter: &self.matter,
            grids,
            leaks,
            lights: &inputs.lights.lights,
            transmittances: &self.transmittances,
        };
        let heat = kind_of(scene) == Kind::Heat;
        if self.unprepared && !heat {
            passes.p1_matter(&light, &bound);
            diffusion.coarsen(grids);
        }
        let source = |from_nothing: bool| {
            if from_nothing {
                passes.clear(&grids.solution);
            }
            match heat {
                true => passes.heat(&light, &bound, scene.illumination.heat_spread as f32)?,
                false => passes.p1_source(&light, &bound),
            }
            if heat && self.unprepared {
                diffusion.coarsen(grids);
            }
            diffusion.begin(grids)
        };
        let mut norms = source(false)?;
        if norms.is_haunted() {
            norms = source(true)?;
        }
        self.unprepared = false;
        let done = norms.relative() <= scene.illumination.max_residual as f32;
        self.iterations = (!done).then_some(0);
        Ok(())
    }

    fn iterate(&mut self, iterations: u32) -> Result<(), RenderError> {
        let Some((grids, _)) = &self.diffused else {
            self.iterations = None;
            return Ok(());
        };
        let norms = self.solvers.diffusion.iterate(grids)?;
        let wanted = self.snapshot.scene.illumination.max_residual as f32;
        let done = norms.relative() <= wanted || iterations + 1 >= MAX_ITERATIONS;
        self.iterations = (!done).then_some(iterations + 1);
        Ok(())
    }

    /// Composes some cells; how many. The field has changed once all are.
    fn compose(&mut self, inputs: &Inputs<'_>, changed: &mut bool) -> Result<u64, RenderError> {
        let Some(first) = self.uncomposed else { return Ok(0) };
        let scene = &self.snapshot.scene;
        let all = self.cells.count() as u32;
        let count = CELLS_PER_SLICE.min(all - first);
        let passes = &self.solvers.passes;
        let mut light = passes.light(&self.cells, scene, &self.slots_in_order(scene))?;
        light.take(first, count);
        let scale = scale_of(scene);
        if first == 0 {
            self.field.set_scale(scale);
        }
        passes.compose(
            &light,
            &super::passes::Composed {
                matter: &self.matter,
                diffused: self.diffused.as_ref().map(|(grids, leaks)| (grids, leaks)),
                lights: &inputs.lights.lights,
                transmittances: &self.transmittances,
                field: &self.field,
                kind: if self.diffused.is_some() { kind_of(scene) } else { Kind::None },
                scale,
            },
        )?;
        self.uncomposed = (first + count < all).then_some(first + count);
        *changed |= self.uncomposed.is_none();
        Ok(u64::from(count))
    }
}

/// The radiance that the field holds as 1.
fn scale_of(scene: &Scene) -> f32 {
    let half = 0.5 * scene.grid.size_world;
    let strongest = |light: &scene::Light| {
        let power = light.power.max_element();
        match &light.geometry {
            LightGeometry::Point { position } | LightGeometry::Spot { position, .. } => {
                let beyond = (position.abs() - half).max(DVec3::ZERO).length();
                power / beyond.max(super::passes::NEAREST).powi(2)
            }
            LightGeometry::Directional { .. } => power,
            // Radiance from a hemisphere at most.
            _ => power * std::f64::consts::TAU,
        }
    };
    let lights: f64 = carried(scene).map(strongest).sum();
    let all = lights + tables::ambient(scene).max_element();
    (all / STRONGEST).clamp(1e-30, 1e30) as f32
}
