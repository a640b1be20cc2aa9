//! Rotations by their rotation vectors, axis times angle.

use glam::{DMat3, DQuat, DVec3};

/// The rotation with this vector.
pub(crate) fn exp(w: DVec3) -> DMat3 {
    let angle = w.length();
    if angle < 1e-12 { DMat3::IDENTITY + skew(w) } else { DMat3::from_axis_angle(w / angle, angle) }
}

/// The vector of a rotation, no longer than π.
pub(crate) fn log(rotation: DMat3) -> DVec3 {
    rotation_vector(DQuat::from_mat3(&rotation))
}

/// [`log`] of a unit quaternion.
pub(crate) fn rotation_vector(q: DQuat) -> DVec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let axis = q.xyz();
    let sine = axis.length();
    if sine < 1e-12 { 2.0 * axis } else { axis * (2.0 * sine.atan2(q.w) / sine) }
}

/// The matrix of `x ↦ a × x`.
pub(crate) fn skew(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

/// The right Jacobian `J` of [`exp`]: `exp(w + d) ≈ exp(w) exp(J d)`.
pub(crate) fn right_jacobian(w: DVec3) -> DMat3 {
    let angle2 = w.length_squared();
    let angle = angle2.sqrt();
    let (a, b) = if angle < 1e-3 {
        (0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0)
    } else {
        ((1.0 - angle.cos()) / angle2, (angle - angle.sin()) / (angle2 * angle))
    };
    let k = skew(w);
    DMat3::IDENTITY - k * a + k * k * b
}

/// The smallest rotation from the direction of `a` to that of `b`; none where one has none.
pub(crate) fn between(a: DVec3, b: DVec3) -> DMat3 {
    let ends = a.try_normalize().zip(b.try_normalize());
    ends.map_or(DMat3::IDENTITY, |(a, b)| DMat3::from_quat(DQuat::from_rotation_arc(a, b)))
}

/// The rotation half-way from `a` to `b`.
pub(crate) fn halfway(a: DMat3, b: DMat3) -> DMat3 {
    exp(0.5 * log(b * a.transpose())) * a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_and_jacobians_belong_to_the_exponential() {
        let mut random = fastrand::Rng::with_seed(1);
        for k in 0..50 {
            let size = [1e-9, 1e-4, 0.3, 2.0][k % 4];
            let w = DVec3::new(random.f64() - 0.5, random.f64() - 0.5, random.f64() - 0.5) * size;
            assert!((log(exp(w)) - w).length() < 1e-12);
            let d = DVec3::new(random.f64() - 0.5, random.f64() - 0.5, random.f64() - 0.5);
            let step = 1e-5;
            let change = exp(w).transpose() * (exp(w + step * d) - exp(w - step * d)) * (0.5 / step);
            let expected = skew(right_jacobian(w) * d);
            assert!((change - expected).to_cols_array().iter().all(|x| x.abs() < 1e-8), "{change} {expected}");
            let (a, b) = (w / size, d);
            assert!((between(a, b) * a.normalize() - b.normalize()).length() < 1e-12);
        }
        assert!((between(DVec3::X, -DVec3::X) * DVec3::X + DVec3::X).length() < 1e-12);
        let half = halfway(exp(DVec3::X), exp(2.0 * DVec3::X));
        assert!((log(half) - 1.5 * DVec3::X).length() < 1e-12);
    }
}
