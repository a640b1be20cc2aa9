//! Makes linear functions exact, by the best linear function of every column of data.

use cager_geometry::mesh::Point;
use cager_geometry::vector::mean;
#[cfg(test)]
use faer::Mat;
use faer::MatMut;

/// The linear functions that fit the hat functions best: with `V̂ = [1 V]`, v × 4, the
/// pseudo-inverse `M`, 4 × v.
pub(super) struct AffineFit {
    /// Subtracted from positions before anything else.
    centre: Point,
    /// Columns of M.
    columns: Vec<[f64; 4]>,
    /// Rows of V̂.
    rows: Vec<[f64; 4]>,
}

impl AffineFit {
    pub(super) fn new(vertices: &[Point]) -> Self {
        let centre = mean(vertices);
        let rows: Vec<[f64; 4]> = vertices.iter().map(|v| row(*v, centre)).collect();
        // Orthonormal columns by Gram and Schmidt, twice, with the triangular factor.
        let mut q = rows.clone();
        let mut inverse = [[0.0; 4]; 4];
        for (k, unit) in inverse.iter_mut().enumerate() {
            unit[k] = 1.0;
        }
        for k in 0..4 {
            for _ in 0..2 {
                for j in 0..k {
                    let share: f64 = q.iter().map(|r| r[j] * r[k]).sum();
                    q.iter_mut().for_each(|r| r[k] -= share * r[j]);
                    for i in 0..4 {
                        inverse[i][k] -= share * inverse[i][j];
                    }
                }
            }
            let size = q.iter().map(|r| r[k] * r[k]).sum::<f64>().sqrt();
            q.iter_mut().for_each(|r| r[k] /= size);
            inverse.iter_mut().for_each(|r| r[k] /= size);
        }
        // V̂ = Q R, so M = R⁻¹ Qᵀ.
        let columns = q.iter().map(|r| [0, 1, 2, 3].map(|i| (0..4).map(|k| inverse[i][k] * r[k]).sum())).collect();
        Self { centre, columns, rows }
    }

    /// Makes these points' rows reproduce linear functions; returns the largest change, or NaN.
    pub(super) fn complete(&self, mut a: MatMut<'_, f64>, points: impl Iterator<Item = Point>) -> f64 {
        let mut missing: Vec<[f64; 4]> = points.map(|x| row(x, self.centre)).collect();
        for (j, row) in self.rows.iter().enumerate() {
            for (missing, &value) in missing.iter_mut().zip(a.as_ref().col(j).iter()) {
                for k in 0..4 {
                    missing[k] -= value * row[k];
                }
            }
        }
        let mut largest = 0.0f64;
        let mut finite = true;
        for (j, column) in self.columns.iter().enumerate() {
            for (missing, value) in missing.iter().zip(a.as_mut().col_mut(j).iter_mut()) {
                let change: f64 = (0..4).map(|k| missing[k] * column[k]).sum();
                *value += change;
                finite &= value.is_finite();
                largest = largest.max(change.abs());
            }
        }
        if finite { largest } else { f64::NAN }
    }

    /// `M V̂`, 4 × 4.
    #[cfg(test)]
    pub(super) fn product(&self) -> Mat<f64> {
        Mat::from_fn(4, 4, |i, k| self.columns.iter().zip(&self.rows).map(|(c, r)| c[i] * r[k]).sum())
    }
}

fn row(p: Point, centre: Point) -> [f64; 4] {
    [1.0, p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_functions_fit_themselves_in_thin_cages_too() {
        for thickness in [1.0, 1e-4, 1e-8] {
            let vertices: Vec<Point> = (0..40)
                .map(|k| {
                    let t = f64::from(k);
                    [t.sin(), (1.7 * t).cos(), thickness * (2.9 * t).sin()]
                })
                .collect();
            let product = AffineFit::new(&vertices).product();
            for i in 0..4 {
                for k in 0..4 {
                    let expected = if i == k { 1.0 } else { 0.0 };
                    let scale = if i == 3 { thickness } else { 1.0 };
                    assert!((product[(i, k)] - expected).abs() * scale < 1e-13, "{thickness} {i} {k}");
                }
            }
        }
    }
}
