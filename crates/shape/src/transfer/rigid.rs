//! The target's rigidity in the inversion: `min_C ‖A_s C − S₁‖² / (n d²) + μ ARAP(A_t C)`.

use crate::registration::surface_vertices;
use cager_geometry::linalg::{cholesky, gram, mirrored, solve_cholesky, tall_product, transposed_product};
use cager_geometry::mesh::TriMesh;
use faer::Mat;
use glam::DVec3;

use crate::canonical::size;
use crate::deformation::graph::{CageGraph, edge_growth};
use crate::error::{MeshError, TransferError};
use crate::points::{matrix, welded_normals};

/// What holds the target rigid while the cage is found for a pose of the source.
pub(super) struct Rigidity {
    graph: CageGraph,
    /// Of the source.
    triangles: Vec<[u32; 3]>,
    weight: f64,
    /// One over points and squared diagonal.
    unit: f64,
    factor: Mat<f64>,
}

/// The usual weight of the target's rigidity.
pub const RIGIDITY: f64 = 1e-2;
const ITERATIONS: usize = 25;
const RIDGE: f64 = 1e-12;
const BLOCK_ROWS: usize = 512;

impl Rigidity {
    /// Of a target with this weight, and a source scaled by `scale`; both with coordinates of
    /// vertices.
    pub(super) fn new(
        (source, source_phi): (&TriMesh, &Mat<f64>),
        (target, target_phi): (&TriMesh, &Mat<f64>),
        scale: f64,
        weight: f64,
    ) -> Result<Self, TransferError> {
        let normals = welded_normals(&target.vertices, &target.triangles);
        let graph = CageGraph::new(&target.vertices, &normals, &target.triangles, target_phi.as_ref());
        let m = source_phi.ncols();
        let size = scale * size(&surface_vertices(&source.vertices, &source.triangles));
        let unit = 1.0 / (source.vertices.len() as f64 * size * size);
        let mut sum =
            faer::Scale(unit) * mirrored(gram(source_phi.as_ref(), BLOCK_ROWS)) + faer::Scale(weight) * &graph.hessian;
        let ridge = RIDGE * (0..m).map(|k| sum[(k, k)]).sum::<f64>() / m as f64;
        (0..m).for_each(|k| sum[(k, k)] += ridge);
        let factor = cholesky(sum).ok_or(TransferError::Target(MeshError::Degenerate))?;
        Ok(Self { graph, triangles: source.triangles.clone(), weight, unit, factor })
    }

    /// The change of the cage's values, from `change` on, that takes the source to `pose`.
    pub(super) fn refined(
        &self,
        phi: &Mat<f64>,
        [rest, pose]: [&[DVec3]; 2],
        at_rest: &Mat<f64>,
        mut change: Mat<f64>,
    ) -> Mat<f64> {
        // Edges grow with the source's, so that a source that is scaled scales the target.
        let growth = edge_growth(rest, pose, &self.triangles);
        let wanted = matrix(pose) - matrix(rest);
        for _ in 0..ITERATIONS {
            let positions = self.graph.positions((at_rest + &change).as_ref());
            let turned: Vec<_> = self.graph.graph.rotations(&positions).into_iter().map(|r| r * growth).collect();
            let left = &wanted - tall_product(phi.as_ref(), change.as_ref());
            let mut step = transposed_product(phi.as_ref(), left.as_ref(), BLOCK_ROWS);
            step *= faer::Scale(self.unit);
            step += faer::Scale(self.weight) * self.graph.pull(&positions, &turned);
            solve_cholesky(self.factor.as_ref(), &mut step);
            change += &step;
        }
        change
    }
}
