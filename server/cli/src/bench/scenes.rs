//! The standard scenes of `accuracy`: what is lit, by what, and how matter scatters.

use std::sync::Arc;

use proto::SceneFile;
use proto::scene_file::{Builtin, Light};
use scene::{EnvironmentImage, EnvironmentImages, PreparedVolume, Volume};
use serde_json::{Value, json};

use super::bone::bone_like_ct;

/// How large scenes and pictures are, and how good references.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// For tests: seconds altogether.
    Quick,
    /// For a machine without a GPU: minutes.
    Small,
    /// For a GPU; references take an hour or more.
    Large,
}

impl Size {
    /// Voxels along each axis.
    pub fn volume_edge(self) -> usize {
        match self {
            Size::Quick => 24,
            Size::Small => 48,
            Size::Large => 256,
        }
    }

    /// Pixels along each axis.
    pub fn image_edge(self) -> u32 {
        match self {
            Size::Quick => 28,
            Size::Small => 48,
            Size::Large => 384,
        }
    }

    /// For reports.
    pub fn name(self) -> &'static str {
        match self {
            Size::Quick => "quick",
            Size::Small => "small",
            Size::Large => "large",
        }
    }
}

/// A scene by name.
pub struct Standard {
    /// Name in tables and files.
    pub name: &'static str,
    /// What it is there for.
    pub about: &'static str,
    /// Whether the quick form takes it.
    pub quick: bool,
    matter: Matter,
    patch: fn() -> Value,
}

#[derive(Clone, Copy)]
enum Matter {
    Of(Builtin),
    BoneLikeCt,
}

/// A scene with its voxels and pictures of light.
pub struct Loaded {
    /// As in a file.
    pub file: SceneFile,
    /// Its voxels.
    pub volume: Arc<PreparedVolume>,
    /// Environment images by the name the file gives them.
    pub images: EnvironmentImages,
}

impl Loaded {
    /// The checked scene of another file on the same voxels.
    ///
    /// # Errors
    /// The first field that is out of range.
    pub fn scene(&self, file: &SceneFile) -> Result<scene::Scene, proto::FieldError> {
        scene::Scene::with_images(file, self.volume.clone(), &self.images)
    }
}

/// Name of the sky in scene files.
const SKY: &str = "sky";

fn as_it_is() -> Value {
    json!({})
}

/// Every standard scene.
pub const STANDARD: [Standard; 12] = [
    Standard {
        name: "cornell_box",
        about: "area light and a little uniform light; diffuse walls, many bounces",
        quick: true,
        matter: Matter::Of(Builtin::CornellBox),
        patch: as_it_is,
    },
    Standard {
        name: "pillars",
        about: "two directional lights, uniform light; surfaces, long shadows",
        quick: true,
        matter: Matter::Of(Builtin::Pillars),
        patch: as_it_is,
    },
    Standard {
        name: "buckyball",
        about: "directional lights, uniform light; surfaces and haze",
        quick: false,
        matter: Matter::Of(Builtin::Buckyball),
        patch: as_it_is,
    },
    Standard {
        name: "smoke",
        about: "one directional light; g = 0, self-shadowing",
        quick: false,
        matter: Matter::Of(Builtin::SmokePlume),
        patch: || json!({"lights": [key_light()]}),
    },
    Standard {
        name: "smoke_forward",
        about: "one point light behind the smoke; g = 0.8",
        quick: true,
        matter: Matter::Of(Builtin::SmokePlume),
        patch: || {
            json!({"materials": {"smoke": {"phase": {"type": "henyey_greenstein", "g": 0.8}}},
            "lights": [{"id": "lamp", "type": "point", "position": [-0.5, 0.3, -0.9], "intensity": [6, 5.4, 4.5]}]})
        },
    },
    Standard {
        name: "smoke_backward",
        about: "one directional light, uniform light; g = -0.5",
        quick: false,
        matter: Matter::Of(Builtin::SmokePlume),
        patch: || {
            json!({"materials": {"smoke": {"phase": {"type": "henyey_greenstein", "g": -0.5}}},
            "lights": [key_light(), {"id": "sky", "type": "environment", "radiance": [0.1, 0.12, 0.16]}]})
        },
    },
    Standard {
        name: "smoke_sky",
        about: "a picture of the sky with a sun; g = 0.8",
        quick: true,
        matter: Matter::Of(Builtin::SmokePlume),
        patch: || {
            json!({"materials": {"smoke": {"phase": {"type": "henyey_greenstein", "g": 0.8}}},
            "lights": [{"id": "sky", "type": "environment", "image": SKY}]})
        },
    },
    Standard {
        name: "vessel_tree",
        about: "directional lights, uniform light; thin shiny surfaces, nearly all empty",
        quick: false,
        matter: Matter::Of(Builtin::VesselTree),
        patch: as_it_is,
    },
    Standard {
        name: "thick_blob",
        about: "two ball lights; albedo near 1, many mean free paths thick (diffusion regime)",
        quick: true,
        matter: Matter::Of(Builtin::ThickBlob),
        patch: || {
            json!({"lights": [
            {"id": "key", "type": "sphere", "center": [-0.46, 0.48, 0.34], "radius": 0.08, "radiance": [180, 137, 85]},
            {"id": "fill", "type": "sphere", "center": [0.5, -0.36, 0.3], "radius": 0.08, "radiance": [13, 37, 88]}]})
        },
    },
    Standard {
        name: "thin_shell",
        about: "a disk light and uniform light; a shell thinner than a voxel",
        quick: false,
        matter: Matter::Of(Builtin::NestedShells),
        patch: || {
            json!({
            "transfer_function": {"points": [
                {"s": 0.0, "extinction": 0, "albedo": [0.3, 0.6, 0.9], "material": "skin"},
                {"s": 0.10, "extinction": 0, "albedo": [0.3, 0.6, 0.9], "material": "skin"},
                {"s": 0.13, "extinction": 250, "albedo": [0.3, 0.6, 0.9], "material": "skin"},
                {"s": 0.16, "extinction": 0, "albedo": [0.3, 0.6, 0.9], "material": "skin"},
                {"s": 0.70, "extinction": 0, "albedo": [0.95, 0.7, 0.3], "material": "skin"},
                {"s": 0.80, "extinction": 120, "albedo": [0.95, 0.7, 0.3], "material": "skin"}]},
            "lights": [
                {"id": "lamp", "type": "disk", "center": [0.3, 0.9, 0.7], "normal": [-0.3, -0.9, -0.7], "radius": 0.25, "radiance": [14, 13, 11]},
                {"id": "room", "type": "environment", "radiance": [0.16, 0.18, 0.22]}]})
        },
    },
    Standard {
        name: "bone_like_ct",
        about: "directional light, uniform light; Ashikhmin-Shirley surfaces, noise, cut open by a clip box",
        quick: false,
        matter: Matter::BoneLikeCt,
        patch: || {
            json!({
            "value_range": [-1000, 2000],
            "transfer_function": {"points": [
                {"s": 0.0, "extinction": 0, "albedo": [0.8, 0.5, 0.4], "material": "bone"},
                {"s": 0.40, "extinction": 0, "albedo": [0.9, 0.7, 0.55], "material": "bone"},
                {"s": 0.55, "extinction": 90, "albedo": [0.93, 0.85, 0.72], "material": "bone"},
                {"s": 0.80, "extinction": 300, "albedo": [0.95, 0.92, 0.86], "material": "bone"}]},
            "materials": {"bone": {"surface": 0.9, "brdf":
                {"type": "ashikhmin_shirley", "diffuse": 0.8, "specular": 0.06, "exponents": [60, 60]}}},
            "lights": [
                {"id": "key", "type": "directional", "direction": [0.5, -0.5, -0.7], "irradiance": [3.2, 3.0, 2.7]},
                {"id": "room", "type": "environment", "radiance": [0.2, 0.2, 0.22]}],
            "camera": {"position": [0.35, 0.35, 1.75], "target": [0, 0.02, 0], "up": [0, 1, 0], "fov_y_degrees": 33},
            "clip": {"box": [[0, 0, 0], [1, 1, 0.52]], "shadows": false},
            "background": [0.012, 0.014, 0.02]})
        },
    },
    Standard {
        name: "mixed_lights",
        about: "point, ball, rectangle, directional and uniform light at once",
        quick: false,
        matter: Matter::Of(Builtin::Buckyball),
        patch: || {
            json!({"lights": [
            {"id": "sun", "type": "directional", "direction": [0.55, -0.65, -0.55], "irradiance": [1.2, 1.1, 0.9]},
            {"id": "lamp", "type": "point", "position": [-0.7, 0.6, 0.5], "intensity": [0.9, 0.5, 0.3]},
            {"id": "ball", "type": "sphere", "center": [0.7, -0.5, 0.5], "radius": 0.1, "radiance": [8, 16, 30]},
            {"id": "panel", "type": "rectangle", "center": [0, 0.8, 0.2], "normal": [0, -1, 0], "up": [0, 0, 1], "size": [0.5, 0.5], "radiance": [3, 3, 3]},
            {"id": "room", "type": "environment", "radiance": [0.1, 0.11, 0.14]}]})
        },
    },
];

fn key_light() -> Value {
    json!({"id": "key", "type": "directional", "direction": [0.6, -0.6, -0.5], "irradiance": [4.5, 4.0, 3.2]})
}

impl Standard {
    /// Makes the voxels and the scene.
    ///
    /// # Errors
    /// A scene that does not fit the format: a fault of this table.
    pub fn load(&self, size: Size) -> anyhow::Result<Loaded> {
        let edge = size.volume_edge();
        let (volume, mut json) = match self.matter {
            Matter::Of(kind) => {
                let json = serde_json::to_value(scene::builtin::scene(kind)?)?;
                (scene::builtin::build(kind, [edge; 3], &|_| {}), json)
            }
            Matter::BoneLikeCt => {
                let json = json!({"version": 1, "volume": {"file": "bone_like_ct"}});
                (bone_like_ct(edge), json)
            }
        };
        json["volume"]["dims"] = json!([edge, edge, edge]);
        json_patch::merge(&mut json, &(self.patch)());
        let file = SceneFile::from_value(json)?;
        let mut images = EnvironmentImages::new();
        if file.lights.iter().any(|light| matches!(light, Light::Environment(l) if l.image.is_some())) {
            images.insert(SKY.to_owned(), Arc::new(sky()?));
        }
        Ok(Loaded { file, volume: prepared(volume), images })
    }
}

/// A volume ready to be drawn.
pub fn prepared(volume: Volume) -> Arc<PreparedVolume> {
    Arc::new(PreparedVolume::new(volume, &|_| {}))
}

/// A blue sky with a small bright sun to the upper left behind the volume, over brown ground.
fn sky() -> anyhow::Result<EnvironmentImage> {
    const WIDTH: usize = 64;
    const HEIGHT: usize = 32;
    /// Texels of the sun: columns, rows.
    const SUN: [[usize; 2]; 2] = [[58, 60], [8, 10]];
    let texel = |index: usize| {
        let (x, y) = (index % WIDTH, index / WIDTH);
        let [columns, rows] = SUN;
        let inside = |range: [usize; 2], at: usize| (range[0]..range[1]).contains(&at);
        if inside(columns, x) && inside(rows, y) {
            return [260.0, 230.0, 180.0];
        }
        if y >= HEIGHT / 2 { [0.06, 0.05, 0.035] } else { [0.16, 0.24, 0.42] }
    };
    let rgb: Vec<f32> = (0..WIDTH * HEIGHT).flat_map(texel).collect();
    Ok(EnvironmentImage::new(WIDTH, HEIGHT, &rgb)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_standard_scene_is_consistent() {
        for standard in STANDARD {
            let loaded = standard.load(Size::Quick).unwrap();
            let scene = loaded.scene(&loaded.file).unwrap();
            assert!(!scene.lights.is_empty() && scene.bins_with_matter() != 0, "{}", standard.name);
        }
    }
}
