//! Scattering behaviour: `(1 - surface) * phase + surface * brdf * |n . w_i|`.

use proto::scene_file::{Brdf, Phase};

/// A material without its name; equal materials compare equal.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Material {
    /// Phase function.
    pub phase: Phase,
    /// Weight of the BRDF, 0..1; 0 where there is none.
    pub surface: f64,
    /// Surface reflection, present where `surface` > 0.
    pub brdf: Option<Brdf>,
}

impl Material {
    /// From the checked file form.
    pub fn from_file(file: &proto::scene_file::Material) -> Self {
        let shines = file.surface > 0.0;
        Self {
            phase: file.phase.clone(),
            surface: if file.brdf.is_some() { file.surface } else { 0.0 },
            brdf: file.brdf.clone().filter(|_| shines),
        }
    }
}
