//! The offset surface of a model, with cavities filled, holes closed by the winding number, and
//! components joined by tubes.

use super::gap_offset::Offset;
use super::gaps::balls_in_gaps;
use super::lattice::{Lattice, Octree};
use super::level_set::level_set;
use super::source::NormalizedModel;
use cager_geometry::spatial::distance::closest_on_segment;
use cager_geometry::spatial::{Aabb, Bvh, GeneralizedWinding};
use cager_geometry::topology::UnionFind;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::VecDeque;

/// Side of the lattice's cubes over the offset. A distance interpolated in a tetrahedron is at most
/// its circumradius, √5/4 of the side, at points of the model: below 4/√5 every point is inside.
/// The offset at a cube's centre stands for that around it, at most 0.43 of the side less; what
/// this leaves uncovered is found when the cage is verified.
const SPACING: f64 = 1.3;

/// The same offset everywhere, and the lattice's cubes.
pub(super) fn uniform_offset(source: &NormalizedModel, largest: f64) -> (Offset, Octree) {
    let spacing = SPACING * largest;
    let bounds = source.surface.tree.bounds().grown(largest + 2.0 * spacing);
    (Offset::uniform(largest), Octree::uniform(&bounds, spacing))
}

/// The offset that keeps gaps open, at least `least`, and the lattice's cubes. `None` where more
/// than `most` would be halved, or too many places looked at.
pub(super) fn offset_with_gaps(
    source: &NormalizedModel,
    largest: f64,
    least: f64,
    most: usize,
) -> Option<(Offset, Octree)> {
    // No gap can be kept open at a half of it.
    if 0.5 * largest < least {
        return Some(uniform_offset(source, largest));
    }
    let offset = Offset::around(&balls_in_gaps(source, largest)?, largest, least);
    let (_, mut cubes) = uniform_offset(source, largest);
    let is_too_large = |center: DVec3, side: f64| {
        let offset = offset.at(center);
        side > 1.001 * SPACING * offset && source.surface.distance_within(center, offset + side).is_some()
    };
    cubes.refine(most, is_too_large).then_some((offset, cubes))
}

/// A closed surface at a distance from the model, in one component unless `per_part`; `None` of
/// more than `most_parts`.
pub(super) fn offset_surface(
    source: &NormalizedModel,
    offset: &Offset,
    cubes: &Octree,
    per_part: bool,
    most_parts: usize,
) -> Option<(Vec<DVec3>, Vec<[u32; 3]>)> {
    let distance = offset.largest;
    let lattice = Lattice::of(cubes);
    let mut values = distances(source, &lattice, offset);
    // Each round joins all parts that were apart; a second one is rare.
    for _ in 0..4 {
        fill_cavities(&lattice, &mut values);
        let (labels, parts) = components(&lattice, source, distance, &mut values);
        if parts as usize > most_parts {
            return None;
        }
        if parts <= 1 || per_part {
            break;
        }
        add_tubes(source, &lattice, &shortest_links(&lattice, &labels, parts), distance, &mut values);
    }
    Some(level_set(&lattice, &values))
}

/// Distance less the offset at every node, negative inside.
fn distances(source: &NormalizedModel, lattice: &Lattice, offset: &Offset) -> Vec<f64> {
    let spacing = SPACING * offset.largest;
    let within = source.surface.tree.bounds();
    let winding = source.open.then(|| GeneralizedWinding::new(&source.surface));
    let value = |&p: &DVec3| {
        let offset = offset.at(p);
        let reach = offset + 1.1 * spacing;
        let value = source.surface.distance_within(p, reach).unwrap_or(reach) - offset;
        match &winding {
            Some(winding) if value >= 0.0 && within.distance2(p) == 0.0 => {
                value.min(8.0 * spacing * (0.5 - winding.at(p).abs()))
            }
            _ => value,
        }
    };
    lattice.positions.par_iter().with_min_len(512).map(value).collect()
}

/// For each node, the first of those of its sign that edges of the lattice join with it.
fn groups(lattice: &Lattice, values: &[f64]) -> Vec<u32> {
    let mut groups = UnionFind::new(values.len());
    for t in &lattice.tetrahedra {
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            if (values[t[i] as usize] < 0.0) == (values[t[j] as usize] < 0.0) {
                groups.join(t[i], t[j]);
            }
        }
    }
    (0..values.len() as u32).map(|node| groups.root(node)).collect()
}

/// Marks as inside everything that cannot be reached from the border.
fn fill_cavities(lattice: &Lattice, values: &mut [f64]) {
    let group = groups(lattice, values);
    let outside = group[lattice.outermost as usize];
    for (value, group) in values.iter_mut().zip(group) {
        if group != outside && *value >= 0.0 {
            *value = -1e-3;
        }
    }
}

const NONE: u32 = u32::MAX;

/// Labels the connected parts of the inside. Those that hold nothing of the model are discarded.
fn components(lattice: &Lattice, source: &NormalizedModel, distance: f64, values: &mut [f64]) -> (Vec<u32>, u32) {
    let group = groups(lattice, values);
    let mut holds_model = vec![false; values.len()];
    for node in 0..values.len() {
        let holds = &mut holds_model[group[node] as usize];
        *holds =
            *holds || values[node] < 0.0 && source.surface.distance_within(lattice.positions[node], distance).is_some();
    }
    let mut labels = vec![NONE; values.len()];
    let mut parts = 0;
    for node in 0..values.len() {
        let first = group[node] as usize;
        if values[node] >= 0.0 {
            continue;
        }
        if !holds_model[first] {
            values[node] = distance;
        } else if first == node {
            labels[node] = parts;
            parts += 1;
        } else {
            labels[node] = labels[first];
        }
    }
    (labels, parts)
}

/// Links that join all parts: a minimum spanning tree over those that meet when all grow at once.
fn shortest_links(lattice: &Lattice, labels: &[u32], parts: u32) -> Vec<[usize; 2]> {
    let mut origin: Vec<u32> =
        labels.iter().enumerate().map(|(i, &l)| if l == NONE { NONE } else { i as u32 }).collect();
    let mut queue: VecDeque<usize> = (0..labels.len()).filter(|&i| labels[i] != NONE).collect();
    let mut links = Vec::new();
    let (starts, neighbours) = lattice.neighbours();
    while let Some(node) = queue.pop_front() {
        let from = origin[node];
        // Ascending, and each as often as tetrahedra share the edge.
        for edge in neighbours[starts[node]..starts[node + 1]].chunk_by(|a, b| a == b) {
            let next = edge[0];
            let to = origin[next as usize];
            if to == NONE {
                origin[next as usize] = from;
                queue.push_back(next as usize);
            } else if labels[from as usize] < labels[to as usize] {
                let [a, b] = [from, to].map(|node| lattice.positions[node as usize]);
                let length = a.distance_squared(b);
                links.push((length, labels[from as usize], labels[to as usize], from, to));
            }
        }
    }
    links.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.3, a.4).cmp(&(b.3, b.4))));
    let mut joined = UnionFind::new(parts as usize);
    let mut tree = Vec::new();
    for (_, a, b, from, to) in links {
        if joined.join(a, b) {
            tree.push([from as usize, to as usize]);
        }
    }
    tree
}

/// Puts tubes between the points of the model nearest to the nodes of each link.
fn add_tubes(source: &NormalizedModel, lattice: &Lattice, links: &[[usize; 2]], distance: f64, values: &mut [f64]) {
    let segments_of = |nodes: &[usize; 2]| {
        let ends = nodes.map(|n| lattice.positions[n]);
        let nearest = ends.map(|p| source.surface.nearest(p).map_or(p, |n| n.point));
        [[ends[0], nearest[0]], [nearest[0], nearest[1]], [nearest[1], ends[1]]]
    };
    let segments: Vec<[DVec3; 2]> = links.iter().flat_map(segments_of).collect();
    let boxes: Vec<Aabb> = segments.iter().map(|&ends| Aabb::around(ends).grown(3.0 * distance)).collect();
    let tubes = Bvh::new(&boxes);
    values.par_iter_mut().zip(&lattice.positions).with_min_len(4096).for_each(|(value, &p)| {
        tubes.visit(&Aabb { low: p, high: p }, |tube| {
            if boxes[tube as usize].distance2(p) == 0.0 {
                let [a, b] = segments[tube as usize];
                *value = value.min(a.lerp(b, closest_on_segment(p, a, b)).distance(p) - distance);
            }
            true
        });
    });
}
