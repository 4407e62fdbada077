//! What the tests of the whole system share: a device, pictures, comparison with golden images.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock};

use proto::SceneFile;
use render::{AdapterPolicy, DrawRequest, Gpu, Picture, Radiance, Renderer, View};
use scene::plan::Target;
use scene::{PreparedVolume, Scene, Snapshot, Volume};

/// The renderer of this test binary; a machine without any Vulkan device fails here.
pub fn renderer() -> MutexGuard<'static, Renderer> {
    static RENDERER: OnceLock<Mutex<Renderer>> = OnceLock::new();
    let renderer = RENDERER.get_or_init(|| {
        let gpu = Gpu::open(AdapterPolicy::Any).expect("a Vulkan device, hardware or software");
        Mutex::new(Renderer::new(gpu).expect("shaders compile"))
    });
    renderer.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Draws a scene of a volume into a fresh view.
pub fn draw(file: &SceneFile, volume: Volume, size: (u32, u32), samples: u32) -> (Picture, Radiance, Scene) {
    let prepared = Arc::new(PreparedVolume::new(volume, &|_| {}));
    let scene = Scene::new(file, prepared).expect("a consistent scene");
    let snapshot = Arc::new(Snapshot { epoch: 1, scene });
    let target = Target { width: size.0, height: size.1, samples_per_pixel: samples };
    let mut renderer = renderer();
    let mut view = View::new();
    let drawn = renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None }).unwrap();
    assert!(drawn.complete);
    let (picture, radiance) = (renderer.picture(&mut view).unwrap(), renderer.radiance(&view).unwrap());
    (picture, radiance, snapshot.scene.clone())
}

/// The folder of shared test data, if it is there; says aloud when it is not.
pub fn shared_data() -> Option<PathBuf> {
    let default = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("TYNDALL_TEST_DATA").map_or_else(default, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("LEFT OUT: {} is absent; tests on shared data are skipped by choice", folder.display());
    None
}

/// Keeps a picture for people to look at where `TYNDALL_TEST_IMAGES` names a folder.
pub fn keep(picture: &Picture, name: &str) {
    if let Some(folder) = std::env::var_os("TYNDALL_TEST_IMAGES") {
        std::fs::create_dir_all(&folder).unwrap();
        let path = PathBuf::from(folder).join(format!("{name}.png"));
        std::fs::write(path, render::still::png(picture).unwrap()).unwrap();
    }
}

/// How far two 8-bit pictures are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Root mean square over all channels, in steps of 1/255.
    pub rms: f64,
    /// Share of pixels with a channel that differs by more than 16/255.
    pub far_share: f64,
}

impl Difference {
    /// Devices interpolate textures with 8-bit weights (NVIDIA) up to full f32 (software): a
    /// value may move by 1/512 of the difference of neighbouring voxels. Where the transfer
    /// function is steep that moves an edge by up to 1/512 voxel, far below a pixel: a few
    /// edge pixels change visibly, the rest by a step or so.
    pub fn tolerable(&self) -> bool {
        self.rms <= 2.0 && self.far_share <= 0.01
    }
}

/// Compares two RGB pictures of the same size.
pub fn difference(a: &[u8], b: &[u8]) -> Difference {
    assert_eq!(a.len(), b.len(), "pictures of different size");
    let steps = a.iter().zip(b).map(|(&a, &b)| f64::from(a.abs_diff(b)));
    let squared: f64 = steps.clone().map(|d| d * d).sum();
    let steps: Vec<f64> = steps.collect();
    let far = steps.chunks_exact(3).filter(|pixel| pixel.iter().any(|&d| d > 16.0)).count();
    Difference {
        rms: (squared / steps.len() as f64).sqrt(),
        far_share: far as f64 / (steps.len() / 3) as f64,
    }
}

/// Compares with `tests/golden/NAME.png`. A missing golden image fails; `TYNDALL_BLESS=1` writes
/// it, and the commit that changes one says why.
pub fn assert_golden(picture: &Picture, name: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden").join(format!("{name}.png"));
    if std::env::var_os("TYNDALL_BLESS").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, render::still::png(picture).unwrap()).unwrap();
    }
    let golden = image::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgb8();
    assert_eq!((golden.width(), golden.height()), (picture.width, picture.height), "{name}: size");
    let difference = difference(golden.as_raw(), &picture.rgb());
    assert!(difference.tolerable(), "{name} differs from its golden image: {difference:?}");
}
