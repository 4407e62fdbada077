//! Beams of light that cross the volume's box: one direction's lie side by side, evenly.

use glam::DVec3;

use crate::uniforms;

/// From one beam to the next, in smallest edges of texels.
const SPACING: f64 = 0.5;
/// Most beams along an edge of a direction's square: of flat boxes the smallest edge of a texel would ask for
/// thousands. Lists of beams have 20 bits for a place.
const MOST_EDGE: f64 = 1000.0;
/// Whole numbers that sums of beams stay below.
const MOST_COUNT: f64 = 4_294_967_296.0;

/// Beams of all directions of a bake.
pub struct BeamSet {
    /// Of each direction.
    pub beams: Vec<uniforms::Beams>,
    /// Of each direction's square, in beams.
    pub edge: u32,
    /// Cross-section of a beam, world units.
    pub area: f64,
    /// What losses are counted in: a power of two.
    pub unit: f32,
}

impl BeamSet {
    /// Through a box of this size, in this many texels.
    pub fn new(towards: &[DVec3], size: DVec3, dims: [u32; 3]) -> Self {
        let texel = size / DVec3::from_array(dims.map(f64::from));
        // As wide as the sphere around the box, and a beam more, by which squares are shifted.
        let radius = 0.5 * size.length();
        let spacing = (SPACING * texel.min_element()).max(2.0 * radius / MOST_EDGE);
        let edge = (2.0 * radius / spacing).ceil() as u32 + 1;
        let square = |(index, &towards): (usize, &DVec3)| {
            let across = towards.any_orthonormal_vector();
            let down = towards.cross(across);
            // Another shift for each direction, so that no place is always between beams.
            let part = |ratio: f64| (0.5 + ratio * index as f64).fract();
            let shift = DVec3::new(part(0.754_877_666_246_692_8), part(0.569_840_290_998_053_3), 0.0);
            let first = (shift - 0.5 * f64::from(edge)) * spacing;
            let origin = 1.01 * radius * towards + first.x * across + first.y * down;
            uniforms::Beams {
                towards: towards.as_vec3().to_array(),
                edge,
                across: (spacing * across).as_vec3().to_array(),
                down: (spacing * down).as_vec3().to_array(),
                origin: origin.as_vec3().to_array(),
                ..uniforms::Beams::default()
            }
        };
        Self {
            beams: towards.iter().enumerate().map(square).collect(),
            edge,
            area: spacing * spacing,
            unit: unit_of(texel, spacing),
        }
    }
}

/// So that nothing overflows if all beams that meet a texel's surroundings are lost there.
fn unit_of(texel: DVec3, spacing: f64) -> f32 {
    // Two texels wide; what it shows of itself, from any direction, is less than the sum of its faces.
    let wide = 2.0 * texel;
    let shown = wide.x * wide.y + wide.y * wide.z + wide.z * wide.x;
    let beams = shown / (spacing * spacing) + 8.0 * wide.element_sum() / spacing + 16.0;
    (beams / MOST_COUNT).log2().ceil().exp2() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::spherical::healpix;

    #[test]
    fn beams_cover_the_box_evenly() {
        let size = DVec3::new(1.0, 0.5, 0.7);
        let set = BeamSet::new(&healpix::centres(2), size, [32, 16, 22]);
        for beams in &set.beams {
            let v = |a: [f32; 3]| DVec3::from_array(a.map(f64::from));
            let (towards, origin) = (v(beams.towards), v(beams.origin));
            let (mut met, step) = (0.0, [v(beams.across), v(beams.down)]);
            for index in 0..beams.edge * beams.edge {
                let at = origin
                    + f64::from(index % beams.edge) * step[0]
                    + f64::from(index / beams.edge) * step[1];
                // The slab method.
                let (a, b) = ((-0.5 * size - at) / -towards, (0.5 * size - at) / -towards);
                if a.min(b).max_element() < a.max(b).min_element() {
                    assert!(a.min(b).max_element() >= 0.0, "beams start outside");
                    met += set.area;
                }
            }
            let shown = towards.abs() * DVec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
            assert!((met / shown.element_sum() - 1.0).abs() < 0.08, "{met} {shown}");
        }
    }

    #[test]
    fn sums_have_room_in_flat_texels_too() {
        for dims in [[32; 3], [64, 1, 1], [128, 128, 2]] {
            let texel = DVec3::ONE / DVec3::from_array(dims.map(f64::from));
            let spacing = SPACING * texel.min_element();
            let unit = f64::from(unit_of(texel, spacing));
            assert!(unit.log2().fract() == 0.0 && unit < 2e-3);
            let wide = 2.0 * texel / spacing;
            assert!((wide.x * wide.y + wide.y * wide.z + wide.z * wide.x) / unit < MOST_COUNT);
        }
    }
}
