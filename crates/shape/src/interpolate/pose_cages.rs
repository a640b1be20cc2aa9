//! The cages of poses of a model.

use cager_core::cage::Cage;
use cager_geometry::linalg::{
    cholesky, gram, mirrored, nearest_rotation, solve_cholesky, tall_product, transposed_product,
};
use cager_geometry::mesh::Point;
use faer::{Mat, Scale};
use glam::{DMat3, DVec3};

use super::poses::check_poses;
use crate::error::ShapeError;
use crate::points::{matrix, outer, plain, points_in, row_points, vectors};
use crate::similarity::Similarity;

/// Poses of a model in a cage.
pub(super) struct PoseCages {
    phi: Mat<f64>,
    /// The cage of each pose.
    pub(super) cages: Vec<Vec<Point>>,
    /// By how much the model in its cage misses each pose.
    missed: Vec<Vec<DVec3>>,
}

/// Weight of the cage's own shape beside the error of the points, for what these hardly determine.
const STIFFNESS: f64 = 1e-4;
const ITERATIONS: usize = 6;
const BLOCK_ROWS: usize = 512;

impl PoseCages {
    /// The cages C of poses P, by `min ‖Φ C − P‖² / n + λ ‖L C − R δ‖² / m`: the Laplacian `δ = L
    /// C₀` at rest, turned with its surroundings, decides where points do not (Sorkine et al.
    /// 2004). Φ is n × m, one column a vertex.
    pub(super) fn new(cage: &Cage, phi: Mat<f64>, poses: &[Vec<Point>]) -> Result<Self, ShapeError> {
        check_poses(poses)?;
        let ((n, m), vertices) = (phi.shape(), cage.vertices().len());
        if m != vertices {
            return Err(ShapeError::Columns { columns: m, vertices });
        }
        if let Some(pose) = poses.iter().position(|points| points.len() != n) {
            return Err(ShapeError::OtherPoints { pose, points: poses[pose].len(), expected: n });
        }
        let none = ShapeError::Rank { rank: n, unknowns: m };
        let scale = m as f64 / n as f64;
        let rings = Rings::new(cage);
        let laplacian = rings.laplacian();
        let shape = mirrored(gram(laplacian.as_ref(), BLOCK_ROWS));
        let sum = Scale(scale) * mirrored(gram(phi.as_ref(), BLOCK_ROWS)) + Scale(STIFFNESS) * shape;
        let factor = if n < m { None } else { cholesky(sum) }.ok_or(none)?;
        let rest: Vec<Point> = points_in(phi.as_ref(), matrix(cage.vertices()).as_ref());
        let (mut cages, mut missed) = (Vec::new(), Vec::new());
        for pose in poses {
            let start = Similarity::of_points(&rest, pose, true).apply_all(cage.vertices());
            let (start_matrix, start) = (matrix(&start), vectors(&start));
            let left = matrix(pose) - tall_product(phi.as_ref(), start_matrix.as_ref());
            let by_points = Scale(scale) * transposed_product(phi.as_ref(), left.as_ref(), BLOCK_ROWS);
            let mut found = start.clone();
            for _ in 0..ITERATIONS {
                let turned = rings.turned(&start, &found);
                let mut change = &by_points + Scale(STIFFNESS) * (laplacian.transpose() * turned);
                solve_cholesky(factor.as_ref(), &mut change);
                found = row_points((&start_matrix + change).as_ref());
            }
            let found = plain(&found);
            let reached: Vec<DVec3> = points_in(phi.as_ref(), matrix(&found).as_ref());
            missed.push(pose.iter().zip(reached).map(|(p, q)| DVec3::from(*p) - q).collect());
            cages.push(found);
        }
        Ok(Self { phi, cages, missed })
    }

    /// The model in a cage between or beyond poses, with what their own cages miss of these.
    pub(super) fn model(&self, cage: &[Point], weights: &[(usize, f64)]) -> Vec<Point> {
        let mut model: Vec<DVec3> = points_in(self.phi.as_ref(), matrix(cage).as_ref());
        for &(pose, weight) in weights {
            model.iter_mut().zip(&self.missed[pose]).for_each(|(p, missed)| *p += weight * *missed);
        }
        plain(&model)
    }
}

/// The vertices around each vertex of a cage.
struct Rings(Vec<Vec<u32>>);

impl Rings {
    fn new(cage: &Cage) -> Self {
        let mut rings = vec![Vec::new(); cage.vertices().len()];
        for edge in cage.edges() {
            let [a, b] = edge.vertices;
            rings[a as usize].push(b);
            rings[b as usize].push(a);
        }
        Self(rings)
    }

    /// `L = I − D⁻¹A`, m × m.
    fn laplacian(&self) -> Mat<f64> {
        let mut laplacian = Mat::identity(self.0.len(), self.0.len());
        for (i, ring) in self.0.iter().enumerate() {
            ring.iter().for_each(|&j| laplacian[(i, j as usize)] -= 1.0 / ring.len() as f64);
        }
        laplacian
    }

    /// `R δ − δ`, with the rotation of each vertex's surroundings, m × 3.
    fn turned(&self, start: &[DVec3], now: &[DVec3]) -> Mat<f64> {
        let change = |(i, ring): (usize, &Vec<u32>)| {
            let (mut sum, mut delta) = (DMat3::ZERO, DVec3::ZERO);
            for &j in ring {
                let (e, d) = (start[i] - start[j as usize], now[i] - now[j as usize]);
                sum += outer(d, e);
                delta += e / ring.len() as f64;
            }
            (nearest_rotation(sum) * delta - delta).to_array()
        };
        matrix(&self.0.iter().enumerate().map(change).collect::<Vec<Point>>())
    }
}
