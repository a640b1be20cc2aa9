//! The offset surface of a model: the boundary of all points closer than a distance, with cavities filled, holes closed by the winding number, and
//! components joined by tubes.

use super::lattice::Lattice;
use super::source::NormalizedModel;
use crate::geometry::distance::{closest_on_segment, point_triangle2};
use crate::geometry::{Aabb, GeneralizedWinding};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::VecDeque;

/// Spacing of the lattice over the offset. A distance interpolated in a tetrahedron is at most its circumradius, √5/4 of the spacing,
/// at points of the model: below 4/√5 every point of the model is inside.
const SPACING: f64 = 1.3;

/// A closed surface at a distance from the model; one component, or with `per_part` as many as there are. `None` where it would have
/// more than `most_parts` before they are joined.
pub(super) fn offset_surface(
    source: &NormalizedModel,
    distance: f64,
    per_part: bool,
    most_parts: usize,
) -> Option<(Vec<DVec3>, Vec<[u32; 3]>)> {
    let spacing = SPACING * distance;
    let bounds = source.surface.tree.bounds().grown(distance + 2.0 * spacing);
    let lattice = Lattice::over(&bounds, spacing);
    let mut values = distances(source, &lattice, distance, spacing);
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
        for [from, to] in shortest_links(&lattice, &labels, parts) {
            add_tube(source, &lattice, [from, to], distance, &mut values);
        }
    }
    Some(lattice.surface(&values))
}

/// Distance less `distance` at every node, negative inside.
fn distances(source: &NormalizedModel, lattice: &Lattice, distance: f64, spacing: f64) -> Vec<f64> {
    let reach = distance + 1.1 * spacing;
    let within = source.surface.tree.bounds();
    let winding = source.open.then(|| GeneralizedWinding::new(&source.surface));
    let value = |node: usize| {
        let p = lattice.position(node);
        let limit = reach * reach;
        let nearest = source.surface.tree.nearest(p, limit, |f| point_triangle2(p, source.surface.corners(f)));
        let value = nearest.map_or(reach, |(_, d2)| d2.sqrt()) - distance;
        match &winding {
            Some(winding) if value >= 0.0 && within.distance2(p) == 0.0 => {
                value.min(8.0 * spacing * (0.5 - winding.at(p).abs()))
            }
            _ => value,
        }
    };
    (0..lattice.len()).into_par_iter().with_min_len(512).map(value).collect()
}

/// Marks as inside everything that cannot be reached from the border.
fn fill_cavities(lattice: &Lattice, values: &mut [f64]) {
    let mut reached = vec![false; values.len()];
    reached[0] = true;
    let mut stack = vec![0];
    while let Some(node) = stack.pop() {
        for next in lattice.neighbours(node) {
            if !reached[next] && values[next] >= 0.0 {
                reached[next] = true;
                stack.push(next);
            }
        }
    }
    for (value, reached) in values.iter_mut().zip(reached) {
        if !reached && *value >= 0.0 {
            *value = -1e-3;
        }
    }
}

const NONE: u32 = u32::MAX;

/// Labels the connected parts of the inside. Parts that hold nothing of the model, which winding numbers of badly oriented faces produce, are
/// discarded.
fn components(lattice: &Lattice, source: &NormalizedModel, distance: f64, values: &mut [f64]) -> (Vec<u32>, u32) {
    let mut labels = vec![NONE; values.len()];
    let mut parts = 0;
    for start in 0..values.len() {
        if values[start] >= 0.0 || labels[start] != NONE {
            continue;
        }
        labels[start] = parts;
        let mut members = vec![start];
        let mut done = 0;
        let mut holds_model = false;
        while done < members.len() {
            let node = members[done];
            done += 1;
            holds_model = holds_model || {
                let p = lattice.position(node);
                source.surface.distance_within(p, distance).is_some()
            };
            for next in lattice.neighbours(node) {
                if labels[next] == NONE && values[next] < 0.0 {
                    labels[next] = parts;
                    members.push(next);
                }
            }
        }
        if holds_model {
            parts += 1;
        } else {
            for node in members {
                labels[node] = NONE;
                values[node] = distance;
            }
        }
    }
    (labels, parts)
}

/// Pairs of nodes whose links join all parts: a minimum spanning tree over links between parts that meet when all grow at once.
fn shortest_links(lattice: &Lattice, labels: &[u32], parts: u32) -> Vec<[usize; 2]> {
    let mut origin: Vec<u32> =
        labels.iter().enumerate().map(|(i, &l)| if l == NONE { NONE } else { i as u32 }).collect();
    let mut queue: VecDeque<usize> = (0..labels.len()).filter(|&i| labels[i] != NONE).collect();
    let mut links = Vec::new();
    while let Some(node) = queue.pop_front() {
        let from = origin[node];
        for next in lattice.neighbours(node) {
            let to = origin[next];
            if to == NONE {
                origin[next] = from;
                queue.push_back(next);
            } else if labels[from as usize] < labels[to as usize] {
                let length = lattice.position(from as usize).distance_squared(lattice.position(to as usize));
                links.push((length, labels[from as usize], labels[to as usize], from, to));
            }
        }
    }
    links.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.3, a.4).cmp(&(b.3, b.4))));
    let mut group: Vec<u32> = (0..parts).collect();
    let mut tree = Vec::new();
    for (_, a, b, from, to) in links {
        let (a, b) = (root(&mut group, a), root(&mut group, b));
        if a != b {
            group[a.max(b) as usize] = a.min(b);
            tree.push([from as usize, to as usize]);
        }
    }
    tree
}

fn root(group: &mut [u32], mut part: u32) -> u32 {
    while group[part as usize] != part {
        group[part as usize] = group[group[part as usize] as usize];
        part = group[part as usize];
    }
    part
}

/// Puts a tube as thick as the offset between the points of the model nearest to two nodes.
fn add_tube(source: &NormalizedModel, lattice: &Lattice, nodes: [usize; 2], distance: f64, values: &mut [f64]) {
    let ends = nodes.map(|n| lattice.position(n));
    let nearest = ends.map(|p| source.surface.nearest(p).map_or(p, |n| n.point));
    for [a, b] in [[ends[0], nearest[0]], [nearest[0], nearest[1]], [nearest[1], ends[1]]] {
        let around = Aabb::around([a, b]).grown(3.0 * distance);
        for node in lattice.nodes_in(&around) {
            let p = lattice.position(node);
            let value = a.lerp(b, closest_on_segment(p, a, b)).distance(p) - distance;
            values[node] = values[node].min(value);
        }
    }
}
