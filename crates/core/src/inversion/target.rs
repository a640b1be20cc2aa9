//! Regularisation towards a reference cage: what it adds to `R · H`; and row sums corrected so that
//! cages follow a translation exactly, despite truncation, damping or rounding.

use cager_geometry::mesh::Point;
use faer::Mat;
use faer::reborrow::Reborrow;

/// The cage towards which solutions are regularised, as its contribution to the solution.
#[derive(Clone, Debug)]
pub enum RegularizationTarget {
    /// Nothing.
    None,
    /// Towards the rest cage: `c₀` of `C = R·H + c₀`, m × 3.
    Constant(Mat<f64>),
    /// Towards the previous frame's cage: S of `C_t = R·H_t + S·C_{t−1}`.
    Previous {
        /// S, m × m; the entries of every row that multiply vertices sum to zero.
        operator: Mat<f64>,
        /// The first frame's predecessor, m × 3 interleaved: the rest cage.
        first: Vec<f32>,
    },
}

impl RegularizationTarget {
    /// Towards the previous frame's cage by this linear map of it, and at first the rest cage.
    pub(crate) fn towards_previous(to_cage: Mat<f64>, rest: &[Point], positions: usize) -> Self {
        let first = rest.iter().flatten().map(|&x| x as f32).collect();
        Self::Previous { operator: with_zero_row_sums(to_cage, positions), first }
    }

    /// Whether frames depend on their predecessors.
    pub fn is_previous(&self) -> bool {
        matches!(self, Self::Previous { .. })
    }

    /// Whether its shapes match a solver with so many unknowns.
    pub(super) fn fits(&self, unknowns: usize) -> bool {
        match self {
            Self::None => true,
            Self::Constant(offset) => offset.shape() == (unknowns, 3),
            Self::Previous { operator, first } => {
                operator.shape() == (unknowns, unknowns) && first.len() == 3 * unknowns
            }
        }
    }

    pub(super) fn size_bytes(&self) -> usize {
        match self {
            Self::None => 0,
            Self::Constant(offset) => 8 * offset.nrows() * offset.ncols(),
            Self::Previous { operator, first } => 8 * operator.nrows() * operator.ncols() + 4 * first.len(),
        }
    }

    /// Adds its contribution to a cage, m × 3, given the previous frame's cage.
    pub(super) fn add(&self, cage: &mut [[f64; 3]], previous: Option<&[f32]>, positions: usize) {
        match self {
            Self::None => {}
            Self::Constant(offset) => {
                for (j, row) in cage.iter_mut().enumerate() {
                    for k in 0..3 {
                        row[k] += offset[(j, k)];
                    }
                }
            }
            Self::Previous { operator, first } => {
                let previous = previous.unwrap_or(first).as_chunks::<3>().0;
                let origin = previous[0].map(f64::from);
                for (j, row) in previous.iter().enumerate() {
                    let x = [0, 1, 2].map(|k| f64::from(row[k]) - if j < positions { origin[k] } else { 0.0 });
                    for (row, &weight) in cage.iter_mut().zip(operator.col_as_slice(j)) {
                        for k in 0..3 {
                            row[k] += weight * x[k];
                        }
                    }
                }
            }
        }
    }
}

/// Makes the rows of R for vertices sum to one, those for normals to zero. Takes and returns `Rᵀ`.
pub(crate) fn with_unit_row_sums(mut operator: Mat<f64>, positions: usize) -> Mat<f64> {
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

/// Makes the entries of every row that multiply vertices sum to zero.
pub(crate) fn with_zero_row_sums(mut target: Mat<f64>, positions: usize) -> Mat<f64> {
    for i in 0..target.nrows() {
        let share = (0..positions).map(|j| target[(i, j)]).sum::<f64>() / positions as f64;
        for j in 0..positions {
            target[(i, j)] -= share;
        }
    }
    target
}
