//! Files of sessions and jobs in a bucket, of which one process at a time knows all: it has asked once, and notes what it changes.

mod bucket;
mod names;

use bucket::Bucket;
use names::{Object, Part, in_force, parse};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io;
use std::ops::Bound;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Why the bucket cannot be used; inside an [`io::Error`] where that is what a call gives.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct BlobsError(pub(crate) String);

/// A file or folder in a folder of the bucket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listed {
    /// Its name.
    pub name: String,
    /// Whether it is a folder.
    pub is_folder: bool,
    /// Bytes of a file.
    pub bytes: u64,
}

/// A bucket. Paths have `/` between their names, and none before or behind. All calls block, and fail as the bucket does.
#[derive(Debug)]
pub struct Blobs {
    bucket: Bucket,
    taken: i64,
    /// What is there, by paths of files.
    index: Mutex<BTreeMap<String, Vec<Object>>>,
    next: AtomicU64,
}

impl Blobs {
    /// Opens the bucket at `url` (`s3://bucket/path`, or `file:///folder`) for the process that has taken its database as the so-manieth, and lists it.
    /// `environment` has keys, region and endpoint by the names that Amazon's own programs have for them, among others.
    ///
    /// # Errors
    /// [`BlobsError`], also where the bucket is not there.
    pub fn open(
        url: &str,
        taken: i64,
        environment: impl IntoIterator<Item = (String, String)>,
    ) -> Result<Self, BlobsError> {
        let environment: Vec<_> = environment.into_iter().collect();
        let bucket = Bucket::connect(url, &environment)?;
        let listed = bucket.list("").map_err(|error| BlobsError(error.to_string()))?;
        let mut index = BTreeMap::<String, Vec<Object>>::new();
        for (key, bytes) in &listed {
            // Of other programs, or of later versions.
            let Some((path, object)) = parse(key, *bytes) else { continue };
            index.entry(path.to_owned()).or_default().push(object);
        }
        for objects in index.values_mut() {
            *objects = in_force(objects).to_vec();
        }
        Ok(Self { bucket, taken, index: Mutex::new(index), next: AtomicU64::new(1) })
    }

    /// What it is called in messages.
    pub fn name(&self) -> &str {
        &self.bucket.name
    }

    /// Whether nothing is there.
    pub fn is_empty(&self) -> bool {
        self.index().is_empty()
    }

    /// Length of a file; `None` if it is not there.
    pub fn bytes(&self, path: &str) -> Option<u64> {
        Some(length(self.index().get(path)?))
    }

    /// Whether there is a file in this folder.
    pub fn has_folder(&self, path: &str) -> bool {
        within(&self.index(), path).next().is_some()
    }

    /// Files and folders in a folder.
    pub fn list(&self, folder: &str) -> Vec<Listed> {
        let (mut files, mut folders) = (Vec::new(), BTreeSet::new());
        for (path, objects) in within(&self.index(), folder) {
            let name = &path[folder.len() + 1..];
            match name.split_once('/') {
                Some((name, _)) => drop(folders.insert(name.to_owned())),
                None => files.push(Listed { name: name.to_owned(), is_folder: false, bytes: length(objects) }),
            }
        }
        files.extend(folders.into_iter().map(|name| Listed { name, is_folder: true, bytes: 0 }));
        files
    }

    /// Stores a file of this machine; replaces what is there. Durable on `Ok`.
    pub fn put_file(&self, path: &str, from: &Path) -> io::Result<()> {
        let object = Object { taken: self.taken, part: Part::Whole, bytes: 0 };
        let bytes = self.bucket.put_file(&object.key(path), &File::open(from)?)?;
        let before = self.index().insert(path.to_owned(), vec![Object { bytes, ..object }]);
        let old: Vec<String> =
            before.iter().flatten().map(|old| old.key(path)).filter(|key| *key != object.key(path)).collect();
        if !old.is_empty()
            && let Err(error) = self.bucket.remove(&old)
        {
            tracing::warn!(%error, path, "what was replaced in the bucket takes space until the file is removed");
        }
        Ok(())
    }

    /// Stores what was written to a file from `offset` on. Durable on `Ok`.
    pub fn put_piece(&self, path: &str, offset: u64, bytes: Vec<u8>) -> io::Result<()> {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        let object = Object { taken: self.taken, part: Part::Piece { number, offset }, bytes: bytes.len() as u64 };
        self.bucket.put(&object.key(path), bytes.into())?;
        let mut index = self.index();
        let objects = index.entry(path.to_owned()).or_default();
        // Others may have been faster.
        objects.push(object);
        in_force(objects);
        Ok(())
    }

    /// Writes a file of the bucket into an empty one of this machine.
    ///
    /// # Errors
    /// `NotFound` where it is not there.
    pub fn fetch(&self, path: &str, to: &File) -> io::Result<u64> {
        let objects = self.index().get(path).cloned().ok_or(io::ErrorKind::NotFound)?;
        for object in &objects {
            let offset = object.end() - object.bytes;
            self.bucket.get(&object.key(path), object.bytes, to, offset)?;
        }
        Ok(length(&objects))
    }

    /// Removes a file, or all in a folder. Nothing there is no error.
    pub fn remove(&self, path: &str) -> io::Result<()> {
        let mut keys: Vec<String> =
            self.index().get(path).into_iter().flatten().map(|object| object.key(path)).collect();
        if keys.is_empty() {
            // What an earlier process has sent late is known to the bucket alone.
            keys = self.bucket.list(path)?.into_iter().map(|(key, _)| key).collect();
        }
        if !keys.is_empty() {
            self.bucket.remove(&keys)?;
        }
        let mut index = self.index();
        index.remove(path);
        let gone: Vec<String> = within(&index, path).map(|(path, _)| path.clone()).collect();
        for path in gone {
            index.remove(&path);
        }
        Ok(())
    }

    /// Checks that the bucket can be written to.
    pub fn probe(&self) -> io::Result<()> {
        self.bucket.put("probe", "probe\n".into())
    }

    fn index(&self) -> MutexGuard<'_, BTreeMap<String, Vec<Object>>> {
        self.index.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Length of a file of these objects.
fn length(objects: &[Object]) -> u64 {
    objects.iter().map(Object::end).max().unwrap_or(0)
}

/// The files in a folder and in those within it.
fn within<'a>(
    index: &'a BTreeMap<String, Vec<Object>>,
    folder: &str,
) -> impl Iterator<Item = (&'a String, &'a Vec<Object>)> + use<'a> {
    let start = format!("{folder}/");
    let range = index.range::<String, _>((Bound::Included(&start), Bound::Unbounded));
    range.take_while(move |(path, _)| path.starts_with(&start)).collect::<Vec<_>>().into_iter()
}
