//! Containers back to positions.

use crate::coordinates;
use crate::timing::Timing;
use cager_core::cage::{Cage, CageError};
use cager_core::coordinates::CoordinatesError;
use cager_core::decode::Decoder;
use cager_core::inversion::{BATCH, coordinates_fit};
use cager_core::mesh::Model;
use cager_formats::{Action, FrameOptions, create_frames};
use cager_proto::container::{self, ContainerReader};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Why decoding stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// The container cannot be read.
    #[error("{}: {cause}", .path.display())]
    Container {
        /// The container.
        path: PathBuf,
        /// What went wrong; part of the message, so not a source as well.
        cause: container::Error,
    },
    /// The container is a pipe or a device.
    #[error("{}: is a pipe or a device, and frames are read from anywhere in a .cager file; save it as a file first", .path.display())]
    NotAFile {
        /// The container.
        path: PathBuf,
    },
    /// The container holds a cage that is none.
    #[error("{}: {cause}", .path.display())]
    Cage {
        /// The container.
        path: PathBuf,
        /// What is wrong with it; part of the message, so not a source as well.
        cause: CageError,
    },
    /// The container needs what this program cannot do.
    #[error("{}: {what}; use a newer cager", .path.display())]
    Unsupported {
        /// The container.
        path: PathBuf,
        /// What it needs.
        what: String,
    },
    /// The coordinates of the file's model do not exist.
    #[error("{}: {cause}", .path.display())]
    Coordinates {
        /// The input.
        path: PathBuf,
        /// Why; part of the message, so not a source as well.
        cause: CoordinatesError,
    },
    /// The coordinates do not fit into memory.
    #[error("{}: its coordinates need {gigabytes:.0} GB of memory; decode it on a larger machine", .path.display())]
    Memory {
        /// The container.
        path: PathBuf,
        /// What decoding needs.
        gigabytes: f64,
    },
    /// The positions cannot be written.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
}

impl DecodeError {
    pub(crate) fn container(path: &Path, cause: container::Error) -> Self {
        let path = path.to_owned();
        match cause {
            container::Error::Io(cause) => cager_formats::Error::Io { path, action: Action::Read, cause }.into(),
            cause => Self::Container { path, cause },
        }
    }
}

/// An opened container.
pub type Container = ContainerReader<BufReader<File>>;

/// Opens a container.
///
/// # Errors
/// A file that cannot be read or is no container; the path is named.
pub fn open(path: &Path) -> Result<Container, DecodeError> {
    let fail = |cause| DecodeError::container(path, cause);
    // Opening a pipe would wait for somebody to write to it.
    if std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return Err(DecodeError::NotAFile { path: path.to_owned() });
    }
    let file = File::open(path).map_err(|e| fail(container::Error::from(e)))?;
    if file.metadata().is_ok_and(|m| m.is_dir()) {
        return Err(fail(container::Error::NotAContainer));
    }
    ContainerReader::open(BufReader::new(file)).map_err(fail)
}

/// The rest pose of a container and what turns its cages into positions.
///
/// # Errors
/// Damage, or coordinates that this program does not compute.
pub fn decoder(container: &mut Container, path: &Path) -> Result<(Model, Decoder), DecodeError> {
    let fail = |cause| DecodeError::container(path, cause);
    let unsupported = |what| DecodeError::Unsupported { path: path.to_owned(), what };
    let header = container.header().clone();
    let Some(system) = coordinates::by_name(&header.coordinates) else {
        return Err(unsupported(format!("its coordinates are {:?}", header.coordinates)));
    };
    if header.solver_version != cager_core::SOLVER_VERSION {
        return Err(unsupported(format!("its coordinates are of version {}", header.solver_version)));
    }
    let rest = container.rest().map_err(fail)?;
    if let Some(face) = rest.faces.arities().iter().position(|&corners| corners < 3) {
        return Err(fail(container::Error::Corrupt { offset: 0, what: format!("face {face} of the model is none") }));
    }
    let mesh = container.cage().map_err(fail)?;
    let cage = Cage::new(mesh).map_err(|cause| DecodeError::Cage { path: path.to_owned(), cause })?;
    if system.unknowns(&cage) != header.rows_per_frame as usize {
        return Err(unsupported(format!("it stores {} rows per frame", header.rows_per_frame)));
    }
    let columns = system.columns(&cage);
    if !coordinates_fit(rest.points.len(), columns, 2) {
        let gigabytes = 12e-9 * rest.points.len() as f64 * columns as f64;
        return Err(DecodeError::Memory { path: path.to_owned(), gigabytes });
    }
    let coordinates = system.coordinates(&cage, &rest.points);
    let phi = coordinates.map_err(|cause| DecodeError::Coordinates { path: path.to_owned(), cause })?.phi;
    let decoder = Decoder::new(phi.as_ref(), cage.vertices().len()).with_tied_normals(system.tied_normals(&cage));
    Ok((rest, decoder))
}

/// Decodes all frames into `output`, which appears whole or not at all; `timing` goes before what the container tells. `progress` is told the number of frames done.
///
/// # Errors
/// See [`DecodeError`].
pub fn decode(input: &Path, output: &Path, timing: Timing, progress: &mut dyn FnMut(usize)) -> Result<(), DecodeError> {
    let fail = |cause| DecodeError::container(input, cause);
    let mut container = open(input)?;
    let frames = container.frames();
    let fps = timing.fps.or(container.header().frame_rate).unwrap_or(FrameOptions::default().fps);
    let numbers = timing.numbers(container.frame_numbers().map_err(fail)?);
    let options = FrameOptions { fps, numbers };
    // Decoding needs neither, but a damaged file is refused wherever the damage is.
    container.errors().map_err(fail)?;
    container.summary().map_err(fail)?;
    let (rest, decoder) = decoder(&mut container, input)?;
    let mut writer = create_frames(output, rest.points.len(), frames, &rest.faces, &options)?;
    // Both keep their allocations from batch to batch.
    let mut cages = vec![Vec::new(); BATCH];
    let mut positions = vec![Vec::new(); BATCH];
    let mut first = 0;
    while first < frames {
        let count = BATCH.min(frames - first);
        for (k, cage) in cages[..count].iter_mut().enumerate() {
            container.read_frame(first + k, cage).map_err(fail)?;
        }
        let views: Vec<&[f32]> = cages[..count].iter().map(Vec::as_slice).collect();
        decoder.decode(&views, &mut positions[..count]);
        for frame in &positions[..count] {
            writer.write_frame(frame)?;
        }
        first += count;
        progress(first);
    }
    Ok(writer.finish()?)
}
