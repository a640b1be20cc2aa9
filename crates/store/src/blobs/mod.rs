//! Files of sessions and jobs in a bucket, of which one process at a time knows all: it has asked once, and notes what it changes.

mod bucket;
mod index;
mod names;

use bucket::Bucket;
use index::Index;
use names::{Object, Part, in_force};
use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Most bytes of what is written to a file that are sent at once.
const PIECE: usize = 8 << 20;
/// How often a file is fetched again that others change meanwhile.
const FETCHES: usize = 5;
/// Says that a process has begun to write; nothing reads it.
const OWNER: &str = "owner";

/// Why the bucket cannot be used; inside an [`io::Error`] where that is what a call gives.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct BlobsError {
    what: String,
    is_away: bool,
}

impl BlobsError {
    /// What waiting does not cure.
    pub(crate) fn lasting(what: impl Into<String>) -> Self {
        Self { what: what.into(), is_away: false }
    }

    /// Whether it does not answer for now, so that the same may succeed later.
    pub fn is_away(&self) -> bool {
        self.is_away
    }
}

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
    index: Mutex<Index>,
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
        let failed = |error: io::Error| BlobsError::lasting(error.to_string());
        let (mut index, last) = Index::of(&bucket.list("").map_err(failed)?);
        // A database that was restored counts fewer takeovers than the bucket has seen.
        let taken = taken.max(last + 1);
        let object = Object { taken, part: Part::Whole, bytes: 0 };
        bucket.put(&object.key(OWNER), Vec::new().into()).map_err(failed)?;
        let before = index.take(OWNER);
        let blobs = Self { bucket, taken, index: Mutex::new(index), next: AtomicU64::new(1) };
        // They do no harm.
        let _ = blobs.bucket.remove(&before.iter().map(|object| object.key(OWNER)).collect::<Vec<_>>());
        Ok(blobs)
    }

    /// Checks the address of a bucket, and what the environment says of it, without asking for anything.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn check_address(url: &str, environment: impl IntoIterator<Item = (String, String)>) -> Result<(), BlobsError> {
        Bucket::check_address(url, &environment.into_iter().collect::<Vec<_>>())
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
        self.index().bytes(path)
    }

    /// Whether there is a file in this folder.
    pub fn has_folder(&self, path: &str) -> bool {
        self.index().has_folder(path)
    }

    /// Files and folders in a folder.
    pub fn list(&self, folder: &str) -> Vec<Listed> {
        self.index().list(folder)
    }

    /// Stores a file of this machine; replaces what is there. Durable on `Ok`.
    ///
    /// # Errors
    /// `NotFound` in a folder that was removed for good.
    pub fn put_file(&self, path: &str, from: &Path) -> io::Result<()> {
        let object = Object { taken: self.taken, part: Part::Whole, bytes: 0 };
        self.index().admit(path)?;
        let bytes = self.bucket.put_file(&object.key(path), &File::open(from)?)?;
        let old = self.note(path, Object { bytes, ..object }, true)?;
        if !old.is_empty() {
            let keys: Vec<String> = old.iter().map(|old| old.key(path)).collect();
            match self.bucket.remove(&keys) {
                Ok(()) => self.index().forget(path, &old),
                Err(error) => {
                    tracing::warn!(%error, path, "what was replaced in the bucket takes space until the file is removed");
                }
            }
        }
        Ok(())
    }

    /// Stores what was written to a file from `offset` on. Durable on `Ok`.
    ///
    /// # Errors
    /// As [`Self::put_file`].
    pub fn put_piece(&self, path: &str, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.index().admit(path)?;
        for (piece, place) in bytes.chunks(PIECE).zip(0..) {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            let part = Part::Piece { number, offset: offset + place * PIECE as u64 };
            let object = Object { taken: self.taken, part, bytes: piece.len() as u64 };
            self.bucket.put(&object.key(path), piece.to_vec().into())?;
            self.note(path, object, false)?;
        }
        Ok(())
    }

    /// Notes what was stored, unless its folder was removed meanwhile: then it goes again. Gives what it replaces.
    fn note(&self, path: &str, object: Object, replaces: bool) -> io::Result<Vec<Object>> {
        let noted = self.index().add(path, object, replaces);
        noted.inspect_err(|_| {
            if let Err(error) = self.bucket.remove(&[object.key(path)]) {
                tracing::warn!(%error, path, "what came too late takes space in the bucket until the next start");
            }
        })
    }

    /// Writes a file of the bucket into an empty one of this machine, as it is at one moment.
    ///
    /// # Errors
    /// `NotFound` where it is not there.
    pub fn fetch(&self, path: &str, to: &File) -> io::Result<u64> {
        for _ in 0..FETCHES {
            let objects = self.index().objects(path).ok_or(io::ErrorKind::NotFound)?;
            to.set_len(0)?;
            let mut parts = objects.clone();
            let mut fetched = Ok(());
            for object in in_force(&mut parts) {
                fetched = self.bucket.get(&object.key(path), object.bytes, to, object.end() - object.bytes);
                if fetched.is_err() {
                    break;
                }
            }
            // What others have replaced or removed meanwhile is not what it was.
            if self.index().objects(path).as_ref() == Some(&objects) {
                return fetched.map(|()| names::length(&objects));
            }
        }
        let what = format!("{}: {path} changes faster than it can be fetched", self.bucket.name);
        Err(io::Error::other(BlobsError::lasting(what)))
    }

    /// Gives a file, or all in a folder, another name.
    pub fn rename(&self, from: &str, to: &str) -> io::Result<()> {
        let all = self.index().within(from);
        for (path, objects) in &all {
            let target = format!("{to}{}", &path[from.len()..]);
            for object in objects {
                self.bucket.copy(&object.key(path), &object.key(&target))?;
                self.note(&target, *object, false)?;
            }
        }
        self.remove(from)
    }

    /// Removes a file, or all in a folder. Nothing there is no error. After an error it is not there either, and may come back when the bucket is opened again.
    pub fn remove(&self, path: &str) -> io::Result<()> {
        self.remove_known(path, false)
    }

    /// As [`Self::remove`], for a folder in which nothing is stored again, whoever still tries.
    pub fn remove_for_good(&self, folder: &str) -> io::Result<()> {
        self.remove_known(folder, true)
    }

    fn remove_known(&self, path: &str, for_good: bool) -> io::Result<()> {
        let (is_file, gone) = {
            let mut index = self.index();
            if for_good {
                index.close(path);
            }
            (index.bytes(path).is_some(), index.remove(path))
        };
        let mut keys: Vec<String> =
            gone.iter().flat_map(|(path, objects)| objects.iter().map(|object| object.key(path))).collect();
        if !is_file {
            // What an earlier process has sent late is known to the bucket alone.
            keys.extend(self.bucket.list(path)?.into_iter().map(|(key, _)| key));
            keys.sort();
            keys.dedup();
        }
        if keys.is_empty() { Ok(()) } else { self.bucket.remove(&keys) }
    }

    /// Checks that the bucket can be written to.
    pub fn probe(&self) -> io::Result<()> {
        self.bucket.probe()
    }

    fn index(&self) -> MutexGuard<'_, Index> {
        self.index.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
