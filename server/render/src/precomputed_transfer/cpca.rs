//! Clustered principal components (Sloan, Hall, Hart, Snyder 2003; section 6.4 of PVRT): vectors in
//! clusters, each cluster with a few directions of its own, each vector a sum of its cluster's directions.
//!
//! Clusters and directions are found together: a vector belongs where least of it is left out, directions
//! are those that leave out least of a cluster's vectors, and each is found from the other a few times.
//! Every sum has a fixed order, so that threads change no bit.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// Directions of a cluster, as in shaders/precomputed_transfer/clusters.wgsl: as many as the mean and the
/// four bases of PVRT.
pub const DIRECTIONS: usize = 5;
/// Directions looked for: with some more than are wanted, the wanted ones are found sooner.
const SOUGHT: usize = 8;
/// Multiplications with a cluster's vectors from which its directions are taken.
const MULTIPLICATIONS: usize = 3;
/// Steps of the solver for one block: a few are needed, and none finds what is not a number.
const MOST_ROTATIONS: usize = 1000;
/// Rounds with one direction a cluster, then with all.
const ROUNDS: [(usize, usize); 2] = [(1, 3), (DIRECTIONS, 5)];
/// Vectors compared with all clusters at once.
const BLOCK: usize = 256;
/// What is left of a vector beside what it is counts as nothing below this, both squared: sums of single
/// precision.
const NOTHING: f64 = 1e-6;

/// Vectors in few numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Clusters {
    /// [`DIRECTIONS`] columns a cluster, orthonormal.
    pub directions: DMatrix<f32>,
    /// Of each vector its cluster.
    pub of: Vec<u32>,
    /// Of each vector how much of each direction it is.
    pub weights: Vec<[f32; DIRECTIONS]>,
    /// What is left out of all vectors, relative to what they are, root of sums of squares.
    pub error: f64,
}

/// What a vector is nearest to.
struct Nearest {
    cluster: usize,
    weights: [f32; DIRECTIONS],
    /// What is left out of it, squared.
    left: f64,
}

impl Clusters {
    /// Of the columns of `vectors`, with at most `count` clusters. `None`: it was `abandoned` meanwhile.
    pub fn of(vectors: &DMatrix<f32>, count: usize, abandoned: &AtomicBool) -> Option<Self> {
        let squares: Vec<f64> =
            (0..vectors.ncols()).into_par_iter().map(|i| norm_squared(vectors, i)).collect();
        let mut directions = seeds(vectors, &squares, count.max(1), abandoned)?;
        for (rank, rounds) in ROUNDS {
            for _ in 0..rounds {
                let mut nearest = nearest(vectors, &squares, &directions, abandoned)?;
                fill_empty(&mut nearest, directions.ncols() / DIRECTIONS);
                directions = fitted(vectors, &nearest, &directions, rank, abandoned)?;
            }
        }
        let nearest = nearest(vectors, &squares, &directions, abandoned)?;
        let left: Vec<f64> =
            nearest.par_iter().enumerate().map(|(i, n)| left_out(vectors, i, &directions, n)).collect();
        let (left, all): (f64, f64) = (left.iter().sum(), squares.iter().sum());
        Some(Self {
            error: if all > 0.0 { (left / all).sqrt() } else { 0.0 },
            of: nearest.iter().map(|nearest| nearest.cluster as u32).collect(),
            weights: nearest.iter().map(|nearest| nearest.weights).collect(),
            directions,
        })
    }
}

/// One direction for each cluster, the others zero: vectors drawn with probabilities as what is left of
/// them beside those drawn before (k-means++). No more than there are different directions.
fn seeds(
    vectors: &DMatrix<f32>,
    squares: &[f64],
    count: usize,
    abandoned: &AtomicBool,
) -> Option<DMatrix<f32>> {
    let mut left = squares.to_vec();
    let mut drawn = Vec::new();
    while drawn.len() < count {
        if abandoned.load(Ordering::Relaxed) {
            return None;
        }
        let Some(chosen) = draw(&left, uniform(drawn.len() as u64)) else { break };
        let seed = vectors.column(chosen) / squares[chosen].sqrt() as f32;
        left.par_iter_mut().enumerate().for_each(|(i, left)| {
            let along = f64::from(vectors.column(i).dot(&seed));
            let beside = squares[i] - along * along;
            *left = if beside > NOTHING * squares[i] { left.min(beside) } else { 0.0 };
        });
        drawn.push(seed);
    }
    let mut directions = DMatrix::zeros(vectors.nrows(), DIRECTIONS * drawn.len().max(1));
    drawn.iter().enumerate().for_each(|(k, seed)| directions.set_column(DIRECTIONS * k, seed));
    Some(directions)
}

/// The index where a share `at`, 0..1, of the sum of all lies; `None`: the sum is zero.
fn draw(shares: &[f64], at: f64) -> Option<usize> {
    let mut rest = at * shares.iter().sum::<f64>();
    let reached = |(i, &share): (usize, &f64)| {
        rest -= share;
        (share > 0.0 && rest < 0.0).then_some(i)
    };
    let last = shares.iter().rposition(|&share| share > 0.0);
    shares.iter().enumerate().find_map(reached).or(last)
}

/// The same numbers always, 0..1: a finaliser of MurmurHash3.
fn uniform(index: u64) -> f64 {
    let mut x = (index + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for factor in [0xff51_afd7_ed55_8ccd, 0xc4ce_b9fe_1a85_ec53] {
        x = (x ^ (x >> 33)).wrapping_mul(factor);
    }
    ((x ^ (x >> 33)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// The cluster that leaves out least of each vector; of equal ones the first.
fn nearest(
    vectors: &DMatrix<f32>,
    squares: &[f64],
    directions: &DMatrix<f32>,
    abandoned: &AtomicBool,
) -> Option<Vec<Nearest>> {
    let across = directions.transpose();
    let in_block = |first: usize| {
        if abandoned.load(Ordering::Relaxed) {
            return None;
        }
        let columns = BLOCK.min(vectors.ncols() - first);
        let along = &across * vectors.columns(first, columns);
        let of = |i: usize| {
            let along = along.column(i);
            let mut best = Nearest { cluster: 0, weights: [0.0; DIRECTIONS], left: squares[first + i] };
            for (cluster, &weights) in along.as_slice().as_chunks::<DIRECTIONS>().0.iter().enumerate() {
                let taken: f64 = weights.iter().map(|&weight| f64::from(weight) * f64::from(weight)).sum();
                let left = (squares[first + i] - taken).max(0.0);
                if left < best.left {
                    best = Nearest { cluster, weights, left };
                }
            }
            best
        };
        Some((0..columns).map(of).collect::<Vec<_>>())
    };
    let blocks: Vec<usize> = (0..vectors.ncols()).step_by(BLOCK).collect();
    let found: Option<Vec<_>> = blocks.into_par_iter().map(in_block).collect();
    Some(found?.into_iter().flatten().collect())
}

/// Gives each cluster without a vector one of those that most is left out of.
fn fill_empty(nearest: &mut [Nearest], count: usize) {
    let mut members = vec![0_usize; count];
    nearest.iter().for_each(|nearest| members[nearest.cluster] += 1);
    let mut worst: Vec<usize> = (0..nearest.len()).filter(|&i| nearest[i].left > 0.0).collect();
    worst.sort_by(|&a, &b| nearest[b].left.total_cmp(&nearest[a].left).then(a.cmp(&b)));
    let mut worst = worst.into_iter();
    for cluster in 0..count {
        if members[cluster] > 0 {
            continue;
        }
        let Some(moved) = worst.find(|&i| members[nearest[i].cluster] > 1) else { return };
        members[nearest[moved].cluster] -= 1;
        members[cluster] = 1;
        nearest[moved] = Nearest { cluster, weights: [0.0; DIRECTIONS], left: 0.0 };
    }
}

/// New directions of each cluster, the first `rank`; clusters without vectors keep theirs.
fn fitted(
    vectors: &DMatrix<f32>,
    nearest: &[Nearest],
    directions: &DMatrix<f32>,
    rank: usize,
    abandoned: &AtomicBool,
) -> Option<DMatrix<f32>> {
    let count = directions.ncols() / DIRECTIONS;
    let mut members = vec![Vec::new(); count];
    nearest.iter().enumerate().for_each(|(i, nearest)| members[nearest.cluster].push(i));
    let fit = |(cluster, members): (usize, Vec<usize>)| {
        if abandoned.load(Ordering::Relaxed) {
            return None;
        }
        if members.is_empty() {
            return Some(directions.columns(DIRECTIONS * cluster, DIRECTIONS).into_owned());
        }
        Some(principal_directions(&vectors.select_columns(&members), rank))
    };
    let found: Option<Vec<_>> = members.into_par_iter().enumerate().map(fit).collect();
    let mut directions = DMatrix::zeros(vectors.nrows(), directions.ncols());
    for (cluster, found) in found?.iter().enumerate() {
        directions.columns_mut(DIRECTIONS * cluster, DIRECTIONS).copy_from(found);
    }
    Some(directions)
}

/// The `rank` orthonormal directions that leave out least of the columns, the others zero: block power
/// iteration from fixed sums of the columns, then the exact directions within the block.
fn principal_directions(columns: &DMatrix<f32>, rank: usize) -> DMatrix<f32> {
    let sought = SOUGHT.min(columns.nrows());
    let shares =
        DMatrix::from_fn(columns.ncols(), sought, |i, j| uniform((i * SOUGHT + j) as u64) as f32 - 0.5);
    let mut block = (columns * shares).qr().q();
    for _ in 1..MULTIPLICATIONS {
        let along = block.transpose() * columns;
        block = (columns * along.transpose()).qr().q();
    }
    let along = (block.transpose() * columns).cast::<f64>();
    let products = &along * along.transpose();
    let Some(SymmetricEigen { eigenvalues, eigenvectors }) =
        SymmetricEigen::try_new(products, f64::EPSILON, MOST_ROTATIONS)
    else {
        return DMatrix::zeros(columns.nrows(), DIRECTIONS);
    };
    let mut order: Vec<usize> = (0..sought).collect();
    order.sort_by(|&a, &b| eigenvalues[b].total_cmp(&eigenvalues[a]).then(a.cmp(&b)));
    order.truncate(rank);
    let chosen = eigenvectors.select_columns(&order).cast::<f32>();
    (block * chosen).resize_horizontally(DIRECTIONS, 0.0)
}

fn norm_squared(vectors: &DMatrix<f32>, i: usize) -> f64 {
    vectors.column(i).iter().map(|&value| f64::from(value) * f64::from(value)).sum()
}

/// What is left out of a vector, squared.
fn left_out(vectors: &DMatrix<f32>, i: usize, directions: &DMatrix<f32>, nearest: &Nearest) -> f64 {
    let mut rest = vectors.column(i).into_owned();
    for (j, &weight) in nearest.weights.iter().enumerate() {
        rest.axpy(-weight, &directions.column(DIRECTIONS * nearest.cluster + j), 1.0);
    }
    rest.iter().map(|&value| f64::from(value) * f64::from(value)).sum()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn found(vectors: &DMatrix<f32>, count: usize) -> Clusters {
        Clusters::of(vectors, count, &AtomicBool::new(false)).unwrap()
    }

    fn random(rows: usize, columns: usize, seed: u64) -> DMatrix<f32> {
        DMatrix::from_fn(rows, columns, |i, j| {
            uniform(seed + (j * rows + i) as u64).mul_add(2.0, -1.0) as f32
        })
    }

    fn sums(clusters: &Clusters) -> DMatrix<f32> {
        let sum = |i: usize| {
            let first = DIRECTIONS * clusters.of[i] as usize;
            let weights = nalgebra::RowSVector::from(clusters.weights[i]).transpose();
            clusters.directions.columns(first, DIRECTIONS) * weights
        };
        DMatrix::from_columns(&(0..clusters.of.len()).map(sum).collect::<Vec<_>>())
    }

    /// As matrices in a volume are: smooth along three axes, with steps.
    fn smooth(rows: usize, edge: usize) -> DMatrix<f32> {
        DMatrix::from_fn(rows, edge * edge * edge, |i, j| {
            let at = [j % edge, j / edge % edge, j / (edge * edge)].map(|x| x as f64 / edge as f64);
            let along = (0..3).map(|k| at[k] * (uniform((3 * i + k) as u64) - 0.5)).sum::<f64>();
            let shadow = if along > 0.1 { 0.2 } else { 1.0 };
            ((4.0 * along).exp() * shadow * (0.1 + at[0])) as f32
        })
    }

    #[test]
    fn vectors_of_few_directions_come_back() {
        // Of one cluster, whatever they are; and of three that have nothing in common.
        let columns = random(60, DIRECTIONS, 1) * random(DIRECTIONS, 200, 2);
        let one = found(&columns, 1);
        assert!(one.error < 1e-5, "{}", one.error);
        assert!((sums(&one) - &columns).norm() < 1e-5 * columns.norm());
        let mut apart = DMatrix::zeros(90, 300);
        for part in 0..3 {
            // Of various lengths, and not quite alike.
            let mut weights = random(4, 100, 7 + part as u64) * 0.1;
            weights.row_mut(0).add_scalar_mut(1.0);
            let columns = random(30, 4, 3 + part as u64) * weights * (1.0 + part as f32);
            apart.view_mut((30 * part, 100 * part), (30, 100)).copy_from(&columns);
        }
        let three = found(&apart, 3);
        assert!(three.error < 1e-5, "{}", three.error);
        for part in 0..3 {
            assert!(three.of[100 * part..][..100].iter().all(|&of| of == three.of[100 * part]));
        }
        assert!(found(&apart, 1).error > 0.03, "one cluster cannot hold them");
    }

    #[test]
    fn one_cluster_leaves_out_what_the_singular_value_decomposition_does() {
        let columns = smooth(40, 6);
        let singular = columns.clone().svd(false, false).singular_values;
        let squares = |from: usize| singular.iter().skip(from).map(|s| f64::from(s * s)).sum::<f64>();
        let least = (squares(DIRECTIONS) / squares(0)).sqrt();
        let found = found(&columns, 1);
        assert!(found.error >= least * 0.999 && found.error < least * 1.03, "{} {least}", found.error);
        // The error is that of the sums.
        let difference = (sums(&found) - &columns).norm() / columns.norm();
        assert!((f64::from(difference) / found.error - 1.0).abs() < 1e-3);
        let products = found.directions.transpose() * &found.directions;
        assert!((products - DMatrix::identity(DIRECTIONS, DIRECTIONS)).norm() < 1e-4, "orthonormal");
    }

    #[test]
    fn more_clusters_leave_out_less() {
        let columns = smooth(80, 12);
        let errors = [1, 2, 4, 8, 16, 32, 64].map(|count| found(&columns, count).error);
        println!("{errors:?}");
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
        assert!(errors[6] < 0.35 * errors[0], "{errors:?}");
    }

    #[test]
    fn threads_change_no_bit() {
        let columns = smooth(50, 9);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| found(&columns, 12))
        };
        let one = with(1);
        assert_eq!(one.directions.ncols(), 12 * DIRECTIONS);
        assert!(one == with(2) && one == with(5));
    }

    #[test]
    fn few_vectors_and_nothing_are_no_trouble() {
        for columns in [1, 2, 4, 7] {
            let vectors = random(42, columns, 5);
            let found = found(&vectors, 128);
            assert!(found.error < 1e-5 && found.directions.ncols() <= DIRECTIONS * columns);
        }
        let same = random(42, 1, 9) * DMatrix::from_element(1, 30, 2.0);
        let of_same = found(&same, 32);
        assert!(
            of_same.error < 1e-5 && of_same.directions.ncols() == DIRECTIONS,
            "one direction, one cluster"
        );
        let mut some = random(42, 40, 3);
        some.columns_mut(5, 20).fill(0.0);
        for vectors in [DMatrix::zeros(42, 3), some, random(2, 40, 1)] {
            let found = found(&vectors, 4);
            assert!(found.error.is_finite() && found.directions.iter().all(|value| value.is_finite()));
            assert!(found.of.iter().all(|&of| (of as usize) < found.directions.ncols() / DIRECTIONS));
            let zeros = (0..vectors.ncols()).filter(|&i| vectors.column(i).norm() == 0.0);
            assert!(zeros.into_iter().all(|i| found.weights[i] == [0.0; DIRECTIONS]));
        }
    }

    #[test]
    fn what_is_abandoned_ends() {
        assert!(Clusters::of(&smooth(50, 9), 12, &AtomicBool::new(true)).is_none());
    }

    #[test]
    fn clusters_without_vectors_get_those_that_most_is_left_out_of() {
        let of = |cluster: usize, left: f64| Nearest { cluster, weights: [0.0; DIRECTIONS], left };
        let mut nearest = vec![of(0, 1.0), of(0, 3.0), of(2, 9.0), of(0, 2.0)];
        fill_empty(&mut nearest, 4);
        // The third keeps its only vector.
        assert_eq!(nearest.iter().map(|n| n.cluster).collect::<Vec<_>>(), [0, 1, 2, 3]);
        fill_empty(&mut nearest, 6);
        assert_eq!(nearest.iter().map(|n| n.cluster).collect::<Vec<_>>(), [0, 1, 2, 3]);
    }

    #[test]
    fn draws_follow_shares() {
        assert_eq!([0.0, 0.24, 0.26, 0.99].map(|at| draw(&[0.0, 1.0, 0.0, 3.0], at)), [1, 1, 3, 3].map(Some));
        assert_eq!(draw(&[0.0, 0.0], 0.5), None);
        let mean = (0..1000).map(uniform).sum::<f64>() / 1000.0;
        assert!((mean - 0.5).abs() < 0.03, "{mean}");
    }

    #[test]
    fn constants_are_those_of_the_shader() {
        assert!(crate::shaders::LIGHT_CLUSTERS.contains(&format!("const DIRECTIONS = {DIRECTIONS}u;")));
    }
}
