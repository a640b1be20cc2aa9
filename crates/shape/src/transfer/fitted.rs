//! The fitted cage: the source is laid onto the target by its cage, which says what corresponds;
//! then the target follows the gradients of the source (deformation transfer, Sumner and Popović
//! 2004).

use crate::registration::{Alignment, NearestPoints, Observation, Registration, outward};
use cager_core::cage::Cage;
use cager_geometry::mesh::{Model, Point, TriMesh};
use faer::MatRef;
use glam::{DMat3, DVec3};

use super::fitted_options::{FittedOptions, Pose};
use super::registered_source::{Goal, RegisteredSource, middles};
use super::source::{Source, moved_frame};
use crate::deformation::gradients::Gradients;
use crate::deformation::graph::CageSpace;
use crate::deformation::poisson::Poisson;
use crate::error::{MeshError, TransferError};
use crate::points::{mean, trace, vectors, welded_normals};

/// How well source and target go together.
#[derive(Clone, Debug)]
pub struct FittedReport {
    /// From the source's space to the target's, before the cage was fitted.
    pub aligned: Alignment,
    /// Where the cage ended, in the target's space.
    pub registration: Registration,
    /// Whether limbs take the source's directions.
    pub absolute: bool,
    /// The share of the source's area that the registration turned by more than 30 degrees.
    pub turned: f64,
}

/// Moves frames of a source onto a target.
pub struct FittedTransfer {
    source_points: usize,
    gradients: Gradients,
    smoothing: usize,
    /// What undoes the registration's rotations, for absolute poses.
    back: Option<Vec<DMat3>>,
    body: Body,
    /// The source's triangle for each gradient of the body, and for each point of the target.
    matches: Vec<u32>,
    under: Vec<u32>,
    source_triangles: Vec<[u32; 3]>,
    /// From the means of the source's points under the target's to that of the target's, at rest.
    offset: DVec3,
    report: FittedReport,
}

/// What turns gradients into poses of the target.
enum Body {
    /// Its own triangles.
    Mesh(Poisson),
    /// A cage around it.
    Caged(Box<CageSpace>),
}

/// A target in a cage: for soups of triangles, and for clouds of points.
#[derive(Clone, Copy)]
pub struct CagedTarget<'a> {
    /// The model at rest, with or without faces.
    pub model: &'a Model,
    /// A cage around it.
    pub cage: &'a Cage,
    /// Coordinates, n × m, one column per vertex of the cage.
    pub phi: MatRef<'a, f64>,
}

/// Scores below are of like shapes. Measured, in percent: a man onto himself with another mesh
/// 0.15, in poses of his own 0.24 and 0.27, onto a heavy woman
/// 0.26, in two of her poses 0.31; a horse onto a lion 0.52, onto a cat 0.56.
const LIKE_SHAPES: f64 = 0.0042;
/// Passes by which the registration's rotations are smoothed.
const ROTATION_PASSES: usize = 31;
/// Passes that smooth the source's gradients: of like shapes, of those carried by a cage, whose
/// graph has longer edges, and of unlike ones. A gallop on a cat, by 1, 3, 6, 10 and 20 passes:
/// 3.7, 3.3, 3.0, 2.8 and 2.4 % stretched, with volumes down to 0.895, 0.889, 0.885, 0.881 and
/// 0.874.
const LIKE_PASSES: usize = 1;
const GRAPH_PASSES: usize = 3;
const UNLIKE_PASSES: usize = 10;
/// Triangles turned by more count as turned, in degrees.
const TURNED: f64 = 30.0;

impl FittedTransfer {
    /// Aligns, fits and factors, for a target that follows on its own mesh. Runs on the current
    /// rayon pool; the result does not depend on it.
    ///
    /// # Errors
    /// See [`TransferError`].
    pub fn new(source: &Source<'_>, target: &TriMesh, options: &FittedOptions<'_>) -> Result<Self, TransferError> {
        let body = Poisson::new(target).map_err(TransferError::Target)?;
        let seen = Observation::of_mesh(&target.vertices, &target.triangles, &options.observation())?.0;
        let triangles = outward(&target.vertices, &target.triangles);
        let goal = Goal { points: &target.vertices, triangles: &triangles, seen: &seen };
        let laid = RegisteredSource::new(source, &goal, options)?;
        let (centers, normals) = middles(&target.vertices, &triangles);
        let matches = laid.triangles_at(&centers, &normals);
        let under = laid.triangles_at(&target.vertices, &welded_normals(&target.vertices, &triangles));
        Ok(Self::assembled(laid, Body::Mesh(body), matches, under, &target.vertices, options))
    }

    /// As [`Self::new`], for a target in the space of a cage around it, by one linear solve a pose.
    ///
    /// # Errors
    /// See [`TransferError`].
    pub fn through_cage(
        source: &Source<'_>,
        target: &CagedTarget<'_>,
        options: &FittedOptions<'_>,
    ) -> Result<Self, TransferError> {
        let points = &target.model.points;
        let mesh = TriMesh::from(target.model);
        let triangles = outward(points, &mesh.triangles);
        let (seen, _) = Observation::of_surface(points, &triangles, &target.model.normals, &options.observation())?;
        let normals = if triangles.is_empty() {
            let near = NearestPoints::new(seen.points.iter().copied());
            points.iter().map(|&p| seen.normals[near.nearest(p).0]).collect()
        } else {
            welded_normals(points, &triangles)
        };
        let rest = target.cage.vertices();
        let body = CageSpace::new(points, &normals, &triangles, target.phi, rest)
            .ok_or(TransferError::Target(MeshError::Degenerate))?;
        let laid = RegisteredSource::new(source, &Goal { points, triangles: &triangles, seen: &seen }, options)?;
        let under = laid.triangles_at(points, &normals);
        let matches = body.graph.nodes.iter().map(|&node| under[node as usize]).collect();
        Ok(Self::assembled(laid, Body::Caged(Box::new(body)), matches, under, points, options))
    }

    fn assembled(
        laid: RegisteredSource,
        body: Body,
        matches: Vec<u32>,
        under: Vec<u32>,
        target: &[Point],
        options: &FittedOptions<'_>,
    ) -> Self {
        let RegisteredSource { aligned, rest, laid, registration, .. } = laid;
        let gradients = Gradients::new(&rest);
        let like = registration.score < LIKE_SHAPES;
        let smoothing = match body {
            _ if !like => UNLIKE_PASSES,
            Body::Caged(_) => GRAPH_PASSES,
            Body::Mesh(_) => LIKE_PASSES,
        };
        let turned_by = gradients.smoothed(gradients.of(&vectors(&laid)), ROTATION_PASSES);
        let turns = Gradients::rotations(&turned_by);
        let absolute = match options.pose {
            Pose::Auto => like,
            pose => pose == Pose::Absolute,
        };
        let offset = mean(&vectors(target)) - mean_of(&vectors(&rest.vertices), &rest.triangles, &under);
        let turned = turned(&turns, gradients.areas());
        Self {
            source_points: rest.vertices.len(),
            gradients,
            smoothing,
            back: absolute.then(|| turns.iter().map(DMat3::transpose).collect()),
            body,
            matches,
            under,
            source_triangles: rest.triangles,
            offset,
            report: FittedReport { aligned, registration, absolute, turned },
        }
    }

    /// How well source and target go together.
    pub fn report(&self) -> &FittedReport {
        &self.report
    }

    /// For each point of the target, a point of the source that was laid there.
    pub fn source_points(&self) -> Vec<u32> {
        self.under.iter().map(|&t| self.source_triangles[t as usize][0]).collect()
    }

    /// The target as the source is in a frame, the mean where the source's goes.
    ///
    /// # Errors
    /// Other points than at rest, or one that is not finite; `frame` is the number in the message.
    pub fn pose(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, TransferError> {
        let pose = moved_frame(frame, points, self.source_points, &self.report.aligned.similarity)?;
        let gradients = self.gradients.smoothed(self.gradients.of(&pose), self.smoothing);
        let matched = |t: &u32| {
            let gradient = gradients[*t as usize];
            self.back.as_ref().map_or(gradient, |back| gradient * back[*t as usize])
        };
        let wanted: Vec<DMat3> = self.matches.iter().map(matched).collect();
        let shape = match &self.body {
            Body::Mesh(poisson) => poisson.solve(&wanted),
            Body::Caged(space) => space.solve(&wanted),
        };
        let turn = self.under.iter().map(|&t| gradients[t as usize]).sum::<DMat3>() * (1.0 / self.under.len() as f64);
        let to = mean_of(&pose, &self.source_triangles, &self.under) + turn * self.offset;
        let by = to - mean(&shape);
        Ok(shape.iter().map(|p| (*p + by).to_array()).collect())
    }

    /// The source's points under the target's vertices, in the target's space: for contacts.
    ///
    /// # Errors
    /// As [`Self::pose`].
    pub fn under(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, TransferError> {
        let pose = moved_frame(frame, points, self.source_points, &self.report.aligned.similarity)?;
        Ok(self.under.iter().map(|&t| center(&pose, self.source_triangles[t as usize]).to_array()).collect())
    }
}

/// The share of the area whose triangles are turned by more than [`TURNED`].
fn turned(turns: &[DMat3], areas: &[f64]) -> f64 {
    let least = TURNED.to_radians().cos();
    let far = |r: &DMat3| 0.5 * (trace(*r) - 1.0) < least;
    // From 0, since an empty sum is −0.
    let sum = turns.iter().zip(areas).filter(|(r, _)| far(r)).fold(0.0, |sum, (_, area)| sum + area);
    sum / areas.iter().sum::<f64>()
}

fn center(pose: &[DVec3], triangle: [u32; 3]) -> DVec3 {
    triangle.iter().map(|&v| pose[v as usize]).sum::<DVec3>() / 3.0
}

/// The mean of the centres of some triangles.
fn mean_of(pose: &[DVec3], triangles: &[[u32; 3]], chosen: &[u32]) -> DVec3 {
    chosen.iter().map(|&t| center(pose, triangles[t as usize])).sum::<DVec3>() / chosen.len() as f64
}
