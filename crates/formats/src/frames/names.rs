//! The order of a capture's files by their names, and whether they are one sequence at all.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::pieces::{Name, below_folder};
use super::several::several;
use super::{maya, numbers};
use crate::natural;

/// The files of one sequence in their order, with the number of each where the names tell one.
#[derive(Debug, PartialEq)]
pub(super) struct Sequence {
    pub(super) files: Vec<PathBuf>,
    pub(super) numbers: Option<Vec<f64>>,
}

impl Sequence {
    /// Files in the order of their numbers, or in natural order where names have none.
    ///
    /// # Errors
    /// Files of several sequences, or several of one number: patterns that pick some of them.
    pub(super) fn of(files: Vec<PathBuf>) -> Result<Self, String> {
        let Self { files, .. } = Self::of_all(files);
        let numbers = match maya::numbers_of(&files) {
            None => numbers_of_names(&files)?,
            numbers => numbers,
        };
        let Some(numbers) = numbers else { return Ok(Self { files, numbers: None }) };
        let mut numbered: Vec<(f64, PathBuf)> = numbers.into_iter().zip(files).collect();
        numbered.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (numbers, files) = numbered.into_iter().unzip();
        Ok(Self { files, numbers: Some(numbers) })
    }

    /// All files in natural order, whatever sequences they belong to.
    pub(super) fn of_all(mut files: Vec<PathBuf>) -> Self {
        files.sort_by(|a, b| natural::compare(a.as_os_str().as_encoded_bytes(), b.as_os_str().as_encoded_bytes()));
        Self { files, numbers: None }
    }
}

/// Whether a file is called as one more frame of these would be.
pub(super) fn is_one_of(file: &Path, others: &[PathBuf]) -> bool {
    let all: Vec<PathBuf> = others.iter().cloned().chain([file.to_owned()]).collect();
    let extension = |path: &Path| path.extension().map(OsStr::to_ascii_lowercase);
    let same = others.first().is_some_and(|other| extension(other) == extension(file));
    same && Sequence::of(all).is_ok_and(|sequence| sequence.numbers.is_some())
}

/// The number that is all in which names differ, or else digits that differ in all of them.
///
/// # Errors
/// As of [`Sequence::of`].
fn numbers_of_names(files: &[PathBuf]) -> Result<Option<Vec<f64>>, String> {
    let (folder, below) = below_folder(files);
    let names: Vec<Name<'_>> = below.iter().map(|name| Name::of(name)).collect();
    let labels: Vec<&str> = names.iter().map(|name| name.label).collect();
    if let Some(numbers) = numbers::of_names(&labels) {
        return Ok(Some(numbers));
    }
    let mut alike: BTreeMap<String, Vec<&Name<'_>>> = BTreeMap::new();
    names.iter().for_each(|name| alike.entry(name.texts()).or_default().push(name));
    if alike.len() == names.len() {
        // Each pose has a name of its own, such as `run` and `walk`, or `01_run` and `02_walk`.
        let source = |copy: &Name<'_>| original(copy.label).and_then(|from| names.iter().find(|n| n.label == from));
        return match names.iter().find_map(|copy| Some((copy, source(copy)?))) {
            None => Ok(None),
            Some((copy, from)) => {
                Err(format!("{copy} looks like a copy of {from}; keep one of them, or name the frames by a pattern"))
            }
        };
    }
    if alike.len() == 1 {
        let columns = distinct_columns(&names.iter().collect::<Vec<_>>());
        if !columns.is_empty() {
            // No numbers that the order of names contradicts, such as seconds beside minutes.
            let mut ascending = columns.into_iter().filter(|values| values.windows(2).all(|pair| pair[0] < pair[1]));
            let first = ascending.next();
            let even = first.iter().cloned().chain(ascending).find(|values| numbers::evenly_spaced(values));
            return Ok(even.or(first).filter(|values| values.iter().all(|&value| value < 1e15)));
        }
    } else if leading_numbers_differ(&names) {
        return Ok(None);
    }
    let parts = |files: Vec<_>| if distinct_columns(&files).is_empty() { split(files) } else { vec![files] };
    let mut groups: Vec<Vec<&Name<'_>>> = alike.into_values().flat_map(parts).collect();
    if groups.len() == 1 {
        return Ok(None);
    }
    groups.sort_by_key(|files| Reverse(files.len()));
    Err(several(&folder, &names, &groups))
}

/// The name that a browser or a file manager gave `(1)` or `- Copy` for a second file.
fn original(label: &str) -> Option<&str> {
    let counted = label.strip_suffix(')').and_then(|rest| rest.rsplit_once(" ("));
    let counted = counted.filter(|(_, digits)| digits.bytes().all(|b| b.is_ascii_digit())).map(|(name, _)| name);
    let copy = ["Copy", "copy"].iter().find_map(|word| counted.unwrap_or(label).strip_suffix(word));
    copy.map(|name| name.trim_end_matches([' ', '-', '_'])).or(counted)
}

/// Whether all names begin alike and go on with different numbers: `f_000_a1b2 f_001_c3d4`.
fn leading_numbers_differ(names: &[Name<'_>]) -> bool {
    let mut seen = BTreeSet::new();
    let begin = names.first().map(|name| name.pieces[0]);
    names.iter().all(|name| {
        let number = name.values().first().copied();
        Some(name.pieces[0]) == begin && number.is_some_and(|number| seen.insert(number))
    })
}

/// The numbers in which all of these differ, from left to right.
fn distinct_columns(files: &[&Name<'_>]) -> Vec<Vec<f64>> {
    let columns = files.first().map_or(0, |name| name.numbers().count());
    let values = |column: usize| files.iter().map(|name| name.numbers().nth(column)?.parse().ok()).collect();
    (0..columns).filter_map(values).filter(|values: &Vec<f64>| numbers::distinct(values)).collect()
}

/// Files whose names have the same texts in parts, with one number for the frame in each.
fn split<'a>(files: Vec<&'a Name<'a>>) -> Vec<Vec<&'a Name<'a>>> {
    let all: BTreeSet<Vec<&str>> = files.iter().map(|name| name.values()).collect();
    // Frames are what there is most of; versions and takes mostly come before them.
    let different = |column: usize| all.iter().map(|values| values[column]).collect::<BTreeSet<_>>().len();
    let is_version = |column: usize| {
        let word = files[0].pieces[2 * column].rsplit(|c: char| !c.is_alphabetic()).next().unwrap_or_default();
        matches!(word, "v" | "ver" | "version" | "take" | "shot")
    };
    let columns = files[0].values().len();
    let frame = (0..columns).max_by_key(|&column| (!is_version(column), different(column)));
    let has_twins = all.len() < files.len();
    let mut parts: BTreeMap<String, Vec<&Name<'_>>> = BTreeMap::new();
    for name in files {
        let mut others = name.values();
        // The same numbers with more zeros or fewer, or texts in capital letters.
        let part = match frame {
            Some(frame) if !has_twins => {
                others.remove(frame);
                others.join(" ")
            }
            _ => name.label.replace(|c: char| c.is_ascii_digit(), "#"),
        };
        parts.entry(part).or_default().push(name);
    }
    parts.into_values().collect()
}
