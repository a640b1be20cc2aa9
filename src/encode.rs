//! The main job: frames in, one cage per frame out, measured as a decoder will see it.

use crate::report::{Bytes, Condition, Errors, FrameError, MaxVol, Report, Seconds};
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::{BATCH, PrepareError, Solver, SolverOptions};
use cager_core::mesh::Model;
use cager_core::regularize::{Regularizer, WEAK};
use cager_formats::{Action, AtomicFile, FrameReader};
use cager_proto::container::{self, ContainerWriter, Header, Summary};
use rayon::prelude::*;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

/// Frames on their way take at most this much memory, unless one frame per batch already takes more.
const FRAMES_BYTES: usize = 640 << 20;

/// Why encoding stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// The rest pose and its cage cannot be used.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// The frames could not be read, or the output not be created.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
    /// The container could not be written.
    #[error("{}: {cause}", .path.display())]
    Container {
        /// The output.
        path: PathBuf,
        /// What went wrong; part of the message, so not a source as well.
        cause: container::Error,
    },
}

impl EncodeError {
    fn container(path: &Path, cause: container::Error) -> Self {
        let path = path.to_owned();
        match cause {
            // What `AtomicFile` passes through `io::Write` has the path in it already.
            container::Error::Io(io) => match io.downcast() {
                Ok(named) => Self::Formats(named),
                Err(io) => Self::Formats(cager_formats::Error::Io { path, action: Action::Write, cause: io }),
            },
            cause => Self::Container { path, cause },
        }
    }
}

/// Everything an encoding needs.
pub struct Job<'a> {
    /// Model in its rest pose.
    pub rest: &'a Model,
    /// Checked cage around it.
    pub cage: &'a Cage,
    /// The capture.
    pub frames: &'a mut dyn FrameReader,
    /// File to write.
    pub output: &'a Path,
    /// Coordinate system.
    pub system: &'a dyn CoordinateSystem,
    /// Solver options.
    pub options: SolverOptions,
}

/// Encodes a capture into one container, which appears whole or not at all. `progress` is told the number of frames done.
///
/// # Errors
/// See [`EncodeError`].
pub fn encode(job: Job<'_>, progress: &mut dyn FnMut(usize)) -> Result<Report, EncodeError> {
    let clock = Instant::now();
    let fail = |cause| EncodeError::container(job.output, cause);
    // Before the work, so that an unwritable place costs no waiting.
    let file = AtomicFile::create(job.output)?;
    let solver = Solver::prepare(job.system, job.cage, &job.rest.points, job.options)?;
    let mut report = begin_report(&job, &solver);
    let header = header(&job, &solver);
    let mut writer = ContainerWriter::new(BufWriter::with_capacity(1 << 20, file), &header, job.rest, job.cage.mesh())
        .map_err(fail)?;

    let mut totals = Totals::default();
    let mut farthest = (0, 0.0);
    let points = job.frames.points();
    std::thread::scope(|scope| -> Result<(), EncodeError> {
        let (full, batches) = sync_channel(rayon::current_num_threads());
        let (empty, recycled) = sync_channel(2 * rayon::current_num_threads() + 2);
        let frames = job.frames;
        let reader = scope.spawn(move || read_batches(frames, frames_per_batch(points), &full, &recycled));
        let mut done = 0;
        while let Ok(first) = batches.recv() {
            let mut waiting = vec![first];
            while waiting.len() < rayon::current_num_threads() {
                match batches.try_recv() {
                    Ok(batch) => waiting.push(batch),
                    Err(_) => break,
                }
            }
            let solved: Vec<SolvedBatch> = waiting.par_iter().map(|batch| solve(&solver, batch)).collect();
            for batch in waiting {
                // The reader may have stopped already.
                let _ = empty.send(batch);
            }
            let clock = Instant::now();
            for batch in solved {
                report.seconds.invert += batch.invert_seconds;
                report.seconds.measure += batch.measure_seconds;
                for (cage, error) in batch.cages.iter().zip(&batch.errors) {
                    let extent = cage.iter().fold(0.0f32, |far, x| far.max(x.abs()));
                    if f64::from(extent) > farthest.1 {
                        farthest = (done, f64::from(extent));
                    }
                    let error = totals.add(error, &mut report.error.per_frame, solver.diagonal());
                    writer.write_frame(cage, error.l2 as f32, error.linf as f32).map_err(fail)?;
                    done += 1;
                }
            }
            report.seconds.write += clock.elapsed().as_secs_f64();
            progress(done);
        }
        let outcome = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        report.seconds.read += outcome?;
        Ok(())
    })?;

    report.warnings.extend(far_away(farthest.0, farthest.1 / solver.diagonal()));
    let clock_write = Instant::now();
    report.frames = report.error.per_frame.len();
    totals.finish(&mut report);
    let summary = summary(&report);
    let buffered = writer.finish(Some(&summary)).map_err(fail)?;
    let file = buffered.into_inner().map_err(|e| fail(container::Error::from(e.into_error())))?;
    file.commit()?;
    report.bytes.output = std::fs::metadata(job.output).map_or(0, |m| m.len());
    report.bytes.ratio = report.bytes.capture as f64 / report.bytes.output as f64;
    report.bytes.bits_per_vertex_per_frame = 8.0 * report.bytes.output as f64 / (report.points * report.frames) as f64;
    report.seconds.write += clock_write.elapsed().as_secs_f64();
    report.seconds.total = clock.elapsed().as_secs_f64();
    Ok(report)
}

type Batch = Vec<Vec<f64>>;

fn frames_per_batch(points: usize) -> usize {
    let batches = 2 * rayon::current_num_threads() + 1;
    (FRAMES_BYTES / batches / (24 * points)).clamp(1, BATCH)
}

/// Reads all frames; returns the seconds that took, not counting the time it waited for the solver.
fn read_batches(
    frames: &mut dyn FrameReader,
    size: usize,
    full: &SyncSender<Batch>,
    recycled: &Receiver<Batch>,
) -> Result<f64, cager_formats::Error> {
    let mut seconds = 0.0;
    loop {
        let clock = Instant::now();
        let mut batch = recycled.try_recv().unwrap_or_default();
        let mut filled = 0;
        while filled < size {
            if filled == batch.len() {
                batch.push(Vec::new());
            }
            if !frames.read_next(&mut batch[filled])? {
                break;
            }
            filled += 1;
        }
        batch.truncate(filled);
        seconds += clock.elapsed().as_secs_f64();
        if batch.is_empty() || full.send(batch).is_err() {
            return Ok(seconds);
        }
    }
}

struct SolvedBatch {
    cages: Vec<Vec<f32>>,
    errors: Vec<cager_core::decode::FrameError>,
    invert_seconds: f64,
    measure_seconds: f64,
}

fn solve(solver: &Solver, batch: &Batch) -> SolvedBatch {
    let frames: Vec<&[f64]> = batch.iter().map(Vec::as_slice).collect();
    let clock = Instant::now();
    let cages = solver.invert(&frames);
    let invert_seconds = clock.elapsed().as_secs_f64();
    let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
    let errors = solver.decoder().measure(&views, &frames);
    let measure_seconds = clock.elapsed().as_secs_f64() - invert_seconds;
    SolvedBatch { cages, errors, invert_seconds, measure_seconds }
}

/// Sums over all frames that the KG error needs.
#[derive(Default)]
struct Totals {
    squared: f64,
    spread: f64,
}

impl Totals {
    fn add(
        &mut self,
        error: &cager_core::decode::FrameError,
        per_frame: &mut Vec<FrameError>,
        diagonal: f64,
    ) -> FrameError {
        self.squared += error.squared;
        self.spread += error.spread;
        // As the container stores them, so that report and container agree.
        let stored = |x: f64| f64::from((x / diagonal) as f32);
        let error = FrameError { l2: stored(error.l2), linf: stored(error.linf) };
        per_frame.push(error);
        error
    }

    fn finish(&self, report: &mut Report) {
        let frames = &report.error.per_frame;
        let mean = |f: fn(&FrameError) -> f64| frames.iter().map(f).sum::<f64>() / frames.len().max(1) as f64;
        let max = |f: fn(&FrameError) -> f64| frames.iter().map(f).fold(0.0, f64::max);
        (report.error.l2_mean, report.error.l2_max) = (mean(|e| e.l2), max(|e| e.l2));
        (report.error.linf_mean, report.error.linf_max) = (mean(|e| e.linf), max(|e| e.linf));
        report.error.kg_percent = if self.spread > 0.0 { 100.0 * (self.squared / self.spread).sqrt() } else { 0.0 };
        let corners = report.bytes.capture;
        report.bytes.capture = corners * 4 + 12 * (report.points as u64) * (report.frames as u64);
    }
}

fn begin_report(job: &Job<'_>, solver: &Solver) -> Report {
    let found = solver.preparation();
    Report {
        points: job.rest.points.len(),
        triangles: job.rest.faces.arities().iter().map(|&a| (a as usize).saturating_sub(2)).sum(),
        frames: 0,
        unknowns: solver.decoder().unknowns(),
        cage_vertices: job.cage.vertices().len(),
        cage_faces: job.cage.faces().len(),
        coordinates: job.system.name().to_owned(),
        handles: job.options.handles.name().to_owned(),
        regularizer: job.options.regularizer.name().to_owned(),
        spectrum: job.options.spectrum,
        lambda: job.options.lambda,
        affine_reproduction_error: found.affine_reproduction_error,
        condition_number: Condition { full: found.condition_full, handles: found.condition_handles },
        rank: found.rank,
        singular_values: found.singular_values.clone(),
        maxvol: MaxVol { swaps: found.swaps, log_volume: found.log_volume, max_entry: found.max_entry },
        handle_indices: solver.handles().to_vec(),
        error: Errors {
            l2_mean: 0.0,
            l2_max: 0.0,
            linf_mean: 0.0,
            linf_max: 0.0,
            kg_percent: 0.0,
            per_frame: Vec::new(),
        },
        bytes: Bytes {
            capture: job.rest.faces.indices().len() as u64,
            output: 0,
            ratio: 0.0,
            bits_per_vertex_per_frame: 0.0,
        },
        seconds: Seconds {
            coordinates: found.coordinates_seconds,
            maxvol: found.maxvol_seconds,
            svd: found.svd_seconds,
            ..Seconds::default()
        },
        warnings: warnings(job, solver),
    }
}

fn warnings(job: &Job<'_>, solver: &Solver) -> Vec<String> {
    let found = solver.preparation();
    let unknowns = solver.decoder().unknowns();
    let mut warnings = Vec::new();
    if !found.outside.is_empty() {
        warnings.push(format!(
            "{} of {} points lie outside the cage, by up to {:.2} % of the rest diagonal; mean value coordinates are defined there too, but an enlarged cage usually gives lower errors",
            found.outside.len(),
            job.rest.points.len(),
            100.0 * found.outside_distance
        ));
    }
    let strong = found.singular_values.iter().filter(|&&s| s >= WEAK * found.singular_values[0]).count();
    let weak = unknowns - strong;
    if weak > 0 {
        let consequence = match job.options.regularizer {
            Regularizer::Laplacian | Regularizer::Global if job.options.lambda > 0.0 => {
                "the cage's Laplacian takes care".to_owned()
            }
            Regularizer::Tikhonov => "all are damped".to_owned(),
            Regularizer::TruncatedSvd if job.options.spectrum >= weak => "all are dropped".to_owned(),
            _ => format!(
                "they follow the rounding of the data, so expect spikes, or use --regularizer laplacian --spectrum {weak}"
            ),
        };
        warnings.push(format!(
            "the points determine only {strong} of the {unknowns} unknowns of the cage; of the {weak} others, {consequence}"
        ));
    }
    if found.affine_reproduction_error > 1e-10 {
        warnings.push(format!(
            "the coordinates reproduce the rest pose to {:.1e} of its diagonal only, as happens far outside a cage, above all a very thin one; check that both files belong together",
            found.affine_reproduction_error
        ));
    }
    warnings
}

/// Cages are stored as positions in single precision; far from the origin little of it is left for the shape.
fn far_away(frame: usize, diagonals: f64) -> Option<String> {
    const LOST: f64 = 100.0;
    (diagonals > LOST).then(|| {
        format!(
            "the cage of frame {frame} lies {diagonals:.0} diagonals from the origin, where single precision resolves {:.1e} of the diagonal; move the capture closer to the origin",
            diagonals * f64::from(f32::EPSILON) / 2.0
        )
    })
}

fn header(job: &Job<'_>, solver: &Solver) -> Header {
    Header {
        solver_version: cager_core::SOLVER_VERSION,
        coordinates: job.system.name().to_owned(),
        handles: job.options.handles.name().to_owned(),
        regularizer: job.options.regularizer.name().to_owned(),
        spectrum: job.options.spectrum as u32,
        lambda: job.options.lambda,
        rows_per_frame: solver.decoder().unknowns() as u32,
        frame_rate: job.frames.frame_rate(),
        ..Header::default()
    }
}

fn summary(report: &Report) -> Summary {
    Summary {
        generator: concat!("cager ", env!("CARGO_PKG_VERSION")).to_owned(),
        triangles: report.triangles as u64,
        affine_reproduction_error: report.affine_reproduction_error,
        condition_number: container::ConditionNumber {
            full: report.condition_number.full,
            handles: report.condition_number.handles,
        },
        rank: report.rank as u64,
        singular_values: report.singular_values.clone(),
        maxvol: container::MaxVolSummary {
            swaps: report.maxvol.swaps as u64,
            log_volume: report.maxvol.log_volume,
            max_entry: report.maxvol.max_entry,
        },
        handle_indices: report.handle_indices.clone(),
        error: container::ErrorSummary {
            l2_mean: report.error.l2_mean,
            l2_max: report.error.l2_max,
            linf_mean: report.error.linf_mean,
            linf_max: report.error.linf_max,
            kg_percent: report.error.kg_percent,
        },
        capture_bytes: report.bytes.capture,
        warnings: report.warnings.clone(),
    }
}
