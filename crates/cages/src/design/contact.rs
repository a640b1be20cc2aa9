//! Constrained moves that keep a cage enclosing and free of self-intersection.
//!
//! Before each move, pairs of nearby features are collected: points and faces, vertices and faces,
//! edges and edges, corners and opposite edges. The desired move is projected so that every pair,
//! linearised, keeps its minimum distance. Then each vertex moves by at most a fraction of the
//! distance of its pairs, less than half where both sides move, so that no pair can meet.

use super::symmetry::Symmetry;
use cager_core::cage::Cage;
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::distance::{closest_on_segment, closest_on_segments, closest_on_triangle};
use cager_geometry::spatial::{Aabb, Bvh, Surface, triangles_intersect};
use glam::DVec3;
use rayon::prelude::*;

/// Fraction of a pair's distance that a vertex may move, where both sides do, and where one is
/// fixed.
const SHARE: f64 = 0.45;
const SHARE_OF_FIXED: f64 = 0.9;
/// The same of a corner's own distance where it is not at the nearest point: `0.9 + 0.4 t ≤ √(1 +
/// t²)`, so points between it and one there do not meet the other feature either.
const SHARE_OF_FAR: f64 = 0.2;
/// Sweeps of corrections.
const SWEEPS: usize = 4;

/// Least distances, in the model's unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Distances {
    /// Between the model's points and faces.
    pub(super) clearance: f64,
    /// Between parts of the cage; `None` where self-intersection is allowed.
    pub(super) gap: Option<f64>,
}

/// What a cage must keep its distance from: the model's points and, if required, itself.
pub(super) struct Obstacles {
    points: Vec<DVec3>,
    tree: Bvh,
    distances: Distances,
    symmetry: Option<Symmetry>,
}

/// Two features near each other, at the distance `normal · (Σ weight x)` less `at_rest`.
struct Pair {
    /// Its vertices, the first `used` of them.
    vertices: [u32; 4],
    used: usize,
    weights: [f64; 4],
    normal: DVec3,
    at_rest: f64,
    distance: f64,
    least: f64,
    share: f64,
}

impl Obstacles {
    /// Whether new faces cut no other face, and no point of the model changes sides.
    pub(super) fn allow(&self, mesh: &TriMesh, old: &[[u32; 3]], new: &[[u32; 3]]) -> bool {
        let at = |t: [u32; 3]| t.map(|v| DVec3::from(mesh.vertices[v as usize]));
        let around = Aabb::around(old.iter().flat_map(|&t| at(t)));
        if self.distances.gap.is_some() {
            let kept = mesh.triangles.iter().filter(|t| !old.contains(t));
            let near: Vec<[u32; 3]> = kept.copied().filter(|&t| Aabb::around(at(t)).overlaps(&around)).collect();
            let cuts = |f: [u32; 3], g: [u32; 3]| triangles_intersect([f, g], [at(f), at(g)]);
            let among = |(i, &f): (usize, &[u32; 3])| new[..i].iter().any(|&g| cuts(f, g));
            if new.iter().any(|&f| near.iter().any(|&g| cuts(f, g))) || new.iter().enumerate().any(among) {
                return false;
            }
        }
        // Old faces and new ones turned around enclose what changes sides.
        let between = old.iter().copied().chain(new.iter().map(|&[a, b, c]| [a, c, b])).collect();
        let vertices = mesh.vertices.iter().map(|&v| v.into()).collect();
        let between = Surface::new(vertices, between);
        self.tree.visit(&around, |i| {
            let p = self.points[i as usize];
            between.winding(p) == 0 && between.distance_within(p, 0.25 * self.distances.clearance).is_none()
        })
    }

    pub(super) fn new(points: Vec<DVec3>, distances: Distances, symmetry: Option<Symmetry>) -> Self {
        Self { tree: Self::tree(&points), points, distances, symmetry }
    }

    /// Adds points.
    pub(super) fn add(&mut self, points: impl Iterator<Item = Point>) {
        self.points.extend(points.map(DVec3::from));
        self.tree = Self::tree(&self.points);
    }

    fn tree(points: &[DVec3]) -> Bvh {
        let boxes: Vec<Aabb> = points.iter().map(|&p| Aabb { low: p, high: p }).collect();
        Bvh::new(&boxes)
    }

    /// The vertices after the move nearest to the desired one that the obstacles allow.
    pub(super) fn moved(&self, cage: &Cage, desired_moves: &[DVec3]) -> Vec<DVec3> {
        let x: Vec<DVec3> = cage.vertices().iter().map(|&v| v.into()).collect();
        let longest = desired_moves.iter().map(|w| w.length()).fold(0.0, f64::max);
        let reach = (2.0 * longest).max(self.distances.gap.unwrap_or(0.0)).max(self.distances.clearance) / SHARE;
        let pairs = self.pairs(cage, &x, reach);
        let mut moves = desired_moves.to_vec();
        for _ in 0..SWEEPS {
            for pair in &pairs {
                pair.correct(&x, &mut moves);
            }
        }
        let mut most = vec![SHARE * reach; x.len()];
        for pair in &pairs {
            let middle = pair.middle(&x);
            for k in 0..pair.used {
                let v = pair.vertices[k] as usize;
                // Vertices of zero weight at the nearest points are farther away and may move more.
                let own = if pair.weights[k] == 0.0 {
                    SHARE_OF_FAR * (x[v].distance(middle) - 0.5 * pair.distance).max(pair.distance)
                } else {
                    pair.share * pair.distance
                };
                most[v] = most[v].min(own);
            }
        }
        if let Some(symmetry) = &self.symmetry {
            symmetry.apply(&mut moves, &mut most);
        }
        let limited =
            moves.iter().zip(&most).map(|(m, &most)| *m * (most / m.length().max(f64::MIN_POSITIVE)).min(1.0));
        x.iter().zip(limited).map(|(&x, m)| x + m).collect()
    }

    fn pairs(&self, cage: &Cage, x: &[DVec3], reach: f64) -> Vec<Pair> {
        let faces = cage.faces();
        let corners = |f: usize| faces[f].vertices.map(|v| x[v as usize]);
        let boxes: Vec<Aabb> = (0..faces.len()).map(|f| Aabb::around(corners(f))).collect();
        let fixed = Limits { reach, least: self.distances.clearance, share: SHARE_OF_FIXED };
        let with_points = |f: usize| {
            let mut found = Vec::new();
            self.tree.visit(&boxes[f].grown(reach), |i| {
                let p = self.points[i as usize];
                found.extend(fixed.with_point(p, faces[f].vertices, corners(f)));
                true
            });
            found.sort_by(|a: &Pair, b| a.distance.total_cmp(&b.distance));
            found
        };
        let mut pairs: Vec<Pair> =
            (0..faces.len()).into_par_iter().with_min_len(32).flat_map_iter(with_points).collect();
        let Some(least) = self.distances.gap else { return pairs };
        let limits = Limits { reach, least, share: SHARE };
        let tree = Bvh::new(&boxes);
        let ends = |e: usize| cage.edges()[e].vertices.map(|v| x[v as usize]);
        let edge_boxes: Vec<Aabb> = (0..cage.edges().len()).map(|e| Aabb::around(ends(e))).collect();
        let edge_tree = Bvh::new(&edge_boxes);
        let with_faces = |v: usize| {
            let mut found = Vec::new();
            tree.visit(&Aabb { low: x[v], high: x[v] }.grown(reach), |f| {
                let vertices = faces[f as usize].vertices;
                if !vertices.contains(&(v as u32)) {
                    found.extend(limits.with_face(v, x[v], vertices, corners(f as usize)));
                }
                true
            });
            found
        };
        let with_edges = |e: usize| {
            let [a, b] = cage.edges()[e].vertices;
            let mut found = Vec::new();
            edge_tree.visit(&edge_boxes[e].grown(reach), |other| {
                let [c, d] = cage.edges()[other as usize].vertices;
                if other as usize > e && a != c && a != d && b != c && b != d {
                    found.extend(limits.with_edge([a, b, c, d], ends(e), ends(other as usize)));
                }
                true
            });
            found
        };
        let in_face = |f: usize| (0..3).filter_map(move |i| limits.in_face(faces[f].vertices, corners(f), i));
        pairs.par_extend((0..x.len()).into_par_iter().with_min_len(32).flat_map_iter(with_faces));
        pairs.par_extend((0..cage.edges().len()).into_par_iter().with_min_len(32).flat_map_iter(with_edges));
        pairs.extend((0..faces.len()).flat_map(in_face));
        pairs
    }
}

/// How near two features must be to count as a pair, their least distance, and the share of it that
/// each may move.
#[derive(Clone, Copy)]
struct Limits {
    reach: f64,
    least: f64,
    share: f64,
}

impl Limits {
    fn with_point(self, p: DVec3, t: [u32; 3], corners: [DVec3; 3]) -> Option<Pair> {
        let w = closest_on_triangle(p, corners);
        let nearest = w[0] * corners[0] + w[1] * corners[1] + w[2] * corners[2];
        self.pair(([t[0], t[1], t[2], 0], 3), [w[0], w[1], w[2], 0.0], nearest - p, p)
    }

    fn with_face(self, v: usize, p: DVec3, t: [u32; 3], corners: [DVec3; 3]) -> Option<Pair> {
        let w = closest_on_triangle(p, corners);
        let nearest = w[0] * corners[0] + w[1] * corners[1] + w[2] * corners[2];
        self.pair(([v as u32, t[0], t[1], t[2]], 4), [1.0, -w[0], -w[1], -w[2]], p - nearest, DVec3::ZERO)
    }

    fn with_edge(self, vertices: [u32; 4], first: [DVec3; 2], second: [DVec3; 2]) -> Option<Pair> {
        let (s, t) = closest_on_segments(first, second);
        let apart = first[0].lerp(first[1], s) - second[0].lerp(second[1], t);
        self.pair((vertices, 4), [1.0 - s, s, t - 1.0, -t], apart, DVec3::ZERO)
    }

    /// Corner i and the edge opposite.
    fn in_face(self, t: [u32; 3], corners: [DVec3; 3], i: usize) -> Option<Pair> {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let s = closest_on_segment(corners[i], corners[j], corners[k]);
        let apart = corners[i] - corners[j].lerp(corners[k], s);
        self.pair(([t[i], t[j], t[k], 0], 3), [1.0, s - 1.0, -s, 0.0], apart, DVec3::ZERO)
    }

    /// Vertices with their weights, less a fixed point.
    fn pair(self, (vertices, used): ([u32; 4], usize), weights: [f64; 4], apart: DVec3, fixed: DVec3) -> Option<Pair> {
        let Self { reach, least, share } = self;
        let distance = apart.length();
        let normal = apart / distance;
        let found = Pair { vertices, used, weights, normal, at_rest: normal.dot(fixed), distance, least, share };
        (distance < reach && normal.is_finite()).then_some(found)
    }
}

impl Pair {
    /// The middle between the nearest points.
    fn middle(&self, x: &[DVec3]) -> DVec3 {
        let ahead = |k: &usize| self.weights[*k] > 0.0;
        let nearest: DVec3 = (0..self.used).filter(ahead).map(|k| self.weights[k] * x[self.vertices[k] as usize]).sum();
        nearest - 0.5 * self.distance * self.normal
    }

    /// The smallest correction of the moves that restores the least distance of the pair.
    fn correct(&self, x: &[DVec3], moves: &mut [DVec3]) {
        let place = |k: usize| x[self.vertices[k] as usize] + moves[self.vertices[k] as usize];
        let distance: f64 = (0..4)
            .filter(|&k| self.weights[k] != 0.0)
            .map(|k| self.weights[k] * self.normal.dot(place(k)))
            .sum::<f64>()
            - self.at_rest;
        let missing = self.least - distance;
        if missing > 0.0 {
            let sum: f64 = self.weights.iter().map(|w| w * w).sum();
            for k in 0..4 {
                if self.weights[k] != 0.0 {
                    moves[self.vertices[k] as usize] += self.normal * (self.weights[k] * missing / sum);
                }
            }
        }
    }
}
