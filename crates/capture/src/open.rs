//! Captures of files: a rest pose, its cage, and the frames.

use crate::design::{default_vertices, read_frames};
use crate::encode::EncodeError;
use crate::frames::CaptureFiles;
use cager_cages::{DesignOptions, Goal, design};
use cager_core::cage::Cage;
use cager_formats::{ReadModel, read_mesh};
use cager_geometry::mesh::{Model, TriMesh};
use std::ops::ControlFlow;
use std::path::Path;

/// A rest pose, its cage, and frames that are read from files.
#[derive(Clone, Debug)]
pub struct Capture {
    /// Model in its rest pose, about the origin of [`Self::files`].
    pub rest: Model,
    /// Checked cage around it.
    pub cage: Cage,
    /// Where the frames are, and how they are adapted to the rest pose.
    pub files: CaptureFiles,
}

impl Capture {
    /// Opens a rest pose and a cage, each a mesh, and names the frames: a folder or pattern of mesh files, or a point cache.
    ///
    /// # Errors
    /// Files that cannot be read; an invalid cage.
    pub fn open(rest: impl AsRef<Path>, cage: impl AsRef<Path>, frames: impl AsRef<Path>) -> Result<Self, EncodeError> {
        let (rest, files) = opened(rest.as_ref(), &[cage.as_ref()], frames.as_ref())?;
        let path = cage.as_ref();
        let ReadModel { model: mut mesh, units, .. } = read_mesh(path, None)?;
        units.change_to(files.rest_units).apply_to(&mut mesh.points);
        crate::origin::move_to(files.origin, &mut mesh.points);
        let cage =
            Cage::new(TriMesh::from(&mesh)).map_err(|cause| EncodeError::Cage { path: path.to_owned(), cause })?;
        Ok(Self { rest, cage, files })
    }

    /// Opens a rest pose and frames, and designs a cage from their motion, which takes minutes; `vertices` is its size, a usual one without it.
    ///
    /// # Errors
    /// Files that cannot be read; no frames.
    pub fn design(
        rest: impl AsRef<Path>,
        frames: impl AsRef<Path>,
        vertices: Option<usize>,
    ) -> Result<Self, EncodeError> {
        let path = rest.as_ref();
        let (rest, files) = opened(path, &[], frames.as_ref())?;
        let goal = Goal::Vertices(vertices.unwrap_or_else(|| default_vertices(rest.points.len())));
        let options = DesignOptions { goal, ..DesignOptions::default() };
        let designed = design(&rest, &read_frames(&files)?, None, &options, &mut |_| ControlFlow::Continue(()))?;
        let cage = Cage::new(designed.cage).map_err(|cause| EncodeError::Cage { path: path.to_owned(), cause })?;
        Ok(Self { rest, cage, files })
    }
}

/// The rest pose and the files of its frames, which are neither the rest pose's nor `others`.
fn opened(path: &Path, others: &[&Path], frames: &Path) -> Result<(Model, CaptureFiles), EncodeError> {
    let ReadModel { model: mut rest, units, .. } = read_mesh(path, None)?;
    let mut files = CaptureFiles::new(frames, rest.points.len());
    files.rest_units = units;
    files.selection.no_frames = [&path].into_iter().chain(others).map(|path| path.to_path_buf()).collect();
    files.take_origin(&mut rest);
    Ok((rest, files))
}
