//! Finding the files of a capture: in a folder, by a glob, by numbered names.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use super::numbered::NumberedNames;
use crate::error::{Error, Fault};

/// The files of a folder or a pattern; none of a path that is one file.
pub(super) fn several(path: &Path) -> Result<Option<Vec<PathBuf>>, Error> {
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => in_folder(path).map(Some),
        Ok(found) if found.is_file() => Ok(None),
        Ok(_) => Err(Fault::unsupported("is not a regular file; copy it to one").at(path)),
        Err(_) if is_pattern(path) => matching(path).map(Some),
        Err(cause) => Err(Error::read(path, cause)),
    }
}

/// Whether a path that is not there can be a pattern.
fn is_pattern(path: &Path) -> bool {
    path.to_str().is_some_and(|text| text.contains(['*', '?', '[']))
        || path.iter().any(|part| part.to_str().and_then(NumberedNames::parse).is_some())
}

/// The files of a folder, without hidden ones.
pub(super) fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let read = || -> io::Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            let hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
            if !hidden && path.is_file() {
                files.push(path);
            }
        }
        Ok(files)
    };
    read().map_err(|cause| Error::read(folder, cause))
}

/// The files that a pattern matches. Each part of its path is a name where there is such a file or
/// folder, else a glob, or a name with a place for a number.
fn matching(path: &Path) -> Result<Vec<PathBuf>, Error> {
    let pattern = Pattern::of(path, false);
    let found = pattern.files(path)?;
    if found.is_empty() && pattern.has_brackets {
        // In names such as `take[1]_*.obj` they stand for themselves.
        return Pattern::of(path, true).files(path);
    }
    if found.is_empty() && !pattern.numbered.is_empty() {
        let what = "matches no file; the place of the number stands for as many digits or more, filled up with zeros";
        return Err(Fault::invalid(what).at(path));
    }
    Ok(found)
}

struct Pattern {
    glob: PathBuf,
    /// Names with a place for a number, counted from the end of the path.
    numbered: Vec<(usize, NumberedNames)>,
    has_brackets: bool,
}

impl Pattern {
    fn of(path: &Path, brackets_are_names: bool) -> Self {
        let (mut glob, mut numbered, mut has_brackets) = (PathBuf::new(), Vec::new(), false);
        // As much of the path as is there.
        let mut there = Some(PathBuf::new());
        let parts = path.components().count();
        for (place, part) in path.components().enumerate() {
            let text = part.as_os_str().to_str().unwrap_or_default();
            there = there.map(|folder| folder.join(part)).filter(|path| path.exists());
            let plain = !matches!(part, Component::Normal(_));
            if plain || there.is_some() {
                glob.push(if plain { text.to_owned() } else { glob::Pattern::escape(text) });
            } else if let Some(names) = NumberedNames::parse(text) {
                glob.push(names.glob());
                numbered.push((parts - place, names));
            } else if brackets_are_names {
                glob.push(text.replace('[', "[[]"));
            } else {
                has_brackets |= text.contains('[');
                glob.push(text);
            }
        }
        Self { glob, numbered, has_brackets }
    }

    fn files(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let options = glob::MatchOptions { require_literal_leading_dot: true, ..Default::default() };
        let matches = glob::glob_with(self.glob.to_str().unwrap_or_default(), options)
            .map_err(|cause| Fault::invalid(format!("is not a pattern ({}); correct it", cause.msg)).at(path))?;
        let (mut found, mut folders) = (Vec::new(), false);
        for path in matches {
            let path = path.map_err(|cause| {
                let path = cause.path().to_owned();
                Error::read(&path, cause.into())
            })?;
            let part = |from_end: usize| path.iter().rev().nth(from_end - 1).and_then(|name| name.to_str());
            let numbers = |(from_end, names): &(usize, NumberedNames)| {
                part(*from_end).is_some_and(|name| names.number(name).is_some())
            };
            if !self.numbered.iter().all(numbers) {
                continue;
            }
            folders |= path.is_dir();
            if path.is_file() {
                found.push(path);
            }
        }
        if found.is_empty() && folders {
            let inside = path.join("*.obj");
            let what = format!("matches folders; give a pattern of the files in them, such as '{}'", inside.display());
            return Err(Fault::invalid(what).at(path));
        }
        Ok(found)
    }
}
