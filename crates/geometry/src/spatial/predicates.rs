//! Exact signs of determinants (Shewchuk 1997).

use glam::DVec3;
use robust::{Coord, Coord3D};

/// Positive where `a`, `b`, `c` turn counter-clockwise as seen from `d`.
pub fn orient3d(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let coord = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    -robust::orient3d(coord(a), coord(b), coord(c), coord(d))
}

/// Positive where `a`, `b`, `c` turn counter-clockwise in the plane without `axis`.
pub fn orient2d(a: DVec3, b: DVec3, c: DVec3, axis: usize) -> f64 {
    let coord = |p: DVec3| Coord { x: p[(axis + 1) % 3], y: p[(axis + 2) % 3] };
    robust::orient2d(coord(a), coord(b), coord(c))
}
