//! Cages that stay near their frames. What a cage cannot follow is left over in every singular
//! direction, and moves the cage by that over the singular value: weak directions may take vertices
//! hundreds of diagonals away. Such a frame is solved once more, held to the rest cage's shape over
//! the whole spectrum, `min ‖A (C' − C)‖² + λ ‖Δ (C' − C_R)‖²`, with the smallest λ that does.

use crate::cage::Cage;
use crate::regularize::{add_term, cage_laplacian};
use cager_geometry::linalg;
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::Aabb;
use faer::Mat;
use std::sync::OnceLock;

/// A cage is near where no vertex leaves the box around the points by more than at rest and this.
const NEAR: f64 = 1.0;
/// From so many diagonals on, a frame has the held cage alone; before, a mixture.
const FAR: f64 = 2.0;
/// Weights λ that are tried in turn; under the last the rest cage moves along as it is.
const WEIGHTS: [f64; 10] = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e4, 1e6];
/// Weight of displacements themselves, for parts of a cage that no point determines.
const DISPLACEMENT: f64 = 1e-3;

/// What brings cages back to their frames.
#[derive(Debug)]
pub(crate) struct Nearness {
    data: NearnessParts,
    cage: Cage,
    /// `AᵀA`; computed, as the factors are, for the first frame that needs it.
    gram: OnceLock<Mat<f64>>,
    /// Lower Cholesky factors of `AᵀA + λ (ΔᵀΔ + ε)`.
    factors: [OnceLock<Option<Mat<f64>>>; WEIGHTS.len()],
}

/// The data of what brings cages back to their frames.
#[derive(Clone, Debug)]
pub struct NearnessParts {
    /// F with `FᵀF = AᵀA`, scaled so that weights are beside the mean square error; r × m.
    pub factor: Mat<f64>,
    /// Unknowns of the rest pose, m × 3.
    pub rest: Mat<f64>,
    /// Faces of the cage.
    pub faces: Vec<[u32; 3]>,
    /// Distance of the rest cage's farthest vertex from the box around the rest pose's points.
    pub margin: f64,
}

impl Nearness {
    /// For the points of a rest pose, from F with `FᵀF = AᵀA`; `None` where there is no cage.
    pub(crate) fn new(factor: Mat<f64>, unknowns: &[Point], cage: &Cage, points: &[Point]) -> Option<Self> {
        Self::from_parts(NearnessParts {
            factor,
            rest: Mat::from_fn(unknowns.len(), 3, |i, k| unknowns[i][k]),
            faces: cage.mesh().triangles.clone(),
            margin: max_distance(&Aabb::around_all(points), cage.vertices()),
        })
    }

    /// `None` where the parts are no cage.
    pub(super) fn from_parts(data: NearnessParts) -> Option<Self> {
        let last = data.faces.iter().flatten().max()?;
        let vertices = *last as usize + 1;
        let fits = data.rest.ncols() == 3 && vertices <= data.rest.nrows() && data.factor.ncols() == data.rest.nrows();
        if !fits {
            return None;
        }
        let vertices = (0..vertices).map(|i| [0, 1, 2].map(|k| data.rest[(i, k)])).collect();
        let cage = Cage::new(TriMesh { vertices, triangles: data.faces.clone() }).ok()?;
        Some(Self { data, cage, gram: OnceLock::new(), factors: Default::default() })
    }

    pub(super) fn parts(&self) -> &NearnessParts {
        &self.data
    }

    pub(super) fn unknowns(&self) -> usize {
        self.data.rest.nrows()
    }

    pub(super) fn size_bytes(&self) -> usize {
        8 * self.data.factor.nrows() * self.data.factor.ncols()
    }

    /// Brings the cage of a frame back where it is far from it, and says whether it was.
    pub(super) fn keep(&self, cage: &mut [Point], frame: &Aabb, diagonal: f64) -> bool {
        let unit = diagonal.max(frame.size().length());
        let vertices = self.cage.vertices().len();
        let share = |distance: f64| (((distance - self.data.margin) / unit - NEAR) / (FAR - NEAR)).min(1.0);
        // Seldom is even the box around the cage far, and it is found faster than all distances.
        let around = Aabb::around_all(&cage[..vertices]);
        if share(frame.max_distance2(&around).sqrt()) <= 0.0 {
            return false;
        }
        let distance = |cage: &[Point]| max_distance(frame, &cage[..vertices]);
        let share_held = share(distance(cage));
        let is_far = share_held > 0.0;
        if is_far {
            let held = self.held(cage, |cage| share(distance(cage)) <= 0.0);
            for (row, held) in cage.iter_mut().zip(held) {
                *row = [0, 1, 2].map(|k| (1.0 - share_held) * row[k] + share_held * held[k]);
            }
        }
        is_far
    }

    /// The cage nearest to fitting what this one fits that is near.
    fn held(&self, cage: &[Point], is_near: impl Fn(&[Point]) -> bool) -> Vec<Point> {
        let (m, vertices) = (cage.len(), self.cage.vertices().len());
        // By the calling thread: whoever waits for it must not be given work that waits for it too.
        let of_factor = || linalg::mirrored(linalg::gram(self.data.factor.as_ref(), usize::MAX));
        let gram = self.gram.get_or_init(of_factor);
        // Displacements, and a translation by one.
        let one = |i: usize| if i < vertices { 1.0 } else { 0.0 };
        let moved = Mat::from_fn(m, 4, |i, k| if k < 3 { cage[i][k] - self.data.rest[(i, k)] } else { one(i) });
        let moved = linalg::product(gram.as_ref(), moved.as_ref());
        let sum = |k: usize| (0..vertices).map(|i| moved[(i, k)]).sum::<f64>();
        // What the points move by on the average, which nothing holds.
        let mean = [0, 1, 2].map(|k| sum(k) / sum(3));
        let right = Mat::from_fn(m, 3, |i, k| moved[(i, k)] - mean[k] * moved[(i, 3)]);
        let with = |displacement: &Mat<f64>| -> Vec<Point> {
            let row = |i| [0, 1, 2].map(|k| self.data.rest[(i, k)] + one(i) * mean[k] + displacement[(i, k)]);
            (0..m).map(row).collect()
        };
        for (factor, weight) in self.factors.iter().zip(WEIGHTS) {
            let Some(factor) = factor.get_or_init(|| self.factor(gram, weight)) else { continue };
            let mut displacement = right.clone();
            linalg::solve_cholesky(factor.as_ref(), &mut displacement);
            let held = with(&displacement);
            if is_near(&held) {
                return held;
            }
        }
        with(&Mat::zeros(m, 3))
    }

    fn factor(&self, gram: &Mat<f64>, weight: f64) -> Option<Mat<f64>> {
        let m = self.unknowns();
        let delta = cage_laplacian(&self.cage, m);
        let mut system = gram.clone();
        for i in 0..m {
            system[(i, i)] += weight * DISPLACEMENT;
        }
        add_term(&mut system, delta.as_ref(), weight);
        linalg::cholesky(system)
    }
}

/// Largest distance of a point from a box.
fn max_distance(from: &Aabb, places: &[Point]) -> f64 {
    places.iter().map(|&p| from.distance2(p.into())).fold(0.0, f64::max).sqrt()
}
