//! The walk over a mesh, from a face across an edge to the next, as encoder and decoder take it.

use crate::entropy::{BinaryModel, Coder, Integers, Models};
use crate::gates::{Gates, MAX_TO_COME};
use crate::open_edges::{NEWEST, OpenEdges};

/// Faces at a vertex are told apart up to this number.
const MAX_FACES: u32 = 8;
/// Pairs of such numbers.
const PAIRS: usize = (MAX_FACES as usize + 1).pow(2);
/// Open edges of a vertex that are queued anew, in either direction, as it has fewer faces.
const MAX_REQUEUED: usize = 4;
/// Candidates for the next corner: vertices at the far end of open edges.
const MAX_NEAR: usize = 8;

/// The turn of vertices that were not met yet.
const UNVISITED: u32 = u32::MAX;

/// How vertices are numbered.
pub(crate) enum VertexLabels {
    /// What the faces call them that are encoded; the faces at each.
    Given(Vec<u32>),
    /// By their turn.
    TraversalOrder,
}

/// What the walk knows of the mesh.
pub(crate) struct Walk {
    /// Ends of the directed edges that wait for their opposite, by both of their ends.
    leaving: Vec<OpenEdges>,
    arriving: Vec<OpenEdges>,
    /// The vertices that were met, in order, and the place of each in it.
    met: Vec<u32>,
    pub(crate) turns: Vec<u32>,
    /// Faces that each vertex still is a corner of.
    faces_to_come: Vec<u32>,
    /// The last face, counted from 1, that each vertex is a corner of, and the face that is coded.
    of_face: Vec<u32>,
    face: u32,
    gates: Gates,
    arity: u32,
    /// Corners that are not coded yet: a damaged face has no more.
    corners_left: usize,
    across: Vec<BinaryModel>,
    /// Whether faces follow that begin anywhere.
    pub(crate) more: BinaryModel,
    same_arity: BinaryModel,
    first_time: Vec<BinaryModel>,
    place: Vec<BinaryModel>,
    arities: Integers,
    face_counts: Integers,
    labels: VertexLabels,
}

impl Walk {
    pub(crate) fn new(points: usize, corners: usize, labels: VertexLabels) -> Self {
        Self {
            leaving: std::iter::repeat_with(OpenEdges::default).take(points).collect(),
            arriving: std::iter::repeat_with(OpenEdges::default).take(points).collect(),
            met: Vec::new(),
            turns: vec![UNVISITED; points],
            faces_to_come: vec![0; points],
            of_face: vec![0; points],
            face: 0,
            gates: Gates::default(),
            arity: 3,
            corners_left: corners,
            across: vec![BinaryModel::default(); 9],
            more: BinaryModel::default(),
            same_arity: BinaryModel::default(),
            first_time: vec![BinaryModel::default(); 2 * PAIRS],
            place: vec![BinaryModel::default(); 8 * MAX_NEAR],
            arities: Integers::new(1),
            face_counts: Integers::new(1),
            labels,
        }
    }

    /// The next edge that still waits for a face.
    pub(crate) fn gate(&mut self) -> Option<(u32, u32)> {
        while let Some((a, b)) = self.gates.pop() {
            if self.leaving[a as usize].contains(b) {
                return Some((a, b));
            }
        }
        None
    }

    /// Fewest faces that are to come at an end of an edge.
    fn to_come(&self, (a, b): (u32, u32)) -> u32 {
        self.faces_to_come[a as usize].min(self.faces_to_come[b as usize])
    }

    /// Sorts the open edges of a vertex anew where none of their ends has fewer faces to come.
    fn requeue_open_edges(&mut self, v: u32) {
        let faces = self.faces_to_come[v as usize];
        if faces >= MAX_TO_COME {
            return;
        }
        let mut scratch = [0; NEWEST];
        for (ends, leaves) in [(&self.leaving, true), (&self.arriving, false)] {
            for &x in last_few(ends[v as usize].newest(&mut scratch)) {
                if self.faces_to_come[x as usize] >= faces {
                    self.gates.push(if leaves { (v, x) } else { (x, v) }, faces);
                }
            }
        }
    }

    /// Codes whether a face follows across a gate.
    pub(crate) fn code_across(&mut self, coder: &mut impl Coder, (a, b): (u32, u32), follows: bool) -> bool {
        let to_come = |v: u32| self.faces_to_come[v as usize].min(2) as usize;
        coder.bit(&mut self.across[3 * to_come(a) + to_come(b)], follows)
    }

    /// The edge from a to b waits no longer.
    pub(crate) fn close(&mut self, a: u32, b: u32) -> bool {
        let was_open = self.leaving[a as usize].remove(b);
        if was_open {
            self.arriving[b as usize].remove(a);
        }
        was_open
    }

    /// Codes a face, which begins with the opposite of the gate's edge, and takes it into the walk.
    /// Damaged bytes may name vertices or corners that are not there.
    pub(crate) fn face(&mut self, coder: &mut impl Coder, gate: Option<(u32, u32)>, given: &[u32]) -> Vec<u32> {
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
            let faces = self.faces_to_come[from as usize];
            if faces > 0 {
                self.faces_to_come[from as usize] = faces - 1;
                nearer.push(from);
            }
        }
        for gate in opened {
            self.gates.push(gate, self.to_come(gate));
        }
        nearer.into_iter().for_each(|v| self.requeue_open_edges(v));
        face
    }

    /// Codes the vertex after those of `face`; `closes`: an edge leads from it back to the gate.
    fn corner(&mut self, coder: &mut impl Coder, face: &[u32], closes: bool, given: u32) -> u32 {
        let (near, both) = self.candidates(face, closes);
        let faces = |v: Option<&u32>| v.map_or(0, |&v| self.faces_to_come[v as usize].min(MAX_FACES));
        let (previous, first) = (faces(face.last()), faces(face.first()));
        let pair = ((MAX_FACES + 1) * previous + first) as usize;
        let ends = usize::from(previous == 1) + 2 * usize::from(first == 1);
        let new = self.is_unvisited(given);
        if coder.bit(&mut self.first_time[PAIRS * usize::from(both) + pair], new) {
            return self.new_vertex(coder, given);
        }
        let context = MAX_NEAR * (2 * ends + usize::from(both));
        for (k, &x) in near.iter().enumerate() {
            if !coder.bit(&mut self.place[context + k], x != given) {
                return x;
            }
        }
        self.met_vertex(coder, given)
    }

    /// Vertices that an open edge leads from to the last corner, or to from the first one, those that
    /// both are true of first; and whether there are such.
    fn candidates(&self, face: &[u32], closes: bool) -> (Vec<u32>, bool) {
        let (mut near, mut both) = (Vec::with_capacity(4), false);
        let (Some(&previous), Some(&first)) = (face.last(), face.first()) else { return (near, both) };
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
        let mut kept = 0;
        for k in 0..near.len() {
            if !is_corner(near[k]) && !near[..kept].contains(&near[k]) {
                near[kept] = near[k];
                kept += 1;
            }
        }
        near.truncate(kept.min(MAX_NEAR));
        (near, both)
    }

    fn is_unvisited(&self, vertex: u32) -> bool {
        self.turns.get(vertex as usize).is_none_or(|&turn| turn == UNVISITED)
    }

    /// A vertex met for the first time.
    fn new_vertex(&mut self, coder: &mut impl Coder, given: u32) -> u32 {
        let turn = self.met.len() as u32;
        let (vertex, faces) = match &self.labels {
            VertexLabels::Given(faces) => (given, faces[given as usize]),
            VertexLabels::TraversalOrder => (turn, 1),
        };
        if let Some(place) = self.turns.get_mut(vertex as usize) {
            *place = turn;
            // Of the first face of all it is a corner now.
            self.faces_to_come[vertex as usize] = self.face_counts.natural(coder, 0, faces - 1).saturating_add(1);
            self.met.push(vertex);
        }
        vertex
    }

    /// A vertex that was met, but that nothing leads to.
    fn met_vertex(&mut self, coder: &mut impl Coder, given: u32) -> u32 {
        let turn = self.turns.get(given as usize).copied().unwrap_or(0);
        let turn = coder.bits(u32::BITS - (self.met.len() as u32).leading_zeros(), turn);
        self.met.get(turn as usize).copied().unwrap_or(UNVISITED)
    }

    /// Gives the vertices of no face the last turns.
    pub(crate) fn number_isolated_vertices(&mut self) {
        let unvisited = self.turns.iter_mut().filter(|turn| **turn == UNVISITED);
        unvisited.zip(self.met.len() as u32..).for_each(|(turn, next)| *turn = next);
    }
}

fn last_few(ends: &[u32]) -> &[u32] {
    &ends[ends.len().saturating_sub(MAX_REQUEUED)..]
}
