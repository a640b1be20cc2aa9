//! Singular value decomposition of a bidiagonal matrix by divide and conquer (Gu and Eisenstat 1995).
//!
//! A row is torn out of the middle. What lies above and below it is decomposed by itself, which leaves, in the bases found, a
//! diagonal matrix with one full row: see [`super::secular`]. Entries that are next to nothing are dropped first, and of each
//! two diagonal entries next to equal one is turned out of the problem; often most of it goes that way.
//!
//! Blocks n × (n + x) with x ∈ {0, 1}: those above a torn-out row end in a column more than they have rows.

use super::secular::Poles;
use faer::{Mat, MatMut, MatRef};

/// Blocks smaller than this are not worth another thread.
const WORTH_A_TASK: usize = 48;
/// Fraction of a block's size that is next to nothing.
const NEGLIGIBLE: f64 = 8.0 * f64::EPSILON;
/// The same of the whole matrix, whose largest entry is one. Squares of what remains do not underflow.
const NOTHING: f64 = 1e-20;

/// Left and right singular vectors in the making.
pub(super) struct Vectors<'a> {
    /// n × n. Without it only values are wanted.
    pub(super) left: Option<MatMut<'a, f64>>,
    /// (n + x) × (n + x), the last x columns spanning the null space; only its first and last row, where only values are wanted.
    pub(super) right: MatMut<'a, f64>,
}

/// Decomposes the block with this diagonal, n, and these entries right of it, n − 1 + x. All vectors come as zeros. The
/// values, not negative and in no order, replace the diagonal; columns of the vectors belong to them.
///
/// Runs on the current rayon pool; the result does not depend on it.
pub(super) fn decompose(diagonal: &mut [f64], above: &[f64], mut vectors: Vectors<'_>) {
    let n = diagonal.len();
    match n {
        0 => vectors.right.fill(1.0),
        1 => single(diagonal, above, vectors),
        _ => {
            let middle = n / 2;
            let torn = [diagonal[middle], above.get(middle).copied().unwrap_or(0.0)];
            let (first, rest) = diagonal.split_at_mut(middle);
            let (upper, lower) = vectors.halves(middle);
            let solve_first = || decompose(first, &above[..middle], upper);
            let solve_rest = || decompose(&mut rest[1..], above.get(middle + 1..).unwrap_or(&[]), lower);
            if n < WORTH_A_TASK {
                solve_first();
                solve_rest();
            } else {
                rayon::join(solve_first, solve_rest);
            }
            merge(diagonal, torn, vectors);
        }
    }
}

/// One row: `[d]` or `[d e]`.
fn single(diagonal: &mut [f64], above: &[f64], mut vectors: Vectors<'_>) {
    let d = diagonal[0];
    let extra = vectors.right.ncols() - 1;
    let e = if extra == 1 { above[0] } else { 0.0 };
    let size = d.hypot(e);
    let (c, s) = if size == 0.0 { (1.0, 0.0) } else { (d / size, e / size) };
    diagonal[0] = size;
    let last = vectors.right.nrows() - 1;
    vectors.right[(0, 0)] = c;
    vectors.right[(last, 0)] = if extra == 1 { s } else { c };
    if extra == 1 {
        vectors.right[(0, 1)] = -s;
        vectors.right[(last, 1)] = c;
    }
    if let Some(left) = &mut vectors.left {
        left[(0, 0)] = 1.0;
    }
}

impl Vectors<'_> {
    /// Views for the blocks above and below row `middle`.
    fn halves(&mut self, middle: usize) -> (Vectors<'_>, Vectors<'_>) {
        let compact = self.left.is_none();
        let (first, rest) = self.right.as_mut().split_at_col_mut(middle + 1);
        let (first, rest) = if compact {
            (first, rest)
        } else {
            (first.split_at_row_mut(middle + 1).0, rest.split_at_row_mut(middle + 1).1)
        };
        let (left_first, left_rest) = match &mut self.left {
            None => (None, None),
            Some(left) => {
                let (a, b) = left.as_mut().split_at_col_mut(middle);
                let b = b.split_at_col_mut(1).1;
                (Some(a.split_at_row_mut(middle).0), Some(b.split_at_row_mut(middle + 1).1))
            }
        };
        (Vectors { left: left_first, right: first }, Vectors { left: left_rest, right: rest })
    }
}

/// Which rows of the vectors a column has entries in.
#[derive(Clone, Copy, PartialEq)]
enum Reach {
    Upper,
    Both,
    Lower,
}

/// What is left to decompose after deflation, and what is done already. Numbers are columns of the block.
struct Deflated {
    /// Columns left, those of a reach together: upper, both, lower.
    kept: Vec<usize>,
    /// Counts of the three.
    reaches: [usize; 3],
    /// Places in `kept`, by ascending diagonal entry; the first is the torn-out row's.
    ascending: Vec<usize>,
    /// Columns whose values and vectors are final.
    done: Vec<usize>,
}

/// Joins the two halves of a block around the torn-out row, given by its two entries.
fn merge(diagonal: &mut [f64], torn: [f64; 2], mut vectors: Vectors<'_>) {
    let n = diagonal.len();
    let middle = n / 2;
    let mut z = full_row(n, torn, &mut vectors);
    if let Some(left) = &mut vectors.left {
        left[(middle, middle)] = 1.0;
    }
    diagonal[middle] = 0.0;
    let problem = deflate(diagonal, &mut z, &mut vectors);
    let kept = &problem.kept;
    let pick = |from: &[f64]| kept.iter().map(|&c| from[c]).collect::<Vec<f64>>();
    let (sigma, right, left) = if kept.len() == 1 {
        let sign = Mat::from_fn(1, 1, |_, _| 1f64.copysign(z[middle]));
        (vec![z[middle].abs()], sign, Some(Mat::identity(1, 1)))
    } else {
        Poles::new(&pick(diagonal), &pick(&z), problem.ascending.clone()).decompose(vectors.left.is_some())
    };
    let done: Vec<f64> = problem.done.iter().map(|&c| diagonal[c]).collect();
    diagonal[..sigma.len()].copy_from_slice(&sigma);
    diagonal[sigma.len()..].copy_from_slice(&done);

    let split = if vectors.left.is_some() { middle + 1 } else { 1 };
    let turn_right = || combine(vectors.right, split, &problem, right.as_ref());
    match (vectors.left, left) {
        (Some(u), Some(left)) if n >= WORTH_A_TASK => {
            rayon::join(turn_right, || combine(u, split, &problem, left.as_ref()));
        }
        (Some(u), Some(left)) => {
            turn_right();
            combine(u, split, &problem, left.as_ref());
        }
        _ => turn_right(),
    }
}

/// The torn-out row in the bases of the halves, n entries. Of the two null vectors one takes the middle column, so that the
/// row has no entry for the other.
fn full_row(n: usize, torn: [f64; 2], vectors: &mut Vectors<'_>) -> Vec<f64> {
    let middle = n / 2;
    let right = &mut vectors.right;
    let extra = right.ncols() > n;
    let compact = vectors.left.is_none();
    let (end, start) = if compact { (1, 0) } else { (middle, middle + 1) };
    let mut z: Vec<f64> =
        (0..n).map(|c| if c <= middle { torn[0] * right[(end, c)] } else { torn[1] * right[(start, c)] }).collect();
    let beyond = if extra { torn[1] * right[(start, n)] } else { 0.0 };
    if compact {
        // Of the whole block now: the first row of the upper half, the last of the lower.
        for c in 0..right.ncols() {
            right[(if c <= middle { 1 } else { 0 }, c)] = 0.0;
        }
    }
    let size = z[middle].hypot(beyond);
    if extra && size > 0.0 {
        rotate(right.as_mut(), middle, n, z[middle] / size, beyond / size);
        z[middle] = size;
    }
    z
}

/// Turns columns `(a, b)` into `(c a + s b, c b − s a)`.
fn rotate(m: MatMut<'_, f64>, a: usize, b: usize, c: f64, s: f64) {
    let (low, high) = (a.min(b), a.max(b));
    let (left, right) = m.split_at_col_mut(high);
    let (low, high) = (left.col_mut(low), right.col_mut(0));
    let (x, y) = if a < b { (low, high) } else { (high, low) };
    for (x, y) in x.iter_mut().zip(y.iter_mut()) {
        (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
    }
}

/// Takes out of the problem whatever changes it by less than rounding does.
fn deflate(d: &mut [f64], z: &mut [f64], vectors: &mut Vectors<'_>) -> Deflated {
    let n = d.len();
    let middle = n / 2;
    let size = d.iter().chain(z.iter()).fold(0.0, |a: f64, x| a.max(x.abs()));
    let tolerance = (NEGLIGIBLE * size).max(NOTHING);
    let mut reach: Vec<Reach> = (0..n).map(|c| if c < middle { Reach::Upper } else { Reach::Lower }).collect();
    reach[middle] = Reach::Both;
    let mut order: Vec<usize> = (0..n).filter(|&c| c != middle).collect();
    order.sort_unstable_by(|&a, &b| d[a].total_cmp(&d[b]).then(a.cmp(&b)));

    let mut by_size = vec![middle];
    let mut done = Vec::new();
    for c in order {
        if z[c].abs() <= tolerance {
            done.push(c);
            continue;
        }
        if d[c] <= tolerance {
            let length = z[middle].hypot(z[c]);
            rotate(vectors.right.as_mut(), middle, c, z[middle] / length, z[c] / length);
            z[middle] = length;
            d[c] = 0.0;
            done.push(c);
            continue;
        }
        let previous = by_size[by_size.len() - 1];
        if previous != middle && d[c] - d[previous] <= tolerance {
            let length = z[c].hypot(z[previous]);
            let (cos, sin) = (z[c] / length, z[previous] / length);
            rotate(vectors.right.as_mut(), c, previous, cos, sin);
            if let Some(left) = &mut vectors.left {
                rotate(left.as_mut(), c, previous, cos, sin);
            }
            z[c] = length;
            if reach[c] != reach[previous] {
                reach[c] = Reach::Both;
            }
            by_size.pop();
            done.push(previous);
        }
        by_size.push(c);
    }
    if by_size.len() > 1 && z[middle].abs() < tolerance {
        z[middle] = tolerance.copysign(z[middle]);
    }
    let mut kept = Vec::with_capacity(by_size.len());
    let mut places = vec![0; n];
    let mut reaches = [0; 3];
    for (count, wanted) in reaches.iter_mut().zip([Reach::Upper, Reach::Both, Reach::Lower]) {
        let before = kept.len();
        for &c in by_size.iter().filter(|&&c| reach[c] == wanted) {
            places[c] = kept.len();
            kept.push(c);
        }
        *count = kept.len() - before;
    }
    let ascending = by_size.iter().map(|&c| places[c]).collect();
    Deflated { kept, reaches, ascending, done }
}

/// Multiplies the kept columns by the vectors of the reduced problem and puts the others behind them. The first `split` rows
/// are the upper half's.
fn combine(mut vectors: MatMut<'_, f64>, split: usize, problem: &Deflated, by: MatRef<'_, f64>) {
    let Deflated { kept, reaches: [upper, both, lower], done, .. } = problem;
    let rows = vectors.nrows();
    let count = kept.len();
    let gather = |columns: &[usize], first: usize, rows: usize| {
        let mut gathered = Mat::zeros(rows, columns.len());
        for (to, &from) in columns.iter().enumerate() {
            gathered.col_mut(to).copy_from(vectors.as_ref().col(from).subrows(first, rows));
        }
        gathered
    };
    let top = gather(&kept[..upper + both], 0, split);
    let bottom = gather(&kept[*upper..], split, rows - split);
    let finished = gather(done, 0, rows);
    let (above, below) = vectors.as_mut().subcols_mut(0, count).split_at_row_mut(split);
    crate::dense::multiply(above, top.as_ref(), by.subrows(0, upper + both));
    crate::dense::multiply(below, bottom.as_ref(), by.subrows(*upper, both + lower));
    vectors.subcols_mut(count, done.len()).copy_from(finished.as_ref());
}
