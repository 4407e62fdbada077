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
    "shared/field.wgsl",
    "shared/light_field.wgsl",
    "direct_light/nodes.wgsl",
    "direct_light/look_up.wgsl",
    "local/local.wgsl",
    "ray_cast/way.wgsl",
    "ray_cast/cells.wgsl",
    "ray_cast/pieces.wgsl",
    "ray_cast/values.wgsl",
    "ray_cast/isosurface.wgsl",
    "ray_cast/segments.wgsl",
    "photon_map/parts.wgsl",
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
    "shared/place.wgsl",
    "shared/path.wgsl",
    "shared/sources.wgsl",
    "shared/scatter.wgsl",
    "shared/tracking.wgsl",
    "path_traced/meet.wgsl",
    "path_traced/layers.wgsl",
    "path_traced/path_traced.wgsl",
);

/// Entry points that tests of samplers join to [`PATH_TRACE`].
#[cfg(test)]
pub(crate) const SAMPLER_TEST: &str = parts!("shared/sobol.wgsl", "path_traced/sampler_test.wgsl");

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
    "shared/changes.wgsl",
    "shared/arriving.wgsl",
    "shared/three_in_a_word.wgsl",
    "image_based/records.wgsl",
    "image_based/march_records.wgsl",
);

/// `march_direct`: how much of a light reaches the nodes of a grid.
pub const MARCH_DIRECT: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "ray_cast/way.wgsl",
    "ray_cast/cells.wgsl",
    "ray_cast/pieces.wgsl",
    "shared/changes.wgsl",
    "shared/arriving.wgsl",
    "direct_light/march.wgsl",
);

/// `project_records` of method `image_based`.
pub const PROJECT_RECORDS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/light.wgsl",
    "shared/sh.wgsl",
    "shared/three_in_a_word.wgsl",
    "image_based/records.wgsl",
    "image_based/project_records.wgsl",
);

/// `scatter_records`: what cells of records scatter on.
pub const SCATTER_RECORDS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/light.wgsl",
    "shared/sh.wgsl",
    "shared/field.wgsl",
    "direct_light/nodes.wgsl",
    "convection_diffusion/grid.wgsl",
    "image_based/scatter_records.wgsl",
);

/// `receive_records`: what records receive of it.
pub const RECEIVE_RECORDS: &str = parts!(
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/sh.wgsl",
    "shared/three_in_a_word.wgsl",
    "image_based/records.wgsl",
    "image_based/receive_records.wgsl",
);

/// `trace_photons`: method `photon_map`.
pub const TRACE_PHOTONS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "shared/random.wgsl",
    "shared/place.wgsl",
    "shared/path.wgsl",
    "shared/scatter.wgsl",
    "shared/tracking.wgsl",
    "shared/onward.wgsl",
    "shared/sh.wgsl",
    "shared/add_up.wgsl",
    "shared/blocks.wgsl",
    "photon_map/history.wgsl",
    "photon_map/seen.wgsl",
    "photon_map/looked_at.wgsl",
    "photon_map/deposit.wgsl",
    "photon_map/trace.wgsl",
);

/// `take_up`: before it, which photons are stale.
pub const TAKE_UP: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "shared/random.wgsl",
    "shared/sobol.wgsl",
    "shared/faces.wgsl",
    "shared/environment.wgsl",
    "shared/place.wgsl",
    "shared/path.wgsl",
    "shared/sources.wgsl",
    "shared/scatter.wgsl",
    "shared/tracking.wgsl",
    "photon_map/history.wgsl",
    "photon_map/emit.wgsl",
    "photon_map/take_up.wgsl",
);

/// `add_up_mass`.
pub const ADD_UP_MASS: &str = parts!(
    "shared/frame.wgsl",
    "shared/medium.wgsl",
    "shared/place.wgsl",
    "photon_map/seen.wgsl",
    "photon_map/mass.wgsl"
);

/// `pack_interactions`: what of them rays gather.
pub const PACK_INTERACTIONS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "shared/random.wgsl",
    "shared/place.wgsl",
    "shared/path.wgsl",
    "shared/scatter.wgsl",
    "shared/tracking.wgsl",
    "photon_map/history.wgsl",
    "shared/three_in_a_word.wgsl",
    "photon_map/pack.wgsl",
);

/// `gather_photons`: what they bring to parts of view rays.
pub const GATHER_PHOTONS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "photon_map/parts.wgsl",
    "photon_map/kernel.wgsl",
    "shared/three_in_a_word.wgsl",
    "photon_map/gather.wgsl",
);

/// `add_gathered`.
pub const ADD_GATHERED: &str = parts!(
    "shared/frame.wgsl",
    "photon_map/parts.wgsl",
    "photon_map/kernel.wgsl",
    "photon_map/add_gathered.wgsl",
);

/// `fill_field`.
pub const FILL_FIELD: &str =
    parts!("shared/whole_number.wgsl", "photon_map/texels.wgsl", "photon_map/fill.wgsl");

/// `widen_field`.
pub const WIDEN_FIELD: &str = parts!("photon_map/texels.wgsl", "photon_map/widen.wgsl");

/// `march_transfer` of method `precomputed_transfer`.
pub const MARCH_TRANSFER: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/place.wgsl",
    "ray_cast/way.wgsl",
    "ray_cast/cells.wgsl",
    "ray_cast/pieces.wgsl",
    "shared/changes.wgsl",
    "precomputed_transfer/transfer.wgsl",
    "precomputed_transfer/direct.wgsl",
);

/// `spread_beams`.
pub const SPREAD_BEAMS: &str =
    parts!("precomputed_transfer/transfer.wgsl", "precomputed_transfer/spread.wgsl");

/// `enter_photons`.
pub const ENTER_PHOTONS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "shared/random.wgsl",
    "shared/sobol.wgsl",
    "shared/faces.wgsl",
    "shared/place.wgsl",
    "shared/path.wgsl",
    "shared/scatter.wgsl",
    "shared/tracking.wgsl",
    "precomputed_transfer/transfer.wgsl",
    "precomputed_transfer/photons.wgsl",
    "precomputed_transfer/enter.wgsl",
);

/// `carry_photons`.
pub const CARRY_PHOTONS: &str = parts!(
    "shared/features.wgsl",
    "shared/frame.wgsl",
    "shared/ray.wgsl",
    "shared/medium.wgsl",
    "shared/phase.wgsl",
    "shared/brdf.wgsl",
    "shared/random.wgsl",
    "shared/place.wgsl",
    "shared/path.wgsl",
    "shared/scatter.wgsl",
    "shared/tracking.wgsl",
    "shared/onward.wgsl",
    "shared/sh.wgsl",
    "shared/add_up.wgsl",
    "shared/blocks.wgsl",
    "photon_map/seen.wgsl",
    "photon_map/looked_at.wgsl",
    "precomputed_transfer/transfer.wgsl",
    "precomputed_transfer/photons.wgsl",
    "precomputed_transfer/carry.wgsl",
);

/// `count_stale` and `list_stale`.
pub const FIND_STALE: &str =
    parts!("precomputed_transfer/transfer.wgsl", "precomputed_transfer/find_stale.wgsl");

/// `move_rows`.
pub const MOVE_ROWS: &str =
    parts!("precomputed_transfer/transfer.wgsl", "precomputed_transfer/move_rows.wgsl");

/// `relight`.
pub const RELIGHT: &str = parts!(
    "shared/whole_number.wgsl",
    "precomputed_transfer/transfer.wgsl",
    "precomputed_transfer/field_weights.wgsl",
    "precomputed_transfer/field.wgsl",
    "precomputed_transfer/relight.wgsl",
);

/// `light_directions` and `light_rows`: light from compressed matrices.
pub const LIGHT_CLUSTERS: &str = parts!(
    "precomputed_transfer/transfer.wgsl",
    "precomputed_transfer/field_weights.wgsl",
    "precomputed_transfer/field.wgsl",
    "precomputed_transfer/clusters.wgsl",
);

/// `light_coefficients`: matter in the cells of the light grid.
pub const LIGHT_COEFFICIENTS: &str = parts!(
    "shared/frame.wgsl",
    "shared/medium.wgsl",
    "convection_diffusion/grid.wgsl",
    "convection_diffusion/coefficients.wgsl",
);

/// `march_lines`: optical depth along characteristics.
pub const MARCH_LINES: &str = parts!(
    "convection_diffusion/steering.wgsl",
    "convection_diffusion/sweep.wgsl",
    "convection_diffusion/march.wgsl",
);

/// `gather_lines`: from characteristics to cells.
pub const GATHER_LINES: &str = parts!("convection_diffusion/sweep.wgsl", "convection_diffusion/gather.wgsl");

/// `upwind_front`: the upwind scheme.
pub const UPWIND: &str = parts!("convection_diffusion/upwind.wgsl");

/// Passes of the diffusion solver: `smooth_level`, `restrict_residual`, `prolong_correction`,
/// `coarsen_level` and those of the conjugate gradients.
pub const DIFFUSE: &str = parts!(
    "convection_diffusion/level.wgsl",
    "convection_diffusion/smooth.wgsl",
    "convection_diffusion/restrict.wgsl",
    "convection_diffusion/prolong.wgsl",
    "convection_diffusion/coarsen.wgsl",
    "convection_diffusion/conjugate.wgsl",
);

/// `p1_matter`.
pub const P1_MATTER: &str = parts!(
    "convection_diffusion/grid.wgsl",
    "convection_diffusion/faces.wgsl",
    "convection_diffusion/p1.wgsl",
);

macro_rules! with_direct_light {
    ($($path:literal),+ $(,)?) => {
        parts!(
            "shared/features.wgsl",
            "shared/frame.wgsl",
            "shared/medium.wgsl",
            "shared/phase.wgsl",
            "shared/light.wgsl",
            "convection_diffusion/grid.wgsl",
            "convection_diffusion/direct.wgsl",
            $($path),+
        )
    };
}

/// `p1_source`.
pub const P1_SOURCE: &str =
    with_direct_light!("convection_diffusion/faces.wgsl", "convection_diffusion/source.wgsl");

/// `heat_matter`.
pub const HEAT_MATTER: &str = with_direct_light!("convection_diffusion/heat.wgsl");

/// `compose_field`.
pub const COMPOSE_FIELD: &str = with_direct_light!("shared/sh.wgsl", "convection_diffusion/compose.wgsl");

/// `differ`: by how much an approximate film and that of paths differ.
pub const DIFFER: &str = parts!("refinement/parts.wgsl", "refinement/differ.wgsl");

/// `split`: parts of that, from fine to smooth.
pub const SPLIT: &str = parts!("refinement/parts.wgsl", "refinement/split.wgsl");

/// `take_over`: as much of each as is known.
pub const TAKE_OVER: &str = parts!("refinement/parts.wgsl", "refinement/take_over.wgsl");

/// `blend`: one film of both.
pub const BLEND: &str = parts!("refinement/parts.wgsl", "refinement/blend.wgsl");

/// `tone_map`.
pub const TONE_MAP: &str = parts!("film/tone_map.wgsl");

/// Every module with its name, for validation.
pub const ALL: &[(&str, &str)] = &[
    ("ray_cast", RAY_CAST),
    ("path_trace", PATH_TRACE),
    ("restart_tiles", RESTART_TILES),
    ("mix_lights", MIX_LIGHTS),
    ("error", ERROR),
    ("trace_photons", TRACE_PHOTONS),
    ("take_up", TAKE_UP),
    ("add_up_mass", ADD_UP_MASS),
    ("pack_interactions", PACK_INTERACTIONS),
    ("gather_photons", GATHER_PHOTONS),
    ("add_gathered", ADD_GATHERED),
    ("fill_field", FILL_FIELD),
    ("widen_field", WIDEN_FIELD),
    ("march_transfer", MARCH_TRANSFER),
    ("spread_beams", SPREAD_BEAMS),
    ("enter_photons", ENTER_PHOTONS),
    ("carry_photons", CARRY_PHOTONS),
    ("find_stale", FIND_STALE),
    ("move_rows", MOVE_ROWS),
    ("relight", RELIGHT),
    ("light_clusters", LIGHT_CLUSTERS),
    ("light_coefficients", LIGHT_COEFFICIENTS),
    ("march_lines", MARCH_LINES),
    ("gather_lines", GATHER_LINES),
    ("upwind", UPWIND),
    ("diffuse", DIFFUSE),
    ("p1_matter", P1_MATTER),
    ("p1_source", P1_SOURCE),
    ("heat_matter", HEAT_MATTER),
    ("compose_field", COMPOSE_FIELD),
    ("march_direct", MARCH_DIRECT),
    ("march_records", MARCH_RECORDS),
    ("project_records", PROJECT_RECORDS),
    ("scatter_records", SCATTER_RECORDS),
    ("receive_records", RECEIVE_RECORDS),
    ("differ", DIFFER),
    ("split", SPLIT),
    ("take_over", TAKE_OVER),
    ("blend", BLEND),
    ("tone_map", TONE_MAP),
];
