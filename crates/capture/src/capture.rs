//! Writes solved frames to a container with their report, for `encode` and the service alike.

use crate::preparation_warnings::preparation_warnings;
use cager_codec::{CodedMesh, rounded_error};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, DEFINITION};
use cager_core::inversion::{Solver, SolverOptions};
use cager_geometry::mesh::{Model, Point};
use cager_geometry::units::Units;
use cager_proto::container::{self, ContainerWriter, Header, counted_from_zero};
use cager_proto::report::{Coding, ConditionNumber, FrameError, Report};
use serde::{Deserialize, Serialize};
use std::io::Write;

/// What containers and reports say they were written by.
pub(crate) const GENERATOR: &str = concat!("cager ", env!("CARGO_PKG_VERSION"));

/// What an encoding is made with, besides its frames.
#[derive(Clone, Copy)]
pub struct Encoding<'a> {
    /// Model in its rest pose.
    pub rest: &'a Model,
    /// Checked cage around it.
    pub cage: &'a Cage,
    /// Coordinate system.
    pub system: &'a dyn CoordinateSystem,
    /// Solver options.
    pub options: SolverOptions,
    /// Solver prepared with all of these.
    pub solver: &'a Solver,
    /// Frames per second, where known.
    pub frame_rate: Option<f64>,
    /// What is added to all positions when they are decoded.
    pub origin: Option<Point>,
    /// What positions mean, as far as it is known.
    pub units: Units,
}

/// Errors of a frame as they are stored, with the sums that the error of the whole capture needs.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct StoredError {
    /// `sqrt(mean |e|²)` over the rest diagonal; NaN if not measured.
    pub l2: f32,
    /// `max |e|` over the rest diagonal; NaN if not measured.
    pub linf: f32,
    /// `Σ |e|²` in the capture's unit.
    pub squared: f64,
    /// `Σ |p − p̄|²` of the frame about its own centroid.
    pub spread: f64,
}

impl StoredError {
    /// Of a frame of which only handle rows are known.
    pub const NOT_MEASURED: Self = Self { l2: f32::NAN, linf: f32::NAN, squared: f64::NAN, spread: f64::NAN };

    /// Of a frame that was coded and measured: to the digits that files keep of it.
    pub fn of_coded(error: &cager_core::decode::FrameError, diagonal: f64) -> Self {
        let exact = Self::new(error, diagonal);
        Self { l2: rounded_error(exact.l2), linf: rounded_error(exact.linf), ..exact }
    }

    /// Of a measured frame.
    pub fn new(error: &cager_core::decode::FrameError, diagonal: f64) -> Self {
        // Not smaller than it is.
        let stored = |x: f64| {
            let nearest = (x / diagonal) as f32;
            if f64::from(nearest) < x / diagonal { nearest.next_up() } else { nearest }
        };
        Self { l2: stored(error.l2), linf: stored(error.linf), squared: error.squared, spread: error.spread }
    }
}

/// Writes the container of a capture frame by frame, and collects its report.
pub struct CaptureWriter<W: Write> {
    writer: ContainerWriter<W>,
    report: Report,
    squared: f64,
    spread: f64,
    diagonal: f64,
    /// Frame whose cage lies farthest from the origin, and how far.
    farthest: (usize, f64),
    /// Whether cages stay near their frames.
    stays_near: bool,
}

impl<W: Write> CaptureWriter<W> {
    /// Writes the header, the rest pose and the cage, these as they are or in the bytes of a codec.
    ///
    /// # Errors
    /// An output that refuses; sizes beyond the format.
    pub fn new(
        out: W,
        encoding: &Encoding<'_>,
        coded: Option<(&CodedMesh, &CodedMesh)>,
    ) -> Result<Self, container::Error> {
        let (rest, cage) = coded.unzip();
        let meshes = ((encoding.rest, rest), (encoding.cage.mesh(), cage));
        let mut writer =
            ContainerWriter::with_meshes(out, &header(encoding), meshes.0, meshes.1, encoding.cage.carriers())?;
        if let Some(plan) = &encoding.solver.preparation().plan {
            writer.add_elements(plan.as_bytes())?;
        }
        let report = begin_report(writer.header(), encoding);
        let diagonal = encoding.solver.diagonal();
        let stays_near = encoding.solver.nearness().is_some();
        Ok(Self { writer, report, squared: 0.0, spread: 0.0, diagonal, farthest: (0, 0.0), stays_near })
    }

    /// Sets the frame numbers, one for each frame to be written.
    pub fn number_frames(&mut self, numbers: Vec<f64>) {
        if !counted_from_zero(&numbers) {
            self.report.frame_numbers = numbers;
        }
    }

    /// Adds the next frame: its cage, m × 3, and its error.
    ///
    /// # Errors
    /// An output that refuses.
    pub fn write_frame(&mut self, cage: &[f32], error: &StoredError) -> Result<(), container::Error> {
        let extent = f64::from(cage.iter().fold(0.0f32, |far, x| far.max(x.abs())));
        if extent > self.farthest.1 {
            self.farthest = (self.report.frames, extent);
        }
        self.add_error(error);
        self.writer.write_frame(cage, error.l2, error.linf)
    }

    /// Adds coded frames, their errors, and which cage lies farthest from the origin, and how far.
    ///
    /// # Errors
    /// An output that refuses.
    pub fn write_group(
        &mut self,
        cages: &[u8],
        residual: Option<&[u8]>,
        errors: &[StoredError],
        (frame, extent): (usize, f64),
    ) -> Result<(), container::Error> {
        if extent > self.farthest.1 {
            self.farthest = (self.report.frames + frame, extent);
        }
        errors.iter().for_each(|error| self.add_error(error));
        let errors: Vec<(f32, f32)> = errors.iter().map(|error| (error.l2, error.linf)).collect();
        self.writer.write_group(cages, residual, &errors)
    }

    fn add_error(&mut self, error: &StoredError) {
        self.squared += error.squared;
        self.spread += error.spread;
        self.report.error.per_frame.push(FrameError { l2: f64::from(error.l2), linf: f64::from(error.linf) });
        self.report.frames += 1;
    }

    /// Frames written so far.
    pub fn frames(&self) -> usize {
        self.report.frames
    }

    /// Bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.writer.bytes()
    }

    /// Says how the frames were coded.
    pub fn set_coding(&mut self, coding: Coding) {
        self.report.coding = Some(coding);
    }

    /// Writes what comes after the frames; the caller adds sizes, times and the worst point.
    ///
    /// # Errors
    /// An output that refuses.
    pub fn finish(mut self) -> Result<(W, Report), container::Error> {
        self.report.hold_errors_to_bound();
        self.report.warnings.extend(far_away(self.farthest.0, self.farthest.1 / self.diagonal, self.stays_near));
        let frames = &self.report.error.per_frame;
        let mean = |f: fn(&FrameError) -> f64| frames.iter().map(f).sum::<f64>() / frames.len().max(1) as f64;
        let max =
            |f: fn(&FrameError) -> f64| frames.iter().map(f).fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a });
        let kg_percent = if self.spread == 0.0 { 0.0 } else { 100.0 * (self.squared / self.spread).sqrt() };
        let (l2_mean, l2_max, linf_mean, linf_max) = (mean(|e| e.l2), max(|e| e.l2), mean(|e| e.linf), max(|e| e.linf));
        let error = &mut self.report.error;
        (error.l2_mean, error.l2_max, error.linf_mean, error.linf_max) = (l2_mean, l2_max, linf_mean, linf_max);
        error.kg_percent = kg_percent;
        self.report.bytes.capture = self.writer.header().capture_bytes(self.report.frames);
        if !self.report.frame_numbers.is_empty() {
            self.writer.add_frame_numbers(&self.report.frame_numbers)?;
        }
        Ok((self.writer.finish(Some(&self.report))?, self.report))
    }
}

fn begin_report(header: &Header, encoding: &Encoding<'_>) -> Report {
    let solver = encoding.solver;
    let found = solver.preparation();
    Report {
        generator: GENERATOR.to_owned(),
        triangles: encoding.rest.faces.arities().iter().map(|&a| (a as usize).saturating_sub(2)).sum(),
        diagonal: solver.diagonal(),
        refinement: found.refinement,
        affine_reproduction_error: found.affine_reproduction_error,
        condition_number: ConditionNumber { full: found.condition_full, handles: found.condition_handles },
        rank: found.rank,
        singular_values: found.singular_values.clone(),
        maxvol: found.maxvol,
        handle_indices: solver.handles().to_vec(),
        warnings: preparation_warnings(encoding.options, solver),
        ..Report::new(header)
    }
}

/// Cages are stored in single precision, which loses resolution far from the origin.
fn far_away(frame: usize, diagonals: f64, stays_near: bool) -> Option<String> {
    const MAX_DIAGONALS: f64 = 100.0;
    (diagonals > MAX_DIAGONALS).then(|| {
        let cure = if stays_near {
            "move the capture closer to the origin"
        } else {
            "unless the capture itself is there, the cage ran away, since with these options nothing keeps it near its frames: leave out regularizer, spectrum and lambda, whose usual values do"
        };
        format!(
            "the cage of frame {frame} lies {diagonals:.0} diagonals from the origin, where single precision resolves {:.1e} of the diagonal; {cure}",
            diagonals * f64::from(f32::EPSILON) / 2.0
        )
    })
}

fn header(encoding: &Encoding<'_>) -> Header {
    Header {
        coordinates_definition: DEFINITION,
        coordinates: encoding.system.name().to_owned(),
        handles: encoding.options.handles.name().to_owned(),
        regularizer: encoding.options.regularizer.name().to_owned(),
        // Larger values occur only with methods that have no threshold.
        spectrum: u32::try_from(encoding.options.spectrum).unwrap_or(u32::MAX),
        lambda: encoding.options.lambda,
        rows_per_frame: encoding.solver.decoder().unknowns() as u32,
        frame_rate: encoding.frame_rate,
        origin: encoding.origin,
        units: encoding.units,
        ..Header::default()
    }
}
