//! The page of `cager demo`: what the command prints, errors, and the decoded model in its cage.

use anyhow::Result;
use cager_capture::decode;
use cager_compare::report_page::{Box3, Contents, Quantised, ReportKind, ReportPage, ShownCage, ShownMesh};
use cager_demo::Capture;
use cager_formats::open_frames;
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use cager_proto::report::Report;
use serde::Serialize;
use std::path::Path;

/// Points of the model that are drawn at the most, about, and the same over all frames.
const POINTS: usize = 12_000;
const POINTS_OF_ALL_FRAMES: usize = 300_000;
/// How far from the rest pose cages are kept, in diagonals.
const CAGE_REACH: f64 = 4.0;

/// A line of the table: what, how much, and a note.
#[derive(Serialize)]
pub(super) struct Row {
    pub(super) name: &'static str,
    pub(super) value: String,
    pub(super) note: String,
}

/// Errors are fractions of the rest pose's diagonal.
#[derive(Serialize)]
struct Figures<'a> {
    rows: &'a [Row],
    l2: Vec<f64>,
    linf: Vec<f64>,
    singular_values: &'a [f64],
}

#[derive(Serialize)]
struct Geometry {
    mesh: ShownMesh,
    cage: ShownCage,
    /// Frames that are drawn, evenly spaced.
    frames: Vec<usize>,
    /// Points of these frames, as decoded.
    points: Quantised,
    /// Vertices of their cages.
    cages: Quantised,
}

/// The page as a file.
pub(super) fn page(
    page: &ReportPage,
    (capture, report, rows): (&Capture, &Report, &[Row]),
    (container, decoded): (&Path, &Path),
) -> Result<Vec<u8>> {
    let (l2, linf) = report.error.per_frame.iter().map(|e| (e.l2, e.linf)).unzip();
    let figures = Figures { rows, l2, linf, singular_values: &report.singular_values };
    let geometry = geometry(capture, container, decoded)?;
    let program = env!("CARGO_PKG_VERSION");
    Ok(page.with(&Contents { kind: ReportKind::Demo, program, figures: &figures, geometry: &geometry })?)
}

fn geometry(capture: &Capture, container: &Path, decoded: &Path) -> Result<Geometry> {
    let rest = &capture.rest.points;
    let mesh = ShownMesh::new(&TriMesh::from(&capture.rest), None, POINTS);
    let count = (POINTS_OF_ALL_FRAMES / rest.len().min(POINTS)).clamp(1, capture.frames());
    let frames: Vec<usize> = (0..count).map(|k| k * (capture.frames() - 1) / (count - 1).max(1)).collect();

    let mut container_reader = decode::open(container)?;
    let mut reader = open_frames(decoded, rest.len())?;
    let (mut points, mut cages, mut frame, mut rows) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for number in 0..capture.frames() {
        reader.read_next(&mut frame)?;
        if frames.binary_search(&number).is_err() {
            continue;
        }
        points.extend(mesh.pick(&frame));
        let fail = |cause| decode::DecodeError::container(container, cause);
        container_reader.read_frame(number, &mut rows).map_err(fail)?;
        let vertices = rows[..3 * capture.cage.vertices.len()].as_chunks::<3>().0;
        cages.extend(vertices.iter().map(|p| -> Point { p.map(f64::from) }));
    }
    let reach = Box3::around(rest, CAGE_REACH * diagonal(rest));
    let (points, cages) = (Quantised::new(&points, 16, reach), Quantised::new(&cages, 16, reach));
    Ok(Geometry { mesh, cage: ShownCage::new(&capture.cage), frames, points, cages })
}
