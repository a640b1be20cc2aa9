//! State of a frame during the consistent inversion, and the conjugate gradients of a step.

use crate::batch::product_columns;
use crate::coordinates::DependentNormals;
use cager_geometry::mesh::Point;
use cager_geometry::vector::{add, along, combination, dot, mean, sub};
use faer::{Mat, MatRef};

/// Conjugate gradients stop at this fraction of the initial preconditioned squared residual.
const CG_TOLERANCE: f64 = 1e-4;

/// How the inversion of one frame ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The last step lowered E by less than the tolerance, or no further step lowered it.
    Converged,
    /// The maximum number of steps was taken, each of which lowered E.
    StepLimit,
    /// No step lowered E: the cage is that of the linear start.
    KeptStart,
}

/// State of one frame. Positions are relative to the centre of the initial cage, for precision.
pub(super) struct FrameState {
    pub(super) origin: Point,
    start: Vec<Point>,
    pub(super) cage: Vec<Point>,
    /// `(v/K) Φᵀ P`, T × 3.
    pub(super) right_hand_side: Vec<Point>,
    /// `(v/K) Σ |P|²`.
    pub(super) squared_positions: f64,
    /// `G Y` of the cage's values Y.
    pub(super) products: Vec<Point>,
    pub(super) energy: f64,
    pub(super) start_energy: f64,
    pub(super) steps: usize,
    pub(super) outcome: Option<Outcome>,
}

impl FrameState {
    pub(super) fn new(cage: &[Point]) -> Self {
        let origin = mean(cage);
        let start: Vec<Point> = cage.iter().map(|p| sub(*p, origin)).collect();
        Self {
            origin,
            cage: start.clone(),
            start,
            right_hand_side: Vec::new(),
            squared_positions: 0.0,
            products: Vec::new(),
            energy: 0.0,
            start_energy: 0.0,
            steps: 0,
            outcome: None,
        }
    }

    /// Vertices and their normals, T × 3.
    pub(super) fn values(&self, dependent: &DependentNormals, cage: &[Point]) -> Vec<Point> {
        cage.iter().copied().chain(dependent.normals(|v| cage[v as usize])).collect()
    }

    /// Data term of E.
    pub(super) fn data_energy(&self, values: &[Point], products: &[Point]) -> f64 {
        let terms = values.iter().zip(products).zip(&self.right_hand_side);
        self.squared_positions + terms.map(|((&y, g), s)| dot(y, along(*g, -2.0, *s))).sum::<f64>()
    }

    pub(super) fn displacement(&self, cage: &[Point]) -> Vec<Point> {
        cage.iter().zip(&self.start).map(|(c, s)| sub(*c, *s)).collect()
    }

    /// Writes the refined cage back, relative to the origin of the capture.
    pub(super) fn write(&self, cage: &mut [Point]) {
        if self.steps > 0 {
            for (to, from) in cage.iter_mut().zip(&self.cage) {
                *to = add(*from, self.origin);
            }
        }
    }
}

/// Conjugate gradients on `(JᵀGJ + λΔᵀΔ) d = −½ ∇E`, `J` the derivative of a cage's values.
pub(super) struct ConjugateGradients {
    derivatives: Vec<[[Point; 3]; 2]>,
    pub(super) step: Vec<Point>,
    pub(super) residual: Vec<Point>,
    direction: Vec<Point>,
    /// Inner product of the residual with the preconditioned residual, and its initial value.
    size: f64,
    first_size: f64,
    pub(super) done: bool,
}

impl ConjugateGradients {
    /// From a frame and half the gradient of the regularisation term of E.
    pub(super) fn new(dependent: &DependentNormals, frame: &FrameState, regularization_gradient: &[Point]) -> Self {
        let derivatives = dependent.derivatives(&frame.cage);
        let difference = |(s, g): (&Point, &Point)| sub(*s, *g);
        let open: Vec<Point> = frame.right_hand_side.iter().zip(&frame.products).map(difference).collect();
        let mut residual = transposed_jacobian_product(dependent, &derivatives, &open);
        for (r, p) in residual.iter_mut().zip(regularization_gradient) {
            *r = sub(*r, *p);
        }
        let zeros = vec![[0.0; 3]; residual.len()];
        Self { derivatives, step: zeros.clone(), direction: zeros, residual, size: 0.0, first_size: 0.0, done: false }
    }

    /// Computes the next search direction from the preconditioned residual.
    pub(super) fn update_direction(&mut self, preconditioned: &[Point], first: bool) {
        let size: f64 = self.residual.iter().zip(preconditioned).map(|(&r, &z)| dot(r, z)).sum();
        if first {
            self.first_size = size;
        }
        // Negated, so that NaN ends the iteration as well.
        if !(size > CG_TOLERANCE * self.first_size || (first && size > 0.0)) {
            self.done = true;
            return;
        }
        let beta = if first { 0.0 } else { size / self.size };
        for (d, z) in self.direction.iter_mut().zip(preconditioned) {
            *d = along(*z, beta, *d);
        }
        self.size = size;
    }

    /// `J d` of the direction, T × 3.
    pub(super) fn jacobian_product(&self, dependent: &DependentNormals) -> Vec<Point> {
        let d = &self.direction;
        let of_face = |(&[a, b, c], derivative): (&[u32; 3], &[[Point; 3]; 2])| {
            let [a, b, c] = [a, b, c].map(|v| d[v as usize]);
            let (u, v) = (sub(b, a), sub(c, a));
            [0, 1, 2].map(|i| dot(derivative[0][i], u) + dot(derivative[1][i], v))
        };
        d.iter().copied().chain(dependent.faces().iter().zip(&self.derivatives).map(of_face)).collect()
    }

    /// Steps along the direction d; takes the product of the curvature matrix with `J d`.
    pub(super) fn advance(&mut self, dependent: &DependentNormals, products: &[Point]) {
        let image = transposed_jacobian_product(dependent, &self.derivatives, products);
        let curvature: f64 = self.direction.iter().zip(&image).map(|(&d, &i)| dot(d, i)).sum();
        let length = self.size / curvature;
        if !(length.is_finite() && length > 0.0) {
            self.done = true;
            return;
        }
        for (i, image) in image.iter().enumerate() {
            for k in 0..3 {
                self.step[i][k] += length * self.direction[i][k];
                self.residual[i][k] -= length * image[k];
            }
        }
    }
}

/// `Jᵀ w` of values w, T × 3.
fn transposed_jacobian_product(normals: &DependentNormals, derivatives: &[[[Point; 3]; 2]], w: &[Point]) -> Vec<Point> {
    let vertices = w.len() - derivatives.len();
    let mut out = w[..vertices].to_vec();
    for ((&[a, b, c], derivative), w) in normals.faces().iter().zip(derivatives).zip(&w[vertices..]) {
        let [u, v] = derivative.map(|rows| combination(*w, rows));
        for k in 0..3 {
            out[a as usize][k] -= u[k] + v[k];
            out[b as usize][k] += u[k];
            out[c as usize][k] += v[k];
        }
    }
    out
}

/// `A · X` for the X of every frame, each the same bits whatever the others.
pub(super) fn products<T: faer::traits::RealField + Copy>(
    a: MatRef<'_, T>,
    frames: &[impl AsRef<[Point]>],
    to: impl Fn(f64) -> T,
    from: impl Fn(T) -> f64,
) -> Vec<Vec<Point>> {
    if frames.is_empty() {
        return Vec::new();
    }
    let width = product_columns(frames.len());
    let mut columns = Mat::<T>::zeros(a.ncols(), width);
    for (f, frame) in frames.iter().enumerate() {
        for k in 0..3 {
            for (entry, row) in columns.col_as_slice_mut(3 * f + k).iter_mut().zip(frame.as_ref()) {
                *entry = to(row[k]);
            }
        }
    }
    let mut out = Mat::<T>::zeros(a.nrows(), width);
    cager_geometry::linalg::multiply(out.as_mut(), a, columns.as_ref());
    let rows = |f: usize| (0..a.ncols()).map(|j| [0, 1, 2].map(|k| from(out[(j, 3 * f + k)]))).collect();
    (0..frames.len()).map(rows).collect()
}
