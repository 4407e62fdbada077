//! Functions on the sphere.

pub mod dsf;
pub mod healpix;
pub mod icosphere;
pub mod light_basis;
pub mod sh;
pub mod sky;
pub mod srbf;
