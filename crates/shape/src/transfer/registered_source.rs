//! The source laid onto the target: aligned, then fitted by its cage.

use crate::registration::{
    Anchors, MeasuredSurface, Observation, Registration, RegistrationError, StageOptions, Template, TemplateOptions,
    outward, surface_vertices,
};
use cager_core::cage::Cage;
use cager_geometry::linalg::{rows_of, tall_product};
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use cager_geometry::spatial::Surface;
use cager_geometry::vector::distance;
use glam::DVec3;

use super::fitted_options::FittedOptions;
use super::source::Source;
use crate::canonical::canonical_frame;
use crate::error::TransferError;
use crate::points::{matrix, plain, row_points};
use crate::similarity::Similarity;
use crate::transfer::alignment::{Aligned, align_with, preferred};
use crate::transfer::correspondence::Correspondence;
use crate::transfer::pairs::Pairs;

/// Iterations of each stage where alignments are compared.
const FIRST_ITERATIONS: usize = 3;
/// How much worse than the best the next alignment must be: by this share of it, and by this score, which samples of the same surface can differ by.
const AMBIGUOUS: f64 = 0.005;
const SAME: f64 = 5e-5;
/// Alignments from which the cage lays vertices closer together than this share of the size, in the mean, come to the same: either will do.
const SAME_PLACES: f64 = 0.01;
/// Scores above are of shapes that were not reached. Measured, in percent: a horse onto a lion 0.52, a cat 0.56, a hand 0.80, a man onto a horse 0.85; a horse
/// onto an arm 1.00, a hand onto a man 1.58, onto a horse 1.66.
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
    pub(crate) aligned: Aligned,
    /// The source at rest in the target's space, its triangles facing outwards.
    pub(crate) rest: TriMesh,
    /// Its vertices where the registration has them.
    pub(crate) laid: Vec<Point>,
    pub(crate) registration: Registration,
    /// A length of the target that does not depend on how it is turned.
    size: f64,
}

impl RegisteredSource {
    pub(crate) fn new(
        source: &Source<'_>,
        goal: &Goal<'_>,
        options: &FittedOptions<'_>,
    ) -> Result<Self, TransferError> {
        let (vertices, triangles) = (&source.rest.vertices, &source.rest.triangles);
        check_coordinates(source)?;
        let pairs = Pairs::new(&options.pairs, vertices, goal.points)?;
        let seen = Observation::of_mesh(vertices, triangles, &options.observation());
        let seen = seen.map_err(TransferError::SourceSurface)?.0;
        let triangles = outward(vertices, triangles);
        let surface = (!goal.triangles.is_empty()).then(|| {
            let vertices = goal.points.iter().map(|&p| p.into()).collect();
            Surface::new(vertices, goal.triangles.to_vec())
        });
        let found = align_with(&seen, goal.seen, surface.as_ref(), options.align, options.up, &pairs);
        let fitting = Fitting::new(source, &triangles, goal, &pairs, options);
        let aligned = fitting.chosen(found)?;
        let registration = fitting.fit(&aligned.similarity, &options.stages)?;
        if registration.score.is_nan() || registration.score > OUT_OF_REACH {
            let [score, limit] = [registration.score, OUT_OF_REACH].map(|x| 100.0 * x);
            return Err(TransferError::OutOfReach { score, limit });
        }
        let laid = fitting.laid(&registration.cage);
        let size = fitting.size;
        let rest = TriMesh { vertices: aligned.similarity.apply_all(vertices), triangles };
        Ok(Self { aligned, rest, laid, registration, size })
    }

    pub(crate) fn correspondence(&self) -> Correspondence {
        Correspondence::new(&self.laid, &self.rest.triangles, self.size)
    }
}

/// Whether the source's coordinates are of its points and its cage.
fn check_coordinates(source: &Source<'_>) -> Result<(), RegistrationError> {
    let (rows, columns) = (source.phi.nrows(), source.phi.ncols());
    let (points, vertices) = (source.rest.vertices.len(), source.cage.vertices().len());
    if (rows, columns) == (points, vertices) {
        return Ok(());
    }
    Err(RegistrationError::OtherCoordinates { rows, columns, points, vertices })
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
        let seen = Observation {
            points: frame.apply_all(&goal.seen.points),
            normals: goal.seen.normals.iter().map(|&n| (frame.rotation * DVec3::from(n)).to_array()).collect(),
        };
        let surface = if goal.triangles.is_empty() {
            MeasuredSurface::of_cloud(&seen, size)
        } else {
            MeasuredSurface::of_mesh(&points, goal.triangles, size)
        };
        let anchors = (!pairs.vertices.is_empty()).then(|| {
            let places: Vec<Point> = pairs.to.iter().map(|&p| frame.apply(p).to_array()).collect();
            Anchors::new(rows_of(source.phi, &pairs.vertices), &places, PAIRS_WEIGHT)
        });
        Self { source, triangles, frame, seen, surface, size, anchors, options }
    }

    /// Of several alignments the one from which the cage fits best, after few iterations.
    fn chosen(&self, found: Vec<Aligned>) -> Result<Aligned, TransferError> {
        if found.len() < 2 {
            return Ok(found[0]);
        }
        let ambiguous = || TransferError::Ambiguous { up: self.options.up.is_some() };
        let quick = StageOptions { iterations: FIRST_ITERATIONS, good_score: f64::INFINITY, ..self.options.stages };
        let mut scored = Vec::new();
        for aligned in found {
            scored.push((self.fit(&aligned.similarity, &quick)?, aligned));
        }
        scored.sort_by(|a, b| a.0.score.total_cmp(&b.0.score));
        let [first, second] = [&scored[0].0, &scored[1].0];
        if second.score - first.score < SAME.max(AMBIGUOUS * first.score) && self.apart(first, second) > SAME_PLACES {
            return Err(ambiguous());
        }
        let best = scored.into_iter().map(|(found, aligned)| (found.score, aligned));
        let best = best.min_by(|a, b| preferred(a).total_cmp(&preferred(b)));
        best.map(|(_, aligned)| aligned).ok_or_else(ambiguous)
    }

    /// How far two registrations leave the source's vertices from each other, in the mean, as a share of the size.
    fn apart(&self, a: &Registration, b: &Registration) -> f64 {
        let (a, b) = (self.laid(&a.cage), self.laid(&b.cage));
        a.iter().zip(&b).map(|(p, q)| distance(*p, *q)).sum::<f64>() / (a.len() as f64 * self.size)
    }

    /// Fits the source's cage to the target; the cage that is found is in the target's space.
    fn fit(&self, aligned: &Similarity, stages: &StageOptions) -> Result<Registration, TransferError> {
        let there = self.frame.after(aligned);
        let rest =
            TriMesh { vertices: there.apply_all(&self.source.rest.vertices), triangles: self.triangles.to_vec() };
        let cage = self.source.cage.mesh();
        let cage = TriMesh { vertices: there.apply_all(&cage.vertices), triangles: cage.triangles.clone() };
        let cage = Cage::new(cage).map_err(TransferError::SourceCage)?;
        let (seed, stopped) = (self.options.seed, self.options.stopped);
        let template = TemplateOptions { seed, ..TemplateOptions::default() };
        let mut template = Template::new(&rest, &cage, self.source.phi, &template)?;
        let score = |cage: &[Point]| self.surface.distance(&self.seen, &self.laid(cage), self.triangles, seed);
        let anchors = self.anchors.as_ref();
        let mut registration = template.register(cage.vertices(), &self.seen, anchors, stages, &score, stopped);
        if stopped() {
            return Err(TransferError::Stopped);
        }
        registration.cage = self.frame.inverse().apply_all(&registration.cage);
        Ok(registration)
    }

    /// The source's vertices in a cage.
    fn laid(&self, cage: &[Point]) -> Vec<Point> {
        plain(&row_points(tall_product(self.source.phi, matrix(cage).as_ref()).as_ref()))
    }
}
