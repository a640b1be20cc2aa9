//! The coordinates in which cages are coded: what a cage's rows do to the model.
//!
//! With Gram matrix `G = ΦᵀΦ/n + εI = L Lᵀ`, rows of `Y = Lᵀ(C − C₀)` have the length of what they
//! move the model (root mean square over its points), so that a uniform step in Y is optimal for a
//! mean square error. A rotation to the eigenvectors of `LᵀL` gathers what moves much. G is rounded
//! first, by steps that the bytes say, so that every machine computes the same basis.

use crate::gram_rounding::GramRounding;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Coordinates, CoordinatesError, ElementPlan, MeanValue};
use cager_geometry::linalg;
use cager_geometry::mesh::Point;
use faer::{Mat, MatRef, Par};

/// ε over the mean of the diagonal: vertices that hardly move the model are coded too.
const FLOOR: f64 = 1e-2;
/// Equal eigenvalues leave their vectors open; scaling each row by up to this much parts them.
const SPLIT: f64 = 1e-3;
/// Largest relative change of a coefficient by the rounding of factorisations on another machine.
const STABLE: f64 = 1e-7;
/// Disturbance that shows that change, over the largest diagonal entry of G: many times rounding.
const DISTURBANCE: f64 = 1e-14;

/// What two machines' entries of `ΦᵀΦ/n` may differ by, over the mean of its diagonal.
const TOLERANCE: f64 = 1e-9;

/// How a basis is computed from `Φ`, as the bytes of a group of cages say it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BasisRecord {
    /// Whether it is rotated to eigenvectors.
    pub rotated: bool,
    /// How the Gram matrix is rounded; `None` in files of programs up to 0.2, which did not.
    pub rounding: Option<GramRounding>,
}

/// The coordinates of a cage's rows that bytes hold.
#[derive(Clone, Debug)]
pub struct CageBasis {
    rest: Vec<Point>,
    record: BasisRecord,
    /// Y from rows, m × m.
    to: Mat<f64>,
    /// Rows from Y.
    from: Mat<f64>,
}

impl CageBasis {
    /// Most points whose coordinates are read.
    pub const SAMPLE: usize = 1 << 14;

    /// For a model in its cage, from every k-th point, 16,384 at the most; and the coordinates of
    /// these, where they are those of the system. `record` is what the encoder found. `None` where
    /// numbers are not finite.
    ///
    /// Solved coordinates differ between machines: their basis is that of mean value coordinates.
    ///
    /// # Errors
    /// As [`CoordinateSystem::coordinates`].
    pub fn of(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        plan: Option<&ElementPlan>,
        record: Option<&BasisRecord>,
    ) -> Result<Option<(Self, Option<Coordinates>)>, CoordinatesError> {
        let every = points.len().div_ceil(Self::SAMPLE).max(1);
        let sample: Vec<Point> = points.iter().step_by(every).copied().collect();
        let is_own = system.pointwise().is_some() || record.is_some_and(|record| record.rounding.is_none());
        let system: &dyn CoordinateSystem = if is_own { system } else { &MeanValue };
        let sampled_cage = cage.of_points((0..points.len() as u32).step_by(every));
        let found = system.coordinates(&sampled_cage, &sample, plan.filter(|_| is_own))?;
        // Of normals that follow from the vertices no rows are stored.
        let values = system.values(cage);
        let rows = values.unknowns();
        let (phi, rest) = (found.phi.subcols(0, rows), &values.rest[..rows]);
        let basis = match record {
            Some(record) => Self::new(phi, rest, record),
            None => Self::for_encoding(phi, rest),
        };
        Ok(basis.map(|basis| (basis, is_own.then_some(found))))
    }

    /// From rows of `Φ` and the rest pose's rows; `None` where numbers are not finite.
    pub fn new(phi: MatRef<'_, f64>, rest: &[Point], record: &BasisRecord) -> Option<Self> {
        let products = products(phi);
        let rounded = match &record.rounding {
            Some(rounding) => rounding.apply(products)?,
            None => products,
        };
        Self::of_gram(with_floor(rounded).as_ref(), rest, record.clone())
    }

    /// The basis for encoding, rotated where the factorisations are stable.
    pub fn for_encoding(phi: MatRef<'_, f64>, rest: &[Point]) -> Option<Self> {
        let products = products(phi);
        let rounding = GramRounding::of(products.as_ref(), TOLERANCE)?;
        let gram = with_floor(rounding.apply(products)?);
        let record = |rotated| BasisRecord { rotated, rounding: Some(rounding.clone()) };
        let rotated = Self::of_gram(gram.as_ref(), rest, record(true))?;
        let m = gram.nrows();
        let size = DISTURBANCE * (0..m).map(|k| gram[(k, k)]).fold(0.0, f64::max);
        let disturbed = Mat::from_fn(m, m, |i, j| {
            let (i, j) = (i.min(j), i.max(j));
            gram[(i, j)] + size * (2.0 * spread(i * 31 + j) - 1.0)
        });
        let same = Self::of_gram(disturbed.as_ref(), rest, record(true)).is_some_and(|other| {
            let there_and_back = linalg::product(other.to.as_ref(), rotated.from.as_ref());
            (0..m).all(|j| (0..m).all(|i| (there_and_back[(i, j)] - f64::from(u8::from(i == j))).abs() <= STABLE))
        });
        if same { Some(rotated) } else { Self::of_gram(gram.as_ref(), rest, record(false)) }
    }

    fn of_gram(gram: MatRef<'_, f64>, rest: &[Point], record: BasisRecord) -> Option<Self> {
        let m = gram.nrows();
        let l = linalg::cholesky(gram.to_owned())?;
        let mut to = l.transpose().to_owned();
        // L⁻ᵀ
        let mut from = Mat::identity(m, m);
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(l.transpose(), from.as_mut(), Par::Seq);
        if record.rotated {
            let inner = linalg::product(l.transpose(), l.as_ref());
            let part = |k: usize| 1.0 + SPLIT * spread(k);
            let split = Mat::from_fn(m, m, |i, j| inner[(i, j)] * part(i) * part(j));
            let (_, mut vectors) = linalg::eigen(split.as_ref())?;
            for vector in vectors.col_iter_mut() {
                let side: f64 = vector.as_ref().iter().enumerate().map(|(k, x)| x * (spread(k) - 0.5)).sum();
                if side < 0.0 {
                    vector.iter_mut().for_each(|x| *x = -*x);
                }
            }
            to = linalg::product(vectors.transpose(), to.as_ref());
            from = linalg::product(from.as_ref(), vectors.as_ref());
        }
        Some(Self { rest: rest.to_vec(), record, to, from })
    }

    /// How it was computed, for the bytes of its groups.
    pub fn record(&self) -> &BasisRecord {
        &self.record
    }

    /// Rows of a cage.
    pub fn rows(&self) -> usize {
        self.rest.len()
    }

    /// Y of some cages, m × 3·frames, three columns for each.
    pub(crate) fn forward(&self, cages: &[&[f32]]) -> Mat<f64> {
        let moved = Mat::from_fn(self.rows(), 3 * cages.len(), |j, column| {
            f64::from(cages[column / 3][3 * j + column % 3]) - self.rest[j][column % 3]
        });
        linalg::product(self.to.as_ref(), moved.as_ref())
    }

    /// The cages of Y.
    pub(crate) fn inverse(&self, y: MatRef<'_, f64>) -> Vec<Vec<f32>> {
        let moved = linalg::product(self.from.as_ref(), y);
        let cage = |frame: usize| {
            let row = |j: usize| (0..3).map(move |c| (j, c));
            let value = |(j, c): (usize, usize)| (moved[(j, 3 * frame + c)] + self.rest[j][c]) as f32;
            (0..self.rows()).flat_map(row).map(value).collect()
        };
        (0..y.ncols() / 3).map(cage).collect()
    }
}

/// `ΦᵀΦ/n`.
fn products(phi: MatRef<'_, f64>) -> Mat<f64> {
    let n = phi.nrows();
    let mut products = linalg::mirrored(linalg::lower_product(phi.transpose(), phi));
    products *= faer::Scale(1.0 / n.max(1) as f64);
    products
}

/// G of `ΦᵀΦ/n`.
fn with_floor(mut gram: Mat<f64>) -> Mat<f64> {
    let m = gram.nrows();
    let trace: f64 = (0..m).map(|k| gram[(k, k)]).sum();
    let floor = FLOOR * (trace / m as f64).max(f64::MIN_POSITIVE);
    for k in 0..m {
        gram[(k, k)] += floor;
    }
    gram
}

/// A number between 0 and 1 for each k, spread evenly: fractions of multiples of the golden ratio.
fn spread(k: usize) -> f64 {
    (k as f64 * 0.618_033_988_749_894_9).fract()
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::cage::Carrier;
    use cager_geometry::mesh::TriMesh;

    fn cage_of(m: usize) -> (Vec<Point>, Vec<f32>) {
        let mut random = fastrand::Rng::with_seed(3);
        ((0..m).map(|k| [k as f64, 0.0, 1.0]).collect(), (0..3 * m).map(|_| random.f32()).collect())
    }

    #[test]
    fn lengths_are_what_the_model_moves_and_equal_values_do_not_rotate() {
        let mut random = fastrand::Rng::with_seed(3);
        let (n, m) = (200, 12);
        let phi = Mat::from_fn(n, m, |_, _| random.f64());
        let (rest, cage) = cage_of(m);
        let basis = CageBasis::for_encoding(phi.as_ref(), &rest).unwrap();
        assert!(basis.record().rotated);
        let y = basis.forward(&[&cage]);
        let moved = Mat::from_fn(m, 3, |j, c| f64::from(cage[3 * j + c]) - rest[j][c]);
        let model = linalg::product(phi.as_ref(), moved.as_ref());
        let length = model.norm_l2() / (n as f64).sqrt();
        assert!((y.norm_l2() - length).abs() < 0.05 * length, "{} {length}", y.norm_l2());
        let back = basis.inverse(y.as_ref());
        assert!(back[0].iter().zip(&cage).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn a_component_that_the_sample_misses_has_a_basis() {
        const FACES: [[u32; 3]; 8] =
            [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        let corner = |k: usize| [0, 1, 2].map(|c| if k / 2 == c { 1.0 - 2.0 * (k % 2) as f64 } else { 0.0 });
        let vertices = (0..12).map(|k| [corner(k % 6)[0] + 5.0 * (k / 6) as f64, corner(k % 6)[1], corner(k % 6)[2]]);
        let triangles = [0, 6].into_iter().flat_map(|first| FACES.map(|face| face.map(|k| first + k)));
        let mesh = TriMesh { vertices: vertices.collect(), triangles: triangles.collect() };
        // Every third point is read, and the second component has the second one.
        let count = 2 * CageBasis::SAMPLE as u32 + 3;
        let carriers = [(0..1, 0..6), (1..2, 6..12), (2..count, 0..6)];
        let carriers = carriers.map(|(points, vertices)| Carrier { points, vertices }).to_vec();
        let cage = Cage::new(mesh).unwrap().with_carriers(carriers).unwrap();
        let points: Vec<Point> = (0..count).map(|k| [1e-5 * f64::from(k), 0.1, 0.01 * f64::from(k % 7)]).collect();
        let (basis, found) = CageBasis::of(&MeanValue, &cage, &points, None, None).unwrap().unwrap();
        assert_eq!((basis.rows(), found.unwrap().phi.nrows()), (12, count.div_ceil(3) as usize));
    }

    /// Coordinates with the symmetries of a regular polygon, whose eigenvalues come in equal pairs.
    fn symmetrical(m: usize) -> Mat<f64> {
        Mat::from_fn(9 * m, m, |i, j| {
            let turn = (i % m + m - j) % m;
            let distance = turn.min(m - turn) as f64;
            (-0.1 * distance * distance * (1.0 + (i / m) as f64)).exp()
        })
    }

    #[test]
    fn other_rounding_of_coordinates_finds_the_same_basis() {
        let (phi, (rest, cage)) = (symmetrical(40), cage_of(40));
        let basis = CageBasis::for_encoding(phi.as_ref(), &rest).unwrap();
        assert!(basis.record().rotated);
        let mut random = fastrand::Rng::with_seed(8);
        let mean = phi.squared_norm_l2() / phi.nrows() as f64 / 40.0;
        for _ in 0..8 {
            // As another machine would compute them, by as much as the tolerance allows.
            let by = 0.2 * TOLERANCE * mean.sqrt();
            let other = Mat::from_fn(phi.nrows(), 40, |i, j| phi[(i, j)] + by * (random.f64() - 0.5));
            let other = CageBasis::new(other.as_ref(), &rest, basis.record()).unwrap();
            let back = other.inverse(basis.forward(&[&cage]).as_ref());
            assert!(back[0].iter().zip(&cage).all(|(a, b)| (a - b).abs() < 1e-5));
        }
    }

    #[test]
    fn directions_that_rounding_could_turn_are_left_as_they_are() {
        // Rows of Φ that say the same of all vertices: all eigenvalues but one are equal.
        let phi = Mat::from_fn(40, 8, |i, j| f64::from(u8::from(i % 8 == j)));
        let rest = vec![[0.0; 3]; 8];
        let basis = CageBasis::for_encoding(phi.as_ref(), &rest).unwrap();
        let other = CageBasis::new(phi.as_ref(), &rest, basis.record()).unwrap();
        let cage: Vec<f32> = (0..24).map(|k| k as f32).collect();
        let back = other.inverse(basis.forward(&[&cage]).as_ref());
        assert!(back[0].iter().zip(&cage).all(|(a, b)| (a - b).abs() < 1e-4));
    }
}
