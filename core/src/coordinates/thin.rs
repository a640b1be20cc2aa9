//! Mean value weights of faces that a point sees edge-on, where the plain formula divides rounding by rounding.
//!
//! All weights here are still to be divided by the distances of the vertices.

use crate::mesh::{Point, dot, norm};

/// Weights, still to be divided by the distances, of a face that `x` sees almost edge-on from beside it.
///
/// Here `θ_i − θ_j cos φ_k − θ_k cos φ_j` (Ju et al., §3) is a difference of nearly equal angles; it is rewritten in the
/// spherical excess and in `1 ∓ cos φ`, which are small by themselves. `None` where the triangle is not of that shape.
pub(super) fn flat_weights(u: [Point; 3], det: f64) -> Option<[f64; 3]> {
    if det == 0.0 {
        return Some([0.0; 3]);
    }
    let mut theta = [0.0; 3];
    let mut sine = [0.0; 3];
    let mut half_cosine = [0.0; 3];
    for i in 0..3 {
        let (a, b) = (u[(i + 1) % 3], u[(i + 2) % 3]);
        let chord = norm([a[0] - b[0], a[1] - b[1], a[2] - b[2]]);
        let bisector = norm([a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
        theta[i] = 2.0 * chord.atan2(bisector);
        sine[i] = 0.5 * chord * bisector;
        half_cosine[i] = 0.5 * bisector;
    }
    let first = (0..3).max_by(|&a, &b| theta[a].total_cmp(&theta[b]))?;
    let [a, b, c] = [first, (first + 1) % 3, (first + 2) % 3];
    let size = det.abs();
    let sin_phi = |i: usize| size / (sine[(i + 1) % 3] * sine[(i + 2) % 3]);
    // One side is the sum of the other two: flat at the corner opposite to it, sharp at the others.
    let cosine_sign = |i: usize| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        theta[i].cos() - theta[j].cos() * theta[k].cos()
    };
    let sines = [sin_phi(0), sin_phi(1), sin_phi(2)];
    // A short side is known to rounding only, which the square of the widest corner brings into the weights.
    const ACCEPTED: f64 = 1e-10;
    let precise = |s: f64| s < 0.5 && f64::EPSILON * s * s < ACCEPTED * size;
    let flat =
        sines.iter().all(|&s| precise(s)) && cosine_sign(a) < 0.0 && cosine_sign(b) > 0.0 && cosine_sign(c) > 0.0;
    if !flat {
        return None;
    }
    let versine = |s: f64| s * s / (1.0 + (1.0 - s * s).sqrt());
    let half_excess = (size / (4.0 * half_cosine[0] * half_cosine[1] * half_cosine[2])).min(1.0).asin();
    let s = 0.5 * (theta[0] + theta[1] + theta[2]);
    let product = (0.5 * s).tan() * (0.5 * (s - theta[b])).tan() * (0.5 * (s - theta[c])).tan();
    let slack = 2.0 * (((0.5 * half_excess).tan().powi(2)) / product).atan();
    if !(product > 0.0 && slack.is_finite()) {
        return None;
    }
    let mut x = [0.0; 3];
    x[a] = -2.0 * slack + theta[b] * versine(sines[c]) + theta[c] * versine(sines[b]);
    x[b] = 2.0 * slack - theta[c] * versine(sines[a]) + theta[a] * versine(sines[c]);
    x[c] = 2.0 * slack - theta[b] * versine(sines[a]) + theta[a] * versine(sines[b]);
    Some([0, 1, 2].map(|i| sine[i] * x[i] / (2.0 * det)))
}

/// Weights of a face seen under so small a solid angle that three digits of them are enough, from the integral that defines
/// them: `w_i = h ∫ λ_i / ρ⁴ dA` over the face, h the height of the point above its plane.
pub(super) fn sliver_weights(u: [Point; 3], distances: [f64; 3], det: f64) -> [f64; 3] {
    /// Barycentric points and weights of a rule of degree five.
    const RULE: [([f64; 3], f64); 7] = [
        ([1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], 0.225),
        ([0.059_715_871_789_770, 0.470_142_064_105_115, 0.470_142_064_105_115], 0.132_394_152_788_506),
        ([0.470_142_064_105_115, 0.059_715_871_789_770, 0.470_142_064_105_115], 0.132_394_152_788_506),
        ([0.470_142_064_105_115, 0.470_142_064_105_115, 0.059_715_871_789_770], 0.132_394_152_788_506),
        ([0.797_426_985_353_087, 0.101_286_507_323_456, 0.101_286_507_323_456], 0.125_939_180_544_827),
        ([0.101_286_507_323_456, 0.797_426_985_353_087, 0.101_286_507_323_456], 0.125_939_180_544_827),
        ([0.101_286_507_323_456, 0.101_286_507_323_456, 0.797_426_985_353_087], 0.125_939_180_544_827),
    ];
    const MAX_PIECES: usize = 4096;
    let corners = [0, 1, 2].map(|i| u[i].map(|c| c * distances[i]));
    let at = |l: Point| [0, 1, 2].map(|k| l[0] * corners[0][k] + l[1] * corners[1][k] + l[2] * corners[2][k]);
    let mut sums = [0.0; 3];
    let mut pieces = vec![([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1.0)];
    let mut split = 0;
    while let Some((piece, share)) = pieces.pop() {
        let [a, b, c] = piece.map(at);
        let span = |p: Point, q: Point| norm([p[0] - q[0], p[1] - q[1], p[2] - q[2]]);
        let spans = [span(b, c), span(c, a), span(a, b)];
        let longest = (0..3).fold(0, |best, i| if spans[i] > spans[best] { i } else { best });
        let nearest = norm(a).min(norm(b)).min(norm(c));
        if spans[longest] > 0.7 * nearest && split < MAX_PIECES {
            // Halving the longest side cuts needles along their length.
            split += 1;
            let (j, k) = ((longest + 1) % 3, (longest + 2) % 3);
            let middle = [0, 1, 2].map(|i| 0.5 * (piece[j][i] + piece[k][i]));
            let (mut one, mut other) = (piece, piece);
            one[j] = middle;
            other[k] = middle;
            pieces.push((one, 0.5 * share));
            pieces.push((other, 0.5 * share));
            continue;
        }
        for (inner, weight) in RULE {
            let l = [0, 1, 2].map(|i| inner[0] * piece[0][i] + inner[1] * piece[1][i] + inner[2] * piece[2][i]);
            let p = at(l);
            let rho2 = dot(p, p);
            let factor = share * weight / (rho2 * rho2);
            for i in 0..3 {
                sums[i] += factor * l[i];
            }
        }
    }
    let volume = 0.5 * det * distances[0] * distances[1] * distances[2];
    [0, 1, 2].map(|i| sums[i] * volume * distances[i])
}
