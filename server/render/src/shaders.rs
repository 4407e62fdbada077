//! WGSL modules, joined from listed parts (module order is free in WGSL).

macro_rules! parts {
    ($($path:literal),+ $(,)?) => {
        concat!($(include_str!(concat!("../../../shaders/", $path)), "\n"),+)
    };
}

/// `ray_cast` with the `local` method.
pub const RAY_CAST: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "shared/light.wgsl",
    "local/local.wgsl",
    "ray_cast/way.wgsl",
    "ray_cast/cells.wgsl",
    "ray_cast/values.wgsl",
    "ray_cast/isosurface.wgsl",
    "ray_cast/segments.wgsl",
    "ray_cast/ray_cast.wgsl",
);

/// `tone_map`.
pub const TONE_MAP: &str = parts!("film/tone_map.wgsl");

/// Every module with its name, for validation.
pub const ALL: &[(&str, &str)] = &[("ray_cast", RAY_CAST), ("tone_map", TONE_MAP)];
