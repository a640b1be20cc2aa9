//! Reduction of a square matrix to bidiagonal form, `A = Q B Pᵀ`, by Householder reflections (Golub and Kahan 1965).
//!
//! A step k reflects column k, then row k. Both reflections are applied to the rest of the matrix one step late, as
//! `A − u yᵀ − z vᵀ`, in the same sweep that gathers what step k + 1 needs of it. A column is thus read once per step, while
//! it lies in the first-level cache (Howell, Demmel, Fulton, Hammarling and Marmol 2008); the memory limits the speed.

use crate::simd::{LANES, Lanes, flat, flat_mut, multiversion};
use faer::{Mat, MatRef};

/// Columns that one sweep handles together, so that vectors all of them need are read once.
const TOGETHER: usize = 4;
/// Squared lengths below this, where the matrix is at most one, are zero: their square roots would have too few digits.
const NOTHING: f64 = 1e-280;

/// `A = Q B Pᵀ`, m × m, with B zero but for its diagonal and the one above.
pub(super) struct Bidiagonal {
    /// Diagonal of B, length m.
    pub(super) diagonal: Vec<f64>,
    /// Entries above it, length m − 1.
    pub(super) above: Vec<f64>,
    /// Reflections of Q: m × m, column k below its diagonal, a one on the diagonal left out.
    pub(super) left: Mat<f64>,
    /// Half the squared length of each vector of `left`; infinite where nothing is reflected.
    pub(super) left_scales: Vec<f64>,
    /// Reflections of P, of all coordinates but the first: (m − 1) × (m − 1).
    pub(super) right: Mat<f64>,
    /// As `left_scales`, length m − 1.
    pub(super) right_scales: Vec<f64>,
}

/// Working memory: matrix and vectors are padded with zeros to whole lane groups.
struct Sweep {
    /// Lane groups of one column.
    stride: usize,
    /// The matrix, column after column.
    a: Vec<Lanes>,
    /// The pending update `u yᵀ + z vᵀ`: u and z over rows, y and v over columns.
    u: Vec<Lanes>,
    z: Vec<Lanes>,
    y: Vec<f64>,
    v: Vec<f64>,
    /// `A r` of the current step, over rows.
    image: Vec<Lanes>,
    /// Row k right of the diagonal, after the reflection of column k.
    r: Vec<f64>,
}

/// A reflection `I − τ w wᵀ` with `w = scale · (x − β e)` that takes a vector x to `β e`.
struct Reflection {
    beta: f64,
    scale: f64,
    tau: f64,
}

impl Reflection {
    /// From the first entry of x and the squared length of the others.
    #[inline(always)]
    fn new(head: f64, tail2: f64) -> Self {
        if tail2 < NOTHING {
            return Self { beta: head, scale: 0.0, tau: 0.0 };
        }
        let beta = -(head * head + tail2).sqrt().copysign(head);
        Self { beta, scale: 1.0 / (head - beta), tau: (beta - head) / beta }
    }
}

/// Bidiagonalises `scale · A`, sequentially; its largest entry should be about one.
pub(super) fn bidiagonalise(a: MatRef<'_, f64>, scale: f64) -> Bidiagonal {
    let m = a.nrows();
    let stride = m.div_ceil(LANES);
    let mut sweep = Sweep {
        stride,
        a: vec![Lanes::ZERO; m * stride],
        u: vec![Lanes::ZERO; stride],
        z: vec![Lanes::ZERO; stride],
        y: vec![0.0; m],
        v: vec![0.0; m],
        image: vec![Lanes::ZERO; stride],
        r: vec![0.0; m],
    };
    for (j, column) in sweep.a.chunks_exact_mut(stride).enumerate() {
        for (i, &x) in a.col(j).iter().enumerate() {
            column[i / LANES].0[i % LANES] = x * scale;
        }
    }
    let mut b = Bidiagonal {
        diagonal: vec![0.0; m],
        above: vec![0.0; m - 1],
        left: Mat::zeros(m, m),
        left_scales: vec![0.0; m],
        right: Mat::zeros(m - 1, m - 1),
        right_scales: vec![0.0; m - 1],
    };
    for k in 0..m {
        let (left, right) = step(&mut sweep, k);
        b.diagonal[k] = left.beta;
        b.left_scales[k] = left.tau.recip();
        for i in k + 1..m {
            b.left[(i, k)] = sweep.u[i / LANES].0[i % LANES];
        }
        if k + 1 < m {
            b.above[k] = right.beta;
            b.right_scales[k] = right.tau.recip();
            for j in k + 2..m {
                b.right[(j - 1, k)] = sweep.v[j];
            }
        }
    }
    b
}

multiversion! {
    /// Reflects column and row k; leaves the reflections' vectors in `u` and `v`.
    fn step(sweep: &mut Sweep, k: usize) -> (Reflection, Reflection) = step_generic;
}

#[inline(always)]
fn step_generic(sweep: &mut Sweep, k: usize) -> (Reflection, Reflection) {
    let Sweep { stride, a, u, z, y, v, image, r } = sweep;
    let (stride, first) = (*stride, k / LANES);
    let m = y.len();
    let (done, rest) = a.split_at_mut((k + 1) * stride);
    let column = &mut done[k * stride..];
    let mut tail = Lanes::ZERO;
    for c in first..stride {
        column[c] = column[c] - u[c] * y[k] - z[c] * v[k];
    }
    let head = column[first].0[k % LANES];
    clear_to(&mut column[first], k % LANES);
    for x in &column[first..] {
        tail = tail + *x * *x;
    }
    let left = Reflection::new(head, total(tail));
    for x in &mut column[first..] {
        *x = *x * left.scale;
    }
    column[first].0[k % LANES] = 1.0;
    let column = &*column;

    for x in &mut image[first..] {
        *x = Lanes::ZERO;
    }
    let mut j = k + 1;
    for group in rest.chunks_mut(TOGETHER * stride) {
        let pass = Pass { k, old_u: &u[first..], old_z: &z[first..], u: &column[first..], tau: left.tau };
        let image = &mut image[first..];
        if group.len() == TOGETHER * stride {
            pass.over::<TOGETHER>(group, &mut y[j..], &v[j..], &mut r[j..], image);
        } else {
            for (g, one) in group.chunks_exact_mut(stride).enumerate() {
                pass.over::<1>(one, &mut y[j + g..], &v[j + g..], &mut r[j + g..], image);
            }
        }
        j += TOGETHER;
    }
    u[first..].copy_from_slice(&column[first..]);
    if k + 1 == m {
        return (left, Reflection::new(0.0, 0.0));
    }

    let right = Reflection::new(r[k + 1], dot(&r[k + 2..], &r[k + 2..]));
    v[k + 1] = 1.0;
    for j in k + 2..m {
        v[j] = r[j] * right.scale;
    }
    // A v from A r, and z = τ (A − u yᵀ) v.
    let along = right.tau * dot(&y[k + 1..], &v[k + 1..]);
    let (scale, back) = (right.tau * right.scale, right.tau * right.scale * right.beta);
    let next = &rest[..stride];
    for c in first..stride {
        z[c] = image[c] * scale - next[c] * back - u[c] * along;
    }
    clear_to(&mut z[first], k % LANES);
    (left, right)
}

/// What one sweep over the columns right of column k applies and gathers; vectors start at the lane group of row k.
struct Pass<'a> {
    k: usize,
    old_u: &'a [Lanes],
    old_z: &'a [Lanes],
    u: &'a [Lanes],
    tau: f64,
}

impl Pass<'_> {
    /// Brings G columns up to date; then y, the reflected row r, and their share of `A r`.
    #[inline(always)]
    fn over<const G: usize>(
        &self,
        columns: &mut [Lanes],
        y: &mut [f64],
        v: &[f64],
        r: &mut [f64],
        image: &mut [Lanes],
    ) {
        let groups = self.u.len();
        let stride = columns.len() / G;
        let (old_u, old_z, u) = (&self.old_u[..groups], &self.old_z[..groups], &self.u[..groups]);
        let image = &mut image[..groups];
        let mut parts = columns.chunks_exact_mut(stride);
        let parts: [&mut [Lanes]; G] =
            std::array::from_fn(|_| &mut parts.next().expect("G columns")[stride - groups..]);
        let old_y: [f64; G] = std::array::from_fn(|g| y[g]);
        let old_v: [f64; G] = std::array::from_fn(|g| v[g]);
        let mut sums = [Lanes::ZERO; G];
        for c in 0..groups {
            let (p, q, w) = (old_u[c], old_z[c], u[c]);
            for g in 0..G {
                let x = parts[g][c] - p * old_y[g] - q * old_v[g];
                parts[g][c] = x;
                sums[g] = sums[g] + w * x;
            }
        }
        let mut row = [0.0; G];
        for g in 0..G {
            y[g] = self.tau * total(sums[g]);
            row[g] = parts[g][0].0[self.k % LANES] - y[g];
            r[g] = row[g];
        }
        // As plain numbers: of lane groups without a reduction the compiler makes gathers and scatters.
        let parts: [&[f64]; G] = std::array::from_fn(|g| &flat(parts[g])[..groups * LANES]);
        let image = &mut flat_mut(image)[..groups * LANES];
        for i in 0..groups * LANES {
            let mut sum = image[i];
            for g in 0..G {
                sum += parts[g][i] * row[g];
            }
            image[i] = sum;
        }
    }
}

/// Zeros lanes 0 to `last`.
#[inline(always)]
fn clear_to(lanes: &mut Lanes, last: usize) {
    for l in 0..=last {
        lanes.0[l] = 0.0;
    }
}

#[inline(always)]
fn total(x: Lanes) -> f64 {
    let [a, b, c, d, e, f, g, h] = x.0;
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut sum = Lanes::ZERO;
    for (&x, &y) in a.iter().zip(b) {
        sum = sum + Lanes(x) * Lanes(y);
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    total(sum) + rest
}
