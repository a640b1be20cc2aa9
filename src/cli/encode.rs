//! `cager encode`.

use super::args::{CoordinatesArg, EncodeArgs, SolverArgs, SpectrumArg, StyleArg};
use super::checks::{capture_files, check_cage, check_capture};
use super::design;
use super::dry_run::{read_files, size, tell_would};
use super::outputs::Outputs;
use super::{grouped, human_bytes, is_verbose, plain, progress, tell, warn};
use crate::coordinates;
use crate::design::{DesignReport, read_frames};
use crate::encode::{self, ChooseSpectrum, EncodeProgress, Encoded, Job, sample_frames};
use crate::frames::CaptureFiles;
use crate::memory::Memory;
use crate::remote::{EncodedRemotely, FileFrames, RemoteCage, RemoteJob, RemoteProgress, encode_remotely};
use crate::report::Report;
use crate::speed::seconds_to_prepare;
use crate::timing::counted_from_zero;
use anyhow::{Context, Result, bail};
use cager_cages::DesignOptions;
use cager_cages::doctor::weld;
use cager_client::FrameSource;
use cager_client::messages::SessionOptions;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::{PrepareError, Solver, SolverOptions, check_options, usual_spectrum};
use cager_core::mesh::{Model, TriMesh};
use cager_core::regularize::{Regularizer, SparseMatrix, Term};
use cager_formats::{AtomicFile, CompleteFile, FrameReader, Target, commit_together, read_matrix, read_model};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

pub(super) fn run(args: &EncodeArgs) -> Result<()> {
    let clock = Instant::now();
    let targets = Targets::new(args)?;
    let mut rest = read_model(&args.rest)?;
    let mut files = capture_files(&args.capture, &args.frames, &mut rest);
    files.range = args.frames_range;
    let cage = args.cage.as_ref().map(|path| read_cage(path, args.flip_cage)).transpose()?;
    if args.capture.weld && args.server.is_some() {
        bail!("--weld: a service reads the rest pose as it is; give --server one without seams, or encode here");
    }
    check_capture(&files, (&args.rest, &rest), &args.capture.checks, true)?;
    if let (Some(path), Some(cage)) = (&args.cage, &cage) {
        check_cage((path, cage.mesh()), &rest, &args.capture.checks)?;
    }
    if args.outputs.dry_run {
        return dry_run(args, &targets, &files, &rest, cage.as_ref());
    }
    match (&args.server, &cage) {
        (None, Some(cage)) => here(args, &targets, &files, &rest, cage, None, clock),
        (None, None) => {
            let (cage, report) = designed(args, &files, &rest)?;
            here(args, &targets, &files, &rest, &cage, Some(report), clock)
        }
        (Some(address), cage) => elsewhere(args, &targets, address, files, &rest, cage.as_ref(), clock),
    }
}

/// Where the container goes, and the report.
struct Targets {
    output: Target,
    report: Option<Target>,
}

impl Targets {
    fn new(args: &EncodeArgs) -> Result<Self> {
        let inputs = [&args.rest, &args.frames].into_iter().chain(&args.cage).chain(&args.solver.regularizer_matrix);
        let mut outputs = Outputs::new(args.outputs, inputs)?;
        let output = outputs.binary(&args.output, "walk.cager")?;
        Ok(Self { output, report: args.report.as_ref().map(|path| outputs.text(path)).transpose()? })
    }

    fn begin_report(&self) -> Result<Option<AtomicFile>> {
        Ok(self.report.as_ref().map(AtomicFile::create).transpose()?)
    }
}

/// What can be known without designing a cage and solving, and without a service.
fn dry_run(
    args: &EncodeArgs,
    targets: &Targets,
    files: &CaptureFiles,
    rest: &Model,
    cage: Option<&Cage>,
) -> Result<()> {
    let matrix = matrix(&args.solver)?;
    spectrum_bound(&args.solver)?;
    if args.server.is_some() {
        refuse_choosing(&args.solver)?;
    }
    let what = match cage {
        Some(cage) => {
            let (system, _) = checked_solver(args, rest, cage, matrix.as_ref())?;
            let frames = read_files(files)?;
            format!("cages of {}, and the rest pose", size(frames, system.unknowns(cage), "unknowns"))
        }
        None => {
            design_options(args, rest.points.len())?;
            solver_for(&args.solver, |_| 0)?;
            if args.server.is_some() {
                designed_spectrum(&args.solver)?;
            }
            format!("{} frames; a cage would be designed from them first", grouped(read_files(files)? as u64))
        }
    };
    tell_would(&targets.output, &what, std::slice::from_ref(&targets.report))
}

/// How a cage is designed. Mean value coordinates do without a tidy one; the others want all points inside.
fn design_options(args: &EncodeArgs, points: usize) -> Result<DesignOptions> {
    let usual = match args.solver.coordinates {
        CoordinatesArg::Mvc => StyleArg::Free,
        _ => StyleArg::Editable,
    };
    if args.design.mean_error.is_some() && !matches!(args.solver.coordinates, CoordinatesArg::Mvc) {
        bail!(
            "--mean-error: is measured with mean value coordinates; give --cage-vertices, or leave --coordinates out"
        );
    }
    Ok(DesignOptions {
        goal: design::goal(args.design.cage_vertices, args.design.mean_error, points)?,
        style: args.design.style.unwrap_or(usual).into(),
        seed: args.design.seed.unwrap_or(0),
        time_limit: args.design.time_limit.map(|s| Duration::from_secs(s.into())),
        ..DesignOptions::default()
    })
}

/// A cage from the capture itself.
fn designed(args: &EncodeArgs, files: &CaptureFiles, rest: &Model) -> Result<(Cage, DesignReport)> {
    let options = design_options(args, rest.points.len())?;
    let frames = read_frames(files).map_err(|error| name_files(error, args))?;
    let design = design::design((&args.rest, rest), (&args.frames, &frames), None, &options)?;
    warn(&design.warnings);
    let report = DesignReport::new(&design, &options, frames.len());
    let cage = Cage::new(design.cage).with_context(|| args.rest.display().to_string())?;
    Ok((cage, report))
}

fn here(
    args: &EncodeArgs,
    targets: &Targets,
    files: &CaptureFiles,
    rest: &Model,
    cage: &Cage,
    design: Option<DesignReport>,
    clock: Instant,
) -> Result<()> {
    let memory = args.memory.unwrap_or_else(Memory::half_of_free);
    let mut frames = files.open()?;
    let read_seconds = clock.elapsed().as_secs_f64();
    let (system, options) = solver(&args.solver, cage)?;
    let matrix = matrix(&args.solver)?;
    let choose = match (args.solver.spectrum, spectrum_bound(&args.solver)?) {
        (Some(SpectrumArg::Auto), bound) => {
            // What is wrong with the options is told before anything is read.
            check_options(rest.points.len(), system.unknowns(cage), options).map_err(|e| name_file(&e, args))?;
            let mut again = files.open()?;
            let samples = choosing_frames(again.as_mut(), options.regularizer == Regularizer::Temporal)
                .map_err(|error| name_files(error, args))?;
            Some(ChooseSpectrum { samples, bound })
        }
        _ => None,
    };
    let report_file = targets.begin_report()?;

    let bar = progress::Prepared::new("encoding", frames.frames())
        .expecting(|| seconds_to_prepare(system, cage, rest.points.len()));
    let job = Job {
        rest,
        cage,
        frames: frames.as_mut(),
        output: &targets.output,
        system,
        options,
        term: matrix.as_ref().map(|matrix| matrix as &dyn Term),
        choose,
        memory,
    };
    let result = encode::encode(job, &|told| match told {
        EncodeProgress::Preparing(step) => bar.preparing(step),
        EncodeProgress::Frames(done) => bar.done(done),
    });
    bar.finish();
    let mut encoded = result.map_err(|error| name_files(error, args))?;
    encoded.report.seconds.read += read_seconds;
    encoded.report.design = design;
    finish(targets, encoded, report_file, clock)
}

/// Frames to choose a spectrum threshold by: the first ones where cages follow their predecessors.
fn choosing_frames(frames: &mut dyn FrameReader, first_ones: bool) -> Result<Vec<Vec<f64>>, encode::EncodeError> {
    sample_frames(frames, if first_ones { 96 } else { 24 }, first_ones)
}

/// The files are read and the options checked here as well, so that what is wrong with them is told before anything is sent, in
/// words that name them.
fn elsewhere(
    args: &EncodeArgs,
    targets: &Targets,
    address: &str,
    files: CaptureFiles,
    rest: &Model,
    cage: Option<&Cage>,
    clock: Instant,
) -> Result<()> {
    let frames = FileFrames::open(files)?;
    if !counted_from_zero(&frames.numbers()) {
        warn(&["a service numbers frames from 0; encode here to keep the numbers of the files".to_owned()]);
    }
    let read_seconds = clock.elapsed().as_secs_f64();
    let matrix = matrix(&args.solver)?;
    spectrum_bound(&args.solver)?;
    refuse_choosing(&args.solver)?;
    let (system, options, spectrum) = match cage {
        Some(cage) => {
            let (system, options) = checked_solver(args, rest, cage, matrix.as_ref())?;
            // Where there is a threshold it was checked; where there is none, none is used.
            (system, options, Some(u32::try_from(options.spectrum).unwrap_or(u32::MAX)))
        }
        None => {
            let (system, options) = solver_for(&args.solver, |_| 0)?;
            (system, options, designed_spectrum(&args.solver)?)
        }
    };
    let handle_count = args.solver.handle_count.map(u32::try_from).transpose();
    let report_file = targets.begin_report()?;

    let token = args.token.clone().or_else(|| std::env::var("CAGER_TOKEN").ok()).filter(|token| !token.is_empty());
    let options = SessionOptions {
        name: args
            .output
            .file_stem()
            .filter(|&name| name != "-")
            .map(|name| name.to_string_lossy().chars().take(200).collect()),
        coordinates: Some(system.name().to_owned()),
        handles: Some(options.handles.name().to_owned()),
        handle_count: handle_count.context("--handle-count: is larger than any number of points")?,
        regularizer: Some(options.regularizer.name().to_owned()),
        spectrum,
        lambda: Some(options.lambda),
        flip_cage: args.flip_cage,
        frame_rate: frames.frame_rate(),
        ..SessionOptions::default()
    };
    let design = design_options(args, rest.points.len())?;
    let bar = progress::frames("encoding", frames.frames().unwrap_or(0) as usize);
    let job = RemoteJob {
        address,
        token: token.as_deref(),
        rest: &args.rest,
        cage: match &args.cage {
            Some(path) => RemoteCage::File(path),
            None => RemoteCage::Designed(&design),
        },
        matrix: args.solver.regularizer_matrix.as_deref(),
        frames,
        output: &targets.output,
        options,
    };
    let designing = progress::steps();
    let result = encode_remotely(job, &mut |told| match told {
        RemoteProgress::Designing(told) => progress::design(&designing, told),
        RemoteProgress::Frames(done) => {
            designing.finish_and_clear();
            bar.set_position(done as u64);
        }
    });
    designing.finish_and_clear();
    bar.finish_and_clear();
    let EncodedRemotely { mut encoded, session, .. } = result?;
    encoded.report.seconds.read += read_seconds;
    finish(targets, encoded, report_file, clock)?;
    tell(&format!("  service {}, session {}\n", plain(address), plain(&session)))
}

fn refuse_choosing(args: &SolverArgs) -> Result<()> {
    if args.spectrum == Some(SpectrumArg::Auto) {
        bail!(
            "--spectrum auto: a service prepares before it sees a frame to measure; give a number, or encode without --server"
        );
    }
    Ok(())
}

/// [`solver`] for this rest pose and cage, with all checked that needs no coordinates.
fn checked_solver(
    args: &EncodeArgs,
    rest: &Model,
    cage: &Cage,
    matrix: Option<&SparseMatrix>,
) -> Result<(&'static dyn CoordinateSystem, SolverOptions)> {
    let (system, options) = solver(&args.solver, cage)?;
    let delta = matrix.map_or(Ok(()), |matrix| matrix.delta(cage, system.unknowns(cage)).map(|_| ()));
    match delta.map_err(PrepareError::from).and_then(|()| Solver::check(system, cage, &rest.points, options)) {
        // A service knows its own memory.
        Err(PrepareError::HandlesOutOfMemory { .. }) if args.server.is_some() => {}
        checked => checked.map_err(|error| name_file(&error, args))?,
    }
    Ok((system, options))
}

fn finish(targets: &Targets, encoded: Encoded, report_file: Option<AtomicFile>, clock: Instant) -> Result<()> {
    let Encoded { mut report, container } = encoded;
    report.seconds.total = clock.elapsed().as_secs_f64();
    // A full disk shows here, before either file has its name.
    let report_file = report_file.map(|file| write_report(file, &report)).transpose()?;
    commit_together(report_file.into_iter().chain([container]).collect())?;
    warn(&report.warnings);
    tell(&summary(&report, targets.output.path()))
}

/// Errors of the mathematics know vertices and points; the user knows files.
fn name_files(error: encode::EncodeError, args: &EncodeArgs) -> anyhow::Error {
    match error {
        encode::EncodeError::Prepare(inner) => name_file(&inner, args),
        error @ encode::EncodeError::EndsEarly { .. } => anyhow::anyhow!("{}: {error}", args.frames.display()),
        other => other.into(),
    }
}

fn name_file(error: &PrepareError, args: &EncodeArgs) -> anyhow::Error {
    match (error, &args.solver.regularizer_matrix) {
        (PrepareError::Term(_), Some(matrix)) => anyhow::anyhow!("{}: {error}", matrix.display()),
        _ => blame(error, &args.rest, args.cage.as_deref().unwrap_or(&args.rest)),
    }
}

/// Names the file or the option that is to blame.
pub(super) fn blame(error: &PrepareError, rest: &Path, cage: &Path) -> anyhow::Error {
    let path = match error {
        PrepareError::BadLambda { .. } => return anyhow::anyhow!("--lambda: {error}"),
        PrepareError::SpectrumTooLarge { .. } => return anyhow::anyhow!("--spectrum: {error}"),
        PrepareError::HandleCount { .. } | PrepareError::HandlesOutOfMemory { .. } => {
            return anyhow::anyhow!("--handle-count: {error}");
        }
        PrepareError::NotFinite { .. }
        | PrepareError::TooFewPoints { .. }
        | PrepareError::NoExtent
        | PrepareError::TooLarge
        | PrepareError::NotReproduced { .. }
        | PrepareError::TooFar { .. }
        | PrepareError::OutOfMemory { .. } => rest,
        _ => cage,
    };
    anyhow::anyhow!("{}: {error}", path.display())
}

pub(super) fn read_cage(path: &Path, flip: bool) -> Result<Cage> {
    let mut model = read_model(path)?;
    if model.faces.is_empty() {
        bail!("{}: has no faces, and a cage is a closed mesh; export the cage with its faces", path.display());
    }
    if let Some(welded) = weld(&model) {
        let places = grouped(welded.merged as u64);
        warn(&[format!(
            "{}: merged {places} vertices with others in the same place, as seams split them",
            path.display()
        )]);
        model = welded.model;
    }
    let mesh = TriMesh::from(&model);
    let cage = Cage::new(if flip { mesh.flipped() } else { mesh });
    let polygon_of = model.faces.polygon_of_triangle();
    cage.map_err(|error| error.renumbered(|triangle| polygon_of[triangle] as usize))
        .with_context(|| path.display().to_string())
}

pub(super) fn solver(args: &SolverArgs, cage: &Cage) -> Result<(&'static dyn CoordinateSystem, SolverOptions)> {
    solver_for(args, |system| system.unknowns(cage))
}

/// As [`solver`], for a cage of so many unknowns.
fn solver_for(
    args: &SolverArgs,
    unknowns: impl FnOnce(&'static dyn CoordinateSystem) -> usize,
) -> Result<(&'static dyn CoordinateSystem, SolverOptions)> {
    let name = args.coordinates.name();
    let system = coordinates::by_name(name).with_context(|| format!("--coordinates: {name} is unknown"))?;
    let unknowns = unknowns(system);
    let options = SolverOptions {
        handles: args
            .handles
            .handles(args.handle_count)
            .context("--handle-count: maxvol and all read a number of points of their own; leave it out")?,
        regularizer: args.regularizer.into(),
        spectrum: match args.spectrum {
            None => usual_spectrum(unknowns),
            Some(SpectrumArg::Threshold(s)) => s,
            Some(SpectrumArg::All) => unknowns,
            Some(SpectrumArg::Auto) => 0,
        },
        lambda: args.lambda,
    };
    if matches!(args.spectrum, Some(SpectrumArg::Auto)) && !options.regularizer.has_threshold() {
        bail!("--spectrum auto: {} has no threshold to choose; leave it out", options.regularizer.name());
    }
    Ok((system, options))
}

/// The threshold for a cage that is not known yet; none where the service chooses.
fn designed_spectrum(args: &SolverArgs) -> Result<Option<u32>> {
    match args.spectrum {
        Some(SpectrumArg::Threshold(s)) => Ok(Some(u32::try_from(s).unwrap_or(u32::MAX))),
        Some(SpectrumArg::All) => {
            bail!("--spectrum all: the cage is not known yet; give a number, or a cage with --cage")
        }
        Some(SpectrumArg::Auto) | None => Ok(None),
    }
}

/// The matrix of `--regularizer matrix`.
fn matrix(args: &SolverArgs) -> Result<Option<SparseMatrix>> {
    match (&args.regularizer_matrix, Regularizer::from(args.regularizer)) {
        (Some(path), Regularizer::Matrix) => Ok(Some(read_matrix(path)?)),
        (None, Regularizer::Matrix) => {
            bail!("--regularizer matrix: needs a matrix; give --regularizer-matrix FILE.mtx")
        }
        (Some(_), other) => {
            bail!("--regularizer-matrix: {} uses no matrix; give --regularizer matrix with it", other.name())
        }
        (None, _) => Ok(None),
    }
}

fn spectrum_bound(args: &SolverArgs) -> Result<f64> {
    const USUAL: f64 = 0.05;
    // Errors a hundred times as large are no encoding of the capture any more.
    const MOST: f64 = 100.0;
    match args.spectrum_bound {
        Some(_) if args.spectrum != Some(SpectrumArg::Auto) => {
            bail!("--spectrum-bound: only --spectrum auto looks at it; leave it out or choose automatically")
        }
        Some(bound) if !(bound.is_finite() && bound >= 0.0) => {
            bail!("--spectrum-bound: is {bound}; give a finite fraction of at least 0")
        }
        Some(bound) if bound > MOST => {
            bail!("--spectrum-bound: is {bound:e}; give a fraction of at most {MOST}, such as 0.05 for 5 %")
        }
        bound => Ok(bound.unwrap_or(USUAL)),
    }
}

pub(super) fn write_report(mut file: AtomicFile, report: &Report) -> Result<CompleteFile> {
    let mut text = serde_json::to_vec_pretty(report)?;
    text.push(b'\n');
    file.write_all(&text)?;
    Ok(file.complete()?)
}

/// A length to three digits.
fn significant(length: f64) -> String {
    if length == 0.0 || !length.is_finite() {
        return length.to_string();
    }
    let digits = 2 - length.abs().log10().floor() as i32;
    if (0..=8).contains(&digits) {
        format!("{length:.*}", digits as usize)
    } else if digits < 0 && digits > -8 {
        format!("{length:.0}")
    } else {
        format!("{length:.2e}")
    }
}

fn summary(report: &Report, output: &Path) -> String {
    let chosen = report.spectrum_choice.as_ref().map_or_else(String::new, |choice| {
        format!(
            "  chosen  spectrum {}: L2 {:.2} % above that of 0 on {} frames, at most {:.2} % allowed\n",
            report.spectrum,
            100.0 * choice.extra,
            choice.frames,
            100.0 * choice.bound
        )
    });
    let refined = report.refinement.as_ref().map_or_else(String::new, |refined| {
        format!(
            "  solved  on {} boundary elements, {} times refined; no coordinate changed by more than {:.1e} at last\n",
            refined.elements, refined.refinements, refined.change
        )
    });
    let worst = report.error.worst.map_or_else(String::new, |worst| {
        let point = worst.point.map_or_else(String::new, |point| format!("point {point} of "));
        format!(
            "  worst   {point}frame {}: off by {} where the rest pose is {} across\n",
            report.frame_numbers.get(worst.frame).copied().unwrap_or(worst.frame as f64),
            significant(worst.distance),
            significant(report.diagonal)
        )
    });
    let s = &report.seconds;
    let steps = if is_verbose() {
        format!(
            "  steps   read {:.3} s, coordinates {:.3} s, handles {:.3} s, SVD {:.3} s, inversion {:.3} s, errors {:.3} s, writing {:.3} s\n",
            s.read, s.coordinates, s.maxvol, s.svd, s.invert, s.measure, s.write
        )
    } else {
        String::new()
    };
    format!(
        "{}: {} frames of {} points as cages of {} vertices\n\
         \x20 size    {} from {}: {:.1} times smaller, {:.2} bits per point and frame\n\
         \x20 error   L2 {:.4} % mean, {:.4} % max; L∞ {:.3} % mean, {:.3} % max (of the rest diagonal); KG {:.3} %\n{worst}\
         \x20 system  condition {:.1} (all points {:.1}), rank {} of {}, affine reproduction {:.1e}\n\
         {refined}{chosen}\x20 time    {:.3} s\n{steps}",
        output.display(),
        grouped(report.frames as u64),
        grouped(report.points as u64),
        grouped(report.cage_vertices as u64),
        human_bytes(report.bytes.output),
        human_bytes(report.bytes.capture),
        report.bytes.ratio,
        report.bytes.bits_per_vertex_per_frame,
        100.0 * report.error.l2_mean,
        100.0 * report.error.l2_max,
        100.0 * report.error.linf_mean,
        100.0 * report.error.linf_max,
        report.error.kg_percent,
        report.condition_number.handles,
        report.condition_number.full,
        report.rank,
        report.unknowns,
        report.affine_reproduction_error,
        report.seconds.total,
    )
}
