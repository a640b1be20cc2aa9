//! All defects of a cage.

use super::alignment::{Alignment, alignment};
use super::influence::influence;
use cager_core::cage::{CageError, Defects};
use cager_geometry::mesh::{Model, TriMesh, diagonal, welded};
use cager_geometry::spatial::{outside, self_intersections};
use cager_geometry::topology::{edges, fans};

/// What is wrong with a cage around a model. Vertices and triangles are counted from 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub faces: usize,
    /// Why nothing can be encoded with the cage, if that is so.
    pub refusal: Option<CageError>,
    /// What keeps the mesh from being a cage.
    pub defects: Defects,
    /// Pairs of vertices in the same place that are one: on open borders, or without other faces.
    pub duplicate_vertices: Vec<[u32; 2]>,
    /// Pairs of vertices in the same place at which closed parts touch.
    pub touching_vertices: Vec<[u32; 2]>,
    /// Vertices at which parts of the surface touch without a common edge.
    pub non_manifold_vertices: Vec<u32>,
    /// Pairs of faces that cut, touch or overlap one another.
    pub self_intersections: Vec<[u32; 2]>,
    /// Whether it was examined if the cage encloses the model, as of usable cages.
    pub enclosure_examined: bool,
    /// Points of the model outside the cage, where there are any and they were looked for.
    pub outside: Option<Outside>,
    /// A change after which the cage would enclose most points that are outside.
    pub alignment: Option<Alignment>,
    /// Vertices that move no point of the model.
    pub idle_vertices: Vec<u32>,
    /// Condition number of the mean value coordinates, infinite where they are singular; `None`
    /// where it was not computed.
    pub condition_number: Option<f64>,
}

/// Points of a model outside its cage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outside {
    /// Number of points outside.
    pub count: usize,
    /// Number of points of the model.
    pub points: usize,
    /// The farthest of them.
    pub farthest: u32,
    /// How far it is from the cage, as a fraction of the model's diagonal.
    pub distance: f64,
}

impl Findings {
    /// Whether a capture may be encoded with the cage.
    pub fn usable(&self) -> bool {
        self.refusal.is_none()
    }

    /// Whether the cage is also fit to be edited: not self-intersecting, around all of the model.
    pub fn editable(&self) -> bool {
        self.usable()
            && self.self_intersections.is_empty()
            && self.non_manifold_vertices.is_empty()
            && self.touching_vertices.is_empty()
            && self.enclosure_examined
            && self.outside.is_none()
    }
}

/// All defects of a cage around a model, rather than the first one.
pub fn check(mesh: &TriMesh, model: &Model) -> Findings {
    let vertices = mesh.vertices.len();
    let (defects, refusal) = Defects::of(mesh);
    let exists = |t: &&[u32; 3]| t.iter().all(|&v| (v as usize) < vertices);
    let faces: Vec<[u32; 3]> = mesh.triangles.iter().filter(exists).copied().collect();
    let fans = fans(vertices, &faces);
    let (duplicate_vertices, touching_vertices) = same_place(mesh, &faces);
    let mut findings = Findings {
        vertices,
        faces: mesh.triangles.len(),
        refusal,
        defects,
        duplicate_vertices,
        touching_vertices,
        non_manifold_vertices: (0..vertices as u32).filter(|&v| fans[v as usize].len() > 1).collect(),
        self_intersections: self_intersections(mesh),
        ..Findings::default()
    };
    let points_finite = model.points.iter().flatten().all(|x| x.is_finite());
    if findings.usable() && points_finite && !model.points.is_empty() {
        examine_fit(&mut findings, mesh, model);
    }
    findings
}

/// Pairs of vertices with equal coordinates: those that are one, and those that only touch.
pub(super) fn same_place(mesh: &TriMesh, faces: &[[u32; 3]]) -> (Vec<[u32; 2]>, Vec<[u32; 2]>) {
    let first = welded(&mesh.vertices);
    let pairs: Vec<[u32; 2]> = first.into_iter().zip(0..).map(|(at, v)| [at, v]).filter(|[at, v]| at != v).collect();
    if pairs.is_empty() {
        return (pairs, Vec::new());
    }
    let edges = edges(faces);
    let (mut is_closed, mut is_used) = (vec![true; mesh.vertices.len()], vec![false; mesh.vertices.len()]);
    for (ends, users) in &edges {
        for &v in ends {
            is_used[v as usize] = true;
            is_closed[v as usize] &= users.len() > 1;
        }
    }
    let touches = |pair: &[u32; 2]| {
        pair.iter().all(|&v| is_used[v as usize])
            && pair.iter().any(|&v| is_closed[v as usize])
            && !edges.contains_key(&[pair[0].min(pair[1]), pair[0].max(pair[1])])
    };
    let (touching, one) = pairs.into_iter().partition(touches);
    (one, touching)
}

fn examine_fit(findings: &mut Findings, mesh: &TriMesh, model: &Model) {
    findings.enclosure_examined = true;
    let found = outside(mesh, &model.points);
    let farthest = found.iter().copied().reduce(|best, found| if best.1 >= found.1 { best } else { found });
    let extent = diagonal(&model.points).max(f64::MIN_POSITIVE);
    findings.outside = farthest.map(|(farthest, distance)| Outside {
        count: found.len(),
        points: model.points.len(),
        farthest,
        distance: distance / extent,
    });
    if 2 * found.len() > model.points.len() {
        findings.alignment = alignment(mesh, model);
    }
    (findings.idle_vertices, findings.condition_number) = influence(mesh, model);
}
