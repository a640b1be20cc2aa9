//! Translation equivariance: corrects row sums so that cages follow a translation of the frame exactly, despite truncation, damping or rounding.

use faer::Mat;
use faer::reborrow::Reborrow;

/// Makes the rows of R for vertices sum to one and those for normals to zero. Takes and returns `Rᵀ`.
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

/// Makes the contribution of a reference cage independent of its translation: the entries of every row that multiply vertices sum to zero.
pub(crate) fn with_zero_row_sums(mut target: Mat<f64>, positions: usize) -> Mat<f64> {
    for i in 0..target.nrows() {
        let share = (0..positions).map(|j| target[(i, j)]).sum::<f64>() / positions as f64;
        for j in 0..positions {
            target[(i, j)] -= share;
        }
    }
    target
}
