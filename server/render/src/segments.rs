//! View-ray segments of a view: layers of segments, one per film sample, kept between edits of
//! matter (shaders/ray_cast/segments.wgsl).

use std::sync::Arc;

use scene::distance::distance_map;
use scene::plan::{SegmentsState, bins_changed_since, stale_share};
use scene::{Scene, Snapshot};

use crate::gpu::Gpu;

/// GPU memory for the segments of one view.
const VIEW_BYTES: u64 = 256 << 20;
/// Radiance and transmittance, f32 each.
const SEGMENT_BYTES: u64 = 16;
/// Film sizes whose segments are kept: that of pictures in motion and that of pictures at rest.
const MAX_SIZES: usize = 2;
/// Most snapshots that the segments of a layer may stem from; beyond it they are all cast anew.
const MAX_BASES: usize = 8;
/// If more of the matter's cells changed, looking for segments that did not does not pay.
const WORTHWHILE_SHARE: f32 = 0.9;

/// Segments for the film sizes last used, newest last.
#[derive(Default)]
pub(crate) struct Segments {
    sizes: Vec<Size>,
}

/// Layers of one film size.
struct Size {
    width: u32,
    height: u32,
    /// Segments of a ray.
    count: u32,
    /// Layer i holds sample i.
    layers: Vec<Layer>,
}

struct Layer {
    buffer: wgpu::Buffer,
    /// Each segment was cast, or found not to be stale, for one of these.
    bases: Vec<Arc<Snapshot>>,
}

/// What a pass of the ray caster does with a layer.
pub(crate) struct LayerPass {
    pub buffer: wgpu::Buffer,
    /// Distances to changed cells; `None`: nothing kept is of use.
    pub changed_distances: Option<Vec<u8>>,
}

/// Bytes of a layer: of each pixel the segments and their sum.
fn layer_bytes(pixels: u64, count: u32) -> u64 {
    pixels * (u64::from(count) + 1) * SEGMENT_BYTES
}

impl Segments {
    /// What a plan needs to know for a film of a size.
    pub fn state(
        &self,
        (width, height): (u32, u32),
        count: u32,
        max_binding_bytes: u64,
    ) -> SegmentsState<'_> {
        let held = self.sizes.iter().find(|s| (s.width, s.height, s.count) == (width, height, count));
        let first = held.and_then(|size| size.layers.first());
        let bases = first.map_or_else(Vec::new, |l| l.bases.iter().map(|base| &base.scene).collect());
        let bytes = layer_bytes(u64::from(width) * u64::from(height), count);
        SegmentsState {
            bases,
            wanted: false,
            film_is_cast_in_them: false,
            fit: bytes <= VIEW_BYTES.min(max_binding_bytes),
        }
    }

    /// Bytes of all layers.
    pub fn bytes(&self) -> u64 {
        let layers = self.sizes.iter().flat_map(|size| &size.layers);
        layers.map(|layer| layer.buffer.size()).sum()
    }

    /// Prepares the layer of a sample for casting rows of `snapshot`; `None` if there is no memory
    /// for it. From now on the layer holds segments of this snapshot among others.
    pub fn begin(
        &mut self,
        gpu: &Gpu,
        (width, height): (u32, u32),
        sample: u32,
        snapshot: &Arc<Snapshot>,
    ) -> Option<LayerPass> {
        let scene = &snapshot.scene;
        let count = scene.sampling.segments;
        let size = self.size(width, height, count);
        let index = sample as usize;
        if index > size.layers.len() {
            return None;
        }
        if index == size.layers.len() {
            let bytes = layer_bytes(u64::from(width) * u64::from(height), count);
            self.make_room(bytes)?;
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            // Without memory rays are cast whole.
            let buffer = gpu.buffer("view-ray segments", bytes, usage).ok()?;
            self.sizes.last_mut()?.layers.push(Layer { buffer, bases: Vec::new() });
        }
        let layer = self.sizes.last_mut()?.layers.get_mut(index)?;
        let bases: Vec<&Scene> = layer.bases.iter().map(|base| &base.scene).collect();
        let bins = bins_changed_since(&bases, scene).filter(|_| bases.len() <= MAX_BASES);
        let changed_distances = match bins {
            Some(bins) => changed_distances(scene, bins),
            None => {
                let mut encoder =
                    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                encoder.clear_buffer(&layer.buffer, 0, None);
                gpu.queue.submit([encoder.finish()]);
                layer.bases.clear();
                None
            }
        };
        // A snapshot that differs in nothing that segments depend on stands for both.
        let same = |base: &&mut Arc<Snapshot>| bins_changed_since(&[&base.scene], scene) == Some(0);
        match layer.bases.iter_mut().find(same) {
            Some(base) => *base = snapshot.clone(),
            None => layer.bases.push(snapshot.clone()),
        }
        Some(LayerPass { buffer: layer.buffer.clone(), changed_distances })
    }

    /// All rows of a sample's layer are `snapshot`'s now.
    pub fn finish(&mut self, sample: u32, snapshot: &Arc<Snapshot>) {
        let size = self.sizes.last_mut();
        if let Some(layer) = size.and_then(|size| size.layers.get_mut(sample as usize)) {
            layer.bases = vec![snapshot.clone()];
        }
    }

    /// The layers of a size, now the newest.
    fn size(&mut self, width: u32, height: u32, count: u32) -> &mut Size {
        let key = (width, height, count);
        let held = self.sizes.iter().position(|s| (s.width, s.height, s.count) == key);
        let size = match held {
            Some(index) => self.sizes.remove(index),
            None => Size { width, height, count, layers: Vec::new() },
        };
        if self.sizes.len() >= MAX_SIZES {
            self.sizes.remove(0);
        }
        self.sizes.push(size);
        let newest = self.sizes.len() - 1;
        &mut self.sizes[newest]
    }

    /// Frees layers of other sizes until so many more bytes fit.
    fn make_room(&mut self, bytes: u64) -> Option<()> {
        while self.bytes() + bytes > VIEW_BYTES {
            if self.sizes.len() < 2 {
                return None;
            }
            self.sizes.remove(0);
        }
        Some(())
    }
}

/// Distance of every macrocell to one in which matter changed; `None` if that is most of them.
fn changed_distances(scene: &Scene, bins: u64) -> Option<Vec<u8>> {
    let cells = &scene.volume.macrocells;
    let worthwhile = stale_share(scene, scene.bins_in_view() | bins, bins) <= WORTHWHILE_SHARE;
    worthwhile.then(|| distance_map(cells.dims, cells.masks(scene.filter), bins))
}
