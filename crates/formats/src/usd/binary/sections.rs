//! The sections of a binary layer: what it holds and where; values stay where they are.

use super::file::{File, Rep};
use super::pack::{unpacked, unpacked_integers};
use crate::error::Fault;
use crate::scene::{Allowance, Fields, damaged};
use crate::usd::layer::{DEEPEST, too_deep};

/// Bytes that all sections may unpack to, for each byte of the file and for the smallest of files.
const UNPACKED: u64 = 64;
const UNPACKED_ALWAYS: u64 = 1 << 16;
/// Sections of a file, of which these are read.
const MOST_SECTIONS: u64 = 64;

/// Bytes of a name or a path of a file that are kept.
const LONGEST_STRING: usize = 4096;

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

pub(super) struct Sections {
    text: Vec<u8>,
    /// Where the tokens begin in the text, and where the last ends.
    starts: Vec<u32>,
    /// Which tokens strings are.
    strings: Vec<u32>,
    fields: Vec<(u32, Rep)>,
    /// Indices of fields, set after set, each with an end that is no index.
    sets: Vec<i32>,
    pub(super) paths: Vec<Path>,
    /// In the order of their paths, of each path one.
    pub(super) specs: Vec<Spec>,
}

impl Sections {
    pub(super) fn read(file: &mut File<'_>, contents: u64) -> Result<Self, Fault> {
        let count = file.source.number(contents)?;
        if count > MOST_SECTIONS {
            return Err(damaged("it has more sections than any program writes"));
        }
        let table = file.source.bytes(contents.saturating_add(8), count, 32)?;
        let mut read = |name: &str| -> Result<Vec<u8>, Fault> {
            for entry in table.as_chunks::<32>().0 {
                let mut fields = Fields(entry);
                if fields.take(16)?.split(|&b| b == 0).next() == Some(name.as_bytes()) {
                    let (start, length) = (fields.number()?, fields.number()?);
                    return file.source.bytes(start, length, 1);
                }
            }
            Err(damaged(&format!("it has no section {name}")))
        };
        let strings = read("STRINGS").unwrap_or_default();
        let [tokens, fields, sets, tree, specs] =
            [read("TOKENS")?, read("FIELDS")?, read("FIELDSETS")?, read("PATHS")?, read("SPECS")?];
        let mut allowance = Allowance(file.source.length.saturating_mul(UNPACKED).saturating_add(UNPACKED_ALWAYS));

        let mut section = Fields(&tokens);
        let (count, length) = (section.number()?, section.number()?);
        let text = unpacked(&mut section, length, &mut allowance)?;
        allowance.take(count, 4)?;
        if text.len() >= u32::MAX as usize {
            return Err(damaged("it has more names than any program writes"));
        }
        let ends = text.iter().enumerate().filter(|&(_, &byte)| byte == 0).map(|(end, _)| end as u32 + 1);
        let starts: Vec<u32> = std::iter::once(0).chain(ends).collect();
        if starts.len() as u64 <= count {
            return Err(damaged("it has fewer names than it says"));
        }

        // Behind how many they are.
        let strings = strings.get(8..).unwrap_or_default().as_chunks().0;
        let strings = strings.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();

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
            return Err(damaged("it describes what has no path"));
        }
        Ok(Self { text, starts, strings, fields, sets, paths, specs })
    }

    /// A name by its index; empty where there is none.
    pub(super) fn token(&self, index: u32) -> &[u8] {
        match self.starts.get(index as usize..).and_then(|starts| starts.get(..2)) {
            Some(&[start, end]) => &self.text[start as usize..end as usize - 1],
            _ => &[],
        }
    }

    /// A string by its index; empty where there is none.
    pub(super) fn string(&self, index: u32) -> String {
        let token = self.strings.get(index as usize).map_or(&[][..], |&token| self.token(token));
        String::from_utf8_lossy(&token[..token.len().min(LONGEST_STRING)]).into_owned()
    }

    /// The names down to a prim, each behind a `/`, or to its property, behind a dot; empty for the
    /// root and for no path.
    pub(super) fn path(&self, index: u32) -> String {
        let mut names = Vec::new();
        let mut at = self.paths.get(index as usize).copied().unwrap_or_default();
        while at.depth > 0 {
            let name = self.token(at.name);
            names.push(String::from_utf8_lossy(&name[..name.len().min(LONGEST_STRING)]));
            names.push(if at.is_property { "." } else { "/" }.into());
            at = self.paths[at.parent as usize];
        }
        names.iter().rev().map(|name| &**name).collect()
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

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Path {
    /// Index of the path above it; of the top its own.
    pub(super) parent: u32,
    pub(super) name: u32,
    pub(super) depth: u32,
    pub(super) is_property: bool,
}

/// In place of the distance to the next sibling: it follows at once; there is none, but a child
/// follows; or neither.
pub(crate) const SIBLING: i32 = 0;
pub(crate) const CHILD_ONLY: i32 = -1;
pub(crate) const LAST: i32 = -2;

/// Paths by their indices, of which there are `count`; `names` of properties are negative.
pub(super) fn paths(count: usize, [indices, names, jumps]: [&[i32]; 3]) -> Result<Vec<Path>, Fault> {
    let wrong = || damaged("its paths are not a tree");
    let mut paths = vec![Path::default(); count];
    let mut known = vec![false; count];
    // Places that are yet to be entered, and the paths above them.
    let mut waiting = if indices.is_empty() { Vec::new() } else { vec![(0, None)] };
    while let Some((mut place, above)) = waiting.pop() {
        loop {
            let index = indices.get(place).and_then(|&index| u32::try_from(index).ok()).ok_or_else(wrong)?;
            // Once each, so that none lies below itself.
            let is_new = known.get_mut(index as usize).filter(|known| !**known).ok_or_else(wrong)?;
            *is_new = true;
            let (parent, depth) = above.map_or((index, 0), |(parent, depth)| (parent, depth + 1));
            // A property lies below the last of so many prims.
            if depth > DEEPEST + 1 {
                return Err(too_deep());
            }
            paths[index as usize] =
                Path { parent, depth, name: names[place].unsigned_abs(), is_property: names[place] < 0 };
            match jumps[place] {
                LAST => break,
                SIBLING => place += 1,
                jump => {
                    if jump > 0 {
                        waiting.push((place + jump as usize, above));
                    } else if jump != CHILD_ONLY {
                        return Err(wrong());
                    }
                    waiting.push((place + 1, Some((index, depth))));
                    break;
                }
            }
        }
    }
    Ok(paths)
}
