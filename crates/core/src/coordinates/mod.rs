//! Cage coordinates: points as linear combinations `P = Φ·Y` of a cage's rows Y, its vertices and,
//! for Green coordinates, its face normals.

mod error;
mod green;
mod harmonic;
pub(crate) mod layer;
mod mean_value;
mod normals;

pub use error::CoordinatesError;
pub use green::Green;
pub use harmonic::{ElementPlan, Harmonic};
pub use mean_value::MeanValue;
pub use normals::{DependentNormals, Derivative};

use crate::cage::Cage;
use crate::simd::LANES;
use cager_geometry::linalg::{BLOCK_ROWS, zeros};
use cager_geometry::mesh::Point;
use faer::{Mat, MatMut};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Coordinates of all points of a model.
#[derive(Clone, Debug)]
pub struct Coordinates {
    /// `Φ`, n × m, column-major.
    pub phi: Mat<f64>,
    /// Points that lie outside the cage, ascending.
    pub outside: Vec<u32>,
    /// How the solution was refined, for coordinates that are a numerical one.
    pub refinement: Option<Refinement>,
    /// What they were solved on, for coordinates that are a numerical solution.
    pub plan: Option<ElementPlan>,
}

/// Version of the coordinate systems, stored in containers because decoders recompute the
/// coordinates. It increases when a decoded point moves by more than 1e-7 of the diagonal; those
/// before then remain supported. 1 and 2 were never released.
pub const DEFINITION: u32 = 3;

/// How a numerical solution was refined. The names of fields are part of the report's format.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct Refinement {
    /// Boundary elements of the last solution.
    pub elements: usize,
    /// Solutions after the first.
    pub refinements: usize,
    /// Estimate of how far a coordinate is from the limit, at most 1e-3 but where a warning says
    /// otherwise: the largest of what the highest degrees change, what linear functions were
    /// corrected by, and the residual of the equations on the cage.
    #[serde(deserialize_with = "crate::numbers::number_or_null")]
    pub change: f64,
}

impl Refinement {
    /// Refining ends when it changes no coordinate of a point by more than this.
    pub const TOLERANCE: f64 = 1e-3;

    /// Whether [`Self::TOLERANCE`] was reached.
    pub fn reached(&self) -> bool {
        self.change <= Self::TOLERANCE
    }
}

/// Every coordinate system, the usual one first.
pub const SYSTEMS: [&dyn CoordinateSystem; 4] = [&MeanValue, &Harmonic, &Green::Consistent, &Green::Free];

/// The coordinate system with this name on the command line, in reports and in containers.
pub fn by_name(name: &str) -> Option<&'static dyn CoordinateSystem> {
    SYSTEMS.into_iter().find(|system| system.name() == name)
}

/// Computes the coordinates of points independently of each other.
pub type PointwiseCoordinates = fn(&Cage, &[Point]) -> Coordinates;

/// The values of a cage in a coordinate system: what `Φ` multiplies.
#[derive(Clone, Debug, PartialEq)]
pub struct CageValues {
    /// Those of the rest pose, columns × 3. The vertices come first.
    pub rest: Vec<Point>,
    /// How normals are computed from the vertices, where the vertices alone are unknown.
    pub dependent_normals: Option<DependentNormals>,
}

impl CageValues {
    /// Those of a system with one column per vertex.
    pub fn of_vertices(cage: &Cage) -> Self {
        Self { rest: cage.vertices().to_vec(), dependent_normals: None }
    }

    /// Columns of `Φ`.
    pub fn columns(&self) -> usize {
        self.rest.len()
    }

    /// Unknowns m of a cage: the rows stored per frame.
    pub fn unknowns(&self) -> usize {
        self.columns() - self.dependent_normals.as_ref().map_or(0, |normals| normals.faces().len())
    }
}

/// A system of cage coordinates. Each passes the suite in `crates/core/tests/conformance.rs`.
pub trait CoordinateSystem: Sync {
    /// The name on the command line, in reports and in containers.
    fn name(&self) -> &'static str;

    /// The values of a cage.
    fn values(&self, cage: &Cage) -> CageValues;

    /// `Φ` for these points. Rows sum to one; the threads of the pool do not matter. With a plan, a
    /// numerical solution is found on the elements of an earlier one.
    ///
    /// # Errors
    /// A cage or points for which the system is not defined; a plan of another cage or system.
    fn coordinates(
        &self,
        cage: &Cage,
        points: &[Point],
        plan: Option<&ElementPlan>,
    ) -> Result<Coordinates, CoordinatesError> {
        match (self.pointwise(), plan) {
            (Some(pointwise), None) => Ok(pointwise(cage, points)),
            _ => Err(CoordinatesError::BadPlan { system: self.name(), reason: "they have none" }),
        }
    }

    /// [`Self::coordinates`] where a row of `Φ` depends on its own point alone and always exists.
    fn pointwise(&self) -> Option<PointwiseCoordinates> {
        None
    }

    /// Bytes that computing takes beside `Φ`, at the most, for any points; of a refused plan none.
    fn working_bytes(&self, _cage: &Cage, _plan: Option<&ElementPlan>) -> u64 {
        0
    }

    /// The inexpensive checks of [`Self::coordinates`].
    ///
    /// # Errors
    /// Points for which the system is not defined.
    fn check(&self, _cage: &Cage, _points: &[Point]) -> Result<(), CoordinatesError> {
        Ok(())
    }
}

/// Points that one parallel task computes: a few lane groups.
const TASK_POINTS: usize = 8 * LANES;

/// Coordinates whose rows depend on their own points alone, task by task: `work` fills the rows
/// from that of the given point on, and returns the points that lie outside.
fn pointwise_coordinates<S>(
    points: usize,
    columns: usize,
    scratch: impl Fn() -> S + Send + Sync,
    work: impl Fn(usize, MatMut<'_, f64>, &mut S) -> Vec<u32> + Send + Sync,
) -> Coordinates {
    let mut phi = zeros(points, columns);
    let tasks = phi.as_mut().par_row_chunks_mut(TASK_POINTS).enumerate();
    let outside = tasks.map_init(scratch, |scratch, (task, rows)| work(task * TASK_POINTS, rows, scratch));
    let outside = outside.flatten_iter().collect();
    Coordinates { phi, outside, refinement: None, plan: None }
}

/// Approximate memory of one chunk of coordinates, in both precisions together.
const CHUNK_BYTES: usize = 96 << 20;

/// Computes coordinates chunk by chunk, in whole blocks; `work` gets each one's first point.
pub(crate) fn for_each_chunk(
    pointwise: PointwiseCoordinates,
    cage: &Cage,
    points: &[Point],
    columns: usize,
    mut work: impl FnMut(usize, &Coordinates),
) {
    let size = (CHUNK_BYTES / (12 * columns)).max(1).next_multiple_of(BLOCK_ROWS);
    for (part, points) in points.chunks(size).enumerate() {
        let first = part * size;
        let cage = cage.of_points(first as u32..(first + points.len()) as u32);
        work(first, &pointwise(&cage, points));
    }
}
