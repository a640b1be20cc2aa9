//! What is in the bucket, as one process has listed it and changed it since.

use super::Listed;
use super::names::{Object, Part, length, parse};
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::io;
use std::ops::Bound;

#[derive(Debug, Default)]
pub(super) struct Index {
    /// Objects by the path of their file, those that are of no use any more too.
    files: BTreeMap<String, Vec<Object>>,
    /// Folders that were removed for good.
    closed: HashSet<String>,
}

impl Index {
    /// What is listed, by names and bytes, and the last takeover that has left something.
    pub(super) fn of(listed: &[(String, u64)]) -> (Self, i64) {
        let (mut index, mut last) = (Self::default(), 0);
        for (key, bytes) in listed {
            // Of other programs, or of later versions.
            let Some((path, object)) = parse(key, *bytes) else { continue };
            last = last.max(object.taken);
            index.files.entry(path.to_owned()).or_default().push(object);
        }
        (index, last)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    pub(super) fn objects(&self, path: &str) -> Option<Vec<Object>> {
        self.files.get(path).cloned()
    }

    pub(super) fn bytes(&self, path: &str) -> Option<u64> {
        self.files.get(path).map(|objects| length(objects))
    }

    pub(super) fn has_folder(&self, path: &str) -> bool {
        self.range(path).next().is_some()
    }

    pub(super) fn list(&self, folder: &str) -> Vec<Listed> {
        let (mut files, mut folders) = (Vec::new(), BTreeSet::new());
        for (path, objects) in self.range(folder) {
            let name = &path[folder.len() + 1..];
            match name.split_once('/') {
                Some((name, _)) => drop(folders.insert(name.to_owned())),
                None => files.push(Listed { name: name.to_owned(), is_folder: false, bytes: length(objects) }),
            }
        }
        files.extend(folders.into_iter().map(|name| Listed { name, is_folder: true, bytes: 0 }));
        files
    }

    /// The file of this path, or the files in this folder.
    pub(super) fn within(&self, path: &str) -> Vec<(String, Vec<Object>)> {
        let own = self.files.get_key_value(path).into_iter();
        own.chain(self.range(path)).map(|(path, objects)| (path.clone(), objects.clone())).collect()
    }

    /// Removes the file of this path, or the files in this folder.
    pub(super) fn remove(&mut self, path: &str) -> Vec<(String, Vec<Object>)> {
        let gone = self.within(path);
        for (path, _) in &gone {
            self.files.remove(path);
        }
        gone
    }

    pub(super) fn take(&mut self, path: &str) -> Vec<Object> {
        self.files.remove(path).unwrap_or_default()
    }

    /// # Errors
    /// `NotFound` in a folder that was removed for good.
    pub(super) fn admit(&self, path: &str) -> io::Result<()> {
        let above = path.match_indices('/').map(|(at, _)| &path[..at]);
        match above.chain([path]).any(|folder| self.closed.contains(folder)) {
            true => Err(io::ErrorKind::NotFound.into()),
            false => Ok(()),
        }
    }

    /// Adds an object; where it `replaces` the file, gives those that are of no use any more, which stay until they are forgotten.
    ///
    /// # Errors
    /// As [`Self::admit`].
    pub(super) fn add(&mut self, path: &str, object: Object, replaces: bool) -> io::Result<Vec<Object>> {
        self.admit(path)?;
        let objects = self.files.entry(path.to_owned()).or_default();
        // One of the same name was replaced in the bucket.
        objects.retain(|old| (old.taken, old.part) != (object.taken, object.part));
        let old = if replaces { objects.clone() } else { Vec::new() };
        if replaces && object.part == Part::Whole {
            // What was written to the file before is not laid over it.
            objects.retain(|old| old.taken < object.taken);
        }
        objects.push(object);
        Ok(old)
    }

    pub(super) fn forget(&mut self, path: &str, old: &[Object]) {
        if let Some(objects) = self.files.get_mut(path) {
            objects.retain(|object| !old.contains(object));
        }
    }

    /// Nothing is stored in this folder any more.
    pub(super) fn close(&mut self, folder: &str) {
        self.closed.insert(folder.to_owned());
    }

    fn range(&self, folder: &str) -> impl Iterator<Item = (&String, &Vec<Object>)> {
        let start = format!("{folder}/");
        let range = self.files.range::<String, _>((Bound::Included(&start), Bound::Unbounded));
        range.take_while(move |(path, _)| path.starts_with(&start))
    }
}
