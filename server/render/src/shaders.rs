//! WGSL modules, joined from listed parts (module order is free in WGSL).

macro_rules! parts {
    ($($path:literal),+ $(,)?) => {
        concat!($(include_str!(concat!("../../../shaders/", $path)), "\n"),+)
    };
}

/// `ray_cast`, in the light of `local` or of a light field.
pub const RAY_CAST: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "shared/light.wgsl",
    "shared/environment.wgsl",
    "shared/sh.wgsl",
    "shared/light_field.wgsl",
    "local/local.wgsl",
    "ray_cast/way.wgsl",
    "ray_cast/cells.wgsl",
    "ray_cast/pieces.wgsl",
    "ray_cast/values.wgsl",
    "ray_cast/isosurface.wgsl",
    "ray_cast/segments.wgsl",
    "ray_cast/ray_cast.wgsl",
);

/// `path_trace`: method `path_traced`.
pub const PATH_TRACE: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "shared/random.wgsl",
    "shared/environment.wgsl",
    "path_traced/sources.wgsl",
    "path_traced/scatter.wgsl",
    "path_traced/tracking.wgsl",
    "path_traced/layers.wgsl",
    "path_traced/path_traced.wgsl",
);

/// Entry points that tests of samplers join to [`PATH_TRACE`].
#[cfg(test)]
pub(crate) const SAMPLER_TEST: &str = parts!("path_traced/sampler_test.wgsl");

/// `restart_tiles`.
pub const RESTART_TILES: &str = parts!("path_traced/restart.wgsl");

/// `mix_lights`.
pub const MIX_LIGHTS: &str = parts!("path_traced/mix_lights.wgsl");

/// `error`.
pub const ERROR: &str = parts!("path_traced/error.wgsl");

/// `march_records` of method `image_based`.
pub const MARCH_RECORDS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/light.wgsl",
    "ray_cast/way.wgsl",
    "ray_cast/cells.wgsl",
    "ray_cast/pieces.wgsl",
    "image_based/records.wgsl",
    "image_based/march_records.wgsl",
);

/// `project_records` of method `image_based`.
pub const PROJECT_RECORDS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/light.wgsl",
    "shared/sh.wgsl",
    "image_based/records.wgsl",
    "image_based/project_records.wgsl",
);

/// `tone_map`.
pub const TONE_MAP: &str = parts!("film/tone_map.wgsl");

/// Every module with its name, for validation.
pub const ALL: &[(&str, &str)] = &[
    ("ray_cast", RAY_CAST),
    ("path_trace", PATH_TRACE),
    ("restart_tiles", RESTART_TILES),
    ("mix_lights", MIX_LIGHTS),
    ("error", ERROR),
    ("march_records", MARCH_RECORDS),
    ("project_records", PROJECT_RECORDS),
    ("tone_map", TONE_MAP),
];
