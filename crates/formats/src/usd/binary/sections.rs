//! The sections of a binary layer, which say what it holds and where; values are left where they are.

use std::io::{Read, Seek};

use super::file::{File, Rep};
use super::pack::{unpacked, unpacked_integers};
use super::paths::{Path, paths};
use crate::error::Fault;
use crate::scene::{Allowance, Failure, Fields, damaged};

/// Bytes that all sections may unpack to, for each byte of the file and for the smallest of files.
const UNPACKED: u64 = 64;
const UNPACKED_ALWAYS: u64 = 1 << 16;
/// Sections of a file, of which these are read.
const MOST_SECTIONS: u64 = 64;

/// Fields of a prim or an attribute; programs write some thirty.
const MOST_FIELDS: usize = 256;

/// Something with fields: a prim or a property.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spec {
    pub(super) path: u32,
    /// Index of its first field in the sets.
    pub(super) set: u32,
    pub(super) kind: u32,
}

/// What the sections hold.
pub(super) struct Sections {
    text: Vec<u8>,
    /// Where the tokens begin in the text, and where the last ends.
    starts: Vec<u32>,
    fields: Vec<(u32, Rep)>,
    /// Indices of fields, set after set, each with an end that is no index.
    sets: Vec<i32>,
    pub(super) paths: Vec<Path>,
    /// In the order of their paths, of each path one.
    pub(super) specs: Vec<Spec>,
}

impl Sections {
    pub(super) fn read<R: Read + Seek>(file: &mut File<R>, contents: u64) -> Result<Self, Failure> {
        let count = file.source.number(contents)?;
        if count > MOST_SECTIONS {
            return Err(damaged("it has more sections than any program writes").into());
        }
        let table = file.source.bytes(contents.saturating_add(8), count, 32)?;
        let mut read = |name: &str| -> Result<Vec<u8>, Failure> {
            for entry in table.as_chunks::<32>().0 {
                let mut fields = Fields(entry);
                if fields.take(16)?.split(|&b| b == 0).next() == Some(name.as_bytes()) {
                    let (start, length) = (fields.number()?, fields.number()?);
                    return file.source.bytes(start, length, 1);
                }
            }
            Err(damaged(&format!("it has no section {name}")).into())
        };
        let [tokens, fields, sets, tree, specs] =
            [read("TOKENS")?, read("FIELDS")?, read("FIELDSETS")?, read("PATHS")?, read("SPECS")?];
        let mut allowance = Allowance(file.source.length.saturating_mul(UNPACKED).saturating_add(UNPACKED_ALWAYS));

        let mut section = Fields(&tokens);
        let (count, length) = (section.number()?, section.number()?);
        let text = unpacked(&mut section, length, &mut allowance)?;
        allowance.take(count, 4)?;
        if text.len() >= u32::MAX as usize {
            return Err(damaged("it has more names than any program writes").into());
        }
        let ends = text.iter().enumerate().filter(|&(_, &byte)| byte == 0).map(|(end, _)| end as u32 + 1);
        let starts: Vec<u32> = std::iter::once(0).chain(ends).collect();
        if starts.len() as u64 <= count {
            return Err(damaged("it has fewer names than it says").into());
        }

        let mut section = Fields(&fields);
        let count = section.number()?;
        let names = unpacked_integers(&mut section, count, &mut allowance)?;
        let values = unpacked(&mut section, count.saturating_mul(8), &mut allowance)?;
        let values = values.as_chunks().0.iter().map(|bytes| Rep(u64::from_le_bytes(*bytes)));
        let fields = names.iter().map(|&name| name.unsigned_abs()).zip(values).collect();

        let mut section = Fields(&sets);
        let count = section.number()?;
        let sets = unpacked_integers(&mut section, count, &mut allowance)?;

        let mut section = Fields(&tree);
        let (count, places) = (section.number()?, section.number()?);
        let mut integers = || unpacked_integers(&mut section, places, &mut allowance);
        let [indices, names, jumps] = [integers()?, integers()?, integers()?];
        let paths = paths(allowance.take(count, 12)?, [&indices, &names, &jumps])?;

        let mut section = Fields(&specs);
        let count = section.number()?;
        let mut integers = || unpacked_integers(&mut section, count, &mut allowance);
        let [at, first, kinds] = [integers()?, integers()?, integers()?];
        let specs = at.iter().zip(&first).zip(&kinds);
        let mut specs: Vec<Spec> = specs
            .map(|((&path, &set), &kind)| Spec {
                path: path.unsigned_abs(),
                set: set.unsigned_abs(),
                kind: kind.unsigned_abs(),
            })
            .collect();
        specs.sort_by_key(|spec| spec.path);
        specs.dedup_by_key(|spec| spec.path);
        if specs.last().is_some_and(|spec| spec.path as usize >= paths.len()) {
            return Err(damaged("it describes what has no path").into());
        }
        Ok(Self { text, starts, fields, sets, paths, specs })
    }

    /// A name by its index; empty where there is none.
    pub(super) fn token(&self, index: u32) -> &[u8] {
        match self.starts.get(index as usize..).and_then(|starts| starts.get(..2)) {
            Some(&[start, end]) => &self.text[start as usize..end as usize - 1],
            _ => &[],
        }
    }

    /// The fields of a spec: their names and their values.
    pub(super) fn fields(&self, spec: Spec) -> impl Iterator<Item = Result<(&[u8], Rep), Fault>> {
        let set = self.sets.get(spec.set as usize..).unwrap_or_default().iter();
        set.map_while(|&index| usize::try_from(index).ok()).enumerate().map(|(k, index)| {
            // Many may have the same set.
            if k >= MOST_FIELDS {
                return Err(damaged("it describes a prim by more fields than any program writes"));
            }
            let &(name, value) = self.fields.get(index).ok_or_else(|| damaged("a field is missing"))?;
            Ok((self.token(name), value))
        })
    }

    /// A field of a spec.
    pub(super) fn field(&self, spec: Spec, name: &str) -> Result<Option<Rep>, Fault> {
        for field in self.fields(spec) {
            let (found, value) = field?;
            if found == name.as_bytes() {
                return Ok(Some(value));
            }
        }
        Ok(None)
    }
}
