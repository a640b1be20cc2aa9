//! Repair of a cage: what can be repaired without changing its shape or its faces more than needed.

use super::apart::moved_apart;
use super::enlarge::enlarged;
use super::findings::{Findings, check};
use super::holes::{MAX_HOLE_EDGES, fill};
use super::messages::counted;
use super::weld::same_place;
use cager_geometry::mesh::{Model, Polygons, TriMesh, diagonal};
use cager_geometry::spatial::{Nesting, part_volumes};
use cager_geometry::topology::{border_loops, edges, fans, orientations, shells, sides};
use glam::DVec3;
use std::collections::HashSet;

/// A repaired cage.
#[derive(Clone, Debug, PartialEq)]
pub struct Repair {
    /// The cage. Polygons stay polygons.
    pub cage: Model,
    /// What was changed, a sentence each; empty where nothing was.
    pub changes: Vec<String>,
    /// What is still wrong.
    pub remaining: Findings,
}

/// Repairs a cage: merges doubled vertices along open borders, removes degenerate and doubled faces
/// and loose vertices, splits vertices at which parts only touch and moves them a little inwards,
/// makes the orientation consistent and outward, fills small holes, and moves vertices out slightly
/// where points of the model are outside; all this only where no more is wrong afterwards.
pub fn repair(cage: &Model, model: &Model) -> Repair {
    let repaired = attempt(cage, model, true);
    if repaired.changes.is_empty() {
        return repaired;
    }
    let before = check(&TriMesh::from(cage), model);
    if severity(&repaired.remaining) <= severity(&before) {
        return repaired;
    }
    let unsplit = attempt(cage, model, false);
    if severity(&unsplit.remaining) <= severity(&before) {
        return unsplit;
    }
    Repair { cage: cage.clone(), changes: Vec::new(), remaining: before }
}

/// Whether a cage cannot be encoded with, and in how many places it cannot be edited.
fn severity(found: &Findings) -> (bool, usize) {
    let places = [&found.touching_vertices, &found.duplicate_vertices, &found.self_intersections].map(Vec::len);
    (!found.usable(), places.iter().sum::<usize>() + found.non_manifold_vertices.len())
}

fn attempt(cage: &Model, model: &Model, splits: bool) -> Repair {
    let mut repairing = Repairing {
        points: cage.points.iter().map(|&p| p.into()).collect(),
        faces: cage.faces.iter().map(<[u32]>::to_vec).collect(),
        changes: Vec::new(),
    };
    repairing.drop_unusable_faces();
    repairing.merge_border_vertices();
    repairing.drop_repeated_faces();
    if splits {
        repairing.split_touching_vertices();
    }
    repairing.orient_consistently();
    repairing.fill_holes();
    repairing.orient_outwards();
    repairing.drop_loose_vertices();
    repairing.move_touching_apart();
    repairing.enlarge(model);
    let cage = repairing.model();
    let remaining = check(&TriMesh::from(&cage), model);
    Repair { cage, changes: repairing.changes, remaining }
}

struct Repairing {
    points: Vec<DVec3>,
    faces: Vec<Vec<u32>>,
    changes: Vec<String>,
}

impl Repairing {
    /// Notes what was done with so many of something, unless they were none.
    fn changed(&mut self, done: &str, count: usize, noun: &str, rest: &str) {
        if count > 0 {
            self.changes.push(format!("{done} {}{rest}", counted(count, noun)));
        }
    }

    fn drop_unusable_faces(&mut self) {
        let before = self.faces.len();
        let points = &self.points;
        let sound = |v: &u32| points.get(*v as usize).is_some_and(|p| p.is_finite());
        self.faces.retain(|face| face.iter().all(sound));
        self.changed("removed", before - self.faces.len(), "face", " with missing or non-finite corners");
    }

    fn merge_border_vertices(&mut self) {
        let target = same_place(&self.points, &self.faces);
        let merged = target.iter().enumerate().filter(|(v, t)| *v != **t as usize).count();
        self.faces.iter_mut().flatten().for_each(|v| *v = target[*v as usize]);
        self.changed("merged", merged, "vertex", " with another in the same place");
    }

    fn drop_repeated_faces(&mut self) {
        let before = self.faces.len();
        for face in &mut self.faces {
            face.dedup();
            while face.len() > 1 && face.first() == face.last() {
                face.pop();
            }
        }
        let distinct = |face: &[u32]| face.iter().collect::<HashSet<_>>().len() == face.len();
        self.faces.retain(|face| face.len() >= 3 && distinct(face));
        let degenerate = before - self.faces.len();
        let mut seen = HashSet::new();
        self.faces.retain(|face| {
            let mut key = face.clone();
            key.sort_unstable();
            seen.insert(key)
        });
        let doubled = before - degenerate - self.faces.len();
        self.changed("removed", degenerate, "face", " without area");
        self.changed("removed", doubled, "face", " doubling another");
    }

    /// A vertex at which several parts of the surface touch becomes one for each.
    fn split_touching_vertices(&mut self) {
        let mut split = 0;
        for (v, fans) in fans(self.points.len(), &self.faces).into_iter().enumerate() {
            for fan in fans.iter().skip(1) {
                let copy = self.points.len() as u32;
                self.points.push(self.points[v]);
                split += 1;
                for &f in fan {
                    self.faces[f as usize].iter_mut().filter(|w| **w == v as u32).for_each(|w| *w = copy);
                }
            }
        }
        self.changed("split", split, "vertex", " at which parts of the surface only touched");
    }

    /// In each connected component, the minority of faces is flipped to agree with the majority.
    fn orient_consistently(&mut self) {
        let edges = edges(&self.faces);
        let across = |f: u32, [a, b]: [u32; 2]| match edges.get(&[a.min(b), a.max(b)]).map(Vec::as_slice) {
            Some(&[p, q]) => Some((if p.0 == f { q.0 } else { p.0 }, p.1 == q.1)),
            _ => None,
        };
        let around = |(f, face): (u32, &Vec<u32>)| sides(face).filter_map(|side| across(f, side)).collect();
        let neighbours: Vec<Vec<(u32, bool)>> = (0..).zip(&self.faces).map(around).collect();
        let mut flips = 0;
        for part in orientations(&neighbours) {
            let against = part.iter().filter(|(_, turned)| *turned).count();
            let turn = 2 * against <= part.len();
            for (face, _) in part.into_iter().filter(|(_, turned)| *turned == turn) {
                self.faces[face as usize].reverse();
                flips += 1;
            }
        }
        self.changed("turned", flips, "face", " around to agree with the rest");
    }

    fn fill_holes(&mut self) {
        let loops = border_loops(&edges(&self.faces));
        let small: Vec<&Vec<u32>> = loops.iter().filter(|l| l.len() <= MAX_HOLE_EDGES).collect();
        for border in &small {
            let new = fill(border, |v| self.points[v as usize]);
            self.faces.extend(new);
        }
        self.changed("filled", small.len(), "hole", "");
    }

    fn orient_outwards(&mut self) {
        let edges = edges(&self.faces);
        let (labels, count) = shells(self.faces.len(), &edges);
        let mut closed = vec![true; count as usize];
        for users in edges.values().filter(|u| u.len() != 2) {
            users.iter().for_each(|u| closed[labels[u.0 as usize] as usize] = false);
        }
        let (mesh, triangle_labels) = self.labelled(&labels);
        let volumes = part_volumes(&mesh.vertices, &mesh.triangles, &triangle_labels);
        let nesting = Nesting::new(&mesh.vertices, &mesh.triangles, &triangle_labels);
        // What a part encloses depends on which parts before it were turned around.
        let mut signs = vec![1; count as usize];
        for part in (0..count).filter(|&p| closed[p as usize] && volumes[p as usize] < 0.0) {
            if !nesting.is_enclosed(part, |other| signs[other as usize]) {
                signs[part as usize] = -1;
            }
        }
        let to_turn = self.faces.iter_mut().zip(&labels).filter(|(_, label)| signs[**label as usize] < 0);
        to_turn.for_each(|(face, _)| face.reverse());
        let turned = signs.iter().filter(|sign| **sign < 0).count();
        self.changed("turned", turned, "part", " to point outwards");
    }

    fn labelled(&self, labels: &[u32]) -> (TriMesh, Vec<u32>) {
        let model = self.model();
        let of_triangle = model.faces.polygon_of_triangle().iter().map(|&f| labels[f as usize]).collect();
        (TriMesh::from(&model), of_triangle)
    }

    fn drop_loose_vertices(&mut self) {
        let mut used = vec![false; self.points.len()];
        self.faces.iter().flatten().for_each(|&v| used[v as usize] = true);
        let mut new = vec![0; used.len()];
        let mut kept = Vec::new();
        for v in 0..used.len() {
            if used[v] {
                new[v] = kept.len() as u32;
                kept.push(self.points[v]);
            }
        }
        self.changed("removed", self.points.len() - kept.len(), "vertex", " that no face uses any more");
        self.points = kept;
        self.faces.iter_mut().flatten().for_each(|v| *v = new[*v as usize]);
    }

    /// Vertices of different parts in one place go a little inwards.
    fn move_touching_apart(&mut self) {
        let Some((positions, farthest)) = moved_apart(&TriMesh::from(&self.model())) else { return };
        let moved = positions.iter().zip(&self.points).filter(|(a, b)| a != b).count();
        self.points = positions;
        self.changes.push(format!(
            "moved {} inwards, by {:.2} % of the diagonal at most, as others lay in the same place",
            counted(moved, "vertex"),
            100.0 * farthest
        ));
    }

    fn enlarge(&mut self, model: &Model) {
        let mesh = TriMesh::from(&self.model());
        let findings = check(&mesh, model);
        let Some(outside) = findings.outside.filter(|_| findings.alignment.is_none()) else { return };
        let Some(positions) = enlarged(&mesh, model) else { return };
        let moves: Vec<f64> = positions.iter().zip(&self.points).map(|(a, b)| a.distance(*b)).collect();
        let moved = moves.iter().filter(|m| **m > 0.0).count();
        let farthest = moves.iter().fold(0.0_f64, |a, b| a.max(*b)) / diagonal(&model.points);
        self.points = positions;
        self.changes.push(format!(
            "moved {} outwards, by {:.2} % of the diagonal at most, around {} that were outside",
            counted(moved, "vertex"),
            100.0 * farthest,
            counted(outside.count, "point"),
        ));
    }

    fn model(&self) -> Model {
        let mut faces = Polygons::new();
        self.faces.iter().for_each(|face| faces.push(face));
        Model { points: self.points.iter().map(DVec3::to_array).collect(), faces, ..Model::default() }
    }
}
