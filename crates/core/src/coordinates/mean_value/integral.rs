//! Mean value weights of a face as the integrals that define them (Ju, Schaefer and Warren 2005):
//! `w_i = h ∫ λ_i / |r|⁴ dA`, with `r` from the point to the face, `h` the height of the face's
//! plane and `λ_i` the barycentric coordinates. The integrands have one sign, so nothing cancels.

use cager_geometry::mesh::{Point, distance2_to_triangle};
use cager_geometry::vector::{along, cross, dot, middle, sub};

/// Nodes and weights of Gauss's rule with eight points on [0, 1], exact to degree 15.
const GAUSS: [[f64; 2]; 8] = [
    [0.019_855_071_751_231_884, 0.050_614_268_145_188_13],
    [0.101_666_761_293_186_63, 0.111_190_517_226_687_24],
    [0.237_233_795_041_835_5, 0.156_853_322_938_943_64],
    [0.408_282_678_752_175_1, 0.181_341_891_689_181],
    [0.591_717_321_247_825, 0.181_341_891_689_181],
    [0.762_766_204_958_164_5, 0.156_853_322_938_943_64],
    [0.898_333_238_706_813_4, 0.111_190_517_226_687_24],
    [0.980_144_928_248_768_1, 0.050_614_268_145_188_13],
];
/// Pieces are halved until their longest side is at most this fraction of their distance.
const MAX_SIDE_OVER_DISTANCE: f64 = 0.35;
/// Halvings at most; a longest side is halved by every second one.
const MAX_HALVINGS: u32 = 120;

/// Weights of the corners of a face for the point `x`.
pub(super) fn face_weights(corners: [Point; 3], x: Point) -> [f64; 3] {
    let [a, b, c] = corners;
    let sides = [sub(c, b), sub(a, c), sub(b, a)];
    // The normal, times twice the area, from the two shortest sides, whose product rounds least.
    let longest = longest(&sides);
    let normal = cross(sides[(longest + 1) % 3], sides[(longest + 2) % 3]);
    let seen = corners.map(|corner| sub(corner, x));
    let mut sums = [0.0; 3];
    integrate(seen, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1.0, MAX_HALVINGS, &mut sums);
    sums.map(|sum| sum * dot(seen[longest], normal))
}

fn longest(sides: &[Point; 3]) -> usize {
    (0..3).fold(0, |best, i| if dot(sides[i], sides[i]) > dot(sides[best], sides[best]) { i } else { best })
}

/// Adds `∫ λ_i / |r|⁴ dA` over a piece, given by its corners, their barycentric coordinates and its
/// share of the face's area, in the unit in which that is one half.
fn integrate(corners: [Point; 3], barycentric: [Point; 3], share: f64, depth: u32, sums: &mut Point) {
    let [a, b, c] = corners;
    let sides = [sub(c, b), sub(a, c), sub(b, a)];
    let top = longest(&sides);
    let reach2 = distance2_to_triangle(corners, [0.0; 3]) * (MAX_SIDE_OVER_DISTANCE * MAX_SIDE_OVER_DISTANCE);
    if depth > 0 && dot(sides[top], sides[top]) > reach2 {
        let (i, j) = ((top + 1) % 3, (top + 2) % 3);
        let middles = (middle(corners[i], corners[j]), middle(barycentric[i], barycentric[j]));
        for replaced in [i, j] {
            let (mut corners, mut barycentric) = (corners, barycentric);
            (corners[replaced], barycentric[replaced]) = middles;
            integrate(corners, barycentric, 0.5 * share, depth - 1, sums);
        }
        return;
    }
    // Collapsed coordinates: y = a + u (b − a) + u v (c − b), dA = 2 area · u du dv.
    let [bc, _, ab] = sides;
    let mut local = [0.0; 3];
    for [u, weight_u] in GAUSS {
        let start: Point = along(a, u, ab);
        for [v, weight_v] in GAUSS {
            let r = along(start, u * v, bc);
            let r2 = dot(r, r);
            let value = weight_u * weight_v * u / (r2 * r2);
            local[0] += value * (1.0 - u);
            local[1] += value * u * (1.0 - v);
            local[2] += value * u * v;
        }
    }
    for i in 0..3 {
        sums[i] += share * (0..3).map(|j| local[j] * barycentric[j][i]).sum::<f64>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_all_faces_balance_however_flat_the_cage() {
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        for (thickness, x) in
            [(1.0, [0.3, 0.1, 2.0]), (1e-4, [0.2, 0.3, 1.0]), (1e-4, [3.0, 1.0, 1e-9]), (1.0, [300.0, 7.0, 9.0])]
        {
            let vertices =
                [[-1.0, 0.0, -thickness], [1.0, 0.0, -thickness], [0.0, -1.0, thickness], [0.0, 1.0, thickness]];
            let (mut sum, mut size) = ([0.0; 3], 0.0);
            for face in faces {
                let corners = face.map(|v: usize| vertices[v]);
                for (weight, corner) in face_weights(corners, x).into_iter().zip(corners) {
                    for k in 0..3 {
                        sum[k] += weight * (corner[k] - x[k]);
                        size += (weight * (corner[k] - x[k])).abs();
                    }
                }
            }
            assert!(sum.iter().all(|s| s.abs() < 1e-15 * size), "{thickness}: {sum:?} of {size:e}");
        }
    }
}
