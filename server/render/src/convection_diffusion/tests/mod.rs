//! Solvers against closed forms, on the device.

mod diffusion;
mod transport;

use std::sync::{Arc, Mutex, MutexGuard, OnceLock};

use glam::DVec3;
use proto::SceneFile;
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot, Volume, Voxels};
use serde_json::{Value, json};

use super::Pipelines;
use super::sweep::{Cells, sweeps};
use super::transport::{Matter, Transport, storage};
use super::upwind::Upwind;
use crate::gpu::{AdapterPolicy, Gpu};
use crate::{DrawRequest, Renderer, View};

/// The device with the pipelines of the method; one for all tests.
struct Device {
    gpu: Arc<Gpu>,
    renderer: Renderer,
    transport: Transport,
    pipelines: Pipelines,
}

fn device() -> MutexGuard<'static, Device> {
    static DEVICE: OnceLock<Mutex<Device>> = OnceLock::new();
    let device = DEVICE.get_or_init(|| {
        let gpu = Gpu::open(AdapterPolicy::Any).expect("a Vulkan device, hardware or software");
        let renderer = Renderer::new(gpu.clone()).expect("shaders compile");
        let transport = Transport::new(gpu.clone());
        Mutex::new(Device { transport, renderer, pipelines: Pipelines::default(), gpu })
    });
    device.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// A scene of one volume, value range 0..255.
fn snapshot(dims: [usize; 3], voxels: Vec<u8>, patch: Value) -> Arc<Snapshot> {
    snapshot_of(Volume::new(dims, Voxels::U8(voxels)), patch)
}

fn snapshot_of(volume: Volume, patch: Value) -> Arc<Snapshot> {
    let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "value_range": [0, 255]});
    for (key, value) in patch.as_object().unwrap() {
        file[key] = value.clone();
    }
    let volume = Arc::new(PreparedVolume::new(volume, &|_| {}));
    let scene = Scene::new(&SceneFile::from_value(file).unwrap(), volume).unwrap();
    Arc::new(Snapshot { epoch: 1, scene })
}

/// Extinction `sigma_t` at value 255 and none at 0, linear between them.
fn ramp(sigma_t: f64, albedo: f64) -> Value {
    let point = |s: f64, sigma: f64| json!({"s": s, "extinction": sigma, "albedo": [albedo, albedo, albedo]});
    json!({"points": [point(0.0, 0.0), point(1.0, sigma_t)]})
}

fn cells(snapshot: &Snapshot, dims: [u32; 3]) -> Cells {
    Cells { dims, size: snapshot.scene.grid.size_world / DVec3::from_array(dims.map(f64::from)) }
}

impl Device {
    fn matter(&mut self, snapshot: &Arc<Snapshot>, cells: &Cells) -> Matter {
        let mut view = View::new();
        let target = Target { width: 8, height: 8, samples_per_pixel: 1 };
        self.renderer.draw(&mut view, &DrawRequest { snapshot, target, budget: None }).unwrap();
        let matter = Matter::new(&self.gpu, cells).unwrap();
        let (_, volume) = view.volume.as_ref().unwrap();
        let (_, tables) = view.transfer_function.as_ref().unwrap();
        let count = cells.count() as u32;
        self.transport.fill(&matter, cells, [0, count], snapshot, volume, tables).unwrap();
        matter
    }

    /// Per cell, by the upwind scheme: transmittance to the centre, and its mean over the cell.
    fn upwind(&mut self, snapshot: &Arc<Snapshot>, cells: &Cells, steps: u32) -> Vec<[f32; 2]> {
        let matter = self.matter(snapshot, cells);
        let out = storage(&self.gpu, "transmittances", 4 * cells.count()).unwrap();
        let upwind = Upwind::new(self.gpu.clone());
        let geometry = &snapshot.scene.lights[0].geometry;
        let mut fronts = upwind.begin(geometry, cells, 0, steps, &matter, &out).unwrap().unwrap();
        while !upwind.advance(&mut fronts).0 {}
        self.shares(&out, cells)
    }

    /// Per cell, along characteristics: transmittance to the centre, and its mean over the cell.
    fn transmittances(&mut self, snapshot: &Arc<Snapshot>, cells: &Cells) -> Vec<[f32; 2]> {
        let matter = self.matter(snapshot, cells);
        let out = storage(&self.gpu, "transmittances", 4 * cells.count()).unwrap();
        for sweep in sweeps(&snapshot.scene.lights[0].geometry, cells, 0) {
            let mut lines = self.transport.begin(sweep, 0).unwrap();
            while !self.transport.advance(&mut lines, &matter, &out).unwrap().0 {}
        }
        self.shares(&out, cells)
    }

    fn shares(&self, out: &wgpu::Buffer, cells: &Cells) -> Vec<[f32; 2]> {
        let bytes = 4 * cells.count();
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&self.gpu.read_buffer(out, bytes).unwrap());
        words.iter().map(|&word| [word & 0xffff, word >> 16].map(|share| share as f32 / 65535.0)).collect()
    }
}

/// Every cell with the world position of its centre.
fn centres(cells: &Cells) -> impl Iterator<Item = (usize, DVec3)> {
    let Cells { dims, size } = *cells;
    (0..cells.count() as usize).map(move |index| {
        let [x, y, _] = dims.map(|n| n as usize);
        let cell = DVec3::new((index % x) as f64, (index / x % y) as f64, (index / (x * y)) as f64);
        (index, (cell + 0.5 - 0.5 * DVec3::from_array(dims.map(f64::from))) * size)
    })
}
