//! Electron-density-like field of C60: a Gaussian at each of the 60 atoms and a Gaussian tube
//! along each of the 90 bonds.
//!
//! Vertices of the truncated icosahedron: the cyclic permutations of (0, ±1, ±3φ),
//! (±1, ±(2+φ), ±2φ) and (±φ, ±2, ±(2φ+1)) with φ the golden ratio; its edges have length 2.

use super::grid::Point;
use super::vector::{dot, length, scale, sub};

/// Distance of the atoms from the centre, world units.
pub const RADIUS: f64 = 0.37;
/// Standard deviation of an atom, world units.
const ATOM_SIGMA: f64 = 0.026;
/// Standard deviation across a bond, and the density of one relative to an atom's.
const BOND_SIGMA: f64 = 0.017;
const BOND_STRENGTH: f64 = 0.4;
/// Gaussians are cut off at this many standard deviations, where they are below 1e-6, less than
/// a tenth of a quantization step.
const CUTOFF_SIGMAS: f64 = 5.5;
/// Density at an atom: its own Gaussian and half of each of its three bonds, so that the
/// maxima come out close to 1.
const PEAK: f64 = 1.0 + 3.0 * 0.5 * BOND_STRENGTH;

/// Atoms and bonds.
#[derive(Debug, Clone)]
pub(crate) struct Molecule {
    atoms: Vec<Point>,
    bonds: Vec<[Point; 2]>,
}

/// World positions of the 60 atoms.
pub fn atoms() -> Vec<Point> {
    let phi = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let families = [[0.0, 1.0, 3.0 * phi], [1.0, 2.0 + phi, 2.0 * phi], [phi, 2.0, 2.0 * phi + 1.0]];
    let mut atoms = Vec::new();
    for family in families {
        let to_world = RADIUS / length(family);
        for rotation in 0..3 {
            for signs in 0..8 {
                let signed = |i: usize| {
                    if signs >> i & 1 == 1 { -family[i] } else { family[i] }
                };
                // -0 is 0: that coordinate has one sign only.
                if (0..3).any(|i| family[i] == 0.0 && signs >> i & 1 == 1) {
                    continue;
                }
                let corner = [signed(rotation), signed((rotation + 1) % 3), signed((rotation + 2) % 3)];
                atoms.push(scale(corner, to_world));
            }
        }
    }
    atoms
}

impl Molecule {
    pub fn new() -> Self {
        let atoms = atoms();
        let phi = (1.0 + 5.0_f64.sqrt()) / 2.0;
        let bond_length = 2.0 * RADIUS / length([0.0, 1.0, 3.0 * phi]);
        // The second-nearest atoms are 1.618 bond lengths apart.
        let bonded = |a: Point, b: Point| length(sub(a, b)) < 1.3 * bond_length;
        let mut bonds = Vec::new();
        for (i, &a) in atoms.iter().enumerate() {
            bonds.extend(atoms[i + 1..].iter().filter(|&&b| bonded(a, b)).map(|&b| [a, b]));
        }
        Self { atoms, bonds }
    }

    /// The density at a world position, 0..1.
    pub fn density(&self, p: Point) -> f64 {
        // Everything lies in a thick sphere around the cage.
        if (length(p) - RADIUS).abs() > CUTOFF_SIGMAS * ATOM_SIGMA {
            return 0.0;
        }
        let atoms: f64 = self.atoms.iter().map(|&atom| gaussian(length(sub(p, atom)), ATOM_SIGMA)).sum();
        let bonds: f64 = self.bonds.iter().map(|&bond| tube(p, bond)).sum();
        (atoms + BOND_STRENGTH * bonds) / PEAK
    }
}

fn gaussian(distance: f64, sigma: f64) -> f64 {
    let t = distance / sigma;
    if t > CUTOFF_SIGMAS { 0.0 } else { libm::exp(-0.5 * t * t) }
}

/// A line of unit density from end to end, blurred by a Gaussian: 1 on its axis, 0.5 at its ends.
fn tube(p: Point, [start, end]: [Point; 2]) -> f64 {
    let bond_length = length(sub(end, start));
    let axis = scale(sub(end, start), 1.0 / bond_length);
    let offset = sub(p, start);
    let along = dot(offset, axis);
    let beyond = (-along).max(along - bond_length);
    let across = gaussian(length(sub(offset, scale(axis, along))), BOND_SIGMA);
    if across == 0.0 || beyond > CUTOFF_SIGMAS * BOND_SIGMA {
        return 0.0;
    }
    let step = |x: f64| libm::erf(x / (std::f64::consts::SQRT_2 * BOND_SIGMA));
    across * 0.5 * (step(along) + step(bond_length - along))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_atom_has_three_bonds() {
        let molecule = Molecule::new();
        assert_eq!(molecule.atoms.len(), 60);
        assert_eq!(molecule.bonds.len(), 90);
        for atom in &molecule.atoms {
            assert!((length(*atom) - RADIUS).abs() < 1e-12);
            assert_eq!(molecule.bonds.iter().filter(|bond| bond.contains(atom)).count(), 3);
        }
    }

    #[test]
    fn a_bond_alone_has_the_density_of_a_blurred_line() {
        let bond = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        assert!((tube([0.0; 3], bond) - 1.0).abs() < 1e-12);
        assert!((tube(bond[1], bond) - 0.5).abs() < 1e-12);
        let aside = tube([0.0, BOND_SIGMA, 0.0], bond);
        assert!((aside - (-0.5_f64).exp()).abs() < 1e-12);
        assert_eq!(tube([0.0, 6.0 * BOND_SIGMA, 0.0], bond), 0.0);
    }
}
