//! Lights with an extent in parts, each of which shines from about one direction on each place.

use glam::DVec3;
use scene::Scene;
use scene::light::{Light, LightGeometry};

use super::LIGHTS_A_SLAB;

/// Parts that a light with an extent may be shown in.
const PARTS: [usize; 2] = [4, 2];
/// Distance of the middle of a quarter of a disk from the disk's, in radii: 4 sqrt(2) / (3 pi).
const MIDDLE_OF_A_QUARTER: f64 = 0.600_210_9;

/// The lights, those with an extent in as many parts as one slab holds: view rays evaluate each from its
/// centre, which is wrong beside large ones.
pub(crate) fn in_parts(scene: &Scene, lights: Vec<Light>) -> Vec<Light> {
    let wide = |light: &Light| {
        matches!(light.geometry, LightGeometry::Rectangle { .. } | LightGeometry::Disk { .. })
            && is_wide(scene, light)
    };
    let count = lights.iter().filter(|light| wide(light)).count();
    let fits = |parts: &usize| lights.len() + count * (parts - 1) <= LIGHTS_A_SLAB;
    let Some(parts) = PARTS.into_iter().find(fits).filter(|_| count > 0) else { return lights };
    lights
        .into_iter()
        .flat_map(|light| if wide(&light) { parts_of(&light, parts) } else { vec![light] })
        .collect()
}

/// Whether a light is seen from the middle of the volume under more than some degrees.
fn is_wide(scene: &Scene, light: &Light) -> bool {
    /// Half of its extent over its distance.
    const WIDE: f64 = 0.15;
    let (center, half) = match light.geometry {
        LightGeometry::Rectangle { center, size, .. } => (center, 0.5 * size[0].hypot(size[1])),
        LightGeometry::Disk { center, radius, .. } => (center, radius),
        _ => return false,
    };
    let nearest = (center.length() - 0.5 * scene.grid.size_world.length()).max(0.0);
    half > WIDE * nearest
}

/// Two or four parts of equal area and of the same radiance.
fn parts_of(light: &Light, parts: usize) -> Vec<Light> {
    let part = |(index, geometry): (usize, LightGeometry)| Light {
        // Behind all names that a scene file can give.
        id: format!("{}\u{0}{index}", light.id),
        geometry,
        ..light.clone()
    };
    geometries(&light.geometry, parts).into_iter().enumerate().map(part).collect()
}

fn geometries(whole: &LightGeometry, parts: usize) -> Vec<LightGeometry> {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
    match *whole {
        LightGeometry::Rectangle { center, normal, up, size } => {
            let across = up.cross(normal);
            // Two halves lie along the longer edge.
            let longer = usize::from(size[1] > size[0]);
            let divided = [0, 1].map(|edge| if parts == 4 || edge == longer { 2.0 } else { 1.0 });
            let places = corners.into_iter().filter(|corner| divided[0] > 1.0 || corner[0] < 0.0);
            let places = places.filter(|corner| divided[1] > 1.0 || corner[1] < 0.0);
            let part = |corner: [f64; 2]| {
                let offset =
                    |edge: usize| if divided[edge] > 1.0 { 0.25 * size[edge] * corner[edge] } else { 0.0 };
                LightGeometry::Rectangle {
                    center: center + offset(0) * across + offset(1) * up,
                    normal,
                    up,
                    size: [size[0] / divided[0], size[1] / divided[1]],
                }
            };
            places.map(part).collect()
        }
        LightGeometry::Disk { center, normal, radius } if parts == 4 => {
            let u: DVec3 = normal.any_orthonormal_vector();
            let v = normal.cross(u);
            let away = MIDDLE_OF_A_QUARTER * radius / 2.0_f64.sqrt();
            let part = |corner: [f64; 2]| LightGeometry::Disk {
                center: center + away * (corner[0] * u + corner[1] * v),
                normal,
                radius: 0.5 * radius,
            };
            corners.map(part).to_vec()
        }
        _ => vec![whole.clone()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_have_the_middle_and_the_area_of_the_whole() {
        let rectangle = LightGeometry::Rectangle {
            center: DVec3::new(0.1, 0.4, 0.2),
            normal: DVec3::NEG_Y,
            up: DVec3::Z,
            size: [0.3, 0.5],
        };
        let disk =
            LightGeometry::Disk { center: DVec3::new(0.1, 0.4, 0.2), normal: DVec3::NEG_Y, radius: 0.2 };
        for (whole, parts) in [(&rectangle, 2), (&rectangle, 4), (&disk, 4)] {
            let measured = |geometry: &LightGeometry| match *geometry {
                LightGeometry::Rectangle { center, size, .. } => (center, size[0] * size[1]),
                LightGeometry::Disk { center, radius, .. } => (center, radius * radius),
                _ => unreachable!(),
            };
            let (center, area) = measured(whole);
            let found: Vec<_> = geometries(whole, parts).iter().map(measured).collect();
            assert_eq!(found.len(), parts);
            let middle: DVec3 = found.iter().map(|part| part.0 / parts as f64).sum();
            assert!((middle - center).length() < 1e-12);
            assert!((found.iter().map(|part| part.1).sum::<f64>() / area - 1.0).abs() < 1e-12);
            for (i, a) in found.iter().enumerate() {
                assert!(found[i + 1..].iter().all(|b| (a.0 - b.0).length() > 0.1));
            }
        }
    }
}
