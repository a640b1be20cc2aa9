//! The inversion in factors, for many methods on the same frames: `C = V T (Uᵀ H)`. A reading projects the frames once, to `Uᵀ H`; a
//! method is the map T of singular directions.

use super::{Pull, Reading, Solver};
use crate::dense;
use crate::mesh::Point;
use crate::regularize::SpectralMap;
use faer::Mat;

/// A method of inversion for frames that a [`Reading`] has projected. Its cages are those of the solver with the same options, up to rounding.
#[derive(Clone, Debug)]
pub struct Factored(Form);

#[derive(Clone, Debug)]
enum Form {
    Factors(Factors),
    /// Where normals are tied: iterations tell rounding errors of their start apart, so that they start where encoding does.
    Solver(Box<Solver>),
}

#[derive(Clone, Debug)]
struct Factors {
    /// The first singular directions are scaled by these.
    scales: Vec<f64>,
    /// The others are these combinations, (m − s) × r.
    mixed: Mat<f64>,
    /// What the weights of each unknown lack of their sum, which following a translation asks for.
    missing: Vec<f64>,
    pull: Pull,
}

/// Frames as a reading sees them: `Uᵀ H`, r × 3 for each frame.
#[derive(Clone, Debug)]
pub struct Projected {
    values: Mat<f64>,
    /// Mean of the rows read of each frame.
    means: Vec<Point>,
}

impl From<Solver> for Factored {
    fn from(solver: Solver) -> Self {
        Self(Form::Solver(Box::new(solver)))
    }
}

impl Factored {
    pub(super) fn new(reading: &Reading<'_>, map: &SpectralMap, pull: Pull) -> Self {
        let (m, r) = map.data.shape();
        let is_scaled = |&i: &usize| i < r && (0..r).all(|j| i == j || map.data[(i, j)] == 0.0);
        let low = (0..m).take_while(is_scaled).count();
        let scales = (0..low).map(|i| map.data[(i, i)]).collect();
        let mixed = map.data.subrows(low, m - low).to_owned();
        let mut factors = Factors { scales, mixed, missing: vec![0.0; m], pull };
        let ones = Mat::from_fn(reading.rows_read(), 1, |_, _| 1.0);
        let sums = factors.cages(reading, &reading.decomposed.project(reading.analysis.phi.as_ref(), ones.as_ref()));
        let positions = reading.analysis.decoder.positions();
        factors.missing = (0..m).map(|j| if j < positions { 1.0 } else { 0.0 } - sums[(j, 0)]).collect();
        Self(Form::Factors(factors))
    }

    /// Whether every cage depends on the previous frame's.
    pub fn follows_previous(&self) -> bool {
        match &self.0 {
            Form::Factors(factors) => factors.pull.is_previous(),
            Form::Solver(solver) => solver.follows_previous(),
        }
    }
}

impl Factors {
    /// `V T x`.
    fn cages(&self, reading: &Reading<'_>, x: &Mat<f64>) -> Mat<f64> {
        let low = self.scales.len();
        let mut q = Mat::zeros(self.missing.len(), x.ncols());
        for j in 0..x.ncols() {
            for (i, scale) in self.scales.iter().enumerate() {
                q[(i, j)] = scale * x[(i, j)];
            }
        }
        if self.mixed.nrows() > 0 {
            dense::multiply(q.as_mut().subrows_mut(low, self.mixed.nrows()), self.mixed.as_ref(), x.as_ref());
        }
        dense::product(reading.decomposed.v.as_ref(), q.as_ref())
    }

    fn invert(&self, reading: &Reading<'_>, previous: Option<&[f32]>, projected: &Projected) -> Vec<Vec<f32>> {
        let cages = self.cages(reading, &projected.values);
        let positions = reading.analysis.decoder.positions();
        let mut found: Vec<Vec<f32>> = Vec::with_capacity(projected.means.len());
        for (f, mean) in projected.means.iter().enumerate() {
            let row = |(j, share): (usize, &f64)| [0, 1, 2].map(|k| cages[(j, 3 * f + k)] + share * mean[k]);
            let mut cage: Vec<Point> = self.missing.iter().enumerate().map(row).collect();
            self.pull.add(&mut cage, found.last().map(Vec::as_slice).or(previous), positions);
            found.push(cage.as_flattened().iter().map(|&x| x as f32).collect());
        }
        found
    }
}

impl Reading<'_> {
    fn rows_read(&self) -> usize {
        if self.decomposed.reads_all { self.analysis.phi.nrows() } else { self.decomposed.handles.len() }
    }

    /// Projects frames, each n × 3 interleaved.
    ///
    /// # Panics
    /// Where a frame's length does not fit.
    pub fn project(&self, frames: &[&[f64]]) -> Projected {
        let phi = self.analysis.phi.as_ref();
        assert!(frames.iter().all(|f| f.len() == 3 * phi.nrows()), "every frame has every point");
        let count = self.rows_read();
        let point = |i: usize| if self.decomposed.reads_all { i } else { self.decomposed.handles[i] as usize };
        let read = Mat::from_fn(count, 3 * frames.len(), |i, j| frames[j / 3][3 * point(i) + j % 3]);
        let mean = |j: usize| read.col_as_slice(j).iter().sum::<f64>() / count as f64;
        let means = (0..frames.len()).map(|f| [0, 1, 2].map(|k| mean(3 * f + k))).collect();
        Projected { values: self.decomposed.project(phi, read.as_ref()), means }
    }

    /// Cages, each m × 3 interleaved, of up to [`BATCH`](super::BATCH) frames that this reading has projected, by a method of its own;
    /// `previous` as for [`Solver::invert_after`].
    ///
    /// # Panics
    /// Where frames and their projections differ in number, or more come than a batch holds.
    pub fn cages(
        &self,
        method: &Factored,
        previous: Option<&[f32]>,
        projected: &Projected,
        frames: &[&[f64]],
    ) -> Vec<Vec<f32>> {
        assert_eq!(projected.means.len(), frames.len(), "one projection per frame");
        match &method.0 {
            Form::Factors(factors) => factors.invert(self, previous, projected),
            Form::Solver(solver) => solver.invert_after(previous, frames),
        }
    }
}
