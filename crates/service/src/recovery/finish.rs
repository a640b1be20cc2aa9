//! What is made of recovered frames: the container, cages, joints and the report.

use super::source::StoredSurfaces;
use super::view::CAGES;
use super::{Finished, RecoveryJob};
use crate::jobs::{ResultsError, Stoppable};
use crate::problem::{self, ApiError};
use crate::store::{StoredPart, Workshop};
use cager_capture::coding::Goal;
use cager_capture::encode::Encoded;
use cager_core::coordinates::CoordinateSystem;
use cager_formats::{Error, Target, Units};
use cager_motion::recover::{Encoding, JOINTS_RATE, RecoverError, Recovered, as_large};
use cager_proto::report::json_file;
use std::fs::File;
use std::io::{self, BufWriter, Write as _};

/// Writes all results into the workshop. Blocks.
pub(super) fn results(
    job: &RecoveryJob,
    recovered: Recovered,
    (system, goal, units): (&'static dyn CoordinateSystem, Option<Goal>, Units),
    pool: &rayon::ThreadPool,
    workshop: &Workshop,
    source: &StoredSurfaces,
) -> Result<Finished, ResultsError> {
    let options = &job.meta.options;
    let Recovered { rest, cage, mut frames, cages, report, joints, mut warnings } = recovered;
    let output = Target::Replacing(workshop.path().join("capture.cager"));
    let encoding = Encoding {
        output: &output,
        system,
        goal,
        offsets: options.offsets,
        origin: job.meta.origin,
        units,
        exact_rest: options.exact_rest,
    };
    let stopped = || source.is_stopped();
    let mut frames = Stoppable { frames: &mut frames, stopped: &stopped, timing: (None, None) };
    let encode = || encoding.write((&rest, &cage), &mut frames, &|_| ());
    let Encoded { report: encoded, container } = pool.install(encode)?;
    container.commit()?;
    warnings.extend(encoded.warnings);
    let numbers: Vec<f64> = report.frames.iter().map(|frame| frame.number).collect();
    let mut files = vec![workshop.described("capture.cager")?];
    let mut write = |name: &str, bytes: &[u8]| {
        files.push(StoredPart::of(name, bytes));
        workshop.write(name, bytes)
    };
    write("report.json", &json_file(&report)?)?;
    if let Some(joints) = joints {
        write("joints.csv", joints.csv(&numbers).as_bytes())?;
        write("joints.bvh", &joints.bvh(options.frame_rate.unwrap_or(JOINTS_RATE)))?;
    }
    let mut out = BufWriter::new(File::create_new(workshop.path().join(CAGES))?);
    for x in cages.iter().flat_map(|cage| cage.as_flattened()) {
        out.write_all(&(*x as f32).to_le_bytes())?;
    }
    out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_data()?;
    files.push(workshop.described(CAGES)?);
    Ok(Finished {
        frames: cages.len() as u32,
        lost: report.lost.len() as u32,
        cage_vertices: cage.vertices().len() as u32,
        warnings,
        files,
    })
}

/// The response for a recovery that cannot go on.
pub(super) fn refused(error: &RecoverError) -> ApiError {
    let detail = match error {
        RecoverError::Turned { path, degrees } => format!(
            "{}: the template lies on this first surface better when it is turned by {degrees:.0} degrees; make the recovery anew with align auto, with up where another axis points up, or with force to go on as it is (--align, --up and --force on the command line)",
            path.display()
        ),
        RecoverError::OtherSize { path, scale } => format!(
            "{}: this first surface is {} the template; make the recovery anew with scale auto, or with force to go on as it is (--scale auto and --force on the command line)",
            path.display(),
            as_large(*scale)
        ),
        RecoverError::OtherPerson { path, scale } => format!(
            "{}: this first surface is {} the template; scale one of them, or make the recovery anew with force to go on as it is (--force on the command line)",
            path.display(),
            as_large(*scale)
        ),
        RecoverError::Elsewhere { path, distance, diagonals } => format!(
            "{}: this first surface lies {distance:.3} away from the template, {diagonals:.1} times its diagonal; make the recovery anew with align auto, or with force to go on as it is (--align auto and --force on the command line)",
            path.display()
        ),
        other => other.to_string(),
    };
    match error {
        RecoverError::Formats(Error::Io { .. }) | RecoverError::Stored(_) | RecoverError::Stopped => {
            ApiError::internal(error)
        }
        RecoverError::Formats(_)
        | RecoverError::Unusable(_)
        | RecoverError::Surface { .. }
        | RecoverError::NoSurface { .. }
        | RecoverError::Turned { .. }
        | RecoverError::OtherSize { .. }
        | RecoverError::OtherPerson { .. }
        | RecoverError::Elsewhere { .. } => ApiError::new(problem::INVALID_FRAME, detail),
        _ => ApiError::new(problem::INVALID_GEOMETRY, detail),
    }
}
