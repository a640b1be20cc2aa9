//! Coordinates for an analysis: of all points of a model, or of a sample of a very large one.

use super::checks::{
    check, coordinates_bytes, outside, reject_carriers, reject_far_points, reject_missed, reproduction_error,
};
use super::{Handles, PreparationReport, PrepareContext, PrepareError, SolverOptions, Step};
use crate::cage::Cage;
use crate::coordinates::{CageValues, CoordinateSystem, MeanValue, PointwiseCoordinates, for_each_chunk};
use crate::decode::Decoder;
use crate::morton::morton_order;
use cager_geometry::mesh::{Point, diagonal};
use faer::Mat;
use rayon::prelude::*;

/// Minimum number of points analysed per unknown.
const ROWS_PER_UNKNOWN: usize = 8;

/// Number of points with the largest coordinates of each column that are always analysed.
const NEAREST: usize = 8;

/// Coordinates for the analysis and for decoding.
pub(crate) struct AnalysedCoordinates {
    /// `Φ` of the points analysed, in the system that the inversion starts from.
    pub(crate) phi: Mat<f64>,
    /// The points analysed.
    pub(crate) points: Vec<Point>,
    /// Their indices in the model, ascending, where they are not all.
    pub(crate) sample: Option<Vec<u32>>,
    /// The decoder, where its coordinates are not `phi`.
    pub(crate) decoder: Option<Decoder>,
    /// Unknowns of the rest pose, m × 3.
    pub(crate) rest: Vec<Point>,
    /// Diagonal of the rest pose's bounding box.
    pub(crate) diagonal: f64,
    /// As far as it follows from the coordinates.
    pub(crate) preparation: PreparationReport,
}

impl AnalysedCoordinates {
    /// Of all points, or, for a solver with these handles, of a sample of a very large model.
    pub(crate) fn checked(
        (system, cage, points): (&dyn CoordinateSystem, &Cage, &[Point]),
        options: SolverOptions,
        handles: Option<Handles>,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let values = system.values(cage);
        let (m, columns) = (values.unknowns(), values.columns());
        check(points, m, options, context.memory)?;
        reject_far_points(cage, points)?;
        reject_carriers(system, cage, points.len())?;
        context.begin(Step::Coordinates)?;
        let copies = if handles.is_none() { 3 } else { 2 };
        let check_memory = |rows: usize| {
            let needed = coordinates_bytes(rows, columns, copies);
            let gigabytes = 1e-9 * needed as f64;
            let too_large = PrepareError::OutOfMemory { points: points.len(), unknowns: m, gigabytes };
            if needed > context.memory { Err(too_large) } else { Ok(()) }
        };
        let sampled = system
            .pointwise()
            .and_then(|pointwise| Some((pointwise, sample(points, m, handles, context.analysed_entries)?)));
        if let Some((pointwise, sample)) = sampled {
            check_memory(sample.len())?;
            return of_sample(values, pointwise, cage, points, sample, context.stores_coordinates);
        }
        check_memory(points.len())?;
        let found = system.coordinates(cage, points, None)?;
        let (mut phi, mut rest) = (found.phi, values.rest);
        let worst = reproduction_error(phi.as_ref(), &rest, cage, points);
        reject_missed(worst, cage, diagonal(points))?;
        let mut decoder = None;
        if values.dependent_normals.is_some() {
            decoder = Some(
                Decoder::new(phi.as_ref(), cage.vertices().len()).with_dependent_normals(values.dependent_normals),
            );
            drop(phi);
            phi = MeanValue.coordinates(cage, points, None)?.phi;
            rest.truncate(m);
        }
        let (refinement, plan) = (found.refinement, found.plan);
        let preparation = PreparationReport { refinement, plan, ..report(cage, points, &found.outside, worst.1) };
        let (points, diagonal) = (points.to_vec(), diagonal(points));
        Ok(Self { phi, points, sample: None, decoder, rest, diagonal, preparation })
    }
}

/// A sample of points spaced evenly along a space-filling curve, so that its density follows the
/// model's; `None` where all points are analysed. At least as many as the handles read, except with
/// [`Handles::All`], for which the sample stands for all.
fn sample(points: &[Point], unknowns: usize, handles: Option<Handles>, entries: usize) -> Option<Vec<u32>> {
    let read = match handles? {
        Handles::All => 0,
        handles => handles.count(points.len(), unknowns),
    };
    let count = (entries / unknowns).max(ROWS_PER_UNKNOWN * unknowns).max(read);
    if points.len() <= count {
        return None;
    }
    let order = morton_order(points);
    let mut sample: Vec<u32> = (0..count).map(|k| order[(2 * k + 1) * points.len() / (2 * count)]).collect();
    sample.sort_unstable();
    Some(sample)
}

fn of_sample(
    values: CageValues,
    pointwise: PointwiseCoordinates,
    cage: &Cage,
    points: &[Point],
    mut sample: Vec<u32>,
    keeps: bool,
) -> Result<AnalysedCoordinates, PrepareError> {
    let (unknowns, columns) = (values.unknowns(), values.columns());
    let mut rest = values.rest;
    let mut nearest: Vec<Vec<(f64, u32)>> = vec![Vec::new(); columns];
    let (mut worst, mut found_outside) = ((0, 0.0), Vec::new());
    for_each_chunk(pointwise, cage, points, columns, |first, part| {
        let here = &points[first..first + part.phi.nrows()];
        let (point, error) = reproduction_error(part.phi.as_ref(), &rest, cage, here);
        if error > worst.1 || error.is_nan() {
            worst = (first + point, error);
        }
        found_outside.extend(part.outside.iter().map(|&i| first as u32 + i));
        nearest.par_iter_mut().enumerate().for_each(|(j, nearest)| {
            for (i, x) in part.phi.col(j).iter().enumerate() {
                let least = nearest.last().map_or(0.0, |&(least, _)| least);
                if nearest.len() == NEAREST && x.abs() <= least {
                    continue;
                }
                let at = nearest.partition_point(|&(other, _)| other >= x.abs());
                nearest.insert(at, (x.abs(), (first + i) as u32));
                nearest.truncate(NEAREST);
            }
        });
    });
    // A part of the cage may be determined by very few points, which the sample could miss.
    sample.extend(nearest.iter().flatten().map(|&(_, point)| point));
    sample.sort_unstable();
    sample.dedup();
    reject_missed(worst, cage, diagonal(points))?;
    let decoder = if keeps { Decoder::with_stored_coordinates } else { Decoder::with_recomputed_coordinates }(
        pointwise, cage, points, columns,
    );
    let decoder = decoder.with_dependent_normals(values.dependent_normals);
    rest.truncate(unknowns);
    let sampled: Vec<Point> = sample.iter().map(|&i| points[i as usize]).collect();
    let sampled_cage = cage.of_points(sample.iter().copied());
    let start = if decoder.dependent_normals().is_some() {
        MeanValue.coordinates(&sampled_cage, &sampled, None)?
    } else {
        pointwise(&sampled_cage, &sampled)
    };
    Ok(AnalysedCoordinates {
        phi: start.phi,
        points: sampled,
        sample: Some(sample),
        decoder: Some(decoder),
        rest,
        diagonal: diagonal(points),
        preparation: report(cage, points, &found_outside, worst.1),
    })
}

/// What is known of points that were reported as outside, and of the largest `|Φ C_R − P_R|`.
fn report(cage: &Cage, points: &[Point], found_outside: &[u32], error: f64) -> PreparationReport {
    let diagonal = diagonal(points);
    let (outside, outside_distance) = outside(cage, points, found_outside, diagonal);
    PreparationReport {
        affine_reproduction_error: error / diagonal,
        condition_full: f64::NAN,
        condition_handles: f64::NAN,
        outside,
        outside_distance,
        ..PreparationReport::default()
    }
}
