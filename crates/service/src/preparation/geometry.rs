//! Uploaded files as rest pose, cage and matrix. All functions block.

use super::ValidOptions;
use crate::problem::{self, ApiError};
use crate::store::{Content, NamedFile};
use cager_cages::diagnosis::weld;
use cager_capture::coding::RestMeshes;
use cager_capture::origin::move_to;
use cager_codec::CodedMesh;
use cager_core::cage::{Cage, CageError};
use cager_core::regularize::Regularizer;
use cager_formats::{MeshFormat, Units, read_matrix_bytes, read_split_mesh_bytes};
use cager_geometry::linalg::SparseMatrix;
use cager_geometry::mesh::{Model, Point, TriMesh, diagonal};
use cager_proto::container::unpack_model;
use std::path::Path;

/// Rest pose and cage of a session, on a grid where its frames are coded.
pub(crate) struct Geometry {
    pub(crate) rest: Model,
    pub(crate) cage: Cage,
    /// The matrix of the regularizer `matrix`.
    pub(crate) matrix: Option<SparseMatrix>,
    /// Rest pose and cage in the bytes of the codec.
    pub(crate) coded: Option<(CodedMesh, CodedMesh)>,
    /// The unit of guaranteed errors: the diagonal of the rest pose as it was sent, or as it is stored, whichever is less.
    pub(crate) unit: f64,
    /// What the file of the rest pose says of its positions.
    pub(crate) units: Units,
}

fn read_matrix(content: &Content, valid: &ValidOptions) -> Result<Option<SparseMatrix>, ApiError> {
    let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, format!("regularizer_matrix: {detail}")));
    match (&content.matrix, valid.inversion.regularizer) {
        (Some(file), Regularizer::Matrix) => {
            read_matrix_bytes(Path::new(&file.name), &file.bytes).map(Some).or_else(|error| refuse(error.to_string()))
        }
        (None, Regularizer::Matrix) => refuse("the regularizer matrix needs it; send it as a file".to_owned()),
        (Some(_), other) => refuse(format!("{} uses no matrix; choose the regularizer matrix", other.name())),
        (None, _) => Ok(None),
    }
}

/// Reads and checks rest pose and cage.
///
/// # Errors
/// Bytes that cannot be read; a cage that cannot be used.
pub(crate) fn read(content: &Content, valid: &ValidOptions) -> Result<Geometry, ApiError> {
    let (rest, units) = read_part_with_units("rest", &content.rest.name, &content.rest.bytes)?;
    let cage = read_cage(&content.cage, valid)?;
    let matrix = read_matrix(content, valid)?;
    let given = diagonal(&rest.points);
    let goal = valid.goal.filter(|_| !valid.exact_rest);
    Ok(match goal.and_then(|goal| RestMeshes::new(goal, &rest, &cage, valid.system)) {
        Some(RestMeshes { rest, cage, checked }) => Geometry {
            unit: given.min(diagonal(&rest.mesh.points)),
            rest: rest.mesh.clone(),
            cage: checked,
            matrix,
            coded: Some((rest, cage)),
            units,
        },
        None => Geometry { rest, cage, matrix, coded: None, unit: given, units },
    })
}

/// Reads and checks the cage.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_cage(file: &NamedFile, valid: &ValidOptions) -> Result<Cage, ApiError> {
    let NamedFile { name, bytes } = file;
    let model = read_part("cage", name, bytes)?;
    if model.faces.is_empty() {
        return Err(geometry(format!(
            "{name}: has no faces, and a cage is a closed mesh; export the cage with its faces"
        )));
    }
    let model = weld(&model).map(|welded| welded.model).unwrap_or(model);
    let mesh = TriMesh::from(&model);
    let polygon_of = model.faces.polygon_of_triangle();
    Cage::new(if valid.flip_cage { mesh.flipped() } else { mesh }).map_err(|error| {
        let or = if matches!(error, CageError::Inward { .. }) && !valid.flip_cage { ", or send flip_cage" } else { "" };
        let error = error.renumbered(|triangle| polygon_of[triangle] as usize);
        geometry(format!("{name}: {error}{or}"))
    })
}

/// A cage that was sent with a job.
///
/// # Errors
/// It cannot be read or used.
pub(crate) fn cage_of(file: &NamedFile, origin: Option<Point>) -> Result<Cage, ApiError> {
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

/// Parses a mesh file; `part` names it in errors.
///
/// # Errors
/// Bytes that cannot be read.
pub(crate) fn read_part(part: &str, name: &str, bytes: &[u8]) -> Result<Model, ApiError> {
    read_part_with_units(part, name, bytes).map(|(model, _)| model)
}

/// As [`read_part`], with what the file says of its positions.
///
/// # Errors
/// As [`read_part`].
pub(crate) fn read_part_with_units(part: &str, name: &str, bytes: &[u8]) -> Result<(Model, Units), ApiError> {
    let path = Path::new(name);
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("cager")) {
        return unpack_model(bytes).map_err(|error| geometry(format!("{part}: {name}: {error}")));
    }
    let format = MeshFormat::from_path(path).map_err(|error| geometry(format!("{part}: {error}")))?;
    // Frames come without a file that would say which points are one.
    let mut read = read_split_mesh_bytes(format, path, bytes).map_err(|error| geometry(format!("{part}: {error}")))?;
    read.model.surface.keep_named_pictures();
    Ok((read.model, read.units))
}

pub(super) fn geometry(detail: String) -> ApiError {
    ApiError::new(problem::INVALID_GEOMETRY, detail)
}
