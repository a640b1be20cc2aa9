//! The paper's transfer with the target's rigidity in the inversion: `min_C ‖A_s C − S₁‖² / (n d²) + μ ARAP(A_t C)`.

use crate::registration::surface_vertices;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_geometry::linalg::{cholesky, gram, mirrored, solve_cholesky, tall_product, transposed_product};
use cager_geometry::mesh::{Point, TriMesh};
use faer::Mat;
use glam::DVec3;

use super::public::PublicTransfer;
use crate::canonical::size;
use crate::deformation::graph::{CageGraph, edge_growth};
use crate::error::{MeshError, TransferError};
use crate::points::{matrix, welded_normals};
use crate::similarity::Similarity;

/// Moves frames of a source onto a target through a cage around both, the target as rigid as possible.
pub struct RigidTransfer {
    public: PublicTransfer,
    graph: CageGraph,
    triangles: Vec<[u32; 3]>,
    rigidity: f64,
    /// One over points and squared diagonal.
    unit: f64,
    factor: Mat<f64>,
}

/// The usual weight of the target's rigidity.
pub const RIGIDITY: f64 = 1e-2;
const ITERATIONS: usize = 25;
const RIDGE: f64 = 1e-12;
const BLOCK_ROWS: usize = 512;

impl RigidTransfer {
    /// As [`PublicTransfer::new`], with the weight μ of the target's rigidity. For coordinates of vertices alone.
    ///
    /// # Errors
    /// As [`PublicTransfer::new`].
    pub fn new(
        source: &TriMesh,
        target: &TriMesh,
        aligned: Similarity,
        cage: &Cage,
        system: &dyn CoordinateSystem,
        rigidity: f64,
    ) -> Result<Self, TransferError> {
        let public = PublicTransfer::new(&source.vertices, &target.vertices, aligned, cage, system)?;
        let normals = welded_normals(&target.vertices, &target.triangles);
        let graph = CageGraph::new(&target.vertices, &normals, &target.triangles, public.target.as_ref());
        let m = public.values.len();
        let size = aligned.scale * size(&surface_vertices(&source.vertices, &source.triangles));
        let unit = 1.0 / (source.vertices.len() as f64 * size * size);
        let mut sum = faer::Scale(unit) * mirrored(gram(public.source.as_ref(), BLOCK_ROWS))
            + faer::Scale(rigidity) * &graph.hessian;
        let ridge = RIDGE * (0..m).map(|k| sum[(k, k)]).sum::<f64>() / m as f64;
        (0..m).for_each(|k| sum[(k, k)] += ridge);
        let factor = cholesky(sum).ok_or(TransferError::Target(MeshError::Degenerate))?;
        Ok(Self { public, graph, triangles: source.triangles.clone(), rigidity, unit, factor })
    }

    /// The target as the source is in a frame.
    ///
    /// # Errors
    /// As [`PublicTransfer::pose`].
    pub fn pose(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, TransferError> {
        let (whole, pose) = self.public.moved(frame, points)?;
        let rest = matrix(&self.public.values);
        let mut change = self.public.change(&pose);
        // Edges grow with the source's, so that a source that is scaled scales the target.
        let growth = edge_growth(&self.public.source_rest, &pose, &self.triangles);
        let wanted = Mat::from_fn(pose.len(), 3, |i, k| pose[i][k] - self.public.source_rest[i][k]);
        for _ in 0..ITERATIONS {
            let positions: Vec<DVec3> = self.graph.positions((&rest + &change).as_ref());
            let turned: Vec<_> = self.graph.rotations(&positions).into_iter().map(|r| r * growth).collect();
            let left = &wanted - tall_product(self.public.source.as_ref(), change.as_ref());
            let mut step = transposed_product(self.public.source.as_ref(), left.as_ref(), BLOCK_ROWS);
            step *= faer::Scale(self.unit);
            step += faer::Scale(self.rigidity) * self.graph.pull(&positions, &turned);
            solve_cholesky(self.factor.as_ref(), &mut step);
            change += &step;
        }
        Ok(self.public.target_in(change.as_ref(), &whole))
    }
    /// As [`PublicTransfer::under`].
    ///
    /// # Errors
    /// As [`PublicTransfer::pose`].
    pub fn under(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, TransferError> {
        self.public.under(frame, points)
    }
}
