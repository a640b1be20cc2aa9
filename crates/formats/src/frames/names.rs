//! The order of a capture's files as a person reads their names, and whether they are one sequence
//! at all.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::maya;
use super::numbers;
use super::pieces::{NUMBER, Names, Pieces};
use super::several::several;
use crate::natural;

/// The files of one sequence in their order, with the number of each where the names tell one.
#[derive(Debug, PartialEq)]
pub(super) struct Sequence {
    pub(super) files: Vec<PathBuf>,
    pub(super) numbers: Option<Vec<f64>>,
}

impl Sequence {
    /// Files in the order of their numbers, or in natural order where their names have no such
    /// number.
    ///
    /// # Errors
    /// Files of several sequences, or several files with one number: what was found, and patterns
    /// that pick some of them.
    pub(super) fn of(mut files: Vec<PathBuf>) -> Result<Self, String> {
        sort_naturally(&mut files);
        if let Some(numbers) = maya::numbers_of(&files) {
            return Ok(Self::sorted(files, Some(numbers)));
        }
        let names = Names::of(&files);
        let labels: Vec<&str> = names.labels.iter().map(String::as_str).collect();
        let numbers = match numbers::of_names(&labels) {
            Some(numbers) => Some(numbers),
            None => numbers_of_one_sequence(&names)?,
        };
        Ok(Self::sorted(files, numbers))
    }

    /// All files in natural order, whatever sequences they belong to.
    pub(super) fn of_all(mut files: Vec<PathBuf>) -> Self {
        sort_naturally(&mut files);
        Self { files, numbers: None }
    }

    fn sorted(files: Vec<PathBuf>, numbers: Option<Vec<f64>>) -> Self {
        let Some(numbers) = numbers else { return Self { files, numbers: None } };
        let mut numbered: Vec<(f64, PathBuf)> = numbers.into_iter().zip(files).collect();
        numbered.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (numbers, files) = numbered.into_iter().unzip();
        Self { files, numbers: Some(numbers) }
    }
}

/// Whether a file is called as one more frame of these would be.
pub(super) fn is_one_of(file: &Path, others: &[PathBuf]) -> bool {
    let all: Vec<PathBuf> = others.iter().cloned().chain([file.to_owned()]).collect();
    let extension = |path: &Path| path.extension().map(OsStr::to_ascii_lowercase);
    let same = others.first().is_some_and(|other| extension(other) == extension(file));
    same && Sequence::of(all).is_ok_and(|sequence| sequence.numbers.is_some())
}

fn sort_naturally(files: &mut [PathBuf]) {
    files.sort_by(|a, b| natural::compare(a.as_os_str().as_encoded_bytes(), b.as_os_str().as_encoded_bytes()));
}

/// The numbers of names that differ in more than one place.
///
/// # Errors
/// As of [`Sequence::of`].
fn numbers_of_one_sequence(names: &Names) -> Result<Option<Vec<f64>>, String> {
    let pieces: Vec<Pieces<'_>> = names.labels.iter().map(|label| Pieces::of(label)).collect();
    let mut alike: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (file, found) in pieces.iter().enumerate() {
        alike.entry(&found.texts).or_default().push(file);
    }
    if alike.values().all(|files| files.len() == 1) {
        // Each pose has a name of its own, such as `run` and `walk`, or `01_run` and `02_walk`.
        let copied =
            |label: &String| original(label).and_then(|from| names.labels.iter().position(|label| label == from));
        if let Some((copy, from)) = names.labels.iter().enumerate().find_map(|(k, label)| Some((k, copied(label)?))) {
            let (copy, from) = (names.name(copy), names.name(from));
            return Err(format!(
                "{copy} looks like a copy of {from}; keep one of them, or name the frames by a pattern"
            ));
        }
        return Ok(None);
    }
    if alike.len() > 1 && leading_numbers_differ(&pieces) {
        return Ok(None);
    }
    let mut groups = Vec::new();
    for files in alike.into_values() {
        match unique_columns(&pieces, &files).as_slice() {
            [] if files.len() > 1 => groups.extend(split(&pieces, &files).into_iter().map(|files| (files, None))),
            columns => {
                // Numbers that the order of the names contradicts are none, such as seconds beside
                // minutes.
                let even = columns.iter().find(|(_, values)| ascends(values) && numbers::evenly_spaced(values));
                let column = even.or(columns.iter().find(|(_, values)| ascends(values))).map(|(column, _)| *column);
                groups.push((files, column));
            }
        }
    }
    match groups.as_slice() {
        [(_, Some(column))] => {
            let value =
                |found: &Pieces<'_>| found.numbers[*column].parse().ok().filter(|_| found.numbers[*column].len() <= 15);
            Ok(pieces.iter().map(value).collect())
        }
        [_] => Ok(None),
        _ => {
            groups.sort_by_key(|(files, _)| std::cmp::Reverse(files.len()));
            let groups: Vec<Vec<usize>> = groups.into_iter().map(|(files, _)| files).collect();
            Err(several(names, &pieces, &groups))
        }
    }
}

/// The name that a browser or a file manager gave `(1)` or `- Copy` for a second file.
fn original(label: &str) -> Option<&str> {
    let counted = label.strip_suffix(')').and_then(|rest| rest.rsplit_once(" ("));
    if let Some((name, _)) = counted.filter(|(_, digits)| digits.bytes().all(|b| b.is_ascii_digit())) {
        return Some(original(name).unwrap_or(name));
    }
    let copy =
        label.len().checked_sub(4).filter(|&at| label.get(at..).is_some_and(|end| end.eq_ignore_ascii_case("copy")))?;
    Some(label[..copy].trim_end_matches([' ', '-', '_']))
}

fn ascends(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[0] < pair[1])
}

/// Whether all names begin alike and go on with numbers that differ, as `01_sit 02_stand` and
/// `f_000_a1b2 f_001_c3d4` do.
fn leading_numbers_differ(pieces: &[Pieces<'_>]) -> bool {
    let begin = |found: &Pieces<'_>| found.texts.split(NUMBER).next().map(str::to_owned);
    let first = pieces.first().and_then(begin);
    let mut seen = BTreeSet::new();
    pieces
        .iter()
        .all(|found| begin(found) == first && found.values().first().is_some_and(|number| seen.insert(*number)))
}

/// The numbers in which all of these differ.
fn unique_columns(pieces: &[Pieces<'_>], files: &[usize]) -> Vec<(usize, Vec<f64>)> {
    let columns = files.first().map_or(0, |&file| pieces[file].numbers.len());
    let values = |column: usize| -> Option<Vec<f64>> {
        files.iter().map(|&file| pieces[file].numbers[column].parse().ok()).collect()
    };
    (0..columns)
        .filter_map(|column| Some((column, values(column)?)))
        .filter(|(_, values)| numbers::distinct(values))
        .collect()
}

/// Files whose names have the same pieces in parts, in each of which one number tells the frames
/// apart.
fn split(pieces: &[Pieces<'_>], files: &[usize]) -> Vec<Vec<usize>> {
    let mut parts: BTreeMap<Vec<String>, Vec<usize>> = BTreeMap::new();
    let mut seen: BTreeMap<Vec<&str>, usize> = BTreeMap::new();
    files.iter().for_each(|&file| *seen.entry(pieces[file].values()).or_default() += 1);
    if seen.values().any(|&count| count > 1) {
        // The same numbers with more zeros or fewer.
        for &file in files {
            let widths = pieces[file].numbers.iter().map(|digits| digits.len().to_string()).collect();
            parts.entry(widths).or_default().push(file);
        }
        if parts.len() == 1 {
            return files.iter().map(|&file| vec![file]).collect();
        }
        return parts.into_values().collect();
    }
    let columns = pieces[files[0]].numbers.len();
    let different = |column: usize| {
        let mut values: Vec<&str> = files.iter().map(|&file| pieces[file].values()[column]).collect();
        values.sort_unstable();
        values.dedup();
        values.len()
    };
    let version = |column: usize| {
        let before = pieces[files[0]].texts.split(NUMBER).nth(column).unwrap_or_default();
        let word = before.rsplit(|c: char| !c.is_alphabetic()).next().unwrap_or_default();
        matches!(word, "v" | "ver" | "version" | "take" | "shot")
    };
    // Frames are what there is most of; versions and takes mostly come before them.
    let frame = (0..columns).max_by_key(|&column| (!version(column), different(column))).unwrap_or(0);
    for &file in files {
        let mut others: Vec<String> = pieces[file].values().into_iter().map(str::to_owned).collect();
        others.remove(frame.min(others.len().saturating_sub(1)));
        parts.entry(others).or_default().push(file);
    }
    parts.into_values().collect()
}
