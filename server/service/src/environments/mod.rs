//! Environments: pictures of light from all directions that scenes are lit by.
//!
//! ```text
//! data/environments/<id>.json      name and size: its existence is the environment's existence
//! data/environments/<id>.image     the uploaded file, named by its hash
//! ```
//!
//! The image is written and synced first, the manifest last. What a crash left without a manifest
//! is removed at start.

pub mod routes;
mod samples;

use std::collections::{BTreeMap, VecDeque};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use parking_lot::Mutex;
use proto::FieldError;
use proto::rest::Environment;
use proto::scene_file::{Light, SceneFile};
use scene::environment::{EnvironmentImage, EnvironmentImages};

use crate::config::Limits;
use crate::datasets::storage::write_atomically;
use crate::problem::{Answer, Fault};
use samples::SAMPLES;

/// Images kept in memory besides those that sessions hold.
const KEPT_IMAGES: usize = 4;
/// Bytes a decoded image may have before it is shrunk.
const MAX_DECODED_BYTES: u64 = 1 << 30;
/// Hexadecimal digits of an identifier.
const ID_DIGITS: usize = 32;

/// All environments.
pub struct Environments {
    folder: PathBuf,
    stored: Mutex<BTreeMap<String, Environment>>,
    /// Newest last.
    images: Mutex<VecDeque<(String, Arc<EnvironmentImage>)>>,
    most: usize,
}

impl Environments {
    /// Opens the folder. A manifest that cannot be used is logged and left where it is.
    ///
    /// # Errors
    /// The folder cannot be made, read or cleaned.
    pub fn open(folder: PathBuf, limits: &Limits) -> io::Result<Self> {
        fs::create_dir_all(&folder)?;
        let mut stored = BTreeMap::new();
        let mut damaged = false;
        for path in entries(&folder, "json")? {
            match read_manifest(&path) {
                Ok(environment) => drop(stored.insert(environment.id.clone(), environment)),
                Err(reason) => {
                    damaged = true;
                    tracing::error!(manifest = %path.display(), reason, "an environment is left out");
                }
            }
        }
        for path in entries(&folder, "part")? {
            fs::remove_file(path)?;
        }
        for path in entries(&folder, "image")?.into_iter().filter(|_| !damaged) {
            let id = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            if !stored.contains_key(id) {
                fs::remove_file(path)?;
            }
        }
        let stored = Mutex::new(stored);
        Ok(Self { folder, stored, images: Mutex::default(), most: limits.max_environments })
    }

    /// Samples, then uploads by name. Blocks while samples are first described.
    pub fn list(&self) -> Vec<Environment> {
        static DESCRIBED: LazyLock<Vec<Environment>> =
            LazyLock::new(|| SAMPLES.iter().map(described).collect());
        let mut uploads: Vec<_> = self.stored.lock().values().cloned().collect();
        uploads.sort_by(|a, b| a.name.cmp(&b.name));
        DESCRIBED.iter().cloned().chain(uploads).collect()
    }

    /// Stores an uploaded file; true if it was there before. Blocks.
    ///
    /// # Errors
    /// Too many environments (507), no reader accepts the file, the file system refuses.
    pub fn store(&self, name: &str, bytes: &[u8]) -> Answer<(Environment, bool)> {
        let id: String = blake3::hash(bytes).to_hex().chars().take(ID_DIGITS).collect();
        if let Some(known) = self.stored.lock().get(&id) {
            return Ok((known.clone(), true));
        }
        let failed = |error: io::Error| Fault::disk("storing an environment", &error);
        if self.stored.lock().len() >= self.most {
            let most = self.most;
            return Err(Fault::storage_full(format!(
                "There are {most} environments, the most this service keeps (`limits.max_environments`); delete one."
            )));
        }
        let path = self.image_path(&id);
        write_atomically(&path, bytes).map_err(failed)?;
        let read = match read_image(&path) {
            Ok(read) => read,
            Err(error) => {
                let _ = fs::remove_file(&path);
                return Err(Fault::unreadable_file(error));
            }
        };
        let environment = Environment {
            id: id.clone(),
            name: name.to_owned(),
            sample: false,
            width: read.image.width() as u32,
            height: read.image.height() as u32,
            bytes: bytes.len() as u64,
            mean_radiance: Some(read.image.mean_radiance()),
            notices: read.notices,
        };
        let manifest = serde_json::to_vec_pretty(&environment)
            .map_err(|error| Fault::internal("storing an environment", &error))?;
        write_atomically(&self.manifest_path(&id), &manifest).map_err(failed)?;
        self.stored.lock().insert(id.clone(), environment.clone());
        self.keep(id, read.image);
        Ok((environment, false))
    }

    /// Removes an upload; sessions that show it keep it until they are put away. Blocks.
    ///
    /// # Errors
    /// There is none, or it is a sample.
    pub fn delete(&self, id: &str) -> Answer<()> {
        if SAMPLES.iter().any(|sample| sample.id == id) {
            return Err(Fault::forbidden("Environments that come with the service cannot be deleted."));
        }
        if self.stored.lock().remove(id).is_none() {
            return Err(no_such_environment(id));
        }
        self.images.lock().retain(|(known, _)| known != id);
        fs::remove_file(self.manifest_path(id))
            .and_then(|()| fs::remove_file(self.image_path(id)))
            .map_err(|error| Fault::internal("deleting an environment", &error))
    }

    /// The images a scene's lights name. Blocks while they are read.
    ///
    /// # Errors
    /// The light whose image is not there.
    pub fn images_of(&self, file: &SceneFile) -> Result<EnvironmentImages, FieldError> {
        let mut images = EnvironmentImages::new();
        for (index, light) in file.lights.iter().enumerate() {
            let Light::Environment(light) = light else { continue };
            let Some(id) = light.image.as_ref().filter(|_| light.enabled) else { continue };
            let image = self
                .image(id)
                .map_err(|fault| FieldError::new(format!("lights[{index}].image"), fault.problem.detail))?;
            images.insert(id.clone(), image);
        }
        Ok(images)
    }

    /// An environment's image. Blocks while it is read.
    ///
    /// # Errors
    /// There is none of this identifier, or it cannot be read any more.
    pub fn image(&self, id: &str) -> Answer<Arc<EnvironmentImage>> {
        {
            let mut images = self.images.lock();
            if let Some(at) = images.iter().position(|(known, _)| known == id)
                && let Some(found) = images.remove(at)
            {
                let image = found.1.clone();
                images.push_back(found);
                return Ok(image);
            }
        }
        let image = match SAMPLES.iter().find(|sample| sample.id == id) {
            Some(sample) => {
                let image = sample.image();
                Arc::new(image.map_err(|error| Fault::internal("computing an environment", &error))?)
            }
            None if self.stored.lock().contains_key(id) => {
                read_image(&self.image_path(id)).map_err(Fault::unreadable_file)?.image
            }
            None => return Err(no_such_environment(id)),
        };
        self.keep(id.to_owned(), image.clone());
        Ok(image)
    }

    fn keep(&self, id: String, image: Arc<EnvironmentImage>) {
        let mut images = self.images.lock();
        images.push_back((id, image));
        while images.len() > KEPT_IMAGES {
            images.pop_front();
        }
    }

    fn image_path(&self, id: &str) -> PathBuf {
        self.folder.join(format!("{id}.image"))
    }

    fn manifest_path(&self, id: &str) -> PathBuf {
        self.folder.join(format!("{id}.json"))
    }
}

struct Read {
    image: Arc<EnvironmentImage>,
    notices: Vec<String>,
}

fn read_image(path: &Path) -> Result<Read, String> {
    let limits = formats::Limits { max_decoded_bytes: MAX_DECODED_BYTES, ..formats::Limits::default() };
    let read = formats::read_environment(path, &limits).map_err(|error| error.to_string())?;
    let image =
        EnvironmentImage::new(read.width, read.height, &read.rgb).map_err(|error| error.to_string())?;
    Ok(Read { image: Arc::new(image), notices: read.notices })
}

fn read_manifest(path: &Path) -> Result<Environment, String> {
    let text = fs::read(path).map_err(|error| error.to_string())?;
    let environment: Environment = serde_json::from_slice(&text).map_err(|error| error.to_string())?;
    if path.file_stem().is_none_or(|stem| stem != environment.id.as_str()) {
        return Err("its identifier is not that of its file".into());
    }
    Ok(environment)
}

/// Files of a folder with an ending.
fn entries(folder: &Path, ending: &str) -> io::Result<Vec<PathBuf>> {
    let paths: io::Result<Vec<PathBuf>> = fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect();
    Ok(paths?.into_iter().filter(|path| path.extension().is_some_and(|found| found == ending)).collect())
}

fn described(sample: &samples::Sample) -> Environment {
    let (width, height) = samples::SIZE.map(|edge| edge as u32).into();
    Environment {
        id: sample.id.into(),
        name: sample.name.into(),
        sample: true,
        width,
        height,
        bytes: 0,
        mean_radiance: sample.image().ok().map(|image| image.mean_radiance()),
        notices: Vec::new(),
    }
}

/// The answer to an unknown environment.
fn no_such_environment(id: &str) -> Fault {
    let shown: String = id.chars().take(64).collect();
    Fault::not_found(format!("There is no environment `{shown}`; GET /api/v1/environments lists them."))
}
