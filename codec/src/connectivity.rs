//! Polygons by a walk over the mesh, from a face across an edge to the next: most corners are then vertices whose edges still wait for a face, or
//! are met for the first time. The walk counts vertices as it meets them; the numbers that the mesh gives them follow ([`crate::vertex_order`]). Any list of polygons
//! can be coded; vertices keep their numbers, faces come in the order of the walk.

use crate::adjacency::Adjacency;
use crate::entropy::{Bit, Coder, Decoder, Encoder, Integers, SIZES, size_class};
use crate::error::{Error, Result};
use crate::fenwick::Counted;
use crate::mesh::MeshVersion;
use crate::open_edges::{NEWEST, OpenEdges};
use crate::vertex_order::{MOST_FAR_POINTS, code_order};
use cager_core::mesh::Polygons;
use std::cmp::Reverse;
use std::collections::VecDeque;

/// Faces at a vertex are told apart up to this number.
const MOST_FACES: u32 = 8;
/// Pairs of such numbers.
const PAIRS: usize = (MOST_FACES as usize + 1).pow(2);
/// Open edges are told apart by the faces to come at their ends up to this number.
const MOST_TO_COME: u32 = 15;
/// Open edges of a vertex that are sorted anew with it, in either direction: ordinary meshes have no more.
const MOST_NEARER: usize = 4;
/// Vertices that a corner is looked for among, those that open edges lead to.
const MOST_NEAR: usize = 8;

/// What the walk knows of the mesh.
struct Walk {
    /// Ends of the directed edges that wait for their opposite, by where these begin, and the other way round.
    leaving: Vec<OpenEdges>,
    arriving: Vec<OpenEdges>,
    /// The vertices that were met, in order, and the place of each in it.
    met: Vec<u32>,
    turns: Vec<u32>,
    /// Faces that each vertex still is a corner of; of [`MeshVersion::First`] those that it was of.
    faces: Vec<u32>,
    /// The last face, counted from 1, that each vertex is a corner of, and the face that is coded.
    of_face: Vec<u32>,
    face: u32,
    gates: Gates,
    arity: u32,
    /// Corners that are not coded yet: a damaged face has no more.
    corners_left: usize,
    across: Vec<Bit>,
    more: Bit,
    same_arity: Bit,
    first_time: Vec<Bit>,
    place: Vec<Bit>,
    arities: Integers,
    face_counts: Integers,
    names: Names,
}

/// Edges at which the walk may go on; some wait no longer.
enum Gates {
    /// By how few faces are to come at one of their ends, which is then complete soon; those that were opened or came nearer first before others.
    Fewest(Vec<VecDeque<(u32, u32)>>),
    /// The newest first.
    Newest(Vec<(u32, u32)>),
    /// The oldest first.
    Oldest(VecDeque<(u32, u32)>),
}

/// The turn of vertices that were not met yet.
const UNMET: u32 = u32::MAX;

/// What vertices are called that are met for the first time.
enum Names {
    /// What the faces call them that are encoded; the faces at each.
    Given(Vec<u32>),
    /// By their turn.
    Turns,
    /// By the numbers of the mesh, which are read where they are met.
    Numbers(Box<Numbers>),
}

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

/// A directed edge, its face, and at which corner of it it begins; the last corners of a face come first.
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
        let mut walk = Walk::new(points, edges.len(), Gates::fewest(), Names::Given(counts));
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
            coder.even(is_far);
            code_order(&mut coder, &adjacency, is_far, Some(&turns));
            coder.into_bytes()
        };
        let is_small = adjacency.points() <= MOST_FAR_POINTS;
        let (near, far) = rayon::join(|| with_order(false), || is_small.then(|| with_order(true)));
        far.filter(|far| far.len() < near.len()).unwrap_or(near)
    }
}

/// The polygons of coded bytes, this program's or earlier ones': `count` faces with `corners` corners in all.
///
/// # Errors
/// Bytes that the encoder did not write.
pub fn decode_faces(
    bytes: &[u8],
    version: MeshVersion,
    points: usize,
    count: usize,
    corners: usize,
) -> Result<Polygons> {
    let mut coder = Decoder::new(bytes)?;
    let (gates, names) = match version {
        MeshVersion::First => {
            let gates = if coder.even(false) { Gates::Oldest(VecDeque::new()) } else { Gates::Newest(Vec::new()) };
            (gates, Names::Numbers(Box::new(Numbers::new(points))))
        }
        MeshVersion::Second => (Gates::fewest(), Names::Turns),
    };
    let mut walk = Walk::new(points, corners, gates, names);
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
    if version == MeshVersion::Second {
        let is_far = coder.even(false);
        if is_far && points > MOST_FAR_POINTS {
            return Err(Error::Damaged("the order of so many vertices cannot have been written"));
        }
        let order = code_order(&mut coder, &Adjacency::new(&faces, points), is_far, None);
        let order = order.ok_or(Error::Damaged("vertices are not those that the faces name"))?;
        let mut numbers = vec![0; points];
        order.iter().enumerate().for_each(|(number, &vertex)| numbers[vertex as usize] = number as u32);
        faces = faces.renamed(&numbers);
    }
    coder.check()?;
    if (found, read) == (count, corners) {
        Ok(faces)
    } else {
        Err(Error::Damaged("faces are not those that the header counts"))
    }
}

impl Walk {
    fn new(points: usize, corners: usize, gates: Gates, names: Names) -> Self {
        Self {
            leaving: std::iter::repeat_with(OpenEdges::default).take(points).collect(),
            arriving: std::iter::repeat_with(OpenEdges::default).take(points).collect(),
            met: Vec::new(),
            turns: vec![UNMET; points],
            faces: vec![0; points],
            of_face: vec![0; points],
            face: 0,
            gates,
            arity: 3,
            corners_left: corners,
            across: vec![Bit::default(); 9],
            more: Bit::default(),
            same_arity: Bit::default(),
            first_time: vec![Bit::default(); 2 * PAIRS],
            place: vec![Bit::default(); 8 * MOST_NEAR],
            arities: Integers::new(1),
            face_counts: Integers::new(1),
            names,
        }
    }

    /// The next edge that still waits for a face.
    fn gate(&mut self) -> Option<(u32, u32)> {
        while let Some((a, b)) = self.gates.pop() {
            if self.leaving[a as usize].contains(b) {
                return Some((a, b));
            }
        }
        None
    }

    fn is_first_version(&self) -> bool {
        matches!(self.names, Names::Numbers(_))
    }

    /// Fewest faces that are to come at an end of an edge.
    fn to_come(&self, (a, b): (u32, u32)) -> u32 {
        self.faces[a as usize].min(self.faces[b as usize])
    }

    /// Sorts the open edges of a vertex anew where none of their ends has fewer faces to come.
    fn requeue_open_edges(&mut self, v: u32) {
        let faces = self.faces[v as usize];
        if faces >= MOST_TO_COME {
            return;
        }
        let mut scratch = [0; NEWEST];
        for &x in last_few(self.leaving[v as usize].newest(&mut scratch)) {
            if self.faces[x as usize] >= faces {
                self.gates.push((v, x), faces);
            }
        }
        for &x in last_few(self.arriving[v as usize].newest(&mut scratch)) {
            if self.faces[x as usize] >= faces {
                self.gates.push((x, v), faces);
            }
        }
    }

    /// Codes whether a face follows across a gate.
    fn code_across(&mut self, coder: &mut impl Coder, (a, b): (u32, u32), follows: bool) -> bool {
        let to_come = |v: u32| self.faces[v as usize].min(2) as usize;
        let context = if self.is_first_version() { 0 } else { 3 * to_come(a) + to_come(b) };
        coder.bit(&mut self.across[context], follows)
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
            if vertex as usize >= self.turns.len() {
                return vec![vertex];
            }
            face.push(vertex);
            self.of_face[vertex as usize] = self.face;
        }
        let (mut opened, mut nearer) = (Vec::with_capacity(face.len()), Vec::with_capacity(face.len()));
        for (k, &from) in face.iter().enumerate() {
            let to = face[(k + 1) % face.len()];
            if !self.close(to, from) {
                self.leaving[from as usize].push(to);
                self.arriving[to as usize].push(from);
                opened.push((from, to));
            }
            let faces = self.faces[from as usize];
            if self.is_first_version() {
                self.faces[from as usize] = faces + 1;
            } else if faces > 0 {
                self.faces[from as usize] = faces - 1;
                nearer.push(from);
            }
        }
        for gate in opened {
            self.gates.push(gate, self.to_come(gate));
        }
        nearer.into_iter().for_each(|v| self.requeue_open_edges(v));
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
        near.truncate(MOST_NEAR);
        let faces = |v: u32| self.faces[v as usize].min(MOST_FACES);
        let pair = ((MOST_FACES + 1) * faces(previous) + faces(first)) as usize;
        let ends = usize::from(faces(previous) == 1) + 2 * usize::from(faces(first) == 1);
        let (context, ends) = match (both, self.is_first_version()) {
            (true, true) => (PAIRS, 0),
            (false, true) => (pair, 0),
            (both, false) => (PAIRS * usize::from(both) + pair, ends),
        };
        let new = self.is_unmet(given);
        if coder.bit(&mut self.first_time[context], new) {
            return self.new_vertex(coder, previous.max(first), given);
        }
        let context = MOST_NEAR * (2 * ends + usize::from(both));
        for (k, &x) in near.iter().enumerate() {
            if !coder.bit(&mut self.place[context + k], x != given) {
                return x;
            }
        }
        self.met_vertex(coder, given)
    }

    /// A corner of the first face of a part.
    fn any(&mut self, coder: &mut impl Coder, given: u32) -> u32 {
        let new = self.is_unmet(given);
        if coder.bit(&mut self.first_time[0], new) {
            let last = self.met.last().copied().unwrap_or(0);
            self.new_vertex(coder, last, given)
        } else {
            self.met_vertex(coder, given)
        }
    }

    fn is_unmet(&self, vertex: u32) -> bool {
        self.turns.get(vertex as usize).is_none_or(|&turn| turn == UNMET)
    }

    /// A vertex met for the first time, `near` another.
    fn new_vertex(&mut self, coder: &mut impl Coder, near: u32, given: u32) -> u32 {
        let turn = self.met.len() as u32;
        let (vertex, faces) = match &mut self.names {
            Names::Given(faces) => (given, faces[given as usize]),
            Names::Turns => (turn, 1),
            Names::Numbers(numbers) => (numbers.read(coder, near), 0),
        };
        if !self.is_first_version() && (vertex as usize) < self.faces.len() {
            // Of the first face of all it is a corner now.
            self.faces[vertex as usize] = self.face_counts.natural(coder, 0, faces - 1).saturating_add(1);
        }
        if let Some(place) = self.turns.get_mut(vertex as usize) {
            *place = turn;
            self.met.push(vertex);
        }
        vertex
    }

    /// A vertex that was met, but that nothing leads to.
    fn met_vertex(&mut self, coder: &mut impl Coder, given: u32) -> u32 {
        if let Names::Numbers(_) = self.names {
            return coder.bits(32, 0);
        }
        let turn = self.turns.get(given as usize).copied().unwrap_or(0);
        let turn = coder.bits(u32::BITS - (self.met.len() as u32).leading_zeros(), turn);
        self.met.get(turn as usize).copied().unwrap_or(UNMET)
    }

    /// Gives the vertices of no face the last turns.
    fn number_isolated_vertices(&mut self) {
        let unmet = self.turns.iter_mut().filter(|turn| **turn == UNMET);
        unmet.zip(self.met.len() as u32..).for_each(|(turn, next)| *turn = next);
    }
}

fn last_few(ends: &[u32]) -> &[u32] {
    &ends[ends.len().saturating_sub(MOST_NEARER)..]
}

impl Gates {
    fn fewest() -> Self {
        Self::Fewest(vec![VecDeque::new(); MOST_TO_COME as usize + 1])
    }

    fn push(&mut self, gate: (u32, u32), to_come: u32) {
        match self {
            Self::Fewest(queues) => queues[to_come.min(MOST_TO_COME) as usize].push_back(gate),
            Self::Newest(list) => list.push(gate),
            Self::Oldest(queue) => queue.push_back(gate),
        }
    }

    fn pop(&mut self) -> Option<(u32, u32)> {
        match self {
            Self::Fewest(queues) => queues.iter_mut().find_map(VecDeque::pop_front),
            Self::Newest(list) => list.pop(),
            Self::Oldest(queue) => queue.pop_front(),
        }
    }
}

/// Reads the numbers of vertices where they are met, by how many others that are not met yet lie between one and one that was: [`MeshVersion::First`].
struct Numbers {
    models: Integers,
    unmet: Counted,
    before: u32,
}

impl Numbers {
    fn new(points: usize) -> Self {
        Self { models: Integers::new(SIZES), unmet: Counted::all(points), before: 0 }
    }

    /// Beyond the last vertex there is none.
    fn read(&mut self, coder: &mut impl Coder, near: u32) -> u32 {
        let expected = self.unmet.before(near);
        let context = size_class(self.before.min(1 << 16) * 2);
        let difference = self.models.code(coder, context, 0);
        self.before = (self.before + difference.unsigned_abs().min(1 << 20)) / 2;
        let Some(vertex) = self.unmet.find(expected.wrapping_add(difference as u32)) else { return UNMET };
        self.unmet.remove(vertex);
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
        let back = decode_faces(&bytes, MeshVersion::Second, points, faces.len(), corners).unwrap();
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
        assert_eq!(decode_faces(&bytes, MeshVersion::Second, count as usize, 2, 2 * count as usize).unwrap().len(), 2);
        check(&vec![&[0, 1, 2][..]; count as usize], 3);
        assert!(begin.elapsed().as_secs() < 10, "{:?}", begin.elapsed());
    }

    #[test]
    fn damage_is_an_error_or_polygons_of_these_points() {
        let mut random = fastrand::Rng::with_seed(8);
        for _ in 0..300 {
            let bytes: Vec<u8> = (0..4 * random.usize(..60)).map(|_| random.u8(..)).collect();
            for version in [MeshVersion::First, MeshVersion::Second] {
                if let Ok(faces) = decode_faces(&bytes, version, 20, random.usize(..30), random.usize(..90)) {
                    assert!(faces.indices().iter().all(|&v| v < 20));
                }
            }
        }
    }
}
