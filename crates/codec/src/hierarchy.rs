//! An order of a mesh's vertices from coarse to fine, each predicted from neighbours before it.
//!
//! Independent vertices are taken away round by round, those of few neighbours first, and the
//! neighbours of each are joined to the one of them that has the fewest.

use cager_geometry::mesh::Polygons;
use cager_geometry::topology::Adjacency;
use std::collections::BTreeSet;

/// Rounds end when so few vertices are left; these are not predicted.
const COARSEST: usize = 48;
/// Vertices of a patch of a [part](Hierarchy::part), about.
const PATCH: usize = 512;

/// Vertices from coarse to fine.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    /// The vertex at each place.
    order: Vec<u32>,
    /// `parents[starts[k]..starts[k + 1]]` are the places of what predicts the vertex at place k.
    parents: Vec<u32>,
    starts: Vec<u32>,
}

impl Hierarchy {
    /// Of the vertices of these faces; without an edge a vertex is not predicted.
    pub fn new(faces: &Polygons, points: usize) -> Self {
        let adjacency = Adjacency::new(faces, points);
        let mut near: Vec<Near> = (0..points).map(|v| Near::new(adjacency.of(v))).collect();
        // Who has no neighbours never gets any again: rounds are over the others alone.
        let (mut left, mut alone): (Vec<u32>, Vec<u32>) = (0..points as u32).partition(|&v| near[v as usize].len() > 0);
        let mut by_size: Vec<u64> = Vec::with_capacity(left.len());
        let mut removed: Vec<(u32, Vec<u32>)> = Vec::with_capacity(left.len());
        let mut blocked = vec![0u32; points];
        let mut gone = vec![false; points];
        let mut round = 0;
        while left.len() + alone.len() > COARSEST && !left.is_empty() {
            round += 1;
            // The number of neighbours, then the vertex, as one number.
            by_size.clear();
            by_size.extend(left.iter().map(|&v| (near[v as usize].len() as u64) << 32 | u64::from(v)));
            by_size.sort_unstable();
            let before = removed.len();
            for v in by_size.iter().map(|&numbers| numbers as u32) {
                if blocked[v as usize] != round {
                    near[v as usize].for_each(|w| blocked[w as usize] = round);
                    blocked[v as usize] = round;
                    gone[v as usize] = true;
                    removed.push((v, Vec::new()));
                }
            }
            for (v, parents) in &mut removed[before..] {
                *parents = std::mem::replace(&mut near[*v as usize], Near::Few(Vec::new())).into_vec();
                join(&mut near, *v, parents);
            }
            left.retain(|&v| {
                let is_alone = near[v as usize].len() == 0;
                if is_alone && !gone[v as usize] {
                    alone.push(v);
                }
                !is_alone
            });
        }
        left.extend(alone);
        left.sort_unstable();
        let mut hierarchy = Self { starts: vec![0; left.len() + 1], order: left, parents: Vec::new() };
        hierarchy.order.extend(removed.iter().rev().map(|(v, _)| v));
        let mut places = vec![0; points];
        hierarchy.order.iter().enumerate().for_each(|(place, &v)| places[v as usize] = place as u32);
        for (_, parents) in removed.iter().rev() {
            hierarchy.parents.extend(parents.iter().map(|&parent| places[parent as usize]));
            hierarchy.starts.push(hierarchy.parents.len() as u32);
        }
        hierarchy
    }

    /// Number of vertices.
    pub fn points(&self) -> usize {
        self.order.len()
    }

    /// About one in `every` vertices, in whole patches of the mesh, with their numbers here.
    pub fn part(&self, every: usize) -> (Self, Vec<u32>) {
        // A patch is what follows by the first parents from one of the first places.
        let all = 0..self.points();
        let roots = all.clone().filter(|&place| self.parents(place).is_empty()).count();
        let patches = roots + self.points() / PATCH;
        let mut patch = vec![0usize; self.points()];
        for place in all.clone() {
            let first = self.parents(place).first().filter(|_| place >= patches);
            patch[place] = first.map_or(place, |&parent| patch[parent as usize]);
        }
        let mut sizes = vec![0; self.points()];
        patch.iter().for_each(|&patch| sizes[patch] += 1);
        // One whenever fewer than one in `every` points were chosen so far.
        let (mut seen, mut chosen) = (0, 0);
        let is_patch_chosen: Vec<bool> = sizes
            .iter()
            .map(|&size| {
                let is_chosen = chosen * every <= seen;
                seen += size;
                chosen += if is_chosen { size } else { 0 };
                is_chosen
            })
            .collect();
        let places: Vec<usize> = all.filter(|&place| is_patch_chosen[patch[place]]).collect();
        let mut vertices: Vec<u32> = places.iter().map(|&place| self.order[place]).collect();
        vertices.sort_unstable();
        let number = |vertex: u32| vertices.partition_point(|&v| v < vertex) as u32;
        let order = places.iter().map(|&place| number(self.order[place])).collect();
        let mut part = Self { order, starts: vec![0], parents: Vec::new() };
        for &place in &places {
            let parents = self.parents(place).iter();
            part.parents.extend(parents.filter_map(|&p| Some(places.binary_search(&(p as usize)).ok()? as u32)));
            part.starts.push(part.parents.len() as u32);
        }
        (part, vertices)
    }

    /// The vertices in order.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// The places of the vertices that predict the one at this place, all before it.
    #[inline(always)]
    pub(crate) fn parents(&self, place: usize) -> &[u32] {
        &self.parents[self.starts[place] as usize..self.starts[place + 1] as usize]
    }
}

/// The neighbours of a vertex, ascending; hubs have too many for a plain list.
enum Near {
    Few(Vec<u32>),
    Many(BTreeSet<u32>),
}

/// Most neighbours in a plain list.
const FEW: usize = 128;

impl Near {
    fn new(list: &[u32]) -> Self {
        if list.len() <= FEW { Self::Few(list.to_vec()) } else { Self::Many(list.iter().copied().collect()) }
    }

    fn len(&self) -> usize {
        match self {
            Self::Few(list) => list.len(),
            Self::Many(set) => set.len(),
        }
    }

    fn for_each(&self, f: impl FnMut(u32)) {
        match self {
            Self::Few(list) => list.iter().copied().for_each(f),
            Self::Many(set) => set.iter().copied().for_each(f),
        }
    }

    fn into_vec(self) -> Vec<u32> {
        match self {
            Self::Few(list) => list,
            Self::Many(set) => set.into_iter().collect(),
        }
    }

    fn remove(&mut self, v: u32) {
        match self {
            Self::Few(list) => {
                if let Ok(place) = list.binary_search(&v) {
                    list.remove(place);
                }
            }
            Self::Many(set) => {
                set.remove(&v);
            }
        }
    }

    fn insert(&mut self, v: u32) {
        match self {
            Self::Few(list) => {
                if let Err(place) = list.binary_search(&v) {
                    list.insert(place, v);
                    if list.len() > FEW {
                        *self = Self::Many(std::mem::take(list).into_iter().collect());
                    }
                }
            }
            Self::Many(set) => {
                set.insert(v);
            }
        }
    }
}

/// Takes v from the lists of its neighbours and joins these to the one that has the fewest.
fn join(near: &mut [Near], v: u32, neighbours: &[u32]) {
    for &w in neighbours {
        near[w as usize].remove(v);
    }
    let Some(&hub) = neighbours.iter().min_by_key(|&&w| (near[w as usize].len(), w)) else { return };
    for &w in neighbours {
        if w != hub {
            near[hub as usize].insert(w);
            near[w as usize].insert(hub);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vertex_comes_once_and_after_those_that_predict_it() {
        let side = 30u32;
        let mut faces = Polygons::new();
        for (i, j) in (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| i * side + j;
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        let points = (side * side) as usize + 7;
        let hierarchy = Hierarchy::new(&faces, points);
        let mut vertices = hierarchy.order().to_vec();
        vertices.sort_unstable();
        assert!(vertices.iter().enumerate().all(|(k, &v)| k == v as usize) && vertices.len() == points);
        let parents = (0..points).map(|place| hierarchy.parents(place));
        assert!(parents.clone().enumerate().all(|(place, parents)| parents.iter().all(|&p| (p as usize) < place)));
        assert!(parents.filter(|parents| !parents.is_empty()).count() >= points - COARSEST - 7);
    }

    #[test]
    fn a_part_has_its_share_of_the_points_whatever_else_is_there() {
        let side = 120u32;
        for (before, after) in [(0, 0), (60, 0), (0, 61), (400, 0)] {
            let mut faces = Polygons::new();
            for (i, j) in (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j))) {
                let at = |i: u32, j: u32| before + i * side + j;
                faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
            let points = (before + side * side + after) as usize;
            let hierarchy = Hierarchy::new(&faces, points);
            let names = |of: &Hierarchy, place: usize| -> Vec<u32> {
                of.parents(place).iter().map(|&p| of.order()[p as usize]).collect()
            };
            let mut whole = vec![Vec::new(); points];
            (0..points).for_each(|place| whole[hierarchy.order()[place] as usize] = names(&hierarchy, place));
            for every in [2, 5] {
                let (part, vertices) = hierarchy.part(every);
                let share = points / every;
                assert!(part.points() == vertices.len() && vertices.is_sorted());
                assert!(
                    (share / 2..2 * share).contains(&vertices.len()),
                    "{before} {after}: {} of {points}",
                    vertices.len()
                );
                for (place, &vertex) in part.order().iter().enumerate() {
                    let (parents, whole) = (names(&part, place), &whole[vertices[vertex as usize] as usize]);
                    assert!(
                        parents.len() <= whole.len() && parents.iter().all(|&p| whole.contains(&vertices[p as usize]))
                    );
                }
            }
        }
    }

    #[test]
    fn hubs_and_vertices_alone_have_their_places() {
        let (leaves, clique) = (500_000u32, 300);
        let mut faces = Polygons::new();
        (0..leaves).for_each(|k| faces.push(&[0, 2 * k + 1, 2 * k + 2]));
        let first = 2 * leaves + 1;
        (0..clique).for_each(|a| (0..a).for_each(|b| faces.push(&[first + a, first + b])));
        let points = (first + clique + 500_000) as usize;
        let hierarchy = Hierarchy::new(&faces, points);
        assert_eq!(hierarchy.points(), points);
        let before = |place: usize| hierarchy.parents(place).iter().all(|&parent| (parent as usize) < place);
        assert!((0..points).all(before), "a vertex is predicted from one that follows it");
    }
}
