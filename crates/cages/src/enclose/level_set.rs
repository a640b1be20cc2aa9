//! Level sets by marching tetrahedra: a closed manifold where values at the border are positive.

use super::lattice::Lattice;
use glam::DVec3;

/// The closed surface between nodes with negative and with other values, facing the latter.
pub(super) fn level_set(lattice: &Lattice, values: &[f64]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut keyed = Vec::new();
    for t in &lattice.tetrahedra {
        cut(lattice, values, t, &mut keyed);
    }
    let mut keys: Vec<u64> = keyed.iter().flatten().copied().collect();
    keys.sort_unstable();
    keys.dedup();
    let vertices = keys.iter().map(|&key| crossing(lattice, values, key)).collect();
    let index = |key: u64| keys.partition_point(|&k| k < key) as u32;
    (vertices, keyed.iter().map(|t| t.map(index)).collect())
}

/// Adds the triangles of a tetrahedron, by the edges that their corners lie on.
fn cut(lattice: &Lattice, values: &[f64], t: &[u32; 4], triangles: &mut Vec<[u64; 3]>) {
    let key = |p: usize, q: usize| {
        let (p, q) = (u64::from(t[p]), u64::from(t[q]));
        p.min(q) << 32 | p.max(q)
    };
    let inside = (0..4).fold(0, |bits, i| bits | usize::from(values[t[i] as usize] < 0.0) << i);
    // Even permutations, so that the tetrahedron stays positively oriented.
    let single = |i: usize| [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]][i];
    match inside.count_ones() {
        1 => {
            let [p, q, r, s] = single(inside.trailing_zeros() as usize);
            triangles.push([key(p, q), key(p, r), key(p, s)]);
        }
        3 => {
            let [p, q, r, s] = single((!inside & 15).trailing_zeros() as usize);
            triangles.push([key(p, q), key(p, s), key(p, r)]);
        }
        2 => {
            let [p, q, r, s] = match inside {
                0b0011 => [0, 1, 2, 3],
                0b1100 => [2, 3, 0, 1],
                0b0101 => [0, 2, 3, 1],
                0b1010 => [1, 3, 2, 0],
                0b1001 => [0, 3, 1, 2],
                _ => [1, 2, 0, 3],
            };
            let quad = [key(p, r), key(p, s), key(q, s), key(q, r)];
            let [a, b, c, d] = quad.map(|k| crossing(lattice, values, k));
            let first = a.distance_squared(c) <= b.distance_squared(d);
            let order = if first { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] };
            triangles.extend(order.map(|o| o.map(|i| quad[i])));
        }
        _ => {}
    }
}

/// Where the surface crosses an edge, kept away from its ends so that no triangle is degenerate.
fn crossing(lattice: &Lattice, values: &[f64], key: u64) -> DVec3 {
    let ends = [(key >> 32) as usize, (key & 0xffff_ffff) as usize];
    let [p, q] = ends.map(|n| values[n]);
    let t = (p / (p - q)).clamp(0.12, 0.88);
    lattice.positions[ends[0]].lerp(lattice.positions[ends[1]], t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::enclose::lattice::Octree;
    use cager_geometry::spatial::Aabb;
    use std::collections::HashMap;

    /// Cubes of all sizes, finest around a corner of the box and around places inside it.
    fn graded() -> (Lattice, Aabb) {
        let bounds = Aabb { low: DVec3::ZERO, high: DVec3::new(1.0, 0.8, 0.9) };
        let spots = [bounds.low, DVec3::new(0.5, 0.4, 0.45), DVec3::new(0.61, 0.33, 0.6)];
        let too_large = |center: DVec3, side: f64| spots.iter().any(|s| s.distance(center) < side) && side > 0.03;
        let mut cubes = Octree::uniform(&bounds, 0.2);
        assert!(cubes.refine(10_000, too_large));
        (Lattice::of(&cubes), bounds)
    }

    #[test]
    fn tetrahedra_of_cubes_of_all_sizes_fit_together() {
        let (lattice, bounds) = graded();
        let at = |v: u32| lattice.positions[v as usize];
        let mut faces: HashMap<[u32; 3], u32> = HashMap::new();
        let mut volume = 0.0;
        for t in &lattice.tetrahedra {
            let [a, b, c] = [1, 2, 3].map(|k| at(t[k]) - at(t[0]));
            let own = a.cross(b).dot(c) / 6.0;
            assert!(own > 0.0, "{t:?} has the volume {own}");
            volume += own;
            for left_out in 0..4 {
                let mut face = [1, 2, 3].map(|k| t[(left_out + k) % 4]);
                face.sort_unstable();
                *faces.entry(face).or_default() += 1;
            }
        }
        assert!(volume > 0.7 * bounds.size().element_product(), "they fill {volume}");
        let sizes: Vec<f64> = lattice.tetrahedra.iter().map(|t| at(t[0]).distance(at(t[1]))).collect();
        assert!(sizes.iter().any(|&s| s < 0.03) && sizes.iter().any(|&s| s > 0.15));
        let whole = Aabb::around(lattice.positions.iter().copied());
        let is_on_border = |p: DVec3| (p - whole.low).min(whole.high - p).min_element() < 1e-9;
        for (face, count) in faces {
            // Only faces around the whole belong to one tetrahedron: they have an edge on the
            // border.
            let on_border = face.iter().filter(|&&v| is_on_border(at(v))).count();
            assert!(count == 2 || (count == 1 && on_border >= 2), "{face:?} belongs to {count}");
        }
    }

    #[test]
    fn any_values_give_a_closed_manifold_on_a_graded_lattice() {
        let (lattice, bounds) = graded();
        let mut rng = fastrand::Rng::with_seed(6);
        let values: Vec<f64> = lattice
            .positions
            .iter()
            .map(|&p| {
                let is_near_border = (p - bounds.low).min(bounds.high - p).min_element() < 0.21;
                if is_near_border { 1.0 } else { rng.f64() - 0.5 }
            })
            .collect();
        let (positions, triangles) = level_set(&lattice, &values);
        assert!(triangles.len() > 300, "{}", triangles.len());
        let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
        for t in &triangles {
            (0..3).for_each(|k| *edges.entry((t[k], t[(k + 1) % 3])).or_default() += 1);
        }
        for (&(a, b), &count) in &edges {
            assert!(count == 1 && edges.contains_key(&(b, a)), "{a}, {b}: {count}");
        }
        let volume: f64 =
            triangles.iter().map(|t| t.map(|v| positions[v as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
        assert!(volume > 0.0, "it faces inwards");
    }
}
