//! What changed between two scenes, derived by comparing them.

use std::sync::Arc;

use proto::scene_file::Illumination;

use crate::light::Light;
use crate::rendering::Rendering;
use crate::scene::Scene;

/// What happened to one light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum LightChange {
    Added,
    Removed,
    /// Geometry changed (power may have, too).
    Moved,
    /// Only colour or strength changed.
    Recolored,
}

/// The difference of two scenes, by what caches depend on.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Changes {
    /// Other voxels, other spacing or another filter.
    pub volume: bool,
    /// Query set: bins in which a property of matter changed. All bins if the volume did.
    pub bins: u64,
    /// Lights that shine, by id.
    pub lights: Vec<(String, LightChange)>,
    /// The view.
    pub camera: bool,
    /// What is clipped.
    pub clip: bool,
    /// Whether clipped matter still blocks light.
    pub clip_shadows: bool,
    /// What lies behind the volume.
    pub background: bool,
    /// Scattering orders.
    pub orders: bool,
    /// Illumination method.
    pub method: bool,
    /// Scattering events after which paths are cut.
    pub longest_path: bool,
    /// Whether paths refine the picture at rest.
    pub refinement: bool,
    /// Whether there are light layers, or of which lights: their order, names or geometry.
    pub light_layers: bool,
    /// Settings of a method that keeps its light in a field.
    pub light_settings: bool,
    /// What a pixel shows.
    pub rendering: bool,
    /// Data values shown black and white.
    pub window: bool,
    /// Albedo or material of the isosurface.
    pub isosurface: bool,
    /// Step length, termination, interpolation or segments of view rays.
    pub ray_sampling: bool,
    /// Exposure or tone mapping.
    pub film: bool,
}

impl Changes {
    /// What turns `old` into `new`.
    pub fn between(old: &Scene, new: &Scene) -> Self {
        let same_voxels = Arc::ptr_eq(&old.volume, &new.volume) || old.volume.content == new.volume.content;
        let volume = !same_voxels || old.grid != new.grid || old.filter != new.filter;
        let bins = if volume {
            u64::MAX
        } else {
            old.classification().changed_bins(&new.classification(), &new.volume.bins)
        };
        let (a, b) = (&old.sampling, &new.sampling);
        Self {
            volume,
            bins,
            lights: light_changes(&old.lights, &new.lights),
            camera: old.camera != new.camera,
            clip: old.clip.bounds != new.clip.bounds || old.clip.planes != new.clip.planes,
            clip_shadows: old.clip.shadows != new.clip.shadows,
            background: old.background != new.background,
            orders: old.orders != new.orders,
            method: old.method != new.method,
            longest_path: old.paths.longest != new.paths.longest,
            refinement: old.is_refined() != new.is_refined(),
            light_layers: (old.has_light_layers() || new.has_light_layers()) && !old.shares_light_layers(new),
            light_settings: new.has_light_field() && light_settings(old) != light_settings(new),
            rendering: old.rendering != new.rendering,
            window: old.window != new.window,
            isosurface: match (old.rendering, new.rendering) {
                (Rendering::Isosurface { value: a }, Rendering::Isosurface { value: b }) => {
                    old.classification().surface_at(a) != new.classification().surface_at(b)
                }
                _ => false,
            },
            ray_sampling: a.step_voxels != b.step_voxels
                || a.termination_transmittance != b.termination_transmittance
                || a.interpolation != b.interpolation
                || a.segments != b.segments,
            film: old.film != new.film,
        }
    }

    /// Whether nothing changed.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The changes as phrases, for people.
    pub fn in_words(&self) -> Vec<String> {
        let mut words = Vec::new();
        let mut say = |holds: bool, what: &str| {
            if holds {
                words.push(what.to_owned());
            }
        };
        say(self.volume, "volume");
        say(self.camera, "camera");
        say(self.clip, "clip region");
        say(self.clip_shadows, "shadows of clipped matter");
        say(self.background, "background");
        say(self.orders, "scattering orders");
        say(self.method, "illumination method");
        say(self.longest_path, "longest path");
        // An added, moved or removed light is named below.
        say(self.light_layers && self.lights.is_empty(), "light layers");
        say(self.light_settings && !self.method, "settings of the light");
        say(self.refinement && !self.method && !self.rendering, "refinement at rest");
        say(self.rendering, "rendering mode");
        say(self.window, "window");
        say(self.isosurface, "matter of the isosurface");
        say(self.ray_sampling, "ray sampling");
        say(self.film, "exposure or tone mapping");
        if self.bins != 0 && !self.volume {
            words.push(format!("transfer function in {} of 64 bins", self.bins.count_ones()));
        }
        for (id, change) in &self.lights {
            let verb = match change {
                LightChange::Added => "added",
                LightChange::Removed => "removed",
                LightChange::Moved => "moved",
                LightChange::Recolored => "recoloured",
            };
            words.push(format!("light `{id}` {verb}"));
        }
        words
    }
}

/// Settings of the method without those of paths, which no field depends on.
fn light_settings(scene: &Scene) -> Illumination {
    let (paths_per_pixel, max_error, longest_path) = (0, 0.0, 0);
    let (light_layers, refine) = (false, false);
    let settings = scene.illumination.clone();
    Illumination { paths_per_pixel, max_error, longest_path, light_layers, refine, ..settings }
}

fn light_changes(old: &[Light], new: &[Light]) -> Vec<(String, LightChange)> {
    let mut changes = Vec::new();
    let shining = |light: &&Light| light.shines();
    for light in new.iter().filter(shining) {
        match old.iter().filter(shining).find(|other| other.id == light.id) {
            None => changes.push((light.id.clone(), LightChange::Added)),
            Some(other) if other.geometry != light.geometry => {
                changes.push((light.id.clone(), LightChange::Moved))
            }
            Some(other) if other.power != light.power => {
                changes.push((light.id.clone(), LightChange::Recolored))
            }
            Some(_) => {}
        }
    }
    let stays = |light: &&Light| new.iter().filter(shining).any(|other| other.id == light.id);
    let gone = old.iter().filter(shining).filter(|light| !stays(light));
    changes.extend(gone.map(|light| (light.id.clone(), LightChange::Removed)));
    changes
}
