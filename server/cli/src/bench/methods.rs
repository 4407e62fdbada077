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
    /// Relative L2 by which it may be off what it claims, at its usual setting, where a case of
    /// `stability` asks for less; 0: it is exact.
    pub off_by_at_most: f64,
    /// Cases of `stability` where it may be off by more, for what its model leaves out.
    pub weak_at: &'static [(&'static str, f64)],
    /// Half as fine a grid as the usual setting's, a merge patch, and by how much brightness may differ in
    /// it; `None`: it has no grid.
    pub halved: Option<(&'static str, f64)>,
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
    Setting { label, step_voxels: 1.0, samples_per_pixel: 8, patch, quick }
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
    off_by_at_most: 0.0,
    weak_at: &[],
    halved: None,
    work: "samples_taken",
    truncated: |_| None,
};

const PHOTON_MAP: Entry = Entry {
    method: Method::PhotonMap,
    judge: FULL,
    settings: &[
        photons(
            "16 k photons, 16 texels",
            r#"{"illumination": {"photons": 16384, "photon_events": 24, "photon_grid": 16}}"#,
            true,
        ),
        photons(
            "16 k photons, 16 texels, gathered on rays",
            r#"{"illumination": {"photons": 16384, "photon_events": 24, "photon_grid": 16, "gather": "ray"}}"#,
            true,
        ),
        photons(
            "65 k photons, 24 texels",
            r#"{"illumination": {"photons": 65536, "photon_grid": 24}}"#,
            false,
        ),
        photons(
            "65 k photons, 24 texels, gathered on rays",
            r#"{"illumination": {"photons": 65536, "photon_grid": 24, "gather": "ray"}}"#,
            false,
        ),
        photons(
            "262 k photons, 32 texels",
            r#"{"illumination": {"photons": 262144, "photon_events": 24, "photon_grid": 32}}"#,
            true,
        ),
        photons(
            "262 k photons, 32 texels, gathered on rays",
            r#"{"illumination": {"photons": 262144, "photon_events": 24, "photon_grid": 32, "gather": "ray"}}"#,
            false,
        ),
        photons(
            "1 M photons of 16 events, 48 texels",
            r#"{"illumination": {"photons": 1048576, "photon_events": 16, "photon_grid": 48}}"#,
            false,
        ),
        photons(
            "4 M photons of 16 events, 64 texels",
            r#"{"illumination": {"photons": 4194304, "photon_events": 16, "photon_grid": 64}}"#,
            false,
        ),
        photons(
            "262 k photons, 32 texels, refined by 64 paths",
            r#"{"illumination": {"photons": 262144, "photon_events": 24, "photon_grid": 32, "refine": true, "paths_per_pixel": 64}}"#,
            true,
        ),
        photons(
            "262 k photons, 32 texels, refined by 1024 paths",
            r#"{"illumination": {"photons": 262144, "photon_events": 24, "photon_grid": 32, "refine": true, "paths_per_pixel": 1024}}"#,
            false,
        ),
    ],
    usual: 0,
    // The same photons and paths every time.
    noisy: false,
    off_by_at_most: 0.3,
    weak_at: &[],
    halved: Some((r#"{"illumination": {"photon_grid": 8, "direct_grid": 32}}"#, 0.1)),
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
        light("grid 1/2, 1 band", r#"{"illumination": {"light_bands": 1}}"#, false),
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
    off_by_at_most: 0.3,
    // Matter whose skin is thinner than a cell, up to the faces of the box.
    weak_at: &[("opacity 1 everywhere", 1.0), ("1, extinction 1e4", 0.8)],
    halved: Some((r#"{"illumination": {"light_grid": 0.25}}"#, 0.1)),
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
        light("32 records, 4 exchanges", r#"{"illumination": {"records": 32, "record_exchange": 4}}"#, false),
        light(
            "32 records, 16 exchanges",
            r#"{"illumination": {"records": 32, "record_exchange": 16}}"#,
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
    off_by_at_most: 0.3,
    // Matter whose skin is thinner than the distance of records: they lie inside, in the dark.
    weak_at: &[("1, extinction 1e4", 0.5), ("opacity 1 everywhere", 0.8)],
    halved: Some((r#"{"illumination": {"records": 8, "direct_grid": 32}}"#, 0.1)),
    work: "record_cells_taken",
    truncated: |_| None,
};

const PRECOMPUTED_TRANSFER: Entry = Entry {
    method: Method::PrecomputedTransfer,
    judge: FULL,
    settings: &[
        light(
            "42 lights, 16 texels",
            r#"{"illumination": {"transfer_lights": 42, "transfer_grid": 16, "transfer_directions": 48, "transfer_photons": 131072}}"#,
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
    off_by_at_most: 0.3,
    // Light that few bands cannot carry; skins in the sixteenth of a box that a texel is.
    weak_at: &[
        ("henyey_greenstein -0.99", 1.0),
        ("schlick -0.99", 1.0),
        ("henyey_greenstein -0.999", 1.0),
        ("schlick -0.999", 1.0),
        ("1e4, white matter", 1.2),
        ("1x1x1", 0.7),
    ],
    halved: Some((r#"{"illumination": {"transfer_grid": 8}}"#, 0.1)),
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
    off_by_at_most: 0.0,
    weak_at: &[],
    halved: None,
    work: "tentative_collisions",
    truncated: |counters| {
        let count = |name: &str| counters.get(name).copied().unwrap_or(0) as f64;
        let lost = count("throughput_cut_1024ths") / 1024.0 + count("paths_not_finite");
        (count("paths") > 0.0).then(|| lost / count("paths"))
    },
};

/// The entries of some methods; all, if none is named.
///
/// # Errors
/// The name that is none.
pub fn chosen(names: &[String]) -> Result<Vec<&'static Entry>, String> {
    let known = || LADDER.iter().map(|entry| entry.method.name()).collect::<Vec<_>>().join(", ");
    let unknown = |name: &&String| !LADDER.iter().any(|entry| entry.method.name() == name.as_str());
    if let Some(name) = names.iter().find(unknown) {
        return Err(format!("--methods: unknown method `{name}`; known: {}", known()));
    }
    let wanted = |entry: &&Entry| names.is_empty() || names.iter().any(|name| name == entry.method.name());
    Ok(LADDER.iter().filter(wanted).collect())
}

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

    /// Relative L2 that is right in a case of `stability` whose own tolerance is this.
    pub fn tolerance_in(&self, case: &str, tolerance: f64) -> f64 {
        let weak = self.weak_at.iter().find(|(name, _)| *name == case);
        let off = weak.map_or(self.off_by_at_most, |(_, off)| *off);
        if off > 0.0 { tolerance.max(off) } else { tolerance }
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
    fn approximations_have_room_and_no_more() {
        assert_eq!(LOCAL_ENTRY.tolerance_in("1x1x1", -1.0), -1.0);
        assert_eq!(PHOTON_MAP.tolerance_in("a box", 0.05), PHOTON_MAP.off_by_at_most);
        assert_eq!(PHOTON_MAP.tolerance_in("a box", 0.5), 0.5);
        assert_eq!(CONVECTION_DIFFUSION.tolerance_in("opacity 1 everywhere", 0.05), 1.0);
        assert!(chosen(&["photon".to_owned()]).is_err_and(|refused| refused.contains("photon_map")));
        assert_eq!(chosen(&[]).unwrap().len(), LADDER.len());
    }

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
