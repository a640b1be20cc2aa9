//! What double precision leaves of mean value weights, and the repair of faces that are seen edge-on.
//!
//! The weights of a face are a quotient of two quantities that are small where the point lies near its plane, or the face
//! is thin or far away. How much that costs follows from the determinant, at next to no expense. Ordinary cages lose
//! digits at single faces only, whose weights [`mend_thin`] replaces. In thin cages all faces lose them, and the weights of
//! opposite sides cancel; the rows that [`is_unreliable`] finds are computed anew from the start.

use super::careful;
use super::mean_value::Scratch;
use crate::cage::{Cage, Face};
use crate::mesh;
use crate::simd::{LANES, Lanes};

/// Faces with a determinant below this fraction of their widest edge need weights of more digits.
const THIN: f64 = 1e-5;
/// Estimated error of a row's entries beyond which the row is computed with more digits.
pub(super) const TOLERANCE: f64 = 1e-11;
/// Length of a face's mean vector below which a point beside the face is not seen as one upon it.
const BESIDE: f64 = 0.1;
/// What takes the place of 1/0 where a point lies on a face.
const HUGE: f64 = 1e100;

/// What a lane group has had mended so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mended {
    /// Faces of each lane.
    faces: [usize; LANES],
    /// The sums of the squares of their weights.
    squares: [f64; LANES],
}

impl Mended {
    /// Whether so many faces are seen edge-on that the whole row had better be computed anew.
    fn is_too_much(&self, cage: &Cage, l: usize) -> bool {
        self.faces[l] > cage.faces().len() / 16 + 2
    }
}

/// Replaces the weights of those lanes whose point sees the face edge-on, and with them what rounding costs.
#[cold]
#[inline(never)]
#[allow(clippy::too_many_arguments)]
pub(super) fn mend_thin(
    cage: &Cage,
    scratch: &mut Scratch,
    face: &Face,
    x: [Lanes; 3],
    thinness: Lanes,
    m: &[Lanes; 3],
    loss: &mut Lanes,
    w: &mut [Lanes; 3],
) {
    for l in 0..LANES {
        if is_kept(thinness.0[l]) {
            continue;
        }
        let vertices = face.vertices.map(|v| v as usize);
        let mean = m.map(|c| c.0[l]);
        if mesh::dot(mean, mean) < BESIDE * BESIDE {
            // The plain formula divides rounding by rounding here.
            scratch.mended.faces[l] += 1;
            if scratch.mended.is_too_much(cage, l) {
                loss.0[l] = f64::INFINITY;
            } else if let Some(exact) = careful::face_weights(cage, face, x.map(|c| c.0[l])) {
                let values = [0, 1, 2].map(|i| exact[i] / scratch.nearness[vertices[i]].0[l]);
                for i in 0..3 {
                    w[i].0[l] = values[i];
                }
                loss.0[l] = mesh::dot(values, values);
                scratch.mended.squares[l] += mesh::dot(exact, exact);
            }
        } else if w.iter().any(|w| !w.0[l].is_finite()) {
            // On the face itself: only the ratios of the weights count.
            let u = vertices.map(|v| scratch.directions[v].map(|c| c.0[l]));
            for i in 0..3 {
                w[i].0[l] = HUGE * mesh::dot(mean, mesh::cross(u[(i + 1) % 3], u[(i + 2) % 3]));
            }
            loss.0[l] = f64::INFINITY;
        }
    }
}

/// Whether the entries of one row, whose weights add up to `total`, may be off by more than [`TOLERANCE`].
///
/// Directions and their cross products are off by ε, the rounding of doubles. So mean vectors are off by ε for each edge,
/// times `θ / sin θ`, and determinants by ε. The former errors add to the weights; the latter change all weights of a face
/// by a common factor, which matters as far as the face alone would give other coordinates than all of them do.
#[cold]
#[inline(never)]
pub(super) fn is_unreliable(cage: &Cage, scratch: &Scratch, l: usize, total: f64) -> bool {
    if scratch.mended.is_too_much(cage, l) {
        return true;
    }
    let mut error2 = scratch.mended.squares[l];
    for face in cage.faces() {
        let vertices = face.vertices.map(|v| v as usize);
        let sides = [0, 1, 2].map(|i| {
            let [x, y, z, _] = scratch.edges[face.edges[i] as usize];
            [x, y, z].map(|c| face.signs[i] * c.0[l])
        });
        let backs = face.edges.map(|e| scratch.edges[e as usize][3].0[l]);
        let mean = [0, 1, 2].map(|k| sides[0][k] + sides[1][k] + sides[2][k]);
        let det = mesh::dot(scratch.directions[vertices[0]].map(|c| c.0[l]), sides[0]) * backs[0];
        let inverse = (1.0 / det).clamp(-HUGE, HUGE);
        let thinness = (mesh::dot(sides[0], sides[0]) + mesh::dot(sides[1], sides[1])) * inverse * inverse;
        if !is_kept(thinness) && mesh::dot(mean, mean) < BESIDE * BESIDE {
            continue;
        }
        let low = inverse.abs();
        let nearness = vertices.map(|v| scratch.nearness[v].0[l]);
        let weights = [0, 1, 2].map(|i| mesh::dot(mean, sides[i]) * backs[i] * inverse * nearness[i]);
        let (seen, rounding) = (mesh::norm(mean), backs.iter().map(|b| 1.0 / b).sum::<f64>());
        let added = [0, 1, 2].map(|i| low * nearness[i] * (seen + rounding * mesh::norm(sides[i]) * backs[i]));
        let alone: f64 = weights.iter().sum();
        let shares = vertices.map(|v| scratch.weights[v].0[l] / total);
        let elsewhere = 1.0 - shares.iter().sum::<f64>();
        let apart = (0..3).map(|i| (weights[i] - alone * shares[i]).abs()).sum::<f64>() + (alone * elsewhere).abs();
        let scaled = low.min(1.0 / f64::EPSILON) * apart;
        error2 += mesh::dot(added, added) + scaled * scaled;
    }
    let largest = scratch.weights.iter().map(|w| w.0[l].abs()).fold(0.0, f64::max);
    let error = f64::EPSILON * (error2.sqrt() + largest) / total.abs();
    error.is_nan() || error > TOLERANCE
}

/// Whether the plain formula will do for a face, by the square of its width over its determinant; false for NaN.
#[inline(always)]
pub(super) fn is_kept(thinness: f64) -> bool {
    thinness < 1.0 / (THIN * THIN)
}
