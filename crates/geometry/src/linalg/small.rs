//! Eigenvalues of matrices of a few rows, and the rotation nearest to one of three.

use glam::{DMat3, DQuat};

/// Sweeps after which matrices of a few rows are diagonal to rounding.
const MAX_SWEEPS: usize = 16;

/// Eigenvalues of a symmetric matrix, the largest first, and their unit vectors (Jacobi).
pub fn symmetric_eigen<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut vectors = [[0.0; N]; N];
    (0..N).for_each(|k| vectors[k][k] = 1.0);
    let size: f64 = a.iter().flatten().map(|x| x * x).sum();
    for _ in 0..MAX_SWEEPS {
        let pairs = (0..N).flat_map(|i| (0..i).map(move |j| (i, j)));
        let off_diagonal: f64 = pairs.map(|(i, j)| a[i][j] * a[i][j]).sum();
        if off_diagonal <= 1e-30 * size {
            break;
        }
        for p in 0..N {
            for q in p + 1..N {
                rotate(&mut a, &mut vectors, p, q);
            }
        }
    }
    let mut order: [usize; N] = std::array::from_fn(|k| k);
    order.sort_by(|&i, &j| a[j][j].total_cmp(&a[i][i]));
    (order.map(|k| a[k][k]), order.map(|k| vectors[k]))
}

/// Makes one entry beside the diagonal 0. `vectors` has the eigenvectors in its rows.
fn rotate<const N: usize>(a: &mut [[f64; N]; N], vectors: &mut [[f64; N]; N], p: usize, q: usize) {
    if a[p][q] == 0.0 {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for k in 0..N {
        (a[k][p], a[k][q]) = (c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]);
    }
    for k in 0..N {
        (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
        (vectors[p][k], vectors[q][k]) = (c * vectors[p][k] - s * vectors[q][k], s * vectors[p][k] + c * vectors[q][k]);
    }
}

/// The rotation nearest to A, which maximises `tr(Rᵀ A)` (Horn, Closed-form solution of absolute
/// orientation using unit quaternions, 1987). With `A = Σ wᵢ bᵢ aᵢᵀ`, R turns the aᵢ onto the bᵢ
/// best. The identity for A = 0, and where A is not finite.
pub fn nearest_rotation(a: DMat3) -> DMat3 {
    if !a.is_finite() {
        return DMat3::IDENTITY;
    }
    // Row k of the columns of A.
    let at = |row: usize, column: usize| a.col(column)[row];
    let (xx, yy, zz) = (at(0, 0), at(1, 1), at(2, 2));
    let (x, y, z) = (at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1));
    let (xy, yz, zx) = (at(0, 1) + at(1, 0), at(1, 2) + at(2, 1), at(0, 2) + at(2, 0));
    let (_, [[w, x, y, z], ..]) = symmetric_eigen([
        [xx + yy + zz, x, y, z],
        [x, xx - yy - zz, xy, zx],
        [y, xy, yy - xx - zz, yz],
        [z, zx, yz, zz - xx - yy],
    ]);
    DMat3::from_quat(DQuat::from_xyzw(x, y, z, w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn eigenvectors_times_eigenvalues_give_the_matrix_back() {
        let mut random = fastrand::Rng::with_seed(2);
        for _ in 0..100 {
            let b: [[f64; 4]; 4] = std::array::from_fn(|_| std::array::from_fn(|_| random.f64() - 0.5));
            let a: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| b[i][j] + b[j][i]));
            let (values, vectors) = symmetric_eigen(a);
            assert!(values.is_sorted_by(|x, y| x >= y));
            for i in 0..4 {
                for j in 0..4 {
                    let sum: f64 = (0..4).map(|k| values[k] * vectors[k][i] * vectors[k][j]).sum();
                    assert!((sum - a[i][j]).abs() < 1e-13);
                }
            }
        }
        assert_eq!(symmetric_eigen([[0.0; 3]; 3]).0, [0.0; 3]);
    }

    #[test]
    fn turned_and_stretched_points_give_their_rotation_back() {
        let mut random = fastrand::Rng::with_seed(1);
        let mut vector = || DVec3::from_array(std::array::from_fn(|_| 2.0 * random.f64() - 1.0));
        for _ in 0..200 {
            let rotation = DMat3::from_axis_angle(vector().normalize(), 3.0 * vector().x);
            let b = DMat3::from_cols(vector(), vector(), vector());
            let stretch = b * b.transpose() + DMat3::IDENTITY * 1e-3;
            let found = nearest_rotation(rotation * stretch);
            assert!(found.abs_diff_eq(rotation, 1e-9), "{found} is not {rotation}");
        }
    }

    #[test]
    fn a_reflection_a_line_and_nothing_give_rotations() {
        let line = DMat3::from_cols(DVec3::new(0.0, 2.0, 0.0), DVec3::ZERO, DVec3::ZERO);
        for a in [DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)), line, DMat3::ZERO, DMat3::IDENTITY * f64::NAN] {
            let r = nearest_rotation(a);
            assert!((r.determinant() - 1.0).abs() < 1e-12 && (r * r.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
        }
        assert!((nearest_rotation(line) * DVec3::X - DVec3::Y).length() < 1e-12);
        assert_eq!(nearest_rotation(DMat3::ZERO), DMat3::IDENTITY);
    }
}
