//! Complete files that take their names, all or none.

use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::path::Path;

use super::target::Target;
use super::temporary::{self, Live, Temporary};
use super::{Place, anonymous, hide_temporary, inherit, occupied};
use crate::error::Error;

/// A file whose contents are durable but which does not have its name yet; dropped it leaves nothing.
#[derive(Debug)]
#[must_use = "it has no name before `commit_together`"]
pub struct CompleteFile {
    pub(super) target: Target,
    /// None for standard output.
    pub(super) place: Option<Place>,
    pub(super) file: File,
    pub(super) temporary: Option<Temporary>,
    /// What had the name before, for as long as it may have to come back.
    pub(super) replaced: Option<Temporary>,
    pub(super) length: u64,
}

impl CompleteFile {
    /// The path of the target given to [`AtomicFile::create`](super::AtomicFile::create).
    pub fn path(&self) -> &Path {
        self.target.path()
    }

    /// Bytes in the file.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// The contents from their start, for whoever checks them before they take their name. One reader at a time: all share
    /// one position.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn reader(&self) -> Result<File, Error> {
        let reader = self.file.try_clone().and_then(|mut file| file.rewind().map(|()| file));
        reader.map_err(|cause| hide_temporary(self.path(), &cause))
    }

    /// Gives the file its name and says how to take that back. `keep` saves what had the name before.
    fn put_in_place(&mut self, live: &mut Live, keep: bool) -> io::Result<Undo> {
        let Some(Place { folder, target }) = &self.place else { return Ok(Undo::Nothing) };
        inherit(&self.file, target)?;
        if self.temporary.is_none() {
            match anonymous::link(&self.file, target) {
                Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists && self.target.replaces() => {
                    // Only renaming replaces a file in one step, and only what has a name can be renamed.
                    let ((), name) = live.begin(folder, |path| anonymous::link(&self.file, path))?;
                    self.temporary = Some(name);
                }
                linked => return linked.map(|()| Undo::Remove),
            }
        }
        let Some(temporary) = &self.temporary else { return Ok(Undo::Nothing) };
        if !self.target.replaces() {
            return live.name_new(temporary, target).map(|()| Undo::Remove);
        }
        let replaces = target.exists();
        if replaces && keep {
            let kept = live.begin(folder, |path| fs::hard_link(target, path));
            self.replaced = kept.ok().map(|((), name)| name);
        }
        live.rename(temporary, target)?;
        Ok(match self.replaced {
            Some(_) => Undo::Restore,
            None if replaces => Undo::Nothing,
            None => Undo::Remove,
        })
    }

    fn take_back(&self, live: &mut Live, how: Undo) -> io::Result<()> {
        match (how, &self.place, &self.replaced) {
            (Undo::Remove, Some(place), _) => fs::remove_file(&place.target),
            (Undo::Restore, Some(place), Some(old)) => live.rename(old, &place.target),
            _ => Ok(()),
        }
    }

    fn copy_to_standard_output(&self) -> io::Result<()> {
        let mut file = &self.file;
        file.rewind()?;
        let mut out = io::stdout().lock();
        match io::copy(&mut file, &mut out).and_then(|_| out.flush()) {
            // A reader that has seen enough, as `head` has, is no failure.
            Err(cause) if cause.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            copied => copied,
        }
    }

    fn error(&self, cause: &io::Error) -> Error {
        match cause.kind() {
            io::ErrorKind::AlreadyExists if !self.target.replaces() => occupied(self.path()),
            _ => hide_temporary(self.path(), cause),
        }
    }
}

/// How to take a name back.
#[derive(Clone, Copy)]
enum Undo {
    Remove,
    Restore,
    /// Standard output, or where a file cannot have two names: what was replaced is gone.
    Nothing,
}

/// Gives complete files their names, in place of files that had them where they may, as one step: where one of them cannot
/// have its name, none has, and those that stood there before stay. What goes to standard output is copied there first.
///
/// A process killed in between may leave a part of them; that takes microseconds, since all else was done before. What
/// was replaced can be restored only where the system lets a file have two names.
///
/// # Errors
/// [`Error::Io`], or [`Error::Target`] where a file that may not be replaced has appeared meanwhile; the files are then not
/// created, unless it is a name alone that could not be made durable.
pub fn commit_together(mut files: Vec<CompleteFile>) -> Result<(), Error> {
    for file in files.iter().filter(|file| file.place.is_none()) {
        file.copy_to_standard_output().map_err(|cause| file.error(&cause))?;
    }
    name_all(&mut files)?;
    for file in &mut files {
        // Before what takes time, in which a killed process would leave it.
        file.replaced = None;
    }
    for file in &files {
        file.place.as_ref().map_or(Ok(()), Place::sync_folder).map_err(|cause| file.error(&cause))?;
    }
    Ok(())
}

/// The temporaries stay in the files, since dropping one takes the lock that is held here.
fn name_all(files: &mut [CompleteFile]) -> Result<(), Error> {
    let mut live = temporary::lock();
    let mut done = Vec::new();
    for k in 0..files.len() {
        let another_may_fail = k + 1 < files.len();
        match files[k].put_in_place(&mut live, another_may_fail) {
            Ok(undo) => done.push(undo),
            Err(cause) => {
                for (file, undo) in files.iter().zip(done) {
                    // The first error is the one to tell.
                    let _ = file.take_back(&mut live, undo);
                }
                return Err(files[k].error(&cause));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atomic::AtomicFile;
    use std::collections::BTreeMap;
    use tempfile::tempdir;

    /// A complete file, under a temporary name or, where the system has that, without any.
    fn begin(target: impl Into<Target>, named: bool) -> CompleteFile {
        let unnamed = |folder: &Path| if named { None } else { anonymous::create(folder) };
        let mut file = AtomicFile::create_as(target.into(), unnamed).unwrap();
        file.write_all(b"new").unwrap();
        file.complete().unwrap()
    }

    /// Names in a folder, hidden ones too, with the contents of files.
    fn contents(folder: &Path) -> BTreeMap<String, String> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
        entries
            .map(|e| (e.file_name().into_string().unwrap(), fs::read_to_string(e.path()).unwrap_or_default()))
            .collect()
    }

    fn expected(files: &[(&str, &str)]) -> BTreeMap<String, String> {
        files.iter().map(|&(name, text)| (name.to_owned(), text.to_owned())).collect()
    }

    #[test]
    fn files_take_their_names_together_over_old_ones_and_beside_them() {
        for (named, old) in [(false, false), (false, true), (true, false), (true, true)] {
            let folder = tempdir().unwrap();
            let (a, b) = (folder.path().join("a"), folder.path().join("b"));
            if old {
                fs::write(&a, "old").unwrap();
                fs::write(&b, "old").unwrap();
            }
            let before = contents(folder.path());
            let files = vec![begin(&a, named), begin(&b, named)];
            assert_eq!((files[0].path(), files[0].length()), (a.as_path(), 3));
            if !named && anonymous::create(folder.path()).is_some() {
                assert_eq!(contents(folder.path()), before, "an unnamed file has a name");
            }
            commit_together(files).unwrap();
            assert_eq!(contents(folder.path()), expected(&[("a", "new"), ("b", "new")]), "{named} {old}");
        }
    }

    #[test]
    fn where_one_file_cannot_have_its_name_all_is_as_before() {
        for (named, old) in [(false, false), (false, true), (true, false), (true, true)] {
            let folder = tempdir().unwrap();
            let (a, b) = (folder.path().join("a"), folder.path().join("b"));
            if old {
                fs::write(&a, "old").unwrap();
            }
            let files = vec![begin(&a, named), begin(&b, named)];
            // Someone takes the second name for what no file replaces.
            fs::create_dir(&b).unwrap();
            let error = commit_together(files).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{}: cannot be written (", b.display())), "{error}");
            assert!(!error.contains(".cager-"), "{error}");
            let before: &[_] = if old { &[("a", "old"), ("b", "")] } else { &[("b", "")] };
            assert_eq!(contents(folder.path()), expected(before), "{named} {old}");
        }
    }

    #[test]
    fn a_new_file_takes_the_name_of_none_that_appeared_meanwhile() {
        for named in [false, true] {
            let folder = tempdir().unwrap();
            let (a, b) = (folder.path().join("a"), folder.path().join("b"));
            commit_together(vec![begin(Target::new(&a), named)]).unwrap();
            assert_eq!(contents(folder.path()), expected(&[("a", "new")]), "{named}");
            let files = vec![begin(Target::new(&b), named), begin(Target::new(folder.path().join("c")), named)];
            fs::write(folder.path().join("c"), "theirs").unwrap();
            let error = commit_together(files).unwrap_err().to_string();
            assert!(error.ends_with("c: is there already; name another file"), "{error}");
            assert_eq!(contents(folder.path()), expected(&[("a", "new"), ("c", "theirs")]), "{named}");
            let error = AtomicFile::create(Target::new(&a)).unwrap_err();
            assert!(matches!(error, Error::Target { .. }), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_replaces_another_keeps_its_mode_and_its_links() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        for named in [false, true] {
            let folder = tempdir().unwrap();
            let [old, link, dangling] = ["old", "link", "dangling"].map(|name| folder.path().join(name));
            fs::write(&old, "old").unwrap();
            fs::set_permissions(&old, fs::Permissions::from_mode(0o640)).unwrap();
            symlink("old", &link).unwrap();
            symlink("made", &dangling).unwrap();
            commit_together(vec![begin(&link, named), begin(&dangling, named)]).unwrap();
            assert_eq!(fs::metadata(&old).unwrap().permissions().mode() & 0o777, 0o640, "{named}");
            assert!(
                fs::symlink_metadata(&link).unwrap().is_symlink()
                    && fs::symlink_metadata(&dangling).unwrap().is_symlink()
            );
            assert_eq!(contents(folder.path())["old"], "new");
            assert_eq!(contents(folder.path())["made"], "new", "{named}");
        }
    }

    #[test]
    fn a_file_dropped_with_or_without_a_name_leaves_nothing() {
        for named in [false, true] {
            let folder = tempdir().unwrap();
            let file = begin(folder.path().join("a"), named);
            assert!(contents(folder.path()).len() <= 1);
            drop(file);
            assert!(contents(folder.path()).is_empty());
        }
    }
}
