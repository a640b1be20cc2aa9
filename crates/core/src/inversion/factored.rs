//! The linear inversion in factors, `C = V T (Uᵀ H)`, for applying many methods to the same frames: `Uᵀ H` is computed once per choice of handles,
//! and a method is the map T of singular directions.

use super::{HandleSystem, PrepareError, RegularizationTarget, Rows, Solver, SolverOptions};
use crate::regularize::SpectralMap;
use cager_geometry::linalg;
use cager_geometry::mesh::Point;
use faer::Mat;

/// A method of inversion for frames projected by a [`HandleSystem`]. Its cages are those of the solver with the same options, up to rounding.
#[derive(Clone, Debug)]
pub struct FactoredInversion(Form);

#[derive(Clone, Debug)]
enum Form {
    Factors(Factors),
    /// For dependent normals: the iteration amplifies rounding errors of its start, so that it uses the same solver as encoding.
    Solver(Box<Solver>),
}

#[derive(Clone, Debug)]
struct Factors {
    /// Factors of the leading k singular directions, each of which depends on itself alone.
    scales: Vec<f64>,
    /// The other singular directions as combinations of all, (m − k) × r.
    mixed: Mat<f64>,
    /// For each unknown, the sum of weights that translation equivariance requires minus the actual sum.
    missing: Vec<f64>,
    target: RegularizationTarget,
}

/// Frames projected to the left singular vectors: `Uᵀ H`, r × 3 for each frame.
#[derive(Clone, Debug)]
pub struct ProjectedFrames {
    values: Mat<f64>,
    /// Mean of the rows read of each frame.
    means: Vec<Point>,
}

impl From<Solver> for FactoredInversion {
    fn from(solver: Solver) -> Self {
        Self(Form::Solver(Box::new(solver)))
    }
}

impl FactoredInversion {
    pub(super) fn new(handle_system: &HandleSystem<'_>, map: &SpectralMap, target: RegularizationTarget) -> Self {
        let data = map.data.matrix();
        let (m, r) = data.shape();
        let is_scaled = |&i: &usize| i < r && (0..r).all(|j| i == j || data[(i, j)] == 0.0);
        let low = (0..m).take_while(is_scaled).count();
        let scales = (0..low).map(|i| data[(i, i)]).collect();
        let mixed = data.subrows(low, m - low).to_owned();
        let mut factors = Factors { scales, mixed, missing: vec![0.0; m], target };
        let ones = Mat::from_fn(handle_system.rows_read(), 1, |_, _| 1.0);
        let sums = factors.cages(
            handle_system,
            &handle_system.decomposition.project(handle_system.analysis.found.phi.as_ref(), ones.as_ref()),
        );
        let positions = handle_system.analysis.decoder.positions();
        factors.missing = (0..m).map(|j| if j < positions { 1.0 } else { 0.0 } - sums[(j, 0)]).collect();
        Self(Form::Factors(factors))
    }

    /// Whether each cage depends on that of the previous frame.
    pub fn follows_previous(&self) -> bool {
        match &self.0 {
            Form::Factors(factors) => factors.target.is_previous(),
            Form::Solver(solver) => solver.follows_previous(),
        }
    }
}

impl Factors {
    /// `V T x`.
    fn cages(&self, handle_system: &HandleSystem<'_>, x: &Mat<f64>) -> Mat<f64> {
        let low = self.scales.len();
        let mut q = Mat::zeros(self.missing.len(), x.ncols());
        for j in 0..x.ncols() {
            for (i, scale) in self.scales.iter().enumerate() {
                q[(i, j)] = scale * x[(i, j)];
            }
        }
        if self.mixed.nrows() > 0 {
            linalg::multiply(q.as_mut().subrows_mut(low, self.mixed.nrows()), self.mixed.as_ref(), x.as_ref());
        }
        handle_system.decomposition.directions.to_cage(q.as_ref())
    }

    fn invert(
        &self,
        handle_system: &HandleSystem<'_>,
        previous: Option<&[f32]>,
        projected: &ProjectedFrames,
    ) -> Vec<Vec<f32>> {
        let cages = self.cages(handle_system, &projected.values);
        let positions = handle_system.analysis.decoder.positions();
        let mut found: Vec<Vec<f32>> = Vec::with_capacity(projected.means.len());
        for (f, mean) in projected.means.iter().enumerate() {
            let row = |(j, share): (usize, &f64)| [0, 1, 2].map(|k| cages[(j, 3 * f + k)] + share * mean[k]);
            let mut cage: Vec<Point> = self.missing.iter().enumerate().map(row).collect();
            self.target.add(&mut cage, found.last().map(Vec::as_slice).or(previous), positions);
            found.push(cage.as_flattened().iter().map(|&x| x as f32).collect());
        }
        found
    }
}

impl HandleSystem<'_> {
    /// As [`Self::solver`], in factors: much cheaper to prepare, and cheaper to apply where many are applied to the same frames.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn factored(&self, options: SolverOptions) -> Result<FactoredInversion, PrepareError> {
        if self.analysis.decoder.dependent_normals().is_some() {
            return Ok(self.solver(options, None)?.into());
        }
        let (map, target, _) = self.parts(options, None)?;
        Ok(FactoredInversion::new(self, &map, target))
    }

    fn rows_read(&self) -> usize {
        if self.decomposition.reads_all { self.analysis.found.phi.nrows() } else { self.decomposition.handles.len() }
    }

    /// Projects frames, each n × 3 interleaved: all points of the model, also where a sample of them was analysed.
    ///
    /// # Panics
    /// Where a frame's length does not fit.
    pub fn project(&self, frames: &[&[f64]]) -> ProjectedFrames {
        let phi = self.analysis.found.phi.as_ref();
        assert!(frames.iter().all(|f| f.len() == 3 * self.decoder().points()), "every frame has every point");
        let count = self.rows_read();
        let sample = self.analysis.sample();
        let point = |i: usize| {
            let row = if self.decomposition.reads_all { i } else { self.decomposition.handles[i] as usize };
            sample.map_or(row, |sample| sample[row] as usize)
        };
        let read = Mat::from_fn(count, 3 * frames.len(), |i, j| frames[j / 3][3 * point(i) + j % 3]);
        let mean = |j: usize| read.col_as_slice(j).iter().sum::<f64>() / count as f64;
        let means = (0..frames.len()).map(|f| [0, 1, 2].map(|k| mean(3 * f + k))).collect();
        ProjectedFrames { values: self.decomposition.project(phi, read.as_ref()), means }
    }

    /// Cages, each m × 3 interleaved, of up to [`BATCH`](super::BATCH) frames that this system has projected, by one of its methods;
    /// `previous` as for [`Solver::invert`].
    ///
    /// # Panics
    /// Where frames and their projections differ in number, or more come than a batch holds.
    pub fn cages(
        &self,
        method: &FactoredInversion,
        previous: Option<&[f32]>,
        projected: &ProjectedFrames,
        frames: &[&[f64]],
    ) -> Vec<Vec<f32>> {
        assert_eq!(projected.means.len(), frames.len(), "one projection per frame");
        match &method.0 {
            Form::Factors(factors) => factors.invert(self, previous, projected),
            Form::Solver(solver) => {
                solver.invert(Rows::All, previous, frames).into_iter().map(|inverted| inverted.cage).collect()
            }
        }
    }
}
