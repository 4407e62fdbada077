//! The checked scene and its snapshots.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use proto::FieldError;
use proto::scene_file::{self as file, Film, Filter, Method, Orders, RenderingMode, Sampling, SceneFile};

use crate::camera::Camera;
use crate::clip::Clip;
use crate::environment::{EnvironmentImage, EnvironmentImages};
use crate::grid::Grid;
use crate::light::{Light, LightGeometry};
use crate::material::Material;
use crate::prepared::PreparedVolume;
use crate::rendering::Rendering;
use crate::transfer_function::{Classification, TransferFunction};

/// Share of the brightest light's power that is nothing, whatever the units of the two: some distances are
/// far smaller than others, but not by so much.
const NEGLIGIBLE_POWER: f64 = 1e-15;

/// Everything a picture depends on. Immutable; cheap to clone and to change one part of.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Voxels with what was derived from them.
    pub volume: Arc<PreparedVolume>,
    /// Interpolation between voxels.
    pub filter: Filter,
    /// Where the voxels lie in the world.
    pub grid: Grid,
    /// Data values at `s` = 0 and 1.
    pub value_range: [f64; 2],
    /// From `s` to matter.
    pub transfer_function: TransferFunction,
    /// What the transfer function's material indices mean; the first is isotropic.
    pub materials: Vec<Material>,
    /// Lights that shine; with light layers those that are off or black, too.
    pub lights: Vec<Light>,
    /// The view.
    pub camera: Camera,
    /// What is left out.
    pub clip: Clip,
    /// What is seen where the volume is transparent.
    pub background: Background,
    /// Scattering events a light path may have.
    pub orders: Orders,
    /// Illumination method.
    pub method: Method,
    /// The method's settings, as the scene file has them.
    pub illumination: file::Illumination,
    /// How the path tracer ends.
    pub paths: Paths,
    /// What a pixel shows.
    pub rendering: Rendering,
    /// Data values that projections and slices show black and white.
    pub window: [f64; 2],
    /// Sampling of view rays and pixels.
    pub sampling: Sampling,
    /// From radiance to the picture.
    pub film: Film,
}

/// How the path tracer ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paths {
    /// Paths of each pixel.
    pub per_pixel: u32,
    /// Relative standard error of the picture at which there are enough of them.
    pub max_error: f64,
    /// Scattering events after which a path is cut.
    pub longest: u32,
    /// Whether what each light brings is kept apart.
    pub light_layers: bool,
    /// Whether pictures in the light of a field are refined by paths.
    pub refine: bool,
}

/// What makes a picture of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Integrator {
    /// View rays, marched.
    RayCaster,
    /// Paths of light, followed from the eye.
    PathTracer,
}

/// What is seen where the volume is transparent.
#[derive(Debug, Clone, PartialEq)]
pub enum Background {
    /// One radiance everywhere, linear RGB; that of a uniform environment, too.
    Color(DVec3),
    /// The environment light's image.
    Image {
        /// Texels.
        image: Arc<EnvironmentImage>,
        /// Rotation of the image.
        world_from_map: DMat3,
        /// Factor of the texels, linear RGB.
        scale: DVec3,
    },
}

impl Background {
    /// Linear RGB factor of what is seen: the colour, or the image's factor.
    pub fn power(&self) -> DVec3 {
        match self {
            Background::Color(color) => *color,
            Background::Image { scale, .. } => *scale,
        }
    }

    /// Whether it differs from another in [`Background::power`] at most.
    pub fn differs_in_power_alone(&self, other: &Self) -> bool {
        match (self, other) {
            (Background::Color(_), Background::Color(_)) => true,
            (
                Background::Image { image: a, world_from_map: a_map, .. },
                Background::Image { image: b, world_from_map: b_map, .. },
            ) => a == b && a_map == b_map,
            _ => false,
        }
    }
}

/// A scene at a moment of its history. Later snapshots have larger epochs.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// Counts the scene's edits, from 1.
    pub epoch: u32,
    /// The scene.
    pub scene: Scene,
}

impl Scene {
    /// Checks a scene file against the volume it names. Environment images are refused; see
    /// [`Scene::with_images`].
    ///
    /// # Errors
    /// The first field that is out of range or asks for what is not built yet.
    pub fn new(file: &SceneFile, volume: Arc<PreparedVolume>) -> Result<Self, FieldError> {
        Self::with_images(file, volume, &EnvironmentImages::new())
    }

    /// Checks a scene file against the volume and the environment images it names.
    ///
    /// # Errors
    /// The first field that is out of range, asks for what is not built yet, or names an image
    /// that is not in `images`.
    pub fn with_images(
        file: &SceneFile,
        volume: Arc<PreparedVolume>,
        images: &EnvironmentImages,
    ) -> Result<Self, FieldError> {
        file.validate()?;
        let (transfer_function, materials) = TransferFunction::from_file(file);
        let mut lights = Vec::with_capacity(file.lights.len());
        let integrator = integrator(file.illumination.method, file.rendering.mode == RenderingMode::Volume);
        let keep_off = integrator == Integrator::PathTracer && file.illumination.light_layers;
        for (index, light) in file.lights.iter().enumerate() {
            let light = Light::from_file(light, index, images)?;
            lights.extend(light.filter(|light| keep_off || light.shines()));
        }
        let camera = match &file.camera {
            Some(camera) => Camera::from_file(camera),
            None => Camera::from_file(&Camera::default_file(volume.volume.orientation.is_some())),
        };
        let background = match file.background {
            file::Background::Color(color) => Background::Color(DVec3::from_array(color)),
            file::Background::Environment => environment(&lights),
        };
        let value_range = file.value_range.unwrap_or(volume.range);
        let (grid, clip) = place(file, &volume);
        Ok(Self {
            filter: file.volume.filter,
            grid,
            value_range,
            transfer_function,
            materials,
            lights,
            camera,
            clip,
            background,
            orders: file.scattering.orders,
            method: file.illumination.method,
            illumination: file.illumination.clone(),
            paths: Paths {
                per_pixel: file.illumination.paths_per_pixel,
                max_error: file.illumination.max_error,
                longest: file.illumination.longest_path,
                light_layers: file.illumination.light_layers,
                refine: file.illumination.refine,
            },
            window: file.rendering.window.unwrap_or(value_range),
            rendering: Rendering::from_file(&file.rendering, value_range),
            sampling: file.sampling.clone(),
            film: file.film.clone(),
            volume,
        })
    }

    /// This scene, made from the same file, with another part of its volume.
    pub fn with_part(self, file: &SceneFile, part: Arc<PreparedVolume>) -> Self {
        let (grid, clip) = place(file, &part);
        Self { volume: part, grid, clip, ..self }
    }

    /// The scene without lights that are nothing beside the brightest, if there are any: for methods that
    /// work for each light.
    #[must_use]
    pub fn without_negligible_lights(&self) -> Option<Self> {
        let power = |light: &Light| light.power.max_element();
        let brightest = self.lights.iter().map(power).fold(0.0, f64::max);
        let counts = |light: &&Light| power(light) > NEGLIGIBLE_POWER * brightest;
        let lights: Vec<Light> = self.lights.iter().filter(counts).cloned().collect();
        (lights.len() < self.lights.len()).then(|| Self { lights, ..self.clone() })
    }

    /// This scene moved so that the box of its voxels is centred at the origin, as the renderer
    /// takes it: everything that has a place moves along, so the picture is the same.
    pub fn centred(&self) -> Self {
        let offset = -self.grid.center_world;
        let mut scene = self.clone();
        scene.grid.center_world = DVec3::ZERO;
        scene.camera.eye += offset;
        scene.lights.iter_mut().for_each(|light| light.geometry.move_by(offset));
        for (normal, height) in &mut scene.clip.planes {
            *height += normal.dot(offset);
        }
        if let Rendering::Slice { normal, offset: height } = &mut scene.rendering {
            *height += normal.dot(offset);
        }
        scene
    }

    /// The transfer function with what it refers to.
    pub fn classification(&self) -> Classification<'_> {
        Classification {
            function: &self.transfer_function,
            materials: &self.materials,
            value_range: self.value_range,
        }
    }

    /// What makes its picture: whatever the method, projections, slices and isosurfaces are cast.
    pub fn integrator(&self) -> Integrator {
        integrator(self.method, self.rendering == Rendering::Volume)
    }

    /// Whether its light is computed ahead, on a grid, and view rays read it there.
    pub fn has_light_field(&self) -> bool {
        self.rendering == Rendering::Volume && !matches!(self.method, Method::Local | Method::PathTraced)
    }

    /// Whether its picture is mixed from layers, one for what each light brings.
    pub fn has_light_layers(&self) -> bool {
        self.integrator() == Integrator::PathTracer && self.paths.light_layers
    }

    /// Whether both have layers, of the same lights in the same order but for their power.
    pub fn shares_light_layers(&self, other: &Self) -> bool {
        let layered = self.has_light_layers() && other.has_light_layers();
        let same = |(a, b): (&Light, &Light)| a.id == b.id && a.geometry == b.geometry;
        layered && self.lights.len() == other.lights.len() && self.lights.iter().zip(&other.lights).all(same)
    }

    /// Whether paths refine its picture at rest: it is in the light of a method that approximates all of
    /// light, and the scene asks for it.
    pub fn is_refined(&self) -> bool {
        self.paths.refine && self.has_light_field() && self.method != Method::ImageBased
    }

    /// The same scene as paths see it, which refine its picture.
    pub fn path_traced(&self) -> Self {
        let paths = Paths { light_layers: false, ..self.paths };
        Self { method: Method::PathTraced, paths, ..self.clone() }
    }

    /// Samples per pixel of a picture at rest: view rays, then paths that refine it.
    pub fn samples_at_rest(&self) -> u32 {
        match self.integrator() {
            Integrator::RayCaster if self.is_refined() => {
                self.sampling.samples_per_pixel.saturating_add(self.paths.per_pixel)
            }
            Integrator::RayCaster => self.sampling.samples_per_pixel,
            Integrator::PathTracer => self.paths.per_pixel,
        }
    }

    /// Of so many samples per pixel, how many are its integrator's, and how many are paths that refine.
    pub fn samples_and_paths(&self, samples_per_pixel: u32) -> [u32; 2] {
        let own = if self.is_refined() { self.sampling.samples_per_pixel } else { u32::MAX };
        [samples_per_pixel.min(own), samples_per_pixel.saturating_sub(own)]
    }

    /// The image of the environment light, if it has one, and its rotation. It is what lies behind the
    /// volume, too, where `background` shows an image.
    pub fn environment_image(&self) -> Option<(&Arc<EnvironmentImage>, DMat3)> {
        self.lights.iter().find_map(|light| match &light.geometry {
            LightGeometry::Environment { image, world_from_map } => Some((image, *world_from_map)),
            _ => None,
        })
    }

    /// Whether any of its matter may emit light.
    pub fn glows(&self) -> bool {
        self.transfer_function.points.iter().any(|point| point.emission.max_element() > 0.0)
    }

    /// Bins in which matter can occur.
    pub fn bins_with_matter(&self) -> u64 {
        self.classification().bins_with_matter(&self.volume.bins)
    }

    /// Bins that a macrocell must be able to touch for a view ray to look into it.
    pub fn bins_in_view(&self) -> u64 {
        match self.rendering {
            Rendering::Volume => self.bins_with_matter(),
            Rendering::Isosurface { value } => self.classification().bins_near(value, &self.volume.bins),
            Rendering::Maximum | Rendering::Minimum | Rendering::Average | Rendering::Slice { .. } => {
                u64::MAX
            }
        }
    }

    /// Data values at 0 and 1 of what view rays read: of `s`, or of the grey scale.
    pub fn range_in_view(&self) -> [f64; 2] {
        if self.rendering.is_lit() { self.value_range } else { self.window }
    }

    /// Distance between samples on a view ray, world units.
    pub fn step_world(&self) -> f64 {
        self.sampling.step_voxels * self.grid.smallest_voxel_edge_world()
    }
}

fn integrator(method: Method, volume_in_light: bool) -> Integrator {
    match (method, volume_in_light) {
        (Method::PathTraced, true) => Integrator::PathTracer,
        _ => Integrator::RayCaster,
    }
}

/// The environment light as a background, black without one.
fn environment(lights: &[Light]) -> Background {
    let shown = |light: &Light| match &light.geometry {
        LightGeometry::UniformEnvironment => Some(Background::Color(light.power)),
        LightGeometry::Environment { image, world_from_map } => Some(Background::Image {
            image: image.clone(),
            world_from_map: *world_from_map,
            scale: light.power,
        }),
        _ => None,
    };
    lights.iter().find_map(shown).unwrap_or(Background::Color(DVec3::ZERO))
}

/// Where the voxels held lie in the world, and what of their box is kept.
fn place(file: &SceneFile, volume: &PreparedVolume) -> (Grid, Clip) {
    let placement = &volume.placement;
    let spacing = file.spacing.unwrap_or(placement.whole_spacing);
    (Grid::placed(volume.volume.dims, placement, spacing), Clip::from_file(&file.clip, placement))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::changes::Changes;
    use crate::{Volume, Voxels};

    #[test]
    fn paths_refine_what_approximates_all_of_light() {
        let scene = |method: &str, refine: bool, mode: &str| {
            let file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "rendering": {"mode": mode},
                "sampling": {"samples_per_pixel": 6},
                "illumination": {"method": method, "refine": refine, "paths_per_pixel": 40}});
            let volume = PreparedVolume::new(Volume::new([2; 3], Voxels::U8(vec![9; 8])), &|_| {});
            Scene::new(&SceneFile::from_value(file).unwrap(), Arc::new(volume)).unwrap()
        };
        for method in ["photon_map", "convection_diffusion", "precomputed_transfer"] {
            let refined = scene(method, true, "volume");
            assert!(refined.is_refined() && refined.samples_at_rest() == 46);
            let shares = [1, 6, 7, 50].map(|samples| refined.samples_and_paths(samples));
            assert_eq!(shares, [[1, 0], [6, 0], [6, 1], [6, 44]]);
            assert_eq!(refined.path_traced().integrator(), Integrator::PathTracer);
            // No light is computed anew for it.
            let changes = Changes::between(&scene(method, false, "volume"), &refined);
            assert_eq!(changes, Changes { refinement: true, ..Changes::default() });
        }
        for unrefined in [
            scene("photon_map", false, "volume"),
            scene("photon_map", true, "maximum"),
            scene("image_based", true, "volume"),
            scene("local", true, "volume"),
        ] {
            assert!(!unrefined.is_refined());
            assert_eq!(unrefined.samples_and_paths(50), [50, 0]);
            assert_eq!(unrefined.samples_at_rest(), 6);
        }
        assert_eq!(scene("path_traced", true, "volume").samples_at_rest(), 40);
    }

    #[test]
    fn lights_that_are_nothing_beside_the_brightest_are_left_out() {
        let sun = |id: &str, power: f64| json!({"id": id, "type": "directional", "direction": [0, -1, 0], "irradiance": [0, power, 0]});
        let scene = |lights: Vec<serde_json::Value>| {
            let file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "lights": lights});
            let volume = PreparedVolume::new(Volume::new([2; 3], Voxels::U8(vec![9; 8])), &|_| {});
            Scene::new(&SceneFile::from_value(file).unwrap(), Arc::new(volume)).unwrap()
        };
        let lit = scene(vec![sun("key", 1e4), sun("spark", 1e-30), sun("moon", 1e-9)]);
        let ids: Vec<String> =
            lit.without_negligible_lights().unwrap().lights.into_iter().map(|light| light.id).collect();
        assert_eq!(ids, ["key", "moon"]);
        assert!(scene(vec![sun("key", 1e-30), sun("moon", 1e-43)]).without_negligible_lights().is_none());
        assert!(scene(Vec::new()).without_negligible_lights().is_none());
    }
}
