//! Tables of a layer: names, fields, paths and what they lead to, all packed.

use std::collections::HashMap;
use std::io::{self, Seek, Write};

use super::sink::Sink;
use crate::usd::binary::{CHILD_ONLY, LAST, ROOT, SIBLING, kind};

/// A field of a prim or a property: its name and its value.
pub(super) type Field<'a> = (&'a str, u64);

#[derive(Default)]
pub(super) struct Tables {
    tokens: Vec<String>,
    known: HashMap<String, u32>,
    /// Tokens that are strings as well.
    strings: Vec<u32>,
    fields: Vec<(i32, u64)>,
    sets: Vec<i32>,
    /// Last names, negative for properties, and how many prims are above.
    paths: Vec<[i32; 2]>,
    /// Paths, first fields and kinds.
    specs: Vec<[i32; 3]>,
    /// The path of the prim that is open, and its length at each prim above.
    open: String,
    lengths: Vec<usize>,
    /// What targets may be.
    places: HashMap<String, i32>,
    /// Fields whose value is the place of a path, and that path.
    targets: Vec<(usize, String)>,
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

    pub(super) fn string(&mut self, text: &str) -> u32 {
        let token = self.token(text);
        self.strings.push(token);
        self.strings.len() as u32 - 1
    }

    /// Begins a prim below the one that is open, or the root.
    pub(super) fn begin(&mut self, kind: u32, name: &str, fields: &[Field<'_>]) {
        let (place, depth) = (self.paths.len() as i32, self.lengths.len() as i32);
        let token = self.spec(kind, name, fields);
        self.sets.push(-1);
        self.paths.push([token, depth]);
        self.lengths.push(self.open.len());
        if kind != ROOT {
            self.open.push('/');
            self.open.push_str(name);
            self.places.insert(self.open.clone(), place);
        }
    }

    /// Ends the prim that is open.
    pub(super) fn end(&mut self) {
        self.open.truncate(self.lengths.pop().unwrap_or(0));
    }

    /// Appends a property of the prim that is open, and what it leads to.
    pub(super) fn property(&mut self, kind: u32, name: &str, fields: &[Field<'_>], target: Option<(&str, String)>) {
        let (place, depth) = (self.paths.len() as i32, self.lengths.len() as i32);
        let token = self.spec(kind, name, fields);
        self.paths.push([-token, depth]);
        if name.starts_with("outputs:") {
            self.places.insert(format!("{}.{name}", self.open), place);
        }
        if let Some((field, path)) = target {
            self.targets.push((self.fields.len(), path));
            self.add(field, 0);
        }
        self.sets.push(-1);
    }

    fn spec(&mut self, kind: u32, name: &str, fields: &[Field<'_>]) -> i32 {
        let token = self.token(name) as i32;
        self.specs.push([self.paths.len() as i32, self.sets.len() as i32, kind as i32]);
        for &(name, value) in fields {
            self.add(name, value);
        }
        token
    }

    fn add(&mut self, name: &str, value: u64) {
        let token = self.token(name) as i32;
        self.sets.push(self.fields.len() as i32);
        self.fields.push((token, value));
    }

    /// Writes what targets are.
    fn write_targets<W: Write + Seek>(&mut self, sink: &mut Sink<W>) -> io::Result<()> {
        for (field, path) in std::mem::take(&mut self.targets) {
            let place = self.places.get(&path).copied().unwrap_or(0);
            // A list that replaces others, of one path.
            let list = [&[3][..], &1_u64.to_le_bytes(), &place.to_le_bytes()].concat();
            self.fields[field].1 = u64::from(kind::PATH_LIST) << 48 | sink.put(&list)?;
        }
        Ok(())
    }

    /// For each path, where the next one beside it is.
    fn jumps(&self) -> Vec<i32> {
        let mut jumps = vec![LAST; self.paths.len()];
        // The first path at each depth, of those that come later and have the same above them.
        let mut next: Vec<Option<usize>> = Vec::new();
        for (place, &[_, depth]) in self.paths.iter().enumerate().rev() {
            let depth = depth as usize;
            let is_parent = next.get(depth + 1).is_some();
            jumps[place] = match next.get(depth).copied().flatten() {
                Some(sibling) if is_parent => (sibling - place) as i32,
                Some(_) => SIBLING,
                None if is_parent => CHILD_ONLY,
                None => LAST,
            };
            next.resize(depth + 1, None);
            next[depth] = Some(place);
        }
        jumps
    }

    /// Writes all; gives where the list of sections is.
    pub(super) fn write<W: Write + Seek>(&mut self, sink: &mut Sink<W>) -> io::Result<u64> {
        self.write_targets(sink)?;
        let text: Vec<u8> = self.tokens.iter().flat_map(|token| token.bytes().chain([0])).collect();
        let values: Vec<u8> = self.fields.iter().flat_map(|(_, value)| value.to_le_bytes()).collect();
        let names: Vec<i32> = self.fields.iter().map(|field| field.0).collect();
        let count = |count: usize| (count as u64).to_le_bytes().to_vec();
        let column = |numbers: Vec<i32>| sized(&integers(&numbers));
        let paths = self.paths.len();
        let last_names = column(self.paths.iter().map(|path| path[0]).collect());
        let jumps = column(self.jumps());
        let strings = self.strings.iter().flat_map(|token| token.to_le_bytes()).collect();
        let [at, first, kinds] = [0, 1, 2].map(|k| column(self.specs.iter().map(|spec| spec[k]).collect()));
        let sections = [
            ("TOKENS", [count(self.tokens.len()), count(text.len()), sized(&packed(&text))].concat()),
            ("STRINGS", [count(self.strings.len()), strings].concat()),
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
