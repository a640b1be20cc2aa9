//! Numbers of vertices by move to front (Bentley, Sleator, Tarjan and Wei 1986) over the mesh.
//!
//! Neighbours are usually numbered soon after each other. So all vertices stand in a list, those
//! near the last numbered in front, and each is coded by its place in the list.

use crate::entropy::{BinaryModel, Coder, SIZES, size_class, unary};
use crate::fenwick::Counted;
use cager_geometry::topology::Adjacency;

/// Vertices with more neighbours move none of them when one of these is numbered.
const MAX_PASSED_ON: usize = 16;
/// Most points for which neighbours of neighbours are moved too: that takes several times as long.
pub(crate) const MAX_FAR_POINTS: usize = 1 << 17;

/// Codes the vertex of each number; `is_far` moves neighbours of neighbours to the front too.
/// `None` where what is read is no vertex.
pub(crate) fn code_order(
    coder: &mut impl Coder,
    adjacency: &Adjacency,
    is_far: bool,
    given: Option<&[u32]>,
) -> Option<Vec<u32>> {
    let points = adjacency.points();
    let mut list = RecencyList::new(points);
    let mut places = Places::default();
    let mut found = Vec::with_capacity(points);
    let mut near = Vec::new();
    for number in 0..points {
        let place = places.code(coder, given.map_or(0, |given| list.place(given[number])));
        let vertex = list.take(place)?;
        found.push(vertex);
        let neighbours = adjacency.of(vertex as usize);
        if is_far {
            let passing = neighbours.iter().map(|&w| adjacency.of(w as usize));
            near.extend(passing.filter(|list| list.len() <= MAX_PASSED_ON).flatten());
            list.move_to_front(&mut near);
        }
        near.extend(neighbours);
        list.move_to_front(&mut near);
    }
    Some(found)
}

/// Vertices without a number, the last moved to the front first, each with the time of its move.
struct RecencyList {
    times: Vec<u32>,
    /// Vertices by these times.
    at: Vec<u32>,
    waiting: Counted,
    next: u32,
}

/// The time of vertices that have their number.
const GONE: u32 = u32::MAX;

impl RecencyList {
    /// The first vertex stands in front.
    fn new(points: usize) -> Self {
        let capacity = 4 * points + 64;
        let mut list =
            Self { times: vec![GONE; points], at: vec![0; capacity], waiting: Counted::none(capacity), next: 0 };
        (0..points as u32).rev().for_each(|vertex| list.push(vertex));
        list
    }

    fn push(&mut self, vertex: u32) {
        self.times[vertex as usize] = self.next;
        self.at[self.next as usize] = vertex;
        self.waiting.insert(self.next);
        self.next += 1;
    }

    /// How many stand before this one.
    fn place(&self, vertex: u32) -> u32 {
        self.waiting.count() - 1 - self.waiting.before(self.times[vertex as usize])
    }

    /// Takes out the one that has so many before it.
    fn take(&mut self, place: u32) -> Option<u32> {
        let time = self.waiting.find(self.waiting.count().checked_sub(1)?.checked_sub(place)?)?;
        self.waiting.remove(time);
        let vertex = self.at[time as usize];
        self.times[vertex as usize] = GONE;
        Some(vertex)
    }

    /// Moves those that wait to the front in their order, and empties the list.
    fn move_to_front(&mut self, vertices: &mut Vec<u32>) {
        vertices.retain(|&vertex| self.times[vertex as usize] != GONE);
        vertices.sort_unstable_by_key(|&vertex| self.times[vertex as usize]);
        vertices.dedup();
        if self.next as usize + vertices.len() > self.at.len() {
            self.renew();
        }
        for vertex in vertices.drain(..) {
            self.waiting.remove(self.times[vertex as usize]);
            self.push(vertex);
        }
    }

    /// Counts the times anew from 0.
    fn renew(&mut self) {
        let waiting = self.at[..self.next as usize].iter().enumerate();
        let in_order: Vec<u32> =
            waiting.filter(|(t, v)| self.times[**v as usize] == *t as u32).map(|(_, &v)| v).collect();
        self.waiting = Counted::none(self.at.len());
        self.next = 0;
        in_order.into_iter().for_each(|vertex| self.push(vertex));
    }
}

/// Models of places plus one: the number of binary digits by the place before, then the digits.
struct Places {
    digits: Vec<[BinaryModel; 31]>,
    leading: [[BinaryModel; 4]; 32],
    before: u32,
}

impl Default for Places {
    fn default() -> Self {
        Self { digits: vec![[BinaryModel::default(); 31]; SIZES], leading: Default::default(), before: 0 }
    }
}

impl Places {
    fn code(&mut self, coder: &mut impl Coder, place: u32) -> u32 {
        let number = place + 1;
        let count = unary(coder, &mut self.digits[size_class(self.before)], number.ilog2());
        // The first two digits after the leading 1 by models.
        let modelled = count.min(2);
        let mut found = 1;
        for k in (count - modelled..count).rev() {
            found = 2 * found
                + u32::from(coder.bit(&mut self.leading[count as usize][found as usize], number >> k & 1 == 1));
        }
        let rest = count - modelled;
        found = found << rest | coder.bits(rest, number & ((1 << rest) - 1));
        self.before = found - 1;
        self.before
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::entropy::{Decoder, Encoder};
    use cager_geometry::mesh::Polygons;

    fn grid(side: u32) -> Adjacency {
        let mut faces = Polygons::new();
        for (i, j) in (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| i * side + j;
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        Adjacency::new(&faces, (side * side) as usize)
    }

    #[test]
    fn any_order_comes_back_and_rows_of_a_grid_take_little() {
        let side = 60;
        let adjacency = grid(side);
        let mut random = fastrand::Rng::with_seed(2);
        let points = side * side;
        let columns: Vec<u32> = (0..points).map(|k| (k % side) * side + k / side).collect();
        let mut shuffled = columns.clone();
        random.shuffle(&mut shuffled);
        for is_far in [false, true] {
            for (order, most_bits) in [(&columns, 2.0), (&shuffled, 13.0)] {
                let mut encoder = Encoder::default();
                assert_eq!(code_order(&mut encoder, &adjacency, is_far, Some(order)).as_ref(), Some(order));
                let bytes = encoder.into_bytes();
                let bits = 8.0 * bytes.len() as f64 / f64::from(points);
                assert!(bits < most_bits, "{bits}");
                let mut decoder = Decoder::new(&bytes).unwrap();
                assert_eq!(code_order(&mut decoder, &adjacency, is_far, None).as_ref(), Some(order));
            }
        }
    }

    #[test]
    fn what_is_read_is_an_order_or_nothing() {
        let adjacency = grid(8);
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..300 {
            let bytes: Vec<u8> = (0..4 * random.usize(..40)).map(|_| random.u8(..)).collect();
            let mut decoder = Decoder::new(&bytes).unwrap();
            if let Some(mut order) = code_order(&mut decoder, &adjacency, random.bool(), None) {
                order.sort_unstable();
                assert!(order.iter().enumerate().all(|(k, &v)| k == v as usize) && order.len() == 64);
            }
        }
    }
}
