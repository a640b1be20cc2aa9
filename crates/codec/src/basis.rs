//! The coordinates in which cages are coded: what a cage's rows do to the model.
//!
//! With Gram matrix `G = ΦᵀΦ/n + εI = L Lᵀ`, the rows of `Y = Lᵀ(C − C₀)` have the length of what they move the model, in the root mean square over
//! its points; so a uniform step in Y is optimal at a given mean square error of the positions (reverse water-filling). A rotation of Y to the
//! eigenvectors of `LᵀL` gathers what moves much: `Y = S Vᵀ(C − C₀)`, with the singular values S and vectors V of Φ.

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Coordinates, CoordinatesError, ElementPlan};
use cager_geometry::linalg;
use cager_geometry::mesh::Point;
use faer::{Mat, MatRef, Par};

/// ε over the mean of the diagonal of the Gram matrix: a vertex that hardly moves the model still is coded to a hundred steps.
const FLOOR: f64 = 1e-2;
/// Equal eigenvalues would leave their vectors open; scaling the rows by up to this much, each otherwise, parts them.
const SPLIT: f64 = 1e-3;
/// Largest change of a coefficient, relative to the largest, by rounding on another machine.
const STABLE: f64 = 1e-7;

/// The coordinates of a cage's rows that bytes hold.
#[derive(Clone, Debug)]
pub struct CageBasis {
    rest: Vec<Point>,
    rotated: bool,
    /// Y from rows, m × m.
    to: Mat<f64>,
    /// Rows from Y.
    from: Mat<f64>,
}

impl CageBasis {
    /// Most points whose coordinates are read.
    pub const SAMPLE: usize = 1 << 14;

    /// For a model in its cage: from every k-th point, with the smallest k that leaves 16,384 of them; and the coordinates of these. `rotated` is what the
    /// encoder found; an encoder leaves it out. `None` where numbers are not finite.
    ///
    /// # Errors
    /// As [`CoordinateSystem::coordinates`].
    pub fn of(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        plan: Option<&ElementPlan>,
        rotated: Option<bool>,
    ) -> Result<Option<(Self, Coordinates)>, CoordinatesError> {
        let every = points.len().div_ceil(Self::SAMPLE).max(1);
        let sample: Vec<Point> = points.iter().step_by(every).copied().collect();
        let found = system.coordinates(cage, &sample, plan)?;
        // Of normals that follow from the vertices no rows are stored.
        let values = system.values(cage);
        let rows = values.unknowns();
        let (phi, rest) = (found.phi.subcols(0, rows), &values.rest[..rows]);
        let basis = match rotated {
            Some(rotated) => Self::new(phi, rest, rotated),
            None => Self::for_encoding(phi, rest),
        };
        Ok(basis.map(|basis| (basis, found)))
    }

    /// From rows of `Φ`, any number of them × m, and the rest pose's rows, m × 3. `None` where numbers are not finite.
    ///
    /// `rotated` is false for files whose encoder found that the rotation could not be relied on.
    pub fn new(phi: MatRef<'_, f64>, rest: &[Point], rotated: bool) -> Option<Self> {
        Self::of_gram(gram(phi).as_ref(), rest, rotated)
    }

    /// Rotated where another machine would find the same rotation, but for rounding.
    pub fn for_encoding(phi: MatRef<'_, f64>, rest: &[Point]) -> Option<Self> {
        let gram = gram(phi);
        let rotated = Self::of_gram(gram.as_ref(), rest, true)?;
        // What rounding can do to the sums, several times over.
        let m = gram.nrows();
        let disturbed = Mat::from_fn(m, m, |i, j| {
            let (i, j) = (i.min(j), i.max(j));
            gram[(i, j)] * (1.0 + 1e-13 * (2.0 * spread(i * 31 + j) - 1.0))
        });
        let same = Self::of_gram(disturbed.as_ref(), rest, true).is_some_and(|other| {
            let there_and_back = linalg::product(other.to.as_ref(), rotated.from.as_ref());
            (0..m).all(|j| (0..m).all(|i| (there_and_back[(i, j)] - f64::from(u8::from(i == j))).abs() <= STABLE))
        });
        if same { Some(rotated) } else { Self::of_gram(gram.as_ref(), rest, false) }
    }

    fn of_gram(gram: MatRef<'_, f64>, rest: &[Point], rotated: bool) -> Option<Self> {
        let m = gram.nrows();
        let l = linalg::cholesky(gram.to_owned())?;
        let mut to = l.transpose().to_owned();
        // L⁻ᵀ
        let mut from = Mat::identity(m, m);
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(l.transpose(), from.as_mut(), Par::Seq);
        if rotated {
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
        Some(Self { rest: rest.to_vec(), rotated, to, from })
    }

    /// Whether the coordinates are rotated to eigenvectors.
    pub fn rotated(&self) -> bool {
        self.rotated
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

/// `ΦᵀΦ/n + εI`.
fn gram(phi: MatRef<'_, f64>) -> Mat<f64> {
    let (n, m) = phi.shape();
    let mut gram = linalg::mirrored(linalg::lower_product(phi.transpose(), phi));
    let scale = 1.0 / n.max(1) as f64;
    let trace: f64 = (0..m).map(|k| gram[(k, k)]).sum::<f64>() * scale;
    let floor = FLOOR * (trace / m as f64).max(f64::MIN_POSITIVE);
    for j in 0..m {
        for i in 0..m {
            gram[(i, j)] *= scale;
        }
        gram[(j, j)] += floor;
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

    #[test]
    fn lengths_are_what_the_model_moves_and_equal_values_do_not_rotate() {
        let mut random = fastrand::Rng::with_seed(3);
        let (n, m) = (200, 12);
        let phi = Mat::from_fn(n, m, |_, _| random.f64());
        let rest: Vec<Point> = (0..m).map(|k| [k as f64, 0.0, 1.0]).collect();
        let cage: Vec<f32> = (0..3 * m).map(|_| random.f32()).collect();
        let basis = CageBasis::for_encoding(phi.as_ref(), &rest).unwrap();
        assert!(basis.rotated());
        let y = basis.forward(&[&cage]);
        let moved = Mat::from_fn(m, 3, |j, c| f64::from(cage[3 * j + c]) - rest[j][c]);
        let model = linalg::product(phi.as_ref(), moved.as_ref());
        let length = model.norm_l2() / (n as f64).sqrt();
        assert!((y.norm_l2() - length).abs() < 0.05 * length, "{} {length}", y.norm_l2());
        let back = basis.inverse(y.as_ref());
        assert!(back[0].iter().zip(&cage).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn directions_that_rounding_could_turn_are_left_as_they_are() {
        // Rows of Φ that say the same of all vertices: all eigenvalues but one are equal.
        let phi = Mat::from_fn(40, 8, |i, j| f64::from(u8::from(i % 8 == j)));
        let rest = vec![[0.0; 3]; 8];
        let basis = CageBasis::for_encoding(phi.as_ref(), &rest).unwrap();
        let other = CageBasis::new(phi.as_ref(), &rest, basis.rotated()).unwrap();
        let cage: Vec<f32> = (0..24).map(|k| k as f32).collect();
        let back = other.inverse(basis.forward(&[&cage]).as_ref());
        assert!(back[0].iter().zip(&cage).all(|(a, b)| (a - b).abs() < 1e-4));
    }
}
