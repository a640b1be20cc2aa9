//! An order of a mesh's vertices from coarse to fine, in which each is predicted from neighbours on the mesh that come before it.
//!
//! Independent vertices are taken away round by round, those of few neighbours first; the neighbours of one that is gone are joined to the one of
//! them that has the fewest. It depends on the faces alone, in whole numbers.

use cager_core::mesh::Polygons;

/// Rounds end when so few vertices are left; these are not predicted.
const COARSEST: usize = 48;
/// Vertices of a patch of a [part](Hierarchy::part), about.
const PATCH: usize = 512;

/// Vertices from coarse to fine.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    /// The vertex at each place.
    order: Vec<u32>,
    /// The places of those that predict the vertex at place k are `parents[starts[k]..starts[k + 1]]`.
    parents: Vec<u32>,
    starts: Vec<u32>,
}

impl Hierarchy {
    /// Of the vertices of these faces; without an edge a vertex is not predicted.
    pub fn new(faces: &Polygons, points: usize) -> Self {
        let mut near: Vec<Vec<u32>> = vec![Vec::new(); points];
        for face in faces.iter() {
            for (k, &a) in face.iter().enumerate() {
                let b = face[(k + 1) % face.len()];
                if a != b {
                    near[a as usize].push(b);
                    near[b as usize].push(a);
                }
            }
        }
        for list in &mut near {
            list.sort_unstable();
            list.dedup();
        }
        let mut left: Vec<u32> = (0..points as u32).collect();
        let mut by_size: Vec<u64> = Vec::with_capacity(points);
        let mut removed: Vec<(u32, Vec<u32>)> = Vec::with_capacity(points);
        let mut blocked = vec![0u32; points];
        let mut round = 0;
        while left.len() > COARSEST {
            round += 1;
            // The number of neighbours, then the vertex, as one number.
            by_size.clear();
            by_size.extend(left.iter().map(|&v| (near[v as usize].len() as u64) << 32 | u64::from(v)));
            by_size.sort_unstable();
            let before = removed.len();
            for v in by_size.iter().map(|&numbers| numbers as u32) {
                if blocked[v as usize] != round && !near[v as usize].is_empty() {
                    near[v as usize].iter().for_each(|&w| blocked[w as usize] = round);
                    blocked[v as usize] = round;
                    removed.push((v, Vec::new()));
                }
            }
            if removed.len() == before {
                break;
            }
            let mut gone = vec![false; points];
            for (v, parents) in &mut removed[before..] {
                gone[*v as usize] = true;
                *parents = std::mem::take(&mut near[*v as usize]);
                join(&mut near, *v, parents);
            }
            left.retain(|&v| !gone[v as usize]);
        }
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

    /// About one in `every` of the vertices, in whole patches of the mesh, with the numbers that they have here, ascending: what costs as much to code,
    /// for its size.
    pub fn part(&self, every: usize) -> (Self, Vec<u32>) {
        // A patch is what follows by the first parents from one of the coarsest vertices. Those that are not predicted come first; there may be one for each of
        // many parts, so that others have to be begun with besides.
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

/// Takes v from the lists of its neighbours and joins these to the one that has the fewest.
fn join(near: &mut [Vec<u32>], v: u32, neighbours: &[u32]) {
    for &w in neighbours {
        let list = &mut near[w as usize];
        if let Ok(place) = list.binary_search(&v) {
            list.remove(place);
        }
    }
    let Some(&hub) = neighbours.iter().min_by_key(|&&w| (near[w as usize].len(), w)) else { return };
    for &w in neighbours {
        if w != hub {
            for (a, b) in [(hub, w), (w, hub)] {
                let list = &mut near[a as usize];
                if let Err(place) = list.binary_search(&b) {
                    list.insert(place, b);
                }
            }
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
}
