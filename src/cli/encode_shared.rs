//! What is the same wherever a capture is encoded, here or by a service: where files go, options
//! that are checked, the design of a cage.

use super::args::EncodeArgs;
use super::coding_args::goal;
use super::encode_summary::{summary, write_report};
use super::outputs::Outputs;
use super::solver_options::{check_inversion, inversion_choices, with_input_name};
use super::{design, progress, tell, warn};
use anyhow::{Result, bail};
use cager_cages::{Components, DesignOptions, SuitedSize};
use cager_capture::coding::suited_cage_size;
use cager_capture::design::{PerPart, most_vertices, usual_options};
use cager_capture::encode::{self, Encoded};
use cager_capture::frames::CaptureFiles;
use cager_capture::memory::free_bytes;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_core::inversion::{PrepareError, Solver, SolverOptions};
use cager_core::regularize::Regularizer;
use cager_formats::{AtomicFile, Target, commit_together};
use cager_geometry::linalg::SparseMatrix;
use cager_geometry::mesh::Model;
use std::time::Instant;

/// Where the container goes, and the report.
pub(super) struct Targets {
    pub(super) output: Target,
    pub(super) report: Option<Target>,
    /// What is to be told of the inputs, in the report too.
    pub(super) warnings: Vec<String>,
}

impl Targets {
    pub(super) fn new(args: &EncodeArgs) -> Result<Self> {
        let inputs = [&args.rest, &args.frames].into_iter().chain(&args.cage).chain(&args.solver.regularizer_matrix);
        let mut outputs = Outputs::new(args.outputs, inputs)?;
        let output = outputs.container(&args.output, "walk.cager")?;
        let report = args.report.as_ref().map(|path| outputs.text(path)).transpose()?;
        Ok(Self { output, report, warnings: Vec::new() })
    }

    pub(super) fn begin_report(&self) -> Result<Option<AtomicFile>> {
        Ok(self.report.as_ref().map(AtomicFile::create).transpose()?)
    }
}

pub(super) fn finish(
    targets: &Targets,
    encoded: Encoded,
    report_file: Option<AtomicFile>,
    clock: Instant,
) -> Result<()> {
    let Encoded { mut report, container } = encoded;
    report.seconds.total = clock.elapsed().as_secs_f64();
    report.warnings.splice(0..0, targets.warnings.iter().cloned());
    // A full disk shows here, before either file has its name.
    let report_file = report_file.map(|file| write_report(file, &report)).transpose()?;
    commit_together(report_file.into_iter().chain([container]).collect())?;
    warn(&report.warnings);
    tell(&summary(&report, targets.output.path()))
}

/// How a cage is designed.
pub(super) fn design_options(args: &EncodeArgs, points: usize) -> Result<DesignOptions> {
    let mean_value = args.solver.coordinates.name() == MeanValue.name();
    if args.coding.mean_error.is_some() && !mean_value {
        bail!(
            "--mean-error: is measured with mean value coordinates; give --cage-vertices, or leave --coordinates out"
        );
    }
    if args.design.per_part == PerPart::Yes && !mean_value {
        bail!(
            "--per-part: components carry parts with mean value coordinates alone; leave --coordinates out, or --per-part"
        );
    }
    let points = most_vertices(args.solver.coordinates, points);
    let usual = usual_options(args.solver.coordinates);
    Ok(DesignOptions {
        goal: design::goal(args.design.cage_vertices, args.coding.mean_error, points)?,
        style: args.design.style.unwrap_or(usual.style),
        seed: args.design.seed.unwrap_or(usual.seed),
        time_limit: args.design.time_limit,
        ..usual
    })
}

/// How a cage is designed from these frames, of as many vertices as suit what the file is to meet.
pub(super) fn sized_design(
    args: &EncodeArgs,
    files: &CaptureFiles,
    rest: &Model,
    components: Option<&Components>,
    frames: &[Vec<f64>],
) -> Result<DesignOptions> {
    let mut options = design_options(args, rest.points.len())?;
    let total = files.open()?.frames();
    let goal = goal(&args.coding, args.coding.units(), args.cage.is_some(), rest, total)?;
    let (Some(goal), None, None) = (goal, args.design.cage_vertices, args.coding.mean_error) else {
        return Ok(options);
    };
    check_inversion(&args.solver)?;
    let bar = progress::steps();
    bar.set_message("estimating sizes of cages");
    let suited = suited_cage_size(goal, args.solver.coordinates, rest, components, frames, total);
    bar.finish_and_clear();
    if let Some(SuitedSize { vertices, .. }) = suited {
        tell(&format!(
            "the cage gets {vertices} vertices, estimated from what a small cage leaves of the motion; --cage-vertices \
             gives another number\n"
        ))?;
        options.goal = design::goal(Some(vertices as u32), None, rest.points.len())?;
    }
    Ok(options)
}

/// What the arguments say of the inversion, and what is usual for this rest pose and cage, which a
/// [mean error](goal) is coded with or not.
pub(super) fn solver_options(args: &EncodeArgs, rest: &Model, cage: &Cage, codes_mean: bool) -> Result<SolverOptions> {
    let unknowns = args.solver.coordinates.values(cage).unknowns();
    // The number of frames says how large a file may be, not whether it is coded.
    let is_coded = goal(&args.coding, args.coding.units(), codes_mean, rest, 1)?.is_some();
    Ok(inversion_choices(&args.solver, is_coded, unknowns)?.options(unknowns))
}

/// [`solver_options`] for this rest pose and cage, with all checked that needs no coordinates.
pub(super) fn checked_options(
    args: &EncodeArgs,
    rest: &Model,
    cage: &Cage,
    matrix: Option<&SparseMatrix>,
) -> Result<SolverOptions> {
    let (system, options) = (args.solver.coordinates, solver_options(args, rest, cage, args.cage.is_some())?);
    let unknowns = system.values(cage).unknowns();
    let delta = matrix.map_or(Ok(()), |_| Regularizer::Matrix.delta(matrix, cage, unknowns).map(|_| ()));
    // A service knows its own memory.
    let memory = if args.server.is_some() { u64::MAX } else { free_bytes() };
    delta
        .map_err(PrepareError::from)
        .and_then(|()| Solver::check(system, cage, &rest.points, options, memory))
        .map_err(|error| name_file(&error, args))?;
    Ok(options)
}

/// Errors of `core` know vertices and points; the user needs the file.
pub(super) fn name_files(error: encode::EncodeError, args: &EncodeArgs) -> anyhow::Error {
    match error {
        encode::EncodeError::Prepare(inner) => name_file(&inner, args),
        error @ encode::EncodeError::EndsEarly { .. } => anyhow::anyhow!("{}: {error}", args.frames.display()),
        other => other.into(),
    }
}

pub(super) fn name_file(error: &PrepareError, args: &EncodeArgs) -> anyhow::Error {
    match (error, &args.solver.regularizer_matrix) {
        (PrepareError::Term(_), Some(matrix)) => anyhow::anyhow!("{}: {error}", matrix.display()),
        _ => with_input_name(error, &args.rest, args.cage.as_deref().unwrap_or(&args.rest)),
    }
}
