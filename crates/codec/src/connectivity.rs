//! Polygons by a walk over the mesh, across an edge from face to face. The walk counts vertices as
//! it meets them; the numbers that the mesh gives them follow ([`crate::vertex_order`]). Any list
//! of polygons can be coded; faces come back in the order of the walk.

use crate::entropy::{Coder, Decoder, Encoder};
use crate::error::{Error, Result};
use crate::vertex_order::{MAX_FAR_POINTS, code_order};
use crate::walk::{VertexLabels, Walk};
use cager_geometry::mesh::Polygons;
use cager_geometry::topology::Adjacency;
use std::cmp::Reverse;

/// Faces as they were coded, without the numbers of their vertices yet.
pub(crate) struct WalkedFaces {
    coder: Encoder,
    /// The faces in the order of the walk.
    pub(crate) faces: Polygons,
    /// The turn of each vertex, and which are joined, by their turns.
    turns: Vec<u32>,
    adjacency: Adjacency,
}

/// Codes polygons over this many points.
#[cfg(test)]
fn encode_faces(faces: &Polygons, points: usize) -> Vec<u8> {
    WalkedFaces::new(faces, points).into_bytes()
}

/// A directed edge, its face, and the corner where it begins, the last corners of a face first.
type Edge = ([u32; 2], usize, Reverse<usize>);

impl WalkedFaces {
    pub(crate) fn new(faces: &Polygons, points: usize) -> Self {
        let list: Vec<&[u32]> = faces.iter().collect();
        let mut edges: Vec<Edge> = Vec::with_capacity(faces.indices().len());
        for (f, face) in list.iter().enumerate() {
            edges.extend((0..face.len()).map(|k| ([face[k], face[(k + 1) % face.len()]], f, Reverse(k))));
        }
        let (adjacency, ()) = rayon::join(|| Adjacency::new(faces, points), || edges.sort_unstable());
        let mut counts = vec![0; points];
        faces.indices().iter().for_each(|&v| counts[v as usize] += 1);
        let mut done = vec![false; list.len()];
        // Of equal edges, by where the first of them is, how many have a face that is done.
        let mut past = vec![0; edges.len()];
        let mut coder = Encoder::default();
        let mut walk = Walk::new(points, edges.len(), VertexLabels::Given(counts));
        let mut found = Polygons::new();
        let mut next = 0;
        loop {
            while let Some((a, b)) = walk.gate() {
                let begin = edges.partition_point(|(edge, ..)| *edge < [b, a]);
                let equal = |at: usize| edges.get(at).filter(|(edge, ..)| *edge == [b, a]);
                while equal(begin + past.get(begin).unwrap_or(&0)).is_some_and(|(_, f, _)| done[*f]) {
                    past[begin] += 1;
                }
                let across = equal(begin + past.get(begin).unwrap_or(&0)).copied();
                if walk.code_across(&mut coder, (a, b), across.is_some())
                    && let Some((_, f, Reverse(corner))) = across
                {
                    done[f] = true;
                    let turned: Vec<u32> = (0..list[f].len()).map(|k| list[f][(corner + k) % list[f].len()]).collect();
                    found.push(&walk.face(&mut coder, Some((a, b)), &turned));
                } else {
                    walk.close(a, b);
                }
            }
            while next < list.len() && done[next] {
                next += 1;
            }
            if !coder.bit(&mut walk.more, next < list.len()) {
                break;
            }
            done[next] = true;
            found.push(&walk.face(&mut coder, None, list[next]));
        }
        walk.number_isolated_vertices();
        Self { coder, faces: found, adjacency: adjacency.renamed(&walk.turns), turns: walk.turns }
    }

    /// The bytes, with the numbers of the vertices in the way that is shorter.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        let Self { coder, turns, adjacency, .. } = self;
        let with_order = |is_far: bool| {
            let mut coder = coder.clone();
            coder.bypass(is_far);
            code_order(&mut coder, &adjacency, is_far, Some(&turns));
            coder.into_bytes()
        };
        let is_small = adjacency.points() <= MAX_FAR_POINTS;
        let (near, far) = rayon::join(|| with_order(false), || is_small.then(|| with_order(true)));
        far.filter(|far| far.len() < near.len()).unwrap_or(near)
    }
}

/// The polygons of coded bytes: `count` faces with `corners` corners in all.
pub fn decode_faces(bytes: &[u8], points: usize, count: usize, corners: usize) -> Result<Polygons> {
    let mut coder = Decoder::new(bytes)?;
    let mut walk = Walk::new(points, corners, VertexLabels::TraversalOrder);
    let mut faces = Polygons::new();
    let (mut found, mut read) = (0, 0);
    let mut add = |face: Vec<u32>| {
        (found, read) = (found + 1, read + face.len());
        faces.push(&face);
        if found > count || read > corners || face.is_empty() || face.iter().any(|&v| v as usize >= points) {
            return Err(Error::Damaged("faces are not those that the header counts"));
        }
        Ok(())
    };
    loop {
        while let Some((a, b)) = walk.gate() {
            if walk.code_across(&mut coder, (a, b), false) {
                add(walk.face(&mut coder, Some((a, b)), &[]))?;
            } else {
                walk.close(a, b);
            }
        }
        if !coder.bit(&mut walk.more, false) {
            break;
        }
        add(walk.face(&mut coder, None, &[]))?;
    }
    drop(walk);
    let is_far = coder.bypass(false);
    if is_far && points > MAX_FAR_POINTS {
        return Err(Error::Damaged("the order of so many vertices cannot have been written"));
    }
    let order = code_order(&mut coder, &Adjacency::new(&faces, points), is_far, None);
    let order = order.ok_or(Error::Damaged("vertices are not those that the faces name"))?;
    let mut numbers = vec![0; points];
    order.iter().enumerate().for_each(|(number, &vertex)| numbers[vertex as usize] = number as u32);
    coder.check()?;
    if (found, read) == (count, corners) {
        Ok(faces.renamed(&numbers))
    } else {
        Err(Error::Damaged("faces are not those that the header counts"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each face beginning with its smallest corner, in order.
    fn normal(faces: &Polygons) -> Vec<Vec<u32>> {
        let turned =
            |face: &[u32]| (0..face.len()).map(|k| [&face[k..], &face[..k]].concat()).min().unwrap_or_default();
        let mut list: Vec<Vec<u32>> = faces.iter().map(turned).collect();
        list.sort();
        list
    }

    fn check(faces: &[&[u32]], points: usize) -> usize {
        let mut polygons = Polygons::new();
        faces.iter().for_each(|face| polygons.push(face));
        let bytes = encode_faces(&polygons, points);
        let corners = polygons.indices().len();
        let back = decode_faces(&bytes, points, faces.len(), corners).unwrap();
        assert_eq!(normal(&back), normal(&polygons));
        bytes.len()
    }

    #[test]
    fn every_list_of_polygons_comes_back() {
        check(&[], 0);
        check(&[], 5);
        check(&[&[0, 1, 2]], 3);
        check(&[&[0, 1, 2], &[2, 1, 3], &[3, 1, 0], &[0, 2, 3]], 4);
        check(&[&[0, 1, 2, 3], &[3, 2, 4, 5, 6], &[0, 3, 6]], 9);
        // The same face twice, opposite ones, three at an edge, repeated corners, two corners.
        check(&[&[0, 1, 2], &[0, 1, 2], &[2, 1, 0], &[0, 1, 4], &[1, 0, 5], &[3, 3, 3], &[1, 1, 2], &[4, 5]], 6);
        let mut random = fastrand::Rng::with_seed(7);
        for _ in 0..300 {
            let points = random.u32(1..12);
            let face = |r: &mut fastrand::Rng| (0..r.usize(1..6)).map(|_| r.u32(..points)).collect::<Vec<u32>>();
            let faces: Vec<Vec<u32>> = (0..random.usize(..20)).map(|_| face(&mut random)).collect();
            check(&faces.iter().map(Vec::as_slice).collect::<Vec<_>>(), points as usize);
        }
    }

    #[test]
    fn a_regular_mesh_in_order_takes_a_bit_and_a_half_a_face() {
        let side = 100u32;
        let at = |i: u32, j: u32| i * side + j;
        let quads = (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j)));
        let triangles: Vec<[u32; 3]> = quads
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]])
            .collect();
        let bytes = check(&triangles.iter().map(|t| &t[..]).collect::<Vec<_>>(), (side * side) as usize);
        assert!(8 * bytes < 3 * triangles.len() / 2, "{bytes} bytes of {} triangles", triangles.len());
    }

    #[test]
    fn hubs_large_polygons_and_repeated_faces_come_back() {
        let count = 400_000u32;
        let fan: Vec<[u32; 3]> = (0..count).map(|k| [0, 2 * k + 1, 2 * k + 2]).collect();
        check(&fan.iter().map(|t| &t[..]).collect::<Vec<_>>(), 2 * count as usize + 1);
        let mut round = Polygons::new();
        round.push(&(0..count).collect::<Vec<_>>());
        round.push(&(0..count).rev().collect::<Vec<_>>());
        let bytes = encode_faces(&round, count as usize);
        assert_eq!(decode_faces(&bytes, count as usize, 2, 2 * count as usize).unwrap().len(), 2);
        check(&vec![&[0, 1, 2][..]; count as usize], 3);
    }

    #[test]
    fn damage_is_an_error_or_polygons_of_these_points() {
        let mut random = fastrand::Rng::with_seed(8);
        for _ in 0..300 {
            let bytes: Vec<u8> = (0..4 * random.usize(..60)).map(|_| random.u8(..)).collect();
            if let Ok(faces) = decode_faces(&bytes, 20, random.usize(..30), random.usize(..90)) {
                assert!(faces.indices().iter().all(|&v| v < 20));
            }
        }
    }
}
