//! Normals that lean away from those of the faces around them, as angles that hold when the surface is deformed.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Angle below which a normal is that of the faces around: how programs weight these, and rounding, is within it.
const LEAST: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// How normals are tilted: see [`Part::tilts`](super::Part::tilts).
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub struct Tilts {
    /// Of the normal of each corner the angles from that of the faces around, in radians: along the edge to the next
    /// corner of the first face that has it, and across, counter-clockwise from there. Both are 0 where it is not tilted.
    #[serde(skip)]
    pub corners: Vec<[f32; 2]>,
}

/// The directions along an edge and across, in the plane of a unit normal; none where the edge does not say which.
fn tangents(normal: DVec3, edge: DVec3) -> Option<[DVec3; 2]> {
    let along = (edge - edge.dot(normal) * normal).try_normalize()?;
    Some([along, normal.cross(along)])
}

/// The angles at which a unit vector leans from a normal; `None` where they are too small, or the faces around have no
/// normal.
pub(super) fn angles(normal: DVec3, edge: DVec3, direction: DVec3) -> Option<[f32; 2]> {
    let [along, across] = tangents(normal, edge).filter(|_| normal != DVec3::ZERO && direction != DVec3::ZERO)?;
    let angle = normal.cross(direction).length().atan2(normal.dot(direction));
    let (x, y) = (direction.dot(along), direction.dot(across));
    // Of the opposite direction every one is as good.
    let length = x.hypot(y);
    let [x, y] = if length > 0.0 { [x / length, y / length] } else { [1.0, 0.0] };
    (angle > LEAST).then_some([(angle * x) as f32, (angle * y) as f32])
}

/// The unit vector that leans at these angles from a normal.
pub(super) fn leaning(normal: DVec3, edge: DVec3, angles: [f32; 2]) -> DVec3 {
    let [x, y] = angles.map(f64::from);
    let angle = x.hypot(y);
    match tangents(normal, edge) {
        Some([along, across]) if angle > 0.0 && normal != DVec3::ZERO => {
            angle.cos() * normal + angle.sin() / angle * (x * along + y * across)
        }
        _ => normal,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_comes_back_from_its_angles() {
        let (normal, edge) = (DVec3::new(0.0, 0.6, 0.8), DVec3::new(3.0, 1.0, 0.2));
        let mut random = fastrand::Rng::with_seed(3);
        let mut component = || random.f64() - 0.5;
        for _ in 0..200 {
            let direction = DVec3::new(component(), component(), component()).normalize();
            let back = leaning(normal, edge, angles(normal, edge, direction).unwrap_or_default());
            let is_near = normal.dot(direction) > LEAST.cos();
            assert!(back.dot(direction) > if is_near { LEAST.cos() } else { 1.0 - 1e-12 });
        }
        assert!(leaning(normal, edge, angles(normal, edge, -normal).unwrap()).dot(normal) < -1.0 + 1e-12);
    }

    #[test]
    fn what_is_not_tilted_or_has_no_direction_is_left_as_it_is() {
        let edge = DVec3::X;
        let at = |degrees: f64| DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
        assert_eq!(angles(DVec3::Z, edge, at(1.9)), None);
        let [along, across] = angles(DVec3::Z, edge, at(30.0)).unwrap();
        assert!((along - 30_f32.to_radians()).abs() < 1e-6 && across == 0.0);
        assert_eq!(angles(DVec3::Z, 5.0 * DVec3::Z, at(30.0)), None);
        assert_eq!(angles(DVec3::ZERO, edge, at(30.0)), None);
        assert_eq!(angles(DVec3::Z, edge, DVec3::ZERO), None);
        assert_eq!(leaning(DVec3::Z, DVec3::ZERO, [0.5, 0.1]), DVec3::Z);
        assert_eq!(leaning(DVec3::ZERO, edge, [0.5, 0.1]), DVec3::ZERO);
    }
}
