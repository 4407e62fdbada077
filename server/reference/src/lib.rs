//! The judge: a path tracer in f64 on the CPU, closed forms, and the statistics that compare
//! pictures. Slow, simple, and without a line in common with `render`; of `scene` it uses the
//! data, never the functions that evaluate it.
//!
//! [`render`] estimates a picture with its standard error. See `README.md` for the estimator.

mod brdf;
pub mod closed_forms;
mod environment;
mod frame;
mod image;
mod light;
mod local;
mod majorant;
mod matter;
mod medium;
mod path;
mod phase;
mod random;
mod region;
#[cfg(test)]
mod sampler_tests;
mod scatter;
pub mod statistics;

/// Counts changes of what [`render`] makes of a scene and a request: pictures kept on disk are known by
/// it. Raise it with every change that alters a picture.
pub const ESTIMATOR_VERSION: u32 = 1;

pub use image::{Ended, Estimate, Pixel, Progress, Report, Request, Transport, render};
