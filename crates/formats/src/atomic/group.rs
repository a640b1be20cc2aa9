//! Files of one pattern in a folder that holds others too.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::temporary::{self, Names, Temporary};
use super::{hide_temporary, inherit, sync_folder};
use crate::error::Error;

/// Files that take their names in a folder together once all are complete; dropped before
/// [`AtomicGroup::commit`] they leave nothing.
///
/// A killed process leaves them in a folder of a hidden name, as with
/// [`AtomicFile`](super::AtomicFile).
#[derive(Debug)]
pub struct AtomicGroup {
    folder: PathBuf,
    written: Temporary,
    /// Names of the files that are there and go.
    replaced: Vec<PathBuf>,
    /// Names of the new files, in their order.
    names: Vec<String>,
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
        let (mut replaced, mut others) = (Vec::new(), Vec::new());
        for entry in fs::read_dir(folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = entry.file_name();
            let Some(name) = name.to_str().filter(|name| new.contains(*name) || is_own(name)) else { continue };
            let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
            if !is_file || !replaces {
                return Err(in_the_way(&entry.path(), is_file));
            }
            if new.contains(name) { &mut replaced } else { &mut others }.push(entry.path());
        }
        replaced.sort();
        if let Some(other) = others.iter().min() {
            return Err(no_frame(other, others.len() - 1));
        }
        let begun = temporary::lock().begin(folder, |path| fs::create_dir(path));
        let ((), written) = begun.map_err(|cause| hide_temporary(folder, &cause))?;
        Ok(Self { folder: folder.to_owned(), written, replaced, names: Vec::new() })
    }

    /// Begins a file that is to have this name.
    ///
    /// # Errors
    /// Those of [`File::create`].
    pub fn create_file(&mut self, name: &str) -> io::Result<File> {
        // Not between the removal of the folder and the end of the process.
        let _names = temporary::lock();
        let file = File::create(self.written.0.join(name))?;
        self.names.push(name.to_owned());
        Ok(file)
    }

    /// Makes the files durable and gives them their names.
    ///
    /// # Errors
    /// [`Error::Target`] where someone else has put a file there meanwhile, [`Error::Io`]; all is
    /// as it was then, unless it is the names alone that could not be made durable.
    pub fn commit(self) -> Result<(), Error> {
        let failed = |cause: io::Error| hide_temporary(&self.folder, &cause);
        for name in &self.names {
            let file = File::open(self.written.0.join(name)).map_err(failed)?;
            inherit(&file, &self.folder.join(name)).and_then(|()| file.sync_all()).map_err(failed)?;
        }
        // Outlives the lock, which removing it takes.
        let mut aside = None;
        let mut names = temporary::lock();
        let mut moves: Vec<(PathBuf, PathBuf)> = Vec::new();
        let done = self.take_names(&mut names, &mut aside, &mut moves);
        if let Err(error) = done {
            for (from, to) in moves.iter().rev() {
                let _ = fs::rename(to, from);
            }
            return Err(error);
        }
        drop(names);
        drop(aside);
        sync_folder(&self.folder).map_err(failed)
    }

    /// Moves old files aside and new ones to their names, and lists what was moved.
    fn take_names(
        &self,
        names: &mut Names,
        aside: &mut Option<Temporary>,
        moves: &mut Vec<(PathBuf, PathBuf)>,
    ) -> Result<(), Error> {
        let failed = |cause: io::Error| hide_temporary(&self.folder, &cause);
        let mut rename = |from: PathBuf, to: PathBuf| {
            fs::rename(&from, &to).map_err(failed)?;
            moves.push((from, to));
            Ok::<_, Error>(())
        };
        if !self.replaced.is_empty() {
            let aside = aside.insert(names.begin(&self.folder, |path| fs::create_dir(path)).map_err(failed)?.1);
            for old in self.replaced.iter().filter(|old| old.exists()) {
                rename(old.clone(), aside.0.join(old.file_name().unwrap_or_default()))?;
            }
        }
        for name in &self.names {
            let to = self.folder.join(name);
            if fs::symlink_metadata(&to).is_ok() {
                return Err(in_the_way(&to, true));
            }
            rename(self.written.0.join(name), to)?;
        }
        Ok(())
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
        drop(create(true, &new).expect("a group"));
        let mut group = create(true, &new).expect("a group");
        write(&mut group, &["f.2", "f.9"]);
        assert_eq!(fs::read(folder.join("f.1")).expect("a file"), b"new");
        group.commit().expect("names");
        assert_eq!(names(folder), ["f.2", "f.9", "notes.txt"]);
        // What someone else puts there meanwhile stays, and all the rest.
        let mut group = create(true, &["f.2", "f.5", "f.9"]).expect("a group");
        write(&mut group, &["f.2", "f.5"]);
        fs::write(folder.join("f.5"), "theirs").expect("a file");
        group.commit().expect_err("a file in the way");
        assert_eq!(names(folder), ["f.2", "f.5", "f.9", "notes.txt"]);
        assert_eq!(fs::read(folder.join("f.5")).expect("a file"), b"theirs");
    }
}
