//! The names of a capture's files in pieces: text and numbers.

use std::path::{Path, PathBuf};

/// Names of files below the folder that holds them all.
pub(super) struct Names {
    pub(super) folder: PathBuf,
    /// Without extensions.
    pub(super) labels: Vec<String>,
    pub(super) extensions: Vec<String>,
}

/// What stands for a number in texts; no name has it.
pub(super) const NUMBER: char = '\0';

/// A name in pieces: what stands between its numbers, in lower case, and the numbers.
pub(super) struct Pieces<'a> {
    pub(super) texts: String,
    pub(super) numbers: Vec<&'a str>,
}

impl<'a> Pieces<'a> {
    pub(super) fn of(label: &'a str) -> Self {
        let (mut texts, mut numbers, mut rest) = (String::new(), Vec::new(), label);
        while !rest.is_empty() {
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            if end > 0 {
                numbers.push(&rest[..end]);
                texts.push(NUMBER);
            }
            let next = rest[end..].find(|c: char| c.is_ascii_digit()).map_or(rest.len(), |at| end + at);
            texts.push_str(&rest[end..next].to_lowercase());
            rest = &rest[next..];
        }
        Self { texts, numbers }
    }

    /// The numbers without the zeros that fill them up.
    pub(super) fn values(&self) -> Vec<&'a str> {
        self.numbers.iter().map(|digits| digits.trim_start_matches('0')).collect()
    }
}

impl Names {
    pub(super) fn of(files: &[PathBuf]) -> Self {
        let mut folder = files.first().and_then(|file| file.parent()).unwrap_or(Path::new("")).to_owned();
        while !files.iter().all(|file| file.starts_with(&folder)) && folder.pop() {}
        let below = |file: &PathBuf| file.strip_prefix(&folder).unwrap_or(file).to_path_buf();
        let labels = files.iter().map(|file| below(file).with_extension("").to_string_lossy().into_owned()).collect();
        let extension =
            |file: &PathBuf| file.extension().map_or(String::new(), |e| format!(".{}", e.to_string_lossy()));
        Self { labels, extensions: files.iter().map(extension).collect(), folder }
    }

    /// A file below the folder.
    pub(super) fn name(&self, file: usize) -> String {
        format!("{}{}", self.labels[file], self.extensions[file])
    }
}
