//! Tables of a layer: names, fields, paths and what they lead to, all packed.

use std::collections::HashMap;
use std::io::{self, Seek, Write};

use super::sink::Sink;

/// A field of a prim or a property: its name and its value.
pub(super) type Field<'a> = (&'a str, u64);

#[derive(Default)]
pub(super) struct Tables {
    tokens: Vec<String>,
    known: HashMap<String, u32>,
    fields: Vec<(i32, u64)>,
    sets: Vec<i32>,
    /// Last names, negative for properties, and where the next path is.
    paths: Vec<[i32; 2]>,
    /// Paths, first fields and kinds.
    specs: Vec<[i32; 3]>,
}

impl Tables {
    pub(super) fn token(&mut self, text: &str) -> u32 {
        if let Some(&known) = self.known.get(text) {
            return known;
        }
        let index = self.tokens.len() as u32;
        self.tokens.push(text.to_owned());
        self.known.insert(text.to_owned(), index);
        index
    }

    /// Appends a prim or a property, after what it lies below; `jump` says where the next path is.
    pub(super) fn spec(&mut self, kind: u32, name: &str, jump: i32, fields: &[Field<'_>]) {
        let (token, path) = (self.token(name) as i32, self.paths.len() as i32);
        self.paths.push([if kind == crate::usd::binary::ATTRIBUTE { -token } else { token }, jump]);
        self.specs.push([path, self.sets.len() as i32, kind as i32]);
        for &(name, value) in fields {
            let token = self.token(name) as i32;
            self.sets.push(self.fields.len() as i32);
            self.fields.push((token, value));
        }
        self.sets.push(-1);
    }

    /// Writes all; gives where the list of sections is.
    pub(super) fn write<W: Write + Seek>(&self, sink: &mut Sink<W>) -> io::Result<u64> {
        let text: Vec<u8> = self.tokens.iter().flat_map(|token| token.bytes().chain([0])).collect();
        let values: Vec<u8> = self.fields.iter().flat_map(|(_, value)| value.to_le_bytes()).collect();
        let names: Vec<i32> = self.fields.iter().map(|field| field.0).collect();
        let count = |count: usize| (count as u64).to_le_bytes().to_vec();
        let column = |numbers: Vec<i32>| sized(&integers(&numbers));
        let paths = self.paths.len();
        let [last_names, jumps] = [0, 1].map(|k| column(self.paths.iter().map(|path| path[k]).collect()));
        let [at, first, kinds] = [0, 1, 2].map(|k| column(self.specs.iter().map(|spec| spec[k]).collect()));
        let sections = [
            ("TOKENS", [count(self.tokens.len()), count(text.len()), sized(&packed(&text))].concat()),
            ("STRINGS", count(0)),
            ("FIELDS", [count(self.fields.len()), column(names), sized(&packed(&values))].concat()),
            ("FIELDSETS", [count(self.sets.len()), column(self.sets.clone())].concat()),
            ("PATHS", [count(paths), count(paths), column((0..paths as i32).collect()), last_names, jumps].concat()),
            ("SPECS", [count(self.specs.len()), at, first, kinds].concat()),
        ];
        let mut list = count(sections.len());
        for (name, bytes) in sections {
            let at = sink.put(&bytes)?;
            let mut entry = [0; 16];
            entry[..name.len()].copy_from_slice(name.as_bytes());
            list.extend(entry);
            list.extend(at.to_le_bytes());
            list.extend(count(bytes.len()));
        }
        sink.put(&list)
    }
}

fn sized(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u64).to_le_bytes()[..], bytes].concat()
}

/// Packed by LZ4, in one piece.
fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![0];
    out.extend(lz4_flex::block::compress(bytes));
    out
}

/// Whole numbers by their differences, and these by how many bytes they need.
pub(super) fn integers(numbers: &[i32]) -> Vec<u8> {
    let differences = || {
        let before = std::iter::once(0).chain(numbers.iter().copied());
        numbers.iter().zip(before).map(|(&number, before)| number.wrapping_sub(before))
    };
    let mut times = HashMap::new();
    differences().for_each(|difference| *times.entry(difference).or_insert(0_usize) += 1);
    let usual = times.into_iter().max_by_key(|&(difference, times)| (times, difference)).map_or(0, |(usual, _)| usual);
    let (mut codes, mut rest) = (vec![0; numbers.len().div_ceil(4)], Vec::new());
    for (k, difference) in differences().enumerate() {
        let bytes = difference.to_le_bytes();
        let code = match difference {
            _ if difference == usual => 0,
            -0x80..=0x7f => 1,
            -0x8000..=0x7fff => 2,
            _ => 3,
        };
        rest.extend(&bytes[..[0, 1, 2, 4][code]]);
        codes[k / 4] |= (code as u8) << (2 * (k % 4));
    }
    packed(&[&usual.to_le_bytes()[..], &codes, &rest].concat())
}
