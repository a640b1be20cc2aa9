//! Maximum volume with many columns, to a loose tolerance. The LU factorisation that picks the first rows gives all of `B = Φ Φ□⁻¹` for half a product, and
//! a round of k swaps changes it by a product of rank k; both in single precision, which is enough for a tolerance of one.

use super::handles::{MAX_PASSES, MaxVol, SINGLE_IS_SAFE, Swap, Volume};
use super::swaps::CandidateRows;
use cager_geometry::linalg;
use cager_geometry::linalg::zeros;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_unit_upper_triangular_in_place;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Rows of B of one task.
const TASK_ROWS: usize = 256;

/// As `maxvol`; `None` where the columns are too close to dependent for single precision, or where swaps do not end.
pub(super) fn search(phi: MatRef<'_, f64>, tolerance: f64) -> Option<MaxVol> {
    let lu = linalg::pivoted(linalg::to_single(phi, phi.nrows()));
    let safe = lu.smallest > SINGLE_IS_SAFE;
    // NaN where a column vanished.
    if !safe {
        return None;
    }
    let start = lu.rows().to_vec();
    let mut b = transposed_basis(lu.factors.as_ref());
    let order = lu.order;
    drop(lu.factors);
    let mut place = vec![0; order.len()];
    order.iter().zip(0..).for_each(|(&row, at)| place[row as usize] = at);

    // Numbers of columns of `b`, as long as rows are swapped.
    let mut picked: Vec<u32> = (0..phi.ncols() as u32).collect();
    let mut trace = Vec::new();
    let mut row_max = maxima(b.as_ref());
    for _ in 0..MAX_PASSES {
        let before = picked.clone();
        let done = CandidateRows::copied(b.as_ref(), &row_max).swap(&mut picked, tolerance);
        trace.extend(done.into_iter().map(|swap| Swap { row: order[swap.row as usize], ..swap }));
        exchange(&mut b, &before, &picked);
        row_max = maxima(b.as_ref());
        let max_entry = row_max.iter().copied().fold(0.0, f32::max);
        if f64::from(max_entry) <= 1.0 + tolerance {
            let rows: Vec<u32> = picked.iter().map(|&at| order[at as usize]).collect();
            let (inverse, log_volume) = linalg::inverse(linalg::rows_of(phi, &rows).as_ref());
            let start_log_volume = log_volume - trace.iter().map(|swap| swap.growth.ln()).sum::<f64>();
            let volume = Volume { swaps: trace.len(), log_volume, max_entry: f64::from(max_entry) };
            return Some(MaxVol { rows, start, volume, trace, start_log_volume, gram: None, inverse });
        }
    }
    None
}

/// `Bᵀ`, m × n, from the factors of `P Φ = L U`: the first m columns are the identity, and the others `L₁⁻ᵀ L₂ᵀ`.
fn transposed_basis(factors: MatRef<'_, f32>) -> Mat<f32> {
    let (n, m) = factors.shape();
    let mut b = zeros(m, n);
    for j in 0..m {
        b[(j, j)] = 1.0;
    }
    let first = factors.subrows(0, m);
    b.as_mut().subcols_mut(m, n - m).par_col_chunks_mut(TASK_ROWS).enumerate().for_each(|(task, mut columns)| {
        let rows = factors.subrows(m + task * TASK_ROWS, columns.ncols());
        columns.copy_from(rows.transpose());
        solve_unit_upper_triangular_in_place(first.transpose(), columns, Par::Seq);
    });
    b
}

/// Largest `|B_ij|` of every row.
fn maxima(b: MatRef<'_, f32>) -> Vec<f32> {
    (0..b.ncols()).into_par_iter().map(|i| b.col(i).norm_max()).collect()
}

/// Takes `Bᵀ` from the handles `before` to the handles `after`: with the positions J that changed and their new rows I it is
/// `B − B_·J (B_IJ)⁻¹ (B_I − E_J)`, where E_J are rows of the identity.
fn exchange(b: &mut Mat<f32>, before: &[u32], after: &[u32]) {
    let changed: Vec<usize> = (0..after.len()).filter(|&j| before[j] != after[j]).collect();
    let (m, k) = (after.len(), changed.len());
    if k == 0 {
        return;
    }
    let row = |i: usize, j: usize| f64::from(b[(j, after[changed[i]] as usize)]);
    let (inverse, _) = linalg::inverse(Mat::from_fn(k, k, |i, j| row(i, changed[j])).as_ref());
    let moved = Mat::from_fn(k, m, |i, j| row(i, j) - if changed[i] == j { 1.0 } else { 0.0 });
    let update = linalg::product(inverse.as_ref(), moved.as_ref());
    let update = Mat::<f32>::from_fn(m, k, |j, i| update[(i, j)] as f32);
    b.as_mut().par_col_chunks_mut(TASK_ROWS).for_each(|mut columns: MatMut<'_, f32>| {
        let of_changed = Mat::from_fn(k, columns.ncols(), |i, row| columns[(changed[i], row)]);
        matmul(columns.as_mut(), Accum::Add, update.as_ref(), of_changed.as_ref(), -1.0, Par::Seq);
    });
    for &j in &changed {
        let handle = after[j] as usize;
        b.col_mut(handle).fill(0.0);
        b[(j, handle)] = 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maxvol::handles::LOOSE_TOLERANCE;
    use crate::maxvol::{search as general, start_rows};

    #[test]
    fn rows_are_those_of_the_general_search() {
        let (n, m) = (900, 120);
        let phi = Mat::from_fn(n, m, |i, j| {
            let x = (i * 7919 % n) as f64 / n as f64 - j as f64 / m as f64;
            (-9000.0 * x * x).exp() + 1e-3 * ((i * 31 + j * 17 + i * j) % 101) as f64
        });
        let [found, alone] = [2, 1].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| search(phi.as_ref(), LOOSE_TOLERANCE).unwrap())
        });
        assert_eq!((&found.rows, &found.trace), (&alone.rows, &alone.trace));
        assert_eq!(found.volume.max_entry.to_bits(), alone.volume.max_entry.to_bits());
        let expected = general(phi.as_ref(), start_rows(phi.as_ref()).unwrap(), LOOSE_TOLERANCE);
        assert_eq!(found.start, expected.start);
        assert!(
            (found.volume.log_volume - expected.volume.log_volume).abs() < 1e-3 * expected.volume.log_volume.abs(),
            "{}",
            found.volume.log_volume
        );
        let b = linalg::product(phi.as_ref(), found.inverse.as_ref());
        let largest = b.norm_max();
        assert!(
            (found.volume.max_entry - largest).abs() < 1e-3 * largest && largest <= 1.0 + LOOSE_TOLERANCE,
            "{largest}"
        );
        assert!(found.volume.swaps > 0 && (found.start_log_volume - expected.start_log_volume).abs() < 1e-3);
    }
}
