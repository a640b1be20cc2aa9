//! Polygons by a walk over the mesh, from a face across an edge to the next: most corners are then vertices whose edges still wait for a face, or
//! are met for the first time. Any list of polygons can be coded; vertices keep their numbers, faces come in the order of the walk.

use crate::entropy::{Bit, Coder, Decoder, Encoder, Integers, SIZES, size_class};
use crate::error::{Error, Result};
use crate::open_edges::{NEWEST, OpenEdges};
use cager_core::mesh::Polygons;
use std::cmp::Reverse;
use std::collections::VecDeque;

/// Faces that meet at a vertex are counted up to this number.
const VALENCES: usize = 9;
/// Contexts of whether a corner is met for the first time: both ends' faces, and where an edge on either side leads to the same vertex.
const CORNERS: usize = VALENCES * VALENCES + 1;

/// What the walk knows of the mesh.
struct Walk {
    /// Ends of the directed edges that wait for their opposite, by where these begin, and the other way round.
    leaving: Vec<OpenEdges>,
    arriving: Vec<OpenEdges>,
    met: Vec<bool>,
    faces: Vec<u8>,
    /// The last face, counted from 1, that each vertex is a corner of, and the face that is coded.
    of_face: Vec<u32>,
    face: u32,
    gates: VecDeque<(u32, u32)>,
    /// Whether the walk goes round what it has seen, or on from where it is.
    in_rings: bool,
    last: u32,
    before: u32,
    arity: u32,
    /// Corners that are not coded yet: a damaged face has no more.
    corners_left: usize,
    across: Bit,
    more: Bit,
    same_arity: Bit,
    first_time: Vec<Bit>,
    place: Vec<Bit>,
    arities: Integers,
    numbers: Integers,
    unmet: Unmet,
}

/// Codes polygons over this many points, by the shorter of two walks.
///
/// # Panics
/// Where a corner is beyond them.
pub fn encode_faces(faces: &Polygons, points: usize) -> Vec<u8> {
    let list: Vec<&[u32]> = faces.iter().collect();
    let mut edges = Vec::with_capacity(faces.indices().len());
    for (f, face) in list.iter().enumerate() {
        edges.extend((0..face.len()).map(|k| ([face[k], face[(k + 1) % face.len()]], f, Reverse(k))));
    }
    edges.sort_unstable();
    let walk = |in_rings| encode_walk(&list, &edges, points, in_rings);
    let (on, rings) = rayon::join(|| walk(false), || walk(true));
    if rings.len() < on.len() { rings } else { on }
}

/// A directed edge, its face, and at which corner of it it begins; the last corners of a face come first.
type Edge = ([u32; 2], usize, Reverse<usize>);

/// `edges` are those of the faces, sorted.
fn encode_walk(list: &[&[u32]], edges: &[Edge], points: usize, in_rings: bool) -> Vec<u8> {
    let mut done = vec![false; list.len()];
    // Of equal edges, by where the first of them is, how many have a face that is done.
    let mut past = vec![0; edges.len()];
    let mut coder = Encoder::default();
    let mut walk = Walk::new(points, edges.len(), coder.even(in_rings));
    let mut next = 0;
    loop {
        while let Some((a, b)) = walk.gate() {
            let begin = edges.partition_point(|(edge, ..)| *edge < [b, a]);
            let equal = |at: usize| edges.get(at).filter(|(edge, ..)| *edge == [b, a]);
            while equal(begin + past.get(begin).unwrap_or(&0)).is_some_and(|(_, f, _)| done[*f]) {
                past[begin] += 1;
            }
            let found = equal(begin + past.get(begin).unwrap_or(&0)).copied();
            if coder.bit(&mut walk.across, found.is_some())
                && let Some((_, f, Reverse(corner))) = found
            {
                done[f] = true;
                let turned: Vec<u32> = (0..list[f].len()).map(|k| list[f][(corner + k) % list[f].len()]).collect();
                walk.face(&mut coder, Some((a, b)), &turned);
            } else {
                walk.close(a, b);
            }
        }
        while next < list.len() && done[next] {
            next += 1;
        }
        if !coder.bit(&mut walk.more, next < list.len()) {
            return coder.into_bytes();
        }
        done[next] = true;
        walk.face(&mut coder, None, list[next]);
    }
}

/// The polygons that [`encode_faces`] wrote: `count` faces with `corners` corners in all.
///
/// # Errors
/// Bytes that the encoder did not write.
pub fn decode_faces(bytes: &[u8], points: usize, count: usize, corners: usize) -> Result<Polygons> {
    let mut coder = Decoder::new(bytes)?;
    let mut walk = Walk::new(points, corners, coder.even(false));
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
            if coder.bit(&mut walk.across, false) {
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
    coder.check()?;
    if (found, read) == (count, corners) {
        Ok(faces)
    } else {
        Err(Error::Damaged("faces are not those that the header counts"))
    }
}

impl Walk {
    fn new(points: usize, corners: usize, in_rings: bool) -> Self {
        Self {
            leaving: std::iter::repeat_with(OpenEdges::default).take(points).collect(),
            arriving: std::iter::repeat_with(OpenEdges::default).take(points).collect(),
            met: vec![false; points],
            faces: vec![0; points],
            of_face: vec![0; points],
            face: 0,
            gates: VecDeque::new(),
            in_rings,
            last: 0,
            before: 0,
            arity: 3,
            corners_left: corners,
            across: Bit::default(),
            more: Bit::default(),
            same_arity: Bit::default(),
            first_time: vec![Bit::default(); CORNERS],
            place: vec![Bit::default(); 2 * 8],
            arities: Integers::new(1),
            numbers: Integers::new(SIZES),
            unmet: Unmet::new(points),
        }
    }

    /// The next edge that still waits for a face.
    fn gate(&mut self) -> Option<(u32, u32)> {
        while let Some((a, b)) = if self.in_rings { self.gates.pop_front() } else { self.gates.pop_back() } {
            if self.leaving[a as usize].contains(b) {
                return Some((a, b));
            }
        }
        None
    }

    /// The edge from a to b waits no longer.
    fn close(&mut self, a: u32, b: u32) -> bool {
        let was_open = self.leaving[a as usize].remove(b);
        if was_open {
            self.arriving[b as usize].remove(a);
        }
        was_open
    }

    /// Codes a face, which begins with the opposite of the gate's edge where there is a gate, and takes it into the walk. Damaged bytes may name
    /// vertices that do not exist or too many corners; the face is then none of this mesh.
    fn face(&mut self, coder: &mut impl Coder, gate: Option<(u32, u32)>, given: &[u32]) -> Vec<u32> {
        let arity = given.len() as u32;
        if coder.bit(&mut self.same_arity, arity != self.arity) {
            self.arity = self.arities.natural(coder, 0, arity);
        }
        let Some(left) = self.corners_left.checked_sub(self.arity as usize) else { return Vec::new() };
        self.corners_left = left;
        let mut face = gate.map_or_else(Vec::new, |(a, b)| vec![b, a]);
        face.truncate(self.arity as usize);
        self.face += 1;
        face.iter().for_each(|&v| self.of_face[v as usize] = self.face);
        while face.len() < self.arity as usize {
            let closes = face.len() + 1 == self.arity as usize && gate.is_some();
            let vertex = self.corner(coder, &face, closes, given.get(face.len()).copied().unwrap_or(0));
            if vertex as usize >= self.met.len() {
                return vec![vertex];
            }
            face.push(vertex);
            self.of_face[vertex as usize] = self.face;
        }
        for (k, &from) in face.iter().enumerate() {
            let to = face[(k + 1) % face.len()];
            if !self.close(to, from) {
                self.leaving[from as usize].push(to);
                self.arriving[to as usize].push(from);
                self.gates.push_back((from, to));
            }
            self.faces[from as usize] = self.faces[from as usize].saturating_add(1);
        }
        face
    }

    /// Codes the vertex after those of `face`; `closes` says that an edge leads from it back to the gate.
    fn corner(&mut self, coder: &mut impl Coder, face: &[u32], closes: bool, given: u32) -> u32 {
        let (Some(&previous), Some(&first)) = (face.last(), face.first()) else {
            return self.any(coder, given);
        };
        // Vertices that an open edge leads from to the last corner, or to from the first one.
        let mut near: Vec<u32> = Vec::with_capacity(4);
        let mut both = false;
        let is_corner = |x: u32| self.of_face[x as usize] == self.face;
        let (mut scratch, mut other) = ([0; NEWEST], [0; NEWEST]);
        let back = if closes { self.leaving[first as usize].newest(&mut scratch) } else { &[] };
        for &x in self.arriving[previous as usize].newest(&mut other).iter().rev() {
            if back.contains(&x) && !is_corner(x) {
                near.insert(0, x);
                both = true;
            } else {
                near.push(x);
            }
        }
        near.extend(back.iter().rev());
        near.retain(|&x| !is_corner(x));
        let mut k = 0;
        while k < near.len() {
            if near[..k].contains(&near[k]) {
                near.remove(k);
            } else {
                k += 1;
            }
        }
        near.truncate(8);
        let valence = |v: u32| usize::from(self.faces[v as usize]).min(VALENCES - 1);
        let context = if both { CORNERS - 1 } else { VALENCES * valence(previous) + valence(first) };
        let new = !self.met.get(given as usize).copied().unwrap_or(false);
        if coder.bit(&mut self.first_time[context], new) {
            return self.new_vertex(coder, previous.max(first), given);
        }
        for (k, &x) in near.iter().enumerate() {
            if !coder.bit(&mut self.place[8 * usize::from(both) + k], x != given) {
                return x;
            }
        }
        coder.bits(32, given)
    }

    /// A corner of the first face of a part.
    fn any(&mut self, coder: &mut impl Coder, given: u32) -> u32 {
        let new = !self.met.get(given as usize).copied().unwrap_or(false);
        if coder.bit(&mut self.first_time[0], new) {
            self.new_vertex(coder, self.last, given)
        } else {
            coder.bits(32, given)
        }
    }

    /// A vertex met for the first time, by how many others that are not met yet lie between it and one that was.
    fn new_vertex(&mut self, coder: &mut impl Coder, near: u32, given: u32) -> u32 {
        let expected = self.unmet.before(near);
        let difference = self.unmet.before(given) as i32 - expected as i32;
        let context = size_class(self.before.min(1 << 16) * 2);
        let difference = self.numbers.code(coder, context, difference);
        self.before = (self.before + difference.unsigned_abs().min(1 << 20)) / 2;
        let vertex = self.unmet.take(expected.wrapping_add(difference as u32));
        if let Some(met) = self.met.get_mut(vertex as usize) {
            *met = true;
            self.last = vertex;
        }
        vertex
    }
}

/// Vertices that are not met yet, counted in a Fenwick tree.
struct Unmet {
    sums: Vec<u32>,
    left: u32,
}

impl Unmet {
    fn new(points: usize) -> Self {
        let sums = (0..=points as u32).map(|k| k & k.wrapping_neg()).collect();
        Self { sums, left: points as u32 }
    }

    /// How many have a number below this one.
    fn before(&self, vertex: u32) -> u32 {
        let mut at = (vertex as usize).min(self.sums.len() - 1);
        let mut count = 0;
        while at > 0 {
            count += self.sums[at];
            at &= at - 1;
        }
        count
    }

    /// Takes out the one with so many before it; beyond the last there is no vertex.
    fn take(&mut self, rank: u32) -> u32 {
        if rank >= self.left {
            return u32::MAX;
        }
        let (mut at, mut rest) = (0, rank);
        let mut reach = self.sums.len().next_power_of_two();
        while reach > 0 {
            if at + reach < self.sums.len() && self.sums[at + reach] <= rest {
                at += reach;
                rest -= self.sums[at];
            }
            reach /= 2;
        }
        self.left -= 1;
        let vertex = at as u32;
        at += 1;
        while at < self.sums.len() {
            self.sums[at] -= 1;
            at += at & at.wrapping_neg();
        }
        vertex
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
    fn hubs_large_polygons_and_repeated_faces_take_no_longer_than_others() {
        let begin = std::time::Instant::now();
        let count = 400_000u32;
        let fan: Vec<[u32; 3]> = (0..count).map(|k| [0, 2 * k + 1, 2 * k + 2]).collect();
        check(&fan.iter().map(|t| &t[..]).collect::<Vec<_>>(), 2 * count as usize + 1);
        let mut round = Polygons::new();
        round.push(&(0..count).collect::<Vec<_>>());
        round.push(&(0..count).rev().collect::<Vec<_>>());
        let bytes = encode_faces(&round, count as usize);
        assert_eq!(decode_faces(&bytes, count as usize, 2, 2 * count as usize).unwrap().len(), 2);
        check(&vec![&[0, 1, 2][..]; count as usize], 3);
        assert!(begin.elapsed().as_secs() < 10, "{:?}", begin.elapsed());
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
