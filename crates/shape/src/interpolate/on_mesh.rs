//! Shapes between poses of a model.

use cager_geometry::mesh::{Point, TriMesh};
use glam::{DMat3, DQuat, DVec3};

use super::features::{Features, Refinement};
use super::poses::{Seams, check_poses};
use super::rotations::{Ways, polar};
use crate::deformation::gradients::Gradients;
use crate::deformation::poisson::{Poisson, offsets};
use crate::error::ShapeError;
use crate::points::{mean, vectors};

/// The shapes that weights of some poses name.
pub struct ShapeSpace {
    poisson: Poisson,
    poses: Vec<Pose>,
    refinement: Option<Refinement>,
    /// Lengths and angles of each pose; none without refinement.
    features: Vec<Features>,
    seams: Seams,
}

/// A pose against the first one.
struct Pose {
    /// By triangle: rotation vector and stretch.
    turns: Vec<DVec3>,
    stretches: Vec<DMat3>,
    /// Of ties, before the rotation of the triangle that carries them.
    offsets: Vec<DVec3>,
    mean: DVec3,
}

/// Weights sum to one but for this.
const MAX_SUM_ERROR: f64 = 1e-6;

impl ShapeSpace {
    /// Of two poses or more of one mesh, measured against the first. Rotations go on from each pose
    /// to the next one, less than half a turn where a part is turned least.
    ///
    /// # Errors
    /// See [`ShapeError`].
    pub fn new(triangles: &[[u32; 3]], poses: &[Vec<Point>]) -> Result<Self, ShapeError> {
        check_poses(poses)?;
        let first = TriMesh { vertices: poses[0].clone(), triangles: triangles.to_vec() };
        let seams = Seams::new(poses);
        let poisson = Poisson::joined(&first, seams.rows())?;
        let rows = poisson.rows();
        let gradients = Gradients::new(&first);
        let joined: Vec<[u32; 3]> = triangles.iter().map(|&t| rows.of(t)).collect();
        let refinement = Refinement::new(&rows.gathered(poisson.rest()), &joined, poisson.ties());
        let ways = Ways::new(&gradients, poisson.ties());
        let unturned = vec![DVec3::ZERO; triangles.len()];
        let (mut all, mut features): (Vec<Pose>, Vec<Features>) = (Vec::new(), Vec::new());
        for points in poses {
            let points = vectors(points);
            let at = rows.gathered(&points);
            let (rotations, stretches) = polar(&gradients.of(&points));
            let turns = ways.unwrapped(&rotations, all.last().map_or(&unturned, |before| &before.turns));
            let ties = poisson.ties().iter().zip(offsets(poisson.ties(), &at));
            let offsets = ties.map(|(tie, offset)| rotations[tie.triangle as usize].transpose() * offset).collect();
            all.push(Pose { turns, stretches, offsets, mean: mean(&points) });
            if let Some(refinement) = &refinement {
                let found = refinement.features(&at);
                features.push(match features.last() {
                    Some(before) => found.after(before),
                    None => found,
                });
            }
        }
        Ok(Self { poisson, poses: all, refinement, features, seams })
    }

    /// Number of poses.
    pub fn poses(&self) -> usize {
        self.poses.len()
    }

    /// The shape with these weights, one a pose; beyond 0 and 1 they lead beyond the poses.
    /// Triangles take weighted means of rotation vectors and stretches, the mesh follows in least
    /// squares, and is then, up to 100,000 vertices, brought to the means of edge lengths and
    /// dihedral angles (Fröhlich and Botsch 2011).
    ///
    /// # Errors
    /// Another number of weights than of poses, weights that are not finite or do not sum to one.
    pub fn shape(&self, weights: &[f64]) -> Result<Vec<Point>, ShapeError> {
        let mut shape = self.unrefined(weights)?;
        if let Some(refinement) = &self.refinement {
            let start = self.poisson.rows().gathered(&shape);
            let refined = refinement.refine(start.clone(), &Features::mean(&self.features, weights));
            let moved: Vec<DVec3> = refined.iter().zip(&start).map(|(to, from)| *to - *from).collect();
            shape.iter_mut().zip(self.poisson.rows().spread(&moved)).for_each(|(p, by)| *p += by);
        }
        self.seams.part(&mut shape, weights);
        let wanted: DVec3 = weights.iter().zip(&self.poses).map(|(&w, pose)| w * pose.mean).sum();
        let by = wanted - mean(&shape);
        Ok(shape.iter().map(|p| (*p + by).to_array()).collect())
    }

    fn unrefined(&self, weights: &[f64]) -> Result<Vec<DVec3>, ShapeError> {
        self.check(weights)?;
        let poses = || weights.iter().zip(&self.poses);
        let turn = |t: usize| -> DMat3 {
            DMat3::from_quat(DQuat::from_scaled_axis(poses().map(|(&w, pose)| w * pose.turns[t]).sum()))
        };
        let stretch = |t: usize| -> DMat3 { poses().map(|(&w, pose)| pose.stretches[t] * w).sum() };
        let gradients: Vec<DMat3> = (0..self.poses[0].turns.len()).map(|t| turn(t) * stretch(t)).collect();
        let offset = |k: usize| -> DVec3 { poses().map(|(&w, pose)| w * pose.offsets[k]).sum() };
        let ties = self.poisson.ties().iter().enumerate();
        let offsets: Vec<DVec3> = ties.map(|(k, tie)| turn(tie.triangle as usize) * offset(k)).collect();
        Ok(self.poisson.solve_tied(&gradients, &offsets))
    }

    fn check(&self, weights: &[f64]) -> Result<(), ShapeError> {
        if weights.len() != self.poses() {
            return Err(ShapeError::OtherWeights { weights: weights.len(), poses: self.poses() });
        }
        if let Some(pose) = weights.iter().position(|weight| !weight.is_finite()) {
            return Err(ShapeError::Weight(pose));
        }
        let sum: f64 = weights.iter().sum();
        if (sum - 1.0).abs() > MAX_SUM_ERROR {
            return Err(ShapeError::Sum(sum));
        }
        Ok(())
    }
}
