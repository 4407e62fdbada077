//! Directions spread evenly over the sphere: the vertices of an icosahedron whose triangles are cut
//! in four again and again, 12, 42, 162, 642, 2562 of them.
//!
//! A new vertex halves a great circle's arc, so a triangle's children fill it exactly: the triangle
//! that holds a direction is found from level to level.

use glam::DVec3;

/// Most subdivisions.
pub const MAX_SUBDIVISIONS: usize = 4;

/// A subdivided icosahedron.
#[derive(Debug, Clone)]
pub struct Icosphere {
    /// Unit vectors; those of coarser levels come first.
    pub vertices: Vec<DVec3>,
    /// Corners of each level's triangles, counterclockwise from outside; triangle t of a level is cut
    /// into 4 t .. 4 t + 4 of the next.
    levels: Vec<Vec<[usize; 3]>>,
}

impl Icosphere {
    /// `subdivisions` 0..=4: `10 * 4^subdivisions + 2` vertices.
    pub fn new(subdivisions: usize) -> Self {
        let mut vertices = icosahedron();
        let mut levels = vec![faces(&vertices)];
        for level in 0..subdivisions.min(MAX_SUBDIVISIONS) {
            let mut middles = std::collections::BTreeMap::new();
            let mut middle = |a: usize, b: usize, vertices: &mut Vec<DVec3>| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    vertices.push((vertices[a] + vertices[b]).normalize());
                    vertices.len() - 1
                })
            };
            let mut next = Vec::with_capacity(4 * levels[level].len());
            for &[a, b, c] in &levels[level] {
                let ab = middle(a, b, &mut vertices);
                let bc = middle(b, c, &mut vertices);
                let ca = middle(c, a, &mut vertices);
                next.extend([[ab, bc, ca], [a, ab, ca], [b, bc, ab], [c, ca, bc]]);
            }
            levels.push(next);
        }
        Self { vertices, levels }
    }

    /// Corners of the triangles, counterclockwise from outside.
    pub fn triangles(&self) -> &[[usize; 3]] {
        self.levels.last().map_or(&[], Vec::as_slice)
    }

    /// The triangle a unit direction lies in.
    pub fn triangle_of(&self, direction: DVec3) -> usize {
        let mut candidates = 0..self.levels[0].len();
        let mut found = 0;
        for level in &self.levels {
            let inside = |triangle: &usize| self.depth_in(level[*triangle], direction);
            found = candidates.max_by(|a, b| inside(a).total_cmp(&inside(b))).unwrap_or(0);
            candidates = 4 * found..4 * found + 4;
        }
        found
    }

    /// How deep inside the planes through its edges a direction lies; negative outside.
    fn depth_in(&self, [a, b, c]: [usize; 3], direction: DVec3) -> f64 {
        let [a, b, c] = [a, b, c].map(|vertex| self.vertices[vertex]);
        let depth = |from: DVec3, to: DVec3| from.cross(to).dot(direction);
        depth(a, b).min(depth(b, c)).min(depth(c, a))
    }

    /// The vertices of the triangle around a unit direction, with weights >= 0 that sum to 1: those of
    /// the point of the flat triangle that is seen in this direction.
    pub fn barycentric(&self, direction: DVec3) -> [(usize, f64); 3] {
        let corners = self.triangles()[self.triangle_of(direction)];
        let [a, b, c] = corners.map(|vertex| self.vertices[vertex]);
        let volumes = [b.cross(c), c.cross(a), a.cross(b)].map(|normal| normal.dot(direction).max(0.0));
        let sum: f64 = volumes.iter().sum();
        std::array::from_fn(|i| (corners[i], volumes[i] / sum))
    }

    /// Smallest angle between two vertices, radians.
    pub fn smallest_angle(&self) -> f64 {
        let edges = self.triangles().iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        edges.map(|(a, b)| angle(self.vertices[a], self.vertices[b])).fold(f64::MAX, f64::min)
    }
}

/// Angle between unit vectors, radians; exact for small and large ones, too.
pub fn angle(a: DVec3, b: DVec3) -> f64 {
    2.0 * (a - b).length().atan2((a + b).length())
}

fn icosahedron() -> Vec<DVec3> {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut vertices = Vec::with_capacity(12);
    for (one, long) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        vertices.extend([
            DVec3::new(0.0, one, long).normalize(),
            DVec3::new(one, long, 0.0).normalize(),
            DVec3::new(long, 0.0, one).normalize(),
        ]);
    }
    vertices
}

/// Triples of neighbours.
fn faces(vertices: &[DVec3]) -> Vec<[usize; 3]> {
    // Neighbours are at a cosine of 1 / sqrt(5) = 0.447, all others at less.
    let near = |a: usize, b: usize| vertices[a].dot(vertices[b]) > 0.4;
    let mut faces = Vec::with_capacity(20);
    for a in 0..vertices.len() {
        for b in a + 1..vertices.len() {
            for c in b + 1..vertices.len() {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outwards = vertices[a].cross(vertices[b]).dot(vertices[c]) > 0.0;
                    faces.push(if outwards { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spherical::healpix;

    #[test]
    fn vertices_and_triangles_are_counted() {
        for (level, count) in [12, 42, 162, 642, 2562].into_iter().enumerate() {
            let sphere = Icosphere::new(level);
            assert_eq!(sphere.vertices.len(), count);
            // Euler.
            assert_eq!(sphere.triangles().len(), 2 * count - 4);
            assert!(sphere.vertices.iter().all(|v| (v.length() - 1.0).abs() < 1e-14));
            assert!(sphere.vertices.iter().sum::<DVec3>().length() < 1e-9);
            let spacing = (4.0 * std::f64::consts::PI / count as f64).sqrt();
            let closest = sphere.smallest_angle();
            assert!((0.85..1.15).contains(&(closest / spacing)), "{count}: {}", closest / spacing);
        }
    }

    #[test]
    fn triangles_cover_the_sphere_once() {
        let sphere = Icosphere::new(3);
        let mut found = vec![0.0; sphere.triangles().len()];
        for direction in healpix::centres(128) {
            let triangle = sphere.triangle_of(direction);
            assert!(sphere.depth_in(sphere.triangles()[triangle], direction) > -1e-12);
            found[triangle] += healpix::solid_angle(128);
        }
        for (area, &[a, b, c]) in found.iter().zip(sphere.triangles()) {
            // Solid angle of a triangle (van Oosterom, Strackee 1983).
            let [a, b, c] = [a, b, c].map(|vertex| sphere.vertices[vertex]);
            let exact = 2.0 * a.dot(b.cross(c)).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
            assert!((area / exact - 1.0).abs() < 0.1, "{area} {exact}");
        }
    }

    #[test]
    fn weights_point_to_the_direction() {
        let sphere = Icosphere::new(2);
        for direction in healpix::centres(16).into_iter().chain(sphere.vertices.clone()) {
            let weights = sphere.barycentric(direction);
            assert!((weights.iter().map(|w| w.1).sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(weights.iter().all(|w| w.1 >= 0.0));
            let point: DVec3 = weights.iter().map(|&(vertex, weight)| weight * sphere.vertices[vertex]).sum();
            assert!(angle(point.normalize(), direction) < 1e-9);
        }
    }

    #[test]
    fn small_angles_keep_their_digits() {
        let tiny = DVec3::new(1e-9, 0.0, 1.0).normalize();
        assert!((angle(DVec3::Z, tiny) / 1e-9 - 1.0).abs() < 1e-6);
        assert!((angle(DVec3::Z, -DVec3::Z) - std::f64::consts::PI).abs() < 1e-12);
    }
}
