//! A measure like the spatio-temporal edge difference (STED) of Váša and Skala (IEEE TVCG 17(2),
//! 2011): people see where neighbouring edges change by different ratios, and where vertices
//! tremble, not where whole regions are displaced.
//!
//! With `p` the captured and `q` the decoded positions, `l(e, f)` the length of edge `e` in frame
//! `f` of the capture and `l'(e, f)` that of the decoded:
//!
//! * Relative edge difference `ed(e, f) = (l − l') / l`. Its deviation at a vertex is the standard
//!   deviation over the edges there, weighted by `l`; the spatial part is the mean of these over
//!   all vertices and frames.
//! * A temporal edge joins a vertex to itself in the next frame: `t(v, f) = sqrt(|p(v, f + 1) −
//!   p(v, f)|² + δ²)` with δ a hundredth of the diagonal, and so `t'` for `q`. The temporal part is
//!   the mean, over all vertices and all runs of five frames, of the standard deviation of `(t −
//!   t') / t` over the run, weighted by `t`.
//! * `STED = sqrt(spatial² + temporal²)`. All of them are ratios without a unit.
//!
//! Neither the paper's text nor its authors' program was at hand: the sign of the differences
//! (kept, since the deviation of magnitudes is blind to edges that grow and shrink in turn), the
//! runs of frames and the constants are choices made here: do not compare with published values.

use cager_geometry::mesh::Polygons;
use cager_geometry::topology::Adjacency;
use rayon::prelude::*;
use std::collections::VecDeque;

/// Steps from frame to frame over which a vertex's movement is compared.
const STEPS: usize = 4;
/// The length that a frame takes in time, as a fraction of the model's diagonal.
const DT: f64 = 0.01;

/// Why a capture cannot be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum StedError {
    #[error("a face has the vertex {vertex}, but there are {points} points: give the faces of this model")]
    NoSuchVertex { vertex: u32, points: usize },
    #[error("a model with the diagonal {diagonal} cannot be measured: give one of a finite size above 0")]
    NoExtent { diagonal: f64 },
    #[error(
        "frame {frame} has {captured} captured and {decoded} decoded numbers where the model has {expected}: give three for each of its points"
    )]
    Points { frame: usize, captured: usize, decoded: usize, expected: usize },
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sted {
    /// Mean local deviation of relative edge differences; NaN where no edge has a length.
    pub spatial: f64,
    /// Mean deviation of relative differences of movement over runs; none of fewer than two frames.
    pub temporal: Option<f64>,
    /// `sqrt(spatial² + temporal²)`; the spatial part where there is no temporal one.
    pub total: f64,
}

/// Measures a capture frame by frame; results do not depend on the number of threads.
pub struct StedMeter {
    numbers: usize,
    frames: usize,
    /// δ.
    dt: f64,
    edges: Vec<[u32; 2]>,
    /// The edges at each vertex.
    incident: Vec<Vec<u32>>,
    /// Captured and decoded positions of the last frame.
    before: Option<[Vec<f64>; 2]>,
    /// For each of the last steps, the temporal edge of every vertex and its relative difference.
    steps: VecDeque<Vec<(f64, f64)>>,
    spatial: Mean,
    /// Over the runs that are complete.
    temporal: Mean,
}

impl StedMeter {
    /// For frames of `points` points with these faces, in a rest pose with this diagonal.
    pub fn new(faces: &Polygons, points: usize, diagonal: f64) -> Result<Self, StedError> {
        let dt = DT * diagonal;
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(StedError::NoExtent { diagonal });
        }
        if let Some(&vertex) = faces.indices().iter().find(|&&vertex| vertex as usize >= points) {
            return Err(StedError::NoSuchVertex { vertex, points });
        }
        let adjacency = Adjacency::new(faces, points);
        let (mut edges, mut incident) = (Vec::new(), vec![Vec::new(); points]);
        for a in 0..points as u32 {
            for &b in adjacency.of(a as usize).iter().filter(|&&b| b > a) {
                [a, b].iter().for_each(|&end| incident[end as usize].push(edges.len() as u32));
                edges.push([a, b]);
            }
        }
        let (spatial, temporal) = (Mean::default(), Mean::default());
        let (before, steps) = (None, VecDeque::new());
        Ok(Self { numbers: 3 * points, frames: 0, dt, edges, incident, before, steps, spatial, temporal })
    }

    /// Takes the next frame: its captured and its decoded positions, points × 3.
    ///
    /// # Errors
    /// Another number of points than the model has; the frame is left out.
    pub fn add<C: Copy + Into<f64>, D: Copy + Into<f64>>(
        &mut self,
        captured: &[C],
        decoded: &[D],
    ) -> Result<(), StedError> {
        let expected = self.numbers;
        if captured.len() != expected || decoded.len() != expected {
            let (captured, decoded) = (captured.len(), decoded.len());
            return Err(StedError::Points { frame: self.frames, captured, decoded, expected });
        }
        self.frames += 1;
        let now: [Vec<f64>; 2] =
            [captured.iter().map(|&x| x.into()).collect(), decoded.iter().map(|&x| x.into()).collect()];
        let of_edge = |&edge: &[u32; 2]| weighted_difference(length(&now[0], edge), length(&now[1], edge));
        let differences: Vec<(f64, f64)> = self.edges.par_iter().map(of_edge).collect();
        let at_vertex = |edges: &Vec<u32>| deviation(edges.iter().map(|&edge| differences[edge as usize]));
        self.spatial.extend(&self.incident.par_iter().map(at_vertex).collect::<Vec<_>>());
        if let Some(before) = &self.before {
            if self.steps.len() == STEPS {
                self.steps.pop_front();
            }
            let [t, found] = [0, 1].map(|k| temporal_edges(&before[k], &now[k], self.dt));
            self.steps.push_back(t.zip(found).map(|(t, found)| weighted_difference(t, found)).collect());
            if self.steps.len() == STEPS {
                self.temporal.extend(&self.movement());
            }
        }
        self.before = Some(now);
        Ok(())
    }

    /// The measure of the frames so far.
    pub fn result(&self) -> Sted {
        let (spatial, mut runs) = (self.spatial.value(), self.temporal);
        // A capture that is shorter than a run is one.
        if self.steps.len() < STEPS {
            runs.extend(&self.movement());
        }
        let temporal = (self.frames > 1).then(|| runs.value());
        Sted { spatial, temporal, total: temporal.map_or(spatial, |temporal| spatial.hypot(temporal)) }
    }

    /// Deviation of each vertex's movement over the last steps.
    fn movement(&self) -> Vec<Option<f64>> {
        let points = self.steps.front().map_or(0, Vec::len);
        (0..points).into_par_iter().map(|v| deviation(self.steps.iter().map(move |step| step[v]))).collect()
    }
}

fn length(positions: &[f64], [a, b]: [u32; 2]) -> f64 {
    let along = |k: usize| positions[3 * a as usize + k] - positions[3 * b as usize + k];
    (0..3).map(|k| along(k).powi(2)).sum::<f64>().sqrt()
}

fn temporal_edges<'a>(before: &'a [f64], now: &'a [f64], dt: f64) -> impl Iterator<Item = f64> + 'a {
    let squared = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (b - a).powi(2)).sum::<f64>();
    before.chunks_exact(3).zip(now.chunks_exact(3)).map(move |(a, b)| (squared(a, b) + dt * dt).sqrt())
}

/// `sqrt(Σ w (x − x̄)² / Σ w)` of pairs (w, x), `x̄` the weighted mean; none without a weight.
fn deviation(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Option<f64> {
    let (sum, total) = pairs.clone().fold((0.0, 0.0), |(sum, total), (w, x)| (sum + w * x, total + w));
    if total == 0.0 {
        return None;
    }
    let mean = sum / total;
    Some((pairs.map(|(w, x)| w * (x - mean).powi(2)).sum::<f64>() / total).sqrt())
}

/// A relative difference of two lengths with the first, its weight; nothing where that is 0.
fn weighted_difference(captured: f64, decoded: f64) -> (f64, f64) {
    (captured, if captured == 0.0 { 0.0 } else { (captured - decoded) / captured })
}

/// A running mean; NaN of nothing.
#[derive(Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn extend(&mut self, values: &[Option<f64>]) {
        for value in values.iter().flatten() {
            self.sum += value;
            self.count += 1;
        }
    }

    fn value(self) -> f64 {
        self.sum / self.count as f64
    }
}
