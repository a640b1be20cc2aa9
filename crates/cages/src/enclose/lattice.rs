//! A body-centred cubic lattice that is finer where asked: an octree's cubes with tetrahedra
//! between their centres and corners (Labelle and Shewchuk 2007, without warping). Cubes that touch
//! differ by one level at most.

use cager_geometry::spatial::Aabb;
use glam::DVec3;
use rustc_hash::{FxHashMap, FxHashSet};

/// A cube is halved so many times at most.
pub(super) const LEVELS: u32 = 3;

/// Side of the largest cubes in the unit of integer coordinates, half the side of the smallest.
const MAX_SIDE: u32 = 2 << LEVELS;

/// Corners of a cube's face, along the two axes after the face's.
const FACE: [[u32; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];

type Place = [u32; 3];

/// Nodes and tetrahedra. No edge is longer than the spacing, nor than the side of its cubes.
#[derive(Debug)]
pub(super) struct Lattice {
    pub(super) positions: Vec<DVec3>,
    /// Positively oriented.
    pub(super) tetrahedra: Vec<[u32; 4]>,
    /// A node beside the border.
    pub(super) outermost: u32,
}

impl Lattice {
    /// The lattice of some cubes.
    pub(super) fn of(cubes: &Octree) -> Self {
        let leaves = cubes.leaves();
        let nodes = Nodes::of(&leaves);
        Self {
            positions: nodes.places.iter().map(|&place| cubes.position(place)).collect(),
            tetrahedra: cubes.tetrahedra(&leaves, &nodes),
            outermost: nodes.index(leaves[0].center()),
        }
    }

    /// Where each node's list of neighbours begins, and the lists, which name a node as often as
    /// tetrahedra share the edge to it.
    pub(super) fn neighbours(&self) -> (Vec<usize>, Vec<u32>) {
        let mut starts = vec![0; self.positions.len() + 1];
        self.tetrahedra.iter().flatten().for_each(|&node| starts[node as usize + 1] += 3);
        for node in 1..starts.len() {
            starts[node] += starts[node - 1];
        }
        let mut lists = vec![0; 12 * self.tetrahedra.len()];
        let mut next = starts.clone();
        for t in &self.tetrahedra {
            for k in 0..4 {
                let at = &mut next[t[k] as usize];
                (1..4).for_each(|step| lists[*at + step - 1] = t[(k + step) % 4]);
                *at += 3;
            }
        }
        starts.windows(2).for_each(|ends| lists[ends[0]..ends[1]].sort_unstable());
        (starts, lists)
    }
}

/// A cube: how often the largest was halved to it, and where it is among those of its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Cube {
    level: u32,
    at: Place,
}

impl Cube {
    fn side(self) -> u32 {
        MAX_SIDE >> self.level
    }

    fn low(self) -> Place {
        self.at.map(|i| i * self.side())
    }

    fn center(self) -> Place {
        self.low().map(|i| i + self.side() / 2)
    }

    fn parent(self) -> Option<Self> {
        Some(Self { level: self.level.checked_sub(1)?, at: self.at.map(|i| i / 2) })
    }

    fn children(self) -> [Self; 8] {
        std::array::from_fn(|c| Self {
            level: self.level + 1,
            at: std::array::from_fn(|k| 2 * self.at[k] + (c as u32 >> k & 1)),
        })
    }

    fn corners(self) -> [Place; 8] {
        let low = self.low();
        std::array::from_fn(|c| std::array::from_fn(|k| low[k] + self.side() * (c as u32 >> k & 1)))
    }

    /// Corners of the face towards greater (1) or lesser (0) coordinates along an axis.
    fn face(self, axis: usize, towards: u32) -> [Place; 4] {
        FACE.map(|step| {
            let mut corner = self.low();
            corner[axis] += towards * self.side();
            (0..2).for_each(|k| corner[(axis + 1 + k) % 3] += step[k] * self.side());
            corner
        })
    }
}

/// Cubes over a box, some of them halved, again and again.
#[derive(Debug)]
pub(super) struct Octree {
    origin: DVec3,
    unit: f64,
    /// Number of largest cubes along each axis.
    cells: [u32; 3],
    halved: FxHashSet<Cube>,
}

impl Octree {
    /// Cubes over a box that are all as large as the spacing.
    pub(super) fn uniform(bounds: &Aabb, spacing: f64) -> Self {
        let cells = (bounds.size() / spacing).ceil().max(DVec3::splat(2.0)).to_array().map(|c| c as u32);
        let origin = bounds.center() - 0.5 * spacing * DVec3::from_array(cells.map(f64::from));
        Self { origin, unit: spacing / f64::from(MAX_SIDE), cells, halved: FxHashSet::default() }
    }

    /// Halves all cubes that are too large; false where more than `most` would be.
    pub(super) fn refine(&mut self, most: usize, is_too_large: impl Fn(DVec3, f64) -> bool) -> bool {
        let mut waiting: Vec<Cube> = self.roots().collect();
        while let Some(cube) = waiting.pop() {
            let side = self.unit * f64::from(cube.side());
            if cube.level < LEVELS && is_too_large(self.position(cube.center()), side) {
                self.halve(cube);
                waiting.extend(cube.children());
            }
            if self.halved.len() > most {
                return false;
            }
        }
        true
    }

    fn position(&self, place: Place) -> DVec3 {
        self.origin + self.unit * DVec3::from_array(place.map(f64::from))
    }

    fn roots(&self) -> impl Iterator<Item = Cube> + use<> {
        let [x, y, z] = self.cells;
        (0..z).flat_map(move |k| (0..y).flat_map(move |j| (0..x).map(move |i| Cube { level: 0, at: [i, j, k] })))
    }

    /// Halves a cube, after those around it that are larger.
    fn halve(&mut self, cube: Cube) {
        if !self.halved.insert(cube) {
            return;
        }
        for step in 0..27_u32 {
            let step = [step % 3, step / 3 % 3, step / 9].map(|s| s as i32 - 1);
            if let Some(larger) = self.beside(cube, step).and_then(Cube::parent) {
                self.halve(larger);
            }
        }
    }

    /// The cube of the same size so many steps on.
    fn beside(&self, cube: Cube, step: [i32; 3]) -> Option<Cube> {
        let mut at = cube.at;
        for k in 0..3 {
            at[k] = at[k].checked_add_signed(step[k]).filter(|&i| i < self.cells[k] << cube.level)?;
        }
        Some(Cube { level: cube.level, at })
    }

    /// The cubes that are not halved.
    fn leaves(&self) -> Vec<Cube> {
        let mut leaves = Vec::new();
        for root in self.roots() {
            let mut waiting = vec![root];
            while let Some(cube) = waiting.pop() {
                if self.halved.contains(&cube) { waiting.extend(cube.children()) } else { leaves.push(cube) }
            }
        }
        leaves
    }

    fn tetrahedra(&self, leaves: &[Cube], nodes: &Nodes) -> Vec<[u32; 4]> {
        let mut found = Vec::with_capacity(12 * leaves.len());
        for axis in 0..3 {
            for &cube in leaves {
                for towards in [1, 0] {
                    let mut step = [0; 3];
                    step[axis] = 2 * towards as i32 - 1;
                    if let Some(next) = self.beside(cube, step) {
                        self.join(
                            cube,
                            next,
                            axis,
                            towards,
                            |t| {
                                let t = positive(t);
                                found.push(t.map(|place| nodes.index(place)));
                            },
                            nodes,
                        );
                    }
                }
            }
        }
        found
    }

    /// The tetrahedra between the centre of a cube and the face towards `next`, of the same size.
    /// Those between cubes of one size span both, and are found from the lesser.
    fn join(
        &self,
        cube: Cube,
        next: Cube,
        axis: usize,
        towards: u32,
        mut found: impl FnMut([Place; 4]),
        nodes: &Nodes,
    ) {
        let center = cube.center();
        let corners = cube.face(axis, towards);
        let edges = || (0..4).map(|c| [corners[c], corners[(c + 1) % 4]]);
        if self.halved.contains(&next) {
            let apex = middle([corners[0], corners[2]]);
            for [a, b] in edges() {
                let between = middle([a, b]);
                found([center, apex, a, between]);
                found([center, apex, between, b]);
            }
        } else if let Some(larger) = next.parent().filter(|larger| !self.halved.contains(larger)) {
            // The quarter of the larger face is cut from its centre outwards.
            let other = larger.center();
            let is_apex = |c: &usize| (1..3).all(|k| corners[*c][(axis + k) % 3] == other[(axis + k) % 3]);
            let first = (0..4).find(is_apex).unwrap_or(0);
            let corner = |k: usize| corners[(first + k) % 4];
            found([center, corner(0), corner(1), corner(2)]);
            found([center, corner(0), corner(2), corner(3)]);
        } else if towards == 1 {
            for [a, b] in edges() {
                let between = middle([a, b]);
                if !self.halved.is_empty() && nodes.indices.contains_key(&between) {
                    found([center, next.center(), a, between]);
                    found([center, next.center(), between, b]);
                } else {
                    found([center, next.center(), a, b]);
                }
            }
        }
    }
}

/// Corners of the cubes, then their centres, each in the order of their places.
struct Nodes {
    places: Vec<Place>,
    indices: FxHashMap<Place, u32>,
}

impl Nodes {
    fn of(leaves: &[Cube]) -> Self {
        let ordered = |mut places: Vec<Place>| {
            places.sort_unstable_by_key(|p| [p[2], p[1], p[0]]);
            places.dedup();
            places
        };
        let mut places = ordered(leaves.iter().flat_map(|cube| cube.corners()).collect());
        places.extend(ordered(leaves.iter().map(|cube| cube.center()).collect()));
        let indices = places.iter().enumerate().map(|(i, &place)| (place, i as u32)).collect();
        Self { places, indices }
    }

    fn index(&self, place: Place) -> u32 {
        self.indices[&place]
    }
}

fn middle([a, b]: [Place; 2]) -> Place {
    std::array::from_fn(|k| u32::midpoint(a[k], b[k]))
}

/// A tetrahedron with its last two corners in the order that makes its volume positive.
fn positive(t: [Place; 4]) -> [Place; 4] {
    let at = |i: usize| DVec3::from_array(t[i].map(f64::from));
    let [a, b, c] = [at(1) - at(0), at(2) - at(0), at(3) - at(0)];
    if a.cross(b).dot(c) > 0.0 { t } else { [t[0], t[1], t[3], t[2]] }
}
