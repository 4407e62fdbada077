//! Voxels on the GPU, shared by content between everything that shows them.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use scene::part::Room;
use scene::{PreparedVolume, Scene, Voxels};

use crate::error::RenderError;
use crate::gpu::Gpu;

/// A volume that takes no more than this four voxels to a texel is held that way, too.
const MAX_QUAD_BYTES: u64 = 256 << 20;

/// Bytes staged per upload step; bounds host memory beside the volume itself.
const UPLOAD_CHUNK_BYTES: usize = 32 << 20;

/// Voxels as a 3D texture. A texel holds `(stored - offset) / scale`, exactly for integers.
pub struct VolumeTexture {
    pub(crate) view: wgpu::TextureView,
    /// The same voxels four to a texel (shaders/ray_cast/cells.wgsl), if there is room.
    pub(crate) quads: Option<wgpu::TextureView>,
    /// Whether the sampler may interpolate it.
    pub(crate) filterable: bool,
    bytes: u64,
    stored_scale: f64,
    stored_offset: f64,
}

impl VolumeTexture {
    /// Factors of `s = scale * texel + offset` (before clamping) for a scene's window.
    pub(crate) fn s_from_texel(&self, scene: &Scene) -> (f64, f64) {
        self.share_from_texel(scene, scene.range_in_view())
    }

    /// Factors that make a texel a share of an interval of data values; 0 if that is empty.
    pub(crate) fn share_from_texel(&self, scene: &Scene, [low, high]: [f64; 2]) -> (f64, f64) {
        if high <= low {
            return (0.0, 0.0);
        }
        let volume = &scene.volume.volume;
        let scale = volume.slope * self.stored_scale / (high - low);
        let offset = (volume.slope * self.stored_offset + volume.intercept - low) / (high - low);
        (scale, offset)
    }
}

/// How stored voxels become texels.
enum Encoding {
    U8,
    /// `257 * stored` as unsigned 16-bit: the same share of the largest value.
    U8In16,
    /// `stored + bias` as unsigned 16-bit.
    U16 {
        bias: i32,
    },
    /// Normalised to 0..1 between the stored minimum and maximum.
    F32 {
        low: f32,
        range: f32,
    },
}

/// Memory of the GPU that may be in use where nothing else is said, bytes.
pub const DEFAULT_GPU_BYTES: u64 = 8 << 30;

/// Textures by content hash; least recently used go first when the budget is exceeded, but never
/// one that a view holds. A volume for which there is no room beside those is refused.
pub struct VolumeCache {
    gpu: Arc<Gpu>,
    /// For all that is on the GPU.
    budget_bytes: AtomicU64,
    /// What of it others take: films, segments, paths.
    others_bytes: AtomicU64,
    max_quad_bytes: AtomicU64,
    entries: Mutex<Entries>,
}

#[derive(Default)]
struct Entries {
    /// Ascending by last use.
    by_use: Vec<([u8; 32], Arc<VolumeTexture>)>,
}

impl VolumeCache {
    pub(crate) fn new(gpu: Arc<Gpu>, budget_bytes: u64) -> Self {
        Self {
            gpu,
            budget_bytes: budget_bytes.into(),
            others_bytes: 0.into(),
            max_quad_bytes: MAX_QUAD_BYTES.into(),
            entries: Mutex::default(),
        }
    }

    /// Bytes that all of the GPU's memory in use may be, what views keep included.
    pub fn set_budget_bytes(&self, bytes: u64) {
        self.budget_bytes.store(bytes, Ordering::Relaxed);
    }

    /// Charges what others than volumes take; volumes that nobody uses give way to it.
    pub fn charge_others(&self, bytes: u64) {
        self.others_bytes.store(bytes, Ordering::Relaxed);
        self.evict_beyond(self.own_budget());
    }

    /// Bytes that others than volumes take, as last charged.
    pub fn others_bytes(&self) -> u64 {
        self.others_bytes.load(Ordering::Relaxed)
    }

    /// Bytes in use beyond the budget.
    pub fn excess_bytes(&self) -> u64 {
        self.bytes().saturating_sub(self.own_budget())
    }

    fn own_budget(&self) -> u64 {
        self.budget_bytes.load(Ordering::Relaxed).saturating_sub(self.others_bytes())
    }

    /// Volumes loaded from now on are held four voxels to a texel as well if that takes no more than
    /// these bytes: faster, and the same picture.
    pub fn set_max_quad_bytes(&self, bytes: u64) {
        self.max_quad_bytes.store(bytes, Ordering::Relaxed);
    }

    /// The texture of a volume, uploaded if it is not there yet. May be called from any thread;
    /// takes as long as copying the voxels.
    ///
    /// # Errors
    /// Out of memory, or an edge longer than the device's 3D textures allow.
    pub fn load(&self, volume: &PreparedVolume) -> Result<Arc<VolumeTexture>, RenderError> {
        self.load_within(volume, u64::MAX)
    }

    /// As [`VolumeCache::load`], held four voxels to a texel as well only if both together take no
    /// more than `max_bytes`.
    ///
    /// # Errors
    /// As [`VolumeCache::load`].
    pub fn load_within(
        &self,
        volume: &PreparedVolume,
        max_bytes: u64,
    ) -> Result<Arc<VolumeTexture>, RenderError> {
        if let Some(texture) = self.touch(&volume.content) {
            return Ok(texture);
        }
        let plain_bytes = volume.volume.voxels.len() as u64 * self.texel_bytes(&volume.volume.voxels);
        let budget = self.own_budget();
        self.evict_beyond(budget.saturating_sub(plain_bytes));
        let room = budget.saturating_sub(self.bytes());
        if plain_bytes > room {
            return Err(RenderError::OutOfMemory {
                what: "a volume beside those in use".into(),
                bytes: plain_bytes,
            });
        }
        let max_quad_bytes =
            self.max_quad_bytes.load(Ordering::Relaxed).min(max_bytes.min(room).saturating_sub(plain_bytes));
        let texture = match upload(&self.gpu, volume, max_quad_bytes) {
            Err(RenderError::OutOfMemory { .. }) => {
                // What no view holds gives way.
                self.evict_beyond(0);
                self.gpu.wait()?;
                upload(&self.gpu, volume, 0)?
            }
            uploaded => uploaded?,
        };
        let texture = Arc::new(texture);
        {
            let mut entries = self.entries.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            entries.by_use.push((volume.content, texture.clone()));
        }
        self.evict_beyond(self.own_budget());
        Ok(texture)
    }

    /// Forgets textures that nobody uses until the others take no more than these bytes.
    fn evict_beyond(&self, budget_bytes: u64) {
        let mut entries = self.entries.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut total: u64 = entries.by_use.iter().map(|(_, texture)| texture.bytes).sum();
        entries.by_use.retain(|(_, texture)| {
            let unused = Arc::strong_count(texture) == 1;
            let evict = unused && total > budget_bytes;
            if evict {
                total -= texture.bytes;
            }
            !evict
        });
    }

    /// What this device can hold of one volume, if no more than `max_bytes` are allowed.
    pub fn room(&self, max_bytes: u64) -> Room {
        Room { max_edge: self.gpu.device.limits().max_texture_dimension_3d as usize, max_bytes }
    }

    /// Bytes of a voxel on this device.
    pub fn texel_bytes(&self, voxels: &Voxels) -> u64 {
        match voxels {
            Voxels::U8(_) => 1,
            Voxels::U16(_) | Voxels::I16(_) if self.gpu.abilities.filter_unorm16 => 2,
            _ => 4,
        }
    }

    /// Bytes of all textures held.
    pub fn bytes(&self) -> u64 {
        let entries = self.entries.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        entries.by_use.iter().map(|(_, texture)| texture.bytes).sum()
    }

    /// The texture of a volume, if it is there.
    pub fn loaded(&self, volume: &PreparedVolume) -> Option<Arc<VolumeTexture>> {
        self.touch(&volume.content)
    }

    fn touch(&self, content: &[u8; 32]) -> Option<Arc<VolumeTexture>> {
        let mut entries = self.entries.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let position = entries.by_use.iter().position(|(hash, _)| hash == content)?;
        let entry = entries.by_use.remove(position);
        let texture = entry.1.clone();
        entries.by_use.push(entry);
        Some(texture)
    }
}

fn upload(gpu: &Gpu, prepared: &PreparedVolume, max_quad_bytes: u64) -> Result<VolumeTexture, RenderError> {
    let volume = &prepared.volume;
    let longest = volume.dims.into_iter().max().unwrap_or(1);
    let limit = gpu.device.limits().max_texture_dimension_3d;
    if longest > limit as usize {
        return Err(RenderError::TooLarge {
            what: format!("a volume edge of {longest} voxels"),
            limit: format!("{limit} voxels"),
        });
    }
    let to_unorm16 = gpu.abilities.filter_unorm16;
    let encoding = match &volume.voxels {
        // Mesa's software sampler interpolates 8-bit texels in 8-bit arithmetic.
        Voxels::U8(v) if gpu.info().software && to_unorm16 && 2 * v.len() as u64 <= max_quad_bytes => {
            Encoding::U8In16
        }
        Voxels::U8(_) => Encoding::U8,
        Voxels::U16(_) if to_unorm16 => Encoding::U16 { bias: 0 },
        Voxels::I16(_) if to_unorm16 => Encoding::U16 { bias: -i32::from(i16::MIN) },
        _ => {
            let stored = |value: f64| ((value - volume.intercept) / volume.slope) as f32;
            let ends = prepared.range.map(stored);
            let low = ends[0].min(ends[1]);
            let range = ends[0].max(ends[1]) - low;
            Encoding::F32 { low, range: if range > 0.0 && range.is_finite() { range } else { 1.0 } }
        }
    };
    let (format, texel_bytes, stored_scale, stored_offset, filterable) = match encoding {
        Encoding::U8 => (wgpu::TextureFormat::R8Unorm, 1, 255.0, 0.0, true),
        Encoding::U8In16 => (wgpu::TextureFormat::R16Unorm, 2, 255.0, 0.0, true),
        Encoding::U16 { bias } => (wgpu::TextureFormat::R16Unorm, 2, 65535.0, -f64::from(bias), true),
        Encoding::F32 { low, range } => {
            let filterable = gpu.abilities.filter_f32;
            (wgpu::TextureFormat::R32Float, 4, f64::from(range), f64::from(low), filterable)
        }
    };
    let bytes = volume.voxels.len() as u64 * texel_bytes as u64;
    let all = |range: std::ops::Range<usize>| texels(&volume.voxels, range, &encoding);
    let layer_voxels = volume.dims[0] * volume.dims[1];
    let view = upload_layers(gpu, volume.dims, format, texel_bytes, |layers| {
        all(layers.start * layer_voxels..layers.end * layer_voxels)
    })?;
    let [nx, ny, nz] = volume.dims;
    let quad_dims = [nx + 1, ny + 1, nz];
    let quad_bytes = quad_dims.iter().product::<usize>() as u64 * 4 * texel_bytes as u64;
    let fits = quad_bytes <= max_quad_bytes && quad_dims.iter().all(|&edge| edge <= limit as usize);
    let quads = fits.then(|| {
        let format = match encoding {
            Encoding::U8 => wgpu::TextureFormat::Rgba8Unorm,
            Encoding::U8In16 | Encoding::U16 { .. } => wgpu::TextureFormat::Rgba16Unorm,
            Encoding::F32 { .. } => wgpu::TextureFormat::Rgba32Float,
        };
        upload_layers(gpu, quad_dims, format, 4 * texel_bytes, |layers| {
            let voxels = all(layers.start * layer_voxels..layers.end * layer_voxels);
            voxels
                .chunks_exact(layer_voxels * texel_bytes)
                .flat_map(|layer| quads_of(layer, nx, ny, texel_bytes))
                .collect()
        })
    });
    // Without it pictures are the same, but later.
    let quads = quads.and_then(Result::ok);
    let bytes = bytes + if quads.is_some() { quad_bytes } else { 0 };
    Ok(VolumeTexture { view, quads, bytes, stored_scale, stored_offset, filterable })
}

/// Texels of a layer, four to one: those at (x - 1, y - 1), (x, y - 1), (x - 1, y), (x, y), the
/// outermost ones extended.
fn quads_of(layer: &[u8], nx: usize, ny: usize, texel_bytes: usize) -> Vec<u8> {
    let mut quads = Vec::with_capacity((nx + 1) * (ny + 1) * 4 * texel_bytes);
    for y in 0..=ny {
        for x in 0..=nx {
            for (x, y) in [
                (x.max(1) - 1, y.max(1) - 1),
                (x.min(nx - 1), y.max(1) - 1),
                (x.max(1) - 1, y.min(ny - 1)),
                (x.min(nx - 1), y.min(ny - 1)),
            ] {
                quads.extend_from_slice(&layer[(y * nx + x) * texel_bytes..][..texel_bytes]);
            }
        }
    }
    quads
}

/// A 3D texture, filled layer by layer; `texels` gives those of some layers.
fn upload_layers(
    gpu: &Gpu,
    dims: [usize; 3],
    format: wgpu::TextureFormat,
    texel_bytes: usize,
    texels: impl Fn(std::ops::Range<usize>) -> Vec<u8>,
) -> Result<wgpu::TextureView, RenderError> {
    let [width, height, depth] = dims.map(|n| n as u32);
    let bytes = dims.iter().product::<usize>() as u64 * texel_bytes as u64;
    let texture = gpu.allocating("the volume", bytes, || {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("volume"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: depth },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        })
    })?;
    let layer_bytes = dims[0] * dims[1] * texel_bytes;
    let layers_per_chunk = (UPLOAD_CHUNK_BYTES / layer_bytes).max(1);
    let mut under_way = None;
    for first in (0..dims[2]).step_by(layers_per_chunk) {
        let layers = layers_per_chunk.min(dims[2] - first);
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: first as u32 },
                aspect: wgpu::TextureAspect::All,
            },
            &texels(first..first + layers),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width * texel_bytes as u32),
                rows_per_image: Some(height),
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: layers as u32 },
        );
        // Hands the staging memory of this chunk on before the next is filled, and waits for that
        // of the one before.
        let submitted = gpu.queue.submit([]);
        if let Some(before) = under_way.replace(submitted) {
            let wait = wgpu::PollType::Wait { submission_index: Some(before), timeout: None };
            gpu.device.poll(wait).map_err(|error| RenderError::Gpu(error.to_string()))?;
        }
    }
    gpu.take_error()?;
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}

fn texels(voxels: &Voxels, range: std::ops::Range<usize>, encoding: &Encoding) -> Vec<u8> {
    match (voxels, encoding) {
        (Voxels::U8(v), Encoding::U8) => v[range].to_vec(),
        (Voxels::U8(v), Encoding::U8In16) => {
            v[range].iter().flat_map(|&x| (u16::from(x) * 257).to_ne_bytes()).collect()
        }
        (Voxels::U16(v), Encoding::U16 { .. }) => bytemuck::cast_slice(&v[range]).to_vec(),
        (Voxels::I16(v), Encoding::U16 { bias }) => {
            v[range].iter().flat_map(|&x| ((i32::from(x) + bias) as u16).to_ne_bytes()).collect()
        }
        (_, Encoding::F32 { low, range: width }) => {
            range.flat_map(|i| ((voxels.stored(i) - low) / width).to_ne_bytes()).collect()
        }
        // The encoding is chosen by the voxel type above.
        _ => Vec::new(),
    }
}
