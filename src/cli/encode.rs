//! `cager encode`.

use super::args::{EncodeArgs, SolverArgs};
use super::outputs::refuse_overwriting;
use super::{grouped, human_bytes, interrupt, plain, print, progress, warn};
use crate::coordinates;
use crate::encode::{self, Encoded, Job};
use crate::remote::{EncodedRemotely, FileFrames, RemoteJob, encode_remotely};
use crate::report::Report;
use anyhow::{Context, Result, bail};
use cager_client::FrameSource;
use cager_client::messages::SessionOptions;
use cager_core::cage::Cage;
use cager_core::inversion::{PrepareError, SolverOptions};
use cager_core::mesh::{Model, TriMesh};
use cager_formats::{AtomicFile, CompleteFile, commit_together, open_frames, read_model};
use std::io::Write;
use std::path::Path;
use std::time::Instant;

pub(super) fn run(args: &EncodeArgs) -> Result<()> {
    let clock = Instant::now();
    let rest = read_model(&args.rest)?;
    let cage = read_cage(&args.cage, args.flip_cage)?;
    match &args.server {
        None => here(args, &rest, &cage, clock),
        Some(address) => elsewhere(args, address, &rest, &cage, clock),
    }
}

fn here(args: &EncodeArgs, rest: &Model, cage: &Cage, clock: Instant) -> Result<()> {
    let mut frames = open_frames(&args.frames, rest.points.len())?;
    let read_seconds = clock.elapsed().as_secs_f64();
    let (system, options) = solver(&args.solver, cage)?;
    let report_file = begin(args)?;

    let bar = progress::frames("encoding", frames.frames());
    let job = Job { rest, cage, frames: frames.as_mut(), output: &args.output, system, options };
    let result = encode::encode(job, &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let mut encoded = result.map_err(|error| name_files(error, args))?;
    encoded.report.seconds.read += read_seconds;
    finish(args, encoded, report_file, clock)
}

/// The files are read here as well, so that what is wrong with them is told before anything is sent, in words that name them.
fn elsewhere(args: &EncodeArgs, address: &str, rest: &Model, cage: &Cage, clock: Instant) -> Result<()> {
    let frames = FileFrames::open(&args.frames, rest.points.len())?;
    let read_seconds = clock.elapsed().as_secs_f64();
    let (system, options) = solver(&args.solver, cage)?;
    let report_file = begin(args)?;

    let token = args.token.clone().or_else(|| std::env::var("CAGER_TOKEN").ok()).filter(|token| !token.is_empty());
    let options = SessionOptions {
        name: args.output.file_stem().map(|name| name.to_string_lossy().chars().take(200).collect()),
        coordinates: Some(system.name().to_owned()),
        handles: Some(options.handles.name().to_owned()),
        regularizer: Some(options.regularizer.name().to_owned()),
        spectrum: Some(options.spectrum as u32),
        lambda: Some(options.lambda),
        flip_cage: args.flip_cage,
        frame_rate: frames.frame_rate(),
        ..SessionOptions::default()
    };
    let bar = progress::frames("encoding", frames.frames().unwrap_or(0) as usize);
    let job = RemoteJob {
        address,
        token: token.as_deref(),
        rest: &args.rest,
        cage: &args.cage,
        frames,
        output: &args.output,
        options,
    };
    let result = encode_remotely(job, &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let EncodedRemotely { mut encoded, session, .. } = result?;
    encoded.report.seconds.read += read_seconds;
    finish(args, encoded, report_file, clock)?;
    print(&format!("  service {}, session {}\n", plain(address), plain(&session)))
}

/// What comes before the work, so that outputs that cannot be written cost no waiting.
fn begin(args: &EncodeArgs) -> Result<Option<AtomicFile>> {
    refuse_overwriting(&args.output, args.report.as_deref(), [&args.rest, &args.cage, &args.frames])?;
    interrupt::leaves_nothing()?;
    Ok(args.report.as_ref().map(AtomicFile::create).transpose()?)
}

fn finish(args: &EncodeArgs, encoded: Encoded, report_file: Option<AtomicFile>, clock: Instant) -> Result<()> {
    let Encoded { mut report, container } = encoded;
    report.seconds.total = clock.elapsed().as_secs_f64();
    // A full disk shows here, before either file has its name.
    let report_file = report_file.map(|file| write_report(file, &report)).transpose()?;
    commit_together(report_file.into_iter().chain([container]).collect())?;
    warn(&report.warnings);
    print(&summary(&report, &args.output))
}

/// Errors of the mathematics know vertices and points; the user knows files.
fn name_files(error: encode::EncodeError, args: &EncodeArgs) -> anyhow::Error {
    match error {
        encode::EncodeError::Prepare(inner) => name_file(inner, &args.rest, &args.cage),
        other => other.into(),
    }
}

/// Names the file or the option that is to blame.
pub(super) fn name_file(error: PrepareError, rest: &Path, cage: &Path) -> anyhow::Error {
    let path = match error {
        PrepareError::NotFinite { .. }
        | PrepareError::TooFewPoints { .. }
        | PrepareError::NoExtent
        | PrepareError::TooLarge
        | PrepareError::NotReproduced { .. }
        | PrepareError::TooFar { .. }
        | PrepareError::OutOfMemory { .. } => rest,
        _ => cage,
    };
    match error {
        PrepareError::BadLambda { .. } => anyhow::anyhow!("--lambda: {error}"),
        PrepareError::SpectrumTooLarge { .. } => anyhow::anyhow!("--spectrum: {error}"),
        _ => anyhow::anyhow!("{}: {error}", path.display()),
    }
}

pub(super) fn read_cage(path: &Path, flip: bool) -> Result<Cage> {
    let model = read_model(path)?;
    if model.faces.is_empty() {
        bail!("{}: has no faces, and a cage is a closed mesh; export the cage with its faces", path.display());
    }
    let mesh = TriMesh::from(&model);
    let cage = Cage::new(if flip { mesh.flipped() } else { mesh });
    let polygon_of = model.faces.polygon_of_triangle();
    cage.map_err(|error| error.renumbered(|triangle| polygon_of[triangle] as usize))
        .with_context(|| path.display().to_string())
}

pub(super) fn solver(
    args: &SolverArgs,
    cage: &Cage,
) -> Result<(&'static dyn cager_core::coordinates::CoordinateSystem, SolverOptions)> {
    let name = args.coordinates.name();
    let system = coordinates::by_name(name).with_context(|| format!("--coordinates: {name} is unknown"))?;
    let options = SolverOptions {
        handles: args.handles.into(),
        regularizer: args.regularizer.into(),
        spectrum: args.spectrum.unwrap_or_else(|| coordinates::default_spectrum(system.unknowns(cage))),
        lambda: args.lambda,
    };
    Ok((system, options))
}

pub(super) fn write_report(mut file: AtomicFile, report: &Report) -> Result<CompleteFile> {
    let mut text = serde_json::to_vec_pretty(report)?;
    text.push(b'\n');
    file.write_all(&text)?;
    Ok(file.complete()?)
}

fn summary(report: &Report, output: &Path) -> String {
    format!(
        "{}: {} frames of {} points as cages of {} vertices\n\
         \x20 size    {} from {}: {:.1} times smaller, {:.2} bits per point and frame\n\
         \x20 error   L2 {:.4} % mean, {:.4} % max; L∞ {:.3} % mean, {:.3} % max (of the rest diagonal); KG {:.3} %\n\
         \x20 system  condition {:.1} (all points {:.1}), rank {} of {}, affine reproduction {:.1e}\n\
         \x20 time    {:.3} s\n",
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
