//! Files of one pattern in a folder that holds others too.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::pending::{Pending, take_names};
use super::target::Target;
use crate::error::Error;

/// Files that take their names in a folder together once all are complete; dropped before
/// [`AtomicGroup::commit`] they leave nothing.
#[derive(Debug)]
pub struct AtomicGroup {
    folder: PathBuf,
    /// Names of the files that are there and go.
    replaced: BTreeSet<String>,
    files: Vec<Pending>,
}

impl AtomicGroup {
    /// Begins files of these names in a folder that is there. Those of the same names go once the
    /// new ones take theirs, where that is allowed.
    ///
    /// # Errors
    /// [`Error::Target`] for a file that is in the way, and for others that `is_own` and would stay
    /// among the new ones; [`Error::Io`] where the folder is missing or closed to writing.
    pub fn create(
        folder: &Path,
        replaces: bool,
        new: &BTreeSet<String>,
        is_own: impl Fn(&str) -> bool,
    ) -> Result<Self, Error> {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let failed = |cause| Error::write(folder, cause);
        let (mut replaced, mut others) = (BTreeSet::new(), Vec::new());
        for entry in fs::read_dir(folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = entry.file_name();
            let Some(name) = name.to_str().filter(|name| new.contains(*name) || is_own(name)) else { continue };
            let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
            if !is_file || !replaces {
                return Err(in_the_way(&entry.path(), is_file));
            }
            if new.contains(name) {
                replaced.insert(name.to_owned());
            } else {
                others.push(entry.path());
            }
        }
        if let Some(other) = others.iter().min() {
            return Err(no_frame(other, others.len() - 1));
        }
        Ok(Self { folder: folder.to_owned(), replaced, files: Vec::new() })
    }

    /// Begins a file that is to have this name.
    ///
    /// # Errors
    /// As of [`AtomicFile::create`](super::AtomicFile::create).
    pub fn create_file(&mut self, name: &str) -> Result<File, Error> {
        let path = self.folder.join(name);
        let target = if self.replaced.contains(name) { Target::Replacing(path) } else { Target::New(path) };
        let (file, pending) = Pending::create(target)?;
        self.files.push(pending);
        Ok(file)
    }

    /// Makes the files durable and gives them their names.
    ///
    /// # Errors
    /// As of [`commit_together`](super::commit_together).
    pub fn commit(self) -> Result<(), Error> {
        for file in &self.files {
            file.open().and_then(|open| file.complete(&open)).map_err(|cause| file.error(&cause))?;
        }
        take_names(&self.files)
    }
}

fn in_the_way(path: &Path, is_file: bool) -> Error {
    let path = path.strip_prefix(".").unwrap_or(path);
    if is_file {
        Error::target(path, "is there already; name other files, or allow them to be replaced")
    } else {
        Error::target(path, "is no file, and a frame would have its name; name other files")
    }
}

/// Frames that would stay would pass for some of those that are written.
fn no_frame(path: &Path, more: usize) -> Error {
    let path = path.strip_prefix(".").unwrap_or(path);
    let are = match more {
        0 => "is no frame of what is written, and has such a name".to_owned(),
        more => format!("and {more} more with such a name are no frames of what is written"),
    };
    Error::target(path, are + "; remove what is not wanted, or give another name")
}

#[cfg(test)]
mod tests {
    use super::super::ScratchDir;
    use super::*;
    use std::io::Write;

    fn write(group: &mut AtomicGroup, names: &[&str]) {
        for name in names {
            group.create_file(name).expect(name).write_all(b"new").expect(name);
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn files_take_their_names_together_beside_others_or_not_at_all() {
        let scratch = ScratchDir::create(std::env::temp_dir()).expect("a folder");
        let folder = scratch.path();
        fs::write(folder.join("notes.txt"), "kept").expect("a file");
        let create = |replaces: bool, new: &[&str]| {
            let new = new.iter().map(|&name| name.to_owned()).collect();
            AtomicGroup::create(folder, replaces, &new, |name| name.starts_with("f."))
        };
        let mut group = create(false, &["f.1", "f.2", "f.3"]).expect("a group");
        write(&mut group, &["f.1", "f.2", "f.3"]);
        group.commit().expect("names");
        assert_eq!(names(folder), ["f.1", "f.2", "f.3", "notes.txt"]);
        assert!(create(false, &["f.9"]).unwrap_err().to_string().contains("f.1"));
        // Those that would stay among the new ones are told, and nothing is written.
        let said = create(true, &["f.2", "f.9"]).unwrap_err().to_string();
        assert!(said.contains("f.1: and 1 more with such a name are no frames of what is written"), "{said}");
        assert_eq!(names(folder), ["f.1", "f.2", "f.3", "notes.txt"]);
        // Dropped, they leave nothing; committed, the old ones go.
        let new = ["f.1", "f.2", "f.3", "f.9"];
        fs::write(folder.join("f.1"), "old").expect("a file");
        let mut group = create(true, &new).expect("a group");
        write(&mut group, &new);
        assert_eq!(fs::read(folder.join("f.1")).expect("a file"), b"old");
        drop(group);
        assert_eq!(names(folder), ["f.1", "f.2", "f.3", "notes.txt"]);
        let mut group = create(true, &new).expect("a group");
        write(&mut group, &new);
        group.commit().expect("names");
        assert_eq!(fs::read(folder.join("f.1")).expect("a file"), b"new");
        assert_eq!(names(folder), ["f.1", "f.2", "f.3", "f.9", "notes.txt"]);
        // What someone else puts there meanwhile stays, and all the rest.
        fs::write(folder.join("f.1"), "old").expect("a file");
        let mut group = create(true, &["f.1", "f.2", "f.3", "f.5", "f.9"]).expect("a group");
        write(&mut group, &["f.1", "f.2", "f.5"]);
        fs::write(folder.join("f.5"), "theirs").expect("a file");
        group.commit().expect_err("a file in the way");
        assert_eq!(names(folder), ["f.1", "f.2", "f.3", "f.5", "f.9", "notes.txt"]);
        assert_eq!(fs::read(folder.join("f.1")).expect("a file"), b"old");
        assert_eq!(fs::read(folder.join("f.5")).expect("a file"), b"theirs");
    }
}
