//! Cages follow a translation of the frame exactly, also where truncation, damping or rounding by themselves would not let them.

use faer::Mat;
use faer::reborrow::Reborrow;

/// The rows of R that give positions sum to one, those that give directions to zero. Takes and gives `Rᵀ`.
pub(super) fn keep_translations(mut operator: Mat<f64>, positions: usize) -> Mat<f64> {
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

/// The pull of another cage does not depend on where that cage is: the entries of every row that meet positions sum to zero.
pub(super) fn cages_stay(mut pull: Mat<f64>, positions: usize) -> Mat<f64> {
    for i in 0..pull.nrows() {
        let share = (0..positions).map(|j| pull[(i, j)]).sum::<f64>() / positions as f64;
        for j in 0..positions {
            pull[(i, j)] -= share;
        }
    }
    pull
}
