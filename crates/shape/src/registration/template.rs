//! A template made ready to be laid onto surfaces.

use cager_core::cage::Cage;
use cager_geometry::linalg::{gram, rows_of};
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use faer::{Mat, MatRef};
use glam::DVec3;

use super::dense_rows::DenseRows;
use super::graph::NodeGraph;
use super::rigidity::{Rigidity, StrainGraph};
use super::sampling::{SurfacePoint, sample_surface, surface_vertices};
use super::sparse_rows::SparseRows;
use crate::points::welded_normals;

/// Points of the surface that are matched.
const SAMPLES: usize = 3000;
/// Nodes between which the surface is held as rigid as possible.
const NODES: usize = 700;
/// Weight of the cage's own edges beside those between nodes.
const CAGE_WEIGHT: f64 = 0.1;

/// Why a template cannot be laid onto anything.
#[derive(Debug, thiserror::Error)]
pub enum RegistrationError {
    /// No triangles, or none with an area.
    #[error("the template has no surface: a mesh with faces is needed, not a point cloud")]
    NoSurface,
    /// Coordinates of another model or cage.
    #[error(
        "the coordinates are of {rows} points and {columns} cage vertices, the template has {points} and its cage {vertices}"
    )]
    OtherCoordinates {
        /// Rows of the coordinates.
        rows: usize,
        /// Columns of the coordinates.
        columns: usize,
        /// Points of the template.
        points: usize,
        /// Vertices of the cage.
        vertices: usize,
    },
}

/// A template, its cage and its coordinates.
pub struct Template {
    /// Length of the diagonal of the rest pose's surface.
    pub(crate) diagonal: f64,
    pub(crate) samples: Vec<Sample>,
    /// Coordinates of the corners of the samples' triangles.
    pub(crate) corner_coordinates: DenseRows,
    /// Coordinates of the samples, s × m.
    pub(crate) coordinates: DenseRows,
    pub(crate) sparse: SparseRows,
    /// `ΦᵀΦ / (s d²)` of the samples, its lower triangle.
    pub(crate) gram: Mat<f64>,
    pub(crate) rigidity: Rigidity,
}

/// A sample by the rows of its corners.
pub(crate) struct Sample {
    pub(crate) corners: [u32; 3],
    pub(crate) weights: [f64; 3],
}

/// Coordinates below this are left out where a product need not be exact.
const SPARSE_THRESHOLD: f64 = 3e-3;
/// Blocks of rows in which products are summed.
const BLOCK_ROWS: usize = 512;
/// What a vertex normal counts where nodes are spread, as a share of the diagonal.
const NODE_NORMAL: f64 = 0.1;

impl Template {
    /// From a rest pose, a cage around it and coordinates, n × m, one column a vertex of the cage;
    /// samples are drawn by `seed`. Vertices at the same place count as one.
    ///
    /// # Errors
    /// See [`RegistrationError`].
    pub fn new(rest: &TriMesh, cage: &Cage, phi: MatRef<'_, f64>, seed: u64) -> Result<Self, RegistrationError> {
        check_coordinates(&rest.vertices, cage, phi)?;
        let drawn = sample_surface(&rest.vertices, &rest.triangles, SAMPLES, seed);
        if drawn.is_empty() {
            return Err(RegistrationError::NoSurface);
        }
        let diagonal = diagonal(&surface_vertices(&rest.vertices, &rest.triangles));
        let corners_of = |sample: &SurfacePoint| rest.triangles[sample.face as usize];
        let mut used: Vec<u32> = drawn.iter().flat_map(corners_of).collect();
        used.sort_unstable();
        used.dedup();
        let row_of = |vertex: u32| used.partition_point(|&v| v < vertex) as u32;
        let samples: Vec<Sample> = drawn
            .iter()
            .map(|sample| Sample { corners: corners_of(sample).map(row_of), weights: sample.weights })
            .collect();
        let corner_coordinates = rows_of(phi, &used);
        let coordinates = Mat::from_fn(samples.len(), phi.ncols(), |i, j| {
            let Sample { corners, weights } = &samples[i];
            (0..3).map(|k| weights[k] * corner_coordinates[(corners[k] as usize, j)]).sum()
        });
        let mut scaled = gram(coordinates.as_ref(), BLOCK_ROWS);
        scaled *= faer::Scale(1.0 / (samples.len() as f64 * diagonal * diagonal));
        let rigidity = rigidity(rest, cage, phi, diagonal, seed);
        Ok(Self {
            diagonal,
            samples,
            corner_coordinates: DenseRows::new(corner_coordinates.as_ref()),
            sparse: SparseRows::new(coordinates.as_ref(), SPARSE_THRESHOLD),
            coordinates: DenseRows::new(coordinates.as_ref()),
            gram: scaled,
            rigidity,
        })
    }

    /// Samples in a cage: positions and unit normals.
    pub(crate) fn samples_in(&self, cage: &[DVec3]) -> (Vec<DVec3>, Vec<DVec3>) {
        let corners = self.corner_coordinates.times(cage);
        self.samples.iter().map(|sample| pose(sample, &corners)).unzip()
    }

    /// Length of the diagonal of the rest pose's surface.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }
}

/// Whether coordinates are of these points in this cage.
pub(crate) fn check_coordinates(points: &[Point], cage: &Cage, phi: MatRef<'_, f64>) -> Result<(), RegistrationError> {
    let ((rows, columns), points, vertices) = (phi.shape(), points.len(), cage.vertices().len());
    if (rows, columns) == (points, vertices) {
        return Ok(());
    }
    Err(RegistrationError::OtherCoordinates { rows, columns, points, vertices })
}

fn rigidity(rest: &TriMesh, cage: &Cage, phi: MatRef<'_, f64>, diagonal: f64, seed: u64) -> Rigidity {
    let normals = welded_normals(&rest.vertices, &rest.triangles);
    let NodeGraph { nodes, edges } =
        NodeGraph::new(&rest.vertices, &normals, &rest.triangles, NODES, NODE_NORMAL * diagonal, seed);
    let first = nodes.len();
    let cage_edges: Vec<[u32; 2]> = cage.edges().iter().map(|edge| edge.vertices.map(|v| v + first as u32)).collect();
    let coordinates = Mat::from_fn(first + phi.ncols(), phi.ncols(), |i, j| match i.checked_sub(first) {
        Some(vertex) => f64::from(u8::from(vertex == j)),
        None => phi[(nodes[i] as usize, j)],
    });
    let nodes = nodes.iter().map(|&node| rest.vertices[node as usize]).chain(cage.vertices().iter().copied());
    let at_rest: Vec<DVec3> = nodes.map(DVec3::from).collect();
    let graph = StrainGraph::new(&at_rest, &[(&edges, 1.0), (&cage_edges, CAGE_WEIGHT)], diagonal);
    Rigidity::new(graph, coordinates.as_ref(), SPARSE_THRESHOLD)
}

/// The corners of a sample, its position and its unit normal.
pub(crate) fn pose(sample: &Sample, corners: &[DVec3]) -> (DVec3, DVec3) {
    let [a, b, c] = sample.corners.map(|row| corners[row as usize]);
    let [u, v, w] = sample.weights;
    (u * a + v * b + w * c, (b - a).cross(c - a).normalize_or_zero())
}
