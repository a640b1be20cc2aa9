//! The paper's transfer through a public cage (Eq. 4): `T₁ = A_t (A_sᵀ A_s)⁻¹ A_sᵀ S₁`.

use crate::registration::NearestPoints;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, DependentNormals, SYSTEMS};
use cager_core::inversion::{Handles, PrepareContext, PrepareError, SolverOptions};
use cager_core::spectral::Analysis;
use cager_geometry::linalg::{gram, mirrored, solve_definite, transposed_product};
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::outside;
use cager_geometry::vector::norm;
use faer::Mat;
use glam::DVec3;

use super::rigid::Rigidity;
use super::source::moved_frame;
use crate::error::TransferError;
use crate::points::{cage_values, matrix, points_in, vectors};
use crate::similarity::Similarity;

/// Moves frames of a source onto a target through a cage around both.
pub struct PublicTransfer {
    aligned: Similarity,
    source_rest: Vec<DVec3>,
    source: Mat<f64>,
    target_rest: Vec<DVec3>,
    target: Mat<f64>,
    /// Values of the cage at rest, columns × 3.
    values: Vec<Point>,
    inverse: Inverse,
    rigidity: Option<Rigidity>,
    /// The source's point at rest nearest to each of the target's.
    under: Vec<u32>,
}

/// How the cage is found for the source's points.
enum Inverse {
    /// By one matrix, n × m: transposed, it takes displacements of the source to the cage's.
    Linear(Mat<f64>),
    /// With normals that follow the vertices: these, and `Φᵀ Φ` of the source, columns × columns.
    Consistent(DependentNormals, Mat<f64>),
}

const BLOCK_ROWS: usize = 512;
/// Steps of Gauss and Newton, and when they end: the change as a share of the cage's size.
const MAX_STEPS: usize = 20;
const TOLERANCE: f64 = 1e-12;

impl PublicTransfer {
    /// Of a source, brought to the target by `aligned`, and a target, in a cage around both. The
    /// target is as rigid as possible with a weight, for coordinates of vertices alone.
    ///
    /// # Errors
    /// Models without coordinates in the cage; a cage that the source does not determine.
    pub fn new(
        source_mesh: &TriMesh,
        target_mesh: &TriMesh,
        aligned: Similarity,
        cage: &Cage,
        system: &dyn CoordinateSystem,
        rigidity: Option<f64>,
    ) -> Result<Self, TransferError> {
        let (source, target) = (aligned.apply_all(&source_mesh.vertices), &target_mesh.vertices);
        let target_phi = coordinates("target", target, cage, system)?;
        let values = system.values(cage);
        let unknowns = values.unknowns();
        let options = SolverOptions { handles: Handles::All, ..SolverOptions::for_unknowns(unknowns) };
        let context = PrepareContext { analysed_entries: usize::MAX, ..PrepareContext::default() };
        let refused = |error| refused(error, &source, cage, system);
        let analysis = Analysis::for_options(system, cage, &source, options, &context).map_err(refused)?;
        let found = analysis.preparation();
        if !everywhere(system) && !found.outside.is_empty() {
            return Err(TransferError::Outside { whose: "source", count: found.outside.len() });
        }
        if found.rank < unknowns {
            return Err(TransferError::Rank { rank: found.rank, unknowns });
        }
        let (source_phi, inverse) = if let Some(dependent) = values.dependent_normals {
            let phi = coordinates("source", &source, cage, system)?;
            let gram = mirrored(gram(phi.as_ref(), BLOCK_ROWS));
            (phi, Inverse::Consistent(dependent, gram))
        } else {
            let solver = analysis.solver(options).map_err(refused)?;
            (analysis.coordinates().to_owned(), Inverse::Linear(solver.operator().to_owned()))
        };
        let rigidity = rigidity
            .map(|weight| Rigidity::new((source_mesh, &source_phi), (target_mesh, &target_phi), aligned.scale, weight));
        let near = NearestPoints::new(source.iter().copied());
        let under = target.iter().map(|&p| near.nearest(p).0 as u32).collect();
        Ok(Self {
            aligned,
            source_rest: vectors(&source),
            source: source_phi,
            target_rest: vectors(target),
            target: target_phi,
            values: values.rest,
            inverse,
            rigidity: rigidity.transpose()?,
            under,
        })
    }

    /// The target as the source is in a frame.
    ///
    /// # Errors
    /// Other points than at rest, or one that is not finite; `frame` is the number in the message.
    pub fn pose(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, TransferError> {
        let pose = moved_frame(frame, points, self.source_rest.len(), &self.aligned)?;
        // How the source moves as a whole is taken out and given back.
        let pairs: Vec<_> = self.source_rest.iter().zip(&pose).map(|(&p, &q)| (p, q, 1.0)).collect();
        let whole = Similarity::between(&pairs, true);
        let back = whole.inverse();
        let pose: Vec<DVec3> = pose.into_iter().map(|p| back.apply(p)).collect();
        let mut change = self.change(&pose);
        if let Some(rigidity) = &self.rigidity {
            change = rigidity.refined(&self.source, [&self.source_rest, &pose], &matrix(&self.values), change);
        }
        let moved: Vec<DVec3> = points_in(self.target.as_ref(), change.as_ref());
        Ok(moved.iter().zip(&self.target_rest).map(|(d, p)| whole.apply(*p + *d).to_array()).collect())
    }

    /// The source's points nearest to the target's at rest, in its space: for contacts.
    ///
    /// # Errors
    /// As [`Self::pose`].
    pub fn under(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, TransferError> {
        let pose = moved_frame(frame, points, self.source_rest.len(), &self.aligned)?;
        Ok(self.under.iter().map(|&v| pose[v as usize].to_array()).collect())
    }

    /// The change of the cage's values, columns × 3, for a pose of the source; none at rest.
    fn change(&self, pose: &[DVec3]) -> Mat<f64> {
        let wanted = matrix(pose) - matrix(&self.source_rest);
        match &self.inverse {
            Inverse::Consistent(normals, gram) => self.with_normals(normals, gram, &wanted),
            Inverse::Linear(operator) => transposed_product(operator.as_ref(), wanted.as_ref(), BLOCK_ROWS),
        }
    }

    /// Gauss and Newton over vertices; normals follow on both sides (printed Eq. 4 drops them).
    fn with_normals(&self, normals: &DependentNormals, gram: &Mat<f64>, wanted: &Mat<f64>) -> Mat<f64> {
        let columns = self.values.len();
        let m = columns - normals.faces().len();
        let rest = matrix(&self.values);
        let projected = transposed_product(self.source.as_ref(), wanted.as_ref(), BLOCK_ROWS);
        let mut vertices: Vec<Point> = self.values[..m].to_vec();
        let size = vertices.iter().map(|p| norm(*p)).fold(0.0, f64::max);
        let mut change = Mat::<f64>::zeros(columns, 3);
        let mut error = f64::INFINITY;
        for _ in 0..MAX_STEPS {
            let left = &projected - gram * &change;
            let (hessian, pull) = equations(gram, &chain(normals, &vertices), &left, m);
            let Some(step) = solve_definite(hessian, pull) else { break };
            let mut share = 1.0;
            loop {
                let moved: Vec<Point> =
                    (0..m).map(|v| [0, 1, 2].map(|k| vertices[v][k] + share * step[(3 * v + k, 0)])).collect();
                let tried = cage_values(Some(normals), &moved) - &rest;
                let found = energy(gram, &projected, &tried);
                if found < error || share < 1e-3 {
                    if found < error {
                        (vertices, change, error) = (moved, tried, found);
                    }
                    break;
                }
                share *= 0.5;
            }
            let moved = (0..3 * m).map(|k| step[(k, 0)].abs()).fold(0.0, f64::max);
            if share * moved < TOLERANCE * size || share < 1e-3 {
                break;
            }
        }
        change
    }
}

/// Whether coordinates are defined outside a cage too.
fn everywhere(system: &dyn CoordinateSystem) -> bool {
    system.name() == SYSTEMS[0].name()
}

/// Coordinates of a model, all of it where they are defined.
fn coordinates(
    whose: &'static str,
    points: &[Point],
    cage: &Cage,
    system: &dyn CoordinateSystem,
) -> Result<Mat<f64>, TransferError> {
    let found = system.coordinates(cage, points, None);
    let found = found.map_err(|error| TransferError::Coordinates { whose, error })?;
    if !everywhere(system) && !found.outside.is_empty() {
        return Err(TransferError::Outside { whose, count: found.outside.len() });
    }
    Ok(found.phi)
}

/// Why the source cannot be expressed by a cage.
fn refused(error: PrepareError, source: &[Point], cage: &Cage, system: &dyn CoordinateSystem) -> TransferError {
    let count = if everywhere(system) { 0 } else { outside(cage.mesh(), source).len() };
    match error {
        PrepareError::NotReproduced { .. } if count > 0 => TransferError::Outside { whose: "source", count },
        PrepareError::TooFewPoints { points, unknowns } => TransferError::Rank { rank: points, unknowns },
        PrepareError::Coordinates(error) => TransferError::Coordinates { whose: "source", error },
        error => TransferError::Inversion(error),
    }
}

/// `‖Φ x − y‖² − ‖y‖²`, by `ΦᵀΦ` and `Φᵀ y`.
fn energy(gram: &Mat<f64>, projected: &Mat<f64>, x: &Mat<f64>) -> f64 {
    let image = gram * x;
    let each = |i: usize, k: usize| x[(i, k)] * (image[(i, k)] - 2.0 * projected[(i, k)]);
    (0..x.nrows()).map(|i| (0..3).map(|k| each(i, k)).sum::<f64>()).sum()
}

/// For each column of `Φ`, which vertices its value depends on, and how.
fn chain(dependent: &DependentNormals, vertices: &[Point]) -> Vec<Vec<(usize, [Point; 3])>> {
    const ONE: [Point; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut chain: Vec<Vec<(usize, [Point; 3])>> = (0..vertices.len()).map(|v| vec![(v, ONE)]).collect();
    for (face, [by_u, by_v]) in dependent.faces().iter().zip(dependent.derivatives(vertices)) {
        let [a, b, c] = face.map(|v| v as usize);
        let of_first = [0, 1, 2].map(|i| [0, 1, 2].map(|k| -by_u[i][k] - by_v[i][k]));
        chain.push(vec![(a, of_first), (b, by_u), (c, by_v)]);
    }
    chain
}

/// `Dᵀ (ΦᵀΦ ⊗ I) D` and `Dᵀ left`, over 3m unknowns.
fn equations(gram: &Mat<f64>, chain: &[Vec<(usize, [Point; 3])>], left: &Mat<f64>, m: usize) -> (Mat<f64>, Mat<f64>) {
    let columns = chain.len();
    // (ΦᵀΦ ⊗ I) D, by columns of vertices: 3 columns × 3m.
    let mut image = Mat::<f64>::zeros(3 * columns, 3 * m);
    for (j, terms) in chain.iter().enumerate() {
        for &(v, derivative) in terms {
            for i in 0..3 {
                for k in 0..3 {
                    let d = derivative[i][k];
                    if d != 0.0 {
                        for row in 0..columns {
                            image[(3 * row + i, 3 * v + k)] += gram[(row, j)] * d;
                        }
                    }
                }
            }
        }
    }
    let (mut hessian, mut pull) = (Mat::<f64>::zeros(3 * m, 3 * m), Mat::<f64>::zeros(3 * m, 1));
    for (j, terms) in chain.iter().enumerate() {
        for &(v, derivative) in terms {
            for i in 0..3 {
                for k in 0..3 {
                    let d = derivative[i][k];
                    if d == 0.0 {
                        continue;
                    }
                    pull[(3 * v + k, 0)] += d * left[(j, i)];
                    for column in 0..3 * m {
                        hessian[(3 * v + k, column)] += d * image[(3 * j + i, column)];
                    }
                }
            }
        }
    }
    let ridge = 1e-13 * (0..3 * m).map(|k| hessian[(k, k)]).sum::<f64>() / (3 * m) as f64;
    (0..3 * m).for_each(|k| hessian[(k, k)] += ridge);
    (hessian, pull)
}
