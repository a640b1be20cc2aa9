//! Level sets on a body-centred cubic lattice by marching tetrahedra (Labelle and Shewchuk 2007, without warping): a closed manifold
//! whatever the values are, as long as those at the border are positive.

use crate::geometry::Aabb;
use glam::DVec3;

/// Two cubic grids, the second at the cell centres of the first, with the tetrahedra between them. No edge is longer than the
/// spacing.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    origin: DVec3,
    spacing: f64,
    cells: [usize; 3],
}

impl Lattice {
    /// A lattice over a box.
    pub(super) fn over(bounds: &Aabb, spacing: f64) -> Self {
        let cells = (bounds.size() / spacing).ceil().max(DVec3::splat(2.0)).to_array().map(|c| c as usize);
        let used = DVec3::from_array(cells.map(|c| c as f64)) * spacing;
        Self { origin: bounds.center() - 0.5 * used, spacing, cells }
    }

    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.corners() + self.cells.iter().product::<usize>()
    }

    /// Where a node is.
    pub(super) fn position(&self, node: usize) -> DVec3 {
        let (at, half) = self.place(node);
        let at = DVec3::from_array(at.map(|i| i as f64));
        self.origin + self.spacing * (at + DVec3::splat(if half { 0.5 } else { 0.0 }))
    }

    /// The nodes joined to one by an edge, at most 14.
    pub(super) fn neighbours(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        let (at, half) = self.place(node);
        let along = (0..6).filter_map(move |i| {
            let axis = i / 2;
            let mut to = at;
            to[axis] = if i % 2 == 0 { at[axis].checked_sub(1)? } else { at[axis] + 1 };
            let end = self.cells[axis] - usize::from(half);
            (to[axis] <= end).then(|| self.node(to, half))
        });
        let across = (0..8_usize).filter_map(move |i| {
            let mut to = at;
            for axis in 0..3 {
                let step = i >> axis & 1;
                to[axis] = if half { at[axis] + step } else { (at[axis] + step).checked_sub(1)? };
                if !half && to[axis] >= self.cells[axis] {
                    return None;
                }
            }
            Some(self.node(to, !half))
        });
        along.chain(across)
    }

    /// The nodes in a box, and some around it.
    pub(super) fn nodes_in(&self, bounds: &Aabb) -> Vec<usize> {
        let low = ((bounds.low - self.origin) / self.spacing).floor().max(DVec3::ZERO).to_array().map(|x| x as usize);
        let high = ((bounds.high - self.origin) / self.spacing).ceil().max(DVec3::ZERO).to_array().map(|x| x as usize);
        let mut nodes = Vec::new();
        for half in [false, true] {
            let end: [usize; 3] = std::array::from_fn(|k| high[k].min(self.cells[k] - usize::from(half)));
            for k in low[2]..=end[2] {
                for j in low[1]..=end[1] {
                    nodes.extend((low[0]..=end[0]).map(|i| self.node([i, j, k], half)));
                }
            }
        }
        nodes
    }

    /// The closed surface between nodes with negative and with other values, facing the latter.
    pub(super) fn surface(&self, values: &[f64]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut keyed = Vec::new();
        self.for_each_tetrahedron(values, |tetrahedron| self.cut(tetrahedron, values, &mut keyed));
        let mut keys: Vec<u64> = keyed.iter().flatten().copied().collect();
        keys.sort_unstable();
        keys.dedup();
        let vertices = keys.iter().map(|&key| self.crossing(key, values)).collect();
        let index = |key: u64| keys.partition_point(|&k| k < key) as u32;
        (vertices, keyed.iter().map(|t| t.map(index)).collect())
    }

    /// Calls `found` with every tetrahedron, positively oriented, that has values of both signs.
    fn for_each_tetrahedron(&self, values: &[f64], mut found: impl FnMut([usize; 4])) {
        for axis in 0..3 {
            let mut count = self.cells;
            count[axis] -= 1;
            for k in 0..count[2] {
                for j in 0..count[1] {
                    for i in 0..count[0] {
                        let mut next = [i, j, k];
                        next[axis] += 1;
                        let centers = [self.node([i, j, k], true), self.node(next, true)];
                        let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|step| {
                            let mut corner = next;
                            corner[(axis + 1) % 3] += step[0];
                            corner[(axis + 2) % 3] += step[1];
                            self.node(corner, false)
                        });
                        let negative = |n: usize| values[n] < 0.0;
                        let inside = centers.iter().chain(&corners).filter(|&&n| negative(n)).count();
                        if inside == 0 || inside == 6 {
                            continue;
                        }
                        for c in 0..4 {
                            found([centers[0], centers[1], corners[c], corners[(c + 1) % 4]]);
                        }
                    }
                }
            }
        }
    }

    fn cut(&self, t: [usize; 4], values: &[f64], triangles: &mut Vec<[u64; 3]>) {
        let key = |p: usize, q: usize| {
            let (p, q) = (t[p] as u64, t[q] as u64);
            p.min(q) << 32 | p.max(q)
        };
        let inside = (0..4).fold(0, |bits, i| bits | usize::from(values[t[i]] < 0.0) << i);
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
                let [a, b, c, d] = quad.map(|k| self.crossing(k, values));
                let first = a.distance_squared(c) <= b.distance_squared(d);
                let order = if first { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] };
                triangles.extend(order.map(|o| o.map(|i| quad[i])));
            }
            _ => {}
        }
    }

    /// Where the surface crosses an edge, kept away from its ends so that no triangle is degenerate.
    fn crossing(&self, key: u64, values: &[f64]) -> DVec3 {
        let ends = [(key >> 32) as usize, (key & 0xffff_ffff) as usize];
        let [p, q] = ends.map(|n| values[n]);
        let t = (p / (p - q)).clamp(0.12, 0.88);
        self.position(ends[0]).lerp(self.position(ends[1]), t)
    }

    fn corners(&self) -> usize {
        self.cells.iter().map(|c| c + 1).product()
    }

    fn node(&self, at: [usize; 3], half: bool) -> usize {
        let [nx, ny] = [0, 1].map(|k| self.cells[k] + usize::from(!half));
        at[0] + nx * (at[1] + ny * at[2]) + if half { self.corners() } else { 0 }
    }

    fn place(&self, node: usize) -> ([usize; 3], bool) {
        let half = node >= self.corners();
        let index = if half { node - self.corners() } else { node };
        let [nx, ny] = [0, 1].map(|k| self.cells[k] + usize::from(!half));
        ([index % nx, index / nx % ny, index / (nx * ny)], half)
    }
}
