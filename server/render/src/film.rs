//! The film's way out: tone-mapped picture or linear radiance.

use std::sync::Arc;

use proto::scene_file::{Film, ToneMapping};

use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry};
use crate::shaders;
use crate::uniforms::ToneMap;

/// Invocations of a `tone_map` workgroup.
const WORKGROUP: u32 = 64;
/// Most workgroups along one axis of a dispatch (core WebGPU).
const MAX_WORKGROUPS: u32 = 65535;

/// Pipeline `tone_map`.
pub struct ToneMapper {
    gpu: Arc<Gpu>,
    pipeline: wgpu::ComputePipeline,
    uniform: wgpu::Buffer,
}

impl ToneMapper {
    pub fn new(gpu: Arc<Gpu>) -> Result<Self, RenderError> {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("tone_map"),
            source: wgpu::ShaderSource::Wgsl(shaders::TONE_MAP.into()),
        });
        let pipeline = gpu.compute_pipeline("tone_map", None, &module, &[]);
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform = gpu.buffer("tone map uniform", std::mem::size_of::<ToneMap>() as u64, usage)?;
        Ok(Self { gpu, pipeline, uniform })
    }

    /// Tone-maps `film` (sums of RGB and count) into `picture` (RGBA, one word a pixel).
    pub fn run(&self, film: &wgpu::Buffer, picture: &wgpu::Buffer, pixel_count: u32, settings: &Film) {
        let uniform = ToneMap {
            exposure: settings.exposure_stops.exp2() as f32,
            operator_id: match settings.tone_mapping {
                ToneMapping::Neutral => 0,
                ToneMapping::Linear => 1,
                ToneMapping::Reinhard => 2,
            },
            pixel_count,
            pad0: 0,
        };
        let gpu = &self.gpu;
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("tone_map"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[buffer_entry(0, &self.uniform), buffer_entry(1, film), buffer_entry(2, picture)],
        });
        gpu.dispatch(&self.pipeline, &bind_group, in_a_row(pixel_count.div_ceil(WORKGROUP)));
    }
}

/// Workgroups along x and y that together are at least as many as given, the last row incomplete.
pub(crate) fn in_a_row(groups: u32) -> [u32; 2] {
    let columns = groups.min(MAX_WORKGROUPS);
    [columns, groups.div_ceil(columns)]
}
