//! Preparation of a solver: coordinates, handles, spectrum and operator.

use super::{Analysis, Handles, PrepareError, Solver, SolverOptions};
use crate::cage::Cage;
use crate::coordinates::{CoordinateSystem, ElementPlan, Refinement};
use crate::regularize::SparseMatrix;
use cager_geometry::linalg::tall_product;
use cager_geometry::mesh::{Point, diagonal, distance_to_surface, winding_number};
use cager_geometry::vector::norm;
use faer::{Mat, MatRef};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// Coordinates with a larger affine reproduction error, over the diagonal, are rejected.
const NOT_REPRODUCED: f64 = 1e-6;
/// Largest distance of a point from the cage, in diagonals of the cage. The coordinates of a point farther away are so large that, beside them, the
/// others may fall below [`WEAK_SINGULAR_VALUE`](crate::regularize::WEAK_SINGULAR_VALUE).
const FAR: f64 = 1e5;
/// Points outside by at most this fraction of the diagonal count as lying on the cage.
const ON_THE_CAGE: f64 = 1e-9;

/// Results of the preparation.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct PreparationReport {
    /// Numerical rank of `Φ`, at most m.
    pub rank: usize,
    /// `max_i |Φ C_R − P_R|_i` over the rest diagonal.
    pub affine_reproduction_error: f64,
    /// Condition number of `Φ`, over its rank.
    pub condition_full: f64,
    /// Condition number of the rows read, over their rank; of `Φ□` where every point is read.
    pub condition_handles: f64,
    /// Singular values of the inverted matrix, descending: of `Φ` for spread handles and where every point is read, otherwise of the rows read. Of
    /// 1,024 unknowns or more, of which few are regularised, only the first one and the last are computed; the others are NaN.
    pub singular_values: Vec<f64>,
    /// Swaps of maxvol after its start.
    pub swaps: usize,
    /// `ln |det Φ□|`.
    pub log_volume: f64,
    /// Largest `|B_ij|` of `Φ = B Φ□` after the last swap.
    pub max_entry: f64,
    /// Points outside the cage, ascending.
    pub outside: Vec<u32>,
    /// Largest distance of those to the cage, over the rest diagonal.
    pub outside_distance: f64,
    /// How the coordinates were refined, where they are a numerical solution.
    pub refinement: Option<Refinement>,
    /// The boundary elements on which they were solved, in that case.
    pub plan: Option<ElementPlan>,
    /// Seconds for the coordinates.
    pub coordinates_seconds: f64,
    /// Seconds for maxvol.
    pub maxvol_seconds: f64,
    /// Seconds for singular values, regularisation and the operator.
    pub svd_seconds: f64,
}

impl Solver {
    /// The checks of [`Self::prepare`] that need no computation; the covariance of handles may take `memory` bytes.
    ///
    /// # Errors
    /// See [`PrepareError`].
    pub fn check(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        memory: u64,
    ) -> Result<(), PrepareError> {
        check(points, system.values(cage).unknowns(), options, memory)?;
        reject_far_points(cage, points)?;
        Ok(system.check(cage, points)?)
    }

    /// Computes coordinates, handles, spectrum and operator. Runs on the current rayon pool; its result does not depend on it.
    ///
    /// # Errors
    /// See [`PrepareError`].
    pub fn prepare(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
    ) -> Result<Self, PrepareError> {
        Self::prepare_with(system, cage, points, options, &PrepareContext::default())
    }

    /// As [`Self::prepare`], with a custom matrix, progress and cancellation.
    ///
    /// # Errors
    /// See [`PrepareError`].
    pub fn prepare_with(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        // A matrix that does not fit the cage is refused before anything is computed.
        options.regularizer.delta(context.matrix, cage, system.values(cage).unknowns())?;
        let analysis = Analysis::for_solver(system, cage, points, options, context)?;
        context.next("operator")?;
        analysis.handle_system(options.handles)?.solver(options, context.matrix)
    }
}

/// How to prepare a solver, apart from its options.
#[derive(Clone, Copy)]
pub struct PrepareContext<'a> {
    /// Δ of [`Regularizer::Matrix`](crate::regularize::Regularizer::Matrix).
    pub matrix: Option<&'a SparseMatrix>,
    /// Whether the decoder of a model of very many points stores their coordinates, four bytes per point and column, or recomputes them at every use.
    pub stores_coordinates: bool,
    /// Largest number of entries of `Φ`, points × unknowns, up to which all points are analysed; of a model with more, a sample is. With eight points per
    /// unknown or fewer all of them always are.
    pub analysed_entries: usize,
    /// Most bytes that the coordinates, or the covariance of handles, may take; what needs more is refused before any of it is taken.
    pub memory: u64,
    /// Called with the name of each step before it begins; `Break` ends the preparation with [`PrepareError::Stopped`].
    pub next: &'a dyn Fn(&'static str) -> ControlFlow<()>,
}

impl Default for PrepareContext<'_> {
    fn default() -> Self {
        Self {
            matrix: None,
            stores_coordinates: true,
            analysed_entries: 1 << 25,
            memory: 16 << 30,
            next: &|_| ControlFlow::Continue(()),
        }
    }
}

impl PrepareContext<'_> {
    pub(super) fn next(&self, step: &'static str) -> Result<(), PrepareError> {
        match (self.next)(step) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(PrepareError::Stopped),
        }
    }
}

/// Rejects points so far from the cage that their coordinates are dominated by rounding.
///
/// # Errors
/// [`PrepareError::TooFar`].
pub fn reject_far_points(cage: &Cage, points: &[Point]) -> Result<(), PrepareError> {
    let [a, b, c] = cage.vertices()[0];
    for (point, p) in points.iter().enumerate() {
        let distance = norm([p[0] - a, p[1] - b, p[2] - c]) / cage.diagonal();
        if distance > FAR {
            return Err(PrepareError::TooFar { point, distance });
        }
    }
    Ok(())
}

/// Rejects a point whose coordinates are dominated by rounding. The smaller diagonal counts, since a stray point enlarges that of the model.
pub(super) fn reject_unreproduced_point(
    point: usize,
    error: f64,
    cage: &Cage,
    diagonal: f64,
) -> Result<(), PrepareError> {
    let relative = error / diagonal.min(cage.diagonal());
    if relative.is_nan() || relative > NOT_REPRODUCED {
        return Err(PrepareError::NotReproduced { point, error: relative });
    }
    Ok(())
}

pub(super) fn check(
    points: &[Point],
    unknowns: usize,
    options: SolverOptions,
    memory: u64,
) -> Result<(), PrepareError> {
    if let Some(point) = points.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
        return Err(PrepareError::NotFinite { point });
    }
    if points.len() < unknowns {
        return Err(PrepareError::TooFewPoints { points: points.len(), unknowns });
    }
    let diagonal = diagonal(points);
    if diagonal == 0.0 {
        return Err(PrepareError::NoExtent);
    }
    if !diagonal.is_finite() {
        return Err(PrepareError::TooLarge);
    }
    check_options(points.len(), unknowns, options, memory)
}

/// Checks options for so many points and unknowns, where the covariance of handles may take so many bytes of memory.
///
/// # Errors
/// Those variants of [`PrepareError`] that concern options.
pub fn check_options(points: usize, unknowns: usize, options: SolverOptions, memory: u64) -> Result<(), PrepareError> {
    if options.regularizer.has_threshold() && options.spectrum > unknowns {
        return Err(PrepareError::SpectrumTooLarge { spectrum: options.spectrum, unknowns });
    }
    if !(options.lambda.is_finite() && options.lambda >= 0.0) {
        return Err(PrepareError::BadLambda { lambda: options.lambda });
    }
    let count = options.handles.count(points, unknowns);
    if !(unknowns..=points).contains(&count) {
        return Err(PrepareError::HandleCount { count, unknowns, points });
    }
    // Their covariance, its factor, and what is solved with it.
    let needed = coordinates_bytes(count, 2 * count + 2 * unknowns, 1);
    if matches!(options.handles, Handles::Spread { .. }) && needed > memory {
        return Err(PrepareError::HandlesOutOfMemory { count, gigabytes: 1e-9 * needed as f64 });
    }
    Ok(())
}

/// Bytes of `copies` double-precision matrices n × m. Whoever knows what is free compares them to it: a system that promises more memory than it has
/// would grant any amount, and end the program where it is used.
pub fn coordinates_bytes(points: usize, unknowns: usize, copies: usize) -> u64 {
    [points, unknowns, copies].into_iter().fold(8, |bytes, factor| bytes.saturating_mul(factor as u64))
}

/// Of the points reported as outside, those that neither lie on the cage nor inside a self-overlapping part of it; and their largest distance to the
/// cage over the diagonal.
pub(super) fn outside(cage: &Cage, points: &[Point], found: &[u32], diagonal: f64) -> (Vec<u32>, f64) {
    let distance = |i: u32| distance_to_surface(cage.vertices(), &cage.mesh().triangles, points[i as usize]) / diagonal;
    let enclosed = |i: u32| winding_number(cage.vertices(), &cage.mesh().triangles, points[i as usize]) > 0.5;
    let measured: Vec<(u32, f64)> = found
        .par_iter()
        .map(|&i| (i, distance(i)))
        .filter(|&(i, distance)| distance > ON_THE_CAGE && !enclosed(i))
        .collect();
    let farthest = measured.iter().map(|&(_, distance)| distance).fold(0.0, f64::max);
    (measured.into_iter().map(|(i, _)| i).collect(), farthest)
}

/// The point of the largest `|Φ C − P|`, and that distance. Measured about the cage's first vertex: far from the origin the
/// sum itself would round.
pub(super) fn reproduction_error(
    phi: MatRef<'_, f64>,
    unknowns: &[Point],
    cage: &Cage,
    points: &[Point],
) -> (usize, f64) {
    let o = cage.vertices()[0];
    let positions = cage.vertices().len();
    let c = Mat::from_fn(unknowns.len(), 3, |i, k| unknowns[i][k] - if i < positions { o[k] } else { 0.0 });
    let product = tall_product(phi, c.as_ref());
    let error =
        |(i, p): (usize, &Point)| (i, (0..3).map(|k| (product[(i, k)] - (p[k] - o[k])).powi(2)).sum::<f64>().sqrt());
    points.iter().enumerate().map(error).fold((0, 0.0), |a, b| if b.1 > a.1 || b.1.is_nan() { b } else { a })
}
