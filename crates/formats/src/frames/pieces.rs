//! The names of a capture's files in pieces: texts and numbers.

use std::fmt;
use std::path::{Path, PathBuf};

/// The folder that holds all files, and their names below it.
pub(super) fn below_folder(files: &[PathBuf]) -> (PathBuf, Vec<String>) {
    let mut folder = files.first().and_then(|file| file.parent()).unwrap_or(Path::new("")).to_owned();
    while !files.iter().all(|file| file.starts_with(&folder)) && folder.pop() {}
    let below = |file: &PathBuf| file.strip_prefix(&folder).unwrap_or(file).to_string_lossy().into_owned();
    let names = files.iter().map(below).collect();
    (folder, names)
}

/// The name of a file below the folder of all.
pub(super) struct Name<'a> {
    /// Without the extension.
    pub(super) label: &'a str,
    /// With its dot.
    pub(super) extension: &'a str,
    /// Of the label: texts at even places, which may be empty, and digits at odd ones.
    pub(super) pieces: Vec<&'a str>,
}

impl<'a> Name<'a> {
    pub(super) fn of(name: &'a str) -> Self {
        let dot = Path::new(name).extension().map_or(0, |extension| extension.len() + 1);
        let (label, extension) = name.split_at(name.len() - dot);
        let (mut pieces, mut rest) = (Vec::new(), label);
        while pieces.is_empty() || !rest.is_empty() {
            let is_text = pieces.len() % 2 == 0;
            let end = rest.find(|c: char| c.is_ascii_digit() == is_text).unwrap_or(rest.len());
            pieces.push(&rest[..end]);
            rest = &rest[end..];
        }
        Self { label, extension, pieces }
    }

    /// The texts in lower case.
    pub(super) fn texts(&self) -> String {
        let texts: Vec<String> = self.pieces.iter().step_by(2).map(|text| text.to_lowercase()).collect();
        format!("{}{}", texts.join("#"), if self.pieces.len().is_multiple_of(2) { "#" } else { "" })
    }

    pub(super) fn numbers(&self) -> impl Iterator<Item = &'a str> {
        self.pieces.iter().skip(1).step_by(2).copied()
    }

    /// The numbers without the zeros that fill them up.
    pub(super) fn values(&self) -> Vec<&'a str> {
        self.numbers().map(|digits| digits.trim_start_matches('0')).collect()
    }
}

impl fmt::Display for Name<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.label, self.extension)
    }
}
