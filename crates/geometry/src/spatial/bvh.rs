//! A balanced tree of bounding boxes over any items that have one: points, segments, triangles.

use super::Aabb;
use glam::DVec3;

/// Items of a leaf at most.
const LEAF: usize = 4;

/// A bounding volume hierarchy: a complete binary tree in breadth-first order, split at the median
/// of the longest axis, so that its shape follows from the number of items alone.
#[derive(Clone, Debug)]
pub struct Bvh {
    /// Items in the order of the leaves.
    items: Vec<u32>,
    /// Boxes of the nodes; the children of node i are 2i + 1 and 2i + 2.
    boxes: Vec<Aabb>,
    /// Levels above the leaves.
    depth: u32,
    /// The leaf of each item.
    leaf_of: Vec<u32>,
}

impl Bvh {
    /// A tree over items with these boxes.
    pub fn new(item_boxes: &[Aabb]) -> Self {
        let depth = item_boxes.len().div_ceil(LEAF).max(1).next_power_of_two().trailing_zeros();
        let mut items: Vec<u32> = (0..item_boxes.len() as u32).collect();
        let centers: Vec<DVec3> = item_boxes.iter().map(Aabb::center).collect();
        sort_into_leaves(&mut items, &centers, Part { start: 0, leaf: 0, levels: depth }, depth);
        let boxes = vec![Aabb::EMPTY; (2 << depth) - 1];
        let mut tree = Self { items, boxes, depth, leaf_of: vec![0; item_boxes.len()] };
        for leaf in 0..1 << depth {
            for i in tree.leaf_range(leaf) {
                tree.leaf_of[tree.items[i] as usize] = leaf as u32;
            }
        }
        tree.refit(|item| item_boxes[item as usize]);
        tree
    }

    /// Box around everything.
    pub fn bounds(&self) -> Aabb {
        self.boxes[0]
    }

    /// Fits all boxes to items that have moved.
    pub fn refit(&mut self, item_box: impl Fn(u32) -> Aabb) {
        for leaf in 0..1 << self.depth {
            self.refit_leaf(leaf, &item_box);
        }
        for node in (0..(1 << self.depth) - 1).rev() {
            self.boxes[node] = self.boxes[2 * node + 1].union(&self.boxes[2 * node + 2]);
        }
    }

    /// Fits the boxes above an item that has moved. One with an empty box is found no more.
    pub fn refit_item(&mut self, item: u32, item_box: impl Fn(u32) -> Aabb) {
        let leaf = self.leaf_of[item as usize] as usize;
        self.refit_leaf(leaf, &item_box);
        let mut node = self.first_leaf() + leaf;
        while node > 0 {
            node = (node - 1) / 2;
            let fitted = self.boxes[2 * node + 1].union(&self.boxes[2 * node + 2]);
            if fitted == self.boxes[node] {
                break;
            }
            self.boxes[node] = fitted;
        }
    }

    /// Calls `found` with every item of a leaf whose box overlaps `query` – a superset of the items
    /// that do – until it returns `false`. Says whether all were visited.
    pub fn visit(&self, query: &Aabb, mut found: impl FnMut(u32) -> bool) -> bool {
        let mut stack = [0_u32; 64];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let node = stack[height] as usize;
            if !self.boxes[node].overlaps(query) {
                continue;
            }
            if let Some(leaf) = node.checked_sub(self.first_leaf()) {
                for i in self.leaf_range(leaf) {
                    if !found(self.items[i]) {
                        return false;
                    }
                }
            } else {
                stack[height] = 2 * node as u32 + 2;
                stack[height + 1] = 2 * node as u32 + 1;
                height += 2;
            }
        }
        true
    }

    /// The item nearest to `p` by `distance2`, the squared distance to an item, among those nearer
    /// than `√limit2`; the first one met of several.
    pub fn nearest(&self, p: DVec3, limit2: f64, mut distance2: impl FnMut(u32) -> f64) -> Option<(u32, f64)> {
        let mut best = None;
        let mut limit2 = limit2;
        let mut stack = [(0_u32, 0.0_f64); 64];
        stack[0] = (0, self.boxes[0].distance2(p));
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (node, bound) = stack[height];
            if bound >= limit2 {
                continue;
            }
            let node = node as usize;
            if let Some(leaf) = node.checked_sub(self.first_leaf()) {
                for i in self.leaf_range(leaf) {
                    let d2 = distance2(self.items[i]);
                    if d2 < limit2 {
                        limit2 = d2;
                        best = Some((self.items[i], d2));
                    }
                }
            } else {
                let child = |c: usize| (c as u32, self.boxes[c].distance2(p));
                let (left, right) = (child(2 * node + 1), child(2 * node + 2));
                (stack[height], stack[height + 1]) = if right.1 < left.1 { (left, right) } else { (right, left) };
                height += 2;
            }
        }
        best
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.boxes.len()
    }

    /// Box of a node.
    pub fn node_box(&self, node: usize) -> &Aabb {
        &self.boxes[node]
    }

    /// The children of a node, or the items of a leaf.
    pub fn node(&self, node: usize) -> Node<'_> {
        match node.checked_sub(self.first_leaf()) {
            Some(leaf) => Node::Leaf(&self.items[self.leaf_range(leaf)]),
            None => Node::Inner([2 * node + 1, 2 * node + 2]),
        }
    }

    fn first_leaf(&self) -> usize {
        (1 << self.depth) - 1
    }

    fn leaf_range(&self, leaf: usize) -> std::ops::Range<usize> {
        let n = self.items.len();
        (n * leaf) >> self.depth..(n * (leaf + 1)) >> self.depth
    }

    fn refit_leaf(&mut self, leaf: usize, item_box: impl Fn(u32) -> Aabb) {
        let items = &self.items[self.leaf_range(leaf)];
        let fitted = items.iter().fold(Aabb::EMPTY, |b, &i| b.union(&item_box(i)));
        let node = self.first_leaf() + leaf;
        self.boxes[node] = fitted;
    }
}

/// What a node of a [`Bvh`] has below it.
#[derive(Clone, Copy, Debug)]
pub enum Node<'a> {
    /// Two nodes.
    Inner([usize; 2]),
    /// Items.
    Leaf(&'a [u32]),
}

/// The items that [`sort_into_leaves`] orders: those of `1 << levels` leaves from `leaf` on, from
/// `start` on in the order of all.
#[derive(Clone, Copy)]
struct Part {
    start: usize,
    leaf: usize,
    levels: u32,
}

/// Orders items so that those of every leaf, `n·k / 2^depth` and on for leaf k, stand together.
fn sort_into_leaves(items: &mut [u32], centers: &[DVec3], part: Part, depth: u32) {
    if part.levels == 0 || items.len() <= 1 {
        return;
    }
    let Part { start, leaf, levels } = part;
    let middle_leaf = leaf + (1 << (levels - 1));
    let middle = ((centers.len() * middle_leaf) >> depth) - start;
    let size = Aabb::around(items.iter().map(|&i| centers[i as usize])).size();
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    if middle < items.len() {
        let along = |i: u32| centers[i as usize][axis];
        items.select_nth_unstable_by(middle, |&i, &j| along(i).total_cmp(&along(j)).then(i.cmp(&j)));
    }
    let (low, high) = items.split_at_mut(middle);
    let left = Part { start, leaf, levels: levels - 1 };
    let right = Part { start: start + middle, leaf: middle_leaf, levels: levels - 1 };
    if low.len() > 10_000 {
        rayon::join(|| sort_into_leaves(low, centers, left, depth), || sort_into_leaves(high, centers, right, depth));
    } else {
        sort_into_leaves(low, centers, left, depth);
        sort_into_leaves(high, centers, right, depth);
    }
}
