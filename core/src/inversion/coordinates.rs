//! The coordinates of a model, as an analysis takes them: of all its points, or where these are many, of some.

use super::PrepareError;
use super::operator::Wanted;
use super::prepare::{coordinates_fit, outside, refuse_unreproduced, reproduction_error};
use crate::cage::Cage;
use crate::coordinates::{ByPoint, CoordinateSystem, ElementPlan, MeanValue, Refinement};
use crate::decode::{Decoder, in_parts};
use crate::handles::Handles;
use crate::handles::farthest::along_curve;
use crate::mesh::{Point, diagonal};
use faer::Mat;
use rayon::prelude::*;

/// Entries of the largest `Φ` that is analysed as a whole, unless it has fewer than [`ROWS_PER_UNKNOWN`].
const ENTRIES: usize = 1 << 25;
/// Points that are analysed for each unknown at the least.
const ROWS_PER_UNKNOWN: usize = 8;

/// Points of the largest coordinates of each column that are analysed whatever else is.
const NEAREST: usize = 8;

/// What decoding and analysing begin with.
pub(super) struct Found {
    /// `Φ` of the points analysed, in the system that the inversion starts from.
    pub(super) phi: Mat<f64>,
    /// The points analysed, ascending, where they are not all.
    pub(super) sample: Option<Vec<u32>>,
    /// Where it is another matrix than `phi`.
    pub(super) decoder: Option<Decoder>,
    /// Unknowns of the rest pose, m × 3.
    pub(super) rest: Vec<Point>,
    /// Largest `|Φ C_R − P_R|`.
    pub(super) error: f64,
    /// Points outside, and the largest distance of one over the diagonal.
    pub(super) outside: (Vec<u32>, f64),
    pub(super) refinement: Option<Refinement>,
    pub(super) plan: Option<ElementPlan>,
}

/// As many points along a space-filling curve as are analysed of a model, where they are not all: at least those that are read. They are
/// as dense as its points are.
fn sample(points: &[Point], unknowns: usize, wanted: Wanted) -> Option<Vec<u32>> {
    let read = match wanted {
        Wanted::Everything => return None,
        Wanted::For(Handles::All) => 0,
        Wanted::For(handles) => handles.count(points.len(), unknowns),
    };
    let count = (ENTRIES / unknowns).max(ROWS_PER_UNKNOWN * unknowns).max(read);
    if points.len() <= count {
        return None;
    }
    let order = along_curve(points);
    let mut sample: Vec<u32> = (0..count).map(|k| order[(2 * k + 1) * points.len() / (2 * count)]).collect();
    sample.sort_unstable();
    Some(sample)
}

/// Coordinates of all points, or of a sample of them where not everything is wanted. Of a sample, the decoder `keeps` its coordinates or
/// computes them anew.
pub(super) fn coordinates(
    system: &dyn CoordinateSystem,
    cage: &Cage,
    points: &[Point],
    wanted: Wanted,
    keeps: bool,
) -> Result<Found, PrepareError> {
    let everything = wanted == Wanted::Everything;
    let copies = if everything { 3 } else { 2 };
    let (m, columns) = (system.unknowns(cage), system.columns(cage));
    let too_large = |rows: usize| {
        let gigabytes = (4 + 8 * copies) as f64 * 1e-9 * rows as f64 * columns as f64;
        PrepareError::OutOfMemory { points: points.len(), unknowns: m, gigabytes }
    };
    let sampled = system.by_point().and_then(|by_point| Some((by_point, sample(points, m, wanted)?)));
    if let Some((by_point, sample)) = sampled {
        if !coordinates_fit(sample.len(), columns, copies) {
            return Err(too_large(sample.len()));
        }
        return of_sample(system, by_point, cage, points, sample, keeps);
    }
    if !coordinates_fit(points.len(), columns, copies) {
        return Err(too_large(points.len()));
    }
    let found = system.coordinates(cage, points)?;
    let (mut phi, mut rest) = (found.phi, system.rest_values(cage));
    let worst = reproduction_error(phi.as_ref(), &rest, cage, points);
    refuse_unreproduced(worst.0, worst.1, cage, diagonal(points))?;
    let tied = system.tied_normals(cage);
    let mut decoder = None;
    if tied.is_some() {
        decoder = Some(Decoder::new(phi.as_ref(), cage.vertices().len()).with_tied_normals(tied));
        drop(phi);
        phi = MeanValue.coordinates(cage, points)?.phi;
        rest.truncate(m);
    }
    let outside = outside(cage, points, &found.outside, diagonal(points));
    let (refinement, plan) = (found.refinement, found.plan);
    Ok(Found { phi, sample: None, decoder, rest, error: worst.1, outside, refinement, plan })
}

fn of_sample(
    system: &dyn CoordinateSystem,
    by_point: ByPoint,
    cage: &Cage,
    points: &[Point],
    mut sample: Vec<u32>,
    keeps: bool,
) -> Result<Found, PrepareError> {
    let (columns, mut rest) = (system.columns(cage), system.rest_values(cage));
    let mut nearest: Vec<Vec<(f64, u32)>> = vec![Vec::new(); columns];
    let (mut worst, mut found_outside) = ((0, 0.0), Vec::new());
    in_parts(by_point, cage, points, columns, |first, part| {
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
    // Parts of the model with few points may have a part of the cage to themselves.
    sample.extend(nearest.iter().flatten().map(|&(_, point)| point));
    sample.sort_unstable();
    sample.dedup();
    refuse_unreproduced(worst.0, worst.1, cage, diagonal(points))?;
    let decoder = if keeps { Decoder::keeping } else { Decoder::computing }(by_point, cage, points, columns);
    let decoder = decoder.with_tied_normals(system.tied_normals(cage));
    rest.truncate(system.unknowns(cage));
    let sampled: Vec<Point> = sample.iter().map(|&i| points[i as usize]).collect();
    let start = if decoder.tied_normals().is_some() {
        MeanValue.coordinates(cage, &sampled)?
    } else {
        by_point(cage, &sampled)
    };
    let outside = outside(cage, points, &found_outside, diagonal(points));
    Ok(Found {
        phi: start.phi,
        sample: Some(sample),
        decoder: Some(decoder),
        rest,
        error: worst.1,
        outside,
        refinement: None,
        plan: None,
    })
}
