//! Light that is gathered from photons at parts of view rays (shaders/photon_map/gather.wgsl): rays are cast
//! that write their parts down, so many a time, and photons are summed up for each of these.

use scene::Scene;

use super::casting::SamplePass;
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::photon_map::Gather;
use crate::ray_cast::Features;
use crate::shaders;
use crate::uniforms::{self, FrameUniform};
use crate::variants::Variants;
use crate::view::ViewBuffers;

/// Parts of a ray that are written down in one dispatch; `PARTS` in shaders/photon_map/parts.wgsl.
const PARTS: u32 = 64;
/// Parts that are written down together, unless a row of pixels has more.
const MOST_PARTS: u64 = 1 << 20;
/// Photons of a part in one dispatch. All loops of eight parts end after 65,535 turns together on a software
/// device, a photon or a row of cells each.
const MOST_PHOTONS: u32 = 65_536;
const MOST_PHOTONS_SOFTWARE: u32 = 7900;
/// Bytes at which they lie in the counter buffer: photons gathered, parts of the ray with the most, and whether
/// photons are left to be gathered.
pub(super) const PHOTONS_GATHERED: u64 = 48;
const MOST_PARTS_OF_A_RAY: u64 = 56;
const PHOTONS_LEFT: u64 = 60;

/// Passes, compiled when first needed, and room for the parts of one slice of a picture.
pub(super) struct Pipelines {
    gather: wgpu::ShaderModule,
    add: wgpu::ShaderModule,
    gathers: Variants<Features>,
    adds: Variants<()>,
    parts: Option<wgpu::Buffer>,
    uniform: wgpu::Buffer,
    most_photons: u32,
}

/// What a picture's light is gathered with.
pub(super) struct Gathered<'a> {
    gather: &'a Gather,
    sum_up: wgpu::ComputePipeline,
    add: wgpu::ComputePipeline,
    /// Rows of a slice for whose parts there is room.
    pub most_rows: u32,
}

/// Rays that were cast for a slice.
pub(super) struct CastRays<'a> {
    pub pass: &'a SamplePass,
    /// Of the slice.
    pub frame: &'a mut FrameUniform,
    pub buffers: &'a ViewBuffers,
    pub materials: &'a wgpu::Buffer,
    /// Workgroups of the slice's pixels.
    pub groups: [u32; 2],
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let module = |label, source: &'static str| {
            gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            })
        };
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            gather: module("gather_photons", shaders::GATHER_PHOTONS),
            add: module("add_gathered", shaders::ADD_GATHERED),
            gathers: Variants::default(),
            adds: Variants::default(),
            parts: None,
            uniform: gpu.buffer("gather", std::mem::size_of::<uniforms::Gather>() as u64, usage)?,
            most_photons: if gpu.info().software { MOST_PHOTONS_SOFTWARE } else { MOST_PHOTONS },
        })
    }

    /// Where rays write their parts down.
    pub fn parts(&self) -> Option<&wgpu::Buffer> {
        self.parts.as_ref()
    }

    /// Makes ready for pictures of a width, in pixels.
    pub fn begin<'a>(
        &mut self,
        gpu: &Gpu,
        gather: &'a Gather,
        scene: &Scene,
        width: u32,
    ) -> Result<Gathered<'a>, RenderError> {
        let of_row = u64::from(PARTS) * u64::from(width);
        let bytes = MOST_PARTS.max(of_row) * std::mem::size_of::<uniforms::SeenPart>() as u64;
        if self.parts.as_ref().is_none_or(|parts| parts.size() < bytes) {
            self.parts = None;
            self.parts = Some(gpu.buffer("parts of rays", bytes, wgpu::BufferUsages::STORAGE)?);
        }
        let features = Features::of(scene);
        let sum_up = self.gathers.get(features, || {
            let mut constants = features.constants().to_vec();
            constants.push(("MOST_PHOTONS", f64::from(self.most_photons)));
            gpu.compute_pipeline("gather_photons", None, &self.gather, &constants)
        });
        let add = self.adds.get((), || gpu.compute_pipeline("add_gathered", None, &self.add, &[]));
        Ok(Gathered { gather, sum_up, add, most_rows: (MOST_PARTS / of_row).max(1) as u32 })
    }

    /// Gathers light for rays that were cast, and casts them again for parts behind the first ones.
    pub fn gather(&self, gpu: &Gpu, gathered: &Gathered<'_>, rays: CastRays<'_>) -> Result<(), RenderError> {
        let CastRays { pass, frame, buffers, materials, groups } = rays;
        let Some(parts) = &self.parts else {
            return Err(RenderError::Gpu("no room for parts of rays".into()));
        };
        let word = |at: u64| -> Result<u32, RenderError> {
            Ok(bytemuck::pod_read_unaligned(&gpu.read_part(&buffers.counters, at, 4)?))
        };
        let bind = |pipeline: &wgpu::ComputePipeline, entries: &[wgpu::BindGroupEntry<'_>]| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &pipeline.get_bind_group_layout(0),
                entries,
            })
        };
        let common =
            [buffer_entry(0, &buffers.frame), buffer_entry(13, &self.uniform), buffer_entry(17, parts)];
        let of_photons = [
            buffer_entry(3, materials),
            buffer_entry(6, &buffers.counters),
            texture_entry(14, &gathered.gather.interactions),
            texture_entry(15, &gathered.gather.cell_starts),
            texture_entry(16, &gathered.gather.flux_of_lights),
        ];
        let of_film = [buffer_entry(5, &buffers.film), texture_entry(18, &gathered.gather.extinction_around)];
        let sum_up = bind(&gathered.sum_up, &[&common[..], &of_photons].concat());
        let add = bind(&gathered.add, &[&common[..], &of_film].concat());
        let most = word(MOST_PARTS_OF_A_RAY)?;
        while frame.first_part < most {
            if frame.first_part > 0 {
                gpu.queue.write_buffer(&buffers.frame, 0, bytemuck::bytes_of(frame));
                gpu.dispatch(&pass.pipeline, &pass.bind_group, groups);
            }
            let count = PARTS.min(most - frame.first_part);
            let mut uniform = gathered.gather.uniform;
            let mut goes_on = true;
            while goes_on {
                gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
                gpu.queue.write_buffer(&buffers.counters, PHOTONS_LEFT, &[0; 4]);
                gpu.dispatch_3d(&gathered.sum_up, &sum_up, [groups[0], groups[1], count]);
                goes_on = word(PHOTONS_LEFT)? > 0;
                uniform.first += self.most_photons;
            }
            gpu.dispatch(&gathered.add, &add, groups);
            frame.first_part += PARTS;
        }
        frame.first_part = 0;
        gpu.queue.write_buffer(&buffers.counters, MOST_PARTS_OF_A_RAY, &[0; 4]);
        Ok(())
    }
}
