//! The high unknowns of one vertex's hat function, with the low ones of the same elements.

use super::basis::functions;
use super::elements::Unknowns;
use super::galerkin::{NearPairs, RightHandSides};
use cager_geometry::linalg::cholesky_in_place;
use faer::linalg::triangular_solve;
use faer::{Mat, MatMut, MatRef, Par};

/// An element belongs to a vertex's patch where the residual of the low unknowns, as a value on the
/// boundary, is above this; the iteration ends where all are below.
pub(super) const RESIDUAL: f64 = 3e-4;

/// The equations of all unknowns.
pub(super) struct Equations<'a> {
    pub(super) near: &'a NearPairs,
    /// The low unknowns with each other, the lower triangle.
    pub(super) far: &'a Mat<f32>,
    pub(super) b: &'a RightHandSides,
    pub(super) unknowns: &'a Unknowns,
}

/// Unknowns of a patch at most.
pub(super) const MAX_PATCH_UNKNOWNS: usize = 1600;
/// Fractions by which diagonals grow until the equations of thin elements are definite.
pub(super) const DAMPING: [f64; 5] = [0.0, 1e-4, 1e-3, 1e-2, 1e-1];

/// Makes the diagonal larger by a fraction of it.
pub(super) fn damp(mut a: MatMut<'_, f64>, fraction: f64) {
    for k in 0..a.nrows() {
        a[(k, k)] *= 1.0 + fraction;
    }
}

/// Smallest pivot over its diagonal entry where a damping is chosen: far above rounding.
const MIN_PIVOT: f64 = 1e-6;

/// Factors the lower triangle; whether it is definite, `safely` beyond rounding.
pub(super) fn factor(mut matrix: MatMut<'_, f64>, par: Par, safely: bool) -> bool {
    let diagonal: Vec<f64> = (0..matrix.nrows()).map(|k| matrix[(k, k)]).collect();
    cholesky_in_place(matrix.as_mut(), par).is_some()
        && (!safely || diagonal.iter().enumerate().all(|(k, entry)| matrix[(k, k)].powi(2) >= MIN_PIVOT * entry))
}

/// The first of [`DAMPING`], from the given one on, with which a factorisation succeeds. That of a
/// plan of programs up to 0.2 may fail by rounding: a larger one is better than none.
pub(super) fn least_damping(given: Option<u8>, mut succeeds: impl FnMut(f64) -> bool) -> Option<u8> {
    (given.unwrap_or(0)..DAMPING.len() as u8).find(|&step| succeeds(DAMPING[usize::from(step)]))
}

/// A matrix of zeros in memory that is used again and again.
pub(super) fn zeroed(memory: &mut Vec<f64>, rows: usize, columns: usize) -> MatMut<'_, f64> {
    memory.clear();
    memory.resize(rows * columns, 0.0);
    MatMut::from_column_major_slice_mut(memory, rows, columns)
}

/// The elements where a hat function has high unknowns, ascending, with its column there.
pub(super) struct Patch {
    pub(super) places: Vec<(u32, u32)>,
    /// Which of [`DAMPING`] its matrix takes, where that is known.
    pub(super) damping: Option<u8>,
}

/// Chooses the elements of each vertex's patch by the residuals that the low unknowns leave there.
pub(super) fn choose(unknowns: &Unknowns, candidates: &[Vec<u32>], residuals: &[Mat<f64>], m: usize) -> Vec<Vec<u32>> {
    let mut sizes: Vec<Vec<(f64, u32)>> = vec![Vec::new(); m];
    for (e, (vertices, residual)) in candidates.iter().zip(residuals).enumerate() {
        for (&v, residual) in vertices.iter().zip(residual.col_iter()) {
            // The norm of orthonormal polynomials does not depend on the order of corners.
            let size = residual.norm_l2() / unknowns.elements[e].triangle.area;
            if size > RESIDUAL {
                sizes[v as usize].push((size, e as u32));
            }
        }
    }
    let largest = |mut sizes: Vec<(f64, u32)>| {
        sizes.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut count = 0;
        let fits = |&(_, e): &(f64, u32)| {
            count += functions(unknowns.elements[e as usize].degree);
            count <= MAX_PATCH_UNKNOWNS
        };
        let mut elements: Vec<u32> = sizes.into_iter().take_while(fits).map(|size| size.1).collect();
        elements.sort_unstable();
        elements
    };
    sizes.into_iter().map(largest).collect()
}

/// What solving a patch gives, by element.
pub(super) struct Step {
    /// What is added to its high unknowns.
    pub(super) high: Vec<f64>,
    /// What the highest degrees change of all unknowns there.
    pub(super) change: Vec<f64>,
    /// Which of [`DAMPING`] its matrix took.
    pub(super) damping: u8,
}

/// Rows of a patch's unknowns: the low ones of all elements, others, then those of the highest
/// degrees, so that the solution without these is that of the leading parts of the factor.
struct Layout {
    /// For each element the row of each of its unknowns.
    rows: Vec<Vec<usize>>,
    /// Unknowns below the highest degree, and all.
    coarse: usize,
    count: usize,
}

impl Layout {
    fn new(patch: &Patch, unknowns: &Unknowns) -> Self {
        let degrees: Vec<usize> = patch.places.iter().map(|&(e, _)| unknowns.elements[e as usize].degree).collect();
        let mut layout = Self { rows: vec![Vec::new(); degrees.len()], coarse: 0, count: 0 };
        let coarse = |degree: usize| functions(degree - 1).max(unknowns.low);
        layout.append(degrees.iter().map(|_| unknowns.low));
        layout.append(degrees.iter().map(|&degree| coarse(degree)));
        layout.coarse = layout.count;
        layout.append(degrees.iter().map(|&degree| functions(degree)));
        layout
    }

    /// Appends the unknowns of each element up to a number of them.
    fn append(&mut self, up_to: impl Iterator<Item = usize>) {
        for (rows, up_to) in self.rows.iter_mut().zip(up_to) {
            let more = up_to - rows.len();
            rows.extend(self.count..self.count + more);
            self.count += more;
        }
    }
}

/// Solves the equations of a patch with these residuals; `None` where they are not definite.
pub(super) fn solve(
    equations: &Equations<'_>,
    patch: &Patch,
    residuals: &[Mat<f64>],
    memory: &mut Vec<f64>,
) -> Option<Step> {
    let low = equations.unknowns.low;
    let layout = Layout::new(patch, equations.unknowns);
    let definite = |fraction: f64| {
        let mut matrix = zeroed(memory, layout.count, layout.count);
        fill_low(matrix.as_mut(), equations, patch);
        fill_near(matrix.as_mut(), equations, patch, &layout);
        damp(matrix.as_mut(), fraction);
        factor(matrix, Par::Seq, patch.damping.is_none())
    };
    let damping = least_damping(patch.damping, definite)?;
    let lower = MatRef::from_column_major_slice(memory, layout.count, layout.count);
    // The solution, and what the highest degrees contribute to it.
    let mut x = Mat::<f64>::zeros(layout.count, 2);
    for (&(e, column), rows) in patch.places.iter().zip(&layout.rows) {
        let residual = residuals[e as usize].col(column as usize);
        residual.iter().zip(&rows[low..]).for_each(|(&value, &row)| x[(row, 0)] = value);
    }
    triangular_solve::solve_lower_triangular_in_place(lower, x.as_mut().subcols_mut(0, 1), Par::Seq);
    for row in layout.coarse..layout.count {
        x[(row, 1)] = x[(row, 0)];
    }
    triangular_solve::solve_upper_triangular_in_place(lower.transpose(), x.as_mut(), Par::Seq);
    Some(Step {
        high: layout.rows.iter().flat_map(|rows| rows[low..].iter().map(|&row| x[(row, 0)])).collect(),
        change: layout.rows.iter().flatten().map(|&row| x[(row, 1)]).collect(),
        damping,
    })
}

/// Writes the entries of all low unknowns with each other, on and below the diagonal.
fn fill_low(mut matrix: MatMut<'_, f64>, equations: &Equations<'_>, patch: &Patch) {
    let low = equations.unknowns.low;
    for (j, &(f, _)) in patch.places.iter().enumerate() {
        for c in 0..low {
            let from = equations.far.col_as_slice(f as usize * low + c);
            let mut to = matrix.as_mut().col_mut(j * low + c);
            for (i, &(e, _)) in patch.places.iter().enumerate().skip(j) {
                let entries = &from[e as usize * low..][..low];
                to.as_mut().subrows_mut(i * low, low).iter_mut().zip(entries).for_each(|(to, &x)| *to = f64::from(x));
            }
        }
    }
}

/// Writes all entries of elements near each other, below the diagonal; others are zero.
fn fill_near(mut matrix: MatMut<'_, f64>, equations: &Equations<'_>, patch: &Patch, layout: &Layout) {
    let place_of = |element: usize| patch.places.binary_search_by_key(&(element as u32), |place| place.0).ok();
    for (&(e, _), columns) in patch.places.iter().zip(&layout.rows) {
        // Every pair once, with its lower element.
        for (other, entries) in equations.near.of(e as usize).filter(|(other, _)| *other >= e as usize) {
            let Some(place) = place_of(other) else { continue };
            for (entries, &column) in entries.row_iter().zip(columns) {
                for (&entry, &row) in entries.iter().zip(&layout.rows[place]) {
                    matrix[(row.max(column), row.min(column))] = entry;
                }
            }
        }
    }
}
