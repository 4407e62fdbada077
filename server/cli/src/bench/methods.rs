//! The ladder: every method with the settings it is measured at. A method that is listed here joins
//! `accuracy`, `stability` and `skip`.

use std::collections::BTreeMap;

use proto::scene_file::Method;
use proto::{FieldError, SceneFile};
use reference::Transport;
use serde_json::{Value, json};

/// A method as the suites see it.
pub struct Entry {
    /// Which.
    pub method: Method,
    /// What it claims to draw: its same-transport reference.
    pub judge: Judge,
    /// From quick and rough to slow and good.
    pub settings: &'static [Setting],
    /// The setting of `stability` and `skip`, an index into `settings`.
    pub usual: usize,
    /// Whether its pictures are random estimates: their noise is no fault.
    pub noisy: bool,
    /// Whether it approximates what it claims: how far off it is, is told, and no fault.
    pub approximates: bool,
    /// The counter that says how much it worked.
    pub work: &'static str,
    /// The share of energy that its counters say it cut or clamped; `None`: it does neither.
    pub truncated: fn(&BTreeMap<String, u64>) -> Option<f64>,
}

/// The part of light transport that a method claims.
#[derive(Clone, Copy)]
pub struct Judge {
    /// In words, for tables.
    pub name: &'static str,
    /// The reference's.
    pub transport: Transport,
    /// Most scattering events; `None`: the scene's own.
    pub orders: Option<u32>,
}

/// One step of a ladder.
pub struct Setting {
    /// In words.
    pub label: &'static str,
    /// Distance between samples on a view ray, voxels.
    pub step_voxels: f64,
    /// Samples per pixel.
    pub samples_per_pixel: u32,
    /// Further edits: a JSON merge patch of the scene file; empty: none.
    pub patch: &'static str,
    /// Whether the quick form takes it.
    pub quick: bool,
}

/// Everything a scene asks for.
pub const FULL: Judge = Judge { name: "full", transport: Transport::Full, orders: None };
/// Single scattering without shadows.
const LOCAL: Judge = Judge { name: "local", transport: Transport::Local, orders: None };

/// Single scattering.
const SINGLE: Judge = Judge { name: "single", transport: Transport::Full, orders: Some(1) };

/// A step whose quality is that of view rays.
const fn rays(label: &'static str, step_voxels: f64, samples_per_pixel: u32, quick: bool) -> Setting {
    Setting { label, step_voxels, samples_per_pixel, patch: "", quick }
}

/// A step whose quality is the number of paths.
const fn paths(label: &'static str, patch: &'static str, quick: bool) -> Setting {
    Setting { label, step_voxels: 1.0, samples_per_pixel: 1, patch, quick }
}

/// A step whose quality is the number of photons and the resolution of their light.
const fn photons(label: &'static str, patch: &'static str, quick: bool) -> Setting {
    Setting { label, step_voxels: 1.0, samples_per_pixel: 2, patch, quick }
}

/// Every method built.
pub const LADDER: &[Entry] =
    &[LOCAL_ENTRY, CONVECTION_DIFFUSION, IMAGE_BASED, PRECOMPUTED_TRANSFER, PHOTON_MAP, PATH_TRACED];

const LOCAL_ENTRY: Entry = Entry {
    method: Method::Local,
    judge: LOCAL,
    settings: &[
        rays("step 4, 1 sample", 4.0, 1, false),
        rays("step 2, 1 sample", 2.0, 1, true),
        rays("step 1, 1 sample", 1.0, 1, false),
        rays("step 1, 4 samples", 1.0, 4, false),
        rays("step 1, 8 samples", 1.0, 8, true),
        rays("step 1/2, 16 samples", 0.5, 16, false),
        rays("step 1/4, 32 samples", 0.25, 32, true),
        rays("step 1/8, 64 samples", 0.125, 64, false),
    ],
    usual: 4,
    noisy: false,
    approximates: false,
    work: "samples_taken",
    truncated: |_| None,
};

const PHOTON_MAP: Entry = Entry {
    method: Method::PhotonMap,
    judge: FULL,
    settings: &[
        photons(
            "16 k photons, 16 texels",
            r#"{"illumination": {"photons": 16384, "photon_grid": 16}}"#,
            true,
        ),
        photons(
            "65 k photons, 24 texels",
            r#"{"illumination": {"photons": 65536, "photon_grid": 24}}"#,
            false,
        ),
        photons(
            "262 k photons, 32 texels",
            r#"{"illumination": {"photons": 262144, "photon_grid": 32}}"#,
            true,
        ),
        photons(
            "1 M photons, 48 texels",
            r#"{"illumination": {"photons": 1048576, "photon_grid": 48}}"#,
            false,
        ),
        photons(
            "4 M photons, 64 texels",
            r#"{"illumination": {"photons": 4194304, "photon_grid": 64}}"#,
            false,
        ),
    ],
    usual: 0,
    // The same photons every time.
    noisy: false,
    approximates: true,
    work: "tentative_collisions",
    truncated: |counters| {
        let count = |name: &str| counters.get(name).copied().unwrap_or(0) as f64;
        let photons = count("photons_recomputed");
        (photons > 0.0).then(|| count("throughput_cut_1024ths") / 1024.0 / photons)
    },
};

/// A step whose quality is that of the light grid, in front of view rays of usual quality.
const fn light(label: &'static str, patch: &'static str, quick: bool) -> Setting {
    Setting { label, step_voxels: 1.0, samples_per_pixel: 8, patch, quick }
}

const CONVECTION_DIFFUSION: Entry = Entry {
    method: Method::ConvectionDiffusion,
    judge: FULL,
    settings: &[
        light("grid 1/4", r#"{"illumination": {"light_grid": 0.25}}"#, true),
        light("grid 1/2", r#"{"illumination": {"light_grid": 0.5}}"#, true),
        light("grid 1", r#"{"illumination": {"light_grid": 1.0}}"#, false),
        light(
            "grid 1, residual 1e-4",
            r#"{"illumination": {"light_grid": 1.0, "max_residual": 1e-4}}"#,
            false,
        ),
        light("grid 1, 6 bands", r#"{"illumination": {"light_grid": 1.0, "light_bands": 6}}"#, false),
        light("upwind, grid 1/2", r#"{"illumination": {"transport": "upwind"}}"#, false),
        light("explicit, 5 steps", r#"{"illumination": {"transport": "explicit"}}"#, false),
        light(
            "explicit, 20 steps",
            r#"{"illumination": {"transport": "explicit", "explicit_steps": 20}}"#,
            false,
        ),
        light("heat flow", r#"{"illumination": {"diffusion": "heat"}}"#, true),
        light("no diffusion", r#"{"illumination": {"diffusion": "none"}}"#, false),
    ],
    usual: 1,
    noisy: false,
    approximates: true,
    work: "light_cells_carried",
    truncated: |_| None,
};

const IMAGE_BASED: Entry = Entry {
    method: Method::ImageBased,
    judge: SINGLE,
    settings: &[
        light(
            "16 records, 12 directions",
            r#"{"illumination": {"records": 16, "record_directions": 12}}"#,
            true,
        ),
        light("32 records, 48 directions", r#"{"illumination": {"records": 32}}"#, true),
        light("50 records, 48 directions", r#"{"illumination": {"records": 50}}"#, false),
        light(
            "50 records, 192 directions",
            r#"{"illumination": {"records": 50, "record_directions": 192}}"#,
            false,
        ),
        light(
            "50 records, 192 directions, 6 bands",
            r#"{"illumination": {"records": 50, "record_directions": 192, "record_bands": 6}}"#,
            false,
        ),
        light(
            "as published, 32 records, 48 directions",
            r#"{"illumination": {"records": 32, "record_form": "static", "record_lookup": "containing"}}"#,
            false,
        ),
        light(
            "as published, 50 records, 192 directions",
            r#"{"illumination": {"records": 50, "record_directions": 192, "record_form": "static", "record_lookup": "containing"}}"#,
            false,
        ),
    ],
    usual: 0,
    noisy: false,
    approximates: true,
    work: "record_cells_taken",
    truncated: |_| None,
};

const PRECOMPUTED_TRANSFER: Entry = Entry {
    method: Method::PrecomputedTransfer,
    judge: FULL,
    settings: &[
        light(
            "42 lights, 16 texels",
            r#"{"illumination": {"transfer_lights": 42, "transfer_grid": 16, "transfer_directions": 48, "transfer_photons": 32768}}"#,
            true,
        ),
        light(
            "162 lights, 32 texels",
            r#"{"illumination": {"transfer_lights": 162, "transfer_grid": 32, "transfer_photons": 131072}}"#,
            false,
        ),
        light(
            "642 lights, 32 texels",
            r#"{"illumination": {"transfer_lights": 642, "transfer_grid": 32, "transfer_directions": 768, "transfer_photons": 262144}}"#,
            false,
        ),
        light(
            "162 lights, 48 texels",
            r#"{"illumination": {"transfer_lights": 162, "transfer_grid": 48, "transfer_photons": 1048576}}"#,
            false,
        ),
    ],
    usual: 0,
    // The same photons every time.
    noisy: false,
    approximates: true,
    work: "transfer_rays_marched",
    truncated: |counters| {
        let count = |name: &str| counters.get(name).copied().unwrap_or(0) as f64;
        let photons = count("transfer_photons_traced");
        (photons > 0.0).then(|| count("throughput_cut_1024ths") / 1024.0 / photons)
    },
};

const PATH_TRACED: Entry = Entry {
    method: Method::PathTraced,
    judge: FULL,
    settings: &[
        paths("4 paths", r#"{"illumination": {"paths_per_pixel": 4}}"#, false),
        paths("16 paths", r#"{"illumination": {"paths_per_pixel": 16}}"#, true),
        paths("64 paths", r#"{"illumination": {"paths_per_pixel": 64}}"#, false),
        paths("256 paths", r#"{"illumination": {"paths_per_pixel": 256}}"#, true),
        paths("1024 paths", r#"{"illumination": {"paths_per_pixel": 1024}}"#, false),
    ],
    usual: 1,
    noisy: true,
    approximates: false,
    work: "tentative_collisions",
    truncated: |counters| {
        let count = |name: &str| counters.get(name).copied().unwrap_or(0) as f64;
        let lost = count("throughput_cut_1024ths") / 1024.0 + count("paths_not_finite");
        (count("paths") > 0.0).then(|| lost / count("paths"))
    },
};

impl Entry {
    /// The scene as the method draws it at a setting.
    ///
    /// # Errors
    /// A patch that does not fit the scene format: a fault of the ladder.
    pub fn applied(&self, scene: &SceneFile, setting: &Setting) -> Result<SceneFile, FieldError> {
        let mut json = as_json(scene)?;
        json["illumination"] = json!({"method": self.method.name()});
        json["sampling"]["step_voxels"] = json!(setting.step_voxels);
        json["sampling"]["samples_per_pixel"] = json!(setting.samples_per_pixel);
        if !setting.patch.is_empty() {
            let patch: Value = serde_json::from_str(setting.patch)
                .map_err(|error| FieldError::new(setting.label, error.to_string()))?;
            json_patch::merge(&mut json, &patch);
        }
        SceneFile::from_value(json)
    }

    /// The scene as the method draws it in `stability` and `skip`.
    ///
    /// # Errors
    /// As [`Entry::applied`].
    pub fn usually(&self, scene: &SceneFile) -> Result<SceneFile, FieldError> {
        self.applied(scene, &self.settings[self.usual])
    }
}

fn as_json(scene: &SceneFile) -> Result<Value, FieldError> {
    serde_json::to_value(scene).map_err(|error| FieldError::new("", error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::scene_file::Builtin;

    #[test]
    fn every_method_built_has_a_ladder_that_fits_the_format() {
        let listed: Vec<Method> = LADDER.iter().map(|entry| entry.method).collect();
        assert_eq!(listed, render::METHODS_BUILT);
        let scene = scene::builtin::scene(Builtin::Pillars).unwrap();
        for entry in LADDER {
            assert!(entry.usual < entry.settings.len());
            assert!(entry.settings.iter().any(|setting| setting.quick), "{:?}", entry.method);
            for setting in entry.settings {
                let applied = entry.applied(&scene, setting).unwrap();
                assert_eq!(applied.illumination.method, entry.method);
                assert_eq!(applied.sampling.step_voxels, setting.step_voxels);
            }
        }
    }
}
