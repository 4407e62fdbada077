//! Light fields: incident radiance as spherical harmonics on a grid, whichever method computed it
//! (shaders/shared/light_field.wgsl).

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use std::sync::Arc;

use proto::scene_file::Phase;
use scene::Scene;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::uniforms;

/// Four half floats.
pub(crate) const TEXEL_BYTES: u64 = 8;

/// The grid spans the volume's box; texels are the centres of its cells.
pub(crate) struct LightField {
    /// Texels of one coefficient.
    pub dims: [u32; 3],
    /// Bands, 1..=6.
    pub bands: u32,
    /// `Rgba16Float`: coefficient k in tile (k % bands, k / bands) along x and z.
    #[cfg_attr(not(test), allow(dead_code))]
    pub texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    /// What lights bring by themselves, kept apart; `None`: it is in the field.
    direct: Option<Direct>,
    scale: f32,
    /// How far off skins of matter that is opaque within a texel were looked at from, world units; 0: there
    /// is no such matter, or texels do not hold means of skins.
    reach: f32,
    /// Whether it is told where skins are seen from: with the coefficients 1 to 3, as the mass with the first.
    pub faced: bool,
    /// Whether a place takes the texel it lies in, instead of interpolating between texels.
    pub nearest: bool,
    /// `Field` of the shader.
    pub uniform: wgpu::Buffer,
    gpu: Arc<Gpu>,
}

/// How much of each light reaches places, as view rays look it up (shaders/direct_light/look_up.wgsl).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Direct {
    /// Of four lights a slab along z, a texel a node; the place of a light is that of `tables::by_slot`.
    pub view: wgpu::TextureView,
    /// Cells of the volume's box, along each axis.
    pub cells: [u32; 3],
    /// Nodes along each axis: a cell's corners (one more than cells), or its centres (as many).
    pub nodes: [u32; 3],
    /// How far towards a light matter is looked at, world units, and in how many parts.
    pub near: f32,
    /// As above; 0: not at all.
    pub near_parts: u32,
    /// Whether clipped matter blocks light.
    pub clipped_matter_blocks: bool,
}

pub(crate) fn texture(gpu: &Gpu, size: wgpu::Extent3d) -> Result<wgpu::Texture, RenderError> {
    let descriptor = wgpu::TextureDescriptor {
        label: Some("light field"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    };
    let bytes = TEXEL_BYTES * u64::from(size.width * size.height * size.depth_or_array_layers);
    gpu.allocating("the light field", bytes, || gpu.device.create_texture(&descriptor))
}

/// Texels of a field whose longest edge has about `longest` of them: cells about cubic, none smaller
/// than a voxel.
pub(crate) fn dims(scene: &Scene, longest: u32) -> [u32; 3] {
    let size = scene.grid.size_world;
    let edge = size.max_element() / f64::from(longest);
    [0, 1, 2].map(|axis| {
        let voxels = scene.grid.dims[axis] as f64;
        (size[axis] / edge).ceil().min(voxels).max(1.0) as u32
    })
}

/// Bands that matter needs, at most `most`: isotropic matter without surfaces sees the mean alone.
pub(crate) fn bands_of(scene: &Scene, most: u32) -> u32 {
    let isotropic = |point: &scene::transfer_function::Point| {
        let material = &scene.materials[point.material];
        material.phase == Phase::Isotropic && material.surface <= 0.0
    };
    if scene.transfer_function.points.iter().all(isotropic) { 1 } else { most }
}

impl LightField {
    /// A field without light, whose texels are not known.
    ///
    /// # Errors
    /// Out of memory; too large for the device.
    pub fn new(gpu: &Arc<Gpu>, dims: [u32; 3], bands: u32) -> Result<Self, RenderError> {
        let size = wgpu::Extent3d {
            width: dims[0] * bands,
            height: dims[1],
            depth_or_array_layers: dims[2] * bands,
        };
        let edge = size.width.max(size.height).max(size.depth_or_array_layers);
        if edge > gpu.max_texture_edge_3d() {
            return Err(RenderError::TooLarge {
                what: format!("a light field of {dims:?} texels with {bands} bands"),
                limit: format!("{} texels along an axis", gpu.max_texture_edge_3d()),
            });
        }
        let texture = texture(gpu, size)?;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform = gpu.buffer("light field", std::mem::size_of::<uniforms::Field>() as u64, usage)?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let field = Self {
            dims,
            bands,
            texture,
            view,
            direct: None,
            scale: 1.0,
            reach: 0.0,
            faced: false,
            nearest: false,
            uniform,
            gpu: gpu.clone(),
        };
        field.write_uniform();
        Ok(field)
    }

    /// How much of each light reaches places, if that is kept apart: four lights a slab along z.
    pub fn direct(&self) -> Option<&wgpu::TextureView> {
        self.direct.as_ref().map(|direct| &direct.view)
    }

    /// Parts in which matter beside a place is looked at; `None`: what lights bring is not kept apart.
    pub fn near_parts(&self) -> Option<u32> {
        self.direct.as_ref().map(|direct| direct.near_parts)
    }

    /// From now on what lights bring by themselves is told by this, and the field holds the rest.
    pub fn set_direct(&mut self, direct: Direct) {
        if self.direct.as_ref() != Some(&direct) {
            self.direct = Some(direct);
            self.write_uniform();
        }
    }

    /// From now on what lights bring by themselves is in the field, as all else.
    pub fn take_direct_in(&mut self) {
        self.direct = None;
    }

    /// The radiance that texels hold as 1. Half floats end at 65504 and lose digits below 6e-5.
    pub fn set_scale(&mut self, scale: f32) {
        self.scale = scale;
        self.write_uniform();
    }

    /// Whether texels hold means of what is seen of skins.
    pub fn has_skins(&self) -> bool {
        self.reach > 0.0
    }

    /// From now on texels hold means of what is seen of skins from so far off, world units; 0: they do not.
    pub fn set_reach(&mut self, reach: f32) {
        if self.reach != reach {
            self.reach = reach;
            self.write_uniform();
        }
    }

    fn write_uniform(&self) {
        let mut uniform = uniforms::Field {
            dims: self.dims.map(|n| n as f32),
            scale: self.scale,
            reach: self.reach,
            ..uniforms::Field::default()
        };
        if let Some(direct) = &self.direct {
            uniform.direct_cells = direct.cells.map(|n| n as f32);
            uniform.direct_nodes = direct.nodes.map(|n| n as f32);
            uniform.near = direct.near;
            uniform.clip_blocks = u32::from(direct.clipped_matter_blocks);
        }
        self.gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let texels = self.dims.iter().map(|&n| u64::from(n)).product::<u64>();
        TEXEL_BYTES * texels * u64::from(self.bands * self.bands)
    }

    /// Writes all texels from the host: `coefficients[k][texel]`, x fastest.
    #[cfg(test)]
    pub fn write(&self, coefficients: &[Vec<[f32; 3]>], weights: &[f32]) {
        let [width, height, depth] = self.dims;
        for (k, values) in coefficients.iter().enumerate() {
            let texel = |(i, &[r, g, b]): (usize, &[f32; 3])| {
                let weight = if k == 0 { weights[i] } else { 0.0 };
                [r, g, b, weight].map(|x| half::f16::from_f32(x).to_bits())
            };
            let texels: Vec<[u16; 4]> = values.iter().enumerate().map(texel).collect();
            let mut target = self.texture.as_image_copy();
            let k = k as u32;
            target.origin = wgpu::Origin3d { x: k % self.bands * width, y: 0, z: k / self.bands * depth };
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width * TEXEL_BYTES as u32),
                rows_per_image: Some(height),
            };
            let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
            self.gpu.queue.write_texture(target, bytemuck::cast_slice(&texels), layout, size);
        }
    }
}
