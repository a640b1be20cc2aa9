//! Positions of a mesh at rest, on a grid.

use crate::entropy::{
    Coder, Decoder, Encoder, Integers, MAX_CONTEXT_SIZE, MAX_RESIDUAL_SIZE, MAX_SIZE, Models, SIZES, size_class,
};
use crate::error::{Result, take};
use crate::parallelograms::Predictions;
use crate::prediction_weights::PredictionWeights;
use cager_geometry::mesh::{Point, Polygons, bounds};
use cager_geometry::topology::Adjacency;

/// A grid of positions, each rounded to single precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    origin: Point,
    step: f64,
}

impl Grid {
    /// Over these points; `None` where there are none or they span too many steps.
    pub fn new(points: &[Point], step: f64) -> Option<Self> {
        let (low, high) = bounds(points);
        let steps = (0..3).map(|k| (high[k] - low[k]) / step).fold(0.0, f64::max);
        let far = low.iter().chain(&high).any(|x| x.abs() > f64::from(f32::MAX));
        let finite = points.iter().flatten().all(|x| x.is_finite());
        (!points.is_empty() && finite && step > 0.0 && steps.is_finite() && steps < f64::from(MAX_SIZE >> 4) && !far)
            .then_some(Self { origin: low, step })
    }

    /// As [`Self::new`], through 0, so that multiples of the step stay what they are.
    pub(crate) fn of_multiples(points: &[Point], step: f64) -> Option<Self> {
        let grid = Self::new(points, step)?;
        Some(Self { origin: grid.origin.map(|x| (x / step).floor() * step), ..grid })
    }

    /// The nearest position of the grid.
    pub fn nearest(&self, point: Point) -> Point {
        self.position(self.steps(point))
    }

    fn steps(&self, point: Point) -> [i32; 3] {
        std::array::from_fn(|k| ((point[k] - self.origin[k]) / self.step).round() as i32)
    }

    fn position(&self, steps: [i32; 3]) -> Point {
        std::array::from_fn(|k| f64::from((self.origin[k] + f64::from(steps[k]) * self.step) as f32))
    }
}

/// Codes the positions of the grid nearest to these points.
pub fn encode_positions(grid: Grid, faces: &Polygons, points: &[Point]) -> Vec<u8> {
    let mut bytes: Vec<u8> = grid.origin.iter().chain([&grid.step]).flat_map(|x| x.to_le_bytes()).collect();
    let given: Vec<[i32; 3]> = points.iter().map(|&point| grid.steps(point)).collect();
    let (predictions, adjacency) = (Predictions::new(faces, points.len()), Adjacency::new(faces, points.len()));
    let weights = PredictionWeights::fit(&predictions, &adjacency, &given);
    bytes.extend(weights.to_bytes());
    let mut coder = Encoder::default();
    code(&mut coder, &predictions, &adjacency, weights, &given);
    bytes.extend(coder.into_bytes());
    bytes
}

/// The positions that [`encode_positions`] wrote, for the same faces in the same order.
pub fn decode_positions(bytes: &[u8], faces: &Polygons, points: usize) -> Result<Vec<Point>> {
    const CUT: &str = "positions are cut";
    let mut coded = bytes;
    let mut number = || take(&mut coded, CUT).map(f64::from_le_bytes);
    let grid = Grid { origin: [number()?, number()?, number()?], step: number()? };
    let weights = PredictionWeights::from_bytes(take(&mut coded, CUT)?);
    let predictions = Predictions::new(faces, points);
    let mut coder = Decoder::new(coded)?;
    let steps = code(&mut coder, &predictions, &Adjacency::new(faces, points), weights, &[]);
    coder.check()?;
    Ok(steps.into_iter().map(|steps| grid.position(steps)).collect())
}

/// Codes steps by weighted predictions, in the context of the errors of neighbours.
fn code(
    coder: &mut impl Coder,
    predictions: &Predictions,
    adjacency: &Adjacency,
    weights: PredictionWeights,
    given: &[[i32; 3]],
) -> Vec<[i32; 3]> {
    let points = adjacency.points();
    let mut found = vec![[0i32; 3]; points];
    // How far each was from where it was expected; of those that are not known yet nothing.
    let mut residuals: Vec<Option<[u32; 3]>> = vec![None; points];
    let mut models = Integers::new(3 * SIZES);
    let mut before = 0;
    let mut known = Vec::new();
    for (vertex, triples, near) in predictions.iter() {
        known.clear();
        known.extend(adjacency.of(vertex).iter().copied().filter(|&w| residuals[w as usize].is_some()));
        let mut sizes = [0; 3];
        let mut coded_so_far = 0;
        let expected = weights.expected(&found, triples, &known, (near != vertex).then_some(near));
        for k in 0..3 {
            let of = |w: &u32| residuals[*w as usize].map_or(0, |sizes| u64::from(sizes[k]));
            let around = 6 * known.iter().map(of).sum::<u64>() / known.len().max(1) as u64;
            let around = around.min(MAX_CONTEXT_SIZE.into()) as u32 + 5 * (before / 8) + 5 * coded_so_far;
            let context = SIZES * triples.len().min(2) + size_class(around.min(MAX_CONTEXT_SIZE));
            let value = given.get(vertex).map_or(0, |steps| steps[k] - expected[k]);
            let value = models.code(coder, context, value);
            found[vertex][k] = value.saturating_add(expected[k]);
            sizes[k] = value.unsigned_abs().min(MAX_RESIDUAL_SIZE);
            coded_so_far += sizes[k];
        }
        before = (before + 8 * coded_so_far / 3) / 2;
        residuals[vertex] = Some(sizes);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_come_back_on_the_grid_in_their_order() {
        let mut random = fastrand::Rng::with_seed(5);
        let points: Vec<Point> = (0..200).map(|_| std::array::from_fn(|_| 100.0 * random.f64() - 30.0)).collect();
        let mut faces = Polygons::new();
        (0..150u32).for_each(|k| faces.push(&[k, k + 1, k + 2]));
        for step in [10.0, 1e-2, 1e-4] {
            let grid = Grid::new(&points, step).unwrap();
            let bytes = encode_positions(grid, &faces, &points);
            let back = decode_positions(&bytes, &faces, points.len()).unwrap();
            for (&a, b) in points.iter().zip(&back) {
                assert_eq!(grid.nearest(a), *b);
                assert!((0..3).all(|k| (a[k] - b[k]).abs() <= 0.5 * step + 1e-5));
            }
        }
        assert!(Grid::new(&[], 1.0).is_none());
        assert!(Grid::new(&points, 1e-9).is_none());
        assert!(Grid::new(&[[f64::NAN; 3]], 1.0).is_none());
    }

    #[test]
    fn damage_is_an_error_or_positions() {
        let mut random = fastrand::Rng::with_seed(6);
        for _ in 0..200 {
            let bytes: Vec<u8> = (0..4 * random.usize(..40)).map(|_| random.u8(..)).collect();
            if let Ok(points) = decode_positions(&bytes, &Polygons::new(), 50) {
                assert_eq!(points.len(), 50);
            }
        }
    }
}
