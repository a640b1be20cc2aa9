//! What preparing may take and reports.

use super::PrepareError;
use crate::coordinates::{ElementPlan, Refinement};
use crate::spectral::maxvol::Volume;
use cager_geometry::linalg::SparseMatrix;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// Results of the preparation.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct PreparationReport {
    /// Numerical rank of `Φ`, at most m.
    pub rank: usize,
    /// `max_i |Φ C_R − P_R|_i` over the rest diagonal.
    pub affine_reproduction_error: f64,
    /// Condition number of `Φ`, over its rank.
    pub condition_full: f64,
    /// Condition number of the rows read, over their rank; NaN of rows that are given later.
    pub condition_handles: f64,
    /// Singular values of the inverted matrix, descending: of `Φ` for spread handles and all
    /// points, otherwise of the rows read. Of 1,024 unknowns or more, few of them regularised,
    /// those between the first and the last are NaN. None where normal equations are solved.
    pub singular_values: Vec<f64>,
    /// Directions below [`WEAK_SINGULAR_VALUE`](crate::regularize::WEAK_SINGULAR_VALUE).
    pub weak: usize,
    /// How the handles of maximum volume were found; zeros where none were looked for.
    pub maxvol: Volume,
    /// Points outside the cage, ascending.
    pub outside: Vec<u32>,
    /// Largest distance of those to the cage, over the rest diagonal.
    pub outside_distance: f64,
    /// How the coordinates were refined, where they are a numerical solution.
    pub refinement: Option<Refinement>,
    /// The boundary elements on which they were solved, in that case.
    pub plan: Option<ElementPlan>,
}

/// A step of the preparation; they begin in this order.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Step {
    /// `Φ`.
    Coordinates,
    /// Which rows of it are read.
    Handles,
    /// The spectrum of what is inverted, beside the decoder where the first step left none.
    SingularValues,
    /// The regularisation, and what turns frames into cages; not of an analysis.
    Operator,
}

impl Step {
    /// What people who wait are told.
    pub fn name(self) -> &'static str {
        ["coordinates", "handles", "singular values", "operator"][self as usize]
    }
}

/// How to prepare a solver, apart from its options.
#[derive(Clone, Copy)]
pub struct PrepareContext<'a> {
    /// Δ of [`Regularizer::Matrix`](crate::regularize::Regularizer::Matrix).
    pub matrix: Option<&'a SparseMatrix>,
    /// Whether a decoder of very many points stores their coordinates or recomputes them.
    pub stores_coordinates: bool,
    /// Entries of `Φ` up to which all points are analysed; of a larger model, with more than eight
    /// points per unknown, a sample is.
    pub analysed_entries: usize,
    /// Most bytes that the coordinates, or the covariance of handles, may take.
    pub memory: u64,
    /// Called before each step begins; `Break` ends the preparation with [`PrepareError::Stopped`].
    pub before_step: &'a dyn Fn(Step) -> ControlFlow<()>,
}

impl Default for PrepareContext<'_> {
    fn default() -> Self {
        Self {
            matrix: None,
            stores_coordinates: true,
            analysed_entries: 1 << 25,
            memory: 16 << 30,
            before_step: &|_| ControlFlow::Continue(()),
        }
    }
}

impl PrepareContext<'_> {
    pub(crate) fn begin(&self, step: Step) -> Result<(), PrepareError> {
        match (self.before_step)(step) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(PrepareError::Stopped),
        }
    }
}
