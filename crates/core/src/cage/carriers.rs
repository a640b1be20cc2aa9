//! Which component of a cage carries which points of its model.

use super::{Cage, CageError};
use cager_geometry::mesh::TriMesh;
use std::borrow::Cow;
use std::ops::Range;

/// Consecutive points of a model, and the vertices of the component of its cage that carries them:
/// the coordinates of these points are those in that component alone, and zero elsewhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Carrier {
    /// The points.
    pub points: Range<u32>,
    /// The vertices of the component.
    pub vertices: Range<u32>,
}

impl Cage {
    /// The same cage, each of whose components carries some of the points, the first from point 0
    /// on; with no carriers the whole cage carries every point.
    ///
    /// # Errors
    /// [`CageError::Carriers`]: carriers that leave out a point or a vertex, overlap, or cut a face.
    pub fn with_carriers(mut self, carriers: Vec<Carrier>) -> Result<Self, CageError> {
        self.components = components(&carriers, self.mesh()).map_err(|what| CageError::Carriers { what })?;
        self.carriers = carriers;
        Ok(self)
    }

    /// Which component carries which points, in their order; empty where the whole cage carries
    /// every point.
    pub fn carriers(&self) -> &[Carrier] {
        &self.carriers
    }

    /// Whether its components, if any, carry so many points.
    pub fn carries(&self, points: usize) -> bool {
        self.carriers.last().is_none_or(|last| last.points.end as usize == points)
    }

    /// The cage for some of the points, whose coordinates are asked for in this order; its components
    /// stay, also those that carry none of them.
    pub fn of_points(&self, points: impl IntoIterator<Item = u32>) -> Cow<'_, Self> {
        if self.components.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut carriers: Vec<Carrier> = Vec::new();
        for (place, point) in (0..).zip(points) {
            let at = self.carriers.partition_point(|carrier| carrier.points.end <= point);
            let vertices = self.carriers[at].vertices.clone();
            match carriers.last_mut() {
                Some(last) if last.vertices == vertices => last.points.end = place + 1,
                _ => carriers.push(Carrier { points: place..place + 1, vertices }),
            }
        }
        Cow::Owned(Self { carriers, ..self.clone() })
    }

    /// Each component that carries points as a cage of its own, with its vertices among those of this
    /// one and these points; none where the whole cage carries every point.
    pub(crate) fn components(&self) -> Option<Vec<Component>> {
        if self.components.is_empty() {
            return None;
        }
        let mut points = vec![Vec::new(); self.components.len()];
        for carrier in &self.carriers {
            points[place(&self.components, carrier.vertices.start)].push(carrier.points.clone());
        }
        let meshes = component_meshes(self.mesh(), &self.components);
        let all = meshes.into_iter().zip(&self.components).zip(points);
        let component = |((mesh, vertices), points): ((TriMesh, &Range<u32>), _)| Component {
            cage: Self::new(mesh).expect("a component of a cage"),
            vertices: vertices.clone(),
            points,
        };
        Some(all.filter(|(_, points)| !points.is_empty()).map(component).collect())
    }
}

/// A component of a cage.
pub(crate) struct Component {
    pub(crate) cage: Cage,
    pub(crate) vertices: Range<u32>,
    pub(crate) points: Vec<Range<u32>>,
}

/// Which of the components has a vertex.
fn place(components: &[Range<u32>], vertex: u32) -> usize {
    components.partition_point(|vertices| vertices.end <= vertex)
}

/// The components of a mesh that have these vertices.
fn component_meshes(mesh: &TriMesh, components: &[Range<u32>]) -> Vec<TriMesh> {
    let own = |vertices: &Range<u32>| mesh.vertices[vertices.start as usize..vertices.end as usize].to_vec();
    let mut meshes: Vec<TriMesh> =
        components.iter().map(|vertices| TriMesh { vertices: own(vertices), triangles: Vec::new() }).collect();
    for triangle in &mesh.triangles {
        let at = place(components, triangle[0]);
        meshes[at].triangles.push(triangle.map(|vertex| vertex - components[at].start));
    }
    meshes
}

/// The vertices of each component, ascending, where these can carry the points of a model.
fn components(carriers: &[Carrier], mesh: &TriMesh) -> Result<Vec<Range<u32>>, String> {
    if carriers.is_empty() {
        return Ok(Vec::new());
    }
    let mut next = 0;
    for Carrier { points, .. } in carriers {
        if points.start != next || points.end <= next {
            return Err(format!("a component carries points {points:?} where point {next} is next"));
        }
        next = points.end;
    }
    let mut components: Vec<Range<u32>> = carriers.iter().map(|carrier| carrier.vertices.clone()).collect();
    components.sort_unstable_by_key(|vertices| (vertices.start, vertices.end));
    components.dedup();
    let mut next = 0;
    for vertices in &components {
        if vertices.start != next || vertices.end <= next || vertices.end as usize > mesh.vertices.len() {
            return Err(format!("a component has vertices {vertices:?} where vertex {next} is next"));
        }
        next = vertices.end;
    }
    if (next as usize) < mesh.vertices.len() {
        return Err(format!("vertex {next} is in no component"));
    }
    let is_cut = |triangle: &[u32; 3]| {
        let first = place(&components, triangle[0]);
        triangle.iter().any(|&vertex| place(&components, vertex) != first)
    };
    if let Some(face) = mesh.triangles.iter().position(is_cut) {
        return Err(format!("face {face} has corners in two components"));
    }
    for (mesh, vertices) in component_meshes(mesh, &components).into_iter().zip(&components) {
        Cage::new(mesh).map_err(|error| format!("the component of vertices {vertices:?}: {error}"))?;
    }
    Ok(components)
}
