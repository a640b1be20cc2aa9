//! The method of a transfer made ready.

use super::error::TransferFailed;
use super::job::{MethodChoice, Public, TransferJob};
use super::report::TransferReport;
use cager_cages::{EncloseOptions, enclose_watched};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_geometry::spatial::outside;
use cager_shape::deformation::Detail;
use cager_shape::registration::{Alignment, Observation, ObservationOptions};
use cager_shape::transfer::alignment::{AlignBy, align_surfaces};
use cager_shape::transfer::fitted::{CagedTarget, FittedTransfer};
use cager_shape::transfer::public::PublicTransfer;
use cager_shape::transfer::{FittedOptions, Source, needs_cage};
use cager_shape::{Similarity, TransferError};
use faer::Mat;
use std::ops::ControlFlow;

/// A transfer that is ready.
pub(super) struct Mover {
    method: Method,
    name: &'static str,
    detail: Option<Detail>,
    cage_vertices: usize,
    aligned: Alignment,
    /// Whether the axis that points up was given.
    has_up: bool,
}

enum Method {
    Fitted(Box<FittedTransfer>),
    Public(Box<PublicTransfer>),
}

/// Vertices of the cages that are made.
const CAGE_VERTICES: usize = 350;

impl Mover {
    pub(super) fn new(job: &TransferJob<'_>) -> Result<Self, TransferFailed> {
        if job.source.faces.is_empty() {
            return Err(TransferFailed::NoFaces("source"));
        }
        match job.method {
            MethodChoice::Fitted => fitted(job),
            MethodChoice::Public(cage) => public(job, cage, None),
            MethodChoice::Rigid(cage, rigidity) => public(job, cage, Some(rigidity)),
        }
    }

    pub(super) fn pose(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, TransferError> {
        let pose = match &self.method {
            Method::Fitted(transfer) => transfer.pose(frame, points),
            Method::Public(transfer) => transfer.pose(frame, points),
        }?;
        Ok(match &self.detail {
            Some(detail) => detail.add(&pose),
            None => pose,
        })
    }

    /// The source's points under the target's.
    pub(super) fn under(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, TransferError> {
        match &self.method {
            Method::Fitted(transfer) => transfer.under(frame, points),
            Method::Public(transfer) => transfer.under(frame, points),
        }
    }

    /// What is known before times and qualities are, and warnings.
    pub(super) fn report(&self, points: usize, frames: usize) -> (TransferReport, Vec<String>) {
        let similarity = self.aligned.similarity;
        let mut report = TransferReport {
            points,
            frames,
            turned_degrees: similarity.angle().to_degrees(),
            scale: similarity.scale,
            runner_up: Some(self.aligned.runner_up).filter(|score| score.is_finite()),
            cage_vertices: self.cage_vertices,
            detail: self.detail.is_some(),
            method: self.name,
            ..TransferReport::default()
        };
        let mut warnings = Vec::new();
        if self.aligned.is_ambiguous() {
            warnings.push(format!(
                "another way to lay the source onto the target fits almost as well ({:.2} times the distance); look at the result, and give {} where it is wrong",
                self.aligned.runner_up,
                if self.has_up { "--align" } else { "--up or --align" },
            ));
        }
        if let Method::Fitted(transfer) = &self.method {
            let found = transfer.report();
            report.score = Some(found.registration.score);
            report.pose = Some(if found.absolute { "absolute" } else { "relative" });
            report.turned_area = Some(found.turned);
            report.correspondence = Some(transfer.source_points());
        }
        (report, warnings)
    }
}

fn fitted(job: &TransferJob<'_>) -> Result<Mover, TransferFailed> {
    let made;
    let cage = match &job.cage {
        Some(cage) => cage,
        None => {
            made = around("source", &job.source, job.stopped)?;
            &made
        }
    };
    let phi = mean_value("source", cage, &job.source.points)?;
    let rest = TriMesh::from(&job.source);
    let source = Source { rest: &rest, cage, phi: phi.as_ref() };
    let options = FittedOptions {
        pose: job.pose,
        align: job.align,
        up: job.up,
        pairs: job.pairs.clone(),
        stopped: job.stopped,
        ..FittedOptions::default()
    };
    let target = TriMesh::from(job.target);
    let transfer = if needs_cage(&target) {
        let cage = around("target", job.target, job.stopped)?;
        let phi = mean_value("target", &cage, &job.target.points)?;
        let target = CagedTarget { model: job.target, cage: &cage, phi: phi.as_ref() };
        FittedTransfer::through_cage(&source, &target, &options)?
    } else {
        FittedTransfer::new(&source, &target, &options)?
    };
    let aligned = transfer.report().aligned;
    let (method, cage_vertices) = (Method::Fitted(Box::new(transfer)), cage.vertices().len());
    Ok(Mover { method, name: "fitted", detail: None, cage_vertices, aligned, has_up: job.up.is_some() })
}

fn around(whose: &'static str, model: &Model, stopped: &dyn Fn() -> bool) -> Result<Cage, TransferFailed> {
    let vertices = CAGE_VERTICES.min(model.points.len() / 2).max(4);
    let options = EncloseOptions { vertices, ..EncloseOptions::default() };
    let mesh = enclose_watched(model, &options, &mut watch(stopped))
        .map_err(|error| TransferFailed::Enclose { whose, error })?;
    Cage::new(mesh).map_err(|error| TransferFailed::Cage { whose, error })
}

/// Breaks once the transfer is to stop.
fn watch(stopped: &dyn Fn() -> bool) -> impl FnMut() -> ControlFlow<()> {
    move || if stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

fn mean_value(whose: &'static str, cage: &Cage, points: &[Point]) -> Result<Mat<f64>, TransferError> {
    let found = MeanValue.coordinates(cage, points, None);
    Ok(found.map_err(|error| TransferError::Coordinates { whose, error })?.phi)
}

fn public(job: &TransferJob<'_>, cage: Public, rigidity: Option<f64>) -> Result<Mover, TransferFailed> {
    let (rest, target) = (TriMesh::from(&job.source), TriMesh::from(job.target));
    let detail = match (job.detail, target.triangles.is_empty()) {
        (true, true) => return Err(TransferFailed::NoFaces("target")),
        (true, false) => Some(Detail::new(&target).map_err(TransferError::Target)?),
        (false, _) => None,
    };
    job.go_on()?;
    let aligned = aligned(job, &rest, &target)?;
    job.go_on()?;
    let similarity = aligned.similarity;
    let made;
    let cage = match (cage, &job.cage) {
        (Public::Given, Some(cage)) => {
            reject_outside("source", &similarity.apply_all(&rest.vertices), cage, job.system)?;
            reject_outside("target", &target.vertices, cage, job.system)?;
            cage
        }
        (Public::Given, None) => return Err(TransferFailed::NoCage),
        (Public::Made(shape), _) => {
            let moved = TriMesh { vertices: similarity.apply_all(&rest.vertices), triangles: rest.triangles.clone() };
            let mesh = shape.around_watched(&moved, &target, &mut watch(job.stopped)).map_err(TransferError::from)?;
            made = Cage::new(mesh).map_err(|error| TransferFailed::Cage { whose: "source and the target", error })?;
            &made
        }
    };
    job.go_on()?;
    let transfer = PublicTransfer::new(&rest, &target, similarity, cage, job.system, rigidity)?;
    let (method, cage_vertices) = (Method::Public(Box::new(transfer)), cage.vertices().len());
    let name = if rigidity.is_some() { "rigid" } else { "public" };
    Ok(Mover { method, name, detail, cage_vertices, aligned, has_up: job.up.is_some() })
}

/// Refuses points where coordinates other than mean value ones do not exist.
fn reject_outside(
    whose: &'static str,
    points: &[Point],
    cage: &Cage,
    system: &dyn CoordinateSystem,
) -> Result<(), TransferFailed> {
    if system.name() == MeanValue.name() {
        return Ok(());
    }
    let found = outside(cage.mesh(), points);
    let Some(&(first, _)) = found.first() else { return Ok(()) };
    Err(TransferFailed::Outside { whose, count: found.len(), first, system: system.name() })
}

fn aligned(job: &TransferJob<'_>, source: &TriMesh, target: &TriMesh) -> Result<Alignment, TransferError> {
    if job.align == AlignBy::AsTheyStand {
        return Ok(Alignment::given(Similarity::IDENTITY));
    }
    let draw = ObservationOptions::default();
    let source = Observation::of_mesh(&source.vertices, &source.triangles, &draw);
    let (source, _) = source.map_err(TransferError::SourceSurface)?;
    let (target, _) = Observation::of_surface(&target.vertices, &target.triangles, &job.target.normals, &draw)?;
    Ok(align_surfaces(&source, &target, None, job.align, job.up)[0])
}
