//! Functions on the sphere.

pub mod sh;
