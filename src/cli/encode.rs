//! `cager encode`.

use super::args::{EncodeArgs, SpectrumArg, Textures};
use super::checks::{CaptureArgs, explained_with_options, unnamed_files, warn_of_departures};
use super::coding_args::{Unit, goal};
use super::dry_run::{read_files, size, tell_dry_run};
use super::encode_shared::{
    Targets, checked_options, design_options, finish, name_file, name_files, sized_design, solver_options,
};
use super::solver_options::{check_inversion, designed_spectrum, matrix, spectrum_bound};
use super::{design, encode_remote, grouped, human_bytes, progress, tell, warn, warning};
use anyhow::{Context, Result};
use cager_capture::coding::Goal;
use cager_capture::design::{components, read_frames, report as design_report};
use cager_capture::encode::{ChooseSpectrum, Encode, EncodeError, EncodeProgress, sample_frames};
use cager_capture::frames::CaptureFiles;
use cager_capture::memory::{Memory, free_bytes};
use cager_capture::speed::seconds_to_prepare;
use cager_capture::{OpenOptions, Opened};
use cager_core::cage::Cage;
use cager_core::inversion::check_options;
use cager_core::regularize::Regularizer;
use cager_formats::FrameReader;
use cager_geometry::mesh::Model;
use cager_proto::report::DesignReport;
use std::time::Instant;

pub(super) fn run(mut args: EncodeArgs) -> Result<()> {
    let clock = Instant::now();
    let mut targets = Targets::new(&args)?;
    let Opened { rest, cage, files, dropped } = opened(&args)?;
    args.coding.said = files.rest_units;
    let args = &args;
    // What is wrong with it is told before anything is computed.
    let is_coded = goal(&args.coding, args.coding.units(), args.cage.is_some(), &rest, 1)?.is_some();
    targets
        .warnings
        .extend(dropped.sentence(&args.rest, is_coded && !args.coding.exact_rest && rest.surface.is_empty()));
    if args.outputs.dry_run {
        dry_run(args, &targets, &files, &rest, cage.as_ref())?;
        warn(&targets.warnings);
        warn_of_departures(&files);
        return Ok(());
    }
    let done = match (&args.server, &cage) {
        (None, Some(cage)) => encode_locally(args, &targets, &files, &rest, cage, None, clock),
        (None, None) => {
            // What is wrong with it is told before minutes of design.
            matrix(&args.solver)?;
            spectrum_bound(&args.solver)?;
            let clock_design = Instant::now();
            let (cage, mut design) = designed(args, &files, &rest)?;
            design.seconds = clock_design.elapsed().as_secs_f64();
            let design = Some(design);
            encode_locally(args, &targets, &files, &rest, &cage, design, clock)
        }
        (Some(address), cage) => encode_remote::run(args, &targets, address, &files, &rest, cage.as_ref(), clock),
    };
    warn_of_departures(&files);
    done
}

/// The rest pose, the frames, and the cage where one is given, all checked.
fn opened(args: &EncodeArgs) -> Result<Opened> {
    let CaptureArgs { checks, up, weld, timing } = &args.capture;
    let mut files = CaptureFiles {
        up: *up,
        timing: timing.into(),
        metres_per_unit: args.coding.unit.map(Unit::metres),
        ..unnamed_files(checks)
    };
    files.selection.range = args.frames_range;
    let options = OpenOptions {
        files,
        weld: *weld,
        flip_cage: args.flip_cage,
        pictures: args.textures == Textures::Embed,
        allow_mismatch: checks.force,
    };
    warning(|warnings| options.read(&args.rest, args.cage.as_deref(), &args.frames, warnings))
        .map_err(|error| explained_with_options(error, &args.frames, *up, args.flip_cage))
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
        encode_remote::refuse_choosing(&args.solver)?;
    }
    let what = match cage {
        Some(cage) => {
            checked_options(args, rest, cage, matrix.as_ref())?;
            let system = args.solver.coordinates;
            let frames = read_files(files)?;
            match goal(&args.coding, args.coding.units(), args.cage.is_some(), rest, frames)? {
                None => {
                    format!("cages of {}, and the rest pose", size(frames, system.values(cage).unknowns(), "unknowns"))
                }
                Some(Goal::Size(most)) => {
                    format!("{} frames, coded, {} at the most", grouped(frames), human_bytes(most))
                }
                Some(_) => format!("{} frames, coded; how large they are only coding them tells", grouped(frames)),
            }
        }
        None => {
            design_options(args, rest.points.len())?;
            check_inversion(&args.solver)?;
            if args.server.is_some() {
                designed_spectrum(&args.solver)?;
            }
            format!("{} frames; a cage would be designed from them first", grouped(read_files(files)?))
        }
    };
    tell_dry_run(&targets.output, &what, std::slice::from_ref(&targets.report))
}

/// How a cage was designed.
struct Designed {
    report: DesignReport,
    seconds: f64,
    /// Whether the mean error that was asked for is not met.
    missed: bool,
}

/// A cage from the capture itself.
fn designed(args: &EncodeArgs, files: &CaptureFiles, rest: &Model) -> Result<(Cage, Designed)> {
    let frames = read_frames(files).map_err(|error| name_files(error, args))?;
    design_options(args, rest.points.len())?;
    let vertices = args.design.cage_vertices.map(|vertices| vertices as usize);
    let components = components(args.design.per_part, args.solver.coordinates, rest, &frames, vertices);
    let components = components.as_ref();
    let options = sized_design(args, files, rest, components, &frames)?;
    let design = design::design((&args.rest, rest), (&args.frames, &frames), None, components, &options)?;
    warn(&design.warnings);
    if design.missed {
        tell("what the cage leaves is coded beside it, so that the mean error holds\n")?;
    }
    let designed =
        Designed { report: design_report(&design, &options, frames.len()), seconds: 0.0, missed: design.missed };
    let cage = design.into_cage().with_context(|| args.rest.display().to_string())?;
    if let Some(components) = components {
        tell(&format!("the cage has {} components, which carry some of the parts each\n", components.len()))?;
    }
    Ok((cage, designed))
}

fn encode_locally(
    args: &EncodeArgs,
    targets: &Targets,
    files: &CaptureFiles,
    rest: &Model,
    cage: &Cage,
    design: Option<Designed>,
    clock: Instant,
) -> Result<()> {
    let memory = args.memory.unwrap_or_else(Memory::half_of_free);
    let mut frames = files.open()?;
    let codes_mean = design.as_ref().is_none_or(|design| design.missed);
    let (system, options) = (args.solver.coordinates, solver_options(args, rest, cage, codes_mean)?);
    let matrix = matrix(&args.solver)?;
    let choose = match (args.solver.spectrum, spectrum_bound(&args.solver)?) {
        (Some(SpectrumArg::Auto), bound) => {
            // What is wrong with the options is told before anything is read.
            check_options(rest.points.len(), system.values(cage).unknowns(), options, free_bytes())
                .map_err(|e| name_file(&e, args))?;
            let mut again = files.open()?;
            let samples = choosing_frames(again.as_mut(), options.regularizer == Regularizer::Temporal)
                .map_err(|error| name_files(error, args))?;
            Some(ChooseSpectrum { samples, bound })
        }
        _ => None,
    };
    let report_file = targets.begin_report()?;
    // All that was done so far.
    let design_seconds = design.as_ref().map_or(0.0, |design| design.seconds);
    let read_seconds = clock.elapsed().as_secs_f64() - design_seconds;

    let bar = progress::PreparationBar::new("encoding", frames.frames())
        .expecting(|| seconds_to_prepare(system, cage, rest.points.len()));
    let (announced, units) = (frames.frames(), frames.units());
    let tell_progress = |progress| match progress {
        EncodeProgress::Preparing(step) => bar.preparing(step),
        EncodeProgress::Frames(done) => bar.done(done),
    };
    let goal = goal(&args.coding, args.coding.units(), codes_mean, rest, announced)?;
    let encode = Encode::new(rest, cage).coordinates(system).solver(options).matrix(matrix.as_ref());
    let encode = encode.choose_spectrum(choose).memory(memory).goal(goal).origin(files.origin).units(units);
    let encode = encode.exact_rest(args.coding.exact_rest).progress(&tell_progress);
    let result = encode.run(frames.as_mut(), &targets.output);
    bar.finish();
    let mut encoded = result.map_err(|error| name_files(error, args))?;
    encoded.report.seconds.read += read_seconds;
    encoded.report.seconds.design = design_seconds;
    encoded.report.design = design.map(|design| design.report);
    finish(targets, encoded, report_file, clock)
}

/// Frames to choose a spectrum threshold by: the first ones where cages follow their predecessors.
fn choosing_frames(frames: &mut dyn FrameReader, first_ones: bool) -> Result<Vec<Vec<f64>>, EncodeError> {
    sample_frames(frames, if first_ones { 96 } else { 24 }, first_ones)
}
