//! Functions on the sphere.

pub mod healpix;
pub mod sh;
pub mod sky;
