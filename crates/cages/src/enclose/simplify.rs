//! Simplification of a closed mesh by edge collapses that keep it valid: its topology (link
//! condition), the model inside, and free of self-intersection.

use super::patch::{EnclosedPoints, FaceReplacement, PatchMesh, Violation, normal, quality};
use super::quadric::Quadric;
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::ControlFlow;

/// How far shapes may degrade.
#[derive(Clone, Copy, Debug)]
struct Limits {
    /// Least cosine between a face's normals before and after.
    turn: f64,
    /// Least quality of a face, unless it was worse before.
    quality: f64,
}

/// Tried in turn, the next where the one before leads no further, at a price.
const LIMITS: [Limits; 3] =
    [Limits { turn: 0.5, quality: 0.3 }, Limits { turn: 0.2, quality: 0.15 }, Limits { turn: -0.2, quality: 0.04 }];

/// Collapses that are tried between two calls of `watch`.
const WATCH_EVERY: usize = 500;

/// How many times dearer a collapse is under the next limits.
const PRICE: f64 = 8.0;

/// Why an edge cannot be collapsed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rejection {
    /// A face would be badly shaped.
    Shape,
    /// The mesh would be invalid.
    Validity,
}

/// A collapse that may be worth trying.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    cost: f64,
    edge: [u32; 2],
    /// Versions of the end vertices when it was proposed; it is stale once they change.
    versions: [u32; 2],
    /// Which of the places found valid is the vertex's, if one cost more than expected; else
    /// [`NONE`].
    place: u32,
    /// Which limits hold.
    stage: u8,
}

const NONE: u32 = u32::MAX;

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    /// The cheapest is the greatest.
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then_with(|| other.edge.cmp(&self.edge))
    }
}

/// A mesh that is being simplified.
pub(super) struct Simplifier<'a> {
    pub(super) mesh: PatchMesh,
    pub(super) quadrics: Vec<Quadric>,
    enclosed: &'a EnclosedPoints,
    versions: Vec<u32>,
    /// Edges of each vertex that could not be collapsed; they are tried again when something near
    /// them changes.
    rejected: Vec<Vec<[u32; 2]>>,
    vertices: usize,
}

impl<'a> Simplifier<'a> {
    pub(super) fn new(positions: Vec<DVec3>, faces: Vec<[u32; 3]>, enclosed: &'a EnclosedPoints) -> Self {
        let mut quadrics = vec![Quadric::ZERO; positions.len()];
        for face in &faces {
            let corners = face.map(|v| positions[v as usize]);
            (0..3).for_each(|k| quadrics[face[k] as usize] += Quadric::of_corner(corners, k));
        }
        let (versions, vertices) = (vec![0; positions.len()], positions.len());
        let rejected = vec![Vec::new(); vertices];
        Self { mesh: PatchMesh::new(positions, faces), quadrics, enclosed, versions, rejected, vertices }
    }

    /// Number of vertices.
    pub(super) fn len(&self) -> usize {
        self.vertices
    }

    /// Collapses edges until at most `target` vertices are left; false where it ends before,
    /// stopped or as hardly any can be collapsed.
    pub(super) fn simplify(&mut self, target: usize, watch: &mut dyn FnMut() -> ControlFlow<()>) -> bool {
        while self.vertices > target {
            let before = self.vertices;
            let goal = target.max(before * 6 / 10);
            if !self.collapse_cheapest(goal, watch) {
                return false;
            }
            self.compact();
            if self.vertices > goal && before - self.vertices < before / 50 + 1 {
                return false;
            }
        }
        true
    }

    /// Collapses edges until `goal` vertices are left or none can be collapsed; false where it was
    /// stopped.
    fn collapse_cheapest(&mut self, goal: usize, watch: &mut dyn FnMut() -> ControlFlow<()>) -> bool {
        let mut heap = BinaryHeap::new();
        // Apart from the candidates, so that these are small and soon moved about in the heap.
        let mut places: Vec<DVec3> = Vec::new();
        for v in 0..self.mesh.positions.len() as u32 {
            self.propose_around(v, |w| v < w, &mut heap);
        }
        let mut tried = 0;
        while self.vertices > goal {
            let Some(candidate) = heap.pop() else { break };
            tried += 1;
            if tried % WATCH_EVERY == 0 && watch().is_break() {
                return false;
            }
            let [u, v] = candidate.edge;
            if [u, v].map(|w| self.versions[w as usize]) != candidate.versions {
                continue;
            }
            let (replacement, cost) = match self.admissible(&candidate, places.get(candidate.place as usize).copied()) {
                Ok(found) => found,
                Err(Rejection::Shape) if usize::from(candidate.stage) + 1 < LIMITS.len() => {
                    heap.push(Candidate { cost: PRICE * candidate.cost, stage: candidate.stage + 1, ..candidate });
                    continue;
                }
                Err(_) => {
                    self.rejected[u as usize].push([u, v]);
                    continue;
                }
            };
            if let Some((_, place)) = replacement.moved
                && candidate.place == NONE
                && cost > 1.5 * candidate.cost
            {
                heap.push(Candidate { cost, place: places.len() as u32, ..candidate });
                places.push(place);
                continue;
            }
            self.mesh.apply(&replacement);
            let merged = self.quadrics[v as usize];
            self.quadrics[u as usize] += merged;
            self.vertices -= 1;
            self.versions[v as usize] += 1;
            self.versions[u as usize] += 1;
            self.propose_around(u, |_| true, &mut heap);
            for w in self.mesh.ring(u) {
                for edge in std::mem::take(&mut self.rejected[w as usize]) {
                    if edge.iter().all(|&x| x != u) && self.mesh.joined(edge) {
                        self.propose(edge, &mut heap);
                    }
                }
            }
        }
        true
    }

    fn propose_around(&self, v: u32, wanted: impl Fn(u32) -> bool, heap: &mut BinaryHeap<Candidate>) {
        for w in self.mesh.ring(v) {
            if wanted(w) {
                self.propose([v.min(w), v.max(w)], heap);
            }
        }
    }

    fn propose(&self, edge: [u32; 2], heap: &mut BinaryHeap<Candidate>) {
        let (position, quadric) = self.optimum(edge);
        let versions = edge.map(|x| self.versions[x as usize]);
        heap.push(Candidate { cost: quadric.at(position), edge, versions, place: NONE, stage: 0 });
    }

    fn optimum(&self, edge: [u32; 2]) -> (DVec3, Quadric) {
        let [p, q] = edge.map(|v| self.mesh.positions[v as usize]);
        let mut quadric = self.quadrics[edge[0] as usize];
        quadric += self.quadrics[edge[1] as usize];
        let middle = 0.5 * (p + q);
        let best = quadric.least(middle, 1e-3);
        let far = best.distance(middle) > 2.0 * p.distance(q);
        (if far { middle } else { best }, quadric)
    }

    /// The collapse with a valid position for its vertex, found from `first` on if given, and its
    /// cost there.
    fn admissible(&self, candidate: &Candidate, first: Option<DVec3>) -> Result<(FaceReplacement, f64), Rejection> {
        let limits = LIMITS[usize::from(candidate.stage)];
        let [u, v] = candidate.edge;
        let mesh = &self.mesh;
        let (ring_u, ring_v) = (mesh.ring(u), mesh.ring(v));
        let common: Vec<u32> = ring_u.iter().filter(|w| ring_v.binary_search(w).is_ok()).copied().collect();
        if common.len() != 2 || common.iter().any(|&w| mesh.around[w as usize].len() < 4) {
            return Err(Rejection::Validity);
        }
        let (best, quadric) = self.optimum(candidate.edge);
        let mut kept = Vec::new();
        let mut removed = Vec::new();
        for &f in &mesh.around[u as usize] {
            let shared = mesh.faces[f as usize].contains(&v);
            if shared { removed.push(f) } else { kept.push(f) }
        }
        kept.extend(mesh.around[v as usize].iter().filter(|&&f| !mesh.faces[f as usize].contains(&u)));
        let new: Vec<[u32; 3]> =
            kept.iter().map(|&f| mesh.faces[f as usize].map(|w| if w == v { u } else { w })).collect();
        let outwards = kept.iter().chain(&removed).map(|&f| normal(mesh.corners(f))).sum::<DVec3>().normalize_or_zero();
        let old: Vec<u32> = kept.iter().chain(&removed).copied().collect();
        let mut at = first.unwrap_or(best);
        let mut replacement = FaceReplacement { old, new, moved: Some((u, at)) };
        let size = mesh.positions[u as usize].distance(mesh.positions[v as usize]);
        let mut pushed = 0.0;
        for attempt in 0..5 {
            if !self.well_shaped(&replacement, kept.len(), limits) {
                return Err(Rejection::Shape);
            }
            match mesh.check(&replacement, self.enclosed) {
                Ok(()) => return Ok((replacement, quadric.at(at) * PRICE.powi(i32::from(candidate.stage)))),
                Err(Violation::Uncovered(depth)) if attempt < 4 => {
                    let step = depth * (1.2 + 0.5 * f64::from(attempt)) + 1e-4 * size;
                    pushed += step;
                    if pushed > 2.0 * size {
                        break;
                    }
                    at += step * outwards;
                    replacement.moved = Some((u, at));
                }
                Err(_) => break,
            }
        }
        Err(Rejection::Validity)
    }

    /// Whether no face turns or degrades too much. The first `kept` old faces become the new ones.
    fn well_shaped(&self, replacement: &FaceReplacement, kept: usize, limits: Limits) -> bool {
        (0..kept).all(|i| {
            let before = self.mesh.corners(replacement.old[i]);
            let after = self.mesh.corners_after(replacement.new[i], replacement.moved);
            let q = quality(after);
            normal(before).dot(normal(after)) >= limits.turn && (q >= limits.quality || q >= 1.05 * quality(before))
        })
    }

    /// Drops removed vertices and faces.
    fn compact(&mut self) {
        let (used, faces) = self.mesh.compacted();
        let positions = used.iter().map(|&v| self.mesh.positions[v as usize]).collect();
        self.quadrics = used.iter().map(|&v| self.quadrics[v as usize]).collect();
        self.versions = vec![0; used.len()];
        self.rejected = vec![Vec::new(); used.len()];
        self.mesh = PatchMesh::new(positions, faces);
    }
}
