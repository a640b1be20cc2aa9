//! Distances between points, segments and triangles (Ericson, Real-Time Collision Detection, 5.1).
//! Degenerate segments and triangles are allowed.

use glam::DVec3;

/// The point of a triangle nearest to `p`, as weights of the corners.
#[inline]
pub fn closest_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let normal = ab.cross(ac);
    let area2 = normal.length_squared();
    let beta = ap.cross(ac).dot(normal);
    let gamma = ab.cross(ap).dot(normal);
    let longest2 = ab.length_squared().max(ac.length_squared());
    if area2 > 1e-24 * longest2 * longest2 && beta >= 0.0 && gamma >= 0.0 && beta + gamma <= area2 {
        let (v, w) = (beta / area2, gamma / area2);
        return [1.0 - v - w, v, w];
    }
    let on_edge = |s: DVec3, e: DVec3| {
        let t = closest_on_segment(p, s, e);
        ((s + t * (e - s)).distance_squared(p), t)
    };
    let ((ab2, t), (bc2, u), (ca2, v)) = (on_edge(a, b), on_edge(b, c), on_edge(c, a));
    if ab2 <= bc2 && ab2 <= ca2 {
        [1.0 - t, t, 0.0]
    } else if bc2 <= ca2 {
        [0.0, 1.0 - u, u]
    } else {
        [v, 0.0, 1.0 - v]
    }
}

/// Squared distance from `p` to a triangle.
#[inline]
pub fn point_triangle2(p: DVec3, triangle: [DVec3; 3]) -> f64 {
    let [u, v, w] = closest_on_triangle(p, triangle);
    (u * triangle[0] + v * triangle[1] + w * triangle[2]).distance_squared(p)
}

/// Parameter in 0..=1 of the point of segment `a`–`b` nearest to `p`.
#[inline]
pub fn closest_on_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let d = b - a;
    ((p - a).dot(d) / d.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

/// Parameters `(s, t)` in 0..=1 of the nearest points of the segments `a`–`b` and `c`–`d`.
pub fn closest_on_segments([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> (f64, f64) {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, vv, uv) = (u.length_squared(), v.length_squared(), u.dot(v));
    let (uw, vw) = (u.dot(w), v.dot(w));
    let tiny = f64::MIN_POSITIVE;
    if uu <= tiny {
        return (0.0, closest_on_segment(a, c, d));
    }
    if vv <= tiny {
        return (closest_on_segment(c, a, b), 0.0);
    }
    let determinant = uu * vv - uv * uv;
    // Parallel segments have many nearest pairs: any start will do, the clamping below ends it.
    let s = if determinant > 1e-14 * uu * vv { ((uv * vw - vv * uw) / determinant).clamp(0.0, 1.0) } else { 0.0 };
    let t = (uv * s + vw) / vv;
    if t < 0.0 {
        ((-uw / uu).clamp(0.0, 1.0), 0.0)
    } else if t > 1.0 {
        (((uv - uw) / uu).clamp(0.0, 1.0), 1.0)
    } else {
        (s, t)
    }
}
