//! The rotation nearest to a 3 × 3 matrix.

use glam::{DMat3, DQuat};

use super::small::symmetric_eigen;

/// The rotation R that maximises `tr(Rᵀ A)`: of all rotations the one nearest to A, reflections never (Horn, Closed-form solution of absolute
/// orientation using unit quaternions, 1987). With `A = Σ wᵢ bᵢ aᵢᵀ`, R turns the aᵢ onto the bᵢ best. The identity for A = 0, and where A is not finite.
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
