//! From arguments and files to the options of a solver.

use super::args::{SolverArgs, SpectrumArg};
use anyhow::{Context, Result, bail};
use cager_capture::coding::InversionChoices;
use cager_core::inversion::{Handles, PrepareError};
use cager_core::regularize::Regularizer;
use cager_formats::read_matrix;
use cager_geometry::linalg::SparseMatrix;
use std::path::Path;

/// What the arguments say of the inversion, for a cage of so many unknowns.
pub(super) fn inversion_choices(args: &SolverArgs, is_coded: bool, unknowns: usize) -> Result<InversionChoices> {
    let SolverArgs { coordinates: system, handles, handle_count, regularizer, lambda, .. } = *args;
    if matches!(args.spectrum, Some(SpectrumArg::Auto)) && !regularizer.has_threshold() {
        bail!("--spectrum auto: {} has no threshold to choose; leave it out", regularizer.name());
    }
    let given = match (handles, handle_count) {
        (None, None) => None,
        (handles, count) => Some(
            Handles::by_name(handles.unwrap_or_default().name(), count)
                .context("--handle-count: maxvol and all read a number of points of their own; leave it out")?,
        ),
    };
    let spectrum = args.spectrum.map(|spectrum| match spectrum {
        SpectrumArg::Threshold(s) => s,
        SpectrumArg::All => unknowns,
        SpectrumArg::Auto => 0,
    });
    Ok(InversionChoices { system, handles: given, regularizer, spectrum, lambda, is_coded })
}

/// Refuses arguments that no cage could be solved for with.
pub(super) fn check_inversion(args: &SolverArgs) -> Result<()> {
    inversion_choices(args, false, 0).map(drop)
}

/// The threshold for a cage that is not known yet; none where the service chooses.
pub(super) fn designed_spectrum(args: &SolverArgs) -> Result<Option<u32>> {
    match args.spectrum {
        Some(SpectrumArg::Threshold(s)) => Ok(Some(u32::try_from(s).unwrap_or(u32::MAX))),
        Some(SpectrumArg::All) => {
            bail!("--spectrum all: the cage is not known yet; give a number, or a cage with --cage")
        }
        Some(SpectrumArg::Auto) | None => Ok(None),
    }
}

/// The matrix of `--regularizer matrix`.
pub(super) fn matrix(args: &SolverArgs) -> Result<Option<SparseMatrix>> {
    match (&args.regularizer_matrix, args.regularizer) {
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

pub(super) fn spectrum_bound(args: &SolverArgs) -> Result<f64> {
    const USUAL: f64 = 0.05;
    // Errors a hundred times as large make no useful encoding.
    const MAX_BOUND: f64 = 100.0;
    match args.spectrum_bound {
        Some(_) if args.spectrum != Some(SpectrumArg::Auto) => {
            bail!("--spectrum-bound: only --spectrum auto looks at it; leave it out or choose automatically")
        }
        Some(bound) if !(bound.is_finite() && bound >= 0.0) => {
            bail!("--spectrum-bound: is {bound}; give a finite fraction of at least 0")
        }
        Some(bound) if bound > MAX_BOUND => {
            bail!("--spectrum-bound: is {bound:e}; give a fraction of at most {MAX_BOUND}, such as 0.05 for 5 %")
        }
        bound => Ok(bound.unwrap_or(USUAL)),
    }
}

/// Prefixes an error with the file or option that caused it.
pub(super) fn with_input_name(error: &PrepareError, rest: &Path, cage: &Path) -> anyhow::Error {
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
