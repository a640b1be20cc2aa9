//! The source laid onto the target: aligned, then fitted by its cage.

use crate::registration::{
    Alignment, Anchors, MeasuredSurface, Observation, OrientedPoints, Registration, Template, check_coordinates,
    outward, surface_vertices,
};
use cager_core::cage::Cage;
use cager_geometry::linalg::rows_of;
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use cager_geometry::spatial::Surface;
use cager_geometry::vector::{centroid, distance};
use rayon::prelude::*;

use super::fitted_options::FittedOptions;
use super::source::Source;
use crate::canonical::canonical_frame;
use crate::error::TransferError;
use crate::points::{area_vector, matrix, points_in, vectors};
use crate::similarity::Similarity;
use crate::transfer::alignment::align_with;
use crate::transfer::pairs::Pairs;

/// How much worse the next alignment must be: by this share, and this score, which samples differ
/// by.
const AMBIGUOUS: f64 = 0.005;
const SAME: f64 = 5e-5;
/// Alignments that lay vertices closer than this share of the size come to the same.
const SAME_PLACES: f64 = 0.01;
/// Scores above are out of reach. Measured, in percent: a horse onto a lion 0.52, a cat 0.56, a
/// hand 0.80, a man onto a horse 0.85; a horse onto an arm 1.00, a hand onto a man 1.58, onto a
/// horse 1.66.
const OUT_OF_REACH: f64 = 0.009;
/// What pairs count together beside the matches of the whole surface one way.
const PAIRS_WEIGHT: f64 = 10.0;

/// The target at rest.
pub(crate) struct Goal<'a> {
    pub(crate) points: &'a [Point],
    /// Facing outwards; none of a cloud.
    pub(crate) triangles: &'a [[u32; 3]],
    /// Points of its surface.
    pub(crate) seen: &'a Observation,
}

/// The source laid onto the target.
pub(crate) struct RegisteredSource {
    pub(crate) aligned: Alignment,
    /// The source at rest in the target's space, its triangles facing outwards.
    pub(crate) rest: TriMesh,
    /// Its vertices where the registration has them.
    pub(crate) laid: Vec<Point>,
    pub(crate) registration: Registration,
    /// Its triangles there, by position and normal.
    tree: OrientedPoints,
}

/// What a normal counts where triangles are looked for, as a share of the target's size.
const NORMAL_LENGTH: f64 = 0.05;

impl RegisteredSource {
    pub(crate) fn new(
        source: &Source<'_>,
        goal: &Goal<'_>,
        options: &FittedOptions<'_>,
    ) -> Result<Self, TransferError> {
        let (vertices, triangles) = (&source.rest.vertices, &source.rest.triangles);
        check_coordinates(vertices, source.cage, source.phi)?;
        let pairs = Pairs::new(&options.pairs, vertices, goal.points)?;
        let seen = Observation::of_mesh(vertices, triangles, &options.observation());
        let seen = seen.map_err(TransferError::SourceSurface)?.0;
        let triangles = outward(vertices, triangles);
        let surface = (!goal.triangles.is_empty()).then(|| Surface::new(vectors(goal.points), goal.triangles.to_vec()));
        let found = align_with(&seen, goal.seen, surface.as_ref(), options.align, options.up, &pairs);
        let fitting = Fitting::new(source, &triangles, goal, &pairs, options);
        let aligned = fitting.chosen(found)?;
        let registration = fitting.fit(&aligned.similarity, false)?;
        if registration.score.is_nan() || registration.score > OUT_OF_REACH {
            let [score, limit] = [registration.score, OUT_OF_REACH].map(|x| 100.0 * x);
            return Err(TransferError::OutOfReach { score, limit });
        }
        let laid = fitting.laid(&registration.cage);
        let (centers, normals) = middles(&laid, &triangles);
        let tree = OrientedPoints::new(&centers, &normals, NORMAL_LENGTH * fitting.size);
        let rest = TriMesh { vertices: aligned.similarity.apply_all(vertices), triangles };
        Ok(Self { aligned, rest, laid, registration, tree })
    }

    /// The source's triangle that lies where each of these points with unit normals is.
    pub(crate) fn triangles_at(&self, points: &[Point], normals: &[Point]) -> Vec<u32> {
        points.par_iter().zip(normals).with_min_len(64).map(|(&p, &n)| self.tree.nearest(p, n).0 as u32).collect()
    }
}

/// Centroids and unit normals of triangles.
pub(crate) fn middles(vertices: &[Point], triangles: &[[u32; 3]]) -> (Vec<Point>, Vec<Point>) {
    let middle = |triangle: &[u32; 3]| {
        let corners = triangle.map(|v| vertices[v as usize]);
        (centroid(corners), area_vector(corners).normalize_or_zero().to_array())
    };
    triangles.iter().map(middle).unzip()
}

/// A source and a target in a frame that turns with the target, so that results do.
struct Fitting<'a> {
    source: &'a Source<'a>,
    /// Facing outwards.
    triangles: &'a [[u32; 3]],
    frame: Similarity,
    seen: Observation,
    surface: MeasuredSurface,
    size: f64,
    anchors: Option<Anchors>,
    options: &'a FittedOptions<'a>,
}

impl<'a> Fitting<'a> {
    fn new(
        source: &'a Source<'a>,
        triangles: &'a [[u32; 3]],
        goal: &Goal<'_>,
        pairs: &Pairs,
        options: &'a FittedOptions<'a>,
    ) -> Self {
        let frame = canonical_frame(&goal.seen.points);
        let points = frame.apply_all(goal.points);
        let size = diagonal(&surface_vertices(&points, goal.triangles));
        let seen =
            Observation { points: frame.apply_all(&goal.seen.points), normals: frame.turn_all(&goal.seen.normals) };
        let surface = if goal.triangles.is_empty() {
            MeasuredSurface::of_cloud(&seen, size)
        } else {
            MeasuredSurface::of_mesh(&points, goal.triangles, size)
        };
        let anchors = (!pairs.vertices.is_empty()).then(|| {
            let places: Vec<Point> = pairs.places.iter().map(|&(_, p, _)| frame.apply(p).to_array()).collect();
            Anchors::new(rows_of(source.phi, &pairs.vertices), &places, PAIRS_WEIGHT)
        });
        Self { source, triangles, frame, seen, surface, size, anchors, options }
    }

    /// Of several alignments the one from which the cage fits best, after few iterations.
    fn chosen(&self, found: Vec<Alignment>) -> Result<Alignment, TransferError> {
        if found.len() < 2 {
            return Ok(found[0]);
        }
        let ambiguous = || TransferError::Ambiguous(self.options.up.is_some());
        let mut scored = Vec::new();
        for aligned in found {
            scored.push((self.fit(&aligned.similarity, true)?, aligned));
        }
        scored.sort_by(|a, b| a.0.score.total_cmp(&b.0.score));
        let [first, second] = [&scored[0].0, &scored[1].0];
        if second.score - first.score < SAME.max(AMBIGUOUS * first.score) && self.apart(first, second) > SAME_PLACES {
            return Err(ambiguous());
        }
        let best = scored.iter().map(|(found, aligned)| Alignment { score: found.score, ..*aligned });
        best.min_by(|a, b| a.cost().total_cmp(&b.cost())).ok_or_else(ambiguous)
    }

    /// Mean distance between the source's vertices in two registrations, as a share of the size.
    fn apart(&self, a: &Registration, b: &Registration) -> f64 {
        let (a, b) = (self.laid(&a.cage), self.laid(&b.cage));
        a.iter().zip(&b).map(|(p, q)| distance(*p, *q)).sum::<f64>() / (a.len() as f64 * self.size)
    }

    /// Fits the source's cage to the target; the cage that is found is in the target's space.
    fn fit(&self, aligned: &Similarity, quick: bool) -> Result<Registration, TransferError> {
        let there = self.frame.after(aligned);
        let rest =
            TriMesh { vertices: there.apply_all(&self.source.rest.vertices), triangles: self.triangles.to_vec() };
        let cage = self.source.cage.mesh();
        let cage = TriMesh { vertices: there.apply_all(&cage.vertices), triangles: cage.triangles.clone() };
        let cage = Cage::new(cage).map_err(TransferError::SourceCage)?;
        let (seed, stopped) = (self.options.seed, self.options.stopped);
        let mut template = Template::new(&rest, &cage, self.source.phi, seed)?;
        let score = |cage: &[Point]| self.surface.distance(&self.seen, &self.laid(cage), self.triangles, seed);
        let anchors = self.anchors.as_ref();
        let mut registration = template.register(cage.vertices(), &self.seen, anchors, quick, &score, stopped);
        if stopped() {
            return Err(TransferError::Stopped);
        }
        registration.cage = self.frame.inverse().apply_all(&registration.cage);
        Ok(registration)
    }

    /// The source's vertices in a cage.
    fn laid(&self, cage: &[Point]) -> Vec<Point> {
        points_in(self.source.phi, matrix(cage).as_ref())
    }
}
