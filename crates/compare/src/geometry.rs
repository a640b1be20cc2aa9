//! What the report of a comparison draws: rest pose, cage, frames, and cages and models of the
//! methods.

use super::evaluation::cages;
use super::figures::SystemFigures;
use super::method_groups::{data_alone, solver};
use super::methods::Method;
use super::sample::{Frame, Sample};
use super::system::SystemStudy;
use super::{CompareError, Job, frames_of};
use crate::report_page::{Box3, Quantised, ShownCage, ShownMesh, floats};
use cager_core::cage::Cage;
use cager_core::inversion::{BATCH, SolverOptions};
use cager_geometry::mesh::{Point, TriMesh};
use rayon::prelude::*;
use serde::Serialize;

/// Points of the model that are drawn at the most, about.
const POINTS: usize = 8_000;
/// Vertices of all frames of a method's cages, about.
const CAGE_VERTICES: usize = 4_000;
/// Memory for the frames that are read for it.
const FRAME_BYTES: usize = 256 << 20;
/// Frames of the row that shows the capture.
const ROW: usize = 4;
/// How far from the rest pose cages are kept, in diagonals: spikes leave every picture long before.
const CAGE_REACH: f64 = 4.0;
/// The same for points; and beyond the second, offsets of models are kept with 16 bits.
const OFFSET_REACH: f64 = 50.0;
const LARGE_OFFSET: f64 = 0.5;
const LARGEST_OVER_MEAN: f64 = 12.0;

/// Everything that is drawn, in the unit of the capture.
#[derive(Serialize)]
pub struct Geometry {
    mesh: ShownMesh,
    cage: ShownCage,
    frames: Vec<CaptureFrame>,
    /// Frames that follow each other, around the shown one: those of the cages.
    clip: Vec<usize>,
    /// The systems that could be computed.
    systems: Vec<SystemGeometry>,
}

/// A frame as it was captured.
#[derive(Serialize)]
struct CaptureFrame {
    frame: usize,
    points: Quantised,
}

/// What is drawn of a system.
#[derive(Serialize)]
struct SystemGeometry {
    /// Handles on the rest pose.
    handles: String,
    /// Cages and models of the methods that are shown.
    methods: Vec<MethodGeometry>,
    /// The shown frame by the random draw with the median error.
    draw: Option<DrawGeometry>,
    /// Frames by the paper's method.
    row: Vec<RowGeometry>,
    /// Singular vectors that are painted, a value per vertex of the cage.
    vectors: Vec<String>,
}

#[derive(Serialize)]
struct MethodGeometry {
    /// Its place among the methods of the figures.
    method: usize,
    /// Cages of the clip, one after another.
    cages: Quantised,
    /// Points of the shown frame, relative to the capture's.
    offsets: Quantised,
}

#[derive(Serialize)]
struct DrawGeometry {
    name: String,
    l2: f64,
    linf: f64,
    offsets: Quantised,
}

#[derive(Serialize)]
struct RowGeometry {
    frame: usize,
    cage: Quantised,
    offsets: Quantised,
}

/// Collects the same frames for every system.
pub(super) struct GeometryBuilder<'a> {
    rest: &'a [Point],
    cage: &'a Cage,
    diagonal: f64,
    /// Where cages are kept.
    reach: Box3,
    shown: usize,
    row: Vec<usize>,
    frames: Vec<Frame>,
    geometry: Geometry,
}

impl<'a> GeometryBuilder<'a> {
    /// Chooses the frame to show, and reads it with its neighbours and the row's frames.
    pub(super) fn new(
        job: &Job<'a>,
        mesh: &TriMesh,
        sample: &Sample,
        figures: &SystemFigures,
    ) -> Result<Self, CompareError> {
        let measured = sample.measured();
        let shown = measured[frame_of_largest_spike(figures)];
        let count = measured.len().min(ROW);
        let row: Vec<usize> = (0..count).map(|k| measured[k * (measured.len() - 1) / (count - 1).max(1)]).collect();
        let most = (CAGE_VERTICES / job.cage.vertices().len()).min(FRAME_BYTES / (24 * mesh.vertices.len().max(1)));
        let clip = clip(shown, job.frames, most.clamp(3, BATCH - 1));
        let mut wanted: Vec<usize> = row.iter().chain(&clip).copied().collect();
        wanted.sort_unstable();
        wanted.dedup();
        let frames = frames_of((job.open)()?.as_mut(), &wanted)?;
        let shown_mesh = ShownMesh::new(mesh, job.up, POINTS);
        let kept = row.iter().chain(Some(&shown).filter(|shown| !row.contains(shown)));
        let captured = kept.filter_map(|&number| {
            let frame = frames.iter().find(|frame| frame.number == number)?;
            let points = shown_mesh.pick(&frame.points);
            Some(CaptureFrame { frame: number, points: Quantised::new(&points, 16, Box3::around(&points, 0.0)) })
        });
        let captured = captured.collect();
        let diagonal = cager_geometry::mesh::diagonal(&mesh.vertices);
        let cage = ShownCage::new(job.cage.mesh());
        let reach = Box3::around(&mesh.vertices, CAGE_REACH * diagonal);
        let geometry = Geometry { mesh: shown_mesh, cage, frames: captured, clip, systems: Vec::new() };
        Ok(Self { rest: &job.rest.points, cage: job.cage, diagonal, reach, shown, row, frames, geometry })
    }

    /// The frame whose cages and models are drawn.
    pub(super) fn shown(&self) -> usize {
        self.shown
    }

    pub(super) fn finish(self) -> Geometry {
        self.geometry
    }

    pub(super) fn add(&mut self, study: &SystemStudy<'_>) -> Result<(), CompareError> {
        let rows = study.analysis.handles().map_or(&[][..], |handles| &handles.rows);
        let (v, count) = (study.analysis.handle_vectors(), self.cage.vertices().len());
        let painted = &study.figures.vectors.painted;
        let system = SystemGeometry {
            handles: floats(rows.iter().flat_map(|&row| self.rest[row as usize])),
            methods: self.methods(study),
            draw: self.draw(study)?,
            row: match study.figures.method(|m| m.is_cager() && m.curve) {
                Some(usual) => self.row(study, usual.method.options),
                None => Vec::new(),
            },
            vectors: painted.iter().map(|&k| floats((0..count).map(|j| v[(j, k)]))).collect(),
        };
        self.geometry.systems.push(system);
        Ok(())
    }

    fn frame(&self, number: usize) -> Option<&Frame> {
        self.frames.iter().find(|frame| frame.number == number)
    }

    fn methods(&self, study: &SystemStudy<'_>) -> Vec<MethodGeometry> {
        let clip = &self.geometry.clip;
        let frames: Option<Vec<&[f64]>> = clip.iter().map(|&n| Some(self.frame(n)?.points.as_slice())).collect();
        let (Some(frames), Some(at)) = (frames, clip.iter().position(|&n| n == self.shown)) else { return Vec::new() };
        let found = study.figures.methods.iter().enumerate().filter(|(_, m)| is_shown(&m.method, &study.figures));
        let found: Vec<(usize, SolverOptions)> = found.map(|(place, m)| (place, m.method.options)).collect();
        let geometry = |(method, options): (usize, SolverOptions)| {
            let cages = study.invert(options, &frames)?;
            let offsets = self.offsets(study, &cages[at], frames[at]).0;
            Some(MethodGeometry { method, cages: self.cages(&cages), offsets })
        };
        found.into_par_iter().filter_map(geometry).collect()
    }

    fn draw(&self, study: &SystemStudy<'_>) -> Result<Option<DrawGeometry>, CompareError> {
        let (Some(frame), Some((name, rows))) = (self.frame(self.shown), &study.median_draw) else { return Ok(None) };
        let frames = [frame.points.as_slice()];
        let usual = study.figures.method(|m| m.is_cager() && m.curve).map(|m| m.method.options);
        let handle_system = study.analysis.handle_system_of(rows)?;
        let cages = cages(&solver(&handle_system, usual.unwrap_or_else(data_alone))?, None, &frames);
        Ok(cages.first().map(|cage| {
            let (offsets, [l2, linf]) = self.offsets(study, cage, &frame.points);
            DrawGeometry { name: name.clone(), l2, linf, offsets }
        }))
    }

    fn row(&self, study: &SystemStudy<'_>, usual: SolverOptions) -> Vec<RowGeometry> {
        let geometry = |&frame: &usize| {
            let points = self.frame(frame)?.points.as_slice();
            let cages = study.invert(usual, &[points])?;
            let offsets = self.offsets(study, cages.first()?, points).0;
            Some(RowGeometry { frame, cage: self.cages(&cages), offsets })
        };
        self.row.iter().filter_map(geometry).collect()
    }

    fn cages(&self, cages: &[Vec<f32>]) -> Quantised {
        let count = 3 * self.cage.vertices().len();
        let vertices = cages.iter().flat_map(|cage| cage[..count].as_chunks::<3>().0);
        Quantised::new(&vertices.map(|p| p.map(f64::from)).collect::<Vec<Point>>(), 16, self.reach)
    }

    /// Where a cage takes the points, relative to the capture's; and L2 and L∞ of all points.
    fn offsets(&self, study: &SystemStudy<'_>, cage: &[f32], truth: &[f64]) -> (Quantised, [f64; 2]) {
        let mut out = [Vec::new()];
        study.analysis.decoder().decode(&[cage], &mut out);
        let [decoded] = out;
        let moved: Vec<f64> = decoded.iter().zip(truth).map(|(&found, x)| f64::from(found) - x).collect();
        let squares = moved.as_chunks::<3>().0.iter().map(|p| p.iter().map(|x| x * x).sum::<f64>());
        let (sum, most) = squares.fold((0.0, 0.0), |(sum, most): (f64, f64), x| (sum + x, most.max(x)));
        let [l2, linf] = [sum / (moved.len() / 3) as f64, most].map(|x| x.sqrt() / self.diagonal);
        // With 8 bits a step is 1/128 of the largest offset, to stay below most others.
        let bits = if linf > LARGE_OFFSET || linf > LARGEST_OVER_MEAN * l2 { 16 } else { 8 };
        let shown = self.geometry.mesh.pick(&moved);
        (Quantised::new(&shown, bits, Box3::around_zero(OFFSET_REACH * self.diagonal)), [l2, linf])
    }
}

/// The frame where full least squares spikes most, or else of its largest error.
fn frame_of_largest_spike(figures: &SystemFigures) -> usize {
    let Some(full) = figures.method(Method::is_full_least_squares) else { return 0 };
    let largest = |values: &[f64]| {
        (0..values.len())
            .filter(|&i| values[i].is_finite())
            .max_by(|&a, &b| values[a].total_cmp(&values[b]).then(b.cmp(&a)))
    };
    largest(&full.per_frame.spike_max).or_else(|| largest(&full.per_frame.linf)).unwrap_or(0)
}

/// At most `most` frames that follow each other, `shown` as near to their middle as can be.
fn clip(shown: usize, frames: usize, most: usize) -> Vec<usize> {
    let first = shown.saturating_sub(most / 2).min(frames.saturating_sub(most));
    (first..frames.min(first + most)).collect()
}

fn is_shown(method: &Method, figures: &SystemFigures) -> bool {
    let strongest = figures.methods.iter().filter(|m| m.method.is_cager()).map(|m| m.method.options.spectrum).max();
    method.curve || method.is_cager() && Some(method.options.spectrum) == strongest
}

#[cfg(test)]
mod tests {
    use super::clip;

    #[test]
    fn a_clip_surrounds_the_frame_that_is_shown() {
        assert_eq!(clip(10, 100, 5), [8, 9, 10, 11, 12]);
        assert_eq!(clip(0, 100, 3), [0, 1, 2]);
        assert_eq!(clip(99, 100, 3), [97, 98, 99]);
        assert_eq!(clip(1, 2, 3), [0, 1]);
        assert_eq!(clip(0, 1, 3), [0]);
    }
}
