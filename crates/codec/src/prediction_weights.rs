//! Predicts the position of a vertex at rest by parallelograms and the mean of its neighbours, with
//! weights fitted to the mesh: scans need the mean, modelled meshes the parallelograms.

use crate::entropy::MAX_SIZE;
use crate::parallelograms::Predictions;
use cager_geometry::topology::Adjacency;

/// Weights are counted in these parts; so are predictions before they are rounded.
const PARTS: i64 = 32;
/// By how many parallelograms predict a vertex, these and more alike.
const CLASSES: usize = 3;
/// About the most vertices that weights are fitted to.
const SAMPLE: usize = 1 << 16;
/// Rounds of fitting by reweighted least squares, which comes near the least sum of sizes.
const ROUNDS: usize = 8;

/// Weights of parallelograms and neighbours for each class, from the middle of the edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PredictionWeights([[i8; 2]; CLASSES]);

/// In parts of a step: the middle of the edges, and what parallelograms and neighbours differ by.
struct Terms {
    middle: i64,
    differences: [i64; 2],
}

impl PredictionWeights {
    pub(crate) fn from_bytes(bytes: [u8; 2 * CLASSES]) -> Self {
        Self(std::array::from_fn(|class| [bytes[2 * class] as i8, bytes[2 * class + 1] as i8]))
    }

    pub(crate) fn to_bytes(self) -> [u8; 2 * CLASSES] {
        std::array::from_fn(|k| self.0[k / 2][k % 2] as u8)
    }

    /// Those that fit positions in steps best.
    pub(crate) fn fit(predictions: &Predictions, adjacency: &Adjacency, given: &[[i32; 3]]) -> Self {
        let every = given.len().div_ceil(SAMPLE).max(1);
        let mut is_known = vec![false; given.len()];
        // Both differences, and what they are to add up to.
        let mut rows: [Vec<[f64; 3]>; CLASSES] = Default::default();
        let mut known = Vec::new();
        for (turn, (vertex, triples, _)) in predictions.iter().enumerate() {
            if !triples.is_empty() && turn % every == 0 {
                known.clear();
                known.extend(adjacency.of(vertex).iter().copied().filter(|&w| is_known[w as usize]));
                for k in 0..3 {
                    let Terms { middle, differences: [a, b] } = terms(given, triples, &known, k);
                    let target = PARTS * i64::from(given[vertex][k]) - middle;
                    rows[class(triples)].push([a as f64, b as f64, target as f64]);
                }
            }
            is_known[vertex] = true;
        }
        Self(rows.map(|rows| fitted(&rows)))
    }

    /// Where a vertex is expected, in steps; without triples where `near` is.
    pub(crate) fn expected(
        self,
        found: &[[i32; 3]],
        triples: &[[u32; 3]],
        known: &[u32],
        near: Option<usize>,
    ) -> [i32; 3] {
        if triples.is_empty() {
            let most = MAX_SIZE as i32;
            return near.map_or([0; 3], |near| found[near].map(|steps| steps.clamp(-most, most)));
        }
        let weights = self.0[class(triples)].map(i64::from);
        std::array::from_fn(|k| {
            let Terms { middle, differences } = terms(found, triples, known, k);
            let sum = PARTS * middle + weights[0] * differences[0] + weights[1] * differences[1];
            let nearest = (sum + PARTS * PARTS / 2).div_euclid(PARTS * PARTS);
            nearest.clamp(-i64::from(MAX_SIZE), i64::from(MAX_SIZE)) as i32
        })
    }
}

fn class(triples: &[[u32; 3]]) -> usize {
    triples.len().min(CLASSES) - 1
}

fn terms(found: &[[i32; 3]], triples: &[[u32; 3]], known: &[u32], k: usize) -> Terms {
    let at = |v: u32| i64::from(found[v as usize][k]);
    let count = triples.len() as i64;
    let edges: i64 = triples.iter().map(|&[from, to, _]| at(from) + at(to)).sum();
    let far: i64 = triples.iter().map(|&[.., far]| at(far)).sum();
    let middle = (PARTS / 2 * edges).div_euclid(count);
    let parallelograms = (PARTS * (edges - far)).div_euclid(count);
    let neighbours = match known.len() as i64 {
        0 => middle,
        count => (PARTS * known.iter().map(|&w| at(w)).sum::<i64>()).div_euclid(count),
    };
    Terms { middle, differences: [parallelograms - middle, neighbours - middle] }
}

/// Reweighted least squares: rows count less the more the round before left of them.
fn fitted(rows: &[[f64; 3]]) -> [i8; 2] {
    let mut weights = [1.0, 0.0];
    for _ in 0..ROUNDS {
        let (mut aa, mut ab, mut bb, mut at, mut bt) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for &[a, b, target] in rows {
            let left = target - weights[0] * a - weights[1] * b;
            let weight = 1.0 / (left.abs() + PARTS as f64);
            aa += weight * a * a;
            ab += weight * a * b;
            bb += weight * b * b;
            at += weight * a * target;
            bt += weight * b * target;
        }
        let determinant = aa * bb - ab * ab;
        // Where neighbours say nothing else than parallelograms, these have it all.
        if determinant <= 1e-6 * aa * bb {
            break;
        }
        weights = [(at * bb - bt * ab) / determinant, (bt * aa - at * ab) / determinant];
    }
    weights.map(|weight| (PARTS as f64 * weight).round().clamp(-127.0, 127.0) as i8)
}
