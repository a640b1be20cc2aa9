//! A closed mesh whose faces are replaced as long as the model stays inside and none intersect.

use cager_geometry::spatial::distance::point_triangle2;
use cager_geometry::spatial::surface::crossing;
use cager_geometry::spatial::{Aabb, Bvh, triangles_intersect};
use cager_geometry::topology::{faces_around, ring};
use glam::DVec3;

/// Corners of a face that was removed.
const REMOVED: [u32; 3] = [u32::MAX; 3];

/// Points that must stay inside, at a distance from the surface.
#[derive(Debug)]
pub(super) struct EnclosedPoints {
    points: Vec<DVec3>,
    /// Trees over some of the points, by which most faults are found, and over the others.
    trees: [Bvh; 2],
    /// How far each must stay from the surface, and the largest of these.
    clearances: Vec<f64>,
    largest_clearance: f64,
}

/// One point of so many is looked at first.
const STRIDE: usize = 8;

impl EnclosedPoints {
    /// Points with the distance that each keeps.
    pub(super) fn new(mut points: Vec<DVec3>, mut clearances: Vec<f64>) -> Self {
        let some = points.len().div_ceil(STRIDE);
        for i in 0..some {
            points.swap(i, i * STRIDE);
            clearances.swap(i, i * STRIDE);
        }
        let boxes: Vec<Aabb> = points.iter().map(|&p| Aabb { low: p, high: p }).collect();
        let largest_clearance = clearances.iter().copied().fold(0.0, f64::max);
        Self { trees: [Bvh::new(&boxes[..some]), Bvh::new(&boxes[some..])], points, clearances, largest_clearance }
    }
}

/// Faces that would take the place of others with the same border.
#[derive(Clone, Debug)]
pub(super) struct FaceReplacement {
    /// Faces that are removed.
    pub(super) old: Vec<u32>,
    /// Faces that are added.
    pub(super) new: Vec<[u32; 3]>,
    /// A vertex that moves, and where to; all its faces must be among the old.
    pub(super) moved: Option<(u32, DVec3)>,
}

/// Why a replacement is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Violation {
    /// A point would be outside or too close, by so much.
    Uncovered(f64),
    /// A new face would cut another face.
    Intersecting,
}

/// A closed mesh with the faces around every vertex and a tree over its faces.
#[derive(Debug)]
pub(super) struct PatchMesh {
    pub(super) positions: Vec<DVec3>,
    pub(super) faces: Vec<[u32; 3]>,
    /// Faces around each vertex.
    pub(super) around: Vec<Vec<u32>>,
    tree: Bvh,
}

impl PatchMesh {
    pub(super) fn new(positions: Vec<DVec3>, faces: Vec<[u32; 3]>) -> Self {
        let around = faces_around(positions.len(), &faces);
        let boxes: Vec<Aabb> = faces.iter().map(|f| Aabb::around(f.map(|v| positions[v as usize]))).collect();
        Self { tree: Bvh::new(&boxes), positions, faces, around }
    }

    pub(super) fn is_removed(&self, face: u32) -> bool {
        self.faces[face as usize] == REMOVED
    }

    pub(super) fn corners(&self, face: u32) -> [DVec3; 3] {
        let [a, b, c] = self.faces[face as usize];
        [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]
    }

    /// Vertices joined to one by an edge, ascending.
    pub(super) fn ring(&self, vertex: u32) -> Vec<u32> {
        ring(vertex, &self.around[vertex as usize], &self.faces)
    }

    /// Whether two vertices share a face.
    pub(super) fn joined(&self, [a, b]: [u32; 2]) -> bool {
        self.around[a as usize].iter().any(|&f| self.faces[f as usize].contains(&b))
    }

    /// Corners of a face once a vertex has moved.
    pub(super) fn corners_after(&self, face: [u32; 3], moved: Option<(u32, DVec3)>) -> [DVec3; 3] {
        face.map(|v| match moved {
            Some((vertex, to)) if vertex == v => to,
            _ => self.positions[v as usize],
        })
    }

    /// Whether the model would stay enclosed and the mesh free of self-intersection.
    pub(super) fn check(&self, replacement: &FaceReplacement, enclosed: &EnclosedPoints) -> Result<(), Violation> {
        let new: Vec<[DVec3; 3]> = replacement.new.iter().map(|&f| self.corners_after(f, replacement.moved)).collect();
        self.check_enclosed(replacement, &new, enclosed)?;
        self.check_intersections(replacement, &new)
    }

    /// A point stays inside when a ray from it crosses as many of the new faces as of the old.
    fn check_enclosed(
        &self,
        replacement: &FaceReplacement,
        new: &[[DVec3; 3]],
        enclosed: &EnclosedPoints,
    ) -> Result<(), Violation> {
        let old: Vec<[DVec3; 3]> = replacement.old.iter().map(|&f| self.corners(f)).collect();
        let old: Vec<BoxedFace> = old.into_iter().map(BoxedFace::new).collect();
        let new: Vec<BoxedFace> = new.iter().copied().map(BoxedFace::new).collect();
        let margin = enclosed.largest_clearance;
        let around = old.iter().fold(Aabb::EMPTY, |b, face| b.union(&face.around));
        let around = new.iter().fold(around, |b, face| b.union(&face.around.grown(margin)));
        let some = enclosed.points.len().div_ceil(STRIDE);
        let (first, others) = enclosed.points.split_at(some);
        let (first_clearances, other_clearances) = enclosed.clearances.split_at(some);
        let halves = [(first, first_clearances), (others, other_clearances)];
        for (tree, points) in enclosed.trees.iter().zip(halves) {
            let worst = uncovered(tree, points, [&old, &new], margin, &around);
            if worst > 0.0 {
                return Err(Violation::Uncovered(worst));
            }
        }
        Ok(())
    }

    fn check_intersections(&self, replacement: &FaceReplacement, new: &[[DVec3; 3]]) -> Result<(), Violation> {
        let boxes: Vec<Aabb> = new.iter().map(|&t| Aabb::around(t)).collect();
        let around = boxes.iter().fold(Aabb::EMPTY, |b, t| b.union(t));
        let clear = self.tree.visit(&around, |other| {
            if self.is_removed(other) {
                return true;
            }
            let corners @ [a, b, c] = self.corners(other);
            let other_box = Aabb { low: a.min(b).min(c), high: a.max(b).max(c) };
            if !around.overlaps(&other_box) || replacement.old.contains(&other) {
                return true;
            }
            (0..new.len()).all(|i| {
                let ids = [replacement.new[i], self.faces[other as usize]];
                !boxes[i].overlaps(&other_box) || !cut_each_other(ids, [new[i], corners], [&boxes[i], &other_box])
            })
        });
        let cut = |i: usize, j: usize| {
            cut_each_other([replacement.new[i], replacement.new[j]], [new[i], new[j]], [&boxes[i], &boxes[j]])
        };
        if !clear || (0..new.len()).any(|i| (0..i).any(|j| cut(i, j))) {
            return Err(Violation::Intersecting);
        }
        Ok(())
    }

    /// Applies a replacement, of as many new faces as old ones at most.
    pub(super) fn apply(&mut self, replacement: &FaceReplacement) {
        if let Some((vertex, to)) = replacement.moved {
            self.positions[vertex as usize] = to;
        }
        for &f in &replacement.old {
            for v in self.faces[f as usize] {
                self.around[v as usize].retain(|&g| g != f);
            }
        }
        for (i, &f) in replacement.old.iter().enumerate() {
            let face = replacement.new.get(i).copied().unwrap_or(REMOVED);
            self.faces[f as usize] = face;
            if face != REMOVED {
                face.iter().for_each(|&v| self.around[v as usize].push(f));
            }
        }
        let (faces, positions) = (&self.faces, &self.positions);
        for &f in &replacement.old {
            self.tree.refit_item(f, |g| match faces[g as usize] {
                REMOVED => Aabb::EMPTY,
                face => Aabb::around(face.map(|v| positions[v as usize])),
            });
        }
    }

    /// The vertices still in use, with their old numbers, and the faces over them.
    pub(super) fn compacted(&self) -> (Vec<u32>, Vec<[u32; 3]>) {
        let used: Vec<u32> = (0..self.around.len() as u32).filter(|&v| !self.around[v as usize].is_empty()).collect();
        let mut new = vec![u32::MAX; self.around.len()];
        used.iter().enumerate().for_each(|(i, &v)| new[v as usize] = i as u32);
        let faces = self.faces.iter().filter(|&&f| f != REMOVED).map(|f| f.map(|v| new[v as usize])).collect();
        (used, faces)
    }
}

/// Shape of a triangle: 1 where it is equilateral, 0 where it has no area.
pub(super) fn quality([a, b, c]: [DVec3; 3]) -> f64 {
    let edges = (b - a).length_squared() + (c - b).length_squared() + (a - c).length_squared();
    2.0 * 3.0_f64.sqrt() * (b - a).cross(c - a).length() / edges.max(f64::MIN_POSITIVE)
}

/// Unit normal, or zero for a triangle without area.
pub(super) fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

/// Whether two faces in these boxes cut each other. Around a shared vertex most do not: the edges
/// across from it lie outside the other's box.
fn cut_each_other(ids: [[u32; 3]; 2], corners: [[DVec3; 3]; 2], boxes: [&Aabb; 2]) -> bool {
    let is_apart = |k: usize| {
        let (mut own, mut edge) = (0, Aabb::EMPTY);
        for (id, p) in ids[k].iter().zip(corners[k]) {
            if !ids[1 - k].contains(id) {
                own += 1;
                edge = Aabb { low: edge.low.min(p), high: edge.high.max(p) };
            }
        }
        own == 2 && !edge.overlaps(boxes[1 - k])
    };
    !(is_apart(0) && is_apart(1)) && triangles_intersect(ids, corners)
}

/// A face with what tells soon that a point is far from it.
struct BoxedFace {
    corners: [DVec3; 3],
    around: Aabb,
    /// Normal of twice the area, and its square; infinite for a sliver, whose plane rounding turns.
    normal: DVec3,
    normal2: f64,
}

impl BoxedFace {
    fn new(corners: [DVec3; 3]) -> Self {
        let [ab, ac] = [corners[1] - corners[0], corners[2] - corners[0]];
        let normal = ab.cross(ac);
        let longest2 = ab.length_squared().max(ac.length_squared());
        let (area2, least) = (normal.length_squared(), 1e-12 * longest2 * longest2);
        let normal2 = if area2 > least { area2 } else { f64::INFINITY };
        Self { corners, around: Aabb::around(corners), normal, normal2 }
    }

    /// Whether a point is certainly not within a distance of the face, by its plane.
    fn is_plane_farther(&self, p: DVec3, distance: f64) -> bool {
        let away = self.normal.dot(p - self.corners[0]);
        away * away > 1.002 * distance * distance * self.normal2
    }

    /// [`crossing`], at once 0 for points that the face's box does not lie ahead of.
    fn crossing(&self, p: DVec3) -> i32 {
        let Aabb { low, high } = self.around;
        let misses = (p.y < low.y) | (p.y > high.y) | (p.z < low.z) | (p.z > high.z) | (p.x > high.x);
        if misses { 0 } else { crossing(p, self.corners) }
    }
}

/// How far the worst of some points is outside or too close once `old` faces are `new`; `margin` is
/// the largest clearance, and `around` is around all, and so far around the new.
fn uncovered(
    tree: &Bvh,
    (points, clearances): (&[DVec3], &[f64]),
    [old, new]: [&[BoxedFace]; 2],
    margin: f64,
    around: &Aabb,
) -> f64 {
    let boxes: Vec<Aabb> = new.iter().map(|face| face.around.grown(margin)).collect();
    let mut worst = 0.0_f64;
    tree.visit(around, |i| {
        let (p, clearance) = (points[i as usize], clearances[i as usize]);
        if around.distance2(p) > 0.0 {
            return true;
        }
        let leaves = |faces: &[BoxedFace]| faces.iter().map(|face| face.crossing(p)).sum::<i32>();
        if leaves(new) < leaves(old) {
            let depth2 = new.iter().map(|face| point_triangle2(p, face.corners)).fold(f64::INFINITY, f64::min);
            worst = worst.max(clearance + depth2.sqrt());
            return true;
        }
        let mut near2 = f64::INFINITY;
        for (face, b) in new.iter().zip(&boxes) {
            if b.distance2(p) == 0.0 && !face.is_plane_farther(p, clearance) {
                near2 = near2.min(point_triangle2(p, face.corners));
            }
        }
        if near2 < clearance * clearance {
            worst = worst.max(clearance - near2.sqrt());
        }
        true
    });
    worst
}
