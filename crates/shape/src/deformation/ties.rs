//! Ties between the parts of a mesh that no edge connects, so that all of them go with each other.

use std::collections::HashMap;

use crate::registration::NearestPoints;
use cager_geometry::topology::UnionFind;
use glam::DVec3;
use rayon::prelude::*;

/// Two rows that are to keep their offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tie {
    /// The row that is carried, and the one that carries it.
    pub(crate) rows: [u32; 2],
    /// A triangle at the row that carries.
    pub(crate) triangle: u32,
    /// A triangle at the row that is carried; none for a point without any.
    pub(crate) carried: Option<u32>,
}

/// Ties of two parts.
const TIES: usize = 3;
/// Neighbours of a point that are asked for other parts first.
const NEAR: u32 = 12;
/// Points of a part that are compared one by one.
const FEW: usize = 24;

/// Ties along a tree of near parts (Kruskal over nearest points, then Borůvka), up to [`TIES`] for
/// a pair; points without triangles go to the nearest point with one. `part` numbers the sets that
/// triangles connect, `triangle_at` has a triangle for each row that is in one.
pub(crate) fn ties(at: &[DVec3], part: &[u32], triangle_at: &[Option<u32>]) -> Vec<Tie> {
    let (held, loose): (Vec<u32>, Vec<u32>) =
        (0..at.len() as u32).partition(|&row| triangle_at[row as usize].is_some());
    let mut members: HashMap<u32, Vec<u32>> = HashMap::new();
    held.iter().for_each(|&row| members.entry(part[row as usize]).or_default().push(row));
    if held.is_empty() || (members.len() < 2 && loose.is_empty()) {
        return Vec::new();
    }
    let tree = tree_of(at, &held);
    let tie = |carried: u32, carrier: u32| {
        let triangle = triangle_at[carrier as usize]?;
        Some(Tie { rows: [carried, carrier], triangle, carried: triangle_at[carried as usize] })
    };
    let mut ties: Vec<Tie> = Vec::new();
    if members.len() > 1 {
        let mut trees: HashMap<u32, NearestPoints<3>> = HashMap::new();
        for pair in joints(at, part, &held, &members, &tree) {
            let [a, b] = pair.map(|row| part[row as usize]);
            let (small, large) = if (members[&a].len(), b) <= (members[&b].len(), a) { (a, b) } else { (b, a) };
            let rows = &members[&large];
            if rows.len() > FEW {
                trees.entry(large).or_insert_with(|| tree_of(at, rows));
            }
            let nearest = |from: u32| -> (f64, u32, u32) {
                let p = at[from as usize];
                if rows.len() <= FEW {
                    let each = rows.iter().map(|&to| (p.distance_squared(at[to as usize]), from, to));
                    return each.fold((f64::INFINITY, from, rows[0]), |a, b| if b.0 < a.0 { b } else { a });
                }
                let (found, d2) = trees[&large].nearest(p.to_array());
                (d2, from, rows[found])
            };
            let mut pairs: Vec<(f64, u32, u32)> = members[&small].iter().map(|&row| nearest(row)).collect();
            pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            ties.extend(pairs.iter().take(TIES).filter_map(|&(_, from, to)| tie(from, to)));
        }
    }
    ties.extend(loose.iter().filter_map(|&row| tie(row, held[tree.nearest(at[row as usize].to_array()).0])));
    ties
}

fn tree_of(at: &[DVec3], rows: &[u32]) -> NearestPoints<3> {
    NearestPoints::new(rows.iter().map(|&row| at[row as usize].to_array()))
}

/// Pairs of rows whose parts are to be tied: one fewer than there are parts.
fn joints(
    at: &[DVec3],
    part: &[u32],
    held: &[u32],
    members: &HashMap<u32, Vec<u32>>,
    tree: &NearestPoints<3>,
) -> Vec<[u32; 2]> {
    let largest =
        members.iter().max_by_key(|(part, rows)| (rows.len(), std::cmp::Reverse(**part))).map(|(part, _)| *part);
    let distance = |a: u32, b: u32| at[a as usize].distance_squared(at[b as usize]);
    let mut pairs: Vec<(f64, u32, u32)> = held
        .par_iter()
        .with_min_len(256)
        .filter(|row| Some(part[**row as usize]) != largest)
        .flat_map_iter(|&row| {
            let near = tree.several(NEAR, at[row as usize].to_array()).into_iter().map(move |k| held[k]);
            near.filter(move |&other| part[other as usize] != part[row as usize])
                .map(move |other| (distance(row, other), row, other))
        })
        .collect();
    let mut parts = UnionFind::new(at.len());
    for rows in members.values() {
        for &row in rows {
            parts.join(rows[0], row);
        }
    }
    let mut joints = Vec::new();
    loop {
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for &(_, a, b) in &pairs {
            if parts.join(a, b) {
                joints.push([a, b]);
            }
        }
        if joints.len() + 1 >= members.len() {
            return joints;
        }
        pairs = nearest_outside(at, held, &mut parts);
        // Where squares of distances overflow.
        if pairs.is_empty() {
            return joints;
        }
    }
}

/// For each set but the largest, its nearest pair with another one. Two sets differ in a bit of
/// their numbers: by each bit, rows are looked for among those that have it otherwise.
fn nearest_outside(at: &[DVec3], held: &[u32], parts: &mut UnionFind) -> Vec<(f64, u32, u32)> {
    let mut number: HashMap<u32, usize> = HashMap::new();
    let set: Vec<usize> = held
        .iter()
        .map(|&row| {
            let next = number.len();
            *number.entry(parts.root(row)).or_insert(next)
        })
        .collect();
    let mut sizes = vec![0; number.len()];
    set.iter().for_each(|&s| sizes[s] += 1);
    let largest = (0..sizes.len()).max_by_key(|&s| (sizes[s], std::cmp::Reverse(s)));
    let mut best = vec![(f64::INFINITY, 0, 0); sizes.len()];
    for bit in (0..usize::BITS).take_while(|bit| (sizes.len() - 1) >> bit > 0) {
        let sides: [Vec<u32>; 2] = [0, 1]
            .map(|side| held.iter().zip(&set).filter(|(_, s)| (*s >> bit) & 1 == side).map(|(&row, _)| row).collect());
        let trees = [tree_of(at, &sides[0]), tree_of(at, &sides[1])];
        let found: Vec<(usize, (f64, u32, u32))> = held
            .par_iter()
            .zip(&set)
            .with_min_len(256)
            .filter(|(_, s)| Some(**s) != largest)
            .map(|(&row, &s)| {
                let side = 1 - ((s >> bit) & 1);
                let (found, d2) = trees[side].nearest(at[row as usize].to_array());
                (s, (d2, row, sides[side][found]))
            })
            .collect();
        for (s, pair) in found {
            if pair.0 < best[s].0 {
                best[s] = pair;
            }
        }
    }
    best.into_iter().filter(|pair| pair.0.is_finite()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parts of three points each, on a line; the part of each row, and a triangle for each.
    fn triples(places: &[f64]) -> (Vec<DVec3>, Vec<u32>, Vec<Option<u32>>) {
        let corners = [DVec3::ZERO, 0.1 * DVec3::Y, 0.1 * DVec3::Z];
        let at = places.iter().flat_map(|&x| corners.map(|c| c + x * DVec3::X)).collect();
        let part: Vec<u32> = (0..3 * places.len() as u32).map(|row| row / 3).collect();
        let triangles = part.iter().map(|&p| Some(p)).collect();
        (at, part, triangles)
    }

    #[test]
    fn parts_on_a_line_are_tied_to_the_next_ones_and_all_hang_together() {
        let places: Vec<f64> = (0..60).map(|k| f64::from(k) + 0.3 * (f64::from(k * k)).sin()).collect();
        let (at, part, triangles) = triples(&places);
        let found = ties(&at, &part, &triangles);
        assert_eq!(found.len(), 3 * 59);
        let mut parts = UnionFind::new(60);
        for tie in &found {
            let [a, b] = tie.rows.map(|row| part[row as usize]);
            assert_eq!(a.abs_diff(b), 1, "{a} is tied to {b}");
            parts.join(a, b);
        }
        assert_eq!(parts.numbered().1, 1);
    }

    #[test]
    fn parts_farther_apart_than_their_own_points_are_found_too() {
        // Dense parts of 40 points, whose nearest points are all their own.
        let centers = [[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 9.0], [40.0, 0.0]];
        let mut at = Vec::new();
        for [x, y] in centers {
            at.extend((0..40).map(|k| DVec3::new(x + 0.01 * f64::from(k % 8), y + 0.01 * f64::from(k / 8), 0.0)));
        }
        let part: Vec<u32> = (0..200).map(|row| row / 40).collect();
        let triangles = part.iter().map(|&p| Some(p)).collect::<Vec<_>>();
        let found = ties(&at, &part, &triangles);
        let mut pairs: Vec<[u32; 2]> =
            found.iter().map(|tie| tie.rows.map(|row| part[row as usize])).map(|[a, b]| [a.min(b), a.max(b)]).collect();
        pairs.sort_unstable();
        assert_eq!(pairs.len(), 3 * 4);
        pairs.dedup();
        assert_eq!(pairs, [[0, 1], [1, 2], [1, 4], [2, 3]]);
    }

    #[test]
    fn a_point_without_triangles_is_carried_by_the_nearest_one_that_has_some() {
        let (mut at, mut part, mut triangles) = triples(&[0.0, 2.0]);
        at.extend([DVec3::new(1.9, 0.0, 0.0), DVec3::new(1.8, 0.0, 0.0)]);
        part.extend([2, 3]);
        triangles.extend([None, None]);
        let found = ties(&at, &part, &triangles);
        let loose: Vec<_> =
            found.iter().filter(|tie| tie.carried.is_none()).map(|tie| (tie.rows, tie.triangle)).collect();
        assert_eq!(loose, [([6, 3], 1), ([7, 3], 1)]);
    }
}
