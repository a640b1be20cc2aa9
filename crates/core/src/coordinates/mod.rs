//! Cage coordinates: each point as a linear combination `P = Φ·Y` of the rows Y of a cage, its vertices and, for Green coordinates, its face normals.

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
use cager_geometry::linalg::zeros;
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

/// Version of the definition of the coordinate systems, stored in containers because decoders recompute the coordinates. It increases when a change
/// moves a decoded point by more than 1e-7 of the diagonal; those before it then remain supported. 1 and 2 were never released.
pub const DEFINITION: u32 = 3;

/// How a numerical solution was refined. Stored in reports: the names of fields are part of the format.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct Refinement {
    /// Boundary elements of the last solution.
    pub elements: usize,
    /// Solutions after the first.
    pub refinements: usize,
    /// An estimate of how far a coordinate of a point is from the limit, at most 1e-3 but where a warning says otherwise: the largest of what the
    /// highest degrees of the elements change of one, what one was corrected by to make linear functions exact, and the residual that the iteration
    /// left of the equations on the cage, those of unknowns that it left out and of damped ones as well.
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
    /// How normals are computed from the vertices, for systems in which the vertices alone are unknown.
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

    /// Unknowns m of a cage: rows stored per frame. Equal to the number of columns unless some values are functions of others.
    pub fn unknowns(&self) -> usize {
        self.columns() - self.dependent_normals.as_ref().map_or(0, |normals| normals.faces().len())
    }
}

/// A system of cage coordinates. Every implementation passes the suite in `crates/core/tests/conformance.rs`.
pub trait CoordinateSystem: Sync {
    /// The name on the command line, in reports and in containers.
    fn name(&self) -> &'static str;

    /// The values of a cage.
    fn values(&self, cage: &Cage) -> CageValues;

    /// `Φ` for these points. Rows sum to one; runs on the current rayon pool; the result does not depend on it. With a plan, a numerical solution is
    /// found on the elements of an earlier one instead of elements chosen for these points; with the earlier points the bits are the same.
    ///
    /// # Errors
    /// A cage or points for which the system is not defined; a plan made for another cage or another system.
    fn coordinates(
        &self,
        cage: &Cage,
        points: &[Point],
        plan: Option<&ElementPlan>,
    ) -> Result<Coordinates, CoordinatesError>;

    /// [`Self::coordinates`] for systems in which a row of `Φ` depends on its own point alone and always exists, so that `Φ` can be computed in
    /// chunks.
    fn pointwise(&self) -> Option<PointwiseCoordinates> {
        None
    }

    /// Bytes that computing takes beside `Φ`, at the most, for any points in this cage; with a plan, on its elements, nothing where it is refused.
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

/// Coordinates whose rows depend on their own points alone, task by task: `work` fills the rows from that of the given point on, and returns the points of
/// them that lie outside.
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

/// Refuses a plan for a system that is no numerical solution.
fn refuse_plan(system: &'static str, plan: Option<&ElementPlan>) -> Result<(), CoordinatesError> {
    plan.map_or(Ok(()), |_| Err(CoordinatesError::BadPlan { system, reason: "they have none" }))
}
