//! Reference pictures, kept on disk by what they were computed from.
//!
//! The key is the hash of everything a picture follows from: the scene file without what the
//! reference does not look at, the voxels, the images of light, the request, and the version of the
//! estimator. A file is one line of JSON, then means and standard errors, f64, little-endian.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};
use proto::SceneFile;
use proto::scene_file::{Film, Illumination, ImageSize, Orders, Sampling, VolumeSource};
use reference::{Progress, Request, Transport};
use serde::{Deserialize, Serialize};

use super::methods::Judge;
use super::scenes::{Loaded, Size};

/// Written in front of a file's header line.
const MAGIC: &str = "tyndall reference 1";

/// When a reference is good enough.
#[derive(Debug, Clone, Copy)]
pub struct Quality {
    /// Samples per pixel at most.
    pub samples: u32,
    /// Time at most.
    pub time: Option<Duration>,
    /// Relative error to end at.
    pub relative_error: Option<f64>,
}

impl Quality {
    /// What a suite of this size needs.
    pub fn of(size: Size, transport: Transport) -> Self {
        let seconds = |seconds| Some(Duration::from_secs(seconds));
        match (size, transport) {
            // By samples alone: every run of a test compares with the same picture.
            (Size::Quick, Transport::Full) => Self { samples: 256, time: None, relative_error: None },
            (Size::Quick, Transport::Local) => Self { samples: 16, time: None, relative_error: None },
            (Size::Small, Transport::Full) => {
                Self { samples: 1 << 14, time: seconds(20), relative_error: Some(0.01) }
            }
            (Size::Small, Transport::Local) => {
                Self { samples: 512, time: seconds(20), relative_error: Some(0.002) }
            }
            (Size::Large, Transport::Full) => {
                Self { samples: 1 << 16, time: seconds(1200), relative_error: Some(0.01) }
            }
            (Size::Large, Transport::Local) => {
                Self { samples: 512, time: seconds(300), relative_error: Some(0.002) }
            }
        }
    }
}

/// A reference picture.
pub struct Truth {
    /// Linear RGB of each pixel, rows from the top.
    pub mean: Vec<[f64; 3]>,
    /// Standard errors of the means.
    pub standard_error: Vec<[f64; 3]>,
    /// How it came about.
    pub made: Made,
    /// Whether it came from the disk.
    pub cached: bool,
}

/// How a reference came about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Made {
    width: u32,
    height: u32,
    /// Samples of every pixel.
    pub samples: u32,
    /// Root mean square of the standard errors over that of the means.
    pub relative_error: f64,
    /// Throughput of paths that were cut, and rays given up.
    pub cut: f64,
    /// See `reference::Estimate::lost`.
    pub lost: u64,
    /// Time it took.
    pub seconds: f64,
}

impl Made {
    /// Pixels of a row.
    pub fn width(&self) -> u32 {
        self.width
    }
}

/// A folder of reference pictures.
pub struct References {
    folder: PathBuf,
}

impl References {
    /// Opens the folder, made if need be.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// The reference picture of a scene, from the disk if it is there.
    ///
    /// # Errors
    /// Scenes that the reference does not judge; a disk that cannot be written.
    pub fn get(
        &self,
        loaded: &Loaded,
        judge: &Judge,
        [width, height]: [u32; 2],
        quality: &Quality,
    ) -> anyhow::Result<Truth> {
        let mut file = canonical(&loaded.file);
        if let Some(orders) = judge.orders {
            file.scattering.orders = Orders::AtMost(orders);
        }
        let request = Request {
            transport: judge.transport,
            time: quality.time,
            relative_error: quality.relative_error,
            ..Request::new(width, height, quality.samples)
        };
        let path = self.folder.join(format!("{}.reference", key(&file, loaded, &request)?));
        match read(&path, [width, height]) {
            Ok(Some(truth)) => return Ok(truth),
            Ok(None) => {}
            Err(error) => eprintln!("tyndall: {} is computed again: {error:#}", path.display()),
        }
        let scene = loaded.scene(&file)?;
        let estimate = reference::render(&scene, &request, &Progress::default())?;
        let made = Made {
            width,
            height,
            samples: estimate.samples,
            relative_error: estimate.relative_error,
            cut: estimate.cut,
            lost: estimate.lost,
            seconds: estimate.elapsed.as_secs_f64(),
        };
        let truth =
            Truth { mean: estimate.mean, standard_error: estimate.standard_error, made, cached: false };
        write(&path, &truth).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(truth)
    }
}

/// The file with everything at its default that the reference does not look at, so that it is no
/// part of the key. Voxels are known by their content.
fn canonical(file: &SceneFile) -> SceneFile {
    SceneFile {
        volume: VolumeSource {
            file: Some("voxels".into()),
            filter: file.volume.filter,
            level: file.volume.level,
            region: file.volume.region,
            ..VolumeSource::default()
        },
        illumination: Illumination::default(),
        sampling: Sampling::default(),
        film: Film::default(),
        image: ImageSize::default(),
        ..file.clone()
    }
}

fn key(file: &SceneFile, loaded: &Loaded, request: &Request) -> anyhow::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&reference::ESTIMATOR_VERSION.to_le_bytes());
    hasher.update(serde_json::to_string(file)?.as_bytes());
    hasher.update(&loaded.volume.content);
    for (name, image) in &loaded.images {
        hasher.update(name.as_bytes());
        hasher.update(&image.content());
    }
    hasher.update(format!("{request:?}").as_bytes());
    Ok(hasher.finalize().to_hex()[..32].to_owned())
}

fn write(path: &Path, truth: &Truth) -> anyhow::Result<()> {
    let mut bytes = format!("{MAGIC} {}\n", serde_json::to_string(&truth.made)?).into_bytes();
    for pixels in [&truth.mean, &truth.standard_error] {
        bytes.extend(pixels.iter().flatten().flat_map(|x| x.to_le_bytes()));
    }
    // Whole or not at all, even if two runs write it.
    let partly = path.with_extension(format!("{}.part", std::process::id()));
    let mut file = std::fs::File::create(&partly)?;
    file.write_all(&bytes)?;
    drop(file);
    Ok(std::fs::rename(partly, path)?)
}

/// `None` if there is no such file.
fn read(path: &Path, [width, height]: [u32; 2]) -> anyhow::Result<Option<Truth>> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let line = bytes.iter().position(|&byte| byte == b'\n').context("it has no header")?;
    let header = std::str::from_utf8(&bytes[..line])?.strip_prefix(MAGIC).context("another format")?;
    let made: Made = serde_json::from_str(header)?;
    let values: Vec<f64> =
        bytes[line + 1..].as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let pixels = width as usize * height as usize;
    if (made.width, made.height) != (width, height) || values.len() != 6 * pixels {
        bail!("it has another size");
    }
    if values.iter().any(|x| !x.is_finite()) {
        bail!("it holds numbers that are not finite");
    }
    let triples = values.as_chunks::<3>().0;
    Ok(Some(Truth {
        mean: triples[..pixels].to_vec(),
        standard_error: triples[pixels..].to_vec(),
        made,
        cached: true,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::methods::FULL;
    use crate::bench::scenes::STANDARD;

    const SIZE: [u32; 2] = [6, 4];
    const QUALITY: Quality = Quality { samples: 4, time: None, relative_error: None };

    fn loaded() -> Loaded {
        let smoke = STANDARD.iter().find(|standard| standard.name == "smoke_sky").unwrap();
        smoke.load(Size::Quick).unwrap()
    }

    fn get(references: &References, loaded: &Loaded) -> Truth {
        references.get(loaded, &FULL, SIZE, &QUALITY).unwrap()
    }

    #[test]
    fn a_second_run_reads_what_the_first_computed() {
        let folder = tempfile::tempdir().unwrap();
        let references = References::open(folder.path()).unwrap();
        let mut loaded = loaded();
        let first = get(&references, &loaded);
        // What the reference does not look at makes no other picture.
        loaded.file.sampling.step_voxels = 0.25;
        loaded.file.film.exposure_stops = 1.0;
        let second = get(&references, &loaded);
        assert!(!first.cached && second.cached);
        assert_eq!(first.mean, second.mean);
        assert_eq!(first.standard_error, second.standard_error);
        assert_eq!(first.made, second.made);
    }

    #[test]
    fn another_scene_volume_image_or_judge_is_another_picture() {
        let folder = tempfile::tempdir().unwrap();
        let references = References::open(folder.path()).unwrap();
        let first = loaded();
        get(&references, &first);
        let mut denser = loaded();
        denser.file.density = 2.0;
        let coarser = Loaded {
            volume: crate::bench::scenes::prepared(scene::builtin::build(
                proto::scene_file::Builtin::SmokePlume,
                [19; 3],
                &|_| {},
            )),
            ..loaded()
        };
        let mut darker = loaded();
        let black = scene::EnvironmentImage::new(1, 1, &[0.5; 3]).unwrap();
        darker.images.insert("sky".into(), std::sync::Arc::new(black));
        for other in [denser, coarser, darker] {
            assert!(!get(&references, &other).cached);
        }
        let single = Judge { orders: Some(1), ..FULL };
        assert!(!references.get(&first, &single, SIZE, &QUALITY).unwrap().cached);
    }

    #[test]
    fn a_damaged_file_is_computed_again() {
        let folder = tempfile::tempdir().unwrap();
        let references = References::open(folder.path()).unwrap();
        let loaded = loaded();
        let first = get(&references, &loaded);
        let file = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
        let whole = std::fs::read(&file).unwrap();
        for damaged in [whole[..whole.len() - 8].to_vec(), b"something else".to_vec()] {
            std::fs::write(&file, damaged).unwrap();
            let again = get(&references, &loaded);
            assert!(!again.cached);
            assert_eq!(again.mean, first.mean);
        }
    }
}
