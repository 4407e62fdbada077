//! Dispatches over records: rays, and coefficients.

use proto::scene_file::{Filter, RecordForm};
use scene::{Records, Scene};

use super::passes::{Bound, Chunk, PassVariant, Passes};
use super::slots::CHUNK_SLOTS;
use super::stale::Stale;
use super::{Kept, missing};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::illumination::Inputs;
use crate::light_field::LightField;

/// One call's dispatches.
pub struct Run<'a> {
    pub passes: &'a Passes,
    pub inputs: &'a Inputs<'a>,
    pub distance_map: &'a wgpu::TextureView,
}

impl Run<'_> {
    fn variant(&self, kept: &Kept) -> PassVariant {
        let scene = &self.inputs.snapshot.scene;
        PassVariant {
            nearest: kept.shape.filter == Filter::Nearest,
            quads: self.inputs.texture.quads.is_some(),
            glow: kept.shape.glow,
            dynamic: Records::of(scene).form == RecordForm::Dynamic,
            exchanged: false,
        }
    }

    fn bound<'b>(
        &'b self,
        kept: &'b Kept,
        chunk: usize,
        changed_map: &'b wgpu::TextureView,
    ) -> Result<Bound<'b>, RenderError> {
        let light = kept.light.as_ref().ok_or_else(|| missing("light of records"))?;
        Ok(Bound {
            buffers: &kept.buffers,
            texture: self.inputs.texture,
            tables: self.inputs.tables,
            distance_map: self.distance_map,
            changed_map,
            products: &light.products,
            field: &kept.field,
            received: kept.exchange.as_ref().and_then(|exchange| exchange.shown(chunk)),
        })
    }

    /// Casts what is stale of some records' rays, and writes their coefficients.
    pub fn work(
        &self,
        kept: &mut Kept,
        chunk: usize,
        entries: &[[u32; 2]],
        stale: &Stale,
        changed_map: &wgpu::TextureView,
    ) -> Result<(), RenderError> {
        let gpu = self.inputs.gpu;
        while kept.chunks.len() <= chunk {
            let words = self.variant(kept).words();
            kept.chunks.push(Chunk::new(gpu, kept.shape.columns, words)?);
        }
        if let Some(exchange) = &mut kept.exchange {
            exchange.make_room(gpu, kept.chunks.len(), kept.shape.columns)?;
        }
        self.write(kept, entries, stale.columns());
        let bound = self.bound(kept, chunk, changed_map)?;
        let (records, columns) = (entries.len() as u32, kept.directions() + kept.own_lights());
        if stale.any() {
            self.passes.march(self.variant(kept), &kept.chunks[chunk], &bound, records, columns);
        }
        self.passes.project(self.variant(kept), &kept.chunks[chunk], &bound, records);
        gpu.wait()
    }

    /// Writes coefficients of some records, with what they received, to a field of the records' form.
    pub fn project_to(
        &self,
        kept: &Kept,
        chunk: usize,
        entries: &[[u32; 2]],
        field: &LightField,
        received: Option<&wgpu::Buffer>,
    ) -> Result<(), RenderError> {
        self.write(kept, entries, &kept.towards(&self.inputs.snapshot.scene));
        let bound = Bound { field, received, ..self.bound(kept, chunk, self.distance_map)? };
        self.passes.project(self.variant(kept), &kept.chunks[chunk], &bound, entries.len() as u32);
        self.inputs.gpu.wait()
    }

    /// Makes the texels of cells nothing.
    pub fn clear(&self, kept: &Kept, cells: &[u32]) -> Result<(), RenderError> {
        /// An entry with this bit is none any more; `LEFT` in the shader.
        const LEFT: u32 = 1 << 31;
        let Some(chunk) = kept.chunks.first() else { return Ok(()) };
        for some in cells.chunks(CHUNK_SLOTS as usize) {
            let entries: Vec<[u32; 2]> = some.iter().map(|cell| [0, cell | LEFT]).collect();
            self.write(kept, &entries, &[]);
            let bound = self.bound(kept, 0, self.distance_map)?;
            self.passes.project(self.variant(kept), chunk, &bound, entries.len() as u32);
            self.inputs.gpu.wait()?;
        }
        Ok(())
    }

    pub fn write(&self, kept: &Kept, entries: &[[u32; 2]], columns: &[[f32; 4]]) {
        let queue = &self.inputs.gpu.queue;
        let uniform = kept.uniform(&self.inputs.snapshot.scene, entries.len() as u32);
        queue.write_buffer(&kept.buffers.records, 0, bytemuck::bytes_of(&uniform));
        queue.write_buffer(&kept.buffers.entries, 0, bytemuck::cast_slice(entries));
        queue.write_buffer(&kept.buffers.columns, 0, bytemuck::cast_slice(columns));
    }
}

/// A byte per macrocell.
pub fn cell_map(gpu: &Gpu, scene: &Scene, bytes: &[u8]) -> Result<wgpu::TextureView, RenderError> {
    let [width, height, depth] = scene.volume.macrocells.dims.map(|n| n as u32);
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
    let (dimension, format) = (wgpu::TextureDimension::D3, wgpu::TextureFormat::R8Uint);
    gpu.filled_texture("map of changes for records", size, dimension, format, bytes)
}
