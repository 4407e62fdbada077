//! The GPU: device, volume textures, ray caster, film and the illumination methods.
//!
//! A [`Renderer`] lives on the thread that owns submission; each viewer has a [`View`]. Drawing
//! derives from the snapshots what has to run (see `scene::plan`) and advances by slices.

mod convection_diffusion;
mod device_clock;
mod direct_light;
mod environment_map;
mod error;
mod film;
pub mod fit;
mod frame;
mod gpu;
mod illumination;
mod image_based;
mod light_field;
mod path_tracer;
mod photon_map;
mod precomputed_transfer;
mod ray_cast;
mod renderer;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod sampler_tests;
mod segments;
pub mod shaders;
mod skies;
mod stale_shares;
pub mod still;
mod tables;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod test_support;
pub mod uniforms;
mod variants;
mod view;
mod volume_texture;
mod warm_up;

pub use error::RenderError;
pub use gpu::{AdapterPolicy, Gpu};
pub use illumination::Light;
pub use photon_map::PhotonTrial;
pub use precomputed_transfer::{BakeStore, DEFAULT_BAKE_BYTES};
pub use renderer::{
    DrawRequest, Drawn, METHODS_BUILT, PathEstimate, Picture, Preparer, Radiance, Renderer, check,
};
pub use view::View;
pub use volume_texture::{DEFAULT_GPU_BYTES, VolumeCache};
