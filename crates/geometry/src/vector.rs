//! Arithmetic of points and vectors in space.

/// A point or vector in space.
pub type Point = [f64; 3];

/// `a + b`.
#[inline]
pub fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a − b`.
#[inline]
pub fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `p + t d`: the point on the line from `p` along `d`.
#[inline]
pub fn along(p: Point, t: f64, d: Point) -> Point {
    [p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]]
}

/// The point half-way between two.
#[inline]
pub fn middle(a: Point, b: Point) -> Point {
    add(a, b).map(|x| 0.5 * x)
}

/// The centre of a triangle.
#[inline]
pub fn centroid([a, b, c]: [Point; 3]) -> Point {
    add(add(a, b), c).map(|x| x / 3.0)
}

/// The mean of points; NaN without any.
pub fn mean(points: &[Point]) -> Point {
    std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64)
}

/// `Σ wᵢ pᵢ`.
#[inline]
pub fn combination(weights: [f64; 3], points: [Point; 3]) -> Point {
    let ([u, v, w], [a, b, c]) = (weights, points);
    std::array::from_fn(|k| u * a[k] + v * b[k] + w * c[k])
}

/// Scalar product.
#[inline]
pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cross product.
#[inline]
pub fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Euclidean length.
#[inline]
pub fn norm(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// Distance between two points.
#[inline]
pub fn distance(a: Point, b: Point) -> f64 {
    norm(sub(a, b))
}
