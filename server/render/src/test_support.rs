//! What tests of several modules draw with.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use scene::{PreparedVolume, Volume, Voxels};

use crate::{AdapterPolicy, Gpu, Renderer};

/// The one renderer of all tests here: pipelines are compiled once, and one test draws at a time.
pub fn renderer() -> MutexGuard<'static, Renderer> {
    static RENDERER: OnceLock<Mutex<Renderer>> = OnceLock::new();
    let open = || Mutex::new(Renderer::new(Gpu::open(AdapterPolicy::Any).unwrap()).unwrap());
    RENDERER.get_or_init(open).lock().unwrap_or_else(PoisonError::into_inner)
}

/// Three balls of different values in air.
pub fn balls(edge: usize) -> Arc<PreparedVolume> {
    let mut voxels = vec![0u8; edge * edge * edge];
    for (center, radius, value) in
        [([0.3, 0.35, 0.5], 0.2, 90.0), ([0.7, 0.6, 0.45], 0.22, 160.0), ([0.5, 0.2, 0.7], 0.15, 230.0)]
    {
        for (i, voxel) in voxels.iter_mut().enumerate() {
            let at = [i % edge, i / edge % edge, i / (edge * edge)];
            let d: f64 = (0..3).map(|k| ((at[k] as f64 + 0.5) / edge as f64 - center[k]).powi(2)).sum();
            let inside = ((radius - d.sqrt()) * edge as f64 + 0.5).clamp(0.0, 1.0);
            *voxel = (*voxel).max((inside * value) as u8);
        }
    }
    Arc::new(PreparedVolume::new(Volume::new([edge; 3], Voxels::U8(voxels)), &|_| {}))
}

/// A folder of a test's own, removed with what is in it.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new() -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("tyndall-{}-{count}", std::process::id()));
        std::fs::create_dir(&path).unwrap();
        Self(path)
    }

    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
