//! From an edit to a checked scene.

use std::sync::Arc;

use proto::FieldError;
use proto::scene_file::{Camera, SceneFile};
use scene::{PreparedVolume, Scene};
use serde_json::Value;

use super::filled_camera;
use crate::App;
use crate::datasets::volumes::Key;
use crate::problem::{Answer, Fault};

/// An edit of the scene as a whole.
#[derive(Debug, Clone)]
pub enum Edit {
    /// JSON merge patch (RFC 7396).
    Patch(Value),
    /// Replaces the scene.
    Replace(Value),
}

/// Why an edit was not applied.
pub(super) enum Refusal {
    Field(FieldError),
    /// Its volume has to be loaded first.
    Needs(Key),
}

impl From<FieldError> for Refusal {
    fn from(error: FieldError) -> Self {
        Refusal::Field(error)
    }
}

/// A volume made ready for a scene: in memory and on the GPU.
pub struct Loaded {
    key: Key,
    volume: Arc<PreparedVolume>,
}

impl Loaded {
    /// Loads a volume; `progress` is told 0..1.
    ///
    /// # Errors
    /// It cannot be read, or does not fit.
    pub async fn load(app: &Arc<App>, key: Key, progress: impl FnMut(f32)) -> Answer<Self> {
        let volume = app.volumes().load(&key, progress).await?;
        let (shared, uploaded) = (app.clone(), volume.clone());
        crate::blocking("uploading a volume", move || shared.upload(&uploaded)).await??;
        Ok(Self { key, volume })
    }

    /// A scene of this volume, checked.
    ///
    /// # Errors
    /// The field at fault.
    pub(super) fn check(self, file: SceneFile) -> Answer<Checked> {
        check_with(file, self.key, self.volume).map_err(Fault::from)
    }
}

/// A scene that passed every check.
pub(super) struct Checked {
    pub file: SceneFile,
    pub key: Key,
    pub scene: Scene,
}

/// The scene an edit starts from.
#[derive(Clone, Copy)]
pub(super) struct Current<'a> {
    pub file: &'a SceneFile,
    pub key: &'a Key,
    pub volume: &'a Arc<PreparedVolume>,
}

impl Checked {
    pub fn current(&self) -> Current<'_> {
        Current { file: &self.file, key: &self.key, volume: &self.scene.volume }
    }
}

/// One patch on a scene, checked, and whether it moves the viewer's camera. It is merged with that
/// camera, not the session's; a camera the viewer moved after it sent the patch is not moved back.
pub(super) fn patched(
    app: &App,
    current: Current<'_>,
    loaded: Option<&Loaded>,
    (camera, camera_seq): &(Camera, u32),
    seq: u32,
    patch: &Value,
) -> Result<(Checked, bool), Refusal> {
    let names_camera = patch.get("camera").is_some();
    let moves_camera = names_camera && seq >= *camera_seq;
    let value = if moves_camera {
        let mut base = current.file.clone();
        base.camera = Some(camera.clone());
        merged(&base, patch)?
    } else if names_camera {
        let mut rest = patch.clone();
        if let Value::Object(fields) = &mut rest {
            fields.remove("camera");
        }
        merged(current.file, &rest)?
    } else {
        merged(current.file, patch)?
    };
    Ok((check(app, current, loaded, value)?, moves_camera))
}

/// A scene file with a merge patch applied, not yet checked.
pub(super) fn merged(file: &SceneFile, patch: &Value) -> Result<Value, FieldError> {
    if !patch.is_object() {
        return Err(FieldError::new("", "a merge patch must be a JSON object"));
    }
    let mut value = serde_json::to_value(file).map_err(|error| FieldError::new("", error.to_string()))?;
    json_patch::merge(&mut value, patch);
    Ok(value)
}

/// Decodes and checks a scene against its volume: the present one, or the one just loaded.
pub(super) fn check(
    app: &App,
    current: Current<'_>,
    loaded: Option<&Loaded>,
    value: Value,
) -> Result<Checked, Refusal> {
    let file = SceneFile::from_value(value)?;
    let key = app.volumes().key(&file.volume)?;
    let volume = match loaded {
        _ if *current.key == key => current.volume.clone(),
        Some(loaded) if loaded.key == key => loaded.volume.clone(),
        _ => return Err(Refusal::Needs(key)),
    };
    check_with(file, key, volume).map_err(Refusal::Field)
}

fn check_with(mut file: SceneFile, key: Key, volume: Arc<PreparedVolume>) -> Result<Checked, FieldError> {
    let scene = Scene::new(&file, volume)?;
    render::check(&scene)?;
    file.camera = Some(filled_camera(&file, &scene));
    Ok(Checked { file, key, scene })
}

/// Checks a camera that comes alone, as part of a scene: there is one set of rules.
///
/// # Errors
/// The field at fault, below `camera`.
pub fn check_camera(camera: &Camera) -> Result<(), FieldError> {
    let mut scene = SceneFile::new(Default::default());
    scene.volume.builtin = Some(proto::scene_file::Builtin::Homogeneous);
    scene.camera = Some(camera.clone());
    scene.validate()
}
