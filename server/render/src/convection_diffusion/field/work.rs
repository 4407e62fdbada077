//! One slice of work after the other: what is stale is done again in the order of dependence.

use std::collections::BTreeMap;

use proto::scene_file::{Diffusion as Kind, LightTransport};
use scene::Scene;

use super::{Carrying, ConvectionDiffusion, Slot, Solvers, Solving, Stale};
use crate::convection_diffusion::passes::{Bound, Composed};
use crate::convection_diffusion::settings::{carried, kind_of, scale_of};
use crate::convection_diffusion::stale::{Region, first_plane_within};
use crate::convection_diffusion::sweep::sweeps;
use crate::error::RenderError;
use crate::illumination::Inputs;
use crate::uniforms::MAX_FIELD_LIGHTS;

/// Points at which matter is looked at in one dispatch, about.
const POINTS_PER_SLICE: u64 = 4 << 20;
/// Cells composed in one dispatch, about.
const CELLS_PER_SLICE: u32 = 1 << 18;
/// Iterations after which diffusion is taken as it is.
const MAX_ITERATIONS: u32 = 100;

impl ConvectionDiffusion {
    /// One slice of what is to be done first; whether there was anything.
    pub(super) fn work(
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
        } else if let Some(solving) = self.solving {
            count("light_iterations", 1);
            self.iterate(solving)?;
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
        let Some(grids) = &self.diffused else { return Ok(()) };
        let scene = &self.snapshot.scene;
        let Solvers { passes, diffusion, .. } = &*self.solvers;
        let scale = scale_of(scene, &self.outside);
        let light = passes.light(&self.cells, &self.outside, &self.slots_in_order(scene), scale)?;
        let bound = Bound {
            matter: &self.matter,
            grids,
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
        let first = norms.relative();
        let done = first <= scene.illumination.max_residual as f32;
        self.solving = (!done).then_some(Solving { iterations: 0, first, now: first });
        Ok(())
    }

    fn iterate(&mut self, solving: Solving) -> Result<(), RenderError> {
        let Some(grids) = &self.diffused else {
            self.solving = None;
            return Ok(());
        };
        let norms = self.solvers.diffusion.iterate(grids)?;
        let wanted = self.snapshot.scene.illumination.max_residual as f32;
        let iterated = Solving { iterations: solving.iterations + 1, now: norms.relative(), ..solving };
        let done = iterated.now <= wanted || iterated.iterations >= MAX_ITERATIONS;
        self.solving = (!done).then_some(iterated);
        Ok(())
    }

    /// Composes some cells; how many. The field has changed once all are.
    fn compose(&mut self, inputs: &Inputs<'_>, changed: &mut bool) -> Result<u64, RenderError> {
        let Some(first) = self.uncomposed else { return Ok(0) };
        let scene = &self.snapshot.scene;
        let all = self.cells.count() as u32;
        let count = CELLS_PER_SLICE.min(all - first);
        let passes = &self.solvers.passes;
        let scale = scale_of(scene, &self.outside);
        let mut light = passes.light(&self.cells, &self.outside, &self.slots_in_order(scene), scale)?;
        light.take(first, count);
        if first == 0 {
            self.field.set_scale(scale as f32);
        }
        passes.compose(
            &light,
            &Composed {
                matter: &self.matter,
                diffused: self.diffused.as_ref(),
                lights: &inputs.lights.lights,
                transmittances: &self.transmittances,
                field: &self.field,
                direct: &self.direct.view,
                kind: if self.diffused.is_some() { kind_of(scene) } else { Kind::None },
            },
        )?;
        self.uncomposed = (first + count < all).then_some(first + count);
        *changed |= self.uncomposed.is_none();
        Ok(u64::from(count))
    }
}
