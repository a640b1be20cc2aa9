//! A measure like the spatio-temporal edge difference (STED) of Váša and Skala, "A perception correlated comparison method for
//! dynamic meshes" (IEEE TVCG 17(2), 2011): people see where neighbouring edges change by different ratios, and where vertices tremble, not where
//! whole regions are displaced.
//!
//! With `p` the captured and `q` the decoded positions, `l(e, f)` the length of edge `e` in frame `f` of the capture and `l'(e, f)` that of the decoded:
//!
//! * Relative edge difference `ed(e, f) = (l − l') / l`. Its deviation at vertex `v` is the standard deviation over the edges `N(v)` within
//!   [`rings`](StedOptions::rings) of the vertex, weighted by `l`; the spatial part is the mean of these over all vertices and frames.
//! * A temporal edge joins a vertex to itself in the next frame: `t(v, f) = sqrt(|p(v, f + 1) − p(v, f)|² + δ²)` with δ the [`dt`](StedOptions::dt) of
//!   the diagonal, and so `t'` for `q`. The temporal part is the mean, over all vertices and all runs of [`window`](StedOptions::window) frames, of
//!   the standard deviation of `(t − t') / t` over the run, weighted by `t`.
//! * `STED = sqrt(spatial² + c² · temporal²)`, c the [`weight`](StedOptions::weight). All of them are ratios without a unit.
//!
//! Neither the paper's text nor its authors' program was at hand: the structure is that of descriptions of the measure, while the sign of the
//! differences (kept, since the standard deviation of their magnitudes is blind to edges that grow and shrink in turn), the standard deviation over
//! runs of frames and the constants are choices made here. Values can be compared with each other, not with published ones.

mod deviation;
mod spatial;
mod temporal;

use cager_geometry::mesh::Polygons;
use deviation::Mean;
use spatial::Neighbourhoods;
use temporal::Steps;

/// The constants of the measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StedOptions {
    /// How far, in edges, the edges reach whose differences are compared at a vertex: 1 takes those that end there.
    pub rings: usize,
    /// Frames over which a vertex's movement is compared.
    pub window: usize,
    /// The length that a frame takes in time, as a fraction of the model's diagonal.
    pub dt: f64,
    /// What the temporal part counts beside the spatial one.
    pub weight: f64,
}

impl Default for StedOptions {
    fn default() -> Self {
        Self { rings: 1, window: 5, dt: 0.01, weight: 1.0 }
    }
}

/// Why a capture cannot be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StedError {
    /// A face of the mesh has a vertex that does not exist.
    #[error("a face has the vertex {vertex}, but there are {points} points: give the faces of this model")]
    NoSuchVertex {
        /// The vertex, counted from 0.
        vertex: u32,
        /// Points of the model.
        points: usize,
    },
    /// Constants that measure nothing.
    #[error(
        "neighbourhoods of {rings} rings, windows of {window} frames and frames {dt} long cannot be measured: take at least 1 ring, 2 frames and a finite length above 0"
    )]
    Options {
        /// As given.
        rings: usize,
        /// As given.
        window: usize,
        /// As given, times the diagonal.
        dt: f64,
    },
    /// A frame has another number of points than the model.
    #[error(
        "frame {frame} has {captured} captured and {decoded} decoded numbers where the model has {expected}: give three for each of its points"
    )]
    Points {
        /// The frame, counted from 0.
        frame: usize,
        /// Numbers of the capture.
        captured: usize,
        /// Numbers of what was decoded.
        decoded: usize,
        /// What they have to be.
        expected: usize,
    },
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sted {
    /// Mean local deviation of relative edge differences; NaN where no edge has a length.
    pub spatial: f64,
    /// Mean deviation of relative differences of movement over runs of frames; none where there are fewer than two frames.
    pub temporal: Option<f64>,
    /// `sqrt(spatial² + c² · temporal²)`; the spatial part where there is no temporal one.
    pub total: f64,
}

/// Measures a capture frame by frame. Holds a window of frames, not the capture; results do not depend on the number of threads.
pub struct StedMeter {
    options: StedOptions,
    numbers: usize,
    frames: usize,
    neighbourhoods: Neighbourhoods,
    steps: Steps,
    spatial: Mean,
}

impl StedMeter {
    /// For frames of `points` points joined by these faces; `diagonal` is that of the rest pose's bounding box.
    ///
    /// # Errors
    /// A face with a vertex that does not exist; constants that measure nothing.
    pub fn new(faces: &Polygons, points: usize, diagonal: f64, options: StedOptions) -> Result<Self, StedError> {
        let StedOptions { rings, window, .. } = options;
        let dt = options.dt * diagonal;
        if rings == 0 || window < 2 || !(dt > 0.0 && dt.is_finite()) {
            return Err(StedError::Options { rings, window, dt });
        }
        if let Some(&vertex) = faces.indices().iter().find(|&&vertex| vertex as usize >= points) {
            return Err(StedError::NoSuchVertex { vertex, points });
        }
        Ok(Self {
            options,
            numbers: 3 * points,
            frames: 0,
            neighbourhoods: Neighbourhoods::new(faces, points, rings),
            steps: Steps::new(window - 1, dt),
            spatial: Mean::default(),
        })
    }

    /// Takes the next frame: its captured and its decoded positions, points × 3.
    ///
    /// # Errors
    /// Another number of points than the model has; the frame is left out.
    pub fn add<C, D>(&mut self, captured: &[C], decoded: &[D]) -> Result<(), StedError>
    where
        C: Copy + Into<f64> + Sync,
        D: Copy + Into<f64> + Sync,
    {
        let expected = self.numbers;
        if captured.len() != expected || decoded.len() != expected {
            let (captured, decoded) = (captured.len(), decoded.len());
            return Err(StedError::Points { frame: self.frames, captured, decoded, expected });
        }
        self.frames += 1;
        self.spatial.extend(&self.neighbourhoods.deviations(captured, decoded));
        self.steps.add(captured, decoded);
        Ok(())
    }

    /// The measure of the frames so far.
    pub fn result(&self) -> Sted {
        let spatial = self.spatial.value();
        let temporal = (self.frames > 1).then(|| self.steps.mean());
        let total = temporal.map_or(spatial, |temporal| spatial.hypot(self.options.weight * temporal));
        Sted { spatial, temporal, total }
    }
}
