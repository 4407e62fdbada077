//! Passes between transport and diffusion: what diffusion starts from, and what becomes of both.

use std::sync::Arc;

use super::diffusion::Grids;
use super::outside::Outside;
use super::sweep::Cells;
use super::transport::{Matter, bind, groups_of, light_grid, pipeline, uniform};
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::light_field::LightField;
use crate::shaders;
use crate::tables;
use crate::uniforms::{Compose, Heat, MAX_FIELD_LIGHTS, Sources};
use proto::scene_file::Diffusion as Kind;

/// Nearer to a point or spot light than this, world units, light is no stronger; as in direct.wgsl.
pub const NEAREST: f64 = 0.02;

/// Pipelines of the passes here.
pub struct Passes {
    gpu: Arc<Gpu>,
    p1_matter: wgpu::ComputePipeline,
    p1_source: wgpu::ComputePipeline,
    heat: wgpu::ComputePipeline,
    compose: wgpu::ComputePipeline,
}

/// What passes over cells are told of a scene.
pub struct Light {
    cells: Cells,
    count: u32,
    grid: wgpu::Buffer,
    sources: wgpu::Buffer,
    gpu: Arc<Gpu>,
}

impl Light {
    /// Goes over some cells alone.
    pub fn take(&mut self, first: u32, count: u32) {
        self.count = count;
        let grid = light_grid(&self.cells, first, count);
        self.gpu.queue.write_buffer(&self.grid, 0, bytemuck::bytes_of(&grid));
    }
}

/// What the source of diffusion is made from, and where it goes.
pub struct Bound<'a> {
    /// Matter in the cells.
    pub matter: &'a Matter,
    /// The solver's grids.
    pub grids: &'a Grids,
    /// The table of lights.
    pub lights: &'a wgpu::Buffer,
    /// Of all lights.
    pub transmittances: &'a wgpu::Buffer,
}

/// What a field is composed of.
pub struct Composed<'a> {
    /// Matter in the cells.
    pub matter: &'a Matter,
    /// Grids of the solver, where light is diffused.
    pub diffused: Option<&'a Grids>,
    /// The table of lights.
    pub lights: &'a wgpu::Buffer,
    /// Of all lights.
    pub transmittances: &'a wgpu::Buffer,
    /// What is written: diffused light, and transmittances, four lights a slab.
    pub field: &'a LightField,
    pub direct: &'a wgpu::TextureView,
    /// How light is diffused.
    pub kind: Kind,
}

impl Passes {
    /// Compiles them.
    pub fn new(gpu: Arc<Gpu>) -> Self {
        Self {
            p1_matter: pipeline(&gpu, "p1_matter", shaders::P1_MATTER, &[]),
            p1_source: pipeline(&gpu, "p1_source", shaders::P1_SOURCE, &[]),
            heat: pipeline(&gpu, "heat_matter", shaders::HEAT_MATTER, &[]),
            compose: pipeline(&gpu, "compose_field", shaders::COMPOSE_FIELD, &[]),
            gpu,
        }
    }

    /// What the passes are told of the light of a scene, whose transmittances begin at `slots`, over all
    /// cells; it is told in units of `scale`.
    ///
    /// # Errors
    /// Out of memory.
    pub fn light(
        &self,
        cells: &Cells,
        outside: &Outside,
        slots: &[u32],
        scale: f64,
    ) -> Result<Light, RenderError> {
        let mut sources = Sources {
            ambient: tables::vector(outside.mean / scale),
            outside: outside
                .on_faces
                .map(|irradiance| (4.0 / scale * irradiance).as_vec3().extend(0.0).to_array()),
            inverse_scale: (1.0 / scale) as f32,
            count: slots.len().min(MAX_FIELD_LIGHTS) as u32,
            ..Sources::default()
        };
        for (place, &slot) in sources.slots.as_flattened_mut().iter_mut().zip(slots) {
            *place = slot;
        }
        let count = cells.count() as u32;
        Ok(Light {
            cells: *cells,
            count,
            grid: uniform(&self.gpu, "light grid", &light_grid(cells, 0, count))?,
            sources: uniform(&self.gpu, "sources", &sources)?,
            gpu: self.gpu.clone(),
        })
    }

    /// D and E of the P1 approximation.
    pub fn p1_matter(&self, light: &Light, bound: &Bound<'_>) {
        self.run(
            &self.p1_matter,
            light,
            &[
                buffer_entry(20, &light.grid),
                buffer_entry(22, &bound.matter.cosines),
                texture_entry(24, &bound.matter.coefficients),
                buffer_entry(31, &bound.grids.flows),
                buffer_entry(32, &bound.grids.losses),
            ],
        );
    }

    /// The source of the P1 approximation.
    pub fn p1_source(&self, light: &Light, bound: &Bound<'_>) {
        self.run(
            &self.p1_source,
            light,
            &[
                buffer_entry(4, bound.lights),
                buffer_entry(20, &light.grid),
                texture_entry(24, &bound.matter.coefficients),
                buffer_entry(29, bound.transmittances),
                buffer_entry(31, &bound.grids.flows),
                buffer_entry(34, &bound.grids.residuals),
                buffer_entry(40, &light.sources),
            ],
        );
    }

    /// D, E and the source of the heat flow.
    ///
    /// # Errors
    /// Out of memory.
    pub fn heat(&self, light: &Light, bound: &Bound<'_>, spread: f32) -> Result<(), RenderError> {
        let heat = uniform(&self.gpu, "heat", &Heat { spread, ..Heat::default() })?;
        self.run(
            &self.heat,
            light,
            &[
                buffer_entry(4, bound.lights),
                buffer_entry(20, &light.grid),
                texture_entry(24, &bound.matter.coefficients),
                buffer_entry(29, bound.transmittances),
                buffer_entry(31, &bound.grids.flows),
                buffer_entry(32, &bound.grids.losses),
                buffer_entry(34, &bound.grids.residuals),
                buffer_entry(40, &light.sources),
                buffer_entry(42, &heat),
            ],
        );
        Ok(())
    }

    /// Composes the field in the cells `light` goes over.
    ///
    /// # Errors
    /// Out of memory.
    pub fn compose(&self, light: &Light, composed: &Composed<'_>) -> Result<(), RenderError> {
        let told = Compose {
            bands: composed.field.bands,
            diffusion: match composed.kind {
                Kind::None => 0,
                Kind::P1 => 1,
                Kind::Heat => 2,
            },
            ..Compose::default()
        };
        let told = uniform(&self.gpu, "compose", &told)?;
        // Without diffusion nothing of these is read.
        let (flows, solution) = match composed.diffused {
            Some(grids) => (&grids.flows, &grids.solution),
            None => (&composed.matter.cosines, composed.transmittances),
        };
        self.run(
            &self.compose,
            light,
            &[
                buffer_entry(4, composed.lights),
                buffer_entry(20, &light.grid),
                texture_entry(21, &composed.field.view),
                texture_entry(23, composed.direct),
                texture_entry(24, &composed.matter.coefficients),
                buffer_entry(29, composed.transmittances),
                buffer_entry(31, flows),
                buffer_entry(35, solution),
                buffer_entry(40, &light.sources),
                buffer_entry(41, &told),
            ],
        );
        Ok(())
    }

    /// Fills a buffer with zeros.
    pub fn clear(&self, buffer: &wgpu::Buffer) {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(buffer, 0, None);
        self.gpu.queue.submit([encoder.finish()]);
    }

    fn run(&self, pipeline: &wgpu::ComputePipeline, light: &Light, entries: &[wgpu::BindGroupEntry<'_>]) {
        let group = bind(&self.gpu, pipeline, entries);
        self.gpu.dispatch(pipeline, &group, groups_of(light.count));
    }
}
