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

/// A matrix on the way from one to another: places and sizes in a line, rotations on the shorter way; in a line as well what shears or mirrors.
pub(crate) fn between(from: &Matrix, to: &Matrix, share: f64) -> Matrix {
    let mut line: Matrix =
        std::array::from_fn(|i| std::array::from_fn(|j| from[i][j] + share * (to[i][j] - from[i][j])));
    if let (Some((sizes, start)), Some((larger, end))) = (turned(from), turned(to)) {
        let rows = rows_of(slerp(start, end, share));
        for (k, row) in rows.iter().enumerate() {
            let size = sizes[k] + share * (larger[k] - sizes[k]);
            (0..3).for_each(|j| line[k][j] = size * row[j]);
        }
    }
    line
}

/// The sizes of a matrix's rows and its rotation as a quaternion, real part last, where it is no more than these and a translation.
fn turned(m: &Matrix) -> Option<([f64; 3], [f64; 4])> {
    let dot = |i: usize, j: usize| (0..3).map(|k| m[i][k] * m[j][k]).sum::<f64>();
    let sizes: [f64; 3] = std::array::from_fn(|k| dot(k, k).sqrt());
    let is_square = (0..3).all(|k| dot(k, (k + 1) % 3).abs() <= 1e-6 * sizes[k] * sizes[(k + 1) % 3]);
    let is_affine = [m[0][3], m[1][3], m[2][3], m[3][3]] == [0.0, 0.0, 0.0, 1.0];
    if !(is_square && is_affine && determinant(m) > 0.0) {
        return None;
    }
    let r: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| m[i][j] / sizes[i]));
    let trace = r[0][0] + r[1][1] + r[2][2];
    let mut q = [0.0; 4];
    if trace > 0.0 {
        let s = 2.0 * (1.0 + trace).sqrt();
        (0..3).for_each(|k| q[k] = (r[(k + 1) % 3][(k + 2) % 3] - r[(k + 2) % 3][(k + 1) % 3]) / s);
        q[3] = s / 4.0;
    } else {
        let i = (0..3).max_by(|&a, &b| r[a][a].total_cmp(&r[b][b])).unwrap_or(0);
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let s = 2.0 * (1.0 + r[i][i] - r[j][j] - r[k][k]).max(0.0).sqrt();
        (q[i], q[j], q[k]) = (s / 4.0, (r[i][j] + r[j][i]) / s, (r[i][k] + r[k][i]) / s);
        q[3] = (r[j][k] - r[k][j]) / s;
    }
    Some((sizes, q))
}

/// The rows of the rotation of a quaternion, its real part last, as it is, without regard to its length.
pub(crate) fn rows_of([x, y, z, w]: [f64; 4]) -> [[f64; 3]; 3] {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)],
        [2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)],
        [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// A rotation on the shorter way from one to another, at an even pace.
pub(crate) fn slerp(from: [f64; 4], to: [f64; 4], share: f64) -> [f64; 4] {
    let cosine: f64 = from.iter().zip(&to).map(|(a, b)| a * b).sum();
    let (sign, angle) = (cosine.signum(), cosine.abs().min(1.0).acos());
    let (near, far) = if angle < 1e-6 {
        (1.0 - share, share)
    } else {
        (((1.0 - share) * angle).sin() / angle.sin(), (share * angle).sin() / angle.sin())
    };
    std::array::from_fn(|k| near * from[k] + sign * far * to[k])
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
    fn rotations_keep_their_size_on_the_way() {
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, -2.0, 0.5]] {
            for degrees in [0.0, 10.0, 90.0, 172.0] {
                let of = |share: f64| {
                    let mut matrix = rotation(axis, share * degrees);
                    matrix[..3].as_flattened_mut().iter_mut().for_each(|x| *x *= 2.0 + share);
                    matrix[3] = [share, 0.0, 1.0, 1.0];
                    multiply(&matrix, &rotation([0.0, 1.0, 0.0], 200.0))
                };
                let found = between(&of(0.0), &of(1.0), 0.25);
                let wanted = of(0.25);
                let is_close = |(x, y): (&f64, &f64)| (x - y).abs() < 1e-12;
                assert!(
                    found.as_flattened()[..12].iter().zip(wanted.as_flattened()).all(is_close),
                    "{axis:?} {degrees}"
                );
            }
        }
        // What mirrors goes in a line.
        let mut mirrored = IDENTITY;
        mirrored[0][0] = -1.0;
        assert_eq!(between(&IDENTITY, &mirrored, 0.5)[0][0], 0.0);
    }

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
