//! Sets of items that were joined.

/// Items 0 to n − 1 in sets; each set is named by its least item.
#[derive(Clone, Debug)]
pub struct UnionFind {
    parent: Vec<u32>,
}

impl UnionFind {
    /// Each item alone.
    pub fn new(items: usize) -> Self {
        Self { parent: (0..items as u32).collect() }
    }

    /// The set that an item is in.
    pub fn root(&mut self, mut item: u32) -> u32 {
        while self.parent[item as usize] != item {
            self.parent[item as usize] = self.parent[self.parent[item as usize] as usize];
            item = self.parent[item as usize];
        }
        item
    }

    /// Makes one set of those of two items; says whether they were apart.
    pub fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
        a != b
    }

    /// The number of each item's set, in the order of their least items, and how many there are.
    pub fn numbered(mut self) -> (Vec<u32>, u32) {
        let mut labels = vec![0; self.parent.len()];
        let mut count = 0;
        for item in 0..self.parent.len() as u32 {
            let root = self.root(item);
            labels[item as usize] = if root == item {
                count += 1;
                count - 1
            } else {
                labels[root as usize]
            };
        }
        (labels, count)
    }
}
