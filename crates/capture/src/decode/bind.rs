//! Models bound to the cage of a container: their coordinates in it.

use super::opened::{Container, DecodeError};
use crate::memory::free_bytes;
use crate::origin::move_to;
use cager_core::coordinates;
use cager_core::coordinates::{CoordinateSystem as _, Coordinates, DEFINITION, ElementPlan, MeanValue};
use cager_core::decode::{Bound, Decoder, Survey};
use cager_core::inversion::{coordinates_bytes, reject_far_points};
use cager_geometry::mesh::{Model, TriMesh};
use cager_proto::container;
use std::path::Path;

/// A model at rest, its decoder, and how many points lie outside the rest cage and beside poles.
pub(super) struct BoundModel {
    pub(super) rest: Model,
    pub(super) decoder: Decoder,
    pub(super) outside: usize,
    pub(super) bound: usize,
}

/// Computes the coordinates of the container's model, if they are not `known`, or of another, in
/// the container's cage; `keeps(points, columns)` decides whether to keep them in memory.
pub(super) fn bind(
    container: &mut Container,
    path: &Path,
    other: Option<(&Path, &Model)>,
    known: Option<Coordinates>,
    keeps: impl FnOnce(usize, usize) -> bool,
) -> Result<BoundModel, DecodeError> {
    let fail = |cause| DecodeError::container(path, cause);
    let unsupported = |what| DecodeError::Unsupported { path: path.to_owned(), what };
    let header = container.header().clone();
    let Some(system) = coordinates::by_name(&header.coordinates) else {
        return Err(unsupported(format!("its coordinates are {:?}", header.coordinates)));
    };
    if header.coordinates_definition != DEFINITION {
        return Err(unsupported(format!("its coordinates are of definition {}", header.coordinates_definition)));
    }
    let own = container.rest().map_err(fail)?;
    let (model_path, rest, fitted) = match other {
        None => (path, own, None),
        Some((path, model)) => {
            let mut model = model.clone();
            move_to(header.origin, &mut model.points);
            (path, model, Some(TriMesh::from(&own)))
        }
    };
    if let Some(face) = rest.faces.arities().iter().position(|&corners| corners < 3) {
        return Err(fail(container::Error::Corrupt {
            offset: 0,
            what: format!("face {face} of the model has fewer than three vertices"),
        }));
    }
    let cage = container.checked_cage().map_err(fail)?;
    if let (Some((model, _)), false) = (other, cage.carriers().is_empty()) {
        return Err(DecodeError::ByComponent { path: path.to_owned(), model: model.to_owned() });
    }
    let values = system.values(&cage);
    if values.unknowns() != header.rows_per_frame as usize {
        return Err(unsupported(format!("it stores {} rows per frame", header.rows_per_frame)));
    }
    let columns = values.columns();
    if other.is_some() {
        reject_far_points(&cage, &rest.points)
            .map_err(|cause| DecodeError::Model { path: model_path.to_owned(), cause })?;
    }
    let plan = container.elements().map_err(fail)?.map(ElementPlan::from_bytes);
    let keeps = keeps(rest.points.len(), columns);
    let known = known.filter(|_| other.is_none() && (keeps || plan.is_some()));
    if let Some(pointwise) = system.pointwise().filter(|_| plan.is_none() && known.is_none()) {
        let decoder = if keeps { Decoder::with_stored_coordinates } else { Decoder::with_recomputed_coordinates }(
            pointwise,
            &cage,
            &rest.points,
            columns,
        );
        let decoder = decoder.with_dependent_normals(values.dependent_normals);
        let Some(fitted) = fitted else { return Ok(BoundModel { rest, decoder, outside: 0, bound: 0 }) };
        let Survey { outside, mut beside } = Survey::of(pointwise, &cage, &rest.points);
        // Other coordinates have no poles.
        beside.retain(|_| header.coordinates == MeanValue.name());
        let bound = Bound::new(pointwise, &cage, &fitted, &rest.points, &beside)
            .map_err(|cause| DecodeError::Model { path: model_path.to_owned(), cause })?;
        let count = bound.places.len();
        return Ok(BoundModel { rest, decoder: decoder.with_bound(bound), outside, bound: count });
    }
    let elements = if known.is_some() { 0 } else { system.working_bytes(&cage, plan.as_ref()) };
    let needed = coordinates_bytes(rest.points.len(), columns, 2).saturating_add(elements);
    if needed > free_bytes() {
        return Err(DecodeError::Memory { path: model_path.to_owned(), gigabytes: 1e-9 * needed as f64 });
    }
    let coordinates = known.map_or_else(|| system.coordinates(&cage, &rest.points, plan.as_ref()), Ok);
    let found = coordinates.map_err(|cause| DecodeError::Coordinates { path: model_path.to_owned(), cause })?;
    let decoder =
        Decoder::new(found.phi.as_ref(), cage.vertices().len()).with_dependent_normals(values.dependent_normals);
    Ok(BoundModel { rest, decoder, outside: found.outside.len(), bound: 0 })
}
