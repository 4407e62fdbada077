//! Matter as the passes of a bake read it. Photons are taken out of the sums as they were added: through
//! matter as it was, whose tables are therefore kept as long as there are such photons.

use scene::Scene;

use crate::error::RenderError;
use crate::gpu::{buffer_entry, texture_entry};
use crate::illumination::Inputs;
use crate::uniforms::FrameUniform;

/// A scene with its tables on the device.
pub struct Matter {
    pub scene: Scene,
    /// Bounds of the extinction.
    pub majorants: wgpu::TextureView,
    /// Distances to matter.
    pub distance_map: wgpu::TextureView,
    pub materials: wgpu::Buffer,
    points: wgpu::TextureView,
    cells: wgpu::TextureView,
    frame: wgpu::Buffer,
}

impl Matter {
    /// The snapshot's. Tables are never written twice, so they are shared with the view.
    ///
    /// # Errors
    /// Out of memory; a table that the view has not.
    pub fn of(inputs: &Inputs<'_>) -> Result<Self, RenderError> {
        let (gpu, scene) = (inputs.gpu, &inputs.snapshot.scene);
        let (Some(majorants), Some(distance_map)) = (inputs.majorants, inputs.distance_map) else {
            return Err(RenderError::Gpu("a table of the view is missing".into()));
        };
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let frame = gpu.buffer("frame", std::mem::size_of::<FrameUniform>() as u64, usage)?;
        let contents = crate::frame::scene_uniform(scene, inputs.texture);
        gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&contents));
        Ok(Self {
            scene: scene.clone(),
            majorants: majorants.clone(),
            distance_map: distance_map.clone(),
            materials: inputs.tables.materials.clone(),
            points: inputs.tables.points.clone(),
            cells: inputs.tables.cells.clone(),
            frame,
        })
    }

    /// The scene as shaders take it.
    pub fn frame(&self) -> wgpu::BindGroupEntry<'_> {
        buffer_entry(0, &self.frame)
    }

    /// What passes through matter read; `cells`: distances to matter, or bounds of the extinction.
    pub fn entries<'a>(
        &'a self,
        inputs: &Inputs<'a>,
        cells: &'a wgpu::TextureView,
        settings: &'a wgpu::Buffer,
    ) -> [wgpu::BindGroupEntry<'a>; 7] {
        let sampler = &inputs.transfer_pipelines.sampler;
        [
            self.frame(),
            texture_entry(1, &self.points),
            texture_entry(2, &self.cells),
            texture_entry(7, &inputs.texture.view),
            wgpu::BindGroupEntry { binding: 8, resource: wgpu::BindingResource::Sampler(sampler) },
            texture_entry(9, cells),
            buffer_entry(21, settings),
        ]
    }
}
