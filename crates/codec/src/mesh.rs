//! A mesh at rest: its polygons, and its positions on a grid.

use crate::connectivity::{WalkedFaces, decode_faces};
use crate::error::{Error, Result};
use crate::grid::{Grid, decode_positions, encode_positions};
use crate::surface::CodedSurface;
use cager_geometry::mesh::{Model, Point, Polygons};

/// A mesh as bytes, and what they decode to: the same polygons in another order.
#[derive(Clone, Debug)]
pub struct CodedMesh {
    /// What the bytes decode to.
    pub mesh: Model,
    /// The polygons, for [`decode_faces`].
    pub faces: Vec<u8>,
    /// The positions, for [`decode_positions`].
    pub positions: Vec<u8>,
    /// What lies on the faces, where anything does.
    pub surface: Option<CodedSurface>,
}

impl CodedMesh {
    /// Of a mesh, positions in steps of `step`.
    ///
    /// # Errors
    /// No points, or positions too far apart to be counted in these steps.
    pub fn new(mesh: &Model, step: f64) -> Result<Self> {
        let grid = Self::grid(mesh, step)?;
        let mut walked = WalkedFaces::new(&mesh.faces, mesh.points.len());
        let ordered = std::mem::take(&mut walked.faces);
        let (faces, positions) = rayon::join(|| walked.into_bytes(), || encode_positions(grid, &ordered, &mesh.points));
        let surface = CodedSurface::new(mesh, &ordered);
        Ok(Self::of(mesh, grid, ordered, (faces, positions, surface)))
    }

    /// The same mesh with positions in other steps.
    pub fn in_steps(&self, mesh: &Model, step: f64) -> Result<Self> {
        let grid = Self::grid(mesh, step)?;
        let positions = encode_positions(grid, &self.mesh.faces, &mesh.points);
        let kept = (self.faces.clone(), positions, self.surface.clone());
        Ok(Self::of(mesh, grid, self.mesh.faces.clone(), kept))
    }

    fn grid(mesh: &Model, step: f64) -> Result<Grid> {
        Grid::new(&mesh.points, step).ok_or(Error::Unsuitable("positions too far apart for this step"))
    }

    fn of(
        mesh: &Model,
        grid: Grid,
        ordered: Polygons,
        (faces, positions, surface): (Vec<u8>, Vec<u8>, Option<CodedSurface>),
    ) -> Self {
        let points: Vec<Point> = mesh.points.iter().map(|&point| grid.nearest(point)).collect();
        let count = points.len();
        debug_assert_eq!(decode_faces(&faces, count, ordered.len(), ordered.indices().len()), Ok(ordered.clone()));
        debug_assert_eq!(decode_positions(&positions, &ordered, count), Ok(points.clone()));
        Self {
            mesh: Model { points, faces: ordered, colors: mesh.colors.clone(), ..Model::default() },
            faces,
            positions,
            surface,
        }
    }

    /// Bytes that its polygons, its positions and what lies on its faces take; colours of points are not coded.
    pub fn bytes(&self) -> usize {
        self.faces.len() + self.positions.len() + self.surface.as_ref().map_or(0, |surface| surface.bytes.len())
    }
}
