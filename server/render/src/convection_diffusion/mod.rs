//! Method `convection_diffusion`: light carried from each source over a grid, then spread by
//! diffusion (shaders/convection_diffusion/README.md).

mod diffusion;
mod field;
mod outside;
mod passes;
mod settings;
mod stale;
pub(crate) mod sweep;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod tests;
pub(crate) mod transport;
mod upwind;

pub(crate) use field::{ConvectionDiffusion, Pipelines};
