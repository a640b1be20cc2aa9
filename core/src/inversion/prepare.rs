//! Preparing: coordinates, handles, spectrum and operator.

use super::operator::{Spectra, keep_translations, operator, tall_product, with_whole_tiles};
use super::{Handles, PrepareError, Solver, SolverOptions};
use crate::cage::Cage;
use crate::coordinates::CoordinateSystem;
use crate::decode::Decoder;
use crate::mesh::{Point, diagonal, distance_to_surface, norm};
use crate::regularize::cage_laplacian;
use crate::spectrum::{RANK_TOLERANCE, deficient_basis, row_basis};
use faer::{Mat, MatRef};
use rayon::prelude::*;
use std::time::Instant;

/// Beyond this affine reproduction error, over the diagonal, coordinates are of no use.
const NOT_REPRODUCED: f64 = 1e-6;
/// Farther from the cage, in its diagonals, one point outweighs all others by the inverse of [`WEAK`](crate::regularize::WEAK).
const FAR: f64 = 1e5;
/// Points outside by less than this fraction of the diagonal lie on the cage.
const ON_THE_CAGE: f64 = 1e-9;

/// What preparing found out.
#[derive(Clone, Debug, Default)]
pub struct Preparation {
    /// Numerical rank of `Φ`, at most m.
    pub rank: usize,
    /// `max_i |Φ C_R − P_R|_i` over the rest diagonal.
    pub affine_reproduction_error: f64,
    /// Condition number of `Φ`, over its rank.
    pub condition_full: f64,
    /// Condition number of `Φ□`, over its rank.
    pub condition_handles: f64,
    /// Singular values of the inverted matrix, descending: `Φ□`, or `Φ` where every point is read.
    pub singular_values: Vec<f64>,
    /// Swaps of maxvol after its start.
    pub swaps: usize,
    /// `ln |det Φ□|`.
    pub log_volume: f64,
    /// Largest `|B_ij|` after the last swap.
    pub max_entry: f64,
    /// Points outside the cage, ascending.
    pub outside: Vec<u32>,
    /// Largest distance of those to the cage, over the rest diagonal.
    pub outside_distance: f64,
    /// Seconds for the coordinates.
    pub coordinates_seconds: f64,
    /// Seconds for maxvol.
    pub maxvol_seconds: f64,
    /// Seconds for singular values, regularisation and the operator.
    pub svd_seconds: f64,
}

impl Solver {
    /// What [`Self::prepare`] would refuse before it computes anything.
    ///
    /// # Errors
    /// See [`PrepareError`].
    pub fn check(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
    ) -> Result<(), PrepareError> {
        check(points, system.unknowns(cage), options)?;
        refuse_far_points(cage, points)
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
        let m = system.unknowns(cage);
        check(points, m, options)?;
        let diagonal = diagonal(points);
        let clock = Instant::now();
        if !coordinates_fit(points.len(), m, 2) {
            let gigabytes = 20e-9 * points.len() as f64 * m as f64;
            return Err(PrepareError::OutOfMemory { points: points.len(), unknowns: m, gigabytes });
        }
        refuse_far_points(cage, points)?;
        let coordinates = system.coordinates(cage, points)?;
        let phi = coordinates.phi.as_ref();
        let (point, error) = reproduction_error(phi, &system.rest_unknowns(cage), cage, points);
        let reproduction = error / diagonal;
        // A stray point enlarges the model's own diagonal, not the cage's.
        let relative = error / diagonal.min(cage.diagonal());
        if relative.is_nan() || relative > NOT_REPRODUCED {
            return Err(PrepareError::NotReproduced { point, error: relative });
        }
        let (outside, outside_distance) = outside(cage, points, &coordinates.outside, diagonal);
        let mut preparation = Preparation {
            affine_reproduction_error: reproduction,
            outside_distance,
            outside,
            coordinates_seconds: clock.elapsed().as_secs_f64(),
            ..Preparation::default()
        };

        let clock = Instant::now();
        let no_handles = PrepareError::NoSolution { what: "choice of handles" };
        let mut basis = row_basis(phi).ok_or(no_handles.clone())?;
        preparation.maxvol_seconds = clock.elapsed().as_secs_f64();

        let clock = Instant::now();
        let mut spectra = Spectra::of(&basis, options.handles)?;
        if basis.rank == m && spectra.full_sigma[m - 1] <= RANK_TOLERANCE * spectra.full_sigma[0] {
            basis = deficient_basis(phi).ok_or(no_handles)?;
            spectra = Spectra::of(&basis, options.handles)?;
        }
        let rank = basis.rank;
        preparation.rank = rank;
        preparation.swaps = basis.handles.swaps;
        preparation.log_volume = basis.handles.log_volume;
        preparation.max_entry = basis.handles.max_entry;
        preparation.condition_handles = spectra.handles.sigma[0] / spectra.handles.sigma[rank - 1];
        preparation.condition_full = spectra.full_sigma[0] / spectra.full_sigma[rank - 1];
        let operator = operator(phi, &basis, spectra, cage_laplacian(cage).as_ref(), options, &mut preparation)?;
        let operator = with_whole_tiles(keep_translations(operator, cage.vertices().len()));
        preparation.svd_seconds = clock.elapsed().as_secs_f64();

        let clock = Instant::now();
        let decoder = Decoder::new(phi, cage.vertices().len());
        preparation.coordinates_seconds += clock.elapsed().as_secs_f64();
        Ok(Self {
            handles: basis.handles.rows,
            reads_all: options.handles == Handles::All,
            operator,
            decoder,
            diagonal,
            preparation,
        })
    }
}

fn refuse_far_points(cage: &Cage, points: &[Point]) -> Result<(), PrepareError> {
    let [a, b, c] = cage.vertices()[0];
    for (point, p) in points.iter().enumerate() {
        let distance = norm([p[0] - a, p[1] - b, p[2] - c]) / cage.diagonal();
        if distance > FAR {
            return Err(PrepareError::TooFar { point, distance });
        }
    }
    Ok(())
}

fn check(points: &[Point], unknowns: usize, options: SolverOptions) -> Result<(), PrepareError> {
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
    if options.spectrum > unknowns {
        return Err(PrepareError::SpectrumTooLarge { spectrum: options.spectrum, unknowns });
    }
    if !(options.lambda.is_finite() && options.lambda >= 0.0) {
        return Err(PrepareError::BadLambda { lambda: options.lambda });
    }
    Ok(())
}

/// Whether the system grants memory for `copies` double-precision matrices n × m.
pub fn coordinates_fit(points: usize, unknowns: usize, copies: usize) -> bool {
    let Some(entries) = points.checked_mul(unknowns).and_then(|n| n.checked_mul(copies)) else { return false };
    Vec::<f64>::new().try_reserve_exact(entries).is_ok()
}

/// Of the points found outside, those that do not lie on the cage, and the largest distance over the diagonal.
fn outside(cage: &Cage, points: &[Point], found: &[u32], diagonal: f64) -> (Vec<u32>, f64) {
    let distance = |i: u32| distance_to_surface(cage.vertices(), &cage.mesh().triangles, points[i as usize]) / diagonal;
    let measured: Vec<(u32, f64)> =
        found.par_iter().map(|&i| (i, distance(i))).filter(|&(_, distance)| distance > ON_THE_CAGE).collect();
    let farthest = measured.iter().map(|&(_, distance)| distance).fold(0.0, f64::max);
    (measured.into_iter().map(|(i, _)| i).collect(), farthest)
}

/// The point of the largest `|Φ C − P|`, and that distance. Measured about the cage's first vertex: far from the origin the
/// sum itself would round.
fn reproduction_error(phi: MatRef<'_, f64>, unknowns: &[Point], cage: &Cage, points: &[Point]) -> (usize, f64) {
    let o = cage.vertices()[0];
    let positions = cage.vertices().len();
    let c = Mat::from_fn(unknowns.len(), 3, |i, k| unknowns[i][k] - if i < positions { o[k] } else { 0.0 });
    let product = tall_product(phi, c.as_ref());
    let error =
        |(i, p): (usize, &Point)| (i, (0..3).map(|k| (product[(i, k)] - (p[k] - o[k])).powi(2)).sum::<f64>().sqrt());
    points.iter().enumerate().map(error).fold((0, 0.0), |a, b| if b.1 > a.1 || b.1.is_nan() { b } else { a })
}
