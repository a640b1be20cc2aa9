//! All defects of a cage.

use super::connectivity::{edges, fans, shells};
use super::fit::alignment;
use super::influence::influence;
use crate::geometry::{outside, self_intersections};
use cager_core::cage::{Cage, CageError, Nesting};
use cager_core::mesh::{Model, TriMesh, diagonal};
use glam::DVec3;
use std::collections::HashMap;

/// What is wrong with a cage around a model. Vertices and faces are counted from 0; faces are triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub faces: usize,
    /// Why nothing can be encoded with the cage, if that is so.
    pub refusal: Option<CageError>,
    /// Vertices with coordinates that are NaN or infinite.
    pub not_finite: Vec<u32>,
    /// Faces that name vertices that do not exist.
    pub dangling_faces: Vec<u32>,
    /// Faces without area.
    pub degenerate_faces: Vec<u32>,
    /// Pairs of faces over the same vertices.
    pub duplicate_faces: Vec<[u32; 2]>,
    /// Pairs of vertices in the same place.
    pub duplicate_vertices: Vec<[u32; 2]>,
    /// Vertices that no face uses.
    pub loose_vertices: Vec<u32>,
    /// Edges with one face only.
    pub open_edges: Vec<[u32; 2]>,
    /// Edges with more than two faces.
    pub non_manifold_edges: Vec<[u32; 2]>,
    /// Vertices at which parts of the surface touch without a common edge.
    pub non_manifold_vertices: Vec<u32>,
    /// Edges along which two faces run in the same direction.
    pub inconsistent_edges: Vec<[u32; 2]>,
    /// Connected parts of the surface.
    pub components: usize,
    /// Parts that point inwards inside another part.
    pub cavities: usize,
    /// Parts that point inwards without being a cavity.
    pub inward_parts: usize,
    /// Pairs of faces that cut, touch or overlap one another.
    pub self_intersections: Vec<[u32; 2]>,
    /// Whether it was examined if the cage encloses the model: not of a cage that cannot be encoded with, nor around a model without points or with some
    /// that are not finite.
    pub enclosure_examined: bool,
    /// Points of the model outside the cage, where there are any and they were looked for.
    pub outside: Option<Outside>,
    /// A change of units, axes or position after which the cage would enclose most points that are outside.
    pub alignment: Option<Alignment>,
    /// Vertices that move no point of the model.
    pub idle_vertices: Vec<u32>,
    /// Ratio of the greatest to the least singular value of the mean value coordinates, infinite where they are singular; `None` where it was not
    /// computed.
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

/// A change of the cage after which it would enclose the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// Factor on all coordinates.
    pub scale: f64,
    /// Axes to turn: `"y and z"` where up is another axis, otherwise none.
    pub axes: Option<&'static str>,
    /// Move after that, in units of the model.
    pub shift: [f64; 3],
}

impl Findings {
    /// Whether a capture may be encoded with the cage.
    pub fn usable(&self) -> bool {
        self.refusal.is_none()
    }

    /// Whether the cage is also fit to be edited by hand: free of self-intersection and around all of the model.
    pub fn editable(&self) -> bool {
        self.usable()
            && self.self_intersections.is_empty()
            && self.non_manifold_vertices.is_empty()
            && self.enclosure_examined
            && self.outside.is_none()
    }
}

/// All defects of a cage around a model, rather than the first one.
pub fn check(mesh: &TriMesh, model: &Model) -> Findings {
    let n = mesh.vertices.len();
    let finite = |v: &u32| mesh.vertices[*v as usize].iter().all(|x| x.is_finite());
    let mut findings = Findings {
        vertices: n,
        faces: mesh.triangles.len(),
        refusal: Cage::new(mesh.clone()).err(),
        not_finite: (0..n as u32).filter(|v| !finite(v)).collect(),
        duplicate_vertices: same_place(mesh),
        ..Findings::default()
    };
    let exists = |t: &[u32; 3]| t.iter().all(|&v| (v as usize) < n);
    let names: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    let (real, dangling): (Vec<u32>, Vec<u32>) = names.iter().partition(|&&f| exists(&mesh.triangles[f as usize]));
    findings.dangling_faces = dangling;
    let faces: Vec<[u32; 3]> = real.iter().map(|&f| mesh.triangles[f as usize]).collect();
    examine_faces(&mut findings, mesh, &real, &faces);
    examine_edges(&mut findings, mesh, &faces);
    findings.self_intersections = self_intersections(mesh);
    let points_finite = model.points.iter().flatten().all(|x| x.is_finite());
    if findings.usable() && points_finite && !model.points.is_empty() {
        examine_fit(&mut findings, mesh, model);
    }
    findings
}

/// Pairs of vertices with equal coordinates, each with the first of them.
fn same_place(mesh: &TriMesh) -> Vec<[u32; 2]> {
    let mut first: HashMap<[u64; 3], u32> = HashMap::new();
    let mut pairs = Vec::new();
    for (v, p) in mesh.vertices.iter().enumerate() {
        // −0 and 0 are the same place.
        let at = *first.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(v as u32);
        if at != v as u32 {
            pairs.push([at, v as u32]);
        }
    }
    pairs
}

fn examine_faces(findings: &mut Findings, mesh: &TriMesh, names: &[u32], faces: &[[u32; 3]]) {
    let mut used = vec![false; mesh.vertices.len()];
    let mut seen: HashMap<[u32; 3], u32> = HashMap::new();
    for (&name, face) in names.iter().zip(faces) {
        face.iter().for_each(|&v| used[v as usize] = true);
        let [a, b, c] = face.map(|v| DVec3::from(mesh.vertices[v as usize]));
        let longest2 = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        let flat = (b - a).cross(c - a).length() / longest2;
        if flat.is_nan() || flat <= 1e-12 {
            findings.degenerate_faces.push(name);
        }
        let mut key = *face;
        key.sort_unstable();
        if let Some(&first) = seen.get(&key) {
            findings.duplicate_faces.push([first, name]);
        } else {
            seen.insert(key, name);
        }
    }
    findings.loose_vertices = (0..used.len() as u32).filter(|&v| !used[v as usize]).collect();
}

fn examine_edges(findings: &mut Findings, mesh: &TriMesh, faces: &[[u32; 3]]) {
    let edges = edges(faces);
    for (&edge, users) in &edges {
        match users.as_slice() {
            [_] => findings.open_edges.push(edge),
            [a, b] if a.1 == b.1 => findings.inconsistent_edges.push(edge),
            [_, _] => {}
            _ => findings.non_manifold_edges.push(edge),
        }
    }
    let fans = fans(mesh.vertices.len(), faces);
    findings.non_manifold_vertices = (0..fans.len() as u32).filter(|&v| fans[v as usize].len() > 1).collect();
    let (labels, count) = shells(faces.len(), &edges);
    findings.components = count as usize;
    let sound = findings.open_edges.is_empty()
        && findings.inconsistent_edges.is_empty()
        && findings.non_manifold_edges.is_empty()
        && findings.not_finite.is_empty();
    if sound {
        let nesting = Nesting::new(&mesh.vertices, faces, &labels);
        let inside_out = (0..count).zip(shell_volumes(mesh, faces, &labels, count)).filter(|(_, volume)| *volume < 0.0);
        for (shell, _) in inside_out {
            if nesting.is_enclosed(shell, |_| 1) {
                findings.cavities += 1;
            } else {
                findings.inward_parts += 1;
            }
        }
    }
}

/// Signed volume of each part.
pub(super) fn shell_volumes(mesh: &TriMesh, faces: &[[u32; 3]], labels: &[u32], count: u32) -> Vec<f64> {
    let mut volumes = vec![0.0; count as usize];
    for (face, &label) in faces.iter().zip(labels) {
        let [a, b, c] = face.map(|v| DVec3::from(mesh.vertices[v as usize]) - DVec3::from(mesh.vertices[0]));
        volumes[label as usize] += a.dot(b.cross(c)) / 6.0;
    }
    volumes
}

fn examine_fit(findings: &mut Findings, mesh: &TriMesh, model: &Model) {
    findings.enclosure_examined = true;
    let found = outside(mesh, &model.points);
    let farthest = found.iter().fold(None, |best: Option<(u32, f64)>, &f| match best {
        Some(b) if b.1 >= f.1 => Some(b),
        _ => Some(f),
    });
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
