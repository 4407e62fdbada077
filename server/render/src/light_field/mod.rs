//! Light fields: incident radiance as spherical harmonics on a grid, whichever method computed it
//! (shaders/shared/light_field.wgsl).

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use std::sync::Arc;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::uniforms;

/// Four half floats.
const TEXEL_BYTES: u64 = 8;

/// The grid spans the volume's box; texels are the centres of its cells.
pub(crate) struct LightField {
    /// Texels of one coefficient.
    pub dims: [u32; 3],
    /// Bands, 1..=6.
    pub bands: u32,
    /// `Rgba16Float`: coefficient k in tile (k % bands, k / bands) along x and z.
    pub texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    /// Whether a place takes the texel it lies in, instead of interpolating between texels.
    pub nearest: bool,
    /// `Field` of the shader.
    pub uniform: wgpu::Buffer,
    gpu: Arc<Gpu>,
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
        let texture = gpu.allocating("the light field", bytes, || gpu.device.create_texture(&descriptor))?;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform = gpu.buffer("light field", std::mem::size_of::<uniforms::Field>() as u64, usage)?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let field = Self { dims, bands, texture, view, nearest: false, uniform, gpu: gpu.clone() };
        field.set_scale(1.0);
        Ok(field)
    }

    /// The radiance that texels hold as 1. Half floats end at 65504 and lose digits below 6e-5.
    pub fn set_scale(&self, scale: f32) {
        let uniform = uniforms::Field { dims: self.dims.map(|n| n as f32), scale };
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
