//! Transforms of points that are rows, so that a matrix stands behind what it moves.

pub(crate) type Matrix = [[f64; 4]; 4];

pub(crate) const IDENTITY: Matrix =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

pub(crate) fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Of rows, about an axis; the identity where there is none.
pub(crate) fn rotation(axis: [f64; 3], degrees: f64) -> Matrix {
    let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length == 0.0 {
        return IDENTITY;
    }
    let [x, y, z] = axis.map(|value| value / length);
    let (s, c) = degrees.to_radians().sin_cos();
    let t = 1.0 - c;
    [
        [c + t * x * x, t * x * y + s * z, t * x * z - s * y, 0.0],
        [t * x * y - s * z, c + t * y * y, t * y * z + s * x, 0.0],
        [t * x * z + s * y, t * y * z - s * x, c + t * z * z, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// Moves points, `x y z x y z …`.
pub(super) fn apply(m: &Matrix, points: &mut [f64]) {
    for point in points.as_chunks_mut::<3>().0 {
        let [x, y, z] = *point;
        *point = std::array::from_fn(|k| x * m[0][k] + y * m[1][k] + z * m[2][k] + m[3][k]);
    }
}

/// By how much a matrix makes volumes larger; less than 0 where it turns the inside out.
pub(crate) fn determinant(m: &Matrix) -> f64 {
    let [a, b, c] = [m[0], m[1], m[2]];
    let minor = |i: usize, j: usize| b[i] * c[j] - b[j] * c[i];
    a[0] * minor(1, 2) - a[1] * minor(0, 2) + a[2] * minor(0, 1)
}

/// What brings points back where they were; not finite where nothing does.
pub(crate) fn inverse(m: &Matrix) -> Matrix {
    let determinant = determinant(m);
    let mut back = IDENTITY;
    for (i, row) in back.iter_mut().enumerate().take(3) {
        for (j, value) in row.iter_mut().enumerate().take(3) {
            let [r, s, p, q] = [(j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3];
            *value = (m[r][p] * m[s][q] - m[r][q] * m[s][p]) / determinant;
        }
    }
    back[3] = std::array::from_fn(|k| if k == 3 { 1.0 } else { -(0..3).map(|i| m[3][i] * back[i][k]).sum::<f64>() });
    back
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inverse_brings_points_back() {
        let mut matrix = multiply(&rotation([1.0, -2.0, 0.5], 40.0), &rotation([0.0, 1.0, 0.0], -75.0));
        matrix[0].iter_mut().for_each(|x| *x *= -3.0);
        matrix[3] = [5.0, -6.0, 7.0, 1.0];
        let product = multiply(&matrix, &inverse(&matrix));
        assert!(product.as_flattened().iter().zip(IDENTITY.as_flattened()).all(|(x, y)| (x - y).abs() < 1e-14));
        assert!(determinant(&matrix) < 0.0 && determinant(&IDENTITY) > 0.0);
    }
}
