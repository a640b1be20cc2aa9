//! Connectivity of polygon meshes of any arity, without assumptions on their validity.

use super::{UnionFind, faces_around};
use std::collections::BTreeMap;

/// Every edge, the smaller vertex first, and the faces at it, with whether they run from that one.
pub type Edges = BTreeMap<[u32; 2], Vec<(u32, bool)>>;

/// Sides of a polygon, in its direction.
pub fn sides(face: &[u32]) -> impl Iterator<Item = [u32; 2]> + '_ {
    (0..face.len()).map(move |k| [face[k], face[(k + 1) % face.len()]])
}

/// The edges of some faces.
pub fn edges(faces: &[impl AsRef<[u32]>]) -> Edges {
    let mut edges = Edges::new();
    for (f, face) in faces.iter().enumerate() {
        for [a, b] in sides(face.as_ref()) {
            edges.entry([a.min(b), a.max(b)]).or_default().push((f as u32, a < b));
        }
    }
    edges
}

/// The connected part of each face, by edges shared by two faces, and how many parts there are.
pub fn shells(faces: usize, edges: &Edges) -> (Vec<u32>, u32) {
    let mut shells = UnionFind::new(faces);
    for users in edges.values().filter(|u| u.len() == 2) {
        shells.join(users[0].0, users[1].0);
    }
    shells.numbered()
}

/// The connected parts of faces, each in the order of a walk from its first face, with whether a
/// face has to be turned to agree with it. Takes neighbours, and whether they run against.
pub fn orientations(neighbours: &[Vec<(u32, bool)>]) -> Vec<Vec<(u32, bool)>> {
    let (mut seen, mut parts) = (vec![false; neighbours.len()], Vec::new());
    for start in 0..neighbours.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let (mut part, mut next) = (vec![(start as u32, false)], 0);
        while let Some(&(face, turned)) = part.get(next) {
            for &(other, against) in &neighbours[face as usize] {
                if !std::mem::replace(&mut seen[other as usize], true) {
                    part.push((other, turned != against));
                }
            }
            next += 1;
        }
        parts.push(part);
    }
    parts
}

/// The faces around each vertex, grouped by edges at that vertex: one group at a manifold vertex.
pub fn fans(vertices: usize, faces: &[impl AsRef<[u32]>]) -> Vec<Vec<Vec<u32>>> {
    let fans_at = |(v, faces_at): (usize, Vec<u32>)| {
        let mut fans: Vec<(Vec<u32>, Vec<u32>)> = Vec::new();
        for f in faces_at {
            let face = faces[f as usize].as_ref();
            let spokes: Vec<u32> = sides(face)
                .filter_map(|[a, b]| match v as u32 {
                    v if a == v => Some(b),
                    v if b == v => Some(a),
                    _ => None,
                })
                .collect();
            let (mut joined, apart): (Vec<_>, Vec<_>) =
                fans.into_iter().partition(|(_, s)| s.iter().any(|w| spokes.contains(w)));
            let mut fan = (vec![f], spokes);
            for (more_faces, more_spokes) in joined.drain(..) {
                fan.0.extend(more_faces);
                fan.1.extend(more_spokes);
            }
            fan.0.sort_unstable();
            fans = apart;
            fans.push(fan);
        }
        let mut fans: Vec<Vec<u32>> = fans.into_iter().map(|f| f.0).collect();
        fans.sort_unstable();
        fans
    };
    faces_around(vertices, faces).into_iter().enumerate().map(fans_at).collect()
}

/// Border loops, in the direction in which a face would fill them, but for those that branch.
pub fn border_loops(edges: &Edges) -> Vec<Vec<u32>> {
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for ([a, b], users) in edges.iter().filter(|(_, u)| u.len() == 1) {
        let [from, to] = if users[0].1 { [*b, *a] } else { [*a, *b] };
        next.entry(from).or_default().push(to);
    }
    let mut loops = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let mut path = Vec::new();
        let mut at = start;
        let mut whole = true;
        while let Some(to) = next.remove(&at) {
            whole &= to.len() == 1;
            path.push(at);
            at = to[0];
        }
        if whole && at == start && path.len() >= 3 {
            loops.push(path);
        }
    }
    loops
}
