//! What is made of recovered frames: the container, cages, joints and the report.

use super::source::StoredSurfaces;
use super::view::CAGES;
use super::{Finished, RecoveryJob};
use crate::coding::Goal;
use crate::encode::{EncodeError, Encoded};
use crate::origin::move_to;
use crate::preparation::read_part;
use crate::problem::{self, ApiError};
use crate::recover::{Encoding, JOINTS_RATE, RecoverError, Recovered};
use crate::store::{NamedFile, StoreError, StoredPart, Workshop};
use cager_cages::diagnosis::weld;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_formats::{Error, FrameReader, Target};
use cager_geometry::mesh::{Point, TriMesh};
use std::fs::File;
use std::io::{self, BufWriter, Write as _};

/// Why results cannot be made.
#[derive(Debug, thiserror::Error)]
pub(super) enum ResultsError {
    #[error(transparent)]
    Encode(#[from] EncodeError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Formats(#[from] Error),
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// A cage that was sent.
///
/// # Errors
/// It cannot be read or used.
pub(super) fn cage_of(file: &NamedFile, origin: Option<Point>) -> Result<Cage, ApiError> {
    let refuse = |what: String| ApiError::new(problem::INVALID_GEOMETRY, format!("cage: {}: {what}", file.name));
    let mut model = read_part("cage", &file.name, &file.bytes)?;
    if model.faces.is_empty() {
        return Err(refuse("has no faces, and a cage is a closed mesh; export the cage with its faces".to_owned()));
    }
    model = weld(&model).map_or(model, |welded| welded.model);
    move_to(origin, &mut model.points);
    let polygon_of = model.faces.polygon_of_triangle();
    let cage = Cage::new(TriMesh::from(&model));
    cage.map_err(|error| refuse(error.renumbered(|triangle| polygon_of[triangle] as usize).to_string()))
}

/// Writes all results into the workshop. Blocks.
pub(super) fn results(
    job: &RecoveryJob,
    recovered: Recovered,
    (system, goal): (&'static dyn CoordinateSystem, Option<Goal>),
    pool: &rayon::ThreadPool,
    workshop: &Workshop,
    source: &StoredSurfaces,
) -> Result<Finished, ResultsError> {
    let options = &job.meta.options;
    let Recovered { rest, cage, frames, cages, report, joints, mut warnings } = recovered;
    let output = Target::Replacing(workshop.path().join("capture.cager"));
    let encoding = Encoding {
        output: &output,
        system,
        goal,
        offsets: options.offsets,
        origin: job.meta.origin,
        exact_rest: options.exact_rest,
    };
    let mut frames = Stoppable { frames, source };
    let encode = || encoding.write((&rest, &cage), &mut frames, &|_| ());
    let Encoded { report: encoded, container } = pool.install(encode)?;
    container.commit()?;
    warnings.extend(encoded.warnings);
    let numbers: Vec<f64> = report.frames.iter().map(|frame| frame.number).collect();
    let mut files = vec![described(workshop, "capture.cager")?];
    let mut write = |name: &str, bytes: &[u8]| {
        files.push(StoredPart::of(name, bytes));
        workshop.write(name, bytes)
    };
    write("report.json", &report.json()?)?;
    if let Some(joints) = joints {
        write("joints.csv", joints.csv(&numbers).as_bytes())?;
        write("joints.bvh", &joints.bvh(options.frame_rate.unwrap_or(JOINTS_RATE)))?;
    }
    let mut out = BufWriter::new(File::create_new(workshop.path().join(CAGES))?);
    for x in cages.iter().flat_map(|cage| cage.as_flattened()) {
        out.write_all(&(*x as f32).to_le_bytes())?;
    }
    out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_data()?;
    files.push(described(workshop, CAGES)?);
    Ok(Finished {
        frames: cages.len() as u32,
        lost: report.lost.len() as u32,
        cage_vertices: cage.vertices().len() as u32,
        warnings,
        files,
    })
}

/// A file in the workshop.
fn described(workshop: &Workshop, name: &str) -> io::Result<StoredPart> {
    let file = File::open(workshop.path().join(name))?;
    let bytes = file.metadata()?.len();
    let mut digest = blake3::Hasher::new();
    digest.update_reader(file)?;
    Ok(StoredPart { name: name.to_owned(), bytes, blake3: digest.finalize().to_hex().to_string() })
}

/// Frames that end with an error when the work is to stop.
struct Stoppable<'a, F> {
    frames: F,
    source: &'a StoredSurfaces,
}

impl<F: FrameReader> FrameReader for Stoppable<'_, F> {
    fn points(&self) -> usize {
        self.frames.points()
    }

    fn frames(&self) -> usize {
        self.frames.frames()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.frames.frame_rate()
    }

    fn number(&self, frame: usize) -> f64 {
        self.frames.number(frame)
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        Ok(!self.source.is_stopped() && self.frames.read_next(out)?)
    }
}

/// The response for a recovery that cannot go on.
pub(super) fn refused(error: &RecoverError) -> ApiError {
    let detail = match error {
        RecoverError::Turned { path, degrees } => format!(
            "{}: the template lies on this first surface better when it is turned by {degrees:.0} degrees; make the recovery anew with align auto, with up where another axis points up, or with force to go on as it is (--align, --up and --force on the command line)",
            path.display()
        ),
        RecoverError::OtherSize { path, scale } => format!(
            "{}: this first surface is {scale:.3} times as large as the template; make the recovery anew with scale auto, or with force to go on as it is (--scale auto and --force on the command line)",
            path.display()
        ),
        other => other.to_string(),
    };
    match error {
        RecoverError::Formats(Error::Io { .. }) | RecoverError::Stored(_) | RecoverError::Stopped => {
            ApiError::internal(error)
        }
        RecoverError::Formats(_)
        | RecoverError::Surface { .. }
        | RecoverError::NoSurface { .. }
        | RecoverError::Turned { .. }
        | RecoverError::OtherSize { .. } => ApiError::new(problem::INVALID_FRAME, detail),
        _ => ApiError::new(problem::INVALID_GEOMETRY, detail),
    }
}

/// The response for results that cannot be made.
pub(super) fn refused_encoding(error: &ResultsError) -> ApiError {
    match error {
        ResultsError::Encode(EncodeError::Coding(error)) => ApiError::new(problem::INVALID_OPTIONS, error.to_string()),
        ResultsError::Encode(EncodeError::Prepare(error)) => {
            ApiError::new(problem::INVALID_GEOMETRY, error.to_string())
        }
        other => ApiError::internal(other),
    }
}
