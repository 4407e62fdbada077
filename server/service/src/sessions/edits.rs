//! From an edit to a checked scene.

use std::sync::Arc;

use proto::FieldError;
use proto::rest::{Dataset, ShownVolume};
use proto::scene_file::{Camera, SceneFile, VolumeSource};
use scene::part::Wish;
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
    Needs(Asked),
}

impl From<FieldError> for Refusal {
    fn from(error: FieldError) -> Self {
        Refusal::Field(error)
    }
}

/// What a scene's voxels are made from: which volume, and how much of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    key: Key,
    wish: Wish,
}

impl Asked {
    /// What a scene file asks for. Blocks while samples are first described.
    ///
    /// # Errors
    /// The field at fault, see [`Volumes::key`](crate::datasets::volumes::Volumes::key).
    pub fn of(app: &App, source: &VolumeSource) -> Result<Self, FieldError> {
        Ok(Self { key: app.volumes().key(source)?, wish: Wish::of(source) })
    }
}

/// A volume made ready for a scene: in memory and on the GPU.
pub struct Loaded {
    asked: Asked,
    volume: Arc<PreparedVolume>,
    shown: Option<ShownVolume>,
}

impl Loaded {
    /// Loads a volume; `progress` is told 0..1.
    ///
    /// # Errors
    /// It cannot be read, or does not fit.
    pub async fn load(app: &Arc<App>, asked: Asked, progress: impl FnMut(f32)) -> Answer<Arc<Self>> {
        let whole = app.volumes().load(&asked.key, progress).await?;
        let (shared, wish) = (app.clone(), asked.wish);
        let fitted = crate::blocking("uploading a volume", move || shared.fit(&whole, &wish)).await??;
        Ok(Arc::new(Self { asked, volume: fitted.volume, shown: fitted.shown }))
    }

    /// A scene of this volume, checked.
    ///
    /// # Errors
    /// The field at fault.
    pub(super) fn check(self: Arc<Self>, app: &App, file: SceneFile) -> Answer<Checked> {
        check_with(app, file, self).map_err(Fault::from)
    }

    /// What its dataset is.
    pub(super) fn describe(&self, app: &App) -> Option<Dataset> {
        app.describe_volume(&self.asked.key, &self.volume)
    }

    /// What is shown of it, where that is not all.
    pub(super) fn shown(&self) -> Option<ShownVolume> {
        self.shown.clone()
    }

    /// Whether it is what is asked for.
    fn serves(&self, asked: &Asked) -> bool {
        let level = self.volume.placement.level;
        self.asked.key == asked.key && self.asked.wish.same_voxels(&asked.wish, level)
    }
}

/// A scene that passed every check.
pub(super) struct Checked {
    pub file: SceneFile,
    pub loaded: Arc<Loaded>,
    pub scene: Scene,
}

/// The scene an edit starts from.
#[derive(Clone, Copy)]
pub(super) struct Current<'a> {
    pub file: &'a SceneFile,
    pub loaded: &'a Arc<Loaded>,
}

impl Checked {
    pub fn current(&self) -> Current<'_> {
        Current { file: &self.file, loaded: &self.loaded }
    }
}

/// One patch on a scene, checked, and whether it moves the viewer's camera. It is merged with that
/// camera, not the session's; a camera the viewer moved after it sent the patch is not moved back.
pub(super) fn patched(
    app: &App,
    current: Current<'_>,
    loaded: Option<&Arc<Loaded>>,
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
    loaded: Option<&Arc<Loaded>>,
    value: Value,
) -> Result<Checked, Refusal> {
    let file = SceneFile::from_value(value)?;
    let asked = Asked::of(app, &file.volume)?;
    let ready = [Some(current.loaded), loaded].into_iter().flatten().find(|ready| ready.serves(&asked));
    let Some(ready) = ready else { return Err(Refusal::Needs(asked)) };
    check_with(app, file, ready.clone()).map_err(Refusal::Field)
}

fn check_with(app: &App, mut file: SceneFile, loaded: Arc<Loaded>) -> Result<Checked, FieldError> {
    file.validate()?;
    let images = app.environments().images_of(&file)?;
    let scene = Scene::with_images(&file, loaded.volume.clone(), &images)?;
    render::check(&scene)?;
    file.camera = Some(filled_camera(&file, &scene));
    Ok(Checked { file, loaded, scene })
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
