//! Indices: of triangles that share edges with recent ones, and of anything else.

use super::bytes::{number, signed};

/// Indices of `count` triangles.
pub(super) fn triangles(stream: &[u8], count: usize) -> Option<Vec<u32>> {
    let (&0xe1, stream) = stream.split_first()? else { return None };
    let (codes, rest) = stream.split_at_checked(count)?;
    let (data, table) = rest.split_last_chunk::<16>()?;
    let is_free = |entry: &u8| entry & 15 != 15 && entry >> 4 != 15;
    if table[14..] != [0, 0] || !table.iter().all(is_free) {
        return None;
    }
    let mut state = State { data, next: 0, last: 0, edges: Recent::default(), vertices: Recent::default() };
    let mut out = Vec::with_capacity(3 * count);
    for &code in codes {
        out.extend(state.triangle(code, table)?);
    }
    state.data.is_empty().then_some(out)
}

/// `count` indices, each a difference to one of two.
pub(super) fn sequence(stream: &[u8], count: usize) -> Option<Vec<u32>> {
    let (&0xd1, stream) = stream.split_first()? else { return None };
    let (data, _) = stream.split_last_chunk::<4>()?;
    let (mut data, mut last) = (data, [0_u32; 2]);
    // Every index takes a byte.
    if count > data.len() {
        return None;
    }
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let value = number(&mut data)?;
        let last = &mut last[(value & 1) as usize];
        *last = last.wrapping_add(signed(value >> 1));
        out.push(*last);
    }
    data.is_empty().then_some(out)
}

/// The last sixteen of what was pushed.
#[derive(Default)]
struct Recent<T> {
    entries: [T; 16],
    pushed: usize,
}

impl<T: Copy> Recent<T> {
    fn push(&mut self, entry: T) {
        self.entries[self.pushed % 16] = entry;
        self.pushed += 1;
    }

    /// The entry pushed `back` pushes before the last one.
    fn get(&self, back: u8) -> Option<T> {
        Some(self.entries[self.pushed.checked_sub(usize::from(back) + 1)? % 16])
    }
}

struct State<'a> {
    data: &'a [u8],
    /// The lowest index that was not used yet.
    next: u32,
    last: u32,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
}

impl State<'_> {
    fn triangle(&mut self, code: u8, table: &[u8; 16]) -> Option<[u32; 3]> {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            return self.beside_edge(high, low);
        }
        let (first, corners) = match low {
            0..14 => (0, table[usize::from(low)]),
            _ => {
                let corners = *self.data.split_off_first()?;
                if corners == 0 {
                    self.next = 0;
                }
                (if low == 14 { 0 } else { 15 }, corners)
            }
        };
        let a = self.corner(first)?;
        let b = self.corner(corners >> 4)?;
        let c = self.corner(corners & 15)?;
        [[b, a], [c, b], [a, c]].into_iter().for_each(|edge| self.edges.push(edge));
        for (vertex, said) in [(a, 0), (b, corners >> 4), (c, corners & 15)] {
            if matches!(said, 0 | 15) {
                self.vertices.push(vertex);
            }
        }
        Some([a, b, c])
    }

    fn beside_edge(&mut self, edge: u8, said: u8) -> Option<[u32; 3]> {
        let [a, b] = self.edges.get(edge)?;
        let c = match said {
            0 => self.unused(),
            1..13 => self.vertices.get(said)?,
            13 => self.written(u32::MAX),
            14 => self.written(1),
            _ => self.written_out()?,
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        if !(1..13).contains(&said) {
            self.vertices.push(c);
        }
        Some([a, b, c])
    }

    /// A corner of a triangle that shares no edge.
    fn corner(&mut self, said: u8) -> Option<u32> {
        match said {
            0 => Some(self.unused()),
            1..15 => self.vertices.get(said - 1),
            _ => self.written_out(),
        }
    }

    fn unused(&mut self) -> u32 {
        let index = self.next;
        self.next = index.wrapping_add(1);
        index
    }

    fn written_out(&mut self) -> Option<u32> {
        let difference = signed(number(&mut self.data)?);
        Some(self.written(difference))
    }

    fn written(&mut self, difference: u32) -> u32 {
        self.last = self.last.wrapping_add(difference);
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(header: u8, parts: &[&[u8]], tail: usize) -> Vec<u8> {
        [&[header][..], &parts.concat(), &vec![0; tail]].concat()
    }

    #[test]
    fn triangles_follow_edges_and_vertices() {
        // A new triangle, one on its last edge (0 2) with a new vertex, and one written out.
        let found = triangles(&stream(0xe1, &[&[0xf0, 0x00, 0xff], &[0xf2, 10, 1]], 16), 3);
        assert_eq!(found, Some(vec![0, 1, 2, 0, 2, 3, 5, 4, 2]));
    }

    #[test]
    fn streams_that_refer_to_nothing_or_end_early_or_late_are_refused() {
        for (codes, data) in [(&[0x00][..], &[][..]), (&[0xf0, 0x30], &[]), (&[0xff], &[]), (&[0xf0], &[7])] {
            assert_eq!(triangles(&stream(0xe1, &[codes, data], 16), codes.len()), None, "{codes:?} {data:?}");
        }
        assert_eq!(triangles(&[0xe1; 5], 1), None);
        assert_eq!(triangles(&stream(0xe1, &[&[0xf0]], 16), usize::MAX), None);
        assert_eq!(sequence(&stream(0xd1, &[&[0x80]], 4), 1), None);
    }

    #[test]
    fn a_sequence_counts_from_two_places() {
        assert_eq!(sequence(&stream(0xd1, &[&[4, 5, 4, 3]], 4), 4), Some(vec![1, 1, 2, 0]));
    }
}
