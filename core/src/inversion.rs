//! The solver: prepared once for a rest pose and its cage, then one matrix product per batch of frames.

use crate::cage::Cage;
use crate::coordinates::CoordinateSystem;
use crate::decode::Decoder;
use crate::dense;
use crate::mesh::{Point, diagonal, distance_to_surface, norm};
use crate::regularize::{Regularizer, Spectrum, cage_laplacian, spectral_map};
use crate::simd::zeros;
use crate::spectrum::{RANK_TOLERANCE, RowBasis, deficient_basis, row_basis};
use crate::svd::{self, Svd};
use faer::reborrow::Reborrow;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use std::time::Instant;

mod error;
mod parts;

pub use error::PrepareError;
pub use parts::SolverParts;

/// Most frames of one matrix product.
pub const BATCH: usize = 16;
/// Beyond this affine reproduction error, over the diagonal, coordinates are of no use.
const NOT_REPRODUCED: f64 = 1e-6;
/// Farther from the cage, in its diagonals, one point outweighs all others by the inverse of [`WEAK`](crate::regularize::WEAK).
const FAR: f64 = 1e5;
/// Points outside by less than this fraction of the diagonal lie on the cage.
const ON_THE_CAGE: f64 = 1e-9;
/// Rows of one block where a tall matrix is multiplied in blocks.
const BLOCK_ROWS: usize = 1024;

/// Which points the inversion reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Handles {
    /// As many as unknowns, of maximum volume: stable, and a frame costs microseconds.
    #[default]
    MaxVol,
    /// Every point: least squares, the lowest error.
    All,
}

impl Handles {
    /// The name on the command line, in reports and in containers.
    pub fn name(self) -> &'static str {
        match self {
            Self::MaxVol => "maxvol",
            Self::All => "all",
        }
    }
}

/// Choices for a solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Points read.
    pub handles: Handles,
    /// Treatment of the unstable end of the spectrum.
    pub regularizer: Regularizer,
    /// Spectrum threshold s: how many of the last singular directions are regularised.
    pub spectrum: usize,
    /// Weight λ of the regularisation; α for Tikhonov.
    pub lambda: f64,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self { handles: Handles::MaxVol, regularizer: Regularizer::Laplacian, spectrum: 20, lambda: 1.0 }
    }
}

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

/// A prepared inversion: `C_t = R · H_t`.
#[derive(Clone, Debug)]
pub struct Solver {
    handles: Vec<u32>,
    reads_all: bool,
    /// `Rᵀ`, K × m, column-major: one row per point read; zero columns follow up to a whole tile.
    operator: Mat<f64>,
    decoder: Decoder,
    diagonal: f64,
    preparation: Preparation,
}

impl Solver {
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

    /// What preparing found out.
    pub fn preparation(&self) -> &Preparation {
        &self.preparation
    }

    /// Rows of maximum volume. With [`Handles::All`] they only condition the solve, and every point is read.
    pub fn handles(&self) -> &[u32] {
        &self.handles
    }

    /// Diagonal of the rest pose's bounding box: the unit of errors.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// Cages back to positions.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Bytes the prepared solver holds.
    pub fn size_bytes(&self) -> usize {
        let phi = self.decoder.coordinates();
        4 * phi.nrows() * phi.ncols() + 8 * self.operator.nrows() * self.operator.ncols() + 4 * self.handles.len()
    }

    /// Cages, each m × 3 interleaved, of up to [`BATCH`] frames, each n × 3 interleaved.
    ///
    /// The bits of a cage depend on its frame alone, not on the other frames of the batch.
    ///
    /// # Panics
    /// Where a frame's length does not fit, or more frames come than a batch holds.
    pub fn invert<T: Copy + Into<f64>>(&self, frames: &[&[T]]) -> Vec<Vec<f32>> {
        assert!(frames.iter().all(|f| f.len() == 3 * self.decoder.points()), "every frame has every point");
        self.solve(frames, |row| if self.reads_all { row } else { self.handles[row] as usize })
    }

    /// As [`Self::invert`] of frames of which only the rows of [`Self::handles`] are there, K × 3 interleaved: the same bits.
    ///
    /// # Panics
    /// As [`Self::invert`], and where the solver reads every point.
    pub fn invert_handles<T: Copy + Into<f64>>(&self, frames: &[&[T]]) -> Vec<Vec<f32>> {
        assert!(!self.reads_all, "handles are not enough for least squares over all points");
        assert!(frames.iter().all(|f| f.len() == 3 * self.handles.len()), "every frame has every handle");
        self.solve(frames, |row| row)
    }

    fn solve<T: Copy + Into<f64>>(&self, frames: &[&[T]], point_of_row: impl Fn(usize) -> usize) -> Vec<Vec<f32>> {
        let (columns, padded) = self.operator.shape();
        let m = self.decoder.unknowns();
        let width = product_columns(frames.len());
        let mut cages = Mat::<f64>::zeros(padded, width);
        let mut block = Mat::<f64>::zeros(BLOCK_ROWS.min(columns), width);
        let mut first = 0;
        while first < columns {
            let rows = BLOCK_ROWS.min(columns - first);
            for (f, frame) in frames.iter().enumerate() {
                for i in 0..rows {
                    let point = point_of_row(first + i);
                    for k in 0..3 {
                        block[(i, 3 * f + k)] = frame[3 * point + k].into();
                    }
                }
            }
            faer::linalg::matmul::matmul(
                cages.as_mut(),
                if first == 0 { Accum::Replace } else { Accum::Add },
                self.operator.as_ref().subrows(first, rows).transpose(),
                block.as_ref().subrows(0, rows),
                1.0,
                Par::Seq,
            );
            first += rows;
        }
        (0..frames.len())
            .map(|f| (0..m).flat_map(|j| [0, 1, 2].map(|k| cages[(j, 3 * f + k)] as f32)).collect())
            .collect()
    }
}

/// Columns of the product of a batch of frames.
///
/// Few frames cost less in a narrow product. Widths are whole tiles of the kernels, which sum over the unknowns in the same
/// order in each: a test holds them to it.
///
/// # Panics
/// Where more frames come than a batch holds.
pub(crate) fn product_columns(frames: usize) -> usize {
    assert!(frames <= BATCH, "at most {BATCH} frames in a batch");
    3 * [BATCH / 4, BATCH / 2].into_iter().find(|&width| frames <= width).unwrap_or(BATCH)
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

/// Decompositions of the handles and of all points.
struct Spectra {
    handles: Svd,
    full_sigma: Vec<f64>,
    /// Of `R Φ□`, where every point is read.
    full: Option<Svd>,
}

impl Spectra {
    fn of(basis: &RowBasis, read: Handles) -> Result<Self, PrepareError> {
        let (handles, full) = rayon::join(
            || svd::svd(basis.square.as_ref()),
            || {
                let compressed = basis.compressed()?;
                match read {
                    Handles::MaxVol => Some((svd::singular_values(compressed.as_ref())?, None)),
                    Handles::All => svd::svd(compressed.as_ref()).map(|svd| (svd.sigma.clone(), Some(svd))),
                }
            },
        );
        let failed = |what| PrepareError::NoSolution { what };
        let handles = handles.ok_or(failed("singular value decomposition of the handles"))?;
        let (full_sigma, full) = full.ok_or(failed("singular value decomposition of the coordinates"))?;
        Ok(Self { handles, full_sigma, full })
    }
}

/// The whole inversion as one matrix, transposed: r × m for handles of maximum volume, n × m for all points.
fn operator(
    phi: MatRef<'_, f64>,
    basis: &RowBasis,
    spectra: Spectra,
    delta: MatRef<'_, f64>,
    options: SolverOptions,
    preparation: &mut Preparation,
) -> Result<Mat<f64>, PrepareError> {
    let failed = |what| PrepareError::NoSolution { what };
    let rank = basis.rank;
    // B carries the rounding of Φ□⁻¹, which least squares over all points feels beyond this condition.
    const GRAM_IS_SAFE: f64 = 1e6;
    let directly = options.handles == Handles::All && preparation.condition_full > GRAM_IS_SAFE;
    let decomposition = match (directly, spectra.full) {
        (true, _) => svd::svd(phi).ok_or(failed("singular value decomposition of the coordinates"))?,
        (false, Some(full)) => full,
        (false, None) => spectra.handles,
    };
    let Svd { u, sigma, v } = decomposition;
    let spectrum = Spectrum { sigma: &sigma[..rank], v: v.as_ref(), delta };
    let map = spectral_map(&spectrum, options.regularizer, options.spectrum, options.lambda)
        .ok_or(failed("regularised solve"))?;
    preparation.singular_values = sigma;
    let to_cage = dense::product(v.as_ref(), map.as_ref());
    let u = u.as_ref().subcols(0, rank);
    if directly {
        return Ok(tall_product(u, to_cage.transpose()));
    }
    let mut inverse = dense::product(u, to_cage.transpose());
    if options.handles == Handles::MaxVol {
        return Ok(inverse);
    }
    // Φ = B Φ□ and BᵀB = RᵀR: the left singular vectors of Φ are B R⁻¹ U.
    let factor = basis.gram_factor().ok_or(failed("factorisation of the handles"))?;
    faer::linalg::triangular_solve::solve_upper_triangular_in_place(factor.as_ref(), inverse.as_mut(), Par::Seq);
    let to_points = dense::product(basis.to_basis.as_ref(), inverse.as_ref());
    Ok(tall_product(phi, to_points.as_ref()))
}

/// Makes cages follow a translation of the frame exactly, also where regularisation by itself would not: the rows of R that
/// give positions sum to one, those that give directions to zero. Takes and gives `Rᵀ`.
fn keep_translations(mut operator: Mat<f64>, positions: usize) -> Mat<f64> {
    let read = operator.nrows();
    for j in 0..operator.ncols() {
        let column = operator.col_mut(j);
        let sum: f64 = column.rb().iter().sum();
        let share = (if j < positions { 1.0 } else { 0.0 } - sum) / read as f64;
        for x in column.iter_mut() {
            *x += share;
        }
    }
    operator
}

/// Zero columns up to a whole tile, see [`product_columns`].
fn with_whole_tiles(mut operator: Mat<f64>) -> Mat<f64> {
    operator.resize_with(operator.nrows(), operator.ncols().next_multiple_of(dense::WHOLE_ROWS), |_, _| 0.0);
    operator
}

/// `Φ · X` in parallel row blocks whose bits do not depend on the threads.
pub(crate) fn tall_product(phi: MatRef<'_, f64>, x: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = zeros(phi.nrows(), x.ncols());
    out.as_mut().par_row_chunks_mut(BLOCK_ROWS).enumerate().for_each(|(block, rows)| {
        let count = rows.nrows();
        dense::multiply(rows, phi.subrows(block * BLOCK_ROWS, count), x);
    });
    out
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
