//! What of light's ways to places an edit concerns.

use glam::DVec3;
use scene::light::Light;
use scene::transfer_function::{Classification, Point};
use scene::{Scene, TransferFunction};

/// What becomes of a light's nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Todo {
    /// They are what they would be.
    Keep,
    /// Those are looked up anew whose rays meet a macrocell with one of the bins.
    Test(u64),
    /// All are looked up anew.
    Cast,
}

/// What becomes, for `new`, of nodes that were looked up for `old`, both of one volume, for the light
/// that has the same place in the field.
pub(super) fn todo(old: &Scene, new: &Scene, then: Option<&Light>, light: &Light) -> Todo {
    if then.is_none_or(|then| then.geometry != light.geometry) || kept_region(old) != kept_region(new) {
        return Todo::Cast;
    }
    match changed_bins(old, new, false) & new.volume.macrocells.occurring(new.filter) {
        0 => Todo::Keep,
        bins => Todo::Test(bins),
    }
}

/// Where matter blocks light; `None`: everywhere.
pub(crate) fn kept_region(scene: &Scene) -> Option<&scene::clip::Clip> {
    (!scene.clip.shadows).then_some(&scene.clip)
}

/// Bins in which extinction differs; or, where glowing matter is seen, what a ray sees at all.
pub(crate) fn changed_bins(old: &Scene, new: &Scene, glow: bool) -> u64 {
    let [a, b] = [old, new].map(|scene| seen_by_rays(&scene.transfer_function, glow));
    let isotropic = [scene::material::Material::default()];
    let of = |function, scene: &Scene| Classification {
        function,
        materials: &isotropic,
        value_range: scene.value_range,
    };
    of(&a, old).changed_bins(&of(&b, new), &new.volume.bins)
}

/// The transfer function without what rays do not see.
fn seen_by_rays(function: &TransferFunction, glow: bool) -> TransferFunction {
    let seen = |point: &Point| match glow {
        true => Point { material: 0, ..*point },
        false => Point { material: 0, albedo: DVec3::ONE, emission: DVec3::ZERO, ..*point },
    };
    TransferFunction { points: function.points.iter().map(seen).collect() }
}
